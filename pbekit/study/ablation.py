"""Why a balance and the Monte Carlo differ: one assumption of the balance changed at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import xarray as xr

from pbekit.balance.population_balance import PopulationBalance
from pbekit.estimated_rates.estimated_rates import EstimatedRates, grid_for, start_of
from pbekit.solution.finite_population import population_course
from pbekit.solution.solve import integrate
from pbekit.study.evidence import supported_steady_state
from pbekit.study.uncertainty import course_output, steady_summary
from pbekit.tables.kernel_table import KernelTable, size_classes, size_ratio

SUMMARY = ("mean_size", "relative_deviation", "sauter_diameter")


def changed_assumptions(table: KernelTable) -> Iterator[tuple[str, Callable[[], EstimatedRates], str]]:
    """(name, estimated, scheme): one assumption of the balance changed in each."""
    ratio = size_ratio(len(table.records))

    def reclassed(other: float) -> EstimatedRates:
        edges = size_classes(int(table.records.size.max()), other)
        finer = _classed(table, edges, table.shape_edges, table.shape_name)
        return EstimatedRates(finer, grid_for(finer))

    def reshaped(shapes: int, shape_name: str) -> EstimatedRates:
        edges = KernelTable.of(
            table.records, table.radius, table.shear_rate, shapes=shapes, shape_name=shape_name
        ).shape_edges
        other = _classed(table, table.size_edges, edges, shape_name)
        return EstimatedRates(other, grid_for(other))

    yield "as tabulated", lambda: EstimatedRates(table, grid_for(table)), "fixed pivot"
    if table.shape_edges is not None:
        yield (
            "products forget the parents' shape",
            lambda: EstimatedRates(table, grid_for(table), memory=False),
            "fixed pivot",
        )
        twice = 2 * table.shapes
        yield f"{twice} classes of shape", lambda: reshaped(twice, table.shape_name), "fixed pivot"
        other = "outer radius" if table.shape_name != "outer radius" else "aspect ratio"
        yield f"shapes told apart by {other}", lambda: reshaped(table.shapes, other), "fixed pivot"
        yield (
            "one mean shape per size",
            lambda: EstimatedRates(table, grid_for(table, shapes=None)),
            "fixed pivot",
        )
    yield (
        "outcomes by the fitted law alone",
        lambda: EstimatedRates(table, grid_for(table), "smooth"),
        "fixed pivot",
    )
    yield "size classes half as wide", lambda: reclassed(ratio**0.5), "fixed pivot"
    yield "size classes twice as wide", lambda: reclassed(ratio**2), "fixed pivot"
    yield "exact sizes to 48", lambda: EstimatedRates(table, grid_for(table, exact_to=48)), "fixed pivot"
    yield "cell average", lambda: EstimatedRates(table, grid_for(table)), "cell average"
    designed = table.records.source == 1
    if designed.any() and not designed.all():
        only = table.with_records(table.records.select(~designed))
        yield "the run's encounters alone", lambda: EstimatedRates(only, grid_for(only)), "fixed pivot"


def _classed(
    table: KernelTable, size_edges: np.ndarray, shape_edges: np.ndarray | None, shape_name: str
) -> KernelTable:
    """The same encounters in other classes."""
    return KernelTable(
        table.records, size_edges, shape_edges, table.radius, table.shear_rate, shape_name, table.about
    )


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """Total variation distance of two distributions: the share of aggregates that would have to change size."""
    return float(0.5 * np.abs(one - other).sum())


def to_32(share: np.ndarray) -> np.ndarray:
    """Shares of sizes 1 ... 32, which every grid here has one by one, and of all beyond."""
    return np.append(np.pad(share[:32], (0, max(0, 32 - share.size))), share[32:].sum())


def ablation_table(
    table: KernelTable,
    initial: int,
    duration: float | None,
    times: np.ndarray,
    late: float,
    counted: np.ndarray | None = None,
    replicas: int = 8,
) -> xr.Dataset:
    """What each changed assumption, and a population of the run's size, make of the balance.

    Parameters
    ----------
    table : KernelTable
        Of encounters.
    initial : int
        Primaries of the finite population at its start.
    duration : float or None
        Time over which a finite population is followed to its steady state [s]; None where there is none.
    times : (T,) array
        Of the course [s]; <P> is taken at the last.
    late : float
        From when on the run counted sizes [s].
    counted : (sizes + 1,) array
        Shares of the sizes in a run from `late` on.
    replicas : int
        Finite populations that are followed.

    Returns
    -------
    xarray.Dataset
        Steady <P>, relative deviation and d32 [m], nan where encounters that were seen do not bear them; <P> at the last of
        `times`; and, given `counted`, the distance of the shares then from them.
    """
    names, rows = [], []
    off = lambda share: np.nan if counted is None else distance(to_32(share), to_32(counted[1:]))
    for name, make, scheme in changed_assumptions(table):
        estimated = make()
        balance = estimated.balance(scheme=scheme)
        start = start_of(estimated.grid, table)
        steady, _ = supported_steady_state(estimated, start, scheme=scheme)
        found = (
            dict.fromkeys(SUMMARY, np.nan) if steady is None else steady_summary(balance, steady.population)
        )
        then = course_output(start, times, share_from=late, rtol=1e-5)(balance)
        names.append(name)
        rows.append(
            [float(found[key]) for key in SUMMARY] + [float(then["mean_size"][-1]), off(then["late_share"])]
        )
    estimated = EstimatedRates(table, grid_for(table))
    phi = float(table.about["volume_fraction"])
    early = population_course(
        estimated, phi, times, initial=initial, replicas=4 * replicas, steady_from=late
    ).mean("replica")
    names.append(f"a finite population of {initial}")
    values = [np.nan] * len(SUMMARY)
    if duration is not None:
        settled = population_course(
            estimated, phi, np.linspace(0, duration, 101), initial=initial, replicas=replicas
        ).isel(time=slice(60, None))
        deviation = (settled.size_deviation / settled.mean_size).mean()
        values = [float(v) for v in (settled.mean_size.mean(), deviation, settled.sauter_diameter.mean())]
    rows.append([*values, float(early.mean_size[-1]), off(early.share.values[1:])])
    columns = (*SUMMARY, "end_mean_size", "late_distance")
    return xr.Dataset(
        {c: ("assumption", [row[k] for row in rows]) for k, c in enumerate(columns)},
        {"assumption": names},
        {"until": float(times[-1])},
    )


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
