"""No steady state without encounters that bear it, and intervals that hold as often as they say."""

from __future__ import annotations

import numpy as np
import pytest
from pbe_synthetic import RADIUS, SHEAR_RATE, design, encounters, known_balance
from typer.testing import CliRunner

from pbekit import Grid, PBEError, steady_state
from pbekit.arguments import least_draws
from pbekit.commands.main import app
from pbekit.estimated_rates.estimated_rates import EstimatedRates, grid_for, start_of
from pbekit.study.evidence import LEAST_BREAKUPS, supported_steady_state
from pbekit.study.interpolation_error import InterpolationError
from pbekit.study.over_stresses import breakup_size, stress_law
from pbekit.study.solve_table import solve_table
from pbekit.study.uncertainty import (
    band,
    draws_of,
    mean_size_gradient,
    steady_output,
    variance_shares,
)
from pbekit.tables.counts import count_interval, share_in_words, share_interval
from pbekit.tables.kernel_table import KernelTable, Records

ABOUT = {
    "volume_fraction": 0.04,
    "viscosity": 1.0,
    "shear_stress": 1.0,
    "scene_name": "latex",
    "runs": "latex.nc",
}
LARGEST, CRITICAL = 14, 4.0


def table_of(records, **about):
    return KernelTable.of(records, RADIUS, SHEAR_RATE, shapes=1, about=ABOUT | about)


def supported(table, grid=None, **of_grid):
    estimated = EstimatedRates(table, grid_for(table, **of_grid) if grid is None else grid)
    return supported_steady_state(estimated, start_of(estimated.grid, table))


def some_breakups(count):
    """2000 encounters that join or miss, and `count` that break."""
    records = design(np.random.default_rng(1), 4000, LARGEST, critical=8.0, pieces=3)
    breaks = np.flatnonzero(records.products > 2)
    others = np.flatnonzero(np.isin(records.outcome, (0, 1, 2)))
    return records.select(np.sort(np.concatenate([others[:2000], breaks[:count]])))


# -- refusals -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("count", "words"), [(0, "none of 2000 encounters broke"), (30, "only 30 of 2030 encounters broke")]
)
def test_no_steady_state_where_too_few_encounters_broke(count, words):
    """Solved all the same it would be the end of the grid: here it moves with it."""
    table = table_of(some_breakups(count))
    for largest in (28, 56):
        steady, evidence = supported(table, largest=largest)
        assert steady is None and evidence.breakups == count
        line = evidence.refusal(table)
        assert words in line and "mcdem run latex.toml -o latex.nc --resume" in line and "\n" not in line
    data = solve_table(table, until=1.0, samples=3, draws=19, exact_to=8)
    assert "no steady state" in data.attrs["no_steady_state"]
    assert not [name for name in data.attrs if name.startswith("steady_")]
    assert "steady_number" not in data and np.isfinite(data.mean_size_high).all()


def test_enough_breakups_bear_a_steady_state():
    steady, evidence = supported(table_of(some_breakups(10_000)))
    assert evidence.breakups > LEAST_BREAKUPS and evidence.holds and steady is not None
    assert evidence.moved == 0.0 and evidence.extrapolated_mass < 0.05


def test_no_steady_state_that_moves_with_the_end_of_the_grid():
    """A grid that ends amid the sizes: refused; one that holds them: the known answer."""
    records = design(np.random.default_rng(2), 6000, LARGEST, critical=CRITICAL, pieces=3)
    steady, evidence = supported(table_of(records), Grid.primaries(2))
    assert steady is None and abs(evidence.moved) > 0.01 and evidence.edge_flux > 1e-3
    assert "when the grid ends at twice its size" in evidence.refusal(table_of(records))
    steady, evidence = supported(table_of(records))
    assert steady is not None and evidence.edge_flux < 1e-6


def test_no_steady_state_out_of_classes_that_nobody_sampled():
    """Encounters of primaries alone, and of trimers and more alone: what becomes of one with the other is a guess."""
    records = design(np.random.default_rng(3), 6000, LARGEST, critical=CRITICAL, pieces=3)
    apart = records.select((records.size <= 2).all(axis=1) | (records.size > 2).all(axis=1))
    table = table_of(apart)
    steady, evidence = supported(table)
    assert steady is None and evidence.extrapolated > 0.3
    line = evidence.refusal(table)
    assert "in classes that nobody sampled" in line and "P 1 with P 3" in line
    assert "mcdem kernels latex.toml --from latex.nc -o KERNELS --resume --encounters 200" in line


