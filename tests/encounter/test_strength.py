"""Static strength of aggregates against the touching doublet, symmetry, and what statics says."""

import math

import numpy as np
import pytest
from small_runs import small_runs

from mcdem.aggregates.aggregate import Aggregate
from mcdem.analysis.dataset import RunDataset
from mcdem.encounter.static_strength import worst_loads
from mcdem.figures.strength import static_load
from mcdem.hydrodynamics import LEVELS
from mcdem.scene import load_scene

SCENE = load_scene("scenes/paper-1000Pa.toml")
A = SCENE.suspension.radius
TOUCH = 2.0 * A - 0.317e-9  # h_eq of the paper's contact


def doublet(scene):
    return Aggregate.from_positions(scene, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, TOUCH]]))


def tetrahedron(scene):
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * TOUCH / math.sqrt(8.0)
    return Aggregate.from_positions(scene, corners)


def octahedron_centres():
    return np.concatenate([np.eye(3), -np.eye(3)]) * TOUCH / math.sqrt(2.0)


def test_a_touching_doublet_bears_the_exact_tension():
    """Two touching spheres in shear are torn by 6.12 pi mu g a^2 (Nir & Acrivos 1973); overlap and cut-off change 0.2 %."""
    scene = SCENE.with_changes(
        {"hydrodynamics.cutoff_convention": "gap", "hydrodynamics.lubrication_cutoff": 1e-4}
    )
    strength = scene.effects.contact.pull_off_force(A)
    exact = 6.12 * math.pi * A**2 * scene.flow.shear_stress / strength
    np.testing.assert_allclose(worst_loads(scene, [doublet(scene)])[0], exact, rtol=3e-3)


def test_loads_turn_with_the_aggregate_and_grow_with_the_stress():
    rng = np.random.default_rng(5)
    whole = tetrahedron(SCENE)
    load = worst_loads(SCENE, [whole])[0]
    assert 0.1 < load < 1.0
    np.testing.assert_allclose(worst_loads(SCENE, [whole.turned(rng) for _ in range(3)]), load, rtol=1e-6)
    twice = SCENE.with_changes({"flow.shear_stress": "2000 Pa"})
    rest = 2.0 * load - worst_loads(twice, [whole])[0]  # of the forces at rest: all six bonds bear each other
    assert abs(rest) < 1e-6


def test_floppy_aggregates_and_primaries_have_no_static_load():
    chain = Aggregate.from_positions(SCENE, np.array([[0.0, 0.0, k * TOUCH] for k in range(4)]))
    assert np.isnan(worst_loads(SCENE, [chain, Aggregate.monomer()])).all()


@pytest.mark.parametrize("level", LEVELS)
def test_an_octahedron_is_loaded_alike_in_all_its_poses_at_every_level(level):
    scene = SCENE.with_changes({"hydrodynamics": {"level": level}})
    rng = np.random.default_rng(6)
    octahedron = Aggregate.from_positions(scene, octahedron_centres())
    loads = worst_loads(scene, [octahedron, *(octahedron.turned(rng) for _ in range(3))])
    np.testing.assert_allclose(loads, loads[0], rtol=1e-6)


def test_the_figure_distinguishes_rigid_from_floppy_aggregates(monkeypatch):
    run = RunDataset(small_runs()[1])
    assert static_load([run]) is None  # its made-up aggregates are all floppy
    # Tetrahedra face to face (Boerdijk & Coxeter): rigid at every size.
    helix = list(tetrahedron(SCENE).positions)
    while len(helix) < 14:
        helix.append(2.0 / 3.0 * (helix[-1] + helix[-2] + helix[-3]) - helix[-4])
    rigid = [np.array(helix[:size]) for size in range(4, 15)]
    shapes = [
        Aggregate.from_positions(SCENE, positions)
        for positions in (*rigid, np.array([[0.0, 0.0, k * TOUCH] for k in range(5)]))
    ]
    monkeypatch.setattr(RunDataset, "aggregates", lambda self, snapshot: shapes)
    figure = static_load([run])
    assert figure is not None
    numbers, snapshots = figure.numbers, len(run.late_snapshots)
    count = len(rigid)
    assert (numbers.sizes["aggregate"], numbers.attrs["floppy"]) == (count * snapshots, snapshots)
    loads = worst_loads(run.scene, shapes)[:count]
    np.testing.assert_allclose(numbers["load"].values[:count], loads, rtol=1e-12)
    slope = np.polyfit(np.log(range(4, 15)), np.log(loads), 1)[0]
    np.testing.assert_allclose(numbers["exponent"].values[0], slope, rtol=1e-9)
