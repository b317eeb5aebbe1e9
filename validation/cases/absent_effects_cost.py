"""What an effect costs that a scene does not name, from a saved table of benchmarks/absent_effects.py."""

from __future__ import annotations

import argparse
import importlib.util
import sys
import tempfile
from pathlib import Path

from mcdem.effects import Effects
from mcdem.figures.style import BLACK, BLUE, GREY, canvas
from validation import datasets
from validation.case import Case, Context, Findings, above, below, cannot_say, near, shown

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "absent_effects.py"
ANEW = ("van_der_waals",)
"""Effects whose strength zero is compared with their absence here and now."""
RESISTANCES = ("sliding", "rolling", "twisting", "rods")


def benchmark():
    """The program that makes the table; benchmarks are no package."""
    spec = importlib.util.spec_from_file_location("absent_effects_benchmark", BENCHMARK)
    assert spec is not None and spec.loader is not None
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def measure(context: Context):
    table = benchmark()
    zero, timed = {}, {}
    for effect in ANEW:
        scenes = [
            table.scene_of(effect, present, "explicit_euler", "free_draining") for present in (False, True)
        ]
        absent, none = table.Steps(scenes[0]), table.Steps(scenes[1], zeroed=effect)
        zero[effect] = table.largest_change(absent.run(1)[0].tolist(), none.run(1)[0].tolist())
        if not context.quick:
            options = argparse.Namespace(
                scheme="explicit_euler", level="free_draining", rounds=10, processes=3
            )
            with tempfile.TemporaryDirectory() as folder:
                timed[effect] = table.times(effect, options, Path(folder))
    return {"kept": datasets.absent_effects(), "zero": zero, "timed": timed}


def judge(context: Context, numbers):
    rows = numbers["kept"]
    known = {row["effect"] for row in rows}
    checks = [
        cannot_say(f"{effect}: row", "not in the saved table")
        for effect in Effects.model_fields
        if effect not in known
    ]
    for row in rows:
        effect = row["effect"]
        most = 1e-11 if effect in RESISTANCES else 0.0
        checks += [
            below(f"{effect}: strength zero against None, change of the velocities", row["zero"], most),
            above(f"{effect}: change of the velocities by the effect", row["felt"], 1e-7),
            near(f"{effect}: a step without it over one that never had it", row["absent"], 1.0, abs=0.02,
                 error=row["error_absent"]),
            shown(f"{effect}: time added to a step", 1e6 * row["added"], error=1e6 * row["error_added"], unit="us",
                  why=f"to {1e6 * row['step']:.0f} us"),
        ]  # fmt: skip
    for effect, change in numbers["zero"].items():
        checks.append(below(f"{effect}, anew: strength zero against None", change, 0.0))
    for effect, row in numbers["timed"].items():
        beyond = max(abs(row["absent"] - 1.0) - 2.0 * row["error_absent"], 0.0)
        checks.append(below(f"{effect}, anew: time without it off by more than two errors", beyond, 0.02))

    def draw():
        figure, axes = canvas(width=4.8, height=2.4)
        places = range(len(rows))
        ratio, error = (
            [100.0 * (row["absent"] - 1.0) for row in rows],
            [100.0 * row["error_absent"] for row in rows],
        )
        axes.axhspan(-2.0, 2.0, color=GREY, alpha=0.2, lw=0)
        axes.axhline(0.0, color=BLACK, lw=0.6)
        axes.errorbar(places, ratio, yerr=error, fmt="o", ms=4, mfc="none", color=BLUE, capsize=2)
        axes.set_xticks(places, [row["effect"].replace("_", " ") for row in rows], rotation=40, ha="right")
        axes.set(ylabel="time of a step without it,\nbeyond one that never had it (%)")
        return figure

    return Findings(
        tuple(checks),
        draw,
        "What an absent effect costs a step, with standard errors; the band is 2 %.",
    )


CASE = Case(
    chapter=8,
    claim="An effect that a scene does not name changes nothing to round-off, and its absence costs nothing: a step takes as "
    "long as in a build that never had the effect, within 2 %.",
    source="builds from whose sources the effect is cut, side by side with the whole (benchmarks/absent_effects.py); saved in "
    "validation/data, whose README gives the command",
    tolerance="strength zero is absence to the last bit; resistances double the unknowns, so to 1e-11, where iterations end at "
    "round-off; times to 2 %, standard error included",
    measure=measure,
    judge=judge,
    inputs=lambda context: (datasets.ABSENT_EFFECTS, BENCHMARK),
    saved=lambda context: (datasets.ABSENT_EFFECTS,),
    anew="strength zero against absence of van der Waals attraction; in the full mode, the time of a step without it too",
    seen=("absent_left_in", "absent_costs"),
)
