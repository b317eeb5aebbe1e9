"""The balance beside the Monte Carlo: courses, distributions, what an assumption changes, volume fractions."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from pbekit.figures.style import (
    ANALYTICAL,
    BLACK,
    BLUE,
    MONTE_CARLO,
    SINGLE_RUNS,
    STYLE,
    TABULATED,
    VERMILION,
    blank_figure,
    error_lengths,
    legend_below,
    save,
    ticks_at,
)
from pbekit.figures.table import draw_table
from pbekit.study.compare import Comparison, volume_fractions


def draw_comparison(found: Comparison, prefix: Path) -> list[str]:
    """All figures of one comparison, names beginning with `prefix`; a line for each that is left out."""
    named = lambda what: prefix.with_name(f"{prefix.name}-{what}")
    left_out = []
    draw_table(found.table, named("table"))
    draw_course(found, named("course"))
    draw_distribution(found, named("distribution"))
    if _ablation_panels(found):
        draw_ablation(found, named("ablation"))
    else:
        left_out.append("figure of the ablation left out: no steady state, and no run to compare with")
    if "mean_size" not in found.numbers:
        left_out.append("figure of volume fractions left out: no steady state")
    elif "volume_fraction" not in found.table.about:
        left_out.append("figure of volume fractions left out: the table does not say its volume fraction")
    else:
        data = volume_fractions(found.table, found.numbers["mean_size"])
        draw_volume_fractions(data, named("volume-fractions"))
    return left_out


def draw_course(found: Comparison, path: Path) -> Path:
    """<P>, sigma_P and d32 over time, three accounts."""
    course = found.course
    rows = (
        ("mean_size", r"mean size $\langle P\rangle$", 1.0),
        ("size_deviation", r"standard deviation $\sigma_P$", 1.0),
        ("sauter_diameter", r"Sauter diameter $d_{32}$ [µm]", 1e6),
    )
    with mpl.rc_context(STYLE):
        figure, axes = blank_figure(1, 3, figsize=(8.4, 2.9))
        for ax, (key, label, unit) in zip(axes, rows, strict=True):
            time = course.time.values
            if f"{key}_monte_carlo" in course:
                ax.plot(time, unit * course[f"{key}_monte_carlo"], color=BLACK, lw=0.8, label=MONTE_CARLO)
            if f"{key}_run_low" in course:
                ends = (unit * course[f"{key}_run_{end}"] for end in ("low", "high"))
                ax.fill_between(time, *ends, color=BLUE, alpha=0.12, lw=0, label=SINGLE_RUNS)
            low, high = (unit * course[f"{key}_{end}"] for end in ("low", "high"))
            ax.fill_between(time, low, high, color=BLUE, alpha=0.3, lw=0)
            ax.plot(time, unit * course[key], color=BLUE, label=f"{TABULATED}, 90 % band")
            if f"{key}_analytical" in course:
                ax.plot(time, unit * course[f"{key}_analytical"], color=VERMILION, ls="--", label=ANALYTICAL)
            ax.set(xlabel="time [s]", ylabel=label, xlim=(0, time[-1]))
            ax.set_ylim(bottom=0)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
        return save(figure, course, path)


def draw_distribution(found: Comparison, path: Path) -> Path:
    """Number distribution of the run's last part, three accounts; and at steady state."""
    data, late = found.distribution, found.numbers.get("late_from")
    panels = [
        key for key in ("late_density", "density") if key in data and (late is not None or key == "density")
    ]
    if not panels:
        panels = ["late_density"]
    with mpl.rc_context(STYLE):
        figure, axes = blank_figure(1, len(panels), figsize=(4.2 * len(panels), 3.6), squeeze=False)
        for ax, key in zip(axes[0], panels, strict=True):
            _distribution(ax, data, key)
            last = "last 40 %" if late is None else f"from {late:.4g} s to the run's end"
            ax.set_title("steady state" if key == "density" else last)
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=len(panels))
        return save(figure, data, path)


