"""Kernel tables from runs and from designed encounters: repeatable, resumable, refused where they cannot be."""

from __future__ import annotations

import dataclasses
import shutil

import numpy as np
import pytest
import synthetic
from typer.testing import CliRunner

from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.similarity import groups
from mcdem.commands.main import app
from mcdem.errors import DataFileError, UserError
from mcdem.kernel_tables import into_atlas, steady_shares, tabulate, with_runs
from mcdem.kernel_tables.design import ROUND, plan
from mcdem.kernel_tables.library import Library
from mcdem.kernel_tables.runs import only_designed, records_of_run
from mcdem.monte_carlo import executors
from mcdem.monte_carlo.run_control import run
from pbekit.errors import PBEError
from pbekit.tables.atlas import Atlas
from pbekit.tables.kernel_table import OUTCOMES, KernelTable, Records
from pbekit.tables.similarity import groups_of

ENCOUNTER = synthetic.aggregation_and_breakup


@pytest.fixture(scope="module")
def scene():
    return synthetic.scene(population__initial=40, run__snapshot_every="100 ms")


@pytest.fixture(scope="module")
def dataset(scene, tmp_path_factory):
    path = tmp_path_factory.mktemp("tabulate") / "run.nc"
    run(scene, path, events=600, seed=5, encounter=ENCOUNTER)
    return path


def make(scene, path, dataset, count, **options):
    return tabulate(scene, path, [dataset], encounters=count, encounter=ENCOUNTER, seed=3, **options)


def same(one, other):
    """Whether two tables hold the same encounters, but for the time they took."""
    a, b = (KernelTable.load(p).records for p in (one, other))
    names = [f.name for f in dataclasses.fields(Records) if f.name != "cpu_time"]
    return all(np.array_equal(getattr(a, n), getattr(b, n), equal_nan=True) for n in names)


def test_a_runs_events_become_records(scene, dataset):
    opened = RunDataset(dataset)
    records = records_of_run(opened)
    assert len(records) == 600
    words = np.array(OUTCOMES)[records.outcome]
    for outcome in ("missed", "aggregation", "parted", "exchange"):
        assert (words == outcome).sum() == (opened.outcome == outcome).sum()
    broken = np.char.startswith(words, "fragmentation")
    assert broken.sum() == (opened.outcome == "fragmentation").sum()
    touched = opened.events["contact"].values.astype(bool)
    assert np.array_equal(words == "fragmentation with contact", broken & touched)
    assert np.all(records.aspect_ratio[records.size == 1] == 1)
    assert np.isfinite(records.product_radius_of_gyration).all()


def test_a_table_without_design_holds_the_run(scene, dataset, tmp_path):
    done = make(scene, tmp_path / "k.nc", dataset, 0)
    table = KernelTable.load(tmp_path / "k.nc")
    assert (done.reused, done.designed) == (600, 0) and len(table.records) == 600
    assert table.about["scene"] == scene.text and table.about["seed"] == 3
    assert table.radius == scene.suspension.radius and table.shear_rate == scene.flow.shear_rate


def test_designed_encounters_are_of_the_classes_planned(scene, dataset, tmp_path):
    make(scene, tmp_path / "k.nc", dataset, 2 * ROUND + 30)
    table = KernelTable.load(tmp_path / "k.nc")
    designed = table.with_records(table.records.select(table.records.source == 1))
    assert len(designed.records) == 2 * ROUND + 30
    before = table.with_records(table.records.select(table.records.source == 0))
    library = Library.of([RunDataset(dataset)], before)
    planned = plan(before, library, scene.suspension.volume_fraction, 3, 0)
    np.testing.assert_array_equal(designed.pair[:ROUND], planned.pairs)
    assert planned.error is None or planned.error > 0
    # The designed encounters alone and the run again are the table, from a file too.
    only_designed(table).save(tmp_path / "designed.nc")
    kept = KernelTable.load(tmp_path / "designed.nc")
    assert len(kept.records) == 2 * ROUND + 30
    shutil.copy(dataset, tmp_path / "other.nc")
    with pytest.raises(UserError, match=r"runs = other.nc: expected .*, with which"):
        with_runs(kept, [RunDataset(tmp_path / "other.nc")])
    with_runs(kept, [RunDataset(dataset)]).save(tmp_path / "again.nc")
    assert same(tmp_path / "k.nc", tmp_path / "again.nc")


