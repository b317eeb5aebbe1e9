"""Two rigid aggregates near each other: the hydrodynamics of all their primaries, and no contact in between to be found.

What the moments of one body make of the fluid at the primaries of the other is a disturbance, and what its primaries bear by
the two-body part of pairs is a load. The other answers both by its motion and by moments of its own (`responses`); they go
from one to the other until nothing changes any more (method of reflections: Smoluchowski 1911; Kim & Karrila 1991, ch. 8).
The result is Stokesian dynamics of all primaries with rigid aggregates, but for the two-body part of pairs further than FADED
from each other: it falls off as the seventh power of the distance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, types

from mcdem.compilation import compiled, separately_compiled
from mcdem.hydrodynamics import level as levels
from mcdem.hydrodynamics.frozen_far_field import nearest_rotation, turned_tensor
from mcdem.hydrodynamics.grand_mobility import five_tensor, tensor_to_five
from mcdem.hydrodynamics.linear_algebra import (
    add_product,
    add_transposed_product,
    multiply_symmetric,
    solve_cholesky,
)
from mcdem.hydrodynamics.mobility_product import rates_caused
from mcdem.hydrodynamics.resistance import Work, measure, workspace
from mcdem.hydrodynamics.undisturbed_flow import spin_component
from mcdem.integrators.parting import surely_apart
from mcdem.integrators.rotations import multiply, turn_back
from mcdem.rigid_aggregates.responses import Response
from mcdem.rigid_aggregates.statics import RigidBody, present_load

CONVERGED = 1e-5
"""Change of either body's motion [a g, g] by one more reflection that ends them."""
MOST_REFLECTIONS = 30
FADED = 3.0
"""Gap in a beyond which the two-body part of a pair of one primary of each body is left out."""
LONGEST_STEP = 0.4
"""Longest step in 1/g."""
SHARE_OF_GAP = 0.3
"""... and over the time in which the bodies would close the smallest gap and two radii at least. Gaps are looked at in the
middle of a step too, so none of gap h falls by more than 0.075 (h + 2a) unseen. After bodies of ten primaries have passed
each other at a gap of a radius, they are within 1e-4 a of where a twentieth of both steps brings them."""


# How a passage ended.
APART = 0  # surely
NEAR = 1  # two primaries came closer than the margin
LOADED = 2  # a contact would bear more than its limit, or the reflections do not settle
OVER = 3  # its time is over, or so many steps are taken


class Side(NamedTuple):
    """One of the two bodies, and work arrays."""

    body: RigidBody
    response: Response
    radii: np.ndarray  # (P,)
    places: np.ndarray  # (3, P) of the primaries, in the laboratory
    rows: np.ndarray  # (12, P) moments there, as in `mobility_product`
    rates: np.ndarray  # (12, P) what the moments of the other body make there
    moving: np.ndarray  # (2, P, 3) spins and velocities relative to the flow, in the laboratory
    load: np.ndarray  # (2, P, 3) torques and forces by the two-body part, in the laboratory
    own: np.ndarray  # (11P,) moments without the other body, in its frame, as are
    moments: np.ndarray  # (11P,) those of now
    disturbance: np.ndarray  # (11P,)
    borne: np.ndarray  # (6P,) the load
    motion: np.ndarray  # (F,) y, by what the other body does
    last: np.ndarray  # (6,) motion of the whole before the last reflection
    seen: np.ndarray  # (5,) strain


class Close(NamedTuple):
    """The pairs of one primary of each body whose two-body part is taken."""

    filled: np.ndarray  # (1,) how many there are
    pairs: np.ndarray  # (P_1 P_2, 2)
    resistance: np.ndarray  # (P_1 P_2, 12, 12) ordered (omega | u)
    strain_load: np.ndarray  # (P_1 P_2, 12)
    work: Work  # of two spheres
    positions: np.ndarray  # (2, 3)
    radii: np.ndarray  # (2,)


