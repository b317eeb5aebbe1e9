"""From encounters to a balance: a synthetic DEM of known probabilities is recovered, bands included."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from pbe_synthetic import (
    RADIUS,
    SHEAR_RATE,
    STAY,
    design,
    encounters,
    outer_radius,
    probabilities,
    shape_share,
)

from pbekit import (
    Aggregation,
    CollisionalBreakup,
    Grid,
    PBEError,
    PopulationBalance,
    Restructuring,
    integrate,
    steady_state,
)
from pbekit.balance.breakage import Uniform
from pbekit.estimated_rates.estimated_rates import EstimatedRates, grid_for
from pbekit.study.uncertainty import (
    band,
    course_output,
    draws_of,
    mean_size_gradient,
    steady_output,
    variance_shares,
)
from pbekit.tables.kernel_table import (
    AGGREGATION,
    MISSED,
    OUTCOMES,
    UNRESOLVED,
    KernelTable,
    Records,
    size_classes,
)

LARGEST, NUMBER = 14, 0.01
TIMES = np.array([0.0, 10.0, 30.0])


def known_sizes():
    """The balance that the synthetic DEM obeys, without shapes."""
    grid = Grid.primaries(LARGEST).with_outer_radius(lambda m: outer_radius(m))
    i, j = grid.pivots[:, None], grid.pivots[None]
    join, scatter = probabilities(i, j)
    rate = 4 / 3 * SHEAR_RATE * (outer_radius(i) + outer_radius(j)) ** 3
    events = [Aggregation(rate * join), CollisionalBreakup(rate * scatter, Uniform())]
    return PopulationBalance(grid, events, edge="closed"), grid.monodisperse(NUMBER)


def rates_of(records, outcomes="table"):
    edges = np.arange(1, LARGEST + 2)
    table = KernelTable.of(records, RADIUS, SHEAR_RATE, size_edges=edges, shapes=1)
    return EstimatedRates(table, Grid.primaries(LARGEST), outcomes)


def mean_size(population):
    return NUMBER / population.sum()


# -- recovery -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("outcomes, allowed", [("table", 0.01), ("smooth", 0.03)])
def test_many_encounters_recover_the_exact_balance(outcomes, allowed):
    """60 000 encounters: steady <P> within 1 % (classes) and, the law's form being only near the truth, 3 % (smooth)."""
    balance, start = known_sizes()
    estimated = rates_of(design(np.random.default_rng(1), 60_000, LARGEST), outcomes)
    exact = mean_size(steady_state(balance, start).population)
    found = mean_size(steady_state(estimated.mean, start).population)
    assert found == pytest.approx(exact, rel=allowed)
    late = [mean_size(integrate(b, start, TIMES)[-1, :LARGEST]) for b in (balance, estimated.mean)]
    assert late[1] == pytest.approx(late[0], rel=allowed)


def test_bands_cover_the_exact_answer_as_often_as_they_say():
    """90 % intervals of steady <P> and of <P>(30) over 40 tables of 2500 encounters.

    If each covers with probability 0.9, fewer than 31 of 40 cover with probability 0.005; all 80 with 2e-4.
    """
    balance, start = known_sizes()
    exact = mean_size(steady_state(balance, start).population)
    exact_late = mean_size(integrate(balance, start, TIMES)[-1, :LARGEST])
    guess = steady_state(balance, start).population
    covered = np.zeros((40, 2), bool)
    for repeat in range(40):
        estimated = rates_of(design(np.random.default_rng([7, repeat]), 2500, LARGEST))
        late = course_output(start, TIMES[[0, -1]], rtol=1e-5)
        settled = steady_output(start, guess=guess)

        def both(b, late=late, settled=settled):
            return {"steady": settled(b)["mean_size"], "late": late(b)["mean_size"][-1]}

        drawn = draws_of(estimated, both, 40, seed=repeat)
        for k, (name, truth) in enumerate((("steady", exact), ("late", exact_late))):
            low, high = band(drawn[name].values)
            covered[repeat, k] = low <= truth <= high
    assert np.all(covered.sum(axis=0) >= 31), covered.sum(axis=0)
    assert covered.sum() < 80


