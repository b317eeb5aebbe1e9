"""`pbekit efficiency`: one number of the atlas."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def efficiency(
    size_i: Annotated[int, typer.Argument(metavar="P_I", min=1, help="Primaries of one aggregate.")],
    size_j: Annotated[int, typer.Argument(metavar="P_J", min=1, help="Primaries of the other.")],
    cohesion: Annotated[
        float, typer.Option("--cohesion", metavar="N", help="Cohesion number 6 pi mu a^2 g/F_adh.")
    ],
    atlas: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Atlas, as `mcdem kernels --into` makes it; that of the package by default."
        ),
    ] = None,
) -> None:
    """Aggregation efficiency and breakup probability of two sizes, with 90 % intervals and the encounters behind them."""
    from pbekit.tables.atlas import SHIPPED, Atlas
    from pbekit.tables.kernel_table import SCATTERED

    opened = Atlas.load(atlas or SHIPPED)
    eta = opened.probability(size_i, size_j, cohesion)
    broken = opened.probability(size_i, size_j, cohesion, SCATTERED)
    for name, found, words in (("eta", eta, "aggregated"), ("p_break", broken, "broke")):
        typer.echo(
            f"{name} = {found.value:.3g} ({found.low:.3g} ... {found.high:.3g}): {found.seen} of {found.trials} "
            f"encounters {words}"
        )
