"""One look for all figures: print size, colours that the colour-blind can tell apart, paper's values in one way."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

# Okabe & Ito (2008)
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
GREY = "#777777"

CYCLE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
LINES = ("-", "--", "-.", ":")
MARKERS = ("o", "s", "^", "D", "v", "P")

COLUMN = 3.5  # inches: one column of a journal's page
CONVENTION = {
    "paper": (BLUE, "touch and part counted"),
    "strict": (VERMILION, "strict"),
    "own": (GREEN, "each aggregate for itself"),
}
"""Colour and words for the conventions of breakup."""
OUTCOME = {
    "missed": (GREY, "."),
    "aggregation": (BLUE, "o"),
    "parted": (SKY, "v"),
    "exchange": (ORANGE, "D"),
    "fragmentation": (VERMILION, "^"),
    "unresolved": (BLACK, "x"),
}
"""Colour and marker of each outcome."""

RC: dict[str, Any] = {
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "legend.fontsize": 6.5,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "legend.frameon": False,
    "figure.dpi": 100,
    "savefig.dpi": 300,
    "mathtext.fontset": "dejavusans",
    "figure.constrained_layout.use": True,
}


@contextmanager
def look() -> Iterator[None]:
    """Draw and save within this."""
    with mpl.rc_context(RC):
        yield


def canvas(width: float = COLUMN, height: float = 2.7, **subplots: Any) -> tuple[Canvas, Any]:
    """A figure of `width` x `height` [inch] and its axes, outside of pyplot's global state."""
    figure = Canvas(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(**subplots)


def note(axes: Axes, text: str, place: tuple[float, float] = (0.97, 0.04), **keywords: Any) -> None:
    """Small print inside the axes: counts, tests, what a band is."""
    x, y = place
    axes.text(
        x,
        y,
        text,
        transform=axes.transAxes,
        fontsize=6,
        color="#333333",
        ha="right" if x > 0.5 else "left",
        va="bottom" if y < 0.5 else "top",
        **keywords,
    )


def legend(axes: Axes, small_print: str = "", **keywords: Any) -> None:
    """A legend that carries counts, tests and the meaning of bands in small print under its title's place."""
    drawn = axes.legend(title=small_print or None, title_fontsize=5.5, alignment="left", **keywords)
    drawn.get_title().set_color("#333333")


def colour(index: int) -> str:
    """Colour of the n-th line."""
    return CYCLE[index % len(CYCLE)]
