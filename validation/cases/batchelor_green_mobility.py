"""The relative velocity of two free spheres in shear: A(r) and B(r) of Batchelor & Green, through the engine's own solver."""

from __future__ import annotations

import math

import numpy as np

from mcdem.figures.style import BLUE, VERMILION, canvas, legend
from validation.case import Case, Context, Findings, near

PUBLISHED = {2.1: (0.7324360, 0.1555507), 3.0: (0.1866626, 0.0222800)}
SPIN, STRAIN = np.array([0.5, 0.0, 0.0]), np.array([[0, 0, 0], [0, 0, 0.5], [0, 0.5, 0]])
TOUCHING_FORCE = 6.12
"""Force that holds a touching pair together on the extension axis, over pi mu g a^2 (Nir & Acrivos 1973)."""


def scene():
    import mcdem

    return mcdem.load_scene("scenes/paper-1000Pa.toml").with_changes(
        {"hydrodynamics.lubrication_cutoff": 0.0}
    )


def relative(scene, r, pull=0.0):
    """Velocity of sphere 2 relative to 1 at separation r (3,) [a], in a g; `pull` [6 pi mu a^2 g] pushes them apart."""
    import mcdem

    radius, units = scene.suspension.radius, scene.reduced
    n = r / np.linalg.norm(r)
    moved = mcdem.velocities(
        scene, np.array([0 * r, r]) * radius, np.array([-pull * n, pull * n]) * units.force
    )
    return np.diff(moved.linear, axis=0)[0] / units.velocity


def functions(scene, distance):
    """A and B from a direction in which strain has parts along and across the line."""
    n = np.array([0.0, math.sin(0.4), math.cos(0.4)])
    r = distance * n
    strained = STRAIN @ r
    slip = np.cross(SPIN, r) + strained - relative(scene, r)
    along = n @ strained
    across = strained - along * n
    return float(slip @ n / along), float(slip @ across / (across @ across))


def measure(context: Context):
    asked = scene()
    distances = [*PUBLISHED, *(2.0 + np.geomspace(1e-4, 8.0, 12 if context.quick else 40)), 40.0]
    n = np.array([0.0, 1.0, 1.0]) / math.sqrt(2)
    r = (2.0 + 1e-6) * n
    free, pushed = (n @ relative(asked, r, pull) for pull in (0.0, 1.0))
    doublet = n @ relative(asked, 3.0 * n)
    return {
        "distance": distances,
        "functions": [functions(asked, d) for d in distances],
        "touching_force": 6.0 * free / (pushed - free),
        "parting": doublet,
    }


def judge(context: Context, numbers):
    distance, found = np.array(numbers["distance"]), np.array(numbers["functions"])
    checks = []
    for k, (r, expected) in enumerate(PUBLISHED.items()):
        for name, value, wanted in zip("AB", found[k], expected):
            checks.append(near(f"{name}({r:g})", value, wanted, abs=2e-6))
    far = distance[-1]
    checks.append(near("A(40)", found[-1, 0], 5 / far**3 - 8 / far**5 + 25 / far**6, rel=1e-3))
    checks.append(near("B(40)", found[-1, 1], 16 / (3 * far**5), rel=5e-3))
    checks.append(
        near(
            "parting of a pair at r = 3 a on the extension axis, 1.5 (1 - A(3)); the wrong sign of the strain gives 1.780",
            numbers["parting"],
            1.5 * (1 - PUBLISHED[3.0][0]),
            abs=1e-5,
            unit="g a",
        )
    )
    checks.append(
        near(
            "force that holds a touching pair",
            numbers["touching_force"],
            TOUCHING_FORCE,
            abs=0.005,
            unit="π μ g a²",
        )
    )

    def draw():
        figure, axes = canvas(height=2.6)
        order = np.argsort(distance)
        for column, (name, colour, line) in enumerate((("A", BLUE, "-"), ("B", VERMILION, "--"))):
            axes.loglog(
                distance[order] - 2.0, found[order, column], line, color=colour, label=f"{name}, toolkit"
            )
            axes.loglog(
                [r - 2 for r in PUBLISHED],
                [v[column] for v in PUBLISHED.values()],
                "o",
                mfc="none",
                color=colour,
            )
        gaps = np.geomspace(2, 38, 30)
        axes.loglog(gaps, 5 / (2 + gaps) ** 3, ":", color="k", label="far field, 5/r³ and 16/3r⁵")
        axes.loglog(gaps, 16 / 3 / (2 + gaps) ** 5, ":", color="k")
        axes.set(xlabel="gap / a", ylabel="A, B")
        legend(axes, "circles: published")
        return figure

    return Findings(tuple(checks), draw, "Mobility functions of two free spheres in a straining flow.")


CASE = Case(
    chapter=1,
    claim="Two free spheres move in shear as A(r) and B(r) of Batchelor & Green say, and a touching pair bears 6.12 π μ g a².",
    source="Batchelor & Green 1972; Nir & Acrivos 1973",
    tolerance="2e-6, the digits of the published values and of the table; 0.005 for 6.12, its last digit",
    measure=measure,
    judge=judge,
    seen=("strain_sign", "no_lubrication", "delta_moved"),
)
