"""The far field of a while ago, turned along, and one correction for what has changed since.

The far-field resistance is what costs most of a step and varies slowest.  Its matrix is frozen from one step to the next, each
body's share turned with the body, or all turned together.  The moments of now
(stresslets, torques and forces on the fluid) are predicted as phi' from those of the last two steps, what the true mobility M
makes of them is computed pair by pair, and what it misses is corrected by the frozen factor B ~ M^-1:

    phi = phi' + B (rates - M phi')

The error is B's, times only that of the predicted moments, while a frozen matrix alone would put its own error on all of them.
The matrix is made anew when a separation has changed beyond the turn by more than a share of the gap plus one radius, and when
contacts change, since the last moments then predict little.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, types
from numba.extending import overload

from mcdem.compilation import compiled, separately_compiled
from mcdem.hydrodynamics import level as levels
from mcdem.hydrodynamics.grand_mobility import five_tensor, tensor_to_five
from mcdem.hydrodynamics.level import level_of
from mcdem.hydrodynamics.linear_algebra import (
    add_product,
    add_transposed_product,
    multiply_symmetric,
    solve_lower,
)
from mcdem.hydrodynamics.mobility_product import apply_mobility

# Number of primaries from which keeping a far field costs less than a new one.
PAYS_FROM = 8


class FrozenFarField(NamedTuple):
    """A far field and where it was made; its Cholesky factor stays in `Work.mobility`.

    Moments are kept in the frame of that moment, ordered (stresslets 5N | torques 3N | forces 3N).
    """

    made: np.ndarray  # (1,) bool
    known: np.ndarray  # (1,) how many of the last two steps `moments` holds
    resistance: np.ndarray  # (6N, 6N)
    moments: np.ndarray  # (2, 11N) of the last two steps, newest first
    predicted: np.ndarray  # (11N,) of this step
    still: np.ndarray  # (11N,) of spheres held still in this one, as far as known
    answer: np.ndarray  # (11N,) work space, as is
    half: np.ndarray  # (6N,)
    positions: np.ndarray  # (N, 3)
    turns: np.ndarray  # (N, 3, 3) rotation of each sphere's body since then
    together: np.ndarray  # (N,) work space
    places: np.ndarray  # (3, N) work space of `apply_mobility`, as are
    rows: np.ndarray  # (12, N)
    rates: np.ndarray  # (12, N)


def nothing_frozen(n: int) -> FrozenFarField:
    """Nothing kept yet."""
    return FrozenFarField(
        np.zeros(1, np.bool_),
        np.zeros(1, np.int64),
        np.empty((6 * n, 6 * n)),
        np.empty((2, 11 * n)),
        np.empty(11 * n),
        np.empty(11 * n),
        np.empty(11 * n),
        np.empty(6 * n),
        np.empty((n, 3)),
        np.empty((n, 3, 3)),
        np.empty(n, np.int64),
        np.empty((3, n)),
        np.empty((12, n)),
        np.empty((12, n)),
    )


@compiled
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


@separately_compiled()
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


@separately_compiled(types.float64)
def worst_change(kept, positions, radii):
    """Largest change of a separation beyond the turn of its bodies, over the gap plus one (mean) radius."""
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
            radius = 0.5 * (radii[i] + radii[j])
            room = max(np.sqrt(distance) - radius, radius)
            worst = max(worst, change / (room * room))
    return np.sqrt(worst)


@separately_compiled(types.boolean)
def still_good(kept, middle, radii, tolerance):
    """Rotate the frozen far field along, body by body or all together, whichever fits; whether it is within `tolerance`."""
    positions, labels, bodies, together = middle.positions, middle.labels, middle.bodies, kept.together
    follow_turns(kept, positions, labels, bodies)
    if worst_change(kept, positions, radii) <= tolerance:
        return True
    if bodies == 1:
        return False
    together[:] = 0
    follow_turns(kept, positions, together, 1)
    return worst_change(kept, positions, radii) <= tolerance


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


@separately_compiled()
def turned_resistance(kept, work):
    """The frozen resistance, rotated, into `work.resistance`."""
    n = kept.positions.shape[0]
    m = 3 * n
    half = np.empty((3, 3))
    source, target, turns = kept.resistance, work.resistance, kept.turns
    for i in range(n):
        left = turns[i]
        for j in range(i + 1):
            turn_block(source, target, 3 * i, 3 * j, left, turns[j], half)
            turn_block(source, target, m + 3 * i, m + 3 * j, left, turns[j], half)
        for j in range(n):
            turn_block(source, target, m + 3 * i, 3 * j, left, turns[j], half)


@njit(cache=True, inline="always")
def turned(turn, vector, start, p):
    """Component p of turn (3, 3) times three components of a vector."""
    return turn[p, 0] * vector[start] + turn[p, 1] * vector[start + 1] + turn[p, 2] * vector[start + 2]


@compiled
def turned_tensor(turn, source, out, back):
    """out = turn source turn^T, all (3, 3), or turn^T source turn if `back`."""
    for p in range(3):
        for q in range(3):
            total = 0.0
            for k in range(3):
                for m in range(3):
                    if back:
                        total += turn[k, p] * source[k, m] * turn[m, q]
                    else:
                        total += turn[p, k] * source[k, m] * turn[q, m]
            out[p, q] = total


@separately_compiled()
def moments_as_rows(kept, moments, rows):
    """Stored moments (11N,), rotated along, into rows (12, N) of `mobility_product`."""
    n = kept.positions.shape[0]
    local, tensor = np.empty((3, 3)), np.empty((3, 3))
    for i in range(n):
        turn = kept.turns[i]
        for p in range(3):
            rows[p, i] = turned(turn, moments, 8 * n + 3 * i, p)
            rows[3 + p, i] = turned(turn, moments, 5 * n + 3 * i, p)
        five_tensor(moments[5 * i : 5 * i + 5], local)
        turned_tensor(turn, local, tensor, False)
        rows[6, i], rows[7, i], rows[8, i] = tensor[0, 0], tensor[1, 1], tensor[2, 2]
        rows[9, i], rows[10, i], rows[11, i] = tensor[0, 1], tensor[0, 2], tensor[1, 2]


@separately_compiled()
def misfit(kept, strain, correct, out):
    """out (11N,) = rates of spheres held still in a strain (3, 3), less those in `kept.rates` if `correct`; in its frame."""
    n = kept.positions.shape[0]
    tensor, local, five = np.empty((3, 3)), np.empty((3, 3)), np.empty(5)
    rates = kept.rates
    for i in range(n):
        turn = kept.turns[i]
        tensor[:] = -strain
        if correct:
            third = (rates[6, i] + rates[7, i] + rates[8, i]) / 3.0
            tensor[0, 0] -= rates[6, i] - third
            tensor[1, 1] -= rates[7, i] - third
            tensor[2, 2] -= rates[8, i] - third
            tensor[0, 1] -= rates[9, i]
            tensor[0, 2] -= rates[10, i]
            tensor[1, 2] -= rates[11, i]
            tensor[1, 0], tensor[2, 0], tensor[2, 1] = tensor[0, 1], tensor[0, 2], tensor[1, 2]
        turned_tensor(turn, tensor, local, True)
        tensor_to_five(local, five)
        out[5 * i : 5 * i + 5] = five
        for p in range(3):
            spin = drift = 0.0
            if correct:
                for k in range(3):
                    drift -= turn[k, p] * rates[k, i]
                    spin -= turn[k, p] * rates[3 + k, i]
            out[5 * n + 3 * i + p] = spin
            out[8 * n + 3 * i + p] = drift


@separately_compiled()
def apply_kept(kept, work, rates, strained):
    """Overwrite rates (11N,) by the moments B rates; strained : False if those of the stresslets are zero.

    The frozen resistance is the inverse of what is left of M without stresslets: one product with it takes the place of
    two solves with the rows of torques and forces of the factor.
    """
    m = 5 * kept.positions.shape[0]
    strains, others, moments = rates[:m], rates[m:], kept.half
    own, coupling = work.mobility[:m, :m], work.mobility[m:, :m]
    if strained:
        solve_lower(own, strains, False)
        add_product(coupling, strains, others, -1.0)
    multiply_symmetric(kept.resistance, others, moments)
    others[:] = moments
    add_transposed_product(coupling, moments, strains, -1.0)
    solve_lower(own, strains, True)


@separately_compiled()
def hold_still(kept, work, radii, middle, strain, correct):
    """Moments of spheres held still in the strain (3, 3) into `kept.still`, and their strain_load into `work.strain_load`.

    correct : whether the frozen matrix is not that of `middle` and the predicted moments are to correct it
    """
    n, positions, share = radii.shape[0], middle.positions, middle.share
    if correct:
        last, older = kept.moments[0], kept.moments[1]
        beyond = share if kept.known[0] > 1 else 0.0
        for k in range(11 * n):
            kept.predicted[k] = last[k] + (beyond * (last[k] - older[k]) if beyond > 0.0 else 0.0)
        for i in range(n):
            for k in range(3):
                kept.places[k, i] = positions[i, k]
        moments_as_rows(kept, kept.predicted, kept.rows)
        apply_mobility(kept.places, radii, kept.rows, kept.rates)
    misfit(kept, strain, correct, kept.still)
    apply_kept(kept, work, kept.still, True)
    if correct:
        for k in range(11 * n):
            kept.still[k] += kept.predicted[k]
    for i in range(n):
        for p in range(3):
            work.strain_load[3 * i + p] = -turned(kept.turns[i], kept.still, 5 * n + 3 * i, p)
            work.strain_load[3 * (n + i) + p] = -turned(kept.turns[i], kept.still, 8 * n + 3 * i, p)


@separately_compiled()
def learn(kept, work, angular, linear):
    """Keep the moments of the step taken, from angular and linear (3N,) relative to the flow, where `far_field` was formed."""
    n = kept.positions.shape[0]
    if not kept.made[0]:
        return
    answer = kept.answer
    answer[: 5 * n] = 0.0
    for i in range(n):
        turn = kept.turns[i]
        for p in range(3):
            spin = drift = 0.0
            for k in range(3):
                spin += turn[k, p] * angular[3 * i + k]
                drift += turn[k, p] * linear[3 * i + k]
            answer[5 * n + 3 * i + p] = spin
            answer[8 * n + 3 * i + p] = drift
    apply_kept(kept, work, answer, False)
    for k in range(11 * n):
        kept.moments[1, k] = kept.moments[0, k]
        kept.moments[0, k] = kept.still[k] + answer[k]
    kept.known[0] = min(kept.known[0] + 1, 2)


@compiled
def forget(kept):
    """Contacts have changed: the next far field is made anew, and earlier moments predict nothing."""
    kept.made[0] = False
    kept.known[0] = 0


@separately_compiled()
def turn_moments(kept, moments):
    """Rotate moments (11N,) of the frozen frame into the present one."""
    n = kept.positions.shape[0]
    local, tensor, three = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for i in range(n):
        turn = kept.turns[i]
        for start in (5 * n + 3 * i, 8 * n + 3 * i):
            for p in range(3):
                three[p] = turned(turn, moments, start, p)
            moments[start : start + 3] = three
        five_tensor(moments[5 * i : 5 * i + 5], local)
        turned_tensor(turn, local, tensor, False)
        tensor_to_five(tensor, moments[5 * i : 5 * i + 5])


@separately_compiled()
def keep(kept, work, positions):
    """Keep what `far_field_resistance` just made at `positions`."""
    n = positions.shape[0]
    for known in range(kept.known[0]):
        turn_moments(kept, kept.moments[known])
    for row in range(6 * n):
        for column in range(row + 1):
            kept.resistance[row, column] = kept.resistance[column, row] = work.resistance[row, column]
    kept.positions[:] = positions
    for i in range(n):
        for p in range(3):
            for q in range(3):
                kept.turns[i, p, q] = 1.0 if p == q else 0.0
    kept.made[0] = True


class Middle(NamedTuple):
    """Where a step takes the hydrodynamics: at its extrapolated midpoint."""

    positions: np.ndarray  # (N, 3)
    labels: np.ndarray  # (N,) the body of each sphere
    bodies: int
    share: float  # time from the last step to this one, over that from the one before to the last


def _far_field(level, kept, work, radii, middle, flow, tolerance):
    raise NotImplementedError("compiled code only")


@overload(_far_field, inline="always")
def _(level, kept, work, radii, middle, flow, tolerance):
    if level_of(level).stresslet_couplings:
        return lambda level, kept, work, radii, middle, flow, tolerance: frozen_or_new(
            level, kept, work, radii, middle, flow, tolerance
        )

    def new(level, kept, work, radii, middle, flow, tolerance):
        levels.strain_load(level, work, flow.strain_five)
        return levels.resistance(level, work, radii)

    return new


@compiled
def far_field(level, kept, work, radii, middle, flow, tolerance):
    """Resistance and strain_load without lubrication into `work`, frozen (`tolerance` > 0) or computed anew; 0 or an error code.

    Only a far field with stresslets is worth keeping.
    """
    return _far_field(level, kept, work, radii, middle, flow, tolerance)


@separately_compiled(types.int64)
def frozen_or_new(level, kept, work, radii, middle, flow, tolerance):
    """`far_field` of a level with stresslets."""
    if tolerance <= 0.0 or radii.shape[0] < PAYS_FROM:
        code = levels.resistance(level, work, radii)
        if code == 0:
            levels.strain_load(level, work, flow.strain_five)
        return code
    good = kept.made[0] and kept.known[0] > 0 and still_good(kept, middle, radii, tolerance)
    if good:
        turned_resistance(kept, work)
    else:
        code = levels.resistance(level, work, radii)
        if code != 0:
            return code
        keep(kept, work, middle.positions)
    hold_still(kept, work, radii, middle, flow.strain, good)
    return 0
