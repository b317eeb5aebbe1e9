"""Tables sampled until one probability is known: its truth, the same table however made, and what reads or refuses weights."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import synthetic
from scipy import integrate
from typer.testing import CliRunner

from mcdem.commands.main import app
from mcdem.encounter.offset_strata import SHORTEST
from mcdem.errors import DataFileError, UserError
from mcdem.kernel_tables import tabulate
from mcdem.kernel_tables.until_error import Wanted, sizes_of, tabulate_until
from mcdem.monte_carlo import executors
from mcdem.monte_carlo.run_control import run
from pbekit.errors import PBEError
from pbekit.estimated_rates.estimated_rates import JOIN, EstimatedRates, grid_for
from pbekit.study.fitted_laws import fitted_laws
from pbekit.study.size_rates import size_rates
from pbekit.study.uncertainty import eta_11
from pbekit.tables.atlas import Part
from pbekit.tables.counts import share_interval, weighted_share
from pbekit.tables.kernel_table import AGGREGATION, WEIGHTED_FORMAT, KernelTable, Records

TRUTH = (
    integrate.dblquad(
        lambda x, y: 1.5 * y * synthetic.captured_share((x, y), 1.0),
        0.0,
        1.0,
        lambda y: -np.sqrt(1.0 - y * y),
        lambda y: np.sqrt(1.0 - y * y),
    )[0]
)  # fmt: skip


@pytest.fixture(scope="module")
def scene():
    contact = {"surface_energy": "4.7e-3 J/m^2", "elastic_modulus": "3.4 GPa", "poisson_ratio": 0.5}
    return synthetic.scene(population__initial=40, run__snapshot_every="100 ms").with_changes(
        {"effects.jkr": contact}
    )


@pytest.fixture(scope="module")
def dataset(scene, tmp_path_factory):
    path = tmp_path_factory.mktemp("until") / "run.nc"
    run(scene, path, events=300, seed=5, encounter=synthetic.aggregation_and_breakup)
    return path


def make(scene, path, error="20%", **options):
    options = {"encounter": synthetic.by_offset, "seed": 3, "wanted": f"eta={error}"} | options
    return tabulate_until(scene, path, **options)


def same(one, other):
    """Whether two tables hold the same encounters and weights."""
    a, b = (KernelTable.load(p).records for p in (one, other))
    names = [f.name for f in dataclasses.fields(Records) if f.name != "cpu_time"]
    return all(np.array_equal(getattr(a, n), getattr(b, n), equal_nan=True) for n in names)


def test_it_finds_the_truth_to_the_wanted_error_and_the_table_says_the_same(scene, tmp_path):
    """6 %, judged at four standard errors; plain sampling would need (1 - p)/(p 0.02^2) encounters."""
    done = make(scene, tmp_path / "k.nc", "6%")
    found, table = done.sought.found, KernelTable.load(tmp_path / "k.nc")
    assert done.ended_by == "error" and found.relative <= 0.06
    assert abs(found.value - TRUTH) < 4 * found.deviation
    assert done.sought.encounters < 0.5 * (1 - TRUTH) / TRUTH / 0.06**2
    r = table.records
    assert len(r) == done.sought.encounters and r.weight.mean() == pytest.approx(1.0, rel=1e-6)
    assert table.to_dataset().attrs["format"] == WEIGHTED_FORMAT
    assert table.about["eta"] == pytest.approx(found.value)
    assert r.weight[r.outcome == AGGREGATION].sum() / len(r) == pytest.approx(found.value, rel=1e-6)
    value, low, high = eta_11(table)
    assert value == pytest.approx(found.value, rel=1e-6) and low < TRUTH < high
    # What the balance takes: by the classes' weights, with the law as a prior of some encounters.
    estimated = EstimatedRates(table, grid_for(table))
    assert estimated.mean_rates.outcomes[0, 0, JOIN] == pytest.approx(found.value, rel=0.05)
    draws = [estimated.rates(np.random.default_rng(seed)).outcomes[0, 0, JOIN] for seed in range(60)]
    assert np.std(draws) == pytest.approx(found.deviation, rel=0.5)


def test_counts_alike_would_not_be_the_truth(scene, tmp_path):
    """The weights are what makes it right: without them it is off by far."""
    make(scene, tmp_path / "k.nc")
    r = KernelTable.load(tmp_path / "k.nc").records
    assert (r.outcome == AGGREGATION).mean() > 2 * TRUTH


def test_the_table_is_the_same_on_two_workers_and_after_interruption(scene, dataset, tmp_path):
    options = {"runs": [dataset], "pair": "2+3", "error": "25%"}
    whole = make(scene, tmp_path / "one.nc", **options)
    assert whole.ended_by == "error"
    with executors.local_processes(2) as pool:
        make(scene, tmp_path / "two.nc", executor=pool, **options)
    assert same(tmp_path / "one.nc", tmp_path / "two.nc")
    for stop in (100, SHORTEST, SHORTEST + 12):
        part = make(scene, tmp_path / "parts.nc", resume=True, encounters=stop, **options)
        assert part.ended_by == "encounters" and part.sought.encounters == stop
    again = make(scene, tmp_path / "parts.nc", resume=True, **options)
    assert same(tmp_path / "one.nc", tmp_path / "parts.nc") and again.sought.found == whole.sought.found


def test_what_was_computed_is_kept_when_it_is_interrupted(scene, tmp_path):
    done = []

    def stops(*args, **options):
        if len(done) == 120:
            raise KeyboardInterrupt
        done.append(0)
        return synthetic.by_offset(*args, **options)

    left = make(scene, tmp_path / "k.nc", encounter=stops)
    assert left.ended_by == "interruption" and len(KernelTable.load(tmp_path / "k.nc").records) == 120
    make(scene, tmp_path / "k.nc", resume=True)
    make(scene, tmp_path / "whole.nc")
    assert same(tmp_path / "k.nc", tmp_path / "whole.nc")


@pytest.mark.parametrize(
    "given", ["5%", "eta", "eta=5", "eta=0%", "eta=-5%", "eta=nan", "beta=5%", "eta=5%%", "eta=1e"]
)
def test_other_forms_are_refused(given):
    with pytest.raises(UserError, match="expected such as"):
        Wanted.read(given)


def test_forms_that_are_read():
    assert Wanted.read("eta=5%") == Wanted.read(" eta = 0.05 ") == Wanted("eta", 0.05)
    assert Wanted.read("breakup=10%").quantity == "breakup"
    assert sizes_of("10+10") == (10, 10)
    for given in ("10", "0+1", "ten+ten", "1+1+1"):
        with pytest.raises(UserError, match="expected two sizes"):
            sizes_of(given)


def test_what_does_not_fit_is_refused(scene, dataset, tmp_path):
    with pytest.raises(UserError, match="no aggregate of 900 primaries; the sizes next to it are"):
        make(scene, tmp_path / "a.nc", runs=[dataset], pair="900+1")
    make(scene, tmp_path / "k.nc", encounters=40)
    with pytest.raises(DataFileError, match="exists already"):
        make(scene, tmp_path / "k.nc")
    with pytest.raises(DataFileError, match="another until_error_of"):
        make(scene, tmp_path / "k.nc", wanted="breakup=20%", resume=True)
    with pytest.raises(DataFileError, match="another until_error_of"):
        tabulate(scene, tmp_path / "k.nc", [], encounters=50, seed=3, resume=True)
    table = KernelTable.load(tmp_path / "k.nc")
    with pytest.raises(PBEError, match="the atlas holds counts"):
        Part.of(table)


def test_short_forms_refuse_weights(scene, dataset, tmp_path):
    make(scene, tmp_path / "k.nc", "10%", runs=[dataset], pair=(2, 2))
    table = KernelTable.load(tmp_path / "k.nc")
    with pytest.raises(PBEError, match="fitted to counts"):
        fitted_laws(size_rates(table, draws=19))


def test_breakup_is_wanted_in_the_same_way(scene, tmp_path):
    """Where nothing breaks it goes on to the bound, and says so."""
    done = make(scene, tmp_path / "k.nc", wanted="breakup=30%", encounters=400)
    assert done.ended_by == "encounters" and done.sought.found.value == 0.0
    assert "breakup = 0" in str(done)


def test_the_command_says_what_it_found_and_what_it_expects(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(scene.text)
    call = ["kernels", "scene.toml", "-o", "k.nc", "--workers", "1", "--until-error"]
    for wrong, said in (
        (["eta=5"], "expected such as"),
        (["eta=5%", "--pair", "10"], "expected two sizes"),
        (["eta=5%", "--error", "0.1"], "leave out --error"),
    ):
        done = CliRunner().invoke(app, [*call, *wrong])
        assert done.exit_code == 2 and said in " ".join(done.output.split())


def test_an_interval_of_weights_that_are_alike_is_wilsons():
    hit = np.arange(50) < 7
    assert weighted_share(hit, np.ones(50)) == (0.14, *share_interval(7, 50))
    assert weighted_share(hit, np.full(50, 3.0)) == pytest.approx((0.14, *share_interval(7, 50)))
    assert np.isnan(weighted_share(hit[:0], np.ones(0))[0])


def test_rates_by_size_hold_the_truth_of_a_weighted_table(scene, dataset, tmp_path):
    """Limits are of draws with the weights: counts alike would put them far above."""
    make(scene, tmp_path / "k.nc", "10%", runs=[dataset], pair=(2, 2), aggregates_only=True)
    rates = size_rates(KernelTable.load(tmp_path / "k.nc"), draws=60)
    k = int(np.flatnonzero(rates.pivots == 2)[0])
    assert rates.efficiency.low[k, k] < TRUTH < rates.efficiency.high[k, k] < 2 * TRUTH
