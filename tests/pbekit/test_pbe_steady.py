"""Steady states and what they depend on."""

from __future__ import annotations

import numpy as np
import pytest

from pbekit import (
    Aggregation,
    Breakage,
    CollisionalBreakup,
    Grid,
    PBEError,
    PopulationBalance,
    ShapeMemory,
    exact,
    integrate,
    steady_state,
)
from pbekit.balance.breakage import CriticalSize, PowerLawRate, TwoPeak, Uniform
from pbekit.balance.kernels import Constant, FractalRadius, ShearEncounter


def sheared(phi=1.0, breakup=None, edge="closed", scheme="fixed pivot", factor=1.0):
    grid = Grid.primaries(20, largest=150, ratio=1.2).with_outer_radius(FractalRadius(1.0, 1.0, 2.2))
    law = CriticalSize(1.0, 1.0, 12.0)
    state = grid.state
    column, row = (type(state)(*(c[:, None] for c in state)), type(state)(*(c[None] for c in state)))
    meets = ShearEncounter(1.0)(column, row)
    breaks = law.of_pair(column, row)
    events = [Aggregation(meets * (1 - breaks)), CollisionalBreakup(factor * meets * breaks, TwoPeak(0.3))]
    if breakup is not None:
        events = [Aggregation(meets), breakup]
    return PopulationBalance(grid, events, scheme, edge), grid.monodisperse(phi)


def test_blatz_tobolsky_steady_state():
    number, rate, bond = 1.0, 2.0, 0.3
    grid = Grid.primaries(70)
    events = [Aggregation(Constant(rate)), Breakage(PowerLawRate(bond, 1, offset=1), Uniform())]
    found = steady_state(PopulationBalance(grid, events, edge="closed"), grid.monodisperse(number))
    wanted = exact.chain_bonding(grid.pivots, np.inf, number, rate, bond)
    np.testing.assert_allclose(found.population, wanted, atol=1e-8)
    assert found.residual < 1e-11


@pytest.mark.parametrize("scheme", ["fixed pivot", "cell average", "three pivots"])
def test_newton_ends_where_time_would(scheme):
    balance, start = sheared(scheme=scheme)
    found = steady_state(balance, start)
    late = integrate(balance, start, [0, 2000.0], rtol=1e-10)[-1]
    np.testing.assert_allclose(found.population, late[: balance.cells], atol=1e-7 * late.max())
    assert np.all(found.population >= 0)
    assert found.population @ balance.grid.mass == pytest.approx(start @ balance.grid.mass, rel=1e-13)


def test_a_neighbour_is_reached_from_its_guess():
    balance, start = sheared()
    first = steady_state(balance, start)
    again = steady_state(balance, start, guess=first.population * 1.02)
    assert again.time == 0.0
    np.testing.assert_allclose(again.population, first.population, atol=1e-12)


def test_steady_size_against_volume_fraction():
    """First-order breakup: the steady size grows with phi.  Collisional breakup: it does not depend on phi."""
    collisional, first_order = [], []
    for phi in (0.5, 1.0, 2.0):
        balance, start = sheared(phi)
        n = steady_state(balance, start).population
        collisional.append(n @ balance.grid.mass / n.sum())
        balance, start = sheared(phi, Breakage(PowerLawRate(0.5, 2, offset=1), TwoPeak(0.3)))
        n = steady_state(balance, start).population
        first_order.append(n @ balance.grid.mass / n.sum())
    np.testing.assert_allclose(collisional, collisional[0], rtol=1e-9)
    assert np.all(np.diff(first_order) > 0.05)


def test_response_and_importance_are_the_slope_of_the_steady_state():
    """d<1/n> by one factorisation, forward and adjoint, against a finite difference of two steady states."""
    balance, start = sheared()
    base = steady_state(balance, start)
    step = 1e-4
    up, down = (steady_state(sheared(factor=1 + f)[0], start).population for f in (step, -step))
    slope = (up - down) / (2 * step)
    state = balance.state(base.population)
    change = PopulationBalance(balance.grid, balance.events[1:], edge="closed").rhs(0, state)[: balance.cells]
    np.testing.assert_allclose(base.response(change), slope, atol=1e-6 * np.abs(slope).max())
    output = np.ones(balance.cells)
    np.testing.assert_allclose(base.importance(output) @ change, output @ slope, rtol=1e-5)


def test_an_open_edge_has_no_steady_state():
    balance, start = sheared(edge="overflow")
    with pytest.raises(PBEError, match="closed"):
        steady_state(balance, start)


def test_nothing_happening_is_said():
    grid = Grid.primaries(4)
    with pytest.raises(PBEError, match="nothing happens"):
        steady_state(PopulationBalance(grid, [], edge="closed"), grid.monodisperse(1.0))


def test_edge_flux_falls_with_the_grid():
    fluxes = []
    for largest in (40, 80, 160):
        grid = Grid.primaries(20, largest=largest, ratio=1.2)
        events = [Aggregation(Constant(1.0)), Breakage(PowerLawRate(0.1, 1, offset=1), Uniform())]
        balance = PopulationBalance(grid, events, edge="closed")
        fluxes.append(balance.edge_flux(steady_state(balance, grid.monodisperse(1.0)).population))
    assert fluxes[0] > fluxes[1] > fluxes[2] >= 0
    assert fluxes[2] < 1e-9


def test_products_remember_the_larger_parents_shape():
    """With perfect memory, two kinds of seeds that only collect monomers keep their shapes."""
    grid = Grid.primaries(12).with_shapes([1, 2, 3])
    shares = np.stack([np.where(grid.shape_of_cell == s, 1.0, 0.0) for s in (0, 0, 1)])
    shares[:, grid.shape_of_cell < 0] = 1.0
    kernel = np.zeros((grid.cells, grid.cells))
    kernel[0, 1:] = kernel[1:, 0] = 1.0
    balance = PopulationBalance(grid, [Aggregation(kernel, ShapeMemory(shares, np.array([0, 1])))])
    start = grid.monodisperse(1.0)
    start[(grid.mass == 4) & (grid.shape_of_cell == 0)] = 0.2
    start[(grid.mass == 4) & (grid.shape_of_cell == 1)] = 0.1
    end = integrate(balance, start, [0, 0.8])[-1, : grid.cells]
    elongated = end[grid.shape_of_cell == 1].sum()
    assert elongated == pytest.approx(0.1, abs=1e-4)
    assert end[(grid.shape_of_cell == 1) & (grid.mass > 4)].sum() > 0.02
