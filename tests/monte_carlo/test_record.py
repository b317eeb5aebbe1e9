"""The dataset says what happened, whole at every moment, and refuses what it is not."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import synthetic
import xarray as xr

from mcdem.analysis.dataset import RunDataset
from mcdem.encounter.simulate import OUTCOMES
from mcdem.errors import DataFileError, UserError
from mcdem.monte_carlo.comparison import differences, identical
from mcdem.monte_carlo.record import TIMING
from mcdem.monte_carlo.run_control import run
from mcdem.netcdf.whole_files import FILES
from pbekit.checksum import seal
from pbekit.errors import PBEError
from pbekit.study.monte_carlo import MonteCarlo


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    """400 encounters with every outcome, three doublings or so, three snapshots between start and end."""
    path = tmp_path_factory.mktemp("record") / "run.nc"
    scene = synthetic.scene(population__initial=40, run__snapshot_every="100 ms")
    run(
        scene,
        path,
        events=400,
        seed=5,
        encounter=synthetic.aggregation_and_breakup,
        keep_parents=("unresolved", "exchange"),
    )
    return path


def test_every_variable_has_units_and_a_meaning(dataset):
    tree = xr.open_datatree(dataset, decode_timedelta=False)
    for node in tree.subtree:
        for name, variable in node.to_dataset(inherit=False).variables.items():
            assert variable.attrs["long_name"], name
            if variable.dtype.kind in "fiu":
                assert variable.attrs["units"], name
    assert set(tree.children) == {"events", "snapshots", "kept", "checkpoint"}


def test_the_series_gives_the_population_after_each_encounter(dataset):
    series = xr.open_dataset(dataset)
    tree = xr.open_datatree(dataset)
    events, snapshots = tree["events"].dataset, tree["snapshots"].dataset
    assert series.sizes["row"] == events.sizes["event"] + 1
    assert (series["time"][1:].values == events["time"].values).all()
    last = -1
    for s, (time, number) in enumerate(
        zip(snapshots["time"].values, snapshots["number_of_aggregates"].values, strict=True)
    ):
        row = int(np.searchsorted(series["time"].values, time, side="right")) - 1
        rows = slice(last + 1, last + 1 + number)
        last += number
        sizes, radii = snapshots["size"].values[rows], snapshots["outer_radius"].values[rows]
        now = series.isel(row=row)
        assert now["number_of_aggregates"] == number
        assert now["volume"] == snapshots["volume"][s]
        assert float(now["mean_size"]) == sizes.mean()
        assert float(now["size_deviation"]) == pytest.approx(sizes.std(), rel=1e-12)
        assert float(now["sauter_diameter"]) == pytest.approx(
            2 * (radii**3).sum() / (radii**2).sum(), rel=1e-9
        )
    assert snapshots["time"].values[:-1] == pytest.approx(0.1 * np.arange(len(snapshots["time"]) - 1))
    assert len(snapshots["time"]) > 3


def test_primaries_are_conserved_in_every_row_of_the_file(dataset):
    tree = xr.open_datatree(dataset)
    events, snapshots, series = tree["events"].dataset, tree["snapshots"].dataset, tree.dataset
    event_of_product = np.repeat(np.arange(events.sizes["event"]), events["number_of_products"].values)
    products = np.bincount(event_of_product, weights=events["product_size"].values)
    assert (products == events["parent_size"].sum("parent").values).all()
    from_first = np.bincount(event_of_product, weights=events["product_from_first"].values)
    assert (from_first == events["parent_size"].values[:, 0]).all()
    snapshot_of = np.repeat(np.arange(snapshots.sizes["snapshot"]), snapshots["number_of_aggregates"].values)
    primaries = np.bincount(snapshot_of, weights=snapshots["size"].values)
    assert (primaries == 40 * snapshots["volume"].values / float(series["volume"][0])).all()
    assert snapshots.sizes["primary"] == primaries.sum()


def test_aggregates_can_be_followed_by_their_numbers(dataset):
    """Every parent is a product or a member of an earlier snapshot, or a copy made by a doubling."""
    events = xr.open_datatree(dataset)["events"].dataset
    flags = dict(
        zip(
            events["outcome"].attrs["flag_meanings"].split(),
            events["outcome"].attrs["flag_values"],
            strict=True,
        )
    )
    assert tuple(flags) == OUTCOMES
    ends = np.cumsum(events["number_of_products"].values)
    for k, outcome in enumerate(events["outcome"].values):
        serials = set(
            events["product_serial"].values[ends[k] - events["number_of_products"].values[k] : ends[k]]
        )
        parents = set(events["parent_serial"].values[k])
        if outcome in (flags["missed"], flags["parted"], flags["unresolved"]):
            assert serials == parents
        else:
            assert not serials & parents or outcome == flags["fragmentation"]


def test_parents_are_kept_for_the_outcomes_asked_for(dataset):
    tree = xr.open_datatree(dataset)
    events, kept = tree["events"].dataset, tree["kept"].dataset
    wanted = np.isin(events["outcome"].values, [OUTCOMES.index("unresolved"), OUTCOMES.index("exchange")])
    assert (np.nonzero(wanted)[0] == kept["event"].values).all()
    assert (kept["size"].values.reshape(-1, 2) == events["parent_size"].values[wanted]).all()
    assert (kept["serial"].values.reshape(-1, 2) == events["parent_serial"].values[wanted]).all()
    unresolved = events["outcome"].values[wanted] == OUTCOMES.index("unresolved")
    assert [bool(reason) for reason in kept["reason"].values] == unresolved.tolist()


def test_the_origin_is_in_the_file(dataset):
    attributes = xr.open_dataset(dataset).attrs
    assert "volume_fraction = 1e-4" in attributes["scene"]
    assert attributes["seed"] == 5
    assert "numpy" in attributes["software"]
    assert attributes["command"]


def test_the_history_names_every_stretch_that_was_computed(tmp_path):
    path, scene = tmp_path / "run.nc", synthetic.scene(population__initial=40)
    for events, resume in ((20, False), (20, True), (35, True)):
        run(scene, path, events=events, seed=5, resume=resume, encounter=synthetic.aggregation_and_breakup)
    stretches = xr.open_dataset(path).attrs["history"].splitlines()
    assert [line.split(" from ")[1].split(",")[0] for line in stretches] == ["event 0", "event 20"]
    assert all("numba" in line for line in stretches)


def test_identical_sees_a_single_bit_but_not_the_clock(dataset, tmp_path):
    other = tmp_path / "other.nc"
    scene = synthetic.scene(population__initial=40, run__snapshot_every="100 ms")
    keep = ("unresolved", "exchange")
    run(scene, other, events=400, seed=5, encounter=synthetic.aggregation_and_breakup, keep_parents=keep)
    with netCDF4.Dataset(dataset) as a, netCDF4.Dataset(other) as b:
        assert not np.array_equal(a["events/cpu_time"][:], b["events/cpu_time"][:])
        assert TIMING == ("cpu_time",)
    assert identical(dataset, other)
    with netCDF4.Dataset(other, "a") as file:
        x = file["snapshots/position"][7, 2]
        file["snapshots/position"][7, 2] = np.nextafter(x, 1.0)
    with pytest.raises(DataFileError, match=r"other\.nc: .*checksum differ"):
        differences(dataset, other)
    seal(other)
    assert differences(dataset, other) == ["/snapshots/position: values"]


def refusal(path: Path, **options) -> str:
    with pytest.raises(UserError) as caught:
        run(
            synthetic.scene(population__initial=10),
            path,
            encounter=synthetic.always_miss,
            **{"events": 3, **options},
        )
    return str(caught.value)


def test_an_existing_file_is_neither_replaced_nor_continued_unasked(tmp_path):
    path = tmp_path / "run.nc"
    path.write_text("dear diary")
    assert "--overwrite" in refusal(path)
    assert path.read_text() == "dear diary"
    message = refusal(path, resume=True)
    assert "run.nc" in message and "cannot be read" in message
    assert path.read_text() == "dear diary"
    assert "is no dataset of `mcdem run`" in refusal(path, overwrite=True)
    assert path.read_text() == "dear diary"
    path.write_text("")  # nothing to lose
    for _ in range(2):
        run(synthetic.scene(), path, events=1, encounter=synthetic.always_miss, overwrite=True)
    assert xr.open_dataset(path).sizes["row"] == 2
    assert [file.name for file in tmp_path.iterdir()] == ["run.nc"]


def test_truncated_and_foreign_files_are_refused(dataset, tmp_path):
    truncated = tmp_path / "truncated.nc"
    whole = dataset.read_bytes()
    for length in (0, 100, len(whole) // 2, len(whole) - 1):
        truncated.write_bytes(whole[:length])
        assert "cannot be read" in refusal(truncated, resume=True)
    foreign = tmp_path / "foreign.nc"
    xr.Dataset({"x": ("t", np.arange(3.0))}).to_netcdf(foreign)
    assert "of another kind; expected a dataset written by `mcdem run`" in refusal(foreign, resume=True)
    assert xr.open_dataset(foreign).sizes == {"t": 3}


def test_impossible_places_are_refused(tmp_path):
    assert "folder" in refusal(tmp_path)
    assert "folder" in refusal(tmp_path / "nowhere" / "run.nc")


def test_another_scene_or_seed_does_not_continue_a_file(dataset, tmp_path):
    path = tmp_path / "run.nc"
    path.write_bytes(dataset.read_bytes())
    message = refusal(path, resume=True, events=500)
    assert "population.initial" in message and "40" in message
    same = synthetic.scene(population__initial=40, run__snapshot_every="100 ms")
    with pytest.raises(DataFileError, match="seed 5"):
        run(same, path, events=500, seed=6, resume=True, encounter=synthetic.always_miss)
    assert identical(path, dataset)


def test_a_second_run_on_a_file_is_refused(tmp_path):
    path = tmp_path / "run.nc"
    with FILES.locked(path):
        message = refusal(path)
    assert f"process {os.getpid()} on {socket.gethostname()}" in message
    assert not path.exists()
    run(synthetic.scene(), path, events=1, encounter=synthetic.always_miss)


def test_a_lock_left_by_a_killed_run_does_not_hold(tmp_path):
    path = tmp_path / "run.nc"
    (tmp_path / ".run.nc.lock").write_text(
        json.dumps({"process": 1, "host": "elsewhere", "since": "long ago"})
    )
    run(synthetic.scene(), path, events=1, encounter=synthetic.always_miss)


FULL_DISK = """
import resource, signal, sys
sys.path[:0] = {paths!r}
import synthetic
from mcdem.monte_carlo.run_control import run
from pbekit.errors import PBEError
from pbekit.checksum import seal
from pbekit.study.monte_carlo import MonteCarlo
from mcdem.errors import UserError

