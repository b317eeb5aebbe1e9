"""Linearly implicit midpoint steps: hydrodynamics at the extrapolated midpoint, contacts at the end of the step.

A contact of the paper relaxes in 1 us, a hundredth of the shear time, so explicit steps are bound to that.  Here

    A(x_mid) (x1 - x0)/dt = A u_inf(x_mid) + drive(x_mid) + F_non-contact(mid) + F_contact(x1)

where A is the resistance of torque-free spheres.  Contact forces are the gradient of a function that is convex up
to pull-off and straight beyond, so Newton on 3N unknowns with frozen hydrodynamics finds x1 in a few cheap
iterations.  What makes it work at a fifth of the shear time:
  the midpoint turns every body as a whole (`bodies`), and gaps of close pairs are extrapolated as numbers;
  the first iteration takes contacts by their tangents at the old gaps, since a poor start lies on the flat end
  of the adhesion law; later ones have the tangent floored at 2 % of the equilibrium stiffness;
  contact forces act along the sum of the old and the new line of centres (discrete gradient), so that a bond
  that turns does no work.
Steps are bound by the relative change of the gaps of approaching pairs, never by stiffness.  Contacts made or
lost within a step are events: the step is cut until their time is known to `event_step`.

Contacts that resist sliding, rolling or twisting exert torques: then the turns of the spheres are unknowns too, and
`moments` takes the place of the two functions here that know of 3N (`drive_spheres`, `solve_step`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from mcdem.effects import contact_force, contact_gap, contact_pull_off_gap
from mcdem.hydrodynamics import frozen_far_field as lagged
from mcdem.hydrodynamics import stokesian
from mcdem.hydrodynamics.linear_algebra import cholesky, multiply_symmetric, solve_cholesky
from mcdem.integrators import contact_torques as moments
from mcdem.integrators.bodies import extrapolate, label_bodies, share_beyond
from mcdem.integrators.contacts import add_non_contact_forces, contact_tangent, stay_at_mean
from mcdem.integrators.state import (
    DONE,
    NOT_CONVERGED,
    NOT_FINITE,
    NOT_POSITIVE_DEFINITE,
    forget_older,
    harmonic_radius,
    note_contact_lost,
    note_contact_made,
    note_tension,
    remember,
)

# Share of the longest step that is taken while two bodies are within a radius of each other, and for the strain SETTLING
# after a contact was made or lost: what happens then decides.
NEAR = 0.5
SETTLING = 1.0
# Share of it that the first step takes, which has no step before it to foresee the middle from.
FIRST = 0.3
# Newton's method is done when it moves no primary by more than this, in a.
CONVERGED = 1e-7
# Below it a step has failed.  Strong attraction in a weak flow closes the last of a gap, down to where a stiff contact bears
# it, within 1e-15/g: the clock hardly notices, the primaries do.
SMALLEST_STEP = 1e-18


class ImplicitOptions(NamedTuple):
    """Numerics of the scheme; lengths in a, times in 1/g."""

    max_step: float
    event_step: float  # a step in which a contact is lost is cut to this
    gap_fraction: float  # change of the gap of a pair per step: gap_fraction * gap + gap_floor
    gap_floor: float
    turn_limit: float  # relative motion per step of close pairs of different bodies, over their mean radius
    close_gap: float  # below it gaps are extrapolated as numbers
    far_field_lag: (
        float  # relative change of a separation after which the far field is made anew; 0: every step
    )


class Scratch(NamedTuple):
    """Work arrays of the scheme."""

    hydrodynamics: stokesian.Work
    kept: lagged.Lagged
    middle: np.ndarray  # (N, 3)
    end: np.ndarray  # (N, 3)
    gaps: np.ndarray  # (N, N) at the middle of the step
    end_gaps: np.ndarray  # (N, N)
    forces: np.ndarray  # (N, 3)
    driving: np.ndarray  # (3N,) A u_inf + drive + forces
    jacobian: np.ndarray  # (3N, 3N)
    residual: np.ndarray  # (3N,)
    move: np.ndarray  # (3N,)
    iterations: np.ndarray  # (1,) of Newton's method, for the profile
    labels: np.ndarray  # (N,)
    pairs: np.ndarray  # (B, 2) contacts
    normals: np.ndarray  # (B, 3)
    slopes: np.ndarray  # (B,) stiffness of the contacts now, and ...
    factor_slopes: np.ndarray  # (B,) ... in the Jacobian that is factorised
    turnings: np.ndarray  # (B,) tension over length of the contacts, their resistance to turning
    moments: moments.Moments | None  # where contacts exert torques


def scratch(n: int, resisting: bool = False) -> Scratch:
    """Work arrays for n primaries; `resisting`: whose contacts resist sliding, rolling or twisting."""
    return Scratch(
        stokesian.workspace(n),
        lagged.new_lagged(n),
        np.empty((n, 3)),
        np.empty((n, 3)),
        np.empty((n, n)),
        np.empty((n, n)),
        np.empty((n, 3)),
        np.empty(3 * n),
        np.empty((3 * n, 3 * n)),
        np.empty(3 * n),
        np.empty(3 * n),
        np.zeros(1, np.int64),
        np.empty(n, np.int64),
        np.empty((n * (n - 1) // 2, 2), np.int64),
        np.empty((n * (n - 1) // 2, 3)),
        np.empty(n * (n - 1) // 2),
        np.empty(n * (n - 1) // 2),
        np.empty(n * (n - 1) // 2),
        moments.new_moments(n) if resisting else None,
    )


@njit(cache=True)
def list_contacts(bonded, pairs):
    """Contacts i > j of (N, N) into pairs (B, 2); returns their count."""
    count = 0
    for i in range(bonded.shape[0]):
        for j in range(i):
            if bonded[i, j]:
                pairs[count, 0], pairs[count, 1] = i, j
                count += 1
    return count


@njit(cache=True)
def find_gaps(positions, radii, gaps):
    """Surface gaps of all pairs into gaps (N, N)."""
    for i in range(radii.shape[0]):
        for j in range(i):
            r = 0.0
            for k in range(3):
                r += (positions[i, k] - positions[j, k]) ** 2
            gaps[i, j] = gaps[j, i] = np.sqrt(r) - radii[i] - radii[j]


@njit(cache=True)
def approach_speed(positions, velocities, i, j):
    """(rate of change of the centre distance, relative speed) of a pair."""
    distance = along = speed = 0.0
    for k in range(3):
        d = positions[i, k] - positions[j, k]
        v = velocities[i, k] - velocities[j, k]
        distance += d * d
        along += d * v
        speed += v * v
    return along / np.sqrt(distance), np.sqrt(speed)


@njit(cache=True)
def allowed_step(motion, labels, gaps, options):
    """Longest step that resolves the gaps of pairs not in contact, from the last velocities."""
    step = options.max_step
    for i in range(motion.radii.shape[0]):
        for j in range(i):
            gap = gaps[i, j]
            if motion.bonded[i, j] or gap > 1.0:
                continue
            if labels[i] != labels[j]:
                step = min(step, NEAR * options.max_step)
            rate, speed = approach_speed(motion.positions, motion.velocities, i, j)
            room = options.gap_fraction * max(gap, 0.0) + options.gap_floor
            if rate != 0.0:
                step = min(step, room / abs(rate))
            if labels[i] != labels[j] and gap < options.close_gap and speed > 0.0:
                step = min(step, options.turn_limit * (0.5 * (motion.radii[i] + motion.radii[j])) / speed)
    return step


@njit(cache=True)
def gap_rate(motion, history, gaps, step, i, j):
    """Rate of change of a gap at a quarter of the coming step, from the gaps of the last two steps."""
    if history.steps[0] == 0.0:
        rate, _ = approach_speed(motion.positions, motion.velocities, i, j)
        return rate
    last = (gaps[i, j] - history.gaps[0, i, j]) / history.steps[0]
    if history.steps[1] == 0.0:
        return last
    older = (history.gaps[0, i, j] - history.gaps[1, i, j]) / history.steps[1]
    share = (0.5 * history.steps[0] + 0.25 * step) / (0.5 * (history.steps[0] + history.steps[1]))
    return last + share * (last - older)


@njit(cache=True)
def middle_geometry(motion, history, labels, bodies, gaps, step, options, work):
    """Positions, directions, distances and gaps at the extrapolated midpoint."""
    hydro = work.hydrodynamics
    extrapolate(motion.positions, history, labels, bodies, 0.5 * step, work.middle)
    stokesian.measure(work.middle, hydro.directions, hydro.distances)
    for i in range(motion.radii.shape[0]):
        for j in range(i):
            touching = motion.radii[i] + motion.radii[j]
            if gaps[i, j] < options.close_gap:
                if motion.bonded[i, j]:
                    gap = gaps[i, j]
                else:
                    rate = gap_rate(motion, history, gaps, step, i, j)
                    gap = max(gaps[i, j] + 0.5 * step * rate, 0.5 * gaps[i, j])
                hydro.distances[i, j] = hydro.distances[j, i] = touching + gap
            work.gaps[i, j] = work.gaps[j, i] = hydro.distances[i, j] - touching


@njit(cache=True, inline="always")
def drive_at_middle(motion, flow, physics, labels, bodies, share, lag, work):
    """Resistance of the spheres and everything that drives them but contacts; 0 or an error code."""
    hydro = work.hydrodynamics
    code = lagged.far_field(
        work.kept,
        hydro,
        motion.radii,
        work.middle,
        labels,
        bodies,
        flow.strain,
        share,
        lag,
        physics.coupled,
        physics.stresslets,
    )
    if code != 0:
        return NOT_POSITIVE_DEFINITE
    add_two_body(hydro, motion.radii, flow.strain, physics.cutoff, physics.shifted, physics.table)
    work.forces[:] = 0.0
    add_non_contact_forces(
        work.forces,
        hydro.directions,
        work.gaps,
        motion.bonded,
        motion.radii,
        physics.van_der_waals,
        physics.double_layer,
        physics.short_range,
    )
    return drive_spheres(flow, work, work.moments)


@njit(cache=True)
def drive_spheres(flow, work, torques):
    """What drives the spheres, by what they can do: turn freely, or turn against the torques of their contacts."""
    if torques is not None:
        return moments.drive(flow, work, torques)
    return drive_torque_free(flow, work)


@njit(cache=True)
def drive_torque_free(flow, work):
    """Reduce the resistance to A of torque-free spheres; what drives them into work.driving; 0 or an error code."""
    hydro = work.hydrodynamics
    n = work.middle.shape[0]
    if stokesian.eliminate_torques(hydro.resistance) != 0:
        return NOT_POSITIVE_DEFINITE
    stokesian.reduce_drive(hydro.resistance, hydro.drive)
    m = 3 * n
    matrix = hydro.resistance[m:, m:]
    for i in range(n):
        for k in range(3):
            work.residual[3 * i + k] = (
                flow.gradient[k, 0] * work.middle[i, 0]
                + flow.gradient[k, 1] * work.middle[i, 1]
                + flow.gradient[k, 2] * work.middle[i, 2]
            )
            work.driving[3 * i + k] = hydro.drive[m + 3 * i + k] + work.forces[i, k]
    stay_at_mean(work.residual, flow.centred)
    multiply_symmetric(matrix, work.residual, work.move)
    for row in range(m):
        work.driving[row] += work.move[row]
    return 0


@njit(cache=True)
def learn_moments(motion, flow, step, work, torques):
    """Tell the kept far field how the primaries moved in the step that was taken; torques : work of `moments` or None."""
    if not work.kept.made[0]:
        return
    hydro, gradient, spin = work.hydrodynamics, flow.gradient, work.residual
    for i in range(motion.radii.shape[0]):
        for k in range(3):
            work.residual[3 * i + k] = (
                gradient[k, 0] * work.middle[i, 0]
                + gradient[k, 1] * work.middle[i, 1]
                + gradient[k, 2] * work.middle[i, 2]
            )
    stay_at_mean(work.residual, flow.centred)
    for i in range(motion.radii.shape[0]):
        for k in range(3):
            work.move[3 * i + k] = motion.velocities[i, k] - work.residual[3 * i + k]
    if torques is None:
        stokesian.angular_velocities(hydro.resistance, hydro.drive, work.move, spin)
    else:
        moments.spins(gradient, step, torques, spin)
    lagged.learn(work.kept, hydro, spin, work.move)


@njit(cache=True)
def add_two_body(hydro, radii, strain, cutoff, shifted, table):
    """Lubrication, where the scene has it."""
    if table is not None:
        stokesian.add_lubrication(hydro, radii, strain, cutoff, shifted, table)


@njit(cache=True)
def add_stiffness(matrix, step, contacts, work):
    """Jacobian of the contact problem: resistance over the step plus the contacts' stiffness (slopes, turnings)."""
    jacobian = work.jacobian
    for row in range(jacobian.shape[0]):
        for column in range(row + 1):
            jacobian[row, column] = matrix[row, column] / step
    for b in range(contacts):
        i, j, slope, turning = work.pairs[b, 0], work.pairs[b, 1], work.slopes[b], work.turnings[b]
        work.factor_slopes[b] = slope
        for k in range(3):
            for l in range(3):
                value = (slope - turning) * work.normals[b, k] * work.normals[b, l]
                if k == l:
                    value += turning
                jacobian[3 * i + k, 3 * j + l] -= value
                if l <= k:
                    jacobian[3 * i + k, 3 * i + l] += value
                    jacobian[3 * j + k, 3 * j + l] += value


