"""Nothing that is written destroys what it is not, and nothing half-made stays: one way for every writer of both programs."""

from __future__ import annotations

import errno
import os
import resource
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib.figure
import numpy as np
import pytest
import synthetic
import xarray as xr
from small_files import (
    ROOT,
    course,
    given_to_commands,
    make_run,
    make_table,
    names,
    small_run,
)

from mcdem.analysis.accuracy_cost import write_prices
from mcdem.analysis.sensitivity import write_differences
from mcdem.encounter.trajectory import export
from mcdem.errors import DataFileError, UserError
from mcdem.figures.film import film
from mcdem.monte_carlo.compress import compress
from mcdem.monte_carlo.run_control import run
from mcdem.monte_carlo.sweep import sweep
from mcdem.netcdf.whole_files import FILES, FILM, INDEX, RUN, TRAJECTORY, VTK, XYZ
from pbekit import files
from pbekit.errors import PBEError
from pbekit.outputs import FILES as PBE_FILES


def figure() -> matplotlib.figure.Figure:
    drawn = matplotlib.figure.Figure(figsize=(1, 1))
    drawn.subplots().plot([0, 1])
    return drawn


NUMBERS = xr.Dataset({"x": ("t", np.arange(3.0), {"units": "m"})})
PAGE = f'<!doctype html>\n<html><head><meta name="generator" content="{FILES.signature}"></head></html>'

# name, ending, what writes it to a path (over what it wrote before)
WRITERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "run": (".nc", make_run),
    "compress": (".nc", lambda path: compress(small_run(), path)),
    "kernels": (".nc", make_table),
    "numbers": (".nc", lambda path: FILES.write_numbers(path, NUMBERS)),
    "numbers of pbekit": (".nc", lambda path: PBE_FILES.write_numbers(path, NUMBERS)),
    "trajectory": (".nc", lambda path: export(course(), path)),
    "xyz": (".xyz", lambda path: export(course(), path)),
    "gif": (".gif", lambda path: film(course(), path, width=60)),
    "mp4": (".mp4", lambda path: film(course(), path, width=60)),
    "page": (".html", lambda path: FILES.write(path, FILES.page, PAGE)),
    "png": (".png", lambda path: FILES.write_picture(path, figure())),
    "pdf": (".pdf", lambda path: FILES.write_picture(path, figure())),
    "svg": (".svg", lambda path: FILES.write_picture(path, figure())),
    "png of pbekit": (".png", lambda path: PBE_FILES.write_picture(path, figure())),
    "table of sensitivity": (".csv", lambda path: write_differences([], path)),
    "table of cost": (".csv", lambda path: write_prices([], path)),
}


