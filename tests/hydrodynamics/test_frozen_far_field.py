"""The far field of a while ago: exact under rotation, and corrected to second order for what else has changed."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import icosahedron

from mcdem.hydrodynamics import LEVELS, fts
from mcdem.hydrodynamics import frozen_far_field as frozen
from mcdem.hydrodynamics.grand_mobility import tensor_to_five
from mcdem.hydrodynamics.resistance import measure, workspace
from mcdem.hydrodynamics.undisturbed_flow import UndisturbedFlow

STRAIN = np.array([[0.2, 0.1, 0.0], [0.1, -0.3, 0.5], [0.0, 0.5, 0.1]])
FIVE = np.empty(5)
tensor_to_five(STRAIN, FIVE)
FLOW = UndisturbedFlow(STRAIN, STRAIN, FIVE)
LEVEL = LEVELS["stokesian"].build(5e-3, False, (1.0,))
COUNT = 13


def far_field(kept, work, positions, tolerance, share=0.0):
    measure(positions, work.directions, work.distances)
    middle = frozen.Middle(np.ascontiguousarray(positions), np.zeros(len(positions), np.int64), 1, share)
    radii = np.ones(len(positions))
    assert frozen.far_field(LEVEL, kept, work, radii, middle, FLOW, tolerance) == 0


def load(work, rates):
    """Torques and forces (6N,) exerted on the fluid by spheres that move at rates (6N,)."""
    lower = np.tril(work.resistance)
    return (lower + np.tril(lower, -1).T) @ rates - work.strain_load


def exact(positions, rates):
    work = workspace(len(positions))
    measure(positions, work.directions, work.distances)
    assert fts.far_field_resistance(work, np.ones(len(positions))) == 0
    fts.far_field_strain_load(work, FIVE)
    return load(work, rates)


@pytest.fixture
def start():
    """A cluster, rates of its spheres, and a far field kept where it is, which has learnt the moments there."""
    positions = 1.2 * icosahedron()[0]
    rates = np.random.default_rng(1).normal(size=6 * COUNT)
    kept, work = frozen.nothing_frozen(COUNT), workspace(COUNT)
    far_field(kept, work, positions, 0.5)
    frozen.learn(kept, work, rates[: 3 * COUNT], rates[3 * COUNT :])
    return positions, rates, kept, work


def test_moments_learnt_are_those_exerted(start):
    positions, rates, kept, _ = start
    np.testing.assert_allclose(kept.moments[0, 5 * COUNT :], exact(positions, rates), rtol=1e-10, atol=1e-10)


def test_rotation_is_followed_exactly(start):
    positions, rates, kept, work = start
    made = kept.positions.copy()
    for angle in np.linspace(0.05, 1.0, 20):
        turn = Rotation.from_rotvec(angle * np.array([0.3, -0.8, 0.5])).as_matrix()
        turned = (rates.reshape(-1, 3) @ turn.T).ravel()
        far_field(kept, work, positions @ turn.T + [1.0, 2.0, -3.0], 1e-3)
        assert np.array_equal(kept.positions, made)
        # The fit of a turn is held to the last one by a hundredth.
        np.testing.assert_allclose(load(work, turned), exact(positions @ turn.T, turned), atol=2e-3)
    for _ in range(8):
        far_field(kept, work, positions @ turn.T, 1e-3)
    np.testing.assert_allclose(load(work, turned), exact(positions @ turn.T, turned), atol=1e-9)


def test_a_deformed_cluster_is_off_by_the_lag_times_the_change_of_the_moments(start):
    positions, rates, kept, work = start
    rng = np.random.default_rng(2)
    shift, change = rng.normal(size=positions.shape), rng.normal(size=rates.shape)
    errors, without = [], []
    for size in (0.02, 0.01):
        moved, rates_now = positions + size * shift, rates + size * change
        far_field(kept, work, moved, 1.0)
        true = exact(moved, rates_now)
        errors.append(np.abs(load(work, rates_now) - true).max())
        without.append(np.abs(exact(positions, rates_now) - true).max())
    assert errors[1] < 0.15 * without[1]
    assert errors[1] < 0.35 * errors[0]


def test_the_far_field_is_made_anew_beyond_the_tolerance_and_after_contacts_change(start):
    positions, rates, kept, work = start
    moved = positions.copy()
    moved[0] += [0.5, 0.0, 0.0]
    far_field(kept, work, moved, 0.05)
    assert np.array_equal(kept.positions, moved)
    np.testing.assert_allclose(load(work, rates), exact(moved, rates), atol=1e-9)
    frozen.forget(kept)
    far_field(kept, work, positions, 10.0)
    np.testing.assert_allclose(load(work, rates), exact(positions, rates), atol=1e-9)


def test_predicted_moments_go_on_as_over_the_last_two_steps(start):
    """Steady change of the moments in a fixed cluster: what is predicted is then what comes."""
    _, rates, kept, work = start
    change = np.random.default_rng(4).normal(size=6 * COUNT)
    later = rates + change
    frozen.learn(kept, work, later[: 3 * COUNT], later[3 * COUNT :])
    far_field(kept, work, kept.positions.copy(), 0.5, share=1.0)
    predicted = kept.predicted[5 * COUNT :]
    np.testing.assert_allclose(predicted, exact(kept.positions, rates + 2.0 * change), rtol=1e-9, atol=1e-9)