@njit(cache=True)
def solve_step(motion, contacts, gaps, step, physics, work, springs):
    """Newton for the positions at the end of the step, from the guess in work.end; 0 or NOT_CONVERGED."""
    if springs is not None:
        return moments.solve(
            motion.positions,
            motion.radii,
            contacts,
            gaps,
            step,
            springs,
            physics.jkr,
            physics.dmt,
            physics.sliding,
            physics.rolling,
            physics.twisting,
            physics.rods,
            work,
            work.moments,
        )
    return solve_contacts(
        motion.positions, motion.radii, contacts, gaps, step, physics.jkr, physics.dmt, work
    )


@njit(cache=True)
def keep_springs(motion, contacts, physics, work, springs):
    """The histories of contacts at the end of an accepted step."""
    if springs is not None:
        moments.keep_springs(
            motion.positions,
            motion.radii,
            contacts,
            springs,
            physics.jkr,
            physics.dmt,
            physics.sliding,
            physics.rolling,
            physics.twisting,
            physics.rods,
            work,
            work.moments,
        )


@njit(cache=True)
def solve_contacts(positions, radii, contacts, gaps, step, jkr, dmt, work):
    """Newton for the positions at the end of the step, from the guess in work.end; 0 or NOT_CONVERGED.

    The first iteration takes each contact by its tangent at the old gap, the following ones by the law itself.
    When that does not settle, the start is made once more with linear springs about equilibrium.  A Jacobian is kept
    while no contact's stiffness changed by more than a tenth of the stiffness without load and each iteration still
    moves the primaries by less than a tenth of the one before, which also bounds what is left by the last move.  A move
    that does not is not made: where contacts bear a thousand times what the flow exerts, it may lead far away.
    """
    n = radii.shape[0]
    m = 3 * n
    matrix = work.hydrodynamics.resistance[m:, m:]
    jacobian, residual, move = work.jacobian, work.residual, work.move
    factorised = False
    last = change = np.inf
    for iteration in range(48):
        fallback = iteration == 16 or iteration == 17
        keep = factorised
        for i in range(n):
            for k in range(3):
                move[3 * i + k] = (work.end[i, k] - positions[i, k]) / step
        multiply_symmetric(matrix, move, residual)
        for row in range(m):
            residual[row] = work.driving[row] - residual[row]
        for b in range(contacts):
            i, j = work.pairs[b, 0], work.pairs[b, 1]
            force, slope, turning, stiffness = contact_tangent(
                positions, work.end, radii, gaps, i, j, iteration == 0, fallback, jkr, dmt, work.normals[b]
            )
            work.slopes[b], work.turnings[b] = slope, turning
            if keep and abs(slope - work.factor_slopes[b]) > 0.1 * stiffness:
                keep = False
            for k in range(3):
                along = force * work.normals[b, k]
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
                work.end[i, k] += move[3 * i + k]
        log_iterations(work)
        if not np.isfinite(change):
            return NOT_CONVERGED
        if contacts == 0:
            return 0
        last = change
        if iteration >= 1 and not fallback and change < CONVERGED:
            return 0
    return NOT_CONVERGED


