"""Bodies go on alone only if they never come back: the criterion against exact orbits of two spheres, and in every flow."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mcdem
from mcdem.encounter import capture_efficiency as capture
from mcdem.integrators.parting import STRAY, surely_apart
from validation.exact import two_spheres

SHEAR = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
SMOOTH = mcdem.load_scene("scenes/paper-1000Pa.toml").with_changes(
    {
        "effects.van_der_waals.hamaker_constant": "1e-60 J",
        "hydrodynamics.lubrication_cutoff": 0.0,
        "numerics.rotations": 3,
    }
)


def released(r, gradient=SHEAR, factor=1.5, reaches=(1.0, 1.0)):
    r = np.asarray(r, float)
    return surely_apart(r, gradient @ r, gradient, *reaches, factor)


def turns_back(r):
    """Whether two smooth spheres at r [a] that recede turn back, by exact mobilities."""

    def along(_, at):
        return at[1] * at[2]

    def far(_, at):
        return at[2] - 40.0

    along.terminal = far.terminal = True
    path = solve_ivp(
        lambda _, at: two_spheres.relative_velocity(np.asarray(at), lambda gap: 0.0),
        (0.0, 1500.0),
        r,
        method="DOP853",
        rtol=1e-8,
        atol=1e-10,
        events=[along, far],
    )
    return len(path.t_events[0]) > 0


def test_no_orbit_that_comes_back_is_let_go_and_little_beyond_the_last_is_kept():
    """Along y at several distances: what turns back is never released; a third beyond, far away, is."""
    for z in (4.0, 9.0):
        limit = 4.0 / 3.0 * z**-1.5
        assert turns_back([0.3, 0.8 * limit, z])
        assert not turns_back([0.3, 1.2 * limit, z])
        for y in np.linspace(0.01, 1.05, 12) * limit:
            assert not released([0.3, y, z])
    # Far away no stray is left to wait for, so that the orbits alone decide.
    last = 4.0 / 3.0 * 16.0**-1.5
    assert not released([0.3, 1.2 * last, 16.0])
    assert released([0.3, 1.3 * last, 16.0])
    # Approaching is not parting.
    assert not released([0.3, 1.0, -9.0])


def test_larger_bodies_are_held_together_for_longer():
    near = [0.0, 1.0, 9.0]
    assert released(near)
    assert not released(near, reaches=(3.0, 1.0))
    scaled = 3.0 * np.array(near)
    assert released(scaled, reaches=(3.0, 3.0))


@pytest.mark.parametrize(
    "gradient",
    [
        np.diag([-0.5, -0.5, 1.0]),
        np.diag([0.5, 0.5, -1.0]),
        [[0, 0, 0], [0, 0, 0.3], [0, 1, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
    ],
)
def test_where_the_flow_stretches_what_recedes_is_soon_let_go(gradient):
    """And never comes back: the undisturbed r^2 is convex, and what spheres take from its growth is less."""
    gradient = np.asarray(gradient, float)
    rng, found = np.random.default_rng(1), 0
    for _ in range(200):
        direction = rng.normal(size=3)
        r = 12.0 * direction / np.linalg.norm(direction)
        if released(r, gradient):
            found += 1
            assert r @ gradient @ r > 0.0
    assert found > 30


def test_what_is_let_go_strays_by_no_more_than_is_said():
    """Exact paths from the place of release on, against the streamline of the undisturbed flow."""
    for place in ([0.0, 1.5, 6.8], [1.2, 0.3, 6.5], [0.5, 0.2, 9.0]):
        z = place[2]
        while not released([*place[:2], z]):
            z += 0.05
        path = solve_ivp(
            lambda _, at: two_spheres.relative_velocity(np.asarray(at), lambda gap: 0.0),
            (0.0, (55.0 - z) / place[1]),
            [*place[:2], z],
            method="DOP853",
            rtol=1e-8,
            atol=1e-10,
        )
        moved = np.hypot(*(path.y[:2, -1] - place[:2]))
        assert 0.3 * STRAY < moved < 1.2 * STRAY


@pytest.mark.parametrize("offset", [(0.0, 1.5), (1.2, 0.25)])
def test_paths_after_the_pass_keep_to_exact_ones(offset):
    """A hundredth of a radius, where a release at 1.5 (R_i + R_j) strayed by 0.06 to 0.09."""
    from validation.hard_cases.edges import stray

    fine = SMOOTH.with_changes({"numerics.implicit.max_step": 0.1})
    assert stray(offset, 40.0 if offset[1] > 0.5 else 15.0)(fine) < 0.01


@pytest.mark.parametrize(
    ("stress", "x0", "expected"),
    [
        ("750 Pa", 0.8, 0.1994),
        pytest.param("1000 Pa", 0.8, 0.1673, marks=pytest.mark.slow),
    ],
)
def test_pairs_that_come_back_are_caught(stress, x0, expected):
    """Critical offsets of exact trajectories, orbits that come back included (`validation/hard_cases/edges.py`)."""
    scene = mcdem.load_scene("scenes/paper-750Pa.toml").with_changes(
        {
            "flow.shear_stress": stress,
            "hydrodynamics.lubrication_cutoff": 0.0,
            "numerics.implicit.max_step": 0.1,
        }
    )
    radius = scene.suspension.radius
    assert capture.critical_offset(scene, x0 * radius) / radius == pytest.approx(expected, rel=0.01)
    # Without separation none passes as a body either: nor do those that it is compared with.
    parting = scene.with_changes({"numerics.sure_miss": 0.0})
    whole = scene.with_changes({"numerics.separation": 0.0})
    assert capture.critical_offset(parting, x0 * radius) == pytest.approx(
        capture.critical_offset(whole, x0 * radius), rel=2e-4
    )
