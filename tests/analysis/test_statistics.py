"""Fits, averages, the steady-state test and breakup numbers against known answers and stated odds."""

import numpy as np
import pytest

from mcdem.analysis.breakup import READINGS, breakups, summarise
from mcdem.analysis.statistics import (
    GIVENS,
    find_steady_state,
    fit_mass_size,
    fit_power_law,
    share,
    size_moments,
    time_average,
)


def test_size_moments_of_a_hand_made_population():
    m = size_moments([1, 1, 4], [1e-6, 1e-6, 2e-6])
    assert m.mean_size == 2
    np.testing.assert_allclose(m.size_deviation, 2**0.5)
    np.testing.assert_allclose(m.sauter_diameter, 2 * 10 / 6 * 1e-6)


def test_exact_power_law_is_found_exactly_and_small_clusters_are_left_out():
    length = np.array([1.0, 1.2, 2.0, 3.0, 4.5]) * 500e-9
    sizes = 3.34 * (length / 500e-9) ** 1.68  # the first two, 3.3 and 4.5: one is not above P = 3.5
    for given in GIVENS:
        fit = fit_mass_size(np.append(sizes[1:], [1, 2, 3]), np.append(length[1:], [9, 9, 9]), 500e-9, given)
        np.testing.assert_allclose([fit.exponent, fit.prefactor], [1.68, 3.34], rtol=1e-12)
        assert (fit.points, fit.distinct) == (4, 4)


def test_regressions_of_mass_and_size_differ_by_the_square_of_the_correlation():
    rng = np.random.default_rng(3)
    sizes = rng.integers(5, 25, 200)
    length = (sizes / 3.0) ** (1 / 1.7) * rng.lognormal(0.0, 0.2, 200)
    on_size, on_length = (fit_mass_size(sizes, length, 1.0, given) for given in GIVENS)
    correlation = np.corrcoef(np.log(sizes), np.log(length))[0, 1]
    np.testing.assert_allclose(on_length.exponent, correlation**2 * on_size.exponent, rtol=1e-12)
    centre = np.exp(np.log([sizes, length]).mean(axis=1))  # through which both go
    np.testing.assert_allclose([on_size(centre[1]), on_length(centre[1])], centre[0], rtol=1e-12)


def test_mass_size_limits_cover_the_truth_at_their_stated_rate():
    """As below, for lengths that scatter at given sizes."""
    rng = np.random.default_rng(4)
    covered = np.zeros(2)
    for _ in range(400):
        sizes = rng.integers(4, 40, 60)
        length = (sizes / 3.0) ** (1 / 1.7) * rng.lognormal(0.0, 0.1, 60)
        fit = fit_mass_size(sizes, length, 1.0)
        covered += [fit.exponent_low < 1.7 < fit.exponent_high, fit.prefactor_low < 3.0 < fit.prefactor_high]
    assert (np.abs(covered / 400 - 0.95) < 3 * np.sqrt(0.95 * 0.05 / 400)).all()


def test_power_law_limits_cover_the_truth_at_their_stated_rate():
    """95 % limits of 400 fits: between 92 and 98 % hold the truth (binomial, 3 sigma)."""
    rng = np.random.default_rng(1)
    covered = np.zeros(2)
    for _ in range(400):
        x = rng.uniform(1.5, 6.0, 25)
        y = 3.0 * x**1.7 * rng.lognormal(0.0, 0.2, 25)
        fit = fit_power_law(x, y)
        covered += [
            fit.exponent_low < 1.7 < fit.exponent_high,
            fit.prefactor_low < 3.0 < fit.prefactor_high,
        ]
    assert (np.abs(covered / 400 - 0.95) < 3 * np.sqrt(0.95 * 0.05 / 400)).all()


def test_copies_earn_no_confidence():
    rng = np.random.default_rng(2)
    x = rng.uniform(1, 5, 12)
    y = x**2 * rng.lognormal(0, 0.1, 12)
    once, doubled = fit_power_law(x, y), fit_power_law(np.tile(x, 8), np.tile(y, 8))
    np.testing.assert_allclose(doubled.exponent_low, once.exponent_low, rtol=1e-9)
    np.testing.assert_allclose(doubled.prefactor_high, once.prefactor_high, rtol=1e-9)
    assert (doubled.points, doubled.distinct) == (96, 12)


def test_no_fit_without_three_points():
    assert fit_power_law([1.0, 2.0], [1.0, 2.0]) is None
    assert fit_mass_size([1, 2, 3, 3], [1, 2, 3, 4], 1.0) is None


def test_time_average_weighs_by_time():
    assert time_average([0.0, 1.0, 4.0], [1.0, 5.0, 9.0], 0.0, 4.0).mean == pytest.approx((1 + 3 * 5) / 4)
    assert time_average([0.0, 1.0, 4.0], [1.0, 5.0, 9.0], 2.0, 5.0).mean == pytest.approx((2 * 5 + 9) / 3)


def correlated_series(rng, events, memory, mean, spread):
    """Relaxing noise at irregular times, sampled exactly: an Ornstein-Uhlenbeck process of known mean."""
    t = np.cumsum(rng.exponential(size=events))
    value, values = rng.normal(), []
    for step in np.diff(t, prepend=0.0):
        keep = np.exp(-step / memory)
        value = keep * value + np.sqrt(1 - keep**2) * rng.normal()
        values.append(mean + spread * value)
    return t, np.array(values)


