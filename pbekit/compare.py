"""A balance beside what it came from and beside analytical laws.

Three accounts of one suspension: the balance on tabulated encounters, the Monte Carlo that the encounters came from, and a
balance of analytical laws (van de Ven & Mason's efficiency with power-law breakup).  Where the first two differ, switches
tell why: each changes one assumption of the balance and leaves the rest.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from scipy import optimize, stats

from pbekit.balance import PopulationBalance
from pbekit.between import Between, stress_of
from pbekit.breakage import PowerLawRate, TwoPeak
from pbekit.closures import Closure, grid_for
from pbekit.efficiencies import attraction_number
from pbekit.encounters import Aggregation, Breakage, Event
from pbekit.errors import PBEError
from pbekit.finite import population_course
from pbekit.grid import Grid
from pbekit.solve import integrate
from pbekit.steady import SteadyState, steady_state
from pbekit.tables import AGGREGATION, UNRESOLVED, KernelTable, size_classes
from pbekit.uncertainty import LEVEL, band, course_output, draws_of, steady_output, steady_summary

STEADY_SHARE = 0.4
"""The last part of a run that counts as its steady state."""
SUMMARY = ("mean_size", "relative_deviation", "sauter_diameter")
COURSE = (("mean_size", "1"), ("size_deviation", "1"), ("sauter_diameter", "m"))
BLOCKS = 8
"""A steady stretch is cut into so many blocks; the spread of their means is the error of its mean."""


@dataclass(frozen=True)
class MonteCarlo:
    """What a dataset of `mcdem run` says of sizes.

    time (t,) [s]; mean_size, size_deviation, sauter_diameter (t,)
    steady : mean and standard error of each over the last part; trend : slope of <P> there over its standard error
    share (sizes + 1,) : number share of each size in the snapshots of that part; share_error : its standard error
    """

    path: Path
    scene: str
    time: np.ndarray
    mean_size: np.ndarray
    size_deviation: np.ndarray
    sauter_diameter: np.ndarray
    steady: dict[str, tuple[float, float]]
    trend: float
    share: np.ndarray
    share_error: np.ndarray
    initial: int

    @property
    def is_steady(self) -> bool:
        """Whether <P> shows no trend over the last part: its slope through block means is within 3 standard errors."""
        return abs(self.trend) <= 3.0

    @classmethod
    def read(cls, path: Path | str) -> MonteCarlo:
        """Read a run's series and snapshots."""
        try:
            with (
                xr.open_dataset(path, decode_times=False) as root,
                xr.open_dataset(path, group="snapshots", decode_times=False) as snapshots,
            ):
                root.load()
                snapshots.load()
        except (OSError, ValueError, KeyError) as problem:
            raise PBEError(f"{path}: no dataset of mcdem run ({str(problem).splitlines()[0]})") from None
        time = root.time.values
        late = time >= (1 - STEADY_SHARE) * time[-1]
        values = {
            "mean_size": root.mean_size.values,
            "relative_deviation": root.size_deviation.values / root.mean_size.values,
            "sauter_diameter": root.sauter_diameter.values,
        }
        blocks = {name: _blocks(time[late], v[late]) for name, v in values.items()}
        steady = {name: _mean_and_error(b) for name, b in blocks.items()}
        numbers = snapshots.number_of_aggregates.values
        of_aggregate = np.repeat(np.arange(len(numbers)), numbers)
        chosen = snapshots.time.values[of_aggregate] >= (1 - STEADY_SHARE) * time[-1]
        size, snapshot = snapshots["size"].values[chosen], of_aggregate[chosen]
        used = np.unique(snapshot)
        each = np.stack(
            [np.bincount(size[snapshot == s], minlength=size.max() + 1) / (snapshot == s).sum() for s in used]
        )
        share = each.mean(axis=0)
        # Snapshots share aggregates; their number is no more than that of independent ones.
        error = (
            each.std(axis=0, ddof=1) / np.sqrt(len(used)) if len(used) > 1 else np.full(share.shape, np.nan)
        )
        return cls(
            Path(path),
            str(root.attrs.get("scene", "")),
            time,
            root.mean_size.values,
            root.size_deviation.values,
            root.sauter_diameter.values,
            steady,
            _trend(blocks["mean_size"]),
            share,
            error,
            int(root.number_of_aggregates.values[0]),
        )

    def at(self, name: str, times: np.ndarray) -> np.ndarray:
        """A series at given times: the last value before."""
        row = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, len(self.time) - 1)
        return np.asarray(getattr(self, name))[row]


