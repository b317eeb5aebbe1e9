"""Direct forces of a configuration, and the laws by which contacts are made and lost."""

from __future__ import annotations

import numpy as np
from numba import njit

from mcdem.effects import contact_equilibrium, contact_force, contact_pull_off_gap, non_contact_force
from mcdem.stepping.state import harmonic_radius

equilibrium = contact_equilibrium
pull_off_gap = contact_pull_off_gap

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
def has_contacts(jkr, dmt):
    """Whether the scene has a contact model at all."""
    if jkr is not None:
        return True
    if dmt is not None:
        return True
    return False


@njit(cache=True)
def tensions(positions, bonded, radii, jkr, dmt, out):
    """Tension -F of every contact into out (N, N), nan elsewhere; returns the largest."""
    largest = 0.0
    out[:] = np.nan
    for i in range(radii.shape[0]):
        for j in range(i):
            if bonded[i, j]:
                r = 0.0
                for k in range(3):
                    r += (positions[i, k] - positions[j, k]) ** 2
                gap = np.sqrt(r) - radii[i] - radii[j]
                value, _ = contact_force(gap, harmonic_radius(radii[i], radii[j]), jkr, dmt)
                out[i, j] = out[j, i] = -value
                largest = max(largest, -value)
    return largest
