"""Rigid aggregates: how they turn in the flow, and what their contacts bear at any orientation.

An aggregate without floppy modes moves as a rigid body, and statics alone says what its contacts bear: both its
motion and its tensions are linear in the strain seen from the body, with coefficients found once.

    Omega = omega_inf + Q spin(Q^T E Q),   V = u_inf + Q drift(Q^T E Q),   tension_b = rest_b + response_b : Q^T E Q

Q turns body to laboratory.  The worst tension over all orientations follows from the eigenvalues of response_b:
for symmetric tensors A and E the largest A : Q^T E Q is the sum of products of their sorted eigenvalues.  An
aggregate whose worst tension stays below pull-off is *mechanically stable in every orientation*: nothing can happen to it alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types

from mcdem.compilation import compiled, separately_compiled
from mcdem.effects.sums import (
    contact_equilibrium,
    contact_force,
    contact_pull_off_force,
    non_contact_force,
)
from mcdem.hydrodynamics import level as levels
from mcdem.hydrodynamics.grand_mobility import five_tensor, tensor_to_five
from mcdem.hydrodynamics.linear_algebra import cholesky, multiply_symmetric, solve_cholesky
from mcdem.hydrodynamics.resistance import angular_velocities, eliminate_torques, measure, reduce_strain_load
from mcdem.hydrodynamics.undisturbed_flow import spin_component
from mcdem.integrators.pairs import FORCE_RANGE
from mcdem.integrators.rotations import multiply, rotation, turn_back
from mcdem.integrators.state import harmonic_radius

RIGID = 0
FLOPPY = 1
FAILED = 2

# Smallest pivot of the contact network's stiffness, over that of one contact, that counts as rigid.
_RIGIDITY = 1e-4


class RigidBody(NamedTuple):
    """Response of a rigid aggregate to a uniform strain, in the orientation in which it was analysed."""

    positions: np.ndarray  # (P, 3) about the centre
    spin: np.ndarray  # (3, 5)
    drift: np.ndarray  # (3, 5)
    stresslet: np.ndarray  # (5, 5) exerted on the fluid
    # Tensions of the contacts first; then, where contacts resist sliding, rolling or twisting, what their springs bear.
    contacts: int
    rest: np.ndarray  # (B,) tension without flow
    response: np.ndarray  # (B, 5)
    strength: np.ndarray  # (B,) pull-off force
    squared_radius: float  # of the sphere with the same radius of gyration


_VECTOR, _MATRIX = types.float64[::1], types.float64[:, ::1]
BODY = types.NamedTuple(
    (_MATRIX, _MATRIX, _MATRIX, _MATRIX, types.int64, _VECTOR, _MATRIX, _VECTOR, types.float64), RigidBody
)
"""Type of a `RigidBody` in compiled code."""


@compiled
def sorted_eigenvalues(c):
    """Eigenvalues, largest first, of the symmetric traceless tensor with five components c."""
    a = np.empty((3, 3))
    five_tensor(c, a)
    squares = 0.0
    for k in range(5):
        squares += c[k] * c[k]
    if squares == 0.0:
        return 0.0, 0.0, 0.0
    p = np.sqrt(squares / 6.0)
    determinant = (
        a[0, 0] * (a[1, 1] * a[2, 2] - a[1, 2] * a[1, 2])
        - a[0, 1] * (a[0, 1] * a[2, 2] - a[1, 2] * a[0, 2])
        + a[0, 2] * (a[0, 1] * a[1, 2] - a[1, 1] * a[0, 2])
    )
    angle = np.arccos(min(1.0, max(-1.0, determinant / (2.0 * p**3)))) / 3.0
    largest = 2.0 * p * np.cos(angle)
    smallest = 2.0 * p * np.cos(angle + 2.0 * np.pi / 3.0)
    return largest, -largest - smallest, smallest


@compiled
def worst_load(body, strain_five):
    """Largest ratio, over contacts and orientations, of load to strength."""
    e1, e2, e3 = sorted_eigenvalues(strain_five)
    worst = 0.0
    for b in range(body.rest.shape[0]):
        a1, a2, a3 = sorted_eigenvalues(body.response[b])
        worst = max(worst, (body.rest[b] + a1 * e1 + a2 * e2 + a3 * e3) / body.strength[b])
    return worst


@compiled
def squared_radius(positions, radii):
    """Squared radius of the sphere with the radius of gyration of a body, (5/3) R_g^2, from positions (P, 3) about its centre."""
    volume = second = own = 0.0
    for i in range(radii.shape[0]):
        share = radii[i] ** 3
        volume += share
        own += share * radii[i] ** 2
        for k in range(3):
            second += share * (positions[i, k] * positions[i, k])
    return own / volume + 5.0 / 3.0 * second / volume


@compiled
def empty_body(n):
    """A body with no contacts."""
    return RigidBody(
        np.zeros((n, 3)),
        np.zeros((3, 5)),
        np.zeros((3, 5)),
        np.zeros((5, 5)),
        0,
        np.zeros(0),
        np.zeros((0, 5)),
        np.zeros(0),
        0.0,
    )


@compiled
def of_sphere(radius):
    """The body of one sphere: no contacts, and the stresslet -10/9 a^3 E of a sphere by itself."""
    b = empty_body(1)
    for k in range(5):
        b.stresslet[k, k] = -10.0 / 9.0 * radius**3
    return RigidBody(b.positions, b.spin, b.drift, b.stresslet, 0, b.rest, b.response, b.strength, radius**2)


@separately_compiled(types.boolean)
def network_stiffness(positions, directions, pairs, slopes, count, stiffness):
    """Stiffness (3P, 3P) of the contact network with its rigid motions stiffened, factorised; True if it is rigid."""
    n = positions.shape[0]
    stiffness[:] = 0.0
    typical = 0.0
    for b in range(count):
        i, j = pairs[b, 0], pairs[b, 1]
        typical = max(typical, slopes[b])
        for k in range(3):
            for m in range(3):
                value = slopes[b] * directions[i, j, k] * directions[i, j, m]
                stiffness[3 * i + k, 3 * j + m] -= value
                if m <= k:
                    stiffness[3 * i + k, 3 * i + m] += value
                    stiffness[3 * j + k, 3 * j + m] += value
    spread = 0.0
    for i in range(n):
        for k in range(3):
            spread += positions[i, k] ** 2
    for mode in range(6):
        vector = np.zeros(3 * n)
        for i in range(n):
            if mode < 3:
                vector[3 * i + mode] = 1.0 / np.sqrt(n)
            else:
                k, m = (mode - 2) % 3, (mode - 1) % 3
                vector[3 * i + k] = -positions[i, m] / np.sqrt(spread)
                vector[3 * i + m] = positions[i, k] / np.sqrt(spread)
        for row in range(3 * n):
            for column in range(row + 1):
                stiffness[row, column] += typical * vector[row] * vector[column]
    if cholesky(stiffness) != 0:
        return False
    for row in range(3 * n):
        if stiffness[row, row] ** 2 < _RIGIDITY * typical:
            return False
    return True


class RigidMotions(NamedTuple):
    """The six rigid motions of a body, over m displacements (and turns) of its spheres."""

    modes: np.ndarray  # (6, m)
    pulled: np.ndarray  # (6, m) forces that the fluid makes of each
    grand: np.ndarray  # (6, 6) their resistance, factorised


@separately_compiled(types.Tuple((types.int64, BODY)))
def analyse(work, positions, bonded, radii, physics):
    """(RIGID, FLOPPY or FAILED, body) of one connected aggregate; positions (P, 3) about its centre, reduced units.

    work : `resistance.workspace` of P
    """
    n = radii.shape[0]
    if n == 1:
        return RIGID, of_sphere(radii[0])
    body = empty_body(n)
    count = count_contacts(bonded)
    if count < 3 * n - 6 or count == 0:
        return FLOPPY, body
    measure(positions, work.directions, work.distances)
    pairs = np.empty((count, 2), np.int64)
    slopes, rest, strength = np.empty(count), np.empty(count), np.empty(count)
    unbalanced = np.zeros(3 * n)
    b = 0
    for i in range(n):
        for j in range(i):
            gap = work.distances[i, j] - radii[i] - radii[j]
            radius = harmonic_radius(radii[i], radii[j])
            if bonded[i, j]:
                force, slopes[b] = linear_contact(gap, radius, physics.contact)
                pairs[b, 0], pairs[b, 1] = i, j
                rest[b] = -force
                strength[b] = contact_pull_off_force(radius, physics.contact)
                b += 1
            elif gap < FORCE_RANGE:
                force, _ = non_contact_force(gap, radius, physics.pair_forces)
            else:
                continue
            for k in range(3):
                unbalanced[3 * i + k] += force * work.directions[i, j, k]
                unbalanced[3 * j + k] -= force * work.directions[i, j, k]
    stiffness = np.empty((3 * n, 3 * n))
    if not network_stiffness(positions, work.directions, pairs, slopes, count, stiffness):
        return FLOPPY, body
    solve_cholesky(stiffness, unbalanced)
    add_tensions(work.directions, pairs, slopes, unbalanced, rest)

    level = physics.level
    if levels.resistance(level, work, radii) != 0:
        return FAILED, body
    unit, strain_loads = np.eye(5), np.empty((5, 6 * n))
    loads_of_strains(level, work, radii, unit, strain_loads)
    if eliminate_torques(work.resistance) != 0:
        return FAILED, body
    m = 3 * n
    matrix = work.resistance[m:, m:]
    modes = rigid_modes(positions)
    rigid = RigidMotions(modes, pull_of_modes(matrix, modes), np.zeros((6, 6)))
    if not rigid_resistance(rigid, straight_axis(positions)):
        return FAILED, body
    response = np.zeros((count, 5))
    relative, load, rates, own = np.empty(m), np.empty(m), np.empty(6 * n), np.empty(6)
    for k in range(5):
        strain_load = strain_loads[k]
        reduce_strain_load(work.resistance, strain_load)
        move_as_body(matrix, positions, rigid, strain_load[m:], unit[k], own, relative, load)
        keep_motion(body, k, own)
        angular_velocities(work.resistance, strain_load, relative, rates[:m])
        rates[m:] = relative
        add_stresslet(level, work, radii, positions, rates, load, unit[k], body.stresslet[:, k])
        # Contacts supply the load: K displacement = -load.
        for row in range(m):
            load[row] = -load[row]
        solve_cholesky(stiffness, load)
        add_tensions(work.directions, pairs, slopes, load, response[:, k])
    return RIGID, RigidBody(
        positions.copy(),
        body.spin,
        body.drift,
        body.stresslet,
        count,
        rest,
        response,
        strength,
        squared_radius(positions, radii),
    )


@compiled
def count_contacts(bonded):
    """Number of contacts of (N, N)."""
    count = 0
    for i in range(bonded.shape[0]):
        for j in range(i):
            if bonded[i, j]:
                count += 1
    return count


@compiled
def linear_contact(gap, radius, contact):
    """(force, stiffness) of a contact at its gap; the stiffness is floored as in `newton.contact_tangent`."""
    force, slope = contact_force(gap, radius, contact)
    _, stiffness = contact_equilibrium(radius, contact)
    return force, max(-slope, 0.02 * stiffness)


@separately_compiled()
def loads_of_strains(level, work, radii, unit, strain_loads):
    """What the strains `unit` (5, 5) strain_load, into strain_loads (5, 6N); lubrication goes into the resistance as well."""
    for k in range(5):
        levels.strain_load(level, work, unit[k])
        strain_loads[k] = work.strain_load
    levels.two_body_of_strains(level, work, radii, unit, strain_loads)


@separately_compiled(types.float64[:, ::1])
def pull_of_modes(matrix, modes):
    """Forces (6, m) that the fluid makes of each of the rigid motions `modes` (6, m)."""
    pulled = np.zeros(modes.shape)
    for mode in range(6):
        multiply_symmetric(matrix, modes[mode], pulled[mode])
    return pulled


@separately_compiled()
def move_as_body(matrix, positions, rigid, strain_load, strain_five, motion, relative, load):
    """Rigid motion (6,), translation then rotation, of a force-free body in a strain (5,), into `motion`.

    matrix, strain_load : resistance (m, m) and strain_load (m,); displacements of the spheres are the last 3P
    relative, load : motion (m,) relative to the strain, and what the fluid asks of the contacts (m,)
    """
    tensor = np.empty((3, 3))
    five_tensor(strain_five, tensor)
    modes, pulled, grand = rigid.modes, rigid.pulled, rigid.grand
    m = relative.shape[0]
    first = m - 3 * positions.shape[0]
    relative[:first] = 0.0
    for i in range(positions.shape[0]):
        for c in range(3):
            relative[first + 3 * i + c] = -(
                tensor[c, 0] * positions[i, 0]
                + tensor[c, 1] * positions[i, 1]
                + tensor[c, 2] * positions[i, 2]
            )
    multiply_symmetric(matrix, relative, load)
    for row in range(m):
        load[row] -= strain_load[row]
    for p in range(6):
        motion[p] = 0.0
        for row in range(m):
            motion[p] -= modes[p, row] * load[row]
    solve_cholesky(grand, motion)
    for p in range(6):
        for row in range(m):
            load[row] += motion[p] * pulled[p, row]
            relative[row] += motion[p] * modes[p, row]


@compiled
def keep_motion(body, k, motion):
    """Keep the motion (6,) of a body in the strain k."""
    for c in range(3):
        body.drift[c, k] = motion[c]
        body.spin[c, k] = motion[3 + c]


@separately_compiled()
def add_stresslet(level, work, radii, positions, rates, load, strain_five, stresslet):
    """Add to `stresslet` (5,) what a body exerts on the fluid in a strain (5,): that of its spheres and of their forces.

    rates : (rotations | displacements) (6P,) relative to the strain;  load : the forces are its last 3P
    """
    n = radii.shape[0]
    first = load.shape[0] - 3 * n
    five, extra, moment = np.empty((n, 5)), np.empty(5), np.zeros((3, 3))
    levels.strain_load(level, work, strain_five)
    levels.stresslets(level, work, radii, rates, strain_five, five)
    for i in range(n):
        for c in range(5):
            stresslet[c] += five[i, c]
        for c in range(3):
            for e in range(3):
                product = 0.5 * load[first + 3 * i + c] * positions[i, e]
                moment[c, e] += product
                moment[e, c] += product
    trace = (moment[0, 0] + moment[1, 1] + moment[2, 2]) / 3.0
    for c in range(3):
        moment[c, c] -= trace
    tensor_to_five(moment, extra)
    for c in range(5):
        stresslet[c] += extra[c]


@compiled
def straight_axis(positions):
    """Unit vector (3,) along a doublet, whose spheres, free to turn, do not resist that it spins about it; else zero.

    No other straight aggregate is rigid by its contacts' normal forces alone.
    """
    axis = np.zeros(3)
    if positions.shape[0] == 2:
        for k in range(3):
            axis[k] = positions[1, k] - positions[0, k]
        axis /= np.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
    return axis


@separately_compiled(types.boolean)
def rigid_resistance(rigid, axis):
    """Fill and factorise the resistance of the rigid motions; True if it can be.

    axis : (3,) about which nothing resists a spin, or zero.  Rounding would choose that spin, and with it the step errors of
        all that the body does: it is given the resistance of the others, which leaves it at zero, as no torque is about it
    """
    modes, pulled, grand = rigid.modes, rigid.pulled, rigid.grand
    for p in range(6):
        for q in range(6):
            grand[p, q] = 0.0
            for row in range(modes.shape[1]):
                grand[p, q] += modes[p, row] * pulled[q, row]
    spinning = grand[3, 3] + grand[4, 4] + grand[5, 5]
    for p in range(3):
        for q in range(3):
            grand[3 + p, 3 + q] += spinning * axis[p] * axis[q]
    return cholesky(grand) == 0


@separately_compiled()
def add_tensions(directions, pairs, slopes, displacement, out):
    """out (B,) += tensions of linear contacts under displacements (3P,)."""
    for b in range(pairs.shape[0]):
        i, j = pairs[b, 0], pairs[b, 1]
        for k in range(3):
            out[b] += slopes[b] * directions[i, j, k] * (displacement[3 * i + k] - displacement[3 * j + k])


@separately_compiled(types.float64[:, ::1])
def rigid_modes(positions):
    """Three translations and three rotations about the centre, (6, 3P)."""
    n = positions.shape[0]
    modes = np.zeros((6, 3 * n))
    for i in range(n):
        for k in range(3):
            modes[k, 3 * i + k] = 1.0
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        modes[3, 3 * i + 1], modes[3, 3 * i + 2] = -z, y
        modes[4, 3 * i], modes[4, 3 * i + 2] = z, -x
        modes[5, 3 * i], modes[5, 3 * i + 1] = -y, x
    return modes


@compiled
def present_load(body, seen):
    """Largest ratio of load to strength in the strain seen from the body, (5,): of any kind, and of tension."""
    worst = tension = 0.0
    for b in range(body.rest.shape[0]):
        load = body.rest[b]
        for k in range(5):
            load += body.response[b, k] * seen[k]
        worst = max(worst, load / body.strength[b])
        if b < body.contacts:
            tension = worst
    return worst, tension


@compiled
def turning_rate(body, matrix, gradient, seen, rate):
    """Angular velocity (3,) in the laboratory of a body turned by matrix (3, 3), which sees the strain `seen` (5,)."""
    for k in range(3):
        rate[k] = 0.0
    for c in range(3):
        spin = 0.0
        for e in range(5):
            spin += body.spin[c, e] * seen[e]
        for k in range(3):
            rate[k] += matrix[k, c] * spin
    for k in range(3):
        rate[k] += spin_component(gradient, k)


@separately_compiled(types.Tuple((types.float64, types.float64, types.boolean)))
def turn_rigidly(body, matrix, centre, flow, duration, step, limit):
    """Turn a rigid body in the flow until `duration` has passed or its load exceeds `limit`.

    matrix (3, 3) and centre (3,) are carried along (midpoint rule on rotations, second order; the centre follows
    with the drift).  Returns (time passed, largest tension met over pull-off force, whether the limit stopped it).
    """
    gradient, strain = flow.gradient, flow.strain
    seen, rate = np.empty(5), np.empty(3)
    half, turn, middle, after = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    velocity = np.empty(3)
    elapsed, largest = 0.0, 0.0
    turn_back(matrix, strain, seen)
    while elapsed < duration - 1e-12:
        h = min(step, duration - elapsed)
        turning_rate(body, matrix, gradient, seen, rate)
        rotation(rate * (0.5 * h), half)
        multiply(half, matrix, middle)
        turn_back(middle, strain, seen)
        turning_rate(body, middle, gradient, seen, rate)
        for k in range(3):
            velocity[k] = gradient[k, 0] * centre[0] + gradient[k, 1] * centre[1] + gradient[k, 2] * centre[2]
            for c in range(3):
                for e in range(5):
                    velocity[k] += middle[k, c] * body.drift[c, e] * seen[e]
        rotation(rate * h, turn)
        multiply(turn, matrix, after)
        turn_back(after, strain, seen)
        load, tension = present_load(body, seen)
        if load > limit:
            return elapsed, largest, True
        largest = max(largest, tension)
        matrix[:] = after
        for k in range(3):
            centre[k] += h * velocity[k]
        elapsed += h
    return elapsed, largest, False