class NearPair(NamedTuple):
    """Two rigid bodies near each other; turns and centres are carried along."""

    first: Side
    second: Side
    close: Close
    turns: np.ndarray  # (2, 3, 3) rotations since they were analysed
    centres: np.ndarray  # (2, 3)
    velocities: np.ndarray  # (2, 3) of the centres, and ...
    spins: np.ndarray  # (2, 3) ... angular velocities, where `pass_near` last found them


def side(body: RigidBody, response: Response, radii: np.ndarray) -> Side:
    """A body with its work arrays."""
    n = len(radii)
    return Side(
        body,
        response,
        radii,
        places=np.zeros((3, n)),
        rows=np.zeros((12, n)),
        rates=np.zeros((12, n)),
        moving=np.zeros((2, n, 3)),
        load=np.zeros((2, n, 3)),
        own=np.zeros(11 * n),
        moments=np.zeros(11 * n),
        disturbance=np.zeros(11 * n),
        borne=np.zeros(6 * n),
        motion=np.zeros(len(response.factor)),
        last=np.zeros(6),
        seen=np.zeros(5),
    )


def near_pair(first: Side, second: Side, turns: np.ndarray, centres: np.ndarray) -> NearPair:
    """Two bodies near each other, turned by (2, 3, 3) since they were analysed, with their centres at (2, 3)."""
    most = len(first.radii) * len(second.radii)
    close = Close(
        np.zeros(1, np.int64),
        np.empty((most, 2), np.int64),
        np.empty((most, 12, 12)),
        np.empty((most, 12)),
        workspace(2),
        np.empty((2, 3)),
        np.empty(2),
    )
    return NearPair(first, second, close, turns, centres, np.zeros((2, 3)), np.zeros((2, 3)))


@compiled
def put(one, turn, centre, strain):
    """Primaries of a body where it is, the strain it sees, and its moments in that."""
    n = one.radii.shape[0]
    positions = one.body.positions
    for i in range(n):
        for k in range(3):
            one.places[k, i] = (
                centre[k]
                + turn[k, 0] * positions[i, 0]
                + turn[k, 1] * positions[i, 1]
                + turn[k, 2] * positions[i, 2]
            )
    turn_back(turn, strain, one.seen)
    for k in range(11 * n):
        one.own[k] = 0.0
        for strain_of in range(5):
            one.own[k] += one.response.straining[strain_of, k] * one.seen[strain_of]


@separately_compiled()
def exert(one, turn):
    """Moments of a body as rows in the laboratory."""
    n = one.radii.shape[0]
    moments, rows = one.moments, one.rows
    local, tensor = np.empty((3, 3)), np.empty((3, 3))
    for i in range(n):
        for p in range(3):
            force = torque = 0.0
            for k in range(3):
                force += turn[p, k] * moments[8 * n + 3 * i + k]
                torque += turn[p, k] * moments[5 * n + 3 * i + k]
            rows[p, i], rows[3 + p, i] = force, torque
        five_tensor(moments[5 * i : 5 * i + 5], local)
        turned_tensor(turn, local, tensor, False)
        rows[6, i], rows[7, i], rows[8, i] = tensor[0, 0], tensor[1, 1], tensor[2, 2]
        rows[9, i], rows[10, i], rows[11, i] = tensor[0, 1], tensor[0, 2], tensor[1, 2]


@njit(cache=True, fastmath={"reassoc", "contract", "arcp", "nsz"})
def disturb(one, other):
    """What the moments of the other body make at the primaries of one, as rows in the laboratory."""
    rates_caused(one.places, one.radii, other.places, other.radii, other.rows, one.rates)


