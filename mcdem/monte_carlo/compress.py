"""A run's dataset made small enough to keep or to send, and still one to draw figures from and to continue.

What it takes to go on bit for bit (the last snapshot and the checkpoint), every whole number, flag and identity, and the
parents that were kept stay as they are.  Measured reals of the history are rounded to `DIGITS` significant bits or fewer, far
below their statistical errors; snapshots on the way are fewer; what the log of encounters holds twice is stored once
(`mcdem.netcdf.compact_events`); everything is compressed.
"""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import netCDF4
import numpy as np

from mcdem.encounter.simulate import OUTCOMES
from mcdem.errors import DataFileError, UserError
from mcdem.monte_carlo.record import (
    COMPACT,
    Column,
    compact_columns,
    event_columns,
    opened,
    stretches,
    written,
)
from mcdem.netcdf.whole_files import FILES, RUN, SEALED

if TYPE_CHECKING:
    from numpy.typing import NDArray

DIGITS = 12
"""Significant bits of a rounded real: a relative error of at most 1.2e-4."""
FINER = {"time": 26, "spring": 20}
"""Of moments 1e-8 of the run, so that no two encounters change places; of the history of contacts 1e-6."""
OF_EVENTS = {
    "offset": 8,
    "cpu_time": 4,
    "simulated_time": 8,
    "smallest_gap": 8,
    "first_contact_time": 8,
    "last_bond_change_time": 8,
    "first_bond_loss_time": 8,
}
"""Significant bits of what is only drawn against, or summed over thousands of encounters: 0.4 %, of processor time 6 %."""
OF_MISSES = {"offset": 5, "largest_tension": 4, "simulated_time": 3}
"""The same of encounters that missed, nine in ten of all: at most 3, 6 and 12 %.  How close they came is not kept (nan)."""
POSITION = 17
"""Positions are rounded to 2^-POSITION of the primary radius, or half that, far below the elastic range of a contact, so that
aggregates of the way can meet again (`mcdem kernels`, `mcdem cost`)."""
SMALL = 4096
"""Below so many bytes the index of a compressed variable outweighs what compression gains."""
EXACT = frozenset({"checkpoint", "kept"})
"""Groups kept as they are."""


def compress(source: Path | str, target: Path | str, every: float | None = None) -> None:
    """Write a dataset of `mcdem run` again, smaller.

    Parameters
    ----------
    source : Path or str
        Dataset of `mcdem run`.
    target : Path or str
        File to write.
    every : float
        Time between the snapshots that are kept [s], None for all; the first, the last two, and those that come next after each
        multiple of it.

    Raises
    ------
    DataFileError
        Where `source` is no whole dataset of `mcdem run`, or `target` is the same file, no dataset of `mcdem run`, or one that a
        run is writing.
    UserError
        Where `every` is not above 0.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import mcdem
    >>> from mcdem.monte_carlo import compress
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     compress("notebooks/data/run-750Pa-of-100.nc", Path(folder) / "run.nc", every=60.0)
    ...     len(mcdem.open_run(Path(folder) / "run.nc").snapshot_times)
    4
    """
    source, target = Path(source), Path(target)
    if every is not None and not 0.0 < every < math.inf:
        raise UserError(f"every = {every}: expected a time above 0, in seconds")
    if target.exists() and source.exists() and target.samefile(source):
        raise DataFileError(f"{target}: is the dataset to be compressed; give another name")
    kept = "all" if every is None else f"about {every:g} s apart"
    now = datetime.now(UTC).isoformat(timespec="seconds")
    said = (
        f"{now} compressed: reals to {DIGITS} significant bits, some of encounters to fewer, snapshots {kept}"
    )
    FILES.check(target, RUN)
    with opened(source) as (full,):
        history = "\n".join([*stretches(full), said])
        full.set_auto_maskandscale(False)
        root = _read(full, {}, exact=False)
        groups = {
            name: _read(
                group, _rows_of_snapshots(group, every) if name == "snapshots" else {}, exact=name in EXACT
            )
            for name, group in full.groups.items()
            if name != "events"
        }
        groups["events"] = _events(full)
    with FILES.locked(target), written(target, "give the command again") as small:
        _write(small, root)
        small.setncattr("history", history.encode())
        small.setncattr("format", COMPACT)
        small.setncattr("checksum", SEALED.encode())
        for name, group in groups.items():
            _write(small.createGroup(name), group)


class _Group(NamedTuple):
    attributes: dict[str, Any]
    dimensions: dict[str, int]
    variables: dict[str, tuple[tuple[str, ...], dict[str, Any], NDArray[Any]]]
    """Dimensions, attributes and values of each."""


