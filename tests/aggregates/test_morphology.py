"""Shapes with known answers, and a slow reference written from the paper's definitions."""

import numpy as np
import pytest
import shapes
from hypothesis import given, settings
from hypothesis import strategies as st

from mcdem.aggregates.morphology import morphology, population_morphology

A = 500e-9

# P, R_g/a, R/a, semi-axes of points /a, n_b, floppy modes, redundant bonds
KNOWN = {
    "monomer": (shapes.monomer(), 1, 0.0, 1.0, (1, 1, 1), 0, 0, 0),
    "dimer": (shapes.dimer(), 2, 1.0, 2.0, (5**0.5, 1, 1), 1, 0, 0),
    "triangle": (shapes.triangle(), 3, 2 / 3**0.5, 1 + 2 / 3**0.5, ((10 / 3) ** 0.5,) * 2 + (1,), 3, 0, 0),
    "tetrahedron": (shapes.tetrahedron(), 4, 1.5**0.5, 1 + 1.5**0.5, (2.5**0.5,) * 3, 6, 0, 0),
    "octahedron": (shapes.octahedron(), 6, 2**0.5, 1 + 2**0.5, ((10 / 3) ** 0.5,) * 3, 12, 0, 0),
    # a straight chain bends freely at each inner primary, in two directions
    "chain of 3": (shapes.chain(3), 3, (8 / 3) ** 0.5, 3.0, ((40 / 3) ** 0.5, 1, 1), 2, 2, 0),
    "chain of 7": (shapes.chain(7), 7, 4.0, 7.0, (80**0.5, 1, 1), 6, 10, 0),
    # 12 spokes hold 12 of the shell's 36 coordinates; 3 more are turns of the whole: 39 - 6 - 12 remain
    "icosahedron": (shapes.icosahedron(), 13, (48 / 13) ** 0.5, 3.0, ((5 * 16 / 13) ** 0.5,) * 3, 12, 21, 0),
}


@pytest.mark.parametrize("name", KNOWN)
def test_known_shapes(name):
    (positions, bonds), size, gyration, outer, axes, bond_count, floppy, redundant = KNOWN[name]
    m = morphology(A * positions, bonds, A)
    assert int(m["size"]) == size
    np.testing.assert_allclose(m.radius_of_gyration / A, gyration, atol=1e-12)
    np.testing.assert_allclose(m.outer_radius / A, outer, rtol=1e-12)
    np.testing.assert_allclose(m.semi_axes / A, axes, rtol=1e-12)
    np.testing.assert_allclose(m.aspect_ratio, 2 * axes[0] / (axes[1] + axes[2]), rtol=1e-12)
    np.testing.assert_allclose(m.solid_fraction_sphere, size / outer**3, rtol=1e-12)
    np.testing.assert_allclose(m.solid_fraction_ellipsoid, size / np.prod(axes), rtol=1e-12)
    assert (int(m.bond_count), int(m.floppy_modes), int(m.redundant_bonds)) == (bond_count, floppy, redundant)
    assert float(m.coordination_number) == 2 * bond_count / size


def test_hcp_ball():
    """Kissing shell of 12 and beyond: over-braced, round, and filling space as pi/sqrt(18) when large."""
    kissing = morphology(*shapes.hcp_ball(2.0), 1.0)
    assert (int(kissing["size"]), int(kissing.bond_count)) == (13, 12 + 24)
    # three bonds more than 3P - 6, yet the shell still turns triangle against triangle about the centre
    assert (int(kissing.floppy_modes), int(kissing.redundant_bonds)) == (1, 4)
    second_shell = morphology(*shapes.hcp_ball(8**0.5), 1.0)
    assert (int(second_shell["size"]), int(second_shell.bond_count)) == (19, 60)
    assert (int(second_shell.floppy_modes), int(second_shell.redundant_bonds)) == (0, 60 - (3 * 19 - 6))

    positions, bonds = shapes.hcp_ball(8.0)
    inner = np.linalg.norm(positions, axis=1) < 6.0 - 1e-6
    degree = np.bincount(bonds.ravel(), minlength=len(positions))
    assert (degree[inner] == 12).all()
    ball = morphology(positions, bonds, 1.0, inertia="spheres")
    assert 1.0 <= float(ball.aspect_ratio) < 1.03
    assert abs(float(ball.solid_fraction_ellipsoid) / (np.pi / 18**0.5) - 1) < 0.04
    assert float(ball.coordination_number) < 12


def test_solid_primaries_add_their_own_inertia():
    """Dimer about its axis 2 (2/5) m a^2, across it + 2 m a^2: semi-axes sqrt(6), 1, 1; a sphere stays a sphere."""
    dimer = morphology(*shapes.dimer(), 1.0, inertia="spheres")
    np.testing.assert_allclose(dimer.semi_axes, [6**0.5, 1, 1])
    monomer = morphology(*shapes.monomer(), 1.0, inertia="spheres")
    np.testing.assert_allclose(monomer.semi_axes, [1, 1, 1])
    assert float(monomer.solid_fraction_ellipsoid) == 1.0


