"""Late populations of whole runs side by side, for `notebooks/data/changed-1000Pa.csv`.

    python benchmarks/late_populations.py RUN.nc... --between 36 60 -o TABLE.csv

Each run is averaged over the same stretch of process time; limits are those of 95 %, by blocks of time.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from mcdem.analysis.breakup import EROSION_ABOVE, in_reading
from mcdem.analysis.dataset import RunDataset, origins, pool
from mcdem.analysis.statistics import fit_mass_size, share, time_average


def of_population(run: RunDataset, start: float, end: float) -> dict[str, str | int]:
    """Sizes, shapes and breakup between two process times [s], in words."""
    late = [k for k, t in enumerate(run.snapshot_times) if start <= t <= end]
    found = pool([run.population(k, rigidity=False) for k in late], "aggregate")
    mean, deviation = (
        time_average(run.time, run.series[name].values, start, end)
        for name in ("mean_size", "size_deviation")
    )
    broken = run.breakups
    within = (broken["time"].values >= start) & (broken["time"].values <= end)
    largest = broken["largest_fragment"].values[within & in_reading(broken, "own")]
    eroded, low, high = (100 * value for value in share(int((largest >= EROSION_ABOVE).sum()), len(largest)))
    fit = fit_mass_size(found["size"], found["radius_of_gyration"], run.radius, "size", origins(found))
    return {
        "⟨P⟩": f"{mean.mean:.2f} ± {2 * mean.error:.2f}",
        "σ_P/⟨P⟩": f"{deviation.mean / mean.mean:.2f} ± {2 * deviation.error / mean.mean:.2f}",
        "isolated primaries [%]": f"{100 * float((found['size'] == 1).mean()):.1f}",
        "d_g": "-" if fit is None else f"{fit.exponent:.2f}",
        "mean A.R.": f"{float(found['aspect_ratio'].where(found['size'] > 2).mean()):.2f}",
        "broken": len(largest),
        "of these eroded [%]": f"{eroded:.0f} ({low:.0f} … {high:.0f})" if np.isfinite(eroded) else "-",
    }


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN.nc", help="datasets of `mcdem run`")
    parser.add_argument(
        "--between", nargs=2, type=float, default=(36.0, 60.0), metavar="S", help="process times [s]"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="TABLE.csv")
    given = parser.parse_args()
    rows = {path.stem: of_population(RunDataset(path), *given.between) for path in given.runs}
    pd.DataFrame(rows).T.to_csv(given.output, index_label="run")


if __name__ == "__main__":
    main()