@njit(cache=True)
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


@njit(cache=True)
def worst_overstretch(contacts, radii, jkr, dmt, work):
    """(index, excess over its pull-off gap) of the contact stretched furthest beyond it; (-1, 0) if none is."""
    worst, excess = -1, 0.0
    for b in range(contacts):
        i, j = work.pairs[b, 0], work.pairs[b, 1]
        limit = contact_pull_off_gap(harmonic_radius(radii[i], radii[j]), jkr, dmt)
        beyond = work.end_gaps[i, j] - limit
        if beyond > excess:
            worst, excess = b, beyond
    return worst, excess


@njit(cache=True)
def put_last(pairs, which, count):
    """Move one of the first `count` pairs (B, 2) behind the others, whose order stays; returns how many these are."""
    i, j = pairs[which, 0], pairs[which, 1]
    for b in range(which, count - 1):
        pairs[b, 0], pairs[b, 1] = pairs[b + 1, 0], pairs[b + 1, 1]
    pairs[count - 1, 0], pairs[count - 1, 1] = i, j
    return count - 1


@njit(cache=True, inline="always")
def advance(motion, history, flow, physics, options, log, gaps, work, end_time):
    """One accepted step; gaps (N, N) are those now and are renewed.  Returns DONE or an error code."""
    jkr, dmt = physics.jkr, physics.dmt
    bodies = label_bodies(motion.bonded, work.labels)
    step = allowed_step(motion, work.labels, gaps, options)
    # Not a number, so no comparison holds, until a contact changes.
    if log.time[0] - log.last_bond_change[0] < SETTLING:
        step = min(step, NEAR * options.max_step)
    if history.steps[0] > 0.0:
        step = min(step, 2.0 * history.steps[0])
        if log.last_bond_change[0] == log.time[0]:
            # Losses come in rows: a longer step would only be cut to the event step again.
            step = min(step, max(history.steps[0], options.event_step))
    else:
        step = min(step, FIRST * options.max_step)
    step = min(step, max(end_time - log.time[0], 1e-12))
    return attempt(motion, history, flow, physics, options, log, gaps, work, bodies, step, jkr, dmt)


