"""Figs. 6 and 7: mean size, Sauter diameter and width of the population against process time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from numpy.typing import ArrayLike

from mcdem.analysis import paper
from mcdem.analysis.dataset import RunDataset
from mcdem.figures.figure import Figure, quantity
from mcdem.figures.style import BLACK, COLUMN, VERMILION, canvas, colour, headline, legend_below, plural

MOST_POINTS = 4000
"""A line of more points than a page has dots is thinned, extremes kept."""


def thin(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last row, and the least and the largest value of each of MOST_POINTS/2 stretches."""
    if len(time) <= MOST_POINTS:
        return time, values
    edges = np.linspace(0, len(time), MOST_POINTS // 2).round().astype(int)
    stretches = [slice(first, last) for first, last in pairwise(edges.tolist())]
    rows = [s.start + k for s in stretches for k in (values[s].argmin(), values[s].argmax())]
    kept = np.unique([0, *rows, len(time) - 1])
    return time[kept], values[kept]


def history(runs: Sequence[RunDataset], name: str, scale: float = 1.0) -> xr.Dataset:
    """One series of every run on dimension ``run``, padded with NaN along ``row``; steady means with errors."""
    lines = [thin(run.time, run.series[name].values * scale) for run in runs]
    rows = max(len(t) for t, _ in lines)
    padded = np.full((2, len(runs), rows), np.nan)
    for k, (t, v) in enumerate(lines):
        padded[0, k, : len(t)], padded[1, k, : len(v)] = t, v
    averages = [run.average(name) for run in runs]
    attrs = runs[0].series[name].attrs
    return xr.Dataset(
        {
            "time": quantity(padded[0], ("run", "row"), "s", "process time"),
            name: quantity(padded[1], ("run", "row"), "1", attrs.get("long_name", name)),
            "steady_start": quantity([a.start for a in averages], "run", "s", "start of the steady stretch"),
            "steady_mean": quantity([a.mean * scale for a in averages], "run", "1", "mean from there on"),
            "steady_error": quantity(
                [a.error * scale for a in averages],
                "run",
                "1",
                "mean +- 2 of these are its 95 % limits, by blocks",
            ),
            "steady": ("run", [run.steady.reached for run in runs]),
            "stress": quantity([run.stress for run in runs], "run", "Pa", "shear stress"),
            "events": quantity([run.events.sizes["event"] for run in runs], "run", "1", "encounters"),
        }
    )


def steps(axes: Axes, time: ArrayLike, values: ArrayLike, **keywords: Any) -> None:
    """A series that holds each of its values until the next encounter."""
    axes.plot(time, values, drawstyle="steps-post", **keywords)


def _draw_history(numbers: xr.Dataset, name: str, label: str) -> Canvas:
    """Every run; beside it, on the same axis, the mean of each steady stretch, which no line hides."""
    steady = numbers["steady"].values
    figure, grid = canvas(
        COLUMN + 0.5,
        2.9,
        ncols=2,
        sharey=True,
        squeeze=False,
        width_ratios=(1, 0.16 if steady.any() else 1e-3),
    )
    axes, beside = grid[0]
    stresses = np.unique(numbers["stress"].values).tolist()
    seen: set[float] = set()
    for k in range(numbers.sizes["run"]):
        one = numbers.isel(run=k)
        stress = float(one["stress"])
        tint = colour(stresses.index(stress))
        words = None if stress in seen else f"{stress:.4g} Pa"
        seen.add(stress)
        steps(axes, one["time"], one[name], color=tint, lw=0.7, label=words)
        if steady[k]:
            beside.errorbar(
                k,
                one["steady_mean"],
                2 * one["steady_error"],
                fmt="o",
                ms=2.5,
                color=tint,
                elinewidth=1.2,
                capsize=2,
            )
    axes.set(xlabel="process time  $t$ [s]", ylabel=label)
    axes.set_xlim(0, max(float(numbers["time"].max()), 1e-12))
    axes.set_ylim(0, 1.05 * float(numbers[name].max()))
    if steady.any():
        beside.set(xticks=[], xlabel="mean", xlim=(-0.7, len(steady) - 0.3))
    else:
        figure.delaxes(beside)
    runs = plural(len(steady), "run")
    headline(axes, f"{int(numbers['events'].sum())} encounters, {runs}, {int(steady.sum())} steady")
    legend_below(figure, "right: means of steady stretches, 95 % limits" if steady.any() else "", ncols=5)
    return figure


def mean_size(runs: Sequence[RunDataset]) -> Figure:
    """Mean size <P> against process time (Frungieri & Vanni 2021, Fig. 6a; its inset is `initial_growth`).

    Parameters
    ----------
    runs : sequence of RunDataset
        Of any stresses; those of one stress are replicas.

    Returns
    -------
    Figure
        Its numbers, and what draws them.

    Raises
    ------
    NothingToShowError
        Where the datasets hold nothing of it.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset
    >>> from mcdem.figures import mean_size
    >>> figure = mean_size([RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc")])
    >>> figure.name, dict(figure.numbers.sizes)
    ('fig06a_mean_size', {'run': 1, 'row': 2895})
    """
    return Figure(
        "fig06a_mean_size",
        "Mean aggregate size <P> against process time.",
        history(runs, "mean_size"),
        draw_mean_size,
    )


def draw_mean_size(numbers: xr.Dataset) -> Canvas:
    """<P>(t) of all runs."""
    return _draw_history(numbers, "mean_size", r"mean aggregate size  $\langle P\rangle$")


def sauter_diameter(runs: Sequence[RunDataset]) -> Figure:
    """Sauter diameter d32 against process time (Frungieri & Vanni 2021, Fig. 6b).

    Parameters
    ----------
    runs : sequence of RunDataset
        Of any stresses; those of one stress are replicas.

    Returns
    -------
    Figure
        Its numbers, and what draws them.

    Raises
    ------
    NothingToShowError
        Where the datasets hold nothing of it.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset
    >>> from mcdem.figures import sauter_diameter
    >>> figure = sauter_diameter([RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc")])
    >>> figure.name, dict(figure.numbers.sizes)
    ('fig06b_sauter_diameter', {'run': 1, 'row': 3900})
    """
    numbers = history(runs, "sauter_diameter", 1e6)
    for name in ("sauter_diameter", "steady_mean", "steady_error"):
        numbers[name].attrs["units"] = "um"
    return Figure(
        "fig06b_sauter_diameter", "Sauter diameter d32 (Eq. 24) against process time.", numbers, draw_sauter
    )


def draw_sauter(numbers: xr.Dataset) -> Canvas:
    """d32(t) of all runs."""
    return _draw_history(numbers, "sauter_diameter", r"Sauter diameter  $d_{32}$ [µm]")


def width(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 7: <P> and sigma_P of the first of the replicas."""
    run = runs[0]
    numbers = history([run], "mean_size").isel(run=0).rename(steady_mean="mean_size_steady")
    deviation = history([run], "size_deviation").isel(run=0).rename(row="deviation_row")
    numbers["deviation_time"] = deviation["time"]
    numbers["size_deviation"] = deviation["size_deviation"]
    numbers["size_deviation_steady"] = deviation["steady_mean"]
    return Figure(
        "fig07_width",
        f"Mean <P> and standard deviation sigma_P of the aggregate sizes at {run.label}.",
        numbers.assign_attrs(paper=int(paper.holds_for(run.scene, 1000.0))),
        draw_width,
    )


def draw_width(numbers: xr.Dataset) -> Canvas:
    """<P>(t) and sigma_P(t); the paper's 60 % of <P>."""
    figure, axes = canvas()
    start, end = float(numbers["steady_start"]), float(numbers["time"].max())
    mean, deviation = float(numbers["mean_size_steady"]), float(numbers["size_deviation_steady"])
    for time, name, level, tint, words in (
        ("time", "mean_size", mean, BLACK, r"$\langle P\rangle$"),
        ("deviation_time", "size_deviation", deviation, VERMILION, r"$\sigma_P$"),
    ):
        steps(axes, numbers[time], numbers[name], color=tint, lw=0.7, alpha=0.6, label=words)
        axes.plot([start, end], [level, level], color=tint, lw=1.8, zorder=3, label=f"{words}, mean")
    if numbers.attrs["paper"]:
        level = paper.RELATIVE_DEVIATION * mean
        axes.plot([start, end], [level, level], ":", color=BLACK, label=r"0.60 $\langle P\rangle$ (paper)")
    words = "steady stretch" if bool(numbers["steady"]) else "not steady; last 40 %"
    headline(axes, rf"{words}: $\sigma_P/\langle P\rangle$ = {deviation / mean:.2f}")
    axes.set(xlabel="process time  $t$ [s]", ylabel=r"$\langle P\rangle$,  $\sigma_P$")
    axes.set_xlim(0, max(end, 1e-12))
    axes.set_ylim(0, 1.05 * float(np.nanmax([numbers["mean_size"].max(), numbers["size_deviation"].max()])))
    legend_below(figure, ncols=3)
    return figure
