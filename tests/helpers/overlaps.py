"""What lies over what in a figure: the layout laws that every figure of both packages is held to."""

from __future__ import annotations

import itertools

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text


def overlaps(figure):
    """What is amiss, as pairs: texts over each other, text or legends over a panel's data or out of the figure.

    A panel is an axes whose frame is drawn; pictures of aggregates and tables have none.
    """
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    draw = canvas.get_renderer()
    ticks = {id(t): drawn for ax in figure.findobj(Axes) for t, drawn in tick_labels(ax, draw)}
    seen = [t for t in figure.findobj(Text) if t.get_visible() and t.get_text().strip()]
    seen = [t for t in seen if ticks.get(id(t), True)]
    boxes = [(t.get_text(), t.get_window_extent(draw).padded(-1.0)) for t in seen]
    found = [(a, b) for (a, one), (b, other) in itertools.combinations(boxes, 2) if one.overlaps(other)]
    panels = [
        ax.get_window_extent(draw).padded(-1.0) for ax in figure.axes if ax.axison and not ax.get_images()
    ]
    found += [(words, "panel") for words, box in boxes if any(box.overlaps(panel) for panel in panels)]
    found += [(words, "beyond the figure") for words, box in boxes if leaves(box, figure)]
    legends = [*figure.legends, *(ax.get_legend() for ax in figure.axes if ax.get_legend() is not None)]
    extents = [legend.get_window_extent(draw).padded(-1.0) for legend in legends]
    for k, one in enumerate(extents):
        found += [("legend", "panel") for panel in panels if one.overlaps(panel)]
        found += [("legend", "legend") for other in extents[k + 1 :] if one.overlaps(other)]
        if leaves(one, figure):
            found.append(("legend", "beyond the figure"))
    return found


def leaves(box, figure):
    """Whether a box of pixels reaches out of the figure."""
    return box.x0 < -1 or box.y0 < -1 or box.x1 > figure.bbox.x1 + 1 or box.y1 > figure.bbox.y1 + 1


def tick_labels(ax, draw):
    """(label, whether it is drawn): those beyond the ends of their axis have a place, but are not."""
    panel = ax.get_window_extent(draw)
    for axis, low, high, middle in (
        (ax.xaxis, panel.x0, panel.x1, lambda box: 0.5 * (box.x0 + box.x1)),
        (ax.yaxis, panel.y0, panel.y1, lambda box: 0.5 * (box.y0 + box.y1)),
    ):
        for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]:
            for label in (tick.label1, tick.label2):
                yield label, ax.axison and low - 1 <= middle(label.get_window_extent(draw)) <= high + 1