@separately_compiled(types.float64)
def answer(one, turn):
    """Moments and motion of a body in what the other one does; returns by how much the motion of the whole changed."""
    n = one.radii.shape[0]
    rates, disturbance, motion, response = one.rates, one.disturbance, one.motion, one.response
    local, tensor, five = np.empty((3, 3)), np.empty((3, 3)), np.empty(5)
    for i in range(n):
        tensor[0, 0], tensor[1, 1], tensor[2, 2] = rates[6, i], rates[7, i], rates[8, i]
        tensor[0, 1] = tensor[1, 0] = rates[9, i]
        tensor[0, 2] = tensor[2, 0] = rates[10, i]
        tensor[1, 2] = tensor[2, 1] = rates[11, i]
        turned_tensor(turn, tensor, local, True)
        tensor_to_five(local, five)
        for k in range(5):
            disturbance[5 * i + k] = five[k]
        for p in range(3):
            spin = drift = torque = force = 0.0
            for k in range(3):
                drift += turn[k, p] * rates[k, i]
                spin += turn[k, p] * rates[3 + k, i]
                torque += turn[k, p] * one.load[0, i, k]
                force += turn[k, p] * one.load[1, i, k]
            disturbance[5 * n + 3 * i + p], disturbance[8 * n + 3 * i + p] = spin, drift
            one.borne[3 * i + p], one.borne[3 * (n + i) + p] = torque, force
    motion[:] = 0.0
    add_product(response.answers, disturbance, motion, 1.0)
    add_product(response.allowed, one.borne, motion, 1.0)
    solve_cholesky(response.factor, motion)
    multiply_symmetric(response.inverse, disturbance, one.moments)
    for k in range(11 * n):
        one.moments[k] = one.own[k] - one.moments[k]
    add_transposed_product(response.answers, motion, one.moments, 1.0)
    change = 0.0
    first = motion.shape[0] - 6
    for k in range(6):
        change = max(change, abs(motion[first + k] - one.last[k]))
        one.last[k] = motion[first + k]
    return change


@separately_compiled()
def move(one, turn):
    """Rates of the primaries of a body relative to the flow, in the laboratory."""
    n = one.radii.shape[0]
    response = one.response
    local = np.zeros(6 * n)
    for strain in range(5):
        for k in range(6 * n):
            local[k] += response.moving[strain, k] * one.seen[strain]
    add_transposed_product(response.allowed, one.motion, local, 1.0)
    for part in range(2):
        for i in range(n):
            for p in range(3):
                one.moving[part, i, p] = 0.0
                for k in range(3):
                    one.moving[part, i, p] += turn[p, k] * local[3 * (part * n + i) + k]


@separately_compiled()
def find_close(pair, level, strain):
    """Pairs of one primary of each body that are near each other, and their two-body parts."""
    first, second, close = pair.first, pair.second, pair.close
    work, positions = close.work, close.positions
    count = 0
    for i in range(first.radii.shape[0]):
        for j in range(second.radii.shape[0]):
            squares = 0.0
            for k in range(3):
                positions[0, k], positions[1, k] = first.places[k, i], second.places[k, j]
                squares += (positions[0, k] - positions[1, k]) ** 2
            if squares > (first.radii[i] + second.radii[j] + FADED) ** 2:
                continue
            close.radii[0], close.radii[1] = first.radii[i], second.radii[j]
            measure(positions, work.directions, work.distances)
            for row in range(12):
                work.strain_load[row] = 0.0
                for column in range(12):
                    work.resistance[row, column] = 0.0
            levels.two_body(level, work, close.radii, strain)
            close.pairs[count, 0], close.pairs[count, 1] = i, j
            for row in range(12):
                close.strain_load[count, row] = work.strain_load[row]
                for column in range(row + 1):
                    close.resistance[count, row, column] = work.resistance[row, column]
                    close.resistance[count, column, row] = work.resistance[row, column]
            count += 1
    close.filled[0] = count
    first.load[:] = 0.0
    second.load[:] = 0.0


@separately_compiled()
def bear(pair):
    """What the primaries of both bodies bear by the two-body parts of their pairs, at their rates."""
    first, second, close = pair.first, pair.second, pair.close
    rates = np.empty(12)
    first.load[:] = 0.0
    second.load[:] = 0.0
    for c in range(close.filled[0]):
        i, j = close.pairs[c, 0], close.pairs[c, 1]
        for part in range(2):
            for k in range(3):
                rates[6 * part + k] = first.moving[part, i, k]
                rates[6 * part + 3 + k] = second.moving[part, j, k]
        for part in range(2):
            for k in range(3):
                mine, other = close.strain_load[c, 6 * part + k], close.strain_load[c, 6 * part + 3 + k]
                for m in range(12):
                    mine -= close.resistance[c, 6 * part + k, m] * rates[m]
                    other -= close.resistance[c, 6 * part + 3 + k, m] * rates[m]
                first.load[part, i, k] += mine
                second.load[part, j, k] += other


