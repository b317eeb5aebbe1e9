"""Clusters whose contacts transmit torques, sheared until they lose a bond: size against stress, in motion and by statics.

python -m validation.cases.breakup_fractal_motion > validation/data/fractal_motion.json
"""

from __future__ import annotations

import json
import math

import numpy as np
from scipy.spatial.transform import Rotation

from mcdem.figures.style import BLUE, GREEN, GREY, VERMILION, canvas, legend
from validation import datasets
from validation.case import Case, Context, Findings, Verdict, above, below, between, near, shown

DIMENSION = 1.8
DOUBLINGS, CLUSTERS = (3, 4, 5), 4
CHAINS = (6, 8, 11, 16)
STRAIN, BEFORE = 4.0, 0.1
"""g t of a run, and the angle [rad] by which it starts before the orientation that is worst by statics: a cluster without
symmetry does not turn about the vorticity alone, and from further off it would pass that orientation by."""
STATICS = 100.0
"""Stress [Pa] of statics; forces are proportional to it."""
FIRM = "firm rods, friction against twisting"
SCENE = "as in scenes/moments-1000Pa.toml"
BONDS = {FIRM: (50.0, 200.0, {"friction_coefficient": 1000.0}), SCENE: (5.0, 2.0, None)}
"""Stiffness [N/m] and largest displacement [nm] of the rods, and resistance to twisting, which the scene has none of; firm ones
slip at no moment that these clusters see, and friction at no torque."""
SIZES_SHOWN = (8, 16, 32)


def scene(stress: float, bonds: str):
    import mcdem

    stiffness, displacement, twisting = BONDS[bonds]
    return mcdem.load_scene("scenes/moments-1000Pa.toml").with_changes(
        {
            "flow.shear_stress": f"{stress} Pa",
            "effects.rods.stiffness": f"{stiffness} N/m",
            "effects.rods.largest_displacement": f"{displacement} nm",
            "effects.twisting": twisting,
        }
    )


def geometry(kind: str, size: int, number: int):
    """(P, 3) centres and (P - 1, 2) contacts of a tree."""
    from validation.exact.packings import fractal

    if kind == "fractal":
        return fractal(size, DIMENSION, number)
    return np.arange(size)[:, None] * [0.0, 2.0, 0.0], np.array([[k, k + 1] for k in range(size - 1)])


