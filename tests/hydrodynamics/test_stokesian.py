"""Velocities of free spheres: exact pairs, published chains, and the laws that any number of spheres keeps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import hcp_ball, icosahedron

import mcdem
from mcdem.encounter.simulate import physics_of
from mcdem.errors import UserError
from mcdem.hydrodynamics import grand_mobility as far_field
from mcdem.hydrodynamics.resistance import workspace
from mcdem.hydrodynamics.two_sphere import tables as two_sphere
from mcdem.hydrodynamics.two_sphere import tensors as pair_tensors
from mcdem.hydrodynamics.undisturbed_flow import UndisturbedFlow
from mcdem.hydrodynamics.velocities import solve_velocities

FULL = mcdem.load_scene("scenes/paper-1000Pa.toml").with_changes({"hydrodynamics.lubrication_cutoff": 0.0})
UNITS = FULL.reduced
LEVELS = {
    level: FULL.with_changes({"hydrodynamics.level": level, "hydrodynamics.lubrication_cutoff": None})
    for level in ("free_draining", "rotne_prager", "fts")
} | {"stokesian": FULL}
ALL = LEVELS | {
    f"delta = {delta:g}": FULL.with_changes({"hydrodynamics.lubrication_cutoff": delta})
    for delta in (1e-4, 5e-3)
}
STRAIN = np.array([[0, 0, 0], [0, 0, 0.5], [0, 0.5, 0]])  # of the shear u = g y e_z, over g
SPIN = np.array([0.5, 0.0, 0.0])


def velocities(positions, forces=None, torques=None, scene=FULL):
    """linear, angular and stresslet in units of a, 1/g and 6 pi mu a^2 g."""
    found = mcdem.velocities(
        scene,
        np.asarray(positions) * UNITS.length,
        None if forces is None else np.asarray(forces) * UNITS.force,
        None if torques is None else np.asarray(torques) * UNITS.energy,
    )
    return found.linear / UNITS.velocity, found.angular * UNITS.time, found.stresslet / UNITS.energy


def undisturbed(positions):
    flow = np.zeros_like(positions)
    flow[:, 2] = positions[:, 1]
    return flow


def random_cluster(n, seed, spread=0.05):
    """Spheres put one by one at gaps up to `spread` from another one."""
    rng = np.random.default_rng(seed)
    positions = [np.zeros(3)]
    while len(positions) < n:
        step = rng.normal(size=3)
        trial = positions[rng.integers(len(positions))] + (
            2.0 + spread * rng.random()
        ) * step / np.linalg.norm(step)
        if min(np.linalg.norm(trial - p) for p in positions) >= 2.0:
            positions.append(trial)
    return np.array(positions)


def mobility(positions, scene=FULL):
    """(6N, 6N) velocities and spins of unit forces and torques, column by column."""
    n = len(positions)
    still = np.concatenate([part.ravel() for part in velocities(positions, scene=scene)[:2]])
    columns = []
    for k in range(6 * n):
        load = np.zeros(6 * n)
        load[k] = 1.0
        forces, torques = load[: 3 * n].reshape(n, 3), load[3 * n :].reshape(n, 3)
        moved = velocities(positions, forces, torques, scene)[:2]
        columns.append(np.concatenate([part.ravel() for part in moved]) - still)
    return np.array(columns).T


# Truths


@pytest.mark.parametrize("level", LEVELS)
def test_a_single_sphere_follows_the_flow_and_obeys_stokes_and_einstein(level):
    scene = LEVELS[level]
    x = np.array([[0.3, -1.2, 0.7]])
    linear, angular, _ = velocities(x, scene=scene)
    assert linear == pytest.approx(undisturbed(x), abs=1e-14)
    assert angular[0] == pytest.approx(SPIN, abs=1e-14)
    radius, viscosity, rate = FULL.suspension.radius, FULL.flow.viscosity, FULL.flow.shear_rate
    in_si = mcdem.velocities(scene, x * radius).stresslet[0]
    assert in_si == pytest.approx(20 / 3 * math.pi * viscosity * radius**3 * rate * STRAIN, rel=1e-12)
    pulled, turned, _ = velocities(x, [[2.0, 0.0, 0.0]], [[0.0, 3.0, 0.0]], scene)
    assert (pulled - linear)[0] == pytest.approx([2.0, 0.0, 0.0], abs=1e-14)
    assert (turned - angular)[0] == pytest.approx([0.0, 3.0 * 0.75, 0.0], abs=1e-14)


def exact_pair(positions, forces, torques, functions=two_sphere.exact):
    """Motion and stresslets of two spheres from the resistance functions of a pair alone, without the grand mobility."""
    separation = positions[1] - positions[0]
    distance = np.linalg.norm(separation)
    resistance = two_sphere.resistance_matrix(separation / distance, distance - 2.0, 1.0, functions)
    five = np.tensordot(pair_tensors.STRAIN_BASIS, STRAIN, axes=2)
    strain = np.concatenate([five, five])
    load = np.concatenate([forces.ravel(), torques.ravel()])
    rates = np.linalg.solve(resistance[:12, :12], load + resistance[:12, 12:] @ strain)
    stresslets = resistance[12:, :12] @ rates - resistance[12:, 12:] @ strain
    linear = rates[:6].reshape(2, 3) + undisturbed(positions)
    angular = rates[6:].reshape(2, 3) + SPIN
    return linear, angular, -np.tensordot(stresslets.reshape(2, 5), pair_tensors.STRAIN_BASIS, axes=1)


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("distance", [2.001, 2.003, 2.01, 2.03, 2.1, 2.3, 2.7, 3.0, 3.5, 4.0, 5.0, 6.0])
def test_pairs_move_as_two_exact_spheres(distance, loaded):
    rng = np.random.default_rng(int(1000 * distance))
    for _ in range(3):
        direction = rng.normal(size=3)
        positions = np.array([np.zeros(3), distance * direction / np.linalg.norm(direction)])
        forces, torques = rng.normal(size=(2, 2, 3)) * loaded
        ours = velocities(positions, forces, torques)
        theirs = exact_pair(positions, forces, torques)
        flow = undisturbed(positions), np.tile(SPIN, (2, 1)), np.zeros((2, 3, 3))
        for mine, exact, carried in zip(ours, theirs, flow):
            # What the spheres add to the flow, relative to the largest component.
            assert np.abs(mine - exact).max() < 2e-4 * np.abs(exact - carried).max()


@pytest.mark.parametrize("distance", [2.0, 2.3, 4.0])
def test_fts_pairs_are_the_far_field_of_two_spheres(distance):
    rng = np.random.default_rng(int(10 * distance))
    direction = rng.normal(size=3)
    positions = np.array([np.zeros(3), distance * direction / np.linalg.norm(direction)])
    forces, torques = rng.normal(size=(2, 2, 3))
    ours = velocities(positions, forces, torques, LEVELS["fts"])
    theirs = exact_pair(positions, forces, torques, two_sphere.far_field)
    for mine, expected in zip(ours, theirs):
        assert mine == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_spheres_of_free_draining_do_not_feel_each_other():
    positions = random_cluster(9, 2)
    forces, torques = np.random.default_rng(3).normal(size=(2, 9, 3))
    linear, angular, stresslet = velocities(positions, forces, torques, LEVELS["free_draining"])
    assert linear == pytest.approx(undisturbed(positions) + forces, abs=1e-13)
    assert angular == pytest.approx(SPIN + 0.75 * torques, abs=1e-13)
    assert stresslet == pytest.approx(np.tile(10 / 9 * STRAIN, (9, 1, 1)), abs=1e-13)


def test_force_torque_spheres_are_carried_by_the_flow_and_settle_as_rotne_and_prager_say():
    """1 and (3/2) r^-1 - r^-3 along the line, (3/4) r^-1 + (1/2) r^-3 across, -(3/4) r^-2 for the spin; a = 1."""
    r = 2.7
    positions = np.array([[0.0, 0.0, 0.0], [r, 0.0, 0.0]])
    linear, angular, _ = velocities(
        positions, [[2.0, 3.0, 0.0], [0.0, 0.0, 0.0]], scene=LEVELS["rotne_prager"]
    )
    moved = linear - undisturbed(positions)
    assert moved[0] == pytest.approx([2.0, 3.0, 0.0], abs=1e-12)
    assert moved[1] == pytest.approx(
        [2.0 * (1.5 / r - r**-3), 3.0 * (0.75 / r + 0.5 * r**-3), 0.0], rel=1e-12, abs=1e-12
    )
    # A point force F along y turns the fluid on its +x side clockwise: curl u/2 = (3/4) F x r/r^3.
    assert (angular - SPIN)[1] == pytest.approx([0.0, 0.0, -3.0 * 0.75 / r**2], rel=1e-12, abs=1e-12)
    assert (angular - SPIN)[0] == pytest.approx(np.zeros(3), abs=1e-12)


def test_what_a_level_leaves_out_falls_with_its_power_of_the_distance():
    """A sphere's own mobility near another one is 1 - (15/4) r^-4 + O(r^-6) along the line (Kim & Karrila 1991, ch. 11)."""

    def own(level, distance):
        x = np.array([[0.0, 0.0, 0.0], [distance, 0.0, 0.0]])
        return velocities(x, [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]], scene=LEVELS[level])[0][0, 0]

    # r = 12 and 24: far enough for the leading power, near enough for round-off.
    missing = {level: [own(level, r) - own("stokesian", r) for r in (12.0, 24.0)] for level in LEVELS}
    assert missing["free_draining"] == pytest.approx([15 / 4 * r**-4 for r in (12.0, 24.0)], rel=0.05)
    assert missing["rotne_prager"] == pytest.approx(missing["free_draining"], rel=1e-9)
    assert missing["fts"][0] / missing["fts"][1] == pytest.approx(64.0, rel=0.1)
    assert abs(missing["fts"][0]) < 0.1 * missing["rotne_prager"][0]


