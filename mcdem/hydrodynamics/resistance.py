"""The resistance of N spheres as every level of hydrodynamics fills it, and spheres that turn freely.

    R (u - u_inf) = F + strain_load,   strain_load: the force and torque that the strain exerts on spheres held still

Conventions and ordering: `grand_mobility`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types

from mcdem.compilation import separately_compiled
from mcdem.hydrodynamics.linear_algebra import (
    add_product,
    add_transposed_product,
    cholesky,
    solve_lower,
    solve_lower_from_right,
    subtract_outer,
)
from mcdem.hydrodynamics.two_sphere.lubrication import RAW

NOT_POSITIVE_DEFINITE = 1


class Work(NamedTuple):
    """Work arrays for N spheres; reused from step to step."""

    mobility: np.ndarray  # (11N, 11N) grand mobility, then its Cholesky factor
    resistance: np.ndarray  # (6N, 6N) ordered (omega | u), lower triangle
    strain_load: np.ndarray  # (6N,) torque and force exerted by the strain on spheres held still
    straining: np.ndarray  # (5N,) L_S^-1 E_inf
    raw: np.ndarray  # (RAW,) two-sphere functions of one pair as tabulated
    scalars: np.ndarray  # (11, 4) the same for the pairs 11, 12, 21, 22
    directions: np.ndarray  # (N, N, 3) unit vector from j to i
    distances: np.ndarray  # (N, N) centre distance


def workspace(n: int) -> Work:
    """Work arrays for n spheres."""
    return Work(
        np.empty((11 * n, 11 * n)),
        np.empty((6 * n, 6 * n)),
        np.empty(6 * n),
        np.empty(5 * n),
        np.empty(RAW),
        np.empty((11, 4)),
        np.empty((n, n, 3)),
        np.empty((n, n)),
    )


@separately_compiled()
def measure(positions, directions, distances):
    """Centre distances and unit vectors of all pairs i > j from positions (N, 3)."""
    n = positions.shape[0]
    for i in range(n):
        for j in range(i):
            dx = positions[i, 0] - positions[j, 0]
            dy = positions[i, 1] - positions[j, 1]
            dz = positions[i, 2] - positions[j, 2]
            r = np.sqrt(dx * dx + dy * dy + dz * dz)
            distances[i, j] = distances[j, i] = r
            directions[i, j, 0], directions[j, i, 0] = dx / r, -dx / r
            directions[i, j, 1], directions[j, i, 1] = dy / r, -dy / r
            directions[i, j, 2], directions[j, i, 2] = dz / r, -dz / r


@separately_compiled(types.int64)
def eliminate_torques(resistance):
    """Free rotation: reduce R (6N) to the translational A (3N) in the trailing block (lower triangle); 0 or an error code.

    The leading blocks then hold what `reduce_strain_load` and `angular_velocities` need.
    """
    m = resistance.shape[0] // 2
    rotation, coupling, translation = resistance[:m, :m], resistance[m:, :m], resistance[m:, m:]
    if cholesky(rotation) != 0:
        return NOT_POSITIVE_DEFINITE
    solve_lower_from_right(rotation, coupling)
    subtract_outer(translation, coupling)
    return 0


@separately_compiled()
def reduce_strain_load(resistance, strain_load):
    """Reduce a strain_load (6N,) to that of torque-free spheres, in strain_load[3N:], after `eliminate_torques`."""
    m = resistance.shape[0] // 2
    solve_lower(resistance[:m, :m], strain_load[:m], False)
    add_product(resistance[m:, :m], strain_load[:m], strain_load[m:], -1.0)


@separately_compiled()
def angular_velocities(resistance, strain_load, linear, angular):
    """omega - omega_inf (3N,) of torque-free spheres from u - u_inf (3N,), after `reduce_strain_load`."""
    m = resistance.shape[0] // 2
    angular[:] = strain_load[:m]
    add_transposed_product(resistance[m:, :m], linear, angular, -1.0)
    solve_lower(resistance[:m, :m], angular, True)
