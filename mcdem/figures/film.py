"""Films of encounters: the spheres, and beside them the bonds coloured by their tension."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from mcdem.encounter.trajectory import Trajectory
from mcdem.errors import UserError
from mcdem.figures.encounter import PARENTS, components
from mcdem.figures.render import SHEAR_PLANE, Camera, Canvas
from mcdem.figures.style import GREY, look
from mcdem.netcdf.whole_files import FILES, FILM

FRAMES_PER_SECOND = 25
FORMATS = {".mp4": "imageio-ffmpeg", ".gif": "pillow"}
BEFORE, AFTER = 6.0, 10.0
"""Strains shown before the two are near each other and after the last aggregate was made or broke."""
ASPECT = 2.2
"""Width over height of each of the two pictures: what parts drifts away along the flow."""


def interesting(t: Trajectory) -> Trajectory:
    """From shortly before the aggregates are near to shortly after the last change of who is bonded to whom.

    A cluster may exchange bonds within itself for ever; that alone is no reason to go on.
    """
    cross = t.parent[:, None] != t.parent[None]
    distance = np.linalg.norm(t.positions[:, :, None] - t.positions[:, None], axis=3)
    touching = t.each_radius[:, None] + t.each_radius
    gap = (distance - touching)[:, cross].min(axis=1)
    near = int(np.argmax(gap < t.radius)) if (gap < t.radius).any() else int(np.argmin(gap))
    members = np.array([components(tension) for tension in t.tension])
    changed = np.flatnonzero((members[1:] != members[:-1]).any(axis=1))
    last = max(int(changed[-1]) + 1 if len(changed) else 0, int(np.argmin(gap)))
    first = int(np.searchsorted(t.strain, t.strain[near] - BEFORE))
    return t.part(first, int(np.searchsorted(t.strain, t.strain[last] + AFTER)) + 1)


def half_widths(t: Trajectory) -> NDArray[np.float64]:
    """(F,) [m] what a picture spans along the flow: all there is, within bounds, and never in a jerk."""
    about = np.abs(t.positions - t.positions.mean(axis=1, keepdims=True)).max(axis=1) + 2 * t.radius
    away = np.maximum(about[:, 2], ASPECT * about[:, 1])
    together = float(away.min())
    wanted = np.clip(away, 1.2 * together, 2.4 * together)
    window = max(1, round(2.0 / max(float(np.median(np.diff(t.strain))) if t.frames > 1 else 1.0, 1e-9)))
    kernel = np.hanning(2 * window + 3)[1:-1]
    padded = np.pad(wanted, window, mode="edge")
    return np.asarray(np.convolve(padded, kernel / kernel.sum(), mode="valid"))


def tension_scale(t: Trajectory) -> tuple[float, str, str]:
    """Tension [N] at the ends of the scale of colours, the same in its unit, and the unit.

    The least of 1, 0.5, 0.2, 0.1 ... of the pull-off force that all but one in a hundred bonds stay within, so that bonds that
    bear little are not all grey; the few beyond have the colour of its end.  Without contacts in nanonewtons.
    """
    borne = np.abs(t.tension[np.isfinite(t.tension)])
    most = float(np.quantile(borne, 0.99)) if borne.size else 0.0
    unit, words = (t.pull_off_force, r"$F_{adh}$") if np.isfinite(t.pull_off_force) else (1e-9, "nN")
    share = max(most / unit, 1e-6)
    decade = 10.0 ** np.floor(np.log10(share))
    end = next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= share * (1 - 1e-9))
    if np.isfinite(t.pull_off_force):
        end = min(end, 1.0)
    return float(end * unit), f"{end:.1g}", words


def frames(t: Trajectory, width: int = 720) -> Iterator[NDArray[np.uint8]]:
    """Pictures (height, width, 3) one after another: spheres by parent; bonds by tension (`tension_scale`)."""
    scale, full, unit = tension_scale(t)
    colours = ScalarMappable(Normalize(-1, 1), mpl.colormaps["coolwarm"])
    tints = PARENTS[t.parent]
    tall = round(width / ASPECT)
    strip = round(0.09 * width)
    height = 2 * tall + strip
    with look():
        figure = Figure(figsize=(width / 100, height / 100), dpi=100)
        figure.set_layout_engine("none")
        agg = FigureCanvasAgg(figure)
        above = figure.add_axes((0.0, (tall + strip) / height, 1.0, tall / height))
        below = figure.add_axes((0.0, strip / height, 1.0, tall / height))
        for axes in (above, below):
            axes.set_axis_off()
        size = 10 * width / 720
        clock = figure.text(0.015, 0.985, "", fontsize=1.1 * size, va="top")
        count = figure.text(0.015, (tall + strip) / height, "", fontsize=1.1 * size, va="top")
        figure.text(
            0.985,
            0.985,
            r"flow $\rightarrow$, gradient $\uparrow$",
            fontsize=0.85 * size,
            color=GREY,
            va="top",
            ha="right",
        )
        bar = figure.add_axes((0.62, 0.66 * strip / height, 0.34, 0.24 * strip / height))
        scale_bar = figure.colorbar(colours, cax=bar, orientation="horizontal", ticks=[-1, 0, 1])
        scale_bar.ax.tick_params(length=0, pad=1)
        scale_bar.ax.set_xticklabels([f"push {full}", "0", f"{full} pull"], fontsize=0.9 * size)
        figure.text(0.565, 0.62 * strip / height, f"bond tension [{unit}]", fontsize=0.85 * size, ha="right")
        pictures: list[AxesImage] = []
        for k, half in enumerate(half_widths(t)):
            camera = Camera(t.positions[k].mean(axis=0), half, **SHEAR_PLANE)
            solid = (
                Canvas(camera, 2 * width, 2 * tall).spheres(t.positions[k], t.each_radius, tints).smoothed()
            )
            pairs, tension = t.bonds(k)
            net = Canvas(camera, 2 * width, 2 * tall)
            net.spheres(t.positions[k], 0.30 * t.each_radius, 0.25 + 0.5 * tints)
            if len(pairs):
                ends = t.positions[k][pairs]
                net.rods(ends[:, 0], ends[:, 1], 0.16 * t.radius, colours.to_rgba(tension / scale)[:, :3])
            for place, (axes, image) in enumerate(((above, solid), (below, net.smoothed()))):
                if len(pictures) < 2:
                    pictures.append(axes.imshow(image, aspect="auto", interpolation="none"))
                else:
                    pictures[place].set_data(image)
            clock.set_text(rf"strain $\dot\gamma t$ = {t.strain[k]:5.1f}")
            strongest = max(float(tension.max(initial=0.0)), 0.0) / scale * float(full)
            count.set_text(f"{len(pairs)} bonds, strongest pull {strongest:.2g} {unit}")
            agg.draw()
            yield np.asarray(agg.buffer_rgba())[:, :, :3].copy()


def film(
    trajectory: Trajectory,
    path: Path | str,
    width: int | None = None,
    whole: bool = False,
    progress: Callable[[str, float], None] = lambda state, share: None,
) -> Path:
    """Write an encounter as MP4 (H.264) or GIF, by the file's ending.

    Parameters
    ----------
    trajectory : Trajectory
        Course of an encounter.
    path : Path or str
        Ends in .mp4 (needs imageio-ffmpeg, of `pip install 'pbekit[view]'`) or .gif.
    width : int
        Of the picture in pixels; 720 for MP4 and 440 for GIF by default.
    whole : bool
        From the first frame to the last, not only from shortly before contact to shortly after the last change.
    progress : callable
        Called with each picture that is drawn, in words, and the share of them that are.

    Returns
    -------
    Path
        Of the film.

    Raises
    ------
    UserError
        Of another ending, or without what writes MP4.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from mcdem.encounter import Trajectory
    >>> from mcdem.figures import film
    >>> positions = 1e-6 * np.array([[[0, 0, 0], [0, 1, z]] for z in np.linspace(-4.0, 4.0, 3)])
    >>> passage = Trajectory(
    ...     0.5e-6, 1e4, np.nan, np.linspace(0, 8e-4, 3), positions, np.full((3, 2, 2), np.nan), np.array([0, 1])
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     film(passage, Path(folder) / "passage.gif", width=120, whole=True).stat().st_size > 0
    True
    """
    path = Path(path)
    require_writer(path)
    check(path)
    course = trajectory if whole else interesting(trajectory)
    with FILES.replacing(path, FILM) as beside:
        if path.suffix.lower() == ".gif":
            _write_gif(course, beside, width or 440, progress)
        else:
            _write_mp4(course, beside, width or 720, progress)
    return path


def check(path: Path | str, *, overwrite: bool = True) -> None:
    """Raise `UserError` where no film of this name may be written."""
    path = Path(path)
    require_format(path)
    FILES.check(path, FILM, overwrite=overwrite)


def require_format(path: Path) -> None:
    """Raise `UserError` where the name is none of a film."""
    if path.suffix.lower() not in FORMATS:
        raise UserError(f"{path}: a film ends in {' or '.join(FORMATS)}")


def require_writer(path: Path) -> None:
    """Raise `UserError` where a film of that name cannot be made here; to be asked before anything is computed for it."""
    require_format(path)
    if path.suffix.lower() == ".mp4":
        try:
            import imageio_ffmpeg

            imageio_ffmpeg.get_ffmpeg_exe()
        except (ImportError, RuntimeError) as problem:
            raise UserError(
                f'{path}: MP4 needs imageio-ffmpeg ({problem}): pip install "pbekit[view]", or name a .gif'
            ) from None


Progress = Callable[[str, float], None]


def _counted(
    pictures: Iterator[NDArray[np.uint8]], count: int, progress: Progress
) -> Iterator[NDArray[np.uint8]]:
    for number, picture in enumerate(pictures, start=1):
        progress(f"{number} of {count} pictures", number / count)
        yield picture


def _write_mp4(course: Trajectory, path: Path, width: int, progress: Progress) -> None:
    import imageio_ffmpeg

    pictures = _counted(frames(course, width - width % 2), course.frames, progress)
    first = next(pictures)
    height = first.shape[0] - first.shape[0] % 2
    writer = imageio_ffmpeg.write_frames(
        str(path),
        (first.shape[1], height),
        fps=FRAMES_PER_SECOND,
        codec="libx264",
        quality=None,
        macro_block_size=2,
        output_params=[
            *("-crf", "23", "-preset", "medium", "-threads", "1"),
            *("-metadata", f"comment=written by {FILES.signature}", "-f", "mp4"),
        ],
        ffmpeg_log_level="quiet",
    )
    writer.send(None)
    writer.send(np.ascontiguousarray(first[:height]))
    for picture in pictures:
        writer.send(np.ascontiguousarray(picture[:height]))
    writer.close()
    if not _is_whole(path):  # the library that calls ffmpeg does not report how it ended
        raise OSError("ffmpeg could not finish the film")


def _is_whole(path: Path) -> bool:
    """Whether the boxes of an MP4 fill its file and the one that names the frames is among them."""
    content, place, names = path.read_bytes(), 0, set()
    while place + 8 <= len(content):
        length, name = int.from_bytes(content[place : place + 4], "big"), content[place + 4 : place + 8]
        if length == 1:
            length = int.from_bytes(content[place + 8 : place + 16], "big")
        if length < 8:
            return False
        names.add(name)
        place += length
    return place == len(content) and b"moov" in names


def _write_gif(course: Trajectory, path: Path, width: int, progress: Progress) -> None:
    from PIL import Image

    every = max(1, round(course.frames / 110))  # a page loads so many small pictures without a wait
    course = course.part(0, course.frames, every)
    images = [
        Image.fromarray(picture) for picture in _counted(frames(course, width), course.frames, progress)
    ]
    # One palette for all, or the background would flicker.
    palette = images[len(images) // 2].quantize(colors=64, method=Image.Quantize.MEDIANCUT)
    small = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    small[0].save(
        path,
        save_all=True,
        append_images=small[1:],
        duration=round(1000 * every / FRAMES_PER_SECOND),
        loop=0,
        optimize=True,
        format="GIF",
        comment=f"written by {FILES.signature}".encode(),
    )
