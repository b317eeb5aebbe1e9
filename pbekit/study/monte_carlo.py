"""What a dataset of `mcdem run` says of sizes, read without mcdem."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from scipy import stats

from pbekit.outputs import FILES

STEADY_SHARE = 0.4
"""The last part of a run that counts as its steady state."""


BLOCKS = 8
"""A steady stretch is cut into so many blocks; the spread of their means is the error of its mean."""


@dataclass(frozen=True)
class MonteCarlo:
    """What a dataset of `mcdem run` says of sizes.

    time (t,) [s]; mean_size, size_deviation, sauter_diameter (t,)
    steady : mean and standard error of each over the last part; trend : slope of <P> there over its standard error
    share (sizes + 1,) : number share of each size in the snapshots of that part; share_error : its standard error

    Examples
    --------
    >>> from pbekit.study import MonteCarlo
    >>> run = MonteCarlo.read("notebooks/data/run-750Pa-of-100.nc")
    >>> f"{run.mean_size[-1]:.1f} primaries at {run.time[-1]:.0f} s"
    '13.4 primaries at 108 s'
    """

    path: Path
    scene: str
    time: np.ndarray
    mean_size: np.ndarray
    size_deviation: np.ndarray
    sauter_diameter: np.ndarray
    steady: dict[str, tuple[float, float]]
    trend: float
    share: np.ndarray
    share_error: np.ndarray
    initial: int

    @property
    def is_steady(self) -> bool:
        """Whether <P> shows no trend over the last part: its slope through block means is within 3 standard errors."""
        return abs(self.trend) <= 3.0

    @classmethod
    def read(cls, path: Path | str) -> MonteCarlo:
        """Read a run's series and snapshots."""
        with FILES.reading(path, "a dataset of mcdem run"):
            with (
                xr.open_dataset(path, decode_times=False) as root,
                xr.open_dataset(path, group="snapshots", decode_times=False) as snapshots,
            ):
                root.load()
                snapshots.load()
            return cls._of(Path(path), root, snapshots)
        raise AssertionError  # the guard lets nothing pass in silence

    @classmethod
    def _of(cls, path: Path, root: xr.Dataset, snapshots: xr.Dataset) -> MonteCarlo:
        time = root.time.values
        late = time >= (1 - STEADY_SHARE) * time[-1]
        values = {
            "mean_size": root.mean_size.values,
            "relative_deviation": root.size_deviation.values / root.mean_size.values,
            "sauter_diameter": root.sauter_diameter.values,
        }
        blocks = {name: _blocks(time[late], v[late]) for name, v in values.items()}
        steady = {name: _mean_and_error(b) for name, b in blocks.items()}
        numbers = snapshots.number_of_aggregates.values
        of_aggregate = np.repeat(np.arange(len(numbers)), numbers)
        chosen = snapshots.time.values[of_aggregate] >= (1 - STEADY_SHARE) * time[-1]
        size, snapshot = snapshots["size"].values[chosen], of_aggregate[chosen]
        used = np.unique(snapshot)
        each = np.stack(
            [np.bincount(size[snapshot == s], minlength=size.max() + 1) / (snapshot == s).sum() for s in used]
        )
        share = each.mean(axis=0)
        # Snapshots share aggregates; their number is no more than that of independent ones.
        error = (
            each.std(axis=0, ddof=1) / np.sqrt(len(used)) if len(used) > 1 else np.full(share.shape, np.nan)
        )
        return cls(
            path,
            str(root.attrs.get("scene", "")),
            time,
            root.mean_size.values,
            root.size_deviation.values,
            root.sauter_diameter.values,
            steady,
            _trend(blocks["mean_size"]),
            share,
            error,
            int(root.number_of_aggregates.values[0]),
        )

    def at(self, name: str, times: np.ndarray) -> np.ndarray:
        """A series at given times: the last value before."""
        row = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, len(self.time) - 1)
        return np.asarray(getattr(self, name))[row]


def _blocks(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Time averages over the blocks of a stretch."""
    means = []
    for low, high in itertools.pairwise(np.linspace(time[0], time[-1], BLOCKS + 1)):
        inside = np.flatnonzero((time >= low) & (time <= high))
        if inside.size > 1 and time[inside[-1]] > time[inside[0]]:
            means.append(np.trapezoid(values[inside], time[inside]) / (time[inside[-1]] - time[inside[0]]))
    return np.array(means or [values[-1]])


def _mean_and_error(blocks: np.ndarray) -> tuple[float, float]:
    error = blocks.std(ddof=1) / np.sqrt(len(blocks)) if len(blocks) > 1 else np.nan
    return float(blocks.mean()), float(error)


def _trend(blocks: np.ndarray) -> float:
    """Slope of a line through block means over its standard error; inf if there are too few."""
    if len(blocks) < 4:
        return np.inf
    line = stats.linregress(np.arange(len(blocks)), blocks)
    return float(line.slope / line.stderr) if line.stderr > 0 else 0.0
