"""`mcdem compress`: a dataset small enough to keep."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.arguments import PERIOD
from mcdem.commands import Dataset, Overwrite, quantity


def compress(
    file: Dataset,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="Dataset to write.")],
    every: Annotated[
        float | None,
        typer.Option(
            metavar="TIME",
            parser=quantity("--every", PERIOD),
            help='Time between the snapshots that are kept, such as "5 s".',
        ),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Make a run's dataset small: fewer snapshots, rounded numbers, compression. `mcdem run --resume` continues it.

    Offsets, times and tensions of encounters that missed keep a few per cent, their smallest gaps are left out.
    `mcdem.open_run` gives the columns as of any run.
    """
    from mcdem.netcdf.whole_files import FILES, RUN

    FILES.check(output, RUN, overwrite=overwrite)
    from mcdem.monte_carlo.compress import compress as compress_dataset

    compress_dataset(file, output, every)
    before, after = file.stat().st_size / 2**20, output.stat().st_size / 2**20
    typer.echo(f"{output} written: {after:.2f} MiB of {before:.2f} MiB")
