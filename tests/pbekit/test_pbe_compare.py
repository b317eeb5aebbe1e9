"""Balance, Monte Carlo and analytical laws beside each other; the command line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import synthetic
import xarray as xr
from pbe_synthetic import RADIUS, SHEAR_RATE, design
from typer.testing import CliRunner

from mcdem.kernel_tables import tabulate
from mcdem.monte_carlo.run_control import run
from mcdem.scene import Scene
from pbekit import Grid, integrate
from pbekit.commands.main import app
from pbekit.errors import PBEError
from pbekit.estimated_rates.estimated_rates import EstimatedRates, grid_for, start_of
from pbekit.estimated_rates.stress_interpolation import InterpolatedRates, common_grid, interpolate
from pbekit.solution.finite_population import population_course
from pbekit.solution.steady import steady_state
from pbekit.study.ablation import changed_assumptions, distance
from pbekit.study.analytical import AnalyticalBalance
from pbekit.study.compare import other_tables
from pbekit.study.monte_carlo import MonteCarlo
from pbekit.study.over_stresses import breakup_size, stress_law
from pbekit.study.uncertainty import course_output, eta_11
from pbekit.tables.kernel_table import KernelTable

SCENES = Path(__file__).parents[2] / "scenes"
ABOUT = {"volume_fraction": 0.04, "viscosity": 1.0, "hamaker_constant": 0.01, "shear_stress": 1.0}


@pytest.fixture(scope="module")
def table():
    records = design(np.random.default_rng(8), 12_000, 24, (1.2, 2.2))
    return KernelTable.of(records, RADIUS, SHEAR_RATE, shape_edges=[1, 1.7, 3], about=ABOUT)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A run of synthetic encounters and its table."""
    folder = tmp_path_factory.mktemp("compare")
    attraction = '[effects.van_der_waals]\nhamaker_constant = "0.97e-20 J"\nminimum_approach = "0.165 nm"\n'
    population = '[population]\ninitial = 60\n[run]\nsnapshot_every = "20 ms"\n'
    scene = Scene.from_text(synthetic.SCENE + attraction + population, "synthetic.toml")
    run(scene, folder / "run.nc", events=1500, seed=5, encounter=synthetic.aggregation_and_breakup)
    tabulate(scene, folder / "few.nc", [folder / "run.nc"], encounter=synthetic.aggregation_and_breakup)
    tabulate(
        scene,
        folder / "k.nc",
        [folder / "run.nc"],
        encounters=600,
        encounter=synthetic.aggregation_and_breakup,
    )
    return folder


def test_a_finite_population_follows_the_balance(table):
    """12 replicas of 200 aggregates: <P>(t) within 4 standard errors of the mean field, and the shares of small sizes."""
    grid = Grid.primaries(60).with_shapes(table.shape_edges)
    estimated = EstimatedRates(table, grid)
    times = np.array([0.0, 5.0, 15.0, 30.0])
    phi = 0.04
    found = population_course(estimated, phi, times, replicas=12, steady_from=30.0)
    number = phi / (4 / 3 * np.pi)
    exact = integrate(estimated.mean, grid.monodisperse(number), times)[:, : grid.cells]
    mean = found.mean_size.mean("replica").values
    error = found.mean_size.std("replica", ddof=1).values / np.sqrt(12)
    wanted = number / exact.sum(axis=1)
    # A population of 200 that doubles has its own small bias of order 1/200.
    assert np.all(np.abs(mean - wanted) <= 4 * error + 0.01 * wanted), (mean, wanted, error)
    share = np.bincount(grid.size_of_cell, exact[-1]) / exact[-1].sum()
    seen = found.share.mean("replica").values[1:6]
    spread = found.share.std("replica", ddof=1).values[1:6] / np.sqrt(12)
    assert np.all(np.abs(seen - share[:5]) <= 4 * spread + 0.01 * share[:5])


