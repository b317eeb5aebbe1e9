"""March a balance in time with scipy's integrators."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from scipy.integrate import odeint, solve_ivp

from pbekit import moments
from pbekit.balance.population_balance import PopulationBalance
from pbekit.errors import PBEError


def integrate(
    balance: PopulationBalance,
    population: np.ndarray,
    times: np.ndarray,
    method: Any = "LSODA",
    rtol: float = 1e-8,
    atol: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> np.ndarray:
    """(times, K + tail) states; the state is known at times[0].

    atol : absolute tolerance on numbers, 1e-12 of the largest initial number by default
    progress : called with the time reached
    """
    times = np.asarray(times, float)
    if times.ndim != 1 or times.size < 2 or np.any(np.diff(times) <= 0):
        raise PBEError("times must ascend, the first being that of the initial population")
    start = balance.state(population)
    if atol is None:
        atol = 1e-12 * np.max(start)
    rhs = balance.rhs
    if progress is not None:

        def rhs(t, y):
            progress(t)
            return balance.rhs(t, y)

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


def solve(balance: PopulationBalance, population, times, time_unit: str = "s", **options) -> xr.Dataset:
    """The balance's populations as a dataset, with moments, overflow and mass drift; options as in `integrate`.

    Numbers below zero, which an integrator leaves within its tolerance, are set to zero; `clipped_mass` says what
    that moved.
    """
    states = integrate(balance, population, times, **options)
    return to_dataset(balance, states, np.asarray(times, float), time_unit)


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
