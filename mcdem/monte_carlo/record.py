"""The dataset of a run: one NetCDF file, plain for `xarray.open_dataset` (series) and `xarray.open_datatree` (all).

Layout (every variable carries `units` and `long_name`; ragged rows are CF contiguous ragged arrays)

    /            one row at the start and one after each encounter: number of aggregates, volume, <P>, sigma_P, d32
    /events      one row per encounter: when, which parents, offset, outcome, products (ragged), times, tension, cost
    /snapshots   geometry of every aggregate at the start, at each multiple of `run.snapshot_every`, and at the end;
                 between two encounters at the first ten multiples alone, as nothing changes after them
    /kept        geometry of the parents of chosen encounters, by default those left unresolved, with the reason
    /checkpoint  what else it takes to continue bit for bit: places, serial numbers, state of the event selection

The attribute `history` has a line for each call of `run` that computed a part: from which event on, with what versions.

The file is always whole: it is made in memory, written beside its place, and moved there in one step.  It ends in a
checksum of all its bytes (`pbekit.files`).  The geometry of the last snapshot is the state from which a run is resumed.
`mcdem compress` writes layout 2, in which /events alone takes fewer bytes; `event_columns` reads either.
"""

from __future__ import annotations

import contextlib
import platform
import shlex
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import netCDF4
import numpy as np
from xarray.backends.locks import HDF5_LOCK, NETCDFC_LOCK, combine_locks

from mcdem.aggregates.aggregate import Aggregate
from mcdem.aggregates.morphology import aspect_ratio, second_moments, semi_axes
from mcdem.encounter.simulate import OUTCOMES
from mcdem.errors import DataFileError
from mcdem.monte_carlo.event_selection import Meeting
from mcdem.monte_carlo.population import Product, SamplePopulation
from mcdem.netcdf.compact_events import compacted, expanded, replaced
from mcdem.netcdf.whole_files import FILES, RUN, SEALED

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from mcdem.encounter.simulate import EncounterResult
    from mcdem.scene import Scene

TITLE = "mcdem run: shear aggregation and breakup of colloidal aggregates"
FORMAT = 1
"""Version of the layout."""
COMPACT = 2
"""Version of the layout of `mcdem compress`: as above, but /events in few bytes (`mcdem.netcdf.compact_events`)."""

TIMING = ("cpu_time",)
"""Variables that measure the machine, not the suspension."""
ORIGIN_OF_THE_WRITING = (
    "format",
    "command",
    "date_modified",
    "software",
    "history",
    "discarded",
    "computed_in_vain",
    "checksum",
)
"""Attributes that may differ between two datasets of the same process."""

LIBRARY_LOCK = combine_locks([NETCDFC_LOCK, HDF5_LOCK])
"""xarray's own: the libraries bear one thread at a time, and the collector may close a user's dataset in any thread."""
EXPECTED = "a dataset written by `mcdem run`"


class Variable(NamedTuple):
    """A column of a table: how it is stored and what it means."""

    dtype: str
    units: str
    long_name: str
    shape: tuple[tuple[str, int], ...] = ()
    """Dimensions beyond the row, (name, length) each."""
    attributes: tuple[tuple[str, Any], ...] = ()


PARENT = (("parent", 2),)
FLAGS = (
    ("flag_values", np.arange(len(OUTCOMES), dtype=np.int8)),
    ("flag_meanings", " ".join(OUTCOMES)),
)

OVER_TIME = (("coordinates", "time"),)

