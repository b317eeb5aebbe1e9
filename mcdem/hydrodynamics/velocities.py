"""Velocities of free spheres under given forces and torques."""

from __future__ import annotations

import numpy as np
from numba import types

from mcdem.compilation import compiled, separately_compiled
from mcdem.hydrodynamics import level as levels
from mcdem.hydrodynamics.linear_algebra import cholesky, solve_cholesky
from mcdem.hydrodynamics.resistance import NOT_POSITIVE_DEFINITE, measure
from mcdem.hydrodynamics.undisturbed_flow import flow_component, spin_component


@separately_compiled(types.int64)
def solve_rates(level, work, positions, radii, flow, forces, torques):
    """Rates of free spheres relative to the flow, (omega | u) into `work.strain_load` (6N,); arguments as `solve_velocities`.

    Returns 0 or an error code.
    """
    n = positions.shape[0]
    measure(positions, work.directions, work.distances)
    code = levels.resistance(level, work, radii)
    if code != 0:
        return code
    levels.strain_load(level, work, flow.strain_five)
    levels.two_body(level, work, radii, flow.strain)
    rates = work.strain_load
    for i in range(n):
        for k in range(3):
            rates[3 * i + k] += torques[i, k]
            rates[3 * (n + i) + k] += forces[i, k]
    if cholesky(work.resistance) != 0:
        return NOT_POSITIVE_DEFINITE
    solve_cholesky(work.resistance, rates)
    return 0


@compiled
def solve_velocities(level, work, positions, radii, flow, forces, torques, stresslet):
    """Velocities of free spheres under given forces and torques; reduced units.

    level, work : parameters of a level of hydrodynamics, and `resistance.workspace` of N
    positions, forces, torques : (N, 3);  radii : (N,);  flow : `UndisturbedFlow`
    stresslet : (N, 5), filled with what the fluid exerts on the spheres

    Returns (code, linear (N, 3), angular (N, 3)).
    """
    n = positions.shape[0]
    linear = np.empty((n, 3))
    angular = np.empty((n, 3))
    code = solve_rates(level, work, positions, radii, flow, forces, torques)
    if code != 0:
        return code, linear, angular
    rates = work.strain_load
    levels.stresslets(level, work, radii, rates, flow.strain_five, stresslet)
    for i in range(n):
        for k in range(5):
            stresslet[i, k] = -stresslet[i, k]
        for k in range(3):
            linear[i, k] = rates[3 * (n + i) + k] + flow_component(flow.gradient, positions, i, k)
            angular[i, k] = rates[3 * i + k] + spin_component(flow.gradient, k)
    return 0, linear, angular
