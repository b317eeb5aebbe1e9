"""The approach of two rigid aggregates while they are far apart: each a body with a stresslet.

Free of force and torque, a body far away disturbs the flow by its stresslet.  Each turns and drifts in the flow plus what
the other's stresslet makes of it.  The size of both bodies enters the velocity as Faxen's law and the source quadrupole
of a sphere of the same radius of gyration: it is of relative order (R/r)^5, but it alone moves a body across streamlines
before they are close (Batchelor & Green 1972: B = (16/3)(a/r)^5), so the offset at which two bodies just meet rests on it.
For two spheres what is left out is of order (a/r)^7 of their relative velocity.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types

from mcdem.compilation import compiled, separately_compiled
from mcdem.hydrodynamics.grand_mobility import five_tensor
from mcdem.hydrodynamics.undisturbed_flow import spin_component
from mcdem.integrators.parting import surely_apart
from mcdem.integrators.rotations import multiply, rotation, turn_back
from mcdem.rigid_aggregates.statics import RigidBody, present_load


@compiled
def add_disturbance(stresslet, separation, size, gradient, velocity):
    """Add the field of a stresslet (3, 3) at `separation` (3,) from it: velocity (3,) and gradient (3, 3), du_i/dx_k.

    u = (1 + size nabla^2) (9/4) x (x.S.x)/r^5 in units of 6 pi mu a^3 g; the gradient is that of the point stresslet.
    size : a^2/10 of the sphere that exerts it and a^2/6 of the one that is carried, together
    """
    r2 = separation[0] ** 2 + separation[1] ** 2 + separation[2] ** 2
    r5 = r2 * r2 * np.sqrt(r2)
    product = np.zeros(3)
    for k in range(3):
        for m in range(3):
            product[k] += stresslet[k, m] * separation[m]
    square = product[0] * separation[0] + product[1] * separation[1] + product[2] * separation[2]
    for k in range(3):
        velocity[k] += 2.25 * separation[k] * square / r5
        velocity[k] += 4.5 * size * (2.0 * product[k] - 5.0 * separation[k] * square / r2) / r5
        gradient[k, k] += 2.25 * square / r5
        for m in range(3):
            gradient[k, m] += (
                2.25 * separation[k] * (2.0 * product[m] - 5.0 * separation[m] * square / r2) / r5
            )


@compiled
def exerted(body, matrix, strain, stresslet):
    """Stresslet (3, 3), in the laboratory, of a body turned by matrix in a strain (3, 3); returns its present loads."""
    seen, five = np.empty(5), np.zeros(5)
    turn_back(matrix, strain, seen)
    for k in range(5):
        for m in range(5):
            five[k] += body.stresslet[k, m] * seen[m]
    local, half = np.empty((3, 3)), np.zeros((3, 3))
    five_tensor(five, local)
    stresslet[:] = 0.0
    for p in range(3):
        for q in range(3):
            for k in range(3):
                half[p, q] += matrix[p, k] * local[k, q]
    for p in range(3):
        for q in range(3):
            for k in range(3):
                stresslet[p, q] += half[p, k] * matrix[q, k]
    return present_load(body, seen)


@compiled
def body_rates(body, matrix, centre, gradient, disturbance, carried, velocity, spin):
    """Velocity and angular velocity (3,) of a body in the flow, a disturbance (3, 3) of its gradient, and one of its velocity."""
    total, strain = np.empty((3, 3)), np.empty((3, 3))
    for p in range(3):
        for q in range(3):
            total[p, q] = gradient[p, q] + disturbance[p, q]
    for p in range(3):
        for q in range(3):
            strain[p, q] = 0.5 * (total[p, q] + total[q, p])
    seen = np.empty(5)
    turn_back(matrix, strain, seen)
    for k in range(3):
        spin[k] = spin_component(total, k)
        velocity[k] = carried[k]
        for m in range(3):
            velocity[k] += gradient[k, m] * centre[m]
    for c in range(3):
        own_spin = own_drift = 0.0
        for m in range(5):
            own_spin += body.spin[c, m] * seen[m]
            own_drift += body.drift[c, m] * seen[m]
        for k in range(3):
            spin[k] += matrix[k, c] * own_spin
            velocity[k] += matrix[k, c] * own_drift


@separately_compiled(types.UniTuple(types.float64, 2))
def pair_rates(first, second, turns, centres, gradient, strain, velocities, spins):
    """Rates of both bodies with one reflection of their stresslets; returns the larger present loads (`present_load`)."""
    stresslets = np.empty((2, 3, 3))
    exerted(first, turns[0], strain, stresslets[0])
    exerted(second, turns[1], strain, stresslets[1])
    load = tension = 0.0
    disturbance, carried = np.zeros((2, 3, 3)), np.zeros((2, 3))
    separation = np.empty(3)
    a2, b2 = first.squared_radius, second.squared_radius
    # The second pass lets the strain of the first disturbances act on the stresslets.
    for _ in range(2):
        disturbance[:] = 0.0
        carried[:] = 0.0
        for k in range(3):
            separation[k] = centres[0, k] - centres[1, k]
        add_disturbance(stresslets[1], separation, b2 / 10.0 + a2 / 6.0, disturbance[0], carried[0])
        for k in range(3):
            separation[k] = -separation[k]
        add_disturbance(stresslets[0], separation, a2 / 10.0 + b2 / 6.0, disturbance[1], carried[1])
        local = np.empty((3, 3))
        for which in range(2):
            for p in range(3):
                for q in range(3):
                    local[p, q] = strain[p, q] + 0.5 * (disturbance[which, p, q] + disturbance[which, q, p])
            if which == 0:
                load, tension = exerted(first, turns[0], local, stresslets[0])
            else:
                other, pull = exerted(second, turns[1], local, stresslets[1])
                load, tension = max(load, other), max(tension, pull)
    body_rates(first, turns[0], centres[0], gradient, disturbance[0], carried[0], velocities[0], spins[0])
    body_rates(second, turns[1], centres[1], gradient, disturbance[1], carried[1], velocities[1], spins[1])
    return load, tension


class Pair(NamedTuple):
    """Two rigid bodies on their way; turns and centres are carried along."""

    first: RigidBody
    second: RigidBody
    turns: np.ndarray  # (2, 3, 3) rotations since they were analysed
    centres: np.ndarray  # (2, 3)


class Limits(NamedTuple):
    """How long two bodies are followed."""

    duration: float  # time [1/g]
    step: float  # of the midpoint rule, second order
    load: float  # share of its strength that a contact may bear


@compiled
def rates_of(pair, flow, velocities, spins):
    """`pair_rates` of two bodies where they are."""
    return pair_rates(
        pair.first, pair.second, pair.turns, pair.centres, flow.gradient, flow.strain, velocities, spins
    )


@separately_compiled()
def step_together(pair, flow, velocities, spins, step):
    """Carry two bodies over one step by the midpoint rule; the rates given are those at its start."""
    turns, centres = pair.turns, pair.centres
    middle_turns, middle = np.empty((2, 3, 3)), np.empty((2, 3))
    turn, after = np.empty((3, 3)), np.empty((3, 3))
    for which in range(2):
        rotation(spins[which] * (0.5 * step), turn)
        multiply(turn, turns[which], middle_turns[which])
        for k in range(3):
            middle[which, k] = centres[which, k] + 0.5 * step * velocities[which, k]
    rates_of(Pair(pair.first, pair.second, middle_turns, middle), flow, velocities, spins)
    for which in range(2):
        rotation(spins[which] * step, turn)
        multiply(turn, turns[which], after)
        turns[which] = after
        for k in range(3):
            centres[which, k] += step * velocities[which, k]


@compiled
def closing_speed(centres, velocities):
    """(distance of the centres, rate at which it falls)."""
    distance = closing = 0.0
    for k in range(3):
        d = centres[1, k] - centres[0, k]
        distance += d * d
        closing -= d * (velocities[1, k] - velocities[0, k])
    distance = np.sqrt(distance)
    return distance, closing / distance


@separately_compiled(types.UniTuple(types.float64, 2))
def approach(pair, flow, near, limits):
    """Bring two rigid bodies together until their centres are `near` apart; returns (time passed, largest tension over strength).

    It stops early when a contact would bear more than its limit, when they recede, or when the duration has passed.
    """
    velocities, spins = np.empty((2, 3)), np.empty((2, 3))
    elapsed, largest = 0.0, 0.0
    while elapsed < limits.duration - 1e-12:
        load, tension = rates_of(pair, flow, velocities, spins)
        if load > limits.load:
            break
        largest = max(largest, tension)
        distance, closing = closing_speed(pair.centres, velocities)
        if distance <= near or closing <= 0.0:
            break
        h = min(limits.step, limits.duration - elapsed, max(0.05 * distance, distance - near) / closing)
        h = max(h, 1e-3)
        step_together(pair, flow, velocities, spins, h)
        elapsed += h
    return elapsed, largest


@separately_compiled(types.float64)
def smallest_gap(pair, radii_first, radii_second):
    """Smallest gap between a primary of one body and one of the other."""
    first, second, turns, centres = pair.first, pair.second, pair.turns, pair.centres
    places = np.empty((first.positions.shape[0], 3))
    for i in range(places.shape[0]):
        for k in range(3):
            places[i, k] = centres[0, k] - centres[1, k]
            for m in range(3):
                places[i, k] += turns[0, k, m] * first.positions[i, m]
    smallest = np.inf
    place = np.empty(3)
    for j in range(second.positions.shape[0]):
        for k in range(3):
            place[k] = 0.0
            for m in range(3):
                place[k] += turns[1, k, m] * second.positions[j, m]
        for i in range(places.shape[0]):
            squares = 0.0
            for k in range(3):
                squares += (places[i, k] - place[k]) ** 2
            smallest = min(smallest, np.sqrt(squares) - radii_first[i] - radii_second[j])
    return smallest


class Passing(NamedTuple):
    """When two bodies surely miss each other."""

    radii_first: np.ndarray  # (P_1,) of the primaries
    radii_second: np.ndarray  # (P_2,)
    reaches: np.ndarray  # (2,) outer radii of the bodies
    margin: float  # gap that no two primaries may fall below
    apart: float  # distance over the sum of the outer radii from which they may be surely apart (`parting`)


@separately_compiled(types.Tuple((types.boolean, types.float64, types.float64, types.float64)))
def pass_by(pair, flow, passing, limits):
    """Let two rigid bodies pass each other; (whether they surely miss, time passed, largest tension over strength, smallest gap).

    They surely miss if no two of their primaries come closer than the margin, no contact ever bears more than its limit, and they
    are surely apart in the end, or the duration passes before.
    """
    velocities, spins = np.empty((2, 3)), np.empty((2, 3))
    elapsed, largest, closest = 0.0, 0.0, np.inf
    centres, reaches = pair.centres, passing.reaches
    while elapsed < limits.duration - 1e-12:
        load, tension = rates_of(pair, flow, velocities, spins)
        largest = max(largest, tension)
        closest = min(closest, smallest_gap(pair, passing.radii_first, passing.radii_second))
        if load > limits.load or closest < passing.margin:
            return False, elapsed, largest, closest
        if surely_apart(
            centres[1] - centres[0],
            velocities[1] - velocities[0],
            flow.gradient,
            reaches[1],
            reaches[0],
            passing.apart,
        ):
            return True, elapsed, largest, closest
        h = min(limits.step, limits.duration - elapsed)
        step_together(pair, flow, velocities, spins, h)
        elapsed += h
    return True, elapsed, largest, closest
