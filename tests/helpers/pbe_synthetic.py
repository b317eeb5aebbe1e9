"""A synthetic DEM: encounters of known probabilities, handed over as records."""

from __future__ import annotations

import numpy as np

from pbekit import Aggregation, CollisionalBreakup, Grid, PopulationBalance
from pbekit.balance.encounters import PairRows
from pbekit.tables.kernel_table import AGGREGATION, BROKEN_TOUCHING, EXCHANGE, MISSED, PARTED, Records

RADIUS, SHEAR_RATE = 1.0, 1.0
STAY = 0.7


def outer_radius(size, shape=1.0):
    """R [m]: a fractal, longer when elongated."""
    size = np.asarray(size, float)
    return RADIUS * size**0.5 * np.where(size > 2, np.asarray(shape, float) ** 0.3, 1.0)


def probabilities(i, j, s_i=1.0, s_j=1.0, critical=7.0):
    """(join, scatter) of an encounter; half of the hits scatter at the critical joint size."""
    total = np.asarray(i, float) + j
    stretched = np.where(np.asarray(i) > 2, s_i, 1.0) * np.where(np.asarray(j) > 2, s_j, 1.0)
    hit = 0.3 + 0.3 / (1 + np.abs(np.log(np.asarray(i, float) / j)))
    breaks = 1 / (1 + (critical / total) ** 5 / stretched)
    return hit * (1 - breaks), hit * breaks


def new_shape(rng, size, shapes):
    """Shapes of products are drawn anew, rounder for larger ones; one or two primaries have none."""
    share = 1 / (1 + np.asarray(size, float) / 12)
    return np.where(
        np.asarray(size) > 2, np.where(rng.random(np.shape(size)) < share, shapes[1], shapes[0]), 1.0
    )


def shape_share(size):
    """Probability of the elongated shape for a product of this size."""
    return 1 / (1 + np.asarray(size, float) / 12)


def encounters(rng, size, shape, shapes=(1.0, 1.0), critical=7.0, pieces=2) -> Records:
    """One encounter for each pair: size (n, 2), shape (n, 2).

    pieces : into which a broken pair falls, all splits alike: two (their number never grows, so sizes do) or three
    """
    join, scatter = probabilities(*size.T, *shape.T, critical)
    u = rng.random(len(size))
    total = size.sum(axis=1)
    outcome, first, count = np.full(len(size), MISSED), size[:, 0].copy(), np.full(len(size), 2)
    touched = (u >= join + scatter) & (rng.random(len(size)) < 0.2)
    outcome[touched] = PARTED
    outcome[u < join] = AGGREGATION
    first[u < join], count[u < join] = total[u < join], 1
    broken = (u >= join) & (u < join + scatter)
    first[broken] = 1 + (rng.random(broken.sum()) * (total[broken] - 1)).astype(int)
    # Which primaries end where does not matter here, only that the sets are others.
    outcome[broken] = np.where(rng.random(broken.sum()) < 0.5, EXCHANGE, BROKEN_TOUCHING)
    product_size = np.stack([first, total - first, 0 * first], axis=1)
    three = broken & (total > 2) & (pieces == 3)
    # Two different cuts among the total - 1 places.
    one = 1 + (rng.random(three.sum()) * (total[three] - 1)).astype(int)
    two = 1 + (rng.random(three.sum()) * (total[three] - 2)).astype(int)
    two += two >= one
    low, high = np.minimum(one, two), np.maximum(one, two)
    product_size[three] = np.stack([low, high - low, total[three] - high], axis=1)
    count[three], outcome[three] = 3, BROKEN_TOUCHING
    kept = np.isin(outcome, (MISSED, PARTED))
    moved = rng.random(size.shape) > STAY
    after = np.where(moved, new_shape(rng, size, shapes), shape)
    product_shape = new_shape(rng, product_size[:, : 3 if pieces == 3 else 2], shapes)
    product_shape = np.pad(product_shape, ((0, 0), (0, 3 - product_shape.shape[1])), constant_values=1.0)
    product_shape[:, :2] = np.where(kept[:, None], after, product_shape[:, :2])
    # The first parent's primaries fill the products in their order.
    before = np.cumsum(product_size, axis=1) - product_size
    from_first = np.clip(size[:, :1] - before, 0, product_size)
    mask = np.arange(3)[None] < count[:, None]
    n = len(size)
    return Records(
        size=size,
        aspect_ratio=shape,
        outer_radius=outer_radius(size, shape),
        radius_of_gyration=0.7 * outer_radius(size, shape),
        offset=np.zeros((n, 2)),
        outcome=outcome,
        source=np.ones(n),
        time=np.full(n, np.nan),
        solves=np.ones(n),
        cpu_time=np.zeros(n),
        products=count,
        product_size=product_size[mask],
        product_from_first=from_first[mask],
        product_aspect_ratio=product_shape[mask],
        product_outer_radius=outer_radius(product_size, product_shape)[mask],
        product_radius_of_gyration=0.7 * outer_radius(product_size, product_shape)[mask],
    )


def design(rng, count, largest, shapes=(1.0, 1.0), critical=7.0, pieces=2) -> Records:
    """`count` encounters of sizes drawn evenly, and of shapes drawn evenly."""
    size = rng.integers(1, largest + 1, size=(count, 2))
    shape = np.where(size > 2, np.asarray(shapes)[rng.integers(0, 2, size=(count, 2))], 1.0)
    return encounters(rng, size, shape, shapes, critical, pieces)


def known_balance(largest: int, critical: float = 7.0):
    """The balance that encounters in three pieces obey, without shapes; its grid holds each size to `largest`."""
    grid = Grid.primaries(largest).with_outer_radius(lambda m: outer_radius(m))
    i, j = grid.pivots[:, None], grid.pivots[None]
    join, scatter = probabilities(i, j, critical=critical)
    rate = 4 / 3 * SHEAR_RATE * (outer_radius(i) + outer_radius(j)) ** 3
    high, low = np.tril_indices(largest)
    total = (high + low + 2)[:, None]
    k = grid.pivots[None]
    number = np.where(
        total > 2, 6 * (total - 1 - k) / np.maximum((total - 1) * (total - 2), 1), 2.0 * (k == 1)
    )
    number = np.where(k <= np.maximum(total - 2, 1), number, 0.0)
    rows = np.zeros((total.size, largest + 2))
    rows[:, :largest] = number
    # A closed grid puts what is beyond it on its last size, its mass kept.
    beyond = np.arange(largest + 1, 2 * largest + 1)[None]
    over = np.where(
        beyond <= total - 2, 6 * (total - 1 - beyond) / np.maximum((total - 1) * (total - 2), 1), 0.0
    )
    rows[:, largest - 1] += (over * beyond).sum(axis=1) / largest
    events = [Aggregation(rate * join), CollisionalBreakup(rate * scatter, PairRows(rows, "three pieces"))]
    return PopulationBalance(grid, events, edge="closed"), grid.monodisperse(0.01)
