"""Velocities of rigid free spheres in the scene's flow: the hydrodynamics alone, for anyone to check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from mcdem.aggregates.aggregate import overlap_limit, radii_of
from mcdem.arguments import scene_at_door
from mcdem.encounter.simulate import physics_of
from mcdem.errors import UserError
from mcdem.hydrodynamics import LEVELS
from mcdem.hydrodynamics.grand_mobility import five_to_tensor
from mcdem.hydrodynamics.resistance import workspace
from mcdem.hydrodynamics.velocities import solve_velocities
from mcdem.quantities.units import ENERGY, FORCE, LENGTH, si

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from mcdem.scene import Scene


MATRIX_FREE_FROM = 300
"""Number of spheres from which no dense matrix is made: there both paths take as long (`benchmarks/performance.py`)."""


@dataclass(frozen=True, eq=False)
class Velocities:
    """linear (N, 3) [m/s], angular (N, 3) [1/s], stresslet (N, 3, 3) [N m], symmetric and traceless.

    The stresslet is the one that a free sphere adds to the suspension's stress: + 20/3 pi mu a^3 E for a single one.

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/free-draining-1000Pa.toml")
    >>> found = mcdem.velocities(scene, [[0.0, 0.0, 0.0]])

    Einstein's viscosity is this stresslet times the number of spheres in a volume:

    >>> f"{found.stresslet[0, 1, 2] / (10 / 3 * 3.14159 * scene.flow.shear_stress * (0.5e-6) ** 3):.3f}"
    '1.000'
    """

    linear: NDArray[np.float64]
    angular: NDArray[np.float64]
    stresslet: NDArray[np.float64]


def velocities(
    scene: Scene,
    positions: ArrayLike,
    forces: ArrayLike | None = None,
    torques: ArrayLike | None = None,
    radii: ArrayLike | None = None,
) -> Velocities:
    """Velocities of free spheres of the scene's radius, or of `radii` (N,) [m] of several, in its flow, without direct forces.

    At the scene's level of hydrodynamics: Stokesian dynamics of Durlofsky, Brady & Bossis (1987), or a coarser one; with
    stresslets, from MATRIX_FREE_FROM spheres on by iteration in O(N) memory on all cores, to 1e-6.
    Without stresslet couplings (rotne_prager, free_draining) a sphere's stresslet is that of a single one.

    Parameters
    ----------
    scene : Scene
        Whose flow, radius and level of hydrodynamics are taken.
    positions : array_like, (N, 3) [m]
        Centres.
    forces, torques : array_like, (N, 3) [N], (N, 3) [N m]
        External ones, zero by default.
    radii : array_like, (N,) [m]
        Of spheres of several radii, instead of the scene's.

    All as numbers in SI units, text with units, or quantities of pint.

    Returns
    -------
    Velocities
        linear (N, 3) [m/s], angular (N, 3) [1/s], stresslet (N, 3, 3) [N m].

    Raises
    ------
    UserError
        Of wrong shapes, numbers that are not finite, or spheres that overlap grossly.

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/free-draining-1000Pa.toml")

    A sphere alone goes with the flow, u = g y along z, and spins at half the shear rate:

    >>> found = mcdem.velocities(scene, [[0.0, 1e-6, 0.0]])
    >>> found.linear.round(6).tolist(), abs(found.angular.round(3)).tolist()
    ([[0.0, 0.0, 0.01]], [[5000.0, 0.0, 0.0]])
    """
    scene_at_door(scene)
    x = si("positions", positions, LENGTH, (None, 3))
    f = np.zeros_like(x) if forces is None else si("forces", forces, FORCE, x.shape)
    t = np.zeros_like(x) if torques is None else si("torques", torques, ENERGY, x.shape)
    radius, units = scene.suspension.radius, scene.reduced
    sizes = radii_of(scene, radii, len(x))
    if len(x) > 1:
        pairs = cKDTree(x).query_pairs(2.0 * radius, output_type="ndarray")
        touching = 2.0 * radius if sizes is None else sizes[pairs].sum(axis=1)
        gap = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1) - touching
        if gap.min(initial=0.0) < -overlap_limit(scene) * radius:
            i, j = sorted(int(k) for k in pairs[gap.argmin()])
            raise UserError(
                f"positions: spheres {i} and {j} overlap by {-gap.min() / radius:.3g} radii: move them apart "
                "(are the positions in metres?)"
            )
    flow, physics = physics_of(scene)
    scaled = np.ones(len(x)) if sizes is None else sizes / units.length
    where, loads = x / units.length, (f / units.force, t / units.energy)
    level = LEVELS[scene.hydrodynamics.level]
    if level.stresslet_couplings and len(x) >= MATRIX_FREE_FROM:
        from mcdem.hydrodynamics import matrix_free  # compiled for several cores, and seldom needed

        found = matrix_free.solve_velocities(physics.level, where, scaled, flow, *loads)
        linear, angular, five, code = found.linear, found.angular, found.stresslet, 0
    else:
        five = np.empty((len(x), 5))
        code, linear, angular = solve_velocities(
            physics.level, workspace(len(x)), where, scaled, flow, *loads, five
        )
    if code != 0:
        raise ArithmeticError("the resistance matrix of these spheres is not positive definite")
    return Velocities(linear * units.velocity, angular / units.time, five_to_tensor(five) * units.energy)
