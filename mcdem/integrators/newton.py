"""Newton's method for the contacts at the end of an implicit step, their torques left out."""

from __future__ import annotations

import numpy as np
from numba import njit, types

from mcdem.compilation import compiled, separately_compiled
from mcdem.effects.sums import contact_equilibrium, contact_force, contact_pull_off_gap
from mcdem.hydrodynamics.linear_algebra import cholesky, multiply_symmetric, solve_cholesky
from mcdem.integrators.state import NOT_CONVERGED, harmonic_radius

# The method is done when what is left to do moves no primary by more than this, in a: a few 1e-4 of the pull-off force.
CONVERGED = 1e-7
MOST_ITERATIONS = 48
# The iteration from which the start is made once more, with two that take contacts as linear springs.
ANEW = 16


@compiled
def starts_anew(iteration):
    """Whether an iteration takes contacts as linear springs about equilibrium."""
    return iteration == ANEW or iteration == ANEW + 1


@compiled
def contact_tangent(motion, work, gaps, b, iteration, contact):
    """The force of contact b at the end of a step and how Newton's method takes it; fills its direction in `work.normals`.

    iteration : the first takes it by its tangent at the old gap, one that starts anew as a linear spring about equilibrium
    Returns (force, slope, turning, stiffness): minus dF/dh, floored; tension over length; stiffness without load.
    """
    positions, radii, end, normals = motion.positions, motion.radii, work.end, work.normals
    i, j = work.pairs[b, 0], work.pairs[b, 1]
    x0, y0, z0 = (
        positions[i, 0] - positions[j, 0],
        positions[i, 1] - positions[j, 1],
        positions[i, 2] - positions[j, 2],
    )
    x1, y1, z1 = end[i, 0] - end[j, 0], end[i, 1] - end[j, 1], end[i, 2] - end[j, 2]
    old, new = np.sqrt(x0 * x0 + y0 * y0 + z0 * z0), np.sqrt(x1 * x1 + y1 * y1 + z1 * z1)
    scale = 1.0 / (old + new)
    normals[b, 0], normals[b, 1], normals[b, 2] = (x0 + x1) * scale, (y0 + y1) * scale, (z0 + z1) * scale
    radius = harmonic_radius(radii[i], radii[j])
    gap = new - radii[i] - radii[j]
    rest, stiffness = contact_equilibrium(radius, contact)
    if starts_anew(iteration):
        force, slope = -stiffness * (gap - rest), stiffness
    elif iteration == 0:
        force, tangent = contact_force(gaps[i, j], radius, contact)
        slope = max(-tangent, 0.1 * stiffness)
        force -= slope * (gap - gaps[i, j])
    else:
        force, tangent = contact_force(gap, radius, contact)
        slope = max(-tangent, 0.02 * stiffness)
    # Tension resists the turning of its line, and without that the iteration overshoots it once a contact
    # pulls harder than the fluid holds.  Compression would make the matrix indefinite: it is left out.
    return force, slope, max(-force, 0.0) * scale, stiffness


@separately_compiled()
def add_stiffness(matrix, step, contacts, work):
    """Jacobian of the contact problem: resistance over the step plus the contacts' stiffness (slopes, turnings)."""
    jacobian, normals, pairs = work.jacobian, work.normals, work.pairs
    rate = 1.0 / step
    for row in range(jacobian.shape[0]):
        for column in range(row + 1):
            jacobian[row, column] = matrix[row, column] * rate
    for b in range(contacts):
        i, j, slope, turning = pairs[b, 0], pairs[b, 1], work.slopes[b], work.turnings[b]
        work.factor_slopes[b] = slope
        for k in range(3):
            for l in range(3):
                value = (slope - turning) * normals[b, k] * normals[b, l]
                if k == l:
                    value += turning
                jacobian[3 * i + k, 3 * j + l] -= value
                if l <= k:
                    jacobian[3 * i + k, 3 * i + l] += value
                    jacobian[3 * j + k, 3 * j + l] += value