scene = synthetic.scene(population__initial=40)
run(scene, {path!r}, events=50, encounter=synthetic.aggregation_and_breakup)
resource.setrlimit(resource.RLIMIT_FSIZE, ({size}, resource.RLIM_INFINITY))
try:
    run(scene, {path!r}, events=4000, resume=True, encounter=synthetic.aggregation_and_breakup)
except UserError as problem:
    print(problem)
"""


def test_a_full_disk_leaves_the_last_state_usable(tmp_path):
    path = tmp_path / "run.nc"
    script = FULL_DISK.format(
        paths=[str(Path(__file__).parents[1] / "helpers"), *sys.path], path=str(path), size=300_000
    )
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=600)
    assert said.returncode == 0, said.stderr
    assert "cannot be written" in said.stdout and "MiB free" in said.stdout
    assert [file.name for file in tmp_path.iterdir()] == ["run.nc"]
    scene = synthetic.scene(population__initial=40)
    summary = run(scene, path, events=60, resume=True, encounter=synthetic.aggregation_and_breakup)
    assert summary.events == 60
    whole = tmp_path / "whole.nc"
    run(scene, whole, events=60, encounter=synthetic.aggregation_and_breakup)
    assert identical(path, whole)


def test_a_file_damaged_anywhere_is_refused_by_every_reader(dataset, tmp_path):
    """One bit of one byte in three hundred places, the end and the seed among them: one line that names the file."""
    whole = dataset.read_bytes()
    damaged = tmp_path / "damaged.nc"
    rng = np.random.default_rng(3)
    places = [*rng.integers(0, len(whole), 300), 0, len(whole) - 1, len(whole) - 70, whole.index(b"seed") + 4]
    for place in places:
        broken = bytearray(whole)
        broken[place] ^= 1 << int(rng.integers(8))
        damaged.write_bytes(broken)
        for read in (RunDataset, MonteCarlo.read, lambda path: differences(path, dataset)):
            with pytest.raises((DataFileError, PBEError)) as caught:
                read(damaged)
            assert str(caught.value).startswith(f"{damaged}: ") and "\n" not in str(caught.value)
    assert "checksum differ" in refusal(damaged, resume=True)
    assert "checksum differ" in refusal(damaged, resume=True, seed=6)
    assert damaged.read_bytes() == bytes(broken)


def test_a_dataset_of_before_checksums_is_read_and_its_damage_reported(tmp_path):
    """Blocks of noise: one line that names the file, or what it held."""
    old = Path(__file__).with_name("run_of_before.nc")
    whole = old.read_bytes()
    events = RunDataset(old).events["time"].values
    damaged = tmp_path / "damaged.nc"
    rng, refused = np.random.default_rng(4), 0
    for place in [0, 100, *rng.integers(0, len(whole) - 512, 25)]:
        damaged.write_bytes(whole[:place] + rng.bytes(512) + whole[place + 512 :])
        try:
            assert len(RunDataset(damaged).events["time"]) == len(events)
        except UserError as problem:
            assert damaged.name in str(problem) and "\n" not in str(problem)
            refused += 1
    assert refused > 10
