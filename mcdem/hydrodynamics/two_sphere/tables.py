"""Two rigid spheres in a Stokes flow: exact resistance, far-field resistance, and what the second lacks of the first.

Forces, torques and stresslets F, T, S are those the spheres exert on the fluid; d is the unit vector from sphere 1
to sphere 2 in all four blocks ab = 11, 12, 21, 22; u, omega, E belong to the ambient flow at the spheres' centres:

    F_a = sum_b  A^ab (U_b - u)  +  Bt^ab (Omega_b - omega)  +  Gt^ab : (-E)
    T_a = sum_b  B^ab (U_b - u)  +  C^ab  (Omega_b - omega)  +  Ht^ab : (-E)
    S_a = sum_b  G^ab (U_b - u)  +  H^ab  (Omega_b - omega)  +  M^ab  : (-E)

with transposes Bt^ab_ij = B^ba_ji, Gt^ab_ijk = G^ba_jki, Ht^ab_ijk = H^ba_jki (Kim & Karrila 1991, ch. 11; Jeffrey
1992), and

    A_ij   = XA d_i d_j + YA (delta_ij - d_i d_j)                   C_ij alike with XC, YC
    B_ij   = YB eps_ijk d_k
    G_ijk  = XG (d_i d_j - delta_ij/3) d_k + YG (d_i delta_jk + d_j delta_ik - 2 d_i d_j d_k)
    H_ijk  = YH (d_i eps_jkm + d_j eps_ikm) d_m
    M_ijkl = XM m0 + YM m1 + ZM m2      (m0, m1, m2 project strain on azimuthal numbers 0, 1, 2 about d)

Units: lengths a1, resistances 6 pi mu a1^n; a single sphere has XA11 = YA11 = 1, XC11 = YC11 = 4/3, XM11 = YM11 = ZM11 = 10/9.
`ratio` is a2/a1 and `gap` the distance between the surfaces, (r - a1 - a2)/a1.
"""

from __future__ import annotations

import contextlib
import hashlib
import tempfile
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
from numba import njit

from mcdem.compilation import compiled
from mcdem.compiled_once import one_at_a_time
from mcdem.hydrodynamics.two_sphere import far_field as pair_mobility
from mcdem.hydrodynamics.two_sphere import tensors as pair_tensors
from mcdem.hydrodynamics.two_sphere import twin_multipoles
from mcdem.hydrodynamics.two_sphere.twin_multipoles import FUNCTIONS

NAMES = tuple(function + pair for function in FUNCTIONS for pair in ("11", "12", "21", "22"))

LEADING_ORDER = 6
"""What a sphere's force does to another beyond force, torque and stresslet falls as r^-3, and returns as r^-3."""
FAR = 0.5
"""Value of y = (a1 + a2)/r below which differences are summed order by order, without cancellation."""
FAR_ORDERS = 80


def exact(gap: np.ndarray | float, ratio: float = 1.0) -> dict[str, np.ndarray]:
    """All 44 resistance functions at gaps > 0, summed from the twin-multipole series: name -> array like gap."""
    series = twin_multipoles.series(float(ratio))
    return {
        name: twin_multipoles.evaluate(series[name], np.asarray(gap, dtype=float), ratio) for name in NAMES
    }


def far_field(gap: np.ndarray | float, ratio: float = 1.0) -> dict[str, np.ndarray]:
    """The same from the pair mobility of forces, torques and stresslets alone, inverted; overlap counts as contact."""
    return pair_mobility.resistance(1.0 + ratio + np.maximum(np.asarray(gap, dtype=float), 0.0), ratio)


def difference(gap: np.ndarray | float, ratio: float = 1.0) -> dict[str, np.ndarray]:
    """exact - far_field: what the moments beyond the stresslet, and so lubrication, add to the resistance of a pair."""
    gap = np.asarray(gap, dtype=float)
    y = (1.0 + ratio) / (1.0 + ratio + gap)
    near = y > FAR
    whole, far = (functions(np.where(near, gap, 1.0), ratio) for functions in (exact, far_field))
    return {
        name: np.where(
            near, whole[name] - far[name], y**LEADING_ORDER * np.polynomial.polynomial.polyval(y, orders)
        )
        for name, orders in _difference_orders(float(ratio)).items()
    }


