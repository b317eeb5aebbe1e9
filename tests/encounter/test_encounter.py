"""One encounter: exact trajectories of two spheres, outcomes and their bookkeeping, and the two schemes against each other."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import threadpoolctl
from scipy import stats
from shapes import stack_of_octahedra, tetrahedron

import mcdem
from mcdem.effects.sums import contact_equilibrium, contact_force, contact_pull_off_gap
from mcdem.encounter.motion import integrate
from mcdem.encounter.simulate import OUTCOMES, classify, physics_of
from mcdem.errors import UserError
from mcdem.integrators.time_loop import follow_steps
from mcdem.quantities.linear_flows import draw_offset
from validation.exact import two_spheres

PAPER = mcdem.load_scene("scenes/paper-1000Pa.toml")
RADIUS, RATE, UNITS = PAPER.suspension.radius, PAPER.flow.shear_rate, PAPER.reduced
WITHOUT_SHORTCUTS = {
    "numerics.far_approach": 0.0,
    "numerics.separation": 0.0,
    "numerics.rigid_rotation": False,
    "numerics.end_stable": False,
}
# No attraction to speak of; the laws stay, so that the compiled steps are those of the other tests.
SMOOTH = PAPER.with_changes(
    {
        "effects.van_der_waals.hamaker_constant": "1e-60 J",
        "hydrodynamics.lubrication_cutoff": 0.0,
        "numerics.rotations": 1,
        "numerics.separation": 0.0,
    }
)
MONOMER = mcdem.Aggregate.monomer()
CONTACT = physics_of(PAPER)[1].contact


def encounter(scene, i=MONOMER, j=MONOMER, offset=(0.0, 1.0), **options):
    """An encounter with its offset in primary radii."""
    options.setdefault("seed", 0)
    return mcdem.simulate_encounter(scene, i, j, (offset[0] * RADIUS, offset[1] * RADIUS), **options)


def settled(shape):
    """An aggregate whose contacts are at their unloaded gap."""
    gap, _ = contact_equilibrium(1.0, CONTACT)
    return mcdem.Aggregate.from_positions(PAPER, shape()[0] * RADIUS * (1.0 + 0.5 * gap))


# Two spheres


def separation_path(scene, offset, interval=0.2):
    """(F, 3) separations of two primaries, in a, until they have passed."""
    record = mcdem.Recorder(interval=interval)
    result = encounter(scene, offset=offset, record=record)
    path = (record.positions[:, 1] - record.positions[:, 0]) / RADIUS
    return result, path[path[:, 2] < 9.0]


def distance_from_curve(points, curve):
    """(F,) distances of points from a polygon (K, 3)."""
    start, side = curve[:-1], np.diff(curve, axis=0)
    along = np.einsum("fkc,kc->fk", points[:, None] - start, side) / (side**2).sum(axis=1)
    nearest = start + np.clip(along, 0.0, 1.0)[..., None] * side
    return np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)


def exact_curve(offset):
    solution = two_spheres.trajectory(*offset)
    assert not solution.met
    return solution.sol(np.linspace(0.0, solution.t[-1], 6000)).T


@pytest.mark.parametrize("offset", [(0.0, 1.5), (0.3, 1.2), (0.7, 0.5), (0.0, 0.9)])
def test_free_pairs_follow_the_trajectories_of_batchelor_and_green(offset):
    curve = exact_curve(offset)
    nearest = np.linalg.norm(curve, axis=1).min() - 2.0
    errors = []
    for step in (0.1, 0.05, 0.025):
        scene = SMOOTH.with_changes({"numerics.implicit.max_step": step, "numerics.far_approach": 0.0})
        result, path = separation_path(scene, offset)
        assert result.outcome == "missed"
        assert result.smallest_gap / RADIUS == pytest.approx(nearest, rel=0.01)
        errors.append(distance_from_curve(path, curve).max())
    assert errors[0] < 4e-3
    assert errors[2] < 1e-4
    # Second order at least: a quarter on halving.
    assert errors[1] < errors[0] / 3.5 and errors[2] < errors[1] / 3.5


@pytest.mark.parametrize("offset", [(0.0, 1.5), (0.3, 1.2)])
def test_the_shortcut_of_the_approach_keeps_to_the_trajectory(offset):
    _, path = separation_path(SMOOTH.with_changes({"numerics.implicit.max_step": 0.1}), offset)
    assert distance_from_curve(path, exact_curve(offset)).max() < 4e-3


def test_pairs_that_stay_outside_the_cutoff_do_not_feel_it():
    offset = (0.0, 1.2)
    curve = exact_curve(offset)
    assert np.linalg.norm(curve, axis=1).min() - 2.0 > 5e-3
    paths = [
        separation_path(SMOOTH.with_changes({"hydrodynamics.lubrication_cutoff": delta}), offset)[1]
        for delta in (0.0, 5e-3)
    ]
    assert np.array_equal(*paths)


@pytest.mark.parametrize("offset", [(0.0, 1.5), (0.3, 1.2), (0.7, 0.8), (0.0, 0.9)])
def test_smooth_spheres_return_to_their_streamlines(offset):
    """Without attraction the passage is symmetric fore and aft; what is lost is the error of the step, third order here."""
    lost = []
    for step in (0.1, 0.05):
        scene = SMOOTH.with_changes({"numerics.implicit.max_step": step, "numerics.far_approach": 0.0})
        record = mcdem.Recorder(interval=0.1)
        encounter(scene, offset=offset, record=record)
        x, y, z = (record.positions[:, 1] - record.positions[:, 0]).T / RADIUS
        assert z.max() > 10.0
        lost.append(math.hypot(np.interp(10.0, z, x) - offset[0], np.interp(10.0, z, y) - offset[1]))
    assert lost[0] < 4e-3
    assert lost[1] < lost[0] / 5.0


def test_the_nearest_approach_of_smooth_spheres_tends_to_its_limit():
    """In the shear plane the gap falls to 4.4e-5 a at the edge of the closed orbits, and no further."""
    scene = SMOOTH.with_changes({"numerics.implicit.max_step": 0.025})
    gaps = []
    for y0 in (0.5, 0.2, 0.08, 0.05):
        found = encounter(scene, offset=(0.0, y0)).smallest_gap / RADIUS
        exact = np.linalg.norm(exact_curve((0.0, y0)), axis=1).min() - 2.0
        assert found == pytest.approx(exact, rel=0.03)
        gaps.append(found)
    assert gaps == sorted(gaps, reverse=True)
    assert gaps[-1] == pytest.approx(4.4e-5, rel=0.05)


def attraction(gap):
    """Van der Waals force of the paper's Eq. 11, retarded as Schenkel & Kitchener (1960) did, in 6 pi mu a^2 g."""
    law = PAPER.effects.get("van_der_waals")
    distance = gap * RADIUS + law.minimum_approach
    p = 2.0 * math.pi * distance / law.london_wavelength
    near = (1.0 + 3.54 * p) / (1.0 + 1.77 * p) ** 2
    retarded = near if p < 0.5709 else 0.98 / p - 0.434 / p**2 + 0.0674 / p**3
    return -law.hamaker_constant * RADIUS / (12.0 * distance**2) * retarded / UNITS.force


