"""Two rigid spheres in a Stokes flow: exact resistance, far-field resistance, and what the second lacks of the first.

Forces, torques and stresslets F, T, S are those the spheres exert on the fluid; d is the unit vector from sphere 1
to sphere 2 in all four blocks ab = 11, 12, 21, 22; u, omega, E belong to the ambient flow at the spheres' centres:

    F_a = sum_b  A^ab (U_b - u)  +  Bt^ab (Omega_b - omega)  +  Gt^ab : (-E)
    T_a = sum_b  B^ab (U_b - u)  +  C^ab  (Omega_b - omega)  +  Ht^ab : (-E)
    S_a = sum_b  G^ab (U_b - u)  +  H^ab  (Omega_b - omega)  +  M^ab  : (-E)

with transposes Bt^ab_ij = B^ba_ji, Gt^ab_ijk = G^ba_jki, Ht^ab_ijk = H^ba_jki (Kim & Karrila 1991, ch. 11; Jeffrey 1992,
eq. 1-5), and

    A_ij   = XA d_i d_j + YA (delta_ij - d_i d_j)                   C_ij alike with XC, YC
    B_ij   = YB eps_ijk d_k
    G_ijk  = XG (d_i d_j - delta_ij/3) d_k + YG (d_i delta_jk + d_j delta_ik - 2 d_i d_j d_k)
    H_ijk  = YH (d_i eps_jkm + d_j eps_ikm) d_m
    M_ijkl = XM m0 + YM m1 + ZM m2      (projections of strain on azimuthal numbers 0, 1, 2 about d)

Units: lengths a1, resistances 6 pi mu a1^n; a single sphere has XA11 = YA11 = 1, XC11 = YC11 = 4/3, XM11 = YM11 = ZM11 = 10/9.
`ratio` is a2/a1 and `gap` the distance between the surfaces, (r - a1 - a2)/a1.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline

from mcdem.hydrodynamics import twin_multipoles
from mcdem.hydrodynamics.twin_multipoles import FUNCTIONS

PAIRS = ("11", "12", "21", "22")
NAMES = tuple(function + pair for function in FUNCTIONS for pair in PAIRS)


def exact(gap: np.ndarray | float, ratio: float = 1.0) -> dict[str, np.ndarray]:
    """All 44 resistance functions at gaps > 0, summed from the twin-multipole series: name -> array like gap."""
    series = twin_multipoles.series(float(ratio))
    return {
        name: twin_multipoles.evaluate(series[name], np.asarray(gap, dtype=float), ratio) for name in NAMES
    }


def far_field(gap: np.ndarray | float, ratio: float = 1.0) -> dict[str, np.ndarray]:
    """The same functions from the pair mobility of forces, torques and stresslets alone, inverted.

    Spheres that overlap count as touching.
    """
    distance = 1.0 + ratio + np.maximum(np.asarray(gap, dtype=float), 0.0)
    inverse_distance = (1.0 / distance)[..., None, None]
    return _scalars(
        [
            np.linalg.inv(sum(inverse_distance**order * block for order, block in enumerate(orders)))
            for orders in _mobility_orders(ratio)
        ]
    )


def difference(gap: np.ndarray | float, ratio: float = 1.0) -> dict[str, np.ndarray]:
    """exact - far_field: what the moments beyond the stresslet, and so lubrication, add to the resistance of a pair."""
    gap = np.asarray(gap, dtype=float)
    y = (1.0 + ratio) / (1.0 + ratio + gap)
    near = np.where(y > FAR, gap, 1.0)
    whole, far = exact(near, ratio), far_field(near, ratio)
    orders = _difference_orders(float(ratio))
    return {
        name: np.where(
            y > FAR,
            whole[name] - far[name],
            np.polynomial.polynomial.polyval(y, orders[name]) * y**LEADING_ORDER,
        )
        for name in NAMES
    }


LEADING_ORDER = 6
"""A force's disturbance of a sphere beyond its stresslet falls as r^-3 and returns as r^-3."""
FAR = 0.5
"""Value of y = (a1 + a2)/r below which differences are summed order by order, without cancellation."""
FAR_ORDERS = 80


