"""LAPACK inside compiled code gives what numpy gives, on whole matrices and on parts of larger ones."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from mcdem.hydrodynamics import linear_algebra as compiled


def work_matrix(n, seed, room=0):
    """A positive definite matrix, lower triangle in the leading part of a larger work array; nan elsewhere."""
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(n, n))
    matrix = half @ half.T + n * np.eye(n)
    array = np.full((n + room, n + room), np.nan)
    array[:n, :n][np.tril_indices(n)] = matrix[np.tril_indices(n)]
    return matrix, array[:n, :n]


@pytest.mark.parametrize("room", [0, 3])
@pytest.mark.parametrize("n", [1, 2, 7, 40])
def test_factor_solves_and_inverse(n, room):
    matrix, work = work_matrix(n, n, room)
    assert compiled.cholesky(work) == 0
    factor = np.tril(work)
    assert factor == pytest.approx(np.linalg.cholesky(matrix), rel=1e-12)
    assert np.isnan(work[np.triu_indices(n, 1)]).all()

    right = np.random.default_rng(1).normal(size=n)
    solution = right.copy()
    compiled.solve_cholesky(work, solution)
    assert solution == pytest.approx(np.linalg.solve(matrix, right), rel=1e-10)
    for transposed in (False, True):
        solution = right.copy()
        compiled.solve_lower(work, solution, transposed)
        assert solution == pytest.approx(
            np.linalg.solve(factor.T if transposed else factor, right), rel=1e-10
        )

    rows = np.random.default_rng(2).normal(size=(n + 2, n))
    divided = rows.copy()
    compiled.solve_lower_from_right(work, divided)
    assert divided @ factor.T == pytest.approx(rows, rel=1e-10, abs=1e-12)

    assert compiled.inverse_from_cholesky(work) == 0
    assert np.tril(work) == pytest.approx(np.tril(np.linalg.inv(matrix)), rel=1e-10, abs=1e-14)


def test_a_matrix_that_is_not_positive_definite_names_its_row():
    _, work = work_matrix(5, 0)
    work[3, 3] = -1.0
    assert compiled.cholesky(work) == 4


@pytest.mark.parametrize("room", [0, 5])
def test_products(room):
    n, k = 6, 4
    rng = np.random.default_rng(3)
    matrix, work = work_matrix(n, 4, room)
    vector, out = rng.normal(size=n), np.full(n, np.nan)
    compiled.multiply_symmetric(work, vector, out)
    assert out == pytest.approx(matrix @ vector, rel=1e-12)

    wide = rng.normal(size=(n, k + room))
    rows = wide[:, :k]
    compiled.subtract_outer(work, rows)
    assert np.tril(work) == pytest.approx(np.tril(matrix - rows @ rows.T), rel=1e-12)

    short, total = rng.normal(size=k), rng.normal(size=n)
    expected = total - 2.5 * rows @ short
    compiled.add_product(rows, short, total, -2.5)
    assert total == pytest.approx(expected, rel=1e-12)


@njit
def solve_inside(matrix, vector):
    failed = compiled.cholesky(matrix)
    compiled.solve_cholesky(matrix, vector)
    return failed


def test_they_work_when_called_from_compiled_code():
    matrix, work = work_matrix(9, 8)
    vector = np.arange(9.0)
    assert solve_inside(work, vector) == 0
    assert vector == pytest.approx(np.linalg.solve(matrix, np.arange(9.0)), rel=1e-10)
