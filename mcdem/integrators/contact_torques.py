"""Steps of primaries whose contacts resist sliding, rolling or twisting: rotations of the spheres are unknowns too.

    R (z/dt - z_inf) = strain_load + F_non-contact(mid) + contacts(x1, z),   z = (rotations | displacements) of the step, 6N

with the resistance R of the spheres at the extrapolated midpoint, as in `implicit_midpoint`.  A contact's normal force is the one
there; its springs (`effects.tangential`) start from their history, turned to the middle of the step, and are taken at the
end of it.  Loads act on the middle configuration, where forces and torques of a pair add to nothing.

Newton's method: the first iteration takes springs as stuck and linear, since a start from which they slip lies on the flat
end of their laws; later ones take the law with its own tangent, so that what sticks and what slips is found on the way.
That the limit of friction moves with the normal force is left out of the Jacobian, which stays symmetric.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types

from mcdem.compilation import compiled, separately_compiled
from mcdem.effects.kinds import Response, Turned
from mcdem.effects.sums import contact_force, contact_resistance, fixed_in_spheres
from mcdem.effects.tangential import carry, relative_turns, spread, turn_map
from mcdem.hydrodynamics.linear_algebra import cholesky, multiply_symmetric, solve_cholesky
from mcdem.hydrodynamics.undisturbed_flow import spin_component, velocities_of_flow
from mcdem.integrators.newton import MOST_ITERATIONS, contact_tangent, starts_anew
from mcdem.integrators.state import NOT_CONVERGED, harmonic_radius

# Largest move of a sphere, or turn, by which an iteration is settled: springs slip from 1e-4 a on.
SETTLED = 1e-8


class Pair(NamedTuple):
    """Work arrays of one contact, between sphere 1 (the lower number) and sphere 2."""

    before: np.ndarray  # (3,) from sphere 1 to 2
    after: np.ndarray  # (3,)
    q: np.ndarray  # (7,) turns of the contact
    no_turns: np.ndarray  # (7,) zero
    normals: np.ndarray  # (3, 3)
    spins: np.ndarray  # (2,)
    carried: np.ndarray  # (7,)
    spring: np.ndarray  # (7,)
    loads: np.ndarray  # (7,)
    tangent: np.ndarray  # (7, 7)
    map: np.ndarray  # (7, 12) to the turns, from the motion of both spheres
    force: np.ndarray  # (3,) on sphere 2
    torques: np.ndarray  # (2, 3)


@compiled
def new_pair():
    """Work arrays."""
    return Pair(
        np.empty(3),
        np.empty(3),
        np.empty(7),
        np.zeros(7),
        np.empty((3, 3)),
        np.empty(2),
        np.empty(7),
        np.empty(7),
        np.empty(7),
        np.empty((7, 7)),
        np.empty((7, 12)),
        np.empty(3),
        np.empty((2, 3)),
    )


class TorqueWork(NamedTuple):
    """Work arrays of N spheres."""

    turns: np.ndarray  # (N, 3) of the spheres in this step
    driving: np.ndarray  # (6N,)
    jacobian: np.ndarray  # (6N, 6N)
    residual: np.ndarray  # (6N,)
    move: np.ndarray  # (6N,)
    pair: Pair


def torque_work(n: int) -> TorqueWork:
    """Work arrays for n spheres."""
    return TorqueWork(
        np.empty((n, 3)),
        np.empty(6 * n),
        np.empty((6 * n, 6 * n)),
        np.empty(6 * n),
        np.empty(6 * n),
        new_pair(),
    )


@separately_compiled(types.int64)
def fill_driving(flow, work, torques):
    """R z_inf + strain_load + forces into torques.driving; returns 0."""
    hydro = work.hydrodynamics
    n = torques.turns.shape[0]
    m = 3 * n
    ambient, driving = torques.residual, torques.driving
    for i in range(n):
        for k in range(3):
            ambient[3 * i + k] = spin_component(flow.gradient, k)
    velocities_of_flow(flow, work.middle, ambient[m:])
    multiply_symmetric(hydro.resistance, ambient, driving)
    for row in range(2 * m):
        driving[row] += hydro.strain_load[row]
    for i in range(n):
        for k in range(3):
            driving[m + 3 * i + k] += work.forces[i, k]
    return 0


@compiled
def spins(gradient, step, torques, out):
    """Angular velocities relative to the flow, out (3N,), over the step that was solved."""
    for i in range(torques.turns.shape[0]):
        for k in range(3):
            out[3 * i + k] = torques.turns[i, k] / step - spin_component(gradient, k)


@separately_compiled(types.float64)
def resist(motion, work, i, j, normal_force, linear, resistances):
    """Springs, loads and stiffness of the contact of i and j < i after the motion to work.end; returns |r| in the middle.

    linear : the loads as if no spring passed its limit on the way
    """
    positions, radii, end = motion.positions, motion.radii, work.end
    turns, pair = work.torques.turns, work.torques.pair
    for k in range(3):
        pair.before[k] = positions[i, k] - positions[j, k]
        pair.after[k] = end[i, k] - end[j, k]
    distance = relative_turns(
        pair.before,
        pair.after,
        turns[j],
        turns[i],
        fixed_in_spheres(resistances),
        pair.q,
        pair.normals,
        pair.spins,
    )
    carry(motion.springs[i, j], pair.normals[0], pair.normals[1], pair.spins, pair.carried)
    turned = Turned(
        pair.carried,
        pair.no_turns if linear else pair.q,
        pair.normals[1],
        distance,
        radii[j] / (radii[i] + radii[j]),
        harmonic_radius(radii[i], radii[j]),
        normal_force,
    )
    contact_resistance(turned, resistances, Response(pair.spring, pair.loads, pair.tangent))
    if linear:
        for row in range(7):
            for column in range(7):
                pair.loads[row] -= pair.tangent[row, column] * pair.q[column]
    return distance


@compiled
def place_of(local, i, j, n):
    """Row of (rotations | displacements) for one of twelve coordinates (dx1, turn_1, dx2, turn_2) of a pair, 1 = j and 2 = i."""
    sphere = j if local < 6 else i
    part, k = (local // 3) % 2, local % 3
    return 3 * sphere + k if part == 1 else 3 * (n + sphere) + k


@separately_compiled()
def add_resistance_stiffness(matrix, tangent, map_, i, j, n):
    """matrix (6N, 6N) += B^T tangent B of one pair, lower triangle."""
    for p in range(12):
        row = place_of(p, i, j, n)
        for q in range(12):
            column = place_of(q, i, j, n)
            if column > row:
                continue
            total = 0.0
            for a in range(7):
                if map_[a, p] != 0.0:
                    for b in range(7):
                        total += map_[a, p] * tangent[a, b] * map_[b, q]
            matrix[row, column] += total


@compiled
def add_normal_stiffness(matrix, slope, turning, normal, i, j, n):
    """The same for the normal force, as `implicit.add_stiffness`; i > j."""
    m = 3 * n
    for k in range(3):
        for l in range(3):
            value = (slope - turning) * normal[k] * normal[l]
            if k == l:
                value += turning
            matrix[m + 3 * i + k, m + 3 * j + l] -= value
            if l <= k:
                matrix[m + 3 * i + k, m + 3 * i + l] += value
                matrix[m + 3 * j + k, m + 3 * j + l] += value


@compiled
def add_loads(residual, normal, distance, i, j, n, pair):
    """residual (6N,) += what the loads of one pair exert on its spheres."""
    m = 3 * n
    spread(pair.loads, normal, distance, pair.force, pair.torques[0], pair.torques[1])
    for k in range(3):
        residual[3 * j + k] += pair.torques[0, k]
        residual[3 * i + k] += pair.torques[1, k]
        residual[m + 3 * i + k] += pair.force[k]
        residual[m + 3 * j + k] -= pair.force[k]


@separately_compiled(types.int64)
def solve(motion, contacts, gaps, step, physics, work):
    """Newton for the positions at the end of the step and the turns, from the guess in work.end; 0 or NOT_CONVERGED."""
    torques, positions = work.torques, motion.positions
    n = motion.radii.shape[0]
    m = 3 * n
    matrix = work.hydrodynamics.resistance
    turns, jacobian, residual, move = torques.turns, torques.jacobian, torques.residual, torques.move
    pair = torques.pair
    # Loads are linear in the turns in the first iteration: where it starts does not matter.
    turns[:] = 0.0
    for iteration in range(MOST_ITERATIONS):
        linear = iteration == 0 or starts_anew(iteration)
        for i in range(n):
            for k in range(3):
                move[3 * i + k] = turns[i, k] / step
                move[m + 3 * i + k] = (work.end[i, k] - positions[i, k]) / step
        multiply_symmetric(matrix, move, residual)
        for row in range(2 * m):
            residual[row] = torques.driving[row] - residual[row]
            for column in range(row + 1):
                jacobian[row, column] = matrix[row, column] / step
        for b in range(contacts):
            i, j = work.pairs[b, 0], work.pairs[b, 1]
            normal = work.normals[b]
            force, slope, turning, _ = contact_tangent(motion, work, gaps, b, iteration, physics.contact)
            for k in range(3):
                along = force * normal[k]
                residual[m + 3 * i + k] += along
                residual[m + 3 * j + k] -= along
            add_normal_stiffness(jacobian, slope, turning, normal, i, j, n)
            distance = resist(motion, work, i, j, force, linear, physics.resistances)
            add_loads(residual, pair.normals[1], distance, i, j, n, pair)
            turn_map(pair.normals[1], distance, pair.map)
            add_resistance_stiffness(jacobian, pair.tangent, pair.map, i, j, n)
        if cholesky(jacobian) != 0:
            return NOT_CONVERGED
        solve_cholesky(jacobian, residual)
        if not np.isfinite(residual.sum()):
            return NOT_CONVERGED
        change = 0.0
        for i in range(n):
            for k in range(3):
                change = max(change, abs(residual[3 * i + k]), abs(residual[m + 3 * i + k]))
                turns[i, k] += residual[3 * i + k]
                work.end[i, k] += residual[m + 3 * i + k]
        work.iterations[0] += 1
        if contacts == 0 or (not linear and change < SETTLED):
            return 0
    return NOT_CONVERGED


@separately_compiled()
def keep_springs(motion, contacts, physics, work):
    """Histories of the contacts at the end of the step that leads from the positions of `motion` to work.end."""
    pair, radii = work.torques.pair, motion.radii
    for b in range(contacts):
        i, j = work.pairs[b, 0], work.pairs[b, 1]
        force, _ = contact_force(work.end_gaps[i, j], harmonic_radius(radii[i], radii[j]), physics.contact)
        resist(motion, work, i, j, force, False, physics.resistances)
        carry(pair.spring, pair.normals[1], pair.normals[2], pair.spins, motion.springs[i, j])