def test_single_runs_scatter_by_chance_and_by_what_the_table_leaves_open():
    """A table of 300 encounters leaves much open, so that runs of 2000 aggregates scatter by more than chance."""
    records = design(np.random.default_rng(8), 300, 14)
    few = KernelTable.of(records, RADIUS, SHEAR_RATE, shapes=1, about=ABOUT)
    estimated = EstimatedRates(few, Grid.primaries(40))
    times = np.array([0.0, 10.0])
    spread = {}
    for drawn in (False, True):
        found = population_course(estimated, 0.04, times, initial=2000, replicas=10, drawn=drawn)
        np.testing.assert_allclose(found.sauter_diameter[:, 0], 2 * RADIUS, rtol=1e-6)
        assert (found.sauter_diameter[:, 1] > 2 * RADIUS).all()
        spread[drawn] = float(found.mean_size[:, 1].std())
    assert spread[True] > 2 * spread[False] > 0


def test_late_shares_are_averages_over_time(table):
    grid = Grid.primaries(60).with_shapes(table.shape_edges)
    estimated = EstimatedRates(table, grid)
    start, times = grid.monodisperse(0.04 / (4 / 3 * np.pi)), np.array([0.0, 5.0, 10.0])
    found = course_output(start, times, share_from=5.0)(estimated.mean)["late_share"]
    states = integrate(estimated.mean, start, times)[1:, : grid.cells]
    shares = [np.bincount(grid.size_of_cell, n) / n.sum() for n in states]
    np.testing.assert_allclose(found, np.mean(shares, axis=0), atol=1e-6)
    assert distance(found, shares[0]) == pytest.approx(distance(found, shares[1]), rel=1e-4)
    assert distance(*shares) > 0.01


def test_analytical_laws_are_fitted_in_one_number(table):
    fitted = AnalyticalBalance.fitted(table, 5.0)
    assert fitted.efficiency == pytest.approx(0.95 * (0.01 / (36 * np.pi)) ** 0.18)
    n = steady_state(fitted.balance(), fitted.grid.monodisperse(0.04 / (4 / 3 * np.pi))).population
    assert n @ fitted.grid.mass / n.sum() == pytest.approx(5.0, rel=1e-2)


def test_eta_11_counts_pairs_of_primaries(table):
    r = table.records
    pair = (r.size == 1).all(axis=1)
    eta, low, high = eta_11(table)
    assert eta == pytest.approx((r.outcome[pair] == 2).sum() / pair.sum())
    assert low < eta < high


def test_every_assumption_makes_a_balance(table):
    names = []
    for name, make, scheme in changed_assumptions(table):
        balance = make().balance(scheme=scheme)
        assert np.isfinite(balance.rhs(0, balance.state(balance.grid.monodisperse(0.01)))).all()
        names.append(name)
    assert len(set(names)) == len(names) >= 8


def test_breakup_size_is_where_half_of_the_contacts_break():
    """The synthetic DEM breaks half of its hits at a joint size of 7 (rounder shapes)."""
    records = design(np.random.default_rng(8), 30_000, 14)
    estimated = EstimatedRates(KernelTable.of(records, RADIUS, SHEAR_RATE, shapes=1), Grid.primaries(14))
    assert breakup_size(estimated) == pytest.approx(7.0, rel=0.15)


@pytest.fixture(scope="module")
def two_stresses(tmp_path_factory):
    """Tables of two stresses; twice the stress breaks joint sizes of 4 instead of 8, so q = 1."""
    folder = tmp_path_factory.mktemp("stresses")
    for stress in (1.0, 2.0):
        table_at(stress, 9).save(folder / f"{stress:.0f}.nc")
    return folder / "1.nc", folder / "2.nc"


def table_at(stress, seed, count=8000):
    records = design(np.random.default_rng(seed), count, 24, critical=8.0 / stress, pieces=3)
    about = ABOUT | {"viscosity": stress, "shear_stress": stress}
    return KernelTable.of(records, RADIUS, SHEAR_RATE, shapes=1, about=about)


