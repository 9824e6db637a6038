"""Columns of numbers for rerun, made without the conversions of its archetypes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import rerun as rr

from ballsim_controllers.messages import Array

__all__ = [
    "make_outlines",
    "make_scalars",
    "make_strips",
    "make_texts",
    "make_vectors",
]

_SCALARS = rr.Scalars.descriptor_scalars()


def make_scalars(values: Array) -> list[rr.ComponentColumn]:
    """Return the columns of several scalars, as of `rerun.Scalars`.

    The archetype holds doubles; the viewer draws single precision as well, which
    takes half the room.

    Args:
        values: Shape (n_rows, n_scalars).
    """
    flat = pa.array(np.ascontiguousarray(values, dtype=np.float32).ravel())
    return [_Column(_SCALARS, flat, _even_offsets(*values.shape))]


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
    array = pa.FixedSizeListArray.from_arrays(flat, type=_vector(n_components))
    if counts is None:
        offsets = _even_offsets(*vectors.shape[:2])
    else:
        offsets = pa.array(np.concatenate([[0], np.cumsum(counts)]), pa.int32())
    return _Column(descriptor, array, offsets)


def make_strips(
    descriptor: rr.ComponentDescriptor,
    strips: Sequence[Array],
    counts: npt.NDArray[np.integer] | None = None,
) -> rr.ComponentColumn:
    """Return a column of line strips.

    Args:
        descriptor: What they are.
        strips: The strips, each of shape (n_points, 2 or 3).
        counts: How many are in each row, one if None.
    """
    n_components = strips[0].shape[-1] if strips else 2
    lengths = [len(strip) for strip in strips]
    points = np.concatenate([*strips, np.empty((0, n_components))]).astype(np.float32)
    vectors = pa.FixedSizeListArray.from_arrays(
        points.ravel(), type=_vector(n_components)
    )
    bounds = pa.array(np.concatenate([[0], np.cumsum(lengths)]), pa.int32())
    field = pa.field("item", _vector(n_components), nullable=False)
    array = pa.ListArray.from_arrays(bounds, vectors, type=pa.list_(field))
    if counts is None:
        offsets = _even_offsets(len(strips), 1)
    else:
        offsets = pa.array(np.concatenate([[0], np.cumsum(counts)]), pa.int32())
    return _Column(descriptor, array, offsets)


def make_outlines(
    descriptor: rr.ComponentDescriptor, outlines: Array, counts: npt.NDArray[np.integer]
) -> rr.ComponentColumn:
    """Return a column of line strips that are all of the same length.

    Args:
        descriptor: What they are.
        outlines: All of them one after the other, shape (n, n_points, 2 or 3).
        counts: How many are in each row.
    """
    n, n_points, n_components = outlines.shape
    flat = np.ascontiguousarray(outlines, dtype=np.float32).ravel()
    vectors = pa.FixedSizeListArray.from_arrays(flat, type=_vector(n_components))
    field = pa.field("item", _vector(n_components), nullable=False)
    array = pa.ListArray.from_arrays(
        _even_offsets(n, n_points), vectors, type=pa.list_(field)
    )
    offsets = pa.array(np.concatenate([[0], np.cumsum(counts)]), pa.int32())
    return _Column(descriptor, array, offsets)


def make_texts(
    descriptor: rr.ComponentDescriptor, texts: Sequence[str]
) -> rr.ComponentColumn:
    """Return a column of texts, one in each row.

    Args:
        descriptor: What they are.
        texts: The texts.
    """
    array = pa.array(texts, pa.string())
    return _Column(descriptor, array, _even_offsets(len(texts), 1))


class _Column(rr.ComponentColumn):
    """A column whose components are an Arrow array already."""

    def __init__(
        self,
        descriptor: rr.ComponentDescriptor,
        components: pa.Array,
        offsets: pa.Array,
    ) -> None:
        """Partition the components: row i begins at offset i."""
        self.descriptor = descriptor
        self._rows = pa.ListArray.from_arrays(offsets, components)

    def as_arrow_array(self) -> pa.Array:
        return self._rows


@lru_cache(maxsize=64)
def _even_offsets(n_rows: int, n_each: int) -> pa.Array:
    return pa.array(np.arange(0, n_rows * n_each + 1, n_each), pa.int32())


@lru_cache(maxsize=4)
def _vector(n_components: int) -> pa.DataType:
    item = pa.field("item", pa.float32(), nullable=False)
    return pa.list_(item, n_components)
