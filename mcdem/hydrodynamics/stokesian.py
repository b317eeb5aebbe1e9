"""Stokesian dynamics: the far field of forces, torques and stresslets, and pair lubrication.

Durlofsky, Brady & Bossis 1987: the resistance of N spheres is the inverse of their far-field grand mobility, with
the exact two-body resistance less its own far field added for every pair.

    R = Mhat^-1 + R_two-body
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcdem.compilation import separately_compiled
from mcdem.hydrodynamics import fts
from mcdem.hydrodynamics.grand_mobility import five_tensor
from mcdem.hydrodynamics.level import Level
from mcdem.hydrodynamics.two_sphere import lubrication
from mcdem.hydrodynamics.two_sphere.tables import lubrication_tables


class StokesianDynamics(NamedTuple):
    """Parameters of the two-body part."""

    lubrication: object
    """`two_sphere.tables`, of one radius or of several"""
    cutoff: float
    """delta, the gap over a below which the two-body part keeps its value there"""
    shifted: bool
    """Whether the strain too sees a pair below the cut-off at the gap of the cut-off.  Otherwise only the matrix is frozen there,
    as Frungieri & Vanni (2021) say, and the strain at the true distance causes a squeeze by cutoff - h that grows without
    bound as the cut-off falls below the overlap of a contact."""


@separately_compiled()
def two_body(level, work, radii, strain):
    """Add the two-body part of every pair to the resistance and to what a strain (3, 3) exerts."""
    n = radii.shape[0]
    for i in range(n):
        for j in range(i):
            true_gap = work.distances[i, j] - radii[i] - radii[j]
            gap = max(true_gap, level.cutoff)
            shift = gap - true_gap if level.shifted else 0.0
            lubrication.motion_scalars(gap, radii[i], radii[j], level.lubrication, work.raw, work.scalars)
            d = (work.directions[j, i, 0], work.directions[j, i, 1], work.directions[j, i, 2])
            lubrication.add_pair_resistance(work.scalars, i, j, d, work.resistance)
            lubrication.add_pair_strain_load(work.scalars, i, j, d, strain, shift, work.strain_load)


@separately_compiled()
def two_body_of_strains(level, work, radii, strains, strain_loads):
    """Add the two-body part of every pair to the resistance and to the strain_loads (5, 6N) of five strains (5, 5)."""
    tensor = np.empty((3, 3))
    n = radii.shape[0]
    for i in range(n):
        for j in range(i):
            true_gap = work.distances[i, j] - radii[i] - radii[j]
            gap = max(true_gap, level.cutoff)
            shift = gap - true_gap if level.shifted else 0.0
            lubrication.motion_scalars(gap, radii[i], radii[j], level.lubrication, work.raw, work.scalars)
            d = (work.directions[j, i, 0], work.directions[j, i, 1], work.directions[j, i, 2])
            lubrication.add_pair_resistance(work.scalars, i, j, d, work.resistance)
            for k in range(5):
                five_tensor(strains[k], tensor)
                lubrication.add_pair_strain_load(work.scalars, i, j, d, tensor, shift, strain_loads[k])


@separately_compiled()
def stresslets(level, work, radii, rates, strain_five, out):
    """Stresslets exerted on the fluid into out (N, 5), as `fts.stresslets`, with those of lubrication."""
    fts.stresslets(level, work, radii, rates, strain_five, out)
    n = radii.shape[0]
    for i in range(n):
        for j in range(i):
            gap = max(work.distances[i, j] - radii[i] - radii[j], level.cutoff)
            lubrication.pair_scalars(gap, radii[i], radii[j], level.lubrication, work.raw, work.scalars)
            lubrication.add_pair_stresslet(work.scalars, i, j, work.directions[j, i], rates, strain_five, out)


def _parameters(cutoff: float, shifted: bool, radii: tuple[float, ...]) -> StokesianDynamics:
    return StokesianDynamics(lubrication_tables(radii), cutoff, shifted)


LEVEL = Level(
    StokesianDynamics,
    _parameters,
    fts.resistance,
    fts.strain_load,
    two_body,
    stresslets,
    squeeze=lambda gap: 1.0 / (4.0 * gap),  # the leading term of lubrication
    two_body_of_strains=two_body_of_strains,
    stresslet_couplings=True,
    lubrication=True,
)
