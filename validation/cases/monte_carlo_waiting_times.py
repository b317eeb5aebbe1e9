"""When the next encounter comes, and of which pair."""

from __future__ import annotations

import numpy as np
from scipy import stats

from mcdem.figures.style import BLUE, VERMILION, canvas, legend
from validation.case import Case, Context, Findings, above

WAYS = ("majorant_rejection", "inverse_transform")
SIZES = (1, 1, 2, 3, 5, 8, 13, 40)
SIGNIFICANCE = 1e-4


def parts(context: Context):
    return {way: way for way in WAYS}


def measure(context: Context, way: str):
    import mcdem
    from mcdem.monte_carlo.event_selection import event_selection
    from mcdem.monte_carlo.population import SamplePopulation
    from validation.exact.encounters import compact

    scene = mcdem.load_scene("scenes/paper-1000Pa.toml").with_changes({"numerics.event_selection": way})
    radius = scene.suspension.radius
    population = SamplePopulation(radius, 1e-12)
    for size in SIZES:
        population.add(compact(size, radius))
    selection = event_selection(scene, population, context.seed)
    found = []
    for _ in range(4_000 if context.quick else 40_000):
        meeting = selection.ahead(1).meeting(0)
        selection.happened(meeting, [])
        found.append([meeting.time, *sorted((meeting.first, meeting.second))])
    times, first, second = np.array(found).T
    radii = np.array([a.outer_radius(radius) for _, a in population])
    # Eq. 2, written anew.
    rates = np.triu(4 / 3 * scene.flow.shear_rate * (radii[:, None] + radii) ** 3 / population.volume, 1)
    waits = np.diff(times, prepend=0.0) * rates.sum()
    upper = np.triu_indices(len(SIZES), 1)
    counts = np.zeros_like(rates)
    np.add.at(counts, (first.astype(int), second.astype(int)), 1)
    return {
        "waits": stats.kstest(waits, "expon").pvalue,
        "pairs": stats.chisquare(counts[upper], len(times) * rates[upper] / rates.sum()).pvalue,
        "memory": stats.spearmanr(waits[:-1], waits[1:]).pvalue,
        "counts": counts[upper],
        "expected": len(times) * rates[upper] / rates.sum(),
    }


def judge(context: Context, found):
    checks = []
    for way, numbers in found.items():
        for what, words in (
            ("waits", "waiting times are exponential (Eq. 4), Kolmogorov-Smirnov"),
            ("pairs", "pairs come as f_ij (Eqs. 5-6), chi-squared"),
            ("memory", "waits know nothing of the last one, Spearman"),
        ):
            checks.append(above(f"{way}: {words}, p-value", numbers[what], SIGNIFICANCE))

    def draw():
        figure, axes = canvas(height=2.8)
        for (way, numbers), colour, marker in zip(found.items(), (BLUE, VERMILION), "os"):
            counts, expected = np.array(numbers["counts"]), np.array(numbers["expected"])
            axes.errorbar(expected, counts / expected, yerr=1 / np.sqrt(expected), fmt=marker, ms=3, mfc="none",
                          color=colour, label=way)  # fmt: skip
        axes.axhline(1, color="k", lw=0.5)
        axes.set(xscale="log", xlabel="encounters of a pair expected by Eq. 5", ylabel="drawn / expected")
        legend(axes, "bars: one standard error")
        return figure

    return Findings(tuple(checks), draw, "Encounters of each pair of aggregates, drawn against expected.")


CASE = Case(
    chapter=4,
    claim="Encounters come after exponential waits, each pair as often as its frequency f_ij asks, by majorant rejection "
    "and by the paper's inverse-transform sampling.",
    source="Frungieri & Vanni 2021, Eqs. 2-6",
    tolerance="p above 1e-4 for each of six tests with a fixed seed: a right program had a chance of 6e-4 to be refused",
    measure=measure,
    judge=judge,
    parts=parts,
    seen=("flat_encounter_rates",),
    seed=3,
)
