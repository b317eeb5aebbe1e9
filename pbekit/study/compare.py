"""A balance beside what it came from and beside analytical laws.

Three accounts of one suspension: the balance on tabulated encounters, the Monte Carlo that the encounters came from, and a
balance of analytical laws (van de Ven & Mason's efficiency with power-law breakup).  Where the first two differ, the ablation
shows why: each entry changes one assumption of the balance and leaves the rest.
"""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from pbekit import arguments
from pbekit.arguments import LEVEL
from pbekit.balance.grid import Grid
from pbekit.balance.population_balance import PopulationBalance
from pbekit.errors import PBEError
from pbekit.estimated_rates.estimated_rates import EstimatedRates, grid_for, start_of
from pbekit.solution.finite_population import population_course
from pbekit.solution.steady import SteadyState, steady_state
from pbekit.study.ablation import SUMMARY, ablation_table, distance, settling_time, to_32
from pbekit.study.analytical import AnalyticalBalance
from pbekit.study.evidence import supported_steady_state
from pbekit.study.monte_carlo import STEADY_SHARE, MonteCarlo
from pbekit.study.uncertainty import band, course_output, draws_of, eta_11, steady_output, steady_summary
from pbekit.tables.kernel_table import KernelTable

COURSE = (("mean_size", "1"), ("size_deviation", "1"), ("sauter_diameter", "m"))


@dataclass(frozen=True)
class Comparison:
    """The three accounts at one stress: `course` over time, `distribution` of sizes, `numbers`, `ablation`.

    Bands: *_low, *_high hold 90 % of what the table leaves open; *_run_low, *_run_high 90 % of single runs of the Monte
    Carlo's size to come, table and finite population together.  `distribution`: density at steady state, late_density
    averaged over the last part of the run, steady or not; *_monte_carlo is of that part.  Where encounters that were seen do
    not bear a steady state, nothing of one is in here, and `no_steady_state` says what is missing.
    """

    course: xr.Dataset
    distribution: xr.Dataset
    numbers: dict[str, float]
    ablation: xr.Dataset
    table: KernelTable
    run: MonteCarlo | None
    steady: SteadyState | None
    no_steady_state: str = ""


OF_THE_SAMPLE = {
    "run": ("until", "events", "seed", "snapshot_every"),
    "population": ("initial", "doubling_below"),
}
"""Keys of a scene that say how much of a suspension was followed, not what it does."""


def other_tables(one: str, other: str) -> list[str]:
    """The tables in which two scene files (TOML) differ by what a suspension does, as they are written."""
    scenes = [tomllib.loads(text) for text in (one, other)]
    for scene in scenes:
        for name, keys in OF_THE_SAMPLE.items():
            scene[name] = {k: v for k, v in scene.get(name, {}).items() if k not in keys}
    first, second = scenes
    return sorted(name for name in first.keys() | second.keys() if first.get(name) != second.get(name))


def run_of_each(tables: Sequence[KernelTable], runs: Sequence[MonteCarlo]) -> list[MonteCarlo | None]:
    """The run of each table's own scene, None where there is none; raises `PBEError` for a run of no table's scene."""
    by_scene = {run.scene: run for run in runs}
    scenes = [str(table.about.get("scene")) for table in tables]
    for run in runs:
        if run.scene not in scenes:
            raise PBEError(f"{run.path}: none of the tables is of its scene")
    return [by_scene.get(scene) for scene in scenes]


