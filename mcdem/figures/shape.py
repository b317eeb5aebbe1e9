"""Figs. 9, 11, 12, 13 and the isostaticity figure: shape and structure of the aggregates at the end of a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Canvas

from mcdem.analysis import paper
from mcdem.analysis.dataset import RunDataset, origins, pool
from mcdem.analysis.statistics import GIVENS, SMALLEST_FITTED, PowerLaw, fit_mass_size, shares, why_no_fit
from mcdem.figures.figure import Figure, quantity
from mcdem.figures.size_distribution import stretch
from mcdem.figures.style import BLACK, BLUE, GREEN, GREY, ORANGE, VERMILION, canvas, legend, note

MOST_SNAPSHOTS = 60
"""Fits against time take at most so many snapshots."""


def last_population(runs: Sequence[RunDataset]) -> xr.Dataset:
    """Every aggregate of the last snapshots of replicas, with both conventions of the ellipsoid."""
    found = pool([run.population(-1) for run in runs], "aggregate")
    solid = pool([run.population(-1, "spheres", rigidity=False) for run in runs], "aggregate")
    found["solid_fraction_ellipsoid_spheres"] = solid["solid_fraction_ellipsoid"].assign_attrs(
        long_name="solid fraction of the ellipsoid of solid primaries"
    )
    stress = runs[0].stress
    return found.assign_attrs(stress=stress, paper=int(paper.holds_for(runs[0].scene, 1000.0)))


# Fig. 9

FIT = ("exponent", "exponent_low", "exponent_high", "prefactor", "prefactor_low", "prefactor_high")


def _row(fit: PowerLaw | None) -> list[float]:
    return [getattr(fit, name) if fit else np.nan for name in FIT]


def mass_size(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 9: P against R_g/a, with the exponents' course in the inset."""
    found = last_population(runs)
    a = runs[0].radius
    numbers = found[["size", "radius_of_gyration", "outer_radius"]]
    lengths = {"gyration": "radius_of_gyration", "outer": "outer_radius"}

    def fits(population: xr.Dataset) -> list[list[list[float]]]:
        same = origins(population)
        return [
            [
                _row(fit_mass_size(population["size"], population[name], a, given, same))
                for name in lengths.values()
            ]
            for given in GIVENS
        ]

    numbers = numbers.assign_coords(given=list(GIVENS), length=list(lengths), limit=list(FIT))
    numbers["fit"] = quantity(
        fits(found),
        ("given", "length", "limit"),
        "1",
        "P = k (length/a)^d over P > 3 by either regression, with 95 % limits, last snapshot",
    )
    of = found["size"].values >= SMALLEST_FITTED
    same = origins(found)[of]
    law = fit_mass_size(found["size"], found["radius_of_gyration"], a, origin=origins(found))
    rests_on = law.rests_on if law else why_no_fit(found["size"].values[of], same)
    run = runs[0]
    chosen = np.unique(np.linspace(0, len(run.snapshot_times) - 1, MOST_SNAPSHOTS).round().astype(int))
    course = []
    for k in chosen:
        course.append(fits(run.population(int(k), rigidity=False)))
    numbers["snapshot_time"] = quantity(run.snapshot_times[chosen], "snapshot", "s", "process time")
    numbers["course"] = quantity(
        course, ("snapshot", "given", "length", "limit"), "1", "the fits at each snapshot, first run"
    )
    return Figure(
        "fig09_mass_size",
        f"Primaries per aggregate against radius of gyration at {run.label}; inset: exponents in time.",
        numbers.assign_attrs(
            primary_radius=a, rests_on=rests_on, paper=int(paper.holds_for(run.scene, 1000.0))
        ),
        draw_mass_size,
    )


