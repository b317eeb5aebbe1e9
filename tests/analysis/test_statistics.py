"""Fits, averages, the steady-state test and breakup numbers against known answers and stated odds."""

import numpy as np
import pytest
from scipy import signal, stats

from mcdem.analysis.breakup import CONVENTIONS, breakups, summarise
from mcdem.analysis.statistics import (
    GIVENS,
    OF_MEANS,
    count_limits,
    find_steady_state,
    fit_mass_size,
    fit_power_law,
    mean_limits,
    origins_of,
    share,
    share_of_origins,
    shares,
    size_moments,
    time_average,
    why_no_fit,
)


def test_size_moments_of_a_hand_made_population():
    m = size_moments([1, 1, 4], [1e-6, 1e-6, 2e-6])
    assert m.mean_size == 2
    np.testing.assert_allclose(m.size_deviation, 2**0.5)
    np.testing.assert_allclose(m.sauter_diameter, 2 * 10 / 6 * 1e-6)


def test_exact_power_law_is_found_exactly_and_small_clusters_are_left_out():
    length = np.array([1.0, *np.geomspace(1.2, 4.5, 10)]) * 500e-9
    sizes = 3.34 * (length / 500e-9) ** 1.68  # the first, 3.3, is not above P = 3.5
    for given in GIVENS:
        fit = fit_mass_size(np.append(sizes, [1, 2, 3]), np.append(length, [9, 9, 9]), 500e-9, given)
        np.testing.assert_allclose([fit.exponent, fit.prefactor], [1.68, 3.34], rtol=1e-12)
        assert (fit.points, fit.origins, fit.sizes) == (10, 10, 10)
        assert fit.decades == pytest.approx(1.68 * np.log10(4.5 / 1.2))
        assert fit.rests_on == "10 of 10 sizes over 0.96 decades"


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
    assert (doubled.points, doubled.origins) == (96, 12)


@pytest.mark.parametrize("origins", [12, 40])
def test_limits_by_origin_hold_where_those_by_point_do_not(origins):
    """Each origin seen one to eight times with small changes since, as after doublings; 200 repeats."""
    rng = np.random.default_rng(5)
    covered = np.zeros(3)
    for _ in range(200):
        label = np.repeat(np.arange(origins), rng.integers(1, 9, origins))
        x = rng.uniform(1.5, 6.0, origins)
        y = 3.0 * x**1.7 * rng.lognormal(0.0, 0.2, origins)
        seen = [values[label] * rng.lognormal(0.0, 0.01, len(label)) for values in (x, y)]
        fit, naive = fit_power_law(*seen, origin=label), fit_power_law(*seen)
        covered += [
            fit.exponent_low < 1.7 < fit.exponent_high,
            fit.prefactor_low < 3.0 < fit.prefactor_high,
            naive.exponent_low < 1.7 < naive.exponent_high,
        ]
    assert ((covered[:2] / 200 >= 0.92) & (covered[:2] / 200 <= 0.97)).all()
    assert covered[2] / 200 < 0.8


def test_origins_are_recognised_by_what_copies_keep():
    size, gyration = np.array([5, 5, 5, 6, 1, 1]), np.array([1.5, 1.5002, 1.6, 1.5, 1.0, 1.0])
    label = origins_of(size, [9, 9, 9, 12, 0, 0], gyration)
    alike = label[:, None] == label
    assert np.argwhere(np.triu(alike, 1)).tolist() == [[0, 1], [4, 5]]
    portion, low, high, count = share_of_origins([True, True, False, False, False, True], [1, 1, 2, 3, 0, 0])
    assert (portion, count) == (0.5, 4)
    assert (low, high) == share(2, 4)[1:]


@pytest.mark.parametrize(
    ("x", "words"),
    [
        (np.repeat([4.0, 9.0], 20), "40 of 2 sizes over 0.35 decades"),
        (np.arange(4.0, 13.0), "9 of 9 sizes"),
        (np.linspace(5.0, 9.0, 30), "over 0.26 decades"),
        ([], "0 of 0 sizes"),
    ],
)
def test_no_exponent_without_the_stated_minimum(x, words):
    """Two sizes, nine aggregates, less than a factor of two."""
    x = np.asarray(x)
    y = x**0.5 * np.random.default_rng(0).lognormal(0.0, 0.1, len(x))
    assert fit_power_law(x, y) is None
    assert words in why_no_fit(x) and "at least 10, 4 and 0.3" in why_no_fit(x)
    assert why_no_fit(np.linspace(4.0, 9.0, 30)) == ""


def test_no_fit_through_two_means():
    assert fit_power_law([1.0, 2.0], [1.0, 2.0], minimum=OF_MEANS) is None
    assert fit_power_law([1.0, 2.0, 4.0], [1.0, 2.0, 4.0], minimum=OF_MEANS).exponent == pytest.approx(1.0)
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


