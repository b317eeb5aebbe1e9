"""The scene: what is simulated, read from a TOML file with units and checked once.

Everything downstream reads SI floats from a frozen `Scene`.  Effects that the file does not name are `None` and are
not simulated; every other table but `[suspension]` and `[flow]` may be left out and then has the defaults below.

"The paper" is Frungieri & Vanni (2021), Aggregation and breakup of colloidal particle aggregates in shear flow.
"""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import tomlkit
import tomlkit.exceptions
from pydantic import Field, PrivateAttr, ValidationError, create_model, model_validator
from pydantic_core import PydanticCustomError

from mcdem.effects import EFFECTS, Effects, Kernels, Resistance
from mcdem.errors import SceneError
from mcdem.hydrodynamics import LEVELS
from mcdem.integrators import DEFAULT, SCHEMES
from mcdem.quantities import renamed_keys
from mcdem.quantities.linear_flows import Flow
from mcdem.quantities.random_streams import LARGEST_SEED
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension
from mcdem.quantities.toml_tables import Key, Table, choices, explain, keys, quantity_at, written
from mcdem.quantities.units import DIMENSIONLESS, IN_A_FILE, TIME, shown

LARGEST_FILE = 2**16
"""Bytes of a scene file; the longest of those that come with mcdem has 3000."""
LONGEST_LINE = 2000
"""Characters of a line of it: the time to read a key of many dots grows with the square of their number."""

_PERIOD = TIME.positive.between("1e-15 s", "1e15 s")


class Hydrodynamics(Table):
    """Hydrodynamic interaction between the particles.

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> scene.hydrodynamics.level, scene.hydrodynamics.lubrication_cutoff
    ('stokesian', 0.005)
    >>> scene.with_changes({"hydrodynamics.lubrication_cutoff": 1e-2}).hydrodynamics.lubrication_cutoff
    0.01
    """

    level: Literal[tuple(LEVELS)] = "stokesian"  # type: ignore[valid-type]  # known at run time
    """"free_draining": Stokes drag on each sphere by itself; "rotne_prager": far field of forces and torques;
    "fts": of forces, torques and stresslets; "stokesian": the same with pair lubrication, which alone has the keys below."""
    lubrication_cutoff: Annotated[float, DIMENSIONLESS.non_negative.between("0", "10", "5e-3")] = 5e-3
    """Gap over radius, delta, below which lubrication keeps its value there; 0 for no cut-off (paper, section 2.2.1)."""
    cutoff_convention: Literal["matrix", "gap"] = "matrix"
    """Below the cut-off, "matrix": the two-body resistance is frozen, as the paper says; "gap": the strain sees the frozen gap
    too, so that a touching pair is not squeezed by it; needed where delta is not large against the overlap of contacts."""

    @model_validator(mode="after")
    def _keys_of_lubrication_need_it(self) -> Self:
        stray = sorted(self.model_fields_set & {"lubrication_cutoff", "cutoff_convention"})
        if stray and not self.lubrication:
            raise ValueError(
                f'level = "{self.level}" is without lubrication, so that {" and ".join(stray)} would do nothing: '
                f"remove it, or use level = {choices(LEVELS, 'lubrication')}"
            )
        return self

    @property
    def stresslets(self) -> bool:
        """Whether the far field has stresslets."""
        return LEVELS[self.level].stresslet_couplings

    @property
    def lubrication(self) -> bool:
        """Whether pairs have lubrication."""
        return LEVELS[self.level].lubrication


