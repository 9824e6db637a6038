"""Messages through a pipe: pickled, arrays beside the pickle and without a copy."""

from __future__ import annotations

import os
import pickle
import struct
from typing import Any

__all__ = ["read_frame", "unpack_frame", "write_frame"]

_HEAD = struct.Struct("<QQ")  # parts, bytes of them all with what fills them up
_ALIGNMENT = 8  # of each part: numbers are read in place


def write_frame(descriptor: int, message: Any) -> None:
    """Write a message; wait while the pipe is full.

    Args:
        descriptor: The pipe's end to write to.
        message: What can be pickled; its arrays must be contiguous.

    Raises:
        BrokenPipeError: Nobody reads any more.
    """
    arrays: list[pickle.PickleBuffer] = []
    text = pickle.dumps(message, protocol=5, buffer_callback=arrays.append)
    parts = [memoryview(text), *(array.raw() for array in arrays)]
    sizes = [part.nbytes for part in parts]
    head = _HEAD.pack(len(parts), sum(map(_fill_up, sizes)))
    rest = [memoryview(head + struct.pack(f"<{len(sizes)}Q", *sizes))]
    for part, size in zip(parts, sizes, strict=True):
        rest += [part, memoryview(bytes(_fill_up(size) - size))]
    while rest:
        n_written = os.writev(descriptor, rest)
        while rest and n_written >= rest[0].nbytes:
            n_written -= rest.pop(0).nbytes
        if rest:
            rest[0] = rest[0][n_written:]


def read_frame(descriptor: int) -> list[memoryview]:
    """Read a message; wait until there is one.

    It is read at once: each call of the system gives up the interpreter's lock, and
    to get it back takes its time beside a thread that computes.

    Args:
        descriptor: The pipe's end to read from.

    Returns:
        What `unpack_frame` makes the message of.

    Raises:
        EOFError: There is no further one: the writer has gone, perhaps amid it.
    """
    n_parts, n_bytes = _HEAD.unpack(_read(descriptor, _HEAD.size))
    content = _read(descriptor, 8 * n_parts + n_bytes)
    parts, start = [], 8 * n_parts
    for size in struct.unpack_from(f"<{n_parts}Q", content):
        parts.append(content[start : start + size])
        start += _fill_up(size)
    return parts


def unpack_frame(parts: list[memoryview]) -> Any:
    """Return the message of a frame; its arrays can be written to."""
    return pickle.loads(parts[0], buffers=parts[1:])


def _fill_up(size: int) -> int:
    return -(-size // _ALIGNMENT) * _ALIGNMENT


def _read(descriptor: int, size: int) -> memoryview:
    content = memoryview(bytearray(size))
    rest = content
    while rest:
        n_read = os.readv(descriptor, [rest])
        if n_read == 0:
            raise EOFError
        rest = rest[n_read:]
    return content
