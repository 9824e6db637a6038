"""Compilation of the small functions that run at every control tick.

Numba compiles a function at its first call and keeps the machine code on disk
beside the source (or in the user's cache folder where that cannot be written).
With ``BALLSIM_NO_COMPILE=1`` in the environment the same functions run as plain
Python over NumPy: slow, but open to a debugger.
"""

from __future__ import annotations

import functools
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

__all__ = ["IS_COMPILED", "compiled"]

F = TypeVar("F", bound=Callable[..., object])

#: False where the environment asks for plain Python.
IS_COMPILED = not os.environ.get("BALLSIM_NO_COMPILE")


def compiled(function: F) -> F:
    """Compile a function to machine code (decorator).

    Such a function takes numbers, arrays and records, indexes records by the
    names of their fields, and calls only its like. Floating point is strict:
    nothing is reordered, and a division by zero gives what NumPy gives. To hand
    an array over to Python costs as much as some of these functions do: what is
    called at every tick writes into arrays that it is given.

    Args:
        function: The function.

    Returns:
        What is called in its place.
    """
    if not IS_COMPILED:
        return function
    import numba  # noqa: PLC0415 - not needed where nothing is compiled

    result = numba.njit(cache=True, error_model="numpy")(function)
    # Numba looks at the file of the function alone, though its code holds that of
    # the functions that it calls: the stamp is to be that of all their sources.
    cache: Any = result._cache  # type: ignore[attr-defined]
    cache._cache_file._source_stamp = _source_stamp()
    return cast(F, result)


@functools.cache
def _source_stamp() -> str:
    """Return a digest of all sources of the package."""
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()