def test_sizes_and_shapes_are_recovered_together():
    """Two shapes that change outcomes, are drawn anew by products and by 30 % of survivors: the bivariate balance."""
    shapes, edges = (1.2, 2.2), np.array([1.0, 1.7, 3.0])
    grid = Grid.primaries(LARGEST).with_shapes(edges)
    actual = np.where(grid.shape_of_cell < 0, 1.0, np.asarray(shapes)[np.maximum(grid.shape_of_cell, 0)])
    grid = grid.with_outer_radius(outer_radius(grid.mass, actual))
    m, s, radius = grid.mass, actual, grid.outer_radius
    join, scatter = probabilities(m[:, None], m[None], s[:, None], s[None])
    rate = 4 / 3 * SHEAR_RATE * (radius[:, None] + radius[None]) ** 3
    long = shape_share(m)
    share = np.where(grid.shape_of_cell < 0, 1.0, np.where(grid.shape_of_cell == 1, long, 1 - long))
    drawn = np.stack([1 - long, long], axis=1)
    stay = np.eye(2)[np.maximum(grid.shape_of_cell, 0)]
    events = [
        Aggregation(rate * join, share),
        CollisionalBreakup(rate * scatter, Uniform(), share),
        Restructuring(rate * (1 - join - scatter), STAY * stay + (1 - STAY) * drawn),
    ]
    exact = PopulationBalance(grid, events, edge="closed")
    start = grid.monodisperse(NUMBER)
    truth = steady_state(exact, start).population

    records = design(np.random.default_rng(4), 40_000, LARGEST, shapes)
    table = KernelTable.of(
        records, RADIUS, SHEAR_RATE, size_edges=np.arange(1, LARGEST + 2), shape_edges=edges
    )
    estimated = EstimatedRates(table, Grid.primaries(LARGEST).with_shapes(edges, table.shape_name))
    steady = steady_state(estimated.mean, start)
    found = steady.population
    shares = variance_shares(estimated, steady, mean_size_gradient(estimated.mean, found))
    # Three standard deviations, each 0.7 % of <P>: failure by chance 0.3 %.
    assert abs(mean_size(found) - mean_size(truth)) < 3 * shares.deviation < 0.03 * mean_size(truth)
    elongated = grid.shape_of_cell == 1
    wanted = truth[elongated].sum() / truth[grid.shape_of_cell >= 0].sum()
    assert found[elongated].sum() / found[grid.shape_of_cell >= 0].sum() == pytest.approx(wanted, rel=0.03)
    # Each class is known to about 3 %.
    np.testing.assert_allclose(found, truth, rtol=0.1)
    drawn = draws_of(estimated, steady_output(start, guess=found), 20)
    low, high = band(drawn.mean_size.values)
    assert low < mean_size(found) < high

    # A mean shape per size is not enough here: it takes the shapes in the proportion in which they were sampled, and of
    # encounters with an elongated parent four fifths are left away.
    round_parents = ((records.size <= 2) | (records.aspect_ratio < edges[1])).all(axis=1)
    uneven = records.select(round_parents | (np.random.default_rng(5).random(len(records)) < 0.2))
    flat = steady_state(
        EstimatedRates(table.with_records(uneven), Grid.primaries(LARGEST)).mean,
        Grid.primaries(LARGEST).monodisperse(NUMBER),
    )
    assert abs(mean_size(flat.population) - mean_size(truth)) > 3 * shares.deviation


def test_a_mean_shape_per_size_counts_all_shapes():
    """Of a table with classes of shape: the same balance as of a table without, not that of the roundest parents."""
    table = shaped_table(2000)
    flat = dataclasses.replace(table, shape_edges=None)
    one, other = (EstimatedRates(t, Grid.primaries(LARGEST)).mean_rates.outcomes for t in (table, flat))
    np.testing.assert_array_equal(one, other)


def test_radii_are_per_aggregate_though_encounters_favour_the_large():
    """Encounters drawn in proportion to (R_i + R_j)^3 of elongated and round: the mean R of the cell stays unbiased."""
    rng = np.random.default_rng(0)
    size = np.full((40_000, 2), 6)
    shape = np.where(rng.random(size.shape) < 0.5, 1.0, 40.0)  # R by a factor of 3
    flux = (outer_radius(size, shape)).sum(axis=1) ** 3
    chosen = rng.random(len(size)) < flux / flux.max()
    records = encounters(rng, size[chosen], shape[chosen])
    table = KernelTable.of(records, RADIUS, SHEAR_RATE, shapes=1)
    estimated = EstimatedRates(table, Grid.primaries(8))
    r1, r2, r3 = estimated.radius_moments(estimated.weights(None))[:, 5]
    both = outer_radius(np.array([6, 6]), np.array([1.0, 40.0]))
    for found, power in ((r1, 1), (r2, 2), (r3, 3)):
        assert found == pytest.approx((both**power).mean(), rel=0.03)


