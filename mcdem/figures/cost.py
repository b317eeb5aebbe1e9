"""Time and errors of a scene's settings, one row a setting, and which of them no other beats."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from mcdem.analysis.accuracy_cost import QUANTITIES, Price, front
from mcdem.analysis.paired_encounters import REFERENCE
from mcdem.figures.figure import NothingToShowError
from mcdem.figures.style import (
    BLUE,
    GREY,
    SMALL,
    VERMILION,
    canvas,
    headline,
    legend_below,
    look,
    plain_ticks,
)
from mcdem.netcdf.whole_files import FILES

LABELS = {
    "eta_11": "relative error\nof $\\eta_{11}$",
    "outcome": "error of\nthe outcomes",
    "fragment": "error of the\nlargest product",
    "geometry": "error of\nthe shape",
}
ROW = "#DDDDDD"


def worst_limit(price: Price) -> float:
    """The largest 95 % limit of the errors that are sampled."""
    return float(np.max(price.limit[1:]))


def _named(price: Price) -> str:
    return price.setting.name.replace("_", " ") + (" *" if price.setting.of_physics else "")


def draw_front(prices: Sequence[Price], path: Path, name: str, count: int) -> None:
    """Draw CPU time and errors of every setting, cheapest first.

    An error is a dot with its 95 % limit; where nothing differed there is no dot but an arrow from the limit to the left, since
    nothing is not nought. Rows, not points on a plane of error and time: names never overlap, however close two settings are.

    Raises
    ------
    NothingToShowError
        where nothing but the reference was measured
    UserError
        if the figure cannot be saved
    """
    shown = sorted((p for p in prices if p.setting.name != REFERENCE), key=lambda p: p.cpu_time)
    if not shown:
        raise NothingToShowError(f"{path.name}: nothing but the reference was measured")
    best = {p.setting.name for p in front(shown, worst_limit)}
    reference = next((p for p in prices if p.setting.name == REFERENCE), None)
    rows = np.arange(len(shown))[::-1]
    with look():
        figure, grid = canvas(
            7.2,
            1.5 + 0.165 * len(shown),
            ncols=1 + len(QUANTITIES),
            sharey=True,
            width_ratios=(1.3, 1, 1, 1, 1),
        )
        time = grid[0]
        cpu = np.array([1e3 * p.cpu_time for p in shown])
        spread = np.nan_to_num([1e3 * p.time_error for p in shown], posinf=0.0)
        first = np.array([p.setting.name in best for p in shown])
        for chosen, tint, words in (
            (first, VERMILION, "no other has both less time and lower limits"),
            (~first, GREY, None),
        ):
            ends = [np.minimum(spread, 0.99 * cpu)[chosen], spread[chosen]]
            time.errorbar(
                cpu[chosen], rows[chosen], xerr=ends, fmt="o", ms=3, color=tint, elinewidth=0.8, label=words
            )
        if reference is not None:
            time.axvline(1e3 * reference.cpu_time, color=GREY, lw=0.8, ls=":", label="reference")
        time.set(xscale="log", xlabel="CPU time of an\nencounter [ms]")
        plain_ticks(time.xaxis, 3)
        time.set_yticks(rows, [_named(p) for p in shown], fontsize=SMALL)
        time.set_ylim(-0.8, len(shown) - 0.2)
        for k, quantity in enumerate(QUANTITIES):
            _draw_errors(grid[1 + k], rows, shown, k)
            grid[1 + k].set_xlabel(LABELS[quantity])
        for axes in grid:
            axes.set_axisbelow(True)
            axes.grid(axis="y", color=ROW, lw=0.4)
            axes.tick_params(axis="y", length=0)
        headline(time, f"{name}, {count} encounters")
        legend_below(figure, "errors against the reference; * changes physics, not only numerics", ncols=2)
        FILES.write_picture(path, figure)


def _draw_errors(axes: Axes, rows: np.ndarray, shown: Sequence[Price], quantity: int) -> None:
    """Errors of one quantity with their upper limits on a logarithmic axis."""
    error = np.array([p.error[quantity] for p in shown])
    limit = np.array([p.limit[quantity] for p in shown])
    known = np.concatenate([error[error > 0], limit[np.isfinite(limit) & (limit > 0)]])
    if not known.size:
        axes.set(xticks=[])
        return
    high = 2.0 * known.max()
    low = min(0.5 * max(known.min(), 1e-4 * high), high / 30.0)
    told = np.isfinite(limit) & (error >= 0.0)
    seen, unseen = told & (error > low), told & (error <= low) & (limit > low)
    end = np.maximum(limit, error)
    axes.hlines(rows[seen], error[seen], end[seen], color=BLUE, lw=0.8)
    axes.plot(error[seen], rows[seen], "o", ms=3, color=BLUE, label="error, and its 95 % limit")
    axes.hlines(rows[unseen], low, end[unseen], color=BLUE, lw=0.4)
    axes.plot(
        end[unseen],
        rows[unseen],
        "<",
        ms=3.5,
        color=BLUE,
        mfc="white",
        mew=0.7,
        label="no difference seen: below",
    )
    axes.set(xscale="log")
    axes.set_xlim(low, high)
    plain_ticks(axes.xaxis, 3)
