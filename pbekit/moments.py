"""Averages of a population, along whatever dimensions come with it; the class dimension is `cell`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy import special

Below = Callable[[ArrayLike], np.ndarray]
"""What lies below a mass: cumulative number or mass, as a function of it."""


def moment(number: xr.DataArray, mass: xr.DataArray, order: float) -> xr.DataArray:
    """M_k = sum of m^k n."""
    return (number * mass**order).sum("cell")


def mean_size(number: xr.DataArray, mass: xr.DataArray) -> xr.DataArray:
    """<P> = M1/M0, the arithmetic mean over aggregates."""
    return moment(number, mass, 1) / moment(number, mass, 0)


def size_deviation(number: xr.DataArray, mass: xr.DataArray) -> xr.DataArray:
    """sigma_P, standard deviation of P over aggregates."""
    variance = moment(number, mass, 2) / moment(number, mass, 0) - mean_size(number, mass) ** 2
    return variance.clip(min=0) ** 0.5


def sauter_diameter(number: xr.DataArray, outer_radius: xr.DataArray) -> xr.DataArray:
    """d32 = 2 sum R^3 / sum R^2 (the paper's Eq. 24) [m]."""
    return 2 * (number * outer_radius**3).sum("cell") / (number * outer_radius**2).sum("cell")


def summary(number: xr.DataArray, mass: xr.DataArray, outer_radius: xr.DataArray) -> dict[str, xr.DataArray]:
    """What an experimenter reads first."""
    found = {
        "total_number": moment(number, mass, 0),
        "total_mass": moment(number, mass, 1),
        "second_moment": moment(number, mass, 2),
        "mean_size": mean_size(number, mass),
        "size_deviation": size_deviation(number, mass),
    }
    if bool(np.isfinite(outer_radius).all()):
        found["sauter_diameter"] = sauter_diameter(number, outer_radius).assign_attrs(units="m")
    return found


def schulz_zimm_below(number: float, mean: float, shape: float) -> tuple[Below, Below]:
    """Cumulative number and mass of a Schulz-Zimm (gamma) distribution; 1/shape is the relative variance."""
    rate = shape / mean
    return (
        lambda v: number * special.gammainc(shape, rate * np.asarray(v, float)),
        lambda v: number * mean * special.gammainc(shape + 1, rate * np.asarray(v, float)),
    )
