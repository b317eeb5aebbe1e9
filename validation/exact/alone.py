"""One aggregate alone in the flow: its dynamics through the engine's public door, and statics that share nothing with its own.

Statics: the primaries of a cluster that holds its shape are free of torque (frictionless contacts) or turn with it (welded);
each bears the hydrodynamic force of its motion relative to the free one, and the bonds carry these forces on.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from mcdem.aggregates.rigidity import rigidity_matrix
from mcdem.hydrodynamics.two_sphere.tensors import STRAIN_BASIS
from validation.exact.settling import rigid_motions

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from mcdem.aggregates.aggregate import Aggregate
    from mcdem.encounter.simulate import EncounterResult, Recorder
    from mcdem.scene import Scene

FAR = 200.0
"""Distance [a] along the vorticity at which a free primary passes: its disturbance is below 1e-7 of the flow."""


def sheared(
    scene: Scene,
    aggregate: Aggregate,
    strain: float,
    *,
    shortcuts: bool = True,
    record: Recorder | None = None,
) -> EncounterResult:
    """Shear an aggregate, as it lies, for g t = `strain`: an encounter with a primary that passes far away.

    Identities 0 .. P - 1 of the result are the aggregate's primaries.
    """
    import mcdem

    radius = scene.suspension.radius
    reach = aggregate.outer_radius(radius) + radius
    y0 = scene.numerics.start_distance * reach  # Eq. 21 then gives 1/g for the approach
    changes: dict[str, object] = {
        "numerics.rotations": (strain - 1.0) / (4.0 * math.pi),
        "numerics.far_approach": 0.0,
    }
    if not shortcuts:
        changes |= {
            "numerics.rigid_rotation": False,
            "numerics.end_stable": False,
            "numerics.separation": 0.0,
        }
    return mcdem.simulate_encounter(
        scene.with_changes(changes),
        aggregate,
        mcdem.Aggregate.monomer(),
        (FAR * radius, y0),
        orient=False,
        record=record,
    )


def is_split(result: EncounterResult, size: int) -> bool:
    """Whether the aggregate of `size` primaries came apart."""
    return sum(bool((members < size).any()) for members in result.members) > 1


def threshold(happens: Callable[[float], bool], low: float, high: float, ratio: float = 1.01) -> float:
    """The stress [Pa] from which on something happens, by bisection in the logarithm to within `ratio`.

    nan if it does not happen at `high`; `low` if it happens there.
    """
    if not happens(high):
        return math.nan
    if happens(low):
        return low
    while high > ratio * low:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if happens(middle) else (middle, high)
    return math.sqrt(low * high)


class Held:
    """A cluster that holds its shape, free of force and torque as a whole: what the fluid does to each primary.

    positions : (N, 3) [a].  Its primaries are free of torque, or, welded, turn with it.
    """

    def __init__(self, scene: Scene, positions: NDArray[np.float64], welded: bool = False) -> None:
        self.scene, self.positions = scene, np.asarray(positions, float) - np.mean(positions, axis=0)
        n = len(self.positions)
        self.rows = 6 * n if welded else 3 * n
        free = self.moved(self.positions)
        loads = np.eye(self.rows, 6 * n).reshape(self.rows, 2, n, 3)
        mobility = np.array(
            [(self.moved(self.positions, *load) - free).ravel()[: self.rows] for load in loads]
        )
        self.resistance = np.linalg.inv(0.5 * (mobility + mobility.T))
        self.rigid = rigid_motions(self.positions)[: self.rows]

    def moved(self, positions, *load: NDArray[np.float64]) -> NDArray[np.float64]:
        """(2, N, 3) linear [a g] and angular [g] velocities under forces and torques (N, 3) [reduced]."""
        import mcdem

        units = self.scene.reduced
        forces = [x * unit for x, unit in zip(load, (units.force, units.energy))]
        found = mcdem.velocities(self.scene, positions * units.length, *forces)
        return np.array([found.linear / units.velocity, found.angular * units.time])

    def forces(self, turn: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """(N, 3) [N] on the primaries once the cluster is turned by the matrix `turn` (3, 3), seen from the cluster."""
        turn = np.eye(3) if turn is None else turn
        flow = (self.moved(self.positions @ turn.T) @ turn).ravel()[: self.rows]
        pulled = self.resistance @ self.rigid
        # A straight row can turn about itself: the shortest of its motions.
        motion = np.linalg.lstsq(self.rigid.T @ pulled, pulled.T @ flow, rcond=1e-9)[0]
        load = self.resistance @ flow - pulled @ motion
        return load[: 3 * len(self.positions)].reshape(-1, 3) * self.scene.reduced.force


def largest_tension(held: Held, balance: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> float:
    """Largest tension [N] of any bond in any orientation in shear (`worst_orientation`)."""
    return worst_orientation(held, balance)[0]


def worst_orientation(
    held: Held, balance: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> tuple[float, NDArray[np.float64]]:
    """Largest tension [N] of any bond in any orientation in shear, and the turn (3, 3) of the cluster that brings it.

    balance : gives tensions (B,) from forces (N, 3).  A tension is linear in the strain that the cluster sees, A : Q^T E Q;
    its largest value is the sum of products of sorted eigenvalues, here half the spread of those of A: the axis along which
    A is largest lies along the axis of stretching, that along which it is least along that of compression.
    """
    turns = Rotation.random(8, rng=np.random.default_rng(0)).as_matrix()
    strain = np.array([[0, 0, 0], [0, 0, 0.5], [0, 0.5, 0]])
    seen = turns.transpose(0, 2, 1) @ strain @ turns
    components = np.einsum("nij,bij->nb", seen, STRAIN_BASIS)
    tensions = np.array([balance(held.forces(turn)) for turn in turns])
    response = np.linalg.lstsq(components, tensions, rcond=None)[0]
    matrices = np.einsum("kb,kij->bij", response, STRAIN_BASIS)
    worst = int(np.argmax(np.ptp(np.linalg.eigvalsh(matrices), axis=1)))
    values, axes = np.linalg.eigh(matrices[worst])
    turn = np.linalg.eigh(strain)[1] @ axes.T
    # A mirror image is no turn; the sign of an axis is free.
    if np.linalg.det(turn) < 0.0:
        turn = np.linalg.eigh(strain)[1] @ (axes * [1.0, -1.0, 1.0]).T
    return float(0.5 * np.ptp(values)), turn


def bond_tensions(
    positions: NDArray[np.float64], bonds: NDArray[np.integer], forces: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(B,) tensions [N], positive in tension, by which central bonds balance `forces` (N, 3) on an isostatic cluster."""
    matrix = rigidity_matrix(np.asarray(positions, float), np.asarray(bonds))
    return np.asarray(np.linalg.lstsq(matrix.T, np.ravel(forces), rcond=None)[0], float)


def tree_tensions(
    positions: NDArray[np.float64], bonds: NDArray[np.integer], forces: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(B,) tensions [N] along the bonds of a cluster without loops: each carries the forces of one side to the other."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    x, bonds = np.asarray(positions, float), np.asarray(bonds)
    found = np.empty(len(bonds))
    for b, (i, j) in enumerate(bonds):
        rest = np.delete(bonds, b, axis=0)
        graph = coo_array((np.ones(len(rest)), (rest[:, 0], rest[:, 1])), shape=(len(x), len(x)))
        _, side = connected_components(graph, directed=False)
        along = (x[j] - x[i]) / np.linalg.norm(x[j] - x[i])
        found[b] = forces[side == side[j]].sum(axis=0) @ along
    return found
