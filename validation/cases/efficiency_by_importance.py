"""Efficiencies of tables whose offsets were drawn where they narrow the error most, beside exact and plain ones."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from mcdem.figures.style import BLUE, canvas, legend
from validation import datasets
from validation.case import Case, Context, Findings, near, shown

PAPER = Path(__file__).parents[2] / "scenes" / "paper-1000Pa.toml"
PAIR = 10
WANTED, QUICK = "3%", "8%"


def measure(context: Context):
    import tempfile

    from mcdem.encounter.capture_efficiency import pair_efficiency
    from mcdem.kernel_tables.until_error import tabulate_until
    from mcdem.scene import load_scene

    scene = load_scene(PAPER)
    exact = pair_efficiency(scene, 4 if context.quick else 8)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "table.nc"
        tabulate_until(scene, place, wanted=f"eta={QUICK if context.quick else WANTED}", pair="1+1", seed=2)
        primaries = of_sums(sums_of_table(place))
    saved = json.loads(datasets.BY_IMPORTANCE.read_text(encoding="utf-8"))
    return {
        "exact": [exact.efficiency, exact.error],
        "1 + 1": primaries,
        "10 + 10": of_sums(saved),
        "plain": plain(),
    }


def sums_of_table(path: Path) -> dict[str, Any]:
    """What of a table decides here: encounters and their CPU time [s] by weight and by whether they aggregated."""
    from pbekit.tables.kernel_table import AGGREGATION, KernelTable

    table = KernelTable.load(path)
    r = table.records
    groups, which = np.unique(
        np.stack([r.weight, r.outcome == AGGREGATION], axis=1), axis=0, return_inverse=True
    )
    which = which.ravel()
    columns = groups[:, 0], groups[:, 1], np.bincount(which), np.bincount(which, r.cpu_time)
    return {
        "eta_standard_error": float(table.about["eta_standard_error"]),
        "columns": ["weight", "aggregated", "encounters", "CPU time [s]"],
        "rows": [[float(f"{value:.9g}") for value in row] for row in zip(*columns, strict=True)],
    }


def of_sums(sums: dict[str, Any]) -> dict[str, float]:
    """Share that aggregated by the weights, its stated error, and what plain sampling to the same error would have taken."""
    weight, aggregated, encounters, cpu_time = np.array(sums["rows"]).T
    flux = float((weight * encounters).sum())
    eta = float((weight * aggregated * encounters).sum()) / flux
    error = float(sums["eta_standard_error"])
    plain_encounters = eta * (1.0 - eta) / error**2
    return {
        "eta": eta,
        "error": error,
        "encounters": float(encounters.sum()),
        "plain_encounters": plain_encounters,
        "cpu_time": float(cpu_time.sum()),
        # The mean time of an encounter by the flux is one over the weights, of the same encounters.
        "plain_cpu_time": plain_encounters * float((weight * cpu_time).sum()) / flux,
    }


def plain() -> list[float]:
    """Encounters of 10 + 10 in the run at 1000 Pa, drawn by the flux: share that aggregated, its error, their number."""
    from mcdem.analysis.dataset import RunDataset
    from mcdem.kernel_tables.runs import records_of_run
    from pbekit.tables.kernel_table import AGGREGATION

    r = records_of_run(RunDataset(datasets.SERIES))
    hit = r.outcome[(r.size == PAIR).all(axis=1)] == AGGREGATION
    return [float(hit.mean()), math.sqrt(hit.mean() * (1.0 - hit.mean()) / hit.size), hit.size]


def judge(context: Context, numbers):
    (exact, within), one, ten = numbers["exact"], numbers["1 + 1"], numbers["10 + 10"]
    share, error, count = numbers["plain"]
    said = "10 + 10 at 1000 Pa: eta by importance less that of the run's encounters, over the error of both"
    checks = [
        near("1 + 1 at 1000 Pa: eta by importance less the exact one, over the error of both",
             (one["eta"] - exact) / math.hypot(one["error"], within), 0.0, abs=3.0),
        near(said, (ten["eta"] - share) / math.hypot(ten["error"], error), 0.0, abs=3.0),
        shown("10 + 10: eta by importance", ten["eta"], error=ten["error"], expected=share,
              why=f"{count:.0f} encounters of the run: {share:.4g} ± {error:.2g}"),
        shown("10 + 10: encounters of plain sampling to this error, over those taken",
              ten["plain_encounters"] / ten["encounters"]),
        shown("10 + 10: CPU time of plain sampling to this error, over that taken", ten["plain_cpu_time"] / ten["cpu_time"],
              why="encounters at small offsets, which decide, take longest"),
    ]  # fmt: skip

    def draw():
        figure, axes = canvas(width=3.6, height=2.6)
        names = ["1 + 1\nimportance", "1 + 1\nexact", "10 + 10\nimportance", "10 + 10\nrun"]
        values = [one["eta"], exact, ten["eta"], share]
        errors = 2.0 * np.array([one["error"], within, ten["error"], error])
        axes.errorbar(range(4), values, yerr=errors, fmt="o", ms=4, color=BLUE, label="± two standard errors")
        axes.set_xticks(range(4), names)
        axes.set(yscale="log", ylabel="aggregation efficiency")
        legend(axes)
        return figure

    return Findings(
        tuple(checks), draw, "Efficiencies from weighted encounters, beside exact and plain ones."
    )


CASE = Case(
    chapter=3,
    claim="Efficiencies of tables whose offsets were drawn by importance have no bias: that of two primaries is the exact one, "
    "that of two aggregates of 10 is that of encounters drawn by the flux.",
    source="eta_11 by critical offsets (mcdem efficiency); encounters of the run at 1000 Pa; table in validation/data, whose "
    "README gives the command",
    tolerance="three standard errors of the two together",
    measure=measure,
    judge=judge,
    inputs=lambda context: (datasets.BY_IMPORTANCE, datasets.SERIES),
    saved=lambda context: (datasets.BY_IMPORTANCE, datasets.SERIES),
    anew="the table of 1 + 1 and its exact efficiency",
    seen=("weights_lost",),
)

if __name__ == "__main__":  # the saved sums of a table
    json.dump(sums_of_table(Path(sys.argv[1])), sys.stdout)
