"""Strength: the largest static tension in aggregates of each size, which says how the size that breaks falls with stress."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Canvas

from mcdem.analysis import paper
from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.statistics import SMALLEST_FITTED, fit_power_law, origins_of
from mcdem.encounter.static_strength import worst_loads
from mcdem.figures.figure import Figure, quantity
from mcdem.figures.style import BLACK, BLUE, GREY, VERMILION, canvas, legend

MOST_SNAPSHOTS = 8
"""Of each run: aggregates live on from one to the next, so more snapshots would add little."""


def static_load(runs: Sequence[RunDataset]) -> Figure | None:
    """Largest static tension over pull-off force against P; None where too few are rigid (`OF_AGGREGATES`)."""
    sizes, loads = [], []
    for run in runs:
        if run.scene.effects.contact is None:
            return None
        late = run.late_snapshots
        for k in np.unique(np.linspace(0, len(late) - 1, MOST_SNAPSHOTS).astype(int)):
            large = [aggregate for aggregate in run.aggregates(late[k]) if aggregate.size >= SMALLEST_FITTED]
            sizes += [aggregate.size for aggregate in large]
            loads += worst_loads(run.scene, large).tolist()
    size, load = np.array(sizes), np.array(loads)
    rigid = np.isfinite(load)
    # an aggregate that lives on from one snapshot to the next, or its copy, bears the same
    same = origins_of(size[rigid], load[rigid])
    fit = fit_power_law(size[rigid], load[rigid], same)
    if fit is None:
        return None
    numbers = xr.Dataset(
        {
            "size": quantity(size[rigid], "aggregate", "1", "number of primaries"),
            "load": quantity(load[rigid], "aggregate", "1", "largest static tension over pull-off force"),
            "exponent": quantity(
                [fit.exponent, fit.exponent_low, fit.exponent_high],
                "limit",
                "1",
                "of load against P, 95 % limits",
            ),
            "prefactor": quantity(fit.prefactor, (), "1", "load = prefactor P^exponent"),
        },
        attrs={
            "floppy": int((~rigid).sum()),
            "rests_on": fit.rests_on,
            "paper": int(any(paper.holds_for(runs[0].scene, stress) for stress in paper.STRESSES)),
        },
    )
    return Figure(
        "static_load",
        f"Largest static bond tension, over all orientations, of the rigid aggregates at {runs[0].label}.",
        numbers,
        draw_static_load,
    )


def draw_static_load(numbers: xr.Dataset) -> Canvas:
    """Loads against P with their power law; what is above 1 breaks."""
    figure, axes = canvas()
    size, load = numbers["size"].values, numbers["load"].values
    rng = np.random.default_rng(0)  # spread, so that aggregates of one P do not hide each other
    axes.scatter(size * np.exp(rng.uniform(-0.02, 0.02, len(size))), load, 3, color=BLUE, alpha=0.4, lw=0)
    exponent, low, high = numbers["exponent"].values
    span = np.geomspace(size.min(), size.max() * 1.1, 20)
    words = rf"$\propto P^{{{exponent:.2f}}}$ [{low:.2f}, {high:.2f}]"
    if exponent > 0:
        words += rf": $q$ = {1 / exponent:.2f}"
    axes.plot(span, float(numbers["prefactor"]) * span**exponent, color=BLACK, label=words)
    if numbers.attrs["paper"]:
        q = paper.BREAKUP_EXPONENT
        label = f"slope of $q$ = {q:g} (paper)"
        axes.plot(span, load.mean() * (span / size.mean()) ** (1.0 / q), ":", color=VERMILION, label=label)
    axes.axhline(1.0, color=GREY, lw=0.6, ls="--")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter("{x:g}")
    axes.tick_params(axis="x", which="minor", labelsize=6)
    axes.set_ylim(load.min() * 0.8, load.max() * 4)
    axes.set_yticks(
        [tick for tick in (0.1, 0.2, 0.3, 0.5, 1, 2, 3, 5) if load.min() * 0.8 < tick < load.max() * 4]
    )
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")
    axes.set_xlabel("number of primaries  $P$")
    axes.set_ylabel("largest static tension over pull-off force")
    legend(
        axes,
        f"{len(size)} rigid aggregates, {numbers.attrs['rests_on']};\n{numbers.attrs['floppy']} floppy; above 1: breaks",
        loc="upper left",
    )
    return figure
