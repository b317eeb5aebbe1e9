"""Twin-multipole series of the resistance functions of two rigid spheres.

The reflections of a disturbance between two spheres are summed in powers of the inverse centre distance.
A sphere's disturbance is held by its moments P (pressure), Q (swirl) and V of degree n; the moments of order k
on one sphere follow from those of lower order on the other.  Summed over all orders, the moments of degree one
are its force and torque, those of degree two its stresslet.

The series crawls when the spheres nearly touch, so their singular parts are summed in closed form: 1/xi,
ln xi and xi ln xi with the coefficients known from lubrication theory, xi^2 ln xi with one fitted to the tail.

Symbols, as in the papers: lam = a2/a1, s = 2 r/(a1 + a2), xi = s - 2, y = 2/s; C(n + s, n + m) a binomial.

Sources
-------
Jeffrey & Onishi, J. Fluid Mech. 139 (1984) 261: functions A, B, C ("JO").
Jeffrey, Phys. Fluids A 4 (1992) 16: functions G, H, M ("J").
Townsend, Phys. Fluids 35 (2023) 127126, arXiv 1802.08226: corrects misprints of both.  The coefficients
here are those of his list but for one in Y^M_12; all are tested against the tail of the series itself.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

ORDERS = 1000
"""Orders of the series.  Without the singular parts the terms fall as y^k k^-4, and on the way there swing about it."""

NEGLIGIBLE_WEIGHT = 1e-22

P1, Q1, P2 = range(3)
"""The moments that are forces, torques and stresslets, and equally the unit motions that start the reflections:
translation, rotation and strain."""

Coefficients = tuple[float, float, float]
"""Of 1/xi, ln 1/xi and xi ln 1/xi."""
Singular = tuple[Coefficients, Coefficients]
"""Those of the 11 and of the 12 function."""


class Function(NamedTuple):
    """One of the eleven resistance functions: its place in the recursion and its singular parts."""

    azimuth: int
    """m, the azimuthal number of the disturbance about the line of centres: X 0, Y 1, Z 2."""
    motion: int
    moment: int
    unit: float
    """The function's unit in those of 6 pi mu a1^n, over that of the papers."""
    moment_unit: float
    """Value of the function, in the papers' unit, per unit moment."""
    radius_power: int
    """The power of its radius with which a single sphere's resistance grows."""
    sign_other: int
    """Sign of the 12 function relative to the sum over moments."""
    singular: Callable[[float], Singular]
    """lam -> coefficients of (1/xi, ln 1/xi, xi ln 1/xi) of the 11 and of the 12 function (without sign_other)."""

    @property
    def rank_parity(self) -> int:
        """1 where the tensor is odd in the direction d (B and G), which swapping the spheres turns round."""
        return int((self.motion == P1) != (self.moment == P1))


def _xa(lam: float) -> Singular:
    # Townsend (10)-(12).
    g1 = 2 * lam**2
    g2 = lam * (1 + 7 * lam + lam**2) / 5
    g3 = (1 + 18 * lam - 29 * lam**2 + 18 * lam**3 + lam**4) / 42
    return _over_cube(lam, (g1, g2, g3), (g1, g2, g3))


def _ya(lam: float) -> Singular:
    # JO (4.16).
    g2 = 4 * lam * (2 + lam + 2 * lam**2) / 15
    g3 = 2 * (16 - 45 * lam + 58 * lam**2 - 45 * lam**3 + 16 * lam**4) / 375
    return _over_cube(lam, (0, g2, g3), (0, g2, g3))


def _yb(lam: float) -> Singular:
    # JO (5.6).
    g2 = -lam * (4 + lam) / 5 * (1 + lam)
    g3 = -(32 - 33 * lam + 83 * lam**2 + 43 * lam**3) / 250 * (1 + lam)
    return _over_cube(lam, (0, g2, g3), (0, g2, g3))


def _xc(lam: float) -> Singular:
    # Townsend (26), (27).
    g3 = lam**2 / 4 * (1 + lam) ** 2
    return _over_cube(lam, (0, 0, -g3), (0, 0, g3))


def _yc(lam: float) -> Singular:
    # JO (7.10); g5 corrected, Townsend (30).  The 12 coefficients carry (1 + lam)^3/8 as all others of odd order do.
    square = (1 + lam) ** 2
    g2 = 2 * lam / 5 * square
    g3 = (8 + 6 * lam + 33 * lam**2) / 125 * square
    g4 = lam**2 / 10 * square
    g5 = lam * (43 - 24 * lam + 43 * lam**2) / 500 * square
    return _over_cube(lam, (0, g2, g3), (0, g4, g5))


