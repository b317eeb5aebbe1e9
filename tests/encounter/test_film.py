"""A film shows the encounter's frames, in the pair's frame, with the strain running."""

import re
import shlex
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from PIL import Image
from small_runs import SCENES
from trimer import A, turning_trimer
from typer.testing import CliRunner

from mcdem.aggregates.aggregate import Aggregate
from mcdem.aggregates.morphology import morphology
from mcdem.aggregates.shapes import aggregate_of
from mcdem.commands.main import app
from mcdem.encounter import trajectory
from mcdem.encounter.simulate import simulate_encounter
from mcdem.errors import UserError
from mcdem.figures.film import film, frames, half_widths, interesting, tension_scale
from mcdem.scene import load_scene


def test_frames_show_all_spheres_in_two_colours():
    course = turning_trimer(5)
    pictures = list(frames(course, width=240))
    assert len(pictures) == 5
    picture = pictures[0].astype(int)
    blue = (picture[..., 2] - picture[..., 0] > 60).sum()
    orange = (picture[..., 0] - picture[..., 2] > 60).sum()
    assert blue > 1.3 * orange > 100  # two of i against one of j
    assert np.abs(pictures[0].astype(int) - pictures[-1]).sum() > 0


@pytest.mark.parametrize(
    ("borne", "full"), [(1.0, "1"), (0.3, "0.5"), (0.02, "0.02"), (7e-4, "0.001"), (3.0, "1")]
)
def test_the_scale_of_colours_spans_what_bonds_bear(borne, full):
    """Bonds that bear little are not all grey, and the scale says how little that is."""
    course = turning_trimer(9)
    tension = np.where(np.isfinite(course.tension), borne * course.pull_off_force, np.nan)
    assert tension_scale(replace(course, tension=tension)) == (
        pytest.approx(float(full) * course.pull_off_force),
        full,
        "$F_{adh}$",
    )
    without = replace(course, tension=tension, pull_off_force=np.nan)
    assert tension_scale(without)[2] == "nN"


def test_the_camera_follows_the_centre_of_mass():
    course = turning_trimer(5)
    moved = course.part(0, 5)
    drift = np.array([3.0, -2.0, 7.0]) * A * np.arange(5)[:, None, None]
    object.__setattr__(moved, "positions", course.positions + drift)
    for here, there in zip(frames(course, 160), frames(moved, 160), strict=True):
        assert np.abs(here.astype(int) - there).mean() < 0.5


def test_the_picture_widens_without_a_jerk():
    course = turning_trimer(41)
    widths = half_widths(course)
    assert widths.shape == (41,)
    assert np.abs(np.diff(widths, 2)).max() < 0.02 * widths.max()


def test_only_the_part_with_something_to_see_is_kept():
    course = turning_trimer(201)  # 40 strains, contact at the middle
    kept = interesting(course)
    assert kept.strain[0] < 20 < kept.strain[-1]
    assert kept.frames < 150


@pytest.mark.parametrize("name", ["film.gif", "film.mp4"])
def test_film_reads_back(tmp_path, name):
    course = turning_trimer(9)
    if name.endswith("mp4"):
        reader = pytest.importorskip("imageio_ffmpeg", reason="imageio-ffmpeg is not installed")
        path = film(course, tmp_path / name, width=240, whole=True)
        count, seconds = reader.count_frames_and_secs(str(path))
        assert count == 9
        assert seconds == pytest.approx(9 / 25, abs=0.05)
        return
    path = film(course, tmp_path / name, width=240, whole=True)
    with Image.open(path) as image:
        assert image.n_frames == 9
        assert image.info["duration"] == 40


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(UserError, match=r"\.mp4 or \.gif"):
        film(turning_trimer(3), tmp_path / "film.avi")


