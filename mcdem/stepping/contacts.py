"""Direct forces of a configuration, and the laws by which contacts are made and lost."""

from __future__ import annotations

from numba import njit

from mcdem.effects import non_contact_force
from mcdem.stepping.state import harmonic_radius

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
