"""Coagulation with a constant kernel: finite populations, doublings, and the mean field they tend to."""

from __future__ import annotations

import numpy as np

from mcdem.figures.style import BLUE, VERMILION, canvas, legend
from validation.case import Case, Context, Findings, below, near, shown

SMALL, END = 30, 1.5
"""Primaries at the start, and time in units of 2/(K c0), without doubling."""
DOUBLED, LATE = (20, 50, 200), 3.0
ERRORS = 4.0


def parts(context: Context):
    replicas = 200 if context.quick else 2000
    sizes = DOUBLED[:2] if context.quick else DOUBLED
    # About the same number of primaries for each size of sample.
    with_doubling = {f"doubled from {n}": [n, LATE, 0.75, replicas * 8 // n] for n in sizes}
    return {"finite": [SMALL, END, 0.0, replicas]} | with_doubling


def measure(context: Context, part):
    """Aggregates per primary of the start, primaries per volume against the start, and <P>, of each replica at the end."""
    import mcdem
    from mcdem.monte_carlo.process import Process
    from mcdem.quantities.random_streams import stream
    from validation.exact.encounters import constant_kernel

    initial, tau, doubling, replicas = part
    scene = mcdem.load_scene("scenes/paper-1000Pa.toml").with_changes(
        {"population.initial": initial, "population.doubling_below": doubling}
    )
    rows = []
    for replica in range(replicas):
        seed = 1_000_000 * context.seed + 10_000 * initial + replica
        process = Process.begin(scene, seed, ())
        volume = process.population.volume
        kernel = 4 / 3 * scene.flow.shear_rate * (2 * scene.suspension.radius) ** 3
        end = tau / (kernel * initial / volume / 2)
        while process.population.number > 1 and (meeting := process.selection.ahead(1).meeting(0)).time < end:
            pair = [process.population.at(place) for place in (meeting.first, meeting.second)]
            rng = stream(seed, "encounter", meeting.epoch, meeting.number)
            process.encounter(meeting, constant_kernel(scene, *pair, seed=rng))
        now = process.population
        scale = now.volume / volume * initial
        rows.append([now.number / scale, now.primaries / scale])
    return rows


def judge(context: Context, found):
    from pbekit.exact import marcus_lushnikov_constant

    rows = np.array(found["finite"])
    left = rows[:, 0] * SMALL
    mean, variance = marcus_lushnikov_constant(END, SMALL, 2.0, float(SMALL))
    error = np.sqrt(variance / len(left))
    fourth = ((left - left.mean()) ** 4).mean()
    spread = np.sqrt(max(fourth - variance**2, 0.0) / len(left))
    checks = [
        near(f"{SMALL} primaries without doubling: mean number left", left.mean(), mean, abs=ERRORS * error),
        near(f"{SMALL} primaries without doubling: variance", left.var(), variance, abs=ERRORS * spread),
        shown("Smoluchowski's number for the same time", SMALL / (1 + END), expected=mean),
    ]
    field = 1 / (1 + LATE)
    bias = {}
    for label, several in found.items():
        if label == "finite":
            continue
        initial, several = int(label.split()[-1]), np.array(several)
        error = several[:, 0].std() / np.sqrt(len(several))
        bias[initial] = several[:, 0].mean() / field - 1, error / field
        checks.append(
            below(f"{label}: primaries per volume, largest change", np.abs(several[:, 1] - 1).max(), 1e-12)
        )
        # Smoluchowski is the limit; at finite N the number is higher by about its relative variance, of order 1/N.
        checks.append(
            near(f"{label}: number per volume over Smoluchowski's", several[:, 0].mean() / field, 1.0,
                 abs=2.0 / initial + ERRORS * error / field)
        )  # fmt: skip

    def draw():
        figure, axes = canvas(width=6.5, height=2.6, ncols=2)
        counts = np.bincount(left.round().astype(int), minlength=SMALL + 1) / len(left)
        axes[0].bar(np.arange(SMALL + 1), counts, color=BLUE, alpha=0.6, label="drawn")
        axes[0].axvline(mean, color=VERMILION, label="Marcus-Lushnikov mean")
        axes[0].axvline(SMALL / (1 + END), color="k", ls=":", label="Smoluchowski")
        axes[0].set(xlabel="aggregates left", ylabel="share of replicas")
        legend(axes[0])
        sizes = np.array(list(bias))
        values = np.array(list(bias.values()))
        axes[1].errorbar(
            sizes, 100 * values[:, 0], yerr=100 * values[:, 1], fmt="o", color=BLUE, label="with doublings"
        )
        axes[1].axhline(0, color="k", lw=0.5)
        axes[1].set(xscale="log", xlabel="primaries at the start", ylabel="bias of the number (%)")
        legend(axes[1], "bars: one standard error")
        return figure

    return Findings(
        tuple(checks), draw, "A constant kernel: small populations, and the bias that is left with doublings."
    )


CASE = Case(
    chapter=4,
    claim="With a constant kernel finite samples follow Marcus and Lushnikov, and doubled samples Smoluchowski within 2/N, "
    "losing no primary.",
    source="Marcus 1968; Lushnikov 1978; Smoluchowski 1917",
    tolerance="four standard errors (a right program fails a test once in 16 000 seeds); 2/N of a doubled sample, the order of "
    "its finite-size bias; round-off for primaries per volume",
    measure=measure,
    judge=judge,
    parts=parts,
    seen=("doubling_loses_a_copy",),
    seed=1,
)
