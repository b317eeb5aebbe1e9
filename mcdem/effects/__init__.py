"""Direct forces between primary particles.

One effect a file: its source, its table in a scene, its parameters in reduced units and its compiled law, stated as `EFFECT`
(`kinds`: pair forces add, of contact laws one is chosen, resistances add).  A new effect is a file here and a line in `MENU`;
or a module of any installed package, under the entry point `mcdem.effects`.  An effect that the scene does not name is absent,
and compiled code holds nothing of it (`sums`).
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from pydantic import create_model, model_validator

from mcdem.effects.attraction import Attraction
from mcdem.effects.kinds import Companions, ContactLaw, Effect, EffectTable, PairForce, Resistance
from mcdem.effects.sums import know, non_contact_force
from mcdem.errors import UserError
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension
from mcdem.quantities.toml_tables import Table

__all__ = [
    "EFFECTS",
    "Companions",
    "ContactLaw",
    "Effect",
    "EffectTable",
    "Effects",
    "Kernels",
    "PairForce",
    "Resistance",
    "non_contact_force",
]

MENU = (
    "van_der_waals",
    "double_layer",
    "born",
    "steric",
    "jkr",
    "dmt",
    "sliding",
    "rolling",
    "twisting",
    "rods",
)


def _found() -> dict[str, Effect]:
    """Every effect by the name of its table: those of this package, then those of others."""
    found = {name: import_module(f"mcdem.effects.{name}").EFFECT for name in MENU}
    for entry in entry_points(group="mcdem.effects"):
        where = f"effect {entry.name} of {entry.value}"
        if entry.name in found:
            raise UserError(f"{where}: there is one of this name already; rename the entry point")
        effect = entry.load()
        if not isinstance(effect, Effect):
            raise UserError(f"{where}: expected a PairForce, ContactLaw or Resistance, found {effect!r}")
        found[entry.name] = effect
    for effect in found.values():
        know(effect)
    return found


EFFECTS = _found()


class Kernels(NamedTuple):
    """Parameters of the effects that a scene calls for, for compiled code."""

    pair_forces: tuple[Any, ...]
    contact: Any
    """of the contact law, or None"""
    resistances: tuple[Any, ...]


class EffectsOfScene(Table):
    """Each effect that the scene calls for, with all its parameters; the others are absent.

    Examples
    --------
    >>> import mcdem
    >>> effects = mcdem.load_scene("scenes/paper-1000Pa.toml").effects
    >>> effects.double_layer is None, effects.van_der_waals.hamaker_constant
    (True, 9.7e-21)
    """

    def get(self, name: str) -> Any:
        """The table of an effect, None if the scene does not call for it."""
        return getattr(self, name, None)

    def present(self, kind: type | None = None) -> dict[str, Any]:
        """The tables of the effects that the scene calls for, of one kind or of all, by name."""
        return {
            name: table
            for name, table in self
            if table is not None and (kind is None or isinstance(EFFECTS[name], kind))
        }

    @property
    def contact(self) -> Any:
        """The table of the law of a contact, or None."""
        return next(iter(self.present(ContactLaw).values()), None)

    @property
    def contact_name(self) -> str:
        """The name of the law of a contact, or empty."""
        return next(iter(self.present(ContactLaw)), "")

    @property
    def contact_laws(self) -> list[str]:
        """The names of all laws of a contact that there are."""
        return [name for name, effect in EFFECTS.items() if isinstance(effect, ContactLaw)]

    @property
    def attraction(self) -> Any:
        """The table of the long-range attraction, or None."""
        return next((table for table in self.present().values() if isinstance(table, Attraction)), None)

    @property
    def attractions(self) -> list[str]:
        """The names of all long-range attractions that there are."""
        return [name for name, effect in EFFECTS.items() if issubclass(effect.table, Attraction)]

    @property
    def parted(self) -> bool:
        """Whether a short-range repulsion keeps spheres from contact."""
        return any(table.keeps_apart for table in self.present().values())

    @property
    def resisting(self) -> bool:
        """Whether contacts resist sliding, rolling or twisting, so that they have a history."""
        return bool(self.present(Resistance))

    @property
    def step_length(self) -> float | None:
        """Smallest length [m] that a step has to resolve close to contact; None if no effect has one."""
        lengths = [table.step_length for table in self.present().values()]
        return min((length for length in lengths if length is not None), default=None)

    @model_validator(mode="after")
    def _effects_go_together(self) -> Self:
        laws = list(self.present(ContactLaw))
        if len(laws) > 1:
            raise ValueError(
                f"{' and '.join(laws)} are {'two' if len(laws) == 2 else len(laws)} laws of the same contact: keep one "
                "(JKR for a large Tabor number)"
            )
        for table in self.present().values():
            table.refuse_company(self)
        return self

    def kernels(self, units: ReducedUnits, suspension: Suspension) -> Kernels:
        """The parameters of all effects in reduced units; raises `SceneError` where one does not hold for the suspension."""

        def of(kind: type) -> tuple[Any, ...]:
            return tuple(t.kernel(units, suspension, self) for t in self.present(kind).values())

        return Kernels(of(PairForce), next(iter(of(ContactLaw)), None), of(Resistance))


if TYPE_CHECKING:

    class Effects(EffectsOfScene):
        """Its fields are the tables of `EFFECTS`, which a type checker does not see: `get` gives them."""

else:
    Effects = create_model(
        "Effects",
        __base__=EffectsOfScene,
        __module__=__name__,
        __doc__=EffectsOfScene.__doc__,
        **{name: (effect.table | None, None) for name, effect in EFFECTS.items()},
    )


def __getattr__(name: str) -> Any:
    """The table of an effect by the name of its class: `from mcdem.effects import JKR`."""
    for effect in EFFECTS.values():
        if effect.table.__name__ == name:
            return effect.table
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
