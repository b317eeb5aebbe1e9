"""Strength: the largest static tension in aggregates of each size, which says how the size that breaks falls with stress."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Canvas

from mcdem.analysis import paper
from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.statistics import SMALLEST_FITTED, fit_power_law, origins_of, why_no_fit
from mcdem.encounter.static_strength import worst_loads
from mcdem.figures.figure import Figure, NothingToShowError, quantity
from mcdem.figures.style import (
    BLACK,
    BLUE,
    GREY,
    VERMILION,
    canvas,
    headline,
    legend_below,
    opacity,
    plain_ticks,
)

MOST_SNAPSHOTS = 8
"""Of each run: aggregates live on from one to the next, so more snapshots would add little."""


def static_load(runs: Sequence[RunDataset]) -> Figure:
    """Largest static tension over pull-off force against P, of the rigid aggregates."""
    sizes, loads = [], []
    for run in runs:
        if run.scene.effects.contact is None:
            raise NothingToShowError(
                "static_load: the scene has no law of contacts, so bonds have no strength"
            )
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
        rigid_of = f"{int(rigid.sum())} of {len(size)} aggregates of P > 3 at {runs[0].label} are rigid"
        missing = f": {why_no_fit(size[rigid], same)}" if rigid.any() else ""
        raise NothingToShowError(f"static_load: {rigid_of}{missing}")
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
    figure, axes = canvas(height=3.2)
    size, load = numbers["size"].values, numbers["load"].values
    rng = np.random.default_rng(0)  # spread, so that aggregates of one P do not hide each other
    spread = size * np.exp(rng.uniform(-0.02, 0.02, len(size)))
    axes.scatter(
        spread,
        load,
        4,
        color=BLUE,
        alpha=opacity(len(size)),
        lw=0,
        label="aggregate (spread sideways by 2 %)",
    )
    exponent, low, high = numbers["exponent"].values
    span = np.geomspace(0.95 * size.min(), 1.05 * size.max(), 20)
    words = rf"$\propto P^{{{exponent:.2f}}}$ [{low:.2f}, {high:.2f}]"
    if low > 0:
        words += f": $q$ = {1 / exponent:.2f} [{1 / high:.2f}, {1 / low:.2f}]"
    axes.plot(span, float(numbers["prefactor"]) * span**exponent, color=BLACK, label=words)
    if numbers.attrs["paper"]:
        q = paper.BREAKUP_EXPONENT
        middle = np.exp(np.log(span).mean())
        through = float(numbers["prefactor"]) * middle**exponent
        label = f"slope of $q$ = {q:g} (paper)"
        axes.plot(span, through * (span / middle) ** (1.0 / q), ":", color=VERMILION, lw=1.2, label=label)
    axes.axhline(1.0, color=GREY, lw=0.8, ls="--", label="above: breaks")
    axes.set(xscale="log", yscale="log", xlabel="number of primaries  $P$")
    axes.set_ylabel("largest static tension over $F_{adh}$")
    axes.set_xlim(0.94 * size.min(), 1.06 * size.max())
    axes.set_ylim(0.85 * load.min(), 1.15 * max(load.max(), 1.0))
    plain_ticks(axes.xaxis)
    plain_ticks(axes.yaxis)
    headline(axes, f"{len(size)} rigid ({numbers.attrs['rests_on']}), {numbers.attrs['floppy']} floppy")
    legend_below(figure, "[95 % limits]", ncols=1)
    return figure
