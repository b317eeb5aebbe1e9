"""Exact solutions of balances in which several events compete; those of one kernel stand beside the kernel."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg, special


def chain_scission(size: ArrayLike, time: float, number: float, length: int, bond_rate: float) -> np.ndarray:
    """n_k of chains of `length` whose bonds break independently at `bond_rate` (Montroll & Simha 1940)."""
    k = np.asarray(size, float)
    intact = np.exp(-bond_rate * time)
    broken = -np.expm1(-bond_rate * time)
    inner = np.maximum(length - k - 1, 0)
    return np.where(
        k == length,
        number * intact ** (length - 1),
        np.where(k < length, number * intact ** (k - 1) * (2 * broken + inner * broken**2), 0.0),
    )


def random_scission(
    volume_below: ArrayLike, time: float, number: float, mean: float, rate: float
) -> tuple[np.ndarray, np.ndarray]:
    """Cumulative (number, mass) below v: S = s v, b = 2/u from number/mean exp(-v/mean) (Ziff & McGrady 1985)."""
    from pbekit.balance.kernels import exponential_below

    grown = 1 + rate * mean * time
    below = exponential_below(number * grown, mean / grown)
    return below[0](volume_below), below[1](volume_below)


def chain_bonding(size: ArrayLike, time: float, number: float, rate: float, bond_rate: float) -> np.ndarray:
    """Constant aggregation against bonds that break at `bond_rate` each, from monomers (Blatz & Tobolsky 1945).

    n_k = N0 (1 - p)^2 p^(k-1) with dp/dt = (K N0/2) ((1 - p)^2 - lam p), lam = 2 k_b/(K N0).
    """
    k = np.asarray(size, float)
    lam = 2 * bond_rate / (rate * number)
    root = np.sqrt(lam + 0.25 * lam**2)
    low, high = 1 + 0.5 * lam - root, 1 + 0.5 * lam + root  # roots of (1 - p)^2 = lam p
    decay = np.exp(-0.5 * rate * number * (high - low) * time)
    p = low * high * (1 - decay) / (high - low * decay)
    return number * (1 - p) ** 2 * p ** (k - 1)


def aggregation_with_random_scission(
    time: float, number: float, mean: float, rate: float, breakage: float
) -> float:
    """Total number: constant aggregation K with S = s v, b = 2/u, from an exponential (McCoy & Madras 2003).

    The distribution stays exponential: n = N^2/M exp(-N v/M), dN/dt = s M - K N^2/2.
    """
    steady = np.sqrt(2 * breakage * number * mean / rate)
    t = np.tanh(0.5 * rate * steady * time)
    return steady * (number + steady * t) / (steady + number * t)


def two_component_constant(
    first: ArrayLike, second: ArrayLike, time: float, number: float, rate: float, share: float
) -> np.ndarray:
    """n_(a, b) of whole primaries, from monomers of which `share` are A (after Lushnikov 1976): binomial in each size."""
    a, b = np.asarray(first, float), np.asarray(second, float)
    k, t = a + b, 0.5 * rate * number * time
    with np.errstate(divide="ignore", invalid="ignore"):
        log = (k - 1) * np.log(t) - (k + 1) * np.log1p(t)
        log = log + special.gammaln(k + 1) - special.gammaln(a + 1) - special.gammaln(b + 1)
        log = log + special.xlogy(a, share) + special.xlogy(b, 1 - share)
    return np.where(k > 0, number * np.exp(log), 0.0)


def rectangle_breakage_moment(order: tuple[int, int], time: float, initial: float, rate: float) -> float:
    """M_pq of breakage at a constant rate with b = 2/(x' y'): initial exp((2/((p+1)(q+1)) - 1) s t)."""
    p, q = order
    return initial * np.exp((2 / ((p + 1) * (q + 1)) - 1) * rate * time)


def marcus_lushnikov_constant(time: float, number: int, rate: float, volume: float) -> tuple[float, float]:
    """Mean and variance of the number of clusters of a finite population, constant kernel, from `number` monomers.

    The number is a pure death process m -> m - 1 at rate K m (m - 1)/(2 V) (Marcus 1968, Lushnikov 1978).
    """
    m = np.arange(1, number + 1)
    death = 0.5 * rate / volume * m * (m - 1.0)
    generator = np.diag(-death) + np.diag(death[1:], 1)
    probability = linalg.expm(generator * time)[:, -1]
    mean = probability @ m
    return mean, probability @ m**2 - mean**2
