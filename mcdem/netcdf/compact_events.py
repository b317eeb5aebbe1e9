"""The event log of a run in few bytes, and back bit for bit.

Most encounters of a run miss: both parents go on as they were, so a log that names the shape of each parent and of each
product holds the same four times.  Here a column of shape is stored at an appearance of an aggregate (as parent, then as
product) only where it differs from the appearance before; a product's serial number is stored as the parent that it is, or as
a step beyond the newest; counters are stored as steps.  Moments are those of the series.  Nothing is rounded here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

SHAPES = ("size", "outer_radius", "bonds", "aspect_ratio", "radius_of_gyration")
"""Columns that parents and products have alike, `parent_*` (event, 2) and `product_*` (product,)."""

Stored = dict[str, tuple[tuple[str, ...], str, "NDArray[Any]"]]
"""By name: dimensions, what it means, values."""


def compacted(columns: Mapping[str, NDArray[Any]]) -> Stored:
    """What takes the place of the columns of an event log that it holds less briefly; those not named stay as they are.

    columns : of `mcdem.monte_carlo.record.EVENTS` and `PRODUCTS`, those there are
    """
    parents, counts = columns["parent_serial"], columns["number_of_products"]
    serials, event = columns["product_serial"], _event_of_product(columns["number_of_products"])
    stored: Stored = {
        "product_origin": (
            ("product",),
            "0 or 1: the product is that parent; above: serial number less the newest until then, plus 1; below 0: that, less 1",
            _origins(parents, event, serials),
        ),
        "product_exchanged": (
            ("product",),
            "primary particles that came from the first parent, beyond those of a product that is a parent",
            columns["product_from_first"]
            - _from_first_if_same(columns["parent_size"], parents, event, serials),
        ),
        "stream_step": (
            ("event",),
            "number of the encounter's random stream less that of the encounter before",
            np.diff(columns["stream_number"], prepend=0),
        ),
        "solves_beyond_steps": (("event",), "solves less steps", columns["solves"] - columns["steps"]),
    }
    order, first = _appearances(parents, counts, serials)
    for name in _present(columns):
        values = np.concatenate([columns[f"parent_{name}"].ravel(), columns[f"product_{name}"]])[order]
        bits = np.ascontiguousarray(values).view(f"u{values.itemsize}")
        new = first | np.r_[True, bits[1:] != bits[:-1]][: len(bits)]
        stored[f"{name}_is_new"] = (
            ("appearance",),
            "whether the next value is of this appearance; appearances by serial number, then as they came",
            new.astype(np.int8),
        )
        stored[f"{name}_value"] = ((f"{name}_value",), "values, one after the other", values[new])
    return stored


def replaced(columns: Mapping[str, Any]) -> set[str]:
    """Names of the columns that `compacted` stores in another form."""
    shapes = {f"{of}_{name}" for of in ("parent", "product") for name in _present(columns)}
    return {"time", "product_serial", "product_from_first", "stream_number", "steps"} | shapes


def expanded(stored: Mapping[str, NDArray[Any]], times: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """All columns again.

    stored : what `compacted` gave, with the columns that stayed
    times : (event,) process times [s], of the series
    """
    parents, counts = stored["parent_serial"], stored["number_of_products"]
    event = _event_of_product(counts)
    serials = _serials(parents, event, stored["product_origin"])
    order, _ = _appearances(parents, counts, serials)
    found: dict[str, NDArray[Any]] = {
        name: values
        for name, values in stored.items()
        if name not in {"product_origin", "product_exchanged", "stream_step", "solves_beyond_steps"}
        and not name.endswith(("_is_new", "_value"))
    }
    for name in SHAPES:
        if f"{name}_value" not in stored:
            continue
        values = stored[f"{name}_value"]
        column = np.empty(len(order), values.dtype)
        column[order] = values[np.cumsum(stored[f"{name}_is_new"], dtype=np.int64) - 1]
        found[f"parent_{name}"] = column[: parents.size].reshape(parents.shape)
        found[f"product_{name}"] = column[parents.size :]
    found["time"] = times
    found["product_serial"] = serials
    same = _from_first_if_same(found["parent_size"], parents, event, serials)
    found["product_from_first"] = stored["product_exchanged"] + same
    found["stream_number"] = np.cumsum(stored["stream_step"])
    found["steps"] = stored["solves"] - stored["solves_beyond_steps"]
    return found


def _present(columns: Mapping[str, Any]) -> list[str]:
    return [name for name in SHAPES if f"product_{name}" in columns]


def _event_of_product(counts: NDArray[np.int64]) -> NDArray[np.intp]:
    return np.repeat(np.arange(len(counts)), counts)


def _appearances(
    parents: NDArray[np.int64], counts: NDArray[np.int64], serials: NDArray[np.int64]
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Order of parents, then products, by serial number and time; which are the first of theirs."""
    every = np.concatenate([parents.ravel(), serials])
    when = np.concatenate([2 * np.repeat(np.arange(len(parents)), 2), 2 * _event_of_product(counts) + 1])
    order = np.lexsort((when, every))
    return order, np.diff(every[order], prepend=-1) != 0


def _parent_of(
    parents: NDArray[np.int64], event: NDArray[np.intp], serials: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(product,) which parent it is, -1 for neither."""
    return np.where(serials == parents[event, 0], 0, np.where(serials == parents[event, 1], 1, -1))


def _from_first_if_same(
    sizes: NDArray[np.int64],
    parents: NDArray[np.int64],
    event: NDArray[np.intp],
    serials: NDArray[np.int64],
) -> NDArray[np.int64]:
    return np.where(_parent_of(parents, event, serials) == 0, sizes[event, 0], 0)


def _origins(
    parents: NDArray[np.int64], event: NDArray[np.intp], serials: NDArray[np.int64]
) -> NDArray[np.int64]:
    origin = _parent_of(parents, event, serials).astype(np.int64)
    met, newest = np.maximum.accumulate(parents.max(axis=1, initial=-1)), -1
    for k in np.flatnonzero(origin < 0):
        newest = max(newest, int(met[event[k]]))
        beyond = int(serials[k]) - newest
        origin[k] = beyond + 1 if beyond > 0 else beyond - 1
        newest = max(newest, int(serials[k]))
    return origin


def _serials(
    parents: NDArray[np.int64], event: NDArray[np.intp], origin: NDArray[np.int64]
) -> NDArray[np.int64]:
    is_parent = (origin == 0) | (origin == 1)
    serials = np.where(is_parent, parents[event, np.where(is_parent, origin, 0)], 0)
    met, newest = np.maximum.accumulate(parents.max(axis=1, initial=-1)), -1
    for k in np.flatnonzero(~is_parent):
        newest = max(newest, int(met[event[k]]))
        serials[k] = newest + origin[k] - 1 if origin[k] > 0 else newest + origin[k] + 1
        newest = max(newest, int(serials[k]))
    return serials
