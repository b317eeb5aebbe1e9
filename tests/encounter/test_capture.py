"""Capture of one primary by another: the integral against known shapes, the efficiency against the published law."""

from __future__ import annotations

import math

import numpy as np
import pytest
from asked import mcdem_command, refusal

import mcdem
from mcdem.encounter import capture_efficiency as capture
from mcdem.errors import UserError

PAPER = mcdem.load_scene("scenes/paper-1000Pa.toml")
# One turn after the approach is enough for a pass; the closed orbits of the last test get the paper's eight.
BRIEF = PAPER.with_changes({"numerics.rotations": 1})


def with_captured_set(monkeypatch, inside):
    monkeypatch.setattr(capture.Capture, "captured", lambda self, offset: bool(inside(*offset)))
    return capture.pair_efficiency(BRIEF)


@pytest.mark.parametrize(
    ("inside", "expected"),
    [
        (lambda x, y: x * x + y * y < 1.0, 1.0 / 8.0),
        (lambda x, y: 0.25 < x * x + y * y < 1.0, 7.0 / 64.0),
        # Half axes p along vorticity and q along the gradient carry p q^2/3 of flux.
        (lambda x, y: (x / 1.0) ** 2 + (y / 0.8) ** 2 < 1.0, 0.64 / 8.0),
        (lambda x, y: False, 0.0),
    ],
)
def test_captured_shapes_have_their_flux(monkeypatch, inside, expected):
    found = with_captured_set(monkeypatch, inside)
    assert found.efficiency == pytest.approx(expected, abs=found.bisection_error + found.quadrature_error)
    assert found.bisection_error + found.quadrature_error <= 1e-3 * expected
    assert found.step_error <= 2.0 * found.bisection_error


def test_the_whole_circle_is_the_smoluchowski_flux():
    angles, weights = capture.fejer(8)
    assert weights.sum() == pytest.approx(1.0)
    for power in range(0, 15, 2):
        assert weights @ np.cos(angles) ** power == pytest.approx(1.0 / (power + 1))


def test_rays_and_critical_offsets_give_the_same_efficiency():
    """The integral of y_c^2/2 over x0, by a rule of its own, is the slow reference."""
    found = capture.pair_efficiency(BRIEF, 4)
    radius, widest = PAPER.suspension.radius, 0.93
    nodes, weights = np.polynomial.legendre.leggauss(6)
    x = 0.5 * widest * (nodes + 1.0)
    offsets = np.array([capture.critical_offset(BRIEF, radius * at) for at in x]) / radius
    twin = 0.5 * widest * weights @ offsets**2 / 2.0 / (8.0 / 3.0)
    assert twin == pytest.approx(found.efficiency, rel=0.01)
    assert found.error < 0.01 * found.efficiency


@pytest.mark.parametrize(
    ("shear_rate", "rays"),
    [
        (10.0, 2),
        pytest.param(100.0, 4, marks=pytest.mark.slow),
        pytest.param(10.0, 4, marks=pytest.mark.slow),
        pytest.param(1.0, 4, marks=pytest.mark.slow),
    ],
)
def test_the_law_of_van_de_ven_and_mason_holds_in_its_range(shear_rate, rays):
    """0.95 C_A^0.18 for lambda = 0.2 a (van de Ven & Mason 1977) at C_A = 7e-5, 7e-4 and 7e-3, without a cut-off.

    Their exponent is a fit: exact trajectories follow it to a few per cent over two decades.
    """
    scene = PAPER.with_changes(
        {
            "flow.shear_rate": f"{shear_rate} 1/s",
            "hydrodynamics.lubrication_cutoff": 0.0,
            "numerics.rotations": 1,
        }
    )
    found = capture.pair_efficiency(scene, rays)
    assert found.efficiency == pytest.approx(capture.van_de_ven_mason(scene), rel=0.04)


def test_attraction_number_and_law_of_the_paper():
    at_750 = mcdem.load_scene("scenes/paper-750Pa.toml")
    # Section 3.1 of the paper: 0.078 at 750 Pa and 0.076 at 875 Pa.
    assert capture.van_de_ven_mason(at_750) == pytest.approx(0.078, abs=5e-4)
    at_875 = mcdem.load_scene("scenes/paper-875Pa.toml")
    assert capture.van_de_ven_mason(at_875) == pytest.approx(0.076, abs=5e-4)
    assert math.isnan(capture.van_de_ven_mason(PAPER.with_changes({"effects.van_der_waals": None})))
    # Eq. 22 at 1000 Pa.
    assert capture.initial_growth(PAPER, 0.07) == pytest.approx(4 / math.pi * 0.07 * 1e-4 * 1e4)


def test_closed_orbits_carry_little_flux():
    """Beyond the boundary of the first pass pairs at y0 = 0.03 a orbit and may be caught later."""
    line = lambda x: (x, 0.03)
    extents = [
        max(out for _, out in capture.Capture(scene).segments(line, 0.7, 1.2)) for scene in (BRIEF, PAPER)
    ]
    assert extents[0] <= extents[1]
    zone = 4.0 / 3.0 * 10.0**-1.5
    flux = 0.5 * zone**2 * (extents[1] - extents[0]) / (8.0 / 3.0)
    assert flux < 1e-3 * 0.07


def test_nothing_sticks_without_a_contact_law():
    with pytest.raises(UserError, match=r"no law of contact.*add \[effects.jkr\]"):
        capture.pair_efficiency(PAPER.with_changes({"effects.jkr": None}))


def test_offsets_outside_the_circle_and_odd_rays_are_refused():
    with pytest.raises(UserError, match="expected a length below 2a"):
        capture.critical_offset(PAPER, 2.1 * PAPER.suspension.radius)
    with pytest.raises(UserError, match="rays = 3"):
        capture.pair_efficiency(PAPER, 3)


def test_the_command_says_value_error_and_law(tmp_path, monkeypatch):
    monkeypatch.setattr(capture.Capture, "captured", lambda self, offset: math.hypot(*offset) < 0.8)
    done = mcdem_command("efficiency", "scenes/paper-1000Pa.toml", "--steps", "--cutoff", "0,5e-3")
    assert done.exit_code == 0, done.output
    assert "eta_11 = 0.06400 +-" in done.output
    assert "y_c(0) = 0.8000 a" in done.output
    assert "0.95 C_A^0.18 = 0.07384" in done.output
    assert "frozen gap" in done.output
    for given in ("x", "0,-1", "2"):
        assert refusal("efficiency", "scenes/paper-1000Pa.toml", "--cutoff", given).startswith("--cutoff")


@pytest.mark.parametrize("cutoff", [0.0, 5e-3])
def test_bodies_that_approach_from_afar_arrive_on_their_streamline(cutoff):
    """The shortcut of the far approach moves the critical offset by less than the step does."""
    whole = BRIEF.with_changes({"numerics.far_approach": 0.0, "hydrodynamics.lubrication_cutoff": cutoff})
    short = BRIEF.with_changes({"numerics.far_approach": 2.0, "hydrodynamics.lubrication_cutoff": cutoff})
    assert capture.critical_offset(short, 0.0) == pytest.approx(capture.critical_offset(whole, 0.0), rel=1e-3)
