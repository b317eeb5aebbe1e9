"""Two-sphere resistance: exact values, an independent twin, limits and symmetries, and the table."""

from __future__ import annotations

import numpy as np
import pytest

from mcdem.hydrodynamics.two_sphere import tables as two_sphere
from mcdem.hydrodynamics.two_sphere.tensors import STRAIN_BASIS
from mcdem.hydrodynamics.two_sphere.twin_multipoles import (
    FUNCTIONS,
    P1,
    _logarithm_coefficients,
    _moments,
    series,
)
from validation.exact import point_forces
from validation.exact.bispherical import drag_along_the_line

RATIOS = (1.0, 0.5, 3.0)
DIRECTION = np.array([1.0, -2.0, 0.5])


# Truths


@pytest.mark.parametrize(
    ("distance", "opposite", "same"),
    [(2.01, 53.42229365, 0.645722078), (2.1, 7.413297607, 0.650900145), (3.0, 2.038654644, 0.698304560)],
)
def test_bispherical_drag_repeats_its_published_values(distance, opposite, same):
    assert drag_along_the_line(distance - 2.0) == pytest.approx((opposite, same), rel=1e-9)


@pytest.mark.parametrize(
    ("gap", "accuracy"),
    [(1e-4, 2e-7), (1e-3, 2e-7), (1e-2, 1e-9), (0.02, 3e-12), (0.1, 3e-13), (1.0, 3e-13), (8.0, 3e-13)],
)
def test_drag_along_the_line_is_bispherical(gap, accuracy):
    f = two_sphere.exact(gap)
    opposite, same = drag_along_the_line(gap)
    assert f["XA11"] - f["XA12"] == pytest.approx(opposite, rel=accuracy)
    assert f["XA11"] + f["XA12"] == pytest.approx(same, rel=accuracy)


def test_squeeze_near_contact():
    """JO (3.17); the constant is summed to convergence, 0.99536, where its first 100 orders give 0.99542."""
    xi = np.array([1e-5, 1e-6])
    singular = 1 / (4 * xi) + 9 / 40 * np.log(1 / xi) + 3 / 112 * xi * np.log(1 / xi)
    assert two_sphere.exact(xi)["XA11"] - singular == pytest.approx(0.9953608, abs=2e-6)


def relative_mobility(gap: float) -> tuple[float, float]:
    """A and B of two equal force- and torque-free spheres in a strain, Batchelor & Green, J. Fluid Mech. 56 (1972) 375."""
    resistance = two_sphere.resistance_matrix([0, 0, 1], gap)
    found = []
    for component, axis in ((1, 2), (3, 0)):  # strain along d; strain in the plane of d and x
        strain = np.zeros(10)
        strain[[component, 5 + component]] = 1.0
        motion = np.linalg.solve(resistance[:12, :12], resistance[:12, 12:] @ strain)
        ambient = (2.0 + gap) * STRAIN_BASIS[component][axis, 2]
        found.append(-(motion[3 + axis] - motion[axis]) / ambient)
    return found[0], found[1]


@pytest.mark.parametrize(("distance", "a", "b"), [(2.1, 0.7324360, 0.1555507), (3.0, 0.1866626, 0.0222800)])
def test_relative_velocity_in_strain_is_batchelor_and_greens(distance, a, b):
    """Only B shows the signs of Y^B and Y^H."""
    assert relative_mobility(distance - 2.0) == pytest.approx((a, b), abs=6e-8)


def test_far_relative_velocity_in_strain():
    """Batchelor & Green 1972: A = 5/r^3 - 8/r^5 + 25/r^6, B = 16/(3 r^5)."""
    r = 40.0
    a, b = relative_mobility(r - 2.0)
    assert a == pytest.approx(5 / r**3 - 8 / r**5 + 25 / r**6, abs=300 / r**8)
    assert b == pytest.approx(16 / (3 * r**5), abs=300 / r**8)


def test_force_that_holds_a_touching_pair_together():
    """6.12 pi mu g a^2 at 45 degrees in shear, where the strain along d is g/2: Nir & Acrivos, J. Fluid Mech. 59 (1973) 209."""
    strain = np.zeros(22)
    strain[[13, 18]] = -np.sqrt(1.5) / 2
    for gap in (1e-5, 1e-6):
        resistance = two_sphere.resistance_matrix([0, 0, 1], gap)
        strain[2], strain[5] = (
            (1 + gap / 2) / 2,
            -(1 + gap / 2) / 2,
        )  # at rest, each is slower than its ambient velocity by this
        assert 6 * abs((resistance @ strain)[2]) == pytest.approx(6.12, abs=0.005)


