"""Rotation matrices of bodies."""

from __future__ import annotations

import numpy as np

from mcdem.compilation import compiled
from mcdem.hydrodynamics.grand_mobility import tensor_to_five


@compiled
def rotation(vector, matrix):
    """Rotation matrix (3, 3) by the angle |vector| about vector (3,) (Rodrigues)."""
    angle = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    sine = np.sin(angle) / angle if angle > 1e-12 else 1.0
    versine = (1.0 - np.cos(angle)) / angle**2 if angle > 1e-6 else 0.5
    x, y, z = vector[0], vector[1], vector[2]
    matrix[0, 0] = 1.0 - versine * (y * y + z * z)
    matrix[1, 1] = 1.0 - versine * (x * x + z * z)
    matrix[2, 2] = 1.0 - versine * (x * x + y * y)
    matrix[0, 1], matrix[1, 0] = versine * x * y - sine * z, versine * x * y + sine * z
    matrix[0, 2], matrix[2, 0] = versine * x * z + sine * y, versine * x * z - sine * y
    matrix[1, 2], matrix[2, 1] = versine * y * z - sine * x, versine * y * z + sine * x


@compiled
def multiply(a, b, out):
    """out = a b for (3, 3)."""
    for p in range(3):
        for q in range(3):
            out[p, q] = a[p, 0] * b[0, q] + a[p, 1] * b[1, q] + a[p, 2] * b[2, q]


@compiled
def turn_back(matrix, tensor, five):
    """Components (5,) of Q^T tensor Q, with Q = matrix (3, 3)."""
    half, turned = np.empty((3, 3)), np.empty((3, 3))
    multiply(tensor, matrix, half)
    for p in range(3):
        for q in range(3):
            turned[p, q] = matrix[0, p] * half[0, q] + matrix[1, p] * half[1, q] + matrix[2, p] * half[2, q]
    tensor_to_five(turned, five)
