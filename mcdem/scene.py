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
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
import tomlkit
import tomlkit.exceptions
from pydantic import Field, PrivateAttr, ValidationError, model_validator

from mcdem.effects import Effects
from mcdem.errors import SceneError
from mcdem.quantities.linear_flows import inflow_constant, turns_back
from mcdem.quantities.toml_tables import Key, Table, explain, keys, written
from mcdem.quantities.units import (
    Dimensionless,
    NonNegativeDimensionless,
    PositiveDimensionless,
    PositiveLength,
    PositiveRate,
    PositiveStress,
    PositiveTime,
    PositiveViscosity,
)

# Marks the key of a table that follows from the other keys, until they are read.
FROM_THE_OTHERS = math.nan

SMALLEST_RATIO = 0.1
"""Smallest over largest radius of a suspension."""


class Suspension(Table):
    """The primary particles and how many of them there are."""

    radius: PositiveLength = FROM_THE_OTHERS
    """Radius a of the primary particles; where `radii` are given instead, the largest of them."""
    radii: Annotated[tuple[PositiveLength, ...], Field(strict=False)] | None = None
    """Radii of the primaries of a suspension of several, instead of `radius`; what is given over a is over the largest."""
    number_fractions: Annotated[tuple[PositiveDimensionless, ...], Field(strict=False)] | None = None
    """Share in number of the primaries of each of the `radii`; they add up to 1."""
    volume_fraction: Annotated[PositiveDimensionless, Field(lt=0.74)]
    """Volume of the primary particles over that of the suspension; encounters are binary, so it should be small."""

    @property
    def species(self) -> tuple[float, ...]:
        """Radii [m] that the primaries have."""
        return (self.radius,) if self.radii is None else self.radii

    @model_validator(mode="after")
    def _one_radius_or_several(self) -> Self:
        given = self.model_fields_set & {"radius", "radii"}
        if len(given) != 1:
            raise ValueError(
                'give radius, such as "500 nm", or radii and their number_fractions '
                f"(found {' and '.join(sorted(given)) or 'neither'})"
            )
        if self.radii is None:
            if self.number_fractions is not None:
                raise ValueError(
                    "number_fractions belong to radii: remove them, or give radii instead of radius"
                )
            return self
        if self.number_fractions is None:
            raise ValueError("radii need number_fractions, one for each, such as [0.5, 0.5]")
        if len(self.radii) < 2 or len(set(self.radii)) < len(self.radii):
            raise ValueError("radii: expected two or more, all different; a suspension of one has a radius")
        if len(self.number_fractions) != len(self.radii):
            raise ValueError(
                f"number_fractions: expected {len(self.radii)}, one for each of radii, found {len(self.number_fractions)}"
            )
        if abs(math.fsum(self.number_fractions) - 1.0) > 1e-9:
            raise ValueError(
                f"number_fractions add up to {math.fsum(self.number_fractions):.10g}, expected 1"
            )
        if min(self.radii) < SMALLEST_RATIO * max(self.radii):
            raise ValueError(
                f"radii from {min(self.radii):g} to {max(self.radii):g} m: expected ratios of at least {SMALLEST_RATIO:g}, "
                "to which the two-sphere functions are summed"
            )
        self.__dict__["radius"] = max(self.radii)
        return self


