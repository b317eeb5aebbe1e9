"""What assumptions change: differences with their 95 % limits, one row a setting."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mcdem.analysis.paired_encounters import GIVEN
from mcdem.analysis.sensitivity import ETA, STRICT, Difference
from mcdem.figures.style import BLUE, GREY, canvas, look
from mcdem.netcdf.whole_files import FILES

PANELS = (
    (ETA, "$\\eta_{11}$\nrelative difference", 1.0),
    ("aggregation", "aggregation\n% of encounters", 100.0),
    ("parted", "touched and parted\n% of encounters", 100.0),
    (STRICT, "exchange, fragmentation\n% of encounters", 100.0),
)


def draw_differences(found: Sequence[Difference], path: Path, name: str) -> None:
    """Draw every setting against the scene as given; raises `UserError` if the figure cannot be saved."""
    settings = [s for s in dict.fromkeys(d.setting.name for d in found) if s != GIVEN]
    rows = {s: len(settings) - 1 - k for k, s in enumerate(settings)}
    with look():
        figure, axes = canvas(7.4, 1.1 + 0.2 * len(settings), ncols=len(PANELS), sharey=True)
        for panel, (quantity, label, scale) in zip(np.ravel(axes), PANELS, strict=True):
            of = [d for d in found if d.quantity == quantity and d.setting.name != GIVEN]
            panel.axvline(0.0, color=GREY, linewidth=0.8)
            panel.errorbar(
                [scale * d.value for d in of],
                [rows[d.setting.name] for d in of],
                xerr=np.nan_to_num(
                    [[scale * (d.value - d.low), scale * (d.high - d.value)] for d in of]
                ).T.reshape(2, -1),
                fmt="o",
                markersize=3,
                color=BLUE,
                elinewidth=0.8,
            )
            given = next((d.given for d in found if d.quantity == quantity), np.nan)
            panel.set_title(f"as given: {scale * given:.3g}{' %' if scale > 1 else ''}", fontsize=6.5)
            panel.set_xlabel(label, fontsize=6.5)
            panel.margins(x=0.15)
        np.ravel(axes)[0].set_yticks(list(rows.values()), list(rows), fontsize=6.5)
        count = found[0].encounters if found else 0
        figure.suptitle(
            f"{name}: difference to the scene as given, {count} encounters, 95 % limits", fontsize=7
        )
        FILES.write_picture(path, figure)
