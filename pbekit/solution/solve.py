"""Integrate a balance in time with scipy's integrators."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.integrate import odeint, solve_ivp

from pbekit import arguments, moments
from pbekit.balance.population_balance import PopulationBalance, balance_at_door
from pbekit.errors import PBEError


def integrate(
    balance: PopulationBalance,
    population: ArrayLike,
    times: ArrayLike,
    method: Any = "LSODA",
    rtol: float = 1e-8,
    atol: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> np.ndarray:
    """(times, K + tail) states; the state is known at times[0].

    Parameters
    ----------
    balance : PopulationBalance
        Of K cells, with a tail of what leaves the grid.
    population : (K,) [1/m^3]
        At times[0].
    times : (T,) [s]
        Ascending.
    method : str
        Integrator of scipy: LSODA, BDF, Radau, RK45, RK23, DOP853.
    rtol : float
        Relative tolerance.
    atol : float
        Absolute tolerance on numbers [1/m^3], 1e-12 of the largest initial number by default.
    progress : callable
        Called with the time reached.

    Returns
    -------
    (T, K + tail) array
        Numbers [1/m^3], then number and mass beyond the grid.

    Raises
    ------
    PBEError
        Of times that do not ascend, or arguments that cannot be meant.

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> from pbekit.balance import Constant
    >>> grid = pbekit.Grid.primaries(64)
    >>> balance = pbekit.PopulationBalance(grid, [pbekit.Aggregation(Constant(1.0))])
    >>> states = pbekit.integrate(balance, grid.monodisperse(1.0), [0.0, 2.0], rtol=1e-10)
    >>> round(float(states[-1, :64].sum()), 6)
    0.5
    """
    balance_at_door(balance)
    arguments.method(method)
    arguments.number("rtol", rtol, 1e-14, 1.0)
    times = arguments.array("times", times, (None,), "times")
    if times.size < 2 or np.any(np.diff(times) <= 0):
        raise PBEError("times must ascend, the first being that of the initial population")
    start = balance.state(population)
    atol = 1e-12 * np.max(start) if atol is None else arguments.number("atol", atol, 0.0, np.inf)
    rhs = balance.rhs
    if progress is not None:

        def reported(time: float, state: np.ndarray) -> np.ndarray:
            progress(time)
            return balance.rhs(time, state)

        rhs = reported

    if method == "LSODA":
        # The same integrator as solve_ivp's, but its steps do not pass through Python.
        states, info = odeint(
            rhs,
            start,
            times,
            Dfun=balance.jacobian,
            tfirst=True,
            rtol=rtol,
            atol=atol,
            mxstep=100_000,
            full_output=True,
        )
        if info["message"] != "Integration successful.":
            raise PBEError(f"integration with LSODA stopped before t = {times[-1]:g}: {info['message']}")
        return states
    options: dict[str, Any] = dict(jac=balance.jacobian) if method in ("BDF", "Radau") else {}
    # scipy's BDF subtracts entries of its history that it has not filled yet.
    with np.errstate(invalid="ignore"):
        solution = solve_ivp(
            rhs, (times[0], times[-1]), start, method=method, t_eval=times, rtol=rtol, atol=atol, **options
        )
    if not solution.success:
        raise PBEError(f"integration with {method} stopped at t = {solution.t[-1:]}: {solution.message}")
    return solution.y.T


LONG = 1000.0
"""A course of so many first turnovers of the mass may have come to rest before its end."""


def course(
    balance: PopulationBalance, population: ArrayLike, times: ArrayLike, *, rtol: float = 1e-8, **options: Any
) -> tuple[np.ndarray, float | None]:
    """As `integrate`, but a long course stops where nothing changes any more.

    Returns the states (times, K + tail), which repeat the last from there on, and the time at which the population had come to
    rest: what changes in the time in which the mass passes through the classes once is below `rtol` of it.  None if it had not,
    or if the course is shorter than `LONG` first turnovers, which is not looked at.
    """
    times, start = np.asarray(times, float), balance.state(population)
    cells, mass = balance.cells, balance.grid.mass
    turnover = np.abs(balance.rhs(0.0, start)[:cells]) @ mass / (start[:cells] @ mass)
    if times.ndim != 1 or not np.all(np.isfinite(times)) or not turnover * (times[-1] - times[0]) > LONG:
        return integrate(balance, start, times, rtol=rtol, **options), None
    options = {"atol": 1e-12 * np.max(start)} | options
    states, row = np.empty((times.size, start.size)), 1
    states[0], now, state = start, times[0], start
    while now < times[-1]:
        stop = min(times[0] + max(LONG / turnover, 2.0 * (now - times[0])), times[-1])
        within = times[(times > now) & (times <= stop)]
        found = integrate(balance, state, np.unique([now, *within, stop]), rtol=rtol, **options)
        states[row : row + within.size] = found[1 : 1 + within.size]
        row += within.size
        # Numbers below zero are within the tolerance, and no population to start from.
        now, state = stop, np.maximum(found[-1], 0.0)
        passing = np.abs(np.diag(balance.jacobian(now, state))[:cells]) * state[:cells] @ mass
        if np.abs(balance.rhs(now, state)[:cells]) @ mass <= rtol * passing:
            states[row:] = state
            return states, float(now)
    return states, None


def solve(
    balance: PopulationBalance,
    population: ArrayLike,
    times: ArrayLike,
    time_unit: str = "s",
    **options: Any,
) -> xr.Dataset:
    """The balance's populations as a dataset, with moments, overflow and mass drift; options as in `integrate`.

    Numbers below zero, which an integrator leaves within its tolerance, are set to zero; `clipped_mass` says what
    that moved.  A long course that comes to rest is not followed further (`course`): `at_rest_from` says from when on.

    Parameters
    ----------
    balance : PopulationBalance
        Of K cells.
    population : (K,) [1/m^3]
        At times[0].
    times : (T,)
        Ascending, in `time_unit`.
    time_unit : str
        What times are in, for the labels of the dataset; rates are per the same.
    **options : of `integrate`
        method, rtol, atol, progress.

    Returns
    -------
    xarray.Dataset
        `number` (time, cell) with its moments, overflow and mass drift over `time`.

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> from pbekit.balance import Constant
    >>> grid = pbekit.Grid.primaries(64)
    >>> balance = pbekit.PopulationBalance(grid, [pbekit.Aggregation(Constant(1.0))])
    >>> course = pbekit.solve(balance, grid.monodisperse(1.0), np.linspace(0.0, 2.0, 3))
    >>> course.mean_size.values.round(4).tolist()
    [1.0, 1.5, 2.0]
    """
    states, rest = course(balance, population, times, **options)
    data = to_dataset(balance, states, np.asarray(times, float), time_unit)
    return data if rest is None else data.assign_attrs(at_rest_from=rest)


def to_dataset(
    balance: PopulationBalance, states: np.ndarray, times: np.ndarray, time_unit: str = "s"
) -> xr.Dataset:
    """States (times, K + tail) as a dataset that carries its grid, moments, overflow and mass drift."""
    grid, cells = balance.grid, balance.cells
    numbers = states[:, :cells]
    clipped = np.minimum(numbers, 0.0) @ grid.mass
    numbers = np.maximum(numbers, 0.0)
    mass = states @ balance.conserved
    data = xr.Dataset(
        {
            "number": (("time", "cell"), numbers, {"long_name": "number concentration"}),
            "overflow_number": ("time", states[:, cells]),
            "overflow_mass": ("time", states[:, cells + 1 :].sum(axis=1)),
            "mass_drift": ("time", mass.sum(axis=1) / mass[0].sum() - 1, {"units": "1"}),
            "clipped_mass": ("time", -clipped / mass[0].sum(), {"units": "1"}),
        },
        coords={
            "time": ("time", times, {"units": time_unit}),
            "mass": ("cell", grid.mass),
            "shape": ("cell", grid.state.shape),
            "outer_radius": ("cell", grid.state.outer_radius, {"units": "m"}),
        },
        attrs={"scheme": balance.scheme, "edge": balance.edge},
    )
    return data.assign(moments.summary(data.number, data.mass, data.outer_radius))
