"""The mobility of two spheres that know each other by force, torque and stresslet only, and its inverse.

This is the far field of Stokesian dynamics, Rotne & Prager's mobility with rotation and strain, for a single pair.
Units as in `two_sphere`: lengths a1, mobilities 1/(6 pi mu a1^n), ratio a2/a1.
"""

from __future__ import annotations

import numpy as np


def mobility_orders(ratio: float) -> list[np.ndarray]:
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


def scalars(blocks: list[np.ndarray]) -> dict[str, np.ndarray]:
    """The 44 functions from resistances in the blocks of `mobility_orders`."""
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


def resistance(distance: np.ndarray, ratio: float) -> dict[str, np.ndarray]:
    """The 44 resistance functions at centre distances r [a1] of the inverted pair mobility."""
    inverse_distance = (1.0 / np.asarray(distance, dtype=float))[..., None, None]
    return scalars(
        [
            np.linalg.inv(sum(inverse_distance**order * block for order, block in enumerate(orders)))
            for orders in mobility_orders(ratio)
        ]
    )


def resistance_orders(ratio: float, orders: int) -> dict[str, np.ndarray]:
    """Coefficients of the powers 0 to `orders` of 1/r in the same functions, by dividing the power series."""
    blocks = []
    for mobility in mobility_orders(ratio):
        block = np.zeros((orders + 1, *mobility.shape[1:]))
        block[0] = np.linalg.inv(mobility[0])
        for k in range(1, orders + 1):
            reflected = sum(mobility[j] @ block[k - j] for j in range(1, min(k, len(mobility) - 1) + 1))
            block[k] = -block[0] @ reflected
        blocks.append(block)
    return scalars(blocks)