@pytest.mark.parametrize("x0", [0.0, 0.4])
def test_the_critical_offset_is_that_of_exact_trajectories(x0):
    """Without a cut-off nothing is modelled but Eq. 11: a library's integration decides between hit and miss alike."""
    scene = PAPER.with_changes({"hydrodynamics.lubrication_cutoff": 0.0, **WITHOUT_SHORTCUTS})
    refined = scene.with_changes({"numerics.implicit.max_step": 0.025})
    offset = mcdem.critical_offset(refined, x0 * RADIUS) / RADIUS
    for factor, caught in ((1.0 - 5e-4, True), (1.0 + 5e-4, False)):
        assert two_spheres.trajectory(x0, factor * offset, leave=6.0, force=attraction).met is caught
    assert mcdem.critical_offset(scene, x0 * RADIUS) / RADIUS == pytest.approx(offset, rel=2e-3)


@pytest.mark.parametrize("x0", [0.0, 0.3, 0.6, 0.8])
def test_the_critical_offset_is_converged_at_the_default_step(x0):
    """0.2 % against an eighth of the step without shortcuts; where the boundary is steep, in its distance from the centre."""
    fine = PAPER.with_changes(
        {"numerics.implicit.max_step": 0.0125, "numerics.rotations": 2, **WITHOUT_SHORTCUTS}
    )
    measured = mcdem.critical_offset(PAPER, x0 * RADIUS) / RADIUS
    # Only the bracket is followed at the fine step: the critical offset lies within it.
    tolerance = 2e-3 * (measured if x0 < 0.7 else (x0**2 + measured**2) / measured)
    assert encounter(fine, offset=(x0, measured - tolerance)).outcome == "aggregation"
    assert encounter(fine, offset=(x0, measured + tolerance)).outcome == "missed"


