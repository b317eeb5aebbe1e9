"""The paper's scheme: explicit Euler with the adaptive step of Frungieri & Vanni 2021, Eqs. 19-20.

The reference for other schemes: velocities of free spheres under all direct forces, at the positions that they have, and nothing
predicted, frozen or skipped.

Eq. 20 is read literally (full relative velocity) or by its component along the line of centres, which is what
the text says it bounds.  The paper does not say how near a "close" pair is: `close_gap` is our assumption.
The base step sits near the relaxation time of a contact and past the stability limit of stiff ones; that is a
property of the scheme, shown by the stability map, not mended here.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numpy as np
from numba import types

from mcdem.compilation import compiled, separately_compiled
from mcdem.effects.sums import contact_force, contact_pull_off_gap
from mcdem.hydrodynamics.resistance import Work, measure, workspace
from mcdem.hydrodynamics.undisturbed_flow import flow_component
from mcdem.hydrodynamics.velocities import solve_rates
from mcdem.integrators.pairs import (
    add_non_contact_forces,
    add_pair_force,
    approach_speed,
    find_gaps,
    make_contact,
)
from mcdem.integrators.scheme import Scales, Scheme
from mcdem.integrators.state import (
    DONE,
    NOT_FINITE,
    NOT_POSITIVE_DEFINITE,
    harmonic_radius,
    note_contact_lost,
    note_tension,
)
from mcdem.quantities.toml_tables import Table
from mcdem.quantities.units import DIMENSIONLESS, TIME


class Keys(Table):
    """Explicit Euler with the time step of Eq. 20 (Frungieri & Vanni 2021)."""

    base_step: Annotated[float, TIME.positive.between("1e-15 s", "1e6 s", '"1 us"')] = 1e-6
    """Base time step dt_b (Table 1)."""
    step_velocity: Literal["relative", "normal"] = "relative"
    """Velocity that Eq. 20 bounds: "relative", its literal convention, or "normal", that along the line of centres."""
    close_gap: Annotated[float, DIMENSIONLESS.positive.between("1e-15", "1e4", "1")] = 1.0
    """Gap over radius below which Eq. 20 counts two primaries as close; the paper does not say (assumption)."""


class ExplicitEuler(NamedTuple):
    """Numerics of the scheme; lengths in a, times in 1/g."""

    base_step: float
    minimum_approach: float  # l0, the unit of Eq. 20
    normal_component: bool  # False: Eq. 20 as printed
    close_gap: float


def build(keys: Keys, scales: Scales) -> ExplicitEuler:
    """The options in reduced units."""
    return ExplicitEuler(
        base_step=keys.base_step * scales.shear_rate,
        minimum_approach=scales.roughness,
        normal_component=keys.step_velocity == "normal",
        close_gap=keys.close_gap,
    )


class Scratch(NamedTuple):
    """Work arrays of the scheme."""

    hydrodynamics: Work
    forces: np.ndarray  # (N, 3)
    no_torques: np.ndarray  # (N, 3) zero
    labels: np.ndarray  # (N,)


def scratch(n: int, resisting: bool) -> Scratch:
    """Work arrays for n primaries."""
    return Scratch(workspace(n), np.empty((n, 3)), np.zeros((n, 3)), np.empty(n, np.int64))


@compiled
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


@separately_compiled(types.int64)
def advance(group, flow, physics, options, log, end_time):
    """One explicit step.  Returns DONE or an error code."""
    motion, gaps, work = group.motion, group.gaps, group.work
    n, radii, hydro = motion.radii.shape[0], motion.radii, work.hydrodynamics
    measure(motion.positions, hydro.directions, hydro.distances)
    work.forces[:] = 0.0
    add_non_contact_forces(work.forces, hydro.directions, gaps, motion, physics.pair_forces)
    for i in range(n):
        for j in range(i):
            if motion.bonded[i, j]:
                radius = harmonic_radius(radii[i], radii[j])
                force, _ = contact_force(gaps[i, j], radius, physics.contact)
                add_pair_force(work.forces, i, j, hydro.directions[i, j], force)
                note_tension(motion, log, i, j, -force, log.time[0])
    log.solves[0] += 1
    code = solve_rates(physics.level, hydro, motion.positions, radii, flow, work.forces, work.no_torques)
    if code != 0:
        return NOT_POSITIVE_DEFINITE
    for i in range(n):
        for k in range(3):
            relative = hydro.strain_load[3 * (n + i) + k]
            motion.velocities[i, k] = relative + flow_component(flow.gradient, motion.positions, i, k)
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
                limit = contact_pull_off_gap(harmonic_radius(radii[i], radii[j]), physics.contact)
                if gaps[i, j] > limit:
                    note_contact_lost(motion, log, i, j, now)
            else:
                make_contact(motion, log, gaps, i, j, now, physics.contact)
            if motion.parent[i] != motion.parent[j]:
                log.smallest_gap[0] = min(log.smallest_gap[0], gaps[i, j])
    log.time[0] = now
    log.steps[0] += 1
    return DONE


SCHEME = Scheme(
    Keys,
    ExplicitEuler,
    build,
    scratch,
    "base_step",
    advance,
    shortcuts=False,
    torques=False,
    stretching=False,
    step_in_strain=False,
)