def _blocks(time, values) -> np.ndarray:
    """Time averages over the blocks of a stretch."""
    means = []
    for low, high in itertools.pairwise(np.linspace(time[0], time[-1], BLOCKS + 1)):
        inside = np.flatnonzero((time >= low) & (time <= high))
        if inside.size > 1 and time[inside[-1]] > time[inside[0]]:
            means.append(np.trapezoid(values[inside], time[inside]) / (time[inside[-1]] - time[inside[0]]))
    return np.array(means or [values[-1]])


def _mean_and_error(blocks: np.ndarray) -> tuple[float, float]:
    error = blocks.std(ddof=1) / np.sqrt(len(blocks)) if len(blocks) > 1 else np.nan
    return float(blocks.mean()), float(error)


def _trend(blocks: np.ndarray) -> float:
    """Slope of a line through block means over its standard error; inf if there are too few."""
    if len(blocks) < 4:
        return np.inf
    line = stats.linregress(np.arange(len(blocks)), blocks)
    return float(line.slope / line.stderr) if line.stderr > 0 else 0.0


# -- the balance on a table ---------------------------------------------------------------------------------------------


def start_of(grid: Grid, table: KernelTable, volume_fraction: float | None = None) -> np.ndarray:
    """(K,) free primaries at the volume fraction of the table's scene [1/m^3]."""
    phi = table.about.get("volume_fraction") if volume_fraction is None else volume_fraction
    if phi is None:
        raise PBEError("the table does not say its volume fraction; give one")
    return grid.monodisperse(float(phi) / (4 / 3 * np.pi * table.radius**3))


def eta_11(table: KernelTable) -> tuple[float, float, float]:
    """Efficiency of two primaries: share that aggregated, and its 90 % interval (Jeffreys)."""
    r = table.records
    pair = (r.size == 1).all(axis=1) & (r.outcome != UNRESOLVED)
    n, k = int(pair.sum()), int((r.outcome[pair] == AGGREGATION).sum())
    tail = 0.5 * (1 - LEVEL)
    posterior = stats.beta(k + 0.5, n - k + 0.5)
    return (k / n if n else np.nan), float(posterior.ppf(tail)), float(posterior.ppf(1 - tail))


def van_de_ven_mason_of(table: KernelTable, prefactor: float = 0.95) -> float:
    """Eq. 23 for the table's scene; no warning here, the comparison is the point."""
    about = table.about
    if "hamaker_constant" not in about or "viscosity" not in about:
        raise PBEError("the table does not say hamaker_constant and viscosity, which Eq. 23 needs")
    attraction = attraction_number(
        float(about["hamaker_constant"]), float(about["viscosity"]), table.shear_rate, table.radius
    )
    return prefactor * attraction**0.18