def ornstein_uhlenbeck(rng, series, memories, points=1000):
    """(series, points) of zero mean and unit scatter at equal times, sampled exactly; `memories` fit into the length."""
    keep = np.exp(-memories / points)
    noise = rng.normal(size=(series, points + 1))
    noise[:, 1:] *= np.sqrt(1 - keep**2)
    return signal.lfilter([1.0], [1.0, -keep], noise, axis=1)[:, 1:]


@pytest.mark.parametrize("memories", [15, 20, 30])
def test_limits_of_time_averages_hold_at_their_stated_rate(memories):
    """1000 series with a memory of a 15th, 20th, 30th of their length."""
    rng = np.random.default_rng(8)
    t = np.linspace(0.0, 100.0, 1001)
    averages = [time_average(t, np.append(x, 0.0)) for x in ornstein_uhlenbeck(rng, 1000, memories)]
    within = np.mean([abs(a.mean) < 2 * a.error for a in averages])
    assert 0.92 <= within <= 0.97


def test_limits_of_series_shorter_than_they_should_be_are_known_to_fail():
    rng = np.random.default_rng(8)
    t = np.linspace(0.0, 100.0, 1001)
    averages = [time_average(t, np.append(x, 0.0)) for x in ornstein_uhlenbeck(rng, 400, 5)]
    assert 0.80 < np.mean([abs(a.mean) < 2 * a.error for a in averages]) < 0.90


def test_block_error_of_a_correlated_series():
    """Standard error of a mean over T with memory tau is spread sqrt(2 tau/T), at irregular times as well."""
    rng = np.random.default_rng(3)
    averages = [time_average(*correlated_series(rng, 4000, 12.0, 20.0, 3.0)) for _ in range(60)]
    exact = 3.0 * np.sqrt(2 * 12.0 / 4000)
    # Student's t of four blocks, halved, over the standard error: 1.59 and by the wider of two a little more
    assert 1.3 * exact < np.median([a.error for a in averages]) < 1.9 * exact
    assert np.mean([abs(a.mean - 20.0) < 2 * a.error for a in averages]) > 0.95 - 3 * np.sqrt(
        0.95 * 0.05 / 60
    )


def test_averages_of_nothing_have_no_error_of_nought():
    empty, gone = time_average([], []), time_average([0.0, 1.0, 2.0], [1.0, np.nan, 1.0])
    assert np.isnan([empty.mean, empty.error, gone.mean, gone.error]).all()
    assert time_average([1.0], [5.0]).error == np.inf
    assert not find_steady_state([], {"⟨P⟩": []}).reached
    for values in ([5.0], [5.0, np.nan, 5.0], [np.nan] * 3):
        state = find_steady_state(np.arange(len(values), dtype=float), {"⟨P⟩": values})
        assert not state.reached and state.reason


# The steady-state test: stated size and power.  Series of length 100 and level 10.

TIME = np.linspace(0.0, 100.0, 1001)
PASSED = TIME / 100.0
UNSTEADY = {
    "a jump by half at 70 %": 0.5 * (PASSED > 0.7),
    "a jump by half at 90 %": 0.5 * (PASSED > 0.9),
    "a jump down by a third at 80 %": -0.33 * (PASSED > 0.8),
    "a drift by half": 0.5 * PASSED,
    "a drift down by half": -0.5 * PASSED,
    "a slow wave of 15 %": 0.15 * np.sin(5.0 * np.pi * PASSED),
    "growth that goes on": 1.0 - np.exp(-PASSED),
}
STEADY = {
    "nothing": 0.0 * PASSED,
    "a jump by half at 30 %": 0.5 * (PASSED > 0.3),
    "growth in a tenth": 1.0 - np.exp(-PASSED / 0.1),
}


def called_steady(shape, memories, scatter, series=60, seed=11):
    """Share of noisy series of a shape that the test calls steady."""
    noise = ornstein_uhlenbeck(np.random.default_rng(seed), series, memories, len(TIME))
    return np.mean([find_steady_state(TIME, {"x": 10 * (1 + shape + scatter * x)}).reached for x in noise])


@pytest.mark.parametrize(("memories", "scatter"), [(50, 0.05), (10, 0.20)])
@pytest.mark.parametrize("shape", UNSTEADY)
def test_what_changes_is_not_called_steady(shape, memories, scatter):
    """The memory of <P> in our runs (a 50th or so), and a short noisy series: a power of 0.9 and more (0.93 to 1 seen)."""
    assert called_steady(UNSTEADY[shape], memories, scatter) <= 0.10


@pytest.mark.parametrize("shape", STEADY)
def test_what_is_steady_is_called_so(shape):
    assert called_steady(STEADY[shape], 50, 0.03) >= 0.95


