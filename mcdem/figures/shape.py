"""Figs. 11 and 12: solid fraction and aspect ratio of the aggregates at the end of a run."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Canvas

from mcdem.analysis import paper
from mcdem.analysis.dataset import RunDataset, pool
from mcdem.figures.figure import Figure, NothingToShowError, quantity
from mcdem.figures.size_distribution import draw_histogram, empty, independent, stretch
from mcdem.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    VERMILION,
    canvas,
    headline,
    legend_below,
    opacity,
    plain_ticks,
    plural,
)


def last_population(runs: Sequence[RunDataset], above: int, name: str) -> xr.Dataset:
    """Aggregates of more than `above` primaries of the last snapshots of replicas, with both conventions of the ellipsoid.

    Raises `NothingToShowError` where there is none, for the figure `name`.
    """
    found = pool([run.population(-1) for run in runs], "aggregate")
    solid = pool([run.population(-1, "spheres", rigidity=False) for run in runs], "aggregate")
    found["solid_fraction_ellipsoid_spheres"] = solid["solid_fraction_ellipsoid"].assign_attrs(
        long_name="solid fraction of the ellipsoid of solid primaries"
    )
    kept = found.isel(aggregate=found["size"].values > above)
    if not kept.sizes["aggregate"]:
        raise NothingToShowError(
            f"{name}: no aggregate of more than {plural(above, 'primary', 'primaries')} at {runs[0].label} yet"
        )
    first = runs[0]
    return kept.assign_attrs(stress=first.stress, paper=int(paper.holds_for(first.scene, 1000.0)))


# Fig. 11


def solid_fraction(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 11: solid fraction by outer sphere and by ellipsoid."""
    found = last_population(runs, 3, "fig11_solid_fraction")
    names = ["size", "solid_fraction_sphere", "solid_fraction_ellipsoid", "solid_fraction_ellipsoid_spheres"]
    return Figure(
        "fig11_solid_fraction",
        f"Solid fraction of the aggregates by outer sphere and by inertia-equivalent ellipsoid at {runs[0].label}.",
        found[names],
        draw_solid_fraction,
    )


OF_A_MEDIAN = 5
"""Aggregates without which a class of sizes has no median."""


def draw_solid_fraction(numbers: xr.Dataset) -> Canvas:
    """Every volume of every aggregate above a trimer, and their medians by size over it."""
    figure, axes = canvas(height=3.0)
    p = numbers["size"].values
    edges = np.unique(np.geomspace(3.5, p.max() + 1, 9).round() + 0.5)
    for name, tint, marker, words in (
        ("solid_fraction_ellipsoid", VERMILION, "s", "ellipsoid, mass in points"),
        ("solid_fraction_ellipsoid_spheres", GREEN, "^", "ellipsoid, solid primaries"),
        ("solid_fraction_sphere", BLACK, "o", "outer sphere"),
    ):
        values = numbers[name].values
        axes.scatter(
            p, values, 9, color=tint, marker=marker, alpha=opacity(len(p)), linewidths=0, label=words
        )
        classes = [(p >= low) & (p < high) for low, high in pairwise(edges.tolist())]
        full = [chosen for chosen in classes if chosen.sum() >= OF_A_MEDIAN]
        if len(full) > 1:
            at = [np.exp(np.log(p[chosen]).mean()) for chosen in full]
            axes.plot(at, [np.median(values[chosen]) for chosen in full], color=tint, lw=1.3)
    axes.axhline(np.pi / np.sqrt(18), color=GREY, lw=0.8, ls=":", label="close packing, 0.74")
    axes.set(xscale="log", xlabel="number of primaries  $P$", ylabel=r"solid fraction  $\phi$")
    axes.set_xlim(0.9 * p.min(), 1.1 * p.max())
    plain_ticks(axes.xaxis)
    axes.set_ylim(0, None)
    headline(axes, f"{plural(len(p), 'aggregate')} of $P > 3$, {float(numbers.attrs['stress']):.4g} Pa")
    lines = "lines: medians; " if len(axes.lines) > 1 else ""
    legend_below(figure, f"{lines}mass in points makes the ellipsoid too small")
    return figure


# Fig. 12

BINS = np.arange(1.0, 8.01, 0.25)


