"""Far field of forces, torques and stresslets (Durlofsky, Brady & Bossis 1987, without lubrication).

    Mhat = M_UF - M_US M_ES^-1 M_EF,   R = Mhat^-1

Nothing is inverted but the 6N part: one Cholesky factor of the 11N grand mobility, ordered stresslets first,
holds every piece.  A factor that fails is an error, never mended by jitter.
"""

from __future__ import annotations

from typing import NamedTuple

from numba import types

from mcdem.compilation import compiled, separately_compiled
from mcdem.hydrodynamics.grand_mobility import grand_mobility
from mcdem.hydrodynamics.level import Level, no_two_body
from mcdem.hydrodynamics.linear_algebra import (
    add_product,
    add_transposed_product,
    cholesky,
    inverse_from_cholesky,
    solve_cholesky,
    solve_lower,
)
from mcdem.hydrodynamics.resistance import NOT_POSITIVE_DEFINITE


class ForceTorqueStresslet(NamedTuple):
    """No parameters."""

    lubrication: None = None


@separately_compiled(types.int64)
def far_field_resistance(work, radii):
    """Far-field resistance Mhat^-1 into `work.resistance`, keeping the factor in `work.mobility`; 0 or an error code."""
    n = radii.shape[0]
    grand_mobility(work.directions, work.distances, radii, work.mobility)
    if cholesky(work.mobility) != 0:
        return NOT_POSITIVE_DEFINITE
    remainder = work.mobility[5 * n :, 5 * n :]
    for k in range(6 * n):
        work.resistance[k, : k + 1] = remainder[k, : k + 1]
    return inverse_from_cholesky(work.resistance)


@separately_compiled()
def far_field_strain_load(work, strain_five):
    """What a uniform strain (5,) exerts in the far field into `work.strain_load`, after `far_field_resistance`."""
    n = work.strain_load.shape[0] // 6
    for i in range(n):
        work.straining[5 * i : 5 * i + 5] = strain_five
    solve_lower(work.mobility[: 5 * n, : 5 * n], work.straining, False)
    work.strain_load[:] = 0.0
    add_product(work.mobility[5 * n :, : 5 * n], work.straining, work.strain_load, -1.0)
    solve_cholesky(work.mobility[5 * n :, 5 * n :], work.strain_load)


@compiled
def resistance(level, work, radii):
    """Far-field resistance Mhat^-1 into `work.resistance`, keeping the factor in `work.mobility`; 0 or an error code."""
    return far_field_resistance(work, radii)


@compiled
def strain_load(level, work, strain_five):
    """What a uniform strain (5,) exerts in the far field into `work.strain_load`, after `resistance`."""
    far_field_strain_load(work, strain_five)


@separately_compiled()
def stresslets(level, work, radii, rates, strain_five, out):
    """Stresslets exerted on the fluid into out (N, 5), from rates (6N,) of spheres in a strain (5,).

    `work` holds the far-field factor and, from `far_field_strain_load` of the same strain, L_S^-1 E; the latter is used up.
    """
    n = radii.shape[0]
    # Far-field forces from the factor: Mhat F = rates + W^T z, then S = -L_S^-T (z + W F).
    far = rates.copy()
    coupling = work.mobility[5 * n :, : 5 * n]
    add_product(coupling, work.straining, far, 1.0)
    solve_cholesky(work.mobility[5 * n :, 5 * n :], far)
    five = work.straining
    add_transposed_product(coupling, far, five, 1.0)
    for k in range(5 * n):
        five[k] = -five[k]
    solve_lower(work.mobility[: 5 * n, : 5 * n], five, True)
    for i in range(n):
        out[i] = five[5 * i : 5 * i + 5]


LEVEL = Level(
    ForceTorqueStresslet,
    lambda *_: ForceTorqueStresslet(),
    resistance,
    strain_load,
    no_two_body,
    stresslets,
    squeeze=lambda gap: 40.0 / 21.0,  # half of X^A_11 - X^A_12 by `two_sphere.far_field` at r = 2a
    stresslet_couplings=True,
)