def test_a_drift_just_beyond_what_is_tolerated_is_seen_where_noise_allows():
    """2 % between the halves is called no change; 4 % is one if the noise is small, and is ruled out as 10 % in any case."""
    rng = np.random.default_rng(4)
    t, noise = correlated_series(rng, 6000, 10.0, 0.0, 1.0)
    drift = {share: 20 * (1 + 2 * share * t / t[-1]) + 1e-3 * noise for share in (0.015, 0.1)}
    assert find_steady_state(t, {"x": drift[0.015]}).reached  # halves differ by 1.5 %, from any start by less
    assert not find_steady_state(t, {"x": drift[0.1]}).reached  # by 4 % from the latest start
    noisy = find_steady_state(t, {"x": 20 + 100 * noise})
    assert not noisy.reached and "must be ruled out" in noisy.reason


def test_steady_state_is_found_after_the_growth_and_nowhere_in_a_ramp():
    rng = np.random.default_rng(4)
    t, noise = correlated_series(rng, 6000, 10.0, 0.0, 1.0)
    grown = 20 * (1 - np.exp(-t / 500)) + noise
    state = find_steady_state(t, {"⟨P⟩": grown, "σ_P": 0.6 * grown})
    assert state.reached and 500 < state.start < 3700
    ramp = find_steady_state(t, {"⟨P⟩": 1 + 20 * t / t[-1] + noise})
    assert not ramp.reached and "still changes" in ramp.reason
    short = find_steady_state(t, {"⟨P⟩": grown}, turnovers=np.linspace(0, 9.9, len(t)))
    assert not short.reached and "replaced" in short.reason
    assert find_steady_state(t, {"⟨P⟩": grown}, turnovers=np.linspace(0, 40, len(t))).reached


def test_a_series_may_have_a_bound_of_its_own():
    wide = {"σ_P": 10 * (1 + 0.11 * ornstein_uhlenbeck(np.random.default_rng(0), 1, 200, len(TIME))[0])}
    assert not find_steady_state(TIME, wide, largest_change={"σ_P": 0.02}).reached
    assert find_steady_state(TIME, wide, largest_change={"σ_P": 0.20}).reached


def test_share_limits():
    p, low, high = share(10, 100)
    assert (p, round(low, 3), round(high, 3)) == (0.1, 0.055, 0.174)  # Wilson's own formula by hand
    assert share(0, 0)[1:] == (0.0, 1.0)
    for hits, count in ((0, 12), (1, 12), (12, 12), (7, 300)):
        known = stats.binomtest(hits, count).proportion_ci(0.95, method="wilson")
        np.testing.assert_allclose(share(hits, count)[1:], [known.low, known.high], atol=1e-12)


@pytest.mark.parametrize(("truth", "count"), [(0.3, 50), (0.02, 400), (0.9, 60)])
def test_limits_of_shares_and_counts_hold_at_their_stated_rate(truth, count):
    """1000 repeats, drawn evenly; Poisson limits are exact and so hold a little more often than they say."""
    hits = stats.binom.ppf((np.arange(1000) + 0.5) / 1000, count, truth)
    _, low, high = shares(hits, count)
    assert 0.92 <= np.mean((low <= truth) & (truth <= high)) <= 0.97
    seen = stats.poisson.ppf((np.arange(1000) + 0.5) / 1000, truth * count)
    low, high = count_limits(seen)
    assert 0.95 <= np.mean((low <= truth * count) & (truth * count <= high)) <= 0.985


def test_no_event_is_not_no_error():
    assert share(0, 12)[2] == pytest.approx(0.242, abs=1e-3)
    low, high = count_limits([0, 1, 100])
    np.testing.assert_allclose(low, [0.0, 0.0253, 81.36], atol=5e-3)  # Garwood's table
    np.testing.assert_allclose(high, [3.689, 5.572, 121.63], atol=5e-3)
    assert mean_limits([5.0]) == (5.0, np.inf)
    assert np.isnan(mean_limits([])).all()


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
    paper, strict, own = (summarise(broken, convention) for convention in CONVENTIONS)
    assert (own["breakups"], own["P_br"], own["erosion_share"]) == (5, 9.6, 0.4)
    assert (paper["breakups"], strict["breakups"]) == (4, 3)
    assert (paper["P_br"], strict["P_br"]) == (15, 16)
    assert (paper["erosion_share"], strict["erosion_share"]) == (0.5, pytest.approx(2 / 3))
    assert paper["two_fragments"] == 0.75
    assert np.isnan(summarise(broken.isel(breakup=[]), "paper")["P_br"])
    single = summarise(broken.isel(breakup=[0]), "paper")
    assert single["P_br"] == 12 and single["P_br_error"] == np.inf and np.isnan(single["P_br_deviation"])
    assert single["two_fragments_low"] < 0.25  # one of one
