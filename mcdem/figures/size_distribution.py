"""Fig. 8: how many primaries the aggregates have, and how large they are, at the end of a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from scipy import stats

from mcdem.analysis.dataset import RunDataset, origins, pool
from mcdem.analysis.statistics import SMALLEST_FITTED, shares
from mcdem.figures.figure import Figure, quantity
from mcdem.figures.style import BLACK, BLUE, VERMILION, canvas, headline, legend_below, plural


def late_shares(
    runs: Sequence[RunDataset], values_of: str, edges: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int]:
    """Share of aggregates per bin over the snapshots of the steady stretches, with its scatter over snapshots.

    The scatter is between whole populations at different times, not between aggregates: it holds for correlated ones.
    """
    found = []
    for run in runs:
        for k in run.late_snapshots:
            values = run.population(k, rigidity=False)[values_of].values
            if values_of == "outer_radius":
                values = values / run.radius
            found.append(np.histogram(values, edges)[0] / len(values))
    table = np.array(found)
    return table.mean(axis=0), table.std(axis=0), len(table)


def independent(runs: Sequence[RunDataset], last: xr.Dataset) -> int:
    """How many aggregates of last snapshots count as independent: all, unless the samples were doubled.

    Then as many as there are origins (`dataset.origins`) in proportion among those of P > 3; smaller ones are alike by geometry.
    """
    large = last.isel(aggregate=last["size"].values >= SMALLEST_FITTED)
    if not any(run.doublings for run in runs) or not large.sizes["aggregate"]:
        return int(last.sizes["aggregate"])
    portion = len(np.unique(origins(large))) / large.sizes["aggregate"]
    return max(1, round(portion * last.sizes["aggregate"]))


def stretch(runs: Sequence[RunDataset]) -> str:
    """What late snapshots are taken from."""
    return "steady stretch" if all(run.steady.reached for run in runs) else "last 40 % (not steady)"


def draw_histogram(axes: Axes, edges: np.ndarray, numbers: xr.Dataset, density: bool = False) -> np.ndarray:
    """The last snapshot with its 95 % limits over the mean of the stretch; returns the limits (3, bins).

    numbers : `count` by bin, `steady_share` and `steady_scatter`; attributes `independent`, how many aggregates the limits are
    of, `last`, what the counts are of, `snapshots` and `stretch`.  Bins that hold none have no bar: `empty` says what that
    leaves possible
    """
    unit = np.diff(edges) if density else 1.0
    count = numbers["count"].values
    total, trials = max(int(count.sum()), 1), int(numbers.attrs["independent"])
    middle = 0.5 * (edges[1:] + edges[:-1])
    axes.stairs(
        count / total / unit, edges, fill=True, color=BLUE, alpha=0.45, lw=0, label=numbers.attrs["last"]
    )
    limits = shares(count / total * trials, trials) / unit
    seen = count > 0
    value, low, high = limits[:, seen]
    axes.errorbar(
        middle[seen],
        value,
        np.maximum([value - low, high - value], 0.0),
        fmt="none",
        ecolor=BLUE,
        elinewidth=0.8,
        label="its 95 % limits",
    )
    if numbers.attrs["snapshots"] > 1:
        mean, scatter = numbers["steady_share"].values / unit, numbers["steady_scatter"].values / unit
        ends = (np.maximum(mean - scatter, 0.0), mean + scatter)
        axes.stairs(
            ends[1], edges, baseline=ends[0], fill=True, color=BLACK, alpha=0.18, lw=0,
            label=f"scatter over {numbers.attrs['snapshots']} snapshots",
        )  # fmt: skip
        axes.stairs(mean, edges, baseline=None, color=BLACK, lw=0.8, label=numbers.attrs["stretch"])
    return np.asarray(limits)


def empty(trials: int) -> str:
    """What a bin without any leaves possible, in words."""
    return f"a bin without any: below {shares(0, trials)[2]:.2g} (95 %)"


def _distribution(
    runs: Sequence[RunDataset], values_of: str, bin_edges: np.ndarray, name: str, words: str
) -> xr.Dataset:
    """Counts of the last snapshots and shares of the late ones over dimension `name`."""
    last = pool([run.population(-1, rigidity=False) for run in runs], "aggregate")
    values = last[values_of].values / (runs[0].radius if values_of == "outer_radius" else 1)
    mean, scatter, snapshots = late_shares(runs, values_of, bin_edges)
    return xr.Dataset(
        {
            "count": quantity(
                np.histogram(values, bin_edges)[0], name, "1", "aggregates in the last snapshot"
            ),
            "steady_share": quantity(mean, name, "1", "share of aggregates, mean over the steady stretch"),
            "steady_scatter": quantity(scatter, name, "1", "its standard deviation over snapshots"),
            "edge": quantity(bin_edges, "edge", "1", "edges of the bins"),
        },
        {name: quantity(0.5 * (bin_edges[1:] + bin_edges[:-1]), name, "1", words)},
        {
            "last": f"t = {float(runs[0].snapshot_times[-1]):.4g} s",
            "independent": independent(runs, last),
            "snapshots": snapshots,
            "stretch": stretch(runs),
        },
    )


def by_primaries(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 8a."""
    largest = 2
    for run in runs:
        for k in {*run.late_snapshots, len(run.snapshot_times) - 1}:
            largest = max(largest, int(run.population(k, rigidity=False)["size"].max()))
    return Figure(
        "fig08a_size_distribution",
        f"Distribution of the number of primaries per aggregate at {runs[0].label}.",
        _distribution(runs, "size", np.arange(0.5, largest + 1), "size", "number of primaries P"),
        draw_by_primaries,
    )