# A doublet


def static_tension(scene, gap):
    """Force that holds two primaries on the extension axis at `gap` against the flow, in 6 pi mu a^2 g."""
    n = np.array([0.0, 1.0, 1.0]) / math.sqrt(2)
    positions = np.array([np.zeros(3), (2.0 + gap) * n]) * RADIUS

    def rate(pull):
        forces = np.array([pull * n, -pull * n]) * UNITS.force
        return n @ np.diff(mcdem.velocities(scene, positions, forces).linear, axis=0)[0] / UNITS.velocity

    return rate(0.0) / (rate(0.0) - rate(1.0))


def test_doublet_tension_converges_to_statics():
    """A doublet turns through the extension axis; far from anything its contact bears what statics asks for."""
    gap = at_rest = contact_equilibrium(1.0, CONTACT)[0]
    for _ in range(5):  # the gap opens by a third under this load
        expected = static_tension(PAPER, gap)
        gaps = np.linspace(at_rest, contact_pull_off_gap(1.0, CONTACT), 2001)
        gap = gaps[np.argmin([abs(contact_force(h, 1.0, CONTACT)[0] + expected) for h in gaps])]
    rest = 1.0 + 0.5 * at_rest
    doublet = mcdem.Aggregate.from_positions(PAPER, np.array([[0, 0, -rest], [0, 0, rest]]) * RADIUS)
    errors = []
    for step in (0.1, 0.05, 0.025):
        scene = PAPER.with_changes(
            {
                "numerics.implicit.max_step": step,
                "numerics.rotations": 1,
                "numerics.start_distance": 25,
                **WITHOUT_SHORTCUTS,
            }
        )
        result = encounter(scene, doublet, MONOMER, (60.0, 20.0), orient=False)
        assert result.outcome == "missed"
        errors.append(abs(result.largest_tension / UNITS.force / expected - 1.0))
    assert errors[0] < 0.03
    assert errors[2] < 0.003
    assert errors[1] < errors[0] / 3.0 and errors[2] < errors[1] / 3.0


def test_the_cutoff_lowers_the_tension_in_a_doublet():
    """Touching spheres of the exact theory bear 6.12 pi mu a^2 g (Nir & Acrivos 1973); the frozen matrix 12 % less."""
    assert 6.0 * static_tension(PAPER, 0.0) == pytest.approx(0.88 * 6.12, rel=0.01)
    by_gap = PAPER.with_changes({"hydrodynamics.cutoff_convention": "gap"})
    assert 6.0 * static_tension(by_gap, 0.0) == pytest.approx(6.12, rel=0.005)


# Bookkeeping


def test_outcomes_follow_from_identities():
    def sets(*members):
        return tuple(np.array(m) for m in members)

    assert classify(sets([0, 1], [2, 3]), 2, False) == "missed"
    assert classify(sets([0, 1], [2, 3]), 2, True) == "parted"
    assert classify(sets([0, 1, 2, 3]), 2, True) == "aggregation"
    assert classify(sets([0, 2], [1, 3]), 2, True) == "exchange"
    assert classify(sets([0], [1, 2, 3]), 2, True) == "exchange"
    assert classify(sets([0], [1], [2, 3]), 2, True) == "fragmentation"
    # A parent that splits by itself, with no contact made.
    assert classify(sets([0], [1], [2, 3]), 2, False) == "fragmentation"