def test_the_table_is_the_same_on_two_workers_and_after_interruption(scene, dataset, tmp_path):
    count = ROUND + 60
    make(scene, tmp_path / "one.nc", dataset, count)
    with executors.local_processes(2) as pool:
        make(scene, tmp_path / "two.nc", dataset, count, executor=pool)
    assert same(tmp_path / "one.nc", tmp_path / "two.nc")
    for stop in (37, ROUND, count):
        make(scene, tmp_path / "parts.nc", dataset, stop, resume=True)
    assert same(tmp_path / "one.nc", tmp_path / "parts.nc")


def test_encounters_of_two_primaries_come_first_until_there_are_enough(scene, dataset, tmp_path):
    reused = int((records_of_run(RunDataset(dataset)).size == 1).all(axis=1).sum())
    make(scene, tmp_path / "k.nc", dataset, ROUND + 60, primaries=reused + ROUND + 20)
    size = KernelTable.load(tmp_path / "k.nc").records.size[-ROUND - 60 :]
    assert np.all(size[: ROUND + 20] == 1)
    assert np.any(size[ROUND + 20 :] > 1)


def test_within_a_pair_of_classes_pairs_come_by_their_flux(scene, dataset, tmp_path):
    """4000 draws of two classes: shares of each aggregate against (R_i + R_j)^3, by chi-square at 1e-4."""
    from scipy.stats import chisquare

    make(scene, tmp_path / "k.nc", dataset, 0)
    table = KernelTable.load(tmp_path / "k.nc")
    library = Library.of([RunDataset(dataset)], table)
    counts = np.array([len(m) for m in library.members])
    a, b = np.argsort(-counts)[:2]
    rng = np.random.default_rng(0)
    one = library.members[a][:4]
    other = library.members[b][:3]
    small = Library(library.aggregates, library.outer_radius, (one, other))
    drawn = np.array([small.draw(0, 1, rng) for _ in range(4000)])
    cube = (library.outer_radius[one][:, None] + library.outer_radius[other][None]) ** 3
    seen = np.array([[((drawn[:, 0] == i) & (drawn[:, 1] == j)).sum() for j in other] for i in one])
    assert chisquare(seen.ravel(), 4000 * (cube / cube.sum()).ravel()).pvalue > 1e-4


def test_stops_when_the_error_is_small_enough(scene, dataset, tmp_path):
    done = make(scene, tmp_path / "k.nc", dataset, 10 * ROUND, error=10.0)
    if done.error is not None:
        assert done.ended_by == "error" and done.designed == 0


def test_what_does_not_fit_is_refused(scene, dataset, tmp_path):
    file = tmp_path / "k.nc"
    make(scene, file, dataset, 0)
    with pytest.raises(DataFileError, match="exists already"):
        make(scene, file, dataset, 0)
    with pytest.raises(DataFileError, match="another seed"):
        tabulate(scene, file, [dataset], seed=4, resume=True)
    other = synthetic.scene(population__initial=40, flow__viscosity="20 cP")
    with pytest.raises(UserError, match=r"another \[flow\]"):
        make(other, tmp_path / "o.nc", dataset, 0)
    done = tabulate(
        other, tmp_path / "o.nc", [dataset], encounters=20, aggregates_only=True, encounter=ENCOUNTER
    )
    assert (done.reused, done.designed) == (0, 20)
    with pytest.raises(UserError, match="expected one of"):
        make(scene, tmp_path / "s.nc", dataset, 0, shape="colour")
    with pytest.raises(UserError, match=r"s\.csv: expected a name that ends in \.nc"):
        make(scene, tmp_path / "s.csv", dataset, 0)


