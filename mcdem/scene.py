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
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
import tomlkit
import tomlkit.exceptions
from pydantic import Field, PrivateAttr, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from mcdem.effects import Effects
from mcdem.errors import SceneError
from mcdem.quantities.linear_flows import inflow_constant, turns_back
from mcdem.quantities.random_streams import LARGEST_SEED
from mcdem.quantities.toml_tables import FROM_THE_OTHERS, Key, Table, explain, keys, quantity_at, written
from mcdem.quantities.units import (
    DIMENSIONLESS,
    ENERGY,
    IN_A_FILE,
    LENGTH,
    RATE,
    STRESS,
    TIME,
    VISCOSITY,
    shown,
)

SMALLEST_RATIO = 0.1
"""Smallest over largest radius of a suspension."""
MOST_RADII = 20
"""Radii of a suspension: two-sphere functions are tabulated for every pair of them."""

LARGEST_FILE = 2**16
"""Bytes of a scene file; the longest of those that come with mcdem has 3000."""
LONGEST_LINE = 2000
"""Characters of a line of it: the time to read a key of many dots grows with the square of their number."""

_RADIUS = LENGTH.positive.between("0.1 nm", "1 cm")
_SHARE = DIMENSIONLESS.positive.between("1e-12", "1")
_ENTRY = DIMENSIONLESS.between("-1e6", "1e6")
_PERIOD = TIME.positive.between("1e-15 s", "1e15 s")


class Suspension(Table):
    """The primary particles and how many of them there are."""

    radius: Annotated[float, _RADIUS] = FROM_THE_OTHERS
    """Radius a of the primary particles; where `radii` are given instead, the largest of them."""
    radii: Annotated[tuple[Annotated[float, _RADIUS], ...], Field(strict=False)] | None = None
    """Radii of the primaries of a suspension of several, instead of `radius`; what is given over a is over the largest."""
    number_fractions: Annotated[tuple[Annotated[float, _SHARE], ...], Field(strict=False)] | None = None
    """Share in number of the primaries of each of the `radii`; they add up to 1."""
    volume_fraction: Annotated[float, DIMENSIONLESS.positive.between("1e-15", "0.74", "1e-4")]
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
        if len(self.radii) > MOST_RADII:
            raise ValueError(f"radii: found {len(self.radii)}, expected at most {MOST_RADII}")
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
    alpha: Annotated[float, DIMENSIONLESS.positive.between("1e-12", "1")] | None = None
    """Share of extension in a planar flow, between simple shear (0) and planar extension (1); its kind alone has it."""
    gradient: (
        Annotated[
            tuple[Annotated[tuple[Annotated[float, _ENTRY], ...], Field(strict=False)], ...],
            Field(strict=False),
        ]
        | None
    ) = None
    """Rows of the velocity gradient over g of a linear flow, u = g G r: three of three numbers, of trace 0; such as
    [[-0.7, 0, 0], [0, -0.3, 0], [0, 0, 1]], between planar and uniaxial extension."""
    shear_rate: Annotated[float, RATE.positive.between("1e-9 1/s", "1e12 1/s")] = FROM_THE_OTHERS
    """Rate g of the flow: the shear rate, or in extension the rate of stretching."""
    viscosity: Annotated[float, VISCOSITY.positive.between("1e-9 Pa s", "1e9 Pa s")] = FROM_THE_OTHERS
    """Viscosity mu of the medium."""
    shear_stress: Annotated[float, STRESS.positive.between("1e-12 Pa", "1e12 Pa")] = FROM_THE_OTHERS
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
        if size < 1e-6:
            raise ValueError(
                f"gradient has entries of at most {size:g}, expected some of order 1: it is the velocity gradient over the rate"
            )
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
        third = next(iter({"shear_rate", "viscosity", "shear_stress"} - given))
        quantity = quantity_at(Flow, (third,))
        assert quantity is not None
        try:
            quantity.to_si(getattr(self, third))
        except PydanticCustomError as problem:
            raise ValueError(
                f"{third} = {getattr(self, third):g} {quantity.si}, which follows from the two given, {problem.message()}"
            ) from None
        return self