@pytest.mark.parametrize("distance", [2.001, 2.1, 3.0, 6.0])
def test_lubrication_keeps_a_pairs_gap_to_2e_4_of_its_rate(distance):
    """The approach of nearly touching spheres is a thousandth of the velocities, so it is asked for by itself."""
    rng = np.random.default_rng(3)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    positions = np.array([np.zeros(3), distance * direction])
    forces = np.array([-direction, direction])
    for load in (0.0 * forces, forces):
        rates = [
            direction @ np.diff(linear, axis=0)[0]
            for linear in (velocities(positions, load)[0], exact_pair(positions, load, 0.0 * load)[0])
        ]
        assert rates[0] == pytest.approx(rates[1], rel=2e-4)


@pytest.mark.parametrize(
    ("distance", "opposite", "same"),
    [(2.01, 53.42229365, 0.645722078), (2.1, 7.413297607, 0.650900145), (3.0, 2.038654644, 0.698304560)],
)
def test_drag_along_the_line_is_stimson_and_jefferys(distance, opposite, same):
    positions = np.array([[0, 0, 0], [distance, 0, 0.0]])  # along vorticity, where the shear does not act
    for sign, drag in ((-1.0, opposite), (1.0, same)):
        linear = velocities(positions, [[sign, 0, 0], [1.0, 0, 0]])[0]
        assert 1.0 / linear[1, 0] == pytest.approx(drag, rel=1e-6)
        assert linear[0, 0] == pytest.approx(sign * linear[1, 0], rel=1e-12)