class NumericsOfScene(Table):
    """How an encounter is integrated and how events are drawn."""

    scheme: Literal[tuple(SCHEMES)] = DEFAULT  # type: ignore[valid-type]  # known at run time
    """"implicit": midpoint steps, contacts solved at the end of the step; "explicit_euler": the paper's, with the time step of
    Eq. 20.  The keys of each are in a table of its name."""
    start_distance: Annotated[float, DIMENSIONLESS.positive.between("1", "1e4", "5")] = 5.0
    """Distance upstream at which the second aggregate starts, in units of R_i + R_j."""
    rotations: Annotated[float, DIMENSIONLESS.non_negative.between("0", "1e6", "8")] = 8.0
    """Rotations N_rot that follow the approach (Eq. 21)."""
    far_approach: Annotated[float, DIMENSIONLESS.non_negative.between("0", "1e4", "2.5")] = 2.5
    """Two rigid aggregates approach as bodies with a stresslet down to this centre distance over R_i + R_j; 0 for never,
    as at levels of hydrodynamics without stresslets."""
    sure_miss: Annotated[float, DIMENSIONLESS.non_negative.between("0", "1e4")] = 0.5
    """Two rigid aggregates that came together as bodies pass as bodies while no two of their primaries are closer than this gap,
    in radii, and nothing can break; 0 for never.  By their stresslets the gap is predicted to about 0.1; where that does not
    decide, with the hydrodynamics of all their primaries."""
    separation: Annotated[float, DIMENSIONLESS.non_negative.between("0", "1e4", "1.5")] = 1.5
    """Parts go on alone beyond this centre distance over R_i + R_j once they surely do not come back to each other: beyond the
    closed orbits, and on a path that the other would move by less than a hundredth of a radius; 0 for never."""
    rigid_rotation: bool = True
    """An aggregate without floppy modes turns as a rigid body while its load stays below `rigid_load_limit`."""
    end_stable: bool = True
    """A rigid aggregate that is mechanically stable in every orientation is not followed further."""
    rigid_load_limit: Annotated[float, DIMENSIONLESS.positive.between("1e-6", "1", "0.9")] = 0.9
    """Largest tension over pull-off force, by statics, at which an aggregate is taken as rigid."""
    quiet_time: Annotated[float, DIMENSIONLESS.non_negative.between("0", "1e9", "1")] = 1.0
    """Strain g t without a contact made or lost before an aggregate is taken as rigid."""
    longest_approach: Annotated[float, DIMENSIONLESS.positive.between("1e-3", "1e9", "1000")] = 1000.0
    """Strain g t after which an approach is given up and recorded as unresolved: Eq. 21 diverges as y0 goes to 0.  Two primaries
    draw each other in within 400, whatever y0 (closed orbits); aggregates may not."""
    most_steps: Annotated[int, Field(ge=1, le=10**15)] = 20_000_000
    """Steps after which an encounter is given up and recorded as unresolved."""
    event_selection: Literal["majorant_rejection", "inverse_transform"] = "majorant_rejection"
    """"majorant_rejection": encounters are proposed at a rate above all pairs', some rejected (Lewis & Shedler 1979);
    "inverse_transform": the paper's Eqs. 4-6.  Equal in distribution."""

    def of(self, scheme: str) -> Any:
        """The table of keys of a scheme."""
        return getattr(self, scheme)

    @property
    def own(self) -> Any:
        """The table of keys of the scheme that is chosen."""
        return self.of(self.scheme)

    @property
    def step(self) -> float:
        """Time step of the scheme: in units of 1/g, or in seconds, as its key has it."""
        return float(getattr(self.own, SCHEMES[self.scheme].step_key))

    @property
    def step_unit(self) -> str:
        """What follows the number of `step`."""
        return "/g" if SCHEMES[self.scheme].step_in_strain else " s"

    def with_step(self, step: float) -> Self:
        """The same with another time step of the scheme, unchecked."""
        keys = self.own.model_copy(update={SCHEMES[self.scheme].step_key: step})
        return self.model_copy(update={self.scheme: keys})


if TYPE_CHECKING:

    class Numerics(NumericsOfScene):
        """With a table of keys for each scheme of `SCHEMES`, which a type checker does not see.

        Examples
        --------
        >>> import mcdem
        >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
        >>> scene.numerics.scheme, scene.numerics.rotations
        ('implicit', 8.0)
        """