def test_command_films_a_real_encounter(tmp_path):
    """Two monomers head-on at 1000 Pa stick: the last frame has one bond, and its pull is that of a doublet."""
    files = [tmp_path / "film.gif", tmp_path / "course.nc"]
    call = ["encounter", str(SCENES / "quickstart.toml"), "--offset", "0 nm", "120 nm", "--every", "2"]
    done = CliRunner().invoke(app, [*call, "--film", str(files[0]), "--trajectory", str(files[1])])
    assert done.exit_code == 0, done.output
    course = trajectory.read(files[1])
    assert course.origin["outcome"] == "aggregation"
    assert "aggregation" in done.output
    pairs, tension = course.bonds(course.frames - 1)
    assert pairs.tolist() == [[0, 1]]
    gap = np.linalg.norm(course.positions[-1, 0] - course.positions[-1, 1]) - 2 * course.radius
    assert abs(gap) < 1e-9
    assert abs(tension[0]) < course.pull_off_force
    with Image.open(files[0]) as image:
        assert image.n_frames > 5
    refused = CliRunner().invoke(app, [*call, "--film", str(files[0])])
    assert refused.exit_code == 2 and "--overwrite" in refused.output


GALLERY = (SCENES.parent / "docs/gallery.md").read_text()


def filmed():
    """What the gallery's film is of: options of its command, scene and rods."""
    (line,) = re.findall(r"<!-- film -->\n```bash\nmcdem (.*)\n```", GALLERY)
    command = typer.main.get_command(app).commands["encounter"]
    given = command.make_context("encounter", shlex.split(line)[1:]).params
    scene = load_scene(SCENES.parent / given["scene"])
    rods = [aggregate_of(scene, str(SCENES.parent / given[one]), one) for one in ("first", "second")]
    return given, scene, rods


@pytest.mark.parametrize(("displaced", "times"), [(1e-4, 1), pytest.param(1e-4, 12, marks=pytest.mark.slow)])
def test_the_films_outcome_is_not_left_to_round_off(displaced, times):
    """It is as the gallery says, wherever the primaries are within a ten-thousandth of a radius."""
    given, scene, rods = filmed()
    radius, rng = scene.suspension.radius, np.random.default_rng(times)
    (said,) = re.findall(r"Two rods of (\d+) and (\d+) primaries .* breaks into (\d+) and (\d+)\.", GALLERY)
    whole, broken, large, small = map(int, said)
    assert [rod.size for rod in rods] == [whole, broken]
    offset = [float(text.removesuffix(" nm")) * 1e-9 for text in given["offset"]]
    for _ in range(times):
        shaken = [
            Aggregate.from_positions(
                scene, rod.positions + displaced * radius * rng.standard_normal((rod.size, 3))
            )
            for rod in rods
        ]
        result = simulate_encounter(
            scene,
            *shaken,
            offset=tuple(offset + displaced * radius * rng.standard_normal(2)),
            seed=given["seed"],
        )
        assert result.outcome == "fragmentation" and result.contact
        assert sorted(product.size for product in result.products) == sorted([whole, large, small])


def test_the_films_rods_are_rigid_and_its_command_holds():
    """The gallery's film: the command's options are known, its clusters free contacts of 3P - 6 bonds."""
    given, scene, rods = filmed()
    for rod in rods:
        assert len(rod.bonds) == 3 * rod.size - 6
        assert morphology(rod.positions, rod.bonds, scene.suspension.radius)["floppy_modes"] == 0
    shown = SCENES.parent / "docs" / given["film"]
    assert f"{{image}} {given['film']}\n" in GALLERY
    assert shown.stat().st_size < 2_500_000
    # A clone is as it was after the command.
    assert f"/{given['film']}" in (SCENES.parent / ".gitignore").read_text().splitlines()


def test_what_a_film_needs_is_asked_for_before_anything_is_computed(tmp_path, monkeypatch):
    def computed(*_, **__):
        raise AssertionError("it was computed first")

    monkeypatch.setattr("mcdem.encounter.simulate.simulate_encounter", computed)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    scene = Path(__file__).parents[2] / "scenes" / "quickstart.toml"
    for option, name, words in (
        ("--film", "x.mp4", "MP4 needs imageio-ffmpeg"),
        ("--film", "x.avi", "a film ends in .mp4 or .gif"),
        ("--trajectory", "x.pdb", "ends in .nc or .xyz"),
    ):
        done = CliRunner().invoke(app, ["encounter", str(scene), option, str(tmp_path / name)])
        assert done.exit_code == 2 and words in done.output
