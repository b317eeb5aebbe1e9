"""The paper's scheme: explicit Euler with the adaptive step of Frungieri & Vanni 2021, Eqs. 19-20.

Eq. 20 is read literally (full relative velocity) or by its component along the line of centres, which is what
the text says it bounds.  The paper does not say how near a "close" pair is: `close_gap` is our assumption.
The base step sits near the relaxation time of a contact and past the stability limit of stiff ones; that is a
property of the scheme, shown by the stability map, not mended here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from mcdem.effects import contact_force, contact_pull_off_gap
from mcdem.hydrodynamics import stokesian
from mcdem.hydrodynamics.linear_algebra import cholesky, solve_cholesky
from mcdem.integrators.contacts import add_pair_force
from mcdem.integrators.implicit_midpoint import approach_speed, drive_at_middle, find_gaps, make_contact
from mcdem.integrators.state import (
    DONE,
    NOT_FINITE,
    NOT_POSITIVE_DEFINITE,
    harmonic_radius,
    note_contact_lost,
    note_tension,
)


class PaperOptions(NamedTuple):
    """Numerics of the scheme; lengths in a, times in 1/g."""

    base_step: float
    minimum_approach: float  # l0, the unit of Eq. 20
    normal_component: bool  # False: Eq. 20 as printed
    close_gap: float


@njit(cache=True)
def eq20_step(motion, velocities, gaps, options):
    """Step length by Eq. 20."""
    step = options.base_step
    unit = options.minimum_approach
    for i in range(motion.radii.shape[0]):
        for j in range(i):
            gap = gaps[i, j]
            if motion.bonded[i, j] or gap > options.close_gap:
                continue
            rate, speed = approach_speed(motion.positions, velocities, i, j)
            if options.normal_component:
                speed = abs(rate)
            if speed > 0.0:
                share = 0.02 if gap < 10.0 * unit else (0.5 if gap < 100.0 * unit else 5.0)
                step = min(step, share * unit / speed)
    return step


@njit(cache=True, inline="always")
def advance_paper(motion, flow, physics, options, log, gaps, work, end_time):
    """One explicit step; gaps (N, N) are those now and are renewed.  Returns DONE or an error code."""
    n, radii = motion.radii.shape[0], motion.radii
    hydro = work.hydrodynamics
    work.middle[:] = motion.positions
    stokesian.measure(work.middle, hydro.directions, hydro.distances)
    work.gaps[:] = gaps
    log.solves[0] += 1
    code = drive_at_middle(motion, flow, physics, work.labels, 0, 0.0, 0.0, work)
    if code != 0:
        return code
    work.forces[:] = 0.0
    for i in range(n):
        for j in range(i):
            if motion.bonded[i, j]:
                radius = harmonic_radius(radii[i], radii[j])
                force, _ = contact_force(gaps[i, j], radius, physics.jkr, physics.dmt)
                add_pair_force(work.forces, i, j, hydro.directions[i, j], force)
                note_tension(motion, log, i, j, -force, log.time[0])
    for i in range(n):
        for k in range(3):
            work.driving[3 * i + k] += work.forces[i, k]
    matrix = hydro.resistance[3 * n :, 3 * n :]
    if cholesky(matrix) != 0:
        return NOT_POSITIVE_DEFINITE
    solve_cholesky(matrix, work.driving)
    for i in range(n):
        for k in range(3):
            motion.velocities[i, k] = work.driving[3 * i + k]
    step = min(eq20_step(motion, motion.velocities, gaps, options), max(end_time - log.time[0], 1e-12))
    for i in range(n):
        for k in range(3):
            motion.positions[i, k] += step * motion.velocities[i, k]
    if not np.isfinite(motion.positions.sum()):
        return NOT_FINITE
    now = log.time[0] + step
    find_gaps(motion.positions, radii, gaps)
    for i in range(n):
        for j in range(i):
            if motion.bonded[i, j]:
                limit = contact_pull_off_gap(harmonic_radius(radii[i], radii[j]), physics.jkr, physics.dmt)
                if gaps[i, j] > limit:
                    note_contact_lost(motion, log, i, j, now)
            else:
                make_contact(motion, log, gaps, i, j, now, physics.jkr, physics.dmt)
            if motion.parent[i] != motion.parent[j]:
                log.smallest_gap[0] = min(log.smallest_gap[0], gaps[i, j])
    log.time[0] = now
    log.steps[0] += 1
    return DONE
