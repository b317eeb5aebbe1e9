"""Far field of forces and torques alone (Rotne & Prager 1969; Yamakawa 1970; torques: Reuland, Felderhof & Jones 1978).

Strain exerts nothing on the spheres.
"""

from __future__ import annotations

from typing import NamedTuple

from mcdem.compilation import compiled
from mcdem.hydrodynamics.grand_mobility import force_torque_mobility
from mcdem.hydrodynamics.level import Level, no_strain_load, no_two_body, single_stresslets
from mcdem.hydrodynamics.linear_algebra import cholesky, inverse_from_cholesky
from mcdem.hydrodynamics.resistance import NOT_POSITIVE_DEFINITE


class RotnePrager(NamedTuple):
    """No parameters."""

    lubrication: None = None


@compiled
def resistance(level, work, radii):
    """Far-field resistance of forces and torques into `work.resistance`; 0 or an error code."""
    force_torque_mobility(work.directions, work.distances, radii, work.resistance)
    if cholesky(work.resistance) != 0:
        return NOT_POSITIVE_DEFINITE
    return inverse_from_cholesky(work.resistance)


LEVEL = Level(
    RotnePrager,
    lambda *_: RotnePrager(),
    resistance,
    no_strain_load,
    no_two_body,
    single_stresslets,
    squeeze=lambda gap: 4.0 / 3.0,  # 1/(2 (1 - 5/8)) by the couplings of `grand_mobility` at r = 2a
)
