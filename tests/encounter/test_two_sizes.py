"""Primaries of several radii: exact pairs, what does not depend on the name of a size, geometry, population and dataset."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

import mcdem
from mcdem.aggregates.aggregate import Aggregate
from mcdem.aggregates.morphology import morphology
from mcdem.analysis.dataset import RunDataset
from mcdem.effects.sums import contact_equilibrium
from mcdem.encounter import trajectory
from mcdem.encounter.capture_efficiency import pair_efficiency
from mcdem.encounter.simulate import Recorder, physics_of
from mcdem.errors import UserError
from mcdem.figures import draw_all, plot_run
from mcdem.figures.report import report
from mcdem.hydrodynamics import LEVELS, matrix_free
from mcdem.hydrodynamics.grand_mobility import five_to_tensor
from mcdem.hydrodynamics.resistance import workspace
from mcdem.hydrodynamics.two_sphere import tables as two_sphere
from mcdem.hydrodynamics.two_sphere import tensors as pair_tensors
from mcdem.hydrodynamics.velocities import solve_velocities
from mcdem.kernel_tables import tabulate
from mcdem.monte_carlo.population import SamplePopulation, shares_of
from mcdem.monte_carlo.run_control import run
from mcdem.rigid_aggregates.statics import RIGID, analyse

SCENE = mcdem.load_scene("scenes/two-sizes.toml")
LARGE, SMALL = (Aggregate.monomer(radius) for radius in SCENE.suspension.radii)
# Without a table of lubrication: the code compiled for one radius serves.
COARSE = SCENE.with_changes({"hydrodynamics.level": "free_draining"})
EXACT = SCENE.with_changes({"hydrodynamics.lubrication_cutoff": 0.0})


def of_ratio(ratio: float, **changes):
    return EXACT.with_changes({"suspension.radii": ["500 nm", f"{ratio * 500!r} nm"], **changes})


def packed(scene, count: int, seed: int):
    """Positions (N, 3) and radii (N,) [m] of spheres of a scene put one by one at gaps up to a tenth of a radius."""
    rng = np.random.default_rng(seed)
    radii = rng.permutation(np.resize(scene.suspension.species, count))
    places = [np.zeros(3)]
    while len(places) < count:
        n, partner = len(places), rng.integers(len(places))
        direction = rng.normal(size=3)
        reach = radii[n] + radii[partner] + 5e-8 * rng.random()
        trial = places[partner] + reach * direction / np.linalg.norm(direction)
        if min(np.linalg.norm(trial - p) - r - radii[n] for p, r in zip(places, radii)) >= 0.0:
            places.append(trial)
    return np.array(places), radii


# Hydrodynamics


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize("gap", [1e-4, 0.02, 0.4, 3.0])
@pytest.mark.parametrize("ratio", [0.5, 0.25, pytest.param(0.1, marks=pytest.mark.slow)])
def test_unequal_pairs_move_as_two_exact_spheres(ratio, gap, order):
    """Loads that the exact two-sphere functions say give chosen motions in a strain do give them, and their stresslets."""
    scene = of_ratio(ratio)
    units, rng = scene.reduced, np.random.default_rng(3)
    radii = np.array(scene.reduced_radii)[list(order)]
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    positions = np.array([np.zeros(3), direction * (radii.sum() + gap)])
    flow, _ = physics_of(scene)
    five = np.tensordot(pair_tensors.STRAIN_BASIS, flow.strain, axes=2)
    rates = np.concatenate([rng.normal(size=12), -five, -five])
    # The functions are in units of the first sphere: F ~ a, T and S ~ a^2 for rates of 1/a and 1.
    first = radii[0]
    resistance = two_sphere.resistance_matrix(direction, gap / first, radii[1] / first)
    scale = np.r_[np.full(6, 1.0), np.full(16, first)]
    load = first * (resistance * np.outer(scale, scale)) @ rates
    found = mcdem.velocities(
        scene,
        positions * units.length,
        load[:6].reshape(2, 3) * units.force,
        load[6:12].reshape(2, 3) * units.energy,
        radii=radii * units.length,
    )
    spin = 0.5 * (flow.gradient - flow.gradient.T)[[2, 0, 1], [1, 2, 0]]
    linear = found.linear / units.velocity - positions @ flow.gradient.T
    angular = found.angular * units.time - spin
    assert linear == pytest.approx(rates[:6].reshape(2, 3), abs=3e-7)
    assert angular == pytest.approx(rates[6:12].reshape(2, 3), abs=3e-7 / ratio)
    stresslets = -five_to_tensor(load[12:].reshape(2, 5))
    assert found.stresslet / units.energy == pytest.approx(stresslets, abs=1e-7 * np.abs(stresslets).max())


@pytest.mark.parametrize("level", LEVELS)
def test_spheres_of_one_size_move_as_if_there_were_no_other(level):
    """The small ones of two sizes alone, against a suspension of their size; the cut-off is a length, over either radius."""
    mixed = SCENE.with_changes({"hydrodynamics.level": level})
    changes = {"radius": "250 nm", "radii": None, "number_fractions": None}
    alone = mixed.with_changes({f"suspension.{key}": value for key, value in changes.items()})
    if LEVELS[level].lubrication:
        delta = mixed.hydrodynamics.lubrication_cutoff
        alone = alone.with_changes({"hydrodynamics.lubrication_cutoff": 2.0 * delta})
    rng = np.random.default_rng(5)
    positions, _ = packed(alone, 6, 5)
    forces = mixed.reduced.force * rng.normal(size=positions.shape)
    torques = mixed.reduced.energy * rng.normal(size=positions.shape)
    ours = mcdem.velocities(mixed, positions, forces, torques, radii=np.full(6, 250e-9))
    theirs = mcdem.velocities(alone, positions, forces, torques)
    for name in ("linear", "angular", "stresslet"):
        expected = getattr(theirs, name)
        assert getattr(ours, name) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())


def test_velocities_do_not_depend_on_numbering_place_or_orientation():
    scene = SCENE.with_changes({"flow.kind": "uniaxial_extension"})
    positions, radii = packed(scene, 9, 2)
    rng = np.random.default_rng(8)
    forces = scene.reduced.force * rng.normal(size=positions.shape)
    whole = mcdem.velocities(scene, positions, forces, radii=radii)
    order = rng.permutation(9)
    renumbered = mcdem.velocities(scene, positions[order], forces[order], radii=radii[order])
    assert renumbered.linear == pytest.approx(whole.linear[order], abs=1e-10 * np.abs(whole.linear).max())
    assert renumbered.angular == pytest.approx(whole.angular[order], abs=1e-10 * np.abs(whole.angular).max())
    # About its axis the flow looks the same.
    turn = Rotation.from_euler("z", 0.7)
    turned = mcdem.velocities(scene, turn.apply(positions), turn.apply(forces), radii=radii)
    assert turned.linear == pytest.approx(turn.apply(whole.linear), abs=1e-10 * np.abs(whole.linear).max())


@pytest.mark.slow
def test_resistance_of_packed_unequal_spheres_is_positive_and_iteration_agrees_with_the_dense_solve():
    scene = of_ratio(0.25)
    positions, radii = packed(scene, 40, 4)
    flow, physics = physics_of(scene)
    unit = scene.reduced.length
    rng = np.random.default_rng(0)
    loads = rng.normal(size=(2, 40, 3))
    spheres, five = (positions / unit, radii / unit, flow, *loads), np.empty((40, 5))
    code, linear, angular = solve_velocities(physics.level, workspace(40), *spheres, five)
    assert code == 0
    found = matrix_free.solve_velocities(physics.level, *spheres)
    assert found.linear == pytest.approx(linear, abs=1e-5 * np.abs(linear).max())
    assert found.angular == pytest.approx(angular, abs=1e-5 * np.abs(angular).max())
    assert found.stresslet == pytest.approx(five, abs=1e-5 * np.abs(five).max())


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.5, 0.25])
def test_a_touching_doublet_turns_as_its_two_exact_spheres_do(ratio):
    """Held at one distance by a force along the line of centres, free to spin: statics of rigid bodies against the functions."""
    scene = of_ratio(ratio)
    flow, physics = physics_of(scene)
    radii = np.array(scene.reduced_radii)
    direction = np.array([0.2, 0.6, np.sqrt(0.6)])
    gap = 0.002
    positions = np.outer([0.0, radii.sum() + gap], direction)
    five = np.tensordot(pair_tensors.STRAIN_BASIS, flow.strain, axes=2)
    R = two_sphere.resistance_matrix(direction, gap, ratio)
    # Unknowns: six velocities less the flow, six spins less the flow's, the force that holds them; no loads but that force.
    matrix, right = np.zeros((13, 13)), np.zeros(13)
    matrix[:12, :12] = R[:12, :12]
    matrix[:6, 12] = matrix[12, :6] = np.r_[direction, -direction]
    right[:12] = R[:12, 12:] @ np.r_[five, five]
    right[12] = direction @ (flow.gradient @ (positions[1] - positions[0]))
    moved = np.linalg.solve(matrix, right)
    apart = moved[3:6] - moved[:3] + flow.gradient @ (positions[1] - positions[0])
    expected = np.cross(direction, apart) / (radii.sum() + gap)

    bonded = np.array([[False, True], [True, False]])
    exact = physics._replace(
        level=LEVELS["stokesian"].build(0.0, False, scene.reduced_radii), pair_forces=(), resistances=()
    )
    code, body = analyse(workspace(2), positions - positions.mean(axis=0), bonded, radii, exact)
    assert code == RIGID
    spin = 0.5 * (flow.gradient - flow.gradient.T)[[2, 0, 1], [1, 2, 0]] + body.spin @ five
    across = spin - (spin @ direction) * direction
    assert across == pytest.approx(expected, abs=1e-6)
    # What pulls the contact apart is the force that holds it.
    assert body.response[0] @ five == pytest.approx(-moved[12], abs=1e-6)


# Geometry


def test_an_aggregate_is_about_its_centre_of_mass_and_reaches_to_its_furthest_surface():
    places = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 750e-9]])
    doublet = Aggregate.from_positions(SCENE, places, radii=[500e-9, 250e-9])
    share = 1.0 / 9.0  # of the volume, in the small one
    assert doublet.positions[:, 2] == pytest.approx([-share * 750e-9, (1 - share) * 750e-9])
    assert doublet.outer_radius(500e-9) == pytest.approx((1 - share) * 750e-9 + 250e-9)
    assert doublet.bonds.tolist() == [[0, 1]]
    turned = doublet.turned(np.random.default_rng(1))
    assert turned.outer_radius(500e-9) == pytest.approx(doublet.outer_radius(500e-9))
    assert turned.radii is doublet.radii
    shape = morphology(places, [[0, 1]], 500e-9, radii=doublet.radii)
    gyration = math.sqrt(share * (1 - share)) * 750e-9
    assert float(shape["radius_of_gyration"]) == pytest.approx(gyration)
    assert float(shape["outer_radius"]) == pytest.approx(doublet.outer_radius(500e-9))
    volume = 500e-9**3 + 250e-9**3
    assert float(shape["solid_fraction_sphere"]) == pytest.approx(volume / doublet.outer_radius(0.0) ** 3)
    assert shape["semi_axes"].values == pytest.approx([math.sqrt(5.0) * gyration, 500e-9, 500e-9])


def test_contacts_are_read_off_gaps_up_to_the_pull_off_of_the_two_radii():
    pull_off = SCENE.kernels.contact.pull_off_gap * SCENE.suspension.radius * (2.0 / 3.0) ** (1.0 / 3.0)
    for gap, bonds in ((0.99 * pull_off, 1), (1.01 * pull_off, 0)):
        places = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 750e-9 + gap]])
        if bonds:
            assert len(Aggregate.from_positions(SCENE, places, radii=[500e-9, 250e-9]).bonds) == 1
        else:
            with pytest.raises(UserError, match="2 parts that do not touch"):
                Aggregate.from_positions(SCENE, places, radii=[500e-9, 250e-9])


def test_radii_are_asked_for_where_there_are_several_and_must_be_of_the_scene():
    places = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 750e-9]])
    with pytest.raises(UserError, match=r"has several, 5e-07 m and 2.5e-07 m: give that of each primary"):
        Aggregate.from_positions(SCENE, places)
    with pytest.raises(UserError, match=r"primary 1 has 3e-07 m, expected 5e-07 m or 2.5e-07 m"):
        Aggregate.from_positions(SCENE, places, radii=[500e-9, 300e-9])
    with pytest.raises(UserError, match="one for each of 2 primaries"):
        Aggregate.from_positions(SCENE, places, radii=[500e-9])
    with pytest.raises(UserError, match="has several"):
        mcdem.simulate_encounter(SCENE, Aggregate.monomer(), SMALL)
    one = mcdem.load_scene("scenes/paper-1000Pa.toml")
    with pytest.raises(UserError, match=r"primary 0 has 2.5e-07 m, expected 5e-07 m"):
        mcdem.simulate_encounter(one, SMALL, SMALL)


# Encounters


def test_a_small_primary_sticks_to_a_large_one_at_the_gap_of_their_reduced_radius(tmp_path):
    recorder = Recorder()
    offset = (0.0, 50e-9)
    result = mcdem.simulate_encounter(COARSE, LARGE, SMALL, offset=offset, seed=0, record=recorder)
    assert result.outcome == "aggregation"
    (product,) = result.products
    assert product.radii.tolist() == [500e-9, 250e-9]
    assert product.radii**3 @ product.positions == pytest.approx(np.zeros(3), abs=1e-30)
    reduced, contact = 2.0 / 3.0, COARSE.effects.contact
    rest = contact_equilibrium(reduced, physics_of(COARSE)[1].contact)[0] * 500e-9
    gap = np.linalg.norm(product.positions[1] - product.positions[0]) - 750e-9
    loaded = result.largest_tension / contact.pull_off_force(500e-9 * reduced)
    assert 0.0 < loaded < 1.0
    # Up to the load over the stiffness 1.8 F_adh/L with L = 3/2 of the overlap; that of two large ones is 14 % more.
    assert abs(gap - rest) < 1.5 / 1.8 * loaded * abs(rest) < 0.14 * abs(rest)
    course = trajectory.Trajectory.of_encounter(COARSE, recorder, result)
    trajectory.write(course, tmp_path / "course.nc")
    again = trajectory.read(tmp_path / "course.nc")
    assert again.radii == pytest.approx([500e-9, 250e-9])
    assert again.part(0, 2).radii is again.radii


def test_a_course_of_small_primaries_alone_keeps_their_radius(tmp_path):
    still, none = np.zeros((1, 2, 3)), np.full((1, 2, 2), np.nan)
    still[0, 1, 2] = 1e-6
    course = trajectory.Trajectory(
        500e-9, 1e4, 1e-8, np.zeros(1), still, none, np.array([0, 1]), {}, np.full(2, 250e-9)
    )
    trajectory.write(course, tmp_path / "course.nc")
    assert trajectory.read(tmp_path / "course.nc").each_radius == pytest.approx([250e-9, 250e-9])


def test_it_does_not_matter_which_of_two_sizes_is_called_first():
    """The encounter seen from the other one, at the same offset."""
    found = [
        mcdem.simulate_encounter(COARSE, *pair, offset=(100e-9, 350e-9), seed=0)
        for pair in ((LARGE, SMALL), (SMALL, LARGE))
    ]
    assert found[0].outcome == found[1].outcome
    assert found[0].smallest_gap == pytest.approx(found[1].smallest_gap, rel=1e-9)


# SamplePopulation and dataset


def test_numbers_of_each_size_are_the_nearest_that_add_up():
    assert shares_of(200, (0.5, 0.5)) == [100, 100]
    assert shares_of(10, (1 / 3, 2 / 3)) == [3, 7]
    assert shares_of(7, (0.5, 0.3, 0.2)) == [4, 2, 1]
    assert shares_of(100, (0.29, 0.71)) == [29, 71]


def volume_by_size(aggregates) -> dict[float, int]:
    radii = np.concatenate([a.radii for a in aggregates])
    values, counts = np.unique(radii, return_counts=True)
    return dict(zip(values.tolist(), counts.tolist()))


def test_the_start_has_the_volume_fraction_and_a_run_keeps_the_primaries_of_each_size(tmp_path):
    scene = COARSE.with_changes({"population.initial": 12, "run.until": None, "run.snapshot_every": "20 ms"})
    start = SamplePopulation.of_primaries(scene)
    solid = 4 / 3 * np.pi * sum(a.radii[0] ** 3 for _, a in start)
    assert solid / start.volume == pytest.approx(scene.suspension.volume_fraction, rel=1e-12)
    assert volume_by_size(a for _, a in start) == {250e-9: 6, 500e-9: 6}

    path = tmp_path / "run.nc"
    run(scene, path, events=14, seed=3)
    whole = RunDataset(path)
    assert (whole.outcome == "aggregation").any()
    assert (whole.outcome != "unresolved").all()
    for snapshot in range(len(whole.snapshot_times)):
        counts = volume_by_size(whole.aggregates(snapshot))
        assert counts[250e-9] == counts[500e-9]
        assert sum(counts.values()) == whole.population(snapshot)["size"].sum()
    last = whole.aggregates()
    table = whole.population()
    for k, aggregate in enumerate(last):
        assert aggregate.radii**3 @ aggregate.positions == pytest.approx(np.zeros(3), abs=1e-30)
        assert float(table["outer_radius"][k]) == pytest.approx(aggregate.outer_radius(0.0), rel=1e-12)
    with xr.open_dataset(path, group="snapshots") as stored:
        assert stored["radius"].attrs["units"] == "m"

    # Stopped and resumed it is the same, and another radius is refused.
    parts = tmp_path / "parts.nc"
    run(scene, parts, events=6, seed=3)
    run(scene, parts, events=14, seed=3, resume=True)
    for ours, theirs in zip(RunDataset(parts).aggregates(), last, strict=True):
        assert np.array_equal(ours.positions, theirs.positions)
        assert np.array_equal(ours.radii, theirs.radii)
    other = scene.with_changes({"suspension.number_fractions": [0.25, 0.75]})
    with pytest.raises(UserError, match=r"suspension\.number_fractions"):
        run(other, parts, events=16, seed=3, resume=True)

    plot_run(path, tmp_path / "course.png")
    assert (tmp_path / "course.png").stat().st_size > 10_000
    for refused in (lambda: list(draw_all([path], tmp_path / "figures")), lambda: report(path)):
        with pytest.raises(UserError, match="radii names 2 sizes, expected one"):
            refused()


def test_a_suspension_of_one_radius_keeps_none(tmp_path):
    one = mcdem.load_scene("scenes/free-draining-1000Pa.toml").with_changes({"population.initial": 4})
    run(one, tmp_path / "run.nc", events=1)
    with xr.open_dataset(tmp_path / "run.nc", group="snapshots") as stored:
        assert "radius" not in stored
    assert all(a.radii is None for a in RunDataset(tmp_path / "run.nc").aggregates())


def test_what_holds_for_one_radius_only_says_so(tmp_path):
    with pytest.raises(UserError, match="eta_11 is that of two equal primaries"):
        pair_efficiency(SCENE)
    with pytest.raises(UserError, match="counts equal primaries"):
        tabulate(SCENE, tmp_path / "table.nc", [])
    assert math.isnan(mcdem.encounter.capture_efficiency.van_de_ven_mason(SCENE))


def critical_share(first: Aggregate, second: Aggregate) -> float:
    """Largest offset along the gradient at which two primaries end as a doublet, over R_i + R_j."""
    reach = first.outer_radius(0.0) + second.outer_radius(0.0)
    low, high = 0.01, 0.9
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        result = mcdem.simulate_encounter(SCENE, first, second, offset=(0.0, middle * reach), seed=0)
        low, high = (middle, high) if result.outcome == "aggregation" else (low, middle)
    return 0.5 * (low + high)


@pytest.mark.slow
def test_the_scene_runs_and_unequal_primaries_meet_and_stick(tmp_path):
    """With lubrication: unequal primaries end as doublets, bonded at the gap of their reduced radius."""
    near = mcdem.simulate_encounter(SCENE, LARGE, SMALL, offset=(0.0, 50e-9), seed=0)
    assert near.outcome == "aggregation"
    # The question of the scene: captured offsets y0 < y_c along the gradient, over R_i + R_j.  A small one is carried round a
    # large one, more than equal ones are round each other; the smaller pair attracts itself more strongly against the flow.
    captured = [critical_share(*pair) for pair in ((LARGE, SMALL), (LARGE, LARGE), (SMALL, SMALL))]
    assert captured == pytest.approx([0.3307, 0.4158, 0.4775], abs=0.002)
    run(SCENE, tmp_path / "run.nc", events=60)
    found = RunDataset(tmp_path / "run.nc")
    assert (found.outcome != "unresolved").all()
    assert (found.outcome == "aggregation").any()