@pytest.mark.parametrize(("distance", "a", "b"), [(2.1, 0.7324360, 0.1555507), (3.0, 0.1866626, 0.0222800)])
def test_a_pair_in_shear_moves_as_batchelor_and_green_say(distance, a, b):
    """V = omega x r + E.r - [A nn + B (1 - nn)].E.r, at directions that mix extension and rotation."""
    for angle in (0.25 * math.pi, 0.1, -0.6, 1.3):
        n = np.array([0.0, math.sin(angle), math.cos(angle)])
        r = distance * n
        linear = velocities([np.zeros(3), r])[0]
        strained = STRAIN @ r
        expected = np.cross(SPIN, r) + strained - a * n * (n @ strained) - b * (strained - n * (n @ strained))
        assert linear[1] - linear[0] == pytest.approx(expected, abs=2e-6)


def test_a_doublet_on_the_extension_axis_parts_slower_than_the_flow():
    """1.5 g a undisturbed, 1.5 (1 - A(3)) = 1.220 g a; the wrong sign of the strain gives 1.780."""
    n = np.array([0, 1, 1]) / math.sqrt(2)
    linear = velocities([np.zeros(3), 3.0 * n])[0]
    assert n @ (linear[1] - linear[0]) == pytest.approx(1.220, abs=5e-4)
    compressed = np.array([0, 1, -1]) / math.sqrt(2)
    linear = velocities([np.zeros(3), 3.0 * compressed])[0]
    assert compressed @ (linear[1] - linear[0]) == pytest.approx(-1.220, abs=5e-4)


