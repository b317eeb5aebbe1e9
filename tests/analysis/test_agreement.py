"""Samples of encounters followed in several ways: kept as they were drawn, compared pair by pair, refused if foreign."""

from __future__ import annotations

import numpy as np
import pytest
from small_runs import small_runs

import mcdem
from mcdem.analysis.paired_encounters import REFERENCE, draw_pairs
from mcdem.errors import UserError
from validation import agreement

SCENE = mcdem.load_scene("scenes/paper-1000Pa.toml")
COUNT = 40


@pytest.fixture
def sample():
    run = small_runs()[1]
    return agreement.store(draw_pairs(SCENE, [run], COUNT, 3), SCENE, run, 3)


def fill(sample, way, outcome):
    row = agreement.WAYS.index(way)
    sample["outcome"].values[row] = outcome
    sample["fragment"].values[row] = 0.5
    sample["geometry"].values[row] = 0.0


def test_a_sample_gives_back_the_aggregates_that_met(sample, tmp_path):
    agreement.save(sample, tmp_path / "sample.nc")
    back = agreement.load(tmp_path / "sample.nc")
    drawn = draw_pairs(SCENE, [small_runs()[1]], COUNT, 3)
    for pair, again in zip(drawn, agreement.pairs(back), strict=True):
        for one, two in zip(pair, again, strict=True):
            assert np.array_equal(one.positions, two.positions) and np.array_equal(one.bonds, two.bonds)
    assert agreement.scene_in(back).text == SCENE.text
    assert len(agreement.followed(back, "default")) == 0


def test_ways_that_differ_are_distinguished_from_ways_that_agree(sample):
    outcomes = np.zeros(COUNT, int)
    fill(sample, REFERENCE, outcomes)
    outcomes[0] = 2
    fill(sample, "default", outcomes)
    missed = agreement.differences(sample, "default", REFERENCE)[0]
    assert missed.quantity == "share of missed" and missed.value == pytest.approx(-1 / COUNT)
    assert abs(missed.value) < missed.width
    outcomes[: COUNT // 2] = 2
    fill(sample, "default", outcomes)
    missed = agreement.differences(sample, "default", REFERENCE)[0]
    assert missed.value == pytest.approx(-0.5) and abs(missed.value) > missed.width


def test_foreign_files_are_refused(tmp_path):
    path = tmp_path / "other.nc"
    path.write_text("nothing")
    with pytest.raises(UserError, match="cannot be read as NetCDF"):
        agreement.load(path)
    with pytest.raises(UserError, match="expected a sample"):
        agreement.load(small_runs()[1])
