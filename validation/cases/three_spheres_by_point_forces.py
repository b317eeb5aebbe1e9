"""Three spheres that settle, or are pressed together, against an exact solution: Stokesian dynamics' own error."""

from __future__ import annotations

import numpy as np

from mcdem.figures.style import BLUE, GREEN, PURPLE, VERMILION, canvas, legend
from validation.case import Case, Context, Findings, Verdict, below

GAPS = (2.0, 1.0, 0.5, 0.2, 0.1, 0.05)
TRIANGLE = np.array([[np.cos(t), np.sin(t), 0.0] for t in np.pi * np.array([3, 7, 11]) / 6]) / np.sqrt(3)
LINE = np.array([[-1.0, 0, 0], [0, 0, 0], [1, 0, 0]])
PRESSED = np.concatenate([-np.sqrt(3) * TRIANGLE.ravel(), np.zeros(9)])
MODES = {
    "triangle, across its plane": (TRIANGLE, np.tile([0.0, 0, 1], 3)),
    "triangle, in its plane": (TRIANGLE, np.tile([1.0, 0, 0], 3)),
    "line, along": (LINE, np.tile([1.0, 0, 0], 3)),
    "line, across": (LINE, np.tile([0.0, 1, 0], 3)),
}


def parts(context: Context):
    return {f"{gap:g}": gap for gap in ((2.0, 0.5, 0.1) if context.quick else GAPS)}


def measure(context: Context, gap: float):
    from validation.exact import point_forces
    from validation.exact.settling import mobility, scene

    rows = {}
    for shape in (TRIANGLE, LINE):
        positions = (2.0 + gap) * shape
        exact = np.linalg.inv(point_forces.resistance(positions, np.ones(3), 150)[:18, :18])
        ours = mobility(scene(), positions)
        for name, (of, forces) in MODES.items():
            if of is shape:
                load = np.concatenate([forces, np.zeros(9)])
                rows[name] = [difference(ours @ load, exact @ load), (exact @ load)[:9].reshape(3, 3)]
        if shape is TRIANGLE:
            rows["triangle, pressed together"] = [difference(ours @ PRESSED, exact @ PRESSED)]
    return rows


def difference(ours, exact):
    """Largest difference of a velocity, over the largest velocity."""
    return np.abs(ours - exact)[:9].max() / np.abs(exact[:9]).max()


def judge(context: Context, found):
    gaps = np.array([float(label) for label in found])
    modes = list(next(iter(found.values())))
    errors = {mode: np.array([found[label][mode][0] for label in found]) for mode in modes}
    settling = np.max([errors[mode] for mode in MODES], axis=0)
    close = gaps < 1.0
    checks = [
        below("settling at gaps of 2 a: largest relative error", settling[gaps == 2.0].max(), 1e-3),
        below("settling at all gaps: largest relative error", settling.max(), 0.015),
        below(
            "pressing the triangle together: largest relative error",
            errors["triangle, pressed together"].max(),
            0.05,
            gap="Stokesian dynamics' own error again, largest where three gaps close at once",
        ),
        below(
            "settling at gaps of 0.5 a and less: largest relative error",
            settling[close].max(),
            1e-3,
            gap="Stokesian dynamics' own error: what three close spheres do to each other beyond their stresslets is not in "
            "it, and lubrication is added pair by pair",
        ),
    ]

    def draw():
        figure, axes = canvas(width=4.5, height=3.0)
        lines = zip(modes, (VERMILION, BLUE, GREEN, PURPLE, "k"), ("o-", "s--", "^-.", "D:", "v-"))
        for mode, colour, line in lines:
            axes.loglog(gaps, errors[mode], line, ms=3, color=colour, label=mode)
        axes.set(xlabel="gap / a", ylabel="relative error of velocity")
        legend(axes)
        return figure

    return Findings(
        tuple(checks),
        draw,
        "Error of Stokesian dynamics for three equal spheres under equal forces, against the gap.",
    )


CASE = Case(
    chapter=2,
    claim="Three spheres settle as exact solutions say, within Stokesian dynamics' own error of about 1 % at gaps near 0.1 a.",
    source="point forces (own, validation/exact/point_forces.py, 1e-5 at these gaps by its two-sphere error); Wilson 2013 finds "
    "SD's largest error at gaps near 0.1 a",
    tolerance="1e-3 where spheres are 2 a apart; 1.5 % anywhere, the size of error known of the method",
    measure=measure,
    judge=judge,
    parts=parts,
    seen=("no_lubrication",),
    expected=Verdict.known_gap,
    because="Stokesian dynamics' own error, 1 % in settling and more in squeezing three spheres together, "
    "is shown: lubrication is pairwise and moments beyond the "
    "stresslet of three close spheres are left out; published and unavoidable in this method.",
)