def test_block_error_of_a_correlated_series():
    """Standard error of a mean over T with memory tau is spread sqrt(2 tau/T); the naive one is a fifth of it."""
    rng = np.random.default_rng(3)
    averages = [time_average(*correlated_series(rng, 4000, 12.0, 20.0, 3.0)) for _ in range(60)]
    exact = 3.0 * np.sqrt(2 * 12.0 / 4000)
    assert 0.85 * exact < np.mean([a.error for a in averages]) < 1.4 * exact
    within = np.mean([abs(a.mean - 20.0) < 2 * a.error for a in averages])
    assert within > 0.95 - 3 * np.sqrt(0.95 * 0.05 / 60)


@pytest.mark.parametrize(("memories", "least"), [(5, 0.55), (20, 0.75), (100, 0.85)])
def test_limits_of_short_series_hold_as_often_as_is_said(memories, least):
    """Two errors of 150 series with a memory of a 5th, a 20th, a 100th of their length; 16 blocks held 46 and 79 %."""
    rng = np.random.default_rng(8)
    averages = [time_average(*correlated_series(rng, 600, 600 / memories, 20.0, 3.0)) for _ in range(150)]
    within = np.mean([abs(a.mean - 20.0) < 2 * a.error for a in averages])
    assert least < within < 1.0


def test_a_series_that_never_changed_is_found_steady():
    rng = np.random.default_rng(9)
    found = [find_steady_state(*_named(correlated_series(rng, 1000, 25.0, 20.0, 2.0))) for _ in range(40)]
    assert np.mean([state.reached for state in found]) > 0.9


def _named(series):
    return series[0], {"<P>": series[1]}


def test_steady_state_is_found_after_the_growth_and_nowhere_in_a_ramp():
    rng = np.random.default_rng(4)
    t, noise = correlated_series(rng, 6000, 10.0, 0.0, 1.0)
    grown = 20 * (1 - np.exp(-t / 500)) + noise
    state = find_steady_state(t, {"<P>": grown, "sigma_P": 0.6 * grown})
    assert state.reached and 500 < state.start < 3700

    drifting = {share: 20 * (1 + 2 * share * t / t[-1]) + 1e-3 * noise for share in (0.015, 0.1)}
    assert find_steady_state(
        t, {"<P>": drifting[0.015]}
    ).reached  # halves differ by 1.5 %, from any start by less
    assert not find_steady_state(t, {"<P>": drifting[0.1]}).reached  # by 4 % from the latest start

    ramp = find_steady_state(t, {"<P>": 1 + 20 * t / t[-1] + noise})
    assert not ramp.reached and "still changes" in ramp.reason
    short = find_steady_state(t, {"<P>": grown}, turnovers=np.linspace(0, 9.9, len(t)))
    assert not short.reached and "replaced" in short.reason
    assert find_steady_state(t, {"<P>": grown}, turnovers=np.linspace(0, 40, len(t))).reached
    noisy = find_steady_state(t, {"<P>": 20 + 100 * noise})
    assert not noisy.reached and "% only" in noisy.reason


def test_share_limits():
    p, low, high = share(10, 100)
    assert (p, round(low, 3), round(high, 3)) == (0.1, 0.055, 0.174)  # Wilson's own formula by hand
    assert share(0, 0)[1:] == (0.0, 1.0)


def test_breakups_by_hand():
    outcome = np.array(["missed", "aggregation", "parted", "exchange", "fragmentation", "fragmentation"])
    contact = np.array([False, True, True, True, True, False])
    parents = np.array([[1, 1], [2, 3], [10, 2], [8, 8], [9, 11], [12, 5]])
    products = [[1, 1], [5], [10, 2], [6, 10], [1, 1, 18], [11, 1, 5]]
    origin = [[1, 0], [2], [10, 0], [5, 3], [1, 0, 8], [11, 1, 0]]
    broken = breakups(
        outcome,
        contact,
        parents,
        np.array([len(p) for p in products]),
        np.concatenate(products),
        np.concatenate(origin),
    )
    together, alone = broken.isel(breakup=~broken["by_itself"]), broken.isel(breakup=broken["by_itself"])
    assert together["parent_size"].values.tolist() == [12, 16, 20, 12]  # the last split beside a bystander
    assert together["fragments"].values.tolist() == [2, 2, 3, 2]
    np.testing.assert_allclose(together["largest_fragment"], [10 / 12, 10 / 16, 0.9, 11 / 12])
    # 8 = 5 + 3 on both sides of the exchange, 9 = 1 + 8 and 11 = 1 + 10, and the split again
    assert alone["event"].values.tolist() == [3, 3, 4, 4, 5]
    assert alone["parent_size"].values.tolist() == [8, 8, 9, 11, 12]
    np.testing.assert_allclose(alone["largest_fragment"], [5 / 8, 7 / 8, 8 / 9, 10 / 11, 11 / 12])
    paper, strict, own = (summarise(broken, reading) for reading in READINGS)
    assert (own["breakups"], own["P_br"], own["erosion_share"]) == (5, 9.6, 0.4)
    assert (paper["breakups"], strict["breakups"]) == (4, 3)
    assert (paper["P_br"], strict["P_br"]) == (15, 16)
    assert (paper["erosion_share"], strict["erosion_share"]) == (0.5, pytest.approx(2 / 3))
    assert paper["two_fragments"] == 0.75
    assert np.isnan(summarise(broken.isel(breakup=[]), "paper")["P_br"])