# -- what decides the error ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("outcomes", ["table", "smooth"])
def test_variance_by_adjoint_is_the_variance_of_draws(outcomes):
    """120 draws give their deviation to 6.5 % (one sigma): the two agree within 25 %."""
    _, start = known_sizes()
    estimated = rates_of(design(np.random.default_rng(3), 6000, LARGEST), outcomes)
    steady = steady_state(estimated.mean, start)
    shares = variance_shares(estimated, steady, mean_size_gradient(estimated.mean, steady.population))
    drawn = draws_of(estimated, steady_output(start, guess=steady.population), 120)
    assert shares.deviation == pytest.approx(float(drawn.mean_size.std()), rel=0.25)
    assert shares.table().shape == (LARGEST, LARGEST)


def test_next_encounters_go_where_they_help():
    """The same number of encounters, placed by variance shares or evenly: the placed ones leave the smaller error."""
    _, start = known_sizes()
    first = design(np.random.default_rng(5), 1500, LARGEST)

    def deviation(records):
        estimated = rates_of(records)
        steady = steady_state(estimated.mean, start)
        return estimated, variance_shares(
            estimated, steady, mean_size_gradient(estimated.mean, steady.population)
        )

    _, shares = deviation(first)
    trials = shares.next_trials(3000)
    assert trials.sum() == 3000 and trials.min() >= 0
    high, low = np.tril_indices(LARGEST)
    size = np.repeat(np.stack([low, high], axis=1) + 1, trials, axis=0)
    placed = encounters(np.random.default_rng(6), size, np.ones(size.shape))
    even = design(np.random.default_rng(6), 3000, LARGEST)
    assert (
        deviation(Records.join([first, placed]))[1].deviation
        < deviation(Records.join([first, even]))[1].deviation
    )


def test_extrapolation_is_flagged():
    records = design(np.random.default_rng(0), 2000, 8)
    table = KernelTable.of(records, RADIUS, SHEAR_RATE, shapes=1)
    estimated = EstimatedRates(table, Grid.primaries(LARGEST))
    assert not estimated.extrapolated[:8, :8].any()
    assert estimated.extrapolated[8:].all()
    start = Grid.primaries(LARGEST).monodisperse(NUMBER)
    assert estimated.extrapolated_flux(start) == 0.0
    assert estimated.extrapolated_flux(np.ones(LARGEST)) > 0.3


@pytest.mark.parametrize("seed", range(5))
def test_every_draw_is_physical(seed):
    estimated = rates_of(design(np.random.default_rng(0), 300, LARGEST))
    rng = np.random.default_rng(seed)
    p = estimated.probabilities(estimated.weights(rng), rng)
    assert np.all(p >= 0)
    np.testing.assert_allclose(p.sum(axis=1), 1)
    balance = estimated.balance(rng)
    state = balance.state(np.random.default_rng(1).random(LARGEST))
    rate = balance.rhs(0, state)
    assert abs(rate @ balance.conserved)[0] < 1e-13 * np.abs(rate) @ balance.conserved[:, 0]


def test_a_table_without_breakup_still_makes_a_file_and_a_balance(tmp_path):
    records = design(np.random.default_rng(0), 4000, LARGEST)
    records = records.select(np.isin(records.outcome, (MISSED, AGGREGATION)))
    estimated = rates_of(records)
    estimated.table.save(tmp_path / "k.nc")
    assert KernelTable.load(tmp_path / "k.nc").to_dataset().fragment_mass_density.sum() == 0
    balance = estimated.mean
    assert np.isfinite(balance.rhs(0, balance.state(Grid.primaries(LARGEST).monodisperse(1.0)))).all()


# -- the file -----------------------------------------------------------------------------------------------------


def shaped_table(count=500):
    records = design(np.random.default_rng(2), count, LARGEST, (1.2, 2.2))
    about = {"scene": "# a scene\n[flow]\n", "seed": 3, "viscosity": 0.1, "volume_fraction": 1e-4}
    return KernelTable.of(records, RADIUS, SHEAR_RATE, shape_edges=[1, 1.7, 3], about=about)