def starts():
    """Committed starts, made by tests/data/make_encounter_starts.py: (aggregate i, aggregate j, offset [m])."""
    with np.load(Path(__file__).parents[1] / "data" / "encounter_starts.npz") as stored:
        at, bond_at = (np.cumsum(stored[name].ravel())[:-1] for name in ("sizes", "bond_counts"))
        positions, bonds = np.split(stored["positions"], at), np.split(stored["bonds"], bond_at)
        offsets = stored["offsets"]
    aggregates = [mcdem.Aggregate(p, b) for p, b in zip(positions, bonds)]
    return [(i, j, tuple(o)) for i, j, o in zip(aggregates[::2], aggregates[1::2], offsets)]


@cache
def all_encounters(**changes):
    """The committed encounters, oriented as they are stored, under changed numerics."""
    scene = PAPER.with_changes({f"numerics.{key}": value for key, value in changes.items()})
    return [mcdem.simulate_encounter(scene, i, j, o, seed=0, orient=False) for i, j, o in starts()]


def test_primaries_are_conserved_with_their_identities():
    for (i, j, _), result in zip(starts(), all_encounters()):
        assert result.outcome in OUTCOMES
        assert np.array_equal(np.sort(np.concatenate(result.members)), np.arange(i.size + j.size))
        assert [p.size for p in result.products] == [len(m) for m in result.members]
        assert result.contact == (not math.isnan(result.first_contact_time))
        for product in result.products:
            assert np.abs(product.positions.mean(axis=0)).max() < 1e-12
            gaps = np.linalg.norm(product.positions[:, None] - product.positions[None], axis=2) - 2 * RADIUS
            reach = PAPER.kernels.contact.pull_off_gap * RADIUS
            i_, j_ = product.bonds.T
            assert (gaps[i_, j_] <= reach * (1 + 1e-9)).all()
            np.fill_diagonal(gaps, np.inf)
            assert gaps.min() > -0.01 * RADIUS
        unchanged = {frozenset(range(i.size)), frozenset(range(i.size, i.size + j.size))}
        same = {frozenset(m.tolist()) for m in result.members} == unchanged
        assert same == (result.outcome in ("missed", "parted"))


def test_the_seed_decides_everything():
    i, j = settled(tetrahedron), settled(lambda: stack_of_octahedra(2))
    first, again, other = (mcdem.simulate_encounter(PAPER, i, j, seed=seed) for seed in (7, 7, 8))
    for name in ("outcome", "offset", "simulated_time", "smallest_gap", "largest_tension", "steps"):
        assert getattr(first, name) == getattr(again, name)
    assert np.array_equal(first.centres, again.centres)
    for one, two in zip(first.products, again.products):
        assert np.array_equal(one.positions, two.positions) and np.array_equal(one.bonds, two.bonds)
    assert other.offset != first.offset


def test_offsets_follow_the_flux():
    """Density proportional to y in the half circle: r^3 and the cosine from the vorticity axis are uniform.

    20 000 draws; Kolmogorov-Smirnov at 0.1 %, which sees a shift of either distribution by 0.014.
    """
    rng = np.random.default_rng(11)
    x, y = np.array([draw_offset(PAPER.flow, 3.0, rng) for _ in range(20_000)]).T
    r = np.hypot(x, y)
    assert r.max() <= 3.0 and y.min() > 0.0
    assert stats.kstest((r / 3.0) ** 3, "uniform").pvalue > 1e-3
    assert stats.kstest(x / r, "uniform", args=(-1.0, 2.0)).pvalue > 1e-3


def test_drawn_encounters_use_that_law():
    scene = PAPER.with_changes({"numerics.rotations": 0})
    drawn = mcdem.simulate_encounter(scene, MONOMER, MONOMER, seed=5).offset
    assert drawn == draw_offset(PAPER.flow, 2.0 * RADIUS, np.random.default_rng(5))


@pytest.mark.parametrize("y0", [0.5, -0.5, 1.3])
def test_an_encounter_lasts_as_long_as_eq_21_says(y0):
    result = encounter(PAPER, offset=(1.9, y0))
    assert result.simulated_time * RATE == pytest.approx(10.0 / abs(y0) + 4.0 * math.pi * 8.0)
    assert result.offset == (1.9 * RADIUS, y0 * RADIUS)


def test_an_offset_below_the_axis_is_the_mirror_image():
    above, below = (encounter(PAPER, offset=(0.3, y0)) for y0 in (0.5, -0.5))
    assert above.outcome == below.outcome == "aggregation"
    assert above.first_contact_time == pytest.approx(below.first_contact_time, rel=1e-9)


