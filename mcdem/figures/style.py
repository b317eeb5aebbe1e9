"""One look for all figures: print size, colours that the colour-blind can tell apart, no text where data may be.

Words go above a panel (`headline`) or below the figure (`legend_below`); no panel keeps room for them.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

# Okabe & Ito (2008)
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
GREY = "#777777"

CYCLE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
LINES = ("-", "--", "-.", ":")
MARKERS = ("o", "s", "^", "D", "v", "P")

COLUMN = 3.5  # inches: one column of a journal's page
SMALL = 6.5
"""[pt] The smallest print: counts, tests, what a bar is."""
PRINT = "#333333"
"""Colour of small print."""
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


LETTERS = 19.0
"""Of small print, on an inch."""


def headline(axes: Axes, text: str) -> None:
    """Small print above a panel: what it is of, counts, tests; in as many lines as its width asks for."""
    place = axes.get_subplotspec()
    portion = 1.0
    if place is not None:
        ratios = np.array(place.get_gridspec().get_width_ratios() or [1.0] * place.get_gridspec().ncols)
        portion = ratios[place.colspan.start : place.colspan.stop].sum() / ratios.sum()
    letters = int(LETTERS * (portion * axes.figure.bbox.width / axes.figure.dpi - 0.4))
    lines = "\n".join(textwrap.wrap(text, max(letters, 24)))
    axes.set_title(lines, loc="left", fontsize=SMALL, color=PRINT, pad=4)


def legend(axes: Axes, small_print: str = "", **keywords: Any) -> None:
    """A legend that carries counts, tests and the meaning of bands in small print under its title's place."""
    drawn = axes.legend(title=small_print or None, title_fontsize=5.5, alignment="left", **keywords)
    drawn.get_title().set_color(PRINT)


def legend_below(figure: Canvas, small_print: str = "", ncols: int = 2, **keywords: Any) -> None:
    """One legend of all panels below them, each name once, with what bars and bands are in small print above it."""
    named: dict[str, Artist] = {}
    for axes in figure.axes:
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            named.setdefault(name, handle)
    drawn = figure.legend(
        list(named.values()),
        list(named),
        loc="outside lower center",
        ncols=min(ncols, max(len(named), 1)),
        title=small_print or None,
        title_fontsize=SMALL,
        alignment="left",
        **keywords,
    )
    drawn.get_title().set_color(PRINT)


def own_ticks(axis: Axis, values: np.ndarray) -> None:
    """Ticks of a logarithmic axis at the values themselves, as many of them as have room for their labels."""
    kept = [float(values[0])]
    for value in values[1:]:
        if np.log(value / kept[-1]) >= 0.09 * max(np.log(values[-1] / values[0]), 0.5):
            kept.append(float(value))
    axis.set_major_locator(FixedLocator(kept))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:.4g}"))


STEPS = (
    (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0),
    (1.0, 1.5, 2.0, 3.0, 5.0, 7.0),
    (1.0, 2.0, 5.0),
    (1.0,),
)
"""Ticks within a decade, from many to few."""


def plain_ticks(axis: Axis, most: int = 7) -> None:
    """Plain numbers on a logarithmic axis whose ends are set, `most` of them at most."""
    low, high = axis.get_view_interval()
    decades = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    for steps in STEPS:
        ticks = np.outer(10.0**decades, steps).ravel()
        ticks = ticks[(ticks >= low) & (ticks <= high)]
        if len(ticks) <= most:
            break
    else:
        ticks = ticks[:: -(-len(ticks) // most)]
    axis.set_major_locator(FixedLocator(ticks.tolist()))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(_number))


def _number(x: float, _: int) -> str:
    exponent = np.log10(x)
    if not -3.5 < exponent < 4.5 and abs(exponent - round(exponent)) < 1e-9:
        return f"$10^{{{round(exponent)}}}$"
    return f"{x:g}"


def opacity(points: int) -> float:
    """Of markers of which there are so many: few are to be seen, many to show where they crowd."""
    return float(np.clip(8.0 / np.sqrt(max(points, 1)), 0.25, 0.9))


def plural(count: int, noun: str, nouns: str = "") -> str:
    """The number and the noun, in the singular of one."""
    return f"{count} {noun if count == 1 else nouns or noun + 's'}"


def colour(index: int) -> str:
    """Colour of the n-th line."""
    return CYCLE[index % len(CYCLE)]
