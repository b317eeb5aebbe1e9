"""Zeichner & Schowalter's analysis done again: limiting trajectories in uniaxial extension from exact mobilities."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from mcdem.hydrodynamics.two_sphere import tensors as pair_tensors
from mcdem.hydrodynamics.two_sphere.tables import resistance_matrix
from pbekit import Cells, RangeWarning
from pbekit.balance.efficiencies import ZeichnerSchowalter
from pbekit.balance.kernels import ExtensionEncounter


@pytest.fixture(scope="module")
def mobilities():
    """gap -> (1 - A, B, closing speed under a unit attraction); lengths a, mobilities 1/(6 pi mu a)."""
    gaps = np.geomspace(1e-6, 300, 120)
    axis, across = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    flows = (
        (np.diag([-0.5, -0.5, 1.0]), axis, 1.0),
        (0.5 * (np.outer(axis, across) + np.outer(across, axis)), across, 0.5),
    )
    rows = []
    for gap in gaps:
        r = resistance_matrix(axis, gap)
        slip = []
        for strain, along, rate in flows:
            e = np.einsum("kij,ij->k", np.asarray(pair_tensors.STRAIN_BASIS), strain)
            u = np.linalg.solve(r[:12, :12], r[:12, 12:] @ np.concatenate([e, e]))
            slip.append(-(u[3:6] - u[:3]) @ along / (rate * (2 + gap)))
        pull = np.zeros(12)
        pull[2], pull[5] = 1.0, -1.0
        u = np.linalg.solve(r[:12, :12], pull)
        rows.append([1 - slip[0], slip[1], u[2] - u[5]])
    approach, turn, pull = np.array(rows).T
    x = np.log(gaps)
    # 1 - A and the mobility vanish with the gap; divided by it they are smooth.
    first, last = (
        CubicSpline(x, np.log(approach * (1 + gaps) / gaps)),
        CubicSpline(x, np.log(pull * (1 + gaps) / gaps)),
    )
    middle = CubicSpline(x, turn)

    def at(gap):
        x, near = np.log(gap), gap / (1 + gap)
        return np.exp(first(x)) * near, middle(x), np.exp(last(x)) * near

    return at


def attraction(s):
    """dV/ds of two unit spheres, Hamaker constant one (Hamaker 1937)."""
    q = s**2 - 4
    return (4 * s / q**2 + 4 / s**3 - 2 * s / q + 2 / s) / 6


def efficiency(mobilities, strength):
    """psi of the limiting trajectory over psi of the one that grazes the sphere of contact."""

    def outward(gap):
        approach, _, pull = mobilities(gap)
        return (2 + gap) * approach - 6 * strength * attraction(2 + gap) * pull

    # On the axis of extension attraction holds a pair nearer than this saddle; the trajectory into it is the limit.
    gap = np.exp(brentq(lambda x: outward(np.exp(x)), np.log(2e-6), np.log(3.0)))
    step = 1e-4 * gap
    growth = (outward(gap + step) - outward(gap - step)) / (2 * step)
    approach, turn, _ = mobilities(gap)
    bend = 1.5 * (2 + gap) * approach / (growth + 3 * (1 - turn))

    def upstream(angle, state):
        approach, turn, pull = mobilities(state[0] - 2)
        radial = (
            state[0] * approach * (1.5 * np.cos(angle) ** 2 - 0.5)
            - 6 * strength * attraction(state[0]) * pull
        )
        return [radial / (-1.5 * (1 - turn) * np.sin(angle) * np.cos(angle))]

    far = lambda angle, state: state[0] - 200
    far.terminal = True
    start = 1e-3
    path = solve_ivp(
        upstream,
        (start, np.pi / 2),
        [2 + gap + bend * start**2],
        events=far,
        rtol=1e-9,
        atol=1e-12,
        method="DOP853",
    )
    angle, s = path.t[-1], path.y[0, -1]
    assert path.status == 1
    return 0.5 * s**3 * np.sin(angle) ** 2 * np.cos(angle) / (4 * (2 / 3) / np.sqrt(3))


def test_mobilities_are_batchelor_and_greens(mobilities):
    """A, B at r = 2.1 a and 3 a (Batchelor & Green 1972)."""
    for gap, a, b in ((0.1, 0.7324360, 0.1555507), (1.0, 0.1866626, 0.0222800)):
        approach, turn, _ = mobilities(gap)
        assert approach == pytest.approx(1 - a, abs=1e-4)
        assert turn == pytest.approx(b, abs=1e-4)


@pytest.mark.parametrize("strength", [1e-8, 1e-6, 1e-4, 1e-3, 1e-2])
def test_stored_efficiencies_are_those_of_the_trajectories(mobilities, strength):
    assert ZeichnerSchowalter(strength).value == pytest.approx(efficiency(mobilities, strength), rel=1e-3)


def test_between_and_beyond_the_stored_values(mobilities):
    assert ZeichnerSchowalter(3e-7).value == pytest.approx(efficiency(mobilities, 3e-7), rel=2e-3)
    with pytest.warns(RangeWarning, match="outside 1e-9"):
        ZeichnerSchowalter(1.0)


def test_extension_flux_is_the_inflow_through_the_sphere_of_contact():
    """Integral of the inward radial velocity e r P_2(cos) over a sphere of radius 3."""
    inflow = quad(lambda c: max(0.0, -(1.5 * c**2 - 0.5)), -1, 1, points=[-(3**-0.5), 3**-0.5])[0]
    one = Cells(*(np.array([1.0]) for _ in range(2)), np.array([1.0]))
    two = one._replace(outer_radius=np.array([2.0]))
    assert ExtensionEncounter(0.7)(one, two)[0] == pytest.approx(2 * np.pi * 0.7 * 27 * inflow, rel=1e-9)
