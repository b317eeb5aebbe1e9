"""Breakup, read off the record of encounters.

What counts as breakup is a matter of reading, and decides its numbers, so every number comes under both:

- ``"paper"``  : Frungieri & Vanni, section 2.1: two or more fragments after a collision, or a split without one:
  parted, exchange and fragmentation;
- ``"strict"`` : pairs that touch and part with the same primaries are left out: exchange and fragmentation.

The *parent* is what broke: both aggregates together once they touched; without contact, the aggregate that split.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .statistics import share

Reading = Literal["paper", "strict"]
READINGS: dict[Reading, tuple[str, ...]] = {
    "paper": ("parted", "exchange", "fragmentation"),
    "strict": ("exchange", "fragmentation"),
}

EROSION_ABOVE = 0.90
"""A largest fragment of at least this share of its parent is what erosion leaves (the paper's peak is 90 - 95 %)."""


def is_breakup(outcome: NDArray[np.str_], reading: Reading) -> NDArray[np.bool_]:
    """(E,) which encounters broke something."""
    return np.isin(outcome, READINGS[reading])


def breakups(
    outcome: NDArray[np.str_],
    contact: NDArray[np.bool_],
    parent_sizes: NDArray[np.integer],
    product_counts: NDArray[np.integer],
    product_sizes: NDArray[np.integer],
    from_first: NDArray[np.integer],
) -> xr.Dataset:
    """Parent and fragments of every encounter that is a breakup in the wider reading.

    outcome, contact : (E,) outcomes' names, and whether the two aggregates touched
    parent_sizes : (E, 2) primaries of the two aggregates
    product_counts : (E,) aggregates that left
    product_sizes, from_first : (sum products,) primaries of each, and how many came from the first aggregate

    Returns, over ``breakup``: ``event`` (index into E), ``outcome``, ``parent_size``, ``collider_size`` (mean of the
    two aggregates), ``fragments``, ``largest_fragment`` (as a fraction of the parent).
    """
    first_product = np.cumsum(product_counts) - product_counts
    rows = np.flatnonzero(is_breakup(outcome, "paper"))
    parent, fragments, largest = (np.zeros(len(rows), dtype=np.int64) for _ in range(3))
    for k, e in enumerate(rows):
        sizes = product_sizes[first_product[e] : first_product[e] + product_counts[e]]
        origin = from_first[first_product[e] : first_product[e] + product_counts[e]]
        if not contact[e]:
            split = [
                own
                for own in (
                    origin == sizes,
                    origin == 0,
                )  # products of the first, and of the second aggregate
                if np.count_nonzero(own) > 1
            ]
            sizes = sizes[np.any(split, axis=0)] if split else sizes
        parent[k], fragments[k], largest[k] = sizes.sum(), len(sizes), sizes.max()
    return xr.Dataset(
        {
            "event": ("breakup", rows),
            "outcome": ("breakup", outcome[rows]),
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


def summarise(broken: xr.Dataset, reading: Reading, erosion_above: float = EROSION_ABOVE) -> dict[str, float]:
    """Means over the breakups of one reading; NaN of none.

    ``P_br``, ``P_br_deviation`` (over the breakups), ``P_br_error`` (of the mean), the same of ``collider_size``,
    ``largest_fragment``, ``fragments``, ``two_fragments`` (share), ``fragmentation_share`` (0.45 - 0.75 of the parent:
    the paper's range), ``erosion_share`` with 95 % limits, and ``breakups`` (count).
    """
    chosen = broken.isel(breakup=is_breakup(broken["outcome"].values, reading))
    count = chosen.sizes["breakup"]

    def mean(name: str) -> float:
        return float(chosen[name].mean()) if count else float("nan")

    def deviation(name: str) -> float:
        return float(chosen[name].std()) if count else float("nan")

    largest = chosen["largest_fragment"].values
    erosion = share(int(np.sum(largest >= erosion_above)), count)
    comparable = share(int(np.sum((largest >= 0.45) & (largest <= 0.75))), count)
    two = share(int(np.sum(chosen["fragments"].values == 2)), count)
    return {
        "breakups": count,
        "P_br": mean("parent_size"),
        "P_br_deviation": deviation("parent_size"),
        "P_br_error": deviation("parent_size") / np.sqrt(count) if count else float("nan"),
        "collider_size": mean("collider_size"),
        "collider_size_deviation": deviation("collider_size"),
        "largest_fragment": mean("largest_fragment"),
        "fragments": mean("fragments"),
        "two_fragments": two[0],
        "fragmentation_share": comparable[0],
        "fragmentation_share_low": comparable[1],
        "fragmentation_share_high": comparable[2],
        "erosion_share": erosion[0],
        "erosion_share_low": erosion[1],
        "erosion_share_high": erosion[2],
    }
