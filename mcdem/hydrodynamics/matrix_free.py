"""Velocities of many spheres without a dense matrix: the same equations as `stokesian`, in O(N) memory.

Unknown are the rates v = (omega - omega_inf | u - u_inf) and the far-field stresslets S.  The far field carries what the
two-body part does not, (T, F) = external + strain_load - R v, and

    M_SS S + M_SF (T, F) = -E_inf,      M_FS S + M_FF (T, F) = v,

with M the grand mobility of `far_field` and R, strain_load those of `lubrication`.  M is applied pair by pair on all cores.  R is
kept as a sparse matrix up to RANGE; what is left of it beyond, a sum of terms in (a/r)^6, enters by refinement of the
residual, which takes all pairs.  GMRES is preconditioned by the near part of R with the drag of single spheres, factorised.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sparse
from numba import njit, prange
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, gmres, splu
from scipy.spatial import cKDTree

from mcdem.compilation import compiled
from mcdem.hydrodynamics.grand_mobility import five_to_tensor
from mcdem.hydrodynamics.mobility_product import ANY_ORDER, sphere_rates
from mcdem.hydrodynamics.two_sphere import lubrication
from mcdem.hydrodynamics.undisturbed_flow import UndisturbedFlow

RANGE = 8.0
"""Centre distance in radii up to which the two-body part is kept as a sparse matrix."""
NEAR = 2.6
"""Centre distance in radii up to which it enters the preconditioner."""
TOLERANCE = 1e-6
"""Norm of the residual over that of the right-hand side."""
REFINEMENTS = 12
"""Times the residual of all pairs is formed, at most."""
SHARES = 16
"""Parts into which the pairs are dealt for the cores; the same for any number of cores, and so is the sum."""


class Solution(NamedTuple):
    """What `solve_velocities` found, in reduced units; `iterations` of GMRES, `residual` over the right-hand side."""

    linear: NDArray[np.float64]  # (N, 3)
    angular: NDArray[np.float64]  # (N, 3)
    stresslet: NDArray[np.float64]  # (N, 5) that the fluid exerts on the spheres
    iterations: int
    residual: float


@njit(cache=True, parallel=True, fastmath=ANY_ORDER)
def apply_mobility(places, radii, moments, rates):
    """`mobility_product.apply_mobility` on all cores."""
    for i in prange(radii.shape[0]):
        sphere_rates(i, places, radii, moments, rates)


def mobility_product(
    places: NDArray[np.float64],
    radii: NDArray[np.float64],
    stresslets: NDArray[np.float64],
    torques: NDArray[np.float64],
    forces: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """(strains (N, 5), angular (N, 3), linear (N, 3)) that stresslets (N, 5), torques and forces (N, 3) cause.

    places : (3, N) positions, in the order of rows
    """
    tensor = five_to_tensor(stresslets)
    moments = np.concatenate([forces.T, torques.T, tensor[:, (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)].T])
    rates = np.empty_like(moments)
    apply_mobility(places, radii, np.ascontiguousarray(moments), rates)
    xx, yy, zz, xy, xz, yz = rates[6:]
    strains = np.column_stack(
        [
            (xx - yy) / np.sqrt(2.0),
            (2.0 * zz - xx - yy) / np.sqrt(6.0),
            np.sqrt(2.0) * xy,
            np.sqrt(2.0) * xz,
            np.sqrt(2.0) * yz,
        ]
    )
    return strains, rates[3:6].T, rates[:3].T


@compiled
def near_blocks(positions, radii, pairs, level, strain, blocks, own, strain_load):
    """Two-body part of some pairs (B, 2), i > j.

    blocks (B, 6, 6) resistance of i against j in the order (omega, u); own (N, 6, 6) that of each against itself, added to;
    strain_load (6N,), ordered (omega | u), added to
    """
    raw, scalars, d = np.empty(lubrication.RAW), np.empty((11, 4)), np.empty(3)
    local = np.empty((12, 12))
    for p in range(pairs.shape[0]):
        i, j = pairs[p, 0], pairs[p, 1]
        shift = pair_of(
            positions, radii, i, j, level.lubrication, level.cutoff, level.shifted, raw, scalars, d
        )
        local[:] = 0.0
        lubrication.add_pair_resistance(scalars, 1, 0, d, local)
        lubrication.add_pair_strain_load(scalars, i, j, d, strain, shift, strain_load)
        for row in range(12):
            for column in range(row):
                local[column, row] = local[row, column]
        for k in range(6):
            for m in range(6):
                # Of the pair, sphere 1 is i; locally its rows are 3:6 and 9:12.
                ik, im = 3 + k + (3 if k > 2 else 0), 3 + m + (3 if m > 2 else 0)
                jk, jm = k + (3 if k > 2 else 0), m + (3 if m > 2 else 0)
                own[i, k, m] += local[ik, im]
                own[j, k, m] += local[jk, jm]
                blocks[p, k, m] = local[ik, jm]


@njit(cache=True, inline="always")
def pair_of(positions, radii, i, j, table, cutoff, shifted, raw, scalars, d):
    """Scalars (11, 4) of a pair and d (3,), the unit vector from i to j; returns the shift of its distance."""
    r = 0.0
    for k in range(3):
        d[k] = positions[j, k] - positions[i, k]
        r += d[k] * d[k]
    r = np.sqrt(r)
    for k in range(3):
        d[k] /= r
    true_gap = r - radii[i] - radii[j]
    gap = max(true_gap, cutoff)
    lubrication.pair_scalars(gap, radii[i], radii[j], table, raw, scalars)
    return gap - true_gap if shifted else 0.0


@njit(cache=True, inline="always")
def beyond(positions, i, j, reach):
    """Whether the centres of i and j are further apart than `reach`."""
    r = 0.0
    for k in range(3):
        r += (positions[i, k] - positions[j, k]) ** 2
    return r > reach * reach


@njit(cache=True, parallel=True)
def distant_load(positions, radii, rates, reach, table, cutoff, shifted, load):
    """load (6N,) += R rates of all pairs beyond `reach`; a parallel loop takes no tuple that holds another, so that the level
    comes in pieces.
    """
    n = radii.shape[0]
    loads = np.zeros((SHARES, 6 * n))
    for share in prange(SHARES):
        raw, scalars, d = np.empty(lubrication.RAW), np.empty((11, 4)), np.empty(3)
        for i in range(share, n, SHARES):
            for j in range(i):
                if beyond(positions, i, j, reach):
                    pair_of(positions, radii, i, j, table, cutoff, shifted, raw, scalars, d)
                    lubrication.add_pair_load(scalars, i, j, d, rates, loads[share])
    for share in range(SHARES):
        load += loads[share]


@njit(cache=True, parallel=True)
def distant_strain_load(positions, radii, reach, table, cutoff, shifted, strain, strain_load):
    """strain_load (6N,) += that of all pairs beyond `reach`."""
    n = radii.shape[0]
    strain_loads = np.zeros((SHARES, 6 * n))
    for share in prange(SHARES):
        raw, scalars, d = np.empty(lubrication.RAW), np.empty((11, 4)), np.empty(3)
        for i in range(share, n, SHARES):
            for j in range(i):
                if beyond(positions, i, j, reach):
                    shift = pair_of(positions, radii, i, j, table, cutoff, shifted, raw, scalars, d)
                    lubrication.add_pair_strain_load(scalars, i, j, d, strain, shift, strain_loads[share])
    for share in range(SHARES):
        strain_load += strain_loads[share]


@njit(cache=True, parallel=True)
def pair_stresslets(positions, radii, rates, table, cutoff, shifted, strain_five, out):
    """Two-body stresslets of all pairs, added to out (N, 5)."""
    n = radii.shape[0]
    found = np.zeros((SHARES, n, 5))
    for share in prange(SHARES):
        raw, scalars, d = np.empty(lubrication.RAW), np.empty((11, 4)), np.empty(3)
        for i in range(share, n, SHARES):
            for j in range(i):
                pair_of(positions, radii, i, j, table, cutoff, shifted, raw, scalars, d)
                lubrication.add_pair_stresslet(scalars, i, j, d, rates, strain_five, found[share])
    for share in range(SHARES):
        out += found[share]


class TwoBody:
    """The two-body resistance R (6N, 6N, ordered omega | u) and the strain-induced load; no R where there is no lubrication."""

    def __init__(
        self,
        positions: NDArray[np.float64],
        radii: NDArray[np.float64],
        strain: NDArray[np.float64],
        level: Any,
    ) -> None:
        n = len(radii)
        self.positions, self.radii, self.level = positions, radii, level
        self.strain_load = np.zeros(6 * n)
        self.near = sparse.csr_array((6 * n, 6 * n))
        self.nearest = self.near
        if level.lubrication is None:
            return
        pairs = cKDTree(positions).query_pairs(RANGE, output_type="ndarray")
        pairs = np.sort(pairs, axis=1)[:, ::-1].astype(np.int64).reshape(-1, 2)
        blocks, own = np.empty((len(pairs), 6, 6)), np.zeros((n, 6, 6))
        near_blocks(
            positions,
            radii,
            np.ascontiguousarray(pairs),
            level,
            strain,
            blocks,
            own,
            self.strain_load,
        )
        distant_strain_load(positions, radii, RANGE, *level, strain, self.strain_load)
        self.near = _assembled(n, pairs, blocks, own)
        distance = np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1)
        close = distance < NEAR
        self.nearest = _assembled(n, pairs[close], blocks[close], own)

    def load(self, rates: NDArray[np.float64]) -> NDArray[np.float64]:
        """R rates, of all pairs."""
        load = self.near @ rates
        if self.level.lubrication is not None and rates.any():
            distant_load(self.positions, self.radii, rates, RANGE, *self.level, load)
        return load


def _assembled(
    n: int, pairs: NDArray[np.int64], blocks: NDArray[np.float64], own: NDArray[np.float64]
) -> sparse.csr_array:
    """The sparse matrix of blocks (B, 6, 6) of pairs and (N, 6, 6) on the diagonal, ordered (omega | u)."""
    first, second = pairs[:, 0], pairs[:, 1]
    data = np.concatenate([own, blocks, blocks.transpose(0, 2, 1)])
    row = np.concatenate([np.arange(n), first, second])
    column = np.concatenate([np.arange(n), second, first])
    # Entry k of a block belongs to omega for k < 3, else to u.
    place = np.array([0, 1, 2, 3 * n, 3 * n + 1, 3 * n + 2])
    rows = np.broadcast_to((3 * row)[:, None, None] + place[None, :, None], data.shape)
    columns = np.broadcast_to((3 * column)[:, None, None] + place[None, None, :], data.shape)
    return sparse.coo_array((data.ravel(), (rows.ravel(), columns.ravel())), shape=(6 * n, 6 * n)).tocsr()


def solve_velocities(
    level: Any,
    positions: NDArray[np.float64],
    radii: NDArray[np.float64],
    flow: UndisturbedFlow,
    forces: NDArray[np.float64],
    torques: NDArray[np.float64],
    tolerance: float = TOLERANCE,
) -> Solution:
    """Velocities of free spheres under given forces and torques; reduced units, arguments as `velocities.solve_velocities`.

    Raises `ArithmeticError` if the residual does not fall to `tolerance`.
    """
    positions = np.ascontiguousarray(positions)
    n = len(radii)
    two_body = TwoBody(positions, radii, flow.strain, level)
    external = np.concatenate([np.ravel(torques), np.ravel(forces)]) + two_body.strain_load
    # Of a single sphere: rates over torques and forces.
    single = np.concatenate([np.repeat(0.75 / radii**3, 3), np.repeat(1.0 / radii, 3)])
    drag = sparse.diags_array(1.0 / single)
    factor = splu(
        (two_body.nearest + drag).tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
    )
    tensor_scale = np.repeat(0.9 / radii**3, 5)

    places = np.ascontiguousarray(positions.T)

    def rates_of(
        stresslets: NDArray[np.float64], loads: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        strains, angular, linear = mobility_product(
            places,
            radii,
            stresslets.reshape(n, 5),
            loads[: 3 * n].reshape(n, 3),
            loads[3 * n :].reshape(n, 3),
        )
        return strains.ravel(), np.concatenate([angular.ravel(), linear.ravel()])

    def residual_of(x: NDArray[np.float64], load: NDArray[np.float64]) -> NDArray[np.float64]:
        strains, rates = rates_of(x[: 5 * n], load)
        return np.concatenate([strains, rates - x[5 * n :]])

    def precondition(y: NDArray[np.float64]) -> NDArray[np.float64]:
        s = y[: 5 * n] / tensor_scale
        return np.concatenate([s, -factor.solve(y[5 * n :] / single)])

    size = 11 * n
    linear_part = LinearOperator(
        (size, size), matvec=lambda x: residual_of(x, -(two_body.near @ x[5 * n :])), dtype=float
    )
    preconditioner = LinearOperator((size, size), matvec=precondition, dtype=float)
    target = np.concatenate([-np.tile(flow.strain_five, n), np.zeros(6 * n)])
    x = np.zeros(size)
    scale = np.linalg.norm(target - residual_of(x, external))
    iterations = [0]
    misfit = np.inf
    for _ in range(REFINEMENTS):
        residual = target - residual_of(x, external - two_body.load(x[5 * n :]))
        misfit = float(np.linalg.norm(residual) / scale) if scale > 0.0 else 0.0
        if misfit <= tolerance:
            break
        step, _ = gmres(
            linear_part,
            residual,
            rtol=max(0.1 * tolerance / misfit, 1e-3),
            restart=80,
            maxiter=3,
            M=preconditioner,
            callback=lambda _: iterations.__setitem__(0, iterations[0] + 1),
            callback_type="pr_norm",
        )
        x += step
    else:
        raise ArithmeticError(
            f"the velocities of {n} spheres are known to {misfit:.1e} only, not to {tolerance:.1e}"
        )
    rates, gradient = x[5 * n :], flow.gradient
    stresslets = x[: 5 * n].reshape(n, 5).copy()
    if level.lubrication is not None:
        pair_stresslets(positions, radii, rates, *level, flow.strain_five, stresslets)
    vorticity = np.array(
        [gradient[2, 1] - gradient[1, 2], gradient[0, 2] - gradient[2, 0], gradient[1, 0] - gradient[0, 1]]
    )
    return Solution(
        rates[3 * n :].reshape(n, 3) + positions @ gradient.T,
        rates[: 3 * n].reshape(n, 3) + 0.5 * vorticity,
        -stresslets,
        iterations[0],
        misfit,
    )
