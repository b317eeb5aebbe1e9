"""Fig. 13 and isostaticity: how many bonds the aggregates have at the end of a run, and how many make them rigid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from mcdem.analysis import paper
from mcdem.analysis.dataset import RunDataset, pool
from mcdem.figures.figure import Figure, quantity
from mcdem.figures.shape import last_population
from mcdem.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    VERMILION,
    canvas,
    headline,
    legend_below,
    plain_ticks,
    plural,
)


def _area(count: np.ndarray) -> np.ndarray:
    """[pt^2] of a marker that stands for so many aggregates."""
    return np.asarray(6.0 * np.asarray(count, dtype=float) ** 0.7)


def _area_key(axes: Axes, most: int, tint: str) -> None:
    """Entries of the legend that say what areas mean."""
    for count in (n for n in (1, 10, 100, 1000) if n <= most):
        axes.scatter(
            [], [], _area(np.array(count)), color=tint, alpha=0.45, lw=0, label=plural(count, "aggregate")
        )


def coordination(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 13: mean coordination number against P, markers by how many aggregates share the pair of values."""
    found = pool([run.population(-1) for run in runs], "aggregate")
    pairs, count = np.unique(
        np.column_stack([found["size"].values, found["bond_count"].values]), axis=0, return_counts=True
    )
    numbers = xr.Dataset(
        {
            "size": quantity(pairs[:, 0], "pair", "1", "number of primaries P"),
            "bond_count": quantity(pairs[:, 1], "pair", "1", "number of bonds"),
            "count": quantity(count, "pair", "1", "aggregates with these"),
        },
        attrs={"stress": runs[0].stress, "paper": int(paper.holds_for(runs[0].scene, 1000.0))},
    )
    return Figure(
        "fig13_coordination",
        f"Mean coordination number against number of primaries at {runs[0].label}.",
        numbers,
        draw_coordination,
    )


def draw_coordination(numbers: xr.Dataset) -> Canvas:
    """Bubbles, the isostatic 6 - 12/P and the paper's range."""
    figure, axes = canvas(height=3.0)
    p, count = numbers["size"].values, numbers["count"].values
    if numbers.attrs["paper"] and p.max() > 15:
        axes.fill_between(
            [15, p.max()], *paper.COORDINATION, color=VERMILION, alpha=0.14, lw=0, label="paper, $P>15$"
        )
    axes.scatter(p, 2 * numbers["bond_count"] / p, _area(count), color=BLUE, alpha=0.45, linewidths=0)
    _area_key(axes, int(count.max()), BLUE)
    x = np.linspace(3, max(p.max(), 6), 200)
    axes.plot(x, 6 - 12 / x, color=BLACK, lw=0.9, label="isostatic, $6-12/P$")
    axes.set(xlabel="number of primaries  $P$", ylabel=r"mean coordination number  $\bar n_c$")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlim(0, 1.05 * max(p.max(), 6))
    axes.set_ylim(-0.3, max(6.2, 1.05 * float((2 * numbers["bond_count"] / p).max())))
    headline(axes, f"{plural(int(count.sum()), 'aggregate')}, {float(numbers.attrs['stress']):.4g} Pa")
    legend_below(figure, ncols=3)
    return figure


def isostaticity(runs: Sequence[RunDataset]) -> Figure:
    """Bonds beyond or short of 3P - 6, and what they leave floppy."""
    found = last_population(runs, 2, "isostaticity")
    names = ["size", "bond_count", "isostatic_bond_count", "floppy_modes", "redundant_bonds"]
    beside = paper.holds_for(runs[0].scene, paper.TABLE_2_STRESS)
    return Figure(
        "isostaticity",
        f"Bonds against the isostatic count 3P - 6, and floppy modes, at {runs[0].label}.",
        found[names].assign_attrs(paper=int(beside)),
        draw_isostaticity,
    )


def draw_isostaticity(numbers: xr.Dataset) -> Canvas:
    """Excess of bonds by rigidity, and Table 2 of the paper the same way at its stress.

    The axis spans nearly all; single ones beyond stand at its edge as arrows, and the legend says how far they are.
    """
    figure, axes = canvas(height=3.0)
    p = numbers["size"].values
    excess = numbers["bond_count"].values - numbers["isostatic_bond_count"].values
    floppy, redundant = numbers["floppy_modes"].values, numbers["redundant_bonds"].values
    low, high = np.floor(np.quantile(excess, [0.02, 0.98]))
    low, high = min(low - 1.0, -2.0), max(high + 1.0, 2.0)
    most = 1
    for words, chosen, tint, marker in (
        ("rigid, isostatic", (floppy == 0) & (redundant == 0), BLUE, "o"),
        ("rigid, redundant bonds", (floppy == 0) & (redundant > 0), GREEN, "^"),
        ("floppy", floppy > 0, VERMILION, "s"),
    ):
        if not chosen.any():
            continue
        inside = chosen & (excess >= low) & (excess <= high)
        pairs, count = np.unique(np.column_stack([p[inside], excess[inside]]), axis=0, return_counts=True)
        axes.scatter(
            pairs[:, 0], pairs[:, 1], _area(count), color=tint, marker=marker, alpha=0.6, linewidths=0,
            label=f"{words}: {int(chosen.sum())}",
        )  # fmt: skip
        most = max(most, int(count.max(initial=1)))
    if numbers.attrs["paper"]:
        table = paper.TABLE_2
        theirs = np.round(table[:, 0] * table[:, 4] / 2) - (3 * table[:, 0] - 6)
        inside = (theirs >= low) & (theirs <= high)
        axes.scatter(
            table[inside, 0], theirs[inside], 14, facecolors="none", edgecolors=BLACK, linewidths=0.7, marker="D",
            label="paper, Table 2",
        )  # fmt: skip
        _beyond(axes, table[:, 0], theirs, low, high, BLACK, "paper's beyond")
    _beyond(axes, p, excess, low, high, GREY, "beyond")
    axes.axhline(0, color=GREY, lw=0.6)
    axes.set(xscale="log", xlabel="number of primaries  $P$", ylabel="bonds beyond $3P-6$")
    axes.set_ylim(low - 0.7, high + 0.7)
    axes.yaxis.get_major_locator().set_params(integer=True)
    axes.set_xlim(
        0.9 * p.min(), 1.12 * max(p.max(), paper.TABLE_2[:, 0].max() if numbers.attrs["paper"] else 0)
    )
    plain_ticks(axes.xaxis)
    headline(axes, f"{plural(len(p), 'aggregate')} of $P > 2$, {float(numbers.attrs['stress']):.4g} Pa")
    legend_below(figure, f"area by number, the largest marker {most}")
    return figure


def _beyond(axes: Axes, x: np.ndarray, y: np.ndarray, low: float, high: float, tint: str, words: str) -> None:
    """Arrows at the edges for what lies beyond them."""
    for chosen, edge, marker, end in (
        (y < low, low - 0.45, "v", float(y.min())),
        (y > high, high + 0.45, "^", float(y.max())),
    ):
        if chosen.any():
            axes.scatter(
                x[chosen], np.full(chosen.sum(), edge), 16, facecolors="none", edgecolors=tint, marker=marker,
                linewidths=0.8, label=f"{words}: {int(chosen.sum())}, to {end:+.0f}",
            )  # fmt: skip