def refused(write: Callable[[Path], object], path: Path) -> str:
    """The one line with which a writer refuses."""
    with pytest.raises((UserError, PBEError)) as caught:
        write(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", WRITERS)
def test_a_writer_replaces_its_own_files_and_nothing_else(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)  # names of sockets are short
    ending, write = WRITERS[name]
    if name == "mp4":
        pytest.importorskip("imageio_ffmpeg")
    path, elsewhere = tmp_path / f"own{ending}", tmp_path / "elsewhere"
    elsewhere.mkdir()

    # a new one, over itself, over nothing
    for _ in range(2):
        write(path)
    assert path.stat().st_size > 0
    own = path.read_bytes()
    path.write_bytes(b"")
    write(path)
    path.chmod(0o640)
    write(path)
    assert path.stat().st_mode & 0o777 == 0o640

    # through a symbolic link: the link stays, and what it leads to is new
    link, target = tmp_path / f"link{ending}", elsewhere / f"target{ending}"
    link.symlink_to(target)
    write(link)
    assert link.is_symlink() and target.read_bytes()[:4] == own[:4]

    # what is not its own
    strangers = {
        "text": b"dear diary",
        "text that speaks of it": b"of mcdem run: shear aggregation, mcdem 0.1.0, written by mcdem 1",
        "NetCDF": b"\x89HDF\r\n\x1a\n of somebody else",
        "picture": b"\x89PNG\r\n\x1a\n tEXtSoftware\0Matplotlib",
        "table": b"file,mass\n",
    }
    for content in strangers.values():
        path.write_bytes(content)
        assert "remove it yourself" in refused(write, path)
        assert path.read_bytes() == content
    path.write_bytes(own)
    path.chmod(0o444)
    assert "write-protected" in refused(write, path)
    path.chmod(0o644)
    path.unlink()

    # what is no regular file
    os.mkfifo(path)
    assert "a named pipe" in refused(write, path)
    assert path.is_fifo()
    path.unlink()
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(path.name)
        assert "a socket" in refused(write, path)
        assert path.is_socket()
    path.unlink()
    path.mkdir()
    assert "folder" in refused(write, path)
    path.rmdir()
    path.symlink_to("nowhere/at/all")
    assert "folder" in refused(write, path)
    path.unlink()
    path.symlink_to(path.name)
    assert refused(write, path)
    assert names(tmp_path) == sorted([path.name, link.name, "elsewhere"])


def test_a_device_is_left_alone(tmp_path):
    """Nothing is written here: the check alone is asked."""
    (tmp_path / "link").symlink_to("/dev/null")
    for path in (Path("/dev/null"), tmp_path / "link"):
        for kind in (RUN, TRAJECTORY, VTK, XYZ, FILM, INDEX, FILES.page, FILES.picture):
            assert "is a device" in refused(lambda path, kind=kind: FILES.check(path, kind), path)


def test_no_writer_replaces_the_files_of_another(tmp_path):
    """A page over the run that it is about, a table over a run, a picture of one program over that of the other."""
    made = {}
    for name, (ending, write) in WRITERS.items():
        if name == "mp4":
            continue
        made[name] = tmp_path / f"{name}{ending}"
        write(made[name])
    same = {
        frozenset(("run", "compress")),
        *({frozenset((a, b)) for a in ("png", "pdf", "svg") for b in ("png", "pdf", "svg")}),
    }
    for name, (ending, write) in WRITERS.items():
        for other, path in made.items():
            if other == name or path.suffix != ending or frozenset((name, other)) in same:
                continue
            content = path.read_bytes()
            assert "remove it yourself" in refused(write, path), (name, other)
            assert path.read_bytes() == content
    for page in (made["run"], made["kernels"]):
        with pytest.raises(DataFileError, match="is no page of mcdem"):
            FILES.write(page, FILES.page, PAGE)


# -- full disks -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "number"),
    [
        *((name, errno.ENOSPC) for name in WRITERS),
        ("page", errno.EDQUOT),
        ("png", errno.EROFS),
        ("run", errno.EIO),
    ],
)
def test_a_disk_that_takes_no_more_leaves_what_was_there(tmp_path, monkeypatch, name, number):
    """The last step before the replacing fails, as on a file system that finds out late (a quota over NFS)."""
    ending, write = WRITERS[name]
    if name == "mp4":
        pytest.importorskip("imageio_ffmpeg")
    old, new = tmp_path / f"old{ending}", tmp_path / f"new{ending}"
    write(old)
    content = old.read_bytes()

    def full(path: Path) -> None:
        raise OSError(number, os.strerror(number), str(path))

    monkeypatch.setattr(files, "_to_disk", full)
    for path, stays in ((old, True), (new, False)):
        message = refused(write, path)
        assert f"cannot be written ({os.strerror(number)}" in message and ".part" not in message
        assert ("is intact" in message) == stays
    assert old.read_bytes() == content
    assert names(tmp_path) == [old.name]


def test_a_film_that_ffmpeg_cannot_finish_is_none(tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, before[1]))
    try:
        message = refused(lambda path: film(course(), path, width=60), tmp_path / "out.mp4")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "cannot be written (File too large" in message
    assert names(tmp_path) == []


def test_frames_in_a_folder_are_replaced_together(tmp_path, monkeypatch):
    folder = tmp_path / "frames"
    export(course(9), folder)
    (folder / "notes.txt").write_text("mine")
    export(course(4), folder)
    assert names(folder) == [*(f"frame_{k:04d}.vtk" for k in range(4)), "notes.txt"]
    before = {file.name: file.read_bytes() for file in folder.iterdir()}

    def full(path: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(files, "_to_disk", full)
    assert "No space left" in refused(lambda path: export(course(7), path), folder)
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before
    assert "No space left" in refused(lambda path: export(course(7), path), tmp_path / "new")
    monkeypatch.undo()
    assert names(tmp_path) == ["frames"]
    (folder / "frame_0002.vtk").write_text("# vtk DataFile Version 3.0\nof somebody else")
    with pytest.raises(DataFileError, match=r"frame_0002\.vtk: is no frame"):
        export(course(7), folder)
    assert len(names(folder)) == 5


PROGRAM = """
import sys
import tempfile
sys.path[:0] = {paths!r}
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, (3000, resource.RLIM_INFINITY))
from {program}.commands.main import app
app({arguments!r}, prog_name={program!r})
"""


def short_of_space(program: str, *arguments: object, cwd: Path) -> subprocess.CompletedProcess:
    """A command whose files end after 3000 bytes."""
    text = PROGRAM.format(
        paths=[str(ROOT), *sys.path], program=program, arguments=[str(a) for a in arguments]
    )
    return subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, timeout=300, cwd=cwd, check=False
    )


@pytest.fixture(scope="module")
def given(tmp_path_factory) -> Path:
    return given_to_commands(tmp_path_factory.mktemp("given"))


