"""How a rigid aggregate answers what others do to it: a disturbance of the fluid at its primaries, and loads on these.

A disturbance d is (-strains | spins | velocities), a load f (torques | forces), both by primaries.  The body answers by motions y
that are left to it and by moments of its own:

    S y = Y^T d + P^T f,   moments = own(E) - M^-1 d + Y y,   Y = M^-1 P,   S = P^T R P

M is the grand mobility of its primaries, R their resistance with lubrication among themselves, and P the motions: those of a
rigid body, and each sphere's own spin where contacts do not resist it.  All of this is found once, in the frame of the body.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types

from mcdem.compilation import compiled, separately_compiled
from mcdem.hydrodynamics import level as levels
from mcdem.hydrodynamics.grand_mobility import five_tensor
from mcdem.hydrodynamics.linear_algebra import (
    cholesky,
    inverse_from_cholesky,
    multiply_symmetric,
    solve_cholesky,
)
from mcdem.hydrodynamics.resistance import measure
from mcdem.rigid_aggregates.statics import loads_of_strains, straight_axis

ANSWERED = 0
FAILED = 1


class Response(NamedTuple):
    """How a rigid aggregate of P primaries answers, in the orientation in which it was analysed; vectors as in `grand_mobility`.

    The motions that are left to it are counted by F: spins, then velocity and angular velocity of the whole.
    """

    inverse: np.ndarray  # (11P, 11P) M^-1, lower triangle
    answers: np.ndarray  # (F, 11P) Y^T
    allowed: np.ndarray  # (F, 6P) P^T
    factor: np.ndarray  # (F, F) of S
    straining: np.ndarray  # (5, 11P) moments in each of five unit strains, ...
    moving: np.ndarray  # (5, 6P) ... rates of the primaries relative to these, ...
    motion: np.ndarray  # (5, 6) ... and velocity and angular velocity of the whole


_MATRIX = types.float64[:, ::1]
RESPONSE = types.NamedUniTuple(_MATRIX, 7, Response)


@separately_compiled(types.Tuple((types.int64, RESPONSE)))
def respond(work, positions, modes, radii, level):
    """(ANSWERED or FAILED, `Response`) of a rigid aggregate; positions (P, 3) about its centre.

    work : `resistance.workspace` of P
    modes : rigid motions (6, 3P) as displacements of spheres that spin freely, or (6, 6P) with the turns of ones that do not
    """
    n = radii.shape[0]
    whole, spins = 11 * n, 6 * n - modes.shape[1]
    count = spins + 6
    response = Response(
        np.empty((whole, whole)),
        np.zeros((count, whole)),
        np.zeros((count, 6 * n)),
        np.empty((count, count)),
        np.empty((5, whole)),
        np.empty((5, 6 * n)),
        np.empty((5, 6)),
    )
    measure(positions, work.directions, work.distances)
    if levels.resistance(level, work, radii) != 0:
        return FAILED, response
    inverse, answers, allowed, factor = response.inverse, response.answers, response.allowed, response.factor
    inverse[:] = work.mobility
    inverse_from_cholesky(inverse)
    for row in range(whole):
        for column in range(row):
            inverse[column, row] = inverse[row, column]
    unit, strain_loads = np.eye(5), np.empty((5, 6 * n))
    loads_of_strains(level, work, radii, unit, strain_loads)
    for row in range(spins):
        allowed[row, row] = 1.0
    allowed[spins:, spins:] = modes
    pulled = np.empty((count, 6 * n))
    for row in range(count):
        multiply_symmetric(work.resistance, allowed[row], pulled[row])
        for k in range(6 * n):
            if allowed[row, k] != 0.0:
                for column in range(whole):
                    answers[row, column] += allowed[row, k] * inverse[5 * n + k, column]
    for row in range(count):
        for column in range(row + 1):
            factor[row, column] = 0.0
            for k in range(6 * n):
                factor[row, column] += pulled[row, k] * allowed[column, k]
    if spins > 0:
        hold_free_spins(factor, positions)
    if cholesky(factor) != 0:
        return FAILED, response
    in_strains(response, positions, pulled, strain_loads)
    return ANSWERED, response


@compiled
def hold_free_spins(factor, positions):
    """Let something resist the spins of a whole that nothing resists: of one sphere, and of a doublet about its axis."""
    first = factor.shape[0] - 3
    if positions.shape[0] == 1:
        for k in range(3):
            factor[first + k, first + k] += 1.0
        return
    axis = straight_axis(positions)
    resistance = factor[first, first] + factor[first + 1, first + 1] + factor[first + 2, first + 2]
    for p in range(3):
        for q in range(p + 1):
            factor[first + p, first + q] += resistance * axis[p] * axis[q]


@separately_compiled()
def in_strains(response, positions, pulled, strain_loads):
    """What a body that moves freely does in each of the unit strains, from what these exert on it held still, (5, 6P)."""
    allowed = response.allowed
    n, count = positions.shape[0], allowed.shape[0]
    still, motion, rates = np.zeros(6 * n), np.empty(count), np.empty(11 * n)
    tensor, unit = np.empty((3, 3)), np.eye(5)
    for strain in range(5):
        five_tensor(unit[strain], tensor)
        for i in range(n):
            for k in range(3):
                still[3 * (n + i) + k] = -(
                    tensor[k, 0] * positions[i, 0]
                    + tensor[k, 1] * positions[i, 1]
                    + tensor[k, 2] * positions[i, 2]
                )
        for row in range(count):
            motion[row] = 0.0
            for k in range(6 * n):
                motion[row] += allowed[row, k] * strain_loads[strain, k] - pulled[row, k] * still[k]
        solve_cholesky(response.factor, motion)
        for i in range(n):
            for k in range(5):
                rates[5 * i + k] = -unit[strain, k]
        for k in range(6 * n):
            moving = still[k]
            for row in range(count):
                moving += motion[row] * allowed[row, k]
            rates[5 * n + k] = response.moving[strain, k] = moving
        for k in range(6):
            response.motion[strain, k] = motion[count - 6 + k]
        multiply_symmetric(response.inverse, rates, response.straining[strain])