def test_chain_of_fifteen_durlofsky_brady_bossis_1987():
    """Their Fig. 1: fifteen spheres 4a apart settle across their line under equal forces; F/(6 pi mu a U), centre to end.

    Read off the figure, to a thousandth.
    """
    digitised = [0.5018, 0.5029, 0.5054, 0.5102, 0.5183, 0.5321, 0.5559, 0.6170]
    positions = 4.0 * np.arange(15)[:, None] * [1.0, 0.0, 0.0]
    linear = velocities(positions, np.tile([0.0, 1.0, 0.0], (15, 1)))[0]
    assert linear == pytest.approx(linear[::-1], rel=1e-10)
    assert 1.0 / linear[7:, 1] == pytest.approx(digitised, abs=1e-3)


# Laws


def rotated_velocities(positions, forces, torques, turn, scene):
    """The compiled solver in a turned laboratory: everything turned, the flow's gradient too."""
    physics = physics_of(scene)[1]
    gradient = np.zeros((3, 3))
    gradient[2, 1] = 1.0
    gradient = turn @ gradient @ turn.T
    strain = 0.5 * (gradient + gradient.T)
    five = np.empty(5)
    far_field.tensor_to_five(strain, five)
    stresslet = np.empty((len(positions), 5))
    code, linear, angular = solve_velocities(
        physics.level,
        workspace(len(positions)),
        positions @ turn.T,
        np.ones(len(positions)),
        UndisturbedFlow(gradient, strain, five),
        forces @ turn.T,
        torques @ turn.T,
        stresslet,
    )
    assert code == 0
    back = turn.T @ far_field.five_to_tensor(stresslet) @ turn
    return linear @ turn, angular @ turn, back


@pytest.mark.parametrize("scene", ALL.values(), ids=ALL)
@pytest.mark.parametrize("n", [2, 5, 16])
def test_velocities_turn_with_the_laboratory(n, scene):
    rng = np.random.default_rng(n)
    positions = random_cluster(n, n)
    forces, torques = rng.normal(size=(2, n, 3))
    here = rotated_velocities(positions, forces, torques, np.eye(3), scene)
    for mine, public in zip(here, velocities(positions, forces, torques, scene)):
        assert mine == pytest.approx(public, rel=1e-10, abs=1e-12)
    for turn in Rotation.random(4, rng=rng).as_matrix():
        for mine, there in zip(here, rotated_velocities(positions, forces, torques, turn, scene)):
            assert np.abs(mine - there).max() < 1e-10 * np.abs(mine).max()


@pytest.mark.parametrize("level", LEVELS)
def test_velocities_know_no_place_and_no_numbering(level):
    scene = LEVELS[level]
    positions = random_cluster(9, 1)
    rng = np.random.default_rng(4)
    forces, torques = rng.normal(size=(2, 9, 3))
    linear, angular, stresslet = velocities(positions, forces, torques, scene)
    shift = np.array([5.0, -7.0, 11.0])
    moved = velocities(positions + shift, forces, torques, scene)
    assert moved[0] == pytest.approx(linear + [0, 0, shift[1]], rel=1e-10, abs=1e-10)
    assert moved[1] == pytest.approx(angular, rel=1e-10, abs=1e-10)
    order = rng.permutation(9)
    shuffled = velocities(positions[order], forces[order], torques[order], scene)
    for mine, other in zip((linear, angular, stresslet), shuffled):
        assert other == pytest.approx(mine[order], rel=1e-10, abs=1e-10)


