"""Free draining: Stokes' drag and torque on each sphere by itself (Kirkwood & Riseman 1948, without interaction)."""

from __future__ import annotations

from typing import NamedTuple

from mcdem.compilation import compiled
from mcdem.hydrodynamics.level import Level, no_strain_load, no_two_body, single_stresslets


class FreeDraining(NamedTuple):
    """No parameters."""

    lubrication: None = None


@compiled
def resistance(level, work, radii):
    """Resistance of spheres without hydrodynamic interaction: Stokes' drag and torque, 1 and 4/3 for a sphere of radius a."""
    n = radii.shape[0]
    for row in range(6 * n):
        for column in range(row + 1):
            work.resistance[row, column] = 0.0
        a = radii[(row // 3) % n]
        work.resistance[row, row] = 4.0 / 3.0 * a**3 if row < 3 * n else a
    return 0


LEVEL = Level(
    FreeDraining,
    lambda *_: FreeDraining(),
    resistance,
    no_strain_load,
    no_two_body,
    single_stresslets,
    squeeze=lambda gap: 1.0 / 2.0,
)
