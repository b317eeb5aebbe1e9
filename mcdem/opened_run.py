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
    """
    return OpenedRun(path)