def test_exponents_over_stresses_are_those_put_in(three_stresses):
    tables = [KernelTable.load(path) for path in three_stresses[::-1]]
    found = stress_law(tables, draws=20)
    assert found.stress.values == pytest.approx([1.0, 2**0.5, 2.0])
    q, low, high = (found.attrs[f"q_breakup_size{end}"] for end in ("", "_low", "_high"))
    assert low < 1.0 < high and high - low < 0.6 and low < q < high
    assert found.attrs["stresses_breakup_size"] == 3
    assert found.attrs["decades_breakup_size"] == pytest.approx(np.log10(2))
    for name in ("mean_size", "sauter_diameter"):
        assert 0 < found.attrs[f"q_{name}_low"] < found.attrs[f"q_{name}"] < found.attrs[f"q_{name}_high"]
        assert np.all(found[f"{name}_low"] <= found[name]) and np.all(found[name] <= found[f"{name}_high"])
    # The analytical laws know <P> at their reference, and that more stress breaks more.
    reference = found.sel(stress=found.attrs["reference"])
    assert float(reference.mean_size_analytical) == pytest.approx(float(reference.mean_size), rel=0.01)
    assert found.attrs["q_mean_size_analytical"] > 0.5
    assert np.all(found.no_steady_state.values == "") and np.all(found.extrapolated < 0.05)
    # One inner table gives no error of interpolation of its own prediction.
    assert np.isfinite(found.mean_size_interpolated[1]) and np.isnan(found.mean_size_interpolated_low[1])


def test_two_stresses_give_no_exponent(two_stresses):
    law = stress_law([KernelTable.load(path) for path in two_stresses], draws=19)
    assert not [name for name in law.attrs if name.startswith("q_")]
    assert np.isfinite(law.mean_size).all()


def test_stresses_are_drawn_and_said(three_stresses, tmp_path):
    done = call("stresses", *three_stresses, "-o", tmp_path / "s", "--draws", 19)
    assert done.exit_code == 0, done.output
    for name in ("eta_11", "stress"):
        assert (tmp_path / "s" / f"{name}.png").stat().st_size > 5000
        assert (tmp_path / "s" / f"{name}.nc").exists()
    for words in ("P_br ~ stress^-q", "Eq. 23", "analytical laws", "% extrapolated"):
        assert words in done.output
    done = call("stresses", three_stresses[0], "-o", tmp_path / "t")
    assert done.exit_code == 2 and "one table alone" in done.output


def test_a_run_is_read(files):
    read = MonteCarlo.read(files / "run.nc")
    assert read.mean_size[0] == 1.0 and read.initial == 60
    assert read.share.sum() == pytest.approx(1.0)
    mean, error = read.steady["mean_size"]
    assert 1 < mean < 20 and 0 < error < mean
    assert read.at("mean_size", np.array([0.0]))[0] == 1.0