class Hydrodynamics(Table):
    """How the particles feel each other through the fluid."""

    level: Literal["free_draining", "rotne_prager", "fts", "stokesian"] = "stokesian"
    """"free_draining": Stokes drag on each sphere by itself; "rotne_prager": far field of forces and torques;
    "fts": of forces, torques and stresslets; "stokesian": the same with pair lubrication, which alone has the keys below."""
    lubrication_cutoff: Annotated[float, DIMENSIONLESS.non_negative.between("0", "10", "5e-3")] = 5e-3
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
    max_step: Annotated[float, DIMENSIONLESS.positive.between("1e-9", "10", "0.2")] = 0.2
    """Longest step of the implicit scheme, in units of 1/g; half of it while two bodies are near or contacts change."""
    event_step: Annotated[float, DIMENSIONLESS.positive.between("1e-12", "10", "0.0125")] = 0.0125
    """Step to which the time of a contact's loss is resolved by the implicit scheme, in units of 1/g."""
    start_distance: Annotated[float, DIMENSIONLESS.positive.between("1", "1e4", "5")] = 5.0
    """Distance upstream at which the second aggregate starts, in units of R_i + R_j."""
    rotations: Annotated[float, DIMENSIONLESS.non_negative.between("0", "1e6", "8")] = 8.0
    """Rotations N_rot that follow the approach (Eq. 21)."""
    far_field_lag: Annotated[float, DIMENSIONLESS.non_negative.between("0", "1", "0.3")] = 0.3
    """The far field is kept, turning along, until a separation changed by this share of its gap plus a radius; 0: never kept.
    From about 0.8 on what is foreseen from the last steps may run away."""
    far_approach: Annotated[float, DIMENSIONLESS.non_negative.between("0", "1e4", "2")] = 2.0
    """Two rigid aggregates approach as bodies with a stresslet down to this centre distance over R_i + R_j; 0 for never,
    as at levels of hydrodynamics without stresslets."""
    sure_miss: Annotated[float, DIMENSIONLESS.non_negative.between("0", "1e4")] = 0.5
    """Two rigid aggregates that came together as bodies pass as bodies if no two of their primaries come closer than this gap,
    in radii, and nothing can break; 0 for never.  The gap is foretold to about 0.1."""
    separation: Annotated[float, DIMENSIONLESS.non_negative.between("0", "1e4", "1.5")] = 1.5
    """Parts that recede from each other go on alone beyond this centre distance over R_i + R_j; 0 for never."""
    rigid_rotation: bool = True
    """An aggregate without floppy modes turns as a rigid body while its load stays below `rigid_load_limit`."""
    end_inert: bool = True
    """A rigid aggregate that bears its worst orientation is not followed further."""
    rigid_load_limit: Annotated[float, DIMENSIONLESS.positive.between("1e-6", "1", "0.9")] = 0.9
    """Largest tension over pull-off force, by statics, at which an aggregate is taken as rigid."""
    quiet_time: Annotated[float, DIMENSIONLESS.non_negative.between("0", "1e9", "1")] = 1.0
    """Strain g t without a contact made or lost before an aggregate is taken as rigid."""
    longest_approach: Annotated[float, DIMENSIONLESS.positive.between("1e-3", "1e9", "1000")] = 1000.0
    """Strain g t after which an approach is given up and recorded as unresolved: it diverges as y0 goes to 0 (Eq. 21)."""
    most_steps: Annotated[int, Field(ge=1, le=10**15)] = 20_000_000
    """Steps after which an encounter is given up and recorded as unresolved."""
    paper_base_step: Annotated[float, TIME.positive.between("1e-15 s", "1e6 s", '"1 us"')] = 1e-6
    """Base time step dt_b of the paper's scheme (Table 1)."""
    paper_step_velocity: Literal["relative", "normal"] = "relative"
    """Velocity that Eq. 20 bounds: "relative", its literal reading, or "normal", that along the line of centres."""
    paper_close_gap: Annotated[float, DIMENSIONLESS.positive.between("1e-9", "1e4", "1")] = 1.0
    """Gap over radius below which Eq. 20 counts two primaries as close; the paper does not say (assumption)."""
    pair_selection: Literal["clocks", "inversion"] = "clocks"
    """"clocks": each pair carries an exponential waiting time; "inversion": the paper's Eqs. 4-6. Equal in distribution."""


class Population(Table):
    """The sample of the suspension that is followed."""

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
    """When to stop, what to keep.  The command line may override it."""

    until: Annotated[float, _PERIOD] | None = None
    """Process time at which the run stops."""
    events: Annotated[int, Field(ge=1, le=10**12)] | None = None
    """Number of encounters after which the run stops."""
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)] = 1
    """Seed of every random stream."""
    snapshot_every: Annotated[float, _PERIOD] = 1.0
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

    @model_validator(mode="after")
    def _effects_hold_in_this_suspension(self) -> Self:
        lengths = [
            ("van_der_waals", "minimum_approach"),
            ("born", "collision_diameter"),
            ("rolling", "critical_displacement"),
            ("rods", "largest_displacement"),
        ]
        smallest = min(self.suspension.species)
        for name, key in lengths:
            effect = getattr(self.effects, name)
            if effect is not None and getattr(effect, key) >= smallest:
                raise ValueError(
                    f"[effects.{name}] {key} = {getattr(effect, key):g} m; expected a length below the radius of the primaries, "
                    f"{smallest:g} m"
                )
        try:
            self.effects.kernels(self)
        except SceneError as problem:
            raise ValueError(str(problem).removeprefix(f"{self.name}: ")) from None
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
            scene = cls.model_validate(tables, context=IN_A_FILE)
        except ValidationError as problem:
            raise SceneError(explain(problem, cls, source, _offers(tables))) from None
        scene._text = text
        scene._path = Path(path) if path is not None else None
        return scene

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
    (
        ("effects", "double_layer"),
        (frozenset({"debye_length"}), frozenset({"salt_concentration", "temperature"})),
    ),
    (("effects", "double_layer"), (frozenset({"surface_potential"}), frozenset({"zeta_potential"}))),
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
    offer = "A_H/(24 pi l0^2) from the van der Waals attraction"
    try:
        given = tables["effects"]["van_der_waals"]
        constant, distance = ENERGY.to_si(given["hamaker_constant"]), LENGTH.to_si(given["minimum_approach"])
        offer += f" is {shown(f'{constant / (24.0 * math.pi * distance**2):.3g} J/m^2')}"
    except (KeyError, TypeError, ValueError, ArithmeticError):
        offer = "or A_H/(24 pi l0^2), with Hamaker constant and least distance"
    return {(f"effects.{law}", "surface_energy"): offer for law in ("jkr", "dmt")}


def load_scene(path: Path | str) -> Scene:
    """Read and check a scene file; raises `SceneError` naming file, table, key, value and cure."""
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
