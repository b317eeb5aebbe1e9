"""The reader of datasets agrees with what the writer was given, and with slow recounts."""

import numpy as np
import pytest
import xarray as xr
from small_runs import small_runs

from mcdem.aggregates.morphology import morphology
from mcdem.analysis.breakup import in_convention
from mcdem.analysis.dataset import RunDataset, by_stress, pooled_breakups
from mcdem.analysis.statistics import size_moments
from mcdem.errors import DataFileError, UserError


@pytest.fixture(scope="module")
def run():
    return RunDataset(small_runs()[1])


def test_series_end_where_the_last_snapshot_is(run):
    population = run.population(-1)
    moments = size_moments(population["size"], population["outer_radius"])
    assert population.sizes["aggregate"] == int(run.series["number_of_aggregates"][-1])
    np.testing.assert_allclose(moments.mean_size, run.series["mean_size"][-1], rtol=1e-12)
    np.testing.assert_allclose(moments.size_deviation, run.series["size_deviation"][-1], rtol=1e-9)
    np.testing.assert_allclose(moments.sauter_diameter, run.series["sauter_diameter"][-1], rtol=1e-9)


def test_population_is_its_aggregates_one_by_one(run):
    population = run.population(-1)
    for k in range(0, population.sizes["aggregate"], 7):
        alone = morphology(*run.geometry(k), run.radius)
        for name in ("size", "outer_radius", "aspect_ratio", "floppy_modes", "coordination_number"):
            np.testing.assert_allclose(population[name][k], alone[name], rtol=1e-12, err_msg=name)


def test_snapshots_lie_in_the_run_and_conserve_primaries(run):
    assert (np.diff(run.snapshot_times) > 0).all()
    volume = xr.open_dataset(run.path, group="snapshots")["volume"].values
    for k in range(len(run.snapshot_times)):
        total = int(run.population(k, rigidity=False)["size"].sum())
        assert total == round(50 * volume[k] / volume[0])


def test_breakups_are_those_of_a_slow_recount(run):
    first, found = 0, []
    for e in range(run.events.sizes["event"]):
        count = int(run.events["number_of_products"][e])
        sizes = run.events["product_size"].values[first : first + count]
        first += count
        if run.outcome[e] in ("parted", "exchange", "fragmentation"):
            found.append((sizes.sum(), count, sizes.max() / sizes.sum()))
    assert len(found) > 10
    table = np.array(found)
    together = run.breakups.isel(breakup=in_convention(run.breakups, "paper"))
    np.testing.assert_array_equal(together["parent_size"], table[:, 0])
    np.testing.assert_array_equal(together["fragments"], table[:, 1])
    np.testing.assert_allclose(together["largest_fragment"], table[:, 2])


def test_replicas_are_pooled(run):
    other = RunDataset(run.path)
    groups = by_stress([run, other, RunDataset(small_runs()[0])])
    assert [len(g) for g in groups.values()] == [1, 2]
    alone, twice = (pooled_breakups(g, "strict") for g in ([run], [run, other]))
    assert twice["breakups"] == 2 * alone["breakups"]
    np.testing.assert_allclose(twice["P_br"], alone["P_br"])


@pytest.mark.parametrize(
    ("key", "value", "named"),
    [
        ("effects.jkr.elastic_modulus", "10 GPa", "effects"),
        ("population.restructuring", False, "population.restructuring"),
    ],
)
def test_runs_that_are_no_replicas_are_not_pooled(run, key, value, named):
    other = RunDataset(run.path)
    other.scene = run.scene.with_changes({key: value})
    with pytest.raises(UserError, match=rf"\[{named}\] of their scenes differs"):
        by_stress([run, other])


def test_replicas_may_differ_in_seed_and_sample(run):
    other = RunDataset(run.path)
    other.scene = run.scene.with_changes({"run.seed": 7, "population.initial": 90})
    assert len(by_stress([run, other])) == 1


def test_other_files_are_refused(tmp_path):
    with pytest.raises(DataFileError, match="no such file"):
        RunDataset(tmp_path / "absent.nc")
    xr.Dataset({"x": ("t", [1.0])}).to_netcdf(tmp_path / "other.nc")
    with pytest.raises(DataFileError, match="another kind"):
        RunDataset(tmp_path / "other.nc")