def test_an_approach_that_is_cut_before_they_meet_is_an_outcome_of_its_own():
    cut = PAPER.with_changes({"numerics.longest_approach": 20.0, "numerics.rotations": 0.5})
    result = encounter(cut, settled(tetrahedron), MONOMER, (0.5, 0.0))
    assert result.outcome == "unresolved"
    assert result.reason == "the approach is longer than numerics.longest_approach"
    assert [p.size for p in result.products] == [4, 1]
    assert [m.tolist() for m in result.members] == [[0, 1, 2, 3], [4]]


@pytest.mark.parametrize(("x0", "outcome"), [(0.0, "aggregation"), (1.6, "missed")])
def test_two_primaries_draw_each_other_in_where_the_undisturbed_flow_stands_still(x0, outcome):
    """At y0 = 0 they start on a closed orbit at its furthest, dy/dt = (8/3) (a/z)^4 g a: they come, and the end is known."""
    result = encounter(PAPER, offset=(x0, 0.0))
    assert result.outcome == outcome
    assert result.smallest_gap < 0.2 * RADIUS
    if outcome == "aggregation":
        assert 100.0 < result.first_contact_time * PAPER.flow.shear_rate < 400.0


def test_steps_are_limited_in_words():
    result = encounter(PAPER.with_changes({"numerics.most_steps": 20}), offset=(0.0, 0.5))
    assert (result.outcome, result.reason) == ("unresolved", "more steps than numerics.most_steps")


@pytest.mark.parametrize(
    ("positions", "words"),
    [
        ([[0, 0, 0], [0, 0, 1.5]], r"primaries 0 and 1 overlap by 0.5 radii.*move them apart"),
        ([[0, 0, 0], [0, 0, 3.0]], "2 parts that do not touch"),
        ([[0, 0, math.nan]], r"positions: nan at \(0, 2\) is not finite"),
        ([[0, 0]], r"expected an array \(N, 3\) of lengths"),
    ],
)
def test_what_is_no_aggregate_is_refused(positions, words):
    with pytest.raises(UserError, match=words):
        mcdem.simulate_encounter(PAPER, np.array(positions) * RADIUS, np.zeros((1, 3)), seed=0)


def test_offsets_that_are_no_numbers_are_refused():
    with pytest.raises(UserError, match=r"offset.[01]. = .* is not finite"):
        mcdem.simulate_encounter(PAPER, MONOMER, MONOMER, (math.nan, 0.0), seed=0)


def test_the_layout_of_positions_in_memory_does_not_matter():
    """Neither to the result nor to the compiler, which would take a minute for another layout."""
    shape = settled(tetrahedron)
    by_columns = mcdem.Aggregate(np.asfortranarray(shape.positions), shape.bonds)
    rows = encounter(PAPER, shape, shape, (0.5, 1.5), orient=False)
    compiled = len(follow_steps.kernel.signatures)
    columns = encounter(PAPER, by_columns, by_columns, (0.5, 1.5), orient=False)
    assert len(follow_steps.kernel.signatures) == compiled
    assert np.array_equal(rows.centres, columns.centres)


def test_linear_algebra_runs_on_one_thread(monkeypatch):
    """Whoever calls: on a busy machine, threads that wait for each other cost up to a hundredfold."""
    seen = []

    def threads():
        # Not those of loops over many spheres, which another library runs.
        return [
            library["num_threads"]
            for library in threadpoolctl.threadpool_info()
            if library["user_api"] == "blas"
        ]

    def spy(*arguments):
        seen.extend(threads())
        return integrate(*arguments)

    monkeypatch.setattr("mcdem.encounter.simulate.integrate", spy)
    with threadpoolctl.threadpool_limits(limits=2):
        encounter(PAPER, offset=(0.0, 1.9))
        after = set(threads())
    assert seen and set(seen) == {1}
    assert after == {2}