@njit(cache=True, inline="always")
def attempt(motion, history, flow, physics, options, log, gaps, work, bodies, step, jkr, dmt):
    """Try steps from `step` downwards until one is accepted."""
    radii, n = motion.radii, motion.radii.shape[0]
    while True:
        if step < SMALLEST_STEP:
            return NOT_CONVERGED
        middle_geometry(motion, history, work.labels, bodies, gaps, step, options, work)
        log.solves[0] += 1
        share = share_beyond(history, step)
        code = drive_at_middle(motion, flow, physics, work.labels, bodies, share, options.far_field_lag, work)
        if code != 0:
            if step > 1e-6 and not np.isfinite(work.middle.sum()):
                return NOT_FINITE
            return code
        contacts = list_contacts(motion.bonded, work.pairs)
        extrapolate(motion.positions, history, work.labels, bodies, step, work.end)
        if solve_step(motion, contacts, gaps, step, physics, work, motion.springs) != 0:
            step *= 0.5
            continue
        find_gaps(work.end, radii, work.end_gaps)
        lost, _ = worst_overstretch(contacts, radii, jkr, dmt, work)
        if lost >= 0 and step > options.event_step:
            step = max(0.5 * step, options.event_step)
            continue
        reject = False
        for i in range(n):
            for j in range(i):
                if motion.bonded[i, j] or gaps[i, j] > 1.0:
                    continue
                room = 2.5 * (options.gap_fraction * max(gaps[i, j], 0.0) + options.gap_floor)
                if abs(work.end_gaps[i, j] - gaps[i, j]) > room:
                    reject = True
                # A contact is made no deeper than it bears the drag of a sphere: stiff ones would start far beyond.
                if work.end_gaps[i, j] < min(gaps[i, j], 0.0):
                    deepest = contact_gap(1.0, harmonic_radius(radii[i], radii[j]), jkr, dmt)
                    if work.end_gaps[i, j] < min(gaps[i, j], 0.0) + deepest:
                        reject = True
        if reject:
            step *= 0.5
            continue
        # The most overstretched contact goes first and may relieve the others.
        kept = contacts
        while lost >= 0:
            kept = put_last(work.pairs, lost, kept)
            if solve_step(motion, kept, gaps, step, physics, work, motion.springs) != 0:
                break
            find_gaps(work.end, radii, work.end_gaps)
            lost, _ = worst_overstretch(kept, radii, jkr, dmt, work)
        if lost < 0:
            break
        step *= 0.5
    now = log.time[0] + step
    changed = False
    for b in range(kept, contacts):
        note_contact_lost(motion, log, work.pairs[b, 0], work.pairs[b, 1], now)
        changed = True
    for b in range(kept):
        i, j = work.pairs[b, 0], work.pairs[b, 1]
        force, _ = contact_force(work.end_gaps[i, j], harmonic_radius(radii[i], radii[j]), jkr, dmt)
        note_tension(motion, log, i, j, -force, now)
    keep_springs(motion, kept, physics, work, motion.springs)
    for i in range(n):
        for k in range(3):
            motion.velocities[i, k] = (work.end[i, k] - motion.positions[i, k]) / step
    learn_moments(motion, flow, step, work, work.moments)
    work.middle[:] = motion.positions
    motion.positions[:] = work.end
    remember(history, motion, work.middle, gaps, step)
    for i in range(n):
        for j in range(i):
            gaps[i, j] = gaps[j, i] = work.end_gaps[i, j]
            if motion.parent[i] != motion.parent[j]:
                log.smallest_gap[0] = min(log.smallest_gap[0], gaps[i, j])
            if make_contact(motion, log, gaps, i, j, now, jkr, dmt):
                changed = True
    if changed:
        forget_older(history)
        lagged.forget(work.kept)
    log.time[0] = now
    log.steps[0] += 1
    return DONE


@njit(cache=True)
def make_contact(motion, log, gaps, i, j, now, jkr, dmt):
    """A pair that meets at h <= 0 is in contact from then on, where the scene has contacts; True if it now is."""
    if gaps[i, j] > 0.0 or motion.bonded[i, j]:
        return False
    if jkr is not None or dmt is not None:
        note_contact_made(motion, log, i, j, now)
        return True
    return False