def draw_mass_size(numbers: xr.Dataset) -> Canvas:
    """Points, both regressions, the paper's line; d_g and d_o against time."""
    figure, axes = canvas(height=3.2)
    a = numbers.attrs["primary_radius"]
    x, p = numbers["radius_of_gyration"].values / a, numbers["size"].values
    fitted = p > 3
    axes.scatter(x[fitted], p[fitted], 8, facecolors="none", edgecolors=BLUE, linewidths=0.5)
    small = (p <= 3) & (x > 0)
    axes.scatter(x[small], p[small], 6, color=GREY, marker="x", linewidths=0.5)
    span = np.geomspace(1.0, max(x.max(), 2) * 1.1, 50)
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
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(0.9, max(p.max() * 25.0, 30))
    axes.set_xlabel(r"$R_g/a$")
    axes.set_ylabel("number of primaries  $P$")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter("{x:g}")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.tick_params(axis="x", which="minor", labelsize=6)
    legend(
        axes,
        f"{fitted.sum()} aggregates of $P > 3$, [95 % limits];\n{numbers.attrs['rests_on']}",
        loc="lower right",
    )

    inset = axes.inset_axes((0.10, 0.60, 0.55, 0.36))
    t = numbers["snapshot_time"].values
    for length, colour, words in (("gyration", BLUE, "$d_g$"), ("outer", ORANGE, "$d_o$")):
        course = numbers["course"].sel(given="size", length=length)
        inset.plot(t, course.sel(limit="exponent"), color=colour, lw=0.7, label=words)
        inset.fill_between(
            t,
            course.sel(limit="exponent_low"),
            course.sel(limit="exponent_high"),
            color=colour,
            alpha=0.2,
            lw=0,
        )
        if numbers.attrs["paper"]:
            inset.axhspan(
                *paper.EXPONENT_RANGES[length][1], color=colour, alpha=0.12, lw=0, hatch="////", fill=False
            )
            inset.plot(t[0], paper.EXPONENT_RANGES[length][0], ">", color=colour, ms=3, clip_on=False)
    inset.set_ylim(1.0, 3.6)
    inset.set_xlim(0, max(t[-1], 1e-9))
    inset.tick_params(labelsize=5.5)
    inset.set_xlabel("$t$ [s]", fontsize=6, labelpad=0)
    title = "length on $P$" + ("; hatched, arrows: paper" if numbers.attrs["paper"] else "")
    inset.legend(fontsize=5.5, ncols=2, loc="upper right", title=title, title_fontsize=5)
    return figure


# Fig. 11


