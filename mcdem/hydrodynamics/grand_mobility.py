"""Far field of the force-torque-stresslet description: the grand mobility of N spheres in unbounded fluid.

Rotne-Prager-Yamakawa couplings and their stresslet counterparts (Durlofsky, Brady & Bossis 1987, appendix;
Kim & Karrila 1991, ch. 7 and 11), for spheres of any radii: every entry is the Oseen tensor and its gradients
under the Faxen operators of both spheres.

Conventions of the compiled hydrodynamics (`mcdem.hydrodynamics`):
  reduced units: length a, time 1/g, force 6 pi mu a^2 g, so an isolated sphere of radius a has mobilities 1, 3/4, 9/10;
  forces F, torques T, stresslets S are what the spheres exert on the fluid;
  rates are (u - u_inf, omega - omega_inf, -E_inf), so that rates = mobility . (F, T, S) is symmetric positive definite;
  symmetric traceless tensors are five components in the orthonormal basis
      (xx - yy)/sqrt2, (2zz - xx - yy)/sqrt6, (xy + yx)/sqrt2, (xz + zx)/sqrt2, (yz + zy)/sqrt2;
  a grand matrix is ordered (S or E: 5N | T or omega: 3N | F or u: 3N), and only its lower triangle is kept.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from mcdem.compilation import compiled, separately_compiled

_SQRT2 = math.sqrt(2.0)
_SQRT6 = math.sqrt(6.0)


@njit(cache=True, inline="always")
def basis_contract(direction, rows):
    """rows[a, i] = e^a_ij d_j for the five basis tensors; direction (3,), rows (5, 3)."""
    x, y, z = direction[0], direction[1], direction[2]
    rows[0, 0], rows[0, 1], rows[0, 2] = x / _SQRT2, -y / _SQRT2, 0.0
    rows[1, 0], rows[1, 1], rows[1, 2] = -x / _SQRT6, -y / _SQRT6, 2.0 * z / _SQRT6
    rows[2, 0], rows[2, 1], rows[2, 2] = y / _SQRT2, x / _SQRT2, 0.0
    rows[3, 0], rows[3, 1], rows[3, 2] = z / _SQRT2, 0.0, x / _SQRT2
    rows[4, 0], rows[4, 1], rows[4, 2] = 0.0, z / _SQRT2, y / _SQRT2


@compiled
def tensor_to_five(tensor, out):
    """Components of a symmetric traceless tensor (3, 3) in the basis; out (5,)."""
    out[0] = (tensor[0, 0] - tensor[1, 1]) / _SQRT2
    out[1] = (2.0 * tensor[2, 2] - tensor[0, 0] - tensor[1, 1]) / _SQRT6
    out[2] = _SQRT2 * tensor[0, 1]
    out[3] = _SQRT2 * tensor[0, 2]
    out[4] = _SQRT2 * tensor[1, 2]


@compiled
def five_tensor(components, tensor):
    """The symmetric traceless tensor of five components (5,) into tensor (3, 3)."""
    tensor[0, 0] = components[0] / _SQRT2 - components[1] / _SQRT6
    tensor[1, 1] = -components[0] / _SQRT2 - components[1] / _SQRT6
    tensor[2, 2] = 2.0 * components[1] / _SQRT6
    tensor[0, 1] = tensor[1, 0] = components[2] / _SQRT2
    tensor[0, 2] = tensor[2, 0] = components[3] / _SQRT2
    tensor[1, 2] = tensor[2, 1] = components[4] / _SQRT2


def five_to_tensor(components: np.ndarray) -> np.ndarray:
    """Symmetric traceless tensors (..., 3, 3) of components (..., 5)."""
    c = np.asarray(components, float)
    tensor = np.empty((*c.shape[:-1], 3, 3))
    tensor[..., 0, 0] = c[..., 0] / _SQRT2 - c[..., 1] / _SQRT6
    tensor[..., 1, 1] = -c[..., 0] / _SQRT2 - c[..., 1] / _SQRT6
    tensor[..., 2, 2] = 2.0 * c[..., 1] / _SQRT6
    tensor[..., 0, 1] = tensor[..., 1, 0] = c[..., 2] / _SQRT2
    tensor[..., 0, 2] = tensor[..., 2, 0] = c[..., 3] / _SQRT2
    tensor[..., 1, 2] = tensor[..., 2, 1] = c[..., 4] / _SQRT2
    return tensor


@compiled
def _place_cross(matrix, row, column, factor, d):
    """matrix[row + k, column + l] = factor eps_klm d_m, the map v -> factor v x d."""
    matrix[row, column], matrix[row, column + 1], matrix[row, column + 2] = 0.0, factor * d[2], -factor * d[1]
    matrix[row + 1, column], matrix[row + 1, column + 1], matrix[row + 1, column + 2] = (
        -factor * d[2],
        0.0,
        factor * d[0],
    )
    matrix[row + 2, column], matrix[row + 2, column + 1], matrix[row + 2, column + 2] = (
        factor * d[1],
        -factor * d[0],
        0.0,
    )


@njit(cache=True, inline="always")
def _place_force_torque(matrix, torque, force, i, j, d, u, squares):
    """Couplings of forces and torques of spheres i and j; `torque` and `force` are where these begin in matrix.

    u = 1/r, squares = a_i^2 + a_j^2, d (3,) the unit vector from j to i.
    """
    u2 = u * u
    u3 = u2 * u
    xa = 1.5 * u - 0.5 * squares * u3
    ya = 0.75 * u + 0.25 * squares * u3
    yb = 0.75 * u2
    xc = 0.75 * u3
    yc = -0.375 * u3
    for k in range(3):
        for m in range(3):
            dd = d[k] * d[m]
            unit = 1.0 if k == m else 0.0
            matrix[force + 3 * i + k, force + 3 * j + m] = xa * dd + ya * (unit - dd)
            matrix[torque + 3 * i + k, torque + 3 * j + m] = xc * dd + yc * (unit - dd)
    _place_cross(matrix, force + 3 * i, torque + 3 * j, yb, d)
    _place_cross(matrix, force + 3 * j, torque + 3 * i, -yb, d)


@separately_compiled()
def force_torque_mobility(directions, distances, radii, matrix):
    """Fill the lower triangle of the mobility (6N, 6N) of forces and torques alone, ordered (T | F); else as `grand_mobility`.

    Rotne & Prager (1969), Yamakawa (1970); with rotation and unequal radii Zuk et al. (2014), J. Fluid Mech. 741, R5.
    """
    n = radii.shape[0]
    force = 3 * n
    for i in range(n):
        a = radii[i]
        for k in range(3):
            for m in range(3):
                matrix[3 * i + k, 3 * i + m] = 0.0
                matrix[force + 3 * i + k, force + 3 * i + m] = 0.0
                matrix[force + 3 * i + k, 3 * i + m] = 0.0
            matrix[3 * i + k, 3 * i + k] = 0.75 / a**3
            matrix[force + 3 * i + k, force + 3 * i + k] = 1.0 / a
        for j in range(i):
            b = radii[j]
            u = 1.0 / max(distances[i, j], a + b)
            _place_force_torque(matrix, 0, force, i, j, directions[i, j], u, a * a + b * b)


@separately_compiled()
def grand_mobility(directions, distances, radii, matrix):
    """Fill the lower triangle of the grand mobility (11N, 11N).

    directions : (N, N, 3), directions[i, j] the unit vector from sphere j to sphere i, needed for i > j
    distances : (N, N) centre distances for i > j; below touching the functions at touching are used, which keeps
        the matrix positive definite when a contact is compressed (the two-body part clamps alike)
    radii : (N,)
    """
    n = radii.shape[0]
    torque, force = 5 * n, 8 * n
    q = np.empty((5, 3))
    cross = np.empty((5, 3))
    qd = np.empty(5)
    for i in range(n):
        a = radii[i]
        for k in range(5):
            for m in range(k + 1):
                matrix[5 * i + k, 5 * i + m] = 0.0
            matrix[5 * i + k, 5 * i + k] = 0.9 / a**3
        for k in range(3):
            for m in range(k + 1):
                matrix[torque + 3 * i + k, torque + 3 * i + m] = 0.0
                matrix[force + 3 * i + k, force + 3 * i + m] = 0.0
            matrix[torque + 3 * i + k, torque + 3 * i + k] = 0.75 / a**3
            matrix[force + 3 * i + k, force + 3 * i + k] = 1.0 / a
            for m in range(5):
                matrix[torque + 3 * i + k, 5 * i + m] = 0.0
                matrix[force + 3 * i + k, 5 * i + m] = 0.0
            for m in range(3):
                matrix[force + 3 * i + k, torque + 3 * i + m] = 0.0
        for j in range(i):
            b = radii[j]
            d = directions[i, j]
            u = 1.0 / max(distances[i, j], a + b)
            u2 = u * u
            u3 = u2 * u
            u5 = u3 * u2
            squares = a * a + b * b
            # Strain at i from a force at j, and the other way round.
            weight_ij = a * a / 10.0 + b * b / 6.0
            weight_ji = b * b / 10.0 + a * a / 6.0
            xg_ij = -2.25 * u2 + 13.5 * weight_ij * u2 * u2
            yg_ij = -4.5 * weight_ij * u2 * u2
            xg_ji = -2.25 * u2 + 13.5 * weight_ji * u2 * u2
            yg_ji = -4.5 * weight_ji * u2 * u2
            yh = -1.125 * u3
            xm = -4.5 * u3 + 5.4 * squares * u5
            ym = 2.25 * u3 - 3.6 * squares * u5
            zm = 0.9 * squares * u5
            basis_contract(d, q)
            for k in range(5):
                qd[k] = q[k, 0] * d[0] + q[k, 1] * d[1] + q[k, 2] * d[2]
                cross[k, 0] = d[1] * q[k, 2] - d[2] * q[k, 1]
                cross[k, 1] = d[2] * q[k, 0] - d[0] * q[k, 2]
                cross[k, 2] = d[0] * q[k, 1] - d[1] * q[k, 0]
            _place_force_torque(matrix, torque, force, i, j, d, u, squares)
            for k in range(3):
                for m in range(5):
                    # Velocity at i from a stresslet at j is the transpose of strain at j from a force at i.
                    along = qd[m] * d[k]
                    matrix[force + 3 * i + k, 5 * j + m] = -(xg_ji * along + 2.0 * yg_ji * (q[m, k] - along))
                    matrix[force + 3 * j + k, 5 * i + m] = xg_ij * along + 2.0 * yg_ij * (q[m, k] - along)
                    spin = 2.0 * yh * cross[m, k]
                    matrix[torque + 3 * i + k, 5 * j + m] = spin
                    matrix[torque + 3 * j + k, 5 * i + m] = spin
            for k in range(5):
                for m in range(5):
                    mixed = q[k, 0] * q[m, 0] + q[k, 1] * q[m, 1] + q[k, 2] * q[m, 2]
                    both = qd[k] * qd[m]
                    unit = 1.0 if k == m else 0.0
                    matrix[5 * i + k, 5 * j + m] = (
                        1.5 * xm * both + 2.0 * ym * (mixed - both) + zm * (unit + 0.5 * both - 2.0 * mixed)
                    )
