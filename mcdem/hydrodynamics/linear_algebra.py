"""LAPACK and BLAS inside compiled code: Cholesky factors of symmetric positive definite matrices, in place.

numba offers no triangular solves, rank-k updates or inverses from a factor; these wrappers take them from the
LAPACK that scipy ships, by symbol, so that callers can still be cached on disk.  All matrices are C-ordered
and only their **lower** triangle is read or written (the upper one as Fortran sees it).  A matrix may be the
leading part of a larger work array: only the row stride is used.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import get_cython_function_address, intrinsic

from mcdem.compilation import compiled

_BY_REFERENCE = {"c": ir.IntType(8), "i": ir.IntType(32), "d": ir.DoubleType(), "o": ir.IntType(32)}


def _bind(module: str, name: str, kinds: str) -> Any:
    """A compiled call of one Fortran routine, with its arguments given as one tuple of values.

    `kinds` has a letter an argument: c a character, i an integer, d a double, p an address, o the integer
    result (start value given).  All but addresses are passed by reference from the stack.
    """
    symbol = f"mcdem_{name}"
    llvm.add_symbol(symbol, get_cython_function_address(f"scipy.linalg.{module}", name))

    @intrinsic
    def call(typing_context, arguments):
        def codegen(context, builder, signature, values):
            pointer = ir.IntType(8).as_pointer()
            passed, info = [], None
            items = cgutils.unpack_tuple(builder, values[0])
            for kind, item, kind_type in zip(kinds, items, signature.args[0], strict=True):
                if kind == "p":
                    passed.append(builder.inttoptr(item, pointer))
                    continue
                target = types.float64 if kind == "d" else types.int64
                value = context.cast(builder, item, kind_type, target)
                if kind != "d":
                    value = builder.trunc(value, _BY_REFERENCE[kind])
                slot = cgutils.alloca_once_value(builder, value)
                builder.store(value, slot)
                passed.append(builder.bitcast(slot, pointer))
                info = slot if kind == "o" else info
            function_type = ir.FunctionType(ir.VoidType(), [pointer] * len(kinds))
            builder.call(cgutils.get_or_insert_function(builder.module, function_type, symbol), passed)
            if info is None:
                return context.get_constant(types.int64, 0)
            return builder.sext(builder.load(info), ir.IntType(64))

        return types.int64(arguments), codegen

    return call


_dpotrf = _bind("cython_lapack", "dpotrf", "cipio")
_dpotri = _bind("cython_lapack", "dpotri", "cipio")
_dtrsm = _bind("cython_blas", "dtrsm", "cccciidpipi")
_dtrsv = _bind("cython_blas", "dtrsv", "cccipipi")
_dsyrk = _bind("cython_blas", "dsyrk", "cciidpidpi")
_dsymv = _bind("cython_blas", "dsymv", "cidpipidpi")
_dgemv = _bind("cython_blas", "dgemv", "ciidpipidpi")

_UPPER, _LEFT, _NO, _YES = ord("U"), ord("L"), ord("N"), ord("T")


@njit(cache=True, inline="always")
def _row_stride(matrix):
    return matrix.strides[0] // 8


@compiled
def cholesky(matrix):
    """Overwrite the lower triangle of `matrix` (n, n) by its Cholesky factor L; 0, or the failing row (1-based)."""
    return _dpotrf((_UPPER, matrix.shape[0], matrix.ctypes.data, _row_stride(matrix), 0))


@compiled
def inverse_from_cholesky(factor):
    """Overwrite L (n, n) by the lower triangle of (L L^T)^-1; 0, or the zero pivot (1-based)."""
    return _dpotri((_UPPER, factor.shape[0], factor.ctypes.data, _row_stride(factor), 0))


@compiled
def solve_lower(factor, vector, transposed):
    """Overwrite `vector` (n,) by L^-1 vector, or by L^-T vector."""
    operation = _NO if transposed else _YES
    n, stride = factor.shape[0], _row_stride(factor)
    _dtrsv((_UPPER, operation, _NO, n, factor.ctypes.data, stride, vector.ctypes.data, 1))


@compiled
def solve_cholesky(factor, vector):
    """Overwrite `vector` (n,) by (L L^T)^-1 vector.

    LAPACK's dpotrs takes more than twice as long for one vector: it packs the factor as for many.
    """
    solve_lower(factor, vector, False)
    solve_lower(factor, vector, True)


@compiled
def solve_lower_from_right(factor, rows):
    """Overwrite `rows` (m, n) by rows L^-T, with L (n, n)."""
    n, m = factor.shape[0], rows.shape[0]
    # Fortran sees rows^T (n, m) and U = L^T, and solves U^T X = rows^T.
    matrix, right = (factor.ctypes.data, _row_stride(factor)), (rows.ctypes.data, _row_stride(rows))
    _dtrsm((_LEFT, _UPPER, _YES, _NO, n, m, 1.0, matrix[0], matrix[1], right[0], right[1]))


@compiled
def subtract_outer(matrix, rows):
    """matrix -= rows rows^T on the lower triangle; matrix (n, n), rows (n, k)."""
    n, k = rows.shape
    factor, target = (rows.ctypes.data, _row_stride(rows)), (matrix.ctypes.data, _row_stride(matrix))
    _dsyrk((_UPPER, _YES, n, k, -1.0, factor[0], factor[1], 1.0, target[0], target[1]))


@compiled
def multiply_symmetric(matrix, vector, out):
    """out = matrix vector, reading the lower triangle of matrix (n, n)."""
    source, stride = matrix.ctypes.data, _row_stride(matrix)
    n = matrix.shape[0]
    _dsymv((_UPPER, n, 1.0, source, stride, vector.ctypes.data, 1, 0.0, out.ctypes.data, 1))


@compiled
def add_product(rows, vector, out, factor):
    """out += factor rows vector; rows (m, n)."""
    m, n = rows.shape
    source, stride = rows.ctypes.data, _row_stride(rows)
    _dgemv((_YES, n, m, factor, source, stride, vector.ctypes.data, 1, 1.0, out.ctypes.data, 1))


@compiled
def add_transposed_product(rows, vector, out, factor):
    """out += factor rows^T vector; rows (m, n)."""
    m, n = rows.shape
    source, stride = rows.ctypes.data, _row_stride(rows)
    _dgemv((_NO, n, m, factor, source, stride, vector.ctypes.data, 1, 1.0, out.ctypes.data, 1))
