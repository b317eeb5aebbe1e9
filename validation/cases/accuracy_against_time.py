"""What accuracy costs in time at 1000 Pa, from a saved table of `mcdem cost`."""

from __future__ import annotations

from pathlib import Path

from mcdem.analysis.accuracy_cost import settings_of
from mcdem.analysis.paired_encounters import GIVEN, REFERENCE, efficiency
from mcdem.figures.style import BLACK, BLUE, GREY, VERMILION, canvas, legend
from mcdem.scene import load_scene
from validation import datasets
from validation.case import Case, Context, Findings, above, below, near, shown

PAPER = Path(__file__).parents[2] / "scenes" / "paper-1000Pa.toml"
SAVED = datasets.SAVED / "cost-1000Pa.csv"
"""Made by the command in validation/data/README.md."""
SAMPLED = ("outcome", "fragment", "geometry")
FLOOR = 1e-5
"""Errors below are drawn here."""


AGAIN = (GIVEN, "max_step = 0.05", "max_step = 0.4")
"""Settings whose error of eta_11 is computed again in the full mode."""
RAYS = 4
"""Directions from which `mcdem cost` has eta_11."""


def measure(context: Context):
    again = {}
    if not context.quick:
        scene = load_scene(PAPER)
        known = {setting.name: setting for setting in settings_of(scene)}
        eta = {name: efficiency(known[name].of(scene), RAYS) for name in (REFERENCE, *AGAIN)}
        again = {name: abs(eta[name] / eta[REFERENCE] - 1.0) for name in AGAIN}
    return {"saved": datasets.prices(SAVED), "again": again}


def surely(row, quantity: str) -> float:
    """By how much a sampled mean is off beyond two standard errors; 0 where it cannot be told from the reference."""
    return max(row[f"error_{quantity}"] - 2.0 * row[f"standard_error_{quantity}"], 0.0)


def judge(context: Context, numbers):
    rows = numbers["saved"]
    named = {row["setting"]: row for row in rows}
    reference, given = named["reference"], named["as given"]
    steps = sorted(
        (row for row in rows if row["varied"] == "max_step"),
        key=lambda row: float(row["setting"].partition("=")[2]),
    )
    finest, coarsest = (steps[k]["error_eta_11"] for k in (0, -1))
    checks = [
        below("as given: relative error of eta_11", given["error_eta_11"], 0.005),
        *(below(f"as given: error of {name} beyond two standard errors", surely(given, name), 0.02) for name in SAMPLED),
        below("as given: time over that of the reference", given["cpu_time_s"] / reference["cpu_time_s"], 0.25),
        # Not against that as given, in which the errors of the step and of the approach as bodies nearly cancel.
        above("coarsest step: error of eta_11 over that of the finest", coarsest / finest, 1.5),
        below("finest step: relative error of eta_11", finest, 0.005),
    ]  # fmt: skip
    checks += [
        near(
            f"{name}, computed again: relative error of eta_11", error, named[name]["error_eta_11"], abs=5e-4
        )
        for name, error in numbers["again"].items()
    ]
    for row in rows:
        words = ", ".join(
            f"{name} {row[f'error_{name}']:.2g} ± {row[f'standard_error_{name}']:.1g}" for name in SAMPLED
        )
        checks.append(shown(f"{row['setting']}: time of an encounter", 1e3 * row["cpu_time_s"], unit="ms",
                            why=f"eta_11 off by {row['error_eta_11']:.2g}; {words}"))  # fmt: skip

    def draw():
        figure, axes = canvas(width=4.8, height=2.9)
        others = [row for row in rows if row is not reference]
        time, error = ([row[name] for row in others] for name in ("cpu_time_s", "error_eta_11"))
        time, error = [1e3 * t for t in time], [max(e, FLOOR) for e in error]
        axes.loglog(time, error, "o", ms=4, mfc="none", color=BLUE)
        front = [k for k in range(len(time)) if not any(
            t <= time[k] and e <= error[k] and (t, e) != (time[k], error[k]) for t, e in zip(time, error)
        )]  # fmt: skip
        front.sort(key=lambda k: time[k])
        axes.step(
            [time[k] for k in front],
            [error[k] for k in front],
            where="post",
            color=BLACK,
            lw=0.8,
            label="front",
        )
        for k in front:
            axes.annotate(
                others[k]["setting"], (time[k], error[k]), (3, 3), textcoords="offset points", fontsize=5
            )
        axes.loglog(
            1e3 * given["cpu_time_s"],
            max(given["error_eta_11"], FLOOR),
            "*",
            ms=8,
            color=VERMILION,
            label="as given",
        )
        axes.axvline(1e3 * reference["cpu_time_s"], color=GREY, lw=0.8, ls=":", label="reference")
        axes.set(xlabel="CPU time of an encounter (ms)", ylabel="relative error of η₁₁")
        legend(axes)
        return figure

    return Findings(
        tuple(checks),
        draw,
        "Error of the pair efficiency against the time of an encounter, setting by setting.",
    )


CASE = Case(
    chapter=8,
    claim="The default settings are exact to half a per cent in eta_11, cannot be told from the reference in what encounters "
    "leave, and take less than a quarter of its time; twice its step is worse than a quarter.",
    source="`mcdem cost` at 1000 Pa on late populations of a run; saved in validation/data, whose README gives the command",
    tolerance="0.5 % of eta_11, within its own error; sampled means by two standard errors; times to a quarter: machines differ",
    measure=measure,
    judge=judge,
    inputs=lambda context: (SAVED,),
    saved=lambda context: (SAVED,),
    anew="nothing; in the full mode eta_11 as given, with the coarsest and with the finest step, against the reference",
    seen=("coarse_default",),
)