def parts(context: Context):
    if context.quick:
        return {"saved": None}
    several = [["fractal", k, m, FIRM] for k in DOUBLINGS for m in range(CLUSTERS)]
    several += [["fractal", k, m, SCENE] for k in DOUBLINGS for m in range(CLUSTERS // 2)]
    several += [["chain", n, 0, FIRM] for n in CHAINS]
    return {named(*part): part for part in several}


def named(kind: str, size: int, number: int, bonds: str) -> str:
    """Label of a part."""
    return f"{kind}, {2**size if kind == 'fractal' else size} primaries, {number}, {bonds}"


def measure(context: Context, part):
    return datasets.fractal_motion() if part is None else broken_at(*part)


def broken_at(kind: str, size: int, number: int, bonds: str):
    """Stresses [Pa] at which a cluster loses a bond and comes apart in motion, and by statics of the same cluster held rigid."""
    from validation.exact.alone import Held, is_split, sheared, threshold, tree_tensions, worst_orientation
    from validation.hard_cases.shapes import settled

    x, contacts = geometry(kind, size, number)
    still = scene(STATICS, bonds)
    strength = still.kernels.contact.pull_off_force * still.reduced.force
    held = Held(still, x, welded=True)
    worst, turn = worst_orientation(held, lambda forces: tree_tensions(x, contacts, forces))
    by_statics = STATICS * strength / worst
    # The flow turns it from y towards z.
    started = held.positions @ (Rotation.from_rotvec([-BEFORE, 0.0, 0.0]).as_matrix() @ turn).T

    def run(stress: float):
        at = scene(stress, bonds)
        return sheared(at, settled(at, started, seed=None), STRAIN, shortcuts=False)

    # Branches that bend may touch, and the loop that they close is strained and opens again: bonds of the tree are meant.
    tree = {frozenset(map(int, pair)) for pair in contacts}
    loses = lambda stress: bool(tree - bonds_of(run(stress)))
    splits = lambda stress: is_split(run(stress), len(x))
    first = threshold(loses, 0.3 * by_statics, 8.0 * by_statics, 1.03)
    return {
        "kind": kind,
        "bonds": bonds,
        "primaries": len(x),
        "gyration": float(np.sqrt(((x - x.mean(axis=0)) ** 2).sum(axis=1).mean())),
        "statics": by_statics,
        "first": first,
        "split": threshold(splits, first, 10.0 * first, 1.03) if math.isfinite(first) else math.nan,
    }


def bonds_of(result) -> set[frozenset[int]]:
    """Pairs of primaries that are bonded at the end of an encounter, by their identities."""
    pairs = (members[product.bonds] for product, members in zip(result.products, result.members))
    return {frozenset(map(int, pair)) for some in pairs for pair in some}


def exponent(rows, key: str) -> tuple[float, float]:
    """(q, error) of P ~ stress^-q; error: half the width of its 95 % limits."""
    from mcdem.analysis.statistics import OF_MEANS, fit_power_law

    known = [row for row in rows if math.isfinite(row[key] or math.nan)]
    fit = fit_power_law([row["primaries"] for row in known], [row[key] for row in known],
                        minimum=OF_MEANS)  # fmt: skip
    if fit is None:
        return math.nan, math.nan
    return -1.0 / fit.exponent, 0.5 * (-1.0 / fit.exponent_high + 1.0 / fit.exponent_low)


def judge(context: Context, found):
    found = found["saved"] if context.quick else found
    rows = {
        (kind, bonds): [row for row in found.values() if (row["kind"], row["bonds"]) == (kind, bonds)]
        for kind, bonds in (("fractal", FIRM), ("fractal", SCENE), ("chain", FIRM))
    }
    checks = []
    for (kind, bonds), some in rows.items():
        said = f"{kind}s, contacts {bonds}"
        q, error = exponent(some, "first")
        over = np.array([row["first"] / row["statics"] for row in some])
        apart = np.array([row["split"] / row["first"] for row in some])
        checks.append(
            above(f"{said}: stress of first bond loss in motion over statics of the rigid cluster, least", over.min(), 0.97,
                  why="statics in the worst orientation bounds it from below; contacts some 15 nm wide are soft in twisting even "
                  "where friction holds, and branches that turn about their bonds relieve them")
        )  # fmt: skip
        if kind == "chain":
            checks.append(
                below(f"{said}: the same, largest: nothing twists a straight chain", over.max(), 1.06)
            )
        checks.append(
            between(f"{said}: stress of fragmentation over that of first bond loss, median", np.median(apart), 1.0, 1.1,
                    why="in a tree the first bond that goes is the last")
        )  # fmt: skip
        wanted = (DIMENSION / 2, 0.25 * DIMENSION / 2) if kind == "fractal" else (0.65, 0.15)
        if bonds == FIRM:
            checks.append(
                near(f"{said}: q of first bond loss in motion", q, wanted[0], abs=wanted[1], error=error,
                     why="d_f/2" if kind == "fractal" else "slender bodies: 1/2 to 4/5")
            )  # fmt: skip
        checks += [
            shown(f"{said}: q of fragmentation in motion", *exponent(some, "split")[:1], error=exponent(some, "split")[1]),
            shown(f"{said}: q by statics of the same clusters", *exponent(some, "statics")[:1],
                  error=exponent(some, "statics")[1]),
            shown(f"{said}: stress of first bond loss in motion over statics, median", np.median(over)),
        ]  # fmt: skip

    def draw():
        figure, axes = canvas(width=4.8, height=3.0)
        for (kind, bonds), colour, marker in zip(rows, (BLUE, VERMILION, GREEN), "osd"):
            some = rows[kind, bonds]
            size = [row["primaries"] for row in some]
            axes.loglog([row["first"] for row in some], size, marker, ms=4, mfc="none", color=colour,
                        label=f"{kind}s, {'firm rods' if bonds == FIRM else 'as in the scene'}")  # fmt: skip
            axes.loglog([row["split"] for row in some], size, "+", ms=4, color=colour)
        some = rows["fractal", FIRM]
        span = np.geomspace(min(row["first"] for row in some), max(row["first"] for row in some), 10)
        level = np.mean(
            [math.log(row["primaries"]) + 0.5 * DIMENSION * math.log(row["first"]) for row in some]
        )
        axes.loglog(span, math.exp(level) * span ** (-0.5 * DIMENSION), "--", color=GREY, label="q = d_f/2")
        axes.set(xlabel="shear stress (Pa)", ylabel="primaries P")
        axes.set_yticks(SIZES_SHOWN, [f"{n}" for n in SIZES_SHOWN])
        axes.yaxis.set_minor_formatter("")
        legend(axes, f"first bond loss, d_f = {DIMENSION}; crosses: fragmentation")
        return figure

    return Findings(
        tuple(checks),
        draw,
        "Stress at which clusters with contact torques lose a bond and come apart, sheared from the worst orientation.",
    )


CASE = Case(
    chapter=5,
    claim="In motion too, tenuous clusters whose contacts transmit torques break at a size that falls as stress^-q with q near "
    "d_f/2, chains with q between 1/2 and 4/5; the first bond that goes splits them.",
    source="largest force inside a cluster-cluster aggregate scales as its radius of gyration squared (arXiv:1405.3704; "
    "Polimeno, Kim & Blanchette 2024, arXiv:2411.12966, for shear); slender bodies: Batchelor 1970; contacts: rods of Becker & "
    "Briesen 2008; statics and clusters: own, validation/exact",
    tolerance="25 % of q: clusters of 8 to 32 are short of the limit; an error of 95 %; thresholds to 3 %",
    measure=measure,
    judge=judge,
    parts=parts,
    inputs=lambda context: (datasets.FRACTAL_MOTION,) if context.quick else (),
    saved=lambda context: (datasets.FRACTAL_MOTION,) if context.quick else (),
    anew="nothing; in the full mode all",
    seen=("stresses_of_others",),
    expected=Verdict.cannot_say,
    because="q of fractal clusters in motion is 1.04 +- 0.17, near the 0.9 expected but not known well enough from clusters of 8 "
    "to 32: contacts twist, which relieves large clusters more than small ones",
)


def main() -> None:
    """Print the numbers of the full mode."""
    context = Context()
    print(json.dumps({label: measure(context, part) for label, part in parts(context).items()}, indent=0))


if __name__ == "__main__":
    main()
