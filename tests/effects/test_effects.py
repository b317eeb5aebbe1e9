"""Forces between primaries against the paper's numbers, exact solutions and limits."""

from __future__ import annotations

from math import log, pi

import numpy as np
import pytest
from effects_family import CONTACT_LAWS, ELASTIC, TABLES, effects, kernels, scene
from effects_family import kernel as kernel_of
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from mcdem.effects import EFFECTS, Effects, born, dmt, double_layer, jkr, steric, van_der_waals
from mcdem.effects.sums import (
    contact_equilibrium,
    contact_force,
    contact_gap,
    contact_pull_off_force,
    contact_pull_off_gap,
)
from mcdem.errors import SceneError
from mcdem.scene import Scene

NM = 1e-9
PAPER = scene("van_der_waals", "jkr")
A = PAPER.reduced.length
F0 = PAPER.reduced.force
VDW, JKR = kernel_of(PAPER, "van_der_waals"), kernel_of(PAPER, "jkr")


def kernel(name, **changes):
    whole = scene(name)
    table = whole.effects.get(name).model_copy(update=changes)
    return table.kernel(whole.reduced, whole.suspension, whole.effects)


# The paper's contacts


def test_numbers_of_the_papers_contacts():
    """Section 2.2.2 and Table 1 of Frungieri & Vanni (2021): Eqs. 14 and 15 in SI, and what follows from Eq. 13."""
    gamma, modulus, nu = 4.7e-3, 3.4e9, 0.5
    assert JKR.pull_off_force * F0 == pytest.approx(1.5 * pi * gamma * A, rel=1e-14)
    assert JKR.pull_off_force * F0 == pytest.approx(1.107e-8, rel=5e-4)
    b0 = (9 * pi * gamma * A**2 * (1 - nu**2) / (2 * modulus)) ** (1 / 3)
    assert np.sqrt(JKR.indentation) * A == pytest.approx(b0, rel=1e-14)
    assert b0 == pytest.approx(15.42 * NM, rel=3e-4)
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
    assert PAPER.effects.get("jkr").tabor_number(A, 0.165 * NM) == pytest.approx(0.985, abs=5e-4)


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
    """The error in F is that of rounding h once, (dF/dh) h eps, and a few units in the last place of F + F_adh."""
    h = eq13(load) * JKR.indentation
    force, slope = jkr.force(h, 1.0, JKR)
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


# DMT


def test_dmt_is_hertz_less_adhesion():
    kernel_ = kernel("dmt")
    assert kernel_.pull_off_force / JKR.pull_off_force == pytest.approx(4 / 3, rel=1e-14)
    for depth in (0.1 * NM, 1 * NM):
        hertz = 4 / 3 * 3.4e9 / (2 * 0.75) * np.sqrt(A / 2) * depth**1.5 / F0
        force = dmt.force(-depth / A, 1.0, kernel_)[0]
        assert force + kernel_.pull_off_force == pytest.approx(hertz, rel=1e-13)


@pytest.mark.parametrize("law", CONTACT_LAWS)
@pytest.mark.parametrize("radius", [1.0, 0.3])
@pytest.mark.parametrize("load", [-0.5, 0.0, 1.0, 100.0])
def test_the_gap_of_a_loaded_contact_is_the_law_read_backwards(law, radius, load):
    contact = kernels(law).contact
    gap = contact_gap(load, radius, contact)
    assert contact_force(gap, radius, contact)[0] == pytest.approx(load, abs=1e-9)
    assert contact_gap(load, radius, None) == -np.inf


@pytest.mark.parametrize("radius", [0.3, 1.0, 1.6])
@pytest.mark.parametrize("law", CONTACT_LAWS)
def test_equilibrium_and_pull_off_of_a_contact(law, radius):
    contact, force = kernels(law).contact, EFFECTS[law].force
    strength = contact_pull_off_force(radius, contact)
    assert strength == pytest.approx(contact_pull_off_force(1.0, contact) * radius, rel=1e-14)
    gap, stiffness = contact_equilibrium(radius, contact)
    value, slope = force(gap, radius, contact)
    assert abs(value) < 1e-13 * strength
    assert slope == pytest.approx(-stiffness, rel=1e-12)
    pull_off = contact_pull_off_gap(radius, contact)
    assert force(pull_off, radius, contact) == (-strength, 0.0)
    assert force(pull_off - 1e-6, radius, contact)[0] > -strength


