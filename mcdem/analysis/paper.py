"""What Frungieri & Vanni print in their text and tables; their figures' data are not published.

Everything here is theirs, for comparison; nothing of it enters a calculation.
"""

from __future__ import annotations

import numpy as np

from mcdem.scene import Scene

SOURCE = "Frungieri & Vanni (2021)"

COLLISION_EFFICIENCY = {750.0: 0.078, 875.0: 0.076}
"""eta_11 from Eq. 23, by shear stress [Pa]; section 3.1."""

RELATIVE_DEVIATION = 0.60
"""sigma_P / <P> at steady state, 1000 Pa; section 3.1."""

GYRATION_PREFACTOR, GYRATION_EXPONENT = 3.34, 1.68
"""k_g and d_g at 1000 Pa, clusters of P > 3; section 3.2."""
EXPONENT_RANGES = {"gyration": (2.1, (1.6, 1.7)), "outer": (1.9, (1.5, 1.6))}
"""d_g and d_o at 1000 Pa: at first, and the range at steady state; section 3.2."""

ACCELERATED = {750.0: True, 875.0: True, 1000.0: False}
"""Whether growth accelerates before breakup dampens it, by shear stress [Pa]; section 3.1."""

SLIGHTLY_ELONGATED = (1.25, 2.00)
"""Most aggregates' A.R. at 1000 Pa; section 3.2."""
RODS_ABOVE = 2.50
SMALLEST_ASPECT_RATIO = 1.2

COORDINATION = (5.0, 6.0)
"""n_c of aggregates of more than 15 primaries, 1000 Pa; section 3.2."""

BREAKUP_EXPONENT = 2.0
"""q in P_br ~ stress^-q, and of <P> as well; section 3.3."""

COMPARABLE_FRAGMENTS, COMPARABLE_SHARE, LIKELIEST_FRAGMENT = (0.45, 0.75), 0.80, 0.60
"""Largest fragment over parent, 1000 Pa: more than 80 % of the events in this range, peak at 60 %; section 3.3."""
EROSION_PEAK, EROSION_SHARE = (0.90, 0.95), 0.10
"""Second peak, section 3.3; share of erosion, section 4."""

CLUSTERS = [
    # stress [Pa], P, solid fraction of the outer sphere
    (750.0, 17, 0.18),
    (750.0, 22, 0.15),
    (750.0, 64, 0.052),
    (1000.0, 12, 0.18),
    (1000.0, 17, 0.11),
    (1000.0, 19, 0.081),
]
"""Fig. 10."""

TABLE_2 = np.array(
    [
        # P, R_g/a, R/a, A.R., n_c; 750 Pa
        (21, 2.76, 5.08, 2.25, 5.43),
        (54, 4.10, 8.42, 1.69, 5.33),
        (27, 3.56, 7.20, 2.90, 5.41),
        (15, 2.18, 4.20, 1.43, 5.20),
        (15, 2.28, 4.16, 1.38, 5.20),
        (18, 2.88, 5.82, 2.90, 5.33),
        (22, 2.68, 4.84, 1.74, 5.46),
        (30, 3.24, 6.48, 1.49, 5.68),
        (29, 3.34, 6.84, 2.44, 5.59),
        (19, 3.20, 6.38, 3.64, 5.37),
    ]
)


TABLE_2_STRESS = 750.0
"""[Pa]"""


def is_suspension(scene: Scene) -> bool:
    """Whether a scene has Table 1's primaries, volume fraction and shear rate, at whatever stress."""
    given = [scene.suspension.radius, scene.suspension.volume_fraction, scene.flow.shear_rate]
    return bool(np.allclose(given, [500e-9, 1e-4, 1e4], rtol=1e-3))


def holds_for(scene: Scene, stress: float) -> bool:
    """Whether a scene has Table 1's suspension at a stress [Pa] for which the paper prints a number."""
    return is_suspension(scene) and bool(np.isclose(scene.flow.shear_stress, stress, rtol=1e-3))


STRESSES = (750.0, 875.0, 1000.0)
"""The shear stresses [Pa] of its three suspensions."""
