"""Weights that filter an equation of motion over one window, for stamps of any spacing.

A least-squares fit over a window gives weights `c_j` with `a = sum_j c_j q(t_j)`. The weights
annihilate any motion without acceleration, so `a = integral kappa(s) q''(s) ds` holds
exactly, with the Peano kernel `kappa(s) = sum_j c_j max(t_j - s, 0)` (from positions) or
`kappa(s) = sum_{t_j > s} c_j` (from velocities), which has unit area. Averaging every other term
of the equation with the same kernel filters the equation instead of approximating it.

Source: Peano 1913 for the kernel; Savitzky and Golay 1964 for the fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class WeakForm:
    """Weights of one window of m samples at times t.

    Attributes:
        times: (m,) [s], increasing.
        weights: (m,) `c_j`; times positions [1/s^2] or velocities [1/s] they give acceleration.
        left, right: (m - 1,) kernel at both ends of each interval, linear in between [1/s].
    """

    times: np.ndarray
    weights: np.ndarray
    left: np.ndarray
    right: np.ndarray

    @classmethod
    def from_positions(cls, times: np.ndarray) -> WeakForm:
        """Return the weights of a quadratic fit to positions at `times` (m,), m >= 3."""
        centred, half = _scaled(times)
        basis = np.linalg.pinv(np.vander(centred, 3, increasing=True))  # (3, m)
        weights = 2.0 * basis[2] / half**2
        tail = np.cumsum(weights[::-1])[::-1]
        moment = np.cumsum((weights * times)[::-1])[::-1]
        kernel = moment - times * tail  # sum over i >= j of c_i (t_i - t_j)
        kernel[0] = kernel[-1] = 0.0
        return cls(times, weights, kernel[:-1], kernel[1:])

    @classmethod
    def from_velocities(cls, times: np.ndarray) -> WeakForm:
        """Return the weights of a linear fit to velocities at `times` (m,), m >= 2."""
        centred, half = _scaled(times)
        basis = np.linalg.pinv(np.vander(centred, 2, increasing=True))  # (2, m)
        weights = basis[1] / half
        kernel = np.cumsum(weights[::-1])[::-1][1:]
        return cls(times, weights, kernel, kernel)

    @property
    def averaging(self) -> np.ndarray:
        """Weights that average a signal, linear between samples, with the kernel; (m,), sum 1."""
        steps = np.diff(self.times) / 6.0
        shares = np.zeros(len(self.times))
        shares[:-1] += steps * (2.0 * self.left + self.right)
        shares[1:] += steps * (self.left + 2.0 * self.right)
        return shares

    def cumulative(self, seconds: np.ndarray) -> np.ndarray:
        """Integrate the kernel from the first sample to `seconds` (r,) after it, (r,)."""
        steps = np.diff(self.times)
        areas = np.concatenate([[0.0], np.cumsum(0.5 * steps * (self.left + self.right))])
        since = np.clip(seconds, 0.0, self.times[-1] - self.times[0])
        offsets = self.times - self.times[0]
        index = np.clip(np.searchsorted(offsets, since, side='right') - 1, 0, len(steps) - 1)
        inside = since - offsets[index]
        slope = (self.right[index] - self.left[index]) / steps[index]
        return areas[index] + inside * (self.left[index] + 0.5 * slope * inside)

    def nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return three samples that represent all in an average of slowly changing quantities.

        Returns:
            indices (3,) and shares (3,), which average a quadratic as the kernel does.
        """
        centred, _ = _scaled(self.times)
        moments = self.averaging @ np.vander(centred, 3, increasing=True)
        spread = np.sqrt(max(3.0 * (moments[2] - moments[1] ** 2), 0.0))
        last = len(centred) - 1
        middle = min(max(_nearest(centred, moments[1]), 1), last - 1)
        before = min(_nearest(centred, moments[1] - spread), middle - 1)
        after = max(_nearest(centred, moments[1] + spread), middle + 1)
        indices = np.array([before, middle, after])
        return indices, np.linalg.solve(np.vander(centred[indices], 3, increasing=True).T, moments)


def polynomial_smoother(
    times: np.ndarray, degree: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the matrices that smooth samples at `times` (m,) and differentiate them.

    A polynomial of `degree`, or of m - 1 if that is less, is fitted by least squares.

    Returns:
        values, slopes [1/s] and curvatures [1/s^2], (m, m) each: times the samples they give the
        polynomial and its derivatives at the same times.
    """
    centred, half = _scaled(times)
    powers = np.arange(min(degree, len(times) - 1) + 1)
    basis = centred[:, None] ** powers  # (m, degree + 1)
    fit = np.linalg.pinv(basis)
    slope, curvature = np.zeros_like(basis), np.zeros_like(basis)
    slope[:, 1:] = powers[1:] * basis[:, :-1] / half
    curvature[:, 2:] = powers[2:] * (powers[2:] - 1) * basis[:, :-2] / half**2
    return basis @ fit, slope @ fit, curvature @ fit


def _nearest(times: np.ndarray, time: float) -> int:
    return int(np.argmin(np.abs(times - time)))


def _scaled(times: np.ndarray) -> tuple[np.ndarray, float]:
    half = 0.5 * float(times[-1] - times[0])
    return (times - 0.5 * (times[0] + times[-1])) / half, half
