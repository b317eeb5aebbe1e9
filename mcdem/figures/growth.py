"""Figs. 6 and 7: mean size, Sauter diameter and width of the population against process time."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from mcdem.analysis import paper
from mcdem.analysis.dataset import RunDataset
from mcdem.encounter import capture_efficiency as capture
from mcdem.errors import UserError
from mcdem.figures.figure import Figure, quantity
from mcdem.figures.style import BLACK, LINES, VERMILION, canvas, colour, note
from mcdem.integrators import DEFAULT
from mcdem.scene import Scene

MOST_POINTS = 4000
"""A line of more points than a page has dots is thinned, extremes kept."""


def thin(time: np.ndarray, *values: np.ndarray) -> tuple[np.ndarray, ...]:
    """Every k-th row, the last one included."""
    if len(time) <= MOST_POINTS:
        return time, *values
    kept = np.unique(np.linspace(0, len(time) - 1, MOST_POINTS).round().astype(int))
    return time[kept], *(v[kept] for v in values)


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


def _lines(axes: Axes, numbers: xr.Dataset, name: str) -> None:
    stresses = np.unique(numbers["stress"].values).tolist()
    for k in range(numbers.sizes["run"]):
        one = numbers.isel(run=k)
        which = stresses.index(float(one["stress"]))
        first = k == numbers["stress"].values.tolist().index(float(one["stress"]))
        label = f"{float(one['stress']):.4g} Pa" if first else None
        axes.plot(one["time"], one[name], LINES[which % 4], color=colour(which), label=label, lw=0.8)
        if not bool(one["steady"]):
            continue
        span = [float(one["steady_start"]), float(one["time"].max())]
        mean, error = float(one["steady_mean"]), float(one["steady_error"])
        axes.fill_between(span, mean - 2 * error, mean + 2 * error, color=colour(which), alpha=0.3, lw=0)
    axes.set_xlabel("process time  $t$ [s]")
    axes.set_xlim(0, float(numbers["time"].max()))
    axes.legend(title=r"$\mu\dot\gamma$", title_fontsize=6.5, loc="upper left", alignment="left")
    steady, runs = int(numbers["steady"].sum()), numbers.sizes["run"]
    note(
        axes,
        f"{int(numbers['events'].sum())} encounters, {runs} run{'s' * (runs > 1)}, {steady} steady"
        + ("; bands: 95 % limits" if steady else ""),
    )


def with_initial_trend(numbers: xr.Dataset, run: RunDataset) -> xr.Dataset:
    """Add the start of a run and the slopes of Eq. 22 with the paper's eta_11 (Eq. 23) and with the computed one."""
    printed = paper.COLLISION_EFFICIENCY.items()
    efficiency = next(
        (v for s, v in printed if paper.holds_for(run.scene, s)), capture.van_de_ven_mason(run.scene)
    )
    slope = capture.initial_growth(run.scene, efficiency)
    computed = capture.initial_growth(run.scene, computed_efficiency(run.scene))
    early = run.time <= initial_stretch(run)
    size, number = run.series["mean_size"].values[early], run.series["number_of_aggregates"].values[early]
    numbers["initial_time"] = quantity(run.time[early], "early", "s", "process time")
    numbers["initial_mean_size"] = quantity(size, "early", "1", "<P>")
    numbers["initial_primaries"] = quantity(size * number, "early", "1", "primaries in the sample volume")
    numbers["initial_slope"] = quantity(slope, (), "1/s", "d<P>/dt of Eq. 22 with eta_11 of Eq. 23")
    numbers["computed_slope"] = quantity(
        computed, (), "1/s", "d<P>/dt of Eq. 22 with eta_11 of the scene's encounters"
    )
    return numbers


@cache
def computed_efficiency(scene: Scene) -> float:
    """eta_11 of two primaries of the scene, by the default steps, to half a per cent; NaN where nothing sticks."""
    implicit = scene.numerics.model_copy(update={"scheme": DEFAULT})
    try:
        return capture.pair_efficiency(scene.model_copy(update={"numerics": implicit}), rays=4).efficiency
    except UserError:
        return float("nan")


def initial_stretch(run: RunDataset) -> float:
    """Time [s] until <P> has grown by a half: monomers aggregate, and Eq. 22's slope has not steepened much."""
    grown = np.flatnonzero(run.series["mean_size"].values > 1.5)
    return float(run.time[grown[0]] if len(grown) else run.time[-1])


