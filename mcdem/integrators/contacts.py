"""Direct forces of a configuration, and the laws by which contacts are made and lost."""

from __future__ import annotations

import numpy as np
from numba import njit

from mcdem.effects import contact_equilibrium, contact_force, non_contact_force
from mcdem.integrators.state import harmonic_radius

# Gap h/a beyond which direct forces between spheres not in contact are left out: there the unretarded
# attraction is below 1e-7 of its value at contact for the smallest roughness in use.
FORCE_RANGE = 1.0


@njit(cache=True)
def add_pair_force(forces, i, j, direction, value):
    """Add a force of size `value` > 0 driving i and j apart; direction (3,) from j to i."""
    for k in range(3):
        forces[i, k] += value * direction[k]
        forces[j, k] -= value * direction[k]


@njit(cache=True)
def add_non_contact_forces(forces, directions, gaps, bonded, radii, van_der_waals, double_layer, short_range):
    """Add the forces of all pairs not in contact; directions (N, N, 3), gaps (N, N) for i > j."""
    for i in range(radii.shape[0]):
        for j in range(i):
            if not bonded[i, j] and gaps[i, j] < FORCE_RANGE:
                radius = harmonic_radius(radii[i], radii[j])
                value, _ = non_contact_force(gaps[i, j], radius, van_der_waals, double_layer, short_range)
                add_pair_force(forces, i, j, directions[i, j], value)


@njit(cache=True)
def stay_at_mean(velocities, centred):
    """Take their mean from the undisturbed velocities (3N,) where the (linear) flow is seen from the primaries' mean."""
    if centred is not None:
        n = velocities.shape[0] // 3
        for k in range(3):
            mean = 0.0
            for i in range(n):
                mean += velocities[3 * i + k]
            for i in range(n):
                velocities[3 * i + k] -= mean / n


@njit(cache=True)
def contact_tangent(positions, end, radii, gaps, i, j, first, fallback, jkr, dmt, normal):
    """The force of a contact at the end of a step and how Newton's method takes it; fills its direction `normal` (3,).

    first : by its tangent at the old gap;  fallback : as a linear spring about equilibrium
    Returns (force, slope, turning, stiffness): minus dF/dh, floored; tension over length; stiffness without load.
    """
    old = new = 0.0
    for k in range(3):
        d0 = positions[i, k] - positions[j, k]
        d1 = end[i, k] - end[j, k]
        old += d0 * d0
        new += d1 * d1
        normal[k] = d0 + d1
    old, new = np.sqrt(old), np.sqrt(new)
    for k in range(3):
        normal[k] /= old + new
    radius = harmonic_radius(radii[i], radii[j])
    gap = new - radii[i] - radii[j]
    rest, stiffness = contact_equilibrium(radius, jkr, dmt)
    if fallback:
        force, slope = -stiffness * (gap - rest), stiffness
    elif first:
        force, tangent = contact_force(gaps[i, j], radius, jkr, dmt)
        slope = max(-tangent, 0.1 * stiffness)
        force -= slope * (gap - gaps[i, j])
    else:
        force, tangent = contact_force(gap, radius, jkr, dmt)
        slope = max(-tangent, 0.02 * stiffness)
    # Tension resists the turning of its line, and without that the iteration overshoots it once a contact
    # pulls harder than the fluid holds.  Compression would make the matrix indefinite: it is left out.
    return force, slope, max(-force, 0.0) / (old + new), stiffness