def test_the_commands_print_no_number_that_nothing_bears(tmp_path):
    path = tmp_path / "k.nc"
    table_of(some_breakups(0)).save(path)
    call = lambda *arguments: CliRunner().invoke(app, [str(a) for a in arguments])
    shown = call("show", path)
    assert shown.exit_code == 0 and "steady <P> =" not in shown.output
    assert "broke: 0 of 2000, below 0.15 %" in shown.output and "no steady state: none" in shown.output
    solved = call("solve", path, "-o", tmp_path / "s.nc", "--until", 1, "--samples", 3)
    assert (
        solved.exit_code == 0 and "steady <P> =" not in solved.output and "no steady state" in solved.output
    )
    for name in ("s.csv", "s"):
        refused = call("solve", path, "-o", tmp_path / name)
        assert refused.exit_code == 2 and "ends in .nc" in refused.output


def test_a_stress_that_nothing_bears_has_no_point():
    good = [table_of(some_breakups(10_000), viscosity=v) for v in (1.0, 2.0)]
    bad = table_of(some_breakups(0), viscosity=4.0)
    law = stress_law([*good, bad], draws=19)
    assert (
        np.isfinite(law.mean_size[:2]).all() and np.isnan(law.mean_size[2]) and np.isnan(law.breakup_size[2])
    )
    assert list(law.no_steady_state.values[:2]) == ["", ""] and "none of" in law.no_steady_state.values[2]
    assert not [name for name in law.attrs if name.startswith("q_")]


# -- daughters ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(20, 20), (39, 1), (3, 2)])
def test_daughters_of_never_seen_pairs_are_lighter_than_their_parents(size):
    """Fragments of one kind of pair, scaled to every pair there is: mass is kept, and no daughter is the whole."""
    rng = np.random.default_rng(4)
    records = encounters(rng, np.tile(size, (400, 1)), np.ones((400, 2)), critical=1e-3, pieces=3)
    tiny = encounters(rng, np.ones((6, 2), int), np.ones((6, 2)), critical=1e9)
    estimated = EstimatedRates(table_of(Records.join([records, tiny])), Grid.primaries(40))
    rows = estimated.fragment_rows(estimated.weights(None))[:, :40]
    high, low = np.tril_indices(40)
    total, sizes = high + low + 2, np.arange(1, 41)
    np.testing.assert_allclose(rows @ sizes, total, rtol=1e-9)
    assert np.all(rows[total <= 40][sizes[None] >= total[total <= 40][:, None]] == 0.0)
    assert rows[0, 0] == pytest.approx(2.0)


# -- intervals ----------------------------------------------------------------------------------------------------


def run_like(count):
    """A sampler of encounters that come as in a suspension at its steady state, and the exact steady state."""
    balance, start = known_balance(LARGEST, CRITICAL)
    n = steady_state(balance, start).population
    radius = balance.grid.outer_radius
    met = np.outer(n, n) * (radius[:, None] + radius[None]) ** 3

    def draw(rng):
        pair = rng.choice(LARGEST**2, count, p=met.ravel() / met.sum())
        size = np.stack(np.divmod(pair, LARGEST), axis=1) + 1
        return encounters(rng, size, np.ones(size.shape), critical=CRITICAL, pieces=3)

    return draw, start, n, n @ balance.grid.mass / n.sum()


def test_standard_errors_of_the_steady_size_cover_as_often_as_they_say():
    """95 % intervals of 200 tables of 700 encounters of which some 175 break."""
    draw, start, exact, truth = run_like(700)
    off = []
    for repeat in range(200):
        estimated = EstimatedRates(
            table_of(draw(np.random.default_rng([11, repeat]))), Grid.primaries(LARGEST)
        )
        steady = steady_state(estimated.mean, start, guess=exact)
        shares = variance_shares(estimated, steady, mean_size_gradient(estimated.mean, steady.population))
        mean = steady.population @ estimated.grid.mass / steady.population.sum()
        off.append((mean - truth) / shares.deviation)
    covered = np.mean(np.abs(off) < 1.96)
    assert 0.92 <= covered <= 0.97, covered


