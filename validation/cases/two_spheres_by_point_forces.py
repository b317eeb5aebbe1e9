"""All 44 resistance functions of two spheres against an independent method."""

from __future__ import annotations

import numpy as np

from validation.case import Case, Context, Findings, below

DIRECTION = np.array([1.0, -2.0, 0.5]) / np.sqrt(5.25)
PAIRS = ((1.0, 0.5), (0.6, 1.0), (1.0, 3.0), (4.0, 1.0))
"""(gap/a1, a2/a1)"""


def measure(context: Context):
    from mcdem.hydrodynamics import two_sphere
    from validation.exact import point_forces

    errors = []
    for gap, ratio in PAIRS[:1] if context.quick else PAIRS:
        ours = two_sphere.resistance_matrix(DIRECTION, gap, ratio)
        centres = np.outer([0.0, 1.0 + ratio + gap], DIRECTION)
        theirs = point_forces.resistance(centres, [1.0, ratio])
        blocks = {"force": slice(0, 6), "torque": slice(6, 12), "stresslet": slice(12, 22)}
        for name, rows in blocks.items():
            errors.append([gap, ratio, name, np.abs(ours - theirs)[rows].max() / np.abs(ours[rows]).max()])
    return errors


def judge(context: Context, errors):
    return Findings(
        tuple(
            below(f"largest error of a {name}, gap {gap:g} a, radii 1 : {ratio:g}", error, 2e-5)
            for gap, ratio, name, error in errors
        )
    )


CASE = Case(
    chapter=1,
    claim="All 44 resistance functions of two spheres, unequal ones too, are those of an independent method.",
    source="point forces inside the spheres, collocated on their surfaces (own, validation/exact/point_forces.py)",
    tolerance="2e-5 of the largest: how well 250 point forces a sphere meet the boundary condition at gaps of 0.6 a",
    measure=measure,
    judge=judge,
    seen=("torque_sign", "squeeze_low"),
)