class Flow(Table):
    """The undisturbed flow: simple shear u = (0, 0, g y), with gradient along y and vorticity along x, or another linear flow.

    The file gives exactly two of `shear_rate`, `viscosity` and `shear_stress`; the third follows.
    """

    kind: Literal[
        "simple_shear", "planar", "planar_extension", "uniaxial_extension", "biaxial_extension", "linear"
    ] = "simple_shear"
    """"simple_shear": u = g (0, 0, y); "planar": u = g (0, alpha z, y); "planar_extension": the same with alpha = 1;
    "uniaxial_extension": u = g (-x/2, -y/2, z), stretching along z; "biaxial_extension": the reverse;
    "linear": any other, by its `gradient`."""
    alpha: Annotated[PositiveDimensionless, Field(le=1.0)] | None = None
    """Share of extension in a planar flow, between simple shear (0) and planar extension (1); its kind alone has it."""
    gradient: (
        Annotated[tuple[Annotated[tuple[Dimensionless, ...], Field(strict=False)], ...], Field(strict=False)]
        | None
    ) = None
    """Rows of the velocity gradient over g of a linear flow, u = g G r: three of three numbers, of trace 0; such as
    [[-0.7, 0, 0], [0, -0.3, 0], [0, 0, 1]], between planar and uniaxial extension."""
    shear_rate: PositiveRate = FROM_THE_OTHERS
    """Rate g of the flow: the shear rate, or in extension the rate of stretching."""
    viscosity: PositiveViscosity = FROM_THE_OTHERS
    """Viscosity mu of the medium."""
    shear_stress: PositiveStress = FROM_THE_OTHERS
    """Shear stress mu g of the undisturbed flow."""

    @property
    def extension_share(self) -> float:
        """alpha of a planar flow."""
        if self.alpha is not None:
            return self.alpha
        return 1.0 if self.kind == "planar_extension" else 0.0

    @property
    def equivalent_shear_rate(self) -> float:
        """Shear rate [1/s] of the simple shear in which aggregates meet as often."""
        return self.shear_rate * (0.75 * inflow_constant(self))

    @model_validator(mode="after")
    def _alpha_is_of_planar_flows(self) -> Self:
        if self.kind == "planar" and self.alpha is None:
            raise ValueError('kind = "planar" needs alpha, its share of extension: above 0 and up to 1')
        if self.kind != "planar" and self.alpha is not None:
            raise ValueError(f'kind = "{self.kind}" has no alpha: remove it, or use kind = "planar"')
        return self

    @model_validator(mode="after")
    def _gradient_is_of_linear_flows(self) -> Self:
        if (self.kind == "linear") != (self.gradient is not None):
            raise ValueError(
                'kind = "linear" and gradient go together: give both, or another kind and no gradient'
            )
        if self.gradient is None:
            return self
        if [len(row) for row in self.gradient] != [3, 3, 3]:
            raise ValueError("gradient: expected three rows of three numbers")
        G = np.array(self.gradient)
        size = float(np.abs(G).max())
        if abs(np.trace(G)) > 1e-9 * size:
            raise ValueError(
                f"gradient has the trace {np.trace(G):g}, expected 0: the fluid keeps its volume"
            )
        if not np.abs(G + G.T).max() > 1e-9 * size:
            raise ValueError(
                "gradient is a rotation alone, expected one that strains: nothing meets otherwise"
            )
        if turns_back(G):
            raise ValueError(
                "gradient has streamlines that turn back, more vorticity than simple shear has for its strain: expected one in "
                "which every streamline comes from far away, for an encounter to have a beginning"
            )
        return self

    @model_validator(mode="after")
    def _two_give_the_third(self) -> Self:
        given = self.model_fields_set & {"shear_rate", "viscosity", "shear_stress"}
        if len(given) != 2:
            found = " and ".join(sorted(given)) or "none"
            raise ValueError(f"give exactly two of shear_rate, viscosity and shear_stress (found {found})")
        if "shear_stress" not in given:
            self.__dict__["shear_stress"] = self.viscosity * self.shear_rate
        elif "viscosity" not in given:
            self.__dict__["viscosity"] = self.shear_stress / self.shear_rate
        else:
            self.__dict__["shear_rate"] = self.shear_stress / self.viscosity
        return self


class Hydrodynamics(Table):
    """How the particles feel each other through the fluid."""

    level: Literal["free_draining", "rotne_prager", "fts", "stokesian"] = "stokesian"
    """"free_draining": Stokes drag on each sphere by itself; "rotne_prager": far field of forces and torques;
    "fts": of forces, torques and stresslets; "stokesian": the same with pair lubrication, which alone has the keys below."""
    lubrication_cutoff: NonNegativeDimensionless = 5e-3
    """Gap over radius, delta, below which lubrication keeps its value there; 0 for no cut-off (paper, section 2.2.1)."""
    cutoff_reading: Literal["matrix", "gap"] = "matrix"
    """Below the cut-off, "matrix": the two-body resistance is frozen, as the paper says; "gap": the strain sees the frozen gap
    too, so that a touching pair is not squeezed by it; needed where delta is not large against the overlap of contacts."""

    @model_validator(mode="after")
    def _keys_of_lubrication_need_it(self) -> Self:
        stray = sorted(self.model_fields_set & {"lubrication_cutoff", "cutoff_reading"})
        if stray and not self.lubrication:
            raise ValueError(
                f'level = "{self.level}" is without lubrication, so that {" and ".join(stray)} would do nothing: '
                'remove it, or use level = "stokesian"'
            )
        return self

    @property
    def stresslets(self) -> bool:
        """Whether the far field has stresslets."""
        return self.level in ("fts", "stokesian")

    @property
    def lubrication(self) -> bool:
        """Whether pairs have lubrication."""
        return self.level == "stokesian"


