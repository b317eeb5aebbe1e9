"""What accuracy costs: errors of known differences, the front, and the command on a small run."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

import mcdem
from mcdem.analysis import accuracy_cost as cost
from mcdem.analysis import paired_encounters
from mcdem.analysis.paired_encounters import GIVEN, REFERENCE, Sample, Setting, draw_pairs
from mcdem.commands.main import app
from mcdem.encounter.simulate import OUTCOMES
from mcdem.errors import UserError

PAPER = mcdem.load_scene("scenes/paper-1000Pa.toml")


def samples(outcomes, geometry=0.0, fragment=0.5, time=1e-3):
    return [Sample(OUTCOMES.index(o), fragment, geometry, time, 10) for o in outcomes]


REF = samples(["missed"] * 8 + ["parted"] * 2)


def test_a_setting_that_changes_nothing_has_no_error():
    found = cost.price(Setting("same", "x"), 0.07, REF, 0.07, REF)
    assert not found.error.any() and not found.deviation.any() and found.differing == 0.0


def test_errors_are_those_of_the_means():
    other = samples(["missed"] * 7 + ["aggregation"] + ["parted"] * 2, geometry=0.02, fragment=0.6)
    found = cost.price(Setting("other", "x"), 0.077, other, 0.07, REF)
    assert found.error == pytest.approx([0.1, 0.1, 0.1, 0.02])
    # One of ten differs: the standard error of its share.
    assert found.deviation[1] == pytest.approx(np.sqrt(0.1 * 0.9 / 9))
    assert found.differing == pytest.approx(0.1)


def test_outcomes_that_swap_places_differ_one_by_one_but_not_in_the_mean():
    swapped = samples(["parted"] * 2 + ["missed"] * 8)
    found = cost.price(Setting("swapped", "x"), 0.07, swapped, 0.07, REF)
    assert found.error[1] == 0.0 and found.deviation[1] > 0.0 and found.differing == pytest.approx(0.4)


def priced(name, time, error, deviation=0.0, time_error=0.0, **changes):
    errors = np.array([0.0, error, 0.0, 0.0])
    setting = Setting(name, name, {key.replace("__", "."): value for key, value in changes.items()})
    return cost.Price(
        setting, errors, np.full(4, deviation), time, 1.0, 0.0, errors + 2.0 * deviation, time_error
    )


def test_no_difference_is_not_no_error():
    """Of 12 encounters without a difference the limit is 24 % (Wilson), of any mean as well as of the outcomes."""
    ref = samples(["missed"] * 12, geometry=0.1)
    found = cost.price(Setting("same", "x"), 0.07, ref, 0.07, ref)
    assert not found.error.any()
    np.testing.assert_allclose(found.limit, [0.0, 0.242, 0.242, 0.0242], atol=1e-3)
    assert cost.cheapest([found], 0.05) is None
    assert 70 <= cost.encounters_to_decide(0.05) <= 75


def test_limits_of_outcomes_hold_at_their_stated_rate():
    """200 samples of 60 encounters of which 4 % differ: the distance of the outcomes is 4 %."""
    rng = np.random.default_rng(0)
    ref = samples(["missed"] * 60)
    held = 0
    for _ in range(200):
        other = samples(["parted" if rng.random() < 0.04 else "missed" for _ in range(60)])
        held += cost.price(Setting("x", "x"), 1.0, other, 1.0, ref).limit[1] >= 0.04
    assert held / 200 >= 0.92  # an upper limit: 97.5 % or, of so few, a little less


def test_physics_and_differences_of_time_within_their_error_are_not_recommended():
    given = priced(GIVEN, 1.0, 0.0)
    coarse = priced("two rotations", 0.2, 0.0, numerics__rotations=2.0)
    level = priced("level", 0.1, 0.0, hydrodynamics__level="fts")
    same = priced("off", 0.9, 0.0, time_error=0.2, numerics__rigid_rotation=False)
    faster = priced("faster", 0.7, 0.0, time_error=0.2, numerics__max_step=1.0)
    assert cost.cheapest([given, coarse, level, same], 0.05) is given
    assert cost.cheapest([given, coarse, level, same, faster], 0.05) is faster


def test_times_are_compared_side_by_side():
    pairs = [(mcdem.Aggregate.monomer(), mcdem.Aggregate.monomer())] * 6
    scene = PAPER.with_changes({"numerics.rotations": 0.1})
    twins = [Setting(name, name) for name in (REFERENCE, GIVEN, "twin")]
    prices = [cost.price(setting, 1.0, REF, 1.0, REF) for setting in twins]
    *_, given, twin = cost.timed(scene, prices, pairs)
    assert given.cpu_time > 0.0 and given.time_error == 0.0
    assert np.isfinite(twin.time_error) and twin.time_error > 0.0


def test_a_sample_without_aggregates_is_said():
    single, five = mcdem.Aggregate.monomer(), mcdem.Aggregate(np.zeros((5, 3)), np.zeros((0, 2), np.int32))
    assert "only 1 of 4" in cost.few_aggregates([(single, single)] * 3 + [(single, five)])
    assert cost.few_aggregates([(single, single), (single, five)]) == ""


def test_without_a_reference_efficiency_there_is_no_error_of_it():
    found = cost.price(Setting("repelled", "x"), 0.0, REF, 0.0, REF)
    assert np.isnan(found.error[0]) and not found.error[1:].any()


def test_runs_of_other_primaries_are_refused():
    smaller = PAPER.with_changes({"suspension.radius": "250 nm"})
    with pytest.raises(UserError, match="expected a run of the same suspension"):
        draw_pairs(smaller, ["tests/monte_carlo/run_of_before.nc"], 2, seed=0)


def test_a_population_of_one_aggregate_is_refused(monkeypatch):
    alone = [mcdem.Aggregate.monomer()]
    monkeypatch.setattr(paired_encounters.RunDataset, "aggregates", lambda self, snapshot: alone)
    with pytest.raises(UserError, match="no late snapshot has two aggregates"):
        draw_pairs(PAPER, ["tests/monte_carlo/run_of_before.nc"], 2, seed=0)


def test_the_front_holds_what_nothing_beats():
    prices = [priced("a", 1.0, 0.5), priced("b", 2.0, 0.6), priced("c", 3.0, 0.1), priced("d", 4.0, 0.1)]
    assert [p.setting.name for p in cost.front(prices, lambda p: p.worst_sampled)] == ["a", "c"]
    best = cost.cheapest(prices, 0.2)
    assert best is not None and best.setting.name == "c"
    assert cost.cheapest([priced("noisy", 1.0, 0.1, deviation=0.2)], 0.2) is None


def test_every_setting_is_a_valid_scene_and_changes_it():
    for quick in (False, True):
        settings = cost.settings_of(PAPER, quick=quick)
        assert settings[0].name == REFERENCE
        assert len({s.name for s in settings}) == len(settings)
        scenes = [s.of(PAPER) for s in settings]
        assert all(scene != PAPER for s, scene in zip(settings, scenes) if s.name != GIVEN)


def test_the_paper_scheme_is_not_priced_against_itself():
    with pytest.raises(UserError, match="scheme"):
        cost.settings_of(PAPER.with_changes({"numerics.scheme": "explicit_euler"}))


def test_the_same_encounters_are_followed_under_every_setting():
    pairs = [(mcdem.Aggregate.monomer(), mcdem.Aggregate.monomer())] * 3
    scene = PAPER.with_changes({"numerics.rotations": 0.1})
    settings = [Setting(REFERENCE, "reference"), Setting(GIVEN, "as given")]
    reference, same = cost.measure(scene, settings, pairs, rays=2)
    assert same.differing == 0.0 and not same.error.any()
    assert reference.cpu_time > 0.0 and reference.steps == same.steps


def test_the_command_prints_draws_and_names_the_cheapest(tmp_path):
    scene = tmp_path / "short.toml"
    scene.write_text(PAPER.text.replace("rotations = 8", "rotations = 0.2"))
    figure = tmp_path / "cost.png"
    found = CliRunner().invoke(
        app,
        ["cost", str(scene), "--from", "tests/monte_carlo/run_of_before.nc", "--quick", "--encounters", "2"]
        + ["--workers", "1", "--error", "10", "-o", str(figure)],
    )
    assert found.exit_code == 0, found.output
    assert "Cheapest within 10" in found.output and "as given" in found.output
    assert figure.stat().st_size > 10_000
    assert len((tmp_path / "cost.csv").read_text().splitlines()) > 8