def test_the_file_gives_back_what_was_saved(tmp_path):
    table = shaped_table()
    table.save(tmp_path / "k.nc")
    again = KernelTable.load(tmp_path / "k.nc")
    for f in dataclasses.fields(Records):
        np.testing.assert_allclose(getattr(again.records, f.name), getattr(table.records, f.name), rtol=1e-6)
    assert dict(again.about) == dict(table.about)
    np.testing.assert_array_equal(again.counts, table.counts)
    assert again.shape_name == table.shape_name and again.radius == table.radius


def test_the_file_shows_counts_units_and_meaning():
    data = shaped_table().to_dataset()
    assert all("units" in v.attrs and "long_name" in v.attrs for v in data.data_vars.values())
    assert list(data.outcome.values) == list(OUTCOMES)
    np.testing.assert_array_equal(data["count"].sum("outcome"), data.trials)
    trials = data.trials.values
    assert trials.sum() + np.trace(trials) == 2 * 500
    density = data.fragment_mass_density.values
    seen = data.fragment_count.values.sum(axis=2) > 0
    np.testing.assert_allclose(density[seen].mean(axis=1), 1.0)


def test_counts_against_a_slow_twin():
    table = shaped_table()
    r = table.records
    counts = {}
    shapes = r.shape("aspect ratio", RADIUS)
    for e in range(len(r)):
        key = tuple(sorted(int(table.class_of(r.size[e, k], shapes[e, k])) for k in (0, 1)))
        counts[key, int(r.outcome[e])] = counts.get((key, int(r.outcome[e])), 0) + 1
    for ((a, b), outcome), n in counts.items():
        assert table.counts[b * (b + 1) // 2 + a, outcome] == n
    assert sum(counts.values()) == table.counts.sum()


def test_survivors_are_distinguished():
    records = design(np.random.default_rng(2), 300, LARGEST, (1.2, 2.2))
    kept = records.survivors[:, 0] >= 0
    assert np.array_equal(kept, np.isin(records.outcome, (0, 1)))
    np.testing.assert_array_equal(records.product_size[records.survivors[kept]], records.size[kept])


def test_selection_and_joining_keep_products_with_their_encounters():
    records = design(np.random.default_rng(2), 100, LARGEST)
    odd = np.arange(100) % 2 == 1
    both = Records.join([records.select(odd), records.select(~odd)])
    assert len(both) == 100 and both.product_size.sum() == records.product_size.sum()
    assert len(Records.join([])) == 0


def test_size_classes_are_exact_for_the_small():
    edges = size_classes(60)
    assert list(edges[:6]) == [1, 2, 3, 4, 5, 7] and edges[-1] > 60


def test_bad_records_and_files_are_refused(tmp_path):
    records = design(np.random.default_rng(2), 20, LARGEST)
    with pytest.raises(PBEError, match="primaries must be conserved"):
        dataclasses.replace(records, product_size=records.product_size + 1)
    with pytest.raises(PBEError, match="unequal length: offset"):
        dataclasses.replace(records, offset=np.zeros((3, 2)))
    (tmp_path / "no.nc").write_text("nothing")
    with pytest.raises(PBEError, match="expected a kernel table"):
        KernelTable.load(tmp_path / "no.nc")
    with pytest.raises(PBEError, match="whole primaries"):
        EstimatedRates(KernelTable.of(records, 1, 1, shapes=1), Grid.geometric(1, 10))
    gone = dataclasses.replace(
        records,
        outcome=np.full(20, UNRESOLVED),
    )
    with pytest.raises(PBEError, match="no resolved"):
        EstimatedRates(KernelTable.of(gone, 1, 1, shapes=1), Grid.primaries(4))


def test_unresolved_encounters_are_left_out_and_counted():
    records = design(np.random.default_rng(2), 1000, LARGEST)
    missed = np.flatnonzero(records.outcome == MISSED)[:100]
    outcome = records.outcome.copy()
    outcome[missed] = UNRESOLVED
    estimated = rates_of(dataclasses.replace(records, outcome=outcome))
    assert estimated.unresolved == pytest.approx(0.1)
    assert len(estimated.records) == 900


def test_the_default_grid_follows_the_table():
    table = shaped_table(4000)
    grid = grid_for(table)
    assert grid.shapes == 2 and grid.pivots[-1] >= 2 * LARGEST
    assert grid_for(table, shapes=None).shapes == 1
