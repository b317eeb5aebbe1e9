"""Breakup, read off the record of encounters.

What counts as breakup, and of what, is a matter of convention, and decides its numbers, so every number comes under each:

- ``"paper"``  : Frungieri & Vanni, section 2.1: two or more fragments after a collision, or a split without one:
  parted, exchange and fragmentation; the *parent* is both aggregates together once they touched, without contact the
  aggregate that split;
- ``"strict"`` : the same parents, but pairs that touch and part with the same primaries are left out: exchange and
  fragmentation;
- ``"own"``    : each of the two aggregates for itself: it broke if its primaries ended in more than one aggregate, and its
  fragments are its own primaries in each of them. A primary torn out of 13 in a collision leaves 12/13 of its parent here;
  in the other conventions the parent is both colliders, and the largest fragment may be the one that stayed whole.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mcdem.analysis.statistics import mean_limits, share

Convention = Literal["paper", "strict", "own"]
CONVENTIONS: tuple[Convention, ...] = ("paper", "strict", "own")

BROKEN = {
    "paper": ("parted", "exchange", "fragmentation"),
    "strict": ("exchange", "fragmentation"),
    "own": ("exchange", "fragmentation"),
}
"""Outcomes that are breakups in each convention."""

EROSION_ABOVE = 0.90
"""A largest fragment of at least this share of its parent is what erosion leaves (the paper's peak is 90 - 95 %)."""


def in_convention(broken: xr.Dataset, convention: Convention) -> NDArray[np.bool_]:
    """(breakup,) which rows of `breakups` are breakups of a convention.

    Parameters
    ----------
    broken : xarray.Dataset
        Of `breakups`.
    convention : {"paper", "strict", "own"}
        What counts as breakup.

    Returns
    -------
    (breakup,) booleans
        Which belong to it.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset, in_convention
    >>> broken = RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc").late_breakups
    >>> {name: int(in_convention(broken, name).sum()) for name in ("paper", "strict", "own")}
    {'paper': 4370, 'strict': 505, 'own': 513}
    """
    by_itself = broken["by_itself"].values
    return np.isin(broken["outcome"].values, BROKEN[convention]) & (by_itself == (convention == "own"))


def breakups(
    outcome: NDArray[np.str_],
    contact: NDArray[np.bool_],
    parent_sizes: NDArray[np.integer],
    product_counts: NDArray[np.integer],
    product_sizes: NDArray[np.integer],
    from_first: NDArray[np.integer],
) -> xr.Dataset:
    """Parent and fragments of every breakup: the rows of all conventions (`in_convention` says which belong to which).

    Parameters
    ----------
    outcome : (E,) of str
        Names of the outcomes.
    contact : (E,) of bool
        Whether the two aggregates touched.
    parent_sizes : (E, 2) of int
        Primaries of the two aggregates.
    product_counts : (E,) of int
        Aggregates that left.
    product_sizes : (sum of products,) of int
        Primaries of each.
    from_first : (sum of products,) of int
        How many of them came from the first aggregate.

    Returns
    -------
    xarray.Dataset
        Over ``breakup``: ``event`` (index into E), ``outcome``, ``by_itself`` (a row of the convention ``"own"``),
        ``parent_size``, ``collider_size`` (mean of the two aggregates), ``fragments``, ``largest_fragment`` (as a fraction of
        the parent).

    Examples
    --------
    A doublet meets seven primaries; three aggregates leave:

    >>> import numpy as np
    >>> from mcdem.analysis import breakups
    >>> one = np.array
    >>> broken = breakups(one(["fragmentation"]), one([True]), one([[2, 7]]), one([3]), one([4, 3, 2]), one([0, 1, 1]))
    >>> broken["parent_size"].values.tolist(), broken["fragments"].values.tolist()
    ([9, 2, 7], [3, 2, 3])
    """
    first_product = np.cumsum(product_counts) - product_counts
    found: list[tuple[int, bool, NDArray[Any]]] = []
    for e in np.flatnonzero(np.isin(outcome, BROKEN["paper"])).tolist():
        sizes = product_sizes[first_product[e] : first_product[e] + product_counts[e]]
        origin = from_first[first_product[e] : first_product[e] + product_counts[e]]
        own = [pieces[pieces > 0] for pieces in (origin, sizes - origin)]
        split = [pieces for pieces in own if len(pieces) > 1]
        found.append((e, False, np.concatenate(split) if split and not contact[e] else sizes))
        if outcome[e] in BROKEN["own"]:
            found += [(e, True, pieces) for pieces in split]
    rows = np.array([e for e, _, _ in found], dtype=np.intp)
    parent, fragments, largest = (
        np.array([of(pieces) for _, _, pieces in found], dtype=np.int64) for of in (np.sum, len, np.max)
    )
    return xr.Dataset(
        {
            "event": ("breakup", rows),
            "outcome": ("breakup", outcome[rows]),
            "by_itself": ("breakup", np.array([alone for _, alone, _ in found], dtype=bool)),
            "parent_size": ("breakup", parent, {"units": "1", "long_name": "primaries of what broke"}),
            "collider_size": (
                "breakup",
                parent_sizes[rows].mean(axis=1),
                {"units": "1", "long_name": "mean number of primaries of the two aggregates"},
            ),
            "fragments": ("breakup", fragments, {"units": "1", "long_name": "number of fragments"}),
            "largest_fragment": (
                "breakup",
                largest / np.maximum(parent, 1),
                {"units": "1", "long_name": "largest fragment over parent"},
            ),
        }
    )


def summarise(
    broken: xr.Dataset, convention: Convention, erosion_above: float = EROSION_ABOVE
) -> dict[str, float]:
    """Means over the breakups of one convention; NaN of none.

    ``P_br``, ``P_br_deviation`` (over the breakups; nan of one), ``P_br_error`` (such that P_br +- 2 P_br_error are its 95 %
    limits; infinite of one), mean and deviation of ``collider_size``,
    ``largest_fragment``, ``fragments``, ``two_fragments`` (share), ``fragmentation_share`` (0.45 - 0.75 of the parent:
    the paper's range) and ``erosion_share``, each with 95 % limits, and ``breakups`` (count).

    Parameters
    ----------
    broken : xarray.Dataset
        Of `breakups`.
    convention : {"paper", "strict", "own"}
        What counts as breakup.
    erosion_above : float
        Largest fragment over the parent, from which on a breakup is erosion [-].

    Returns
    -------
    dict
        {name: value}.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset, summarise
    >>> broken = RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc").late_breakups
    >>> found = summarise(broken, "paper")
    >>> f"{found['breakups']:.0f} breakups, P_br = {found['P_br']:.1f} +- {2 * found['P_br_error']:.1f}"
    '4370 breakups, P_br = 23.4 +- 0.1'
    """
    chosen = broken.isel(breakup=in_convention(broken, convention))
    count = chosen.sizes["breakup"]

    def mean(name: str) -> float:
        return float(chosen[name].mean()) if count else float("nan")

    def deviation(name: str) -> float:
        return float(chosen[name].std(ddof=1)) if count > 1 else float("nan")

    largest = chosen["largest_fragment"].values
    erosion = share(int(np.sum(largest >= erosion_above)), count)
    comparable = share(int(np.sum((largest >= 0.45) & (largest <= 0.75))), count)
    two = share(int(np.sum(chosen["fragments"].values == 2)), count)
    return {
        "breakups": count,
        "P_br": mean("parent_size"),
        "P_br_deviation": deviation("parent_size"),
        "P_br_error": 0.5 * mean_limits(chosen["parent_size"].values)[1],
        "collider_size": mean("collider_size"),
        "collider_size_deviation": deviation("collider_size"),
        "largest_fragment": mean("largest_fragment"),
        "fragments": mean("fragments"),
        "two_fragments": two[0],
        "two_fragments_low": two[1],
        "two_fragments_high": two[2],
        "fragmentation_share": comparable[0],
        "fragmentation_share_low": comparable[1],
        "fragmentation_share_high": comparable[2],
        "erosion_share": erosion[0],
        "erosion_share_low": erosion[1],
        "erosion_share_high": erosion[2],
    }
