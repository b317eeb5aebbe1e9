"""Encounters come at the rates of Eq. 2, whichever way they are drawn.

Statistical tests have fixed seeds, so they pass or fail for good; a correct program had a chance of SIGNIFICANCE to be
refused by each of them when its seed was chosen.
"""

from __future__ import annotations

import numpy as np
import pytest
import synthetic
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from mcdem.monte_carlo.event_selection import WAYS, EventSelection, event_selection
from mcdem.monte_carlo.event_selection.contract import encounter_rate
from mcdem.monte_carlo.event_selection.majorant_rejection import BLOCK, MajorantRejection, capacity_for
from mcdem.monte_carlo.population import SamplePopulation
from mcdem.monte_carlo.process import Process
from mcdem.quantities.random_streams import stream

SIGNIFICANCE = 1e-3


def polydisperse(scene, sizes) -> SamplePopulation:
    """Chains of the given sizes: outer radii P a."""
    radius = scene.suspension.radius
    population = SamplePopulation(radius, 1e-12)
    for size in sizes:
        population.add(synthetic.chain(size, radius))
    return population


def frequencies(population: SamplePopulation, shear_rate: float) -> np.ndarray:
    """f_ij of all pairs i < j, written from Eq. 2."""
    radii = np.array([a.outer_radius(population.primary_radius) for _, a in population])
    f = 4 / 3 * shear_rate * (radii[:, None] + radii[None, :]) ** 3 / population.volume
    return np.triu(f, 1)


