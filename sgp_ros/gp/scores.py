"""Scores of probabilistic predictions: nMSE, NLPD, coverage."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import special

INTERVAL_95 = float(special.ndtri(0.975))
"""Half width of the central 95 % interval of a standard normal variable."""


def nmse(y: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Mean squared error over the variance of the target, (k,) for y and mean (n, k)."""
    return np.mean((y - mean) ** 2, axis=0) / np.var(y, axis=0)


def nlpd(y: np.ndarray, mean: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Mean negative log predictive density [nat], (k,) for arrays (n, k)."""
    terms = np.log(2.0 * np.pi * variance) + (y - mean) ** 2 / variance
    return 0.5 * np.mean(terms, axis=0)


def coverage95(y: np.ndarray, mean: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Share of targets inside the central 95 % interval, (k,) for arrays (n, k)."""
    inside = np.abs(y - mean) <= INTERVAL_95 * np.sqrt(variance)
    return np.mean(inside, axis=0)


def pit(y: np.ndarray, mean: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Probability integral transform of each target, (n, k); uniform when calibrated."""
    return special.ndtr((y - mean) / np.sqrt(variance))


@dataclass(slots=True)
class RunningScore:
    """Scores of one channel, one sample at a time, O(1) memory.

    Mean and variance of the target by Welford's recursion (1962).
    """

    n: int = 0
    squared_error: float = 0.0
    log_loss: float = 0.0
    inside: int = 0
    target_mean: float = 0.0
    target_squares: float = 0.0

    def add(self, y: float, mean: float, variance: float) -> None:
        """Score one prediction of variance > 0 against its target."""
        self.n += 1
        error = y - mean
        self.squared_error += error * error
        self.log_loss += 0.5 * (math.log(2.0 * math.pi * variance) + error * error / variance)
        self.inside += abs(error) <= INTERVAL_95 * math.sqrt(variance)
        step = y - self.target_mean
        self.target_mean += step / self.n
        self.target_squares += step * (y - self.target_mean)

    @property
    def nmse(self) -> float:
        """Mean squared error over the variance of the target; NaN for a constant target."""
        return self.squared_error / self.target_squares if self.target_squares > 0.0 else math.nan

    @property
    def nlpd(self) -> float:
        """Mean negative log predictive density [nat]; NaN without samples."""
        return self.log_loss / self.n if self.n else math.nan

    @property
    def coverage95(self) -> float:
        """Share of targets inside the 95 % interval; NaN without samples."""
        return self.inside / self.n if self.n else math.nan
