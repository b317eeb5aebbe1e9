"""Which two aggregates meet next, and when (choose one).

Each pair (i, j) meets at the rate f_ij = (4/3) g (R_i + R_j)^3 / Delta V (Frungieri & Vanni, Eq. 2), so the encounters
are competing Poisson processes; in other flows than simple shear, g is that of one in which they meet as often.
Both ways here sample exactly that law:

- `majorant_rejection`: proposals at a rate above all pairs', some rejected (Lewis & Shedler 1979); they do not depend on what the
  places hold, so that those ahead are known; the default.
- `inverse_transform`: inverse-transform sampling by the paper's own Eqs. 3-6 over the table of all pairs; the slow reference.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mcdem.monte_carlo.event_selection.contract import EventSelection, Meeting, Meetings
from mcdem.monte_carlo.event_selection.inverse_transform import InverseTransform
from mcdem.monte_carlo.event_selection.majorant_rejection import MajorantRejection

if TYPE_CHECKING:
    from mcdem.monte_carlo.population import SamplePopulation
    from mcdem.scene import Scene

__all__ = ["EventSelection", "Meeting", "Meetings", "event_selection"]

WAYS: dict[str, Any] = {"majorant_rejection": MajorantRejection, "inverse_transform": InverseTransform}


def event_selection(
    scene: Scene, population: SamplePopulation, seed: int, state: dict[str, Any] | None = None
) -> EventSelection:
    """The way that the scene's `numerics.event_selection` names, at the start or from a state."""
    chosen: EventSelection = WAYS[scene.numerics.event_selection](
        population, scene.flow.equivalent_shear_rate, seed, state
    )
    return chosen
