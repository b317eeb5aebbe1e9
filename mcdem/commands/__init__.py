"""The subcommands of `mcdem`, one a file, named like it, and the options that several have.

Each imports its machinery when it runs, so that `mcdem --help` answers at once.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from pydantic_core import PydanticCustomError

from mcdem.arguments import MOST_EVENTS, PERIOD, ExecutorKind
from mcdem.errors import UserError
from mcdem.quantities.random_streams import LARGEST_SEED
from mcdem.quantities.units import Quantity, shown

MOST_SAMPLED = 10**6
"""Encounters of a sample, or of a design."""
WIDTH = 130
"""Columns of a table where there is no terminal to ask."""


def quantity(option: str, of: Quantity) -> Callable[[str], float]:
    """What reads an option's text with a unit, to its SI value; raises `UserError` that names the option."""

    def read(given: str) -> float:
        try:
            return of.to_si(given, bare=False)
        except PydanticCustomError as problem:
            raise UserError(f"{option} {shown(given)} {problem.message()}") from None

    return read


SceneFile = Annotated[
    Path, typer.Argument(metavar="SCENE", help="Scene file (TOML); `mcdem describe` lists its keys.")
]
Dataset = Annotated[Path, typer.Argument(metavar="FILE", help="Dataset that `mcdem run` wrote (NetCDF).")]
Seed = Annotated[
    int | None,
    typer.Option(min=0, max=LARGEST_SEED, help="Seed of every random stream, instead of the scene's."),
]
Until = Annotated[
    float | None,
    typer.Option(
        metavar="TIME", parser=quantity("--until", PERIOD), help='Process time to stop at, such as "10 s".'
    ),
]
Events = Annotated[
    int | None, typer.Option(min=1, max=MOST_EVENTS, help="Number of encounters to stop after.")
]
Workers = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="Workers that compute encounters; on machines of one kind any number gives the same result. Default: all.",
    ),
]
Kind = Annotated[
    ExecutorKind,
    typer.Option("--executor", help="process: this machine; mpi: ranks of mpiexec; dask: a cluster."),
]
Scheduler = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Address of the dask cluster, such as tcp://host:8786."),
]
SampledRuns = Annotated[
    list[Path] | None,
    typer.Option(
        "--from",
        metavar="RUN",
        help="Dataset of `mcdem run` whose late aggregates meet in the sample; may be repeated. "
        "Without it a short run of the scene is made first.",
    ),
]
SampleSeed = Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the sample.")]
Page = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="PAGE", help="Page to write; default: FILE's name, with .html."),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace what is to be written, if it exists.")]


def show(*found: object) -> None:
    """Print lines, and tables as wide as the terminal."""
    from rich.console import Console

    terminal = Console(highlight=False, markup=False)
    out = terminal if terminal.is_terminal else Console(highlight=False, markup=False, width=WIDTH)
    for one in found:
        out.print(one, soft_wrap=isinstance(one, str))


def note(text: str) -> None:
    """A line for the user beside the results."""
    typer.secho(text, fg="yellow", err=True)
