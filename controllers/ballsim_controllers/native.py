# Numba's intrinsics take their context by themselves, which its types do not know.
# mypy: disable-error-code="attr-defined, call-arg, no-untyped-call"
"""MuJoCo's C functions and arrays, for compiled functions.

A compiled function cannot call MuJoCo's Python bindings. It gets the addresses of
C functions, of model and data, and of their arrays as integers. Whoever hands them
over keeps the objects behind them alive and in place, as `RobotModel` does.

Integers and pointers are passed alike by the calling conventions of all platforms
that MuJoCo has wheels for, so that one kind of argument serves for all.
"""

from __future__ import annotations

import ctypes
import functools
from pathlib import Path

import mujoco
import numpy as np

from ballsim_controllers.compilation import IS_COMPILED
from ballsim_controllers.messages import Array

__all__ = ["call_2", "call_3", "call_4", "find_function", "view_1d", "view_2d"]


def find_function(name: str) -> int:
    """Return the address of a function of MuJoCo's C library.

    Args:
        name: Its name, such as ``mj_kinematics``.
    """
    function = getattr(_load_library(), name)
    address = ctypes.cast(function, ctypes.c_void_p).value
    assert address is not None
    return address


@functools.cache
def _load_library() -> ctypes.CDLL:
    """Return the library that the bindings use, which is loaded already."""
    folder = Path(mujoco.__file__).parent
    (path,) = folder.glob("libmujoco*")
    return ctypes.CDLL(str(path))


def _call(function: int, *arguments: int) -> None:
    kinds = [ctypes.c_int64] * len(arguments)
    ctypes.CFUNCTYPE(None, *kinds)(int(function))(*map(int, arguments))


def call_2(function: int, first: int, second: int) -> None:
    """Call a C function with two integers or pointers that returns nothing."""
    _call(function, first, second)


def call_3(function: int, first: int, second: int, third: int) -> None:
    """Call a C function with three integers or pointers that returns nothing."""
    _call(function, first, second, third)


def call_4(function: int, first: int, second: int, third: int, fourth: int) -> None:
    """Call a C function with four integers or pointers that returns nothing."""
    _call(function, first, second, third, fourth)


def view_1d(address: int, n: int) -> Array:
    """Return the array of n numbers at an address, without a copy."""
    pointer = ctypes.cast(int(address), ctypes.POINTER(ctypes.c_double))
    return np.ctypeslib.as_array(pointer, (int(n),))


def view_2d(address: int, n: int, m: int) -> Array:
    """Return the matrix of n rows and m columns at an address, without a copy."""
    return view_1d(address, n * m).reshape(int(n), int(m))


if IS_COMPILED:
    from llvmlite import ir
    from numba import carray, types
    from numba.extending import intrinsic, overload

    def _emit_call(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        kinds = [argument.type for argument in arguments[1:]]
        kind = ir.FunctionType(ir.VoidType(), kinds)
        builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    def _signature(n: int) -> object:
        return types.void(*[types.int64] * n)

    @intrinsic
    def _call_2(context, function, a, b):  # type: ignore[no-untyped-def]
        return _signature(3), _emit_call

    @intrinsic
    def _call_3(context, function, a, b, c):  # type: ignore[no-untyped-def]
        return _signature(4), _emit_call

    @intrinsic
    def _call_4(context, function, a, b, c, d):  # type: ignore[no-untyped-def]
        return _signature(5), _emit_call

    @intrinsic
    def _pointer(context, address):  # type: ignore[no-untyped-def]
        kind = types.CPointer(types.float64)

        def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            return builder.inttoptr(arguments[0], context.get_value_type(kind))

        return kind(types.int64), emit

    @overload(call_2, inline="always")
    def _overload_call_2(function, first, second):  # type: ignore[no-untyped-def]
        return lambda function, first, second: _call_2(  # noqa: PLW0108
            function, first, second
        )

    @overload(call_3, inline="always")
    def _overload_call_3(function, first, second, third):  # type: ignore[no-untyped-def]
        return lambda function, first, second, third: _call_3(  # noqa: PLW0108
            function, first, second, third
        )

    @overload(call_4, inline="always")
    def _overload_call_4(function, first, second, third, fourth):  # type: ignore[no-untyped-def]
        return lambda function, first, second, third, fourth: _call_4(  # noqa: PLW0108
            function, first, second, third, fourth
        )

    @overload(view_1d)
    def _overload_view_1d(address, n):  # type: ignore[no-untyped-def]
        return lambda address, n: carray(_pointer(address), (n,))

    @overload(view_2d)
    def _overload_view_2d(address, n, m):  # type: ignore[no-untyped-def]
        return lambda address, n, m: carray(_pointer(address), (n, m))