def _distribution(ax: Axes, data: xr.Dataset, key: str) -> None:
    size = data["size"].values
    top = float(data[key].max())
    floor = 1e-5 * top
    if f"{key}_run_low" in data:
        # A run of some hundred aggregates may show none of a size: its band then reaches below the axis.
        low, high = (np.maximum(data[f"{key}_run_{end}"], 0.1 * floor) for end in ("low", "high"))
        ax.fill_between(size, low, high, color=BLUE, alpha=0.12, lw=0, label=SINGLE_RUNS)
    ax.fill_between(size, data[f"{key}_low"], data[f"{key}_high"], color=BLUE, alpha=0.3, lw=0)
    ax.plot(size, data[key], color=BLUE, label=f"{TABULATED}, 90 % band")
    # A run that still changes shows no steady state.
    if "density_monte_carlo" in data and (key == "late_density" or data.attrs["steady_run"]):
        seen = data.density_monte_carlo.values > 0
        counted = data.density_monte_carlo.values[seen]
        error = 1.645 * data.density_monte_carlo_error.values[seen]
        # A lower end at or below zero reaches below the axis.
        lengths = error_lengths(np.stack([np.minimum(error, counted - 0.1 * floor), error]))
        ax.errorbar(
            size[seen],
            counted,
            lengths,
            fmt="o",
            ms=3,
            lw=0.8,
            color=BLACK,
            label=f"{MONTE_CARLO}, 90 %",
        )
    if f"{key}_analytical" in data:
        ax.plot(size, data[f"{key}_analytical"], color=VERMILION, ls="--", label=ANALYTICAL)
    ax.set(
        xscale="log", yscale="log", xlabel="primaries per aggregate $P$", ylabel="number share per primary"
    )
    ax.set_ylim(floor, 5 * top)
    ax.set_xlim(0.9, size[np.flatnonzero(data[key].values > floor)[-1]] * 1.1)


def _ablation_panels(found: Comparison) -> list[tuple[str, str]]:
    """The quantities that have anything to show, and their labels."""
    panels = [("mean_size", r"steady $\langle P\rangle$")]
    if "end" in found.numbers:
        panels.insert(0, ("end_mean_size", rf"$\langle P\rangle$ after {found.numbers['end']:.4g} s"))
        panels.append(("late_distance", "distance of sizes\nfrom the Monte Carlo's"))
    return [panel for panel in panels if bool(found.ablation[panel[0]].notnull().any())]


def draw_ablation(found: Comparison, path: Path) -> Path:
    """<P> at the run's end and at steady state with one assumption changed in each line, beside the Monte Carlo."""
    data, numbers, panels = found.ablation, found.numbers, _ablation_panels(found)
    with mpl.rc_context(STYLE):
        figure, axes = blank_figure(
            1, len(panels), figsize=(3.0 + 2.7 * len(panels), 3.6), sharey=True, squeeze=False
        )
        y = np.arange(data.sizes["assumption"])[::-1]
        for ax, (key, label) in zip(axes[0], panels, strict=True):
            if f"{key}_run_high" in numbers:
                ends = (numbers.get(f"{key}_run_low", 0.0), numbers[f"{key}_run_high"])
                ax.axvspan(*ends, color=BLUE, alpha=0.12, lw=0, label=SINGLE_RUNS)
            if f"{key}_low" in numbers:
                ends = (numbers[f"{key}_low"], numbers[f"{key}_high"])
                ax.axvspan(*ends, color=BLUE, alpha=0.3, lw=0, label="90 % band of the table")
            mean, error = numbers.get(f"{key}_monte_carlo"), numbers.get(f"{key}_monte_carlo_error")
            if mean is not None:
                ax.axvline(mean, color=BLACK, lw=0.9, label=MONTE_CARLO)
            if mean is not None and error is not None:
                ax.axvspan(mean - 1.645 * error, mean + 1.645 * error, color=BLACK, alpha=0.15, lw=0)
            ax.plot(data[key], y, "o", color=BLUE, ms=4)
            ax.set_yticks(y, data.assumption.values)
            ax.set(xlabel=label)
        legend_below(figure, axes[0])
        return save(figure, data, path)


def draw_volume_fractions(data: xr.Dataset, path: Path) -> Path:
    """Steady <P> against volume fraction."""
    with mpl.rc_context(STYLE):
        figure, ax = blank_figure(figsize=(4.2, 3.0))
        ax.plot(
            data.volume_fraction,
            data.tabulated,
            "o-",
            color=BLUE,
            ms=4,
            label="tabulated: breakup on encounter",
        )
        if "analytical" in data:
            ax.plot(
                data.volume_fraction,
                data.analytical,
                "s--",
                color=VERMILION,
                ms=4,
                label="analytical: first-order breakup",
            )
        ax.set(xscale="log", xlabel=r"volume fraction $\phi$", ylabel=r"steady mean size $\langle P\rangle$")
        ax.set_ylim(bottom=0)
        ticks_at(ax, data.volume_fraction.values)
        figure.legend(loc="outside lower center")
        return save(figure, data, path)
