"""Error against time of a scene's settings, and the front of those that no other beats."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mcdem.analysis.accuracy_cost import Price, front
from mcdem.analysis.paired_encounters import REFERENCE
from mcdem.figures.style import BLACK, GREY, MARKERS, canvas, colour, legend, look
from mcdem.netcdf.whole_files import FILES

FLOOR = 1e-5
"""Errors below are drawn here: what nothing distinguishes from the reference has no place on a logarithmic axis."""


def draw_front(prices: Sequence[Price], path: Path, name: str, count: int) -> None:
    """Draw CPU time against the errors of every setting; raises `UserError` if the figure cannot be saved.

    Left the efficiency of pairs, which is not sampled; right the largest error of the `count` sampled encounters.
    """
    shown = [p for p in prices if p.setting.name != REFERENCE]
    varied = list(dict.fromkeys(p.setting.varied for p in shown))
    with look():
        figure, (pairs, sampled) = canvas(7.2, 3.2, ncols=2, sharex=True)
        for number, name in enumerate(varied):
            of = [p for p in shown if p.setting.varied == name]
            time = np.array([1e3 * p.cpu_time for p in of])
            # Six colours and six markers, shifted at every turn, tell 36 settings apart.
            form = {
                "fmt": MARKERS[(number + number // len(MARKERS)) % len(MARKERS)],
                "color": colour(number),
                "markersize": 4,
                "elinewidth": 0.5,
            }
            pairs.errorbar(time, [max(p.error[0], FLOOR) for p in of], **form)
            error = np.array([max(p.worst_sampled, FLOOR) for p in of])
            spread = np.array([max(p.limit[1:].max(), FLOOR) for p in of]) - error
            sampled.errorbar(
                time,
                error,
                yerr=[np.zeros_like(spread), np.maximum(spread, 0.0)],
                label=name.replace("_", " "),
                **form,
            )
        for axes, measure in (
            (pairs, lambda p: max(float(p.error[0]), FLOOR)),
            (sampled, lambda p: max(float(p.limit[1:].max()), FLOOR)),
        ):
            best = front(shown, measure)
            axes.step(
                [1e3 * p.cpu_time for p in best],
                [measure(p) for p in best],
                where="post",
                color=BLACK,
                linewidth=0.8,
                zorder=0,
                label="front",
            )
            for p in best:
                axes.annotate(
                    p.setting.name.replace("_", " "),
                    (1e3 * p.cpu_time, measure(p)),
                    textcoords="offset points",
                    xytext=(4, 4),
                    fontsize=5.5,
                )
            for p in prices:
                if p.setting.name == REFERENCE:
                    axes.axvline(
                        1e3 * p.cpu_time, color=GREY, linewidth=0.8, linestyle=":", label="reference"
                    )
            axes.set(xscale="log", yscale="log", xlabel="CPU time of an encounter (ms)")
        pairs.set(ylabel=r"relative error of $\eta_{11}$")
        sampled.set(ylabel="largest error of outcome, fragment, geometry")
        legend(
            sampled,
            f"{name}, {count} encounters\nbars: up to the 95 % limit\nfront: of the limits",
            loc="center left",
            bbox_to_anchor=(1.0, 0.5),
        )
        FILES.write_picture(path, figure)
