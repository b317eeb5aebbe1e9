"""The datasets that cases read: those given by `--run`, else the committed ones."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pbekit.study.monte_carlo import MonteCarlo
    from pbekit.tables.kernel_table import KernelTable
    from validation.case import Context

FOLDER = Path(__file__).parent.parent / "notebooks" / "data"
SAVED = Path(__file__).parent / "data"
"""Samples and tables that take long to make; its README gives the commands."""
DESIGNED, SERIES = FOLDER / "designed-1000Pa.nc", FOLDER / "run-1000Pa.nc"
"""Designed encounters of a table, and the run that the others are from."""
FRACTAL_MOTION = Path(__file__).parent / "data" / "fractal_motion.json"
ABSENT_EFFECTS = SAVED / "absent_effects.csv"
BY_IMPORTANCE = SAVED / "until-error-1000Pa.json"
RUNS_AGAIN = "the first encounters of each run, by the case saved_runs_come_out_again"
"""Of cases that judge runs."""


def runs(context: Context) -> tuple[Path, ...]:
    """Datasets of `mcdem run`."""
    if context.given.runs:
        return context.given.runs
    return tuple(sorted(FOLDER.glob("run-*.nc")))


def fractal_motion() -> dict[str, dict[str, Any]]:
    """Saved numbers of clusters that were sheared until they broke, by cluster."""
    rows: dict[str, dict[str, Any]] = json.loads(FRACTAL_MOTION.read_text(encoding="utf-8"))
    return rows


def kernels() -> KernelTable:
    """The table of the encounters of the run at 1000 Pa and of those designed."""
    from mcdem.analysis.dataset import RunDataset
    from mcdem.kernel_tables import with_runs
    from pbekit.tables.kernel_table import KernelTable

    return with_runs(KernelTable.load(DESIGNED), [RunDataset(SERIES)])


def series() -> MonteCarlo:
    """Sizes over time of the run behind the table."""
    from pbekit.study.monte_carlo import MonteCarlo

    return MonteCarlo.read(SERIES)


def checkout(context: Context) -> tuple[Path, ...]:
    """The checkout of Pecnut/stokesian-dynamics and its sources, if it is given."""
    root = context.given.pecnut
    return (root, *sorted((root / "stokesian_dynamics" / "functions").glob("*.py"))) if root else ()


def prices(path: Path) -> list[dict[str, Any]]:
    """Rows of a table of `mcdem cost`, numbers as numbers."""
    from mcdem.analysis.accuracy_cost import read_prices

    return read_prices(path)


def absent_effects() -> list[dict[str, Any]]:
    """Rows of the saved table of benchmarks/absent_effects.py, one an effect, numbers as numbers."""
    return _rows(ABSENT_EFFECTS, ("effect", "scheme", "level"))


def _rows(path: Path, words: tuple[str, ...]) -> list[dict[str, Any]]:
    """Rows of a CSV file; columns not among `words` are numbers."""
    with path.open(newline="", encoding="utf-8") as file:
        return [{k: v if k in words else float(v) for k, v in row.items()} for row in csv.DictReader(file)]