def _rows_of_snapshots(group: netCDF4.Dataset, every: float | None) -> dict[str, NDArray[np.bool_]]:
    """Which rows of each dimension stay."""
    times = group["time"][:]
    stays = np.ones(len(times), bool)
    if every is not None:
        interval = np.floor(times / every)
        stays[1:] = interval[1:] != interval[:-1]
        # The last is the state of the run; the one before says when the next is due.
        stays[-2:] = True
    aggregate = np.repeat(stays, group["number_of_aggregates"][:])
    return {
        "snapshot": stays,
        "aggregate": aggregate,
        "primary": np.repeat(aggregate, group["size"][:]),
        "contact": np.repeat(aggregate, group["number_of_bonds"][:]),
    }


def _rows_of_last(snapshots: netCDF4.Dataset, dimension: str) -> int:
    """Rows of the last snapshot, the state of the run."""
    count = int(snapshots["number_of_aggregates"][-1])
    if dimension in ("snapshot", "aggregate"):
        return {"snapshot": 1, "aggregate": count}[dimension]
    return int(snapshots[{"primary": "size", "contact": "number_of_bonds"}[dimension]][-count:].sum())


def _read(source: netCDF4.Dataset, rows: dict[str, NDArray[np.bool_]], *, exact: bool) -> _Group:
    """One group: chosen rows, rounded."""
    variables = {}
    root = source.parent or source
    grain = 2.0 ** (math.floor(math.log2(root.primary_radius)) - POSITION)
    for name, variable in source.variables.items():
        values = variable[...]
        first = variable.dimensions[0] if variable.dimensions else ""
        if first in rows:
            values = values[rows[first]]
        if not exact and values.dtype.kind == "f":
            end = len(values) - (_rows_of_last(source, first) if rows else 0)
            coarse = (
                np.rint(values[:end] / grain) * grain
                if name == "position"
                else rounded(values[:end], FINER.get(name, DIGITS))
            )
            values = np.concatenate([coarse, values[end:]])
        variables[name] = (variable.dimensions, _attributes(variable), values)
    lengths = {name: int(rows[name].sum()) if name in rows else len(dimension)
               for name, dimension in source.dimensions.items()}  # fmt: skip
    return _Group(_attributes(source), lengths, variables)


def _events(full: netCDF4.Dataset) -> _Group:
    """The event log, rounded, in few bytes."""
    columns = event_columns(full)
    missed = columns["outcome"].values == OUTCOMES.index("missed")
    found = {}
    for name, column in columns.items():
        values = column.values
        if values.dtype.kind == "f":
            values = rounded(values, FINER.get(name, OF_EVENTS.get(name, DIGITS)))
            if name in OF_MISSES:
                values[missed] = rounded(values[missed], OF_MISSES[name])
            elif name == "smallest_gap":
                values[missed] = np.nan
        found[name] = Column(column.dimensions, column.attributes, values)
    variables = {
        name: (column.dimensions, _as_characters(column.attributes), column.values)
        for name, column in compact_columns(found).items()
    }
    lengths = {
        d: n for dims, _, values in variables.values() for d, n in zip(dims, values.shape, strict=True)
    }
    return _Group(_attributes(full["events"]), {"event": len(missed), **lengths}, variables)


def _write(target: netCDF4.Dataset, group: _Group) -> None:
    """The same to the file, compressed."""
    target.setncatts(group.attributes)
    for name, length in group.dimensions.items():
        target.createDimension(name, length)
    for name, (dimensions, attributes, values) in group.variables.items():
        many = values.nbytes > SMALL
        packing: dict[str, Any] = {"zlib": True, "complevel": 9, "shuffle": True, "fletcher32": True}
        stored = target.createVariable(
            name, values.dtype, dimensions, **(packing if many else {"contiguous": values.size > 0})
        )
        stored.set_auto_maskandscale(False)
        stored.setncatts(attributes)
        stored[...] = values


def _attributes(source: Any) -> dict[str, Any]:
    """Text as characters, never as strings of variable length (`record`)."""
    return _as_characters({name: source.getncattr(name) for name in source.ncattrs()})


def _as_characters(found: dict[str, Any]) -> dict[str, Any]:
    return {name: value.encode() if isinstance(value, str) else value for name, value in found.items()}


def rounded(values: NDArray[Any], digits: int) -> NDArray[Any]:
    """Reals (...) to `digits` significant bits, half to even; nan and infinity as they are."""
    mantissa, exponent = np.frexp(values)
    return np.ldexp(np.rint(np.ldexp(mantissa, digits)), exponent - digits).astype(values.dtype)
