"""The inset of Fig. 6a: how a population begins to grow, beside the trend of Eq. 22; and the course of one run with it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Canvas

from mcdem.analysis import paper
from mcdem.analysis.dataset import RunDataset
from mcdem.encounter import capture_efficiency as capture
from mcdem.errors import UserError
from mcdem.figures.figure import Figure, quantity
from mcdem.figures.growth import history, steps
from mcdem.figures.style import BLACK, BLUE, VERMILION, canvas, headline, legend_below
from mcdem.integrators import DEFAULT
from mcdem.scene import Scene

LINES = (
    ("initial_slope", ":", BLACK, r"Eq. 22, $\eta_{11}$ of Eq. 23"),
    ("computed_slope", "--", VERMILION, r"Eq. 22, $\eta_{11}$ computed"),
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


def initial_growth(runs: Sequence[RunDataset]) -> Figure:
    """The start of the run of the lowest stress against Eq. 22 of Frungieri & Vanni (2021), the inset of their Fig. 6a.

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
    >>> from mcdem.figures import initial_growth
    >>> figure = initial_growth([RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc")])
    >>> figure.name, dict(figure.numbers.sizes)
    ('fig06a_initial_growth', {'early': 935})
    """
    run = runs[0]
    return Figure(
        "fig06a_initial_growth",
        f"Mean aggregate size at {run.label} until it has grown by a half, beside the trend of Eq. 22.",
        with_initial_trend(xr.Dataset(attrs={"stress": run.stress}), run),
        draw_initial_growth,
    )


def draw_initial_growth(numbers: xr.Dataset) -> Canvas:
    """The start of <P>(t), Eq. 22's lines, and the scatter that chance alone gives the computed one."""
    figure, axes = canvas()
    t, slope = numbers["initial_time"].values, float(numbers["computed_slope"])
    steps(axes, t, numbers["initial_mean_size"], color=BLUE, label=f"run at {numbers.attrs['stress']:.4g} Pa")
    for name, line, tint, words in LINES:
        if np.isfinite(float(numbers[name])):
            axes.plot(t, 1 + float(numbers[name]) * t, line, color=tint, label=words)
    if np.isfinite(slope):
        expected = 1 + slope * t
        # 1/<P> = 1 - n/P_tot: Poisson scatter of the aggregations n, each weighed by the sample in which it happened
        steps_taken = np.diff(1 - 1 / expected, prepend=0.0)
        scatter = expected**2 * np.sqrt(np.cumsum(steps_taken / numbers["initial_primaries"].values))
        ends = (expected - 2 * scatter, expected + 2 * scatter)
        axes.fill_between(t, *ends, color=VERMILION, alpha=0.15, lw=0, label="its scatter by chance, 95 %")
    axes.set(xlabel="process time  $t$ [s]", ylabel=r"mean aggregate size  $\langle P\rangle$")
    axes.set_xlim(0, max(float(t[-1]), 1e-12))
    legend_below(figure)
    return figure


def course(run: RunDataset) -> xr.Dataset:
    """<P>(t) and d32(t) of one run, and its initial trend."""
    numbers = history([run], "mean_size").isel(run=0)
    sauter = history([run], "sauter_diameter", 1e6).isel(run=0).rename(row="sauter_row")
    numbers["sauter_diameter"] = sauter["sauter_diameter"].assign_attrs(units="um")
    numbers["sauter_time"] = sauter["time"]
    return with_initial_trend(numbers, run)


def draw_course(numbers: xr.Dataset) -> Canvas:
    """Above <P>, with the slope of Eq. 22 at the start; below d32."""
    figure, (above, below) = canvas(height=4.2, nrows=2, sharex=True)
    end = float(numbers["time"].max())
    top = 1.1 * float(numbers["mean_size"].max())
    steps(above, numbers["time"], numbers["mean_size"], color=BLUE, lw=0.8, label="run")
    for name, line, tint, words in LINES:
        slope = float(numbers[name])
        if np.isfinite(slope):
            reach = min(end, (top - 1) / slope) if slope > 0 else end
            above.plot([0, reach], [1, 1 + slope * reach], line, color=tint, label=words)
    above.set_ylabel(r"mean size  $\langle P\rangle$")
    above.set_ylim(0, top)
    headline(above, f"{float(numbers['stress']):.4g} Pa, {int(numbers['events'])} encounters")
    steps(below, numbers["sauter_time"], numbers["sauter_diameter"], color=BLUE, lw=0.8)
    below.set(xlabel="process time  $t$ [s]", ylabel=r"Sauter diameter  $d_{32}$ [µm]")
    below.set_ylim(0, 1.1 * float(numbers["sauter_diameter"].max()))
    below.set_xlim(0, end if end > 0 else 1)
    legend_below(figure, ncols=3)
    return figure
