"""Fig. 10 and Table 2: what aggregates look like, with their numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure as Canvas
from matplotlib.patches import Circle, Ellipse

from mcdem.analysis import paper
from mcdem.analysis.dataset import RunDataset, by_stress
from mcdem.figures.figure import Figure, quantity
from mcdem.figures.render import Camera, principal_view
from mcdem.figures.render import Canvas as Picture
from mcdem.figures.style import BLACK, BLUE, PRINT, SKY, SMALL, VERMILION, canvas, headline

TINT = np.array(to_rgb(SKY))
COLUMNS = (
    "size",
    "radius_of_gyration",
    "outer_radius",
    "aspect_ratio",
    "coordination_number",
    "solid_fraction_sphere",
)


def _collected(chosen: list[tuple[RunDataset, int]]) -> xr.Dataset:
    """Geometry and numbers of chosen aggregates of last snapshots; lengths in primary radii."""
    shapes = [run.geometry(k) for run, k in chosen]
    rows = [run.population(-1).isel(aggregate=k) for run, k in chosen]
    a = np.array([run.radius for run, _ in chosen])
    numbers = xr.Dataset(
        {
            "stress": quantity([run.stress for run, _ in chosen], "aggregate", "Pa", "shear stress"),
            "position": quantity(
                np.vstack([x / run.radius for (x, _), (run, _) in zip(shapes, chosen, strict=True)]),
                ("primary", "axis"),
                "1",
                "centres of the primaries over a, aggregate after aggregate",
            ),
            "semi_axes": quantity(
                [r["semi_axes"].values / r.attrs["primary_radius"] for r in rows],
                ("aggregate", "axis"),
                "1",
                "a_i/a",
            ),
        }
    )
    for name in COLUMNS:
        values = np.array([float(r[name]) for r in rows])
        length = rows[0][name].attrs["units"] == "m"
        numbers[name] = quantity(
            values / a if length else values, "aggregate", "1", rows[0][name].attrs["long_name"]
        )
    numbers["size"] = numbers["size"].astype(int)
    return numbers


def _picture(positions: np.ndarray, half_width: float, pixels: int = 440) -> np.ndarray:
    """An aggregate broadside, positions (P, 3) in radii."""
    right, up = principal_view(positions)
    camera = Camera(positions.mean(axis=0), half_width, right, up)
    return Picture(camera, pixels, pixels).spheres(positions, 1.0, TINT).smoothed()


def chosen_shapes(run: RunDataset, count: int = 3) -> list[int]:
    """Aggregates of rising size and elongation: near the 50th, 80th and 99th percentile of P, ever longer."""
    found = run.population(-1)
    p, ratio = found["size"].values, found["aspect_ratio"].values
    order = np.flatnonzero(p > 3)
    order = order if len(order) else np.arange(len(p))
    chosen = []
    for quantile, aim in zip(np.linspace(0.5, 0.99, count), (0.1, 0.6, 0.97), strict=False):
        near = order[np.argsort(np.abs(p[order] - np.quantile(p[order], quantile)), kind="stable")][:12]
        chosen.append(int(near[np.argsort(ratio[near], kind="stable")[int(aim * (len(near) - 1))]]))
    return chosen


def cluster_pictures(runs: Sequence[RunDataset]) -> Figure:
    """Three aggregates of rising size from each stress, in their outer sphere and ellipsoid (Frungieri & Vanni 2021, Fig. 10).

    Parameters
    ----------
    runs : sequence of RunDataset
        Of any stresses; those of one stress are replicas.

    Returns
    -------
    Figure
        Its numbers, and what draws them.

    Raises
    ------
    NothingToShowError
        Where the datasets hold nothing of it.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset
    >>> from mcdem.figures import cluster_pictures
    >>> figure = cluster_pictures([RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc")])
    >>> figure.name, dict(figure.numbers.sizes)
    ('fig10_clusters', {'aggregate': 3, 'primary': 43, 'axis': 3})
    """
    firsts = [group[0] for group in by_stress(runs).values()]
    numbers = _collected([(run, k) for run in firsts for k in chosen_shapes(run)])
    numbers.attrs["paper"] = int(
        any(paper.holds_for(run.scene, stress) for run in firsts for stress, *_ in paper.CLUSTERS)
    )
    return Figure(
        "fig10_clusters",
        "Aggregates in their sphere of outer radius (dashed) and inertia-equivalent ellipsoid (line).",
        numbers,
        draw_clusters,
    )


def _split(numbers: xr.Dataset) -> list[np.ndarray]:
    return np.split(numbers["position"].values, np.cumsum(numbers["size"].values)[:-1])


def draw_clusters(numbers: xr.Dataset) -> Canvas:
    """A row a stress, all to one scale."""
    shapes = _split(numbers)
    rows = len(np.unique(numbers["stress"].values))
    columns = len(shapes) // rows
    figure, grid = canvas(1.95 * columns, 2.2 * rows + 0.4, nrows=rows, ncols=columns, squeeze=False)
    # Titles of two lines do not fit into the layout's own margin.
    figure.set_layout_engine("constrained", h_pad=0.1)
    half = 1.05 * float(numbers["outer_radius"].max())
    for k, (axes, positions) in enumerate(zip(grid.ravel(), shapes, strict=True)):
        one = numbers.isel(aggregate=k)
        axes.imshow(_picture(positions, half), extent=(-half, half, -half, half))
        axes.add_patch(Circle((0, 0), float(one["outer_radius"]), fill=False, ls="--", lw=0.7, ec=BLACK))
        a1, a2, _ = one["semi_axes"].values
        axes.add_patch(Ellipse((0, 0), 2 * a1, 2 * a2, fill=False, lw=0.9, ec=VERMILION))
        axes.set(xticks=[], yticks=[])
        axes.spines[:].set_visible(False)
        letter = "abcdefghijklmnopqrstuvwxyz"[k % 26]
        axes.set_title(
            f"({letter}) {float(one['stress']):.4g} Pa, $P$ = {int(one['size'])}\n"
            rf"A.R. = {float(one['aspect_ratio']):.2f}, $\phi$ = {float(one['solid_fraction_sphere']):.2g}",
            fontsize=SMALL,
        )
    words = "all to one scale; orange: ellipsoid of inertia, dashed: outer sphere"
    if numbers.attrs["paper"]:
        printed = ", ".join(f"{p} ({phi:g})" for _, p, phi in paper.CLUSTERS)
        words += f"\npaper's examples, $P$ ($\\phi$): {printed}"
    figure.supxlabel(words, fontsize=SMALL, color=PRINT)
    return figure


def table_2(runs: Sequence[RunDataset], rows: int = 10) -> Figure:
    """Table 2: aggregates of the lowest stress, even over the upper half of the sizes of P > 3."""
    run = next(iter(by_stress(runs).values()))[0]
    p = run.population(-1)["size"].values
    order = np.argsort(p, kind="stable")
    order = order[p[order] > 3] if (p > 3).any() else order
    # The paper's sample has 15 to 54 primaries: the upper part of its population.
    chosen = order[np.unique(np.linspace(len(order) // 2, len(order) - 1, rows).round().astype(int))]
    beside = paper.holds_for(run.scene, paper.TABLE_2_STRESS)
    return Figure(
        "table2_clusters",
        f"Aggregates at {run.label}, even over the upper half of the sizes of P > 3"
        + (", beside the paper's at 750 Pa." if beside else "."),
        _collected([(run, int(k)) for k in chosen]).assign_attrs(paper=int(beside)),
        draw_table_2,
    )


HEADS = ("$P$", "$R_g/a$", "$R/a$", "A.R.", r"$\bar n_c$")


def draw_table_2(numbers: xr.Dataset) -> Canvas:
    """Picture and numbers of each aggregate; the paper's rows to the right where the run is at its stress."""
    shapes = _split(numbers)
    width = 12.6 if numbers.attrs["paper"] else 6.9
    figure, axes = canvas(0.52 * width, 0.52 * len(shapes) + 0.75)
    axes.set_axis_off()
    axes.set_xlim(0, width)
    axes.set_ylim(-len(shapes) - 0.2, 1.2)
    tables = [(0.2, 2.5, f"this run, {float(numbers['stress'][0]):.4g} Pa", BLUE)]
    if numbers.attrs["paper"]:
        tables.append((7.4, 8.4, f"paper, {paper.TABLE_2_STRESS:g} Pa", BLACK))
    for start, first, title, tint in tables:
        axes.text(start, 0.95, title, fontsize=7, weight="bold", color=tint)
        for k, head in enumerate(HEADS):
            axes.text(first + k, 0.35, head, ha="right", fontsize=7)
    half = float(numbers["outer_radius"].max())

    def row_of(first: float, row: int, values: Sequence[float]) -> None:
        for k, value in enumerate(values):
            text = f"{value:.0f}" if k == 0 else f"{value:.2f}"
            axes.text(first + k, -row - 0.5, text, ha="right", va="center", fontsize=7)

    for row, positions in enumerate(shapes):
        inset = axes.inset_axes((0.0, -row - 0.95, 1.5, 0.98), transform=axes.transData)
        inset.imshow(_picture(positions, half, 320))
        inset.set_axis_off()
        one = numbers.isel(aggregate=row)
        row_of(2.5, row, [float(one[name]) for name in COLUMNS[:5]])
        if numbers.attrs["paper"] and row < len(paper.TABLE_2):
            row_of(8.4, row, paper.TABLE_2[row].tolist())
    axes.axhline(0.15, color=BLACK, lw=0.6)
    headline(axes, "even over the upper half of the sizes of $P > 3$")
    return figure
