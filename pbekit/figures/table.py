"""What a table holds: outcomes and trials of pairs of classes, and fragments."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.colors import LogNorm, Normalize
from matplotlib.ticker import LogLocator, NullLocator

from pbekit.figures.style import (
    STYLE,
    blank_figure,
    legend_below,
    save,
)
from pbekit.tables.kernel_table import AGGREGATION, SCATTERED, KernelTable

FEW_TRIALS = 10
"""Encounters below which a share is no more than a hint: marked by a dot."""


def draw_table(table: KernelTable, path: Path) -> Path:
    """Trials, share that aggregated and share that scattered, by sizes of both parents."""
    r = table.records
    size = table.size_class(r.size)
    shape = (table.sizes, table.sizes)
    both = np.concatenate([size, size[:, ::-1]])
    at = both[:, 0] * table.sizes + both[:, 1]
    count = lambda mask: np.bincount(at, np.tile(mask * r.weight, 2), table.sizes**2).reshape(shape)
    trials = count(np.ones(len(r)))
    data = xr.Dataset(
        {
            "trials": (("size_i", "size_j"), trials),
            "joined": (
                ("size_i", "size_j"),
                np.divide(
                    count(r.outcome == AGGREGATION), trials, where=trials > 0, out=np.full(shape, np.nan)
                ),
            ),
            "scattered": (
                ("size_i", "size_j"),
                np.divide(
                    count(np.isin(r.outcome, SCATTERED)), trials, where=trials > 0, out=np.full(shape, np.nan)
                ),
            ),
        },
        {"size_i": table.size_edges[:-1], "size_j": table.size_edges[:-1]},
    )
    panels = (
        ("trials", "encounters"),
        ("joined", "share that aggregated"),
        ("scattered", "share that scattered"),
    )
    edges = table.size_edges.astype(float)
    middle = np.sqrt(edges[1:] * edges[:-1])
    few = np.nonzero((trials > 0) & (trials < FEW_TRIALS))
    with mpl.rc_context(STYLE):
        figure, axes = blank_figure(1, 3, figsize=(9.0, 3.9))
        for ax, (key, label) in zip(axes, panels, strict=True):
            values = np.where(trials > 0, data[key], np.nan)
            top = float(np.nanmax(values, initial=0.0)) or 1.0
            norm = LogNorm(1.0, max(top, 10.0)) if key == "trials" else Normalize(0.0, top)
            mesh = ax.pcolormesh(edges, edges, values, cmap="viridis", norm=norm)
            # Where no encounter was followed, nothing is known, not nought.
            ax.set_facecolor("#E4E4E4")
            if key != "trials":
                words = f"of fewer than {FEW_TRIALS} encounters"
                ax.plot(
                    middle[few[0]],
                    middle[few[1]],
                    "o",
                    ms=1.5,
                    color="white",
                    mec="black",
                    mew=0.3,
                    label=words,
                )
            ax.set(xscale="log", yscale="log", xlabel="$P_i$", ylabel="$P_j$", aspect="equal")
            ax.set_xlim(edges[0], edges[-1])
            ax.set_ylim(edges[0], edges[-1])
            for axis in (ax.xaxis, ax.yaxis):
                axis.set_major_locator(
                    LogLocator(subs=(1.0, 3.0) if edges[-1] > 15 else (1.0, 2.0, 3.0, 5.0))
                )
                axis.set_major_formatter("{x:g}")
                axis.set_minor_locator(NullLocator())
            figure.colorbar(mesh, ax=ax, label=label, location="top", shrink=0.9)
        axes[0].plot([], [], "s", color="#E4E4E4", label="no encounter")
        legend_below(figure, axes)
        return save(figure, data, path)
