"""A page that shows an encounter or a population in three dimensions, to be turned and played; it needs no network.

The viewer is K3D-jupyter's (MIT), whose stand-alone script is put into the page with the data.
"""

from __future__ import annotations

import html
import json
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import to_hex, to_rgb
from numpy.typing import NDArray

from mcdem.analysis.dataset import RunDataset
from mcdem.encounter import trajectory
from mcdem.encounter.trajectory import Trajectory
from mcdem.errors import UserError
from mcdem.figures.film import half_widths, interesting, tension_scale
from mcdem.figures.style import ORANGE, SKY
from mcdem.netcdf.whole_files import FILES

PARENT_COLOURS = np.array([int(to_hex(c)[1:], 16) for c in (SKY, ORANGE)], dtype=np.uint32)
MOST_FRAMES = 400


def _k3d() -> Any:
    try:
        import k3d
    except ImportError:
        raise UserError('the interactive view needs k3d: pip install "pbekit[view]"') from None
    return k3d


def _packed(colours: NDArray[np.float64]) -> NDArray[np.uint32]:
    """(n, 3) in 0 .. 1 to 0xRRGGBB."""
    levels = np.round(255 * np.clip(colours, 0, 1)).astype(np.uint32)
    return np.asarray((levels[:, 0] << 16) | (levels[:, 1] << 8) | levels[:, 2], dtype=np.uint32)


def page_of(file: Path, snapshot: int = -1) -> str:
    """HTML of a file, whichever of the two it is; raises `UserError`."""
    if trajectory.is_trajectory(file):
        return encounter_page(trajectory.read(file))
    run = RunDataset(file)
    count = len(run.snapshot_times)
    if not -count <= snapshot < count:
        raise UserError(f"{file}: has no snapshot {snapshot}; expected {-count} to {count - 1}")
    run.scene.require_one_radius(
        "the shelf of a population shows such; `mcdem view` shows a trajectory of theirs"
    )
    return population_page(run, snapshot)


