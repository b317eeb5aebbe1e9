"""The coarser levels of hydrodynamics in encounters and in the statics of rigid aggregates."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import octahedron, stack_of_octahedra, tetrahedron

import mcdem
from mcdem.analysis.paired_encounters import draw_pairs, level_changes
from mcdem.effects.sums import contact_equilibrium
from mcdem.encounter.motion import analysed
from mcdem.encounter.simulate import OUTCOMES, physics_of, shortcuts_of
from mcdem.hydrodynamics import MENU
from mcdem.hydrodynamics.grand_mobility import tensor_to_five
from mcdem.integrators import state

PAPER = mcdem.load_scene("scenes/paper-1000Pa.toml")
RADIUS, RATE = PAPER.suspension.radius, PAPER.flow.shear_rate
LEVELS = {level: PAPER.with_changes(level_changes(level)) for level in MENU}
MONOMER = mcdem.Aggregate.monomer()
GRADIENT = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
STRAIN = 0.5 * (GRADIENT + GRADIENT.T)
ORIENTATION = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]


def five(tensor):
    out = np.empty(5)
    tensor_to_five(np.ascontiguousarray(tensor), out)
    return out


def rigid_body(scene, positions):
    """The analysed body of touching spheres at positions (P, 3) [a], a little turned and pressed to contact."""
    n = len(positions)
    physics = physics_of(scene)[1]
    placed = (
        np.asarray(positions) @ ORIENTATION.T * (1.0 + 0.5 * contact_equilibrium(1.0, physics.contact)[0])
    )
    apart = np.linalg.norm(placed[:, None] - placed[None], axis=2)
    bonded = (apart < 2.0 + 1e-6) & ~np.eye(n, dtype=bool)
    part = state.Motion(placed, np.zeros((n, 3)), bonded, np.zeros((n, n)), np.ones(n), np.zeros(n, np.int64))
    body, centre = analysed(part, physics)
    assert body is not None
    return body, placed - centre


@pytest.mark.parametrize("level", LEVELS)
def test_rigid_bodies_move_as_free_spheres_do_that_their_bonds_hold(level):
    """Tensions of the statics, given to free spheres as forces, keep these moving as one body in the scene's flow."""
    scene = LEVELS[level]
    body, x = rigid_body(scene, octahedron()[0])
    tensions, forces, bond = body.response @ five(STRAIN), np.zeros_like(x), 0
    for i in range(len(x)):
        for j in range(i):
            apart = x[i] - x[j]
            if np.linalg.norm(apart) < 2.0 + 1e-6:
                forces[i] -= tensions[bond] * apart / np.linalg.norm(apart)
                forces[j] += tensions[bond] * apart / np.linalg.norm(apart)
                bond += 1
    assert bond == len(tensions) == 12
    units = scene.reduced
    linear = mcdem.velocities(scene, x * units.length, forces * units.force).linear / units.velocity
    spin = [0.5, 0.0, 0.0] + body.spin @ five(STRAIN)
    assert linear == pytest.approx(np.cross(spin, x) + body.drift @ five(STRAIN), abs=1e-9)
    assert np.abs(linear - x @ GRADIENT.T).max() > 0.1


def test_a_rigid_body_of_free_draining_turns_as_its_drag_says():
    """sum x X (E x - Omega X x) = 0: every sphere is dragged in proportion to its velocity, and none resists its own spin."""
    body, x = rigid_body(LEVELS["free_draining"], stack_of_octahedra(2)[0])
    inertia = (x**2).sum() * np.eye(3) - x.T @ x
    torque = np.cross(x, x @ STRAIN).sum(axis=0)
    assert body.spin @ five(STRAIN) == pytest.approx(np.linalg.solve(inertia, torque), abs=1e-9)
    assert body.drift == pytest.approx(np.zeros((3, 5)), abs=1e-12)


def test_a_doublet_of_free_draining_is_rigid_in_any_orientation():
    """It turns as a thin rod does, Omega = n x E n, and is left without a spin about its own axis, which nothing resists."""
    rng = np.random.default_rng(6)
    for n in [np.array([0.0, 0.0, 1.0]), *rng.normal(size=(5, 3))]:
        body, x = rigid_body(LEVELS["free_draining"], np.stack([-n, n]) / np.linalg.norm(n))
        n = x[0] / np.linalg.norm(x[0])
        spin = body.spin @ five(STRAIN)
        assert abs(spin @ n) < 1e-3
        assert spin - spin @ n * n == pytest.approx(np.cross(n, STRAIN @ n), abs=1e-9)


def test_levels_without_stresslets_do_not_approach_by_them():
    taken = {level: shortcuts_of(scene).far_approach > 0.0 for level, scene in LEVELS.items()}
    assert taken == {"free_draining": False, "rotne_prager": False, "fts": True, "stokesian": True}


def test_primaries_of_free_draining_meet_as_their_straight_paths_do():
    """Without attraction to speak of, a pair touches if it starts within 2a, and else passes at its offset."""
    scene = LEVELS["free_draining"].with_changes(
        {"effects.van_der_waals.hamaker_constant": "1e-60 J", "numerics.rotations": 1}
    )
    for x0, y0 in ((0.0, 1.99), (1.2, 1.59), (1.9, 0.6)):
        assert mcdem.simulate_encounter(scene, MONOMER, MONOMER, offset=(x0 * RADIUS, y0 * RADIUS)).contact
    for x0, y0 in ((0.0, 2.05), (1.3, 1.59)):
        passed = mcdem.simulate_encounter(scene, MONOMER, MONOMER, offset=(x0 * RADIUS, y0 * RADIUS))
        assert passed.outcome == "missed"
        # The gap is seen at steps of at most a tenth of a strain, where the pair moves by 0.1 y0 past the nearest point.
        nearest = np.hypot(x0, y0) - 2.0
        assert nearest <= passed.smallest_gap / RADIUS + 1e-9 <= nearest + (0.1 * y0) ** 2


def test_encounters_of_a_run_come_to_a_named_end_in_free_draining():
    """Without interactions nothing slows primaries down that attract each other: the hardest level to step through."""
    scene = LEVELS["free_draining"]
    pairs = draw_pairs(scene, ["tests/monte_carlo/run_of_before.nc"], 20, seed=2)
    found = [mcdem.simulate_encounter(scene, *pair, seed=k) for k, pair in enumerate(pairs)]
    assert [(k, result.reason) for k, result in enumerate(found) if result.reason] == []
    assert {result.outcome for result in found} == set(OUTCOMES[:-1])


@pytest.mark.slow
@pytest.mark.parametrize("level", LEVELS)
def test_shortcuts_keep_the_outcomes_of_a_level(level):
    scene = LEVELS[level].with_changes({"numerics.rotations": 2})
    whole = scene.with_changes(
        {
            "numerics.far_approach": 0.0,
            "numerics.separation": 0.0,
            "numerics.rigid_rotation": False,
            "numerics.end_stable": False,
            "numerics.implicit.far_field_tolerance": 0.0,
        }
    )
    cluster = mcdem.Aggregate.from_positions(scene, tetrahedron()[0] * RADIUS * (1.0 - 1e-4))
    for seed in range(4):
        found = [
            mcdem.simulate_encounter(s, cluster, cluster, offset=(0.3 * RADIUS, 1.2 * RADIUS), seed=seed)
            for s in (scene, whole)
        ]
        assert found[0].outcome == found[1].outcome in OUTCOMES[:-1]
        assert sum(p.size for p in found[0].products) == 8
