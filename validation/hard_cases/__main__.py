"""`python -m validation.hard_cases`: run the catalogue and print its table."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from mcdem.netcdf.whole_files import FILES, HARD_CASES
from pbekit import endings
from validation.hard_cases import table
from validation.hard_cases.case import Finding
from validation.hard_cases.catalogue import CATALOGUE

HEAD = f"{'case':38} {'law':32} {'verdict':17} {'steps':>8} {'margin':>8}  what was found"


def row(finding: Finding) -> str:
    """A line of the table."""
    return (
        f"{finding.case:38} {finding.law:32} {finding.verdict:17} {finding.steps:8d} {finding.margin:8.2g}  "
        f"{finding.words}"
    )


def main(
    cases: Annotated[list[str] | None, typer.Argument(help="Names, or parts of names; all if none.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Only what takes seconds.")] = False,
    readme: Annotated[
        bool, typer.Option("--readme", help="Write README.md beside the catalogue, too.")
    ] = False,
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
    print(HEAD)
    judged = table.judge(chosen, lambda finding: print(row(finding), flush=True))
    print(table.summary(judged))
    if readme:
        FILES.write(table.README, HARD_CASES, table.markdown(judged))
    if table.verdicts(judged)["broken"]:
        raise typer.Exit(1)


if __name__ == "__main__":
    endings.program(lambda: typer.run(main))