@dataclass(frozen=True)
class AnalyticalBalance:
    """Encounters of Eq. 1 with one efficiency, and first-order breakup S = c (P - 1)^power into two pieces.

    efficiency : Eq. 23; radii : as tabulated; c : the one fitted number
    """

    grid: Grid
    encounter_rate: np.ndarray
    efficiency: float
    power: float
    rate: float

    def at(self, table: KernelTable, ratio: float, q: float) -> AnalyticalBalance:
        """The same laws for a table at `ratio` times the stress, breakup being a function of P/P_br, P_br ~ stress^-q."""
        grid, rate = _tabulated_encounters(table)
        rate_of_breakup = self.rate * ratio ** (self.power * q)
        return AnalyticalBalance(grid, rate, van_de_ven_mason_of(table), self.power, rate_of_breakup)

    def balance(self) -> PopulationBalance:
        events: list[Event] = [
            Aggregation(self.efficiency * self.encounter_rate),
            Breakage(PowerLawRate(self.rate, self.power, offset=1), TwoPeak(0.35, 20.0)),
        ]
        return PopulationBalance(self.grid, events, edge="closed")

    @classmethod
    def fitted(cls, table: KernelTable, mean_size: float, power: float = 2.0) -> AnalyticalBalance:
        """c such that the steady <P> is `mean_size`; everything else is given."""
        grid, rate = _tabulated_encounters(table)
        efficiency = van_de_ven_mason_of(table)
        start = start_of(grid, table)

        def off(log_c):
            trial = cls(grid, rate, efficiency, power, float(np.exp(log_c)))
            n = steady_state(trial.balance(), start).population
            return n @ grid.mass / n.sum() - mean_size

        # Where an aggregate of the wanted size meets a partner about as often as it breaks; then out to both sides.
        low = high = float(np.log(efficiency * rate[0, 0] * start.sum() / mean_size**power))
        while off(low) < 0:
            low -= 1.5
        while off(high) > 0:
            high += 1.5
        c = optimize.brentq(off, low, high, xtol=1e-3)
        return cls(grid, rate, efficiency, power, float(np.exp(c)))


def _tabulated_encounters(table: KernelTable) -> tuple[Grid, np.ndarray]:
    """Sizes with their mean radii, and the rate at which they meet (K, K) [m^3/s]."""
    closure = Closure(table, grid_for(table, shapes=None))
    weight = closure.weights(None)
    grid = closure.grid.with_outer_radius(closure.radius_moments(weight)[0])
    return grid, closure.encounter_rate(weight)


def settling_time(balance: PopulationBalance, start: np.ndarray, mean_size: float) -> float:
    """Time [s] after which <P> stays within 2 % of its steady value."""
    rate = balance.rhs(0.0, balance.state(start))[: balance.cells].sum()
    span = 20.0 * start.sum() / abs(rate)
    while True:
        times = np.linspace(0, span, 61)
        n = integrate(balance, start, times, rtol=1e-5)[:, : balance.cells]
        off = np.abs(n @ balance.grid.mass / n.sum(axis=1) / mean_size - 1) > 0.02
        if not off[-15:].any():
            return float(times[np.flatnonzero(off)[-1]])
        span *= 2


# -- switches -------------------------------------------------------------------------------------------------------------


def _classed(table: KernelTable, size_edges, shape_edges, shape_name: str) -> KernelTable:
    """The same encounters in other classes."""
    return KernelTable(
        table.records, size_edges, shape_edges, table.radius, table.shear_rate, shape_name, table.about
    )


def switches(table: KernelTable) -> Iterator[tuple[str, Callable[[], Closure], str]]:
    """(name, closure, scheme): one assumption of the balance changed in each."""

    def reclassed(ratio):
        edges = size_classes(int(table.records.size.max()), ratio)
        finer = _classed(table, edges, table.shape_edges, table.shape_name)
        return Closure(finer, grid_for(finer))

    def reshaped(shapes, shape_name):
        edges = KernelTable.of(
            table.records, table.radius, table.shear_rate, shapes=shapes, shape_name=shape_name
        ).shape_edges
        other = _classed(table, table.size_edges, edges, shape_name)
        return Closure(other, grid_for(other))

    yield "as tabulated", lambda: Closure(table, grid_for(table)), "fixed pivot"
    if table.shape_edges is not None:
        yield (
            "products forget the parents' shape",
            lambda: Closure(table, grid_for(table), memory=False),
            "fixed pivot",
        )
        twice = 2 * table.shapes
        yield f"{twice} classes of shape", lambda: reshaped(twice, table.shape_name), "fixed pivot"
        other = "outer radius" if table.shape_name != "outer radius" else "aspect ratio"
        yield f"shapes told apart by {other}", lambda: reshaped(table.shapes, other), "fixed pivot"
        yield "one mean shape per size", lambda: Closure(table, grid_for(table, shapes=None)), "fixed pivot"
    yield "outcomes by the fitted law alone", lambda: Closure(table, grid_for(table), "smooth"), "fixed pivot"
    yield "size classes half as wide", lambda: reclassed(1.16), "fixed pivot"
    yield "size classes twice as wide", lambda: reclassed(1.8), "fixed pivot"
    yield "exact sizes to 48", lambda: Closure(table, grid_for(table, exact_to=48)), "fixed pivot"
    yield "cell average", lambda: Closure(table, grid_for(table)), "cell average"
    designed = table.records.source == 1
    if designed.any() and not designed.all():
        only = table.with_records(table.records.select(~designed))
        yield "the run's encounters alone", lambda: Closure(only, grid_for(only)), "fixed pivot"


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """Total variation distance of two distributions: the share of aggregates that would have to change size."""
    return float(0.5 * np.abs(one - other).sum())


