"""Figs. 15 and 16: what size breaks, and into what, under each convention of breakup."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Canvas

from mcdem.analysis import paper
from mcdem.analysis.breakup import CONVENTIONS, in_convention
from mcdem.analysis.dataset import RunDataset, by_stress, pool, pooled_breakups
from mcdem.analysis.statistics import OF_MEANS, fit_power_law, shares, why_no_fit
from mcdem.figures.figure import Figure, quantity
from mcdem.figures.style import BLACK, CONVENTION, GREY, canvas, legend


def critical_size(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 15: size just before breakup and mean size at steady state against shear stress."""
    groups = by_stress(runs)
    stresses = np.array(list(groups))
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
    series = {
        "mean_size": numbers["mean_size"].values,
        **{f"P_br_{r}": numbers["P_br"].sel(convention=r).values for r in CONVENTIONS},
    }
    for name, values in series.items():
        known = np.isfinite(values)
        fit = fit_power_law(stresses[known], values[known], minimum=OF_MEANS) if known.any() else None
        limits = [fit.exponent, fit.exponent_low, fit.exponent_high] if fit else [np.nan] * 3
        numbers[f"exponent_{name}"] = quantity(
            -np.array(limits), "limit", "1", "breakup exponent q, 95 % limits"
        )
    return Figure(
        "fig15_critical_size",
        "Size before breakup, under each convention, and mean size at steady state against shear stress.",
        numbers.assign_attrs(no_exponent=why_no_fit(stresses, minimum=OF_MEANS)),
        draw_critical_size,
    )


def draw_critical_size(numbers: xr.Dataset) -> Canvas:
    """Means with standard deviations, exponents, and the paper's slope of -2."""
    figure, axes = canvas(height=3.1)
    stress = numbers["stress"].values

    def words(name: str, text: str) -> str:
        q, high, low = numbers[f"exponent_{name}"].values
        if not np.isfinite(q):
            return text
        limits = f" [{low:.1f}, {high:.1f}]" if np.isfinite(low) else ""
        return f"{text}: q = {q:.1f}{limits}"

    for shift, convention, marker in ((0.96, "paper", "o"), (0.985, "strict", "^"), (1.01, "own", "D")):
        colour, reads = CONVENTION[convention]
        one = numbers.sel(convention=convention)
        axes.errorbar(
            stress * shift,
            one["P_br"],
            one["P_br_deviation"],
            fmt=marker,
            color=colour,
            ms=4,
            capsize=2,
            elinewidth=0.7,
            label=words(f"P_br_{convention}", rf"$\bar P_{{br}}$, {reads}"),
        )
        for x, y, n in zip(
            stress * shift, (one["P_br"] - one["P_br_deviation"]).values, one["breakups"].values, strict=True
        ):
            if np.isfinite(y):
                axes.annotate(
                    f"{int(n)}",
                    (x, y),
                    (0, -7),
                    textcoords="offset points",
                    fontsize=4.5,
                    color=colour,
                    ha="center",
                )
    axes.errorbar(
        stress * 1.035,
        numbers["mean_size"],
        numbers["size_deviation"],
        fmt="s",
        color=BLACK,
        ms=3.5,
        capsize=2,
        elinewidth=0.7,
        label=words("mean_size", r"$\langle P\rangle$"),
    )
    span = np.geomspace(min(stress.min(), 700), max(stress.max(), 1050), 20)
    for level in (numbers["P_br"].sel(convention="paper").values, numbers["mean_size"].values):
        if np.isfinite(level).any():
            anchor = np.nanmean(np.log(level) + paper.BREAKUP_EXPONENT * np.log(stress))
            label = (
                "slope $-2.0$ (paper)" if level is not numbers["mean_size"].values and axes.lines else None
            )
            axes.plot(
                span, np.exp(anchor) * span**-paper.BREAKUP_EXPONENT, ":", color=GREY, lw=0.8, label=label
            )
            label = None
    axes.set_xscale("log")
    axes.set_yscale("log")
    ticks = sorted({*np.round(stress).astype(int).tolist(), 750, 1000})
    axes.set_xticks(ticks, [str(t) for t in ticks])
    axes.minorticks_off()
    top, bottom = axes.get_ylim()[1], axes.get_ylim()[0]
    axes.set_ylim(max(bottom, 1.0), top * 9.0)
    axes.set_yticks([1, 2, 5, 10, 20, 50, 100, 200], ["1", "2", "5", "10", "20", "50", "100", "200"])
    axes.set_ylim(max(bottom, 1.0), top * 9.0)
    axes.set_xlabel(r"shear stress  $\mu\dot\gamma$ [Pa]")
    axes.set_ylabel("number of primaries")
    steady = "" if bool(numbers["steady"].all()) else "; not all runs are steady"
    missing = f"\n{numbers.attrs['no_exponent']}" if numbers.attrs["no_exponent"] else ""
    legend(axes, f"bars: standard deviation\nsmall numbers: breakups{steady}{missing}", loc="upper right")
    return figure


EDGES = np.linspace(0.0, 1.0, 21)


def largest_fragment(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 16: largest fragment over parent."""
    broken = pool([run.late_breakups for run in runs], "breakup")
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
    figure, axes = canvas(height=3.0)
    low, high = numbers["low"].values, numbers["high"].values
    top = 0.0

    def in_words(one: xr.Dataset) -> str:
        if not int(one["count"].sum()):
            return ""
        told = [
            float(one[f"{name}_share{limit}"])
            for name in ("fragmentation", "erosion")
            for limit in ("", "_low", "_high")
        ]
        return "\n0.45 to 0.75: {:.0%} [{:.0%}, {:.0%}]\nerosion: {:.0%} [{:.0%}, {:.0%}]".format(*told)

    for side, convention in zip((-1, 0, 1), CONVENTIONS, strict=True):
        colour, words = CONVENTION[convention]
        one = numbers.sel(convention=convention)
        count = one["count"].values
        total = max(count.sum(), 1)
        x = 0.5 * (low + high) + side * 0.28 * (high - low)
        axes.bar(
            x,
            count / total,
            0.26 * (high - low),
            color=colour,
            alpha=0.7,
            lw=0,
            label=f"{words}: {count.sum()}{in_words(one)}",
        )
        if not count.any():
            continue
        value, lowest, highest = shares(count, int(total))
        axes.errorbar(x, value, [value - lowest, highest - value], fmt="none", ecolor=BLACK, elinewidth=0.5)
        top = max(top, highest.max())
    if numbers.attrs["paper"]:
        axes.axvspan(
            *paper.COMPARABLE_FRAGMENTS,
            color=GREY,
            alpha=0.13,
            lw=0,
            label="paper: > 80 %, and erosion's peak",
        )
        axes.axvspan(*paper.EROSION_PEAK, color=GREY, alpha=0.13, lw=0)
        axes.axvline(paper.LIKELIEST_FRAGMENT, color=GREY, ls=":", lw=0.8)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, max(2.1 * top, 0.1))
    axes.set_xlabel("largest fragment over parent")
    axes.set_ylabel("share of breakups")
    legend(axes, "" if numbers["count"].sum() else "no breakups in the steady stretch", loc="upper left")
    return figure
