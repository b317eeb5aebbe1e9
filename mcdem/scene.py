"""The scene: what is simulated, read from a TOML file with units and checked once.

Everything downstream reads SI floats from a frozen `Scene`.  Effects that the file does not name are `None` and are
not simulated; every other table but `[suspension]` and `[flow]` may be left out and then has the defaults below.

"The paper" is Frungieri & Vanni (2021), Aggregation and breakup of colloidal particle aggregates in shear flow.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import tomlkit
import tomlkit.exceptions
from pydantic import Field, PrivateAttr, ValidationError, create_model, model_validator

from mcdem.effects import Effects, Kernels, Resistance
from mcdem.errors import SceneError
from mcdem.hydrodynamics import LEVELS
from mcdem.integrators import DEFAULT, SCHEMES
from mcdem.quantities.linear_flows import Flow
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension
from mcdem.quantities.toml_tables import Key, Table, choices, explain, keys, written
from mcdem.quantities.units import (
    NonNegativeDimensionless,
    PositiveDimensionless,
    PositiveTime,
)


class Hydrodynamics(Table):
    """How the particles feel each other through the fluid."""

    level: Literal[tuple(LEVELS)] = "stokesian"  # type: ignore[valid-type]
    """"free_draining": Stokes drag on each sphere by itself; "rotne_prager": far field of forces and torques;
    "fts": of forces, torques and stresslets; "stokesian": the same with pair lubrication, which alone has the keys below."""
    lubrication_cutoff: NonNegativeDimensionless = 5e-3
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

    scheme: Literal[tuple(SCHEMES)] = DEFAULT  # type: ignore[valid-type]
    """"implicit": midpoint steps, contacts solved at the end of the step; "explicit_euler": the paper's, with the time step of
    Eq. 20.  The keys of each are in a table of its name."""
    start_distance: Annotated[PositiveDimensionless, Field(ge=1.0)] = 5.0
    """Distance upstream at which the second aggregate starts, in units of R_i + R_j."""
    rotations: NonNegativeDimensionless = 8.0
    """Rotations N_rot that follow the approach (Eq. 21)."""
    far_approach: NonNegativeDimensionless = 2.0
    """Two rigid aggregates approach as bodies with a stresslet down to this centre distance over R_i + R_j; 0 for never,
    as at levels of hydrodynamics without stresslets."""
    sure_miss: NonNegativeDimensionless = 0.5
    """Two rigid aggregates that came together as bodies pass as bodies if no two of their primaries come closer than this gap,
    in radii, and nothing can break; 0 for never.  The gap is predicted to about 0.1."""
    separation: NonNegativeDimensionless = 1.5
    """Parts that recede from each other go on alone beyond this centre distance over R_i + R_j; 0 for never."""
    rigid_rotation: bool = True
    """An aggregate without floppy modes turns as a rigid body while its load stays below `rigid_load_limit`."""
    end_stable: bool = True
    """A rigid aggregate that is mechanically stable in every orientation is not followed further."""
    rigid_load_limit: Annotated[PositiveDimensionless, Field(le=1.0)] = 0.9
    """Largest tension over pull-off force, by statics, at which an aggregate is taken as rigid."""
    quiet_time: NonNegativeDimensionless = 1.0
    """Strain g t without a contact made or lost before an aggregate is taken as rigid."""
    longest_approach: PositiveDimensionless = 1000.0
    """Strain g t after which an approach is given up and recorded as unresolved: it diverges as y0 goes to 0 (Eq. 21)."""
    most_steps: Annotated[int, Field(gt=0)] = 20_000_000
    """Steps after which an encounter is given up and recorded as unresolved."""
    event_selection: Literal["majorant_rejection", "inverse_transform"] = "majorant_rejection"
    """"majorant_rejection": encounters are proposed at a rate above all pairs' and thinned (Lewis & Shedler 1979);
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
        """With a table of keys for each scheme of `SCHEMES`, which a type checker does not see."""

else:
    Numerics = create_model(
        "Numerics",
        __base__=NumericsOfScene,
        __module__=__name__,
        __doc__=NumericsOfScene.__doc__,
        **{name: (scheme.table, Field(default_factory=scheme.table)) for name, scheme in SCHEMES.items()},
    )


