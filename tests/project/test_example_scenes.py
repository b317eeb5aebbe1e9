"""The scenes that ask something else than the paper run, and their question has the answer that it should."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mcdem
from mcdem.analysis.dataset import RunDataset
from mcdem.monte_carlo.run_control import run

SCENES = Path("scenes")
MONOMER = mcdem.Aggregate.monomer()


def test_free_draining_differs_from_the_paper_in_its_level_alone_and_runs(tmp_path):
    scene, paper = (mcdem.load_scene(SCENES / f"{name}-1000Pa.toml") for name in ("free-draining", "paper"))
    bare = paper.with_changes(
        {"hydrodynamics.level": "free_draining", "hydrodynamics.lubrication_cutoff": None}
    )
    assert scene == bare
    run(scene, tmp_path / "run.nc", events=4, workers=1)
    assert (RunDataset(tmp_path / "run.nc").outcome != "unresolved").all()


@pytest.mark.slow
def test_the_double_layer_keeps_pairs_apart_that_attract_each_other_without_it(tmp_path):
    scene = mcdem.load_scene(SCENES / "dlvo-barrier.toml")
    offset = (0.0, 0.3 * scene.suspension.radius)
    without = scene.with_changes({"effects.double_layer": None})
    found = [mcdem.simulate_encounter(s, MONOMER, MONOMER, offset=offset) for s in (scene, without)]
    assert [one.outcome for one in found] == ["missed", "aggregation"]
    run(scene, tmp_path / "run.nc", events=3, workers=1)
    assert (RunDataset(tmp_path / "run.nc").outcome == "missed").all()


def pull_of_an_aligned_doublet(scene):
    """Tension [N] in two primaries along z, at rest in the flow of the scene: contact force that stops their moving apart."""
    separation = 2.0 + scene.kernels.contact.equilibrium_gap
    places = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, separation * scene.suspension.radius]])

    def parting(pull):
        forces = np.array([[0.0, 0.0, pull], [0.0, 0.0, -pull]])
        return np.diff(mcdem.velocities(scene, places, forces=forces).linear[:, 2])[0]

    free, held = parting(0.0), parting(scene.reduced.force)
    return scene.reduced.force * free / (free - held)


@pytest.mark.slow
def test_uniaxial_extension_differs_from_the_paper_in_its_flow_alone_and_runs(tmp_path):
    scene, paper = (
        mcdem.load_scene(SCENES / f"{name}.toml") for name in ("uniaxial-extension", "paper-1000Pa")
    )
    assert scene == paper.with_changes({"flow.kind": "uniaxial_extension", "flow.shear_rate": "5e3 1/s"})
    whole = scene.with_changes({"numerics.end_stable": False})
    result = mcdem.simulate_encounter(whole, MONOMER, MONOMER, offset=(0.0, 0.1 * scene.suspension.radius))
    assert result.outcome == "aggregation"
    axis = result.products[0].positions[1] - result.products[0].positions[0]
    assert abs(axis[2]) > 0.999999 * np.linalg.norm(axis)
    # What statics says of it, with the cut-off; without one a touching doublet is pulled by 12.24 pi mu a^2 E.
    assert result.largest_tension == pytest.approx(pull_of_an_aligned_doublet(scene), rel=0.02)
    assert result.largest_tension < 12.24 / 6.0 * scene.reduced.force
    run(scene, tmp_path / "run.nc", events=6, workers=1)
    assert (RunDataset(tmp_path / "run.nc").outcome != "unresolved").all()


@pytest.mark.slow
def test_contacts_that_bear_moments_keep_a_bent_chain_bent(tmp_path):
    """The bends of a zigzag chain in the flow, with the bonds of the scene and without them."""
    scene, paper = (mcdem.load_scene(SCENES / f"{name}-1000Pa.toml") for name in ("moments", "paper"))
    bonds = {"effects.rods.stiffness": "5 N/m", "effects.rods.largest_displacement": "2 nm"}
    assert scene == paper.with_changes(bonds)
    rest = 2.0 + scene.kernels.contact.equilibrium_gap
    zigzag = np.cumsum([[0.0, 0.0, 0.0], *[[0.0, (k % 2) * 1.0, 1.0 - k % 2] for k in range(4)]], axis=0)
    zigzag *= rest * scene.suspension.radius
    far = (1.9 * scene.suspension.radius, 7.0 * scene.suspension.radius)
    longest = []
    for s in (scene, paper):
        result = mcdem.simulate_encounter(s, zigzag, MONOMER, offset=far, orient=False, seed=0)
        assert result.outcome == "missed"
        chain = max(result.products, key=lambda a: a.size)
        longest.append(len(chain.bonds))
    assert longest[0] == 4 < longest[1]
    run(scene, tmp_path / "run.nc", events=6, workers=1)
    assert (RunDataset(tmp_path / "run.nc").outcome != "unresolved").all()