@cache
def _difference_orders(ratio: float) -> dict[str, np.ndarray]:
    """Coefficients of y^(LEADING_ORDER + k), y = (a1 + a2)/r, in exact - far_field."""
    whole, far = twin_multipoles.series(ratio), pair_mobility.resistance_orders(ratio, FAR_ORDERS)
    to_y = (1.0 + ratio) ** -np.arange(FAR_ORDERS + 1.0)
    return {name: (whole[name].full[: FAR_ORDERS + 1] - far[name] * to_y)[LEADING_ORDER:] for name in NAMES}


def resistance_matrix(
    direction: np.ndarray,
    gap: float,
    ratio: float = 1.0,
    functions: Callable[[float, float], dict[str, np.ndarray]] = exact,
) -> np.ndarray:
    """(22, 22) symmetric resistance of one pair: (F1 F2 T1 T2 S1 S2) from (U1-u U2-u Omega1-w Omega2-w -E1 -E2).

    direction : (3,) from sphere 1 to sphere 2, of any length; functions : `exact`, `far_field` or `difference`.
    Stresslets and rates of strain are components on `pair_tensors.STRAIN_BASIS`.
    """
    return pair_tensors.assemble(direction, functions(gap, ratio))


# The differences, tabulated for compiled code.

SMALLEST_GAP = 1e-8
INTERVALS = 512
SQUEEZED = ("XA", "XG", "XM")
"""Functions that diverge as 1/gap."""
STRETCH = 6.0
"""Puts most of the intervals that a logarithm would spend near contact to gaps between a/10 and 10 a."""


class LubricationTable(NamedTuple):
    """Cubic splines of the differences exact - far_field from gap 1e-8 to infinity, for `lubrication_scalars`.

    With y = (a1 + a2)/r, what is interpolated is smooth and bounded: difference/y^6, and for XA, XG and XM
    that times 1 - y; the intervals are uniform in ln(1 - y) - STRETCH y.
    """

    contact: float
    """(a1 + a2)/a1"""
    smallest_gap: float
    stretch: float
    start: float
    inverse_step: float
    coefficients: np.ndarray
    """(intervals, 4, columns)"""
    squeezed: np.ndarray
    """(columns,) 1 for the functions that diverge as 1/gap, else 0"""
    single: bool = True
    radii: None = None
    """As this is a single table, there are none to choose by (`SpeciesTables`)."""


class SpeciesTables(NamedTuple):
    """`LubricationTable` of each pair of species s <= t of a suspension of several radii, in units of the radius of s.

    Arrays begin with the pair, at t (t + 1)/2 + s; all 44 functions have a column, those of equal spheres too.
    """

    contact: np.ndarray
    smallest_gap: float
    stretch: float
    start: np.ndarray
    inverse_step: np.ndarray
    coefficients: np.ndarray
    """(pairs, intervals, 4, 44)"""
    squeezed: np.ndarray
    """(44,)"""
    single: None
    radii: np.ndarray
    """(S,) of the species"""


def lubrication_columns(ratio: float = 1.0) -> tuple[str, ...]:
    """Names of the table's columns: 11 and 12 of each function for equal spheres, else 11, 12, 21 and 22."""
    return tuple(name for name in NAMES if ratio != 1.0 or name[2] == "1")


@cache
def lubrication_table(ratio: float = 1.0) -> LubricationTable:
    """Table of the differences for spheres of a2/a1 = ratio; its columns are `lubrication_columns(ratio)`.

    Kept beside the compiled kernels from the first call on (about a second), under a name that changes with the
    sources and the ratio; a file that cannot be read is made again, and one that cannot be written is done without.
    """
    sources = sorted(Path(__file__).parent.glob("*.py"))
    digest = hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:16]
    kept = Path(numba.config.CACHE_DIR) / f"two_sphere_{float(ratio)!r}_{digest}.npz"
    table = _stored(kept)
    if table is not None:
        return table
    with one_at_a_time(kept.with_suffix(".lock")):
        table = _stored(kept)  # another process may have made it
        return _store(_tabulate(float(ratio)), kept) if table is None else table


def _stored(kept: Path) -> LubricationTable | None:
    """The table in a file; None if it cannot be read."""
    try:
        with kept.open("rb") as file, np.load(file) as stored:
            return LubricationTable(*(stored[field][()] for field in _STORED))
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile):
        return None


def _store(table: LubricationTable, kept: Path) -> LubricationTable:
    """Keep a table in a file, where one can be written."""
    with contextlib.suppress(OSError):
        with tempfile.NamedTemporaryFile(dir=kept.parent, suffix=".npz", delete=False) as unfinished:
            np.savez(unfinished, **{field: getattr(table, field) for field in _STORED})
        Path(unfinished.name).replace(kept)
    return table


