"""The subcommands of `mcdem`, one a file, named like it.

Each imports its machinery when it runs, so that `mcdem --help` answers at once.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NoReturn

import typer
from pydantic_core import PydanticCustomError

from mcdem.arguments import MOST_EVENTS
from mcdem.errors import UserError
from mcdem.quantities.random_streams import LARGEST_SEED
from mcdem.quantities.units import Quantity, shown
from pbekit.program import finite

__all__ = [
    "LARGEST_SEED",
    "MOST_EVENTS",
    "MOST_SAMPLED",
    "Dataset",
    "SampledRuns",
    "SceneFile",
    "finite",
    "read_quantity",
]

MOST_SAMPLED = 10**6
"""Encounters of a sample, or of a design."""

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
        return quantity.to_si(given, bare=False)
    except PydanticCustomError as problem:
        raise UserError(f"{option} {shown(given)} {problem.message()}") from None


def end_early(problem: BaseException, files: str, done: int, wanted: int) -> NoReturn:
    """End a comparison of settings that was cut off, by the user or by a failure, after it wrote what it had."""
    words = f"{files} hold {done} of {wanted} settings; given again with --overwrite the command begins anew"
    if isinstance(problem, KeyboardInterrupt):
        raise KeyboardInterrupt(words) from None
    raise UserError(f"{problem}; {words}") from None