SERIES = {
    "time": Variable("f8", "s", "process time"),
    "number_of_aggregates": Variable("i8", "1", "number of aggregates in the sample volume", (), OVER_TIME),
    "volume": Variable("f8", "m3", "sample volume", (), OVER_TIME),
    "mean_size": Variable("f8", "1", "mean number of primary particles per aggregate, <P>", (), OVER_TIME),
    "size_deviation": Variable("f8", "1", "standard deviation of that number, sigma_P", (), OVER_TIME),
    "sauter_diameter": Variable("f8", "m", "Sauter diameter, d32", (), OVER_TIME),
}
EVENTS = {
    "time": Variable("f8", "s", "process time of the encounter"),
    "parent_serial": Variable("i8", "1", "serial number of each parent", PARENT),
    "parent_size": Variable("i8", "1", "primary particles of each parent", PARENT),
    "parent_outer_radius": Variable("f8", "m", "outer radius R of each parent", PARENT),
    "parent_bonds": Variable("i8", "1", "contacts within each parent", PARENT),
    "parent_aspect_ratio": Variable(
        "f4", "1", "aspect ratio of each parent's inertia-equivalent ellipsoid", PARENT
    ),
    "parent_radius_of_gyration": Variable("f4", "m", "radius of gyration of each parent", PARENT),
    "offset": Variable(
        "f8", "m", "offset (x0, y0) of the second parent in the cross section", (("cross_section", 2),)
    ),
    "outcome": Variable("i1", "1", "outcome of the encounter", (), FLAGS),
    "contact": Variable("i1", "1", "whether the parents touched"),
    "number_of_products": Variable(
        "i8", "1", "aggregates that left the encounter", (), (("sample_dimension", "product"),)
    ),
    "simulated_time": Variable("f8", "s", "time simulated within the encounter"),
    "first_contact_time": Variable(
        "f8", "s", "time within the encounter of the first contact of the parents"
    ),
    "last_bond_change_time": Variable(
        "f8", "s", "time within the encounter of the last contact made or lost"
    ),
    "largest_tension": Variable("f8", "N", "largest tension of a contact"),
    "smallest_gap": Variable("f8", "m", "smallest gap between the parents' primary particles"),
    "first_bond_loss_time": Variable("f8", "s", "time within the encounter of the first contact lost"),
    "steps": Variable("i8", "1", "time steps of the encounter"),
    "solves": Variable("i8", "1", "evaluations of the hydrodynamics within the encounter"),
    "cpu_time": Variable("f8", "s", "processor time of the encounter"),
    "epoch": Variable("i8", "1", "epoch of the encounter's random stream"),
    "stream_number": Variable("i8", "1", "number of the encounter's random stream within its epoch"),
}
PRODUCTS = {
    "product_serial": Variable("i8", "1", "serial number of each product"),
    "product_size": Variable("i8", "1", "primary particles of each product"),
    "product_from_first": Variable(
        "i8", "1", "primary particles of each product that came from the first parent"
    ),
    "product_outer_radius": Variable("f8", "m", "outer radius R of each product"),
    "product_bonds": Variable("i8", "1", "contacts within each product"),
    "product_aspect_ratio": Variable(
        "f4", "1", "aspect ratio of each product's inertia-equivalent ellipsoid"
    ),
    "product_radius_of_gyration": Variable("f4", "m", "radius of gyration of each product"),
}
SNAPSHOTS = {
    "time": Variable("f8", "s", "process time of the snapshot"),
    "volume": Variable("f8", "m3", "sample volume"),
    "number_of_aggregates": Variable(
        "i8", "1", "aggregates in the snapshot", (), (("sample_dimension", "aggregate"),)
    ),
}
AGGREGATES = {
    "serial": Variable("i8", "1", "serial number of the aggregate"),
    "size": Variable("i8", "1", "primary particles of the aggregate", (), (("sample_dimension", "primary"),)),
    "number_of_bonds": Variable(
        "i8", "1", "contacts of the aggregate", (), (("sample_dimension", "contact"),)
    ),
    "outer_radius": Variable("f8", "m", "outer radius R"),
}
PRIMARIES = {
    "position": Variable(
        "f8", "m", "centre of each primary particle about the centre of mass", (("axis", 3),)
    ),
}
RADII = {"radius": Variable("f8", "m", "radius of each primary particle")}
"""Of primaries of several radii."""
BONDS = {
    "bond": Variable(
        "i4", "1", "primary particles in contact, numbered within their aggregate", (("end", 2),)
    ),
}
SPRINGS = {
    "spring": Variable(
        "f8",
        "1",
        "history of the contact: springs across, [0:3] and [3:6], and twist; lengths in radii of a primary, angles in radians",
        (("spring_component", 7),),
    ),
}
"""Of contacts that resist sliding, rolling or twisting."""
KEPT = {
    "event": Variable("i8", "1", "row of /events"),
    "reason": Variable("S120", "1", "why the encounter is unresolved; empty if it is not"),
}


