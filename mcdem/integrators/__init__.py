"""How an encounter is followed in time; choose one scheme.

    implicit_midpoint    contacts solved at the end of long steps (`step_control`, `newton`, `contact_torques`)
    explicit_euler       the paper's, the reference: nothing predicted, frozen or skipped
    time_loop            the steps of one group of primaries, until something calls for a decision
    state, pairs, bodies, rotations    what all of them handle

A new scheme is a file and a line in `MENU` (`scheme`).
"""

from __future__ import annotations

from importlib import import_module

from mcdem.integrators.scheme import Scheme, know

__all__ = ["DEFAULT", "SCHEMES", "Scheme"]

MENU = {"implicit": "implicit_midpoint", "explicit_euler": "explicit_euler"}

DEFAULT = "implicit"
"""The scheme of a scene that names none."""

SCHEMES: dict[str, Scheme] = {
    name: import_module(f"mcdem.integrators.{module}").SCHEME for name, module in MENU.items()
}
for _scheme in SCHEMES.values():
    know(_scheme)
