"""Compiled functions that are called, not laid into each of their callers.

numba links what a compiled function calls into it and optimises all of that anew, at each level of calls and for each
combination of types above.  Here that ends at a seam: a function marked `separately_compiled` is compiled once for the types of
its arguments, when it is first called, and every caller reaches it through a pointer.  So a scene with another effect compiles
what knows of the effect and nothing else, what is never called is never compiled, and a caller is compiled in the time that its
own lines take.

The pointer lies in the caller's own memory and is empty at first, also in code that comes from the cache on disk: the first call
asks `_address` for it, by the name of the function and the types of its arguments.  A call costs a few nanoseconds more than an
ordinary one and passes its arguments as numba does, so a seam belongs about some microseconds of work.
"""

from __future__ import annotations

import ctypes
import importlib
import pickle
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import llvmlite.binding as llvm
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, Signature, infer_global, signature
from numba.extending import lower_builtin

from mcdem.bundles import bundled
from mcdem.compiled_once import ask, kernel_of, once

Function = TypeVar("Function", bound=Callable[..., Any])

_RESOLVER = "mcdem_address_of_separately_compiled"
_INTERRUPTED = 1
"""No address: the user asked for the end while the function was compiled."""


def separately_compiled(returns: types.Type = types.none) -> Callable[[Function], Function]:
    """Compile a function once for the types of its arguments, and let compiled code call it through a pointer.

    Parameters
    ----------
    returns : what the function returns, a numba type; it stands here so that callers can be compiled before the function is

    Returns
    -------
    A function to be called from Python and from compiled code alike.
    """

    def decorate(function: Function) -> Function:
        kernel = kernel_of(function, _compile_question)
        call = _callable_from_python(function, kernel)
        call.returns = returns
        name = function.__module__, function.__qualname__

        class Template(AbstractTemplate):
            key = call

            def generic(self, args: tuple[types.Type, ...], kws: dict[str, types.Type]) -> Signature:
                if kws:
                    raise TypeError(
                        f"{function.__qualname__}: compiled code calls it with positional arguments"
                    )
                return signature(returns, *(bundled(types.unliteral(arg)) for arg in args))

        infer_global(call, types.Function(Template))

        @lower_builtin(call, types.VarArg(types.Any))
        def _(context: Any, builder: Any, sig: Signature, args: Any) -> Any:
            return _call_by_pointer(context, builder, sig, args, name)

        return call

    return decorate


def compiled(function: Function) -> Function:
    """Compile a function into whatever compiled code calls it.

    What compiled code alone calls is not made ready for calls from Python; where one comes, a few lines of its own pass it on.
    """
    kernel = kernel_of(function, _compile_question)
    call = _callable_from_python(function, kernel)
    infer_global(call, types.Dispatcher(kernel))
    return call


def interpreted(function: Callable[..., Any]) -> Callable[..., Any]:
    """A compiled function as Python runs it, for a few numbers that are not worth the wait for numba."""
    kernel = getattr(function, "kernel", function)
    found: Callable[..., Any] = getattr(kernel, "py_func", function)
    return found


def _callable_from_python(function: Callable[..., Any], kernel: Any) -> Any:
    """A function of Python that calls a kernel; the compiled lines between them are made at the first call."""

    @wraps(function)
    def call(*args: Any) -> Any:
        if not entered:
            entered.append(_passing_on(call))
        return entered[0](*args)

    entered: list[Callable[..., Any]] = []
    call.kernel = kernel  # type: ignore[attr-defined]
    return call


def _passing_on(call: Callable[..., Any]) -> Callable[..., Any]:
    """A compiled function that does nothing but pass on what Python gives it."""

    def entered(*args: Any) -> Any:
        return call(*args)

    entered.__name__ = entered.__qualname__ = f"{call.__name__}_from_python"
    found: Callable[..., Any] = once(njit(cache=True, no_cfunc_wrapper=True)(entered), _compile_question)
    return found


def _call_by_pointer(context: Any, builder: Any, sig: Signature, args: Any, name: tuple[str, str]) -> Any:
    """The code of a call: the pointer, asked for if it is empty, and numba's own way of calling with it."""
    module, address = builder.module, ir.IntType(64)
    wanted = pickle.dumps((*name, tuple(sig.args)))
    ask(wanted)
    slot = cgutils.global_constant(module, "separately_compiled", ir.Constant(address, 0))
    slot.global_constant = False
    known = cgutils.alloca_once_value(builder, builder.load(slot))
    with cgutils.if_unlikely(builder, cgutils.is_null(builder, builder.load(known))):
        resolver = cgutils.get_or_insert_function(
            module, ir.FunctionType(address, [cgutils.voidptr_t, address]), _RESOLVER
        )
        question = cgutils.global_constant(module, "separately_compiled", cgutils.make_bytearray(wanted))
        found = builder.call(
            resolver, [builder.bitcast(question, cgutils.voidptr_t), ir.Constant(address, len(wanted))]
        )
        interrupted = builder.icmp_unsigned("==", found, ir.Constant(address, _INTERRUPTED))
        with cgutils.if_unlikely(builder, interrupted):
            context.call_conv.return_user_exc(builder, KeyboardInterrupt, ())
        with cgutils.if_unlikely(builder, cgutils.is_null(builder, found)):
            context.call_conv.return_user_exc(
                builder, RuntimeError, (f"{'.'.join(name)} could not be compiled",)
            )
        builder.store(found, slot)
        builder.store(found, known)
    kind = context.call_conv.get_function_type(sig.return_type, sig.args)
    pointer = builder.inttoptr(builder.load(known), kind.as_pointer())
    status, value = context.call_conv.call_function(builder, pointer, sig.return_type, sig.args, args)
    with cgutils.if_unlikely(builder, status.is_error):
        context.call_conv.return_status_propagate(builder, status)
    return value


@ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64)
def _address(question: int, length: int) -> int:
    """Where the function with this name and these types of arguments lies; asked once by each call in compiled code.

    No exception can pass from here through the compiled caller: `_INTERRUPTED` has it raise the user's interrupt anew; any other
    failure is printed here, and is 0.
    """
    try:
        return _compile_question(ctypes.string_at(question, length))
    except KeyboardInterrupt:
        return _INTERRUPTED


def _compile_question(question: bytes) -> int:
    """Address of the native code of a separately compiled function, from the cache on disk or compiled now."""
    module, name, args = pickle.loads(question)
    function = getattr(importlib.import_module(module), name)
    kernel = function.kernel
    kernel.compile(args)
    compiled = kernel.overloads[args]
    if types.unliteral(compiled.signature.return_type) != function.returns:
        raise TypeError(f"{module}.{name} returns {compiled.signature.return_type}, not {function.returns}")
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))


llvm.add_symbol(_RESOLVER, ctypes.cast(_address, ctypes.c_void_p).value)
