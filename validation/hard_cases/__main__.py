"""`python -m validation.hard_cases`: run the catalogue and print its table."""

from __future__ import annotations

import sys
import time
from collections import Counter
from typing import Annotated

import typer

import mcdem
from mcdem.scene import load_scene
from validation.hard_cases.case import PAPER, Finding
from validation.hard_cases.catalogue import CATALOGUE

HEAD = f"{'case':38} {'law':32} {'verdict':17} {'steps':>8} {'margin':>8}  what was found"


def row(finding: Finding) -> str:
    """A line of the table."""
    return (
        f"{finding.case:38} {finding.law:32} {finding.verdict:17} {finding.steps:8d} {finding.margin:8.2g}  "
        f"{finding.words}"
    )


def warm_up() -> None:
    """Let both schemes be compiled, which is no case's fault."""
    mote = mcdem.Aggregate.monomer()
    for scheme in ("implicit", "paper"):
        scene = load_scene(PAPER).with_changes({"numerics.scheme": scheme, "numerics.rotations": 0})
        mcdem.simulate_encounter(scene, mote, mote, (0.0, 1.9 * scene.suspension.radius))


def main(
    cases: Annotated[list[str] | None, typer.Argument(help="Names, or parts of names; all if none.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Only what takes seconds.")] = False,
) -> None:
    """Hold every hard case against its laws; exit code 1 if one is broken."""
    chosen = [
        case
        for case in CATALOGUE
        if (not quick or case.quick) and (not cases or any(part in case.name for part in cases))
    ]
    if not chosen:
        print(f"no case is named like {', '.join(cases or ())}; there are:", file=sys.stderr)
        print(*(f"  {case.name}: {case.story}" for case in CATALOGUE), sep="\n", file=sys.stderr)
        raise typer.Exit(2)
    warm_up()
    print(HEAD)
    verdicts: Counter[str] = Counter()
    longest = 0.0
    for case in chosen:
        began = time.process_time()
        for finding in case.judge():
            verdicts[finding.verdict] += 1
            print(row(finding), flush=True)
        longest = max(longest, time.process_time() - began)
    told = ", ".join(f"{count} {verdict}" for verdict, count in verdicts.items())
    print(
        f"{len(chosen)} cases: {told}; the longest, all its laws together, took {longest:.1f} s of processor"
    )
    if verdicts["broken"]:
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