@pytest.mark.parametrize("law", CONTACT_LAWS)
def test_a_law_and_its_table_agree_on_pull_off(law):
    """What the rest of the program takes from the table in SI is what the compiled law does."""
    whole = scene(law)
    contact, units, table = kernels(law).contact, whole.reduced, whole.effects.contact
    assert contact_pull_off_force(1.0, contact) * units.force == pytest.approx(
        table.pull_off_force(units.length), rel=1e-14
    )
    assert contact_pull_off_gap(1.0, contact) * units.length == pytest.approx(
        table.pull_off_gap(units.length), rel=1e-14, abs=1e-24
    )


# Van der Waals


def test_retardation_is_continuous_where_its_branches_meet():
    """The crossing of the published branches; the paper's p0 = 0.5709 and f = 0.7474 to within 0.15 %."""
    assert pytest.approx(0.5709, rel=1.5e-3) == van_der_waals.BRANCH_POINT
    below, above = (
        van_der_waals.retardation(van_der_waals.BRANCH_POINT * (1 + e), 1.0)[0] for e in (-1e-15, 1e-15)
    )
    assert below == pytest.approx(above, rel=4e-15)
    assert below == pytest.approx(0.7474, rel=1e-3)


def test_retardation_has_its_limits():
    assert van_der_waals.retardation(0.0, 1.0) == (1.0, 0.0)
    assert van_der_waals.retardation(1e6, 1.0)[0] == pytest.approx(0.98e-6, rel=1e-6)


def test_unretarded_attraction_falls_as_the_square():
    kernel_ = kernel_of(scene("unretarded"), "unretarded")
    assert kernel_.wavenumber is None
    for gap in (0.0, 1 * NM, 1e-7):
        expected = -0.97e-20 * A / (12 * (gap + 0.165 * NM) ** 2)
        assert van_der_waals.force(gap / A, 1.0, kernel_)[0] * F0 == pytest.approx(expected, rel=1e-13)


# Double layer


def legendre(u, order):
    """P_n(u) and dP_n/du, n = 0 .. order."""
    P, D = np.zeros((order + 1, u.size)), np.zeros((order + 1, u.size))
    P[0], P[1], D[1] = 1, u, 1
    for n in range(1, order):
        P[n + 1] = ((2 * n + 1) * u * P[n] - n * P[n - 1]) / (n + 1)
        D[n + 1] = D[n - 1] + (2 * n + 1) * P[n]
    return P, D


def spherical_bessel(x, order):
    """Log of the modified spherical Bessel function k_n(x), and k_n'/k_n, n = 0 .. order."""
    logs, ratio = np.zeros((order + 2, x.size)), 1 + 1 / x
    logs[0] = -x - np.log(x)
    logs[1] = logs[0] + np.log(ratio)
    for n in range(1, order + 1):
        ratio = 1 / ratio + (2 * n + 1) / x
        logs[n + 1] = logs[n] + np.log(ratio)
    n = np.arange(order + 1)[:, None]
    return logs[:-1], n / x - np.exp(logs[1:] - logs[:-1])


