"""Compiled loops of the gates: a few numbers a joint, where a call on an array costs too much.

Memory is allocated only where a window is rough enough to be compared with earlier ones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

_compiled: Callable[[Any], Any] = njit(cache=True, error_model='numpy')

_ROUNDING = 1e-12
"""Distance from a polynomial, over the size of the signal, that is rounding."""
NOTHING = np.zeros(0)
"""Stands for what a state does not hold."""


@_compiled
def fill_roughness(
    signal: np.ndarray, followed: np.ndarray, others: np.ndarray, first: int, found: np.ndarray
) -> None:
    """Write how far a sample is from the polynomial of the others, and how far they move.

    Without a sample the polynomial would miss it by its distance over the share of the others in
    what follows it (the deleted residual, Allen 1974).

    Args:
        signal: (m, k).
        followed: by the polynomial, (m, k).
        others: share of the other samples in each smoothed value, (m,), above 0.
        first: column of `found` for the first signal.
        found: (2, s), of which k columns are written.
    """
    m, k = signal.shape
    for j in range(k):
        high = low = signal[0, j]
        for i in range(1, m):
            high, low = max(high, signal[i, j]), min(low, signal[i, j])
        least = _ROUNDING * max(abs(high), abs(low))
        largest = 0.0
        for i in range(m):
            distance = abs(signal[i, j] - followed[i, j])
            if distance > least:
                largest = max(largest, distance / others[i])
        found[0, first + j] = largest
        found[1, first + j] = high - low


@_compiled
def is_far_off(
    roughness: np.ndarray, usual: np.ndarray, known: np.ndarray, limits: tuple[float, float, int]
) -> bool:
    """Return whether a sample of a window is farther off than is usual, and than signals move.

    Args:
        roughness: (2, s) distances and ranges, as of `fill_roughness`.
        usual: (s, u) distances of the last windows.
        known: how many were kept so far, (s,).
        limits: multiples of the range and of the median distance, and how many that takes.
    """
    share, rough, least = limits
    for s in range(len(known)):
        distance, span = roughness[0, s], roughness[1, s]
        if (
            distance > share * span > 0.0
            and known[s] >= least
            and distance > rough * np.median(usual[s, : known[s]])
        ):
            return True
    return False


@_compiled
def keep_distances(roughness: np.ndarray, usual: np.ndarray, known: np.ndarray) -> None:
    """Keep the distances of a window in place of the oldest ones; 0 tells nothing, as of rest."""
    size = usual.shape[1]
    for s in range(len(known)):
        if roughness[0, s] > 0.0:
            usual[s, known[s] % size] = roughness[0, s]
            known[s] += 1


@_compiled
def is_beyond(
    errors: np.ndarray, variance: np.ndarray, held: np.ndarray, mean_square: np.ndarray,
    n: np.ndarray, limits: tuple[float, int],
) -> bool:  # fmt: skip
    """Return whether an error (k,) is beyond so many deviations.

    Args:
        errors: of the joints.
        variance: that is expected of them, (k,).
        held: joints whose errors tell nothing, (k,).
        mean_square: of the errors so far, (k,).
        n: how many these are, (k,).
        limits: deviations, and how many errors that takes.
    """
    largest, first = limits
    for j in range(len(errors)):
        if not held[j] and n[j] >= first:
            expected = max(variance[j], mean_square[j])
            if abs(errors[j]) > largest * np.sqrt(expected):
                return True
    return False


@_compiled
def take_errors(
    errors: np.ndarray, held: np.ndarray, mean_square: np.ndarray, n: np.ndarray, memory: int
) -> None:
    """Let errors (k,) enter their fading mean squares (k,), but for those of held joints."""
    for j in range(len(errors)):
        if not held[j]:
            n[j] += 1
            mean_square[j] += (errors[j] * errors[j] - mean_square[j]) / min(n[j], memory)


@_compiled
def is_within(
    position: np.ndarray, velocity: np.ndarray, effort: np.ndarray, bounds: np.ndarray
) -> bool:
    """Return whether a state is within its bounds.

    Args:
        position: (k,).
        velocity: (k,), or (0,) where there is none.
        effort: (k,), or (0,) where there is none.
        bounds: (4, k) least and greatest position, greatest speed and effort.
    """
    found = True
    for j in range(len(position)):
        found &= bounds[0, j] <= position[j] <= bounds[1, j]
    for j in range(len(velocity)):
        found &= abs(velocity[j]) <= bounds[2, j]
    for j in range(len(effort)):
        found &= abs(effort[j]) <= bounds[3, j]
    return found
