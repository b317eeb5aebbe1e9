"""What an assumption changes: differences of known samples, and the command."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from typer.testing import CliRunner

import mcdem
from mcdem.analysis import sensitivity
from mcdem.analysis.paired_encounters import Sample, Setting
from mcdem.commands.main import app
from mcdem.encounter.simulate import OUTCOMES

PAPER = mcdem.load_scene("scenes/paper-1000Pa.toml")
MONOMER = mcdem.Aggregate.monomer()
RUN = "tests/monte_carlo/run_of_before.nc"


def samples(outcomes, geometry=0.0, fragment=0.5):
    return [Sample(OUTCOMES.index(o), fragment, geometry, 1e-3, 10) for o in outcomes]


def test_differences_are_signed_and_paired():
    given = samples(["missed"] * 8 + ["fragmentation"] * 2)
    other = samples(["missed"] * 7 + ["aggregation", "exchange", "fragmentation"], geometry=-0.1)
    found = sensitivity.differences(Setting("other", "x"), (0.07, 0.077), given, other)
    value = {d.quantity: d for d in found}
    assert value["eta_11"].value == pytest.approx(0.1)
    assert value["aggregation"].value == pytest.approx(0.1)
    assert value["missed"].value == pytest.approx(-0.1)
    assert value["fragmentation"].value == pytest.approx(-0.1)
    # One fragmentation became an exchange: a breakup still.
    assert value["breakup, strict"].value == value["breakup, strict"].error == 0.0
    assert value["aggregation"].error == pytest.approx(np.sqrt(0.1 * 0.9 / 9))
    assert value["geometry"].value == pytest.approx(-0.1) and value["geometry"].error == 0.0


def test_none_of_sixty_is_not_nought():
    given = samples(["missed"] * 60)
    same = {d.quantity: d for d in sensitivity.differences(Setting("same", "x"), (0.07, 0.07), given, given)}
    assert same["parted"].value == 0.0 and not same["parted"].is_seen
    assert (same["parted"].low, same["parted"].high) == pytest.approx((-0.0602, 0.0602), abs=1e-4)
    assert np.isnan(same["geometry"].low)
    words = "\n".join(sensitivity.sensitivity_report(list(same.values())))
    assert "none of 60 differs [at most 6.0% do]" in words and "+0.0000 " not in words.replace("eta_11", "")
    other = samples(["missed"] * 40 + ["parted"] * 20)
    found = {
        d.quantity: d for d in sensitivity.differences(Setting("other", "x"), (0.07, 0.07), given, other)
    }
    assert (
        found["parted"].is_seen
        and found["parted"].low > 0.2
        and " *" in "".join(sensitivity.sensitivity_report(list(found.values())))
    )


@pytest.mark.parametrize(("gains", "losses"), [(0.10, 0.05), (0.02, 0.02), (0.20, 0.0)])
def test_limits_of_paired_shares_hold_at_their_stated_rate(gains, losses):
    """1000 samples of 200 encounters of which these shares change one way and the other."""
    rng = np.random.default_rng(2)
    held = 0
    for _ in range(1000):
        spread = rng.choice([1.0, -1.0, 0.0], 200, p=[gains, losses, 1.0 - gains - losses])
        low, high = sensitivity.limits_of(spread, is_share=True)
        held += low <= gains - losses <= high
    assert 0.92 <= held / 1000 <= 0.97


def test_where_nothing_sticks_eta_11_has_no_relative_difference():
    given = samples(["missed"] * 4)
    (eta, *_) = sensitivity.differences(Setting("other", "x"), (0.0, 0.01), given, given)
    assert np.isnan(eta.value)


def test_what_changes_nothing_makes_no_difference_and_what_matters_does():
    pairs = [(MONOMER, MONOMER)] * 40
    scene = PAPER.with_changes({"numerics.rotations": 0.0})
    settings = sensitivity.settings_from(
        {"numerics.most_steps": ["10000000"], "hydrodynamics.lubrication_cutoff": ["2e-2"]}
    )
    given, same, coarser = sensitivity.compare_settings(scene, settings, pairs, rays=2)
    assert all(d.value == d.error == 0.0 for d in (*given, *same))
    eta = coarser[0]
    # Capture happens within the cut-off: a wider one captures more (shared with `mcdem efficiency`).
    assert eta.quantity == sensitivity.ETA and 0.2 < eta.value < 1.0


def test_every_value_of_every_key_is_tried_alone():
    settings = sensitivity.settings_from(
        {"numerics.rotations": ["2", "16"], "effects.van_der_waals": ["none"]}
    )
    assert [s.name for s in settings[1:]] == [
        "numerics.rotations = 2",
        "numerics.rotations = 16",
        "effects.van_der_waals = none",
    ]
    assert settings[2].of(PAPER).numerics.rotations == 16
    assert settings[3].of(PAPER).effects.get("van_der_waals") is None


def test_the_command_prints_draws_and_writes(tmp_path):
    scene = tmp_path / "short.toml"
    scene.write_text(PAPER.text.replace("rotations = 8", "rotations = 0.2"))
    figure = tmp_path / "sensitivity.png"
    arguments = [
        "sensitivity",
        str(scene),
        "--from",
        RUN,
        "--encounters",
        "4",
        "--workers",
        "1",
        "-o",
        str(figure),
    ]
    done = CliRunner().invoke(
        app, [*arguments, "--set", "effects.van_der_waals.london_wavelength=50nm,200nm"]
    )
    assert done.exit_code == 0, done.output
    assert "eta_11" in done.output and "as given" in done.output
    assert figure.stat().st_size > 5_000
    with figure.with_suffix(".csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["setting"] for row in rows} == {
        "as given",
        "effects.van_der_waals.london_wavelength = 50nm",
        "effects.van_der_waals.london_wavelength = 200nm",
    }
    assert {row["encounters"] for row in rows} == {"4"}
    again = CliRunner().invoke(app, [*arguments, "--set", "numerics.rotations=1"])
    assert again.exit_code == 2 and "exists" in again.output


def test_what_is_no_scene_is_refused_before_anything_is_followed(tmp_path):
    arguments = ["sensitivity", "scenes/paper-1000Pa.toml", "--from", RUN, "-o", str(tmp_path / "a.png")]
    for given, word in (("numerics.rotations=-1", "rotations"), ("nonsense", "TABLE.KEY=VALUE")):
        done = CliRunner().invoke(app, [*arguments, "--set", given])
        assert done.exit_code == 2 and word in done.output
    assert not list(tmp_path.iterdir())
