"""Rows of a run that wait on disk for its end, and the archives they end in."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

__all__ = ["Spool", "write_array"]

_ROWS_AT_ONCE = 1000


class Spool:
    """Rows on disk, in a file without a name: a crash leaves nothing behind.

    Args:
        folder: Folder of the file.
        shape: Shape of a row.
        dtype: Type of its elements.
    """

    def __init__(
        self, folder: Path, shape: tuple[int, ...], dtype: npt.DTypeLike = np.float64
    ) -> None:
        """Open the file."""
        self._file: IO[bytes] = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115
        self.shape, self.dtype, self.n_rows = shape, np.dtype(dtype), 0

    def append(self, rows: npt.NDArray[Any]) -> None:
        """Add rows, shape (n, *shape)."""
        content = np.ascontiguousarray(rows, dtype=self.dtype)
        self._file.write(content.view(np.uint8).data)
        self.n_rows += len(rows)

    def read(self) -> Iterator[npt.NDArray[Any]]:
        """Yield all rows, some at once."""
        self._file.seek(0)
        size = _ROWS_AT_ONCE * int(np.prod(self.shape)) * self.dtype.itemsize
        while content := self._file.read(size):
            yield np.frombuffer(content, self.dtype).reshape(-1, *self.shape)

    def close(self) -> None:
        """Drop the rows."""
        self._file.close()


def write_array(
    archive: zipfile.ZipFile,
    name: str,
    shape: tuple[int, ...],
    parts: Iterator[npt.NDArray[Any]],
    dtype: npt.DTypeLike = np.float64,
) -> None:
    """Write an array into an archive, part by part along its first axis.

    Args:
        archive: Open for writing.
        name: Name of the array.
        shape: Its shape.
        parts: Its rows.
        dtype: Type of its elements.
    """
    header: dict[str, Any] = {
        "descr": np.lib.format.dtype_to_descr(np.dtype(dtype)),
        "fortran_order": False,
        "shape": shape,
    }
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array_header_1_0(member, header)
        for part in parts:
            member.write(np.ascontiguousarray(part).data)
