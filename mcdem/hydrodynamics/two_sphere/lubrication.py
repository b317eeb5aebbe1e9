"""Two-body part of the resistance: exact two-sphere functions less their far field, pair by pair.

The scalars of one pair (`mcdem.hydrodynamics.two_sphere.tables`) are laid into the resistance matrix of N spheres with
the tensor forms of Jeffrey & Onishi 1984 and Jeffrey 1992, d being the unit vector from the first to the second
sphere.  The cut-off delta clamps the gap and keeps the true direction.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from mcdem.compilation import compiled
from mcdem.hydrodynamics.grand_mobility import basis_contract, five_tensor
from mcdem.hydrodynamics.two_sphere.tables import LubricationTable, first_columns, lubrication_scalars

# How the scalars of the pairs 21 and 22 follow from those of 12 and 11 when the spheres change places: Y^B, X^G and
# Y^G change sign with d, the others do not (order XA YA YB XC YC XG YG YH XM YM ZM).
_ODD = (2, 5, 6)
# A function in units of 6 pi mu a^n, in the same order.
_POWERS = (1, 1, 2, 3, 3, 2, 2, 3, 3, 3, 3)
RAW = 44
"""Length of the work space of `pair_scalars`."""
FAMILIES = 11
# All but X^M, Y^M and Z^M, which give stresslets alone.
FAMILIES_OF_MOTION = 8


@compiled
def pair_scalars(gap, a1, a2, table, raw, scalars):
    """Two-body differences of two spheres at `gap` into scalars (11, 4); raw (RAW,) is work space.

    a1, a2 : radii, by which `SpeciesTables` are chosen from; with the `LubricationTable` of one radius both are 1
    """
    scalars_of_species(gap, a1, a2, table, table.single, table.radii, raw, scalars)


@compiled
def motion_scalars(gap, a1, a2, table, raw, scalars):
    """`pair_scalars` of the functions that resistance and strain_load are made of, scalars[:FAMILIES_OF_MOTION]."""
    motion_scalars_of_species(gap, a1, a2, table, table.single, table.radii, raw, scalars)


@compiled
def scalars_of_species(gap, a1, a2, table, single, radii, raw, scalars):
    """`pair_scalars`, by whether the suspension has several radii; what is None is left out, an else would not be."""
    if radii is not None:
        unequal_scalars(gap, a1, a2, table, radii, raw, scalars)
    if single is not None:
        equal_scalars(gap, table, FAMILIES, raw, scalars)


@compiled
def motion_scalars_of_species(gap, a1, a2, table, single, radii, raw, scalars):
    """`motion_scalars` likewise; their number is written out, since the compiler is to know it."""
    if radii is not None:
        unequal_scalars(gap, a1, a2, table, radii, raw, scalars)
    if single is not None:
        equal_scalars(gap, table, FAMILIES_OF_MOTION, raw, scalars)


@compiled
def species_of(radius, radii):
    """Which of the radii (S,) of a suspension a sphere has: the nearest, so that rounding does not matter."""
    found = 0
    for s in range(1, radii.shape[0]):
        if abs(radii[s] - radius) < abs(radii[found] - radius):
            found = s
    return found


@compiled
def unequal_scalars(gap, a1, a2, table, radii, raw, scalars):
    """`pair_scalars` in a suspension of several radii, by the table of the two species."""
    s, t = species_of(a1, radii), species_of(a2, radii)
    swapped = s > t
    low, high = (t, s) if swapped else (s, t)
    k, length = high * (high + 1) // 2 + low, radii[low]
    pair = LubricationTable(
        table.contact[k],
        table.smallest_gap,
        table.stretch,
        table.start[k],
        table.inverse_step[k],
        table.coefficients[k],
        table.squeezed,
        True,
        None,
    )
    lubrication_scalars(gap / length, pair, raw)
    for family in range(11):
        unit = length ** _POWERS[family]
        if swapped and family in _ODD:
            unit = -unit
        for place in range(4):
            scalars[family, place] = unit * raw[4 * family + (3 - place if swapped else place)]


@njit(cache=True, inline="always")
def equal_scalars(gap, table, families, raw, scalars):
    """`pair_scalars` of two equal spheres, in units of their radius.

    Inlined, so that the number of families is known and values go from register to register: read back from memory in other
    groups than they were written in, they cost three times as much as all that computes them.
    """
    first_columns(gap, table, 2 * families, raw)
    for family in range(families):
        sign = -1.0 if family in _ODD else 1.0
        scalars[family, 0], scalars[family, 1] = raw[2 * family], raw[2 * family + 1]
        scalars[family, 2], scalars[family, 3] = sign * raw[2 * family + 1], sign * raw[2 * family]


@njit(cache=True, inline="always")
def _axial(matrix, row, column, parallel, normal, d):
    """matrix[3, 3 block] += parallel d d + normal (1 - d d)."""
    for k in range(3):
        for m in range(3):
            dd = d[k] * d[m]
            matrix[row + k, column + m] += parallel * dd + normal * ((1.0 if k == m else 0.0) - dd)


@njit(cache=True, inline="always")
def _cross(matrix, row, column, factor, d):
    """matrix[3, 3 block] += factor eps_klm d_m, with k the row and l the column."""
    matrix[row, column + 1] += factor * d[2]
    matrix[row, column + 2] -= factor * d[1]
    matrix[row + 1, column] -= factor * d[2]
    matrix[row + 1, column + 2] += factor * d[0]
    matrix[row + 2, column] += factor * d[1]
    matrix[row + 2, column + 1] -= factor * d[0]


@compiled
def add_pair_resistance(s, i, j, d, matrix):
    """Add one pair to the resistance.

    s : (11, 4) scalars of XA YA YB XC YC XG YG YH XM YM ZM for the pairs 11, 12, 21, 22, in units of length a
        and resistance 6 pi mu a^n
    i, j : the pair, i > j; **sphere 1 is i**, sphere 2 is j, d (3,) the unit vector from i to j
    matrix : (6N, 6N), ordered (omega | u), lower triangle
    """
    n = matrix.shape[0] // 6
    wi, wj, ui, uj = 3 * i, 3 * j, 3 * (n + i), 3 * (n + j)
    _axial(matrix, ui, ui, s[0, 0], s[1, 0], d)
    _axial(matrix, ui, uj, s[0, 1], s[1, 1], d)
    _axial(matrix, uj, uj, s[0, 3], s[1, 3], d)
    _axial(matrix, wi, wi, s[3, 0], s[4, 0], d)
    _axial(matrix, wi, wj, s[3, 1], s[4, 1], d)
    _axial(matrix, wj, wj, s[3, 3], s[4, 3], d)
    # T_a = B^ab u_b with B = Y^B eps_ijk d_k; the rows of u hold its transpose.
    _cross(matrix, ui, wi, -s[2, 0], d)
    _cross(matrix, uj, wi, -s[2, 1], d)
    _cross(matrix, ui, wj, -s[2, 2], d)
    _cross(matrix, uj, wj, -s[2, 3], d)


@compiled
def add_pair_strain_load(s, i, j, d, strain, shift, strain_load):
    """Add what the straining flow exerts through one pair on spheres held still; arguments as `add_pair_resistance`.

    strain : (3, 3) E_inf
    shift : by how much the distance the scalars are taken at exceeds the true one; the strain then moves the
        spheres apart by as much more
    strain_load : (6N,) torques and forces
    """
    n = strain_load.shape[0] // 6
    wi, wj, ui, uj = 3 * i, 3 * j, 3 * (n + i), 3 * (n + j)
    e0 = strain[0, 0] * d[0] + strain[0, 1] * d[1] + strain[0, 2] * d[2]
    e1 = strain[1, 0] * d[0] + strain[1, 1] * d[1] + strain[1, 2] * d[2]
    e2 = strain[2, 0] * d[0] + strain[2, 1] * d[1] + strain[2, 2] * d[2]
    along = d[0] * e0 + d[1] * e1 + d[2] * e2
    if shift != 0.0:
        half = 0.5 * shift
        for sphere in range(2):
            u, w = (ui, wi) if sphere == 0 else (uj, wj)
            x = half * (s[0, 2 * sphere + 1] - s[0, 2 * sphere])
            y = half * (s[1, 2 * sphere + 1] - s[1, 2 * sphere])
            b = half * (s[2, 2 * sphere + 1] - s[2, 2 * sphere])
            strain_load[u] += (x - y) * along * d[0] + y * e0
            strain_load[u + 1] += (x - y) * along * d[1] + y * e1
            strain_load[u + 2] += (x - y) * along * d[2] + y * e2
            strain_load[w] += b * (e1 * d[2] - e2 * d[1])
            strain_load[w + 1] += b * (e2 * d[0] - e0 * d[2])
            strain_load[w + 2] += b * (e0 * d[1] - e1 * d[0])
    # F_a = G^ba : E summed over b, T_a likewise with H.
    for sphere in range(2):
        u, w = (ui, wi) if sphere == 0 else (uj, wj)
        x = s[5, 0] + s[5, 2] if sphere == 0 else s[5, 1] + s[5, 3]
        y = s[6, 0] + s[6, 2] if sphere == 0 else s[6, 1] + s[6, 3]
        h = s[7, 0] + s[7, 2] if sphere == 0 else s[7, 1] + s[7, 3]
        radial = (x - 2.0 * y) * along
        strain_load[u] += radial * d[0] + 2.0 * y * e0
        strain_load[u + 1] += radial * d[1] + 2.0 * y * e1
        strain_load[u + 2] += radial * d[2] + 2.0 * y * e2
        strain_load[w] += 2.0 * h * (d[1] * e2 - d[2] * e1)
        strain_load[w + 1] += 2.0 * h * (d[2] * e0 - d[0] * e2)
        strain_load[w + 2] += 2.0 * h * (d[0] * e1 - d[1] * e0)


@compiled
def add_pair_load(s, i, j, d, rates, load):
    """Add the torques and forces that one pair's resistance puts against rates; arguments as `add_pair_resistance`.

    rates, load : (6N,), ordered (omega | u) and (T | F)
    """
    n = load.shape[0] // 6
    for a in range(2):
        sphere = i if a == 0 else j
        f0 = f1 = f2 = t0 = t1 = t2 = 0.0
        for b in range(2):
            other = i if b == 0 else j
            u0, u1, u2 = rates[3 * (n + other)], rates[3 * (n + other) + 1], rates[3 * (n + other) + 2]
            w0, w1, w2 = rates[3 * other], rates[3 * other + 1], rates[3 * other + 2]
            # Y^B of T_a from u_b, and transposed that of F_a from omega_b.
            xa, ya, turned, back = s[0, 2 * a + b], s[1, 2 * a + b], s[2, 2 * a + b], s[2, 2 * b + a]
            xc, yc = s[3, 2 * a + b], s[4, 2 * a + b]
            along = (xa - ya) * (u0 * d[0] + u1 * d[1] + u2 * d[2])
            f0 += ya * u0 + along * d[0] - back * (w1 * d[2] - w2 * d[1])
            f1 += ya * u1 + along * d[1] - back * (w2 * d[0] - w0 * d[2])
            f2 += ya * u2 + along * d[2] - back * (w0 * d[1] - w1 * d[0])
            along = (xc - yc) * (w0 * d[0] + w1 * d[1] + w2 * d[2])
            t0 += yc * w0 + along * d[0] + turned * (u1 * d[2] - u2 * d[1])
            t1 += yc * w1 + along * d[1] + turned * (u2 * d[0] - u0 * d[2])
            t2 += yc * w2 + along * d[2] + turned * (u0 * d[1] - u1 * d[0])
        load[3 * sphere] += t0
        load[3 * sphere + 1] += t1
        load[3 * sphere + 2] += t2
        load[3 * (n + sphere)] += f0
        load[3 * (n + sphere) + 1] += f1
        load[3 * (n + sphere) + 2] += f2


@compiled
def add_pair_stresslet(s, i, j, d, rates, strain_five, stresslet):
    """Add one pair's stresslets (exerted on the fluid): G u + H omega - M E.

    rates : (6N,) (omega - omega_inf | u - u_inf);  strain_five (5,);  stresslet (N, 5)
    """
    n = stresslet.shape[0]
    q, tensor = np.empty((5, 3)), np.empty((3, 3))
    basis_contract(d, q)
    five_tensor(strain_five, tensor)
    e0 = tensor[0, 0] * d[0] + tensor[0, 1] * d[1] + tensor[0, 2] * d[2]
    e1 = tensor[1, 0] * d[0] + tensor[1, 1] * d[1] + tensor[1, 2] * d[2]
    e2 = tensor[2, 0] * d[0] + tensor[2, 1] * d[1] + tensor[2, 2] * d[2]
    stretch = e0 * d[0] + e1 * d[1] + e2 * d[2]
    for a in range(2):
        sphere = i if a == 0 else j
        # The stresslet is the symmetric traceless part of d v, and a share of the strain.
        v0 = v1 = v2 = whole = 0.0
        for b in range(2):
            other = i if b == 0 else j
            pair = 2 * a + b
            u0, u1, u2 = rates[3 * (n + other)], rates[3 * (n + other) + 1], rates[3 * (n + other) + 2]
            w0, w1, w2 = rates[3 * other], rates[3 * other + 1], rates[3 * other + 2]
            xg, yg, yh, xm, ym, zm = s[5, pair], s[6, pair], s[7, pair], s[8, pair], s[9, pair], s[10, pair]
            along = (xg - 2.0 * yg) * (u0 * d[0] + u1 * d[1] + u2 * d[2])
            along -= (1.5 * xm - 2.0 * ym + 0.5 * zm) * stretch
            mixed = 2.0 * (ym - zm)
            v0 += along * d[0] + 2.0 * yg * u0 + 2.0 * yh * (w1 * d[2] - w2 * d[1]) - mixed * e0
            v1 += along * d[1] + 2.0 * yg * u1 + 2.0 * yh * (w2 * d[0] - w0 * d[2]) - mixed * e1
            v2 += along * d[2] + 2.0 * yg * u2 + 2.0 * yh * (w0 * d[1] - w1 * d[0]) - mixed * e2
            whole += zm
        for k in range(5):
            value = q[k, 0] * v0 + q[k, 1] * v1 + q[k, 2] * v2
            stresslet[sphere, k] += value - whole * strain_five[k]
