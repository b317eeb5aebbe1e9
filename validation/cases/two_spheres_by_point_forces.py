"""All 44 resistance functions of two spheres against an independent method, and how those across the line grow at contact."""

from __future__ import annotations

import numpy as np

from validation.case import Case, Context, Findings, below, near

DIRECTION = np.array([1.0, -2.0, 0.5]) / np.sqrt(5.25)
PAIRS = ((1.0, 0.5, 250, 0.5), (0.6, 1.0, 250, 0.5), (1.0, 3.0, 600, 0.6), (4.0, 1.0, 250, 0.5))
"""(gap/a1, a2/a1, point forces in each sphere, their depth); with 250 a sphere three times as large is met to 4e-4 only."""
ACROSS = 0.1
"""Gap [a] down to which motions across the line, which squeeze nothing, are met well."""
SLIDING = (1e-2, 1e-3)
"""Gaps [a] down to which at least the forces of sliding are."""
CLOSEST = (1e-6, 1e-5)
LOGARITHMS = {"YA11": 1 / 6, "YA12": -1 / 6, "YC11": 1 / 5, "YC12": 1 / 20}
"""Of lubrication theory: what grows with ln(a/gap), in 6 pi mu a and 8 pi mu a^3."""


def measure(context: Context):
    from mcdem.hydrodynamics.two_sphere import tables as two_sphere
    from validation.exact import point_forces

    errors = []
    for gap, ratio, sources, depth in PAIRS[:1] if context.quick else PAIRS:
        ours = two_sphere.resistance_matrix(DIRECTION, gap, ratio)
        centres = np.outer([0.0, 1.0 + ratio + gap], DIRECTION)
        theirs = point_forces.resistance(centres, [1.0, ratio], sources, depth)
        blocks = {"force": slice(0, 6), "torque": slice(6, 12), "stresslet": slice(12, 22)}
        for name, rows in blocks.items():
            errors.append([gap, ratio, name, np.abs(ours - theirs)[rows].max() / np.abs(ours[rows]).max()])
    across = {}
    for gap in (ACROSS, *SLIDING):
        line = np.array([0.0, 0.0, 1.0])
        ours = two_sphere.resistance_matrix(line, gap, 1.0)
        theirs = point_forces.resistance(np.outer([0.0, 2.0 + gap], line), [1.0, 1.0], 150)
        # Of sphere 1: a velocity along x and a rotation about y; its own force and the other's from the velocity.
        whole = [0, 7]
        across[f"{gap:g}"] = [
            float(np.abs(ours - theirs)[:, whole].max() / np.abs(ours[:, whole]).max()),
            float(np.abs(ours - theirs)[[0, 3], 0].max() / ours[0, 0]),
        ]
    near_contact = [two_sphere.exact(gap) for gap in CLOSEST]
    decade = np.log(CLOSEST[1] / CLOSEST[0])
    grown = {
        name: float(near_contact[0][name] - near_contact[1][name])
        / decade
        * (0.75 if name[1] == "C" else 1.0)
        for name in LOGARITHMS
    }
    return {"errors": errors, "across": across, "grown": grown}


def judge(context: Context, found):
    checks = [
        below(f"largest error of a {name}, gap {gap:g} a, radii 1 : {ratio:g}", error, 2e-5)
        for gap, ratio, name, error in found["errors"]
    ]
    checks.append(
        below(f"gap {ACROSS:g} a: largest error of what motion and rotation across the line do",
              found["across"][f"{ACROSS:g}"][0], 2e-4)
    )  # fmt: skip
    checks += [
        below(f"gap {gap:g} a: largest error of the two forces of sliding", found["across"][f"{gap:g}"][1], 2e-3,
              why="rotation is not met so close")
        for gap in SLIDING
    ]  # fmt: skip
    checks += [
        near(f"{name[:2]}_{name[2:]}: growth with ln(a/gap) from {CLOSEST[1]:g} to {CLOSEST[0]:g} a", found["grown"][name],
             expected, abs=1e-4)
        for name, expected in LOGARITHMS.items()
    ]  # fmt: skip
    return Findings(tuple(checks))


CASE = Case(
    chapter=1,
    claim="All 44 resistance functions of two spheres, unequal ones too, are those of an independent method.",
    source="point forces inside the spheres, collocated on their surfaces (own, validation/exact/point_forces.py); logarithms "
    "of sliding and rolling: Goldman, Cox & Brenner 1967, Jeffrey & Onishi 1984",
    tolerance="2e-5 of the largest: how well 250 point forces a sphere meet the boundary condition at gaps of 0.6 a; nearer, "
    "2e-4 and 2e-3, since rings of point forces follow the film less and less; 1e-4 of the logarithms' factors, what the gap "
    "times its logarithm adds at 1e-5",
    measure=measure,
    judge=judge,
    seen=("torque_sign", "squeeze_low"),
)
