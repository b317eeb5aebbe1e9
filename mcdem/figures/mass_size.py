"""Fig. 9: primaries against radius of gyration, and the exponents of that law in time, which are the figure's inset."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Canvas

from mcdem.analysis import paper
from mcdem.analysis.dataset import RunDataset, origins, pool
from mcdem.analysis.statistics import GIVENS, SMALLEST_FITTED, PowerLaw, fit_mass_size, why_no_fit
from mcdem.figures.figure import Figure, NothingToShowError, quantity
from mcdem.figures.style import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    VERMILION,
    canvas,
    headline,
    legend_below,
    opacity,
    plain_ticks,
)

MOST_SNAPSHOTS = 60
"""Fits against time take at most so many snapshots."""
FIT = ("exponent", "exponent_low", "exponent_high", "prefactor", "prefactor_low", "prefactor_high")
LENGTHS = {"gyration": "radius_of_gyration", "outer": "outer_radius"}


def _row(fit: PowerLaw | None) -> list[float]:
    return [getattr(fit, name) if fit else np.nan for name in FIT]


def _fits(population: xr.Dataset, radius: float) -> list[list[list[float]]]:
    """Rows of FIT by what is given and by length; each origin counts once."""
    same = origins(population)
    return [
        [
            _row(fit_mass_size(population["size"], population[name], radius, given, same))
            for name in LENGTHS.values()
        ]
        for given in GIVENS
    ]


AXES = {"given": list(GIVENS), "length": list(LENGTHS), "limit": list(FIT)}


def mass_size(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 9: P against R_g/a."""
    found = pool([run.population(-1) for run in runs], "aggregate")
    a, of = runs[0].radius, found["size"].values >= SMALLEST_FITTED
    if not (found["size"].values > 1).any():
        raise NothingToShowError(f"fig09_mass_size: nothing has aggregated at {runs[0].label} yet")
    numbers = found[["size", "radius_of_gyration", "outer_radius"]].assign_coords(AXES)
    numbers["fit"] = quantity(
        _fits(found, a),
        tuple(AXES),
        "1",
        "P = k (length/a)^d over P > 3 by either regression, with 95 % limits, last snapshot",
    )
    law = fit_mass_size(found["size"], found["radius_of_gyration"], a, origin=origins(found))
    rests_on = law.rests_on if law else why_no_fit(found["size"].values[of], origins(found)[of])
    return Figure(
        "fig09_mass_size",
        f"Primaries per aggregate against radius of gyration at {runs[0].label}.",
        numbers.assign_attrs(
            primary_radius=a, rests_on=rests_on, paper=int(paper.holds_for(runs[0].scene, 1000.0))
        ),
        draw_mass_size,
    )


def draw_mass_size(numbers: xr.Dataset) -> Canvas:
    """Every aggregate, both regressions, the paper's line."""
    figure, axes = canvas(height=3.4)
    x, p = numbers["radius_of_gyration"].values / numbers.attrs["primary_radius"], numbers["size"].values
    fitted = p >= SMALLEST_FITTED
    axes.scatter(x[fitted], p[fitted], 9, color=BLUE, alpha=opacity(int(fitted.sum())), linewidths=0)
    small = ~fitted & (x > 0)
    if small.any():
        axes.scatter(
            x[small], p[small], 7, color=GREY, marker="x", linewidths=0.6, label="$P < 4$, not fitted"
        )
    span = np.geomspace(0.95 * x[x > 0].min(), 1.05 * x.max(), 50)
    for given, line, words in (("size", "-", "$R_g$ on $P$"), ("length", ":", "$P$ on $R_g$")):
        fit = dict(zip(FIT, numbers["fit"].sel(given=given, length="gyration").values, strict=True))
        if np.isfinite(fit["exponent"]):
            label = (
                rf"{words}: $k_g$ = {fit['prefactor']:.2f} [{fit['prefactor_low']:.2f}, {fit['prefactor_high']:.2f}], "
                rf"$d_g$ = {fit['exponent']:.2f} [{fit['exponent_low']:.2f}, {fit['exponent_high']:.2f}]"
            )
            axes.plot(span, fit["prefactor"] * span ** fit["exponent"], line, color=BLACK, label=label)
    if numbers.attrs["paper"]:
        k, d = paper.GYRATION_PREFACTOR, paper.GYRATION_EXPONENT
        axes.plot(span, k * span**d, "--", color=VERMILION, label=rf"paper: $k_g$ = {k:g}, $d_g$ = {d:g}")
    axes.set(
        xscale="log", yscale="log", xlabel="radius of gyration  $R_g/a$", ylabel="number of primaries  $P$"
    )
    axes.set_xlim(span[0], span[-1])
    axes.set_ylim(0.8 * p[x > 0].min(), 1.25 * p.max())
    plain_ticks(axes.xaxis)
    plain_ticks(axes.yaxis)
    headline(axes, f"{int(fitted.sum())} aggregates of $P > 3$: {numbers.attrs['rests_on']}")
    legend_below(figure, "[95 % limits; what is alike counts once]", ncols=1)
    return figure


