"""Products shared among three pivots, so that number, mass and second moment are kept.

Kumar & Ramkrishna's (1996) fixed pivot keeps two properties with two pivots; a third pivot keeps a third.  What a
product of mass v adds to any smooth property is then right to third order in the width of the classes, not to second.
The price: the share of the far neighbour is negative (by an eighth at most, on even pivots), so that an empty class can be
driven below zero where the population ends abruptly.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Below = Callable[[np.ndarray], np.ndarray]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)
CLEAN = 1e-12
"""A share below this is round-off of a product that meets a pivot."""


def stencils(pivots: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """(n, 3) pivots that share a product of each mass: the nearest and its two neighbours, the last three at the ends."""
    middle = np.searchsorted(0.5 * (pivots[1:] + pivots[:-1]), mass, side="right")
    return np.clip(middle, 1, pivots.size - 2)[:, None] + np.array([-1, 0, 1])


def shares(pivots: np.ndarray, slot: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """(n, 3) numbers on the pivots of `slot` (n, 3) that have these moments (n, 3): number, mass and second moment.

    Moments are about the middle pivot of each, so that none is a difference of large numbers.
    """
    x = pivots[slot] - pivots[slot[:, 1:2]]
    below, above = x[:, 0], x[:, 2]
    number, first, second = moments.T
    low = (second - above * first) / (below * (below - above))
    high = (second - below * first) / (above * (above - below))
    return np.stack([low, number - low - high, high], axis=1)


def of_masses(pivots: np.ndarray, mass: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(slot, number), each (n, 3), of one product of each mass (n,) within the pivots."""
    slot = stencils(pivots, mass)
    away = mass - pivots[slot[:, 1]]
    number = shares(pivots, slot, np.stack([np.ones_like(away), away, away**2], axis=1))
    # Products that meet a pivot stay there; no round-off may leak to its neighbours.
    clean = np.where(np.abs(number) < CLEAN, 0.0, number)
    whole = (clean != 0).sum(axis=1) == 1
    return slot, np.where(whole[:, None], np.round(clean), number)


def surplus(pivots: np.ndarray, number_below: Below, upto: float) -> np.ndarray:
    """(S,) second moment that two pivots add to a density, at most to `upto`, given to the pivots whose stencils take it away.

    Between pivots a and b two pivots add (b - v)(v - a) n(v), integrated here by parts.

    number_below : integral of n(v) from 0 to v
    """
    low, high = pivots[:-1], np.minimum(pivots[1:], np.maximum(upto, pivots[:-1]))
    half = 0.5 * (high - low)
    at = 0.5 * (high + low)[:, None] + half[:, None] * NODES
    met = number_below(low)
    slope = (pivots[1:] + low)[:, None] - 2.0 * at
    rest = half * ((slope * (number_below(at) - met[:, None])) @ WEIGHTS)
    added = (pivots[1:] - high) * (high - low) * (number_below(high) - met) - rest
    # Half to either end of the interval; the ends of the grid have no stencil of their own.
    given = np.zeros(pivots.size)
    given[:-1] += 0.5 * added
    given[1:] += 0.5 * added
    given[1] += given[0]
    given[-2] += given[-1]
    given[[0, -1]] = 0.0
    return given


def without_surplus(pivots: np.ndarray, number: np.ndarray, given: np.ndarray, positive: bool) -> np.ndarray:
    """(S,) numbers on two pivots each, less the second moment that this added; number and mass stay.

    number, given : (S,) as two pivots have it, and its `surplus`
    positive : leave what would take a pivot below zero
    """
    inner = np.arange(1, pivots.size - 1)
    slot = inner[:, None] + np.array([-1, 0, 1])
    moved = shares(pivots, slot, given[1:-1, None] * np.array([0.0, 0.0, 1.0]))
    if positive:
        taken = np.bincount(slot[:, [0, 2]].ravel(), moved[:, [0, 2]].ravel(), pivots.size)
        some = np.minimum(1.0, number / np.maximum(taken, 1e-300))
        moved *= np.minimum(some[:-2], some[2:])[:, None]
    return number - np.bincount(slot.ravel(), moved.ravel(), pivots.size)