def meetings(selection: EventSelection, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Times and pairs of encounters that change nothing."""
    found = []
    for _ in range(count):
        meeting = selection.ahead(1).meeting(0)
        selection.happened(meeting, [])
        found.append(meeting)
    return np.array([m.time for m in found]), np.array([sorted((m.first, m.second)) for m in found])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("sizes", [[1] * 5, [1, 1, 2, 3, 5, 8, 13, 40], [7, 9]])
def test_waiting_times_and_pairs_follow_the_frequencies(way, sizes):
    scene = synthetic.scene(numerics__event_selection=way)
    population = polydisperse(scene, sizes)
    times, pairs = meetings(event_selection(scene, population, seed=3), 4000)
    f = frequencies(population, scene.flow.shear_rate)
    waits = np.diff(times, prepend=0.0) * f.sum()
    assert stats.kstest(waits, "expon").pvalue > SIGNIFICANCE  # Eq. 4
    if len(sizes) > 2:
        index = np.triu_indices(len(sizes), 1)
        counts = np.zeros_like(f)
        np.add.at(counts, tuple(pairs.T), 1)
        expected = len(pairs) * f[index] / f.sum()
        assert stats.chisquare(counts[index], expected).pvalue > SIGNIFICANCE  # Eq. 5
    # A wait says nothing of the pair that ends it, nor of the next wait.
    is_first = (pairs == pairs[0]).all(axis=1)
    if 0 < is_first.sum() < len(pairs):
        assert stats.ks_2samp(waits[is_first], waits[~is_first]).pvalue > SIGNIFICANCE
    assert stats.spearmanr(waits[:-1], waits[1:]).pvalue > SIGNIFICANCE


def histories(way: str, encounter, replicas: int, events: int, fewest: int = 2, **changes) -> list[Process]:
    """Whole processes, without files, each with its own seed, until so many events or so few aggregates."""
    scene = synthetic.scene(numerics__event_selection=way, **changes)
    done = []
    for seed in range(replicas):
        process = Process.begin(scene, seed, ())
        while process.events < events and process.population.number >= fewest:
            meeting = process.selection.ahead(1).meeting(0)
            first, second = process.population.at(meeting.first), process.population.at(meeting.second)
            rng = stream(seed, "encounter", meeting.epoch, meeting.number)
            process.encounter(meeting, encounter(scene, first, second, seed=rng))
        done.append(process)
    return done


def test_both_ways_agree_while_aggregates_form_and_break():
    """Two-sample tests over 80 replicas of 200 encounters each, doublings and epochs included."""
    runs = {
        way: histories(way, synthetic.aggregation_and_breakup, 80, 200, population__initial=20)
        for way in WAYS
    }
    assert (
        min(run.population.volume for run in runs["majorant_rejection"])
        > SamplePopulation.of_primaries(runs["majorant_rejection"][0].scene).volume
    )
    assert min(run.selection.epoch for run in runs["majorant_rejection"]) >= 3
    for observe in (
        lambda run: run.time,
        lambda run: run.population.mean_size,
        lambda run: run.population.sauter_diameter,
        lambda run: run.record.events["parent_size"][-20:].mean(),
        lambda run: run.record.outcomes["aggregation"],
    ):
        clocks, inversion = ([observe(run) for run in runs[way]] for way in WAYS)
        assert stats.ks_2samp(clocks, inversion).pvalue > SIGNIFICANCE


@pytest.mark.parametrize("way", WAYS)
def test_constant_kernel_waits_as_marcus_and_lushnikov(way):
    """n aggregates merge at the rate n (n-1)/2 K: the times of the mergers are sums of independent waits."""
    start, end, replicas = 40, 5, 30
    runs = histories(
        way,
        synthetic.constant_kernel,
        replicas,
        10**6,
        fewest=end + 1,
        population__initial=start,
        population__doubling_below=0,
    )
    radius = runs[0].scene.suspension.radius
    rate = encounter_rate(runs[0].scene.flow.shear_rate, runs[0].population.volume) * (2 * radius) ** 3
    scaled = []
    for run in runs:
        number = run.record.series["number_of_aggregates"]
        merged = np.nonzero(np.diff(number))[0] + 1
        times = np.concatenate([[0.0], run.record.series["time"][merged]])
        before = number[merged - 1]
        waits = np.diff(times) * rate * before * (before - 1) / 2
        scaled.append(waits)
    waits = np.concatenate(scaled)
    assert len(waits) == replicas * (start - end)
    assert stats.kstest(waits, "expon").pvalue > SIGNIFICANCE


def test_constant_kernel_gives_smoluchowskis_sizes():
    """n_k = N0 tau^(k-1)/(1 + tau)^(k+1), tau = K c0 t/2 (Smoluchowski 1916), through several doublings."""
    scene = synthetic.scene(population__initial=4000)
    process = Process.begin(scene, 11, ())
    radius = scene.suspension.radius
    concentration = process.population.number / process.population.volume
    kernel = 4 / 3 * scene.flow.shear_rate * (2 * radius) ** 3
    end = 3.0 / (kernel * concentration / 2)
    while (meeting := process.selection.ahead(1).meeting(0)).time < end:
        first, second = process.population.at(meeting.first), process.population.at(meeting.second)
        rng = stream(11, "encounter", meeting.epoch, meeting.number)
        process.encounter(meeting, synthetic.constant_kernel(scene, first, second, seed=rng))
    assert process.population.volume > 3 * 4000 / concentration
    tau = 3.0
    sizes = process.population.sizes[process.population.sizes > 0]
    share = tau ** np.arange(12) / (1 + tau) ** np.arange(1, 13)
    counts = np.bincount(np.minimum(sizes, 13), minlength=14)[1:]
    # Copies are correlated: only the 4000 primaries of the start count as independent, as 1/(1 + tau) of aggregates.
    independent = 4000 / (1 + tau)
    expected = np.append(share, 1 - share.sum())
    statistic = independent * ((counts / counts.sum() - expected) ** 2 / expected).sum()
    assert stats.chi2.sf(statistic, len(expected) - 1) > SIGNIFICANCE
    number = process.population.number / process.population.volume / concentration
    # Var N = N0 tau (2 + tau).../... is at most N0/(1 + tau) for the Marcus-Lushnikov process: a safe error.
    assert number == pytest.approx(1 / (1 + tau), abs=3.3 * np.sqrt(independent) / 4000)


@given(st.lists(st.integers(1, 60), min_size=2, max_size=12), st.integers(0, 2**63 - 1))
def test_no_pair_is_rarer_than_it_should_be(sizes, seed):
    """Every class's bound holds its members, and every member has a slot of its own."""
    scene = synthetic.scene()
    population = polydisperse(scene, sizes)
    clocks = MajorantRejection(population, scene.flow.shear_rate, seed)
    for place, aggregate in population:
        slot = clocks._slot[place]
        held = int(np.searchsorted(clocks._base, slot, side="right")) - 1
        assert clocks.bounds[held] >= aggregate.outer_radius(population.primary_radius)
        assert clocks._place[slot] == place
    assert len(set(clocks._slot[: len(sizes)])) == len(sizes)


def test_rejection_is_bounded_whatever_the_sizes():
    """At worst, with one giant among primaries, one proposal in 100 is an encounter; a proposal takes some 10 ns."""
    scene = synthetic.scene()
    for sizes in ([1] * 300, [1] * 250 + [30], list(range(1, 60))):
        population = polydisperse(scene, sizes)
        clocks = MajorantRejection(population, scene.flow.shear_rate, 1)
        share = frequencies(population, scene.flow.shear_rate).sum() / clocks._cumulative[-1]
        assert share > 0.01


def test_capacity_leaves_room_in_every_class_up_to_one_beyond_the_largest():
    members = np.array([5, 0, 200, 0, 0, 0])
    capacity = capacity_for(members)
    assert (capacity[:4] > members[:4]).all()
    assert (capacity[4:] == 0).all()


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("events", [0, 1, 333, 1000])
def test_a_restored_selection_goes_on_with_the_same_encounters(way, events):
    (run,) = histories(way, synthetic.aggregation_and_breakup, 1, events, population__initial=50)
    known = run.selection.ahead(1000)
    population = run.population
    places, aggregates = zip(*population, strict=True)
    copy = SamplePopulation.restored(
        population.primary_radius,
        population.volume,
        population.next_serial,
        places,
        [population.serials[p] for p in places],
        aggregates,
    )
    restored = event_selection(run.scene, copy, 0, run.selection.state())
    again = restored.ahead(1000)
    assert again.epoch == known.epoch
    for name in ("times", "first", "second", "numbers"):
        assert np.array_equal(getattr(again, name), getattr(known, name))
    if way == "majorant_rejection":
        assert known.numbers[-1] > 2 * BLOCK


def test_a_single_aggregate_meets_nobody():
    for way in WAYS:
        scene = synthetic.scene(numerics__event_selection=way)
        assert len(event_selection(scene, polydisperse(scene, [3]), 1).ahead(5)) == 0
