"""Restructuring as relaxation of shape: a known law is recovered with its limits, and what was not seen is refused."""

from __future__ import annotations

import numpy as np
import pytest
from pbe_synthetic import RADIUS, SHEAR_RATE, design

from pbekit import KernelTable, PBEError
from pbekit.study import shape_relaxation
from pbekit.study.shape_relaxation import FEWEST
from pbekit.study.size_rates import size_rates

LARGEST, KAPPA, REST, SPREAD = 12, 0.15, 2.2, 0.05
PHI = 0.01 * 4 / 3 * np.pi * RADIUS**3


def rates_with(seed: int, count: int, kappa: float = KAPPA):
    """Rates of encounters whose survivors' shapes follow the law."""
    rng = np.random.default_rng(seed)
    records = design(rng, count, LARGEST, pieces=3)
    x = np.where(records.size > 2, np.exp(rng.normal(np.log(1.8), 0.3, records.size.shape)), 1.0)
    products = np.exp(rng.normal(np.log(1.8), 0.3, records.product_size.shape))
    event, side = np.nonzero(records.survivors >= 0)
    log_x = np.log(x[event, side])
    products[records.survivors[event, side]] = np.exp(
        log_x - kappa * (log_x - np.log(REST)) + SPREAD * rng.normal(size=event.size)
    )
    products = np.where(records.product_size > 2, products, 1.0)
    table = KernelTable.of(
        records._with({"aspect_ratio": x, "product_aspect_ratio": products}),
        RADIUS,
        SHEAR_RATE,
        size_edges=np.arange(1, LARGEST + 2),
        shapes=1,
        about={"volume_fraction": PHI},
    )
    return size_rates(
        table, draws=19, exact_to=LARGEST, largest=LARGEST, population=np.exp(-np.arange(LARGEST) / 4)
    )


def test_a_known_relaxation_is_found_as_often_as_the_limits_say():
    """Classes 3 to 12 of six tables, 60 in all: 0.9 +- 0.04 of the limits hold kappa, and of the shapes x_r."""
    inside = {"kappa": [], "rest": []}
    for seed in range(6):
        found = shape_relaxation(rates_with(seed, 4000))
        seen = found.survivors >= FEWEST
        assert seen.all() and found.spread == pytest.approx(SPREAD, rel=0.2)
        for name, limits, known in (
            ("kappa", found.kappa, KAPPA),
            ("rest", found.resting_shape, REST),
        ):
            inside[name] += list((limits.low <= known) & (known <= limits.high))
    for name, held in inside.items():
        assert len(held) == 60 and 0.78 <= np.mean(held) <= 1.0, (name, np.mean(held))


def test_the_rate_is_that_of_the_encounters_that_are_survived():
    """M from the rates of the table, once more, and proportional to the volume fraction."""
    rates = rates_with(1, 3000)
    found = shape_relaxation(rates)
    survive = 1 - rates.efficiency.value - rates.breakup.value
    wanted = (rates.encounter_rate.value * survive) @ rates.first_order.population
    np.testing.assert_allclose(found.surviving, wanted[2:], rtol=1e-12)
    np.testing.assert_allclose(found.rate.value, found.surviving * found.kappa.value, rtol=1e-12)
    rate, rest = found.of(7)
    assert rate == found.rate.value[4] and rest == found.resting_shape.value[4]


def test_what_was_not_seen_is_refused():
    found = shape_relaxation(rates_with(2, 3000))
    for size in (2, LARGEST + 1):
        with pytest.raises(PBEError, match="survivors of known shape"):
            found.of(size)
    # Shapes that spread have no resting one.
    spreading = shape_relaxation(rates_with(3, 3000, kappa=-0.2))
    assert np.all(spreading.kappa.value < 0)
    with pytest.raises(PBEError, match="do not draw these"):
        spreading.of(7)
    with pytest.raises(PBEError, match=f"{FEWEST} survivors"):
        shape_relaxation(rates_with(4, 200))