@cache
def _difference_orders(ratio: float) -> dict[str, np.ndarray]:
    """Coefficients of y^(LEADING_ORDER + k), y = (a1 + a2)/r, in exact - far_field."""
    resistances = []
    for mobility in _mobility_orders(ratio):
        resistance = np.zeros((FAR_ORDERS + 1, *mobility.shape[1:]))
        resistance[0] = np.linalg.inv(mobility[0])
        for k in range(1, FAR_ORDERS + 1):
            reflected = sum(mobility[j] @ resistance[k - j] for j in range(1, min(k, len(mobility) - 1) + 1))
            resistance[k] = -resistance[0] @ reflected
        resistances.append(resistance)
    far = _scalars(resistances)
    to_y = (1.0 + ratio) ** -np.arange(FAR_ORDERS + 1.0)
    whole = twin_multipoles.series(ratio)
    return {name: (whole[name].full[: FAR_ORDERS + 1] - far[name] * to_y)[LEADING_ORDER:] for name in NAMES}


def _mobility_orders(ratio: float) -> list[np.ndarray]:
    """Pair mobility in blocks of azimuthal number about the line of centres, by powers 0 to 5 of 1/r.

    With d along z: forces and torques in components, stresslets and rates of strain in those of the orthonormal
    tensors (2zz - xx - yy)/sqrt 6, (xz + zx)/sqrt 2, (xy + yx)/sqrt 2.  Blocks and the order of their rows:
    [F1z F2z S1 S2], [T1z T2z], [F1x F2x T1y T2y S1 S2], [S1 S2]; each (6, n, n), units 1/(6 pi mu a1^n).

    Off-diagonal entries are what Faxen's laws give on one sphere for the flow of a force (with its source dipole),
    torque or stresslet (with its quadrupole) on the other: Durlofsky, Brady & Bossis, J. Fluid Mech. 180 (1987) 21,
    section 2, there for equal spheres; the strain induced by a stresslet on the other sphere enters as it stands, for
    a sphere's own stresslet answers the sum of it and the ambient rate of strain.
    """
    squares = 1.0 + ratio**2
    axial, axial_rotation = np.zeros((6, 4, 4)), np.zeros((6, 2, 2))
    transverse, planar = np.zeros((6, 6, 6)), np.zeros((6, 2, 2))
    for sphere, radius in enumerate((1.0, ratio)):
        translation, rotation, strain = 1 / radius, 3 / (4 * radius**3), 9 / (10 * radius**3)
        axial[0, sphere, sphere], axial[0, 2 + sphere, 2 + sphere] = translation, strain
        axial_rotation[0, sphere, sphere] = rotation
        for quantity, mobility in enumerate((translation, rotation, strain)):
            transverse[0, 2 * quantity + sphere, 2 * quantity + sphere] = mobility
        planar[0, sphere, sphere] = strain

    def couple(block: np.ndarray, row: int, column: int, by_order: dict[int, float]) -> None:
        for order, value in by_order.items():
            block[order, row, column] = block[order, column, row] = value

    couple(axial, 0, 1, {1: 3 / 2, 3: -squares / 2})
    couple(axial, 2, 3, {3: -9 / 2, 5: 27 / 5 * squares})
    couple(axial_rotation, 0, 1, {3: 3 / 4})
    couple(transverse, 0, 1, {1: 3 / 4, 3: squares / 4})
    couple(transverse, 2, 3, {3: -3 / 8})
    couple(transverse, 4, 5, {3: 9 / 4, 5: -18 / 5 * squares})
    couple(planar, 0, 1, {5: 9 / 10 * squares})
    for forced, moved, along in (
        (0, 1, 1.0),
        (1, 0, -1.0),
    ):  # along: d points away from the forced sphere, or to it
        radii = (1.0, ratio)
        size = radii[forced] ** 2 / 6 + radii[moved] ** 2 / 10
        couple(axial, 2 + moved, forced, {2: -along * 1.5 * np.sqrt(1.5), 4: along * 9 * np.sqrt(1.5) * size})
        couple(transverse, 2 + moved, forced, {2: -along * 3 / 4})
        couple(transverse, 4 + moved, forced, {4: -along * 4.5 * np.sqrt(2) * size})
        couple(transverse, 4 + moved, 2 + forced, {3: -np.sqrt(2) * 9 / 8})
    return [axial, axial_rotation, transverse, planar]