class Columns:
    """Rows of named columns that grow at the end."""

    def __init__(self, variables: dict[str, Variable], rows: int = 64) -> None:
        self.variables = variables
        self.rows = 0
        self._columns: dict[str, NDArray[Any]] = {
            name: np.zeros((rows, *(n for _, n in v.shape)), dtype=v.dtype) for name, v in variables.items()
        }

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self._columns[name][: self.rows]

    def append(self, **row: Any) -> None:
        self.extend(1, **row)

    def extend(self, count: int, **columns: Any) -> None:
        """Add `count` rows; each value broadcasts to them."""
        end = self.rows + count
        for name in self.variables:
            column = self._columns[name]
            if end > len(column):
                grown = np.zeros((max(end, 2 * len(column)), *column.shape[1:]), dtype=column.dtype)
                grown[: self.rows] = column[: self.rows]
                self._columns[name] = column = grown
            column[self.rows : end] = columns[name]
        self.rows = end

    def cut(self, rows: int) -> None:
        """Keep the first `rows` rows."""
        self.rows = rows


class Geometries:
    """Aggregates one after the other, each with its primaries and bonds.

    resisting : also the history of the bonds;  several : also the radii of the primaries
    """

    def __init__(self, resisting: bool, several: bool) -> None:
        self.resisting, self.several = resisting, several
        self.aggregates = Columns(AGGREGATES)
        self.primaries = Columns(PRIMARIES | RADII if several else PRIMARIES)
        self.bonds = Columns(BONDS | SPRINGS if resisting else BONDS)

    def extend(self, aggregates: Sequence[Aggregate], serials: Sequence[int], outer_radii: ArrayLike) -> None:
        positions = np.concatenate([aggregate.positions for aggregate in aggregates])
        bonds = np.concatenate([aggregate.bonds for aggregate in aggregates])
        self.aggregates.extend(
            len(aggregates),
            serial=serials,
            size=[aggregate.size for aggregate in aggregates],
            number_of_bonds=[len(aggregate.bonds) for aggregate in aggregates],
            outer_radius=outer_radii,
        )
        radii = {"radius": joined_radii(aggregates)} if self.several else {}
        self.primaries.extend(len(positions), position=positions, **radii)
        springs = {}
        if self.resisting:
            springs["spring"] = np.concatenate([histories(aggregate) for aggregate in aggregates])
        self.bonds.extend(len(bonds), bond=bonds, **springs)

    def since(self, row: int) -> list[Aggregate]:
        """The aggregates from the given row to the last."""
        sizes, bonds = self.aggregates["size"][row:], self.aggregates["number_of_bonds"][row:]
        primaries = slice(self.primaries.rows - sizes.sum(), None)
        members = np.cumsum(sizes)[:-1]
        radii: Sequence[NDArray[np.float64] | None] = [None] * len(sizes)
        if self.several:
            radii = [r.copy() for r in np.split(self.primaries["radius"][primaries], members)]
        ends = np.cumsum(bonds)[:-1]
        pairs = np.split(self.bonds["bond"][self.bonds.rows - bonds.sum() :], ends)
        springs: Sequence[NDArray[np.float64] | None] = [None] * len(sizes)
        if self.resisting:
            springs = [
                s.copy() for s in np.split(self.bonds["spring"][self.bonds.rows - bonds.sum() :], ends)
            ]
        return [
            Aggregate(p.copy(), b.copy(), s, r)
            for p, b, s, r in zip(
                np.split(self.primaries["position"][primaries], members),
                pairs,
                springs,
                radii,
                strict=True,
            )
        ]

    def cut(self, row: int) -> None:
        """Remove the aggregates from the given row to the last."""
        self.primaries.cut(self.primaries.rows - self.aggregates["size"][row:].sum())
        self.bonds.cut(self.bonds.rows - self.aggregates["number_of_bonds"][row:].sum())
        self.aggregates.cut(row)

    @property
    def tables(self) -> dict[str, Columns]:
        return {"aggregate": self.aggregates, "primary": self.primaries, "contact": self.bonds}


