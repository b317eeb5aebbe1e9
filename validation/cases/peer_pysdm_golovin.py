"""Golovin's kernel to the end of Shima's case, beside PySDM where it is installed."""

from __future__ import annotations

import importlib.util
import statistics
import sys
import time
from pathlib import Path

from mcdem.figures.style import BLUE, VERMILION, canvas, legend
from validation.case import Case, Context, Findings, below, shown

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "golovin.py"
SCHEMES = (("fixed pivot", 2**0.25), ("cell average", 2**0.5), ("cell average", 2**0.25))
DROPLETS, QUICK_DROPLETS = 2**15, 2**13
SEEDS = (1, 2, 3, 4, 5)


def benchmark():
    """The benchmark of this comparison, which is no module of a package."""
    spec = importlib.util.spec_from_file_location("golovin_benchmark", BENCHMARK)
    assert spec is not None and spec.loader is not None
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def measure(context: Context):
    golovin = benchmark()
    exact = [float(m) for m in golovin.EXACT]
    rows = []
    for scheme, ratio in SCHEMES:
        golovin.solve_pbekit(scheme, ratio)
        took = []
        for _ in range(3):
            begun = time.process_time()
            cells, moments = golovin.solve_pbekit(scheme, ratio)
            took.append(time.process_time() - begun)
        rows.append([f"pbekit, {scheme}, {cells} cells", statistics.median(took), [moments]])
    if importlib.util.find_spec("PySDM"):
        droplets = QUICK_DROPLETS if context.quick else DROPLETS
        golovin.solve_pysdm(droplets, 60.0, 0)
        runs = [golovin.solve_pysdm(droplets, 1.0, seed) for seed in SEEDS]
        rows.append(
            [f"PySDM, {droplets} super-droplets", statistics.median(t for t, _ in runs), [m for _, m in runs]]
        )
    return {"exact": exact, "rows": rows}


def judge(context: Context, found):
    exact, checks, drawn = found["exact"], [], []
    for name, took, runs in found["rows"]:
        second = (sum((m[2] / exact[2] - 1) ** 2 for m in runs) / len(runs)) ** 0.5
        mass = max(abs(m[1] / exact[1] - 1) for m in runs)
        drawn.append((name, took, second))
        why = f"in {took:.3g} s of processor time"
        if name.startswith("pbekit, cell average"):
            checks.append(below(f"{name}: relative error of the second moment", second, 0.2, why=why))
            checks.append(below(f"{name}: relative error of mass", mass, 1e-3))
        else:
            checks.append(shown(f"{name}: relative error of the second moment", second, why=why))
    peers = [row for row in drawn if row[0].startswith("PySDM")]
    checks += [
        shown(f"{name}: its time over that of the fastest pbekit line as exact", took / min(
            (t for n, t, e in drawn if n.startswith("pbekit") and e <= error), default=float("nan")))
        for name, took, error in peers
    ]  # fmt: skip
    if not peers:
        checks.append(shown("PySDM", float("nan"), why="not installed: pip install PySDM shows it beside"))

    def draw():
        figure, axes = canvas(width=4.5, height=2.6)
        for colour, who in ((BLUE, "pbekit"), (VERMILION, "PySDM")):
            some = [(took, error) for name, took, error in drawn if name.startswith(who)]
            if some:
                axes.loglog(*zip(*some), "o", ms=5, mfc="none", color=colour, label=who)
        axes.set(xlabel="processor time (s)", ylabel="relative error of the second moment")
        legend(axes)
        return figure

    return Findings(tuple(checks), draw, "Golovin's kernel until the second moment has grown 49 000 times.")


CASE = Case(
    chapter=9,
    claim="On Golovin's kernel, until the second moment has grown 49 000 times, the balance keeps mass and finds that moment; "
    "PySDM's super-droplets are shown beside it where they are installed.",
    source="Golovin 1963; case of Shima et al. 2009, as in PySDM's own example; benchmarks/golovin.py",
    tolerance="20 % of the second moment at the grids of the benchmark, 1e-3 of mass",
    measure=measure,
    judge=judge,
    inputs=lambda context: (BENCHMARK,),
    seen=("aggregation_half",),
)
