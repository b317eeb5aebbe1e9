"""Error against time of a scene's settings, and the front of those that no other beats."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..cost import REFERENCE, Price, front
from ..errors import UserError
from .style import BLACK, GREY, MARKERS, canvas, colour, legend, look

FLOOR = 1e-5
"""Errors below are drawn here: what nothing distinguishes from the reference has no place on a logarithmic axis."""


def draw_front(prices: Sequence[Price], path: Path, name: str) -> None:
    """Draw CPU time against the worst error of every setting but the reference; raises `UserError` if it cannot be saved."""
    shown = [p for p in prices if p.setting.name != REFERENCE]
    with look():
        figure, axes = canvas(6.0, 3.4)
        knobs = list(dict.fromkeys(p.setting.knob for p in shown))
        for number, knob in enumerate(knobs):
            of = [p for p in shown if p.setting.knob == knob]
            error = np.array([max(p.worst, FLOOR) for p in of])
            spread = np.array([min(p.worst_deviation, 1.0) for p in of])
            axes.errorbar(
                [1e3 * p.cpu_time for p in of],
                error,
                yerr=[np.minimum(spread, 0.9 * error), spread],
                fmt=MARKERS[number % len(MARKERS)],
                color=colour(number),
                markersize=4,
                elinewidth=0.5,
                label=knob.replace("_", " "),
            )
        best = front(shown)
        axes.step(
            [1e3 * p.cpu_time for p in best],
            [max(p.worst, FLOOR) for p in best],
            where="post",
            color=BLACK,
            linewidth=0.8,
            zorder=0,
            label="front",
        )
        for p in best:
            axes.annotate(
                p.setting.name,
                (1e3 * p.cpu_time, max(p.worst, FLOOR)),
                textcoords="offset points",
                xytext=(4, 4),
                fontsize=5.5,
            )
        for p in prices:
            if p.setting.name == REFERENCE:
                axes.axvline(1e3 * p.cpu_time, color=GREY, linewidth=0.8, linestyle=":", label="reference")
        axes.set(xscale="log", yscale="log", xlabel="CPU time of an encounter (ms)", ylabel="largest error")
        legend(
            axes,
            f"{name}; bars: one paired standard error",
            loc="center left",
            bbox_to_anchor=(1.0, 0.5),
        )
        try:
            figure.savefig(path)
        except (OSError, ValueError) as problem:
            raise UserError(f"{path}: the figure cannot be written ({problem})") from None