class Population(Table):
    """The sample of the suspension that is followed."""

    initial: Annotated[int, Field(ge=2)] = 200
    """Number of primary particles, all free, at the start."""
    doubling_below: Annotated[NonNegativeDimensionless, Field(lt=1.0)] = 0.75
    """The sample is doubled by exact copy when its aggregates become fewer than this fraction of `initial`; 0 for never."""
    restructuring: bool = True
    """Whether aggregates keep the shape that an encounter gave them which left them their primaries (missed or parted); false:
    they go on as they came, to see what restructuring does."""


class Run(Table):
    """When to stop, what to keep.  The command line may override it."""

    until: PositiveTime | None = None
    """Process time at which the run stops."""
    events: Annotated[int, Field(gt=0)] | None = None
    """Number of encounters after which the run stops."""
    seed: Annotated[int, Field(ge=0)] = 1
    """Seed of every random stream."""
    snapshot_every: PositiveTime = 1.0
    """Process time between two records of every aggregate's geometry."""


class Scene(Table):
    """All that a run depends on.  Two scenes are equal when their tables are, whatever their file's wording."""

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

    _text: str = PrivateAttr("")
    _path: Path | None = PrivateAttr(None)

    @classmethod
    def from_text(cls, text: str, path: Path | str | None = None) -> Self:
        """The scene that a TOML text describes; `path` is named by errors.

        Raises `SceneError`, one line a problem: file, table, key, value, what was expected.
        """
        source = str(path) if path is not None else "scene"
        try:
            tables = tomllib.loads(text)
        except tomllib.TOMLDecodeError as problem:
            raise SceneError(f"{source}: not valid TOML: {problem}") from None
        try:
            scene = cls.model_validate(tables)
        except ValidationError as problem:
            raise SceneError(explain(problem, cls, source)) from None
        scene._text = text
        scene._path = Path(path) if path is not None else None
        try:
            _ = scene.kernels
        except SceneError as problem:  # an effect does not hold for this suspension
            raise SceneError(f"{source}: {problem}") from None
        return scene

    def with_changes(self, changes: Mapping[str, Any]) -> Self:
        """The scene with other values at dotted keys: `{"flow.shear_stress": "750 Pa", "effects.jkr": None}`.

        Values are written as in the file, `None` removes a key or a table.  Of shear rate, viscosity and shear
        stress two stay: a new stress replaces the viscosity, a new shear rate or viscosity the stress.
        Comments of the text are kept.  Raises `SceneError` as `from_text` does.
        """
        document = tomlkit.parse(self.text)
        for dotted, value in changes.items():
            *tables, key = dotted.split(".")
            table: Any = document
            for name in tables:
                table = table.setdefault(name, tomlkit.table())
                if not isinstance(table, dict):
                    raise SceneError(f'{self.name}: cannot set "{dotted}": "{name}" is a key, not a table')
            if value is None:
                table.pop(key, None)
                continue
            if tables == ["flow"]:
                _make_room(table, key)
            table[key] = value.item() if hasattr(value, "item") else value
        return type(self).from_text(tomlkit.dumps(document), self.path)

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


def _make_room(flow: Any, key: str) -> None:
    """Remove the one of the three flow quantities that a new value of `key` replaces."""
    gives_way = {
        "shear_stress": ("viscosity", "shear_rate"),
        "viscosity": ("shear_stress", "shear_rate"),
        "shear_rate": ("shear_stress", "viscosity"),
    }
    if key not in gives_way or key in flow:
        return
    for other in gives_way[key]:
        if len(flow.keys() & gives_way.keys()) >= 2:
            flow.pop(other, None)


def load_scene(path: Path | str) -> Scene:
    """Read and check a scene file; raises `SceneError` naming file, table, key, value and cure."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as problem:
        raise SceneError(f"{path}: cannot be read: {problem.strerror}") from None
    except UnicodeDecodeError as problem:
        raise SceneError(f"{path}: cannot be read: byte {problem.start} is not UTF-8 text") from None
    return Scene.from_text(text, path)


def describe() -> list[Key]:
    """Every key a scene file may have, with what is expected, its default and its meaning."""
    return keys(Scene)
