"""From the start of an encounter to its end.

Without shortcuts this is one loop over the steps of the chosen scheme, all primaries together.  The shortcuts
(`Shortcuts`, each with an off) skip what cannot change the outcome:

  far approach     two rigid aggregates come together as bodies with a stresslet (`approach`)
  separate bodies  parts that recede from each other go on as smaller problems
  rigid rotation   an aggregate without floppy modes turns as a rigid body until its load nears its strength (`rigid`)
  inert            a rigid aggregate that bears its worst orientation is done: nothing can happen to it alone

What is floppy, near something else, or near its strength is followed primary by primary.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from mcdem.effects import contact_force
from mcdem.stepping.approach import approach
from mcdem.stepping.bodies import label_bodies
from mcdem.stepping.implicit import advance, find_gaps, scratch
from mcdem.stepping.paper_euler import advance_paper
from mcdem.stepping.rigid import RIGID, analyse, tumble, worst_load
from mcdem.stepping.state import (
    DONE,
    TOO_MANY_STEPS,
    Motion,
    harmonic_radius,
    new_history,
)

SEPARATED = -1


class Shortcuts(NamedTuple):
    """Which shortcuts are taken; lengths in R_i + R_j, loads in pull-off forces, times in 1/g."""

    far_approach: float  # centre distance up to which rigid aggregates approach as bodies; 0: off
    separation: float  # centre distance beyond which receding parts go on alone; 0: off
    rigid_rotation: bool
    inert: bool
    load_limit: float  # largest load at which an aggregate is taken as rigid
    quiet_time: float  # strain without a change of contacts before an aggregate is taken as rigid


@njit(cache=True)
def record_frame(motion, members, jkr, dmt, time, frames):
    """Write the state of some primaries to every frame whose time has come."""
    while True:
        k = frames.written[members[0]]
        if k >= frames.time.shape[0] or time < frames.interval * k - 1e-9:
            return
        for i in range(members.shape[0]):
            p = members[i]
            frames.written[p] = k + 1
            frames.positions[k, p] = motion.positions[i]
            for j in range(i):
                q = members[j]
                if motion.bonded[i, j]:
                    r = 0.0
                    for c in range(3):
                        r += (motion.positions[i, c] - motion.positions[j, c]) ** 2
                    gap = np.sqrt(r) - motion.radii[i] - motion.radii[j]
                    force, _ = contact_force(gap, harmonic_radius(motion.radii[i], motion.radii[j]), jkr, dmt)
                    frames.tension[k, p, q] = frames.tension[k, q, p] = -force


@njit(cache=True)
def keep_frame(motion, members, physics, time, frames):
    """Record, where the caller asked for it."""
    if frames is not None:
        record_frame(motion, members, physics.jkr, physics.dmt, time, frames)


@njit(cache=True)
def centre_and_reach(positions, radii, labels, body, centre):
    """Centre (3,) of one body; returns its outer radius."""
    members = 0
    centre[:] = 0.0
    for i in range(radii.shape[0]):
        if labels[i] == body:
            members += 1
            for k in range(3):
                centre[k] += positions[i, k]
    for k in range(3):
        centre[k] /= members
    reach = 0.0
    for i in range(radii.shape[0]):
        if labels[i] == body:
            r = 0.0
            for k in range(3):
                r += (positions[i, k] - centre[k]) ** 2
            reach = max(reach, np.sqrt(r) + radii[i])
    return reach


@njit(cache=True)
def mean_velocity(velocities, labels, body, out):
    """Mean velocity (3,) of one body."""
    members = 0
    out[:] = 0.0
    for i in range(labels.shape[0]):
        if labels[i] == body:
            members += 1
            for k in range(3):
                out[k] += velocities[i, k]
    for k in range(3):
        out[k] /= members


@njit(cache=True)
def all_parting(motion, labels, bodies, gradient, factor):
    """Whether every two bodies are further apart than `factor` (R_i + R_j) and recede in the undisturbed flow too.

    Pairs on nearly the same streamline may turn back (closed orbits): they are never let go.
    """
    first, second, v1, v2 = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for a in range(bodies):
        reach_a = centre_and_reach(motion.positions, motion.radii, labels, a, first)
        mean_velocity(motion.velocities, labels, a, v1)
        for b in range(a):
            reach_b = centre_and_reach(motion.positions, motion.radii, labels, b, second)
            mean_velocity(motion.velocities, labels, b, v2)
            distance = receding = undisturbed = 0.0
            for k in range(3):
                d = first[k] - second[k]
                distance += d * d
                receding += d * (v1[k] - v2[k])
                for m in range(3):
                    undisturbed += d * gradient[k, m] * (first[m] - second[m])
            limit = factor * (reach_a + reach_b)
            if distance < limit * limit or receding <= 0.0 or undisturbed < 0.05 * distance:
                return False
    return True


@njit(cache=True)
def take(motion, members):
    """A copy of some primaries (m,) as a motion of their own."""
    m = members.shape[0]
    part = Motion(
        np.empty((m, 3)),
        np.empty((m, 3)),
        np.empty((m, m), np.bool_),
        np.empty((m, m)),
        np.empty(m),
        np.empty(m, np.int64),
    )
    for i in range(m):
        p = members[i]
        for k in range(3):
            part.positions[i, k] = motion.positions[p, k]
            part.velocities[i, k] = motion.velocities[p, k]
        part.radii[i] = motion.radii[p]
        part.parent[i] = motion.parent[p]
        for j in range(m):
            part.bonded[i, j] = motion.bonded[p, members[j]]
            part.born[i, j] = motion.born[p, members[j]]
    return part


@njit(cache=True)
def put_back(part, members, motion):
    """Write a part back; contacts across its border are gone."""
    for i in range(members.shape[0]):
        p = members[i]
        for k in range(3):
            motion.positions[p, k] = part.positions[i, k]
            motion.velocities[p, k] = part.velocities[i, k]
        for j in range(members.shape[0]):
            motion.bonded[p, members[j]] = part.bonded[i, j]
            motion.born[p, members[j]] = part.born[i, j]


@njit(cache=True)
def analyse_part(part, physics, centre):
    """`rigid.analyse` of a motion that is one body; fills its centre (3,)."""
    n = part.radii.shape[0]
    labels = np.zeros(n, np.int64)
    centre_and_reach(part.positions, part.radii, labels, 0, centre)
    about = np.empty((n, 3))
    for i in range(n):
        for k in range(3):
            about[i, k] = part.positions[i, k] - centre[k]
    return analyse(
        about,
        part.bonded,
        part.radii,
        physics.cutoff,
        physics.shifted,
        physics.table,
        physics.van_der_waals,
        physics.double_layer,
        physics.short_range,
        physics.jkr,
        physics.dmt,
    )


@njit(cache=True)
def place_body(part, body, turn, centre, gradient):
    """Put the primaries of a rigid body where it is; velocities are those of the flow, for a start."""
    for i in range(part.radii.shape[0]):
        for k in range(3):
            part.positions[i, k] = (
                centre[k]
                + turn[k, 0] * body.positions[i, 0]
                + turn[k, 1] * body.positions[i, 1]
                + turn[k, 2] * body.positions[i, 2]
            )
    spin = np.array(
        [
            0.5 * (gradient[2, 1] - gradient[1, 2]),
            0.5 * (gradient[0, 2] - gradient[2, 0]),
            0.5 * (gradient[1, 0] - gradient[0, 1]),
        ]
    )
    for i in range(part.radii.shape[0]):
        x = part.positions[i, 0] - centre[0]
        y = part.positions[i, 1] - centre[1]
        z = part.positions[i, 2] - centre[2]
        turning = (spin[1] * z - spin[2] * y, spin[2] * x - spin[0] * z, spin[0] * y - spin[1] * x)
        for k in range(3):
            part.velocities[i, k] = turning[k]
            for m in range(3):
                part.velocities[i, k] += gradient[k, m] * centre[m]


@njit(cache=True)
def roll_on(part, members, body, centre, flow, physics, log, frames, end_time, limit):
    """Turn a rigid part until the end or until its load exceeds `limit`; True if it reached the end."""
    turn = np.eye(3)
    step = 0.1
    while log.time[0] < end_time - 1e-12:
        duration = end_time - log.time[0]
        if frames is not None:
            duration = min(duration, frames.interval)
        elapsed, load, stopped = tumble(body, turn, centre, flow.gradient, flow.strain, duration, step, limit)
        log.time[0] += elapsed
        log.skipped[0] += elapsed
        for b in range(body.rest.shape[0]):
            log.largest_tension[0] = max(log.largest_tension[0], load * body.strength[b])
        place_body(part, body, turn, centre, flow.gradient)
        keep_frame(part, members, physics, log.time[0], frames)
        if stopped:
            return False
    return True


@njit(cache=True)
def follow(part, members, flow, physics, implicit, paper, shortcuts, log, frames, end_time, max_steps):
    """Follow some primaries together to `end_time`; DONE, SEPARATED, or an error code.  log.time is their clock."""
    n = part.radii.shape[0]
    work = scratch(n)
    history = new_history(part)
    gaps = np.empty((n, n))
    labels = np.empty(n, np.int64)
    centre = np.empty(3)
    find_gaps(part.positions, part.radii, gaps)
    keep_frame(part, members, physics, log.time[0], frames)
    last_change = log.time[0] - shortcuts.quiet_time if n > 1 and log.steps[0] == 0 else log.time[0]
    noted = log.last_bond_change[0]
    look = log.time[0]
    while log.time[0] < end_time - 1e-12:
        if log.last_bond_change[0] != noted and not np.isnan(log.last_bond_change[0]):
            noted = log.last_bond_change[0]
            last_change = noted
        if log.time[0] >= look:
            look = log.time[0] + 0.5
            bodies = label_bodies(part.bonded, labels)
            if bodies > 1:
                if shortcuts.separation > 0.0 and all_parting(
                    part, labels, bodies, flow.gradient, shortcuts.separation
                ):
                    return SEPARATED
            elif (shortcuts.rigid_rotation or shortcuts.inert) and (
                log.time[0] >= last_change + shortcuts.quiet_time - 1e-9
            ):
                code, body = analyse_part(part, physics, centre)
                if code == RIGID:
                    inert = worst_load(body, flow.strain_five) < shortcuts.load_limit
                    if shortcuts.inert and inert:
                        if frames is not None:
                            roll_on(part, members, body, centre, flow, physics, log, frames, end_time, np.inf)
                        log.skipped[0] += end_time - log.time[0]
                        log.time[0] = end_time
                        return DONE
                    if shortcuts.rigid_rotation:
                        if roll_on(
                            part,
                            members,
                            body,
                            centre,
                            flow,
                            physics,
                            log,
                            frames,
                            end_time,
                            shortcuts.load_limit,
                        ):
                            return DONE
                        find_gaps(part.positions, part.radii, gaps)
                        history = new_history(part)
                        look = log.time[0] + shortcuts.quiet_time
                else:
                    look = log.time[0] + 2.0 * shortcuts.quiet_time
        if log.steps[0] >= max_steps:
            return TOO_MANY_STEPS
        code = one_step(part, history, flow, physics, implicit, paper, log, gaps, work, end_time)
        if code != DONE:
            return code
        keep_frame(part, members, physics, log.time[0], frames)
    return DONE


@njit(cache=True)
def one_step(part, history, flow, physics, implicit, paper, log, gaps, work, end_time):
    """Advance by one step of the scheme that is chosen; the other one is None."""
    if implicit is not None:
        return advance(part, history, flow, physics, implicit, log, gaps, work, end_time)
    if paper is not None:
        return advance_paper(part, flow, physics, paper, log, gaps, work, end_time)
    return DONE


@njit(cache=True)
def start_far(motion, flow, physics, shortcuts, log, frames, end_time):
    """Let two rigid aggregates approach as bodies."""
    n = motion.radii.shape[0]
    size = 0
    for i in range(n):
        if motion.parent[i] == 0:
            size += 1
    first_members, second_members = np.arange(size), np.arange(size, n)
    first, second = take(motion, first_members), take(motion, second_members)
    centres = np.empty((2, 3))
    code_1, body_1 = analyse_part(first, physics, centres[0])
    if code_1 != RIGID:
        return
    code_2, body_2 = analyse_part(second, physics, centres[1])
    if code_2 != RIGID:
        return
    reach = 0.0
    scrap = np.empty(3)
    for part in (first, second):
        reach += centre_and_reach(
            part.positions, part.radii, np.zeros(part.radii.shape[0], np.int64), 0, scrap
        )
    turns = np.zeros((2, 3, 3))
    for k in range(3):
        turns[0, k, k] = turns[1, k, k] = 1.0
    going = True
    while going:
        duration = end_time - log.time[0]
        if frames is not None:
            duration = min(duration, frames.interval)
            keep_frame(first, first_members, physics, log.time[0], frames)
            keep_frame(second, second_members, physics, log.time[0], frames)
        elapsed, load = approach(
            body_1,
            body_2,
            turns,
            centres,
            flow.gradient,
            flow.strain,
            shortcuts.far_approach * reach,
            duration,
            0.1,
            shortcuts.load_limit,
        )
        log.time[0] += elapsed
        log.skipped[0] += elapsed
        going = frames is not None and elapsed >= duration - 1e-9 and log.time[0] < end_time - 1e-9
        for b in range(body_1.rest.shape[0]):
            log.largest_tension[0] = max(log.largest_tension[0], load * body_1.strength[b])
        for b in range(body_2.rest.shape[0]):
            log.largest_tension[0] = max(log.largest_tension[0], load * body_2.strength[b])
        place_body(first, body_1, turns[0], centres[0], flow.gradient)
        place_body(second, body_2, turns[1], centres[1], flow.gradient)
    put_back(first, first_members, motion)
    put_back(second, second_members, motion)


@njit(cache=True)
def integrate(motion, flow, physics, implicit, paper, shortcuts, log, frames, end_time, max_steps):
    """Advance `motion` to `end_time`; exactly one of `implicit` and `paper` is given.  Returns a code of `state`.

    Parts that went on alone end at the same time, but the distances between them mean nothing any more.
    """
    n = motion.radii.shape[0]
    if shortcuts.far_approach > 0.0:
        start_far(motion, flow, physics, shortcuts, log, frames, end_time)
    waiting = np.zeros((n, n), np.bool_)
    clocks = np.zeros(n)
    waiting[0] = True
    clocks[0] = log.time[0]
    depth = 1
    labels = np.empty(n, np.int64)
    while depth > 0:
        depth -= 1
        members = np.nonzero(waiting[depth])[0]
        part = take(motion, members)
        log.time[0] = clocks[depth]
        code = follow(
            part, members, flow, physics, implicit, paper, shortcuts, log, frames, end_time, max_steps
        )
        put_back(part, members, motion)
        if code == SEPARATED:
            local = labels[: members.shape[0]]
            bodies = label_bodies(part.bonded, local)
            for body in range(bodies):
                waiting[depth] = False
                alone = 0
                for i in range(members.shape[0]):
                    if local[i] == body:
                        waiting[depth, members[i]] = True
                        alone += 1
                if alone > 1 or frames is not None:
                    clocks[depth] = log.time[0]
                    depth += 1
        elif code != DONE:
            return code
    log.time[0] = end_time
    return DONE
