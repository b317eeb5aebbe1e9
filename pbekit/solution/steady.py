"""Steady states: an integrator brings the balance near, Newton ends it.

The rates of change add to zero in mass whatever the state, so the Jacobian is singular in that direction; the row of
the cell that holds most mass is replaced by the mass balance, which also picks the steady state of this suspension
among those of all concentrations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg
from scipy.integrate import LSODA

from pbekit.arguments import array, number
from pbekit.balance.population_balance import PopulationBalance, balance_at_door
from pbekit.errors import PBEError


class NotReachedError(PBEError):
    """No steady state was reached in any time."""


@dataclass(frozen=True)
class SteadyState:
    """A steady population, and what it takes to ask how it depends on the rates.

    population : (K,)
    residual : largest |dn/dt| weighted by mass, over the mass that is turned over in unit time
    factors : LU factors of the Jacobian with the mass balance in row `row`
    time : how far the integrator went; iterations : of Newton

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> grid = pbekit.Grid.primaries(exact_to=40)
    >>> events = [
    ...     pbekit.Aggregation(1e-15),
    ...     pbekit.Breakage(pbekit.balance.PowerLawRate(0.01, offset=1.0), pbekit.balance.Uniform()),
    ... ]
    >>> balance = pbekit.PopulationBalance(grid, events, edge="closed")
    >>> population = np.zeros(40)
    >>> population[0] = 1e14
    >>> steady = pbekit.steady_state(balance, population)
    >>> f"<P> = {population.sum() / steady.population.sum():.1f}", bool(steady.residual < 1e-9)
    ('<P> = 2.8', True)
    """

    balance: PopulationBalance
    population: np.ndarray
    residual: float
    iterations: int
    time: float
    factors: tuple[np.ndarray, np.ndarray]
    row: int

    def response(self, change: np.ndarray) -> np.ndarray:
        """dn/dtheta (K, ...) of the steady state, given d(dn/dt)/dtheta (K, ...) at fixed population and mass."""
        right = -np.array(change, float)
        right[self.row] = 0.0
        return linalg.lu_solve(self.factors, right)

    def importance(self, gradient: np.ndarray) -> np.ndarray:
        """(K, ...) adjoint: d(output) per unit of d(dn/dt) in each cell, given d(output)/dn (K, ...)."""
        weights = -linalg.lu_solve(self.factors, np.asarray(gradient, float), trans=1)
        weights[self.row] = 0.0
        return weights


def steady_state(
    balance: PopulationBalance,
    population: np.ndarray,
    time_scale: float | None = None,
    rtol: float = 1e-4,
    tolerance: float = 1e-11,
    guess: np.ndarray | None = None,
) -> SteadyState:
    """The steady state reached from `population` (which fixes the mass).

    Parameters
    ----------
    balance : PopulationBalance
        With a closed edge: mass that leaves the grid has no steady state.
    population : (K,) [1/m^3]
        Where it starts, which fixes the mass.
    time_scale : float
        First time span to integrate [s]; by default set by the initial rates.
    rtol : float
        Relative tolerance of the integration.
    tolerance : float
        On the residual [-].
    guess : (K,)
        A population near the steady state, of any mass; Newton is tried from it without integrating.

    Returns
    -------
    SteadyState
        population (K,) [1/m^3], and how it depends on the rates.

    Raises
    ------
    NotReachedError
        Where there is none, with why.

    Examples
    --------
    Aggregation at a constant rate against the breakage of every bond.

    >>> import pbekit
    >>> from pbekit.balance import Constant, PowerLawRate, Uniform
    >>> grid = pbekit.Grid.primaries(128)
    >>> events = [pbekit.Aggregation(Constant(1.0)), pbekit.Breakage(PowerLawRate(0.05, 1.0, 1.0), Uniform())]
    >>> balance = pbekit.PopulationBalance(grid, events, edge="closed")
    >>> found = pbekit.steady_state(balance, grid.monodisperse(1.0))
    >>> bool(found.residual < 1e-11)
    True
    """
    balance_at_door(balance)
    if balance.edge != "closed":
        raise PBEError(
            'steady_state: use PopulationBalance(..., edge="closed"); mass that leaves the grid never settles'
        )
    number("tolerance", tolerance, 1e-300, 1.0)
    number("rtol", rtol, 1e-14, 1.0)
    if time_scale is not None:
        number("time_scale", time_scale, 1e-300, 1e300)
    start = balance.state(population)
    cells, mass = balance.cells, balance.grid.mass
    if balance.conserved.shape[1] > 1:
        raise PBEError("steady_state: for one mass coordinate")
    total = start[:cells] @ mass
    if not total > 0.0:
        raise PBEError("steady_state: the population is empty, expected one that holds mass")
    if guess is not None:
        guess = array("guess", guess, (cells,))
        near = guess * (total / (guess @ mass))
        found = _newton(balance, near, total, tolerance, 0.0)
        if found is not None:
            return found
    rate = balance.rhs(0.0, start)[:cells]
    turnover = np.abs(rate) @ mass / total
    if turnover == 0:
        raise PBEError("steady_state: nothing happens to the initial population")
    span = time_scale or 10.0 / turnover
    trials = 0
    solver = LSODA(
        balance.rhs, 0.0, start, 1e300, rtol=rtol, atol=1e-10 * start[:cells].max(), jac=balance.jacobian
    )
    while trials < 40:
        # scipy's BDF subtracts entries of its history that it has not filled yet.
        with np.errstate(invalid="ignore", over="ignore"):
            while solver.t < span and solver.status == "running":
                solver.step()
        if solver.status == "failed":
            raise NotReachedError(f"steady_state: the integrator failed at t = {solver.t:g}")
        found = _newton(balance, np.maximum(solver.y[:cells], 0.0), total, tolerance, solver.t)
        if found is not None:
            return found
        span, trials = 2 * span, trials + 1
    raise NotReachedError(f"steady_state: not reached by t = {solver.t:g}")


def _newton(
    balance: PopulationBalance, population: np.ndarray, total: float, tolerance: float, time: float
) -> SteadyState | None:
    """Newton with the mass row; None if it does not converge to a non-negative state."""
    cells, mass = balance.cells, balance.grid.mass
    n = population * (total / (population @ mass))
    pad = np.zeros(balance.tail)
    for iteration in range(15):
        state = np.concatenate([n, pad])
        rate = balance.rhs(0.0, state)[:cells]
        jacobian = balance.jacobian(0.0, state)[:cells, :cells]
        # What passes through the classes per unit time: the scale against which a rest is zero.
        passing = np.abs(np.diag(jacobian)) * n @ mass
        residual = np.abs(rate) @ mass / passing
        # Shapes or sizes that nothing makes and nothing takes stay as they are.
        idle = np.flatnonzero((np.diag(jacobian) == 0) & (n == 0))
        jacobian[idle, idle] = 1.0
        row = int(np.argmax(n * mass))
        jacobian[row] = mass
        rate[row] = n @ mass - total
        factors = linalg.lu_factor(jacobian)
        if residual <= tolerance:
            return SteadyState(balance, n, residual, iteration, time, factors, row)
        if not np.isfinite(residual):
            return None
        step = linalg.lu_solve(factors, -rate)
        trial = n + step
        lowest = 1e-9 * n.max()
        if np.any(~np.isfinite(trial)) or np.any(trial < -lowest):
            return None
        n = np.maximum(trial, 0.0)
    return None