def test_recording_does_not_change_an_encounter():
    i, j, offset = next(s for s, r in zip(starts(), all_encounters()) if r.contact)
    plain = mcdem.simulate_encounter(PAPER, i, j, offset, seed=0, orient=False)
    record = mcdem.Recorder(interval=0.5)
    filmed = mcdem.simulate_encounter(PAPER, i, j, offset, seed=0, orient=False, record=record)
    assert filmed.outcome == plain.outcome
    assert filmed.first_contact_time == plain.first_contact_time
    assert record.positions.shape == (len(record.time), i.size + j.size, 3)


def filmed(interval=0.5, **changes):
    """Two tetrahedra that miss each other, recorded; positions (F, 8, 3) in a, tensions over the pull-off force."""
    record = mcdem.Recorder(interval=interval)
    scene = PAPER.with_changes({"numerics.rotations": 1, **changes})
    two = settled(tetrahedron), settled(tetrahedron)
    assert encounter(scene, *two, offset=(0.5, 6.5), record=record).outcome == "missed"
    pull_off = PAPER.kernels.contact.pull_off_force * UNITS.force
    return record.time * RATE, record.positions / RADIUS, record.tension / pull_off


def passages(scene, **options):
    """Two octahedra and a tetrahedron pass each other at offsets from near to far."""
    pair = settled(lambda: stack_of_octahedra(2)), settled(tetrahedron)
    return [
        encounter(scene, *pair, offset=(0.3 * y, y), seed=seed, **options)
        for seed, y in enumerate((2.0, 2.8, 3.2, 3.6, 4.4))
    ]


def test_a_sure_miss_is_the_miss_that_all_primaries_make():
    quick = passages(PAPER)
    whole = passages(PAPER.with_changes({"numerics.sure_miss": 0.0}))
    assert [r.outcome for r in quick] == [r.outcome for r in whole]
    gaps = np.array([[r.smallest_gap for r in results] for results in (quick, whole)]) / RADIUS
    assert np.abs(gaps[0] - gaps[1]).max() < 0.05
    # Those with a small gap are followed by primaries there, and only there.
    near = [(q.steps, w.steps) for q, w in zip(quick, whole, strict=True) if q.smallest_gap < 0.4 * RADIUS]
    assert near and all(0 < q < w for q, w in near)
    taken = [r.steps == 0 for r in quick]
    assert taken == [r.smallest_gap / RADIUS > 0.5 for r in quick]
    assert 0 < sum(taken) < len(taken) and not any(r.steps == 0 for r in whole)
    assert [r.simulated_time for r in quick] == [r.simulated_time for r in whole]


@pytest.mark.parametrize(
    "changes",
    [
        # A million times the attraction moves primaries half a radius apart.
        {"effects.van_der_waals.hamaker_constant": "1e-14 J"},
        # Without parts that go on alone there is no time after the passage.
        {"numerics.separation": 0.0},
        # A contact would bear more than this.
        {"numerics.rigid_load_limit": 0.05},
    ],
)
def test_a_miss_is_not_sure_where_it_may_matter(changes):
    assert all(r.steps > 0 for r in passages(PAPER.with_changes({**changes, "numerics.rotations": 0.5})))


def test_a_sure_miss_can_be_watched():
    scene = PAPER.with_changes({"numerics.rotations": 0.5})
    record = mcdem.Recorder(interval=0.25)
    pair = settled(lambda: stack_of_octahedra(2)), settled(tetrahedron)
    result = encounter(scene, *pair, offset=(1.0, 4.4), record=record)
    assert result.steps == 0
    side = record.parent == 0
    away = record.positions[:, ~side].mean(axis=1) - record.positions[:, side].mean(axis=1)
    together = np.flatnonzero(np.linalg.norm(away, axis=1) < 15.0 * RADIUS)
    # Before the passage, during it, and no jump: the relative velocity of the flow at that height is what moves them.
    assert len(together) > 10
    strides = np.diff(away[together], axis=0) / (0.25 * RADIUS)
    assert np.abs(strides[:, 2] - away[together][:-1, 1] / RADIUS).max() < 1.5
    gaps = np.linalg.norm(
        record.positions[:, side][:, :, None] - record.positions[:, ~side][:, None], axis=-1
    )
    assert gaps[together].min() / RADIUS - 2.0 == pytest.approx(result.smallest_gap / RADIUS, abs=0.1)