_STORED = tuple(field for field in LubricationTable._fields if field not in ("single", "radii"))

CHANGES_SIGN = ("YB", "XG", "YG")
"""Functions that change their sign when the two spheres change places; for equal ones X22 = X11 and X21 = X12 but for it."""


@cache
def lubrication_tables(radii: tuple[float, ...]) -> LubricationTable | SpeciesTables:
    """What a suspension of these radii needs: the table of equal spheres, or of several radii that of every pair of them."""
    if len(radii) == 1:
        return lubrication_table(1.0)
    pairs = [lubrication_table(radii[t] / radii[s]) for t in range(len(radii)) for s in range(t + 1)]
    equal = lubrication_columns(1.0)
    signs = np.array([-1.0 if name[2] == "2" and name[:2] in CHANGES_SIGN else 1.0 for name in NAMES])
    # X21 is X12 and X22 is X11: the column of each name in the table of equal spheres.
    mirrored = [equal.index(name[:2] + {"21": "12", "22": "11"}.get(name[2:], name[2:])) for name in NAMES]
    return SpeciesTables(
        np.array([pair.contact for pair in pairs]),
        SMALLEST_GAP,
        STRETCH,
        np.array([pair.start for pair in pairs]),
        np.array([pair.inverse_step for pair in pairs]),
        np.stack(
            [
                pair.coefficients
                if pair.coefficients.shape[2] == len(NAMES)
                else pair.coefficients[:, :, mirrored] * signs
                for pair in pairs
            ]
        ),
        np.array([name[:2] in SQUEEZED for name in NAMES], dtype=float),
        None,
        np.array(radii),
    )


def _tabulate(ratio: float) -> LubricationTable:
    from scipy.interpolate import CubicSpline  # slow to import, and seldom needed

    columns = lubrication_columns(ratio)
    contact = 1.0 + ratio
    squeezed = np.array([name[:2] in SQUEEZED for name in columns], dtype=float)
    log_start = np.log(SMALLEST_GAP / (contact + SMALLEST_GAP))
    place = np.linspace(log_start + STRETCH * np.expm1(log_start), 0.0, INTERVALS + 1)
    log_gap = np.minimum(place + STRETCH, 0.0)  # ln(1 - y), by Newton from above; the function is convex
    for _ in range(50):
        log_gap -= (log_gap + STRETCH * np.expm1(log_gap) - place) / (1.0 + STRETCH * np.exp(log_gap))
    y = -np.expm1(log_gap)

    near = y > FAR
    differences = difference(contact * np.exp(log_gap[near]) / y[near], ratio)
    orders = _difference_orders(ratio)
    values = np.empty((INTERVALS + 1, len(columns)))
    for column, name in enumerate(columns):
        values[near, column] = differences[name] / y[near] ** LEADING_ORDER
        values[~near, column] = np.polynomial.polynomial.polyval(y[~near], orders[name])
    values *= np.where(squeezed == 1.0, np.exp(log_gap)[:, None], 1.0)
    step = place[1] - place[0]
    spline = CubicSpline(place, values).c[::-1]  # (4, intervals, columns), lowest power first
    coefficients = np.ascontiguousarray(np.moveaxis(spline, 0, 1)) * step ** np.arange(4.0)[:, None]
    return LubricationTable(
        contact, SMALLEST_GAP, STRETCH, float(place[0]), float(1.0 / step), coefficients, squeezed
    )


@compiled
def lubrication_scalars(gap: float, table: LubricationTable, out: np.ndarray) -> None:
    """Fill out[:columns] with the differences at this gap; gaps below `smallest_gap`, overlap too, count as that."""
    first_columns(gap, table, table.coefficients.shape[2], out)


@njit(cache=True, inline="always")
def first_columns(gap, table, columns, out):
    """`lubrication_scalars` of the first columns alone; several at once where the compiler knows their number."""
    h = table.smallest_gap if gap < table.smallest_gap else gap  # lets NaN through
    r = table.contact + h
    y = table.contact / r
    place = (np.log(h / r) - table.stretch * y - table.start) * table.inverse_step
    interval = min(int(place), table.coefficients.shape[0] - 1) if place > 0.0 else 0
    t = place - interval
    decay = y * y * y * y * y * y
    divergence = r / h - 1.0
    c = table.coefficients
    for column in range(columns):
        value = c[interval, 0, column] + t * (
            c[interval, 1, column] + t * (c[interval, 2, column] + t * c[interval, 3, column])
        )
        out[column] = value * decay * (1.0 + divergence * table.squeezed[column])