def test_table_2_counts_points():
    """A stack of five octahedra with a cap has the 19-mer's P, R_g and n_c of Table 2; only points give so long a shape."""
    positions, _ = shapes.stack_of_octahedra(6)
    cap = positions[-3:].mean(axis=0) + [0, 0, np.sqrt(8 / 3)]
    positions, bonds = shapes.with_bonds(np.vstack([positions, cap]))
    m = morphology(positions, bonds, 1.0)
    assert int(m["size"]) == 19
    assert round(float(m.radius_of_gyration), 2) == 3.20
    assert round(float(m.coordination_number), 2) == 5.37
    assert int(m.floppy_modes) == int(m.redundant_bonds) == 0
    printed = 3.64
    solid = morphology(positions, bonds, 1.0, inertia="spheres")
    assert abs(float(m.aspect_ratio) - printed) < abs(float(solid.aspect_ratio) - printed)


def naive(positions, bonds, a):
    """From the paper's words, one number at a time, with the full inertia tensor of Eq. 27's ellipsoid."""
    size = len(positions)
    centre = sum(positions) / size
    distances = [np.sqrt(sum((x - centre) ** 2)) for x in positions]
    inertia = np.zeros((3, 3))
    for x in positions:
        y = x - centre
        inertia += np.dot(y, y) * np.eye(3) - np.outer(y, y)
    i3, i2, i1 = sorted(np.linalg.eigvalsh(inertia), reverse=True)  # the longest axis has the smallest moment
    longest = np.sqrt(max(2.5 * (i2 + i3 - i1) / size, a**2))
    middle = np.sqrt(max(2.5 * (i1 + i3 - i2) / size, a**2))
    shortest = np.sqrt(max(2.5 * (i1 + i2 - i3) / size, a**2))
    return {
        "outer_radius": max(distances) + a,
        "radius_of_gyration": np.sqrt(sum(d**2 for d in distances) / size),
        "aspect_ratio": longest / ((middle + shortest) / 2),
        "solid_fraction_sphere": size * a**3 / (max(distances) + a) ** 3,
        "solid_fraction_ellipsoid": size
        * (4 / 3 * np.pi * a**3)
        / (4 / 3 * np.pi * longest * middle * shortest),
        "coordination_number": sum(sum(k in pair for pair in bonds.tolist()) for k in range(size)) / size,
        "floppy_modes": floppy_by_null_space(positions, bonds),
    }


def floppy_by_null_space(positions, bonds):
    """Zero modes of a network of unit springs, less the rigid motions, both as ranks of explicit matrices."""
    size = len(positions)
    stiffness = np.zeros((3 * size, 3 * size))
    for i, j in bonds:
        along = (positions[j] - positions[i]) / np.linalg.norm(positions[j] - positions[i])
        stretch = np.zeros(3 * size)
        stretch[3 * i : 3 * i + 3], stretch[3 * j : 3 * j + 3] = -along, along
        stiffness += np.outer(stretch, stretch)
    zero_modes = int(np.sum(np.linalg.eigvalsh(stiffness) < 1e-10))
    scaled = (
        (positions - positions.mean(axis=0)) / np.linalg.norm(np.ptp(positions, axis=0), ord=np.inf)
        if size > 1
        else 0 * positions
    )
    rigid = [np.tile(axis, size) for axis in np.eye(3)]
    rigid += [np.cross(axis, scaled).ravel() for axis in np.eye(3)]
    return zero_modes - np.linalg.matrix_rank(np.array(rigid), tol=1e-8)


def random_packing(rng, size):
    """Primaries stuck one by one at random points of one, two or three others: floppy to rigid."""
    positions = [np.zeros(3)]
    while len(positions) < size:
        along = rng.normal(size=3)
        candidate = positions[rng.integers(len(positions))] + 2 * along / np.linalg.norm(along)
        if min(np.linalg.norm(candidate - x) for x in positions) > 2 - 1e-12:
            positions.append(candidate)
    return shapes.with_bonds(positions)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_population_agrees_with_slow_twin_one_by_one(seed):
    rng = np.random.default_rng(seed)
    population = [random_packing(rng, int(p)) for p in rng.integers(1, 13, size=5)]
    population += [shapes.octahedron(), shapes.stack_of_octahedra(4), shapes.chain(4), shapes.monomer()]
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    population = [(x @ turn + rng.normal(size=3) * 10, b) for x, b in population]
    fast = population_morphology(*shapes.ragged(population, A), A)
    for k, (positions, bonds) in enumerate(population):
        for name, value in naive(A * positions, bonds, A).items():
            np.testing.assert_allclose(float(fast[name][k]), value, rtol=1e-7, atol=1e-20, err_msg=name)


def test_units_names_and_an_empty_population():
    m = population_morphology(np.empty((0, 3)), np.empty(0, int), np.empty((0, 2), int), np.empty(0, int), A)
    assert m.sizes["aggregate"] == 0
    assert all({"units", "long_name"} <= set(v.attrs) for v in m.data_vars.values())


def test_population_that_does_not_add_up_is_refused():
    positions, sizes, bonds, counts = shapes.ragged([shapes.dimer(), shapes.triangle()])
    with pytest.raises(ValueError, match="does not add up: 6 primaries"):
        population_morphology(positions, sizes + [0, 1], bonds, counts, 1.0)
