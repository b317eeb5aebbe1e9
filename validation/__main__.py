"""`python -m validation`: run cases, write the report.

Exit codes: 0 every verdict is the one that is known; 1 one is not; 2 something to mend in what was given; 130, 143, 129
interrupted by Ctrl-C, SIGTERM, SIGHUP, what was measured is kept (`pbekit.endings`).
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any

import typer

from mcdem.arguments import ExecutorKind
from mcdem.errors import UserError
from mcdem.netcdf.whole_files import FILES, VERDICTS
from pbekit import endings
from validation import case as cases_of


def chosen(given: list[str]) -> list[str]:
    """Names of the cases that the arguments name: by name, by chapter, or all."""
    known = {case.name: case.chapter for case in cases_of.load_all()}
    wanted: list[str] = []
    for word in given:
        found = [name for name, chapter in known.items() if word in (name, str(chapter))]
        if not found:
            raise UserError(
                f'case "{word}": not known; expected a chapter, 1 to {max(cases_of.CHAPTERS)}, or one of '
                + ", ".join(known)
            )
        wanted += [name for name in found if name not in wanted]
    return wanted or list(known)


def validation(
    case: Annotated[
        list[str] | None, typer.Argument(help="Cases, by name or by chapter; all if none is given.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Smaller samples: all cases in a few minutes.")
    ] = False,
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="FOLDER", help="Of report.html, verdicts.md and what is kept."
        ),
    ] = Path("report"),
    workers: Annotated[
        int | None, typer.Option(min=1, help="How many parts of cases run at once. Default: all there are.")
    ] = None,
    executor: Annotated[
        ExecutorKind, typer.Option(help="process: this machine; mpi: ranks of mpiexec; dask: a cluster.")
    ] = ExecutorKind.process,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Of the dask cluster, such as tcp://host:8786.")
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Measure again what is kept.")] = False,
    way: Annotated[
        str | None,
        typer.Option("--break", metavar="WAY", help="Break physics on purpose; --list names the ways."),
    ] = None,
    readme: Annotated[
        bool, typer.Option("--readme", help="Write the table to validation/README.md too.")
    ] = False,
    runs: Annotated[
        list[Path] | None,
        typer.Option(
            "--run",
            metavar="RUN",
            help="Dataset of `mcdem run` for the cases that read one, in place of the committed one; may be repeated.",
        ),
    ] = None,
    pecnut: Annotated[
        Path | None,
        typer.Option(metavar="CHECKOUT", help="Of Pecnut/stokesian-dynamics. Default: $PECNUT_CHECKOUT."),
    ] = None,
    listed: Annotated[
        bool, typer.Option("--list", help="Name the cases and the ways to break physics.")
    ] = False,
) -> None:
    """Hold the toolkit against what is known, claim by claim, and write a report.

    A second run reuses the numbers that nothing has changed under; an interrupted one goes on from where it was.
    """
    from rich.console import Console

    from validation import broken, report

    console = Console(highlight=False)
    if listed:
        typer.echo(report.listing(cases_of.load_all()))
        for name, how in broken.WAYS.items():
            typer.echo(f"--break {name}: {(how.__doc__ or '').strip()}")
        return
    if way is not None and way not in broken.WAYS:
        raise UserError(f'--break "{way}": expected one of {", ".join(broken.WAYS)}')
    if readme and (case or way or runs):
        raise UserError("--readme: expected a run of all cases, with nothing broken and no run given")
    if pecnut is None and "PECNUT_CHECKOUT" in os.environ:
        pecnut = Path(os.environ["PECNUT_CHECKOUT"])
    for path in [*(runs or []), *([pecnut] if pecnut else [])]:
        if not path.exists():
            raise UserError(f"{path}: no such file or folder")
    given = cases_of.Given(tuple(path.resolve() for path in runs or ()), pecnut and pecnut.resolve())

    from mcdem.monte_carlo import executors
    from validation.run import run

    wanted = [cases_of.load(name) for name in chosen(case or [])]
    try:
        with executors.opened(executor.value, workers, scheduler) as crew, Display(console) as display:
            display.begin(len(wanted))
            outcomes = run(
                wanted,
                output / "kept",
                crew.executor,
                quick=quick,
                way=way,
                given=given,
                fresh=fresh,
                progress=display,
            )
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"{output / 'kept'} holds what was measured: the same command goes on from there"
        ) from None
    title = "Validation" + (" (quick)" if quick else "") + (f", broken: {way}" if way else "")
    output.mkdir(parents=True, exist_ok=True)
    page = output / "report.html"
    FILES.write(page, FILES.page, report.html(outcomes, title, way))
    table = report.markdown(outcomes)
    for path in [output / "verdicts.md", *([report.README] if readme else [])]:
        FILES.write(path, VERDICTS, table)
    console.print(f"{page}: {page.stat().st_size / 1e6:.1f} MB", markup=False)
    strange = [o for o in outcomes if not o.as_expected]
    for o in strange:
        console.print(
            f"unexpected: {o.case.name}: {o.verdict.value}, expected {o.case.expected.value}", markup=False
        )
        if o.problem:
            console.print(o.problem, markup=False)
        for check in o.findings.checks:
            if check.verdict not in (None, cases_of.Verdict.agrees):
                console.print(
                    f"    {check.quantity}: {report.number(check.measured)} +- {report.number(check.error)}, "
                    f"{report.expectation(check)}: {check.verdict} {check.why}",
                    markup=False,
                )
    if strange:
        raise typer.Exit(1)


class Display:
    """A bar on a terminal, and a line for each case that is judged."""

    def __init__(self, console: Any) -> None:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        self.console = console
        self.bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
            disable=not console.is_terminal,
        )

    def begin(self, cases: int) -> None:
        self.task = self.bar.add_task("compiling what is not yet compiled", total=cases)

    def __call__(self, event: str, what: Any) -> None:
        if event == "part":
            self.bar.update(self.task, description=f"{what.name} {what.label}")
            return
        colour = {"agrees": "green", "differs": "red", "failed": "red"}.get(what.verdict.value, "yellow")
        mark = "" if what.as_expected else "  (unexpected)"
        mark += f"  needs {what.needs}: pip install {what.needs}" if what.needs else ""
        line = f"{what.verdict.value:10s}  {what.case.name}  {what.cpu:.1f} s{mark}"
        self.console.print(line, style=colour, markup=False, soft_wrap=True)
        self.bar.update(self.task, advance=1)

    def __enter__(self) -> Display:
        self.bar.start()
        return self

    def __exit__(self, *_: Any) -> None:
        self.bar.stop()


def main() -> None:
    """Entry point of `python -m validation`."""
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="markdown")
    app.command()(validation)
    try:
        endings.program(lambda: app(prog_name="python -m validation"))
    except UserError as problem:
        typer.secho(f"error: {problem}", fg="red", err=True)
        raise SystemExit(2) from None


if __name__ == "__main__":
    main()
