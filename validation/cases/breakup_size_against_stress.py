"""The largest size that survives a stress: at first bond loss and at fragmentation, each with its own exponent."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from mcdem.figures.style import BLUE, GREEN, VERMILION, canvas, legend
from validation.case import Case, Context, Findings, above, between, shown

FAMILIES = {"round": 1.0, "elongated": 3.0}
SIZES, QUICK = (8, 12, 18, 27, 40, 60), (8, 13, 20)
PACKINGS, QUICK_PACKINGS = 4, 3
AT_REST_ONLY = 8
"""Packings of each size of which statics alone are done when in a hurry; they take no time, and the fit needs them."""
CHAINS = (5, 8, 12, 18, 27, 40)
STRAIN = 12.0
"""g t of a run: about one turn."""
ORIENTATIONS = 3
EARLIEST = 100.0
"""Stress [Pa] at which statics are done; forces are proportional to it."""
SIZES_SHOWN = (5, 10, 20, 40, 60)


def scene(stress: float):
    import mcdem

    return mcdem.load_scene("scenes/paper-1000Pa.toml").with_changes({"flow.shear_stress": f"{stress} Pa"})


def adhesion(scene) -> float:
    return scene.kernels.contact.pull_off_force * scene.reduced.force


def parts(context: Context):
    sizes, packings = (QUICK, QUICK_PACKINGS) if context.quick else (SIZES, PACKINGS)
    in_all = max(packings, AT_REST_ONLY if context.quick else 0)
    several = {
        f"{name}, {n}, {k}": [name, n, k, k < packings]
        for name in FAMILIES
        for n in sizes
        for k in range(in_all)
    }
    return several | {"chains": ["chain", 0, 0, False]}


def measure(context: Context, part):
    from validation.exact.alone import Held, bond_tensions, is_split, largest_tension, sheared, threshold
    from validation.exact.packings import isostatic
    from validation.hard_cases.shapes import settled

    family, size, number, moves = part
    if family == "chain":
        return chains()
    centres = isostatic(size, FAMILIES[family], 100 * context.seed + number)
    still = scene(EARLIEST)
    body = settled(still, centres, seed=None)
    held = Held(still, body.positions / still.suspension.radius)
    worst = largest_tension(held, lambda forces: bond_tensions(body.positions, body.bonds, forces))
    first = EARLIEST * adhesion(still) / worst

    def splits(stress: float) -> bool:
        at = scene(stress)
        runs = (sheared(at, settled(at, centres, seed=turn), STRAIN) for turn in range(ORIENTATIONS))
        return any(is_split(run, size) for run in runs)

    return {
        "family": family,
        "size": size,
        "first": first,
        "split": threshold(splits, first, 30 * first, 1.03) if moves else math.nan,
    }


def chains():
    """Straight chains: the worst orientation by statics; what breaks a chain splits it."""
    from validation.exact.alone import Held, largest_tension, tree_tensions

    still, found = scene(EARLIEST), []
    for n in CHAINS:
        x = 2.0 * (np.arange(n) - 0.5 * (n - 1))[:, None] * [0.0, 0.0, 1.0]
        bonds = np.column_stack([np.arange(n - 1), np.arange(1, n)])
        worst = largest_tension(Held(still, x), partial(tree_tensions, x, bonds))
        found.append([n, EARLIEST * adhesion(still) / worst])
    return {"family": "chain", "curve": found}


def slope(sizes, stresses):
    """(1/q, error) of stress ~ P^(-1/q); error: half the width of its 95 % limits."""
    from mcdem.analysis.statistics import OF_MEANS, fit_power_law

    fit = fit_power_law(sizes, stresses, minimum=OF_MEANS)
    return (-fit.exponent, 0.5 * (fit.exponent_high - fit.exponent_low)) if fit else (math.nan, math.nan)


def judge(context: Context, found):
    curves = {"chain": np.array(found["chains"]["curve"])}
    checks, exponents = [], {}
    for family in FAMILIES:
        rows = [n for n in found.values() if n["family"] == family]
        table = np.array([[n["size"], n["first"], n["split"]] for n in rows])
        curves[family] = table
        known = np.isfinite(table[:, 2])
        first, e_first = slope(table[:, 0], table[:, 1])
        split, e_split = slope(table[known, 0], table[known, 2])
        exponents[family] = (1 / first, 1 / split)
        largest = table[:, 0] == table[:, 0].max()
        ratio = table[:, 2] / table[:, 1]
        checks += [
            between(f"{family}: 1/q of first bond loss", first, 0.5, 1.7, error=e_first),
            above(f"{family}: stress of fragmentation over that of first bond loss, smallest of all", np.nanmin(ratio), 1.0),
            above(f"{family}, {table[:, 0].max():g} primaries: the same, mean", np.nanmean(ratio[largest]), 2.5),
            shown(f"{family}: 1/q of fragmentation (the paper: about 1/2.0 for what breaks in a collision)", split,
                  error=e_split),
        ]  # fmt: skip
    # Of the same packings, so that their scatter cancels.
    both = np.concatenate([curves[family] for family in FAMILIES])
    both = both[np.isfinite(both[:, 2])]
    apart, error = slope(both[:, 0], both[:, 1] / both[:, 2])
    said = "1/q of first bond loss less 1/q of fragmentation, round and elongated together"
    checks.append(above(said, apart, 0.0, error=error))
    n, stress = curves["chain"].T
    longer = n >= 8
    steep, error = slope(n[longer], stress[longer])
    checks.append(between("straight chains of 8 to 40: 1/q", steep, 1.25, 2.0, error=error))

    def draw():
        figure, axes = canvas(width=4.8, height=3.2)
        for family, colour, marker in (("round", BLUE, "o"), ("elongated", VERMILION, "s")):
            table, (q_first, q_split) = curves[family], exponents[family]
            axes.loglog(table[:, 1], table[:, 0], marker, ms=4, mfc="none", color=colour,
                        label=f"{family}, first bond loss: q = {q_first:.1f}")  # fmt: skip
            axes.loglog(
                table[:, 2],
                table[:, 0],
                marker,
                ms=4,
                color=colour,
                label=f"fragmentation: q = {q_split:.1f}",
            )
        axes.loglog(
            stress, n, "^-", ms=4, mfc="none", color=GREEN, label=f"straight chains: q = {1 / steep:.2f}"
        )
        axes.set(xlabel="shear stress (Pa)", ylabel="primaries P")
        axes.set_yticks(SIZES_SHOWN, [f"{n}" for n in SIZES_SHOWN])
        axes.yaxis.set_minor_formatter("")
        legend(axes, loc="center left", bbox_to_anchor=(1.0, 0.5))
        return figure

    return Findings(
        tuple(checks),
        draw,
        "Size against the stress at which the first bond is lost (statics, worst orientation) and at which the cluster splits.",
    )


CASE = Case(
    chapter=5,
    claim="First bond loss and fragmentation are two curves: compact clusters of a fixed shape lose their first bond at a size "
    "that falls as stress^-1, rearrange, and split at stresses several times higher with a much larger exponent; straight chains "
    "fall with q between 1/2 and 4/5.",
    source="statics of isostatic clusters (breakup_rigid_clusters); motion of the same clusters; slender bodies: tension grows "
    "as the square of length over its logarithm, so q = 1/2 for the longest (Batchelor 1970: force per length of order "
    "mu U/ln(2l/R)); paper: q about 2.0",
    tolerance="limits of the fits over sizes and packings; the exponent of first bond loss is known from this toolkit alone, so "
    "its range is wide; which of the two curves the paper's q of 2.0 is about is what the case shows",
    measure=measure,
    judge=judge,
    parts=parts,
    seen=("strain_sign",),
)