def linear_poisson_boltzmann(kappa, h, constant_charge, order=140):
    """Force between two spheres of radius 1, eps = psi = 1: multipoles about both centres, matched on the surface, and the
    pressure of ions and field (eps kappa^2 psi^2 + eps E^2)/2 on the plane midway, where the field lies in the plane."""
    R = 2 + h
    c, weight = np.polynomial.legendre.leggauss(3 * order)
    r, u = np.sqrt(R * R + 1 - 2 * R * c), (R - c) / np.sqrt(R * R + 1 - 2 * R * c)
    (log_0, slope_0), (log_r, slope_r) = (
        spherical_bessel(np.array([kappa]), order),
        spherical_bessel(kappa * r, order),
    )
    (P_c, _), (P_u, D_u) = legendre(c, order), legendre(u, order)
    other = np.exp(log_r - log_0)
    if constant_charge:
        dr = (1 - R * c) / r
        du = -c / r - (R - c) / r**2 * dr
        rows = -(kappa * slope_0 * P_c + other * (kappa * slope_r * dr * P_u + D_u * du))
        surface = np.full_like(c, 1 + kappa)  # the charge of an isolated sphere of potential 1
    else:
        rows, surface = P_c + other * P_u, np.ones_like(c)
    root = np.sqrt(weight)
    multipoles = np.linalg.lstsq((rows * root).T, surface * root, rcond=1e-15)[0]
    assert np.abs(multipoles @ rows - surface).max() < 1e-6 * kappa
    x, weight = np.polynomial.legendre.leggauss(200)
    edge = np.sqrt((R / 2 + 25 / kappa) ** 2 - R * R / 4)
    rho, weight = edge * (x + 1) / 2, weight * edge / 2
    r, u = np.hypot(rho, R / 2), R / 2 / np.hypot(rho, R / 2)
    (log_r, slope_r), (P_u, D_u) = spherical_bessel(kappa * r, order), legendre(u, order)
    decay = np.exp(log_r - log_0)
    psi = 2 * multipoles @ (decay * P_u)
    field = 2 * multipoles @ (decay * (kappa * slope_r * rho / r * P_u - D_u * R / 2 * rho / r**3))
    return 2 * pi * np.sum(weight * rho * (kappa**2 * psi**2 + field**2) / 2)