@compiled
def rates_and_load(one, turn, centre, gradient, velocity, spin):
    """Velocity and angular velocity (3,) of a body; returns its largest load, in the strain at any primary, and its tension.

    The tension is that in the mean strain.  What the other body does bends it too, which no one strain says.
    """
    n = one.radii.shape[0]
    mean, there = one.seen.copy(), np.empty(5)
    load = 0.0
    for i in range(n):
        for k in range(5):
            there[k] = one.seen[k] - one.disturbance[5 * i + k]
            mean[k] -= one.disturbance[5 * i + k] / n
        worst, _ = present_load(one.body, there)
        load = max(load, worst)
    for k in range(3):
        spin[k] = spin_component(gradient, k)
        velocity[k] = gradient[k, 0] * centre[0] + gradient[k, 1] * centre[1] + gradient[k, 2] * centre[2]
    for c in range(3):
        own_drift, own_spin = one.last[c], one.last[3 + c]
        for m in range(5):
            own_drift += one.response.motion[m, c] * one.seen[m]
            own_spin += one.response.motion[m, 3 + c] * one.seen[m]
        for k in range(3):
            velocity[k] += turn[k, c] * own_drift
            spin[k] += turn[k, c] * own_spin
    worst, tension = present_load(one.body, mean)
    return max(load, worst), tension


@separately_compiled(types.Tuple((types.boolean, types.float64, types.float64)))
def reflected_rates(pair, level, turns, centres, flow, velocities, spins):
    """Rates (2, 3) of both bodies at the places given; (whether the reflections settled, larger present loads)."""
    first, second = pair.first, pair.second
    put(first, turns[0], centres[0], flow.strain)
    put(second, turns[1], centres[1], flow.strain)
    find_close(pair, level, flow.strain)
    borne = pair.close.filled[0] > 0
    settled = False
    for reflection in range(MOST_REFLECTIONS):
        if borne:
            move(first, turns[0])
            move(second, turns[1])
            bear(pair)
        exert(second, turns[1])
        disturb(first, second)
        change = answer(first, turns[0])
        exert(first, turns[0])
        disturb(second, first)
        change = max(change, answer(second, turns[1]))
        if reflection > 0 and change < CONVERGED:
            settled = True
            break
        if not change < 1e3:
            break
    load, tension = rates_and_load(first, turns[0], centres[0], flow.gradient, velocities[0], spins[0])
    other, pull = rates_and_load(second, turns[1], centres[1], flow.gradient, velocities[1], spins[1])
    return settled, max(load, other), max(tension, pull)


@compiled
def gap_and_speed(pair, velocities, spins):
    """(smallest gap between primaries of both bodies, a bound on the speed with which any gap changes)."""
    first, second = pair.first, pair.second
    smallest = np.inf
    for i in range(first.radii.shape[0]):
        for j in range(second.radii.shape[0]):
            squares = 0.0
            for k in range(3):
                squares += (first.places[k, i] - second.places[k, j]) ** 2
            smallest = min(smallest, np.sqrt(squares) - first.radii[i] - second.radii[j])
    drift = 0.0
    for k in range(3):
        drift += (velocities[1, k] - velocities[0, k]) ** 2
    speed = np.sqrt(drift)
    for which in range(2):
        positions = first.body.positions if which == 0 else second.body.positions
        far = turning = 0.0
        for i in range(positions.shape[0]):
            squares = 0.0
            for k in range(3):
                squares += positions[i, k] ** 2
            far = max(far, squares)
        for k in range(3):
            turning += spins[which, k] ** 2
        speed += np.sqrt(far * turning)
    return smallest, speed


class Stages(NamedTuple):
    """Work arrays of a step."""

    turns: np.ndarray  # (2, 3, 3) within the step
    centres: np.ndarray  # (2, 3)
    velocities: np.ndarray  # (2, 3)
    spins: np.ndarray  # (2, 3)
    turn_sum: np.ndarray  # (2, 3, 3)
    centre_sum: np.ndarray  # (2, 3)