else:
    Numerics = create_model(
        "Numerics",
        __base__=NumericsOfScene,
        __module__=__name__,
        __doc__=NumericsOfScene.__doc__,
        **{name: (scheme.table, Field(default_factory=scheme.table)) for name, scheme in SCHEMES.items()},
    )


class Population(Table):
    """The sample of the suspension that is followed.

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> scene.with_changes({"population.initial": 1000}).population.initial
    1000
    """

    initial: Annotated[int, Field(ge=2, le=10**6)] = 200
    """Number of primary particles, all free, at the start."""
    doubling_below: Annotated[float, DIMENSIONLESS.non_negative.between("0", "1", "0.75"), Field(lt=1.0)] = (
        0.75
    )
    """The sample is doubled by exact copy when its aggregates become fewer than this fraction of `initial`; 0 for never."""
    restructuring: bool = True
    """Whether aggregates keep the shape that an encounter gave them which left them their primaries (missed or parted); false:
    they go on as they came, to see what restructuring does."""


class Run(Table):
    """When to stop, what to keep.  The command line may override it.

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> scene.with_changes({"run.until": "30 s", "run.seed": 2}).run.until
    30.0
    """

    until: Annotated[float, _PERIOD] | None = None
    """Process time at which the run stops."""
    events: Annotated[int, Field(ge=1, le=10**12)] | None = None
    """Number of encounters after which the run stops."""
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)] = 1
    """Seed of every random stream."""
    snapshot_every: Annotated[float, _PERIOD] = 1.0
    """Process time between two records of every aggregate's geometry."""