def histories(aggregate: Aggregate) -> NDArray[np.float64]:
    """(B, 7) history of the contacts of an aggregate, zero where it has none."""
    return np.zeros((len(aggregate.bonds), 7)) if aggregate.springs is None else aggregate.springs


def joined_radii(aggregates: Sequence[Aggregate]) -> NDArray[np.float64] | None:
    """Radii (sum P,) [m] of the primaries of several aggregates; None where the suspension has only one."""
    found = [aggregate.radii for aggregate in aggregates if aggregate.radii is not None]
    return np.concatenate(found) if found else None


class Snapshots:
    """Populations at chosen times."""

    def __init__(self, resisting: bool, several: bool) -> None:
        self.times = Columns(SNAPSHOTS)
        self.geometries = Geometries(resisting, several)

    def append(self, time: float, population: SamplePopulation) -> None:
        self.times.append(time=time, volume=population.volume, number_of_aggregates=population.number)
        places, aggregates = zip(*population, strict=True)
        self.geometries.extend(
            aggregates, [population.serials[place] for place in places], population.outer_radii[list(places)]
        )

    @property
    def _last(self) -> int:
        """First row of the last snapshot's aggregates."""
        return self.geometries.aggregates.rows - int(self.times["number_of_aggregates"][-1])

    def last(self) -> tuple[float, float, list[int], list[Aggregate]]:
        """Time [s], volume [m^3], serial numbers and aggregates of the last."""
        return (
            float(self.times["time"][-1]),
            float(self.times["volume"][-1]),
            self.geometries.aggregates["serial"][self._last :].tolist(),
            self.geometries.since(self._last),
        )

    def drop_last(self) -> None:
        self.geometries.cut(self._last)
        self.times.cut(self.times.rows - 1)


