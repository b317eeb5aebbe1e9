"""The far-field grand mobility against an independent dense evaluation, and the laws it must keep."""

from __future__ import annotations

import itertools

import mpmath
import numpy as np
import pytest

from mcdem.hydrodynamics import grand_mobility as far_field
from mcdem.hydrodynamics.resistance import measure, workspace

BASIS = np.array(
    [
        np.diag([1.0, -1.0, 0.0]) / np.sqrt(2),
        np.diag([-1.0, -1.0, 2.0]) / np.sqrt(6),
        np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0.0]]) / np.sqrt(2),
        np.array([[0, 0, 1], [0, 0, 0], [1, 0, 0.0]]) / np.sqrt(2),
        np.array([[0, 0, 0], [0, 0, 1], [0, 1, 0.0]]) / np.sqrt(2),
    ]
)
EPS = np.zeros((3, 3, 3))
for p in itertools.permutations(range(3)):
    EPS[p] = np.linalg.det(np.eye(3)[list(p)])


def compiled(positions, radii):
    n = len(radii)
    work = workspace(n)
    measure(positions, work.directions, work.distances)
    far_field.grand_mobility(work.directions, work.distances, radii, work.mobility)
    lower = np.tril(work.mobility)
    return lower + np.tril(lower, -1).T


class OseenSeries:
    """Oseen tensor and its derivatives to sixth order at one point, by mpmath differentiation of r = |x|.

    8 pi mu G_ij = delta_ij laplacian(r) - d_i d_j r, so derivatives of r are all that is needed.
    """

    def __init__(self, point):
        self.point = [mpmath.mpf(float(c)) for c in point]
        self.memory = {}

    def r(self, *axes):
        order = tuple(axes.count(k) for k in range(3))
        if order not in self.memory:
            self.memory[order] = mpmath.diff(
                lambda x, y, z: mpmath.sqrt(x * x + y * y + z * z), self.point, order
            )
        return self.memory[order]

    def oseen(self, i, j, *axes):
        value = -self.r(i, j, *axes)
        if i == j:
            value += sum(self.r(k, k, *axes) for k in range(3))
        return value

    def tensor(self, weight, count):
        """(1 + weight laplacian) of the `count`-th gradient of G, indices (i, j, k...)."""
        out = np.zeros((3, 3) + (3,) * count)
        for index in itertools.product(range(3), repeat=2 + count):
            i, j, *axes = index
            value = self.oseen(i, j, *axes)
            if weight:
                value += weight * sum(self.oseen(i, j, m, m, *axes) for m in range(3))
            out[index] = float(value)
        return out


def pair_blocks(separation, a, b):
    """(11, 11) block: rates of a sphere of radius a at `separation` from one of radius b; order (E, omega, u)."""
    mpmath.mp.dps = 40
    series = OseenSeries(separation)
    prefactor = 0.75  # 6 pi / (8 pi)
    uf = series.tensor((a * a + b * b) / 6, 0)
    ef = series.tensor(a * a / 10 + b * b / 6, 1)
    us = series.tensor(a * a / 6 + b * b / 10, 1)
    es = series.tensor((a * a + b * b) / 10, 2)
    plain1, plain2 = series.tensor(0, 1), series.tensor(0, 2)
    block = np.zeros((11, 11))
    block[8:, 8:] = uf
    # velocity of a torque: u_i = -1/2 d_k G_ij eps_lkj T_l
    block[8:, 5:8] = -0.5 * np.einsum("ijk,lkj->il", plain1, EPS)
    # omega = 1/2 curl u
    block[5:8, 8:] = 0.5 * np.einsum("lki,ijk->lj", EPS, plain1)
    curl_torque = -0.5 * np.einsum("ijkm,lkj->iml", plain2, EPS)  # d_m u_i of T_l
    block[5:8, 5:8] = 0.5 * np.einsum("pmi,iml->pl", EPS, curl_torque)
    block[:5, 5:8] = np.einsum("aim,iml->al", BASIS, curl_torque)
    block[:5, 8:] = np.einsum("aim,ijm->aj", BASIS, ef)
    block[8:, :5] = -np.einsum("ijk,bjk->ib", us, BASIS)
    block[:5, :5] = -np.einsum("aim,ijkm,bjk->ab", BASIS, es, BASIS)
    block[5:8, :5] = -0.5 * np.einsum("pmi,ijkm,bjk->pb", EPS, plain2, BASIS)
    return prefactor * block


def reference(positions, radii):
    n = len(radii)
    out = np.zeros((11 * n, 11 * n))

    def rows(i):
        return np.concatenate(
            [5 * i + np.arange(5), 5 * n + 3 * i + np.arange(3), 8 * n + 3 * i + np.arange(3)]
        )

    for i in range(n):
        for j in range(n):
            if i == j:
                a = radii[i]
                block = np.diag([0.9 / a**3] * 5 + [0.75 / a**3] * 3 + [1.0 / a] * 3)
            else:
                block = pair_blocks(positions[i] - positions[j], radii[i], radii[j])
            out[np.ix_(rows(i), rows(j))] = block
    return out


@pytest.mark.parametrize("radii", [[1.0, 1.0, 1.0], [1.0, 0.6, 1.7]])
def test_agrees_with_an_independent_dense_evaluation(radii):
    positions = np.array([[0.0, 0.0, 0.0], [2.9, 0.4, -0.7], [-0.3, 2.8, 1.9]])
    radii = np.array(radii)
    ours, theirs = compiled(positions, radii), reference(positions, radii)
    assert np.abs(ours - theirs).max() < 1e-9


def random_cluster(n, rng, spread):
    positions = [np.zeros(3)]
    while len(positions) < n:
        step = rng.normal(size=3)
        trial = positions[rng.integers(len(positions))] + (
            2.0 + spread * rng.random()
        ) * step / np.linalg.norm(step)
        if min(np.linalg.norm(trial - p) for p in positions) >= 2.0:
            positions.append(trial)
    return np.array(positions)


@pytest.mark.parametrize("n", [2, 7, 25])
def test_positive_definite(n):
    rng = np.random.default_rng(n)
    for _ in range(4):
        positions = random_cluster(n, rng, 0.02)
        assert np.linalg.eigvalsh(compiled(positions, np.ones(n))).min() > 0.05
