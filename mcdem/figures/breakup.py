"""Figs. 15 and 16: what size breaks, and into what, under each convention of breakup."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Canvas

from mcdem.analysis import paper
from mcdem.analysis.breakup import CONVENTIONS, in_convention
from mcdem.analysis.dataset import RunDataset, by_stress, pool, pooled_breakups
from mcdem.analysis.statistics import OF_MEANS, fit_power_law, shares, why_no_fit
from mcdem.figures.figure import Figure, NothingToShowError, quantity
from mcdem.figures.size_distribution import stretch
from mcdem.figures.style import (
    BLACK,
    CONVENTION,
    GREY,
    canvas,
    headline,
    legend_below,
    own_ticks,
    plain_ticks,
    plural,
)


def percent(value: float, low: float, high: float) -> str:
    """A share in per cent with its limits, to the digits that these call for; where none was seen, what it is below."""
    if value == 0.0:
        return f"below {high:.1g} %"
    digits = max(0, -math.floor(math.log10(max(high - low, 1e-3) / 2.0)))
    return f"{value:.{digits}f} % [{low:.{digits}f}, {high:.{digits}f}]"


def critical_size(runs: Sequence[RunDataset]) -> Figure:
    """Size just before breakup and mean size at steady state against shear stress (Frungieri & Vanni 2021, Fig. 15).

    Parameters
    ----------
    runs : sequence of RunDataset
        Of two or more stresses; those of one stress are replicas.

    Returns
    -------
    Figure
        Its numbers, and what draws them.

    Raises
    ------
    NothingToShowError
        Of runs at one stress alone.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset
    >>> from mcdem.figures import critical_size
    >>> runs = [RunDataset(f"notebooks/data/run-{name}.nc") for name in ("875Pa-of-100", "1000Pa-of-100-seed-2")]
    >>> figure = critical_size(runs)
    >>> figure.numbers["stress"].values.tolist()
    [875.0, 1000.0]
    """
    groups = by_stress(runs)
    stresses = np.array(list(groups))
    if len(groups) < 2:
        raise NothingToShowError("fig15_critical_size: needs runs at two or more stresses, there is one")
    mean = [np.mean([run.average("mean_size").mean for run in group]) for group in groups.values()]
    error = [
        np.sqrt(sum(run.average("mean_size").error ** 2 for run in group)) / len(group)
        for group in groups.values()
    ]
    deviation = [np.mean([run.average("size_deviation").mean for run in group]) for group in groups.values()]
    numbers = xr.Dataset(coords={"stress": quantity(stresses, "stress", "Pa", "shear stress")})
    numbers["mean_size"] = quantity(mean, "stress", "1", "<P> at steady state")
    numbers["mean_size_error"] = quantity(error, "stress", "1", "<P> +- 2 of these are its 95 % limits")
    numbers["size_deviation"] = quantity(deviation, "stress", "1", "sigma_P")
    numbers["steady"] = ("stress", [all(run.steady.reached for run in group) for group in groups.values()])
    numbers = numbers.assign_coords(convention=list(CONVENTIONS))
    rows = {
        convention: [pooled_breakups(group, convention) for group in groups.values()]
        for convention in CONVENTIONS
    }
    for name, words in (
        ("P_br", "mean number of primaries of what broke"),
        ("P_br_deviation", "its standard deviation over the breakups"),
        ("P_br_error", "P_br +- 2 of these are its 95 % limits"),
        ("collider_size", "mean number of primaries of each of the two aggregates"),
        ("breakups", "number of breakups"),
    ):
        numbers[name] = quantity(
            [[row[name] for row in rows[convention]] for convention in CONVENTIONS],
            ("convention", "stress"),
            "1",
            words,
        )
    if not numbers["breakups"].values.any():
        raise NothingToShowError("fig15_critical_size: no breakup in what counts of any of the runs")
    series = {
        "mean_size": numbers["mean_size"].values,
        **{f"P_br_{r}": numbers["P_br"].sel(convention=r).values for r in CONVENTIONS},
    }
    for name, values in series.items():
        known = np.isfinite(values)
        if name == "mean_size" and numbers["steady"].values.sum() < OF_MEANS.origins:
            known[:] = False
        fit = fit_power_law(stresses[known], values[known], minimum=OF_MEANS) if known.any() else None
        limits = [fit.exponent, fit.exponent_low, fit.exponent_high] if fit else [np.nan] * 3
        numbers[f"exponent_{name}"] = quantity(
            -np.array(limits), "limit", "1", "breakup exponent q, 95 % limits"
        )
    return Figure(
        "fig15_critical_size",
        "Size before breakup, under each convention, and mean size at steady state against shear stress.",
        numbers.assign_attrs(
            no_exponent=why_no_fit(stresses, minimum=OF_MEANS),
            paper=int(all(paper.is_suspension(run.scene) for run in runs)),
        ),
        draw_critical_size,
    )


def draw_critical_size(numbers: xr.Dataset) -> Canvas:
    """Means with their limits and standard deviations, exponents, and the paper's slope where the suspension is its own."""
    figure, axes = canvas(height=3.4)
    stress = numbers["stress"].values

    def words(name: str, text: str) -> str:
        q, high, low = numbers[f"exponent_{name}"].values
        if not np.isfinite(q):
            return text
        limits = f" [{low:.2f}, {high:.2f}]" if np.isfinite(low) else ""
        return f"{text}: $q$ = {q:.2f}{limits}"

    series: list[tuple[str, str, str, xr.DataArray, xr.DataArray, xr.DataArray]] = []
    for convention, marker in (("paper", "o"), ("strict", "^"), ("own", "D")):
        tint, reads = CONVENTION[convention]
        one = numbers.sel(convention=convention)
        label = words(f"P_br_{convention}", rf"$P_{{br}}$, {reads}")
        series.append((marker, tint, label, one["P_br"], one["P_br_error"], one["P_br_deviation"]))
    mean = words("mean_size", r"$\langle P\rangle$")
    series.append(
        ("s", BLACK, mean, numbers["mean_size"], numbers["mean_size_error"], numbers["size_deviation"])
    )
    closest = np.diff(np.log(stress)).min()
    steady, ends = numbers["steady"].values, list[float]()
    for k, (marker, tint, label, value, error, deviation) in enumerate(series):
        known = np.isfinite(value.values)
        if not known.any():
            continue
        # Beside each other about their stress, the whole group within a third of the distance to the next.
        x = stress * np.exp(min(0.03, 0.12 * closest) * (k - 1.5))
        y, spread = value.values, np.nan_to_num(deviation.values)
        axes.errorbar(x[known], y[known], spread[known], fmt="none", ecolor=tint, elinewidth=0.6)
        limits = 2 * np.where(np.isfinite(error.values), error.values, 0.0)
        bars = axes.errorbar(
            x[known],
            y[known],
            limits[known],
            fmt=marker,
            color=tint,
            ms=3.5,
            capsize=2.5,
            elinewidth=1.4,
            label=label,
        )
        ends.append(y[known].min())
        if k == len(series) - 1 and not steady.all():
            bars.lines[0].set_markerfacecolor("none")
            axes.plot(x[steady], y[steady], marker, color=tint, ms=3.5)
        if numbers.attrs["paper"] and k in (0, 3):
            anchor = np.mean(np.log(y[known]) + paper.BREAKUP_EXPONENT * np.log(stress[known]))
            axes.plot(
                stress, np.exp(anchor) * stress**-paper.BREAKUP_EXPONENT, ":", color=GREY, lw=0.9,
                label=f"slope of $q$ = {paper.BREAKUP_EXPONENT:g} (paper)",
            )  # fmt: skip
    axes.set(
        xscale="log", yscale="log", xlabel=r"shear stress  $\mu\dot\gamma$ [Pa]", ylabel="number of primaries"
    )
    axes.set_xlim(stress[0] * np.exp(-0.5 * closest), stress[-1] * np.exp(0.5 * closest))
    # A deviation as large as its mean reaches to nought, which such an axis has not.
    axes.set_ylim(0.5 * min(ends), axes.get_ylim()[1])
    own_ticks(axes.xaxis, stress)
    plain_ticks(axes.yaxis)
    counts = numbers["breakups"].values[numbers["breakups"].values > 0]
    told = f"{int(counts.min())} to {int(counts.max())} breakups a point" if counts.size else "no breakups"
    headline(axes, told)
    small_print = (
        "thick: 95 % limits of the mean; thin: standard deviation;\npoints of one stress beside each other"
    )
    if not steady.all():
        small_print += "\nopen: $\\langle P\\rangle$ of a run that is not steady"
    if numbers.attrs["no_exponent"]:
        small_print += f"\n{numbers.attrs['no_exponent']}"
    legend_below(figure, small_print, ncols=1)
    return figure


