"""Resistance of contacts to sliding, rolling and twisting: the mechanics that its laws share.

Two spheres in contact, 1 and 2, with r = x2 - x1 and n = r/|r|.  Over a step, seen from the turning line of centres, their
relative motion but for the gap is seven numbers, the *relative rotations*

    q[0:3]  turn of sphere 1 across n,      q[3:6]  turn of sphere 2 across n,      q[6]  twist of 2 against 1 about n,

all zero for a motion of the pair as a rigid body (objectivity; Kuhn & Bagi 2004, Luding 2008).  With the distances w1 r and
w2 r of the contact from the centres (w1 + w2 = 1, w_i proportional to the radius) and the mean turn m = w1 q1 + w2 q2,

    sliding  s = r n x m  (surface of 2 over that of 1),     rolling  q2 - q1,     twisting  q[6].

A law keeps a spring of seven numbers for each contact, its *tangential displacement history*, and gives *loads* conjugate to
q: power = loads . dq/dt.  Loads are minus stiffness times spring; a spring whose load would pass its limit is cut back to it
(Cundall & Strack 1979).
Laws add (`Effects`); each states which part of the history it keeps.

One step of one contact, for an integrator that finds the motion of the step by iteration:

    relative_turns(before, after, turn_1, turn_2, fixed,
                   q, normals, spins)                                   what the motion does to the contact
    carry(history, normals[0], normals[1], spins, carried)              springs, turned with the pair to the middle of the step
    contact_resistance(turned, resistances, response)                   springs at the end of the step, loads, stiffness
    spread(loads, normals[1], distance, force_2, torque_1, torque_2)    what acts on the spheres
    turn_map(normals[1], distance, B)                                   stiffness of the spheres' motion: B^T tangent B
    carry(spring, normals[1], normals[2], spins, history)               once, when the step is done

The turn of a sphere is the vector u of dx = u x (middle position): 2 tan(theta/2) along the axis of a rotation by theta, and the
angular velocity times the time step of a midpoint rule.  So a discretely rigid motion leaves springs as they were, whatever the
step.  Vectors are (3,), springs and loads (7,), in reduced units (or any consistent ones); out arguments come last.
"""

from __future__ import annotations

from math import sqrt

from mcdem.compilation import compiled

STUCK = 0
SLIDES, ROLLS, TWISTS = 1, 2, 4  # bits of the code that a law returns for springs at their limits


@compiled
def relative_turns(before, after, turn_1, turn_2, fixed, q, normals, spins):
    """Turns `q` (7,) over a step that takes r from `before` to `after` while the spheres turn by `turn_1`, `turn_2`.

    `normals` (3, 3) become those at the start, the middle and the end of the step; `spins` (2,) tan(psi/2) of the spin psi about
    the line of centres by which the two vectors of a history turn: that of the pair, or, `fixed` in their spheres, that of these.
    Returns |r| in the middle.
    """
    normal = normals[1]
    start, square, end = 0.0, 0.0, 0.0
    for k in range(3):
        normal[k] = 0.5 * (before[k] + after[k])
        start += before[k] * before[k]
        square += normal[k] * normal[k]
        end += after[k] * after[k]
    start, distance, end = sqrt(start), sqrt(square), sqrt(end)
    spin_1, spin_2, cosine = 0.0, 0.0, 0.0
    for k in range(3):
        normals[0, k] = before[k] / start
        normal[k] /= distance
        normals[2, k] = after[k] / end
        spin_1 += turn_1[k] * normal[k]
        spin_2 += turn_2[k] * normal[k]
        cosine += normals[0, k] * normal[k]
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        line = (normal[a] * (after[b] - before[b]) - normal[b] * (after[a] - before[a])) / distance
        q[k] = turn_1[k] - spin_1 * normal[k] - line
        q[3 + k] = turn_2[k] - spin_2 * normal[k] - line
    q[6] = spin_2 - spin_1
    # A body turns by u = line + spin n; after the shortest turn of n, what is left is a spin of tan(psi/2) = u . n_start/2.
    if fixed:
        spins[0], spins[1] = 0.5 * spin_1 * cosine, 0.5 * spin_2 * cosine
    else:
        spins[:] = 0.25 * (spin_1 + spin_2) * cosine
    return distance


