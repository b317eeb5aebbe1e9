"""The shear stress that breaks a touching doublet, and how the lubrication cut-off moves it."""

from __future__ import annotations

import math

import numpy as np

from mcdem.figures.style import CYCLE, LINES, MARKERS, canvas, legend
from validation.case import Case, Context, Findings, above, below, near, shown

TOUCHING_FORCE = 6.12
"""Tension of a touching doublet on the extension axis, over pi mu g a^2 (Nir & Acrivos 1973)."""
CUTOFFS = (2e-3, 5e-3, 1e-2, 2e-2)
QUICK = (5e-3, 1e-2)
PAPER = (5e-3, "matrix")
STATIC_STRESS = 1000.0


def scene(cutoff: float, convention: str, stress: float = STATIC_STRESS):
    import mcdem

    return mcdem.load_scene("scenes/paper-1000Pa.toml").with_changes(
        {
            "flow.shear_stress": f"{stress} Pa",
            "hydrodynamics.lubrication_cutoff": cutoff,
            "hydrodynamics.cutoff_convention": convention,
            "numerics.implicit.max_step": 0.05,
        }
    )


def doublet(scene, angle: float):
    """Two primaries at rest in contact, in the plane of shear at `angle` from the flow."""
    import mcdem

    gap = scene.kernels.contact.equilibrium_gap
    half = (1.0 + 0.5 * gap) * scene.suspension.radius * np.array([0.0, math.sin(angle), math.cos(angle)])
    return mcdem.Aggregate(np.array([-half, half]), np.array([[0, 1]], np.int32))


def held(scene, gap: float) -> float:
    """Force [pi mu g a^2] that holds a doublet of this gap [a] on the extension axis."""
    from validation.exact.alone import Held

    n = np.array([0.0, 1.0, 1.0]) / math.sqrt(2.0)
    forces = Held(scene, (1.0 + 0.5 * gap) * np.array([-n, n])).forces()
    return float(forces[1] @ n) / (math.pi * scene.flow.shear_stress * scene.suspension.radius**2)


def parts(context: Context):
    cutoffs = QUICK if context.quick else CUTOFFS
    return {f"delta {d:g}, {r}": [d, r] for d in cutoffs for r in ("matrix", "gap")} | {
        "no cut-off": [0.0, "matrix"]
    }


def measure(context: Context, part):
    from validation.exact.alone import sheared, threshold

    cutoff, convention = part
    still = scene(cutoff, convention)
    jkr = still.kernels.contact
    adhesion = jkr.pull_off_force * still.reduced.force
    limit = adhesion / (math.pi * still.suspension.radius**2)
    found = {"cutoff": cutoff, "convention": convention, "limit": limit}
    if cutoff == 0.0:
        return found | {"static": limit / held(still, 1e-6), "dynamic": math.nan}

    def breaks(stress: float) -> bool:
        moving = scene(cutoff, convention, stress)
        # From 80 degrees to 10 the doublet turns past the extension axis.
        result = sheared(moving, doublet(moving, math.radians(80.0)), 3.0, shortcuts=False)
        return math.isfinite(result.first_bond_loss_time)

    return found | {
        "static": limit / held(still, jkr.pull_off_gap),
        "at_rest": held(still, jkr.equilibrium_gap),
        "dynamic": threshold(breaks, 1000.0, 16000.0, 1.002),
    }


def judge(context: Context, found):
    rows = {(n["cutoff"], n["convention"]): n for n in found.values()}
    whole = rows.pop((0.0, "matrix"))
    exact = whole["limit"] / TOUCHING_FORCE
    checks = [
        near("breakup stress by statics, full lubrication", whole["static"], exact, rel=0.002, unit="Pa"),
        near(
            "delta = 5e-3, frozen matrix: tension of a doublet at rest in contact over the exact one",
            rows[PAPER]["at_rest"] / TOUCHING_FORCE,
            0.86,
            abs=0.005,
        ),
        near(
            "delta = 5e-3, frozen matrix: breakup stress by statics over that of full lubrication",
            rows[PAPER]["static"] / exact,
            1.13,
            abs=0.01,
        ),
        near(
            "delta = 5e-3, frozen gap: breakup stress by statics over that of full lubrication",
            rows[5e-3, "gap"]["static"] / exact,
            1.0,
            abs=0.005,
        ),
        above("breakup stress in motion, as in the paper", rows[PAPER]["dynamic"], 1000.0, unit="Pa"),
    ]
    for (cutoff, convention), n in rows.items():
        said = f"delta = {cutoff:g}, frozen {convention}: breakup stress in motion over that by statics"
        ratio = n["dynamic"] / n["static"]
        if cutoff >= 5e-3:
            checks += [above(said, ratio, 1.0), below(said, ratio, 1.05)]
        else:
            checks.append(shown(said, ratio, why="the contact follows the flow more slowly"))

    def draw():
        figure, axes = canvas(width=4.5, height=2.8)
        for k, convention in enumerate(("matrix", "gap")):
            here = [n for (_, r), n in rows.items() if r == convention]
            for kind, fill in (("static", "none"), ("dynamic", CYCLE[k])):
                axes.semilogx(
                    [n["cutoff"] for n in here], [n[kind] for n in here], MARKERS[k] + LINES[k], ms=4, mfc=fill,
                    color=CYCLE[k], label=f"frozen {convention}, {'statics' if kind == 'static' else 'in motion'}",
                )  # fmt: skip
        axes.axhline(exact, color="0.6", lw=0.8, label="F_adh / 6.12 π a²")
        axes.set(xlabel="cut-off δ", ylabel="breakup stress (Pa)", ylim=(0.85 * exact, None))
        legend(axes, loc="lower left")
        return figure

    return Findings(
        tuple(checks), draw, "Stress that breaks a doublet, by statics on the extension axis and in motion."
    )


CASE = Case(
    chapter=5,
    claim="A doublet breaks at F_adh/(6.12 π a²) with full lubrication; the paper's cut-off raises that by a sixth, and no "
    "doublet breaks at 750 to 1000 Pa.",
    source="Nir & Acrivos 1973 (tension of a touching doublet); JKR pull-off force of Frungieri & Vanni 2021, Table 1",
    tolerance="0.2 % for 6.12, its digits; shifts by the cut-off to the digits of physics derived from Table 1; in motion up to "
    "5 % above statics: a contact takes a strain of about 0.01 to stretch, and the doublet turns meanwhile",
    measure=measure,
    judge=judge,
    parts=parts,
    seen=("strain_sign", "delta_moved", "weak_contacts"),
)
