"""Forces of the paper's contacts: its numbers, its equations read backwards, and slopes against differences."""

from __future__ import annotations

from math import pi
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from mcdem.effects import Effects, contact_force, jkr, non_contact_force, van_der_waals

NM = 1e-9
PAPER = SimpleNamespace(
    suspension=SimpleNamespace(radius=500e-9), flow=SimpleNamespace(viscosity=0.1, shear_rate=1e4)
)
F0 = 6 * pi * 0.1 * 500e-9**2 * 1e4
A = 500e-9
EFFECTS = Effects.model_validate(
    {
        "van_der_waals": {"hamaker_constant": "0.97e-20 J", "minimum_approach": "0.165 nm"},
        "jkr": {"surface_energy": "4.7 mJ/m^2", "elastic_modulus": "3.4 GPa", "poisson_ratio": 0.5},
    }
)
VDW = EFFECTS.van_der_waals.kernel(PAPER)
JKR = EFFECTS.jkr.kernel(PAPER)


def test_numbers_of_the_papers_contacts():
    """Section 2.2.2 and Table 1 of Frungieri & Vanni (2021): Eqs. 14 and 15 in SI, and what follows from Eq. 13."""
    gamma, modulus, nu = 4.7e-3, 3.4e9, 0.5
    assert JKR.pull_off_force * F0 == pytest.approx(1.5 * pi * gamma * A, rel=1e-14)
    assert JKR.pull_off_force * F0 == pytest.approx(1.107e-8, rel=5e-4)
    assert np.sqrt(JKR.indentation) * A == pytest.approx(15.42 * NM, rel=3e-4)
    assert JKR.indentation * A == pytest.approx(0.4754 * NM, rel=2e-4)
    eq15 = (3 * pi**2 * gamma**2 * A * (1 - nu**2) ** 2 / (8 * modulus**2)) ** (1 / 3)
    assert JKR.pull_off_gap * A == pytest.approx(eq15, rel=1e-14)
    assert eq15 == pytest.approx(0.126 * NM, rel=2e-3)
    assert JKR.equilibrium_gap * A == pytest.approx(-0.317 * NM, rel=1e-3)
    assert van_der_waals.force(0.0, 1.0, VDW)[0] / JKR.pull_off_force == pytest.approx(-1.34, abs=5e-3)
    assert van_der_waals.force(JKR.pull_off_gap, 1.0, VDW)[0] / JKR.pull_off_force == pytest.approx(
        -0.43, abs=5e-3
    )
    assert jkr.force(0.0, 1.0, JKR)[0] / JKR.pull_off_force == pytest.approx(-0.889, abs=5e-4)


def eq13(force_over_adhesion):
    """h/L of Eq. 13, as printed."""
    c = np.sqrt(1 + force_over_adhesion)
    return ((1 + c) / 2) ** (1 / 3) * (1 - 3 * c) / 3


@pytest.mark.parametrize("load, stiffness", [(-0.5, 32.4), (0.0, 41.9), (1.0, 53.8), (5.0, 79.0)])
def test_jkr_stiffness_in_newton_per_metre(load, stiffness):
    assert -jkr.force(eq13(load) * JKR.indentation, 1.0, JKR)[1] * F0 / A == pytest.approx(
        stiffness, abs=0.05
    )


@given(st.floats(-1.0, 1e6))
def test_jkr_inverts_eq13_to_round_off(load):
    """The error in F is that of rounding h once, dF = (dF/dh) h eps, and a few units in the last place of F itself."""
    h = eq13(load) * JKR.indentation
    force, slope = jkr.force(h, 1.0, JKR)
    # Near pull-off h = h_po - O((F + F_adh)) has lost half the digits of c; there h itself is the measure.
    unit = np.finfo(float).eps * (abs(slope * h) + 4 * JKR.pull_off_force * (1 + abs(load)))
    assert abs(force - load * JKR.pull_off_force) < 16 * unit


def test_jkr_at_equilibrium_and_at_pull_off():
    force, slope = jkr.force(JKR.equilibrium_gap, 1.0, JKR)
    assert abs(force) < 1e-14 * JKR.pull_off_force
    assert slope == pytest.approx(-JKR.equilibrium_stiffness, rel=1e-14)
    for h in (JKR.pull_off_gap, 2 * JKR.pull_off_gap, 10.0):
        assert jkr.force(h, 1.0, JKR) == (-JKR.pull_off_force, 0.0)
    force, slope = jkr.force(JKR.pull_off_gap * (1 - 1e-12), 1.0, JKR)
    assert force == pytest.approx(-JKR.pull_off_force, rel=1e-14)
    assert -1e-6 * JKR.equilibrium_stiffness < slope < 0


def test_jkr_is_hertz_in_deep_compression():
    """F -> (4/3) E* R*^(1/2) (-h)^(3/2), E* = E/(2 (1 - nu^2)), R* = a/2; adhesion is a correction of order (L/-h)^(3/4)."""
    h = -1e8 * JKR.indentation
    hertz = 4 / 3 * 3.4e9 / (2 * 0.75) * np.sqrt(A / 2) * (-h * A) ** 1.5 / F0
    assert jkr.force(h, 1.0, JKR)[0] == pytest.approx(hertz, rel=3e-6)


