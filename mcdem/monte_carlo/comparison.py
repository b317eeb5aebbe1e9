"""Whether two datasets of `mcdem run` record the same process, bit for bit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
from numpy.typing import NDArray

from mcdem.monte_carlo.record import ORIGIN_OF_THE_WRITING, TIMING, event_columns, opened


def differences(one: Path | str, other: Path | str) -> list[str]:
    """What distinguishes two datasets bit by bit, the machine's timing and the origin of the writing aside.

    Parameters
    ----------
    one, other : path
        Files that `mcdem run` wrote.

    Returns
    -------
    list of str
        A line each; empty where they record the same process.

    Examples
    --------
    >>> from mcdem.monte_carlo import differences
    >>> differences("notebooks/data/run-1250Pa.nc", "notebooks/data/run-1250Pa.nc")
    []
    """
    with opened(Path(one), Path(other)) as (a, b):
        return list(_differences(a, b, ""))


def identical(one: Path | str, other: Path | str) -> bool:
    """Whether two datasets record the same process, bit for bit.

    Parameters
    ----------
    one, other : path
        Files that `mcdem run` wrote.

    Returns
    -------
    bool
        Whether there are none.

    Examples
    --------
    >>> from mcdem.monte_carlo import identical
    >>> identical("notebooks/data/run-1250Pa.nc", "notebooks/data/run-1250Pa.nc")
    True
    """
    return not differences(one, other)


def _differences(a: netCDF4.Dataset, b: netCDF4.Dataset, where: str) -> Iterator[str]:
    def attributes(node: Any) -> dict[str, Any]:
        return {n: np.asarray(node.getncattr(n)) for n in node.ncattrs() if n not in ORIGIN_OF_THE_WRITING}

    def compare(kind: str, x: dict[str, Any], y: dict[str, Any]) -> Iterator[str]:
        for name in sorted(x.keys() | y.keys()):
            if name not in x or name not in y:
                yield f"{where}/{name}: {kind} of one only"
            elif x[name].dtype != y[name].dtype or x[name].shape != y[name].shape:
                yield f"{where}/{name}: {x[name].dtype}{x[name].shape} and {y[name].dtype}{y[name].shape}"
            elif not _bits_equal(x[name], y[name]):
                yield f"{where}/{name}: values"

    for node in (a, b):
        node.set_auto_maskandscale(False)
    yield from compare("attribute", attributes(a), attributes(b))

    def values(node: netCDF4.Dataset) -> dict[str, Any]:
        # The log of encounters is laid out in one of two ways.
        found = (
            {n: column.values for n, column in event_columns(node.parent).items()}
            if where == "/events" and node.parent is not None
            else {n: v[...] for n, v in node.variables.items()}
        )
        return {n: v for n, v in found.items() if n not in TIMING}

    yield from compare("variable", values(a), values(b))
    for name in sorted(a.groups.keys() | b.groups.keys()):
        if name not in a.groups or name not in b.groups:
            yield f"{where}/{name}: group of one only"
        else:
            yield from _differences(a[name], b[name], f"{where}/{name}")


def _bits_equal(x: NDArray[Any], y: NDArray[Any]) -> bool:
    return np.ascontiguousarray(x).tobytes() == np.ascontiguousarray(y).tobytes()