def _scalars(blocks: list[np.ndarray]) -> dict[str, np.ndarray]:
    """The 44 functions from resistances in the blocks of `_mobility_orders`."""
    axial, axial_rotation, transverse, planar = blocks
    # function: block, first row (F, T or S), first column (U, Omega or E), component of the tensor form there
    places = {
        "XA": (axial, 0, 0, 1.0),
        "YA": (transverse, 0, 0, 1.0),
        "YB": (transverse, 2, 0, -1.0),
        "XC": (axial_rotation, 0, 0, 1.0),
        "YC": (transverse, 2, 2, 1.0),
        "XG": (axial, 2, 0, np.sqrt(2 / 3)),
        "YG": (transverse, 4, 0, np.sqrt(2)),
        "YH": (transverse, 4, 2, np.sqrt(2)),
        "XM": (axial, 2, 2, 1.0),
        "YM": (transverse, 4, 4, 1.0),
        "ZM": (planar, 0, 0, 1.0),
    }
    return {
        f"{name}{a + 1}{b + 1}": block[..., row + a, column + b] / component
        for name, (block, row, column, component) in places.items()
        for a in range(2)
        for b in range(2)
    }


STRAIN_BASIS = np.array(
    [
        np.array([[1, 0, 0], [0, -1, 0], [0, 0, 0]]) / np.sqrt(2),
        np.array([[-1, 0, 0], [0, -1, 0], [0, 0, 2]]) / np.sqrt(6),
        np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0]]) / np.sqrt(2),
        np.array([[0, 0, 1], [0, 0, 0], [1, 0, 0]]) / np.sqrt(2),
        np.array([[0, 0, 0], [0, 0, 1], [0, 1, 0]]) / np.sqrt(2),
    ]
)
"""(5, 3, 3) orthonormal symmetric traceless tensors in which stresslets and rates of strain have five components."""


def resistance_matrix(
    direction: np.ndarray, gap: float, ratio: float = 1.0, functions: Callable = exact
) -> np.ndarray:
    """(22, 22) symmetric resistance of one pair: (F1 F2 T1 T2 S1 S2) from (U1-u U2-u Omega1-w Omega2-w -E1 -E2).

    direction : (3,) from sphere 1 to sphere 2, of any length
    functions : `exact`, `far_field` or `difference`
    """
    scalars = functions(gap, ratio)
    d = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    one, dd = np.eye(3), np.outer(d, d)
    permutation = np.zeros((3, 3, 3))
    for i in range(3):
        permutation[i, (i + 1) % 3, (i + 2) % 3], permutation[i, (i + 2) % 3, (i + 1) % 3] = 1.0, -1.0
    cross = permutation @ d  # eps_ijk d_k
    turned = dd - one / 3
    m1 = 0.5 * (_both_pairs(dd, one) - 4 * np.multiply.outer(dd, dd))
    m0 = 1.5 * np.multiply.outer(turned, turned)
    identity = 0.5 * (np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one))
    m2 = identity - np.multiply.outer(one, one) / 3 - m0 - m1

    out = np.zeros((22, 22))
    for a in range(2):
        for b in range(2):
            pair = f"{a + 1}{b + 1}"
            f = {name: float(scalars[name + pair]) for name in FUNCTIONS}
            velocity_b, spin_b, strain_b = (
                slice(3 * b, 3 * b + 3),
                slice(6 + 3 * b, 9 + 3 * b),
                slice(12 + 5 * b, 17 + 5 * b),
            )
            force_a, torque_a, stresslet_a = (
                slice(3 * a, 3 * a + 3),
                slice(6 + 3 * a, 9 + 3 * a),
                slice(12 + 5 * a, 17 + 5 * a),
            )
            g = f["XG"] * np.multiply.outer(turned, d) + f["YG"] * (
                np.einsum("i,jk->ijk", d, one) + np.einsum("j,ik->ijk", d, one) - 2 * np.multiply.outer(dd, d)
            )
            # d_i eps_jkm d_m + d_j eps_ikm d_m
            h = f["YH"] * (np.einsum("i,jk->ijk", d, cross) + np.einsum("j,ik->ijk", d, cross))
            m = f["XM"] * m0 + f["YM"] * m1 + f["ZM"] * m2
            out[force_a, velocity_b] = f["XA"] * dd + f["YA"] * (one - dd)
            out[torque_a, velocity_b] = f["YB"] * cross
            out[velocity_b, torque_a] = out[torque_a, velocity_b].T
            out[torque_a, spin_b] = f["XC"] * dd + f["YC"] * (one - dd)
            out[stresslet_a, velocity_b] = np.einsum("pij,ijk->pk", STRAIN_BASIS, g)
            out[velocity_b, stresslet_a] = out[stresslet_a, velocity_b].T
            out[stresslet_a, spin_b] = np.einsum("pij,ijk->pk", STRAIN_BASIS, h)
            out[spin_b, stresslet_a] = out[stresslet_a, spin_b].T
            out[stresslet_a, strain_b] = np.einsum("pij,ijkl,qkl->pq", STRAIN_BASIS, m, STRAIN_BASIS)
    return out


