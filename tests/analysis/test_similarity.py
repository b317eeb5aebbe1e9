"""Scenes of equal dimensionless groups are one scene: encounter by encounter, and for the balance on their tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mcdem import load_scene, simulate_encounter
from mcdem.analysis.similarity import groups, sensitivities, unlike
from mcdem.errors import UserError

SCENES = Path(__file__).parents[2] / "scenes"


@pytest.fixture(scope="module")
def scene():
    return load_scene(SCENES / "quickstart.toml")


def similar(scene, radius, viscosity, shear_rate):
    """The scene at other conditions, of a material that keeps all its groups."""
    a = radius / scene.suspension.radius
    s = viscosity * shear_rate / scene.flow.shear_stress
    attraction, contact = scene.effects.get("van_der_waals"), scene.effects.get("jkr")
    return scene.with_changes(
        {
            "suspension.radius": radius,
            "flow.viscosity": viscosity,
            "flow.shear_rate": shear_rate,
            "effects.van_der_waals.hamaker_constant": attraction.hamaker_constant * s * a**3,
            "effects.van_der_waals.minimum_approach": attraction.minimum_approach * a,
            "effects.van_der_waals.london_wavelength": attraction.london_wavelength * a,
            "effects.jkr.surface_energy": contact.surface_energy * s * a,
            "effects.jkr.elastic_modulus": contact.elastic_modulus * s,
        }
    )


TRIMER = np.array([[0.0, 0.0, 0.0], [1.9994, 0.0, 0.0], [2.6, 1.907, 0.0]])
DOUBLET = TRIMER[:2]
ENCOUNTERS = [
    (np.zeros((1, 3)), np.zeros((1, 3)), (0.1, 0.3)),
    (np.zeros((1, 3)), np.zeros((1, 3)), (0.2, 1.2)),
    (TRIMER, np.zeros((1, 3)), (0.0, 0.9)),
    (TRIMER, TRIMER, (0.5, 2.5)),
    (DOUBLET, np.zeros((1, 3)), (0.1, 0.4)),
    (DOUBLET, DOUBLET, (0.4, 2.0)),
]
"""Parents and offset, over a: of those that are not chaotic."""


def test_scenes_of_equal_groups_have_the_same_encounters(scene):
    """At 130 nm, 0.7 Pa s and 333 1/s: outcomes, evaluations and, over a and 1/g, places and times to round-off."""
    other = similar(scene, 130e-9, 0.7, 333.0)
    assert not unlike(scene, other)
    outcomes = set()
    for k, (i, j, offset) in enumerate(ENCOUNTERS):
        one, two = (
            simulate_encounter(s, i * a, j * a, tuple(x * a for x in offset), seed=k)
            for s in (scene, other)
            for a in (s.suspension.radius,)
        )
        assert one.outcome == two.outcome and one.contact == two.contact and one.solves == two.solves
        for p, q in zip(one.products, two.products, strict=True):
            np.testing.assert_allclose(p.positions / scene.suspension.radius, q.positions / 130e-9, atol=1e-8)
        assert one.simulated_time * scene.flow.shear_rate == pytest.approx(
            two.simulated_time * 333.0, rel=1e-9
        )
        outcomes.add(one.outcome)
    assert len(outcomes) > 1


def test_what_differs_is_named(scene):
    stronger = scene.with_changes({"effects.jkr.surface_energy": "5e-3 J/m^2"})
    assert any(line.startswith("cohesion_number") for line in unlike(scene, stronger))
    assert unlike(scene, scene.with_changes({"hydrodynamics.lubrication_cutoff": 1e-2})) == [
        "[hydrodynamics]"
    ]


def test_groups_are_powers_of_radius_and_stress(scene):
    """The powers say what becomes of each group of the same material elsewhere."""
    other = scene.with_changes(
        {"suspension.radius": "200 nm", "flow.viscosity": "1 Pa s", "flow.shear_rate": "200 1/s"}
    )
    a, s = 200 / 500, 200.0 / scene.flow.shear_stress
    there = groups(other)
    for name, group in groups(scene).items():
        assert there[name].value == pytest.approx(
            group.value * a**group.radius * s**group.stress, rel=1e-5
        ), name
    # N = 6 pi mu a^2 g/F_adh with F_adh in proportion to a; C_A = A_H/(36 pi mu g a^3).
    assert groups(scene)["cohesion_number"][1:] == (1, 1) and groups(scene)["attraction_number"][1:] == (
        -3,
        -1,
    )


def test_sensitivities_are_powers_of_the_groups_that_a_key_moves(scene, tmp_path):
    """A key that moves one group alone; outcomes that moved by more than two standard errors; of two values the nearer."""
    lines = [
        "setting,key,quantity,as_given,changed,difference,standard_error",
        "effects.van_der_waals.london_wavelength = 200 nm,x,eta_11,0.1,0.2,0.1,0.0",
        "effects.van_der_waals.london_wavelength = 400 nm,x,eta_11,0.1,0.8,0.7,0.0",
        "effects.van_der_waals.london_wavelength = 200 nm,x,missed,0.5,0.51,0.01,0.1",
        "effects.van_der_waals.london_wavelength = none,x,eta_11,0.1,0.3,0.2,0.0",
        "effects.jkr.surface_energy = 5e-3 J/m^2,x,eta_11,0.1,0.2,0.1,0.0",
        "numerics.rotations = 1,x,eta_11,0.1,0.2,0.1,0.0",
    ]
    (tmp_path / "s.csv").write_text("\n".join(lines))
    found = sensitivities(scene, tmp_path / "s.csv")
    # The wavenumber goes with the inverse of the wavelength; the surface energy moves force, indentation and more.
    assert found == {"van_der_waals.wavenumber": {"eta_11": pytest.approx(-1.0)}}
    # The modulus moves the indentation of contacts, and what follows from it and from N; the Hamaker constant the attraction.
    more = [
        "effects.jkr.elastic_modulus = 1 GPa,x,breakup,0.1,0.2,0.1,0.0",
        "effects.van_der_waals.hamaker_constant = 1.94e-20 J,x,eta_11,0.1,0.2,0.1,0.0",
    ]
    (tmp_path / "s.csv").write_text("\n".join(lines[:1] + more))
    found = sensitivities(scene, tmp_path / "s.csv")
    assert found == {
        "jkr.indentation": {"breakup": pytest.approx(np.log(2) / (2 / 3 * np.log(3.4)), rel=1e-6)},
        "attraction_number": {"eta_11": pytest.approx(1.0)},
    }
    with pytest.raises(UserError, match="mcdem sensitivity"):
        sensitivities(scene, SCENES / "quickstart.toml")
