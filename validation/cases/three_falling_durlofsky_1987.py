"""Three spheres that start in a horizontal row and fall, exchanging partners on the way."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mcdem.figures.style import BLUE, GREEN, VERMILION, canvas, legend
from validation.case import Case, Context, Findings, below

DIGITISED = Path(__file__).parent.parent / "data" / "durlofsky_1987_fig5.csv"
START = (-5.0, 0.0, 7.0)
DEPTH = {True: 250.0, False: 780.0}


def measure(context: Context):
    from scipy.integrate import solve_ivp

    from validation.exact.settling import scene, settling

    paper = scene()
    # In the plane of x (vorticity) and y (gradient), where the shear that is taken off has least to do.
    start = np.array([[x, 0.0, 0.0] for x in START])

    def rate(_, flat):
        return settling(paper, flat.reshape(3, 3), np.tile([0.0, -1.0, 0.0], (3, 1)))[0].ravel()

    def deep(_, flat):
        return flat.reshape(3, 3)[:, 1].min() + DEPTH[context.quick]

    deep.terminal = True
    found = solve_ivp(
        rate, (0.0, 2000.0), start.ravel(), rtol=1e-7, atol=1e-7, events=[deep], dense_output=True
    )
    return found.sol(np.linspace(0.0, found.t[-1], 1500)).T.reshape(-1, 3, 3)[:, :, :2]


def judge(context: Context, paths):
    paths = np.array(paths)  # (times, spheres, x and y)
    points = np.loadtxt(DIGITISED, delimiter=",")
    far = np.abs(paths).max()
    points = points[points[:, 1] > -0.97 * far]
    # Sideways distance to the nearest path at the same depth.
    sideways = np.min(
        [
            np.abs(np.interp(-points[:, 1], -p[:, 1], p[:, 0]) - points[:, 0])
            for p in paths.transpose(1, 0, 2)
        ],
        axis=0,
    )
    first = points[:, 1] > -100.0
    checks = [
        below(
            "first 100 a: median sideways distance from the published paths",
            np.median(sideways[first]),
            0.1,
            unit="a",
        ),
        below("first 100 a: largest", sideways[first].max(), 0.3, unit="a"),
        below(f"to a depth of {far:.0f} a: median", np.median(sideways), 0.2, unit="a"),
    ]

    def draw():
        figure, axes = canvas(width=3.5, height=4.2)
        for k, (colour, line) in enumerate(((BLUE, "-"), (VERMILION, "--"), (GREEN, "-."))):
            axes.plot(
                paths[:, k, 0], paths[:, k, 1], line, color=colour, label=f"toolkit, from x = {START[k]:g} a"
            )
        axes.plot(*points.T, "k.", ms=3, label="published")
        axes.set(xlabel="x / a", ylabel="depth / a")
        legend(axes, loc="lower left")
        return figure

    return Findings(tuple(checks), draw, "Three spheres fall from a horizontal row.")


CASE = Case(
    chapter=2,
    claim="Three spheres that fall from a horizontal row take the paths of the first Stokesian dynamics.",
    source="Durlofsky, Brady & Bossis 1987, Fig. 5 (there against Ganatos, Pfeffer & Weinbaum 1978), as digitised in "
    "Pecnut/stokesian-dynamics",
    tolerance="0.1 a in the median and 0.3 a at most over the first 100 a, which is how well the figure was read; later small "
    "differences grow",
    measure=measure,
    judge=judge,
    seen=("distances_double",),
    inputs=lambda context: (DIGITISED,),
)
