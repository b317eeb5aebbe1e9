"""Samples of some hundred aggregates that grow and break, with doublings, against the mean field of the same encounters."""

from __future__ import annotations

import numpy as np

from mcdem.figures.style import CYCLE, GREY, MARKERS, canvas, legend
from validation.case import Case, Context, Findings, below, near, shown

EFFICIENCY, LARGEST = 0.8, 10
TIMES = (0.4, 0.8, 1.2, 2.0)
"""Units of 2/(K_11 eta n_0), in which the number halves at the rate of the start; the last is steady."""
INITIAL, QUICK = (100, 200, 400), (40, 80)
REPLICAS, FEW = 60, 20
THRESHOLDS = (0.25, 0.5, 0.75, 0.9)
PAPER = 0.75
ERRORS = 4.0
WIDTH = 2.0
"""Of the tolerance, over the number at the start."""


def parts(context: Context):
    sizes, replicas = (QUICK, FEW) if context.quick else (INITIAL, REPLICAS)
    named = {f"{n}, doubled below {PAPER:g}": [n, PAPER, replicas] for n in sizes}
    if not context.quick:
        named |= {f"200, doubled below {b:g}": [200, b, replicas] for b in THRESHOLDS if b != PAPER}
    return named | {f"{sizes[-1]}, never doubled": [sizes[-1], 0.0, replicas]}


def begin():
    """The paper's scene, and the unit of time [s]."""
    import mcdem

    scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    radius = scene.suspension.radius
    number = scene.suspension.volume_fraction / (4.0 / 3.0 * np.pi * radius**3)
    kernel = 4.0 / 3.0 * scene.flow.shear_rate * (2.0 * radius) ** 3
    return scene, 2.0 / (kernel * EFFICIENCY * number)


def measure(context: Context, part):
    """(replicas, times, 3): aggregates per primary of the start, primaries per volume against the start, aggregates."""
    from mcdem.monte_carlo.process import Process
    from mcdem.quantities.random_streams import stream
    from validation.exact.encounters import sticking

    initial, threshold, replicas = part
    paper, unit = begin()
    scene = paper.with_changes({"population.initial": initial, "population.doubling_below": threshold})
    found = np.empty((replicas, len(TIMES), 3))
    for replica in range(replicas):
        seed = 1_000_000 * (1 + context.seed) + 100_000 * int(100 * threshold) + 1000 * initial + replica
        process = Process.begin(scene, seed, ())
        volume = process.population.volume
        for k, time in enumerate(TIMES):
            while (meeting := process.selection.ahead(1).meeting(0)).time < time * unit:
                pair = [process.population.at(place) for place in (meeting.first, meeting.second)]
                rng = stream(seed, "encounter", meeting.epoch, meeting.number)
                process.encounter(meeting, sticking(scene, *pair, rng, EFFICIENCY, LARGEST))
            now = process.population
            scale = now.volume / volume * initial
            found[replica, k] = now.number / scale, now.primaries / scale, now.number
    return found