def compare_table(
    table: KernelTable,
    run: MonteCarlo | None,
    draws: int = 60,
    until: float | None = None,
    seed: int = 0,
    progress: Callable[[str, float], None] | None = None,
) -> Comparison:
    """Balance with bands, Monte Carlo and analytical balance of one suspension.

    Parameters
    ----------
    table : KernelTable
        Encounters of one suspension.
    run : MonteCarlo
        Of the same scene, None without.
    draws : int
        19 or more, for the bands.
    until : float
        [s], the run's end by default.
    seed : int
        Of the draws.
    progress : callable
        Called with what is being done and the share that is done.

    Returns
    -------
    Comparison
        Datasets and numbers, in SI units.

    Raises
    ------
    PBEError : of a run of another scene, or arguments that cannot be meant

    Examples
    --------
    >>> import mcdem
    >>> import pbekit
    >>> from pbekit.study import MonteCarlo
    >>> path = "notebooks/data/run-1500Pa-of-100.nc"
    >>> table = mcdem.with_runs(pbekit.open_table("notebooks/data/designed-1500Pa.nc"), [mcdem.open_run(path)])
    >>> found = pbekit.compare_table(table, MonteCarlo.read(path), draws=19)
    >>> sorted(found.numbers)[:2]
    ['breakup_rate_analytical', 'edge_flux']
    """
    arguments.draws(draws)
    arguments.whole_number("seed", seed, 0, arguments.LARGEST_SEED)
    if until is not None:
        until = arguments.until(until)
    report = progress or (lambda what, share: None)
    if run is not None and run.scene and table.about.get("scene"):
        differs = other_tables(run.scene, str(table.about["scene"]))
        if differs:
            raise PBEError(f"{run.path}: [{']; ['.join(differs)}] of its scene is not that of the table")
    if until is None:
        if run is None:
            raise PBEError("compare: without a run, say until when")
        until = float(run.time[-1])
    times = np.linspace(0.0, until, 121)
    estimated = EstimatedRates(table, grid_for(table))
    start = start_of(estimated.grid, table)
    report("steady state", 0.05)
    steady, evidence = supported_steady_state(estimated, start)
    mean = None if steady is None else steady_summary(estimated.mean, steady.population)
    late = (1 - STEADY_SHARE) * (until if run is None else min(until, float(run.time[-1])))
    both_course = course_output(start, times, share_from=late, rtol=1e-5)
    both_steady = None if steady is None else steady_output(start, guess=steady.population)

    def output(balance: PopulationBalance) -> dict[str, Any]:
        found: dict[str, Any] = {f"course_{k}": v for k, v in both_course(balance).items()}
        return found if both_steady is None else found | dict(both_steady(balance))

    centre = output(estimated.mean)
    drawn = draws_of(estimated, output, draws, seed, lambda k: report("draws", 0.05 + 0.5 * k / draws))
    replica = None
    if run is not None:
        replica = population_course(
            estimated,
            float(table.about["volume_fraction"]),
            times,
            initial=run.initial,
            replicas=draws,
            seed=seed,
            steady_from=late,
            drawn=True,
            progress=lambda k: report("single runs", 0.55 + 0.15 * k / draws),
        )
    settled = run is not None and run.is_steady
    target = None if mean is None else float(mean["mean_size"])
    if run is not None and settled:
        target = run.steady["mean_size"][0]
    report("analytical laws", 0.7)
    data: dict[str, tuple[Any, ...]] = {}
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
        if mean is not None:
            low, high = band(drawn[key].values)
            numbers |= {key: float(mean[key]), f"{key}_low": float(low), f"{key}_high": float(high)}
        if run is not None and settled:
            numbers[f"{key}_monte_carlo"], numbers[f"{key}_monte_carlo_error"] = run.steady[key]
    numbers["eta_11"], numbers["eta_11_low"], numbers["eta_11_high"] = eta_11(table)
    numbers["unresolved"] = estimated.unresolved
    if steady is not None:
        numbers["extrapolated_flux"] = estimated.extrapolated_flux(steady.population)
        numbers["extrapolated_mass"] = estimated.extrapolated_changes(steady.population)[1]
        numbers["edge_flux"] = estimated.mean.edge_flux(steady.population)
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

    grid = estimated.grid
    width = np.diff(grid.edges)
    shares = _banded("late_density", centre["course_late_share"], drawn["course_late_share"].values, width)
    if mean is not None:
        shares |= _banded("density", np.asarray(mean["share"]), drawn["share"].values, width)
    if "hamaker_constant" in table.about and target is not None:
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
        seen = (counted > 0) | (high > 0)
        numbers["late_share_inside"] = _inside(counted[seen], low[seen], high[seen])
        numbers["late_from"] = late
        own = to_32(centre["course_late_share"])
        numbers["late_distance"] = distance(own, to_32(run.share[1:]))
        chance = [distance(own, to_32(one[1:])) for one in replica.share.values]
        numbers["late_distance_run_high"] = float(np.quantile(chance, LEVEL))
    distribution = xr.Dataset(shares, {"size": grid.pivots}, {"steady_run": int(settled)})
    report("ablation", 0.8)
    duration = None
    if mean is not None:
        duration = max(until, 1.5 * settling_time(estimated.mean, start, float(mean["mean_size"])))
    changed = ablation_table(
        table,
        run.initial if run is not None else 200,
        duration,
        times,
        late,
        run.share if run is not None else None,
    )
    report("done", 1.0)
    return Comparison(
        xr.Dataset(data, {"time": ("time", times, {"units": "s"})}),
        distribution,
        numbers,
        changed,
        table,
        run,
        steady,
        "" if steady is not None else evidence.refusal(table),
    )


RUN_BAND = ("monte_carlo", "run_low", "run_high")


def _inside(values: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """Share of the values within their band."""
    return float(((values >= low) & (values <= high)).mean())


def _banded(
    name: str, centre: np.ndarray, drawn: np.ndarray, width: np.ndarray
) -> dict[str, tuple[str, np.ndarray]]:
    low, high = band(drawn)
    columns = {name: centre, f"{name}_low": low, f"{name}_high": high}
    return {n: ("size", v / width) for n, v in columns.items()}


def _on_grid(per_size: np.ndarray, grid: Grid) -> np.ndarray:
    """(S,) sums over the classes of values per whole size 0, 1, 2 ..."""
    edges = np.round(grid.edges + 0.5).astype(int)
    padded = np.append(per_size, np.zeros(max(0, edges[-1] + 1 - per_size.size)))
    return np.array([padded[a:b].sum() for a, b in itertools.pairwise(edges)])


def volume_fractions(
    table: KernelTable, mean_size: float, factors: Sequence[float] = (0.25, 0.5, 1.0, 2.0, 4.0)
) -> xr.Dataset:
    """Steady <P> against volume fraction: tabulated (breakup on encounter) and analytical (first order).

    Parameters
    ----------
    table : KernelTable
        Encounters of one suspension.
    mean_size : float
        Steady <P> that the analytical laws are given.
    factors : sequence of float
        Volume fractions over that of the table's scene [-].

    Returns
    -------
    xarray.Dataset
        Steady <P> of both over `volume_fraction` [-].
    """
    estimated = EstimatedRates(table, grid_for(table))
    phi = float(table.about["volume_fraction"]) * np.asarray(factors)
    tabulated, first_order, laws, law_grid = [], [], None, estimated.grid
    if "hamaker_constant" in table.about:
        analytical = AnalyticalBalance.fitted(table, mean_size)
        laws, law_grid = analytical.balance(), analytical.grid
    for value in phi:
        n = steady_state(estimated.mean, start_of(estimated.grid, table, value)).population
        tabulated.append(n @ estimated.grid.mass / n.sum())
        if laws is not None:
            n = steady_state(laws, start_of(law_grid, table, value)).population
            first_order.append(n @ law_grid.mass / n.sum())
    data = {"tabulated": ("volume_fraction", tabulated)}
    if first_order:
        data["analytical"] = ("volume_fraction", first_order)
    return xr.Dataset(data, {"volume_fraction": phi})