@pytest.mark.parametrize("radius", [0.2, 1.0, 1.7])
def test_jkr_of_other_radii_is_the_scene_of_those_radii(radius):
    scene = SimpleNamespace(suspension=SimpleNamespace(radius=radius * A), flow=PAPER.flow)
    own = EFFECTS.jkr.kernel(scene)
    for h in (-1e-2, -6e-4, 0.0, 1e-4, 1.0):
        force, slope = jkr.force(h, radius, JKR)
        own_force, own_slope = jkr.force(h / radius, 1.0, own)
        assert force == pytest.approx(own_force * radius**2, rel=1e-12)
        assert slope == pytest.approx(own_slope * radius, rel=1e-12)


def test_retardation_is_continuous_where_its_branches_meet():
    """The crossing of the published branches; the paper's p0 = 0.5709 and f = 0.7474 to their digits."""
    assert pytest.approx(0.5709, rel=2e-3) == van_der_waals.BRANCH_POINT
    below, above = (
        van_der_waals.retardation(van_der_waals.BRANCH_POINT * (1 + e), 1.0)[0] for e in (-1e-15, 1e-15)
    )
    assert below == pytest.approx(above, rel=4e-15)
    assert below == pytest.approx(0.7474, rel=1e-3)


def test_retardation_has_its_limits():
    assert van_der_waals.retardation(0.0, 1.0) == (1.0, 0.0)
    assert van_der_waals.retardation(1e6, 1.0)[0] == pytest.approx(0.98e-6, rel=1e-6)


def test_unretarded_attraction_falls_as_the_square():
    effect = van_der_waals.VanDerWaals.model_validate(
        {"hamaker_constant": "0.97e-20 J", "minimum_approach": "0.165 nm", "retarded": False}
    )
    kernel = effect.kernel(PAPER)
    assert kernel.wavenumber is None
    for gap in (0.0, 1 * NM, 1e-7):
        expected = -0.97e-20 * A / (12 * (gap + 0.165 * NM) ** 2)
        assert van_der_waals.force(gap / A, 1.0, kernel)[0] * F0 == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("radius", [0.5, 1.0, 1.6])
@pytest.mark.parametrize(
    "force, kernel, gaps",
    [
        (van_der_waals.force, VDW, [1e-5, 1e-3, 0.01, 0.0173, 0.03, 1.0]),
        (van_der_waals.force, VDW._replace(wavenumber=None), [1e-5, 1e-3, 0.1]),
        (jkr.force, JKR, [-0.1, -1e-3, -6e-4, 0.0, 1.5e-4]),
    ],
)
def test_slope_is_the_derivative_of_the_force(force, kernel, gaps, radius):
    for h in gaps:
        step = 1e-5 * (abs(h) + 3e-4)
        difference = (
            8 * (force(h + step, radius, kernel)[0] - force(h - step, radius, kernel)[0])
            - (force(h + 2 * step, radius, kernel)[0] - force(h - 2 * step, radius, kernel)[0])
        ) / (12 * step)
        assert force(h, radius, kernel)[1] == pytest.approx(difference, rel=1e-8)


def test_absent_is_strength_zero():
    for h in (0.0, 1e-3, 1.0):
        assert non_contact_force(h, 1.0, None, None, None) == (0.0, 0.0)
        assert non_contact_force(h, 1.0, VDW._replace(strength=0.0), None, None) == (0.0, 0.0)
        assert non_contact_force(h, 1.0, VDW, None, None) == van_der_waals.force(h, 1.0, VDW)
        assert contact_force(h, 1.0, JKR, None) == jkr.force(h, 1.0, JKR)
        assert contact_force(h, 1.0, None, None) == (0.0, 0.0)


@pytest.mark.parametrize(
    "table, words",
    [
        ({"van_der_waals": {"hamaker_constant": "1e-20 J"}}, "minimum_approach"),
        ({"gravity": {}}, "gravity"),
        (
            {"jkr": {"surface_energy": "1 mJ/m^2", "elastic_modulus": "1 GPa", "poisson_ratio": 0.6}},
            "poisson_ratio",
        ),
        (
            {"jkr": {"surface_energy": "1 mJ/m^2", "elastic_modulus": "1 GPa", "poisson_ratio": 0.5, "b": 1}},
            "b",
        ),
        (
            {
                "van_der_waals": {
                    "hamaker_constant": "1e-20 J",
                    "minimum_approach": "1 nm",
                    "retarded": False,
                    "london_wavelength": "90 nm",
                }
            },
            "london_wavelength",
        ),
    ],
)
def test_an_effect_takes_all_its_parameters_and_no_others(table, words):
    with pytest.raises(ValidationError, match=words):
        Effects.model_validate(table)


def test_the_london_wavelength_has_its_documented_default():
    assert EFFECTS.van_der_waals.london_wavelength == pytest.approx(100e-9)