class Scene(Table):
    """All that a run depends on.  Two scenes are equal when their tables are, whatever their file's wording.

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")

    The same suspension at half the stress, by a thinner medium:

    >>> thinner = scene.with_changes({"flow.shear_stress": "500 Pa", "flow.shear_rate": "1e4 1/s"})
    >>> thinner.flow.viscosity
    0.05
    """

    suspension: Suspension
    flow: Flow
    effects: Effects = Field(default_factory=Effects)
    hydrodynamics: Hydrodynamics = Field(default_factory=Hydrodynamics)
    numerics: Numerics = Field(default_factory=Numerics)
    population: Population = Field(default_factory=Population)
    run: Run = Field(default_factory=Run)

    @model_validator(mode="after")
    def _shortcuts_and_scheme_suit_the_flow(self) -> Self:
        if self.flow.kind == "simple_shear":
            return self
        if not SCHEMES[self.numerics.scheme].stretching:
            raise ValueError(
                f'numerics.scheme = "{self.numerics.scheme}" is one for simple shear: use {choices(SCHEMES, "stretching")} '
                f'with flow.kind = "{self.flow.kind}"'
            )
        if self.numerics.separation == 0.0:
            raise ValueError(
                f"numerics.separation = 0 follows parts that recede together, and in {self.flow.kind} they recede "
                "exponentially: give a positive one"
            )
        return self

    @model_validator(mode="after")
    def _scheme_follows_torques(self) -> Self:
        if self.effects.resisting and not SCHEMES[self.numerics.scheme].torques:
            raise ValueError(
                f'numerics.scheme = "{self.numerics.scheme}" follows no torques of contacts: use {choices(SCHEMES, "torques")}, '
                f"or remove {' and '.join(self.effects.present(Resistance))} from [effects]"
            )
        return self

    @model_validator(mode="after")
    def _effects_hold_in_this_suspension(self) -> Self:
        smallest = min(self.suspension.species)
        for name, effect in self.effects.present().items():
            for key in effect.below_radius:
                if getattr(effect, key) >= smallest:
                    raise ValueError(
                        f"[effects.{name}] {key} = {getattr(effect, key):g} m; expected a length below the radius of "
                        f"the primaries, {smallest:g} m"
                    )
        try:
            self.effects.kernels(self.reduced, self.suspension)
        except SceneError as problem:
            raise ValueError(str(problem)) from None
        return self

    _text: str = PrivateAttr("")
    _path: Path | None = PrivateAttr(None)

    @classmethod
    def from_text(cls, text: str, path: Path | str | None = None) -> Self:
        """The scene that a TOML text describes; `path` is named by errors.

        Raises `SceneError`, one line a problem: file, table, key, value, what was expected.
        """
        source = str(path) if path is not None else "scene"
        tables = _tables(text, source)
        try:
            if old := list(renamed_keys.old_words(tables)):
                raise SceneError("\n".join(f"{source}: {line}" for line in old))
            scene = cls.model_validate(tables, context=IN_A_FILE)
        except ValidationError as problem:
            raise SceneError(explain(problem, cls, source, _offers(tables))) from None
        scene._text = text
        scene._path = Path(path) if path is not None else None
        return scene

    @classmethod
    def from_dataset(cls, text: str, path: Path | str | None = None) -> Self:
        """The scene that a dataset holds, whose keys may have earlier names."""
        return cls.from_text(renamed_keys.renewed(text), path)

    def with_changes(self, changes: Mapping[str, Any], *, as_in_file: bool = False) -> Self:
        """The scene with other values at dotted keys: `{"flow.shear_stress": "750 Pa", "effects.jkr": None}`.

        Parameters
        ----------
        changes : dotted key -> text with a unit, a number in SI units or a quantity of pint; a table as a dictionary; `None`
            removes a key or a table.  All are made together: their order means nothing.
        as_in_file : refuse bare numbers where a unit is needed, as in a file

        Of shear rate, viscosity and shear stress two stay: those that are changed and, where it is one, the shear rate beside a
        new stress or viscosity, the viscosity beside a new shear rate (`gives_way` says which key goes).  Of other keys that
        stand for each other (radius and radii, debye_length and salt_concentration ...) the changed ones replace the rest.
        Comments of the text are kept.  Raises `SceneError` as `from_text` does.
        """
        document = tomlkit.parse(self.text)
        given = {tuple(dotted.split(".")): (dotted, value) for dotted, value in changes.items()}
        for path, (dotted, _) in given.items():
            if any(path[:k] in given for k in range(1, len(path))):
                raise SceneError(
                    f'{self.name}: cannot set "{dotted}" and the table it is in: put it into the table\'s own keys'
                )
        for path in self.gives_way(changes):
            table, key = _table_at(document, path, self.name)
            table.pop(key, None)
        for path, (_, value) in given.items():
            table, key = _table_at(document, path, self.name)
            if value is None:
                table.pop(key, None)
            else:
                table[key] = _as_written(type(self), path, value, as_in_file)
        return type(self).from_text(tomlkit.dumps(document), self.path)

    def gives_way(self, changes: Mapping[str, Any]) -> list[tuple[str, ...]]:
        """Keys of the text, as paths, that changes at dotted keys replace without naming them."""
        tables = tomllib.loads(self.text)
        named = {tuple(dotted.split(".")) for dotted, value in changes.items() if value is not None}
        removed = {tuple(dotted.split(".")) for dotted, value in changes.items() if value is None}
        flow = tables.get("flow", {})
        there = {key for key in _GIVES_WAY if key in flow and ("flow", key) not in removed}
        new = [key for key in _GIVES_WAY if ("flow", key) in named]
        found: list[tuple[str, ...]] = []
        if len(new) == 1 and new[0] not in there:
            excess = len(there) - 1
            found += [("flow", other) for other in _GIVES_WAY[new[0]] if other in there][:excess]
        elif len(new) == 2:
            found += [("flow", other) for other in there - set(new)]
        for place, groups in _INSTEAD:
            table: Any = tables
            for name in place:
                table = table.get(name, {}) if isinstance(table, dict) else {}
            for group in groups:
                if any((*place, key) in named for key in group):
                    others = {key for other in groups if other is not group for key in other}
                    found += [
                        (*place, key) for key in sorted(others & set(table)) if (*place, key) not in named
                    ]
        return found

    def value_at(self, dotted: str) -> str:
        """What the scene's text says at a dotted key, on one line; empty where it says nothing."""
        value: Any = tomllib.loads(self.text)
        for name in dotted.split("."):
            if not isinstance(value, dict) or name not in value:
                return ""
            value = value[name]
        if isinstance(value, bool):
            return str(value).lower()
        return str(value)

    @property
    def text(self) -> str:
        """The TOML text that the scene was read from; of a scene made otherwise, one that reads as it."""
        return self._text or tomlkit.dumps(written(self))

    @property
    def path(self) -> Path | None:
        """The file, if it came from one."""
        return self._path

    @property
    def name(self) -> str:
        """The file's name without its ending."""
        return self._path.stem if self._path else "scene"

    @property
    def question(self) -> str:
        """The question that the scene asks: the comment in its first line."""
        first = self.text.lstrip().partition("\n")[0]
        return first.lstrip("# ").rstrip() if first.startswith("#") else ""

    @property
    def reduced(self) -> ReducedUnits:
        """The units of the compiled code."""
        radius, rate = self.suspension.radius, self.flow.shear_rate
        return ReducedUnits(radius, 1.0 / rate, 6.0 * math.pi * self.flow.viscosity * radius**2 * rate)

    @property
    def kernels(self) -> Kernels:
        """The parameters of the effects in reduced units, as compiled code takes them (`effects.sums`)."""
        return self.effects.kernels(self.reduced, self.suspension)

    @property
    def reduced_radii(self) -> tuple[float, ...]:
        """The radii of the primaries in units of the largest."""
        return tuple(radius / self.suspension.radius for radius in self.suspension.species)

    def require_one_radius(self, what: str) -> None:
        """Refuse, for what holds for primaries of one radius only; raises `SceneError`."""
        if self.suspension.radii is not None:
            raise SceneError(
                f"{self.path or self.name}: [suspension] radii names {len(self.suspension.radii)} sizes, expected one: {what}"
            )

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy, unchecked where updated, that forgets the text it was read from."""
        copy = super().model_copy(update=update, deep=deep)
        if update:
            copy._text = ""
        return copy

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash(tuple(self.__dict__.values()))


_GIVES_WAY = {
    "shear_stress": ("viscosity", "shear_rate"),
    "viscosity": ("shear_stress", "shear_rate"),
    "shear_rate": ("shear_stress", "viscosity"),
}
"""Of the three flow quantities: which of the other two a new value replaces, the first that is there."""

_INSTEAD: tuple[tuple[tuple[str, ...], tuple[frozenset[str], ...]], ...] = (
    (("suspension",), (frozenset({"radius"}), frozenset({"radii", "number_fractions"}))),
    *(
        (("effects", name), groups)
        for name, effect in EFFECTS.items()
        for groups in effect.table.instead_of_each_other
    ),
)
"""Tables, and the groups of their keys of which one stands for the others."""


def _table_at(document: Any, path: tuple[str, ...], name: str) -> tuple[Any, str]:
    """The table of a document that holds the last key of a path, made where it is not there, and that key."""
    *tables, key = path
    table = document
    for part in tables:
        table = table.setdefault(part, tomlkit.table())
        if not isinstance(table, dict):
            raise SceneError(f'{name}: cannot set "{".".join(path)}": "{part}" is a key, not a table')
    return table, key


def _as_written(model: type[Table], path: tuple[str, ...], value: Any, as_in_file: bool) -> Any:
    """A value given in Python as a scene file would hold it: numbers with the SI unit of their key."""
    if isinstance(value, Mapping):
        return {name: _as_written(model, (*path, name), inner, as_in_file) for name, inner in value.items()}
    if hasattr(value, "m_as"):  # a quantity of pint: its digits in SI units
        quantity = quantity_at(model, path)
        try:
            number = float(value.to_base_units().magnitude) if quantity is None else quantity.to_si(value)
        except (PydanticCustomError, TypeError, ValueError):
            return f"{value:~}"  # which the reader refuses, with what it expects
        return f"{number!r} {quantity.si}".rstrip() if quantity is not None and quantity.si else number
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, list | tuple):
        return [_as_written(model, path, one, as_in_file) for one in value]
    if isinstance(value, int | float) and not isinstance(value, bool) and not as_in_file:
        quantity = quantity_at(model, path)
        if quantity is not None and quantity.si:
            return f"{value!r} {quantity.si}"
    if not isinstance(value, str | int | float | bool):
        raise SceneError(
            f"{'.'.join(path)} = {shown(value)}: expected text with a unit, a number, a quantity of pint, true or false, a list "
            "or a table of these"
        )
    return value


def _tables(text: str, source: str) -> dict[str, Any]:
    """The tables of a scene's text; raises `SceneError` in a line for what is no TOML, or too much of it."""
    text = text.removeprefix("\ufeff")
    if len(text) > LARGEST_FILE:
        raise SceneError(
            f"{source}: has {len(text)} characters, expected at most {LARGEST_FILE}: is it a scene file?"
        )
    for number, line in enumerate(text.split("\n"), start=1):
        if len(line) > LONGEST_LINE:
            raise SceneError(
                f"{source}: line {number} has {len(line)} characters, expected at most {LONGEST_LINE}: is it a scene file?"
            )
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise SceneError(f"{source}: lists or tables nested too deep, expected at most four levels") from None
    except tomllib.TOMLDecodeError as problem:
        raise SceneError(f"{source}: not valid TOML: {shown(str(problem), 200)[1:-1]}") from None
    except ValueError:  # a whole number of thousands of digits, a day that no month has
        raise SceneError(f"{source}: not valid TOML: a number or a date that cannot be read") from None


