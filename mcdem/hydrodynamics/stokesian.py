"""Resistance, drive and velocities of N spheres: Stokesian dynamics, and the coarser levels below it.

Durlofsky, Brady & Bossis 1987: the resistance of N spheres is the inverse of their far-field grand mobility, with
the exact two-body resistance less its own far field added for every pair.  Conventions and ordering: `far_field`.

    R (u - u_inf) = F + drive,   R = Mhat^-1 + R_two-body,   Mhat = M_UF - M_US M_ES^-1 M_EF

Nothing is inverted but the 6N part: one Cholesky factor of the 11N grand mobility, ordered stresslets first,
holds every piece.  A factor that fails is an error, never mended by jitter.

A level of hydrodynamics is what of this there is; what a level lacks is None, and gone from the compiled code:

    level          coupled  stresslets  table
    free_draining  None     None        None     Stokes drag and torque on each sphere by itself
    rotne_prager   True     None        None     far field of forces and torques; strain exerts nothing
    fts            True     True        None     far field of forces, torques and stresslets
    stokesian      True     True        given    the same and lubrication

`level_resistance`, `level_drive` and `level_stresslets` hold for all of them; what follows does not ask.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from mcdem.hydrodynamics import grand_mobility as far_field
from mcdem.hydrodynamics.linear_algebra import (
    add_product,
    add_transposed_product,
    cholesky,
    inverse_from_cholesky,
    solve_cholesky,
    solve_lower,
    solve_lower_from_right,
    subtract_outer,
)
from mcdem.hydrodynamics.two_sphere import lubrication

NOT_POSITIVE_DEFINITE = 1


class Work(NamedTuple):
    """Work arrays for N spheres; reused from step to step."""

    mobility: np.ndarray  # (11N, 11N) grand mobility, then its Cholesky factor
    resistance: np.ndarray  # (6N, 6N) ordered (omega | u), lower triangle
    drive: np.ndarray  # (6N,) torque and force exerted by the strain on spheres held still
    straining: np.ndarray  # (5N,) L_S^-1 E_inf
    raw: np.ndarray  # (lubrication.RAW,) two-sphere functions of one pair as tabulated
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
        np.empty(lubrication.RAW),
        np.empty((11, 4)),
        np.empty((n, n, 3)),
        np.empty((n, n)),
    )


@njit(cache=True)
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


@njit(cache=True)
def far_field_resistance(work, radii):
    """Far-field resistance Mhat^-1 into `work.resistance`, keeping the factor in `work.mobility`; 0 or an error code."""
    n = radii.shape[0]
    far_field.grand_mobility(work.directions, work.distances, radii, work.mobility)
    if cholesky(work.mobility) != 0:
        return NOT_POSITIVE_DEFINITE
    remainder = work.mobility[5 * n :, 5 * n :]
    for k in range(6 * n):
        work.resistance[k, : k + 1] = remainder[k, : k + 1]
    return inverse_from_cholesky(work.resistance)


@njit(cache=True)
def far_field_drive(work, strain_five):
    """What a uniform strain (5,) exerts in the far field into `work.drive`, after `far_field_resistance`."""
    n = work.drive.shape[0] // 6
    for i in range(n):
        work.straining[5 * i : 5 * i + 5] = strain_five
    solve_lower(work.mobility[: 5 * n, : 5 * n], work.straining, False)
    work.drive[:] = 0.0
    add_product(work.mobility[5 * n :, : 5 * n], work.straining, work.drive, -1.0)
    solve_cholesky(work.mobility[5 * n :, 5 * n :], work.drive)


@njit(cache=True)
def free_draining_resistance(work, radii):
    """Resistance of spheres that do not feel each other: Stokes' drag and torque, 1 and 4/3 for a sphere of radius a."""
    n = radii.shape[0]
    for row in range(6 * n):
        for column in range(row + 1):
            work.resistance[row, column] = 0.0
        a = radii[(row // 3) % n]
        work.resistance[row, row] = 4.0 / 3.0 * a**3 if row < 3 * n else a


@njit(cache=True)
def force_torque_resistance(work, radii):
    """Far-field resistance of forces and torques alone into `work.resistance`; 0 or an error code."""
    far_field.force_torque_mobility(work.directions, work.distances, radii, work.resistance)
    if cholesky(work.resistance) != 0:
        return NOT_POSITIVE_DEFINITE
    return inverse_from_cholesky(work.resistance)


@njit(cache=True, inline="always")
def level_resistance(work, radii, coupled, stresslets):
    """Resistance without lubrication into `work.resistance` at a level; 0 or an error code."""
    code = 0
    if stresslets is not None:
        code = far_field_resistance(work, radii)
    elif coupled is not None:
        code = force_torque_resistance(work, radii)
    else:
        free_draining_resistance(work, radii)
    return code


@njit(cache=True, inline="always")
def level_drive(work, strain_five, stresslets):
    """What a uniform strain (5,) exerts on spheres held still into `work.drive`, after `level_resistance`."""
    if stresslets is not None:
        far_field_drive(work, strain_five)
    else:
        work.drive[:] = 0.0


@njit(cache=True, inline="always")
def level_stresslets(work, radii, rates, strain_five, cutoff, stresslets, table, out):
    """Stresslets exerted on the fluid into out (N, 5); without their couplings, those of single spheres, 10/9 a^3 E."""
    if stresslets is not None:
        exerted_stresslets(work, radii, rates, strain_five, cutoff, table, out)
    else:
        for i in range(radii.shape[0]):
            for k in range(5):
                out[i, k] = -10.0 / 9.0 * radii[i] ** 3 * strain_five[k]


@njit(cache=True)
def add_lubrication(work, radii, strain, cutoff, shifted, table):
    """Add the two-body part of every pair, its gap h/a clamped from below at `cutoff`.

    `shifted`: a pair below the cut-off is seen by the strain too at the gap of the cut-off.  Otherwise only the
    matrix is frozen there, as the paper says, and the strain at the true distance drives a squeeze by cutoff - h
    that grows without bound as the cut-off falls below the overlap of a contact.
    """
    n = radii.shape[0]
    for i in range(n):
        for j in range(i):
            true_gap = work.distances[i, j] - radii[i] - radii[j]
            gap = max(true_gap, cutoff)
            shift = gap - true_gap if shifted else 0.0
            lubrication.motion_scalars(gap, radii[i], radii[j], table, work.raw, work.scalars)
            d = (work.directions[j, i, 0], work.directions[j, i, 1], work.directions[j, i, 2])
            lubrication.add_pair_resistance(work.scalars, i, j, d, work.resistance)
            lubrication.add_pair_drive(work.scalars, i, j, d, strain, shift, work.drive)


@njit(cache=True)
def eliminate_torques(resistance):
    """Free rotation: reduce R (6N) to the translational A (3N) in the trailing block (lower triangle); 0 or an error code.

    The leading blocks then hold what `reduce_drive` and `angular_velocities` need.
    """
    m = resistance.shape[0] // 2
    rotation, coupling, translation = resistance[:m, :m], resistance[m:, :m], resistance[m:, m:]
    if cholesky(rotation) != 0:
        return NOT_POSITIVE_DEFINITE
    solve_lower_from_right(rotation, coupling)
    subtract_outer(translation, coupling)
    return 0


@njit(cache=True)
def reduce_drive(resistance, drive):
    """Reduce a drive (6N,) to that of torque-free spheres, in drive[3N:], after `eliminate_torques`."""
    m = resistance.shape[0] // 2
    solve_lower(resistance[:m, :m], drive[:m], False)
    add_product(resistance[m:, :m], drive[:m], drive[m:], -1.0)


@njit(cache=True)
def angular_velocities(resistance, drive, linear, angular):
    """omega - omega_inf (3N,) of torque-free spheres from u - u_inf (3N,), after `reduce_drive`."""
    m = resistance.shape[0] // 2
    angular[:] = drive[:m]
    add_transposed_product(resistance[m:, :m], linear, angular, -1.0)
    solve_lower(resistance[:m, :m], angular, True)


@njit(cache=True)
def exerted_stresslets(work, radii, rates, strain_five, cutoff, table, out):
    """Stresslets exerted on the fluid into out (N, 5), from rates (6N,) of spheres in a strain (5,).

    `work` holds the far-field factor and, from `far_field_drive` of the same strain, L_S^-1 E; the latter is used up.
    """
    n = radii.shape[0]
    # Far-field forces from the factor: Mhat F = rates + W^T z, then S = -L_S^-T (z + W F).
    far = rates.copy()
    coupling = work.mobility[5 * n :, : 5 * n]
    add_product(coupling, work.straining, far, 1.0)
    solve_cholesky(work.mobility[5 * n :, 5 * n :], far)
    five = work.straining
    add_transposed_product(coupling, far, five, 1.0)
    for k in range(5 * n):
        five[k] = -five[k]
    solve_lower(work.mobility[: 5 * n, : 5 * n], five, True)
    for i in range(n):
        out[i] = five[5 * i : 5 * i + 5]
    if table is not None:
        for i in range(n):
            for j in range(i):
                gap = max(work.distances[i, j] - radii[i] - radii[j], cutoff)
                lubrication.pair_scalars(gap, radii[i], radii[j], table, work.raw, work.scalars)
                lubrication.add_pair_stresslet(
                    work.scalars, i, j, work.directions[j, i], rates, strain_five, out
                )


@njit(cache=True)
def solve_velocities(
    work,
    positions,
    radii,
    gradient,
    strain,
    strain_five,
    forces,
    torques,
    cutoff,
    shifted,
    coupled,
    stresslets,
    table,
    stresslet,
):
    """Velocities of free spheres under given forces and torques; reduced units.  work : `workspace` of N

    positions (N, 3), radii (N,), gradient (3, 3) with u_inf = gradient . r, strain its symmetric part, forces and
    torques (N, 3); `stresslet` (N, 5) is filled with what the fluid exerts on the spheres; coupled, stresslets
    and table are the level.  Returns (code, linear (N, 3), angular (N, 3)).
    """
    n = positions.shape[0]
    linear = np.empty((n, 3))
    angular = np.empty((n, 3))
    measure(positions, work.directions, work.distances)
    code = level_resistance(work, radii, coupled, stresslets)
    if code != 0:
        return code, linear, angular
    level_drive(work, strain_five, stresslets)
    if table is not None:
        add_lubrication(work, radii, strain, cutoff, shifted, table)
    rates = work.drive
    for i in range(n):
        for k in range(3):
            rates[3 * i + k] += torques[i, k]
            rates[3 * (n + i) + k] += forces[i, k]
    if cholesky(work.resistance) != 0:
        return NOT_POSITIVE_DEFINITE, linear, angular
    solve_cholesky(work.resistance, rates)
    level_stresslets(work, radii, rates, strain_five, cutoff, stresslets, table, stresslet)
    for i in range(n):
        for k in range(5):
            stresslet[i, k] = -stresslet[i, k]
        for k in range(3):
            flow = gradient[k, 0] * positions[i, 0]
            flow += gradient[k, 1] * positions[i, 1] + gradient[k, 2] * positions[i, 2]
            linear[i, k] = rates[3 * (n + i) + k] + flow
        angular[i, 0] = rates[3 * i] + 0.5 * (gradient[2, 1] - gradient[1, 2])
        angular[i, 1] = rates[3 * i + 1] + 0.5 * (gradient[0, 2] - gradient[2, 0])
        angular[i, 2] = rates[3 * i + 2] + 0.5 * (gradient[1, 0] - gradient[0, 1])
    return 0, linear, angular