@dataclass
class Record:
    """All that a run keeps, in memory; `write` makes the file."""

    scene: Scene
    seed: int
    keep_parents: tuple[str, ...] = ("unresolved",)
    """Outcomes for which the parents' geometry is kept."""
    series: Columns = field(default_factory=lambda: Columns(SERIES))
    events: Columns = field(default_factory=lambda: Columns(EVENTS))
    products: Columns = field(default_factory=lambda: Columns(PRODUCTS))
    snapshots: Snapshots = field(init=False)
    kept: Columns = field(default_factory=lambda: Columns(KEPT))
    kept_parents: Geometries = field(init=False)

    def __post_init__(self) -> None:
        self.history = [_stretch(0, 0.0)]
        kind = self.scene.effects.resisting, self.scene.suspension.radii is not None
        self.snapshots = Snapshots(*kind)
        self.kept_parents = Geometries(*kind)

    def sample(self, time: float, population: SamplePopulation) -> None:
        """Append to the series."""
        self.series.append(
            time=time,
            number_of_aggregates=population.number,
            volume=population.volume,
            mean_size=population.mean_size,
            size_deviation=population.size_deviation,
            sauter_diameter=population.sauter_diameter,
        )

    def encounter(
        self,
        meeting: Meeting,
        parents: Sequence[tuple[int, Aggregate]],
        result: EncounterResult,
        products: Sequence[Product],
        primary_radius: float,
    ) -> None:
        """Append an event; `parents` are (serial, aggregate) before it, `products` what the population holds after."""
        if result.outcome in self.keep_parents:
            self.kept.append(event=self.events.rows, reason=result.reason.encode("ascii", "replace"))
            self.kept_parents.extend(
                [aggregate for _, aggregate in parents],
                [serial for serial, _ in parents],
                [aggregate.outer_radius(primary_radius) for _, aggregate in parents],
            )
        ratios, gyration = _shapes(
            [aggregate for _, aggregate in parents] + [product.aggregate for product in products],
            primary_radius,
        )
        self.events.append(
            time=meeting.time,
            parent_serial=[serial for serial, _ in parents],
            parent_size=[aggregate.size for _, aggregate in parents],
            parent_outer_radius=[aggregate.outer_radius(primary_radius) for _, aggregate in parents],
            parent_bonds=[len(aggregate.bonds) for _, aggregate in parents],
            parent_aspect_ratio=ratios[:2],
            parent_radius_of_gyration=gyration[:2],
            offset=result.offset,
            outcome=OUTCOMES.index(result.outcome),
            contact=result.contact,
            number_of_products=len(products),
            simulated_time=result.simulated_time,
            first_contact_time=result.first_contact_time,
            last_bond_change_time=result.last_bond_change_time,
            largest_tension=result.largest_tension,
            smallest_gap=result.smallest_gap,
            first_bond_loss_time=result.first_bond_loss_time,
            steps=result.steps,
            solves=result.solves,
            cpu_time=result.cpu_time,
            epoch=meeting.epoch,
            stream_number=meeting.number,
        )
        for k, product in enumerate(products, start=2):
            self.products.append(
                product_serial=product.serial,
                product_size=product.aggregate.size,
                product_from_first=product.from_first,
                product_outer_radius=product.aggregate.outer_radius(primary_radius),
                product_bonds=len(product.aggregate.bonds),
                product_aspect_ratio=ratios[k],
                product_radius_of_gyration=gyration[k],
            )

    @property
    def outcomes(self) -> dict[str, int]:
        """How often each outcome occurred."""
        counts = np.bincount(self.events["outcome"].astype(np.int64), minlength=len(OUTCOMES))
        return dict(zip(OUTCOMES, counts.tolist(), strict=True))

    # To the file

    def write(
        self, path: Path, time: float, population: SamplePopulation, selection: dict[str, Any], discarded: int
    ) -> None:
        """Replace the file at `path` by one that holds everything until `time` [s]; all or nothing."""
        self.snapshots.append(time, population)
        try:
            with written(path) as file:
                self._fill(file, population, selection, discarded)
        finally:
            self.snapshots.drop_last()

    def _fill(
        self, file: netCDF4.Dataset, population: SamplePopulation, selection: dict[str, Any], discarded: int
    ) -> None:
        _describe(
            file,
            {
                "title": TITLE,
                "Conventions": "CF-1.11",
                "format": FORMAT,
                "scene": self.scene.text,
                "scene_name": self.scene.name,
                "seed": np.int64(self.seed),
                "keep_parents": " ".join(self.keep_parents),
                "primary_radius": self.scene.suspension.radius,
                "software": software(),
                "history": "\n".join(self.history),
                "command": _command(),
                "date_modified": datetime.now(UTC).isoformat(timespec="seconds"),
                "discarded": discarded,
                "checksum": SEALED,
            },
        )
        _put(file, {"row": self.series})
        _put(file.createGroup("events"), {"event": self.events, "product": self.products})
        _put(
            file.createGroup("snapshots"),
            {"snapshot": self.snapshots.times, **self.snapshots.geometries.tables},
        )
        _put(file.createGroup("kept"), {"kept": self.kept, **self.kept_parents.tables})
        state = {
            "place": np.array([place for place, _ in population], dtype=np.int64),
            "next_serial": population.next_serial,
            **selection,
        }
        _put_state(file.createGroup("checkpoint"), state)

    # From the file

    @classmethod
    def read(cls, path: Path, scene: Scene) -> tuple[Record, float, SamplePopulation, dict[str, Any]]:
        """What `write` wrote: the record, the time [s], the population and the state of the event selection."""
        with opened(path) as (file,):
            _refuse_another_scene(path, str(file.scene), scene)
            record = cls(scene, int(file.seed), tuple(str(file.keep_parents).split()))
            _get(file, {"row": record.series})
            _get(file["events"], {"event": record.events, "product": record.products}, event_columns(file))
            _get(
                file["snapshots"],
                {"snapshot": record.snapshots.times, **record.snapshots.geometries.tables},
            )
            _get(file["kept"], {"kept": record.kept, **record.kept_parents.tables})
            state = {name: v[...] for name, v in file["checkpoint"].variables.items()}
            time, volume, serials, aggregates = record.snapshots.last()
            record.history = [*stretches(file), _stretch(record.events.rows, time)]
            record.snapshots.drop_last()
            population = SamplePopulation.restored(
                scene.suspension.radius,
                volume,
                int(state.pop("next_serial")),
                state.pop("place").tolist(),
                serials,
                aggregates,
            )
        return record, time, population, state


