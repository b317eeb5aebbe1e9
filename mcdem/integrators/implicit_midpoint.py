"""Linearly implicit midpoint steps: hydrodynamics at the extrapolated midpoint, contacts at the end of the step.

A contact of the paper relaxes in 1 us, a hundredth of the shear time, so explicit steps are bound to that.  Here

    A(x_mid) (x1 - x0)/dt = A u_inf(x_mid) + strain_load(x_mid) + F_non-contact(mid) + F_contact(x1)

where A is the resistance of torque-free spheres.  Contact forces are the gradient of a function that is convex up
to pull-off and straight beyond, so Newton on 3N unknowns with frozen hydrodynamics finds x1 in a few cheap
iterations (`newton`).  What makes it work at a fifth of the shear time:
  the midpoint turns every body as a whole (`bodies`), and gaps of close pairs are extrapolated as numbers;
  the first iteration takes contacts by their tangents at the old gaps, since a poor start lies on the flat end
  of the adhesion law; later ones have the tangent floored at 2 % of the equilibrium stiffness;
  contact forces act along the sum of the old and the new line of centres (discrete gradient), so that a bond
  that turns does no work.
Steps are bound by the relative change of the gaps of approaching pairs (`step_control`), never by stiffness.  Contacts made or
lost within a step are events: the step is cut until their time is known to `event_step`.

Contacts that resist sliding, rolling or twisting exert torques: then the rotations of the spheres are unknowns too, and
`contact_torques` takes the place of the two functions here that know of 3N (`drive_spheres`, `solve_step`).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numba import njit, types

from mcdem.compilation import compiled, separately_compiled
from mcdem.effects.sums import contact_force
from mcdem.hydrodynamics import frozen_far_field
from mcdem.hydrodynamics.level import two_body
from mcdem.hydrodynamics.linear_algebra import multiply_symmetric
from mcdem.hydrodynamics.resistance import (
    Work,
    angular_velocities,
    eliminate_torques,
    reduce_strain_load,
    workspace,
)
from mcdem.hydrodynamics.undisturbed_flow import velocities_of_flow
from mcdem.integrators import contact_torques
from mcdem.integrators.bodies import extrapolate, label_bodies, share_beyond
from mcdem.integrators.newton import put_last, solve_contacts, worst_overstretch
from mcdem.integrators.pairs import add_non_contact_forces, find_gaps, list_contacts, make_contact
from mcdem.integrators.scheme import Scales, Scheme
from mcdem.integrators.state import (
    DONE,
    NOT_CONVERGED,
    NOT_FINITE,
    NOT_POSITIVE_DEFINITE,
    forget_older,
    harmonic_radius,
    note_contact_lost,
    note_tension,
    remember,
)
from mcdem.integrators.step_control import first_try, middle_geometry, too_far
from mcdem.quantities.toml_tables import Table
from mcdem.quantities.units import DIMENSIONLESS

# Below it a step has failed.  Strong attraction in a weak flow closes the last of a gap, down to where a stiff contact bears
# it, within 1e-15/g: that is nothing in time, but not for the primaries.
SMALLEST_STEP = 1e-18

# What a step may change, at the longest step STUDIED and finer in proportion below it; the error of the critical offset of two
# primaries was measured against these: 0.6 % at a step of 0.1/g, second order below.
STUDIED = 0.2
GAP_FRACTION = 0.4
ROUGHNESSES = 3.0
TURN_LIMIT = 0.04
CLOSE_GAP = 0.05


class Keys(Table):
    """The implicit midpoint scheme."""

    max_step: Annotated[float, DIMENSIONLESS.positive.between("1e-9", "10", "0.2")] = 0.2
    """Longest step, in units of 1/g; half of it while two bodies are near or contacts change."""
    event_step: Annotated[float, DIMENSIONLESS.positive.between("1e-12", "10", "0.0125")] = 0.0125
    """Step to which the time of a contact's loss is resolved, in units of 1/g."""
    far_field_tolerance: Annotated[float, DIMENSIONLESS.non_negative.between("0", "1", "0.3")] = 0.3
    """The far field is kept frozen, turning along, until a separation changed by this share of its gap plus a radius; 0: never
    kept.  From about 0.8 on what is predicted from the last steps may run away."""


