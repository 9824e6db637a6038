"""Columns of numbers for rerun, made without the conversions of its archetypes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import rerun as rr

from ballsim_controllers.messages import Array

__all__ = ["make_scalars", "make_vectors"]

_Offsets = npt.NDArray[np.int32]


def make_scalars(values: Array) -> list[rr.ComponentColumn]:
    """Return the columns of several scalars, as of `rerun.Scalars`.

    Args:
        values: Shape (n_rows, n_scalars).
    """
    batch = _Batch(pa.array(np.ascontiguousarray(values).ravel()))
    offsets = _even_offsets(*values.shape)
    descriptor = rr.Scalars.descriptor_scalars()
    return [rr.ComponentColumn(descriptor, batch, offsets=offsets)]


def make_vectors(
    descriptor: rr.ComponentDescriptor,
    vectors: npt.NDArray[np.floating],
    counts: npt.NDArray[np.integer] | None = None,
) -> rr.ComponentColumn:
    """Return a column of vectors: positions, quaternions and the like.

    Args:
        descriptor: What they are.
        vectors: Shape (n_rows, n, 3 or 4), n in each row; or all of them one after
            the other, shape (sum of the counts, 3 or 4).
        counts: How many are in each row, if that differs.
    """
    n_components = vectors.shape[-1]
    flat = np.ascontiguousarray(vectors, dtype=np.float32).ravel()
    batch = _Batch(pa.FixedSizeListArray.from_arrays(flat, type=_vector(n_components)))
    if counts is None:
        offsets = _even_offsets(*vectors.shape[:2])
    else:
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    return rr.ComponentColumn(descriptor, batch, offsets=offsets)


@dataclass(frozen=True, slots=True)
class _Batch:
    """Components that are an Arrow array already."""

    array: pa.Array

    def as_arrow_array(self) -> pa.Array:
        return self.array


@lru_cache(maxsize=64)
def _even_offsets(n_rows: int, n_each: int) -> _Offsets:
    return np.arange(0, n_rows * n_each + 1, n_each, dtype=np.int32)


@lru_cache(maxsize=4)
def _vector(n_components: int) -> pa.DataType:
    item = pa.field("item", pa.float32(), nullable=False)
    return pa.list_(item, n_components)