@contextlib.contextmanager
def written(path: Path, then: str = "continue with --resume") -> Iterator[netCDF4.Dataset]:
    """A dataset that takes the place of the one at `path` in one step, when it is complete; if not, that one stays."""
    with FILES.replacing(path, RUN, then) as beside, LIBRARY_LOCK:
        file = netCDF4.Dataset(beside, "w")
        try:
            yield file
        finally:
            file.close()


def reached(path: Path, scene: Scene, seed: int) -> tuple[float, int]:
    """Process time [s] and encounters of a dataset; raises `DataFileError` if it is not of this scene and seed."""
    with opened(path) as (file,):
        _refuse_another_scene(path, str(file.scene), scene)
        if file.seed != seed:
            raise DataFileError(
                f"{path}: was begun with seed {file.seed}, expected {seed}; choose another file"
            )
        return float(file["snapshots/time"][-1]), len(file["events"].dimensions["event"])


def _refuse_another_scene(path: Path, text: str, scene: Scene) -> None:
    """Raise `DataFileError` if the dataset's scene differs in anything but when to stop."""
    theirs, ours = (
        s.model_dump() | {"run": s.model_dump()["run"] | {"until": None, "events": None, "seed": None}}
        for s in (type(scene).from_dataset(text, path), scene)
    )
    for table in ours:
        for key in ours[table] if isinstance(ours[table], dict) else ():
            if theirs[table][key] != ours[table][key]:
                raise DataFileError(
                    f"{path}: was begun with {table}.{key} = {theirs[table][key]}, the scene has {ours[table][key]}; "
                    "continue it with its own scene, or choose another file"
                )


def _describe(node: Any, attributes: dict[str, Any]) -> None:
    """Set attributes; text as characters of UTF-8, never as strings of variable length (see `_put`)."""
    for name, value in attributes.items():
        node.setncattr(name, value.encode() if isinstance(value, str) else value)


def _put(group: netCDF4.Dataset, tables: dict[str, Columns]) -> None:
    for row, table in tables.items():
        group.createDimension(row, table.rows)
        for name, variable in table.variables.items():
            for dimension, length in variable.shape:
                if dimension not in group.dimensions:
                    group.createDimension(dimension, length)
            dimensions = (row, *(dimension for dimension, _ in variable.shape))
            column, dtype = table[name], variable.dtype
            if column.dtype.kind == "S":
                # Strings of fixed length: those of variable length make HDF5 reach for files that are closed.
                group.createDimension(f"{name}_length", column.itemsize)
                column, dtype = netCDF4.stringtochar(column), "S1"
                dimensions = (*dimensions, f"{name}_length")
            stored = group.createVariable(name, dtype, dimensions, fletcher32=True)
            _describe(
                stored,
                {"units": variable.units, "long_name": variable.long_name, **dict(variable.attributes)},
            )
            stored[:] = column


def _get(group: netCDF4.Dataset, tables: dict[str, Columns], found: dict[str, Column] | None = None) -> None:
    """Fill tables from the variables of the group, or from `found`."""
    group.set_auto_mask(False)
    for row, table in tables.items():
        columns = {
            name: (_column(group[name]) if name in group.variables else np.nan)
            if found is None
            else (found[name].values if name in found else np.nan)
            for name in table.variables
        }
        table.extend(len(group.dimensions[row]), **columns)


class Column(NamedTuple):
    """A variable as it is in a file, or would be in one of the plain layout."""

    dimensions: tuple[str, ...]
    attributes: dict[str, Any]
    values: NDArray[Any]


def event_columns(file: netCDF4.Dataset) -> dict[str, Column]:
    """Every column of /events, of either layout."""
    group = file["events"]
    group.set_auto_maskandscale(False)
    stored = {
        name: Column(v.dimensions, {key: v.getncattr(key) for key in v.ncattrs()}, v[...])
        for name, v in group.variables.items()
    }
    if file.getncattr("format") != COMPACT:
        return stored
    file.set_auto_maskandscale(False)
    times = file["time"][:][len(file.dimensions["row"]) - len(group.dimensions["event"]) :]
    found = expanded({name: column.values for name, column in stored.items()}, times)
    return {
        name: stored[name] if name in stored else _restored(row, variable, found[name])
        for row, table in (("event", EVENTS), ("product", PRODUCTS))
        for name, variable in table.items()
        if name in found
    }


