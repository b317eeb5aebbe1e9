"""Two rigid aggregates near each other, compared with the mobility of all their primaries and with fine steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shapes import monomer, stack_of_octahedra, tetrahedron

import mcdem
from mcdem.encounter.motion import rigid_pair
from mcdem.encounter.simulate import physics_of, shortcuts_of
from mcdem.integrators.state import Motion
from mcdem.rigid_aggregates import reflections
from mcdem.rigid_aggregates.passage import Limits
from mcdem.rigid_aggregates.reflections import APART, LOADED, NEAR, OVER
from validation.hard_cases.shapes import settled

SCENE = mcdem.load_scene("scenes/paper-1000Pa.toml")
RADIUS = SCENE.suspension.radius
FLOW, PHYSICS = physics_of(SCENE)
PAIRS = {
    "octahedra and a tetrahedron": (stack_of_octahedra(2), tetrahedron()),
    "a primary and a tetrahedron": (monomer(), tetrahedron()),
    "two primaries": (monomer(), monomer()),
}


def bodies(shapes, separation):
    """Two settled aggregates, the second at `separation` (3,) [a] from the first, as bodies."""
    first, second = (settled(SCENE, centres, seed) for seed, (centres, _) in enumerate(shapes))
    sizes = first.size, second.size
    positions = np.concatenate([first.positions, second.positions]) / RADIUS
    positions[sizes[0] :] += separation
    bonded = np.zeros((sum(sizes), sum(sizes)), bool)
    bonded[: sizes[0], : sizes[0]] = first.contact_network()
    bonded[sizes[0] :, sizes[0] :] = second.contact_network()
    parent = np.repeat([0, 1], sizes)
    motion = Motion(
        positions,
        positions @ FLOW.gradient.T,
        bonded,
        np.full(bonded.shape, -np.inf),
        np.ones(sum(sizes)),
        parent,
    )
    pair = rigid_pair(motion, np.arange(sum(sizes)), parent, PHYSICS)
    assert pair is not None
    return positions, pair


def at_gap(shapes, direction, gap):
    """The same with the smallest gap [a] between both, apart along `direction` (3,)."""
    low, high = 0.0, 50.0
    while high - low > 1e-10:
        middle = 0.5 * (low + high)
        first, second = (settled(SCENE, centres, seed).positions for seed, (centres, _) in enumerate(shapes))
        apart = first[:, None] / RADIUS - second[None] / RADIUS - middle * direction
        near = np.linalg.norm(apart, axis=-1).min() - 2.0 < gap
        low, high = (middle, high) if near else (low, middle)
    return bodies(shapes, high * direction)


def rigid_rates(positions, sizes):
    """Velocities and spins (2, 2, 3) [a g, g] of two rigid bodies by the mobility of all primaries, one force after the other."""
    n, scale = len(positions), SCENE.reduced
    force = scale.force * np.eye(3 * n).reshape(3 * n, n, 3)

    def linear(forces=None):
        return mcdem.velocities(SCENE, positions * RADIUS, forces).linear.ravel() / RADIUS * scale.time

    free = linear()
    mobility = np.stack([linear(f) - free for f in force], axis=1)
    motions = np.zeros((3 * n, 12))
    for body, rows in enumerate(np.split(np.arange(n), [sizes[0]])):
        about = positions[rows] - positions[rows].mean(axis=0)
        for k, axis in enumerate(np.eye(3)):
            for i, place in zip(rows, about, strict=True):
                motions[3 * i : 3 * i + 3, 6 * body + k] = axis
                motions[3 * i : 3 * i + 3, 6 * body + 3 + k] = np.cross(axis, place)
    # v = free + M F = motions y,  motions^T F = 0; what turns nothing is left at zero.
    grand = motions.T @ np.linalg.solve(mobility, motions)
    rates = np.linalg.pinv(grand, rcond=1e-9) @ (motions.T @ np.linalg.solve(mobility, free))
    return rates.reshape(2, 2, 3)


def reflected(pair):
    """The same by reflections."""
    near = pair.near(PHYSICS)
    velocities, spins = np.empty((2, 2, 3))
    settled_down, _, _ = reflections.reflected_rates(
        near, PHYSICS.level, near.turns, near.centres, FLOW, velocities, spins
    )
    assert settled_down
    return np.stack([velocities, spins], axis=1)


@pytest.mark.parametrize("gap", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("shapes", PAIRS.values(), ids=PAIRS.keys())
def test_reflections_are_the_motion_of_all_primaries_with_rigid_aggregates(shapes, gap):
    direction = np.array([0.48, 0.6, 0.64])
    positions, pair = at_gap(shapes, direction, gap)
    sizes = [len(part.radii) for part in pair.parts]
    whole = rigid_rates(positions, sizes)
    found = reflected(pair)
    # A primary's own spin is free, and no motion of a rigid body.
    turning = np.array(sizes) > 1
    assert np.abs(found[:, 0] - whole[:, 0]).max() < 1e-3
    assert np.abs((found[:, 1] - whole[:, 1])[turning]).max(initial=0.0) < 1e-3
    # What the two make of each other is larger by far.
    alone = np.concatenate([positions[: sizes[0]].mean(axis=0), positions[sizes[0] :].mean(axis=0)])
    undisturbed = alone.reshape(2, 3) @ FLOW.gradient.T
    assert np.abs(undisturbed - whole[:, 0]).max() > 0.03


def test_what_is_left_out_fades_as_the_seventh_power():
    shapes, direction = PAIRS["two primaries"], np.array([0.0, 0.6, 0.8])
    errors = []
    for gap in (3.1, 8.2):
        positions, pair = at_gap(shapes, direction, gap)
        errors.append(np.abs(reflected(pair)[:, 0] - rigid_rates(positions, (1, 1))[:, 0]).max())
    power = math.log(errors[0] / errors[1]) / math.log(10.2 / 5.1)
    assert 6.0 < power < 8.5
    assert errors[0] < 1e-3


@pytest.mark.parametrize("shapes", list(PAIRS.values())[:2], ids=list(PAIRS)[:2])
def test_alone_a_body_answers_as_its_statics_say(shapes):
    _, pair = bodies(shapes, np.array([0.0, 3.0, 40.0]))
    near = pair.near(PHYSICS)
    for one in (near.first, near.second):
        assert np.allclose(one.response.motion[:, :3].T, one.body.drift, atol=1e-9)
        if len(one.radii) > 1:
            assert np.allclose(one.response.motion[:, 3:].T, one.body.spin, atol=1e-6)


def passed(step, separation=(0.0, 4.0, -12.0), margin=0.1, load=10.0, duration=30.0, pieces=10**6):
    """(code, time, largest load, smallest gap, turns, centres) after two bodies have passed each other."""
    _, pair = bodies(PAIRS["octahedra and a tetrahedron"], np.array(separation))
    passing = pair.passing(shortcuts_of(SCENE)._replace(sure_miss=margin))
    near, elapsed, code = pair.near(PHYSICS), 0.0, OVER
    while code == OVER and elapsed < duration - 1e-9:
        limits = Limits(duration - elapsed, step, load)
        found = reflections.pass_near(near, PHYSICS.level, FLOW, passing, limits, pieces)
        code, elapsed = found[0], elapsed + found[1]
    found = (code, elapsed, *found[2:])
    return (*found, pair.turns.copy(), pair.centres.copy())


def test_steps_are_fine_enough():
    """Where two bodies go that pass within a radius of each other."""
    code, _, _, gap, turns, centres = passed(reflections.LONGEST_STEP, duration=4.0)
    fine = passed(reflections.LONGEST_STEP / 8.0, duration=4.0)
    assert code == fine[0] == OVER
    assert gap < 1.0
    assert abs(gap - fine[3]) < 0.05
    assert np.abs(turns - fine[4]).max() < 2e-3
    assert np.abs(centres - fine[5]).max() < 5e-3
    assert np.allclose(turns @ turns.transpose(0, 2, 1), np.eye(3), atol=1e-12)


def test_how_a_passage_ends():
    assert passed(0.4)[0] == APART
    assert passed(0.4, margin=2.0)[0] == NEAR
    assert passed(0.4, load=0.01)[0] == LOADED
    assert passed(0.4, duration=0.5)[:2] == (OVER, 0.5)


def test_where_a_passage_is_cut_changes_nothing():
    whole, cut = passed(0.4), passed(0.4, pieces=3)
    assert whole[0] == cut[0] == APART
    assert np.array_equal(whole[4], cut[4]) and np.array_equal(whole[5], cut[5])
