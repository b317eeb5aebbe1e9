"""A synthetic DEM: encounters of known probabilities, handed over as records."""

from __future__ import annotations

import numpy as np

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


def encounters(rng, size, shape, shapes=(1.0, 1.0), critical=7.0) -> Records:
    """One encounter for each pair: size (n, 2), shape (n, 2)."""
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
    product_size = np.stack([first, total - first], axis=1)
    kept = np.isin(outcome, (MISSED, PARTED))
    moved = rng.random(size.shape) > STAY
    after = np.where(moved, new_shape(rng, size, shapes), shape)
    product_shape = np.where(kept[:, None], after, new_shape(rng, product_size, shapes))
    from_first = np.where(kept[:, None], np.stack([size[:, 0], 0 * first], axis=1), 0)
    mask = np.arange(2)[None] < count[:, None]
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


def design(rng, count, largest, shapes=(1.0, 1.0), critical=7.0) -> Records:
    """`count` encounters of sizes drawn evenly, and of shapes drawn evenly."""
    size = rng.integers(1, largest + 1, size=(count, 2))
    shape = np.where(size > 2, np.asarray(shapes)[rng.integers(0, 2, size=(count, 2))], 1.0)
    return encounters(rng, size, shape, shapes, critical)
