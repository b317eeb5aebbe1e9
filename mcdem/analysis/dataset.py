"""A run's dataset, opened for reading: series, encounters, populations, and what follows from them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from operator import attrgetter
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mcdem.aggregates.aggregate import Aggregate
from mcdem.aggregates.morphology import Inertia, population_morphology
from mcdem.analysis.breakup import Convention, breakups, summarise
from mcdem.analysis.statistics import SteadyState, TimeAverage, find_steady_state, origins_of, time_average
from mcdem.errors import DataFileError, UserError
from mcdem.monte_carlo.record import EXPECTED, event_columns, opened
from mcdem.netcdf.whole_files import FILES
from mcdem.scene import Scene

FEW_BREAKUPS = 100
"""Below this many breakups a distribution's shape is noise: a share of 10 % is known to +- 6 %."""
LARGEST_CHANGE_OF_WIDTH = 0.20
"""As `statistics.LARGEST_CHANGE`, of sigma_P, which a few large aggregates decide and which scatters twice as much."""


class RunDataset:
    """One dataset written by `mcdem run` (layout: `mcdem.monte_carlo.record`). Times are process times [s].

    series : Dataset over ``row``: time, number_of_aggregates, volume, mean_size, size_deviation, sauter_diameter
    events : Dataset over ``event``; outcomes as words

    Examples
    --------
    >>> from mcdem.analysis import RunDataset
    >>> run = RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc")
    >>> average = run.average("mean_size")
    >>> f"steady <P> = {average.mean:.1f} +- {average.error:.1f}"
    'steady <P> = 10.6 +- 0.1'
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        with opened(self.path) as (file,):
            columns = event_columns(file)
        with FILES.reading(self.path, EXPECTED):
            with xr.open_dataset(self.path, decode_times=False) as root:
                self.series, self.attributes = root.load(), dict(root.attrs)
            self.events = xr.Dataset(
                {name: (of.dimensions, of.values, of.attributes) for name, of in columns.items()}
            )
            with xr.open_dataset(self.path, group="snapshots", decode_times=False) as group:
                self._snapshots = group.load()
            self.scene = Scene.from_dataset(self.attributes["scene"], self.path)
            self._populations: dict[tuple[int, Inertia, bool], xr.Dataset] = {}
            self._check()

    def _check(self) -> None:
        """Rows that do not fit each other are damage that no checksum has caught (older datasets have none)."""
        s, events = self._snapshots, self.events
        for counts, rows in (
            (s["number_of_aggregates"], s.sizes["aggregate"]),
            (s["size"], s.sizes["primary"]),
            (s["number_of_bonds"], s.sizes["contact"]),
            (events["number_of_products"], events.sizes["product"]),
        ):
            if (counts.values < 0).any() or counts.values.sum() != rows:
                raise DataFileError(
                    f"{self.path}: is damaged: {counts.name} counts {counts.values.sum()} rows, there are {rows}; "
                    "restore it from a copy, or make it again"
                )

    @property
    def radius(self) -> float:
        """a [m], of several the largest"""
        return self.scene.suspension.radius

    @property
    def stress(self) -> float:
        """Shear stress of the undisturbed flow [Pa]."""
        return self.scene.flow.shear_stress

    @property
    def label(self) -> str:
        return f"{self.stress:.4g} Pa"

    @property
    def doublings(self) -> int:
        """How often the sample was doubled by an exact copy, after which its aggregates are not independent."""
        volume = self.series["volume"].values
        return int(np.log2(volume[-1] / volume[0]) + 0.5)

    # Time

    @property
    def time(self) -> NDArray[np.float64]:
        return np.asarray(self.series["time"].values)

    @cached_property
    def outcome(self) -> NDArray[np.str_]:
        """(events,) outcomes in words."""
        column = self.events["outcome"]
        words = np.array(str(column.attrs["flag_meanings"]).split())
        codes = np.asarray(column.attrs["flag_values"])
        return words[np.searchsorted(codes, column.values)] if len(column) else np.empty(0, dtype=words.dtype)

    @cached_property
    def steady(self) -> SteadyState:
        """By the test of `statistics.STEADY_TEST`, on <P> and sigma_P."""
        return find_steady_state(
            self.time,
            {"⟨P⟩": self.series["mean_size"].values, "σ_P": self.series["size_deviation"].values},
            self.turnovers,
            {"σ_P": LARGEST_CHANGE_OF_WIDTH},
        )

    @cached_property
    def turnovers(self) -> NDArray[np.float64]:
        """(rows,) aggregates born by aggregation or breakup until then, over the number there is."""
        changed = np.isin(self.outcome, ("aggregation", "exchange", "fragmentation"))
        born = np.cumsum(np.where(changed, self.events["number_of_products"].values, 0))
        per_row = np.concatenate([[0], born])[: len(self.time)]
        number = self.series["number_of_aggregates"].values
        return np.asarray(np.cumsum(np.diff(per_row, prepend=0) / number))

    def average(self, name: str) -> TimeAverage:
        """Mean of a series over the steady stretch (the last 40 % of a run that is not steady)."""
        return time_average(self.time, self.series[name].values, self.steady.start)

    @cached_property
    def is_late(self) -> NDArray[np.bool_]:
        """(events,) which encounters fall in the steady stretch."""
        return np.asarray(self.events["time"].values >= self.steady.start)

    # Breakup

    @cached_property
    def breakups(self) -> xr.Dataset:
        """Every breakup of the run in the wider convention (see `mcdem.analysis.breakup`), with its ``time`` [s]."""
        broken = breakups(
            self.outcome,
            self.events["contact"].values.astype(bool),
            self.events["parent_size"].values,
            self.events["number_of_products"].values,
            self.events["product_size"].values,
            self.events["product_from_first"].values,
        )
        broken["time"] = ("breakup", self.events["time"].values[broken["event"].values])
        return broken

    @property
    def late_breakups(self) -> xr.Dataset:
        """Breakups of the steady stretch."""
        return self.breakups.isel(breakup=self.breakups["time"].values >= self.steady.start)

    # Populations

    @property
    def snapshot_times(self) -> NDArray[np.float64]:
        return np.asarray(self._snapshots["time"].values)

    def _ragged(
        self, snapshot: int
    ) -> tuple[NDArray[np.float64], NDArray[np.integer], NDArray[np.integer], NDArray[np.integer]]:
        """Positions, sizes, bonds and numbers of bonds of a snapshot, as `morphology` takes them."""
        s = self._snapshots
        ends = np.cumsum(s["number_of_aggregates"].values)
        snapshot %= len(ends)
        rows = slice(int(ends[snapshot] - s["number_of_aggregates"].values[snapshot]), int(ends[snapshot]))
        sizes, bonds = s["size"].values, s["number_of_bonds"].values
        primaries = slice(int(sizes[: rows.start].sum()), int(sizes[: rows.stop].sum()))
        links = slice(int(bonds[: rows.start].sum()), int(bonds[: rows.stop].sum()))
        return s["position"].values[primaries], sizes[rows], s["bond"].values[links], bonds[rows]

    def _radii(self, snapshot: int) -> NDArray[np.float64] | None:
        """Radii (sum P,) [m] of the primaries of a snapshot; None where the suspension has only one."""
        if "radius" not in self._snapshots:
            return None
        first = int(self._snapshots["size"].values[: self._first(snapshot)].sum())
        return np.asarray(self._snapshots["radius"].values[first : first + self._ragged(snapshot)[1].sum()])

    def population(
        self, snapshot: int = -1, inertia: Inertia = "points", rigidity: bool = True
    ) -> xr.Dataset:
        """Morphology of every aggregate of a snapshot, over ``aggregate``; computed once."""
        key = (snapshot % len(self.snapshot_times), inertia, rigidity)
        if key not in self._populations:
            self._populations[key] = self._population(*key)
        return self._populations[key].copy()

    def _population(self, snapshot: int, inertia: Inertia, rigidity: bool) -> xr.Dataset:
        positions, sizes, bonds, counts = self._ragged(snapshot)
        found = population_morphology(
            positions, sizes, bonds, counts, self.radius, inertia, rigidity, self._radii(snapshot)
        )
        return found.assign_attrs(time=float(self.snapshot_times[snapshot]), stress=self.stress)

    def geometry(self, aggregate: int, snapshot: int = -1) -> tuple[NDArray[np.float64], NDArray[np.integer]]:
        """Positions (P, 3) [m] and bonds (n_b, 2) of one aggregate of a snapshot."""
        positions, sizes, bonds, counts = self._ragged(snapshot)
        first, first_bond = int(sizes[:aggregate].sum()), int(counts[:aggregate].sum())
        return (
            positions[first : first + sizes[aggregate]],
            bonds[first_bond : first_bond + counts[aggregate]],
        )

    def aggregates(self, snapshot: int = -1) -> list[Aggregate]:
        """Every aggregate of a snapshot, with the history of its contacts where these have one."""
        positions, sizes, bonds, counts = self._ragged(snapshot)
        ends, links = np.cumsum(sizes), np.cumsum(counts)
        springs: Sequence[NDArray[np.float64] | None] = [None] * len(sizes)
        if "spring" in self._snapshots:
            before = int(self._snapshots["number_of_bonds"].values[: self._first(snapshot)].sum())
            histories = self._snapshots["spring"].values[before : before + counts.sum()]
            springs = np.split(histories, links[:-1])
        radii = self._radii(snapshot)
        each = [None] * len(sizes) if radii is None else np.split(radii, ends[:-1])
        return [
            Aggregate(positions[end - size : end], bonds[link - count : link].astype(np.int32), spring, own)
            for end, size, link, count, spring, own in zip(
                ends, sizes, links, counts, springs, each, strict=True
            )
        ]

    def _first(self, snapshot: int) -> int:
        """First row of the aggregates of a snapshot."""
        numbers = self._snapshots["number_of_aggregates"].values
        return int(numbers[: snapshot % len(numbers)].sum())

    @cached_property
    def late_snapshots(self) -> list[int]:
        """Indices of the snapshots of the steady stretch; at least the last one."""
        late = np.flatnonzero(self.snapshot_times >= self.steady.start)
        return late.tolist() or [len(self.snapshot_times) - 1]


def origins(population: xr.Dataset) -> NDArray[np.intp]:
    """(aggregate,) which aggregates of a population are copies of one another (`statistics.origins_of`).

    Parameters
    ----------
    population : xarray.Dataset
        Of `RunDataset.population`.

    Returns
    -------
    (aggregate,) integers
        The same for copies.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset, origins
    >>> last = RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc").population(-1, rigidity=False)
    >>> label = origins(last)
    >>> len(label), len(set(label.tolist()))
    (150, 120)
    """
    return origins_of(
        *(population[name].values for name in ("size", "bond_count", "radius_of_gyration", "outer_radius"))
    )


def pool(datasets: Iterable[xr.Dataset], dim: str) -> xr.Dataset:
    """Rows of several replicas one after another.

    Parameters
    ----------
    datasets : iterable of xarray.Dataset
        Of replicas, of the same variables.
    dim : str
        Dimension along which they are joined.

    Returns
    -------
    xarray.Dataset
        All rows.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset, pool
    >>> run = RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc")
    >>> late = pool((run.population(s, rigidity=False) for s in (-2, -1)), "aggregate")
    >>> late.sizes["aggregate"] == sum(len(run.aggregates(s)) for s in (-2, -1))
    True
    """
    return xr.concat(list(datasets), dim, combine_attrs="drop_conflicts", join="exact")


OF_REPLICAS = ("suspension", "flow", "effects", "hydrodynamics", "numerics", "population.restructuring")
"""Tables and keys of the scene that replicas share: all that decides what becomes of an aggregate."""


def by_stress(runs: Iterable[RunDataset]) -> dict[float, list[RunDataset]]:
    """Replicas together, by rising shear stress [Pa].

    Parameters
    ----------
    runs : iterable of RunDataset
        Replicas, in any order.

    Returns
    -------
    dict
        {stress [Pa]: its runs}.

    Raises
    ------
    UserError
        Where two runs of one stress differ in more than seed, sample and end: they are no replicas.

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.analysis import by_stress
    >>> runs = [mcdem.open_run(f"notebooks/data/run-{name}.nc") for name in ("1250Pa", "1500Pa-of-100")]
    >>> list(by_stress(runs))
    [1250.0, 1500.0]
    """
    groups: dict[float, list[RunDataset]] = {}
    for run in sorted(runs, key=lambda run: run.stress):
        group = groups.setdefault(round(run.stress, 6), [])
        for name in OF_REPLICAS:
            if group and attrgetter(name)(group[0].scene) != attrgetter(name)(run.scene):
                raise UserError(
                    f"{group[0].path} and {run.path}: both of {run.label}, but [{name}] of their scenes differs; "
                    "take them one at a time"
                )
        group.append(run)
    return groups


def pooled_breakups(runs: Sequence[RunDataset], convention: Convention) -> dict[str, float]:
    """`breakup.summarise` over the steady stretches of replicas.

    Parameters
    ----------
    runs : sequence of RunDataset
        Replicas.
    convention : {"paper", "strict", "own"}
        What counts as breakup, see `mcdem.analysis.breakups`.

    Returns
    -------
    dict
        {name: value}, with 95 % limits.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset, pooled_breakups
    >>> run = RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc")
    >>> found = pooled_breakups([run], "paper")
    >>> f"erosion: {found['erosion_share']:.2f} of the breakups"
    'erosion: 0.00 of the breakups'
    """
    return summarise(pool([run.late_breakups for run in runs], "breakup"), convention)
