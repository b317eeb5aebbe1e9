"""Velocities of rigid free spheres in the scene's flow: the hydrodynamics alone, for anyone to check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mcdem.aggregate import overlap_limit
from mcdem.encounter import physics_of
from mcdem.errors import UserError
from mcdem.hydrodynamics.far_field import five_to_tensor
from mcdem.hydrodynamics.stokesian import solve_velocities, workspace

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from mcdem.scene import Scene


@dataclass(frozen=True, eq=False)
class Velocities:
    """linear (N, 3) [m/s], angular (N, 3) [1/s], stresslet (N, 3, 3) [N m], symmetric and traceless.

    The stresslet is the one that a free sphere adds to the suspension's stress: + 20/3 pi mu a^3 E for a single one.
    """

    linear: NDArray[np.float64]
    angular: NDArray[np.float64]
    stresslet: NDArray[np.float64]


def velocities(
    scene: Scene, positions: ArrayLike, forces: ArrayLike | None = None, torques: ArrayLike | None = None
) -> Velocities:
    """Velocities of free spheres of the scene's radius in its flow, with no direct forces between them.

    positions : (N, 3) [m];  forces : (N, 3) [N] and torques : (N, 3) [N m], external, zero by default.
    Stokesian dynamics of Durlofsky, Brady & Bossis (1987) with the scene's hydrodynamics table.
    Raises `UserError` for wrong shapes, numbers that are not finite, or spheres that overlap grossly.
    """
    x = np.array(positions, dtype=float, ndmin=2)
    if x.ndim != 2 or x.shape[1] != 3:
        raise UserError(f"positions: expected an array (N, 3) in metres, found shape {x.shape}")
    f = np.zeros_like(x) if forces is None else np.array(forces, dtype=float, ndmin=2)
    t = np.zeros_like(x) if torques is None else np.array(torques, dtype=float, ndmin=2)
    for name, array in (("positions", x), ("forces", f), ("torques", t)):
        if array.shape != x.shape:
            raise UserError(f"{name}: expected the shape {x.shape} of positions, found {array.shape}")
        if not np.isfinite(array).all():
            raise UserError(
                f"{name}: found a number that is not finite in row {int(np.argwhere(~np.isfinite(array))[0, 0])}"
            )
    radius, units = scene.suspension.radius, scene.reduced
    if len(x) > 1:
        gaps = np.linalg.norm(x[:, None] - x[None], axis=2) - 2.0 * radius
        np.fill_diagonal(gaps, np.inf)
        if gaps.min() < -overlap_limit(scene) * radius:
            i, j = np.unravel_index(gaps.argmin(), gaps.shape)
            raise UserError(
                f"positions: spheres {i} and {j} overlap by {-gaps[i, j] / radius:.3g} radii: move them apart "
                "(are the positions in metres?)"
            )
    flow, physics = physics_of(scene)
    five = np.empty((len(x), 5))
    code, linear, angular = solve_velocities(
        workspace(len(x)),
        x / units.length,
        np.ones(len(x)),
        flow.gradient,
        flow.strain,
        flow.strain_five,
        f / units.force,
        t / units.energy,
        physics.cutoff,
        physics.shifted,
        physics.table,
        five,
    )
    if code != 0:
        raise ArithmeticError("the resistance matrix of these spheres is not positive definite")
    return Velocities(linear * units.velocity, angular / units.time, five_to_tensor(five) * units.energy)