def draw_by_primaries(numbers: xr.Dataset) -> Canvas:
    """Shares of the last snapshot with 95 % limits, mean of the steady stretch, log-normal of the aggregates."""
    figure, axes = canvas(height=3.0)
    p, count = numbers["size"].values, numbers["count"].values
    total = int(count.sum())
    value, lowest, highest = draw_histogram(axes, numbers["edge"].values, numbers)
    clusters = np.repeat(p[p > 1], count[p > 1])
    if len(clusters) >= 10 and np.ptp(clusters):
        mu, sigma = np.log(clusters).mean(), np.log(clusters).std(ddof=1)
        x = np.linspace(1.5, p[-1], 300)
        curve = len(clusters) / total * stats.lognorm.pdf(x, sigma, scale=np.exp(mu))
        axes.plot(x, curve, "--", color=VERMILION, label="log-normal of $P > 1$")
    axes.set(xlabel="number of primaries  $P$", ylabel="share of aggregates")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlim(0.5, p[-1] + 0.5)
    axes.set_ylim(0, None)
    alone = f"{value[0]:.1%} [{lowest[0]:.1%}, {highest[0]:.1%}] of them primaries"
    headline(axes, f"{plural(total, 'aggregate')}; {alone}")
    legend_below(figure, empty(int(numbers.attrs["independent"])))
    return figure


def by_radius(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 8b."""
    largest = max(
        float(run.population(-1, rigidity=False)["outer_radius"].max()) / run.radius for run in runs
    )
    edges = np.arange(0.75, largest + 0.5, 0.5)  # a monomer, R = a, in the middle of the first bin
    return Figure(
        "fig08b_radius_distribution",
        f"Distribution of the outer radius at {runs[0].label}.",
        _distribution(runs, "outer_radius", edges, "radius", "outer radius R/a"),
        draw_by_radius,
    )


def draw_by_radius(numbers: xr.Dataset) -> Canvas:
    """Shares of the last snapshot with 95 % limits and the mean of the steady stretch."""
    figure, axes = canvas(height=3.0)
    edges = numbers["edge"].values
    draw_histogram(axes, edges, numbers)
    axes.set(xlabel="outer radius  $R/a$", ylabel=f"share of aggregates per {edges[1] - edges[0]:g} $a$")
    axes.set_xlim(edges[0], edges[-1])
    axes.set_ylim(0, None)
    headline(axes, plural(int(numbers["count"].sum()), "aggregate"))
    legend_below(figure, empty(int(numbers.attrs["independent"])))
    return figure