def aspect_distribution(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 12a: distribution of the aspect ratio of aggregates of P > 2."""
    found = last_population(runs, 2, "fig12a_aspect_ratio")
    ratio = found["aspect_ratio"].values
    edges = np.append(BINS, max(BINS[-1] + 0.25, ratio.max() + 0.25))
    late = [
        np.histogram(one["aspect_ratio"].values[one["size"].values > 2], edges)[0]
        for run in runs
        for one in (run.population(k, rigidity=False) for k in run.late_snapshots)
    ]
    by_snapshot = np.array([h / max(h.sum(), 1) for h in late])
    numbers = xr.Dataset(
        {
            "count": quantity(
                np.histogram(ratio, edges)[0], "bin", "1", "aggregates of P > 2, last snapshot"
            ),
            "edge": quantity(edges, "edge", "1", "edges of the bins of the aspect ratio"),
            "steady_share": quantity(by_snapshot.mean(axis=0), "bin", "1", "share over the steady stretch"),
            "steady_scatter": quantity(
                by_snapshot.std(axis=0), "bin", "1", "its standard deviation over snapshots"
            ),
        },
        attrs={
            "last": f"t = {float(runs[0].snapshot_times[-1]):.4g} s",
            "independent": independent(runs, found),
            "snapshots": len(by_snapshot),
            "stretch": stretch(runs),
            **found.attrs,
        },
    )
    return Figure(
        "fig12a_aspect_ratio",
        f"Distribution of the aspect ratio (Eq. 27) at {runs[0].label}, aggregates of P > 2.",
        numbers,
        draw_aspect_distribution,
    )


def draw_aspect_distribution(numbers: xr.Dataset) -> Canvas:
    """Density with 95 % limits; the paper's ranges shaded."""
    figure, axes = canvas(height=3.0)
    count, edges = numbers["count"].values, numbers["edge"].values
    total = int(count.sum())
    if numbers.attrs["paper"]:
        axes.axvspan(*paper.SLIGHTLY_ELONGATED, color=VERMILION, alpha=0.1, lw=0, label="paper: most")
        axes.axvline(paper.RODS_ABOVE, color=VERMILION, ls="--", lw=0.8, label="paper: rods above")
    draw_histogram(axes, edges, numbers, density=True)
    low, high = edges[:-1], edges[1:]
    between = (low >= paper.SLIGHTLY_ELONGATED[0]) & (high <= paper.SLIGHTLY_ELONGATED[1])
    rods = low >= paper.RODS_ABOVE
    axes.set_xlim(1, min(8.25, max(4.0, high[count > 0].max())))
    axes.set_ylim(0, None)
    axes.set(xlabel="aspect ratio  A.R.", ylabel="probability density")
    headline(
        axes,
        f"{plural(total, 'aggregate')} of $P > 2$; {count[between].sum() / total:.0%} at 1.25 to 2, "
        f"{count[rods].sum() / total:.0%} above 2.5",
    )
    step = BINS[1] - BINS[0]
    legend_below(figure, f"{empty(int(numbers.attrs['independent']))}, a share per {step:g}")
    return figure


def aspect_against_size(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 12b."""
    found = last_population(runs, 2, "fig12b_aspect_ratio_size")
    return Figure(
        "fig12b_aspect_ratio_size",
        f"Aspect ratio against number of primaries at {runs[0].label}.",
        found[["size", "aspect_ratio"]],
        draw_aspect_against_size,
    )


def draw_aspect_against_size(numbers: xr.Dataset) -> Canvas:
    """Every aggregate, and the paper's lower bound."""
    figure, axes = canvas()
    p, ratio = numbers["size"].values, numbers["aspect_ratio"].values
    axes.scatter(p, ratio, 9, color=BLUE, alpha=opacity(len(p)), linewidths=0, label="aggregate")
    if numbers.attrs["paper"]:
        axes.axhline(
            paper.SMALLEST_ASPECT_RATIO, color=VERMILION, ls="--", lw=0.8, label="paper: about the smallest"
        )
    axes.set(xlabel="number of primaries  $P$", ylabel="aspect ratio  A.R.")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlim(0, 1.05 * p.max())
    axes.set_ylim(0.9, 1.05 * max(ratio.max(), 2))
    headline(axes, f"{plural(len(p), 'aggregate')} of $P > 2$, {float(numbers.attrs['stress']):.4g} Pa")
    legend_below(figure)
    return figure
