"""The scenes that ask something else than the paper run, and their question has the answer that it should."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mcdem
from mcdem.runs import Run
from mcdem.simulate import run

SCENES = Path("scenes")
MONOMER = mcdem.Aggregate.monomer()


def test_free_draining_differs_from_the_paper_in_its_level_alone_and_runs(tmp_path):
    scene, paper = (mcdem.load_scene(SCENES / f"{name}-1000Pa.toml") for name in ("free-draining", "paper"))
    bare = paper.with_changes(
        {"hydrodynamics.level": "free_draining", "hydrodynamics.lubrication_cutoff": None}
    )
    assert scene == bare
    run(scene, tmp_path / "run.nc", events=4, workers=1)
    assert (Run(tmp_path / "run.nc").outcome != "unresolved").all()


@pytest.mark.slow
def test_the_double_layer_keeps_pairs_apart_that_attract_each_other_without_it(tmp_path):
    scene = mcdem.load_scene(SCENES / "dlvo-barrier.toml")
    offset = (0.0, 0.3 * scene.suspension.radius)
    without = scene.with_changes({"effects.double_layer": None})
    found = [mcdem.simulate_encounter(s, MONOMER, MONOMER, offset=offset) for s in (scene, without)]
    assert [one.outcome for one in found] == ["missed", "aggregation"]
    run(scene, tmp_path / "run.nc", events=3, workers=1)
    assert (Run(tmp_path / "run.nc").outcome == "missed").all()


@pytest.mark.slow
def test_uniaxial_extension_differs_from_the_paper_in_its_flow_alone_and_runs(tmp_path):
    scene, paper = (
        mcdem.load_scene(SCENES / f"{name}.toml") for name in ("uniaxial-extension", "paper-1000Pa")
    )
    assert scene == paper.with_changes({"flow.kind": "uniaxial_extension", "flow.shear_rate": "5e3 1/s"})
    whole = scene.with_changes({"numerics.end_inert": False})
    result = mcdem.simulate_encounter(whole, MONOMER, MONOMER, offset=(0.0, 0.1 * scene.suspension.radius))
    assert result.outcome == "aggregation"
    axis = result.products[0].positions[1] - result.products[0].positions[0]
    assert abs(axis[2]) > 0.999999 * np.linalg.norm(axis)
    # A touching doublet along the axis is pulled by 12.24 pi mu a^2 E (Nir & Acrivos 1973), that cut off at delta a little less.
    pull = 12.24 / 6.0 * scene.reduced.force
    assert result.largest_tension == pytest.approx(pull, rel=0.05)
    run(scene, tmp_path / "run.nc", events=6, workers=1)
    assert (Run(tmp_path / "run.nc").outcome != "unresolved").all()