def encounter_page(t: Trajectory) -> str:
    """HTML of an encounter: primaries by parent, bonds by tension, in the frame of the pair; its time is the strain.

    Parameters
    ----------
    t : Trajectory
        Of `mcdem.encounter.read`; needs k3d (`pip install 'pbekit[view]'`).

    Returns
    -------
    str
        A page to turn and play in a browser, without a network.

    Raises
    ------
    UserError
        Without k3d.

    Examples
    --------
    >>> import numpy as np
    >>> from mcdem.encounter import Trajectory
    >>> from mcdem.figures import encounter_page
    >>> positions = 1e-6 * np.array([[[0, 0, 0], [0, 1, z]] for z in np.linspace(-4.0, 4.0, 9)])
    >>> passage = Trajectory(
    ...     0.5e-6, 1e4, np.nan, np.linspace(0, 8e-4, 9), positions, np.full((9, 2, 2), np.nan), np.array([0, 1])
    ... )
    >>> "<html" in encounter_page(passage)
    True
    """
    k3d = _k3d()
    t = interesting(t)
    t = t.part(0, t.frames, max(1, -(-t.frames // MOST_FRAMES)))
    # seen as the film shows it: flow to the right, gradient up
    about = (t.positions - t.positions.mean(axis=1, keepdims=True))[:, :, [2, 1, 0]] * [1, 1, -1] / t.radius
    scale, full, unit = tension_scale(t)
    bonds = [t.bonds(k) for k in range(t.frames)]
    slots = max(1, *(len(pairs) for pairs, _ in bonds))
    points, vertices, colours = {}, {}, {}
    for k, (pairs, tension) in enumerate(bonds):
        now = f"{t.strain[k]:.6g}"
        points[now] = about[k].astype(np.float32)
        # the viewer wants as many rods in every frame: those left over hide inside the first primary
        ends = np.broadcast_to(about[k][0] + [[0, 0, 0], [0.01, 0, 0]], (slots, 2, 3)).copy()
        ends[: len(pairs)] = about[k][pairs]
        tints = np.zeros((slots, 3))
        tints[: len(pairs)] = mpl.colormaps["coolwarm"](0.5 + 0.5 * tension / scale)[:, :3]
        vertices[now], colours[now] = ends.reshape(-1, 3).astype(np.float32), np.repeat(_packed(tints), 2)
    plot = k3d.plot(
        grid_visible=False, camera_auto_fit=False, menu_visibility=False, axes_helper=0, name="encounter"
    )
    plot += k3d.points(
        points,
        colors=PARENT_COLOURS[t.parent],
        point_size=2.0,
        # Sizes of their own come before the common one.
        point_sizes=[] if t.radii is None else (2.0 * t.radii / t.radius).astype(np.float32),
        shader="3d",
        mesh_detail=3,
        name="primaries",
    )
    plot += k3d.lines(
        vertices,
        np.arange(2 * slots, dtype=np.uint32).reshape(-1, 2),
        indices_type="segment",
        colors=colours,
        width=0.35,
        shader="mesh",
        radial_segments=8,
        name="bonds, by tension",
        visible=True,
    )
    span = 0.85 * float(half_widths(t).max()) / t.radius
    plot.camera = [0, 0, span / np.tan(np.radians(20)), 0, 0, 0, 0, 1, 0]
    plot.camera_fov = 40
    outcome = t.origin.get("outcome", "")
    title = f"Encounter{': ' + outcome if outcome else ''}, {t.positions.shape[1]} primaries"
    return _page(
        plot,
        title,
        "flow to the right, gradient up; blue i, orange j; bonds blue pushed, red pulled, "
        f"full colour at {full} {unit.replace('$F_{adh}$', 'F_adh')}",
        t.strain,
    )


def population_page(run: RunDataset, snapshot: int = -1) -> str:
    """HTML of a run's snapshot: its aggregates on a shelf, by size, each by its own colour.

    Parameters
    ----------
    run : RunDataset
        What is shown; needs k3d (`pip install 'pbekit[view]'`).
    snapshot : int
        Which of `run.snapshot_times`; the last by default.

    Returns
    -------
    str
        A page to turn in a browser, without a network.

    Raises
    ------
    UserError
        Without k3d.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset
    >>> from mcdem.figures import population_page
    >>> page = population_page(RunDataset("notebooks/data/run-750Pa-of-100.nc"), snapshot=5)
    >>> "<html" in page
    True
    """
    k3d = _k3d()
    sizes = run.population(snapshot, rigidity=False)["size"].values
    radii = run.population(snapshot, rigidity=False)["outer_radius"].values / run.radius
    order = np.argsort(-sizes, kind="stable")
    cell = 2.0 * radii[order]
    shelf = 1.5 * float(np.sqrt(((cell + 1.0) ** 2).sum()))
    centres: list[NDArray[np.float64]] = []
    colours, bonds = [], []
    palette = [np.array(to_rgb(c)) for c in mpl.colormaps["tab20"].colors]  # type: ignore[attr-defined]  # a list
    x = y = row_height = 0.0
    for n, k in enumerate(order):
        if x + cell[n] > shelf and x > 0:
            x, y, row_height = 0.0, y - row_height - 1.0, 0.0
        row_height = max(row_height, cell[n])
        positions, pairs = run.geometry(int(k), snapshot)
        spot = np.array([x + 0.5 * cell[n], y - 0.5 * cell[n], 0.0])
        first = sum(len(c) for c in centres)
        centres.append((positions - positions.mean(axis=0)) / run.radius + spot)
        colours.append(np.repeat(_packed(palette[n % len(palette)][None]), len(positions)))
        bonds.append(np.asarray(pairs, dtype=np.int64) + first)
        x += cell[n] + 1.0
    points = np.vstack(centres)
    points -= 0.5 * (points.max(axis=0) + points.min(axis=0))
    plot = k3d.plot(
        grid_visible=False, camera_auto_fit=False, menu_visibility=False, axes_helper=0, name="population"
    )
    plot += k3d.points(
        points.astype(np.float32),
        colors=np.concatenate(colours),
        point_size=2.0,
        shader="3d",
        name="primaries",
    )
    pairs = np.vstack(bonds)
    if len(pairs):
        plot += k3d.lines(
            points.astype(np.float32),
            pairs.astype(np.uint32),
            indices_type="segment",
            color=0x333333,
            width=0.3,
            shader="simple",
            name="bonds",
        )
    plot.camera_fov = 40
    plot.camera = [0, 0, 1.05 * shelf / 2 / np.tan(np.radians(20)), 0, 0, 0, 0, 1, 0]
    time = run.snapshot_times[snapshot]
    return _page(
        plot,
        f"{len(sizes)} aggregates at t = {time:.4g} s, {run.label}",
        "by size; colours tell them apart",
        None,
    )


def _page(plot: Any, title: str, legend: str, strain: NDArray[np.float64] | None) -> str:
    """The viewer's own page, with a headline and, for a course, a slider of strain that plays."""
    page = str(plot.get_snapshot(additional_js_code=PLAYER if strain is not None else SHOWN))
    controls = '<label><input id="small" type="checkbox"> show bonds</label> ' + (
        '<button id="play" aria-label="play">&#9654;</button>'
        f'<input id="strain" type="range" min="0" max="{len(strain) - 1}" value="0" aria-label="strain">'
        '<output id="now"></output>'
        if strain is not None
        else ""
    )
    head = (
        f"<style>{STYLE}</style>"
        f'<div id="bar"><b>{html.escape(title)}</b> <span>{html.escape(legend)}; drag to turn, wheel to zoom</span>'
        f"<div>{controls}</div></div>"
        f"<script>const STRAINS = {json.dumps([] if strain is None else [round(float(s), 6) for s in strain])};</script>"
    )
    if "<body>" not in page:
        raise RuntimeError("the viewer's page has no <body>: k3d has changed its template")
    return page.replace("<body>", "<body>" + head, 1).replace(
        "<head>",
        f'<head><meta name="generator" content="{FILES.signature}"><title>{html.escape(title)}</title>',
        1,
    )


STYLE = """
#bar { position: fixed; left: 0; top: 0; z-index: 100000; padding: 8px 12px; font: 14px sans-serif; max-width: 70vw;
  background: rgba(255, 255, 255, .8); }
#bar span { color: #555; font-size: 12px; }
#strain { width: 40vw; vertical-align: middle; }
"""

# The viewer's spheres shrink so that the bonds within them are seen.
BONDS = """
let whole = null;
document.getElementById('small').onchange = (event) => {
  const world = K3DInstance.getWorld();
  const spheres = Object.values(world.ObjectsListJson).find((object) => object.name === 'primaries');
  const share = event.target.checked ? 0.35 : 1.0;
  const changes = {point_size: 2.0 * share};
  if (spheres.point_sizes && spheres.point_sizes.data.length) {
    whole = whole || Float32Array.from(spheres.point_sizes.data);
    changes.point_sizes = {...spheres.point_sizes, data: whole.map((size) => size * share)};
  }
  Object.assign(spheres, changes);
  K3DInstance.reload(spheres, changes).then(() => K3DInstance.render());
};
"""
SHOWN = BONDS + "window.viewer = K3DInstance; document.body.dataset.ready = 'yes';"

# The viewer interpolates between frames by its own clock; here the slider sets the time, so what is shown is a frame.
PLAYER = (
    BONDS
    + """
window.viewer = K3DInstance;
const slider = document.getElementById('strain'), button = document.getElementById('play');
let playing = null;
const show = (k) => {
  slider.value = k;
  document.getElementById('now').textContent = 'strain ' + STRAINS[k].toFixed(1);
  document.body.dataset.frame = k;
  return K3DInstance.setTime(STRAINS[k]);
};
const stop = () => { clearInterval(playing); playing = null; button.innerHTML = '&#9654;'; };
button.onclick = () => {
  if (playing) { stop(); return; }
  if (+slider.value >= STRAINS.length - 1) show(0);
  button.innerHTML = '&#10074;&#10074;';
  playing = setInterval(() => (+slider.value < STRAINS.length - 1 ? show(+slider.value + 1) : stop()), 50);
};
slider.oninput = () => { stop(); show(+slider.value); };
show(0);
document.body.dataset.ready = 'yes';
"""
)