def mean_field() -> np.ndarray:
    """(times,) aggregates per primary of the start in an infinite sample: the rate equations of every whole size."""
    from scipy.integrate import solve_ivp

    from validation.exact.encounters import compact

    scene, _ = begin()
    radius = scene.suspension.radius
    size = np.arange(1, LARGEST + 1)
    reach = np.array([compact(int(p), radius).outer_radius(radius) for p in size]) / (2.0 * radius)
    # In the unit of time, and numbers over that of the start: K_ij/K_11 is ((R_i + R_j)/2a)^3, and K_11 eta n_0 is 2.
    kernel = 2.0 * (reach[:, None] + reach[None]) ** 3

    def rate(_, n):
        met = 0.5 * kernel * np.outer(n, n)
        change = np.zeros(LARGEST)
        for i, j in np.ndindex(LARGEST, LARGEST):
            total = int(size[i] + size[j])
            made = [total] if total <= LARGEST else [total // 2, total - total // 2]
            for p, sign in [(int(size[i]), -1.0), (int(size[j]), -1.0), *((p, 1.0) for p in made)]:
                change[p - 1] += sign * met[i, j]
        return change

    start = np.eye(LARGEST)[0]
    solution = solve_ivp(rate, (0.0, TIMES[-1]), start, method="LSODA", rtol=1e-9, atol=1e-12, t_eval=TIMES)
    return solution.y.sum(axis=0)


def judge(context: Context, found):
    field = mean_field()
    checks, drawn = [], {}
    for label, several in found.items():
        rows = np.array(several)
        initial = int(label.partition(",")[0])
        number = rows[..., 0]
        bias = number.mean(axis=0) / field - 1.0
        error = number.std(axis=0, ddof=1) / np.sqrt(len(number)) / field
        drawn[label] = bias, error
        checks.append(
            below(f"{label}: primaries per volume, largest change", np.abs(rows[..., 1] - 1.0).max(), 1e-12)
        )
        for k, when in ((2, "while it grows"), (len(TIMES) - 1, "steady")):
            # Bias is of the order of one over the aggregates there are; without doublings these become few.
            few = initial if "doubled below" in label else rows[:, k, 2].mean()
            checks.append(
                near(f"{label}: number per volume over the mean field's, {when}", 1.0 + bias[k], 1.0,
                     abs=WIDTH / few + ERRORS * error[k], why=f"bias {100 * bias[k]:.2f} ± {100 * error[k]:.2f} %")
            )  # fmt: skip
        scatter = number.std(axis=0, ddof=1) / number.mean(axis=0)
        checks.append(
            shown(f"{label}: scatter of <P> among runs that are steady, times the root of the aggregates there are",
                  scatter[-1] * np.sqrt(rows[:, -1, 2].mean()))
        )  # fmt: skip

    def draw():
        figure, axes = canvas(width=7.0, height=2.8, ncols=2)
        axes[0].plot(TIMES, 1.0 / field, "k--", label="mean field")
        for k, (label, (bias, error)) in enumerate(drawn.items()):
            style = {"fmt": MARKERS[k % len(MARKERS)], "ms": 4, "mfc": "none", "color": CYCLE[k % len(CYCLE)]}
            axes[0].plot(
                TIMES, 1.0 / (field * (1.0 + bias)), style["fmt"], ms=4, mfc="none", color=style["color"]
            )
            shift = 1.0 + 0.03 * (k - 0.5 * len(drawn))
            axes[1].errorbar(np.array(TIMES) * shift, 100 * bias, yerr=100 * error, label=label, **style)
        axes[1].axhline(0.0, color=GREY, lw=0.6)
        axes[1].margins(y=0.35)
        axes[0].set(xscale="log", xlabel="time, 2/(K₁₁ η n₀)", ylabel="mean size ⟨P⟩")
        axes[1].set(xscale="log", xlabel="time, 2/(K₁₁ η n₀)", ylabel="bias of the number (%)")
        legend(axes[0])
        legend(axes[1], "bars: one standard error")
        return figure

    return Findings(
        tuple(checks),
        draw,
        f"Pairs that stick with an efficiency of {EFFICIENCY:g}, and fall into halves above {LARGEST} primaries: mean size, and "
        "the bias of samples that are doubled when they become few.",
    )  # fmt: skip


CASE = Case(
    chapter=4,
    claim="Doubling the sample when its aggregates become few biases neither growth nor the steady balance of growth and "
    "breakup beyond what a sample of that many must show, about one over their number.",
    source="the process with its own event selection, population and doublings, and encounters that stick with one efficiency "
    "and split above one size (own, validation/exact/encounters.py), "
    "against the rate equations of Smoluchowski 1917 for the same rules",
    tolerance="2 over the aggregates at the start, the order of a finite sample's bias (Marcus 1968), and four standard errors; "
    "round-off for primaries per volume",
    measure=measure,
    judge=judge,
    parts=parts,
    seen=("doubling_loses_a_copy",),
)
