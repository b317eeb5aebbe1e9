"""Velocities of spheres under given forces in a fluid at rest, by the toolkit; units a, 6 pi mu a."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def scene(cutoff: float = 0.0):
    """The paper's, with another lubrication cut-off."""
    import mcdem

    return mcdem.load_scene("scenes/paper-1000Pa.toml").with_changes(
        {"hydrodynamics.lubrication_cutoff": cutoff}
    )


def settling(scene, positions, forces, torques=None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(linear, angular), each (N, 3), of spheres at positions (N, 3); the scene's shear is taken off."""
    import mcdem

    units, x = scene.reduced, np.asarray(positions, float)
    turned = np.zeros_like(x) if torques is None else np.asarray(torques, float)
    loaded = mcdem.velocities(
        scene, x * units.length, np.asarray(forces, float) * units.force, turned * units.energy
    )
    free = mcdem.velocities(scene, x * units.length)
    return (loaded.linear - free.linear) / units.velocity, (loaded.angular - free.angular) * units.time


def mobility(scene, positions) -> NDArray[np.float64]:
    """(6N, 6N) velocities and angular velocities of unit forces and torques."""
    n = len(positions)
    columns = []
    for load in np.eye(6 * n):
        linear, angular = settling(scene, positions, load[: 3 * n].reshape(n, 3), load[3 * n :].reshape(n, 3))
        columns.append(np.concatenate([linear.ravel(), angular.ravel()]))
    return np.array(columns).T


def rigid_motions(positions) -> NDArray[np.float64]:
    """(6N, 6) motions of the spheres of a rigid cluster: three translations, three rotations about the origin."""
    x = np.asarray(positions, float)
    n = len(x)
    motions = np.zeros((6 * n, 6))
    for k, axis in enumerate(np.eye(3)):
        motions[: 3 * n, k] = np.tile(axis, n)
        motions[: 3 * n, 3 + k] = np.cross(axis, x).ravel()
        motions[3 * n :, 3 + k] = np.tile(axis, n)
    return motions