def _xg(lam: float) -> Singular:
    # J (19b).
    g1 = 3 * lam**2
    g2 = 3 * lam * (1 + 12 * lam - 4 * lam**2) / 10
    g3 = (5 + 181 * lam - 453 * lam**2 + 566 * lam**3 - 65 * lam**4) / 140
    return _over_cube(lam, (g1, g2, g3), (g1, g2, g3))


def _yg(lam: float) -> Singular:
    # J (27b).
    g2 = lam * (4 - lam + 7 * lam**2) / 10
    g3 = (32 - 179 * lam + 532 * lam**2 - 356 * lam**3 + 221 * lam**4) / 500
    return _over_cube(lam, (0, g2, g3), (0, g2, g3))


def _yh(lam: float) -> Singular:
    # J (35b).
    g2 = lam * (2 - lam) / 10 * (1 + lam)
    g3 = (16 - 61 * lam + 180 * lam**2 + 2 * lam**3) / 500 * (1 + lam)
    g5 = lam**2 * (1 + 7 * lam) / 20 * (1 + lam)
    g6 = lam * (43 + 147 * lam - 185 * lam**2 + 221 * lam**3) / 1000 * (1 + lam)
    return _over_cube(lam, (0, g2, g3), (0, g5, g6))


def _xm(lam: float) -> Singular:
    # J (48b).
    g1 = 6 * lam**2 / 5
    g2 = 3 * lam * (1 + 17 * lam - 9 * lam**2) / 25
    g3 = (5 + 272 * lam - 831 * lam**2 + 1322 * lam**3 - 415 * lam**4) / 350
    g4 = 6 * lam**3 / 5
    g5 = 3 * lam**2 * (-4 + 17 * lam - 4 * lam**2) / 25
    g6 = lam * (-65 + 832 * lam - 1041 * lam**2 + 832 * lam**3 - 65 * lam**4) / 350
    return _over_cube(lam, (g1, g2, g3), (g4, g5, g6))


def _ym(lam: float) -> Singular:
    # J (64b).
    g2 = 6 * lam * (1 - lam + 4 * lam**2) / 25
    g3 = (24 - 201 * lam + 882 * lam**2 - 1182 * lam**3 + 591 * lam**4) / 625
    g5 = 3 * lam**2 * (7 - 10 * lam + 7 * lam**2) / 50
    # -748 is what the tail of the series shows at every size ratio (see the tests); the -728 of Townsend's list does not fit.
    g6 = 3 * lam * (221 - 748 * lam + 1902 * lam**2 - 748 * lam**3 + 221 * lam**4) / 2500
    return _over_cube(lam, (0, g2, g3), (0, g5, g6))


def _zm(lam: float) -> Singular:
    # J (79b).
    g3 = -3 * (lam**2 + lam**4) / 10
    return _over_cube(lam, (0, 0, g3), (0, 0, -g3))


def _over_cube(lam: float, same: Coefficients, other: Coefficients) -> Singular:
    cube = (1 + lam) ** 3
    (a, b, c), (d, e, f) = same, other
    return (a / cube, b / cube, c / cube), (d / cube, e / cube, f / cube)


# The papers scale A by 6 pi mu a, B and G by 4 pi mu a^2, C and H by 8 pi mu a^3, M by 20 pi mu a^3/3, a = (a_a + a_b)/2.
# Functions from moments: Townsend (9), (21), (29) and, from Ichiki et al. 2013, (94), (105), (115), (120), (125), (131).
# Q is 2/3 of JO's, and is J's of m = 2.
FUNCTIONS: dict[str, Function] = {
    "XA": Function(0, P1, P1, 1.0, 1.0, 1, -1, _xa),
    "YA": Function(1, P1, P1, 1.0, 1.0, 1, -1, _ya),
    "YB": Function(1, P1, Q1, 2 / 3, 3.0, 2, -1, _yb),
    "XC": Function(0, Q1, Q1, 4 / 3, 1.0, 3, 1, _xc),
    "YC": Function(1, Q1, Q1, 4 / 3, 1.0, 3, 1, _yc),
    "XG": Function(0, P1, P2, 2 / 3, 0.75, 2, -1, _xg),
    "YG": Function(1, P1, P2, 2 / 3, 0.75, 2, -1, _yg),
    "YH": Function(1, Q1, P2, 4 / 3, -0.25, 3, 1, _yh),
    "XM": Function(0, P2, P2, 10 / 9, 1.0, 3, 1, _xm),
    "YM": Function(1, P2, P2, 10 / 9, 1.0, 3, 1, _ym),
    "ZM": Function(2, P2, P2, 10 / 9, 1.0, 3, 1, _zm),
}