# An independent twin


@pytest.mark.parametrize(("gap", "ratio", "accuracy"), [(1.0, 0.5, 1e-6), (0.6, 1.0, 2e-5)])
def test_every_function_agrees_with_collocation(gap, ratio, accuracy):
    resistance = two_sphere.resistance_matrix(DIRECTION, gap, ratio)
    along = DIRECTION / np.linalg.norm(DIRECTION)
    collocated = point_forces.resistance(np.outer([0.0, 1 + ratio + gap], along), [1.0, ratio])
    assert collocated == pytest.approx(resistance, abs=accuracy)


# Laws


@pytest.mark.parametrize("name", FUNCTIONS)
def test_singular_parts_exhaust_the_tail(name):
    """Taken out of the series, 1/xi, ln xi and xi ln xi must leave terms of order k^-3.

    At equal sizes either the sum of the even and odd terms or their difference is free of the slow swings that hide
    the tail; for that one k^2 times the remainder must fall as 1/k.
    """
    f, orders = FUNCTIONS[name], 800
    k = np.arange(orders + 1)
    rest = f.moment_unit * _moments(f.azimuth, f.motion, np.array([0.5, 0.5]), orders)[0, f.moment]
    for parity, (inverse, *logarithms) in zip((f.rank_parity, 1 - f.rank_parity), f.singular(1.0)):
        rest -= np.where(k % 2 == parity, inverse, 0.0)
        for power, g in enumerate(logarithms):
            rest -= g * _logarithm_coefficients(power, parity, orders)
    tails = []
    for sign in (1.0, -1.0):
        smooth = rest * sign**k
        for _ in range(4):
            smooth[1:-1] = (smooth[:-2] + 2 * smooth[1:-1] + smooth[2:]) / 4
        tails.append(np.abs(smooth * k**2.0)[[390, 780]])
    steady = min(tails, key=lambda tail: tail[1])
    assert steady[1] < 6e-3
    assert steady[1] < 0.55 * steady[0]


@pytest.mark.slow
def test_singular_parts_hold_for_unequal_spheres():
    """For other ratios the swings stay; the fitted xi ln xi left in the tail is nought within their size."""
    ratio, orders = 0.5, 1600
    k = np.arange(orders + 1)
    moments = {}
    for name, f in FUNCTIONS.items():
        start = (f.azimuth, f.motion)
        if start not in moments:
            moments[start] = _moments(*start, np.array([1.0, ratio]) / (1 + ratio), orders)
        terms = f.moment_unit * moments[start][0, f.moment]
        cross = terms if f.motion == P1 else ratio * terms
        for rest, parity, (inverse, g2, g3) in zip(
            (terms, cross), (f.rank_parity, 1 - f.rank_parity), f.singular(ratio)
        ):
            basis = np.stack([_logarithm_coefficients(power, parity, orders) for power in range(3)], axis=1)
            tail = (k % 2 == parity) & (k > 800)
            left = (rest - inverse - basis[:, 0] * g2 - basis[:, 1] * g3)[tail]
            weight = k[tail] ** 3.0
            fitted = np.linalg.lstsq(basis[tail, 1:] * weight[:, None], left * weight, rcond=None)[0]
            assert abs(fitted[0]) < 2e-4, name


def test_series_has_converged():
    """Contact is the worst place; the difference of two truncations bounds the error of the shorter one."""
    short, long = (two_sphere.twin_multipoles.series(1.0, orders) for orders in (600, 1000))
    for gap, accuracy in ((1e-6, 3e-6), (0.02, 3e-9), (0.05, 1e-12)):
        for name in two_sphere.NAMES:
            a, b = (two_sphere.twin_multipoles.evaluate(s[name], gap, 1.0) for s in (short, long))
            assert a == pytest.approx(b, rel=accuracy, abs=accuracy), (name, gap)


@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("gap", [1e-7, 1e-3, 0.1, 2.0, 30.0])
def test_resistance_is_symmetric_and_positive(ratio, gap):
    """So is the difference: more moments can only resist more."""
    for functions in (two_sphere.exact, two_sphere.far_field, two_sphere.difference):
        resistance = two_sphere.resistance_matrix(DIRECTION, gap, ratio, functions)
        assert np.abs(resistance - resistance.T).max() < 1e-12 * np.abs(resistance).max()
        assert np.linalg.eigvalsh(resistance).min() > 0.0


