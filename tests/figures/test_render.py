"""The picture shows what lies in front, where it is and how large."""

import numpy as np

from mcdem.figures.render import SHEAR_PLANE, Camera, Canvas, principal_view

RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def test_a_sphere_covers_its_disc():
    canvas = Canvas(Camera((0, 0, 0), 2.0, **SHEAR_PLANE), 200, 200).spheres([[0, 0.5, -0.5]], 1.0, [RED])
    covered = np.isfinite(canvas.depth)
    assert abs(covered.sum() - np.pi * 50**2) < 60
    rows, columns = np.nonzero(covered)
    # flow z to the right, gradient y up: (y, z) = (0.5, -0.5) is half a radius above and left of the middle
    np.testing.assert_allclose([rows.mean() + 0.5, columns.mean() + 0.5], [75, 75], atol=0.5)


def test_the_nearer_sphere_hides_the_other():
    towards = np.cross((0, 0, 1), (0, 1, 0))
    for near, far, expected in ((RED, BLUE, 0), (BLUE, RED, 2)):
        canvas = Canvas(Camera((0, 0, 0), 2.0), 101, 101)
        canvas.spheres([0.5 * towards, -0.5 * towards], 1.0, [near, far])
        assert np.argmax(canvas.image[50, 50]) == expected


def test_a_rod_joins_its_ends_and_stays_thin():
    canvas = Canvas(Camera((0, 0, 0), 2.0), 200, 200).rods([[0, 0, -1]], [[0, 0, 1]], 0.1, [RED])
    rows, columns = np.nonzero(np.isfinite(canvas.depth))
    np.testing.assert_allclose([columns.min(), columns.max() + 1], [45, 155], atol=1)
    np.testing.assert_allclose([rows.min(), rows.max() + 1], [95, 105], atol=1)


def test_outside_of_the_image_nothing_is_drawn():
    canvas = Canvas(Camera((0, 0, 0), 1.0), 50, 50).spheres([[0, 9, 0], [0, 0, -9], [0, -9, 9]], 1.0, RED)
    canvas.rods([[0, 9, 9]], [[0, 12, 9]], 0.1, RED)
    assert not np.isfinite(canvas.depth).any()


def test_principal_view_is_broadside():
    chain = np.array([[k, 2 * k, -k] for k in range(5)], dtype=float) + np.array(
        [[0, 0, 0.2 * (k % 2)] for k in range(5)]
    )
    right, up = principal_view(chain)
    np.testing.assert_allclose(abs(right @ np.array([1, 2, -1]) / 6**0.5), 1.0, atol=0.02)
    assert abs(right @ up) < 1e-12
