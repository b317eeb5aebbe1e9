"""Arrays of a table, for targets that take arrays: between classes, padded to nothing."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from pbekit.export.target import MARK, HandOver


def arrays_of(given: HandOver) -> dict[str, np.ndarray]:
    """All arrays of the balance between S classes, SI units."""
    rates = given.rates
    found = {
        "P": rates.pivots,
        "R": rates.outer_radius,
        "K": rates.aggregation_rate.value,
        "B": rates.breakup_rate.value if rates.breaks else np.zeros_like(rates.breakup_rate.value),
        "f": rates.encounter_rate.value,
        "daughters": rates.daughters,
        "n0": np.array(given.primaries),
        "a": np.array(given.radius),
        "g": np.array(given.shear_rate),
    }
    steady = given.steady_mean_size
    if steady is not None:
        found["steady_mean_size"] = np.array(steady)
    return found


def packed(arrays: dict[str, Any]) -> bytes:
    """As an .npz archive."""
    held = io.BytesIO()
    # Not compressed, so that the mark can be read in the file.
    np.savez(held, written_by=np.array(MARK.encode()), **arrays)
    return held.getvalue()