def solid_fraction(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 11: solid fraction by outer sphere and by ellipsoid."""
    found = last_population(runs)
    names = ["size", "solid_fraction_sphere", "solid_fraction_ellipsoid", "solid_fraction_ellipsoid_spheres"]
    return Figure(
        "fig11_solid_fraction",
        f"Solid fraction of the aggregates by outer sphere and by inertia-equivalent ellipsoid at {runs[0].label}.",
        found[names],
        draw_solid_fraction,
    )


def draw_solid_fraction(numbers: xr.Dataset) -> Canvas:
    """Both volumes against P, above a trimer; the ellipsoid in both conventions."""
    figure, axes = canvas()
    shown = numbers.isel(aggregate=numbers["size"].values > 3)
    p = shown["size"]
    axes.scatter(
        p, shown["solid_fraction_sphere"], 9, color=BLACK, marker="o", linewidths=0, label="outer sphere"
    )
    for name, colour, marker, words in (
        ("solid_fraction_ellipsoid", VERMILION, "s", "ellipsoid (points)"),
        ("solid_fraction_ellipsoid_spheres", GREEN, "^", "ellipsoid (solid primaries)"),
    ):
        axes.scatter(
            p,
            shown[name],
            9,
            facecolors="none",
            edgecolors=colour,
            marker=marker,
            linewidths=0.5,
            label=words,
        )
    axes.axhline(np.pi / np.sqrt(18), color=GREY, lw=0.6, ls=":")
    axes.text(
        0.99,
        np.pi / np.sqrt(18),
        "close packing",
        transform=axes.get_yaxis_transform(),
        fontsize=5.5,
        ha="right",
    )
    axes.set_xlabel("number of primaries  $P$")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_ylabel(r"solid fraction  $\phi$")
    axes.set_ylim(0, 1.35)
    axes.set_xlim(0, None)
    axes.legend(loc="upper right", handletextpad=0.2)
    note(axes, f"{shown.sizes['aggregate']} aggregates of $P > 3$", (0.03, 0.97))
    return figure


# Fig. 12

BINS = np.arange(1.0, 8.01, 0.25)


def aspect_distribution(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 12a: distribution of the aspect ratio of aggregates of P > 2."""
    found = last_population(runs)
    ratio = found["aspect_ratio"].values[found["size"].values > 2]
    edges = np.append(BINS, max(BINS[-1] + 0.25, ratio.max() + 0.25 if len(ratio) else 0))
    late = [
        np.histogram(one["aspect_ratio"].values[one["size"].values > 2], edges)[0]
        for run in runs
        for one in (run.population(k, rigidity=False) for k in run.late_snapshots)
    ]
    by_snapshot = np.array([h / max(h.sum(), 1) for h in late])
    numbers = xr.Dataset(
        {
            "count": quantity(
                np.histogram(ratio, edges)[0], "bin", "1", "aggregates of P > 2, last snapshot"
            ),
            "low": quantity(edges[:-1], "bin", "1", "aspect ratio from"),
            "high": quantity(edges[1:], "bin", "1", "aspect ratio to"),
            "steady_share": quantity(by_snapshot.mean(axis=0), "bin", "1", "share over the steady stretch"),
            "steady_scatter": quantity(
                by_snapshot.std(axis=0), "bin", "1", "its standard deviation over snapshots"
            ),
        },
        attrs={"snapshots": len(by_snapshot), "stretch": stretch(runs), **found.attrs},
    )
    return Figure(
        "fig12a_aspect_ratio",
        f"Distribution of the aspect ratio (Eq. 27) at {runs[0].label}, aggregates of P > 2.",
        numbers,
        draw_aspect_distribution,
    )


def draw_aspect_distribution(numbers: xr.Dataset) -> Canvas:
    """Density with 95 % limits; the paper's ranges shaded."""
    figure, axes = canvas()
    count, low, high = (numbers[n].values for n in ("count", "low", "high"))
    total, step = max(count.sum(), 1), high - low
    middle = 0.5 * (low + high)
    axes.bar(middle, count / total / step, 0.92 * step, color=BLUE, alpha=0.55, lw=0, label="last snapshot")
    seen = count > 0
    within = np.arange(len(count)) <= (np.flatnonzero(seen)[-1] if seen.any() else -1)
    value, lowest, highest = shares(count, int(total)) / step
    axes.errorbar(
        middle[within],
        value[within],
        np.abs([lowest - value, highest - value])[:, within],
        fmt="none",
        ecolor=GREY,
        elinewidth=0.6,
    )
    if numbers.attrs["snapshots"] > 1:
        mean, scatter = numbers["steady_share"].values / step, numbers["steady_scatter"].values / step
        axes.plot(middle, mean, color=BLACK, drawstyle="steps-mid", lw=0.8, label=numbers.attrs["stretch"])
        axes.fill_between(middle, mean - scatter, mean + scatter, step="mid", color=BLACK, alpha=0.15, lw=0)
    between = (low >= paper.SLIGHTLY_ELONGATED[0]) & (high <= paper.SLIGHTLY_ELONGATED[1])
    rods = low >= paper.RODS_ABOVE
    if numbers.attrs["paper"]:
        axes.axvspan(*paper.SLIGHTLY_ELONGATED, color=VERMILION, alpha=0.08, lw=0, label="paper: most")
        axes.axvline(paper.RODS_ABOVE, ymax=0.6, color=VERMILION, ls="--", lw=0.7, label="paper: rods above")
    axes.set_xlim(1, min(8.25, max(4.0, high[count > 0].max() if seen.any() else 4)))
    axes.set_ylim(0, 1.6 * max(np.max(highest[within], initial=0.0), 0.1))
    axes.set_xlabel("aspect ratio  A.R.")
    axes.set_ylabel("probability density")
    legend(
        axes,
        f"{count.sum()} aggregates of $P > 2$; bars: 95 %\n1.25 to 2.00: {count[between].sum() / total:.0%}, "
        f"above 2.50: {count[rods].sum() / total:.0%}",
    )
    return figure


def aspect_against_size(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 12b."""
    found = last_population(runs)
    return Figure(
        "fig12b_aspect_ratio_size",
        f"Aspect ratio against number of primaries at {runs[0].label}.",
        found[["size", "aspect_ratio"]],
        draw_aspect_against_size,
    )


def draw_aspect_against_size(numbers: xr.Dataset) -> Canvas:
    """Points, the longest of each tenth of sizes, the paper's lower bound."""
    figure, axes = canvas()
    shown = numbers.isel(aggregate=numbers["size"].values > 2)
    p, ratio = shown["size"].values, shown["aspect_ratio"].values
    axes.scatter(p, ratio, 8, facecolors="none", edgecolors=BLUE, linewidths=0.5)
    if numbers.attrs["paper"]:
        axes.axhline(
            paper.SMALLEST_ASPECT_RATIO, color=VERMILION, ls="--", lw=0.7, label="paper: about the smallest"
        )
        axes.legend(loc="upper left")
    axes.set_xlabel("number of primaries  $P$")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_ylabel("aspect ratio  A.R.")
    axes.set_xlim(0, None)
    axes.set_ylim(0.9, 1.15 * max(ratio.max() if len(ratio) else 2, 2))
    note(axes, f"{len(p)} aggregates of $P > 2$", (0.97, 0.97))
    return figure


# Fig. 13 and isostaticity


def coordination(runs: Sequence[RunDataset]) -> Figure:
    """Fig. 13: mean coordination number against P, markers by how many aggregates share the pair of values."""
    found = last_population(runs)
    pairs, count = np.unique(
        np.column_stack([found["size"].values, found["bond_count"].values]), axis=0, return_counts=True
    )
    numbers = xr.Dataset(
        {
            "size": quantity(pairs[:, 0], "pair", "1", "number of primaries P"),
            "bond_count": quantity(pairs[:, 1], "pair", "1", "number of bonds"),
            "count": quantity(count, "pair", "1", "aggregates with these"),
        },
        attrs=found.attrs,
    )
    return Figure(
        "fig13_coordination",
        f"Mean coordination number against number of primaries at {runs[0].label}.",
        numbers,
        draw_coordination,
    )


def draw_coordination(numbers: xr.Dataset) -> Canvas:
    """Bubbles, the isostatic 6 - 12/P and the paper's range."""
    figure, axes = canvas()
    p, count = numbers["size"].values, numbers["count"].values
    axes.scatter(
        p,
        2 * numbers["bond_count"] / p,
        6 * count**0.7,
        facecolors=BLUE,
        edgecolors=BLUE,
        alpha=0.45,
        linewidths=0.3,
    )
    x = np.linspace(3, max(p.max(), 6), 200)
    axes.plot(x, 6 - 12 / x, color=BLACK, lw=0.8, label="isostatic, $6-12/P$")
    if numbers.attrs["paper"] and p.max() > 15:
        axes.fill_between(
            [15, p.max()], *paper.COORDINATION, color=VERMILION, alpha=0.12, lw=0, label="paper, $P>15$"
        )
    axes.set_xlabel("number of primaries  $P$")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_ylabel(r"mean coordination number  $\bar n_c$")
    axes.set_xlim(0, None)
    axes.set_ylim(-0.3, 7.2)
    legend(axes, f"{count.sum()} aggregates; area by their number", loc="lower right")
    return figure


def isostaticity(runs: Sequence[RunDataset]) -> Figure:
    """Bonds beyond or short of 3P - 6, and what they leave floppy."""
    found = last_population(runs)
    names = ["size", "bond_count", "isostatic_bond_count", "floppy_modes", "redundant_bonds"]
    return Figure(
        "isostaticity",
        f"Bonds against the isostatic count 3P - 6, and floppy modes, at {runs[0].label}.",
        found[names],
        draw_isostaticity,
    )


def draw_isostaticity(numbers: xr.Dataset) -> Canvas:
    """Left: excess of bonds, by rigidity. Right: Table 2 of the paper the same way where it applies."""
    figure, axes = canvas()
    shown = numbers.isel(aggregate=numbers["size"].values > 2)
    p = shown["size"].values
    excess = shown["bond_count"].values - shown["isostatic_bond_count"].values
    floppy, redundant = shown["floppy_modes"].values, shown["redundant_bonds"].values
    kinds = (
        ("rigid, isostatic", (floppy == 0) & (redundant == 0), BLUE, "o"),
        ("rigid, over-braced", (floppy == 0) & (redundant > 0), GREEN, "^"),
        ("floppy", floppy > 0, VERMILION, "s"),
    )
    for words, chosen, colour, marker in kinds:
        pairs, count = np.unique(np.column_stack([p[chosen], excess[chosen]]), axis=0, return_counts=True)
        if not len(pairs):
            continue
        axes.scatter(
            pairs[:, 0],
            pairs[:, 1],
            5 * count**0.7,
            color=colour,
            marker=marker,
            alpha=0.6,
            linewidths=0,
            label=f"{words}: {chosen.sum()}",
        )
    table = paper.TABLE_2
    axes.scatter(
        table[:, 0],
        np.round(table[:, 0] * table[:, 4] / 2) - (3 * table[:, 0] - 6),
        14,
        facecolors="none",
        edgecolors=BLACK,
        linewidths=0.6,
        marker="D",
        label="paper, Table 2 (750 Pa)",
    )
    axes.axhline(0, color=GREY, lw=0.5)
    axes.set_xlabel("number of primaries  $P$")
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_ylabel("bonds beyond $3P-6$")
    axes.legend(loc="lower left", markerscale=0.8)
    return figure
