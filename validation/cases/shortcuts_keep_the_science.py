"""Encounters of a real population with and without the shortcuts, from saved samples."""

from __future__ import annotations

import numpy as np

from mcdem.analysis.paired_encounters import REFERENCE
from mcdem.encounter.simulate import OUTCOMES
from mcdem.figures.style import BLACK, BLUE, canvas, legend
from validation import agreement, datasets
from validation.case import Case, Context, Findings, above, below, cannot_say, near, shown

STRESSES = (1000, 750)
ENOUGH = 200
AGAIN = 3
"""Encounters of each outcome but a miss that are followed once more by the engine as it is, the quickest."""


def saved(stress: int):
    return datasets.SAVED / f"agreement-{stress}Pa.nc"


def stored(context: Context):
    return tuple(path for stress in STRESSES if (path := saved(stress)).exists())


def parts(context: Context):
    return {f"{stress} Pa": stress for stress in STRESSES}


def measure(context: Context, stress: int):
    if not saved(stress).exists():
        return None
    data = agreement.load(saved(stress))
    compared = {
        way: [d._asdict() for d in agreement.differences(data, "default", way)]
        for way in agreement.WAYS
        if way != "default" and len(agreement.followed(data, way))
    }
    cpu = data["cpu_time"].sel(way="default").values
    kept = data["outcome"].sel(way="default").values
    # They show that the saved sample is of this engine.  The quickest of all would be those that touch and part at once, whatever
    # the strength of contacts.
    quickest = [
        k
        for outcome in np.unique(kept[kept != OUTCOMES.index("missed")])
        for k in sorted(np.flatnonzero(kept == outcome), key=lambda k: cpu[k])[:AGAIN]
    ]
    same = [agreement.again(data, "default", int(k)).outcome == kept[k] for k in quickest]
    both = agreement.followed(data, "paper")
    ratio = data["cpu_time"].sel(way="paper").values[both] / cpu[both]
    return {
        "encounters": int(data.sizes["encounter"]),
        "mean_size": data.attrs["mean_size"],
        "compared": compared,
        "again": [sum(same), len(same)],
        "cpu": {way: float(np.nanmean(data["cpu_time"].sel(way=way).values)) for way in agreement.WAYS},
        "ratios": ratio.tolist(),
        "shares": [float(np.mean(kept == k)) for k in range(len(OUTCOMES))],
    }


def judge(context: Context, found):
    checks = []
    for label, numbers in found.items():
        if numbers is None:
            checks.append(cannot_say(f"{label}: sample", "no sample of this stress is committed yet"))
            continue
        checks.append(above(f"{label}: encounters in the sample", numbers["encounters"], ENOUGH))
        for way, rows in numbers["compared"].items():
            for row in rows:
                # Agreement is a difference inside the interval that chance allows; the interval is given with it.
                checks.append(
                    near(
                        f"{label}: {row['quantity']}, default against {way}",
                        row["mean"] - row["other"],
                        0.0,
                        abs=row["width"],
                        why=f"{row['mean']:.4f} and {row['other']:.4f}",
                    )
                )
        same, several = numbers["again"]
        checks.append(
            above(
                f"{label}: of {several} encounters of every outcome, how many come out as saved",
                same,
                several - 1,
                why="paths are chaotic, so that another processor may turn one of them",
            )
        )
        widest = max(row["width"] for row in numbers["compared"][REFERENCE])
        checks.append(below(f"{label}: widest of these intervals", widest, 0.1))
        if numbers["ratios"]:
            checks.append(
                shown(
                    f"{label}: time of the paper's scheme over that of the default, median of {len(numbers['ratios'])}",
                    float(np.median(numbers["ratios"])),
                )
            )

    def draw():
        figure, axes = canvas(width=5.0, height=3.2)
        labels, place = [], 0
        for label, numbers in found.items():
            for row in numbers["compared"][REFERENCE] if numbers else ():
                axes.errorbar(
                    row["mean"] - row["other"], -place, xerr=row["width"], fmt="o", ms=3, color=BLUE, lw=0.8
                )
                labels.append(f"{label}: {row['quantity']}")
                place += 1
        axes.axvline(0.0, color=BLACK, lw=0.6, label="no difference")
        axes.set_yticks([-k for k in range(place)], labels, fontsize=5)
        axes.set(xlabel="default less reference (means over the same encounters)")
        legend(axes)
        return figure

    return Findings(
        tuple(checks),
        draw,
        "Differences between the default and the reference without shortcuts, with their 95 % intervals, all together.",
    )


CASE = Case(
    chapter=8,
    claim="Encounters of real populations come out alike with and without the shortcuts: outcomes, fragments, geometry.",
    source="the paper's scheme, and implicit steps without shortcuts at a quarter of the step; "
    "samples saved in validation/data, whose README gives the command",
    tolerance="simultaneous 95 % intervals of the paired differences, none wider than 0.1",
    parts=parts,
    measure=measure,
    judge=judge,
    inputs=stored,
    seen=("weak_contacts", "strain_sign"),
)