@separately_compiled(types.Tuple((types.boolean, types.float64)))
def step_near(pair, level, flow, stages, step, margin):
    """Carry both bodies over one step by Runge & Kutta's fourth-order rule; stages holds the rates at its start.

    Returns (whether all reflections settled, smallest gap in the middle).  Where they do not, or the gap is below the margin,
    both stay where they are.
    """
    turned, crossed = np.empty((3, 3)), np.zeros((3, 3))
    stages.turn_sum[:] = 0.0
    stages.centre_sum[:] = 0.0
    middle_gap = np.inf
    stages.turns[:] = pair.turns
    stages.centres[:] = pair.centres
    for stage in range(4):
        if stage > 0:
            fine, _, _ = reflected_rates(
                pair, level, stages.turns, stages.centres, flow, stages.velocities, stages.spins
            )
            if stage == 2:
                middle_gap, _ = gap_and_speed(pair, stages.velocities, stages.spins)
            if not fine or middle_gap < margin:
                return fine, middle_gap
        weight = step / 6.0 if stage == 0 or stage == 3 else step / 3.0
        ahead = step if stage == 2 else 0.5 * step
        for which in range(2):
            w = stages.spins[which]
            crossed[0, 1], crossed[0, 2], crossed[1, 2] = -w[2], w[1], -w[0]
            crossed[1, 0], crossed[2, 0], crossed[2, 1] = w[2], -w[1], w[0]
            multiply(crossed, stages.turns[which], turned)
            for p in range(3):
                stages.centre_sum[which, p] += weight * stages.velocities[which, p]
                stages.centres[which, p] = pair.centres[which, p] + ahead * stages.velocities[which, p]
                for q in range(3):
                    stages.turn_sum[which, p, q] += weight * turned[p, q]
                    stages.turns[which, p, q] = pair.turns[which, p, q] + ahead * turned[p, q]
    for which in range(2):
        for p in range(3):
            pair.centres[which, p] += stages.centre_sum[which, p]
            for q in range(3):
                pair.turns[which, p, q] += stages.turn_sum[which, p, q]
        nearest_rotation(pair.turns[which])
    return True, middle_gap


@separately_compiled(types.Tuple((types.int64, types.float64, types.float64, types.float64)))
def pass_near(pair, level, flow, passing, limits, most_steps):
    """Let two rigid bodies pass each other, in `most_steps` of limits.step at most.

    Returns (APART, NEAR, LOADED or OVER, time passed, largest tension over strength, smallest gap).
    """
    velocities, spins = pair.velocities, pair.spins
    stages = Stages(
        np.empty((2, 3, 3)), np.empty((2, 3)), velocities, spins, np.empty((2, 3, 3)), np.empty((2, 3))
    )
    elapsed, largest, closest, steps = 0.0, 0.0, np.inf, 0
    centres, reaches = pair.centres, passing.reaches
    while elapsed < limits.duration - 1e-12 and steps < most_steps:
        settled, load, tension = reflected_rates(pair, level, pair.turns, centres, flow, velocities, spins)
        if not settled or load > limits.load:
            return LOADED, elapsed, largest, closest
        largest = max(largest, tension)
        gap, speed = gap_and_speed(pair, velocities, spins)
        if gap < passing.margin:
            return NEAR, elapsed, largest, closest
        closest = min(closest, gap)
        if surely_apart(
            centres[1] - centres[0],
            velocities[1] - velocities[0],
            flow.gradient,
            reaches[1],
            reaches[0],
            passing.apart,
        ):
            return APART, elapsed, largest, closest
        step = min(limits.step, limits.duration - elapsed, SHARE_OF_GAP * (gap + 2.0) / speed)
        settled, gap = step_near(pair, level, flow, stages, step, passing.margin)
        if not settled or gap < passing.margin:
            reflected_rates(pair, level, pair.turns, centres, flow, velocities, spins)
            return LOADED if not settled else NEAR, elapsed, largest, closest
        closest = min(closest, gap)
        elapsed += step
        steps += 1
    return OVER, elapsed, largest, closest