def test_no_steady_size_is_said_where_nothing_broke(scene, tmp_path):
    """Encounters that only join: the table is made, its steady <P> is not; designed encounters go on evenly."""
    path = tmp_path / "run.nc"
    run(scene, path, events=60, seed=5, encounter=synthetic.always_merge)
    said = []
    done = tabulate(
        scene,
        tmp_path / "k.nc",
        [path],
        encounters=40,
        error=10.0,
        encounter=synthetic.always_merge,
        seed=3,
        progress=said.append,
    )
    assert done.mean_size is None and done.error is None and done.designed == 40
    assert "encounters broke an aggregate" in done.refusal and "mcdem run" in done.refusal
    assert all(now.mean_size is None for now in said)
    with pytest.raises(PBEError, match="no steady state"):
        steady_shares(KernelTable.load(tmp_path / "k.nc"), scene.suspension.volume_fraction)


def test_the_command_says_what_it_made(scene, dataset, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(scene.text)
    done = CliRunner().invoke(
        app, ["kernels", "scene.toml", "--from", str(dataset), "-o", "k.nc", "--workers", "1"]
    )
    assert done.exit_code == 0, done.output
    assert "600 encounters from runs, 0 designed" in done.output
    again = CliRunner().invoke(app, ["kernels", "scene.toml", "--from", str(dataset), "-o", "k.nc"])
    assert again.exit_code == 2 and "exists already" in again.output


def test_runs_go_into_an_atlas_each_once_and_of_equal_groups(scene, tmp_path):
    path, dataset = tmp_path / "atlas.nc", tmp_path / "run.nc"
    contact = {"surface_energy": "4.7e-3 J/m^2", "elastic_modulus": "3.4 GPa", "poisson_ratio": 0.5}
    scene = scene.with_changes({"effects.jkr": contact})
    run(scene, dataset, events=100, seed=5, encounter=ENCOUNTER)
    (part,) = into_atlas(scene, [dataset], path).parts
    assert part.encounters == 100 and part.origin["runs"] == "run.nc"
    assert part.cohesion == pytest.approx(groups(scene)["cohesion_number"].value)
    with pytest.raises(DataFileError, match="already"):
        into_atlas(scene, [dataset], path)
    other = scene.with_changes({"suspension.radius": "400 nm"})
    with pytest.raises(UserError, match="another"):
        into_atlas(other, [dataset], tmp_path / "other.nc")
    run(other, tmp_path / "smaller.nc", events=20, seed=6, encounter=ENCOUNTER)
    with pytest.raises(DataFileError, match="other groups"):
        into_atlas(other, [tmp_path / "smaller.nc"], path)
    assert len(Atlas.load(path).parts) == 1
    scene_file = tmp_path / "scene.toml"
    scene_file.write_text(scene.text)
    call = ["kernels", str(scene_file), "--from", str(dataset), "--into", str(tmp_path / "new.nc")]
    done = CliRunner().invoke(app, call)
    assert done.exit_code == 0 and "100 encounters" in done.output


def test_a_table_keeps_the_groups_of_its_scene(scene, dataset, tmp_path):
    make(scene, tmp_path / "k.nc", dataset, 0)
    table = KernelTable.load(tmp_path / "k.nc")
    assert {name: tuple(g) for name, g in groups_of(table).items()} == {
        name: tuple(g) for name, g in groups(scene).items()
    }
    # One that was made before says them again when its run is joined.
    old = dataclasses.replace(
        only_designed(table), about={k: v for k, v in table.about.items() if k != "groups"}
    )
    assert groups_of(with_runs(old, [RunDataset(dataset)])) == groups_of(table)