class ImplicitMidpoint(NamedTuple):
    """Numerics of the scheme; lengths in a, times in 1/g."""

    max_step: float
    event_step: float  # a step in which a contact is lost is cut to this
    gap_fraction: float  # change of the gap of a pair per step: gap_fraction * gap + gap_floor
    gap_floor: float
    turn_limit: float  # relative motion per step of close pairs of different bodies, over their mean radius
    close_gap: float  # below it gaps are extrapolated as numbers
    far_field_tolerance: float  # change of a separation after which the far field is made anew; 0: every step


class Scratch(NamedTuple):
    """Work arrays of the scheme."""

    hydrodynamics: Work
    kept: frozen_far_field.FrozenFarField
    middle: np.ndarray  # (N, 3)
    end: np.ndarray  # (N, 3)
    gaps: np.ndarray  # (N, N) at the middle of the step
    end_gaps: np.ndarray  # (N, N)
    forces: np.ndarray  # (N, 3)
    driving: np.ndarray  # (3N,) A u_inf + strain_load + forces
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
    torques: contact_torques.TorqueWork | None  # where contacts exert torques


def scratch(n: int, resisting: bool = False) -> Scratch:
    """Work arrays for n primaries; `resisting`: whose contacts resist sliding, rolling or twisting."""
    return Scratch(
        workspace(n),
        frozen_far_field.nothing_frozen(n),
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
        contact_torques.torque_work(n) if resisting else None,
    )


def build(keys: Keys, scales: Scales) -> ImplicitMidpoint:
    """The options in reduced units."""
    refinement = min(keys.max_step / STUDIED, 1.0)
    return ImplicitMidpoint(
        max_step=keys.max_step,
        event_step=keys.event_step,
        gap_fraction=GAP_FRACTION * refinement,
        gap_floor=ROUGHNESSES * scales.roughness * refinement,
        turn_limit=TURN_LIMIT * refinement,
        close_gap=CLOSE_GAP,
        far_field_tolerance=keys.far_field_tolerance,
    )


@compiled
def drive_at_middle(motion, flow, physics, middle, tolerance, work):
    """Resistance of the spheres and all loads on them but those of contacts; 0 or an error code."""
    hydro = work.hydrodynamics
    code = frozen_far_field.far_field(physics.level, work.kept, hydro, motion.radii, middle, flow, tolerance)
    if code != 0:
        return NOT_POSITIVE_DEFINITE
    two_body(physics.level, hydro, motion.radii, flow.strain)
    work.forces[:] = 0.0
    add_non_contact_forces(work.forces, hydro.directions, work.gaps, motion, physics.pair_forces)
    return drive_spheres(flow, work, work.torques)


@compiled
def drive_spheres(flow, work, torques):
    """Loads on the spheres, torque-free ones or ones that rotate against the torques of their contacts."""
    if torques is not None:
        return contact_torques.fill_driving(flow, work, torques)
    return drive_torque_free(flow, work)


@separately_compiled(types.int64)
def drive_torque_free(flow, work):
    """Reduce the resistance to A of torque-free spheres; the loads on them into work.driving; 0 or an error code."""
    hydro = work.hydrodynamics
    n = work.middle.shape[0]
    if eliminate_torques(hydro.resistance) != 0:
        return NOT_POSITIVE_DEFINITE
    reduce_strain_load(hydro.resistance, hydro.strain_load)
    m = 3 * n
    velocities_of_flow(flow, work.middle, work.residual)
    multiply_symmetric(hydro.resistance[m:, m:], work.residual, work.move)
    for i in range(n):
        for k in range(3):
            row = 3 * i + k
            work.driving[row] = hydro.strain_load[m + row] + work.forces[i, k] + work.move[row]
    return 0


