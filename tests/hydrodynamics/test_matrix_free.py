"""Velocities without a dense matrix, compared with the dense ones."""

from __future__ import annotations

import numpy as np
import pytest

import mcdem
from mcdem.hydrodynamics import LEVELS, matrix_free
from mcdem.hydrodynamics import grand_mobility as far_field
from mcdem.hydrodynamics.resistance import measure, workspace
from mcdem.hydrodynamics.undisturbed_flow import UndisturbedFlow
from mcdem.hydrodynamics.velocities import solve_velocities

# Iteration is for levels with stresslets, whose far field is worth it.
WITH_STRESSLETS = [name for name, level in LEVELS.items() if level.stresslet_couplings]


def suspension(n, seed, spread=1.9, least=2.001):
    """Random spheres that come as near as `least` to each other; positions (N, 3)."""
    rng = np.random.default_rng(seed)
    placed = [np.zeros(3)]
    while len(placed) < n:
        new = placed[rng.integers(len(placed))] + rng.normal(size=3) * spread
        if min(np.linalg.norm(new - p) for p in placed) > least:
            placed.append(new)
    return np.array(placed)


def test_the_mobility_is_that_of_the_dense_matrix():
    positions = suspension(9, 0, least=2.6)
    rng = np.random.default_rng(1)
    radii = rng.uniform(0.6, 1.2, 9)
    n = len(radii)
    directions, distances = np.empty((n, n, 3)), np.empty((n, n))
    measure(positions, directions, distances)
    matrix = np.zeros((11 * n, 11 * n))
    far_field.grand_mobility(directions, distances, radii, matrix)
    matrix = np.tril(matrix) + np.tril(matrix, -1).T
    x = rng.normal(size=11 * n)
    strain, angular, linear = matrix_free.mobility_product(
        np.ascontiguousarray(positions.T),
        radii,
        x[: 5 * n].reshape(n, 5),
        x[5 * n : 8 * n].reshape(n, 3),
        x[8 * n :].reshape(n, 3),
    )
    found = np.concatenate([strain.ravel(), angular.ravel(), linear.ravel()])
    assert found == pytest.approx(matrix @ x, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("level", WITH_STRESSLETS)
@pytest.mark.parametrize("shifted", [False, True], ids=["matrix", "gap"])
def test_both_paths_give_the_same_velocities(level, shifted):
    positions = suspension(60, 2)
    n = len(positions)
    rng = np.random.default_rng(3)
    forces, torques = rng.normal(size=(2, n, 3))
    gradient = rng.normal(size=(3, 3))
    gradient -= np.trace(gradient) / 3.0 * np.eye(3)
    strain, five = 0.5 * (gradient + gradient.T), np.empty(5)
    far_field.tensor_to_five(strain, five)
    stresslet = np.empty((n, 5))
    common = (positions, np.ones(n), UndisturbedFlow(gradient, strain, five), forces, torques)
    parameters = LEVELS[level].build(5e-3, shifted, (1.0,))
    code, linear, angular = solve_velocities(parameters, workspace(n), *common, stresslet)
    assert code == 0
    found = matrix_free.solve_velocities(parameters, *common, tolerance=1e-8)
    assert found.residual <= 1e-8
    for one, other in ((found.linear, linear), (found.angular, angular), (found.stresslet, stresslet)):
        assert np.abs(one - other).max() < 1e-6 * np.abs(other).max()


def test_many_spheres_take_the_path_without_a_matrix(monkeypatch):
    scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    positions = suspension(40, 5, least=2.02) * scene.suspension.radius
    dense = mcdem.velocities(scene, positions)
    monkeypatch.setattr("mcdem.free_spheres.MATRIX_FREE_FROM", 40)
    monkeypatch.setattr("mcdem.free_spheres.solve_velocities", None)
    sparse = mcdem.velocities(scene, positions)
    for name in ("linear", "angular", "stresslet"):
        one, other = getattr(sparse, name), getattr(dense, name)
        assert np.abs(one - other).max() < 1e-5 * np.abs(other).max()
        assert not np.array_equal(one, other)