def _offers(tables: dict[str, Any]) -> dict[tuple[str, str], str]:
    """What may stand for a key that is missing: (table, key) -> words."""
    effects = tables.get("effects")
    given = (
        [table for table in effects.values() if isinstance(table, dict)] if isinstance(effects, dict) else []
    )
    return {
        (f"effects.{name}", key): words
        for name, effect in EFFECTS.items()
        for key, words in effect.table.offers(given).items()
    }


def load_scene(path: Path | str) -> Scene:
    """Read and check a scene file.

    Parameters
    ----------
    path : str or Path
        TOML file; its keys are those of `mcdem describe`.

    Returns
    -------
    Scene
        All values in SI units.

    Raises
    ------
    SceneError
        Where the file, a table, a key or a value cannot be used; it names them, what was expected and what to do.

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> scene.flow.shear_stress, scene.suspension.radius
    (1000.0, 5e-07)
    """
    if not isinstance(path, str | os.PathLike):
        raise SceneError(f"{shown(path)}: expected the name of a scene file")
    try:
        with Path(path).open("rb") as file:
            data = file.read(4 * LARGEST_FILE + 1)
        text = data.decode("utf-8-sig").replace("\r\n", "\n")
    except OSError as problem:
        raise SceneError(f"{shown(str(path), 200)[1:-1]}: cannot be read: {problem.strerror}") from None
    except UnicodeDecodeError as problem:
        raise SceneError(f"{path}: cannot be read: byte {problem.start} is not UTF-8 text") from None
    except ValueError:
        raise SceneError(f"{shown(str(path))}: is not the name of a file") from None
    return Scene.from_text(text, path)


def describe() -> list[Key]:
    """Every key a scene file may have, with what is expected, its default and its meaning."""
    return keys(Scene)