def _to_32(share: np.ndarray) -> np.ndarray:
    """Shares of sizes 1 ... 32, which every grid here has one by one, and of all beyond."""
    return np.append(np.pad(share[:32], (0, max(0, 32 - share.size))), share[32:].sum())


def switch_table(
    table: KernelTable,
    initial: int,
    duration: float,
    times: np.ndarray,
    late: float,
    counted: np.ndarray | None = None,
    replicas: int = 8,
) -> xr.Dataset:
    """What each switch, and a population of the run's size, make of the balance.

    Steady <P>, relative deviation and d32; <P> at the last of `times`; and, given the shares `counted` (sizes + 1,) of a
    run from `late` [s] on, the distance of the shares then from them.
    """
    names, rows = [], []
    off = lambda share: np.nan if counted is None else distance(_to_32(share), _to_32(counted[1:]))
    for name, make, scheme in switches(table):
        closure = make()
        balance = closure.balance(scheme=scheme)
        start = start_of(closure.grid, table)
        found = steady_summary(balance, steady_state(balance, start).population)
        then = course_output(start, times, share_from=late, rtol=1e-5)(balance)
        names.append(name)
        rows.append(
            [float(found[key]) for key in SUMMARY] + [float(then["mean_size"][-1]), off(then["late_share"])]
        )
    closure = Closure(table, grid_for(table))
    phi = float(table.about["volume_fraction"])
    settled = population_course(
        closure, phi, np.linspace(0, duration, 101), initial=initial, replicas=replicas
    ).isel(time=slice(60, None))
    early = population_course(
        closure, phi, times, initial=initial, replicas=4 * replicas, steady_from=late
    ).mean("replica")
    names.append(f"a finite population of {initial}")
    deviation = (settled.size_deviation / settled.mean_size).mean()
    values = (settled.mean_size.mean(), deviation, settled.sauter_diameter.mean(), early.mean_size[-1])
    rows.append([float(v) for v in values] + [off(early.share.values[1:])])
    columns = (*SUMMARY, "end_mean_size", "late_distance")
    return xr.Dataset(
        {c: ("switch", [row[k] for row in rows]) for k, c in enumerate(columns)},
        {"switch": names},
        {"until": float(times[-1])},
    )


# -- comparison ------------------------------------------------------------------------------------------------------------


def efficiencies(tables: list[KernelTable]) -> xr.Dataset:
    """eta_11 of each table with its interval, and Eq. 23, against stress."""
    stress = np.array([stress_of(t) for t in tables])
    order = np.argsort(stress)
    counted = np.array([eta_11(tables[k]) for k in order])
    law = [van_de_ven_mason_of(tables[k]) if "hamaker_constant" in tables[k].about else np.nan for k in order]
    columns = {
        "eta_11": counted[:, 0],
        "eta_11_low": counted[:, 1],
        "eta_11_high": counted[:, 2],
        "equation_23": law,
    }
    data = xr.Dataset({n: ("stress", v, {"units": "1"}) for n, v in columns.items()})
    return data.assign_coords(stress=("stress", stress[order], {"units": "Pa"}))