def _both_pairs(dd: np.ndarray, one: np.ndarray) -> np.ndarray:
    """d_i d_k delta_jl + d_j d_k delta_il + d_i d_l delta_jk + d_j d_l delta_ik."""
    return (
        np.einsum("ik,jl->ijkl", dd, one)
        + np.einsum("jk,il->ijkl", dd, one)
        + np.einsum("il,jk->ijkl", dd, one)
        + np.einsum("jl,ik->ijkl", dd, one)
    )


# The table of differences for compiled code.

EQUAL_COLUMNS = tuple(function + pair for function in FUNCTIONS for pair in ("11", "12"))
UNEQUAL_COLUMNS = NAMES
SMALLEST_GAP = 1e-8
INTERVALS = 512


class LubricationTable(NamedTuple):
    """Cubics of the differences exact - far_field, uniform in ln(1 - y), y = (a1 + a2)/r, from gap 1e-8 to infinity.

    What is interpolated is bounded and smooth: difference/y^6, and for XA, XG and XM that times 1 - y.
    """

    contact: float
    """(a1 + a2)/a1"""
    smallest_gap: float
    start: float
    inverse_step: float
    coefficients: np.ndarray
    """(intervals, 4, columns)"""
    squeezed: np.ndarray
    """(columns,) 1 for the functions that diverge as 1/gap, else 0"""


def lubrication_columns(ratio: float = 1.0) -> tuple[str, ...]:
    """Names of the table's columns: 11 and 12 of each function for equal spheres, else 11, 12, 21 and 22."""
    return EQUAL_COLUMNS if ratio == 1.0 else UNEQUAL_COLUMNS


@cache
def lubrication_table(ratio: float = 1.0) -> LubricationTable:
    """Table of the differences for spheres of a2/a1 = ratio; its columns are `lubrication_columns(ratio)`."""
    columns = lubrication_columns(ratio)
    contact = 1.0 + ratio
    start = np.log(SMALLEST_GAP / (contact + SMALLEST_GAP))
    v = np.linspace(start, 0.0, INTERVALS + 1)
    y = -np.expm1(v)
    squeezed = np.array([name[:2] in ("XA", "XG", "XM") for name in columns], dtype=float)
    near = y > FAR
    values = np.empty((INTERVALS + 1, len(columns)))
    differences = difference(contact * np.exp(v[near]) / y[near], ratio)
    orders = _difference_orders(float(ratio))
    for column, name in enumerate(columns):
        values[near, column] = differences[name] / y[near] ** LEADING_ORDER
        values[~near, column] = np.polynomial.polynomial.polyval(y[~near], orders[name])
    values *= np.where(squeezed == 1.0, np.exp(v)[:, None], 1.0)
    step = v[1] - v[0]
    spline = CubicSpline(v, values, axis=0)
    coefficients = np.stack([spline.c[3 - power] * step**power for power in range(4)], axis=1)
    return LubricationTable(
        contact, SMALLEST_GAP, float(start), float(1.0 / step), np.ascontiguousarray(coefficients), squeezed
    )


@njit(cache=True)
def lubrication_scalars(gap: float, table: LubricationTable, out: np.ndarray) -> None:
    """Fill out[:columns] with the differences at this gap; gaps below `smallest_gap`, overlap too, count as that."""
    h = max(gap, table.smallest_gap)
    r = table.contact + h
    y = table.contact / r
    place = (np.log(h / r) - table.start) * table.inverse_step
    interval = min(int(place), table.coefficients.shape[0] - 1)
    t = place - interval
    decay = y * y * y * y * y * y
    divergence = r / h - 1.0
    c = table.coefficients[interval]
    for column in range(c.shape[1]):
        value = c[0, column] + t * (c[1, column] + t * (c[2, column] + t * c[3, column]))
        out[column] = value * decay * (1.0 + divergence * table.squeezed[column])
