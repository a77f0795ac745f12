"""Compiled loops that change the growing factor, in place: samples that come, go and rotate.

The factor `K = L L^T` is stored column by column: row j of U is column j of L from its diagonal
on, contiguous. A column is then all that one step of a solve or of a rotation needs, and every
element of it takes the same operations in the same order, so the loops run at the width of the
processor and give the same bits at any width, alignment or place in memory. Two or four columns
are taken at once, so that the vector they act on is read and written less often. The live part is
`U[start:stop, start:stop]`; when the oldest sample leaves, `start` moves on and nothing is copied.

Sources: Gill, Golub, Murray, Saunders 1974 (methods C1, C2); Golub and Van Loan, section 5.1.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from scipy import linalg

_compiled: Callable[[Any], Any] = njit(cache=True, error_model='numpy')


@_compiled
def _rotate_pair(
    U: np.ndarray, r: int, first: int, stop: int, start: int,
    c: float, s: float, c2: float, s2: float, carried: np.ndarray,
) -> None:  # fmt: skip
    one = np.uint64(1)
    for i in range(first, stop):
        a = U[r, i]
        b = carried[i - start]
        a2 = U[r + one, i]
        U[r, i] = c * a + s * b
        b = c * b - s * a
        U[r + one, i] = c2 * a2 + s2 * b
        carried[i - start] = c2 * b - s2 * a2


@_compiled
def _rotation(a: float, b: float) -> tuple[float, float, float]:
    """Return cosine, sine and radius of the rotation that turns (a, b) into (radius, 0)."""
    radius = np.sqrt(a * a + b * b)
    return a / radius, b / radius, radius


@_compiled
def _rotate_data(white: np.ndarray, j: int, c: float, s: float, extra: np.ndarray) -> None:
    for i in range(len(extra)):
        a = white[j, i]
        white[j, i] = c * a + s * extra[i]
        extra[i] = c * extra[i] - s * a


@_compiled
def absorb_column(
    U: np.ndarray, start: int, carried: np.ndarray, white: np.ndarray, extra: np.ndarray
) -> None:
    """Turn the factor of K into that of `K + carried carried^T`, whitened data alongside.

    The rotations that bring `[L carried]` to `[L' 0]` are applied to the rows of `[white; extra]`.
    O(n^2 + n m) operations for n = len(white), each stored number touched once.

    Args:
        U: (N, N), row j holds column j of L from its diagonal on.
        start: first live row of U.
        carried: (n,) the added column; used up.
        white: (n, m) whitened data `L^-1 [F y]`.
        extra: (m,) their row beside the added column, zero where no data belong to it. Used up.
    """
    n = len(white)
    stop = start + n
    for j in range(0, n - 1, 2):
        r = start + j
        c, s, U[r, r] = _rotation(U[r, r], carried[j])
        a, b = U[r, r + 1], carried[j + 1]
        U[r, r + 1] = c * a + s * b
        c2, s2, U[r + 1, r + 1] = _rotation(U[r + 1, r + 1], c * b - s * a)
        _rotate_pair(
            U, np.uint64(r), np.uint64(r + 2), np.uint64(stop), np.uint64(start),
            c, s, c2, s2, carried,
        )  # fmt: skip
        _rotate_data(white, j, c, s, extra)
        _rotate_data(white, j + 1, c2, s2, extra)
    if n % 2:
        c, s, U[stop - 1, stop - 1] = _rotation(U[stop - 1, stop - 1], carried[n - 1])
        _rotate_data(white, n - 1, c, s, extra)


@_compiled
def close_gap(U: np.ndarray, start: int, n: int, m: int) -> None:
    """Move samples 0..m-1 up by one place, over sample m. O(n m), nothing for the oldest."""
    for j in range(m - 1, -1, -1):
        r = start + j
        for i in range(start + m + 1, start + n):
            U[r + 1, i] = U[r, i]
        for i in range(r, start + m):
            U[r + 1, i + 1] = U[r, i]


@_compiled
def move_to_front(U: np.ndarray, start: int, n: int) -> None:
    """Move the factor of n samples from `start` to the first rows of U. O(n^2 / 2)."""
    for j in range(n):
        for i in range(j, n):
            U[j, i] = U[start + j, start + i]


@_compiled
def _copy_row(A: np.ndarray, i: int, j: int) -> None:
    for c in range(A.shape[1]):
        A[j, c] = A[i, c]


@_compiled
def append_row(
    U: np.ndarray, S: np.ndarray, white: np.ndarray, start: int, n: int,
    s: np.ndarray, v: np.ndarray, diagonal: float, row: np.ndarray,
) -> int:  # fmt: skip
    """Border the factor of n samples with one more, and return where it begins. O(n).

    Where the memory ends, everything moves to its front first. Without a process U is empty.

    Args:
        U: (N, N) factor.
        S: (N, d) scaled inputs.
        white: (N, k w) whitened data.
        start: first live row of each.
        n: samples held.
        s: (d,) scaled input.
        v: (n,) its whitened covariances.
        diagonal: element that the factor ends with.
        row: (k w,) whitened data.
    """
    if start + n == len(white):
        if len(U):
            move_to_front(U, start, n)
        for i in range(n):
            _copy_row(white, start + i, i)
            _copy_row(S, start + i, i)
        start = 0
    last = start + n
    for c in range(len(row)):
        white[last, c] = row[c]
    for c in range(len(s)):
        S[last, c] = s[c]
    if len(U):
        for i in range(n):
            U[start + i, last] = v[i]
        U[last, last] = diagonal
    return start


@_compiled
def drop_row(
    U: np.ndarray, S: np.ndarray, white: np.ndarray, start: int, n: int,
    m: int, carried: np.ndarray, row: np.ndarray,
) -> int:  # fmt: skip
    """Remove sample m of n from factor, inputs and data; return where they begin. O(n^2).

    Args:
        U: (N, N) factor.
        S: (N, d) scaled inputs.
        white: (N, k w) whitened data.
        start: first live row of each.
        n: samples held.
        m: which of them.
        carried: (n,) at least, for the column that is carried through the rotations.
        row: (k w,), for the data that are.
    """
    rest = n - 1 - m
    if len(U):
        for c in range(len(row)):
            row[c] = white[start + m, c]
        for i in range(rest):
            carried[i] = U[start + m, start + m + 1 + i]
        absorb_column(U, start + m + 1, carried[:rest], white[start + m + 1 : start + n], row)
    if not rest:
        return start
    if m and len(U):
        close_gap(U, start, n, m)
    for j in range(start + m - 1, start - 1, -1):
        _copy_row(white, j, j + 1)
        _copy_row(S, j, j + 1)
    return start + 1


@_compiled
def _take_sums(U: np.ndarray, r: int, first: int, n: int, start: int, x: np.ndarray) -> None:
    # Unsigned indices, as a signed one might count from the end.
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    i = r - start
    s0, s1, s2, s3 = x[i], x[i + one], x[i + two], x[i + three]
    for j in range(first, n):
        c = start + j
        s0 -= U[r, c] * x[j]
        s1 -= U[r + one, c] * x[j]
        s2 -= U[r + two, c] * x[j]
        s3 -= U[r + three, c] * x[j]
    x[i], x[i + one], x[i + two], x[i + three] = s0, s1, s2, s3


@_compiled
def substitute_back(U: np.ndarray, start: int, x: np.ndarray) -> None:
    """Replace x (n,) by L^-T x for the factor that begins at `start`. O(n^2 / 2).

    Four independent sums at once.
    """
    n = len(x)
    rest = n % 4
    for i in range(n - 4, rest - 1, -4):
        _take_sums(U, np.uint64(start + i), np.uint64(i + 4), np.uint64(n), np.uint64(start), x)
        for a in range(i + 3, i - 1, -1):
            for j in range(a + 1, i + 4):
                x[a] -= U[start + a, start + j] * x[j]
            x[a] /= U[start + a, start + a]
    for a in range(rest - 1, -1, -1):
        for j in range(a + 1, n):
            x[a] -= U[start + a, start + j] * x[j]
        x[a] /= U[start + a, start + a]


def absorbed_column_numpy(
    L: np.ndarray, carried: np.ndarray, white: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the factor (n, n) and whitened data (n, m) of `absorb_column`, from scratch."""
    factor = linalg.cholesky(L @ L.T + np.outer(carried, carried), lower=True)
    return factor, linalg.solve_triangular(factor, L @ white, lower=True)


def dropped_sample_numpy(
    L: np.ndarray, white: np.ndarray, m: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the factor (n-1, n-1) and whitened data (n-1, c) without sample m, from scratch."""
    rest = np.delete(np.arange(len(L)), m)
    K, data = L @ L.T, L @ white
    factor = np.linalg.cholesky(K[np.ix_(rest, rest)])
    return factor, np.linalg.solve(factor, data[rest])