class Numerics(Table):
    """How an encounter is integrated and how events are drawn."""

    scheme: Literal["implicit", "paper"] = "implicit"
    """"implicit": contacts solved at the end of the step; "paper": explicit Euler with the time step of Eq. 20."""
    max_step: PositiveDimensionless = 0.2
    """Longest step of the implicit scheme, in units of 1/g; half of it while two bodies are near or contacts change."""
    event_step: PositiveDimensionless = 0.0125
    """Step to which the time of a contact's loss is resolved by the implicit scheme, in units of 1/g."""
    start_distance: Annotated[PositiveDimensionless, Field(ge=1.0)] = 5.0
    """Distance upstream at which the second aggregate starts, in units of R_i + R_j."""
    rotations: NonNegativeDimensionless = 8.0
    """Rotations N_rot that follow the approach (Eq. 21)."""
    far_field_lag: Annotated[NonNegativeDimensionless, Field(le=1.0)] = 0.3
    """The far field is kept, turning along, until a separation changed by this share of its gap plus a radius; 0: never kept.
    From about 0.8 on what is foreseen from the last steps may run away."""
    far_approach: NonNegativeDimensionless = 2.5
    """Two rigid aggregates approach as bodies with a stresslet down to this centre distance over R_i + R_j; 0 for never,
    as at levels of hydrodynamics without stresslets."""
    sure_miss: NonNegativeDimensionless = 0.5
    """Two rigid aggregates that came together as bodies pass as bodies if no two of their primaries come closer than this gap,
    in radii, and nothing can break; 0 for never.  The gap is foretold to about 0.1."""
    separation: NonNegativeDimensionless = 1.5
    """Parts go on alone beyond this centre distance over R_i + R_j once they surely do not come back to each other: beyond the
    closed orbits, and on a path that the other would move by less than a hundredth of a radius; 0 for never."""
    rigid_rotation: bool = True
    """An aggregate without floppy modes turns as a rigid body while its load stays below `rigid_load_limit`."""
    end_inert: bool = True
    """A rigid aggregate that bears its worst orientation is not followed further."""
    rigid_load_limit: Annotated[PositiveDimensionless, Field(le=1.0)] = 0.9
    """Largest tension over pull-off force, by statics, at which an aggregate is taken as rigid."""
    quiet_time: NonNegativeDimensionless = 1.0
    """Strain g t without a contact made or lost before an aggregate is taken as rigid."""
    longest_approach: PositiveDimensionless = 1000.0
    """Strain g t after which an approach is given up and recorded as unresolved: Eq. 21 diverges as y0 goes to 0.  Two primaries
    draw each other in within 400, whatever y0 (closed orbits); aggregates may not."""
    most_steps: Annotated[int, Field(gt=0)] = 20_000_000
    """Steps after which an encounter is given up and recorded as unresolved."""
    paper_base_step: PositiveTime = 1e-6
    """Base time step dt_b of the paper's scheme (Table 1)."""
    paper_step_velocity: Literal["relative", "normal"] = "relative"
    """Velocity that Eq. 20 bounds: "relative", its literal reading, or "normal", that along the line of centres."""
    paper_close_gap: PositiveDimensionless = 1.0
    """Gap over radius below which Eq. 20 counts two primaries as close; the paper does not say (assumption)."""
    pair_selection: Literal["clocks", "inversion"] = "clocks"
    """"clocks": each pair carries an exponential waiting time; "inversion": the paper's Eqs. 4-6. Equal in distribution."""


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


class ReducedUnits(NamedTuple):
    """SI values of the units of the compiled code: a single sphere has translational resistance 1 in them."""

    length: float
    """a [m]"""
    time: float
    """1/g [s]"""
    force: float
    """6 pi mu a^2 g [N]"""

    @property
    def velocity(self) -> float:
        """a g [m/s]."""
        return self.length / self.time

    @property
    def energy(self) -> float:
        """6 pi mu a^3 g, the unit of torque and stresslet too [J]."""
        return self.force * self.length

    @property
    def stiffness(self) -> float:
        """6 pi mu a g [N/m]."""
        return self.force / self.length


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
        if self.numerics.scheme == "paper":
            raise ValueError(
                f'numerics.scheme = "paper" is one for simple shear: use "implicit" with flow.kind = "{self.flow.kind}"'
            )
        if self.numerics.separation == 0.0:
            raise ValueError(
                f"numerics.separation = 0 follows parts that recede together, and in {self.flow.kind} they recede "
                "exponentially: give a positive one"
            )
        return self

    @model_validator(mode="after")
    def _paper_scheme_has_no_resistances(self) -> Self:
        if self.effects.resisting and self.numerics.scheme == "paper":
            raise ValueError(
                'numerics.scheme = "paper" follows no torques of contacts: use "implicit", or remove sliding, rolling, '
                "twisting and rods from [effects]"
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
        scene.effects.kernels(scene)  # refuses what an effect does not hold for in this suspension
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
