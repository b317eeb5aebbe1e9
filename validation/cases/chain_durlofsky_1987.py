"""Fifteen spheres in a row that settle across their line."""

from __future__ import annotations

import numpy as np

from mcdem.figures.style import BLUE, canvas, legend
from validation.case import Case, Context, Findings, near

DIGITISED = (0.5018, 0.5029, 0.5054, 0.5102, 0.5183, 0.5321, 0.5559, 0.6170)
"""F/(6 pi mu a U) from the centre to the end, read off their Fig. 1."""


def measure(context: Context):
    from validation.exact.settling import scene, settling

    positions = 4.0 * np.arange(15)[:, None] * [1.0, 0.0, 0.0]
    return 1.0 / settling(scene(), positions, np.tile([0.0, 1.0, 0.0], (15, 1)))[0][:, 1]


def judge(context: Context, drag):
    checks = [
        near(f"drag of sphere {k} from the centre", drag[7 + k], published, abs=1e-3)
        for k, published in enumerate(DIGITISED)
    ]
    checks.append(near("drag of the two ends alike", drag[0], drag[-1], rel=1e-10))

    def draw():
        figure, axes = canvas(height=2.4)
        axes.plot(np.arange(-7, 8), drag, "-", color=BLUE, label="toolkit")
        axes.plot(range(8), DIGITISED, "ko", mfc="none", label="Durlofsky, Brady & Bossis 1987")
        axes.set(xlabel="sphere from the centre", ylabel="F / (6 π μ a U)")
        legend(axes)
        return figure

    return Findings(
        tuple(checks), draw, "Fifteen spheres 4 a apart settle across their line under equal forces."
    )


CASE = Case(
    chapter=2,
    claim="Fifteen spheres in a row settle as in the first Stokesian dynamics.",
    source="Durlofsky, Brady & Bossis 1987, Fig. 1, digitised",
    tolerance="1e-3: how well the figure can be read",
    measure=measure,
    judge=judge,
    seen=("distances_long",),
)
