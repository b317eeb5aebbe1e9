"""The subcommands of `mcdem`, one a file, named like it.

Each imports its machinery when it runs, so that `mcdem --help` answers at once.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from pydantic_core import PydanticCustomError

from mcdem.errors import UserError
from mcdem.quantities.units import Quantity

SceneFile = Annotated[
    Path, typer.Argument(metavar="SCENE", help="Scene file (TOML); `mcdem describe` lists its keys.")
]
Dataset = Annotated[Path, typer.Argument(metavar="FILE", help="Dataset that `mcdem run` wrote (NetCDF).")]

SampledRuns = Annotated[
    list[Path] | None,
    typer.Option(
        "--from",
        metavar="RUN",
        help="Dataset of `mcdem run` whose late aggregates meet in the sample; may be repeated. "
        "Without it a short run of the scene is made first.",
    ),
]


def read_quantity(option: str, given: str, quantity: Quantity) -> float:
    """SI value of an option's text with a unit; raises `UserError` that names the option."""
    try:
        return quantity.to_si(given)
    except PydanticCustomError as problem:
        raise UserError(f'{option} "{given}" {problem.message()}') from None


def refuse_existing(output: Path, *, overwrite: bool) -> None:
    """Raise `UserError` where writing `output` would destroy a file or cannot succeed."""
    if output.is_file() and not overwrite:
        raise UserError(f"{output} exists; give another name, or --overwrite to replace it")
    if not output.absolute().parent.is_dir():
        raise UserError(f"{output}: there is no folder {output.parent}; make it, or name another")
