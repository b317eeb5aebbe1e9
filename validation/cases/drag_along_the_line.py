"""Two spheres moving along, and turning about, their line of centres, against closed series."""

from __future__ import annotations

import numpy as np

from mcdem.figures.style import BLUE, GREEN, PURPLE, VERMILION, canvas, legend
from validation.case import Case, Context, Findings, below, near


def measure(context: Context):
    from mcdem.hydrodynamics.two_sphere import tables as two_sphere
    from validation.exact.bispherical import drag_along_the_line, torque_about_the_line

    table, raw = two_sphere.lubrication_table(1.0), np.empty(22)
    columns = two_sphere.lubrication_columns(1.0)
    rows = []
    for gap in np.geomspace(1e-6, 4.0, 8 if context.quick else 25):
        series, far = two_sphere.exact(gap), two_sphere.far_field(gap)
        two_sphere.lubrication_scalars(gap, table, raw)
        used = {name: far[name] + raw[k] for k, name in enumerate(columns)}
        rows.append(
            {
                "gap": gap,
                "exact": [*drag_along_the_line(gap), *torque_about_the_line(gap)],
                **{how: combine(f) for how, f in (("series", series), ("table", used))},
            }
        )
    return rows


def combine(f):
    """Opposite and same motion along, opposite and same rotation about the line, each over that of a single sphere."""
    return [
        float(f["XA11"] - f["XA12"]),
        float(f["XA11"] + f["XA12"]),
        float(f["XC11"] - f["XC12"]) * 0.75,
        float(f["XC11"] + f["XC12"]) * 0.75,
    ]


MOTIONS = ("opposite motion", "same motion", "opposite rotation", "same rotation")


def judge(context: Context, rows):
    gaps = np.array([row["gap"] for row in rows])
    errors = {
        how: np.abs(np.array([row[how] for row in rows]) / np.array([row["exact"] for row in rows]) - 1.0)
        for how in ("series", "table")
    }
    checks = []
    for how, words in (
        ("series", "twin multipoles"),
        ("table", "far field + table, as compiled code uses them"),
    ):
        for k, motion in enumerate(MOTIONS):
            checks.append(below(f"largest relative error, {motion}: {words}", errors[how][:, k].max(), 1e-7))
    touching = rows[0]["series"]
    checks.append(
        near("same motion, almost touching (Stimson & Jeffery: 0.645)", touching[1], 0.645, abs=5e-4)
    )

    def draw():
        figure, axes = canvas(height=2.6)
        for k, (motion, colour, line) in enumerate(
            zip(MOTIONS, (VERMILION, BLUE, PURPLE, GREEN), ("-", "--", "-.", ":"))
        ):
            axes.loglog(gaps, np.maximum(errors["table"][:, k], 1e-16), line, color=colour, label=motion)
        axes.axhline(1e-7, color="k", lw=0.5)
        axes.set(xlabel="gap / a", ylabel="relative error")
        legend(axes, "line at 1e-7: tolerance")
        return figure

    return Findings(tuple(checks), draw, "Error of the compiled two-sphere functions against closed series.")


CASE = Case(
    chapter=1,
    claim="Drag and torque of two spheres along their line of centres are exact from gaps of 1e-6 a to 4 a.",
    source="Stimson & Jeffery 1926; Brenner 1961; Jeffery 1915",
    tolerance="1e-7: the series is cut at 1000 orders, which near contact leaves some 1e-8",
    measure=measure,
    judge=judge,
    seen=("squeeze_low",),
)
