"""The tensors of a pair of spheres, made from its scalar resistance functions (forms: see `two_sphere`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

FUNCTIONS = ("XA", "YA", "YB", "XC", "YC", "XG", "YG", "YH", "XM", "YM", "ZM")

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


def assemble(direction: np.ndarray, scalars: Mapping[str, float | np.ndarray]) -> np.ndarray:
    """(22, 22) resistance of one pair: (F1 F2 T1 T2 S1 S2) from (U1-u U2-u Omega1-w Omega2-w -E1 -E2).

    direction : (3,) from sphere 1 to sphere 2, of any length
    scalars : the 44 functions, XA11 to ZM22
    """
    d = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    one = np.eye(3)
    dd = np.outer(d, d)
    across = one - dd
    cross = np.array([[0, d[2], -d[1]], [-d[2], 0, d[0]], [d[1], -d[0], 0]])  # eps_ijk d_k

    traceless = dd - one / 3
    g_axial = np.einsum("ij,k->ijk", traceless, d)
    g_transverse = np.einsum("i,jk->ijk", d, across) + np.einsum("j,ik->ijk", d, across)
    h_transverse = np.einsum("i,jk->ijk", d, cross) + np.einsum("j,ik->ijk", d, cross)
    m_axial = 1.5 * np.einsum("ij,kl->ijkl", traceless, traceless)
    m_transverse = 0.5 * sum(
        np.einsum(f"{pair},{other}->ijkl", dd, across)
        for pair, other in (("ik", "jl"), ("jk", "il"), ("il", "jk"), ("jl", "ik"))
    )
    m_planar = 0.5 * (
        np.einsum("ik,jl->ijkl", across, across)
        + np.einsum("il,jk->ijkl", across, across)
        - np.einsum("ij,kl->ijkl", across, across)
    )

    def components(tensor: np.ndarray) -> np.ndarray:
        return np.tensordot(STRAIN_BASIS, tensor, axes=2)

    resistance = np.zeros((22, 22))
    for a in range(2):
        for b in range(2):
            f = {name: float(scalars[f"{name}{a + 1}{b + 1}"]) for name in FUNCTIONS}
            force, torque, stresslet = _places(a)
            velocity, spin, strain = _places(b)
            resistance[force, velocity] = f["XA"] * dd + f["YA"] * across
            resistance[torque, velocity] = f["YB"] * cross
            resistance[torque, spin] = f["XC"] * dd + f["YC"] * across
            resistance[stresslet, velocity] = components(f["XG"] * g_axial + f["YG"] * g_transverse)
            resistance[stresslet, spin] = components(f["YH"] * h_transverse)
            m = f["XM"] * m_axial + f["YM"] * m_transverse + f["ZM"] * m_planar
            resistance[stresslet, strain] = np.einsum("pij,ijkl,qkl->pq", STRAIN_BASIS, m, STRAIN_BASIS)
            resistance[velocity, torque] = resistance[torque, velocity].T
            resistance[velocity, stresslet] = resistance[stresslet, velocity].T
            resistance[spin, stresslet] = resistance[stresslet, spin].T
    return resistance


def _places(sphere: int) -> tuple[slice, slice, slice]:
    """Where the sphere's force, torque and stresslet, or velocity, rotation and strain, stand."""
    return (
        slice(3 * sphere, 3 * sphere + 3),
        slice(6 + 3 * sphere, 9 + 3 * sphere),
        slice(12 + 5 * sphere, 17 + 5 * sphere),
    )
