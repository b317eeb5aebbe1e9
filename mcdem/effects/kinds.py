"""What an effect is: the contract of the three kinds.

    PairForce     forces between spheres not in contact; these add
    ContactLaw    the force of two spheres in contact; choose one, or none where repulsion keeps spheres apart
    Resistance    of contacts to sliding, rolling or twisting; these add

A file of this package, or a module of another installed one, states its effect as `EFFECT`, one of the three.  How the laws of
all are summed in compiled code: `sums`.

Forces are (F, dF/dh) along the line of centres, F > 0 repelling, as a function of the surface gap `h` and of the harmonic mean
`radius` 2 a1 a2/(a1 + a2) of the two spheres: 1 for two primaries of radius a.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from mcdem.compilation import interpreted
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension
from mcdem.quantities.toml_tables import Table


class Companions(Protocol):
    """The other effects of a scene, as an effect sees them."""

    @property
    def contact(self) -> Any:
        """The table of the contact law, or None."""

    @property
    def contact_name(self) -> str:
        """The name of the contact law, or empty."""

    @property
    def contact_laws(self) -> list[str]:
        """The names of all contact laws that there are."""

    @property
    def attractions(self) -> list[str]:
        """The names of all attractions that there are."""

    @property
    def attraction(self) -> Any:
        """The table of the long-range attraction, an `attraction.Attraction`, or None."""

    def get(self, name: str) -> Any:
        """The table of an effect, or None."""


class EffectTable(Table):
    """The keys of an effect in a scene."""

    below_radius: ClassVar[tuple[str, ...]] = ()
    """Lengths among its keys that have to be below the radius of the primaries."""
    instead_of_each_other: ClassVar[tuple[tuple[frozenset[str], ...], ...]] = ()
    """Groups of its keys of which one stands for the others."""

    @classmethod
    def offers(cls, tables: list[dict[str, Any]]) -> dict[str, str]:
        """What may stand for a key of this one that is missing, in words, from the effects `tables` of the scene."""
        return {}

    title: ClassVar[str] = ""
    """Its name in words, as a legend has it."""
    keeps_apart: ClassVar[bool] = False
    """Whether it is the wall that keeps spheres from contact, in place of a contact law."""

    def kernel(self, units: ReducedUnits, suspension: Suspension, effects: Companions) -> Any:
        """The parameters in reduced units; raises `SceneError` where the effect does not hold for this suspension."""
        raise NotImplementedError

    def refuse_company(self, effects: Companions) -> None:
        """Raise `ValueError`, with what to do, where the other effects of the scene do not go with this one."""

    @property
    def step_length(self) -> float | None:
        """Length [m] that a step has to resolve close to contact; None if the effect has no such one."""
        return None


@dataclass(frozen=True)
class PairForce:
    """A force between two spheres not in contact.

    table : its keys in a scene
    kernel : the NamedTuple of its parameters
    force : compiled, (h, radius, parameters) -> (F, dF/dh)
    """

    kind: ClassVar[str] = "pair_force"
    table: type[EffectTable]
    kernel: type
    force: Callable[..., Any]


@dataclass(frozen=True)
class ContactLaw:
    """The law of two spheres in contact.

    table, kernel : as of a `PairForce`; the table is an `elastic_contact.ElasticContact`
    force : compiled, (h, radius, parameters) -> (F, dF/dh), continuous beyond pull-off
    gap : compiled, (F, radius, parameters) -> the gap at which a contact bears F > -F_adh
    pull_off_gap : compiled, (radius, parameters) -> the gap beyond which a contact is lost
    pull_off_force : compiled, (radius, parameters) -> the largest tension that it bears
    equilibrium : compiled, (radius, parameters) -> (gap, stiffness) without load
    """

    kind: ClassVar[str] = "contact"
    table: type[EffectTable]
    kernel: type
    force: Callable[..., Any]
    gap: Callable[..., Any]
    pull_off_gap: Callable[..., Any]
    pull_off_force: Callable[..., Any]
    equilibrium: Callable[..., Any]

    def at_rest(self, radius: float, parameters: Any) -> tuple[float, float]:
        """`equilibrium` as Python runs it: for two numbers, numba need not be made ready."""
        gap, stiffness = interpreted(self.equilibrium)(radius, parameters)
        return float(gap), float(stiffness)


@dataclass(frozen=True)
class Resistance:
    """What a contact sets against sliding, rolling or twisting.

    table, kernel : as of a `PairForce`
    resist : compiled, (turned: Turned, parameters, response: Response) -> STUCK or the springs at their limits; adds to response
    limits : compiled, (radius, parameters, limits) writes its rows of limits (3, 2), see `sums.contact_limits`
    fixed_in_spheres : whether its springs turn about the line of centres with their spheres, not with the pair
    """

    kind: ClassVar[str] = "resistance"
    table: type[EffectTable]
    kernel: type
    resist: Callable[..., Any]
    limits: Callable[..., Any]
    fixed_in_spheres: bool = False


Effect = PairForce | ContactLaw | Resistance


def refuse_contact(name: str, effects: Companions) -> None:
    """Refuse, for the short-range repulsion `name`, a contact law beside it."""
    if effects.contact is not None:
        raise ValueError(
            f"{name} keeps spheres from the contact that {effects.contact_name} describes: keep one of them"
        )


def require_contact(name: str, effects: Companions) -> None:
    """Refuse, for the resistance `name`, a scene whose spheres make no contacts."""
    if effects.contact is None:
        raise ValueError(
            f"{name} is a resistance of contacts: add a contact law, {' or '.join(effects.contact_laws)}"
        )


class Turned(NamedTuple):
    """What the motion of a step does to a contact, see `tangential`; vectors (3,), springs (7,)."""

    carried: np.ndarray  # (7,) springs before, carried to the middle of the step
    q: np.ndarray  # (7,) turns of the step
    normal: np.ndarray  # (3,) in the middle of the step
    distance: float  # of the centres there
    share_1: float  # radius of sphere 1 over the sum of both
    radius: float  # harmonic mean
    normal_force: float  # F > 0 in compression


class Response(NamedTuple):
    """What a contact sets against it."""

    spring: np.ndarray  # (7,) at the end of the step
    loads: np.ndarray  # (7,)
    tangent: np.ndarray  # (7, 7)
