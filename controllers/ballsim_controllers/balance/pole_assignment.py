"""State feedback by pole assignment, with a cache on disk.

python-control needs about five seconds to import, a gain a millisecond to
read. Gains are therefore kept under the user's cache directory, and python-control
is imported only when a gain is new. No gain is trusted, new or read: each must
put the eigenvalues of A - B K where they were asked for.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ballsim_controllers.errors import InvalidSettingError
from ballsim_controllers.messages import Array

__all__ = ["cache_directory", "place_poles", "pole_error"]

POLE_TOLERANCE = 1e-4
"""Largest accepted error of an eigenvalue, relative to the largest pole.

The paper's models have cond(M) of 1e5 to 1e6 and poles spread over 1 to 50, so
the last digits of the eigenvalues, not of the gain, are lost in the check: about
1e-9 for the paper's K; repeated poles lose half of the digits or more."""


def cache_directory() -> Path | None:
    """Return the directory that keeps the gains, or None without a home.

    Returns:
        ``$XDG_CACHE_HOME/ballsim/gains``, else ``~/.cache/ballsim/gains``.
    """
    base = os.environ.get("XDG_CACHE_HOME")
    if base and Path(base).is_absolute():
        return Path(base) / "ballsim" / "gains"
    try:
        return Path.home() / ".cache" / "ballsim" / "gains"
    except RuntimeError:
        return None


def pole_error(A: Array, B: Array, K: Array, poles: Sequence[complex]) -> float:
    """Return how far the eigenvalues of A - B K are from the poles.

    Args:
        A: State matrix, shape (n, n).
        B: Input matrix, shape (n, m).
        K: Feedback gain, shape (m, n).
        poles: Wanted eigenvalues, n of them, [rad/s].

    Returns:
        Largest distance between a pole and the eigenvalue matched to it, over
        the largest modulus of the poles (at least 1 rad/s).

    Examples:
        >>> A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
        >>> pole_error(A, B, np.array([[2.0, 3.0]]), [-1.0, -2.0]) < 1e-12
        True
    """
    left = list(np.linalg.eigvals(A - B @ K))
    scale, worst = max(1.0, *(abs(pole) for pole in poles)), 0.0
    for pole in sorted(poles, key=abs):
        nearest = min(range(len(left)), key=lambda i: abs(left[i] - pole))
        worst = max(worst, abs(left.pop(nearest) - pole))
    return worst / scale


def place_poles(
    A: Array, B: Array, poles: Sequence[complex], *, use_cache: bool = True
) -> Array:
    """Return the gain K that gives A - B K the wanted eigenvalues.

    With one input K is unique. With several it is not, and the choice may
    matter a lot (see `observer`). Poles that repeat more often than B has
    columns are left to Ackermann's formula, for one input only.

    Args:
        A: State matrix, shape (n, n).
        B: Input matrix, shape (n, m).
        poles: Wanted eigenvalues, n of them, closed under conjugation, [rad/s]
            for a continuous model.
        use_cache: Whether to read and write the cache on disk.

    Returns:
        K, shape (m, n).

    Raises:
        InvalidSettingError: If the poles cannot be placed, or not well enough.

    Source:
        Section III-B: "K is chosen so that A - BK is stable".

    Examples:
        >>> A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
        >>> place_poles(A, B, [-1.0, -2.0], use_cache=False).round(9).tolist()
        [[2.0, 3.0]]
    """
    wanted = np.asarray(poles, dtype=np.complex128)
    n, m = np.shape(B)
    if wanted.shape != (n,) or not np.isfinite(wanted).all():
        raise InvalidSettingError("poles", list(poles), f"{n} finite numbers")
    if not np.allclose(np.sort(wanted), np.sort(wanted.conj())):
        raise InvalidSettingError("poles", list(poles), "closed under conjugation")
    path = _cache_path(A, B, wanted) if use_cache else None
    if path is not None:
        cached = _read(path, (m, n))
        if cached is not None and pole_error(A, B, cached, poles) <= POLE_TOLERANCE:
            return cached
    K = _compute_gain(A, B, wanted)
    error = pole_error(A, B, K, poles)
    if not error <= POLE_TOLERANCE:
        raise InvalidSettingError(
            "poles",
            list(poles),
            f"poles that can be placed to {POLE_TOLERANCE:.0e} (reached: {error:.0e})",
        )
    if path is not None:
        _write(path, K)
    return K


def _compute_gain(A: Array, B: Array, poles: np.ndarray) -> Array:
    """Return the gain that python-control computes."""
    import control  # noqa: PLC0415 (takes seconds; gains are cached)

    if np.isreal(poles).all():
        poles = poles.real
    is_repeated = max(np.sum(np.isclose(poles, pole)) for pole in poles) > B.shape[1]
    try:
        place = control.acker if is_repeated else control.place
        gain = place(A, B, poles)
    except (ValueError, TypeError, IndexError, np.linalg.LinAlgError) as error:
        raise InvalidSettingError("poles", poles.tolist(), str(error)) from error
    return np.asarray(gain, dtype=np.float64).reshape(B.shape[1], B.shape[0])


def _cache_path(A: Array, B: Array, poles: np.ndarray) -> Path | None:
    """Return the file that would hold the gain of this very problem."""
    directory = cache_directory()
    if directory is None:
        return None
    digest = hashlib.sha256(f"place_poles 1 {np.shape(A)} {np.shape(B)}".encode())
    for item in (A, B):
        digest.update(np.ascontiguousarray(item, dtype=np.float64).tobytes())
    digest.update(np.sort(poles).tobytes())
    return directory / f"{digest.hexdigest()}.npy"


def _read(path: Path, shape: tuple[int, int]) -> Array | None:
    """Return the gain in a file, or None if there is none that can be used."""
    try:
        gain = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError):
        return None
    if not isinstance(gain, np.ndarray) or gain.dtype != np.float64:
        return None
    return gain if gain.shape == shape and np.isfinite(gain).all() else None


def _write(path: Path, gain: Array) -> None:
    """Write a gain so that no reader sees half of it; a failure is no error."""
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(
            dir=path.parent, suffix=".tmp", delete=False
        ) as file:
            temporary = Path(file.name)
            np.save(file, gain, allow_pickle=False)
        temporary.replace(path)
    except OSError:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
