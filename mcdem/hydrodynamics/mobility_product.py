"""The far-field mobility applied to forces, torques and stresslets pair by pair, without its matrix.

Moments and rates of N spheres are arrays (12, N), a row a component, so that loops run along memory: force, torque and the
stresslet as xx, yy, zz, xy, xz, yz;  linear, angular and -strain likewise.  The scalars are those of
`far_field.grand_mobility`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# Sums may be taken in any order, so that several pairs go through the processor at once.
ANY_ORDER = {"reassoc", "contract", "arcp", "nsz"}


@njit(cache=True, inline="always")
def rates_at(x, y, z, a, itself, places, radii, moments):
    """The twelve rates of a sphere of radius a at (x, y, z) that moments (12, N) on spheres at `places` (3, N) cause.

    itself : which of them it is, whose moments cause nothing here; -1 for none
    """
    n = radii.shape[0]
    u0 = u1 = u2 = w0 = w1 = w2 = e0 = e1 = e2 = e3 = e4 = e5 = 0.0
    for j in range(n):
        b = radii[j]
        d0, d1, d2 = x - places[0, j], y - places[1, j], z - places[2, j]
        r = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        # A sphere's own term comes out as nothing: it has no distance and is weighted by none.
        weight = 1.0 if j != itself else 0.0
        inverse = weight / max(r, 1e-300)
        d0, d1, d2 = d0 * inverse, d1 * inverse, d2 * inverse
        u = weight / max(r, a + b)
        v2 = u * u
        v3 = v2 * u
        squares = a * a + b * b
        xa, ya = 1.5 * u - 0.5 * squares * v3, 0.75 * u + 0.25 * squares * v3
        yb, xc, yc, yh = 0.75 * v2, 0.75 * v3, -0.375 * v3, -1.125 * v3
        own, other = a * a / 10.0 + b * b / 6.0, b * b / 10.0 + a * a / 6.0
        xg, yg = -2.25 * v2 + 13.5 * own * v2 * v2, -4.5 * own * v2 * v2
        xg_other, yg_other = -2.25 * v2 + 13.5 * other * v2 * v2, -4.5 * other * v2 * v2
        xm = -4.5 * v3 + 5.4 * squares * v3 * v2
        ym = 2.25 * v3 - 3.6 * squares * v3 * v2
        zm = 0.9 * squares * v3 * v2
        f0, f1, f2 = moments[0, j], moments[1, j], moments[2, j]
        t0, t1, t2 = moments[3, j], moments[4, j], moments[5, j]
        sxx, syy, szz = moments[6, j], moments[7, j], moments[8, j]
        sxy, sxz, syz = moments[9, j], moments[10, j], moments[11, j]
        sd0 = sxx * d0 + sxy * d1 + sxz * d2
        sd1 = sxy * d0 + syy * d1 + syz * d2
        sd2 = sxz * d0 + syz * d1 + szz * d2
        dsd = d0 * sd0 + d1 * sd1 + d2 * sd2
        df = d0 * f0 + d1 * f1 + d2 * f2
        # Crosses with d on the right.
        fx, fy, fz = f1 * d2 - f2 * d1, f2 * d0 - f0 * d2, f0 * d1 - f1 * d0
        tx, ty, tz = t1 * d2 - t2 * d1, t2 * d0 - t0 * d2, t0 * d1 - t1 * d0
        along = (xa - ya) * df - (xg_other - 2.0 * yg_other) * dsd
        u0 += ya * f0 + along * d0 + yb * tx - 2.0 * yg_other * sd0
        u1 += ya * f1 + along * d1 + yb * ty - 2.0 * yg_other * sd1
        u2 += ya * f2 + along * d2 + yb * tz - 2.0 * yg_other * sd2
        along = (xc - yc) * (d0 * t0 + d1 * t1 + d2 * t2)
        w0 += yc * t0 + along * d0 + yb * fx + 2.0 * yh * (d1 * sd2 - d2 * sd1)
        w1 += yc * t1 + along * d1 + yb * fy + 2.0 * yh * (d2 * sd0 - d0 * sd2)
        w2 += yc * t2 + along * d2 + yb * fz + 2.0 * yh * (d0 * sd1 - d1 * sd0)
        radial = (xg - 2.0 * yg) * df + (1.5 * xm - 2.0 * ym + 0.5 * zm) * dsd
        mixed = 2.0 * ym - 2.0 * zm
        # Symmetrised products of d with these.
        g0 = 2.0 * yg * f0 + 2.0 * yh * tx + mixed * sd0 + radial * d0
        g1 = 2.0 * yg * f1 + 2.0 * yh * ty + mixed * sd1 + radial * d1
        g2 = 2.0 * yg * f2 + 2.0 * yh * tz + mixed * sd2 + radial * d2
        e0 += d0 * g0 + zm * sxx
        e1 += d1 * g1 + zm * syy
        e2 += d2 * g2 + zm * szz
        e3 += 0.5 * (d0 * g1 + d1 * g0) + zm * sxy
        e4 += 0.5 * (d0 * g2 + d2 * g0) + zm * sxz
        e5 += 0.5 * (d1 * g2 + d2 * g1) + zm * syz
    return u0, u1, u2, w0, w1, w2, e0, e1, e2, e3, e4, e5


@njit(cache=True, fastmath=ANY_ORDER)
def apply_mobility(places, radii, moments, rates):
    """Rates (12, N) that moments (12, N) on spheres at `places` (3, N) cause."""
    for i in range(radii.shape[0]):
        sphere_rates(i, places, radii, moments, rates)


@njit(cache=True, inline="always")
def sphere_rates(i, places, radii, moments, rates):
    """Rates of sphere i, into column i of rates (12, N), that moments (12, N) on spheres at `places` (3, N) cause."""
    a = radii[i]
    turn, strain = 0.75 / a**3, 0.9 / a**3
    caused = rates_at(places[0, i], places[1, i], places[2, i], a, i, places, radii, moments)
    for k in range(12):
        rates[k, i] = caused[k] + (1.0 / a if k < 3 else (turn if k < 6 else strain)) * moments[k, i]


@njit(cache=True, fastmath=ANY_ORDER)
def rates_caused(places, radii, sources, source_radii, moments, rates):
    """Rates (12, N) of spheres at `places` (3, N) that moments (12, M) on other spheres, at `sources` (3, M), cause."""
    for i in range(radii.shape[0]):
        caused = rates_at(
            places[0, i], places[1, i], places[2, i], radii[i], -1, sources, source_radii, moments
        )
        for k in range(12):
            rates[k, i] = caused[k]
