"""What `mcdem check` says of a scene: the paper's own numbers, and each warning where it is due and only there."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from typer.testing import CliRunner

import mcdem
from mcdem.aggregates import straight_chain
from mcdem.analysis.dimensionless_groups import check, contact_relaxation, doublet_share, tabor_number
from mcdem.analysis.paired_encounters import efficiency
from mcdem.commands.main import app
from mcdem.encounter import worst_loads

SCENES = Path(__file__).parents[2] / "scenes"


def scene(stress=750, **changes):
    return mcdem.load_scene(SCENES / f"paper-{stress}Pa.toml").with_changes(
        {key.replace("__", "."): value for key, value in changes.items()}
    )


def finding(scene, start):
    (found,) = [one for one in check(scene) if one.name.startswith(start)]
    return found


# Numbers derived by hand from Table 1 of Frungieri & Vanni (2021).


@pytest.mark.parametrize(
    ("start", "at_750", "at_1000"),
    [
        ("Peclet", 4.29e5, 5.72e5),
        ("cohesion", 0.319, 0.426),
        ("Tabor", 0.985, 0.985),
        ("attraction number", 9.15e-7, 6.86e-7),
        ("cut-off delta over l0/a", 15.2, 15.2),
        ("paper's step dt_b", 1 / 0.84, 1 / 1.12),
        ("work of adhesion", 0.995, 0.995),
    ],
)
def test_the_papers_groups(start, at_750, at_1000):
    assert finding(scene(750), start).value == pytest.approx(at_750, rel=5e-3)
    assert finding(scene(1000), start).value == pytest.approx(at_1000, rel=5e-3)


@pytest.mark.parametrize("stress", [750, 875, 1000])
def test_the_papers_scene(stress):
    found = check(scene(stress))
    assert not [one for one in found if one.verdict == "warning"]
    words = " ".join(one.words for one in found)
    assert "Brownian motion cannot matter" in words
    assert "the fluid's inertia cannot matter" in words
    assert "the particles' inertia cannot matter" in words
    assert "eta_11 may depend on delta" in words
    assert "dt_b is near the contact's relaxation time" in words


@pytest.mark.parametrize("path", sorted(SCENES.glob("*.toml")), ids=lambda path: path.stem)
def test_every_scene_can_be_checked(path):
    for one in check(mcdem.load_scene(path)):
        assert math.isfinite(one.value)
        assert one.words


# Each warning, at a scene that deserves it.


@pytest.mark.parametrize(
    ("changes", "start", "verdict", "words"),
    [
        ({"suspension.radius": "5 nm"}, "Peclet", "warning", "Brownian motion matters and is not simulated"),
        ({"suspension.radius": "50 nm"}, "Peclet", "note", "Brownian motion, not simulated"),
        ({"suspension.radius": "10 um"}, "Reynolds", "warning", "inertia matters and is not simulated"),
        ({"suspension.radius": "10 um"}, "Stokes", "warning", "inertia matters and is not simulated"),
        ({"flow.shear_stress": "3000 Pa"}, "cohesion", "warning", "the flow parts even doublets"),
        ({"flow.shear_stress": "1 Pa"}, "cohesion", "note", "only large aggregates break"),
        ({"effects.jkr": None}, "contact laws", "warning", "add [effects.jkr]"),
        ({"effects": None}, "contact laws", "note", "nothing sticks"),
        ({"effects.jkr.surface_energy": "50 mJ/m^2"}, "work of adhesion", "note", "disagree"),
        ({"effects.jkr.elastic_modulus": "3 MPa"}, "Tabor", "fine", "JKR contacts are right"),
        ({"effects.jkr.elastic_modulus": "1000 GPa"}, "Tabor", "warning", "(below 0.1), the scene has JKR"),
        ({"effects.van_der_waals.hamaker_constant": "1e-24 J"}, "van der Waals", "note", "should hardly matter"),
        ({"hydrodynamics.lubrication_cutoff": 1e-4}, "cut-off delta over the gap", "fine", "should hardly depend on delta"),
        ({"hydrodynamics.lubrication_cutoff": 0.0}, "cut-off delta over the gap", "note", "depends on l0 instead"),
        ({"hydrodynamics.lubrication_cutoff": 0.2}, "cut-off delta over l0/a", "warning", "little of lubrication is left"),
        ({"hydrodynamics.lubrication_cutoff": 1e-4}, "cut-off delta over l0/a", "note", "below the molecular roughness"),
        ({"hydrodynamics.lubrication_cutoff": 1e-3}, "cut-off delta over the overlap", "note", "by a good part of delta"),
        ({"hydrodynamics.lubrication_cutoff": 1e-4}, "cut-off delta over the overlap", "warning", "bears 0.1 of its exact"),
        ({"hydrodynamics.lubrication_cutoff": 0.0}, "cut-off delta over the overlap", "warning", "presses a touching doublet"),
        ({"suspension.volume_fraction": 0.01}, "simulated time", "warning", "too crowded"),
        ({"suspension.volume_fraction": 1e-3}, "simulated time", "note", "may meet a third"),
        ({"numerics.scheme": "explicit_euler", "numerics.explicit_euler.base_step": "5 us"},
         "paper's step", "warning", "past the limit"),
        ({"numerics.explicit_euler.base_step": "5 us"}, "paper's step", "note", "no such limit"),
        ({"numerics.explicit_euler.base_step": "0.1 us"}, "paper's step", "fine", "resolves the contacts"),
        ({"numerics.implicit.max_step": 0.5}, "longest step", "warning", "not resolved"),
        ({"numerics.start_distance": 2.0}, "start distance", "note", "already interact"),
    ],
)  # fmt: skip
def test_verdicts_follow_the_numbers(changes, start, verdict, words):
    found = finding(scene().with_changes(changes), start)
    assert found.verdict == verdict
    assert words in found.words
    before = [one for one in check(scene()) if one.name.startswith(start)]
    assert found not in before


# Rules against what happens, on both sides of their thresholds.


def capture_area(scene):
    """Square of the critical offset in the plane of shear: eta_11 goes with it."""
    return mcdem.critical_offset(scene, 0.0) ** 2


@pytest.mark.slow
@pytest.mark.parametrize(("stress", "verdict"), [("0.3 Pa", "fine"), ("3 Pa", "fine"), ("300 Pa", "note")])
def test_captures_depend_on_the_cut_off_where_it_reaches_beyond_their_gap(stress, verdict):
    """At half the cut-off: nothing at delta over the gap of 0.15 and 0.47, a tenth of eta_11 at 4.7."""
    given = scene(1000, flow__shear_stress=stress)
    halved = given.with_changes(
        {"hydrodynamics.lubrication_cutoff": 0.5 * given.hydrodynamics.lubrication_cutoff}
    )
    change = abs(capture_area(halved) / capture_area(given) - 1.0)
    found = finding(given, "cut-off delta over the gap")
    assert found.verdict == verdict
    assert (change > 0.02) == (found.value > 1.0), change


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hamaker_constant", "verdict"), [("1e-23 J", "note"), ("1.5e-22 J", "note"), ("1e-21 J", "fine")]
)
def test_attraction_before_contact_matters_above_a_tenth_of_the_viscous_force(hamaker_constant, verdict):
    given = scene(1000, effects__van_der_waals__hamaker_constant=hamaker_constant)
    change = capture_area(given) / capture_area(scene(1000, effects__van_der_waals=None)) - 1.0
    found = finding(given, "van der Waals force")
    assert found.verdict == verdict
    assert (change > 0.02) == (found.value > 0.1), (found.value, change)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wavelength", "stress"), [("100 nm", "1000 Pa"), ("300 nm", "1000 Pa"), ("100 nm", "3 Pa")]
)
def test_retardation_matters_where_the_gap_of_capture_is_long(wavelength, stress):
    given = scene(1000, flow__shear_stress=stress, effects__van_der_waals__london_wavelength=wavelength)
    off = {"effects.van_der_waals.retarded": False, "effects.van_der_waals.london_wavelength": None}
    change = abs(capture_area(given) / capture_area(given.with_changes(off)) - 1.0)
    found = finding(given, "retardation")
    assert ("hardly matter" in found.words) == (found.value < 0.1)
    assert (change > 0.02) == (found.value > 0.1), (found.value, change)


@pytest.mark.slow
@pytest.mark.parametrize("convention", ["gap", "matrix"])
@pytest.mark.parametrize("stress", ["2250 Pa", "2400 Pa", "2800 Pa"])
def test_doublets_are_said_to_part_where_their_load_exceeds_the_pull_off_force(convention, stress):
    given = scene(1000, flow__shear_stress=stress, hydrodynamics__cutoff_convention=convention)
    (load,) = worst_loads(given, [straight_chain(given, 2)])
    assert ("parts even doublets" in finding(given, "cohesion").words) == (load > 1.0), load


DOUBLE_LAYER = {"debye_length": "10 nm", "relative_permittivity": 78.5, "condition": "constant_potential"}


def charged(potential, stress="750 Pa"):
    table = DOUBLE_LAYER | {"surface_potential": potential}
    return scene().with_changes({"effects.double_layer": table, "flow.shear_stress": stress})


@pytest.mark.parametrize(
    ("etas", "verdict", "words"),
    [
        ((0.0748, 0.0749), "fine", "hardly changes captures"),
        ((0.0581, 0.0749), "note", "changes captures (by more than 2 %: 0.0581 against 0.0749"),
        ((0.0, 0.128), "warning", "keeps primaries apart"),
        ((0.0, 0.0), "note", "nothing is captured"),
    ],
)
def test_the_verdict_on_a_double_layer_is_that_of_the_efficiencies(monkeypatch, etas, verdict, words):
    monkeypatch.setattr("mcdem.analysis.dimensionless_groups.eta_with_and_without", lambda scene, key: etas)
    found = finding(charged("60 mV"), "eta_11 with the double layer")
    assert (found.verdict, words in found.words) == (verdict, True), found
    assert finding(charged("60 mV"), "kappa a").value == pytest.approx(50.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("potential", "stress", "verdict", "ratio"),
    [
        ("10 mV", "750 Pa", "fine", 1.0),
        ("30 mV", "750 Pa", "note", 0.943),
        ("60 mV", "30 Pa", "warning", 0.0),
    ],
)
def test_a_double_layer_is_weighed_by_what_it_captures(potential, stress, verdict, ratio):
    """Its force is 0.001, 0.02 and 2 of the viscous one: that it takes 6 % of the captures at 0.02 no bound on it would say."""
    found = finding(charged(potential, stress), "eta_11 with the double layer")
    assert found.verdict == verdict and found.value == pytest.approx(ratio, abs=0.02), found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "start", "below", "above", "bounds"),
    [
        ("hydrodynamics.lubrication_cutoff", "cut-off delta over the gap", (5e-4, 1e-4), (2e-3, 1e-4), (0.01, 0.10)),
        ("effects.van_der_waals.london_wavelength", "retardation", ("100 nm", "1 um"), ("20 nm", "1 um"), (0.01, 0.01)),
    ],
)  # fmt: skip
def test_bounds_stand_where_the_efficiency_changes(key, start, below, above, bounds):
    """eta_11 against that in the limit, on both sides of a bound: it differs by less than the first number below."""
    apart = []
    for now, limit in (below, above):
        one, other = (efficiency(scene().with_changes({key: value}), 2) for value in (now, limit))
        apart.append(abs(one / other - 1.0))
    assert apart[0] < bounds[0] and apart[1] > bounds[1], apart
    said = [finding(scene().with_changes({key: value}), start).words for value in (below[0], above[0])]
    assert "should hardly" in said[0] and "may" in said[1]


def test_the_barrier_without_attraction_is_the_double_layers_force_at_contact():
    """Hogg, Healy & Fuerstenau (1966): at constant potential pi eps psi^2 a kappa for h = 0, equal spheres of radius a."""
    bare = charged("25 mV").with_changes({"effects.van_der_waals": None, "effects.jkr": None})
    exact = math.pi * 8.8541878e-12 * 78.5 * 0.025**2 * 5e-7 / 1e-8
    assert finding(bare, "largest repulsion").value == pytest.approx(exact / bare.reduced.force, rel=1e-3)


def test_dmt_contacts_are_known():
    table = {"surface_energy": "4.7 mJ/m^2", "elastic_modulus": "1000 GPa", "poisson_ratio": 0.5}
    stiff = scene().with_changes({"effects.jkr": None, "effects.dmt": table})
    assert finding(stiff, "Tabor").verdict == "fine"
    assert finding(stiff, "cohesion").value == pytest.approx(0.319 * 3 / 4, rel=2e-3)


# Truths.


def test_tabor_number_in_its_limits():
    """JKR deforms by (R w^2/E*^2)^(1/3) before it lets go: the number is that length over the range of the attraction."""
    base = tabor_number(1e-6, 0.01, 1e9, 1e-10)
    assert tabor_number(8e-6, 0.01, 1e9, 1e-10) == pytest.approx(2.0 * base)
    assert tabor_number(1e-6, 0.01, 1e9, 2e-10) == pytest.approx(base / 2.0)
    assert tabor_number(1e-6, 0.08, 1e9, 1e-10) == pytest.approx(4.0 * base)


def test_relaxation_time_follows_the_exact_squeeze_film():
    """Exact damping of two approaching spheres (Jeffrey & Onishi 1984): X^A = 1/(4 xi) + 9/40 ln(1/xi) + ..., xi = h/a."""
    paper = scene()
    thin = paper.with_changes({"hydrodynamics.lubrication_cutoff": 1e-4})
    ratio = contact_relaxation(thin) / contact_relaxation(paper)
    exact = [1 / (4 * xi) + 9 / 40 * np.log(1 / xi) for xi in (1e-4, 5e-3)]
    assert ratio == pytest.approx(exact[0] / exact[1], rel=0.03)


@pytest.mark.parametrize("level", ["free_draining", "rotne_prager", "fts"])
def test_relaxation_time_without_lubrication_is_that_of_two_touching_spheres(level):
    bare = scene().with_changes({"hydrodynamics.level": level, "hydrodynamics.lubrication_cutoff": None})
    radius, units = bare.suspension.radius, bare.reduced
    touching = 2.0 * radius * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    forces = units.force * np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    apart = np.diff(mcdem.velocities(bare, touching, forces).linear[:, 0])[0]
    stiffness = bare.kernels.contact.equilibrium_stiffness * units.stiffness
    assert contact_relaxation(bare) == pytest.approx(units.force / apart / stiffness, rel=1e-9)
    words = " ".join(one.words for one in check(bare))
    assert f'level = "{level}" is without lubrication' in words
    assert "delta" not in words


def doublet_tension(scene, gap):
    """Tension of two spheres held at `gap` [a] where the flow stretches most, over the exact 6.12 pi mu a^2 g of a doublet."""
    along = np.array([0.0, 1.0, 1.0]) / np.sqrt(2.0)
    positions = scene.suspension.radius * (1.0 + 0.5 * gap) * np.outer([-1.0, 1.0], along)
    pull = scene.reduced.force * np.outer([1.0, -1.0], along)
    free, pulled = (
        np.diff(mcdem.velocities(scene, positions, forces).linear @ along)[0]
        for forces in (np.zeros((2, 3)), pull)
    )
    return free / (free - pulled) / (6.12 / 6.0)


@pytest.mark.parametrize("cutoff", [5e-3, 1e-3, 3e-4, 1e-4])
def test_a_doublet_bears_what_the_frozen_matrix_leaves(cutoff):
    """The estimate of `mcdem check` against the forces that hold a doublet; reading the gap loses nothing."""
    frozen = scene(hydrodynamics__lubrication_cutoff=cutoff)
    gap = frozen.kernels.contact.equilibrium_gap
    assert doublet_share(cutoff, -gap) == pytest.approx(doublet_tension(frozen, gap), abs=0.01)
    read = frozen.with_changes({"hydrodynamics.cutoff_convention": "gap"})
    assert doublet_tension(read, gap) == pytest.approx(1.0, abs=0.01)
    assert not [one for one in check(read) if one.name.startswith("cut-off delta over the overlap")]


def test_mean_approach_is_that_of_the_flux():
    """|z0|/y0 averaged with the flux, a density proportional to y on the disc of R_i + R_j, is 3 pi/4 of |z0|/(R_i + R_j)."""
    width = lambda y: 2.0 * np.sqrt(1.0 - y * y)
    mean = quad(width, 0, 1)[0] / quad(lambda y: y * width(y), 0, 1)[0]
    no_rotations = scene().with_changes({"numerics.rotations": 0, "numerics.start_distance": 5.0})
    between = math.pi / (8.0 * no_rotations.suspension.volume_fraction)
    assert finding(no_rotations, "simulated time").value == pytest.approx(5.0 * mean / between)


# The command.


def test_exit_code_follows_the_verdict(tmp_path):
    run = CliRunner().invoke(app, ["check", str(SCENES / "paper-1000Pa.toml")], prog_name="mcdem")
    assert run.exit_code == 0
    assert "Brownian" in run.stdout
    crowded = tmp_path / "crowded.toml"
    crowded.write_text((SCENES / "quickstart.toml").read_text().replace("1e-4", "0.1"))
    run = CliRunner().invoke(app, ["check", str(crowded)], prog_name="mcdem")
    assert run.exit_code == 3
    assert "warning" in run.stdout
    assert CliRunner().invoke(app, ["check", str(tmp_path / "none.toml")], prog_name="mcdem").exit_code == 2