@compiled
def carry(spring, start, end, spins, carried):
    """Turn the springs of a contact with the pair over half a step: by the shortest turn from normal `start` to normal `end`,
    and about that by psi/2, where `spins` = tan(psi/2).  Lengths stay as they are.
    """
    cosine = 1.0
    for k in range(3):
        cosine += start[k] * end[k]
    for vector in range(2):
        m = 3 * vector
        share = 0.0
        for k in range(3):
            share += spring[m + k] * end[k]
        share /= cosine
        x = spring[m] - share * (start[0] + end[0])
        y = spring[m + 1] - share * (start[1] + end[1])
        z = spring[m + 2] - share * (start[2] + end[2])
        c = 1.0 / sqrt(1.0 + spins[vector] * spins[vector])
        s = spins[vector] * c
        carried[m] = c * x + s * (end[1] * z - end[2] * y)
        carried[m + 1] = c * y + s * (end[2] * x - end[0] * z)
        carried[m + 2] = c * z + s * (end[0] * y - end[1] * x)
    carried[6] = spring[6]


@compiled
def spread(loads, normal, distance, force_2, torque_1, torque_2):
    """Force on sphere 2 (that on sphere 1 is its opposite) and torques of the `loads`; they do the work of the loads."""
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        across = (loads[a] + loads[3 + a]) * normal[b] - (loads[b] + loads[3 + b]) * normal[a]
        force_2[k] = -across / distance
        torque_1[k] = loads[k] - loads[6] * normal[k]
        torque_2[k] = loads[3 + k] + loads[6] * normal[k]


@compiled
def turn_map(normal, distance, B):
    """Matrix (7, 12) of q = B (dx1, turn_1, dx2, turn_2); -B^T tangent B is the stiffness of the spheres' motion."""
    B[:] = 0.0
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        for row in (k, 3 + k):
            # The line of centres turns by n x (dx2 - dx1)/r.
            B[row, 6 + b] -= normal[a] / distance
            B[row, 6 + a] += normal[b] / distance
            B[row, b] += normal[a] / distance
            B[row, a] -= normal[b] / distance
            for j in range(3):
                B[row, (3 if row < 3 else 9) + j] -= normal[k] * normal[j]
        B[k, 3 + k] += 1.0
        B[3 + k, 9 + k] += 1.0
        B[6, 3 + k] = -normal[k]
        B[6, 9 + k] = normal[k]


@compiled
def cut_back(spring, first, largest):
    """Cut the vector spring[first:first+3] back to the length `largest`; returns its length after over that before."""
    square = spring[first] ** 2 + spring[first + 1] ** 2 + spring[first + 2] ** 2
    if square <= largest * largest:
        return 1.0
    share = largest / sqrt(square)
    for k in range(first, first + 3):
        spring[k] *= share
    return share


@compiled
def add_stiffness(tangent, row, column, stiffness, normal, limit):
    """Add stiffness (1 - n n) to a block (3, 3); a spring at its limit has none along itself, its unit vector `limit`."""
    for a in range(3):
        for b in range(3):
            across = (1.0 if a == b else 0.0) - normal[a] * normal[b]
            tangent[row + a, column + b] += stiffness * (across - limit[a] * limit[b])


@compiled
def direction(spring, first, share, out):
    """Unit vector of spring[first:first+3] if it was cut back (share < 1), else zero."""
    square = spring[first] ** 2 + spring[first + 1] ** 2 + spring[first + 2] ** 2
    scale = 1.0 / sqrt(square) if share < 1.0 and square > 0.0 else 0.0
    for k in range(3):
        out[k] = spring[first + k] * scale
