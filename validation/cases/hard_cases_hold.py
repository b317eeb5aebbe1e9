"""Every hard case of the catalogue against every law that it must obey (`python -m validation.hard_cases` prints them all)."""

from __future__ import annotations

from mcdem.figures.style import BLUE, GREY, VERMILION, canvas
from validation.case import Case, Context, Findings, above, below, shown
from validation.hard_cases import table
from validation.hard_cases.catalogue import CATALOGUE

FEW = ("edge of capture", "contact at pull-off +1e-09 a", "overlap of 0.5 a", "E = 1 TPa", "shear rate = 1 1/s",
       "closed necklaces", "encounters that are given up", "weak contacts in a weak flow 781")  # fmt: skip
"""For --quick: one of each kind."""


def parts(context: Context):
    return {case.name: case.name for case in CATALOGUE if not context.quick or case.name in FEW}


def measure(context: Context, name: str):
    return [
        {
            "case": finding.case,
            "law": finding.law.partition(" (")[0],
            "verdict": finding.verdict,
            "margin": finding.margin,
            "words": finding.words,
        }
        for one in table.judge(case for case in CATALOGUE if case.name == name)
        for finding in one.findings
    ]


def judge(context: Context, found):
    rows = [row for several in found.values() for row in several]
    checks = [
        below(
            f"laws broken, of {len(rows)} checked on {len({row['case'] for row in rows})} cases",
            sum(row["verdict"] == "broken" for row in rows),
            0.5,
        )
    ]
    held = [row for row in rows if row["verdict"] != "expected failure"]
    for law in dict.fromkeys(row["law"] for row in held):
        least = min((row for row in held if row["law"] == law), key=lambda row: row["margin"])
        checks.append(
            above(f"{law}: least margin", least["margin"], 0.0, why=f"{least['case']}: {least['words']}")
        )
    checks += [
        shown(f"expected failure: {row['case']}, {row['law']}", row["margin"], why=row["words"])
        for row in rows
        if row["verdict"] == "expected failure"
    ]

    def draw():
        laws = list(dict.fromkeys(row["law"] for row in rows))
        figure, axes = canvas(height=0.5 + 0.16 * len(laws))
        for row in rows:
            colour = {"holds": BLUE, "broken": VERMILION}.get(row["verdict"], GREY)
            axes.plot(max(min(row["margin"], 1.2), -0.2), laws.index(row["law"]), ".", ms=3, color=colour)
        axes.axvline(0.0, color="k", lw=0.5)
        axes.set_yticks(range(len(laws)), laws)
        axes.set(xlabel="margin, cut at -0.2 and 1.2", xlim=(-0.25, 1.25))
        axes.invert_yaxis()
        return figure

    caption = (
        "Every case of the catalogue, a dot for each law: its margin is what is left of the allowance; blue holds, grey is an "
        "expected failure, red is broken."
    )
    return Findings(tuple(checks), draw, caption)


CASE = Case(
    chapter=8,
    claim="Grazing starts, contacts at the edge of their hysteresis, extreme materials, large and floppy clusters and "
    "populations at their ends are followed to a named end, with every law held.",
    source="the catalogue in validation/hard_cases, whose table is its README.md; laws derived in laws.py",
    tolerance="a margin of 0 is where a law is broken; each allowance is derived where the law stands, never fitted",
    measure=measure,
    judge=judge,
    parts=parts,
    seen=("strain_sign",),
)