EDGES = np.linspace(0.0, 1.0, 21)


def largest_fragment(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 16: largest fragment over parent."""
    broken = pool([run.late_breakups for run in runs], "breakup")
    if not broken.sizes["breakup"]:
        raise NothingToShowError(
            f"fig16_largest_fragment: no breakup in the {stretch(runs)} at {runs[0].label}"
        )
    counts = []
    for convention in CONVENTIONS:
        chosen = broken["largest_fragment"].values[in_convention(broken, convention)]
        # a fragment of exactly 0.9 is erosion: bins hold their lower edge
        counts.append(np.histogram(chosen - 1e-9 + 2e-9, EDGES)[0])
    numbers = xr.Dataset(
        {
            "count": quantity(counts, ("convention", "bin"), "1", "breakups"),
            "low": quantity(EDGES[:-1], "bin", "1", "largest fragment over parent, from"),
            "high": quantity(EDGES[1:], "bin", "1", "largest fragment over parent, to"),
        },
        {"convention": list(CONVENTIONS)},
        {"paper": int(paper.holds_for(runs[0].scene, 1000.0)), "stress": runs[0].stress},
    )
    for name in ("erosion_share", "fragmentation_share"):
        for limit in ("", "_low", "_high"):
            numbers[name + limit] = (
                "convention",
                [pooled_breakups(runs, r)[name + limit] for r in CONVENTIONS],
            )
    return Figure(
        "fig16_largest_fragment",
        f"Largest fragment as a share of what broke at {runs[0].label}, under each convention.",
        numbers,
        draw_largest_fragment,
    )


def draw_largest_fragment(numbers: xr.Dataset) -> Canvas:
    """A histogram a convention with 95 % limits; the paper's ranges shaded."""
    figure, axes = canvas(height=3.4)
    edges = np.append(numbers["low"].values, numbers["high"].values[-1])
    step = edges[1] - edges[0]
    if numbers.attrs["paper"]:
        shade = {"color": GREY, "alpha": 0.15, "lw": 0}
        axes.axvspan(*paper.COMPARABLE_FRAGMENTS, **shade, label="paper: over 80 %, erosion's peak (shaded)")
        axes.axvspan(*paper.EROSION_PEAK, **shade)
        axes.axvline(paper.LIKELIEST_FRAGMENT, color=GREY, ls=":", lw=0.9, label="paper: likeliest")
    empties = []
    for side, convention in zip((-1, 0, 1), CONVENTIONS, strict=True):
        tint, words = CONVENTION[convention]
        one = numbers.sel(convention=convention)
        count = one["count"].values
        total = int(count.sum())
        if not total:
            axes.plot([], [], " ", label=f"{words}: none")
            continue
        middle, eroded = (
            percent(*(100 * float(one[f"{name}_share{limit}"]) for limit in ("", "_low", "_high")))
            for name in ("fragmentation", "erosion")
        )
        label = f"{words}: {plural(total, 'breakup')}\n{middle} at 0.45 to 0.75, erosion {eroded}"
        value, low, high = shares(count, total)
        axes.stairs(value, edges, color=tint, lw=1.1, label=label)
        seen = count > 0
        x = 0.5 * (edges[1:] + edges[:-1]) + 0.25 * side * step
        bars = np.maximum([value - low, high - value], 0.0)[:, seen]
        axes.errorbar(x[seen], value[seen], bars, fmt="none", ecolor=tint, elinewidth=0.9, capsize=1.5)
        empties.append(float(high[~seen].max(initial=0.0)))
    axes.set_xlim(0, 1)
    axes.set_ylim(0, None)
    axes.set(xlabel="largest fragment over parent", ylabel=f"share of breakups per {step:g}")
    headline(axes, f"{float(numbers.attrs['stress']):.4g} Pa")
    legend_below(figure, f"bars: 95 % limits; of a bin without any: below {max(empties):.1g}", ncols=1)
    return figure
