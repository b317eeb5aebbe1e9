"""Rigid aggregates whose contacts resist sliding, rolling or twisting: statics with torques.

As `statics`, with the rotations of the spheres among the unknowns, (rotations | displacements) of 6P: the stiffness of the
network is that of normal forces and springs together, so that a chain can be rigid.  A contact is given by the gap and springs
that it has; without flow, springs and gaps relax elastically to what balances, and the strain adds what is linear in it.

The load of a spring is compared with its limit as the tension is with the pull-off force.  A spring across the line of centres
is bounded in every direction: it is looked at along SIDES of them, whose bound is smaller than the circle's by a factor of
cos(pi/SIDES), so that no load passes unseen.  The limit of friction falls with the tension t, |s| <= c - d t: the load looked
at is e.s + d t, linear as well.

A sphere that can spin about its only contact unopposed is taken to turn along; where such a spin moves others, the aggregate is
floppy.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types

from mcdem.compilation import compiled, separately_compiled
from mcdem.effects.kinds import Response, Turned
from mcdem.effects.sums import (
    contact_limits,
    contact_pull_off_force,
    contact_resistance,
    non_contact_force,
)
from mcdem.effects.tangential import STUCK, turn_map
from mcdem.hydrodynamics import level as levels
from mcdem.hydrodynamics.linear_algebra import cholesky, solve_cholesky
from mcdem.hydrodynamics.resistance import measure
from mcdem.integrators.contact_torques import (
    add_loads,
    add_normal_stiffness,
    add_resistance_stiffness,
    new_pair,
    place_of,
)
from mcdem.integrators.pairs import FORCE_RANGE
from mcdem.integrators.state import harmonic_radius
from mcdem.rigid_aggregates.statics import (
    BODY,
    FAILED,
    FLOPPY,
    RIGID,
    RigidBody,
    RigidMotions,
    add_stresslet,
    count_contacts,
    empty_body,
    keep_motion,
    linear_contact,
    loads_of_strains,
    move_as_body,
    of_sphere,
    pull_of_modes,
    rigid_modes,
    rigid_resistance,
    squared_radius,
)

SIDES = 16
# Stiffness added to the turn of every sphere, and the smallest pivot of a displacement that counts as rigid, over the stiffness
# of a contact: that of a chain of 100 is 1e-7; where only the addition resists, a pivot is at most some hundred times it.
_SPIN = 1e-12
_RIGIDITY = 1e-9
# Turns by which springs are tried: far below every limit.
_TRIAL = 1e-9


@compiled
def modes_with_turns(positions):
    """Three translations and three rotations about the centre, (6, 6P), as (rotations | displacements)."""
    n = positions.shape[0]
    modes = np.zeros((6, 6 * n))
    modes[:, 3 * n :] = rigid_modes(positions)
    for i in range(n):
        for k in range(3):
            modes[3 + k, 3 * i + k] = 1.0
    return modes


@compiled
def factorise_network(stiffness, modes, typical):
    """Factor of the network's stiffness (6P, 6P) with its rigid motions stiffened; True if nothing is floppy.

    These are stiffened by their displacements alone: otherwise one could hide behind a spin that nothing resists.
    """
    rows = stiffness.shape[0]
    for mode in range(6):
        square = 0.0
        for row in range(rows // 2, rows):
            square += modes[mode, row] ** 2
        if square == 0.0:  # of a straight chain about its axis
            continue
        for row in range(rows // 2, rows):
            for column in range(rows // 2, row + 1):
                stiffness[row, column] += typical * modes[mode, row] * modes[mode, column] / square
    for row in range(rows // 2):
        stiffness[row, row] += _SPIN * typical
    if cholesky(stiffness) != 0:
        return False
    for row in range(rows // 2, rows):
        if stiffness[row, row] ** 2 < _RIGIDITY * typical:
            return False
    return True


class Network(NamedTuple):
    """The contacts of an aggregate where it is; B of them."""

    directions: np.ndarray  # (P, P, 3)
    distances: np.ndarray  # (P, P)
    radii: np.ndarray  # (P,)
    pairs: np.ndarray  # (B, 2) i > j
    slopes: np.ndarray  # (B,) normal stiffness
    maps: np.ndarray  # (B, 7, 12) from the motion of both spheres to the turns of the contact


@compiled
def spring_change(network, b, motion, resistances, pair):
    """Change (7,), into pair.spring, of the springs of contact b by a small motion (6P,) of (rotations | displacements)."""
    i, j = network.pairs[b, 0], network.pairs[b, 1]
    radii, n = network.radii, network.radii.shape[0]
    size = 0.0
    for a in range(7):
        pair.q[a] = 0.0
        for local in range(12):
            pair.q[a] += network.maps[b, a, local] * motion[place_of(local, i, j, n)]
        size = max(size, abs(pair.q[a]))
    scale = _TRIAL / size if size > 0.0 else 0.0
    for a in range(7):
        pair.q[a] *= scale
    turned = Turned(
        pair.no_turns,
        pair.q,
        network.directions[i, j],
        network.distances[i, j],
        radii[j] / (radii[i] + radii[j]),
        harmonic_radius(radii[i], radii[j]),
        0.0,
    )
    contact_resistance(turned, resistances, Response(pair.spring, pair.loads, pair.tangent))
    for a in range(7):
        pair.spring[a] = pair.spring[a] / scale if scale > 0.0 else 0.0


@compiled
def add_bearing(bearing, network, motion, resistances, pair):
    """bearing (B, 8) += tension and springs of all contacts under a small motion (6P,)."""
    m = 3 * network.radii.shape[0]
    for b in range(network.pairs.shape[0]):
        i, j = network.pairs[b, 0], network.pairs[b, 1]
        for k in range(3):
            apart = motion[m + 3 * i + k] - motion[m + 3 * j + k]
            bearing[b, 0] += network.slopes[b] * network.directions[i, j, k] * apart
        spring_change(network, b, motion, resistances, pair)
        for a in range(7):
            bearing[b, 1 + a] += pair.spring[a]


@compiled
def loads_of(rest, response, network, physics):
    """Loads (L,) at rest, (L, 5) per strain, and strengths (L,): tensions, then springs along their sides."""
    radii, pairs = network.radii, network.pairs
    count = pairs.shape[0]
    limits, e = np.empty((3, 2)), np.zeros((2, 3))
    most = count * (3 + 2 * SIDES)
    static, per_strain, strength = np.empty(most), np.empty((most, 5)), np.empty(most)
    for b in range(count):
        static[b], per_strain[b] = rest[b, 0], response[b, 0]
        strength[b] = contact_pull_off_force(
            harmonic_radius(radii[pairs[b, 0]], radii[pairs[b, 1]]), physics.contact
        )
    row = count
    for b in range(count):
        i, j = pairs[b, 0], pairs[b, 1]
        contact_limits(harmonic_radius(radii[i], radii[j]), physics.resistances, limits)
        across(network.directions[i, j], e)
        for spring in range(3):
            if limits[spring, 0] == np.inf:
                continue
            sides = SIDES if spring < 2 else 2
            for side in range(sides):
                static[row] = limits[spring, 1] * rest[b, 0]
                for c in range(5):
                    per_strain[row, c] = limits[spring, 1] * response[b, 0, c]
                if spring == 2:
                    sign = 1.0 - 2.0 * side
                    static[row] += sign * rest[b, 7]
                    for c in range(5):
                        per_strain[row, c] += sign * response[b, 7, c]
                    strength[row] = limits[2, 0]
                else:
                    angle = 2.0 * np.pi * side / SIDES
                    for k in range(3):
                        share = np.cos(angle) * e[0, k] + np.sin(angle) * e[1, k]
                        static[row] += share * rest[b, 1 + 3 * spring + k]
                        for c in range(5):
                            per_strain[row, c] += share * response[b, 1 + 3 * spring + k, c]
                    strength[row] = limits[spring, 0] * np.cos(np.pi / SIDES)
                row += 1
    return static[:row].copy(), per_strain[:row].copy(), strength[:row].copy()


@compiled
def across(normal, e):
    """Two unit vectors (2, 3) across a normal (3,)."""
    least = 0
    for k in range(1, 3):
        if abs(normal[k]) < abs(normal[least]):
            least = k
    size = np.sqrt(1.0 - normal[least] ** 2)
    for k in range(3):
        e[0, k] = ((1.0 if k == least else 0.0) - normal[least] * normal[k]) / size
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        e[1, k] = normal[a] * e[0, b] - normal[b] * e[0, a]


@separately_compiled(types.Tuple((types.int64, BODY)))
def analyse_with_torques(work, positions, bonded, springs, radii, physics):
    """(RIGID, FLOPPY or FAILED, body) of one connected aggregate; positions (P, 3) about its centre, springs (P, P, 7)."""
    n = radii.shape[0]
    if n == 1:
        return RIGID, of_sphere(radii[0])
    body = empty_body(n)
    m = 3 * n
    count = count_contacts(bonded)
    measure(positions, work.directions, work.distances)
    network = Network(
        work.directions,
        work.distances,
        radii,
        np.empty((count, 2), np.int64),
        np.empty(count),
        np.empty((count, 7, 12)),
    )
    pairs, slopes, maps, pair = network.pairs, network.slopes, network.maps, new_pair()
    rest, response = np.zeros((count, 8)), np.zeros((count, 8, 5))
    unbalanced, stiffness = np.zeros(2 * m), np.zeros((2 * m, 2 * m))
    typical = 0.0
    b = 0
    for i in range(n):
        for j in range(i):
            direction, distance = work.directions[i, j], work.distances[i, j]
            gap = distance - radii[i] - radii[j]
            radius = harmonic_radius(radii[i], radii[j])
            if bonded[i, j]:
                force, slopes[b] = linear_contact(gap, radius, physics.contact)
                pairs[b, 0], pairs[b, 1] = i, j
                typical = max(typical, slopes[b])
                share_1 = radii[j] / (radii[i] + radii[j])
                turned = Turned(springs[i, j], pair.no_turns, direction, distance, share_1, radius, force)
                code = contact_resistance(
                    turned, physics.resistances, Response(pair.spring, pair.loads, pair.tangent)
                )
                if code != STUCK:
                    return FLOPPY, body
                rest[b, 0] = -force
                rest[b, 1:] = pair.spring
                turn_map(direction, distance, maps[b])
                add_normal_stiffness(stiffness, slopes[b], 0.0, direction, i, j, n)
                add_resistance_stiffness(stiffness, pair.tangent, maps[b], i, j, n)
                add_loads(unbalanced, direction, distance, i, j, n, pair)
                b += 1
            elif gap < FORCE_RANGE:
                force, _ = non_contact_force(gap, radius, physics.pair_forces)
            else:
                continue
            for k in range(3):
                unbalanced[m + 3 * i + k] += force * direction[k]
                unbalanced[m + 3 * j + k] -= force * direction[k]
    modes = modes_with_turns(positions)
    if not factorise_network(stiffness, modes, typical):
        return FLOPPY, body
    solve_cholesky(stiffness, unbalanced)
    add_bearing(rest, network, unbalanced, physics.resistances, pair)

    level = physics.level
    if levels.resistance(level, work, radii) != 0:
        return FAILED, body
    unit, strain_loads = np.eye(5), np.empty((5, 2 * m))
    loads_of_strains(level, work, radii, unit, strain_loads)
    rigid = RigidMotions(modes, pull_of_modes(work.resistance, modes), np.zeros((6, 6)))
    if not rigid_resistance(rigid, np.zeros(3)):
        return FAILED, body
    relative, load, own = np.empty(2 * m), np.empty(2 * m), np.empty(6)
    for k in range(5):
        move_as_body(work.resistance, positions, rigid, strain_loads[k], unit[k], own, relative, load)
        keep_motion(body, k, own)
        add_stresslet(level, work, radii, positions, relative, load, unit[k], body.stresslet[:, k])
        # Contacts supply the load: K motion = -load.
        for row in range(2 * m):
            load[row] = -load[row]
        solve_cholesky(stiffness, load)
        add_bearing(response[:, :, k], network, load, physics.resistances, pair)
    static, per_strain, strength = loads_of(rest, response, network, physics)
    return RIGID, RigidBody(
        positions.copy(),
        body.spin,
        body.drift,
        body.stresslet,
        count,
        static,
        per_strain,
        strength,
        squared_radius(positions, radii),
    )
