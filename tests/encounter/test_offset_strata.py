"""Offsets by strata: the flux comes out again, estimates have no bias, intervals cover."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest

from mcdem.encounter.offset_strata import (
    SHARE,
    SHORTEST,
    STRATA,
    U_EDGES,
    V_EDGES,
    Tally,
    allotted,
    draw_in,
    estimate,
    round_length,
    weights,
)

FIELDS = {
    "core": lambda u, v: 0.35 * np.exp(-((u / 0.03) ** 2)) * np.cos(0.5 * np.pi * v) ** 2,
    "all in a critical offset": lambda u, v: 1.0 * (u < 0.1 * (1.0 - v * v)),
    "core and far tail": lambda u, v: 0.3 * (u < 0.02) * (v < 0.7) + 1e-3,
    "the same everywhere": lambda u, v: 0.01 + 0.0 * u,
}
"""Known probabilities over the unit square, on which area is flux."""


def mean_over_flux(field):
    nodes = (np.arange(2000) + 0.5) / 2000
    u, v = np.meshgrid(nodes**3, nodes)
    return float((field(u, v) * 3.0 * nodes**2).mean())


def sampled_round(field, rounds, length, rng):
    """A round of encounters of a known field; work is as between aggregates, more at small u and for hits."""
    stratum = np.repeat(np.arange(STRATA), allotted(rounds, length))
    k, m = np.divmod(stratum, V_EDGES.size - 1)
    u = U_EDGES[k] + np.diff(U_EDGES)[k] * rng.random(length)
    v = V_EDGES[m] + np.diff(V_EDGES)[m] * rng.random(length)
    hit = rng.random(length) < field(u, v)
    work = 10.0 + 200.0 * np.exp(-20.0 * u) + 1000.0 * hit
    return Tally.of(stratum, hit, np.zeros(length, bool), work)


def until(field, error, seed):
    rng, rounds, done = np.random.default_rng(seed), [], 0
    while not rounds or estimate(rounds).relative > error:
        rounds.append(sampled_round(field, rounds, round_length(done), rng))
        done += int(rounds[-1].trials.sum())
    return estimate(rounds)


def test_strata_in_proportion_to_their_flux_are_the_flux():
    """20000 offsets: y and x by Kolmogorov & Smirnov at 1e-4 against their laws inside the circle."""
    assert SHARE.sum() == pytest.approx(1.0, abs=1e-14)
    rng = np.random.default_rng(1)
    drawn = rng.choice(STRATA, 20000, p=SHARE)
    x, y = np.array([draw_in(int(h), 1.0, rng) for h in drawn]).T
    assert (x**2 + y**2 < 1.0).all() and (y > 0.0).all()
    assert kstest(y, lambda y: 1.0 - (1.0 - y * y) ** 1.5).pvalue > 1e-4
    # The chord at x leaves 3/4 (1 - x^2).
    assert kstest(x, lambda x: 0.5 + 0.75 * (x - x**3 / 3.0)).pvalue > 1e-4


def test_an_offset_is_in_its_stratum():
    rng = np.random.default_rng(2)
    for h in range(STRATA):
        x, y = draw_in(h, 3.0, rng)
        rest = np.sqrt(1.0 - (y / 3.0) ** 2)
        k, m = divmod(h, V_EDGES.size - 1)
        assert U_EDGES[k] - 1e-7 <= 1.0 - rest**3 <= U_EDGES[k + 1] + 1e-7
        assert V_EDGES[m] - 1e-7 <= abs(x / 3.0) / rest <= V_EDGES[m + 1] + 1e-7


def test_every_round_visits_every_stratum_and_weights_are_one_in_the_mean():
    rng, rounds = np.random.default_rng(3), []
    for _ in range(4):
        trials = allotted(rounds, SHORTEST)
        assert trials.sum() == SHORTEST and trials.min() >= 1
        assert (weights(trials) * trials).sum() == pytest.approx(SHORTEST, rel=1e-12)
        rounds.append(sampled_round(FIELDS["core"], rounds, SHORTEST, rng))


@pytest.mark.parametrize("name", FIELDS)
def test_three_adaptive_rounds_have_no_bias(name):
    """600 repeats: their mean is within four of its standard errors of the truth."""
    truth, found = mean_over_flux(FIELDS[name]), []
    for seed in range(600):
        rng, rounds = np.random.default_rng(10_000 + seed), []
        for _ in range(3):
            rounds.append(sampled_round(FIELDS[name], rounds, SHORTEST, rng))
        found.append(estimate(rounds).value)
    assert abs(np.mean(found) - truth) < 4.0 * np.std(found) / np.sqrt(len(found))


@pytest.mark.parametrize("name", FIELDS)
def test_intervals_cover_when_the_error_is_reached(name):
    """200 repeats to 5 %: 95 % intervals hold the truth in 0.92 to 0.97 of them, and the spread is the error that is stated."""
    truth = mean_over_flux(FIELDS[name])
    found = [until(FIELDS[name], 0.05, seed) for seed in range(200)]
    assert 0.92 <= np.mean([one.low <= truth <= one.high for one in found]) <= 0.97
    spread = np.std([one.value for one in found])
    assert spread == pytest.approx(np.mean([one.deviation for one in found]), rel=0.2)


def test_unresolved_encounters_are_left_out():
    """A tenth lost everywhere: the probability is that among the others."""
    trials = np.full(STRATA, 100)
    one = Tally(trials, np.full(STRATA, 9), np.full(STRATA, 10), trials.astype(float))
    assert estimate([one]).value == pytest.approx(0.1) and estimate([one]).unresolved == pytest.approx(0.1)


def test_nothing_hit_is_no_certainty():
    trials = np.full(STRATA, 100)
    found = estimate([Tally(trials, 0 * trials, 0 * trials, trials.astype(float))])
    assert found.value == found.low == 0.0 < found.high and found.relative == np.inf