def test_a_film_shows_the_tensions_of_bodies_that_turn():
    """Of rigid bodies by statics; they are those of the primaries followed one by one, at every moment."""
    short_steps = {"numerics.implicit.max_step": 0.05}  # tensions are those of the step's end
    strain, positions, tension = filmed(**short_steps)
    _, positions_too, followed = filmed(**WITHOUT_SHORTCUTS, **short_steps)
    assert np.array_equal(np.isfinite(tension), np.isfinite(followed))
    bonds = np.isfinite(tension[0])
    # At the start the gaps of the primaries know nothing of the flow yet.
    tension, followed = tension[1:, bonds], followed[1:, bonds]
    swing = np.ptp(followed, axis=0)
    assert swing.min() > 0.1  # as they turn
    assert np.abs(tension - followed).max() < 0.1 * swing.min()
    together = strain < 3.8  # until they go on alone
    assert np.abs(positions - positions_too)[together].max() < 0.01


def test_a_frame_shows_its_own_moment():
    """However far apart frames are, and however long the steps."""
    strain, coarse, _ = filmed(interval=0.34)
    _, fine, _ = filmed(interval=0.17)
    together = int((strain < 5.0).sum())
    assert np.abs(coarse[:together] - fine[: 2 * together : 2]).max() < 5e-3


# The two schemes

CHEAP_STARTS = (6, 12, 14, 24, 29)
"""A few of the 32, one of which touches and stays, two touch and part, two miss.  Not 7 or 28: they turn about each other for
long at the edge of touching, and their outcomes change with the step."""


def outcomes_and_contacts(numbers, changes=None):
    """Outcome and time of first contact of some of the committed encounters, one rotation after the approach."""
    scene = PAPER.with_changes({"numerics.rotations": 1} | (changes or {}))
    chosen = [starts()[k] for k in numbers]
    results = [mcdem.simulate_encounter(scene, i, j, o, seed=0, orient=False) for i, j, o in chosen]
    return [r.outcome for r in results], np.array([r.first_contact_time for r in results])


EXPLICIT = {"numerics.scheme": "explicit_euler", "numerics.explicit_euler.step_velocity": "normal"}


def test_implicit_and_explicit_steps_agree():
    implicit, touched = outcomes_and_contacts(CHEAP_STARTS)
    explicit, touched_too = outcomes_and_contacts(CHEAP_STARTS, EXPLICIT)
    assert implicit == explicit
    assert set(implicit) >= {"missed", "parted", "aggregation"}
    assert touched == pytest.approx(touched_too, rel=0.03, nan_ok=True)


@pytest.mark.slow
def test_the_schemes_agree_on_every_outcome_as_both_steps_are_refined():
    """32 encounters of 2 to 8 primaries, 13 of which touch.

    Steps: implicit from 0.2/g, explicit from the paper's 1 us, which is at 0.9 of a contact's relaxation time.  The bound of
    Eq. 20 is kept, read by the normal component (see the next test for its literal convention).
    """
    numbers = range(len(starts()))
    assert len(numbers) >= 30
    agreeing, lags = [], []
    for factor in (1.0, 0.5, 0.25):
        implicit, touched = outcomes_and_contacts(numbers, {"numerics.implicit.max_step": 0.2 * factor})
        explicit, touched_too = outcomes_and_contacts(
            numbers, EXPLICIT | {"numerics.explicit_euler.base_step": f"{factor} us"}
        )
        agreeing.append(sum(a == b for a, b in zip(implicit, explicit)))
        lags.append(np.nanmedian(np.abs(touched - touched_too)) * RATE)
    assert agreeing == sorted(agreeing)
    assert agreeing[0] >= 30
    assert agreeing[2] == len(numbers)
    assert np.isfinite(touched).sum() >= 10
    assert lags[0] < 0.05
    assert lags[2] < lags[0] / 2.0


@pytest.mark.slow
def test_the_literal_reading_of_eq_20_agrees_too():
    implicit, touched = outcomes_and_contacts(CHEAP_STARTS)
    literal, touched_too = outcomes_and_contacts(
        CHEAP_STARTS, EXPLICIT | {"numerics.explicit_euler.step_velocity": "relative"}
    )
    assert implicit == literal
    assert touched == pytest.approx(touched_too, rel=0.03, nan_ok=True)