@dataclass(frozen=True)
class Comparison:
    """The three accounts at one stress: `course` over time, `distribution` of sizes, `numbers`, `switches`.

    Bands: *_low, *_high hold 90 % of what the table leaves open; *_run_low, *_run_high 90 % of single runs of the Monte
    Carlo's size to come, table and finite population together.  `distribution`: density at steady state, late_density
    averaged over the last part of the run, steady or not; *_monte_carlo is of that part.
    """

    course: xr.Dataset
    distribution: xr.Dataset
    numbers: dict[str, float]
    switches: xr.Dataset
    table: KernelTable
    run: MonteCarlo | None
    steady: SteadyState


def compare(
    table: KernelTable,
    run: MonteCarlo | None,
    draws: int = 60,
    until: float | None = None,
    seed: int = 0,
    progress: Callable[[str, float], None] | None = None,
) -> Comparison:
    """Balance with bands, Monte Carlo and analytical balance of one suspension.

    until : [s], the run's end by default
    """
    tell = progress or (lambda what, share: None)
    if run is not None and run.scene and table.about.get("scene") not in (None, run.scene):
        raise PBEError(f"{run.path}: is of another scene than the table")
    if until is None:
        if run is None:
            raise PBEError("compare: without a run, say until when")
        until = float(run.time[-1])
    times = np.linspace(0.0, until, 121)
    closure = Closure(table, grid_for(table))
    start = start_of(closure.grid, table)
    tell("steady state", 0.05)
    steady = steady_state(closure.mean, start)
    mean = steady_summary(closure.mean, steady.population)
    late = (1 - STEADY_SHARE) * (until if run is None else min(until, float(run.time[-1])))
    both_course = course_output(start, times, share_from=late, rtol=1e-5)
    both_steady = steady_output(start, guess=steady.population)

    def output(balance):
        return {f"course_{k}": v for k, v in both_course(balance).items()} | dict(both_steady(balance))

    centre = output(closure.mean)
    drawn = draws_of(closure, output, draws, seed, lambda k: tell("draws", 0.05 + 0.5 * k / draws))
    replica = None
    if run is not None:
        replica = population_course(
            closure,
            float(table.about["volume_fraction"]),
            times,
            initial=run.initial,
            replicas=draws,
            seed=seed,
            steady_from=late,
            drawn=True,
            progress=lambda k: tell("single runs", 0.55 + 0.15 * k / draws),
        )
    settled = run is not None and run.is_steady
    target = run.steady["mean_size"][0] if run is not None and settled else float(mean["mean_size"])
    tell("analytical laws", 0.7)
    data: dict[str, tuple] = {}
    for key, unit in COURSE:
        low, high = band(drawn[f"course_{key}"].values)
        data |= {
            key: ("time", centre[f"course_{key}"], {"units": unit}),
            f"{key}_low": ("time", low, {"units": unit}),
            f"{key}_high": ("time", high, {"units": unit}),
        }
        if run is not None:
            data[f"{key}_monte_carlo"] = ("time", run.at(key, times), {"units": unit})
        if replica is not None:
            for end, values in zip(("low", "high"), band(replica[key].values), strict=True):
                data[f"{key}_run_{end}"] = ("time", values, {"units": unit})
    numbers: dict[str, float] = {}
    for key in SUMMARY:
        low, high = band(drawn[key].values)
        numbers |= {key: float(mean[key]), f"{key}_low": float(low), f"{key}_high": float(high)}
        if run is not None and settled:
            numbers[f"{key}_monte_carlo"], numbers[f"{key}_monte_carlo_error"] = run.steady[key]
    numbers["eta_11"], numbers["eta_11_low"], numbers["eta_11_high"] = eta_11(table)
    numbers["extrapolated_flux"] = closure.extrapolated_flux(steady.population)
    numbers["unresolved"] = closure.unresolved
    numbers["edge_flux"] = closure.mean.edge_flux(steady.population)
    if run is not None:
        # At the end of the run, steady or not.
        low, high = band(drawn["course_mean_size"].values[:, -1])
        numbers |= {
            "end": until,
            "end_mean_size": float(centre["course_mean_size"][-1]),
            "end_mean_size_low": float(low),
            "end_mean_size_high": float(high),
            "end_mean_size_monte_carlo": float(run.at("mean_size", times[-1:])[0]),
        }
        for end in ("run_low", "run_high"):
            numbers[f"end_mean_size_{end}"] = float(data[f"mean_size_{end}"][1][-1])

    grid = closure.grid
    width = np.diff(grid.edges)
    shares = {
        **_banded("density", np.asarray(mean["share"]), drawn["share"].values, width),
        **_banded("late_density", centre["course_late_share"], drawn["course_late_share"].values, width),
    }
    if "hamaker_constant" in table.about:
        analytical = AnalyticalBalance.fitted(table, target)
        laws = analytical.balance()
        law_start = start_of(analytical.grid, table)
        course = course_output(law_start, times, share_from=late, rtol=1e-5)(laws)
        for key, unit in COURSE:
            data[f"{key}_analytical"] = ("time", course[key], {"units": unit})
        law_mean = steady_summary(laws, steady_state(laws, law_start).population)
        shares["density_analytical"] = ("size", np.asarray(law_mean["share"]) / width)
        shares["late_density_analytical"] = ("size", course["late_share"] / width)
        numbers |= {
            "eta_11_equation_23": analytical.efficiency,
            "mean_size_analytical": float(law_mean["mean_size"]),
            "relative_deviation_analytical": float(law_mean["relative_deviation"]),
            "sauter_diameter_analytical": float(law_mean["sauter_diameter"]),
            "breakup_rate_analytical": analytical.rate,
        }
    if run is not None and replica is not None:
        low, high = band(np.stack([_on_grid(one, grid) for one in replica.share.values]))
        shares["late_density_run_low"] = ("size", low / width)
        shares["late_density_run_high"] = ("size", high / width)
        counted = _on_grid(run.share, grid)
        shares["density_monte_carlo"] = ("size", counted / width)
        shares["density_monte_carlo_error"] = (
            "size",
            np.sqrt(_on_grid(np.nan_to_num(run.share_error) ** 2, grid)) / width,
        )
        for key, _ in COURSE:
            numbers[f"{key}_inside"] = _inside(*(data[f"{key}_{of}"][1][1:] for of in RUN_BAND))
        # A class in which neither is expected says nothing.
        told = (counted > 0) | (high > 0)
        numbers["late_share_inside"] = _inside(counted[told], low[told], high[told])
        numbers["late_from"] = late
        own = _to_32(centre["course_late_share"])
        numbers["late_distance"] = distance(own, _to_32(run.share[1:]))
        chance = [distance(own, _to_32(one[1:])) for one in replica.share.values]
        numbers["late_distance_run_high"] = float(np.quantile(chance, LEVEL))
    distribution = xr.Dataset(shares, {"size": grid.pivots}, {"steady_run": int(settled)})
    tell("switches", 0.8)
    duration = max(until, 1.5 * settling_time(closure.mean, start, float(mean["mean_size"])))
    switched = switch_table(
        table,
        run.initial if run is not None else 200,
        duration,
        times,
        late,
        run.share if run is not None else None,
    )
    tell("done", 1.0)
    return Comparison(
        xr.Dataset(data, {"time": ("time", times, {"units": "s"})}),
        distribution,
        numbers,
        switched,
        table,
        run,
        steady,
    )


