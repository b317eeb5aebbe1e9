"""Local averages: what encounters nearest in size say where none is exactly alike."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse

NEIGHBOURS = 40
"""Encounters that a local average of fragments, shapes or radii rests on, where exact matches are fewer."""
MOST_NEIGHBOURS = 400


def nearest(
    targets: np.ndarray,
    samples: np.ndarray,
    scale: np.ndarray,
    within: Callable[[int], np.ndarray] | None = None,
) -> sparse.csr_array:
    """(targets, samples) weights of a local average, Gaussian in the scaled distance.

    The width is such that about NEIGHBOURS samples count; where that many match exactly, only these count.
    targets (t, d), samples (n, d), scale (d,); within : (t, n) -> only samples allowed, as a function of the target
    """
    rows = []
    for t, target in enumerate(targets):
        allowed = np.arange(len(samples)) if within is None else within(t)
        if allowed.size == 0:
            rows.append((np.zeros(0, int), np.zeros(0)))
            continue
        d = np.sqrt((((samples[allowed] - target) / scale) ** 2).sum(axis=1))
        count = min(len(d), MOST_NEIGHBOURS)
        exact = np.flatnonzero(d < 1e-9)
        if exact.size >= NEIGHBOURS:
            rows.append((allowed[exact], np.ones(exact.size)))
            continue
        near = np.argpartition(d, count - 1)[:count]
        width = max(np.partition(d[near], min(NEIGHBOURS, count) - 1)[min(NEIGHBOURS, count) - 1] / 1.5, 1e-6)
        weight = np.exp(-0.5 * (np.minimum(d[near] / width, 30)) ** 2)
        keep = weight > 1e-6
        rows.append((allowed[near[keep]], weight[keep]))
    columns = np.concatenate([r[0] for r in rows]) if rows else np.zeros(0, int)
    data = np.concatenate([r[1] for r in rows]) if rows else np.zeros(0)
    start = np.concatenate([[0], np.cumsum([len(r[0]) for r in rows])])
    return sparse.csr_array((data, columns, start), shape=(len(targets), len(samples)))
