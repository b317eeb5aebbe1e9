"""Fig. 14: five moments of an encounter."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure as Canvas

from mcdem.encounter.trajectory import Trajectory
from mcdem.figures.figure import Figure
from mcdem.figures.render import SHEAR_PLANE, Camera
from mcdem.figures.render import Canvas as Picture
from mcdem.figures.style import ORANGE, SKY, canvas

MOMENTS = ("approach", "nearing", "contact", "parting", "drifting")
PARENTS = np.array([to_rgb(SKY), to_rgb(ORANGE)])


def components(tension: np.ndarray) -> np.ndarray:
    """(N,) number of the aggregate that each primary is in."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    return np.asarray(connected_components(coo_array(np.isfinite(tension)), directed=False)[1])


def moments(t: Trajectory) -> dict[str, int]:
    """Frames of the five moments; of an encounter that never touches or never parts, the nearest to them.

    approach: the first frame; nearing: halfway between it and contact in time, but near; contact: the first with a bond
    between i and j; parting: the first after the last change of the number of aggregates; drifting: a few strains on.
    """
    cross = t.parent[:, None] != t.parent[None]
    touched = np.isfinite(t.tension[:, cross]).any(axis=1)
    apart = [int(components(f).max()) + 1 for f in t.tension]
    gap = np.linalg.norm(t.positions[:, :, None] - t.positions[:, None], axis=3)[:, cross].min(axis=1)
    contact = int(np.argmax(touched)) if touched.any() else int(np.argmin(gap))
    changes = contact + 1 + np.flatnonzero(np.diff(apart[contact:]))
    split = int(changes[-1]) if len(changes) else min(contact + (t.frames - contact) // 2, t.frames - 1)
    near = np.flatnonzero(gap[: contact + 1] > 3 * t.radius)
    before = int(near[-1]) if len(near) else contact // 2
    away = split + int(np.searchsorted(t.strain[split:], t.strain[split] + 4.0))
    return dict(zip(MOMENTS, (before // 2, before, contact, split, min(away, t.frames - 1)), strict=True))


def snapshots(t: Trajectory) -> Figure:
    """Fig. 14 from the course of an encounter."""
    found = moments(t)
    numbers = t.to_xarray().isel(frame=list(found.values())).assign_coords(moment=("frame", list(found)))
    numbers.attrs.pop("scene", None)
    return Figure(
        "fig14_encounter",
        f"Five moments of an encounter in the shear plane ({t.origin.get('outcome', 'unknown outcome')}).",
        numbers,
        draw_snapshots,
    )


def draw_snapshots(numbers: xr.Dataset) -> Canvas:
    """The shear plane, flow to the right and gradient up, centred on the pair."""
    a = numbers.attrs["radius"]
    count = numbers.sizes["frame"]
    figure, grid = canvas(1.42 * count, 2.05, ncols=count)
    figure.set_layout_engine(
        "constrained", h_pad=0.12
    )  # two lines of title do not fit into the layout's own margin
    tints = PARENTS[numbers["parent"].values]
    for k, axes in enumerate(grid):
        one = numbers.isel(frame=k)
        x = one["position"].values / a
        # wide enough for all that is near; what has drifted off is outside
        centre = x.mean(axis=0)
        half = float(np.clip(1.1 * np.abs((x - centre)[:, 1:]).max() + 1.5, 6.0, 60.0))
        picture = Picture(Camera(centre, half, **SHEAR_PLANE), 480, 480).spheres(x, 1.0, tints).smoothed()
        axes.imshow(picture, extent=(-half, half, -half, half))
        axes.set_xticks([])
        axes.set_yticks([])
        bar = 5.0 if half > 8 else 2.0
        axes.plot(
            [-0.9 * half, -0.9 * half + 2 * bar], [-0.9 * half] * 2, color="k", lw=1.5, solid_capstyle="butt"
        )
        axes.text(-0.9 * half + bar, -0.85 * half, f"{2 * bar:g} a", fontsize=5.5, ha="center", va="bottom")
        axes.set_title(
            f"({'abcde'[k]}) {one['moment'].item()}\n" + rf"$\dot\gamma t$ = {float(one['strain']):.1f}",
            fontsize=6.5,
        )
    figure.supxlabel(
        rf"flow $\rightarrow$, gradient $\uparrow$; blue: $i$, orange: $j$; {numbers.attrs.get('outcome', '')}",
        fontsize=6,
    )
    return figure