@separately_compiled(types.int64)
def solve_contacts(motion, contacts, gaps, step, contact, work):
    """Newton for the positions at the end of the step, from the guess in work.end; 0 or NOT_CONVERGED.

    The first iteration takes each contact by its tangent at the old gap, the following ones by the law itself.
    When that does not settle, the start is made once more with linear springs about equilibrium.  A Jacobian is kept
    while no contact's stiffness changed by more than a tenth of the stiffness without load and each iteration still
    moves the primaries by less than a tenth of the one before, which also bounds what is left by the last move.  A move
    that does not is not made: where contacts bear a thousand times what the flow exerts, it may lead far away.
    """
    positions, n = motion.positions, motion.radii.shape[0]
    m = 3 * n
    matrix = work.hydrodynamics.resistance[m:, m:]
    jacobian, residual, move = work.jacobian, work.residual, work.move
    end, normals = work.end, work.normals
    factorised = False
    last = change = np.inf
    for iteration in range(MOST_ITERATIONS):
        fallback = starts_anew(iteration)
        keep = factorised
        for i in range(n):
            for k in range(3):
                move[3 * i + k] = (end[i, k] - positions[i, k]) / step
        multiply_symmetric(matrix, move, residual)
        for row in range(m):
            residual[row] = work.driving[row] - residual[row]
        for b in range(contacts):
            i, j = work.pairs[b, 0], work.pairs[b, 1]
            force, slope, turning, stiffness = contact_tangent(motion, work, gaps, b, iteration, contact)
            work.slopes[b], work.turnings[b] = slope, turning
            if keep and abs(slope - work.factor_slopes[b]) > 0.1 * stiffness:
                keep = False
            for k in range(3):
                along = force * normals[b, k]
                residual[3 * i + k] += along
                residual[3 * j + k] -= along
        if keep:
            move[:] = residual
            solve_cholesky(jacobian, move)
            change = largest(move)
            keep = change <= 0.1 * last
        if not keep:
            add_stiffness(matrix, step, contacts, work)
            if cholesky(jacobian) != 0:
                return NOT_CONVERGED
            factorised = True
            move[:] = residual
            solve_cholesky(jacobian, move)
            change = largest(move)
        for i in range(n):
            for k in range(3):
                end[i, k] += move[3 * i + k]
        log_iterations(work)
        if not np.isfinite(change):
            return NOT_CONVERGED
        if contacts == 0:
            return 0
        if iteration >= 1 and not fallback and is_done(iteration, change, last):
            return 0
        last = change
    return NOT_CONVERGED


@compiled
def is_done(iteration, change, last):
    """Whether less than CONVERGED is left, by the last move, or by the rate at which the last two fell."""
    if change < CONVERGED:
        return True
    return iteration >= 2 and change <= 0.1 * last and change * change < CONVERGED * (last - change)


@compiled
def largest(values):
    """Largest size of a component; not a number if one is none."""
    found = 0.0
    for value in values:
        if np.isnan(value):
            return value
        found = max(found, abs(value))
    return found


@njit(cache=True, inline="always")
def log_iterations(work):
    """Count an iteration of Newton's method."""
    work.iterations[0] += 1


@separately_compiled(types.Tuple((types.int64, types.float64)))
def worst_overstretch(contacts, radii, contact, work):
    """(index, excess over its pull-off gap) of the contact stretched furthest beyond it; (-1, 0) if none is."""
    worst, excess = -1, 0.0
    for b in range(contacts):
        i, j = work.pairs[b, 0], work.pairs[b, 1]
        limit = contact_pull_off_gap(harmonic_radius(radii[i], radii[j]), contact)
        beyond = work.end_gaps[i, j] - limit
        if beyond > excess:
            worst, excess = b, beyond
    return worst, excess


@compiled
def put_last(pairs, which, count):
    """Move one of the first `count` pairs (B, 2) behind the others, whose order stays; returns how many these are."""
    i, j = pairs[which, 0], pairs[which, 1]
    for b in range(which, count - 1):
        pairs[b, 0], pairs[b, 1] = pairs[b + 1, 0], pairs[b + 1, 1]
    pairs[count - 1, 0], pairs[count - 1, 1] = i, j
    return count - 1
