"""The subcommands of `pbekit`, one a file, named like it, and the options that several have.

Each imports its machinery when it runs, so that `pbekit --help` answers at once.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pbekit import arguments
from pbekit.arguments import DENSEST, LEVEL, MOST_DRAWS, least_draws
from pbekit.program import checked

Table = Annotated[Path, typer.Argument(metavar="KERNELS", help="Table that `mcdem kernels` wrote (NetCDF).")]
Tables = Annotated[list[Path], typer.Argument(metavar="KERNELS...", help="Tables, one per stress.")]
Draws = Annotated[
    int,
    typer.Option(min=least_draws(), max=MOST_DRAWS, help=f"Posterior draws for the {100 * LEVEL:g} % bands."),
]
FigureFolder = Annotated[
    Path,
    typer.Option(
        "--output",
        "-o",
        metavar="FOLDER",
        help="Folder for figures and numbers; those drawn before are replaced.",
    ),
]
Scene = Annotated[
    Path | None,
    typer.Option(
        "--scene",
        metavar="SCENE",
        help="Scene of mcdem (TOML) whose radius, viscosity, shear rate and volume fraction a table is used at; its groups are "
        "compared with the table's.",
    ),
]
Radius = Annotated[
    float | None,
    typer.Option(
        help="Radius of primaries [m] at which a table of the same groups is used; the table's by default."
    ),
]
Viscosity = Annotated[float | None, typer.Option(help="Viscosity [Pa s], likewise; the table's by default.")]
ShearRate = Annotated[float | None, typer.Option(help="Shear rate [1/s], likewise; the table's by default.")]
VolumeFraction = Annotated[
    float | None,
    typer.Option(
        callback=checked(lambda share: arguments.volume_fraction(share, "--volume-fraction")),
        help=f"Of primaries, instead of the table's; above 0, below {DENSEST:g}. First-order rates go with it.",
    ),
]
Until = Annotated[
    str,
    typer.Option(
        metavar="TIME",
        callback=checked(lambda time: arguments.until(time, "--until")),
        help='Time to stop at, such as "10 s".',
    ),
]
Cohesion = Annotated[
    float | None,
    typer.Option(
        help="Cohesion number 6 pi mu a^2 g/F_adh of your contacts; by default that of the table's material there."
    ),
]