def exponents_in_time(runs: Sequence[RunDataset]) -> Figure:
    """The inset of Fig. 9: d_g and d_o at the snapshots of the first of the replicas."""
    run = runs[0]
    chosen = np.unique(np.linspace(0, len(run.snapshot_times) - 1, MOST_SNAPSHOTS).round().astype(int))
    course = np.array([_fits(run.population(int(k), rigidity=False), run.radius) for k in chosen])
    if np.isfinite(course[..., 0]).any(axis=(1, 2)).sum() < 2:
        raise NothingToShowError(
            f"fig09_exponents_in_time: fewer than two snapshots at {run.label} hold aggregates enough for an exponent"
        )
    numbers = xr.Dataset(
        coords=AXES, attrs={"paper": int(paper.holds_for(run.scene, 1000.0)), "stress": run.stress}
    )
    numbers["snapshot_time"] = quantity(run.snapshot_times[chosen], "snapshot", "s", "process time")
    numbers["course"] = quantity(
        course, ("snapshot", *AXES), "1", "P = k (length/a)^d over P > 3 at each snapshot, with 95 % limits"
    )
    return Figure(
        "fig09_exponents_in_time",
        f"Exponents of primaries against radius of gyration and outer radius in time at {run.label}.",
        numbers,
        draw_exponents_in_time,
    )


def draw_exponents_in_time(numbers: xr.Dataset) -> Canvas:
    """Both exponents with their limits; the paper's ranges."""
    figure, axes = canvas(height=3.0)
    t = numbers["snapshot_time"].values
    for length, tint, words in (("gyration", BLUE, "$d_g$"), ("outer", ORANGE, "$d_o$")):
        exponent, low, high = (
            numbers["course"].sel(given="size", length=length, limit=limit).values for limit in FIT[:3]
        )
        known = np.isfinite(exponent)
        axes.plot(t[known], exponent[known], "o-", ms=2, color=tint, lw=0.9, label=words)
        axes.fill_between(t[known], low[known], high[known], color=tint, alpha=0.18, lw=0)
        if numbers.attrs["paper"]:
            first, late = paper.EXPONENT_RANGES[length]
            axes.axhspan(
                *late, fill=False, hatch="////", color=tint, alpha=0.35, lw=0, label=f"{words}, paper, late"
            )
            axes.plot(t[0], first, ">", color=tint, ms=5, clip_on=False, label=f"{words}, paper, at first")
    shown = numbers["course"].sel(given="size", limit="exponent").values
    least, most = float(np.nanmin(shown)), float(np.nanmax(shown))
    if numbers.attrs["paper"]:
        least, most = min(least, 1.5), max(most, 2.1)
    axes.set_ylim(max(least - 0.6, 0.0), most + 0.6)
    axes.set_xlim(0, max(t[-1], 1e-9))
    axes.set(xlabel="process time  $t$ [s]", ylabel="exponent of $P$ against length")
    headline(axes, f"length on $P$, aggregates of $P > 3$, {float(numbers.attrs['stress']):.4g} Pa")
    legend_below(figure, "bands: 95 % limits", ncols=3)
    return figure