@pytest.mark.parametrize("kappa_h", [1.0, 3.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_double_layer_is_the_exact_solution_for_thin_layers(sign, kappa_h):
    """The error against exact linear Poisson-Boltzmann spheres falls as 1/(kappa a): Derjaguin's approximation is first order."""
    error = []
    for kappa in (10.0, 20.0, 40.0):
        kernel_ = double_layer.DoubleLayerKernel(2 * pi, kappa, sign, 0.0)
        exact = linear_poisson_boltzmann(kappa, kappa_h / kappa, sign < 0)
        error.append(double_layer.force(kappa_h / kappa, 1.0, kernel_)[0] / exact - 1)
    assert max(np.abs(error)) < 0.13
    # Ratio 2 but for the next order, itself of relative size 1/(kappa a).
    assert 1.7 < error[0] / error[1] < 2.4 and 1.8 < error[1] / error[2] < 2.3


def test_double_layer_energy_is_that_of_hogg_healy_fuerstenau():
    """V = 2 pi eps psi^2 a ln(1 + x), or -2 pi eps psi^2 a ln(1 - x): its derivative over a step is the force at the middle."""
    for sign in (1.0, -1.0):
        kernel_ = double_layer.DoubleLayerKernel(1.0, 50.0, sign, 0.0)
        energy = [sign * log(1 + sign * np.exp(-50 * h)) for h in (0.01 - 1e-6, 0.01 + 1e-6)]
        force = double_layer.force(0.01, 1.0, kernel_)[0]
        assert force == pytest.approx((energy[0] - energy[1]) / 2e-6, rel=1e-8)


def test_double_layer_of_the_sample_in_si():
    """2 pi eps psi^2 kappa a/2 at constant potential and contact."""
    value = double_layer.force(0.0, 1.0, kernel("double_layer"))[0] * F0
    assert value == pytest.approx(2 * pi * 78.5 * 8.8541878128e-12 * 0.025**2 * 50 / 2, rel=1e-12)


def test_double_layer_refuses_what_it_does_not_hold_for():
    with pytest.raises(SceneError, match=r"kappa a = 8\.33"):
        kernel("double_layer", debye_length=60 * NM)
    table = TABLES["double_layer"]
    for change, words in [
        ({"surface_potential": "80 mV"}, "60 mV"),
        ({"condition": "constant_charge"}, "minimum_approach"),
        ({"minimum_approach": "0.2 nm"}, "remove it"),
    ]:
        with pytest.raises(ValidationError, match=words):
            Effects.model_validate({"double_layer": table | change})


# Short range


def test_born_is_the_integral_over_two_half_spaces():
    """F = pi a_eff W, W = integral of 4 eps sigma^12/r^12 over two half-spaces of density rho, A_H = 4 pi^2 eps rho^2 sigma^6."""
    sigma, gap, hamaker = 0.5 * NM, 0.3 * NM, 0.97e-20
    # An atom at distance z from a half-space: 2 pi int_z^inf int_0^inf r (r^2 + y^2)^-6 dr dy = pi/(5*9 z^9).
    x, weight = np.polynomial.legendre.leggauss(60)
    z = gap / ((x + 1) / 2)  # z from gap to infinity
    work = np.sum(weight / 2 * gap / ((x + 1) / 2) ** 2 * pi / (45 * z**9))
    work *= hamaker * sigma**6 / pi**2
    value = born.force(gap / A, 1.0, kernel("born"))[0] * F0
    assert value == pytest.approx(pi * A * work, rel=1e-11)


def test_born_balances_the_attraction_of_touching_atoms():
    attraction = VDW._replace(wavenumber=None, minimum_approach=0.0)
    h = 0.5 * NM / A * 30 ** (-1 / 6)
    assert born.force(h, 1.0, kernel("born"))[0] == pytest.approx(
        -van_der_waals.force(h, 1.0, attraction)[0], rel=1e-13
    )


def test_steric_is_derjaguins_integral_of_the_brush_pressure():
    kernel_ = kernel("steric")
    for d in (0.05, 0.3, 0.9):
        pressure = 1.380649e-23 * 298 / (3 * NM) ** 3 * (d**-2.25 - d**0.75)
        assert -steric.force(d * kernel_.range, 1.0, kernel_)[1] * F0 / A == pytest.approx(
            pi * A * pressure, rel=1e-12
        )
    value, slope = steric.force(kernel_.range * (1 - 1e-9), 1.0, kernel_)
    assert 0 <= value < 1e-12 * kernel_.pressure and abs(slope) < 1e-7 * kernel_.pressure


# Scene tables


@pytest.mark.parametrize(
    "table, words",
    [
        ({"van_der_waals": {"hamaker_constant": "1e-20 J"}}, "minimum_approach"),
        (
            {"van_der_waals": TABLES["van_der_waals"] | {"retarded": False, "london_wavelength": "90 nm"}},
            "london_wave",
        ),
        ({"jkr": ELASTIC | {"poisson_ratio": 0.6}}, "poisson_ratio"),
        ({"jkr": ELASTIC | {"b": 1}}, "b"),
        ({"jkr": ELASTIC, "dmt": ELASTIC}, "keep one"),
        ({"jkr": ELASTIC, "steric": TABLES["steric"]}, "steric keeps spheres from the contact"),
        ({"born": TABLES["born"]}, "van_der_waals"),
        ({"rods": TABLES["rods"]}, "add a contact law"),
        ({"dmt": ELASTIC, "rolling": TABLES["rolling"]}, "JKR"),
        ({"jkr": ELASTIC, "rods": TABLES["rods"], "sliding": TABLES["sliding"]}, "already"),
    ],
)
def test_what_does_not_go_together_is_refused(table, words):
    with pytest.raises(ValidationError, match=words):
        Effects.model_validate(table)


SUSPENSION = """
[suspension]
radius = "500 nm"
volume_fraction = 1e-4
[flow]
shear_rate = "1e4 1/s"
viscosity = "100 cP"
"""


def test_a_refusal_of_the_scene_file_names_table_and_cure():
    text = SUSPENSION + '[effects.born]\ncollision_diameter = "0.5 nm"\n'
    with pytest.raises(SceneError, match=r"scene.toml: \[effects\] born .* add \[effects.van_der_waals\]"):
        Scene.from_text(text, "scene.toml")
    text = SUSPENSION + '[effects.double_layer]\ndebye_length = "60 nm"\nsurface_potential = "25 mV"\n'
    text += 'relative_permittivity = 78.5\ncondition = "constant_potential"\n'
    with pytest.raises(
        SceneError, match=r"scene.toml: \[effects.double_layer\] debye_length = 60 nm .* at most 50 nm"
    ):
        Scene.from_text(text, "scene.toml")


def test_the_london_wavelength_has_its_documented_default():
    assert effects("van_der_waals").van_der_waals.london_wavelength == pytest.approx(100 * NM)
    assert effects("unretarded").van_der_waals.london_wavelength is None
