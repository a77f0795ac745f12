"""Statistics of the errors of one-step predictions: scores, drift, intervals, the weight of Z.

Everything here sees an error after the prediction it belongs to. Scores and drift are of one
stream; the scales of the intervals and the weights of Z belong to the model and stay with it.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from sgp_ros.engine.results import Channel
from sgp_ros.gp.calibration import IntervalScale
from sgp_ros.gp.scores import DriftTest, RunningScore
from sgp_ros.gp.stacking import ProcessWeight

CHANNELS = ('acceleration', 'effort')


class Scoring:
    """Scores, drift, interval scales and weights of Z of k joints.

    Attributes:
        scores: of the model, channel name to one score per joint.
        baseline: scores of the physics alone on the target, one per joint.
        drift: tests of the target, one per joint.
        scales: of the intervals, channel name to one per joint.
        weights: of Z beside the physics alone, one per joint.

    Args:
        k: number of joints.
    """

    def __init__(self, k: int) -> None:
        self._k = k
        self.scales = {channel: tuple(IntervalScale() for _ in range(k)) for channel in CHANNELS}
        self.weights = tuple(ProcessWeight() for _ in range(k))
        self.begin()

    def begin(self) -> None:
        """Begin all scores anew; scales and weights stay."""
        k = self._k
        self.scores = {channel: tuple(RunningScore() for _ in range(k)) for channel in CHANNELS}
        self.baseline = tuple(RunningScore() for _ in range(k))
        self.drift = tuple(DriftTest() for _ in range(k))

    def calibrated(self, channel: str, raw: np.ndarray) -> np.ndarray:
        """Return the variances with which the 95 % intervals of a channel hold their rate, (k,).

        Args:
            channel: key of `CHANNELS`.
            raw: variances of the model, (k,); other numbers stay as they are.
        """
        return np.array([
            scale.variance(v) if 0.0 < v < math.inf else v
            for scale, v in zip(self.scales[channel], raw.tolist(), strict=True)
        ])  # fmt: skip

    def take(
        self, channel: str, values: Channel, is_informed: np.ndarray, *, adapts: bool
    ) -> None:
        """Score the joints whose variance is known; their scales follow if `adapts`.

        Args:
            channel: key of `CHANNELS`.
            values: measured and predicted.
            is_informed: whether the equation holds information on each joint.
            adapts: whether the intervals learn from these errors.
        """
        for j in np.flatnonzero(is_informed):
            y, mean, variance, raw = (
                float(x[j])
                for x in (values.measured, values.mean, values.variance, values.raw_variance)
            )
            if not (math.isfinite(variance) and variance > 0.0 and raw > 0.0):
                continue
            self.scores[channel][j].add(y, mean, variance, raw)
            if adapts:
                self.scales[channel][j].add(y - mean, raw)

    def take_target(self, values: Channel, is_informed: np.ndarray) -> None:
        """Test the errors of the target for drift, beside what the model itself expects."""
        errors = (values.measured - values.mean) / np.sqrt(values.raw_variance)
        for j in np.flatnonzero(is_informed):
            self.drift[j].add(float(errors[j]))

    def take_baseline(
        self, y: np.ndarray, mean: np.ndarray, variance: np.ndarray, is_informed: np.ndarray
    ) -> None:
        """Score the physics alone, (k,) each."""
        for j in np.flatnonzero(is_informed):
            self.baseline[j].add(*(float(x[j]) for x in (y, mean, variance, variance)))

    def weight(self, *, is_used: bool) -> np.ndarray:
        """Return the weight of Z for each joint, (k,); 1 where none is used."""
        return np.array([weight.value if is_used else 1.0 for weight in self.weights])

    def take_experts(
        self, model: np.ndarray, physics: np.ndarray, is_informed: np.ndarray
    ) -> None:
        """Weigh the errors (k,) with Z against those of the physics alone."""
        for j in np.flatnonzero(is_informed):
            self.weights[j].add(float(model[j]), float(physics[j]))

    def state(self) -> dict[str, Any]:
        """Return everything as plain values; `restore` takes it back."""
        return {
            'scores': {c: [asdict(s) for s in scores] for c, scores in self.scores.items()},
            'scales': {c: [asdict(s) for s in scales] for c, scales in self.scales.items()},
            'weights': [asdict(weight) for weight in self.weights],
            'drift': [asdict(test) for test in self.drift],
            'baseline': [asdict(score) for score in self.baseline],
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue exactly where `state` was taken."""
        self.scores = {
            c: tuple(RunningScore(**score) for score in scores)
            for c, scores in state['scores'].items()
        }
        self.scales = {
            c: tuple(IntervalScale(**scale) for scale in scales)
            for c, scales in state['scales'].items()
        }
        self.weights = tuple(ProcessWeight(**weight) for weight in state['weights'])
        self.drift = tuple(DriftTest(**test) for test in state['drift'])
        self.baseline = tuple(RunningScore(**score) for score in state['baseline'])
