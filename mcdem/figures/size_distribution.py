"""Fig. 8: how many primaries the aggregates have, and how large they are, at the end of a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Canvas
from scipy import stats

from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.statistics import shares
from mcdem.figures.figure import Figure, quantity
from mcdem.figures.style import BLACK, BLUE, GREY, VERMILION, canvas, legend


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


def stretch(runs: Sequence[RunDataset]) -> str:
    """What late snapshots are taken from."""
    return "steady stretch" if all(run.steady.reached for run in runs) else "last 40 % (not steady)"


def _last(runs: Sequence[RunDataset], name: str) -> np.ndarray:
    return np.concatenate([run.population(-1, rigidity=False)[name].values for run in runs])


def by_primaries(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 8a."""
    sizes = _last(runs, "size")
    largest = int(max(sizes.max(), 2))
    for run in runs:
        for k in run.late_snapshots:
            largest = max(largest, int(run.population(k, rigidity=False)["size"].max()))
    edges = np.arange(0.5, largest + 1)
    mean, scatter, snapshots = late_shares(runs, "size", edges)
    numbers = xr.Dataset(
        {
            "count": quantity(np.histogram(sizes, edges)[0], "size", "1", "aggregates in the last snapshot"),
            "steady_share": quantity(mean, "size", "1", "share of aggregates, mean over the steady stretch"),
            "steady_scatter": quantity(scatter, "size", "1", "its standard deviation over snapshots"),
        },
        {"size": quantity(np.arange(1, largest + 1), "size", "1", "number of primaries P")},
        {"time": float(runs[0].snapshot_times[-1]), "snapshots": snapshots, "stretch": stretch(runs)},
    )
    return Figure(
        "fig08a_size_distribution",
        f"Distribution of the number of primaries per aggregate at {runs[0].label}.",
        numbers,
        draw_by_primaries,
    )


def draw_by_primaries(numbers: xr.Dataset) -> Canvas:
    """Shares of the last snapshot with 95 % limits, mean of the steady stretch, log-normal of the aggregates."""
    figure, axes = canvas()
    p, count = numbers["size"].values, numbers["count"].values
    total = count.sum()
    axes.bar(p, count / total, 0.9, color=BLUE, alpha=0.55, lw=0, label=f"t = {numbers.attrs['time']:.4g} s")
    value, lowest, highest = shares(count, int(total))
    axes.errorbar(p, value, [value - lowest, highest - value], fmt="none", ecolor=GREY, elinewidth=0.5)
    if numbers.attrs["snapshots"] > 1:
        mean, scatter = numbers["steady_share"].values, numbers["steady_scatter"].values
        axes.plot(p, mean, color=BLACK, lw=0.8, drawstyle="steps-mid", label=numbers.attrs["stretch"])
        axes.fill_between(p, mean - scatter, mean + scatter, step="mid", color=BLACK, alpha=0.15, lw=0)
    clusters = np.repeat(p[p > 1], count[p > 1])
    if len(clusters) >= 10:
        mu, sigma = np.log(clusters).mean(), np.log(clusters).std(ddof=1)
        x = np.linspace(1.5, p[-1], 300)
        curve = len(clusters) / total * stats.lognorm.pdf(x, sigma, scale=np.exp(mu))
        axes.plot(x, curve, "--", color=VERMILION, label="log-normal of $P > 1$")
    axes.set_xlabel("number of primaries  $P$")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_ylabel("share of aggregates")
    axes.set_xlim(0, None)
    axes.set_ylim(0, None)
    legend(
        axes,
        f"{total} aggregates, {value[0]:.0%} [{lowest[0]:.0%}, {highest[0]:.0%}] monomers\n"
        f"bars: 95 %; band: over {numbers.attrs['snapshots']} snapshots",
    )
    return figure


def by_radius(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 8b."""
    radii = _last(runs, "outer_radius") / runs[0].radius
    edges = np.arange(0.75, radii.max() + 0.5, 0.5)  # a monomer, R = a, in the middle of the first bin
    mean, scatter, snapshots = late_shares(runs, "outer_radius", edges)
    numbers = xr.Dataset(
        {
            "count": quantity(
                np.histogram(radii, edges)[0], "radius", "1", "aggregates in the last snapshot"
            ),
            "steady_share": quantity(
                mean, "radius", "1", "share of aggregates, mean over the steady stretch"
            ),
            "steady_scatter": quantity(scatter, "radius", "1", "its standard deviation over snapshots"),
        },
        {"radius": quantity(0.5 * (edges[1:] + edges[:-1]), "radius", "1", "outer radius R/a")},
        {
            "time": float(runs[0].snapshot_times[-1]),
            "snapshots": snapshots,
            "bin_width": 0.5,
            "stretch": stretch(runs),
        },
    )
    return Figure(
        "fig08b_radius_distribution",
        f"Distribution of the outer radius at {runs[0].label}.",
        numbers,
        draw_by_radius,
    )


def draw_by_radius(numbers: xr.Dataset) -> Canvas:
    """Shares of the last snapshot with 95 % limits and the mean of the steady stretch."""
    figure, axes = canvas()
    x, count, step = numbers["radius"].values, numbers["count"].values, numbers.attrs["bin_width"]
    total = count.sum()
    axes.bar(
        x, count / total, 0.9 * step, color=BLUE, alpha=0.55, lw=0, label=f"t = {numbers.attrs['time']:.4g} s"
    )
    value, lowest, highest = shares(count, int(total))
    axes.errorbar(x, value, [value - lowest, highest - value], fmt="none", ecolor=GREY, elinewidth=0.5)
    if numbers.attrs["snapshots"] > 1:
        mean, scatter = numbers["steady_share"].values, numbers["steady_scatter"].values
        axes.plot(x, mean, color=BLACK, lw=0.8, drawstyle="steps-mid", label=numbers.attrs["stretch"])
        axes.fill_between(x, mean - scatter, mean + scatter, step="mid", color=BLACK, alpha=0.15, lw=0)
    axes.set_xlabel("outer radius  $R/a$")
    axes.set_ylabel(f"share of aggregates per {step:g} $a$")
    axes.set_xlim(0.5, None)
    # Room above the bars for the legend.
    axes.set_ylim(0, 1.4 * axes.get_ylim()[1])
    legend(axes, f"{total} aggregates\nbars: 95 %; band: over {numbers.attrs['snapshots']} snapshots")
    return figure
