"""What assumptions change: differences with their 95 % limits, one row a setting."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mcdem.analysis.paired_encounters import GIVEN
from mcdem.analysis.sensitivity import ETA, STRICT, Difference
from mcdem.figures.figure import NothingToShowError
from mcdem.figures.style import BLUE, GREY, SMALL, VERMILION, canvas, headline, legend_below, look
from mcdem.netcdf.whole_files import FILES

PANELS = (
    (ETA, "$\\eta_{11}$, relative\n[%]", 100.0),
    ("aggregation", "aggregation\n[% of encounters]", 100.0),
    ("parted", "touched and parted\n[% of encounters]", 100.0),
    (STRICT, "exchange, fragmentation\n[% of encounters]", 100.0),
)


def draw_differences(found: Sequence[Difference], path: Path, name: str) -> None:
    """Draw every setting against the scene as given, those whose limits leave nought out in a colour of their own.

    Raises
    ------
    NothingToShowError
        where no setting but the scene as given was tried
    UserError
        if the figure cannot be saved
    """
    settings = [s for s in dict.fromkeys(d.setting.name for d in found) if s != GIVEN]
    if not settings:
        raise NothingToShowError(f"{path.name}: nothing but the scene as given was tried")
    rows = {s: len(settings) - 1 - k for k, s in enumerate(settings)}
    with look():
        figure, axes = canvas(7.4, 1.7 + 0.18 * len(settings), ncols=len(PANELS), sharey=True)
        for panel, (quantity, label, scale) in zip(np.ravel(axes), PANELS, strict=True):
            of = [d for d in found if d.quantity == quantity and d.setting.name != GIVEN]
            panel.axvline(0.0, color=GREY, linewidth=0.8)
            # eta_11 is not sampled and has no limits: what is seen of it is there.
            for seen, tint, words in (
                (True, VERMILION, "differs: the limits leave nought out, or nothing is sampled"),
                (False, BLUE, "may be nothing"),
            ):
                those = [d for d in of if (d.is_seen or not np.isfinite(d.low)) == seen]
                ends = [[scale * (d.value - d.low), scale * (d.high - d.value)] for d in those]
                panel.errorbar(
                    [scale * d.value for d in those],
                    [rows[d.setting.name] for d in those],
                    xerr=np.nan_to_num(np.reshape(ends, (-1, 2))).T,
                    fmt="o",
                    markersize=3,
                    color=tint,
                    elinewidth=0.8,
                    label=words,
                )
            given = next((d.given for d in found if d.quantity == quantity), np.nan)
            headline(
                panel, f"as given: {given:.3g}" if quantity == ETA else f"as given: {scale * given:.3g} %"
            )
            panel.set_xlabel(label)
            panel.locator_params(axis="x", nbins=4)
            panel.margins(x=0.15)
            panel.tick_params(axis="y", length=0)
            panel.grid(axis="y", color="#DDDDDD", lw=0.4)
        first = np.ravel(axes)[0]
        first.set_yticks(list(rows.values()), [s.replace("_", " ") for s in rows], fontsize=SMALL)
        first.set_ylim(-0.8, len(rows) - 0.2)
        count = found[0].encounters
        legend_below(
            figure, f"{name}: difference to the scene as given, {count} encounters; bars: 95 % limits"
        )
        FILES.write_picture(path, figure)