def _restored(row: str, variable: Variable, values: NDArray[Any]) -> Column:
    attributes = {"units": variable.units, "long_name": variable.long_name, **dict(variable.attributes)}
    return Column((row, *(name for name, _ in variable.shape)), attributes, values)


def compact_columns(columns: dict[str, Column]) -> dict[str, Column]:
    """The columns of /events as the compact layout stores them."""
    values = {name: column.values for name, column in columns.items()}
    gone = replaced(columns)
    return {name: column for name, column in columns.items() if name not in gone} | {
        name: Column(dimensions, {"units": _unit_of(name), "long_name": meaning}, array)
        for name, (dimensions, meaning, array) in compacted(values).items()
    }


def _unit_of(name: str) -> str:
    return PRODUCTS[f"product_{name.removesuffix('_value')}"].units if name.endswith("_value") else "1"


def _shapes(
    aggregates: Sequence[Aggregate], primary_radius: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Aspect ratios (Eq. 27) and radii of gyration [m]."""
    sizes, radii = np.array([aggregate.size for aggregate in aggregates]), joined_radii(aggregates)
    moments = second_moments(np.concatenate([a.positions for a in aggregates]), sizes, radii)
    axes = semi_axes(moments, primary_radius, sizes=sizes, radii=radii)
    return aspect_ratio(axes), np.sqrt(moments.sum(axis=1))


def _column(stored: netCDF4.Variable[Any]) -> NDArray[Any]:
    values = stored[:]
    return netCDF4.chartostring(values, "none") if values.dtype == "S1" else values


def _put_state(group: netCDF4.Dataset, state: dict[str, Any]) -> None:
    meaning = {"block_time": "s", "time": "s"}
    for name, value in state.items():
        array = np.asarray(value)
        dimensions: tuple[str, ...] = ()
        if array.ndim:
            group.createDimension(name, len(array))
            dimensions = (name,)
        stored = group.createVariable(name, array.dtype, dimensions, fletcher32=bool(dimensions))
        _describe(
            stored,
            {"units": meaning.get(name, "1"), "long_name": f"{name.replace('_', ' ')}, to resume from"},
        )
        stored[...] = array


def _command() -> str:
    """The command line, without the folder in which the program lies here."""
    return shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])


def software() -> str:
    """The versions that can change a number."""
    packages = []
    for name in ("pbekit", "numpy", "scipy", "numba"):
        with contextlib.suppress(PackageNotFoundError):
            packages.append(f"{name} {version(name)}")
    return ", ".join([*packages, f"python {platform.python_version()}", platform.platform()])


def _stretch(events: int, time: float) -> str:
    """Who computes from here on: a line of the dataset's history, as a run may be resumed by another version."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return f"{now} from event {events}, t = {time:.6g} s: {software()}: {_command()}"


def stretches(file: netCDF4.Dataset) -> list[str]:
    """The stretches that hold an encounter, oldest first."""
    if "history" not in file.ncattrs():
        return [f"{file.date_modified} until then: {file.software}: {file.command}"]
    lines = str(file.history).splitlines()
    events = len(file["events"].dimensions["event"])
    return [line for line in lines if f" from event {events}," not in line]


@contextlib.contextmanager
def opened(*paths: Path) -> Iterator[tuple[netCDF4.Dataset, ...]]:
    """The datasets at `paths`, for reading; raises `DataFileError` if one is not ours or not whole."""
    with contextlib.ExitStack() as stack:
        for path in paths:
            stack.enter_context(FILES.reading(path, EXPECTED))
        stack.enter_context(LIBRARY_LOCK)
        yield tuple(stack.enter_context(_opened(path)) for path in paths)


def _opened(path: Path) -> netCDF4.Dataset:
    file = netCDF4.Dataset(path)
    title, layout, writer = (getattr(file, name, None) for name in ("title", "format", "software"))
    if title == TITLE and layout in (FORMAT, COMPACT):
        return file
    file.close()
    if title == TITLE:
        raise DataFileError(
            f"{path}: layout {layout}, expected {FORMAT} or {COMPACT}; written by another version: {writer}"
        )
    raise DataFileError(f"{path}: a NetCDF file of another kind; expected {EXPECTED}")