CLUSTERS = {
    "random": random_cluster(12, 7),
    "touching": random_cluster(12, 8, spread=0.0),
    "hcp of 13": hcp_ball(2.0)[0],
    "icosahedron": icosahedron()[0],
    "hcp pressed": hcp_ball(2.0)[0] * (1.0 - 3e-4),
}


@pytest.mark.parametrize("name", CLUSTERS)
@pytest.mark.parametrize("cutoff", [1e-4, 1e-3, 5e-3, 1e-2])
def test_mobility_is_symmetric_and_positive_definite(name, cutoff):
    scene = FULL.with_changes({"hydrodynamics.lubrication_cutoff": cutoff})
    response = mobility(CLUSTERS[name], scene)
    assert np.abs(response - response.T).max() < 1e-9 * np.abs(response).max()
    values = np.linalg.eigvalsh(0.5 * (response + response.T))
    # Two spheres pressed together at the cut-off yield least: X^A is 1/(4 cutoff), shared by twelve neighbours.
    assert 0.1 * cutoff < values.min() < values.max() < len(CLUSTERS[name])


@pytest.mark.parametrize("name", CLUSTERS)
@pytest.mark.parametrize("level", ["free_draining", "rotne_prager", "fts"])
def test_mobility_without_lubrication_is_symmetric_and_positive_definite(name, level):
    response = mobility(CLUSTERS[name], LEVELS[level])
    assert np.abs(response - response.T).max() < 1e-9 * np.abs(response).max()
    values = np.linalg.eigvalsh(0.5 * (response + response.T))
    assert 0.02 < values.min() < values.max() < len(CLUSTERS[name])


@pytest.mark.parametrize("scene", ALL.values(), ids=ALL)
@pytest.mark.parametrize(
    "positions",
    [
        random_cluster(3, 0, 1e-4),
        random_cluster(60, 1, 0.0),
        hcp_ball(4.0)[0],
        hcp_ball(4.0)[0] * 1.0005,
        hcp_ball(4.0)[0] * (1.0 - 6e-4),
    ],
    ids=["three", "sixty touching", "hcp of 57", "hcp at gaps of 0.001", "hcp pressed"],
)
def test_resistance_can_be_factorised_however_dense(positions, scene):
    """A Cholesky factor exists of positive definite matrices only; `velocities` raises without one."""
    linear, angular, _ = velocities(positions, scene=scene)
    assert np.abs(angular).max() < 10.0
    assert np.abs(linear).max() < 2.0 * np.abs(positions).max()


@pytest.mark.parametrize("level", LEVELS)
def test_forces_act_linearly_and_dissipate(level):
    scene = LEVELS[level]
    positions = random_cluster(8, 5)
    rng = np.random.default_rng(6)
    loads = rng.normal(size=(3, 2, 8, 3))
    loads[2] = 2.0 * loads[0] - 0.5 * loads[1]
    still = velocities(positions, scene=scene)
    added = [
        [part - rest for part, rest in zip(velocities(positions, *load, scene), still)] for load in loads
    ]
    for first, second, both in zip(*added):
        assert both == pytest.approx(2.0 * first - 0.5 * second, abs=1e-9)
    for (forces, torques), (linear, angular, _) in zip(loads, added):
        assert (forces * linear).sum() + (torques * angular).sum() > 0.0


@pytest.mark.parametrize("level", LEVELS)
def test_stresslets_and_velocities_are_reciprocal(level):
    """Lorentz: what the strain does to spheres and what forces do to stresslets is one coupling."""
    positions = random_cluster(7, 9)
    rng = np.random.default_rng(10)
    forces, torques = rng.normal(size=(2, 7, 3))
    linear, angular, stresslet = velocities(positions, scene=LEVELS[level])
    loaded = velocities(positions, forces, torques, LEVELS[level])[2] - stresslet
    power = (forces * (linear - undisturbed(positions))).sum() + (torques * (angular - SPIN)).sum()
    assert (loaded * STRAIN).sum() == pytest.approx(-power, rel=1e-9, abs=1e-12)
    assert (power == pytest.approx(0.0, abs=1e-12)) == (not LEVELS[level].hydrodynamics.stresslets)


