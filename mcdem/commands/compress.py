"""`mcdem compress`: a dataset small enough to keep."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.arguments import PERIOD
from mcdem.commands import Dataset, read_quantity


def compress(
    file: Dataset,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="Dataset to write.")],
    every: Annotated[
        str | None,
        typer.Option(metavar="TIME", help='Time between the snapshots that are kept, such as "5 s".'),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the output if it exists.")] = False,
) -> None:
    """Make a run's dataset small: fewer snapshots, rounded numbers, compression. `mcdem run --resume` continues it.

    Offsets, times and tensions of encounters that missed keep a few per cent, their smallest gaps are left out.
    `mcdem.open_run` gives the columns as of any run.
    """
    from mcdem.netcdf.whole_files import FILES, RUN

    FILES.check(output, RUN, overwrite=overwrite)
    spacing = None if every is None else read_quantity("--every", every, PERIOD)
    from mcdem.monte_carlo.compress import compress as compress_dataset

    compress_dataset(file, output, spacing)
    before, after = file.stat().st_size / 2**20, output.stat().st_size / 2**20
    typer.echo(f"{output} written: {after:.2f} MiB of {before:.2f} MiB")