@pytest.mark.slow
def test_bands_of_draws_cover_as_often_as_they_say():
    """95 % bands of the same 200 tables by 79 draws each; the value itself lies in each of them."""
    draw, start, exact, truth = run_like(700)
    covered, inside = [], []
    for repeat in range(200):
        estimated = EstimatedRates(
            table_of(draw(np.random.default_rng([11, repeat]))), Grid.primaries(LARGEST)
        )
        n = steady_state(estimated.mean, start, guess=exact).population
        drawn = draws_of(estimated, steady_output(start, guess=n), 79, seed=repeat).mean_size.values
        low, high = band(drawn, 0.95)
        covered.append(low <= truth <= high)
        inside.append(low <= n @ estimated.grid.mass / n.sum() <= high)
    assert all(inside) and 0.92 <= np.mean(covered) <= 0.97, (np.mean(inside), np.mean(covered))


@pytest.mark.parametrize(("noise", "most"), [(0.0, 0.97), (0.3, 0.97), (1.0, 1.0)])
@pytest.mark.parametrize("tables", [2, 3, 6])
def test_bands_of_interpolation_cover_as_often_as_they_say(noise, most, tables):
    """2000 laws whose curvature scatters from stress to stress, known with an error of `noise` of the interpolation's.

    Where the error of the tables themselves is as large, it is counted twice and bands are on the safe side.
    """
    rng = np.random.default_rng(12)
    gap, covered = 0.03, []
    for _ in range(2000):
        curvature = rng.standard_normal(tables + 1)
        measured = curvature[:-1] * gap + noise * gap * rng.standard_normal(tables)
        error = InterpolationError.of(np.exp(measured), np.ones(tables), np.full(tables, gap))
        draws = np.exp(noise * gap * rng.standard_normal(400))
        value = np.exp(noise * gap * rng.standard_normal())
        low, high = error.widened(value, draws, gap, 0.95)
        covered.append(low <= np.exp(curvature[-1] * gap) <= high)
    assert 0.94 <= np.mean(covered) <= most, np.mean(covered)


@pytest.mark.parametrize("trials", [8, 30, 300])
def test_shares_cover_as_often_as_they_say(trials):
    """Wilson's 95 % interval, averaged over probabilities from 0 to 1: 2000 counts."""
    rng = np.random.default_rng(13)
    chance = rng.random(2000)
    counts = rng.binomial(trials, chance)
    each = {k: share_interval(k, trials, 0.95) for k in range(trials + 1)}
    covered = np.mean([each[k][0] <= p <= each[k][1] for k, p in zip(counts, chance, strict=True)])
    assert 0.94 <= covered <= 0.97
    assert each[0][0] == 0.0 and each[trials][1] == 1.0 and each[0][1] > 0.0


def test_none_is_below_a_limit():
    assert share_in_words(0, 12) == "0 of 12, below 22 %"
    assert share_in_words(0, 0) == "no trial" and share_interval(0, 0) == (0.0, 1.0)
    # Garwood's limits of no count and of one, 90 %.
    assert count_interval(0) == pytest.approx((0.0, 2.9957), abs=1e-3)
    assert count_interval(1) == pytest.approx((0.0513, 4.7439), abs=1e-3)


def test_too_few_draws_give_no_band():
    assert least_draws(0.9) == 19 and least_draws(0.95) == 39
    with pytest.raises(PBEError, match="got 5, expected 19"):
        band(np.arange(5.0))
    low, high = band(np.array([*np.arange(18.0), np.inf]))
    assert low == 0.0 and np.isinf(high)
    with pytest.raises(PBEError, match="draws = 5"):
        solve_table(table_of(some_breakups(200)), draws=5)


def test_a_band_holds_the_next_draw_as_often_as_it_says():
    rng = np.random.default_rng(14)
    draws = rng.standard_normal((20, 20_000))
    low, high = band(draws[:19])
    assert np.mean((draws[19] >= low) & (draws[19] <= high)) == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize("seed", range(4))
def test_a_breakup_size_lies_in_its_own_band(seed):
    estimated = EstimatedRates(
        table_of(design(np.random.default_rng(seed), 600, LARGEST)), Grid.primaries(LARGEST)
    )
    rng = np.random.default_rng(seed)
    low, high = band(np.array([breakup_size(estimated, rng) for _ in range(19)]))
    assert low < breakup_size(estimated) < high