WRITING = {
    "plot": ("mcdem", "plot {given}/run.nc -o out.png"),
    "figures": ("mcdem", "figures {given}/course.nc -o out"),
    "report": ("mcdem", "report {given}/run.nc -o out.html"),
    "compress": ("mcdem", "compress {given}/run.nc -o out.nc"),
    "view": ("mcdem", "view {given}/course.nc -o out.html"),
    "run": ("mcdem", "run {given}/quickstart.toml -o out.nc --events 1 --workers 1"),
    "encounter": ("mcdem", "encounter {given}/quickstart.toml --seed 1 --trajectory out.nc"),
    "kernels": (
        "mcdem",
        "kernels {given}/quickstart.toml --from {given}/run.nc --aggregates-only --encounters 1 --workers 1 -o out.nc "
        "--shape outer~radius",
    ),
    "film": ("mcdem", "encounter {given}/quickstart.toml --seed 1 --film out.gif"),
    "solve": ("pbekit", "solve {given}/kernels.nc -o out.nc --until 1 --samples 300 --mean-shape"),
}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n == "compress" else pytest.mark.slow) for n in WRITING]
)
def test_a_command_on_a_full_disk_says_so_in_a_line(given, tmp_path, name):
    program, words = WRITING[name]
    done = short_of_space(
        program, *(word.replace("~", " ") for word in words.format(given=given).split()), cwd=tmp_path
    )
    said = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert done.returncode == 2, done.stderr
    assert len(said) == 1 and "cannot be written (File too large" in said[0], done.stderr
    assert "Traceback" not in done.stderr and "Exception ignored" not in done.stderr, done.stderr
    left = [file for file in tmp_path.rglob("*") if file.is_file()]
    assert left == []


@pytest.mark.parametrize("program", ["mcdem", pytest.param("pbekit", marks=pytest.mark.slow)])
def test_what_is_written_to_a_full_disk(program, given):
    """`/dev/full` is a disk that is always full."""
    words = {"mcdem": ["describe"], "pbekit": ["show", str(given / "kernels.nc")]}[program]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", program, *words],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            check=False,
        )
    assert done.returncode == 2
    assert done.stderr.startswith("error: output: No space left on device") and done.stderr.count("\n") == 1


# -- ends -----------------------------------------------------------------------------------------------------------

INTERRUPTED = """
import sys, time
sys.path[:0] = {paths!r}
from pathlib import Path
from mcdem.netcdf.whole_files import FILES, RUN
with FILES.locked({path!r}), FILES.replacing({path!r}, RUN) as beside:
    beside.write_bytes(b"half")
    print("begun", flush=True)
    time.sleep(60)
"""


@pytest.mark.parametrize(
    ("number", "code"),
    [
        (signal.SIGTERM, 143),
        pytest.param(signal.SIGHUP, 129, marks=pytest.mark.slow),
        pytest.param(signal.SIGINT, -signal.SIGINT, marks=pytest.mark.slow),
    ],
)
def test_nothing_half_made_stays_after_a_signal(tmp_path, number, code):
    path = tmp_path / "run.nc"
    make_run(path)
    whole = path.read_bytes()
    script = INTERRUPTED.format(paths=[str(ROOT), *sys.path], path=str(path))
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == b"begun\n"
        assert names(tmp_path) == [".run.nc.lock", ".run.nc.part", "run.nc"]
        process.send_signal(number)
        assert process.wait(20) == code
    assert names(tmp_path) == ["run.nc"]
    assert path.read_bytes() == whole


def test_what_a_killed_process_left_is_taken_over(tmp_path):
    """And a link in the way of the file beside is not followed."""
    (tmp_path / ".run.nc.lock").write_text("{}")
    (tmp_path / "precious").write_text("precious")
    (tmp_path / ".run.nc.part").symlink_to(tmp_path / "precious")
    make_run(tmp_path / "run.nc")
    assert names(tmp_path) == ["precious", "run.nc"]
    assert (tmp_path / "precious").read_text() == "precious"


# -- names and locks ------------------------------------------------------------------------------------------------


def test_a_run_goes_on_through_a_link(tmp_path):
    (tmp_path / "far").mkdir()
    path, link = tmp_path / "far/run.nc", tmp_path / "link.nc"
    scene = synthetic.scene()
    run(scene, path, events=2, encounter=synthetic.always_miss)
    link.symlink_to(path)
    run(scene, link, events=4, resume=True, encounter=synthetic.always_miss)
    assert link.is_symlink()
    assert xr.open_dataset(path).sizes["row"] == 5
    assert names(tmp_path / "far") == ["run.nc"]


def test_two_names_of_a_file_are_one_file(tmp_path):
    (tmp_path / "far").mkdir()
    path, link, folder = tmp_path / "far/run.nc", tmp_path / "link.nc", tmp_path / "near"
    link.symlink_to(path)
    folder.symlink_to("far")
    with FILES.locked(path):
        for name in (link, folder / "run.nc", tmp_path / "far/../far/run.nc"):
            with pytest.raises(DataFileError, match="another run is writing it"):
                make_run(name)
    assert names(tmp_path / "far") == []
    make_run(link)
    assert xr.open_dataset(path).sizes["row"] == 3


def test_an_index_of_somebody_else_is_kept(tmp_path):
    from mcdem.monte_carlo.executors import Here

    (tmp_path / "index.csv").write_text("file,mass\n")
    with pytest.raises(DataFileError, match=r"index\.csv: is no index of `mcdem sweep`"):
        sweep(synthetic.scene(), tmp_path, {"population.initial": ["20"]}, events=1, executor=Here())
    assert names(tmp_path) == ["index.csv"]
