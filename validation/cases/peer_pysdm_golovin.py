"""Golovin's kernel to the end of Shima's case, beside PySDM where it is installed."""

from __future__ import annotations

import importlib.util
import math
import statistics
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from mcdem.figures.style import BLUE, VERMILION, canvas, legend
from validation.case import Case, Context, Findings, below, near, shown

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "golovin.py"
DROPLETS, QUICK_DROPLETS = 2**15, 2**13
STEP = 1.0
"""[s], as in PySDM's own example of this case."""
SEEDS = (1, 2, 3, 4, 5)
ROUNDS = 3
FEW = 5.0
"""Standard errors: five seeds give their own only to a third."""
OURS = "pbekit"


def benchmark():
    """The benchmark of this comparison, which is no module of a package."""
    spec = importlib.util.spec_from_file_location("golovin_benchmark", BENCHMARK)
    assert spec is not None and spec.loader is not None
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def parts(context: Context):
    # The version is of the label, so that numbers are measured anew when PySDM is installed or renewed.
    try:
        return {OURS: None, f"PySDM {version('PySDM')}": QUICK_DROPLETS if context.quick else DROPLETS}
    except PackageNotFoundError:
        return {OURS: None}


def measure(context: Context, droplets: int | None):
    """{setting: {seconds of processor, relative errors of number, mass and second moment, of each run}}."""
    golovin = benchmark()

    def errors(moments):
        return [float(m / exact - 1.0) for m, exact in zip(moments, golovin.EXACT)]

    if droplets:
        runs = [golovin.solve_pysdm(droplets, STEP, seed) for seed in SEEDS]
        took, found = statistics.median(t for t, _ in runs), [errors(m) for _, m in runs]
        return {f"{droplets} super-droplets": {"seconds": took, "errors": found}}
    rows = {}
    for setting in golovin.SETTINGS:
        cells, moments = golovin.solve_pbekit(*setting)
        took = statistics.median(golovin.seconds(setting) for _ in range(ROUNDS))
        # Grid and integrator apart, so that neither hides the other.
        rows[f"{setting.scheme}, {cells} cells, {setting.method}"] = {
            "seconds": took, "errors": [errors(moments)], "bound": golovin.error_of(setting)[-1],
        }  # fmt: skip
    return rows


def judge(context: Context, found):
    checks, drawn = [], {}
    for who, rows in found.items():
        for setting, row in rows.items():
            number, mass, second = zip(*row["errors"])
            error = row.get("bound", math.sqrt(statistics.fmean(e**2 for e in second)))
            drawn[who, setting] = row["seconds"], error
            said, why = f"{who}, {setting}", f"in {row['seconds']:.3g} s of processor time"
            if "cell average" in setting or "three pivots" in setting:
                most = 2e-3 if "three pivots" in setting else 0.2
                checks.append(below(f"{said}: relative error of the second moment", error, most, why=why))
                checks.append(below(f"{said}: relative error of mass", max(map(abs, mass)), 1e-3))
            elif who == OURS:
                checks.append(shown(f"{said}: relative error of the second moment", error, why=why))
            else:
                scatter = statistics.stdev(second) / math.sqrt(len(second))
                checks += [
                    below(f"{said}: relative error of mass", max(map(abs, mass)), 1e-3),
                    near(f"{said}: second moment over the exact one, mean of {len(second)} seeds", 1.0 + statistics.fmean(second),
                         1.0, abs=FEW * scatter, why=f"within {FEW:g} standard errors of {scatter:.2g}"),
                    shown(f"{said}: relative error of the second moment, root of its mean square", error, why=why),
                    shown(f"{said}: relative error of number, mean", statistics.fmean(number)),
                ]  # fmt: skip
    for (who, setting), (took, error) in drawn.items():
        if who != OURS:
            quickest = min(
                (t for (w, _), (t, e) in drawn.items() if w == OURS and e <= error), default=math.nan
            )
            checks.append(
                shown(
                    f"{who}, {setting}: its time over that of the quickest pbekit line as exact",
                    took / quickest,
                )
            )
    if len(found) == 1:
        checks.append(shown("PySDM", math.nan, why="not installed: pip install PySDM shows it beside"))

    def draw():
        figure, axes = canvas(width=4.5, height=2.6)
        for colour, marker, who in zip((BLUE, VERMILION), "os", found):
            some = [numbers for (w, _), numbers in drawn.items() if w == who]
            axes.loglog(*zip(*some), marker, ms=5, mfc="none", color=colour, label=who)
        axes.set(xlabel="processor time (s)", ylabel="relative error of the second moment")
        legend(axes)
        return figure

    return Findings(tuple(checks), draw, "Golovin's kernel until the second moment has grown 49 000 times.")


CASE = Case(
    chapter=9,
    claim="On Golovin's kernel, until the second moment has grown 49 000 times, the balance keeps mass and finds that moment; "
    "PySDM's super-droplets are shown beside it where they are installed.",
    source="Golovin 1963; case of Shima et al. 2009, as in PySDM's own example; benchmarks/golovin.py",
    tolerance="20 % of the second moment by the cell average at the grids of the benchmark, 0.2 % on three pivots, 1e-3 "
    "of mass; PySDM's own, a mean of few seeds, to five "
    "of its standard errors",
    measure=measure,
    judge=judge,
    parts=parts,
    inputs=lambda context: (BENCHMARK,),
    seen=("aggregation_half",),
)
