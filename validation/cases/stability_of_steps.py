"""The largest stable step of each scheme against elastic modulus, cut-off and viscosity, beside what theory predicts."""

from __future__ import annotations

import numpy as np

from mcdem.scene import Numerics, load_scene
from validation import stability_map
from validation.case import Case, Context, Findings, above, below, near, shown

# Quick: the least, the paper's and the most demanding, one parameter each.
FEW = (
    ("contact", "elastic_modulus", 3.4e9),
    ("contact", "cutoff", 1e-3),
    ("snap_in", "elastic_modulus", 3.4e9),
    ("turning", "viscosity", 10.0),
)


def measure(context: Context):
    if context.quick:
        rows = [row for point in FEW for row in stability_map.measure_point(*point)]
    else:
        rows = stability_map.measure()
    compressed = {}
    for stress in (750, 875, 1000):
        scene = load_scene(stability_map.PAPER.with_name(f"paper-{stress}Pa.toml"))
        compressed[str(stress)] = stability_map.predicted_contact(scene, 5.0) / scene.flow.shear_rate
    return {"anew": rows, "kept": stability_map.kept(), "compressed": compressed}


def ratios(rows, motion, scheme):
    """Measured over predicted limit, in the order of the rows."""
    found = stability_map.of(rows, motion=motion, scheme=scheme)
    return stability_map.steps_of(found) / np.array([row["predicted_for_euler"] for row in found])


def judge(context: Context, numbers):
    rows = numbers["kept"] if context.quick else numbers["anew"]
    checks = []
    for motion, (low, high) in {
        "contact": (0.95, 1.02),
        "snap_in": (0.95, 1.25),
        "turning": (0.9, 1.05),
    }.items():
        words = stability_map.MOTIONS[motion].words
        over = ratios([row for row in rows if straight(row)], motion, "euler")
        checks += [
            above(f"explicit Euler, {words}: least of measured over predicted limit", over.min(), low),
            below(f"explicit Euler, {words}: largest", over.max(), high),
        ]
    eq20 = ratios(rows, "snap_in", "paper") / ratios(rows, "snap_in", "euler")
    checks.append(near("Eq. 20 over plain Euler, snap-in: largest", eq20.max(), 1.0, abs=0.1))
    implicit = min(in_strain(row, "largest_step") for row in stability_map.of(rows, scheme="implicit"))
    checks.append(
        above("implicit: least of its largest steps", implicit, Numerics().implicit.max_step, unit="1/g")
    )
    known = {key(row): row["largest_step"] for row in numbers["kept"]}
    apart = max(
        abs(np.log(row["largest_step"] / known[key(row)])) if row["largest_step"] else np.inf
        for row in numbers["anew"]
    )
    checks.append(
        below(f"{len(numbers['anew'])} steps measured anew: largest deviation (logarithm)", apart, 0.05)
    )
    for parameter, words, unit, papers in (
        ("elastic_modulus", "elastic modulus from which", "Pa", "3.4 GPa"),
        ("cutoff", "cut-off from which", "a", "5e-3 a"),
        ("viscosity", "viscosity below which", "Pa s", "0.075 to 0.1 Pa s"),
    ):
        found = stability_map.crossing(rows, parameter)
        checks.append(
            shown(f"{words} dt_b = 1 us is past Euler's limit", found, unit=unit, why=f"paper: {papers}")
        )
    for stress, limit in numbers["compressed"].items():
        checks.append(
            shown(
                f"{stress} Pa, a contact compressed by 5 F_adh: predicted limit over dt_b",
                limit / stability_map.PAPERS_STEP,
                why="past its limit below 1",
            )
        )
    return Findings(tuple(checks), lambda: stability_map.draw(rows), stability_map.CAPTION)


def in_strain(row, what):
    """A time of a row [1/g]; 0 for the largest step where none holds."""
    return (row[what] or 0.0) * stability_map.SWEEPS[row["parameter"]].shear_rate


def straight(row):
    """Whether a step at the predicted limit hardly turns a bond: longer ones stretch it, and that stretch limits them first."""
    return row["motion"] != "turning" or in_strain(row, "predicted_for_euler") <= 0.03


def key(row):
    """What a row is about."""
    return row["motion"], row["parameter"], row["value"], row["scheme"]


CASE = Case(
    chapter=8,
    claim="Explicit steps are stable up to twice the relaxation time of a contact, which the paper's step of 1 us leaves "
    "behind for stiff contacts, thin fluids and wide cut-offs; implicit steps are not bound by it.",
    source="Frungieri & Vanni 2021, Table 1 (dt_b) and Eq. 20; stability limit of explicit Euler, 2 over the largest "
    "eigenvalue of mobility times stiffness",
    tolerance="steps are bisected to 3 %; what is predicted is the linear limit, so a few per cent where contacts are loaded; "
    "the snap-in by the landing depth at the worst place on the way; a turning cluster where a step turns it by less than 0.03",
    measure=measure,
    judge=judge,
    inputs=lambda context: (stability_map.KEPT,),
    saved=lambda context: (stability_map.KEPT,),
    anew="four points of it; in the full mode all, which are judged then",
    seen=("delta_moved",),
)