@njit(cache=True, fastmath={"reassoc", "contract"})
def _moments(m: int, motion: int, fraction: np.ndarray, orders: int) -> np.ndarray:
    """The moments P1, Q1, P2 on either sphere at each order.

    Townsend (5)-(8), (18); JO (4.6)-(4.11), (7.3)-(7.5); J (58), (73)-(76).
    The papers' P_npq are summed over p + q = k with the weights fraction^p, fraction^q of the two radii, which leaves
    one index less.  A row j = n + k is kept together: all that a row needs lies in earlier ones.  One recursion
    serves all azimuthal numbers, with Q scaled so that P and Q are coupled by m alone.

    m : azimuthal number; motion : P1, Q1 or P2; fraction : (2,) each radius over the sum of both
    Returns (2, 3, orders + 1): sphere, moment, order.
    """
    spheres = 1 if fraction[0] == fraction[1] else 2  # the moments of equal spheres are equal
    degrees, rows = orders // 2 + 4, orders + 3
    sign = -1.0 if m % 2 else 1.0
    log_factorial = np.zeros(2 * degrees)
    for i in range(2, 2 * degrees):
        log_factorial[i] = log_factorial[i - 1] + np.log(i)
    first = max(m, 1)

    weight = np.zeros((spheres, degrees, degrees))
    pressure_weight = np.zeros((spheres, degrees, degrees))
    start = np.full((spheres, degrees), degrees)
    stop = np.zeros((spheres, degrees), dtype=np.int64)
    for a in range(spheres):
        for n in range(first, degrees):
            for s in range(first, degrees):
                binomial = log_factorial[n + s] - log_factorial[n + m] - log_factorial[s - m]
                w = sign * np.exp(binomial + n * np.log(fraction[a]) + s * np.log(fraction[1 - a]))
                if abs(w) > NEGLIGIBLE_WEIGHT:
                    start[a, n], stop[a, n] = min(start[a, n], s), s + 1
                ns = n * s * (2 * n * s - n - s + 2) + m * m * (2 * n * s - 4 * s - 4 * n + 2)
                weight[a, n, s] = w
                pressure_weight[a, n, s] = w * (2 * n + 1) * ns / (2.0 * (n + 1) * s * (n + s) * (2 * s - 1))

    pressure = np.zeros((spheres, rows, degrees))
    pressure_over_s = np.zeros((spheres, rows, degrees))
    swirl = np.zeros((spheres, rows, degrees))
    swirl_times_s = np.zeros((spheres, rows, degrees))
    velocity_over_s = np.zeros((spheres, rows, degrees))  # V_s/(2 s + 1)
    for j in range(1, rows):
        for a in range(spheres):
            b, own, other = (1 - a) % spheres, fraction[a], fraction[1 - a]
            for n in range(first, min(degrees - 1, j) + 1):
                p, q, v = 0.0, 0.0, 0.0
                if j == n:
                    if motion == Q1 and n == 1:
                        q = 1.0
                    elif (motion == P1 and n == 1) or (motion == P2 and n == 2):
                        p = v = 1.0
                else:
                    row = j - 2 * n
                    low, high = start[a, n], min(stop[a, n], row // 2 + 3)
                    p_of_p, p_of_v, p_of_q, q_of_p, q_of_q, v_of_p = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                    if row + 1 >= 1:
                        for s in range(low, high):
                            p_of_p += pressure_weight[a, n, s] * pressure[b, row + 1, s]
                    if row >= 1:
                        for s in range(low, high):
                            p_of_q += weight[a, n, s] * swirl[b, row, s]
                            q_of_p += weight[a, n, s] * pressure_over_s[b, row, s]
                    if row - 1 >= 1:
                        for s in range(low, high):
                            v_of_p += weight[a, n, s] * pressure[b, row - 1, s]
                            p_of_v += weight[a, n, s] * velocity_over_s[b, row - 1, s]
                            q_of_q += weight[a, n, s] * swirl_times_s[b, row - 1, s]
                    square = 4.0 * n * n - 1.0
                    p = (
                        p_of_p / own
                        - n * (2 * n - 1) / (2.0 * (n + 1)) * own * v_of_p
                        - n * square / (2.0 * (n + 1)) * other**2 / own * p_of_v
                        + m * square / (n + 1) * other / own * p_of_q
                    )
                    q = m / (n * (n + 1.0)) * q_of_p - other / (n + 1) * q_of_q
                    v = p - 2.0 * n / ((n + 1) * (2 * n + 3)) * own * v_of_p
                pressure[a, j, n], pressure_over_s[a, j, n] = p, p / n
                swirl[a, j, n], swirl_times_s[a, j, n] = q, q * n
                velocity_over_s[a, j, n] = v / (2 * n + 1)

    out = np.zeros((2, 3, orders + 1))
    for sphere in range(2):
        a = sphere % spheres
        for k in range(orders + 1):
            out[sphere, P1, k] = pressure[a, k + 1, 1]
            out[sphere, Q1, k] = swirl[a, k + 1, 1]
            out[sphere, P2, k] = pressure[a, k + 2, 2]
    return out


def _logarithm_coefficients(power: int, parity: int, orders: int) -> np.ndarray:
    """Power series in y of -(1 - y^2)^power ln(1 - y^2) (even) or (1 - y^2)^power ln((1 + y)/(1 - y)) (odd)."""
    k = np.arange(orders + 1)
    coefficients = np.where((k % 2 == parity) & (k > 0), 2.0 / np.maximum(k, 1), 0.0)
    for _ in range(power):
        coefficients[2:] = coefficients[2:] - coefficients[:-2]
    return coefficients


class Series(NamedTuple):
    """A resistance function as singular parts plus a power series in y = (a1 + a2)/r."""

    parity: int
    inverse: float
    """Coefficient of 1/(1 - y^2), or y/(1 - y^2) for odd parity."""
    logarithms: tuple[float, ...]
    """Coefficients of (1 - y^2)^j L, j = 0, 1, 2, with L = -ln(1 - y^2), or ln((1 + y)/(1 - y)) for odd parity."""
    remainder: np.ndarray
    """Coefficients of what is left."""
    full: np.ndarray
    """Coefficients of the whole, for large distances."""


def _series(coefficients: np.ndarray, parity: int, singular: tuple[float, float, float]) -> Series:
    orders = len(coefficients) - 1
    k = np.arange(orders + 1)
    of_parity = k % 2 == parity
    full = np.where(of_parity, coefficients, 0.0)
    remainder = np.where(of_parity, full - singular[0], 0.0)
    logarithms = list(singular[1:])
    for power, g in enumerate(logarithms):
        remainder -= g * _logarithm_coefficients(power, parity, orders)
    tail = of_parity & (k > orders // 2)
    next_logarithm = _logarithm_coefficients(2, parity, orders)
    weight = k[tail] ** 3.0  # the fitted coefficients decay as k^-3
    g = np.sum(remainder[tail] * next_logarithm[tail] * weight**2) / np.sum(
        (next_logarithm[tail] * weight) ** 2
    )
    remainder -= g * next_logarithm
    return Series(parity, singular[0], (*logarithms, g), remainder, full)


@cache
def series(ratio: float, orders: int = ORDERS) -> dict[str, Series]:
    """All 44 functions, XA11, XA12, XA21, XA22, YA11 ... ZM22, of two spheres with a2/a1 = ratio, in units 6 pi mu a1^n."""
    fraction = np.array([1.0, ratio]) / (1.0 + ratio)
    moments: dict[tuple[int, int], np.ndarray] = {}
    found: dict[str, Series] = {}
    for name, f in FUNCTIONS.items():
        start = (f.azimuth, f.motion)
        if start not in moments:
            moments[start] = _moments(f.azimuth, f.motion, fraction, orders)
        for sphere, own, other in ((0, "11", "12"), (1, "22", "21")):
            lam = (ratio, 1.0 / ratio)[sphere]
            radius = (1.0, ratio)[sphere]
            unit = f.unit * radius**f.radius_power
            if sphere == 1 and f.rank_parity:
                unit = -unit  # d points towards this sphere
            same_singular, other_singular = f.singular(lam)
            same = f.moment_unit * moments[start][sphere, f.moment]
            # Rotation and strain of the other sphere move its surface in proportion to its own radius.
            cross = same if f.motion == P1 else lam * same
            found[name + own] = _scaled(_series(same, f.rank_parity, same_singular), unit)
            found[name + other] = _scaled(
                _series(cross, 1 - f.rank_parity, other_singular), unit * f.sign_other
            )
    return {name + pair: found[name + pair] for name in FUNCTIONS for pair in ("11", "12", "21", "22")}


def _scaled(part: Series, factor: float) -> Series:
    return Series(
        part.parity,
        factor * part.inverse,
        tuple(factor * g for g in part.logarithms),
        factor * part.remainder,
        factor * part.full,
    )


def evaluate(part: Series, gap: np.ndarray, ratio: float) -> np.ndarray:
    """The function at the gaps (r - a1 - a2)/a1 > 0."""
    xi = 2.0 * np.asarray(gap, dtype=float) / (1.0 + ratio)
    y = 2.0 / (2.0 + xi)
    w = xi * (4.0 + xi) / (2.0 + xi) ** 2  # 1 - y^2, without cancellation at contact
    logarithm = np.log((4.0 + xi) / xi) if part.parity else -np.log(w)
    singular = part.inverse * (y if part.parity else 1.0) / w
    for power, g in enumerate(part.logarithms):
        singular = singular + g * w**power * logarithm
    return singular + np.polynomial.polynomial.polyval(y, part.remainder)