def call(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_show_says_what_decides_the_error(files):
    done = call("show", files / "k.nc")
    assert done.exit_code == 0, done.output
    assert "2100 encounters" in done.output and "shares of its variance" in done.output
    done = call("show", files / "few.nc")
    assert done.exit_code == 0, done.output
    assert "no steady state" in done.output and "shares of its variance" not in done.output


@pytest.mark.parametrize(
    "options", [(), ("--mean-shape", "--smooth"), ("--scheme", "cell average"), ("--scheme", "three pivots")]
)
def test_solve_writes_a_dataset(files, tmp_path, options):
    out = tmp_path / "s.nc"
    done = call("solve", files / "k.nc", "-o", out, "--until", 2, "--samples", 11, "--draws", 19, *options)
    assert done.exit_code == 0, done.output
    data = xr.load_dataset(out)
    assert data.sizes["time"] == 11 and float(abs(data.mass_drift).max()) < 1e-12
    assert float(data.number.min()) >= 0
    assert bool((data.mean_size_low <= data.mean_size_high).all())
    assert data.attrs["steady_mean_size"] > 1 and "scene" in data.attrs


def test_compare_draws_and_says(files, tmp_path):
    done = call("compare", files / "k.nc", "--run", files / "run.nc", "-o", tmp_path / "c", "--draws", 19)
    assert done.exit_code == 0, done.output
    for name in ("table", "course", "distribution", "ablation", "volume-fractions"):
        assert (tmp_path / "c" / f"k-{name}.png").stat().st_size > 5000
        assert (tmp_path / "c" / f"k-{name}.nc").exists()
    assert (tmp_path / "c" / "eta_11.png").stat().st_size > 5000
    for words in ("steady <P>", "eta_11", "within the 90 % band of single runs", "a finite population of 60"):
        assert words in done.output
    course = xr.load_dataset(tmp_path / "c" / "k-course.nc")
    late = course.isel(time=-1)
    # The synthetic encounters depend on sizes alone, and strongly: the balance must stay near the run it came from.
    assert abs(float(late.mean_size) / float(late.mean_size_monte_carlo) - 1) < 0.3
    assert float(late.mean_size_run_low) < float(late.mean_size) < float(late.mean_size_run_high)
    sizes = xr.load_dataset(tmp_path / "c" / "k-distribution.nc")
    said = np.flatnonzero(sizes.density_monte_carlo.values > 0.02)
    assert said.size > 2
    assert np.all(np.abs(np.log(sizes.late_density / sizes.density_monte_carlo))[said] < 1)


def test_mistakes_are_answered_in_a_line(files, tmp_path):
    done = call("show", tmp_path / "none.nc")
    assert done.exit_code == 2 and "expected a kernel table" in done.output
    (tmp_path / "s.nc").write_text("")
    done = call("solve", files / "k.nc", "-o", tmp_path / "s.nc")
    assert done.exit_code == 2 and "--overwrite" in done.output
    done = call("compare", files / "k.nc", "--run", files / "k.nc", "-o", tmp_path)
    assert done.exit_code == 2


@pytest.fixture(scope="module")
def three_stresses(two_stresses):
    """The two, and one in between."""
    path = two_stresses[0].with_name("between.nc")
    table_at(2**0.5, 10).save(path)
    return two_stresses[0], path, two_stresses[1]


def test_a_stress_between_two_tables_is_predicted(three_stresses):
    tables = [KernelTable.load(path) for path in three_stresses]
    lower, upper = tables[0], tables[2]
    found = interpolate([upper, lower], 2**0.5)
    assert found.weight == pytest.approx(0.5)
    population = np.random.default_rng(1).random(found.grid.cells)
    drawn = found.balance(np.random.default_rng(2))
    for balance in (found.mean, drawn):
        rate = balance.rhs(0.0, balance.state(population))
        assert np.all(np.abs(rate @ balance.conserved) <= 1e-13 * (np.abs(rate) @ balance.conserved))
    steady = [steady_size(EstimatedRates(t, grid_for(t))) for t in tables]
    guess = steady_size(found)
    assert steady[2] < guess < steady[0]
    # Neighbours a factor two apart in critical size; the left-out table is met far better than by either.
    assert abs(guess - steady[1]) < 0.35 * (steady[0] - steady[2])


def steady_size(estimated):
    table = estimated.table if hasattr(estimated, "table") else estimated.of_tables[0].table
    n = steady_state(estimated.mean, start_of(estimated.grid, table)).population
    return n @ estimated.grid.mass / n.sum()


def test_rates_that_cannot_be_mixed_are_refused():
    """Of two tables with classes of shape: with and without memory of shapes, on two grids, by two ways of outcomes."""
    records = [design(np.random.default_rng(k), 400, 8, shapes=(1.0, 3.0)) for k in (1, 2)]
    lower, upper = (
        KernelTable.of(r, RADIUS, SHEAR_RATE, shape_edges=[1, 1.7, 3], about=ABOUT | {"viscosity": stress})
        for r, stress in zip(records, (1.0, 2.0), strict=True)
    )
    grid = common_grid([lower, upper])
    below = EstimatedRates(lower, grid)
    assert below.memory
    for above, words in (
        (
            EstimatedRates(upper, grid, memory=False),
            r"differ in memory \(True and False\): estimate both with the same",
        ),
        (EstimatedRates(upper, grid, "smooth"), "differ in smooth"),
        (EstimatedRates(upper, grid, partners=(1, 2)), "differ in partners"),
        (EstimatedRates(upper, common_grid([lower, upper], largest=40)), "differ in pivots: .* common_grid"),
        (EstimatedRates(upper, common_grid([lower, upper], shapes=None)), "differ in shape_edges"),
    ):
        with pytest.raises(PBEError, match=words):
            InterpolatedRates.of(below, above, 1.5)
    assert InterpolatedRates.of(below, EstimatedRates(upper, grid), 1.5).mean_rates.outcomes.shape[-1] == 3


def test_at_the_ends_and_beyond(three_stresses):
    lower, _, upper = (KernelTable.load(path) for path in three_stresses)
    at_the_end = InterpolatedRates(lower, upper, 1.0)
    own = EstimatedRates(lower, at_the_end.grid)
    n = own.grid.monodisperse(0.01) + 1e-3
    rates = [b.rhs(0.0, b.state(n)) for b in (at_the_end.mean, own.mean)]
    np.testing.assert_allclose(rates[0], rates[1], rtol=1e-9, atol=1e-12 * np.abs(rates[1]).max())
    with pytest.raises(PBEError, match="beyond them nothing is known"):
        interpolate([lower, upper], 3.0)
    with pytest.raises(PBEError, match="beyond them nothing is known"):
        InterpolatedRates(lower, upper, 0.5)
    silent = KernelTable.of(lower.records, RADIUS, SHEAR_RATE, shapes=1)
    with pytest.raises(PBEError, match="viscosity"):
        interpolate([silent, upper], 1.5)


def test_stresses_of_several_shear_rates_are_shown_without_prediction(three_stresses):
    tables = [KernelTable.load(path) for path in three_stresses]
    faster = KernelTable.of(tables[2].records, RADIUS, 2 * SHEAR_RATE, shapes=1, about=tables[2].about)
    law = stress_law([*tables[:2], faster], draws=19)
    assert "mean_size_interpolated" not in law and np.isfinite(law.mean_size).all()


def test_solve_interpolates(three_stresses, tmp_path):
    low, middle, high = three_stresses
    options = ("--until", 20, "--samples", 5, "--draws", 19)
    done = call("solve", low, high, "--stress", 1.5, "-o", tmp_path / "n.nc", *options)
    assert done.exit_code == 0, done.output
    assert "steady <P>" in done.output and "no band: two tables" in done.output
    two = xr.load_dataset(tmp_path / "n.nc")
    assert two.attrs["shear_stress"] == 1.5 and "mean_size_low" not in two
    done = call("solve", *three_stresses, "--stress", 1.5, "-o", tmp_path / "t.nc", *options)
    assert done.exit_code == 0, done.output
    three = xr.load_dataset(tmp_path / "t.nc")
    assert (
        three.attrs["steady_mean_size_low"]
        < three.attrs["steady_mean_size"]
        < three.attrs["steady_mean_size_high"]
    )
    assert np.all(three.mean_size_low[1:] < three.mean_size[1:])
    done = call("solve", low, high, "-o", tmp_path / "m.nc")
    assert done.exit_code == 2 and "--stress" in done.output
    done = call("solve", low, middle, "--stress", 5, "-o", tmp_path / "m.nc")
    assert done.exit_code == 2 and "between" in done.output


@pytest.mark.parametrize(
    ("old", "new", "differs"),
    [
        ("initial = 200", "initial = 100", []),
        ('until = "300 s"', 'until = "20 s"', []),
        ("lubrication_cutoff = 5e-3", "lubrication_cutoff = 1e-2", ["hydrodynamics"]),
        ("doubling_below = 0.75", "restructuring = false", ["population"]),
        ("[effects.jkr]", "[effects.dmt]", ["effects"]),
    ],
)
def test_a_scene_is_the_same_whatever_the_sample(old, new, differs):
    scene = (SCENES / "paper-1000Pa.toml").read_text(encoding="utf-8")
    assert old in scene
    assert other_tables(scene, scene.replace(old, new)) == differs
