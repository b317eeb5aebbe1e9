"""Palette and style of figures, and how one is kept: as a picture with its numbers beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from pbekit.outputs import FILES

# Okabe & Ito's palette, told apart by colour-blind readers.
BLUE, VERMILION, GREEN, ORANGE, BLACK = "#0072B2", "#D55E00", "#009E73", "#E69F00", "#000000"
STYLE = {
    "font.size": 9,
    "axes.labelsize": 9,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.constrained_layout.use": True,
    "lines.linewidth": 1.3,
    "savefig.dpi": 200,
}
TABULATED, MONTE_CARLO, ANALYTICAL, SINGLE_RUNS = (
    "balance on tabulated encounters",
    "Monte Carlo",
    "van de Ven-Mason, power-law breakup",
    "90 % of single runs of its size, by table and chance",
)


def blank_figure(rows: int = 1, columns: int = 1, *, figsize: tuple[float, float], **options: Any) -> Any:
    """A figure that no window shows, and its axes."""
    figure = Figure(figsize=figsize)
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, **options)


def save(figure: Figure, data: xr.Dataset, path: Path) -> Path:
    """The figure as PNG and its numbers as NetCDF of the same name."""
    FILES.write_picture(path.with_suffix(".png"), figure)
    FILES.write_numbers(path.with_suffix(".nc"), data)
    return path.with_suffix(".png")


def legend_below(figure: Figure, axes: np.ndarray, ncols: int = 2) -> None:
    """One legend of all panels, each name once, below them."""
    named: dict[str, Artist] = {}
    for ax in np.ravel(axes):
        for handle, name in zip(*ax.get_legend_handles_labels(), strict=True):
            named.setdefault(name, handle)
    figure.legend(list(named.values()), list(named), loc="outside lower center", ncols=ncols)


def ticks_at(ax: Axes, values: np.ndarray) -> None:
    """Label a logarithmic axis at the values themselves; between close ones its own labels overlap."""
    ax.set_xticks(values, [f"{v:.4g}" for v in values])
    ax.xaxis.set_minor_locator(NullLocator())


def error_lengths(ends: np.ndarray) -> np.ndarray:
    """Lengths of error bars: none where there is no band."""
    return np.where(np.isfinite(ends), np.maximum(ends, 0.0), 0.0)