@pytest.mark.parametrize("level", LEVELS)
def test_free_spheres_make_a_suspension_more_viscous(level):
    """Rigid free spheres dissipate more than the fluid in their place, at least as much as each alone would.

    Of the far field that is not asked: it holds their surfaces rigid in the lowest moments only, and so dissipates less.
    """
    for seed in range(4):
        positions = random_cluster(10, seed)
        stresslet = velocities(positions, scene=LEVELS[level])[2]
        assert stresslet == pytest.approx(np.swapaxes(stresslet, 1, 2), abs=1e-12)
        assert np.trace(stresslet, axis1=1, axis2=2) == pytest.approx(0.0, abs=1e-12)
        alone = 10 * 10 / 9 * (STRAIN**2).sum()
        if level == "stokesian":
            assert (stresslet * STRAIN).sum() > alone
        elif level == "fts":
            assert 0.0 < (stresslet * STRAIN).sum() < (velocities(positions)[2] * STRAIN).sum()
        else:
            assert (stresslet * STRAIN).sum() == pytest.approx(alone, rel=1e-12)


def test_a_cutoff_acts_below_it_only():
    near, far = np.array([[0, 0, 0], [0, 0, 2.004]]), np.array([[0, 0, 0], [0, 0, 2.006]])
    push = np.array([[0, 0, 1.0], [0, 0, -1.0]])
    cut = FULL.with_changes({"hydrodynamics.lubrication_cutoff": 5e-3})
    assert velocities(far, push, scene=cut)[0] == pytest.approx(velocities(far, push)[0], rel=1e-12)
    closing = [np.diff(velocities(near, push, scene=scene)[0][:, 2])[0] for scene in (FULL, cut)]
    assert closing[1] == pytest.approx(closing[0] * 5 / 4, rel=0.02)  # X^A goes as the inverse of the gap


def test_the_two_readings_of_the_cutoff_differ_in_the_strain_alone():
    positions = np.array([[0, 0, 0], [0, 1, 1.0]]) * 2.002 / math.sqrt(2)
    matrix, gap = (
        FULL.with_changes(
            {"hydrodynamics.lubrication_cutoff": 5e-3, "hydrodynamics.cutoff_convention": convention}
        )
        for convention in ("matrix", "gap")
    )
    forces = np.array([[1.0, 0, 0], [-1.0, 0.5, 0]])
    by_force = [
        velocities(positions, forces, scene=scene)[0] - velocities(positions, scene=scene)[0]
        for scene in (matrix, gap)
    ]
    assert by_force[0] == pytest.approx(by_force[1], rel=1e-12)
    n = positions[1] / np.linalg.norm(positions[1])
    at_cutoff = n @ np.diff(velocities(n * np.array([[0.0], [2.005]]), scene=FULL)[0], axis=0)[0]
    frozen = n @ np.diff(velocities(positions, scene=gap)[0], axis=0)[0]
    assert frozen == pytest.approx(at_cutoff, rel=2e-3)


# Refusals


@pytest.mark.parametrize(
    ("positions", "forces", "words"),
    [
        ([[0.0, 0.0]], None, r"positions: expected an array \(N, 3\) of lengths, .* found shape \(1, 2\)"),
        ([[0.0, 0.0, math.nan]], None, r"positions: nan at \(0, 2\) is not finite"),
        ([[0.0, 0.0, 0.0]], [[0.0, 0.0, math.inf]], r"forces: inf at \(0, 2\) is not finite"),
        ([[0.0, 0.0, 0.0]], [[0.0] * 3] * 2, r"forces: expected an array \(1, 3\) of forces"),
        ([[0.0, 0.0, 0.0], [0.0, 0.0, 1e-7]], None, "spheres 0 and 1 overlap by 1.8 radii"),
    ],
)
def test_bad_input_is_answered_by_its_name(positions, forces, words):
    with pytest.raises(UserError, match=words):
        mcdem.velocities(FULL, positions, forces)