@separately_compiled()
def learn_moments(motion, flow, step, work, torques):
    """Update the frozen far field by the step that was taken; torques : work arrays or None."""
    if not work.kept.made[0]:
        return
    hydro, spin = work.hydrodynamics, work.residual
    velocities_of_flow(flow, work.middle, work.residual)
    for i in range(motion.radii.shape[0]):
        for k in range(3):
            work.move[3 * i + k] = motion.velocities[i, k] - work.residual[3 * i + k]
    if torques is None:
        angular_velocities(hydro.resistance, hydro.strain_load, work.move, spin)
    else:
        contact_torques.spins(flow.gradient, step, torques, spin)
    frozen_far_field.learn(work.kept, hydro, spin, work.move)


@compiled
def solve_step(motion, contacts, gaps, step, physics, work, springs):
    """Newton for the positions at the end of the step, from the guess in work.end; 0 or NOT_CONVERGED."""
    if springs is not None:
        return contact_torques.solve(motion, contacts, gaps, step, physics, work)
    return solve_contacts(motion, contacts, gaps, step, physics.contact, work)


@compiled
def keep_springs(motion, contacts, physics, work, springs):
    """The histories of contacts at the end of an accepted step."""
    if springs is not None:
        contact_torques.keep_springs(motion, contacts, physics, work)


@separately_compiled(types.int64)
def advance(group, flow, physics, options, log, end_time):
    """One accepted step.  Returns DONE or an error code."""
    bodies = label_bodies(group.motion.bonded, group.work.labels)
    step = first_try(group, options, log, end_time)
    return attempt(group, flow, physics, options, log, bodies, step)


@njit(cache=True, inline="always")
def attempt(group, flow, physics, options, log, bodies, step):
    """Try steps from `step` downwards until one is accepted."""
    motion, history, gaps, work = group.motion, group.history, group.gaps, group.work
    radii, n, contact = motion.radii, motion.radii.shape[0], physics.contact
    while True:
        if step < SMALLEST_STEP:
            return NOT_CONVERGED
        middle_geometry(group, bodies, step, options)
        log.solves[0] += 1
        share = share_beyond(history, step)
        middle = frozen_far_field.Middle(work.middle, work.labels, bodies, share)
        code = drive_at_middle(motion, flow, physics, middle, options.far_field_tolerance, work)
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
        lost, _ = worst_overstretch(contacts, radii, contact, work)
        if lost >= 0 and step > options.event_step:
            step = max(0.5 * step, options.event_step)
            continue
        if too_far(group, options, contact):
            step *= 0.5
            continue
        # The most overstretched contact goes first and may relieve the others.
        kept = contacts
        while lost >= 0:
            kept = put_last(work.pairs, lost, kept)
            if solve_step(motion, kept, gaps, step, physics, work, motion.springs) != 0:
                break
            find_gaps(work.end, radii, work.end_gaps)
            lost, _ = worst_overstretch(kept, radii, contact, work)
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
        force, _ = contact_force(work.end_gaps[i, j], harmonic_radius(radii[i], radii[j]), contact)
        note_tension(motion, log, i, j, -force, now)
    keep_springs(motion, kept, physics, work, motion.springs)
    for i in range(n):
        for k in range(3):
            motion.velocities[i, k] = (work.end[i, k] - motion.positions[i, k]) / step
    learn_moments(motion, flow, step, work, work.torques)
    work.middle[:] = motion.positions
    motion.positions[:] = work.end
    remember(history, motion, work.middle, gaps, step)
    for i in range(n):
        for j in range(i):
            gaps[i, j] = gaps[j, i] = work.end_gaps[i, j]
            if motion.parent[i] != motion.parent[j]:
                log.smallest_gap[0] = min(log.smallest_gap[0], gaps[i, j])
            if make_contact(motion, log, gaps, i, j, now, contact):
                changed = True
    if changed:
        forget_older(history)
        frozen_far_field.forget(work.kept)
    log.time[0] = now
    log.steps[0] += 1
    return DONE


SCHEME = Scheme(
    Keys, ImplicitMidpoint, build, scratch, "max_step", advance, shortcuts=True, torques=True, stretching=True
)
