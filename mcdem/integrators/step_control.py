"""How long a step of the implicit scheme may be, and where its midpoint lies."""

from __future__ import annotations

from numba import types

from mcdem.compilation import compiled, separately_compiled
from mcdem.effects.sums import contact_gap
from mcdem.hydrodynamics.resistance import measure
from mcdem.integrators.bodies import extrapolate
from mcdem.integrators.pairs import approach_speed
from mcdem.integrators.state import harmonic_radius

# Share of the longest step that is taken while two bodies are within a radius of each other, and for the strain SETTLING
# after a contact was made or lost: what happens then decides.
NEAR = 0.5
SETTLING = 1.0
# Share of it that the first step takes, which has no step before it to predict the middle from.
FIRST = 0.3


@compiled
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


@compiled
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


@separately_compiled()
def middle_geometry(group, bodies, step, options):
    """Positions, directions, distances and gaps at the extrapolated midpoint."""
    motion, history, gaps, work = group.motion, group.history, group.gaps, group.work
    hydro = work.hydrodynamics
    extrapolate(motion.positions, history, work.labels, bodies, 0.5 * step, work.middle)
    measure(work.middle, hydro.directions, hydro.distances)
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


@separately_compiled(types.float64)
def first_try(group, options, log, end_time):
    """Length of the step that is tried first."""
    motion, history, gaps, work = group.motion, group.history, group.gaps, group.work
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
    return min(step, max(end_time - log.time[0], 1e-12))


@separately_compiled(types.boolean)
def too_far(group, options, contact):
    """Whether a step to `work.end_gaps` changes a gap by more than it resolves, or makes a contact too deep."""
    motion, gaps, work = group.motion, group.gaps, group.work
    radii = motion.radii
    reject = False
    for i in range(radii.shape[0]):
        for j in range(i):
            if motion.bonded[i, j] or gaps[i, j] > 1.0:
                continue
            room = 2.5 * (options.gap_fraction * max(gaps[i, j], 0.0) + options.gap_floor)
            if abs(work.end_gaps[i, j] - gaps[i, j]) > room:
                reject = True
            # A contact is made no deeper than it bears the drag of a sphere: stiff ones would start far beyond.
            if work.end_gaps[i, j] < min(gaps[i, j], 0.0):
                deepest = contact_gap(1.0, harmonic_radius(radii[i], radii[j]), contact)
                if work.end_gaps[i, j] < min(gaps[i, j], 0.0) + deepest:
                    reject = True
    return reject
