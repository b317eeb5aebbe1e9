"""Pairs of primaries: gaps, approach, direct forces, and contacts that are made."""

from __future__ import annotations

import numpy as np
from numba import types

from mcdem.compilation import compiled, separately_compiled
from mcdem.effects.sums import non_contact_force
from mcdem.integrators.state import harmonic_radius, note_contact_made

# Gap h/a beyond which direct forces between spheres not in contact are left out: there the unretarded
# attraction is below 1e-7 of its value at contact for the smallest roughness in use.
FORCE_RANGE = 1.0


@separately_compiled(types.int64)
def list_contacts(bonded, pairs):
    """Contacts i > j of (N, N) into pairs (B, 2); returns their count."""
    count = 0
    for i in range(bonded.shape[0]):
        for j in range(i):
            if bonded[i, j]:
                pairs[count, 0], pairs[count, 1] = i, j
                count += 1
    return count


@separately_compiled()
def find_gaps(positions, radii, gaps):
    """Surface gaps of all pairs into gaps (N, N)."""
    for i in range(radii.shape[0]):
        for j in range(i):
            r = 0.0
            for k in range(3):
                r += (positions[i, k] - positions[j, k]) ** 2
            gaps[i, j] = gaps[j, i] = np.sqrt(r) - radii[i] - radii[j]


@compiled
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


@compiled
def add_pair_force(forces, i, j, direction, value):
    """Add a force of size `value` > 0 pushing i and j apart; direction (3,) from j to i."""
    for k in range(3):
        forces[i, k] += value * direction[k]
        forces[j, k] -= value * direction[k]


@separately_compiled()
def add_non_contact_forces(forces, directions, gaps, motion, pair_forces):
    """Add the forces of all pairs not in contact; directions (N, N, 3), gaps (N, N) for i > j."""
    bonded, radii = motion.bonded, motion.radii
    for i in range(radii.shape[0]):
        for j in range(i):
            if not bonded[i, j] and gaps[i, j] < FORCE_RANGE:
                radius = harmonic_radius(radii[i], radii[j])
                value, _ = non_contact_force(gaps[i, j], radius, pair_forces)
                add_pair_force(forces, i, j, directions[i, j], value)


@compiled
def make_contact(motion, log, gaps, i, j, now, contact):
    """A pair that meets at h <= 0 is in contact from then on, where the scene has contacts; True if it now is."""
    if gaps[i, j] > 0.0 or motion.bonded[i, j]:
        return False
    if contact is not None:
        note_contact_made(motion, log, i, j, now)
        return True
    return False
