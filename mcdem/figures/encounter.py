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
from mcdem.figures.style import ORANGE, PRINT, SKY, SMALL, canvas

PARENTS = np.array([to_rgb(SKY), to_rgb(ORANGE)])


def components(tension: np.ndarray) -> np.ndarray:
    """(N,) number of the aggregate that each primary is in."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    return np.asarray(connected_components(coo_array(np.isfinite(tension)), directed=False)[1])


def moments(t: Trajectory) -> dict[str, int]:
    """Frames of five moments, each named by what is seen in it.

    approach: the first frame; nearing: the last before contact at which the two are more than 3 a apart; contact: the first with
    a bond between i and j, or where none is made `closest`, the frame of the smallest gap.  Then, where the number of
    aggregates changes again, `parting` if it rises or `joining` if it falls, the first frame after the last such change, and
    `drifting`, a few strains on; where it does not, `together` (or `passing`, of those that never touch) and `end`, halfway to
    the last frame and the last.
    """
    cross = t.parent[:, None] != t.parent[None]
    touched = np.isfinite(t.tension[:, cross]).any(axis=1)
    apart = np.array([int(components(f).max()) + 1 for f in t.tension])
    gap = np.linalg.norm(t.positions[:, :, None] - t.positions[:, None], axis=3)[:, cross].min(axis=1)
    contact = int(np.argmax(touched)) if touched.any() else int(np.argmin(gap))
    changes = contact + 1 + np.flatnonzero(np.diff(apart[contact:]))
    near = np.flatnonzero(gap[: contact + 1] > 3 * t.radius)
    before = int(near[-1]) if len(near) else contact // 2
    found = {
        "approach": before // 2,
        "nearing": before,
        "contact" if touched.any() else "closest": contact,
    }
    if len(changes):
        last = int(changes[-1])
        away = last + int(np.searchsorted(t.strain[last:], t.strain[last] + 4.0))
        parts = apart[last] > apart[last - 1]
        found |= {"parting" if parts else "joining": last}
        found |= {"drifting" if apart[-1] > 1 else "together": min(away, t.frames - 1)}
    else:
        middle = contact + (t.frames - contact) // 2
        found |= {"together" if touched.any() else "passing": min(middle, t.frames - 1), "end": t.frames - 1}
    return found


def snapshots(t: Trajectory) -> Figure:
    """Frames of an encounter side by side, from start to end (Frungieri & Vanni 2021, Fig. 14).

    Parameters
    ----------
    t : Trajectory
        Course of an encounter.

    Returns
    -------
    Figure
        Its numbers, and what draws them.

    Examples
    --------
    >>> import numpy as np
    >>> from mcdem.encounter import Trajectory
    >>> from mcdem.figures import snapshots
    >>> positions = 1e-6 * np.array([[[0, 0, 0], [0, 1, z]] for z in np.linspace(-4.0, 4.0, 9)])
    >>> passage = Trajectory(
    ...     0.5e-6, 1e4, np.nan, np.linspace(0, 8e-4, 9), positions, np.full((9, 2, 2), np.nan), np.array([0, 1])
    ... )
    >>> snapshots(passage).name
    'fig14_encounter'
    """
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
    figure, grid = canvas(1.42 * count, 2.15, ncols=count)
    # Titles of two lines do not fit into the layout's own margin.
    figure.set_layout_engine("constrained", h_pad=0.1)
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
        # Below the picture, where no primary can lie over it.
        bar = 10.0 if half > 8 else 4.0
        axes.plot(
            [-0.5 * bar, 0.5 * bar],
            [-1.1 * half] * 2,
            color="k",
            lw=1.5,
            solid_capstyle="butt",
            clip_on=False,
        )
        axes.set_xlabel(f"{bar:g} $a$", fontsize=SMALL, labelpad=7)
        axes.set_xlim(-half, half)
        axes.set_ylim(-half, half)
        axes.set_title(
            f"({'abcde'[k]}) {one['moment'].item()}\n" + rf"$\dot\gamma t$ = {float(one['strain']):.1f}",
            fontsize=SMALL,
        )
    outcome = numbers.attrs.get("outcome", "")
    figure.supxlabel(
        r"flow $\rightarrow$, gradient $\uparrow$; blue: $i$, orange: $j$"
        + (f"; outcome: {outcome}" if outcome else ""),
        fontsize=SMALL,
        color=PRINT,
    )
    return figure
