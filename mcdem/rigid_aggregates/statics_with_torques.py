"""Rigid aggregates whose contacts resist sliding, rolling or twisting: statics with torques.

As `rigid`, with the turns of the spheres among the unknowns, (turns | displacements) of 6P: the stiffness of the network is
that of normal forces and springs together, so that a chain can be rigid.  A contact is given by the gap and the springs that
it has; without flow, springs and gaps relax elastically to what balances, and the strain adds what is linear in it.

What a spring bears is held against its limit as the tension against the pull-off force.  A spring across the line of centres
is bounded in every direction: it is looked at along SIDES of them, whose bound is smaller than the circle's by a factor of
cos(pi/SIDES), so that no load passes unseen.  The limit of friction falls with the tension t, |s| <= c - d t: the load looked
at is e.s + d t, linear as well.

A sphere that can spin about its only contact unopposed is taken to turn along; where such a spin moves others, the aggregate is
floppy.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from mcdem.effects import (
    contact_limits,
    contact_pull_off_force,
    contact_resistance,
    non_contact_force,
)
from mcdem.effects.tangential import STUCK, turn_map
from mcdem.hydrodynamics import stokesian
from mcdem.hydrodynamics.linear_algebra import cholesky, solve_cholesky
from mcdem.integrators.contact_torques import (
    add_loads,
    add_normal_stiffness,
    add_resistance_stiffness,
    new_pair,
    place_of,
)
from mcdem.integrators.contacts import FORCE_RANGE
from mcdem.integrators.state import harmonic_radius
from mcdem.rigid_aggregates.statics import (
    FAILED,
    FLOPPY,
    RIGID,
    RigidBody,
    add_stresslet,
    count_contacts,
    drive_by_strains,
    empty_body,
    linear_contact,
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


@njit(cache=True)
def modes_with_turns(positions):
    """Three translations and three rotations about the centre, (6, 6P), as (turns | displacements)."""
    n = positions.shape[0]
    modes = np.zeros((6, 6 * n))
    modes[:, 3 * n :] = rigid_modes(positions)
    for i in range(n):
        for k in range(3):
            modes[3 + k, 3 * i + k] = 1.0
    return modes


@njit(cache=True)
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


@njit(cache=True)
def spring_change(
    map_, normal, distance, share, radius, motion, i, j, n, sliding, rolling, twisting, rods, pair
):
    """Change (7,), into pair.spring, of the springs of a contact by a small motion (6P,) of (turns | displacements)."""
    size = 0.0
    for a in range(7):
        pair.q[a] = 0.0
        for local in range(12):
            pair.q[a] += map_[a, local] * motion[place_of(local, i, j, n)]
        size = max(size, abs(pair.q[a]))
    scale = _TRIAL / size if size > 0.0 else 0.0
    for a in range(7):
        pair.q[a] *= scale
    contact_resistance(
        pair.no_turns,
        pair.q,
        normal,
        distance,
        share,
        radius,
        0.0,
        sliding,
        rolling,
        twisting,
        rods,
        pair.spring,
        pair.loads,
        pair.tangent,
    )
    for a in range(7):
        pair.spring[a] = pair.spring[a] / scale if scale > 0.0 else 0.0


@njit(cache=True)
def add_bearing(bearing, directions, distances, radii, pairs, slopes, maps, motion, laws, pair):
    """bearing (B, 8) += tension and springs of all contacts under a small motion (6P,)."""
    n = radii.shape[0]
    m = 3 * n
    sliding, rolling, twisting, rods = laws
    for b in range(pairs.shape[0]):
        i, j = pairs[b, 0], pairs[b, 1]
        for k in range(3):
            apart = motion[m + 3 * i + k] - motion[m + 3 * j + k]
            bearing[b, 0] += slopes[b] * directions[i, j, k] * apart
        share, radius = radii[j] / (radii[i] + radii[j]), harmonic_radius(radii[i], radii[j])
        spring_change(
            maps[b],
            directions[i, j],
            distances[i, j],
            share,
            radius,
            motion,
            i,
            j,
            n,
            sliding,
            rolling,
            twisting,
            rods,
            pair,
        )
        for a in range(7):
            bearing[b, 1 + a] += pair.spring[a]


@njit(cache=True)
def loads_of(rest, response, directions, radii, pairs, laws, jkr, dmt):
    """Loads (L,) at rest, (L, 5) per strain, and strengths (L,): tensions, then springs along their sides."""
    count = pairs.shape[0]
    sliding, rolling, twisting, rods = laws
    limits, e = np.empty((3, 2)), np.zeros((2, 3))
    most = count * (3 + 2 * SIDES)
    held, felt, strength = np.empty(most), np.empty((most, 5)), np.empty(most)
    for b in range(count):
        held[b], felt[b] = rest[b, 0], response[b, 0]
        strength[b] = contact_pull_off_force(
            harmonic_radius(radii[pairs[b, 0]], radii[pairs[b, 1]]), jkr, dmt
        )
    row = count
    for b in range(count):
        i, j = pairs[b, 0], pairs[b, 1]
        contact_limits(harmonic_radius(radii[i], radii[j]), sliding, rolling, twisting, rods, limits)
        across(directions[i, j], e)
        for spring in range(3):
            if limits[spring, 0] == np.inf:
                continue
            sides = SIDES if spring < 2 else 2
            for side in range(sides):
                held[row] = limits[spring, 1] * rest[b, 0]
                for c in range(5):
                    felt[row, c] = limits[spring, 1] * response[b, 0, c]
                if spring == 2:
                    sign = 1.0 - 2.0 * side
                    held[row] += sign * rest[b, 7]
                    for c in range(5):
                        felt[row, c] += sign * response[b, 7, c]
                    strength[row] = limits[2, 0]
                else:
                    angle = 2.0 * np.pi * side / SIDES
                    for k in range(3):
                        share = np.cos(angle) * e[0, k] + np.sin(angle) * e[1, k]
                        held[row] += share * rest[b, 1 + 3 * spring + k]
                        for c in range(5):
                            felt[row, c] += share * response[b, 1 + 3 * spring + k, c]
                    strength[row] = limits[spring, 0] * np.cos(np.pi / SIDES)
                row += 1
    return held[:row].copy(), felt[:row].copy(), strength[:row].copy()


@njit(cache=True)
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


@njit(cache=True)
def analyse_with_moments(work, positions, bonded, springs, radii, physics, coupled, stresslets, table):
    """(RIGID, FLOPPY or FAILED, body) of one connected aggregate; positions (P, 3) about its centre, springs (P, P, 7)."""
    n = radii.shape[0]
    if n == 1:
        return RIGID, of_sphere(radii[0])
    body = empty_body(n)
    m = 3 * n
    jkr, dmt = physics.jkr, physics.dmt
    laws = (physics.sliding, physics.rolling, physics.twisting, physics.rods)
    count = count_contacts(bonded)
    stokesian.measure(positions, work.directions, work.distances)
    pairs, slopes = np.empty((count, 2), np.int64), np.empty(count)
    maps, pair = np.empty((count, 7, 12)), new_pair()
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
                force, slopes[b] = linear_contact(gap, radius, jkr, dmt)
                pairs[b, 0], pairs[b, 1] = i, j
                typical = max(typical, slopes[b])
                code = contact_resistance(
                    springs[i, j],
                    pair.no_turns,
                    direction,
                    distance,
                    radii[j] / (radii[i] + radii[j]),
                    radius,
                    force,
                    physics.sliding,
                    physics.rolling,
                    physics.twisting,
                    physics.rods,
                    pair.spring,
                    pair.loads,
                    pair.tangent,
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
                force, _ = non_contact_force(
                    gap, radius, physics.van_der_waals, physics.double_layer, physics.short_range
                )
            else:
                continue
            for k in range(3):
                unbalanced[m + 3 * i + k] += force * direction[k]
                unbalanced[m + 3 * j + k] -= force * direction[k]
    modes = modes_with_turns(positions)
    if not factorise_network(stiffness, modes, typical):
        return FLOPPY, body
    solve_cholesky(stiffness, unbalanced)
    directions, distances = work.directions, work.distances
    add_bearing(rest, directions, distances, radii, pairs, slopes, maps, unbalanced, laws, pair)

    if stokesian.level_resistance(work, radii, coupled, stresslets) != 0:
        return FAILED, body
    unit, drives = np.eye(5), np.empty((5, 2 * m))
    drive_by_strains(work, radii, unit, drives, physics.cutoff, physics.shifted, stresslets, table)
    pulled, grand = pull_of_modes(work.resistance, modes), np.zeros((6, 6))
    if not rigid_resistance(modes, pulled, 0.0, grand):
        return FAILED, body
    relative, load = np.empty(2 * m), np.empty(2 * m)
    for k in range(5):
        move_as_body(
            work.resistance, positions, modes, pulled, grand, drives[k], unit, k, body, relative, load
        )
        add_stresslet(
            work, radii, positions, relative, load, physics.cutoff, stresslets, table, unit, k, body
        )
        # Contacts supply the load: K motion = -load.
        for row in range(2 * m):
            load[row] = -load[row]
        solve_cholesky(stiffness, load)
        add_bearing(response[:, :, k], directions, distances, radii, pairs, slopes, maps, load, laws, pair)
    held, felt, strength = loads_of(rest, response, directions, radii, pairs, laws, jkr, dmt)
    return RIGID, RigidBody(
        positions.copy(),
        body.spin,
        body.drift,
        body.stresslet,
        count,
        held,
        felt,
        strength,
        squared_radius(positions, radii),
    )
