"""The far field of a while ago, turned along.

The far-field resistance is what costs most of a step and varies slowest.  It is kept from one step to the next, each
body's share turned with the body, or all turned together, which is exact as long as nothing but that rotation
happens; it is made anew when a separation has changed beyond it by more than a share of the gap plus one radius.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from mcdem.hydrodynamics import stokesian
from mcdem.hydrodynamics.far_field import tensor_to_five

# Number of primaries from which turning a kept far field costs less than a new one.
LAG_PAYS = 8
# Calls for which a far field is made without being kept, after one that was kept in vain: keeping costs a quarter more.
WAIT = 4


class Lagged(NamedTuple):
    """A far field and where it was made."""

    made: np.ndarray  # (1,) bool
    used: np.ndarray  # (1,) bool, whether it has served since it was made
    wait: np.ndarray  # (1,) calls for which keeping is not tried: it just failed
    resistance: np.ndarray  # (6N, 6N)
    drives: np.ndarray  # (5, 6N) of the five unit strains
    positions: np.ndarray  # (N, 3)
    turns: np.ndarray  # (N, 3, 3) rotation of each sphere's body since then
    together: np.ndarray  # (N,) work space


def new_lagged(n: int) -> Lagged:
    """Nothing kept yet."""
    return Lagged(
        np.zeros(1, np.bool_),
        np.zeros(1, np.bool_),
        np.zeros(1, np.int64),
        np.empty((6 * n, 6 * n)),
        np.empty((5, 6 * n)),
        np.empty((n, 3)),
        np.empty((n, 3, 3)),
        np.empty(n, np.int64),
    )


@njit(cache=True)
def nearest_rotation(matrix):
    """Orthogonal polar factor of matrix (3, 3), in place, by scaled Newton iteration (Higham 1986)."""
    inverse = np.empty((3, 3))
    for _ in range(30):
        for p in range(3):
            for q in range(3):
                a, b, c, d = (p + 1) % 3, (p + 2) % 3, (q + 1) % 3, (q + 2) % 3
                inverse[p, q] = matrix[a, c] * matrix[b, d] - matrix[a, d] * matrix[b, c]
        determinant = 0.0
        for q in range(3):
            determinant += matrix[0, q] * inverse[0, q]
        size = inverse_size = 0.0
        for p in range(3):
            for q in range(3):
                inverse[p, q] /= determinant
                size += matrix[p, q] ** 2
                inverse_size += inverse[p, q] ** 2
        scale = (inverse_size / size) ** 0.25
        change = 0.0
        for p in range(3):
            for q in range(3):
                new = 0.5 * (scale * matrix[p, q] + inverse[p, q] / scale)
                change = max(change, abs(new - matrix[p, q]))
                matrix[p, q] = new
        if change < 1e-12:
            return


@njit(cache=True)
def follow_turns(kept, positions, labels, bodies):
    """Renew the rotation of every body since the far field was made, by the best fit of its spheres."""
    n = labels.shape[0]
    fit = np.empty((3, 3))
    now, then = np.empty(3), np.empty(3)
    for body in range(bodies):
        now[:] = 0.0
        then[:] = 0.0
        fit[:] = 0.0
        members = 0
        for i in range(n):
            if labels[i] == body:
                members += 1
                fit += kept.turns[i]
                for k in range(3):
                    now[k] += positions[i, k]
                    then[k] += kept.positions[i, k]
        if members == 1:
            continue
        for k in range(3):
            now[k] /= members
            then[k] /= members
        # Directions that the spheres do not fix (a doublet's axis) follow the last rotation: the mean of all, as those
        # of bodies taken together differ.
        for p in range(3):
            for q in range(3):
                fit[p, q] *= 0.01 / members
        for i in range(n):
            if labels[i] == body:
                for p in range(3):
                    for q in range(3):
                        fit[p, q] += (positions[i, p] - now[p]) * (kept.positions[i, q] - then[q])
        nearest_rotation(fit)
        for i in range(n):
            if labels[i] == body:
                kept.turns[i] = fit


@njit(cache=True)
def worst_change(kept, positions):
    """Largest change of a separation beyond the turn of its bodies, over the gap plus one radius."""
    n = positions.shape[0]
    worst = 0.0
    for i in range(n):
        for j in range(i):
            change = distance = 0.0
            for k in range(3):
                d = positions[i, k] - positions[j, k]
                old = 0.0
                for m in range(3):
                    turn = 0.5 * (kept.turns[i, k, m] + kept.turns[j, k, m])
                    old += turn * (kept.positions[i, m] - kept.positions[j, m])
                change += (d - old) ** 2
                distance += d * d
            room = max(np.sqrt(distance) - 1.0, 1.0)
            worst = max(worst, change / (room * room))
    return np.sqrt(worst)


@njit(cache=True)
def still_good(kept, positions, labels, bodies, together, tolerance):
    """Turn the kept far field along, body by body or all together, whichever fits; whether it is within `tolerance`."""
    follow_turns(kept, positions, labels, bodies)
    if worst_change(kept, positions) <= tolerance:
        return True
    if bodies == 1:
        return False
    together[:] = 0
    follow_turns(kept, positions, together, 1)
    return worst_change(kept, positions) <= tolerance


@njit(cache=True, inline="always")
def turn_block(source, target, row, column, left, right, half):
    """target block = left source block right^T, all (3, 3); half (3, 3) is work space."""
    for p in range(3):
        for q in range(3):
            half[p, q] = (
                left[p, 0] * source[row, column + q]
                + left[p, 1] * source[row + 1, column + q]
                + left[p, 2] * source[row + 2, column + q]
            )
    for p in range(3):
        for q in range(3):
            target[row + p, column + q] = (
                half[p, 0] * right[q, 0] + half[p, 1] * right[q, 1] + half[p, 2] * right[q, 2]
            )


@njit(cache=True)
def turned_far_field(kept, work, strain):
    """The kept far field, turned, into `work.resistance` and `work.drive`."""
    n = kept.positions.shape[0]
    m = 3 * n
    seen = np.empty(5)
    local, half = np.empty((3, 3)), np.empty((3, 3))
    source, target, turns = kept.resistance, work.resistance, kept.turns
    for i in range(n):
        left = turns[i]
        for j in range(i + 1):
            turn_block(source, target, 3 * i, 3 * j, left, turns[j], half)
            turn_block(source, target, m + 3 * i, m + 3 * j, left, turns[j], half)
        for j in range(n):
            turn_block(source, target, m + 3 * i, 3 * j, left, turns[j], half)
        for p in range(3):
            for q in range(3):
                total = 0.0
                for k in range(3):
                    for c in range(3):
                        total += left[k, p] * strain[k, c] * left[c, q]
                local[p, q] = total
        tensor_to_five(local, seen)
        for start in (3 * i, m + 3 * i):
            for p in range(3):
                total = 0.0
                for q in range(3):
                    for c in range(5):
                        total += left[p, q] * kept.drives[c, start + q] * seen[c]
                work.drive[start + p] = total


@njit(cache=True)
def far_field(kept, work, radii, positions, labels, bodies, strain, tolerance, coupled, stresslets):
    """Resistance and drive without lubrication at a level into `work`, kept (`tolerance` > 0) or made anew; 0 or an error code.

    Only the far field with stresslets is worth keeping.
    """
    five = np.empty(5)
    tensor_to_five(strain, five)
    if stresslets is None:
        stokesian.level_drive(work, five, stresslets)
        return stokesian.level_resistance(work, radii, coupled, stresslets)
    if tolerance <= 0.0 or radii.shape[0] < LAG_PAYS:
        code = stokesian.far_field_resistance(work, radii)
        if code == 0:
            stokesian.far_field_drive(work, five)
        return code
    if kept.wait[0] > 0:
        kept.wait[0] -= 1
    elif kept.made[0]:
        if still_good(kept, positions, labels, bodies, kept.together, tolerance):
            turned_far_field(kept, work, strain)
            kept.used[0] = True
            return 0
        if not kept.used[0]:
            kept.wait[0] = WAIT
    code = stokesian.far_field_resistance(work, radii)
    if code != 0:
        return code
    if kept.wait[0] > 0:
        kept.made[0] = False
        stokesian.far_field_drive(work, five)
        return 0
    n = radii.shape[0]
    unit = np.zeros(5)
    for k in range(5):
        unit[:] = 0.0
        unit[k] = 1.0
        stokesian.far_field_drive(work, unit)
        kept.drives[k] = work.drive
    work.drive[:] = 0.0
    for k in range(5):
        for row in range(6 * n):
            work.drive[row] += five[k] * kept.drives[k, row]
    for row in range(6 * n):
        for column in range(row + 1):
            kept.resistance[row, column] = kept.resistance[column, row] = work.resistance[row, column]
    kept.positions[:] = positions
    for i in range(n):
        for p in range(3):
            for q in range(3):
                kept.turns[i, p, q] = 1.0 if p == q else 0.0
    kept.made[0] = True
    kept.used[0] = False
    return 0