RUN_BAND = ("monte_carlo", "run_low", "run_high")


def _inside(values: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """Share of the values within their band."""
    return float(((values >= low) & (values <= high)).mean())


def _banded(name: str, centre: np.ndarray, drawn: np.ndarray, width: np.ndarray) -> dict[str, tuple]:
    low, high = band(drawn)
    columns = {name: centre, f"{name}_low": low, f"{name}_high": high}
    return {n: ("size", v / width) for n, v in columns.items()}


def _on_grid(per_size: np.ndarray, grid: Grid) -> np.ndarray:
    """(S,) sums over the classes of values per whole size 0, 1, 2 ..."""
    edges = np.round(grid.edges + 0.5).astype(int)
    padded = np.append(per_size, np.zeros(max(0, edges[-1] + 1 - per_size.size)))
    return np.array([padded[a:b].sum() for a, b in itertools.pairwise(edges)])


def volume_fractions(table: KernelTable, mean_size: float, factors=(0.25, 0.5, 1.0, 2.0, 4.0)) -> xr.Dataset:
    """Steady <P> against volume fraction: tabulated (breakup on encounter) and analytical (first order)."""
    closure = Closure(table, grid_for(table))
    phi = float(table.about["volume_fraction"]) * np.asarray(factors)
    tabulated, first_order, laws, law_grid = [], [], None, closure.grid
    if "hamaker_constant" in table.about:
        analytical = AnalyticalBalance.fitted(table, mean_size)
        laws, law_grid = analytical.balance(), analytical.grid
    for value in phi:
        n = steady_state(closure.mean, start_of(closure.grid, table, value)).population
        tabulated.append(n @ closure.grid.mass / n.sum())
        if laws is not None:
            n = steady_state(laws, start_of(law_grid, table, value)).population
            first_order.append(n @ law_grid.mass / n.sum())
    data = {"tabulated": ("volume_fraction", tabulated)}
    if first_order:
        data["analytical"] = ("volume_fraction", first_order)
    return xr.Dataset(data, {"volume_fraction": phi})


def breakup_size(closure: Closure, rng: np.random.Generator | None = None) -> float:
    """P_br: joint size at which half of the encounters that join or scatter scatter, among encounters with equal partners.

    By the fitted law, so that it is defined for any table.
    """
    law = closure.law if rng is None else closure.law.drawn(rng)
    size = np.geomspace(1.5, 2000, 400)
    records, table = closure.records, closure.table
    seen = np.log(records.shape(table.shape_name, table.radius)[records.size > 2])
    typical = np.exp(np.nanmean(seen)) if closure.grid.shapes > 1 else np.nan
    shape = np.where(size > 2, typical, np.nan)
    p = law(law.features(size, size, shape, shape))
    share = p[:, 2] / (p[:, 1] + p[:, 2])
    above = np.flatnonzero(share > 0.5)
    return float(2 * size[above[0]]) if above.size else np.nan


def stress_law(
    tables: list[KernelTable], draws: int = 60, progress: Callable[[float], None] | None = None
) -> xr.Dataset:
    """Steady <P>, d32 and breakup size against stress with bands, and the exponent q of each, X ~ stress^-q.

    *_interpolated : steady <P> and d32 from the tables at the next lower and the next higher stress alone, with bands; nan
    at the ends, which have no two neighbours
    *_analytical : van de Ven & Mason's efficiency with power-law breakup, which is given <P> at the stress with most
    encounters (attribute `reference`) and P_br ~ stress^-ANALYTICAL_Q; extrapolated : share of encounters in pairs of
    classes nobody sampled; breakup_beyond : whether P_br is larger than any two partners together were
    """
    if len(tables) < 2:
        raise PBEError("a law over stresses needs tables at two stresses or more")
    stress = np.array([stress_of(t) for t in tables])
    order = np.argsort(stress)
    stress, tables = stress[order], [tables[k] for k in order]
    values: dict[str, list] = {name: [] for name in OVER_STRESSES}
    extrapolated, beyond, interpolated = [], [], []
    for k, table in enumerate(tables):
        closure = Closure(table, grid_for(table))
        start = start_of(closure.grid, table)
        steady = steady_state(closure.mean, start)
        mean = steady_summary(closure.mean, steady.population)
        drawn = draws_of(closure, steady_output(start, guess=steady.population), draws, seed=k)
        for name in ("mean_size", "sauter_diameter"):
            values[name].append(np.append(mean[name], drawn[name].values))
        rng = np.random.default_rng(k)
        values["breakup_size"].append(
            [breakup_size(closure)] + [breakup_size(closure, rng) for _ in range(draws)]
        )
        interpolated.append(
            _from_neighbours(tables[k - 1], tables[k + 1], stress[k], draws, k)
            if 0 < k < len(tables) - 1
            else {}
        )
        extrapolated.append(closure.extrapolated_flux(steady.population))
        beyond.append(values["breakup_size"][-1][0] > table.records.size.sum(axis=1).max())
        if progress is not None:
            progress((k + 1) / len(tables))
    found = xr.Dataset(
        {"extrapolated": ("stress", extrapolated), "breakup_beyond": ("stress", beyond)},
        {"stress": ("stress", stress, {"units": "Pa"})},
    )
    for name, rows in values.items():
        each = np.array(rows)
        low, high = np.nanquantile(each[:, 1:], [0.05, 0.95], axis=1)
        bands = {name: each[:, 0], f"{name}_low": low, f"{name}_high": high}
        found = found.assign({n: ("stress", v, {"units": OVER_STRESSES[name]}) for n, v in bands.items()})
        q = -np.polyfit(np.log(stress), np.log(each), 1)[0]
        found.attrs |= {
            f"q_{name}": q[0],
            f"q_{name}_low": np.nanquantile(q[1:], 0.05),
            f"q_{name}_high": np.nanquantile(q[1:], 0.95),
        }
    if all("hamaker_constant" in t.about for t in tables):
        found = found.merge(_analytical_over_stresses(tables, stress, found.mean_size.values))
        for name in ("mean_size", "sauter_diameter"):
            slope = np.polyfit(np.log(stress), np.log(found[f"{name}_analytical"].values), 1)[0]
            found.attrs[f"q_{name}_analytical"] = -slope
        found.attrs["reference"] = stress[_most_encounters(tables)]
    if len(tables) > 2:
        for name in interpolated[1]:
            unit = {"units": OVER_STRESSES[name.partition("_interpolated")[0]]}
            found[name] = ("stress", [row.get(name, np.nan) for row in interpolated], unit)
    return found


def _from_neighbours(
    lower: KernelTable, upper: KernelTable, stress: float, draws: int, seed: int
) -> dict[str, float]:
    """Steady <P> and d32 [m] at a stress [Pa] from tables below and above it, with their bands."""
    closure = Between(lower, upper, stress)
    start = start_of(closure.grid, lower)
    steady = steady_state(closure.mean, start)
    mean = steady_summary(closure.mean, steady.population)
    drawn = draws_of(closure, steady_output(start, guess=steady.population), draws, seed=seed)
    found: dict[str, float] = {}
    for name in ("mean_size", "sauter_diameter"):
        low, high = band(drawn[name].values)
        found |= {
            f"{name}_interpolated": float(mean[name]),
            f"{name}_interpolated_low": float(low),
            f"{name}_interpolated_high": float(high),
        }
    return found


OVER_STRESSES = {"mean_size": "1", "breakup_size": "1", "sauter_diameter": "m"}
ANALYTICAL_Q = 2.0
"""Exponent of the breakup size of analytical laws: what the paper finds (section 3), and others of compact aggregates."""


def _most_encounters(tables: list[KernelTable]) -> int:
    return int(np.argmax([len(t.records) for t in tables]))


def _analytical_over_stresses(tables, stress, mean_size) -> xr.Dataset:
    """Steady <P> and d32 of the analytical balance that is right at one stress."""
    reference = _most_encounters(tables)
    fitted = AnalyticalBalance.fitted(tables[reference], float(mean_size[reference]))
    rows = []
    for table, value in zip(tables, stress, strict=True):
        laws = fitted.at(table, value / stress[reference], ANALYTICAL_Q)
        balance = laws.balance()
        rows.append(steady_summary(balance, steady_state(balance, start_of(laws.grid, table)).population))
    names = ("mean_size", "sauter_diameter")
    return xr.Dataset({f"{n}_analytical": ("stress", [float(row[n]) for row in rows]) for n in names})
