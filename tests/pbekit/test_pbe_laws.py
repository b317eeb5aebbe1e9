"""Laws every balance obeys, over every member of each family: conservation, positivity, slopes, refusals, slow references."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from pbekit import (
    Aggregation,
    Breakage,
    CollisionalBreakup,
    Grid,
    KernelError,
    PBEError,
    PopulationBalance,
    Restructuring,
    ShapeMemory,
    TwoComponentGrid,
    integrate,
)
from pbekit.balance.breakage import (
    Binary,
    CriticalSize,
    Erosion,
    ExponentialRate,
    PowerLawRate,
    SchulzZimm,
    TwoBeta,
    TwoPeak,
    Uniform,
)
from pbekit.balance.kernels import Constant, FractalRadius, Product, ShearEncounter, Sum, exponential_below
from pbekit.solution.solve import solve

CLOSED = 1e-13  # mass, relative to the mass that moves
SHARE = np.array([0.5, 0.3, 0.2])
KERNELS = [Constant(0.8), Sum(0.3), Product(0.1), ShearEncounter(2.0)]
DAUGHTERS = [Uniform(), Binary(), TwoPeak(0.3), TwoBeta(), Erosion(), SchulzZimm(0.2, 2.0)]
RATES = [PowerLawRate(0.2, 1, offset=1), ExponentialRate(1.0, 2.0, 5.0), CriticalSize(2.0, 1.0, 40.0)]
SCHEMES = ["fixed pivot", "cell average", "three pivots"]
EDGES = ["overflow", "closed"]


def shaped_grid():
    grid = Grid.primaries(12, largest=90, ratio=1.3).with_shapes([1, 1.6, 2.5, 5])
    return grid.with_outer_radius(lambda m, s: FractalRadius(1.0, 1.2, 1.8)(m) * (1 + 0.1 * np.nan_to_num(s)))


def continuous_grid():
    return Grid.geometric(0.01, 100, 1.6).with_outer_radius(lambda v: v ** (1 / 3))


GRIDS = {"shaped": shaped_grid, "continuous": continuous_grid}


def all_events(grid):
    """Every kind of event, each family with all its members."""
    share = SHARE if grid.shapes > 1 else None
    broken = [d for d in DAUGHTERS if grid.discrete or not isinstance(d, SchulzZimm)]
    yield from (Aggregation(k, share) for k in KERNELS)
    yield from (CollisionalBreakup(k, d, share) for k, d in zip(itertools.cycle(KERNELS), DAUGHTERS))
    for rate, daughters in itertools.product(RATES, broken):
        law = np.where(grid.mass > 1, rate(grid.state), 0.0)
        yield Breakage(law, daughters, share)
    if grid.shapes > 1:
        yield Restructuring(Sum(0.2), np.full((3, 3), 0.1) + 0.7 * np.eye(3))


def population(balance, seed=0):
    rng = np.random.default_rng(seed)
    return balance.state(rng.exponential(size=balance.cells) * rng.integers(0, 2, balance.cells))


def case_name(value):
    return value if isinstance(value, str) else None


@pytest.mark.parametrize("grid", GRIDS, ids=case_name)
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("edge", EDGES)
def test_every_event_conserves_mass_and_stays_positive(grid, scheme, edge):
    grid = GRIDS[grid]()
    for event in all_events(grid):
        balance = PopulationBalance(grid, [event], scheme, edge)
        state = population(balance)
        rate = balance.rhs(0.0, state)
        moved = np.abs(rate) @ balance.conserved
        assert np.all(np.abs(rate @ balance.conserved) <= CLOSED * moved), event
        # An empty class can only fill: the balance is quasi-positive, so exact solutions stay positive.
        # Three pivots give that up: the far one of a product loses an eighth of it at most where pivots are even.
        if scheme != "three pivots":
            assert np.all(rate[: grid.cells][state[: grid.cells] == 0] >= 0), event
        if edge == "closed":
            assert not rate[grid.cells :].any(), event


@pytest.mark.parametrize("scheme", SCHEMES)
def test_number_changes_by_the_products_of_each_event(scheme):
    """Aggregation loses one; two-piece breakup of a pair loses none, of one gains one; restructuring keeps all."""
    grid = shaped_grid()
    state = population(PopulationBalance(grid, []))
    n = state[: grid.cells]
    met = 0.5 * n.sum() ** 2  # the constant kernel's encounters, i < j and half of i = j
    rate = PowerLawRate(0.2, 1, offset=1)(grid.state)
    cases = [
        (Aggregation(Constant(1.0), SHARE), -met),
        (CollisionalBreakup(Constant(1.0), Uniform(), SHARE), 0.0),
        (Breakage(rate, Uniform(), SHARE), rate @ n),
        (Restructuring(Constant(1.0), np.full((3, 3), 1 / 3)), 0.0),
    ]
    for event, wanted in cases:
        change = PopulationBalance(grid, [event], scheme).rhs(0.0, state)
        np.testing.assert_allclose(
            change[: grid.cells + 1].sum(), wanted, atol=1e-10 * met, err_msg=str(event)
        )


@pytest.mark.parametrize("grid", GRIDS, ids=case_name)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_jacobian_is_the_slope_of_the_right_hand_side(grid, scheme):
    grid = GRIDS[grid]()
    balance = PopulationBalance(grid, list(all_events(grid)), scheme)
    state = population(balance, 1) + 0.1
    direction = np.random.default_rng(2).normal(size=state.size)
    direction[grid.cells :] = 0
    step = 1e-6
    slope = (balance.rhs(0, state + step * direction) - balance.rhs(0, state - step * direction)) / (2 * step)
    found = balance.jacobian(0, state) @ direction
    np.testing.assert_allclose(found, slope, rtol=1e-6, atol=1e-7 * np.abs(slope).max())


def slow_twin(grid, state, kernel, daughters, share):
    """The event form of the balance written from its definition: loops over pairs of cells and their products."""
    n, mass = state[: grid.cells], grid.mass
    out = np.zeros(grid.cells)
    overflow = np.zeros(2)

    def deliver(product, number):
        if product > grid.pivots[-1]:
            overflow[:] += number, number * product
            return
        upper = int(np.argmax(grid.pivots >= product))
        lower = upper if grid.pivots[upper] == product else upper - 1
        gap = grid.pivots[upper] - grid.pivots[lower]
        fraction = 1.0 if gap == 0 else (grid.pivots[upper] - product) / gap
        for size, part in ((lower, fraction), (upper, 1 - fraction)):
            for k in np.flatnonzero(grid.size_of_cell == size):
                shape = grid.shape_of_cell[k]
                out[k] += number * part * (1.0 if shape < 0 else share[shape])

    for i in range(grid.cells):
        for j in range(i, grid.cells):
            met = kernel[i, j] * n[i] * n[j] / (2 if i == j else 1)
            out[i] -= met
            out[j] -= met
            if daughters is None:
                deliver(mass[i] + mass[j], met)
            else:
                for product, number in zip(*daughters.pieces(mass[i] + mass[j])):
                    deliver(product, met * number)
    return np.concatenate([out, overflow])


@pytest.mark.parametrize("daughters", [None, TwoPeak(0.3)], ids=["aggregation", "collisional breakup"])
def test_right_hand_side_against_its_slow_twin(daughters):
    grid = Grid.primaries(5, largest=14, ratio=1.3).with_shapes([1, 1.6, 2.5, 5])
    kernel = np.random.default_rng(5).random((grid.cells,) * 2)
    kernel += kernel.T
    event = Aggregation(kernel, SHARE) if daughters is None else CollisionalBreakup(kernel, daughters, SHARE)
    balance = PopulationBalance(grid, [event])
    state = population(balance, 6)
    np.testing.assert_allclose(
        balance.rhs(0, state), slow_twin(grid, state, kernel, daughters, SHARE), rtol=1e-12, atol=1e-12
    )


def test_shapes_that_remember_and_change_against_their_slow_twin():
    """Products shaped by their larger parent, survivors reshaped by who they met: every pair of cells in turn."""
    rng = np.random.default_rng(7)
    grid = Grid.primaries(5, largest=14, ratio=1.3).with_shapes([1, 1.6, 2.5, 5])
    join, pass_by = rng.random((2, grid.cells, grid.cells))
    join, pass_by = join + join.T, pass_by + pass_by.T
    rows = rng.random((4, grid.cells))
    rows /= np.stack([np.bincount(grid.size_of_cell, row)[grid.size_of_cell] for row in rows])
    memory = ShapeMemory(rows[:3], np.array([0, 0, 1]))
    groups = np.array([0, 2, 6, grid.cells])
    after = rng.dirichlet(np.ones(3), (3, grid.cells))
    balance = PopulationBalance(grid, [Aggregation(join, memory), Restructuring(pass_by, after, groups)])
    state = population(balance, 8)
    n, wanted = state[: grid.cells], np.zeros(state.size)
    for i, j in itertools.combinations_with_replacement(range(grid.cells), 2):
        met = join[i, j] * n[i] * n[j] / (2 if i == j else 1)
        wanted[[i]] -= met
        wanted[[j]] -= met
        larger = max((grid.size_of_cell[k], grid.shape_of_cell[k]) for k in (i, j))[1]
        row = rows[0] if larger < 0 else rows[1 + memory.group_of_shape[larger]]
        slot, share, _ = grid.corners(np.array([grid.mass[i] + grid.mass[j]]))
        for size, part in zip(slot[0], share[0]):
            at = grid.size_of_cell == size
            wanted[: grid.cells] += met * part * at * row
            if not at.any():
                wanted[grid.cells + size - grid.sizes] += met * part
    for i, j in itertools.product(range(grid.cells), repeat=2):
        seen = pass_by[i, j] * n[i] * n[j]
        if grid.shape_of_cell[i] >= 0:
            own = np.flatnonzero(grid.size_of_cell == grid.size_of_cell[i])
            wanted[i] -= seen
            wanted[own] += seen * after[np.searchsorted(groups, j, side="right") - 1, i]
    np.testing.assert_allclose(balance.rhs(0, state), wanted, rtol=0, atol=1e-14 * np.abs(wanted).max())


@pytest.mark.parametrize("grid", GRIDS, ids=case_name)
def test_three_pivots_keep_number_mass_and_second_moment_of_every_product(grid):
    """Every aggregate that two cells can form and the grid can hold; the largest share taken is an eighth on even pivots."""
    grid = GRIDS[grid]()
    pair = grid.pivots[:, None] + grid.pivots
    product = pair[pair <= grid.pivots[-1]]
    slot, number, _ = grid.corners(product, "three pivots")
    for power in range(3):
        found = (number * grid.pivots[slot] ** power).sum(axis=1)
        np.testing.assert_allclose(found, product**power, rtol=1e-12)
    met = np.isin(product, grid.pivots)
    assert np.all(np.sort(number[met], axis=1) == [0.0, 0.0, 1.0])
    even = Grid(np.arange(1.0, 30.0), np.arange(0.5, 30.0), discrete=False)
    taken = even.corners(np.linspace(1.6, 28.4, 5000), "three pivots")[1]
    assert taken.min() == pytest.approx(-0.125, abs=1e-3)


@pytest.mark.parametrize("daughters", [Uniform(), Binary(), TwoPeak(0.3), Erosion()], ids=lambda d: d.name)
def test_three_pivots_keep_the_second_moment_of_fragments(daughters):
    """Against the density of fragments itself, on whole primaries and on volumes."""
    whole, volumes = Grid.primaries(8, largest=200), Grid.geometric(1e-7, 100, 1.6)
    pieces, number = daughters.pieces(190.0)
    placed, _ = whole.place(pieces, number, "three pivots")
    assert placed[:-2] @ whole.pivots**2 == pytest.approx(number @ pieces**2, rel=1e-12)
    x = (np.arange(200_000) + 0.5) / 200_000
    density = np.diff(daughters.mass_below(np.arange(200_001) / 200_000))
    placed, _ = volumes.place_density(*daughters.cumulative(50.0), 50.0, "three pivots")
    assert placed[:-2] @ volumes.pivots == pytest.approx(50.0, rel=1e-12)
    assert placed[:-2] @ volumes.pivots**2 == pytest.approx(50.0**2 * (density @ x), rel=1e-6)


def test_a_population_on_three_pivots_starts_without_numbers_below_zero():
    """Number, mass and second moment of an exponential, whose tail falls too steeply for the coarsest grids."""
    for ratio, tolerance in ((2.0, 1e-2), (2**0.5, 1e-3), (2**0.25, 1e-6)):
        grid = Grid.geometric(1e-4, 1e3, ratio)
        n = grid.from_cumulative(*exponential_below(1.0, 1.0), "three pivots")
        two = grid.from_cumulative(*exponential_below(1.0, 1.0))
        assert n.min() >= 0.0
        assert n @ grid.pivots**2 == pytest.approx(2.0, rel=tolerance)
        for power in (0, 1):
            assert n @ grid.pivots**power == pytest.approx(two @ grid.pivots**power, rel=1e-12)


def test_cell_average_against_its_slow_twin():
    """Births of each cell gathered, then shared by their mean mass (Kumar et al. 2006, Eqs. 20-24)."""
    grid = continuous_grid()
    balance = PopulationBalance(grid, [Aggregation(Constant(1.0))], "cell average")
    state = population(balance, 4)
    n, x = state[: grid.cells], grid.pivots
    births, mass, wanted = np.zeros(grid.cells), np.zeros(grid.cells), -n * n.sum()
    for i, j in itertools.product(range(grid.cells), repeat=2):
        v = x[i] + x[j]
        if v <= x[-1]:
            cell = min(int(np.searchsorted(grid.edges, v, side="right")) - 1, grid.cells - 1)
            births[cell] += 0.5 * n[i] * n[j]
            mass[cell] += 0.5 * n[i] * n[j] * v
    for k in np.flatnonzero(births):
        mean = mass[k] / births[k]
        other = k + 1 if mean >= x[k] else k - 1
        moved = (mean - x[k]) / (x[other] - x[k]) if 0 <= other < grid.cells else 0.0
        wanted[k] += births[k] * (1 - moved)
        if 0 <= other < grid.cells:
            wanted[other] += births[k] * moved
    np.testing.assert_allclose(balance.rhs(0, state)[: grid.cells], wanted, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("method", ["LSODA", "BDF", "Radau", "RK45"])
def test_solutions_stay_positive_and_closed_in_mass(method):
    grid = shaped_grid()
    events = [
        Aggregation(ShearEncounter(1.0), SHARE),
        CollisionalBreakup(ShearEncounter(0.3), TwoPeak(0.3), SHARE),
        Restructuring(ShearEncounter(1.0), np.full((3, 3), 1 / 3)),
    ]
    balance = PopulationBalance(grid, events)
    data = solve(balance, grid.monodisperse(0.05), np.linspace(0, 20, 6), method=method, rtol=1e-6)
    assert float(data.number.min()) >= 0
    assert float(data.clipped_mass.max()) < 1e-9
    assert float(np.abs(data.mass_drift).max()) < CLOSED
    assert float(data.mean_size[-1]) > 1.5


# -- grids ------------------------------------------------------------------------------------------------------------


def test_monomers_and_dimers_have_one_shape():
    grid = Grid.primaries(6).with_shapes([1, 2, 3])
    assert grid.cells == 2 + 4 * 2
    assert list(grid.mass[:4]) == [1, 2, 3, 3]
    assert np.isnan(grid.shape[:2]).all() and not np.isnan(grid.shape[2:]).any()


def test_pivots_are_whole_then_about_geometric():
    grid = Grid.primaries(32, largest=1000)
    assert np.array_equal(grid.pivots[:32], np.arange(1, 33))
    assert np.array_equal(grid.pivots, np.round(grid.pivots))
    ratio = grid.pivots[33:] / grid.pivots[32:-1]
    assert np.all(np.abs(ratio - 2**0.25) < 0.02)


def test_mean_shape_mode_is_the_limit_of_equal_shapes():
    """If no rate depends on shape, the balance without shapes gives the same sizes."""
    shaped = shaped_grid()
    sizes = Grid(shaped.pivots, shaped.edges, discrete=True)
    events = lambda share: [
        Aggregation(Sum(0.1), share),
        CollisionalBreakup(Constant(0.05), TwoPeak(0.3), share),
    ]
    options = dict(method="DOP853", rtol=1e-10, atol=1e-14)
    full = integrate(PopulationBalance(shaped, events(SHARE)), shaped.monodisperse(1.0), [0, 5], **options)[
        -1
    ]
    mean = integrate(PopulationBalance(sizes, events(None)), sizes.monodisperse(1.0), [0, 5], **options)[-1]
    summed = np.bincount(shaped.size_of_cell, full[: shaped.cells])
    np.testing.assert_allclose(summed, mean[: sizes.cells], atol=1e-10)


# -- refusals ---------------------------------------------------------------------------------------------------------


def bad_negative(i, j):
    return i - j


def bad_nan(i, j):
    return np.log(i - 2.0) + np.log(j - 2.0)


def bad_skew(i, j):
    return i + 2 * j


def bad_arity(i):
    return i


@pytest.mark.parametrize(
    "kernel, what",
    [
        (bad_negative, "negative"),
        (bad_nan, "not finite"),
        (bad_skew, "not symmetric"),
        (bad_arity, "arguments"),
    ],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("kind", [Aggregation, lambda k: CollisionalBreakup(k, Uniform())])
def test_bad_kernels_are_refused_by_name(kernel, what, kind):
    with pytest.raises(KernelError, match=f"{kernel.__name__}.*{what}"):
        PopulationBalance(Grid.primaries(5), [kind(kernel)])


def loses_mass(parent):
    return [1.0, 2.0], [1.0, 0.5]


def negative_pieces(parent):
    return [1.0, 2.0], [-1.0, 0.5 * (parent + 1)]


@pytest.mark.parametrize(
    "daughters, what", [(loses_mass, "mass must be conserved"), (negative_pieces, "negative")]
)
def test_bad_daughters_are_refused_by_name(daughters, what):
    with pytest.raises(KernelError, match=f"{daughters.__name__}.*{what}"):
        PopulationBalance(Grid.primaries(6), [Breakage(lambda m: np.where(m > 4, 1.0, 0.0), daughters)])


def falls(mass):
    return 3 - mass


def test_bad_rates_are_refused_by_name():
    with pytest.raises(KernelError, match=r"falls.*negative at mass 4"):
        PopulationBalance(Grid.primaries(6), [Breakage(falls, Uniform())])


def test_a_monomer_that_breaks_is_refused():
    with pytest.raises(KernelError, match="1 primaries cannot break"):
        PopulationBalance(Grid.primaries(6), [Breakage(lambda m: 0 * m + 1.0, Uniform())])


def test_wrong_arrays_and_choices_are_refused():
    grid = Grid.primaries(4)
    with pytest.raises(KernelError, match=r"\(3, 3\).*4 cells"):
        PopulationBalance(grid, [Aggregation(np.ones((3, 3)))])
    with pytest.raises(PBEError, match=r"scheme.*'moving'"):
        PopulationBalance(grid, [], "moving")
    with pytest.raises(KernelError, match="no outer radii"):
        PopulationBalance(grid, [Aggregation(ShearEncounter(1.0))])
    with pytest.raises(PBEError, match="several shapes"):
        PopulationBalance(grid.with_shapes([1, 2, 3]), [Aggregation(1.0)])
    pair = TwoComponentGrid.primaries(2, 2)
    with pytest.raises(PBEError, match="fixed pivot"):
        PopulationBalance(pair, [Aggregation(1.0)], "cell average")
    for shape in (np.ones(1), ShapeMemory(np.ones((1, pair.cells)), np.zeros(1, int))):
        with pytest.raises(PBEError, match="two-component grid has no shapes"):
            PopulationBalance(pair, [Aggregation(1.0, shape)])


def test_a_user_brings_a_function_or_arrays():
    """The same kernel as library object, plain function and array gives the same balance."""
    grid = Grid.primaries(6)
    state = population(PopulationBalance(grid, []), 3)

    def mine(i, j):
        return 0.3 * (i + j)

    wanted = PopulationBalance(grid, [Aggregation(Sum(0.3))]).rhs(0, state)
    for kernel in (mine, mine(grid.mass[:, None], grid.mass[None])):
        np.testing.assert_allclose(
            PopulationBalance(grid, [Aggregation(kernel)]).rhs(0, state), wanted, rtol=1e-14
        )
