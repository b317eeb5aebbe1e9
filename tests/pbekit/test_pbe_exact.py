"""Every exact solution, discrete ones on the grid of whole primaries, continuous ones with their order."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from pbekit import (
    Aggregation,
    Breakage,
    Grid,
    KernelError,
    PopulationBalance,
    TwoComponentGrid,
    exact,
    integrate,
    moments,
)
from pbekit.balance.breakage import PowerLawRate, Uniform
from pbekit.balance.kernels import Constant, Product, ShearEncounter, Sum, exponential_below

DISCRETE = 1e-8
TIGHT = dict(method="DOP853", rtol=1e-11, atol=1e-16)


# -- whole primaries ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kernel", [Constant(1.3), Sum(0.7), Product(0.9)], ids=lambda k: k.name)
def test_aggregation_from_monomers(kernel):
    grid, time, number = Grid.primaries(100), 0.35, 1.4  # nothing has reached the last size by then
    balance = PopulationBalance(grid, [Aggregation(kernel)])
    found = integrate(balance, grid.monodisperse(number), [0, time], **TIGHT)[-1, : grid.cells]
    np.testing.assert_allclose(found, kernel.exact_discrete(grid.pivots, time, number), atol=DISCRETE, rtol=0)


def test_product_kernel_refuses_the_gel():
    with pytest.raises(KernelError, match="gel point"):
        Product(1.0).exact_discrete(np.arange(1, 4), 1.0, 1.0)


@pytest.mark.parametrize("time", [0.05, 0.5, 3.0])
def test_chain_scission(time):
    length, number, rate = 30, 2.0, 0.8
    grid = Grid.primaries(length)
    balance = PopulationBalance(grid, [Breakage(PowerLawRate(rate, 1, offset=1), Uniform())])
    found = integrate(balance, grid.monodisperse(number, length), [0, time], **TIGHT)[-1, :length]
    np.testing.assert_allclose(
        found, exact.chain_scission(grid.pivots, time, number, length, rate), atol=DISCRETE, rtol=0
    )


@pytest.mark.parametrize("time", [0.3, 2.0, 40.0])
def test_chains_that_bond_and_break(time):
    """Blatz & Tobolsky: transient and steady state."""
    number, rate, bond = 1.0, 2.0, 0.3
    grid = Grid.primaries(60)
    events = [Aggregation(Constant(rate)), Breakage(PowerLawRate(bond, 1, offset=1), Uniform())]
    balance = PopulationBalance(grid, events, edge="closed")
    found = integrate(balance, grid.monodisperse(number), [0, time], **TIGHT)[-1, :60]
    np.testing.assert_allclose(
        found, exact.chain_bonding(grid.pivots, time, number, rate, bond), atol=DISCRETE, rtol=0
    )


def test_two_components_of_whole_primaries():
    number, rate, share, time = 1.0, 1.0, 0.3, 0.8
    grid = TwoComponentGrid.primaries(14, 14)
    balance = PopulationBalance(grid, [Aggregation(Constant(rate))])
    a, b = grid.masses.T
    start = number * (share * ((a == 1) & (b == 0)) + (1 - share) * ((a == 0) & (b == 1)))
    found = integrate(balance, start, [0, time], **TIGHT)[-1, : grid.cells]
    wanted = exact.two_component_constant(a, b, time, number, rate, share)
    np.testing.assert_allclose(found, wanted, atol=DISCRETE, rtol=0)


def test_shapes_drawn_at_random_follow_the_sizes():
    """n(P, s) = n_P q(s | P) when every product draws its shape anew, here with a q that varies with size."""
    grid = Grid.primaries(40).with_shapes([1, 1.5, 2, 4])
    weight = np.stack([1 / grid.mass, np.ones(grid.cells), 0.02 * grid.mass])
    share = np.where(grid.shape_of_cell < 0, 1.0, weight[grid.shape_of_cell, np.arange(grid.cells)])
    share /= np.bincount(grid.size_of_cell, share)[grid.size_of_cell]
    number, rate, bond, time = 1.0, 1.5, 0.4, 1.0
    events = [
        Aggregation(Constant(rate), shape=share),
        Breakage(PowerLawRate(bond, 1, offset=1), Uniform(), shape=share),
    ]
    balance = PopulationBalance(grid, events)
    found = integrate(balance, grid.monodisperse(number), [0, time], **TIGHT)[-1, : grid.cells]
    sizes = exact.chain_bonding(grid.mass, time, number, rate, bond)
    np.testing.assert_allclose(found, sizes * share, atol=DISCRETE, rtol=0)


# -- continuous volumes: orders of convergence and errors of the second moment ------------------------------------


def _errors(events, start, time, wanted, wanted_second, scheme, ratios, span=(1e-4, 1e3)):
    """L1 error of the numbers in a common set of bins, and relative error of M2, on finer and finer grids."""
    l1, m2 = [], []
    for ratio in ratios:
        grid = Grid.geometric(*span, ratio)
        balance = PopulationBalance(grid, events(), scheme)
        population = grid.from_cumulative(*start, scheme)
        state = integrate(balance, population, [0, time], rtol=1e-9, atol=1e-14)[-1]
        found = state[: grid.cells]
        exact_cells = np.diff(wanted(grid.edges))
        l1.append(np.abs(found - exact_cells).sum() / exact_cells.sum())
        m2.append((found @ grid.pivots**2) / wanted_second - 1)
        assert abs(state @ balance.conserved / (population @ grid.masses) - 1).max() < 1e-12
    return np.array(l1), np.array(m2)


RATIOS = 2 ** np.array([1.0, 0.5, 0.25])
FINER = 2 ** np.array([0.25, 0.125, 0.0625])


def check_law(errors, ratios, factor, order):
    """The declared law: |M2 error| <= factor h^order with h = ln(ratio) on every grid; numbers second order in L1."""
    l1, m2 = errors
    assert np.all(np.abs(m2) <= factor * np.log(ratios) ** order), m2
    assert np.log2(l1[0] / l1[-1]) / 2 > 1.7, l1


# Declared laws of the second moment, (factor, order) of h = ln(ratio).  The cell average changes sides between grids
# (its kinks), so its error is an envelope, not a clean power.


@pytest.mark.parametrize(
    "scheme, law",
    [("fixed pivot", (0.42, 2.0)), ("cell average", (0.12, 2.0)), ("three pivots", (0.02, 3.0))],
)
def test_constant_kernel_from_an_exponential(scheme, law):
    kernel, time = Constant(1.0), 4.0
    below = kernel.exact_cumulative(time, 1.0, 1.0)
    now = 1 / (1 + 0.5 * time)
    errors = _errors(
        lambda: [Aggregation(kernel)], exponential_below(1, 1), time, below[0], 2 / now, scheme, RATIOS
    )
    check_law(errors, RATIOS, *law)


@pytest.mark.parametrize(
    "scheme, ratios, law", [("fixed pivot", RATIOS, (2.1, 2.0)), ("cell average", FINER, (0.16, 1.6))]
)
def test_golovin(scheme, ratios, law):
    kernel, time = Sum(1.0), 1.0
    moment = kernel.exact_moments(time, 1.0, 1.0)

    def wanted(edges):
        fine = np.concatenate([np.linspace(a, b, 40, endpoint=False) for a, b in itertools.pairwise(edges)])
        fine = np.append(fine, edges[-1])
        density = kernel.exact_density(fine, time, 1.0, 1.0)
        steps = 0.5 * (density[1:] + density[:-1]) * np.diff(fine)
        return np.concatenate([[0], np.cumsum(steps)])[::40]

    errors = _errors(
        lambda: [Aggregation(kernel)], exponential_below(1, 1), time, wanted, moment[2], scheme, ratios
    )
    check_law(errors, ratios, *law)


@pytest.mark.parametrize(
    "scheme, law",
    [("fixed pivot", (0.18, 2.0)), ("cell average", (0.07, 2.0)), ("three pivots", (0.02, 3.0))],
)
def test_random_scission(scheme, law):
    """Ziff & McGrady: S = s v, b = 2/u."""
    time, rate = 3.0, 1.0

    def wanted(edges):
        return exact.random_scission(edges, time, 1.0, 1.0, rate)[0]

    events = lambda: [Breakage(PowerLawRate(rate), Uniform())]
    errors = _errors(events, exponential_below(1, 1), time, wanted, 2 / (1 + rate * time), scheme, RATIOS)
    check_law(errors, RATIOS, *law)


@pytest.mark.parametrize(
    "scheme, law",
    [("fixed pivot", (0.35, 2.0)), ("cell average", (0.07, 2.0)), ("three pivots", (0.02, 3.0))],
)
def test_aggregation_against_random_scission(scheme, law):
    time, rate, breakage = 2.0, 1.0, 0.2
    number = exact.aggregation_with_random_scission(time, 1.0, 1.0, rate, breakage)
    below = exponential_below(number, 1 / number)
    events = lambda: [Aggregation(Constant(rate)), Breakage(PowerLawRate(breakage), Uniform())]
    errors = _errors(events, exponential_below(1, 1), time, below[0], 2 / number, scheme, RATIOS)
    check_law(errors, RATIOS, *law)


def third_moments():
    """(kernel, time, M2, M3) from an exponential of number and mean one: by the ordinary equations that moments obey."""
    grown = np.exp(0.8)
    return [
        # dM0/dt = -M0^2/2: an exponential of number 1/3 and mean 3.
        (Constant(1.0), 4.0, 6.0, 54.0),
        # dM3/dt = 3 (M1 M3 + M2^2) with M2 = 2 exp(2 t).
        (Sum(1.0), 0.8, 2 * grown**2, grown**3 * (6 + 12 * (grown - 1))),
        # dM2/dt = M2^2, dM3/dt = 3 M2 M3; gels at t = 1/2.
        (Product(1.0), 0.25, 4.0, 48.0),
    ]


@pytest.mark.parametrize("case", third_moments(), ids=lambda case: case[0].name)
def test_three_pivots_keep_the_second_moment_of_kernels(case):
    """It is no matter of the grid for kernels whose moments close; the third moment falls with the third order of the width."""
    kernel, time, second, third = case
    errors = []
    # What the steep end of an exponential leaves: in the second moment of the start, and below zero.
    for ratio, start_error, below_zero in (
        (2**0.5, 3e-4, 1e-3),
        (2**0.25, 3e-7, 1e-5),
        (2**0.125, 1e-8, 1e-12),
    ):
        grid = Grid.geometric(1e-4, 1e3, ratio)
        balance = PopulationBalance(grid, [Aggregation(kernel)], "three pivots")
        start = grid.from_cumulative(*exponential_below(1, 1), "three pivots")
        n = integrate(balance, start, [0, time], rtol=1e-9, atol=1e-14)[-1, : grid.cells]
        assert n @ grid.pivots**2 == pytest.approx(second, rel=start_error)
        assert np.minimum(n, 0) @ grid.pivots**3 > -below_zero * third
        errors.append(abs(n @ grid.pivots**3 / third - 1))
    assert np.log2(errors[0] / errors[2]) / 2 > 2.4, errors


SHEAR = lambda i, j: (i ** (1 / 3) + j ** (1 / 3)) ** 3
BROWNIAN = lambda i, j: (i ** (1 / 3) + j ** (1 / 3)) * (i ** (-1 / 3) + j ** (-1 / 3))


@pytest.mark.parametrize("kernel", [SHEAR, BROWNIAN], ids=["shear", "Brownian"])
def test_three_pivots_on_kernels_without_a_solution(kernel):
    """Second moments of ever finer grids approach each other with at least the order 2.5, and closer than on two pivots."""
    found = {}
    for scheme in ("fixed pivot", "three pivots"):
        second = []
        for ratio in 2 ** np.array([0.5, 0.25, 0.125]):
            grid = Grid.geometric(1e-4, 1e3, ratio)
            balance = PopulationBalance(grid, [Aggregation(kernel)], scheme)
            start = grid.from_cumulative(*exponential_below(1, 1), scheme)
            n = integrate(balance, start, [0, 0.4], rtol=1e-10, atol=1e-15)[-1, : grid.cells]
            second.append(n @ grid.pivots**2)
        found[scheme] = np.abs(np.diff(second)) / second[-1]
    assert np.log2(found["three pivots"][0] / found["three pivots"][1]) > 2.5, found
    assert found["three pivots"][1] < 0.1 * found["fixed pivot"][1], found


def test_gelbard_seinfeld_two_components():
    """Second order in the mixed and second moments; number and both masses exact."""
    rate, time, means = 1.0, 2.0, (1.0, 2.0)
    t = 0.5 * rate * time
    errors = []
    for ratio in (2.0, 2**0.5):
        axis = np.concatenate([[0.0], Grid.geometric(0.02, 150, ratio).pivots])
        grid = TwoComponentGrid(axis, axis)
        balance = PopulationBalance(grid, [Aggregation(Constant(rate))])
        marginals = [_hat_integrals(axis, mean) for mean in means]
        start = np.outer(*marginals).ravel()
        state = integrate(balance, start, [0, time], rtol=1e-9, atol=1e-13)[-1]
        x, y = grid.masses.T
        n = state[: grid.cells]
        # Up to what the fixed pivot's own spreading carries past the last pivot.
        assert abs(n.sum() / (start.sum() / (1 + t)) - 1) < 1e-5
        np.testing.assert_allclose(state @ balance.conserved, start @ grid.masses, rtol=1e-12)
        # Exact: <xy> grows by aggregation of independent parts, M11 = x0 y0 (1 + 2 t), M20 = 2 x0^2 (1 + t).
        errors.append([n @ (x * y) / (np.prod(means) * (1 + 2 * t)) - 1, n @ x**2 / (2 * (1 + t)) - 1])
    errors = np.abs(errors)
    # Bilinear weights keep the product x y of every event.
    assert errors[1, 0] < 2e-4
    assert np.log(errors[0, 1] / errors[1, 1]) / np.log(2) > 1.7, errors
    assert errors[1, 1] < 0.1


def _hat_integrals(axis, mean):
    """An exponential of this mean put on the pivots of an axis that starts at zero, number and mass kept."""
    number, mass = exponential_below(1.0, mean)
    n, m, width = np.diff(number(axis)), np.diff(mass(axis)), np.diff(axis)
    out = np.zeros(axis.size)
    out[:-1] += (axis[1:] * n - m) / width
    out[1:] += (m - axis[:-1] * n) / width
    return out


def test_breakage_in_two_coordinates():
    """b = 2/(x' y') at a constant rate: moments 1, x, y and xy follow exactly, x^2 to second order."""
    rate, time = 1.0, 0.7
    errors = []
    for count in (17, 33):
        axis = np.linspace(0, 1, count)
        grid = TwoComponentGrid(axis, axis)

        def rectangle(parents, axis=axis, grid=grid):
            return grid.masses, 2 * np.outer(*(_uniform_hat(axis, p) for p in parents)).ravel()

        broken = np.where((grid.masses > 0).all(axis=1), rate, 0.0)
        balance = PopulationBalance(grid, [Breakage(broken, rectangle)])
        start = np.zeros(grid.cells)
        start[-1] = 1.0
        n = integrate(balance, start, [0, time], rtol=1e-10, atol=1e-15)[-1, : grid.cells]
        x, y = grid.masses.T
        error = []
        for order in ((1, 0), (0, 1), (1, 1), (2, 0), (2, 1)):
            found = n @ (x ** order[0] * y ** order[1])
            error.append(found / exact.rectangle_breakage_moment(order, time, 1.0, rate) - 1)
        errors.append(np.abs(error))
    errors = np.array(errors)
    assert np.all(errors[:, :2] < 1e-12)
    assert np.all(np.log2(errors[0, 3:] / errors[1, 3:]) > 1.0), errors
    assert errors[1, 3:].max() < 0.03


def _uniform_hat(axis, parent):
    """A uniform density on (0, parent), of integral one, put on the pivots of an axis that starts at zero."""
    out = np.zeros(axis.size)
    low, high = axis[:-1], np.minimum(axis[1:], parent)
    length = np.maximum(high - low, 0.0)
    middle = 0.5 * (low + high)
    upper = np.where(length > 0, (middle - low) / np.diff(axis), 0.0)
    out[:-1] += length / parent * (1 - upper)
    out[1:] += length / parent * upper
    return out


# -- the paper's Eq. 22 ---------------------------------------------------------------------------------------------


def test_initial_slope_is_equation_22():
    """d<P>/dt(0) = (4/pi) eta_11 phi g, by the whole chain: radii, encounters, grid, compiled rates, moments."""
    radius, shear_rate, phi, eta = 500e-9, 1e4, 1e-4, 0.078
    grid = Grid.primaries(8).with_outer_radius(lambda p: radius * p**0.5)
    balance = PopulationBalance(grid, [Aggregation(ShearEncounter(shear_rate) * eta)])
    number = phi / (4 / 3 * np.pi * radius**3)
    state = balance.state(grid.monodisperse(number))
    slope = balance.rhs(0.0, state)
    m0, m1 = number, number
    dm0, dm1 = slope[: grid.cells].sum(), slope[: grid.cells] @ grid.mass
    np.testing.assert_allclose((dm1 - m1 / m0 * dm0) / m0, 4 / np.pi * eta * phi * shear_rate, rtol=1e-13)


# -- a finite population ----------------------------------------------------------------------------------------


def test_marcus_lushnikov_against_direct_simulation():
    """Mean and variance of the number of clusters; 4000 runs, five standard errors (chance of failure < 1e-5)."""
    number, rate, volume, time, runs = 20, 1.0, 10.0, 1.5, 4000
    mean, variance = exact.marcus_lushnikov_constant(time, number, rate, volume)
    rng = np.random.default_rng(3)
    left = np.full(runs, number)
    m = np.arange(number, 1, -1)
    waits = rng.exponential(1 / (0.5 * rate / volume * m * (m - 1)), size=(runs, m.size)).cumsum(axis=1)
    left = number - (waits < time).sum(axis=1)
    assert abs(left.mean() - mean) < 5 * np.sqrt(variance / runs)
    fourth = ((left - mean) ** 4).mean()
    assert abs(left.var() - variance) < 5 * np.sqrt((fourth - variance**2) / runs)


def test_mean_field_is_the_limit_of_a_large_population():
    """Marcus-Lushnikov at number N against Smoluchowski: the difference falls as 1/N."""
    gaps = []
    for number in (20, 40, 80):
        mean, _ = exact.marcus_lushnikov_constant(1.0, number, 1.0, float(number))
        gaps.append(mean / number - 1 / 1.5)
    np.testing.assert_allclose(np.log2(np.array(gaps[:-1]) / gaps[1:]), 1.0, atol=0.1)


def test_schulz_zimm_start_has_the_moments_asked_for():
    grid = Grid.geometric(1e-4, 100, 2**0.25)
    n = grid.from_cumulative(*moments.schulz_zimm_below(3.0, 2.0, 4.0))
    np.testing.assert_allclose([n.sum(), n @ grid.pivots], [3.0, 6.0], rtol=1e-9)
    np.testing.assert_allclose(n @ grid.pivots**2, 3 * 4 * 1.25, rtol=0.01)
