"""Primary particles are conserved, and the moments are those of the population."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic
from hypothesis import given, settings
from hypothesis import strategies as st

from mcdem.aggregates.aggregate import Aggregate
from mcdem.monte_carlo.population import ConservationError, SamplePopulation
from mcdem.quantities.random_streams import stream


def naive_moments(population: SamplePopulation) -> tuple[float, float, float]:
    """<P>, sigma_P and d32, from the definitions."""
    aggregates = [aggregate for _, aggregate in population]
    sizes = np.array([a.size for a in aggregates], dtype=float)
    radii = np.array([a.outer_radius(population.primary_radius) for a in aggregates])
    return sizes.mean(), sizes.std(), 2.0 * (radii**3).sum() / (radii**2).sum()


def moments(population: SamplePopulation) -> tuple[float, float, float]:
    return population.mean_size, population.size_deviation, population.sauter_diameter


def test_the_start_has_the_scenes_volume_fraction():
    scene = synthetic.scene(population__initial=200)
    population = SamplePopulation.of_primaries(scene)
    solid = population.primaries * 4 / 3 * np.pi * scene.suspension.radius**3
    assert population.number == population.primaries == 200
    assert solid / population.volume == pytest.approx(scene.suspension.volume_fraction, rel=1e-14)
    assert moments(population) == pytest.approx((1.0, 0.0, 2 * scene.suspension.radius))


@given(st.integers(0, 2**63 - 1), st.integers(2, 30), st.integers(1, 80))
@settings(max_examples=40, deadline=None)
def test_events_and_doublings_conserve_primaries_and_keep_the_moments(seed, number, events):
    scene = synthetic.scene(population__initial=number)
    population = SamplePopulation.of_primaries(scene)
    rng = stream(seed, "test")
    volume, primaries = population.volume, population.primaries
    alive = set(population.serials)
    for _ in range(events):
        if population.number < 2:
            population.double()
            volume, primaries = 2 * volume, 2 * primaries
            alive = {population.serials[place] for place, _ in population}
        first, second = rng.choice([place for place, _ in population], 2, replace=False)
        parents = {population.serials[first], population.serials[second]}
        result = synthetic.aggregation_and_breakup(scene, population.at(first), population.at(second), rng)
        before = {place: aggregate for place, aggregate in population}
        products, changed = population.replace(first, second, result.products, result.members)

        assert sum(aggregate.size for _, aggregate in population) == population.primaries == primaries
        after = {place: aggregate for place, aggregate in population}
        moved = {p for p in before.keys() | after.keys() if before.get(p) is not after.get(p)}
        assert moved == set(changed)
        serials = {population.serials[place] for place in after}
        assert len(serials) == population.number == len(after)
        assert serials - alive == {product.serial for product in products} - parents
        assert moments(population) == pytest.approx(naive_moments(population), rel=1e-9, abs=1e-9)
        alive = serials
    assert population.volume == volume


def test_an_aggregate_keeps_its_number_and_place_while_its_primaries_stay_together():
    scene = synthetic.scene(population__initial=3)
    population = SamplePopulation.of_primaries(scene)
    radius = scene.suspension.radius
    dimer = synthetic.chain(2, radius)
    pair, changed = population.replace(0, 1, [dimer], [np.arange(2)])
    assert (pair[0].serial, pair[0].place, changed) == (3, 0, [0, 1])
    longer = synthetic.chain(2, 1.001 * radius)
    missed = synthetic.missed(population.at(2), longer)  # the second parent is the dimer
    products, changed = population.replace(2, 0, missed.products, missed.members)
    assert {product.serial: product.place for product in products} == {2: 2, 3: 0}
    assert changed == [0]  # the primary particle is the same as ever
    assert population.at(0) is longer


def test_exchanged_primaries_make_new_aggregates():
    scene = synthetic.scene(population__initial=4)
    population = SamplePopulation.of_primaries(scene)
    dimer = synthetic.chain(2, scene.suspension.radius)
    population.replace(0, 1, [dimer], [np.arange(2)])
    population.replace(2, 3, [dimer], [np.arange(2)])
    products, _ = population.replace(0, 2, [dimer, dimer], [np.array([0, 2]), np.array([1, 3])])
    assert [product.serial for product in products] == [6, 7]
    assert [product.from_first for product in products] == [1, 1]


@pytest.mark.parametrize(
    "members",
    [[[0], [1, 2], [3]], [[0, 1], [1]], [[0, 1]], [[0, 1, 2, 3]]],
    ids=["more", "twice", "fewer", "merged"],
)
def test_lost_or_made_primaries_are_an_error(members):
    population = SamplePopulation.of_primaries(synthetic.scene(population__initial=3))
    products = [synthetic.chain(len(m), 5e-7) if len(m) > 1 else Aggregate.monomer() for m in members]
    dimer = synthetic.chain(2, 5e-7)
    population.replace(0, 1, [dimer], [np.arange(2)])
    with pytest.raises(ConservationError):
        population.replace(0, 2, products, [np.array(m) for m in members])


def test_doubling_keeps_concentration_and_distribution():
    scene = synthetic.scene(population__initial=10)
    population = SamplePopulation.of_primaries(scene)
    population.replace(0, 1, [synthetic.chain(2, scene.suspension.radius)], [np.arange(2)])
    before, concentration = moments(population), population.number / population.volume
    population.double()
    assert moments(population) == before
    assert population.number / population.volume == concentration
    assert len(set(population.serials) - {-1}) == population.number


def test_streams_depend_on_seed_purpose_and_place_alone():
    draws = {
        (seed, purpose, place): stream(seed, purpose, *place).random(3).tobytes()
        for seed in (0, 1, 2**63 - 1)
        for purpose in ("proposals", "encounter")
        for place in ((0, 0), (0, 1), (1, 0), (2**40, 7))
    }
    assert len(set(draws.values())) == len(draws)
    assert all(stream(s, p, *x).random(3).tobytes() == draw for (s, p, x), draw in draws.items())
