"""Two-sphere resistance: exact values, limits, symmetries, an independent collocation twin, and the table."""

from __future__ import annotations

import numpy as np
import pytest

from mcdem.hydrodynamics import two_sphere

RATIOS = (1.0, 0.5, 3.0)


def relative_mobility(gap: float, matrix=two_sphere.exact) -> tuple[float, float]:
    """Batchelor & Green's A and B of two equal, force- and torque-free spheres in a strain."""
    resistance = two_sphere.resistance_matrix([0, 0, 1], gap, 1.0, matrix)
    distance = 2.0 + gap
    found = []
    for strain_component, axis in ((1, 2), (3, 0)):  # uniaxial about d; in the plane of d and x
        strain = np.zeros(10)
        strain[[strain_component, 5 + strain_component]] = 1.0
        motion = np.linalg.solve(resistance[:12, :12], resistance[:12, 12:] @ strain)
        tensor = two_sphere.STRAIN_BASIS[strain_component]
        ambient = distance * tensor[axis, 2]
        found.append(-(motion[3 + axis] - motion[axis]) / ambient)
    return found[0], found[1]


@pytest.mark.parametrize(
    ("distance", "opposite", "same"),
    [(2.01, 53.42229365, 0.645722078), (2.1, 7.413297607, 0.650900145), (3.0, 2.038654644, 0.698304560)],
)
def test_drag_along_the_line_is_stimson_and_jefferys(distance, opposite, same):
    f = two_sphere.exact(distance - 2.0)
    assert f["XA11"] - f["XA12"] == pytest.approx(opposite, rel=3e-9)
    assert f["XA11"] + f["XA12"] == pytest.approx(same, rel=3e-9)


@pytest.mark.parametrize(("distance", "a", "b"), [(2.1, 0.7324360, 0.1555507), (3.0, 0.1866626, 0.0222800)])
def test_relative_velocity_in_strain_is_batchelor_and_greens(distance, a, b):
    assert relative_mobility(distance - 2.0) == pytest.approx((a, b), abs=1e-7)


@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("functions", [two_sphere.exact, two_sphere.far_field])
@pytest.mark.parametrize("gap", [1e-7, 1e-3, 0.1, 2.0, 30.0])
def test_resistance_is_symmetric_and_positive(ratio, functions, gap):
    resistance = two_sphere.resistance_matrix([1.0, -2.0, 0.5], gap, ratio, functions)
    assert np.abs(resistance - resistance.T).max() < 1e-12 * np.abs(resistance).max()
    assert np.linalg.eigvalsh(resistance).min() > 0.0


@pytest.mark.parametrize("ratio", RATIOS)
def test_swapping_the_spheres_turns_the_direction_round(ratio):
    gap = 0.3
    here = two_sphere.resistance_matrix([1.0, -2.0, 0.5], gap, ratio)
    there = two_sphere.resistance_matrix([-1.0, 2.0, -0.5], gap / ratio, 1 / ratio)
    swap = np.r_[3:6, 0:3, 9:12, 6:9, 17:22, 12:17]
    power = np.r_[[0.5] * 6, [1.5] * 6, [1.5] * 10]  # 6 pi mu a^n in the radius that is the unit
    scale = ratio ** (power[:, None] + power[None, :])
    assert there[np.ix_(swap, swap)] * scale == pytest.approx(here, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("ratio", RATIOS)
def test_difference_falls_as_the_sixth_power(ratio):
    for name, value in two_sphere.difference(np.array([100.0, 200.0]), ratio).items():
        assert abs(value[1]) <= abs(value[0]) * 2.0**-5.8, name


def test_table_repeats_the_differences():
    for ratio in (1.0, 0.5):
        table, columns = two_sphere.lubrication_table(ratio), two_sphere.lubrication_columns(ratio)
        gaps = np.geomspace(1e-8, 50.0, 701)
        expected = two_sphere.difference(gaps, ratio)
        out = np.empty(len(columns))
        for i, gap in enumerate(gaps):
            two_sphere.lubrication_scalars(gap, table, out)
            for column, name in enumerate(columns):
                assert out[column] == pytest.approx(expected[name][i], rel=1e-7, abs=1e-9), (name, gap)
