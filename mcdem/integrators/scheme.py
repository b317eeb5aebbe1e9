"""What an integrator is: the contract, and the compiled function that takes a step of the scheme that is chosen.

A file of this package states its scheme as `SCHEME`.  Compiled code holds the options of the scheme that a scene chooses; its
step is looked up by their type when the code is compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from numba.extending import overload

from mcdem.quantities.toml_tables import Table


class Scales(NamedTuple):
    """What the options of a scheme are measured by."""

    roughness: float  # length over a that a step has to resolve close to contact
    shear_rate: float  # [1/s]


@dataclass(frozen=True)
class Scheme:
    """How an encounter is followed in time.

    table : its keys, [numerics.NAME] in a scene
    options : NamedTuple of its numbers in reduced units;  build : (table, Scales) -> options
    workspace : (number of primaries, whether contacts resist) -> NamedTuple of work arrays, one of them `labels` (N,)
    step_key : which of its keys is the time step, to which everything else that limits a step is in proportion
    step_in_strain : whether that key is in units of 1/g, not in seconds
    advance : compiled, (group, flow, physics, options, log, end) takes one accepted step; DONE or an error code
    shortcuts : whether what cannot change the outcome may be skipped (`encounter.motion`); a reference takes none
    torques : whether it follows the torques of contacts;  stretching : whether it follows flows other than simple shear
    """

    table: type[Table]
    options: type
    build: Callable[[Any, Scales], Any]
    workspace: Callable[[int, bool], Any]
    step_key: str
    advance: Callable[..., Any]
    shortcuts: bool
    torques: bool
    stretching: bool
    step_in_strain: bool = True


_SCHEME_OF: dict[type, Scheme] = {}


def know(scheme: Scheme) -> None:
    """Let compiled code find the step of a scheme by the type of its options."""
    _SCHEME_OF[scheme.options] = scheme


def scheme_of(options: Any) -> Scheme:
    """The scheme whose options these are."""
    return _SCHEME_OF[type(options)]


def advance(group, flow, physics, options, log, end):
    """One accepted step of a group of primaries, by the scheme whose options are given; in compiled code only."""
    raise NotImplementedError("compiled code only")


@overload(advance, inline="always")
def _(group, flow, physics, options, log, end):
    own = _SCHEME_OF[options.instance_class].advance
    return lambda group, flow, physics, options, log, end: own(group, flow, physics, options, log, end)