@pytest.mark.parametrize("ratio", [1.0, 0.5])
def test_swapping_the_spheres_turns_the_direction_round(ratio):
    here = two_sphere.resistance_matrix(DIRECTION, 0.3, ratio)
    there = two_sphere.resistance_matrix(-DIRECTION, 0.3 / ratio, 1 / ratio)
    swap = np.r_[3:6, 0:3, 9:12, 6:9, 17:22, 12:17]
    scale = ratio ** np.r_[[0.5] * 6, [1.5] * 16]  # units 6 pi mu a^n of the sphere that is the first
    assert there[np.ix_(swap, swap)] * np.outer(scale, scale) == pytest.approx(here, rel=1e-12, abs=1e-14)


def test_rigid_motion_of_the_pair_meets_no_squeeze():
    """The divergence belongs to approach alone: the pair turning about its centre with the fluid at rest."""
    motion = np.zeros(22)
    motion[0], motion[3], motion[6:12] = 1.0, -1.0, [0, -1, 0, 0, -1, 0]
    forces = [
        two_sphere.resistance_matrix([0, 0, 1], gap) @ (motion * np.r_[[1 + gap / 2] * 6, [1.0] * 16])
        for gap in (1e-6, 1e-7)
    ]
    assert forces[0] == pytest.approx(forces[1], abs=1e-4)


@pytest.mark.parametrize("ratio", RATIOS)
def test_difference_falls_as_the_sixth_power(ratio):
    """Seen by every function: the far field holds all lower orders of all 44, with their signs."""
    orders = 6
    whole, far = series(ratio), two_sphere.pair_mobility.resistance_orders(ratio, orders)
    for name in two_sphere.NAMES:
        lower = far[name][:orders] / (1 + ratio) ** np.arange(orders)
        assert whole[name].full[:orders] == pytest.approx(lower, abs=1e-13 * (1 + ratio**3)), name


def test_single_spheres():
    far_apart = two_sphere.exact(1e9, 0.5)
    for name, (one, other) in {"A": (1, 1 / 2), "C": (4 / 3, 1 / 6), "M": (10 / 9, 10 / 72)}.items():
        for kind in "XYZ":
            if kind + name in FUNCTIONS:
                found = far_apart[f"{kind}{name}11"], far_apart[f"{kind}{name}22"]
                assert found == pytest.approx((one, other), rel=1e-8)


# The table


@pytest.mark.parametrize("ratio", [1.0, 0.5])
def test_table_repeats_the_differences(ratio):
    table, columns = two_sphere.lubrication_table(ratio), two_sphere.lubrication_columns(ratio)
    gaps = np.geomspace(1e-8, 1e3, 701)
    found = np.empty((len(gaps), len(columns)))
    for gap, out in zip(gaps, found):
        two_sphere.lubrication_scalars(gap, table, out)
    expected = two_sphere.difference(gaps, ratio)
    for column, name in enumerate(columns):
        assert found[:, column] == pytest.approx(expected[name], rel=1e-7, abs=1e-10), name


def test_table_is_smooth_and_finite_everywhere():
    table = two_sphere.lubrication_table()
    contact, overlap, far, unknown = np.empty((4, 22))
    two_sphere.lubrication_scalars(table.smallest_gap, table, contact)
    two_sphere.lubrication_scalars(-0.1, table, overlap)
    two_sphere.lubrication_scalars(1e12, table, far)
    two_sphere.lubrication_scalars(np.nan, table, unknown)
    assert (overlap == contact).all()
    assert np.isnan(unknown).all()
    assert np.abs(far).max() < 1e-60
    c = table.coefficients
    ends = np.stack([c.sum(axis=1), c[:, 1] + 2 * c[:, 2] + 3 * c[:, 3], 2 * c[:, 2] + 6 * c[:, 3]], axis=1)
    starts = c[:, :3] * np.array([1.0, 1.0, 2.0])[:, None]
    assert ends[:-1] == pytest.approx(starts[1:], rel=1e-9, abs=1e-11)


def test_table_survives_a_spoilt_file(monkeypatch, tmp_path):
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path))
    made = two_sphere.lubrication_table.__wrapped__(1.0)
    (kept,) = tmp_path.glob("*.npz")
    again = two_sphere.lubrication_table.__wrapped__(1.0)
    kept.write_bytes(kept.read_bytes()[:1000])
    repaired = two_sphere.lubrication_table.__wrapped__(1.0)
    for field, value in made._asdict().items():
        assert np.array_equal(getattr(again, field), value)
        assert np.array_equal(getattr(repaired, field), value)
    assert list(tmp_path.glob("*.npz")) == [kept]
