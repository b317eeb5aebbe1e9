"""Time and errors of a scene's settings, one row a setting, and which of them no other beats."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from mcdem.analysis.accuracy_cost import QUANTITIES, REFERENCE, Price, front
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
TOLD, LIMIT = "#DDDDDD", BLUE


def worst_limit(price: Price) -> float:
    """The largest 95 % limit of the errors that are sampled."""
    return float(np.max(price.limit[1:]))


def draw_front(prices: Sequence[Price], path: Path, name: str, count: int) -> None:
    """Draw CPU time and errors of every setting, cheapest first.

    An error is a dot with its 95 % limit; where nothing differed there is no dot but an arrow from the limit to the left, since
    nothing is not nought. Rows, not points on a plane of error and time: their names have room however close two settings are.

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
        for row, p in zip(rows, shown, strict=True):
            tint = VERMILION if p.setting.name in best else GREY
            spread = 1e3 * p.time_error if np.isfinite(p.time_error) else 0.0
            time.errorbar(
                1e3 * p.cpu_time, row, xerr=[[min(spread, 0.99e3 * p.cpu_time)], [spread]], fmt="o", ms=3, color=tint,
                elinewidth=0.8,
            )  # fmt: skip
        if reference is not None:
            time.axvline(1e3 * reference.cpu_time, color=GREY, lw=0.8, ls=":", label="reference")
        time.plot(
            [],
            [],
            "o",
            ms=3,
            color=VERMILION,
            label="on the front: no other has both less time and lower limits",
        )
        time.set(xscale="log", xlabel="CPU time of an\nencounter [ms]")
        plain_ticks(time.xaxis)
        time.set_yticks(rows, [p.setting.name.replace("_", " ") for p in shown], fontsize=SMALL)
        time.set_ylim(-0.8, len(shown) - 0.2)
        for k, quantity in enumerate(QUANTITIES):
            _draw_errors(grid[1 + k], rows, shown, k)
            grid[1 + k].set_xlabel(LABELS[quantity])
        for axes in grid:
            axes.set_axisbelow(True)
            axes.grid(axis="y", color=TOLD, lw=0.4)
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
    low, high = 0.5 * max(known.min(), 1e-4 * known.max()), 2.0 * known.max()
    for row, value, top in zip(rows, error, limit, strict=True):
        if not np.isfinite(top) or not value >= 0.0:
            continue
        if value > low:
            axes.plot([value, max(top, value)], [row, row], color=LIMIT, lw=0.8)
            axes.plot(value, row, "o", ms=3, color=LIMIT)
        elif top > low:
            axes.plot([low, top], [row, row], color=LIMIT, lw=0.5, alpha=0.5)
            axes.plot(top, row, "<", ms=3.5, color=LIMIT, mfc="white", mew=0.7)
    axes.plot([], [], "o-", ms=3, lw=0.8, color=LIMIT, label="error and its 95 % limit")
    axes.plot([], [], "<", ms=3.5, color=LIMIT, mfc="white", label="no difference seen: below")
    axes.set(xscale="log")
    axes.set_xlim(low, high)
    plain_ticks(axes.xaxis)
