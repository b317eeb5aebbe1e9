"""A dataset of `mcdem run` as a notebook wants it: series, encounters, populations and figures in one object."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from mcdem.analysis.dataset import RunDataset
from mcdem.figures.album import figures_of
from mcdem.figures.figure import Figure


class OpenedRun(RunDataset):
    """One dataset written by `mcdem run`, opened for reading.

    Attributes
    ----------
    series : xarray.Dataset over ``row``: time [s], mean_size <P>, size_deviation, sauter_diameter [m] and more
    events : xarray.Dataset over ``event``: every encounter; `outcome` has their outcomes in words
    snapshots : xarray.Dataset of the aggregates' geometry at `snapshot_times` [s]
    scene : Scene it was made of

    Examples
    --------
    >>> import mcdem
    >>> run = mcdem.open_run("notebooks/data/run-1000Pa-of-100-seed-2.nc")

    Share of the encounters that ended in each way:

    >>> import numpy as np
    >>> for outcome in ("aggregation", "fragmentation"):
    ...     print(outcome, f"{np.mean(run.outcome == outcome):.3f}")
    aggregation 0.009
    fragmentation 0.006

    Coordination number of the aggregates of more than ten primaries at the end:

    >>> last = run.population(-1, rigidity=False)
    >>> large = last.isel(aggregate=last["size"].values > 10)
    >>> f"{float((2 * large['bond_count'] / large['size']).mean()):.1f}"
    '5.1'
    """

    @property
    def snapshots(self) -> xr.Dataset:
        """Geometry of every aggregate at every snapshot, as it is stored: ragged rows [m]."""
        return self._snapshots

    def figures(self) -> dict[str, Figure]:
        """Every figure that the dataset allows, by name; each has its `numbers`, and `draw()`."""
        return {figure.name: figure for figure in figures_of([self])}

    def __repr__(self) -> str:
        state = f"steady from {self.steady.start:.3g} s" if self.steady.reached else "not steady"
        return f"<OpenedRun {self.path}: {self.label}, {len(self.outcome)} encounters to {self.time[-1]:.4g} s, {state}>"


def open_run(path: Path | str) -> OpenedRun:
    """Open a dataset of `mcdem run`.

    Parameters
    ----------
    path : file written by `mcdem run`, `mcdem compress` or `mcdem.run`

    Returns
    -------
    OpenedRun
        series, events, snapshots, aggregates and figures

    Raises
    ------
    DataFileError
        where the file is not one of a run, or damaged

    Examples
    --------
    >>> import mcdem
    >>> run = mcdem.open_run("notebooks/data/run-1000Pa-of-100-seed-2.nc")
    >>> run
    <OpenedRun notebooks/data/run-1000Pa-of-100-seed-2.nc: 1000 Pa, 88770 encounters to 120 s, steady from 60 s>
    >>> f"<P> = {float(run.series.mean_size[-1]):.1f} at {float(run.series.time[-1]):.0f} s"
    '<P> = 10.7 at 120 s'
    """
    return OpenedRun(path)