def mean_size(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 6a, with the initial trend of the lowest stress against Eq. 22 in its inset."""
    numbers = with_initial_trend(history(runs, "mean_size"), runs[0])
    return Figure(
        "fig06a_mean_size", "Mean aggregate size <P> against process time.", numbers, draw_mean_size
    )


def draw_initial_trend(axes: Axes, numbers: xr.Dataset, label: str) -> None:
    """The start of <P>(t), Eq. 22's line, and the scatter that chance alone gives it."""
    t, slope = numbers["initial_time"].values, float(numbers["computed_slope"])
    axes.plot(t, numbers["initial_mean_size"], color=BLACK, lw=0.8, label=label)
    if np.isfinite(float(numbers["initial_slope"])):
        law = 1 + float(numbers["initial_slope"]) * t
        axes.plot(t, law, ":", color=BLACK, lw=0.8, label=r"Eq. 22, $\eta_{11}$ of Eq. 23")
    if np.isfinite(slope):
        expected = 1 + slope * t
        # <P> = P_tot/(P_tot - n): Poisson scatter of the n aggregations that it takes to get there
        total = numbers["initial_primaries"].values
        scatter = expected**2 * np.sqrt(total * (1 - 1 / expected)) / total
        axes.plot(t, expected, "--", color=VERMILION, lw=0.8, label=r"Eq. 22, $\eta_{11}$ computed")
        axes.fill_between(
            t, expected - 2 * scatter, expected + 2 * scatter, color=VERMILION, alpha=0.15, lw=0
        )


def draw_mean_size(numbers: xr.Dataset) -> Canvas:
    """<P>(t) of all runs; inset: its start."""
    figure, axes = canvas(height=3.0)
    _lines(axes, numbers, "mean_size")
    axes.set_ylabel(r"mean aggregate size  $\langle P\rangle$")
    top = float(numbers["mean_size"].max())
    axes.set_ylim(0, 1.9 * top)
    inset = axes.inset_axes((0.52, 0.60, 0.45, 0.36))
    draw_initial_trend(inset, numbers, f"{float(numbers['stress'][0]):.4g} Pa")
    inset.legend(fontsize=5, loc="upper left", framealpha=0.0)
    inset.tick_params(labelsize=5.5)
    inset.set_xlim(0, float(numbers["initial_time"][-1]))
    inset.set_ylim(1, 1.0 + 1.5 * (inset.get_ylim()[1] - 1.0))
    return figure


def sauter_diameter(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 6b."""
    numbers = history(runs, "sauter_diameter", 1e6)
    numbers["sauter_diameter"].attrs["units"] = "um"
    return Figure(
        "fig06b_sauter_diameter", "Sauter diameter d32 (Eq. 24) against process time.", numbers, draw_sauter
    )


def draw_sauter(numbers: xr.Dataset) -> Canvas:
    """d32(t) of all runs."""
    figure, axes = canvas()
    _lines(axes, numbers, "sauter_diameter")
    axes.set_ylabel(r"Sauter diameter  $d_{32}$ [µm]")
    axes.set_ylim(0, 1.7 * float(numbers["sauter_diameter"].max()))
    return figure


def width(run: RunDataset) -> Figure:
    """Fig. 7: <P> and sigma_P of one run."""
    numbers = history([run], "mean_size").isel(run=0).rename(steady_mean="mean_size_steady")
    deviation = history([run], "size_deviation").isel(run=0)
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
    t = numbers["time"]
    axes.plot(t, numbers["mean_size"], color=BLACK, label=r"$\langle P\rangle$", lw=0.8)
    axes.plot(t, numbers["size_deviation"], color=VERMILION, label=r"$\sigma_P$", lw=0.8)
    start, end = float(numbers["steady_start"]), float(t.max())
    mean, deviation = float(numbers["mean_size_steady"]), float(numbers["size_deviation_steady"])
    words = "steady" if bool(numbers["steady"]) else "not steady; last 40 %"
    axes.plot([start, end], [mean, mean], color=BLACK, lw=2.2, alpha=0.35)
    axes.plot([start, end], [deviation, deviation], color=VERMILION, lw=2.2, alpha=0.35)
    if numbers.attrs["paper"]:
        level = paper.RELATIVE_DEVIATION * mean
        axes.plot([start, end], [level, level], ":", color=BLACK, label=r"0.60 $\langle P\rangle$ (paper)")
    note(axes, rf"{words}: $\sigma_P/\langle P\rangle$ = {deviation / mean:.2f}")
    axes.set_xlabel("process time  $t$ [s]")
    axes.set_ylabel(r"$\langle P\rangle$,  $\sigma_P$")
    axes.set_xlim(0, end)
    axes.set_ylim(0, 1.25 * float(np.nanmax([numbers["mean_size"].max(), numbers["size_deviation"].max()])))
    axes.legend(loc="upper left", ncols=3)
    return figure


# The course of one run


def course(run: RunDataset) -> xr.Dataset:
    """<P>(t) and d32(t) of one run, and its initial trend."""
    numbers = history([run], "mean_size").isel(run=0)
    numbers["sauter_diameter"] = history([run], "sauter_diameter", 1e6)["sauter_diameter"].isel(run=0)
    return with_initial_trend(numbers, run)


def draw_course(numbers: xr.Dataset) -> Canvas:
    """Above <P>, with the slope of Eq. 22 at the start; below d32."""
    figure, (above, below) = canvas(height=4.0, nrows=2, sharex=True)
    above.plot(numbers["time"], numbers["mean_size"], color=BLACK, lw=0.8)
    early = numbers["mean_size"].values[np.isfinite(numbers["mean_size"].values)]
    end = float(numbers["time"].max())
    top = 1.15 * float(early.max())
    for name, line, tone, words in (
        ("initial_slope", ":", BLACK, r"Eq. 22, $\eta_{11}$ of Eq. 23"),
        ("computed_slope", "--", VERMILION, r"Eq. 22, $\eta_{11}$ computed"),
    ):
        slope = float(numbers[name])
        if np.isfinite(slope):
            reach = min(end, (top - 1) / slope) if slope > 0 else end
            above.plot([0, reach], [1, 1 + slope * reach], line, color=tone, label=words)
            above.legend(loc="lower right")
    above.set_ylabel(r"mean size  $\langle P\rangle$")
    above.set_ylim(0, top)
    above.set_title(f"{float(numbers['stress']):.4g} Pa, {int(numbers['events'])} encounters")
    below.plot(numbers["time"], numbers["sauter_diameter"], color=BLACK, lw=0.8)
    below.set_ylabel(r"Sauter diameter  $d_{32}$ [µm]")
    below.set_ylim(0, None)
    below.set_xlabel("process time  $t$ [s]")
    below.set_xlim(0, end if end > 0 else 1)
    return figure
