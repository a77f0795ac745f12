"""Refuses equations that neither the signals nor the model make possible, unless they persist.

Two tests, each with room for what real streams do:

* **Signals.** A sample far off the polynomial that follows the others of its window: by more than
  `ROUGH` times what is usual in this stream, and by more than `SHARE` of all that moves in the
  window, which no impact and no reversal of a real motion comes near.
* **Innovations.** An error larger than `LARGEST` deviations, where a deviation is the larger one
  of what the model expects and of the root mean square of the errors so far. By Chebyshev's
  inequality errors whose mean square stays the same exceed it at most once in `LARGEST^2` = 400
  samples, whatever their distribution; what simulated streams do is measured by
  `sgp_proof.robustness.gates`.

A robot may change: once half of the last `PATIENCE` times hold a refusal, equations are learned
again. What was learned before is kept beside the new model and predicts with it. If it becomes the
better one, by `EVIDENCE` nats, what came in between was no robot, and it takes its place again.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from sgp_ros.engine.gate_loops import is_beyond, is_far_off, keep_distances, take_errors
from sgp_ros.engine.windows import Equation
from sgp_ros.gp.regression import Regression

ROUGH, SHARE = 30.0, 0.3
LARGEST = 20.0
FIRST = 30
"""Errors seen before innovations are tested."""
MEMORY = 200
"""Errors over which their mean square fades."""
PATIENCE = 40
TIME_S = 0.05
"""Refusals within this time, or within a quarter of a longer window, count as one."""
EVIDENCE = 20.0
COMPARED = 20
"""Equations on which the model before and the one that went on are compared."""
FAR, _RUN = 50.0, 4
_USUAL = 31
_LEAST_USUAL = 5
_ROUGHNESS = SHARE, ROUGH, _LEAST_USUAL
T = TypeVar('T')


class Gate:
    """The tests of k joints, and how often they refused of late.

    Attributes:
        n, mean_square: errors seen, and the fading mean of their squares, by joint, (k,).
        usual: largest distances from the polynomial in the last windows, of the positions of the
            joints, then of measured velocities, (2 k, u); the oldest one is replaced.
        known: how many of these were kept so far, (2 k,).
        recent: whether there was a refusal, of the last `PATIENCE` times.
        time: of the last of these, a number of steps.

    Args:
        k: number of joints.
    """

    def __init__(self, k: int) -> None:
        self.n = np.zeros(k, dtype=np.int64)
        self.mean_square = np.zeros(k)
        self.usual = np.zeros((2 * k, _USUAL))
        self.known = np.zeros(2 * k, dtype=np.int64)
        self.recent: list[bool] = []
        self.time = 0

    @property
    def is_patient(self) -> bool:
        """Whether refusals are still the exception."""
        return 2 * sum(self.recent) <= PATIENCE

    def is_rough(self, equation: Equation) -> bool:
        """Whether a sample of the window is far off the others; otherwise the window is usual."""
        found = equation.roughness
        is_rough: bool = is_far_off(found, self.usual, self.known, _ROUGHNESS)
        if not is_rough or not self.is_patient:
            keep_distances(found, self.usual, self.known)
        return is_rough

    def is_surprised(self, errors: np.ndarray, variance: np.ndarray, held: np.ndarray) -> bool:
        """Whether an error (k,) is beyond all that the model, or those before it, let expect.

        Args:
            errors: of the joints.
            variance: that the model expects of them, (k,).
            held: joints on which the equation holds no information, (k,).
        """
        found: bool = is_beyond(errors, variance, held, self.mean_square, self.n, (LARGEST, FIRST))
        return found

    def judge(self, equation: Equation, *, is_wrong: bool) -> bool:
        """Note whether an equation is implausible; return whether it is refused."""
        step_ns = round(1e9 * max(TIME_S, 0.25 * equation.span_s))
        time = equation.stamp_ns // step_ns
        if time == self.time and self.recent:
            self.recent[-1] |= is_wrong
        else:
            self.recent = [*self.recent, is_wrong][-PATIENCE:]
            self.time = time
        return is_wrong and self.is_patient

    def take(self, errors: np.ndarray, held: np.ndarray) -> None:
        """Take the errors (k,) of an equation that is learned, but for those of held joints."""
        take_errors(errors, held, self.mean_square, self.n, MEMORY)

    def state(self) -> dict[str, Any]:
        """Return everything as plain values; `restore` takes it back."""
        usual = [
            np.roll(distances[:known], -known).tolist()
            for distances, known in zip(self.usual, self.known.tolist(), strict=True)
        ]
        return {
            'n': self.n.tolist(), 'mean_square': self.mean_square.tolist(),
            'recent': list(self.recent), 'usual': usual, 'time': self.time,
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue exactly where `state` was taken."""
        self.n, self.mean_square = np.array(state['n']), np.array(state['mean_square'])
        self.recent, self.time = list(state['recent']), state['time']
        for s, distances in enumerate(state['usual']):
            self.usual[s, : len(distances)], self.known[s] = distances, len(distances)


@dataclass(slots=True)
class Before:
    """Copy of the model from before persistent equations were implausible to it.

    Attributes:
        regression, baseline: as `Estimator` has them.
        gate: state of the gate at that time.
        left: equations for which it is still kept.
        errors: sizes of the last errors of the model that went on, and of this one, (m, 2, k).
    """

    regression: Regression
    baseline: Regression | None
    gate: Gate
    left: int
    errors: list[list[list[float]]]

    @classmethod
    def of(cls, regression: Regression, baseline: Regression | None, gate: Gate) -> Before:
        """Return a copy of what was learned so far."""
        kept = copy.deepcopy((regression, baseline, gate))
        kept[2].recent = []
        return cls(*kept, left=regression.memory.budget, errors=[])

    def is_better(
        self,
        errors: np.ndarray,
        equation: tuple[np.ndarray, np.ndarray, np.ndarray],
        held: np.ndarray,
    ) -> bool:
        """Compare with the model that went on, whose errors (k,) are given.

        With errors of unknown size the likelihoods of n of each are in the ratio `(s_other /
        s_own)^n`. Medians stand for the sizes s: errors on garbage are of any size for both.

        Args:
            errors: of that model.
            equation: input (d,), regressor (k, p) and target (k,).
            held: joints on which the equation holds no information, (k,).
        """
        u, f, y = equation
        own = y - self.regression.predict(u, f).mean
        self.left -= 1
        if not held.any():
            self.errors = [*self.errors, np.abs([errors, own]).tolist()][-COMPARED:]
        if len(self.errors) < COMPARED:
            return False
        sizes = np.median(self.errors, axis=0)
        with np.errstate(divide='ignore', invalid='ignore'):
            evidence = COMPARED * np.log(sizes[0] / sizes[1]).sum()
        return bool(evidence > EVIDENCE)


def without_isolated(rows: Sequence[T], values: Sequence[np.ndarray]) -> list[T]:
    """Return the first equations without those that lie far off and are followed by others.

    Far off is more than `FAR` median distances from the median. A motion that begins is far off
    too, but goes on; up to `_RUN` rows are one wrong sample.

    Args:
        rows: of equations.
        values: (c,) of each, by which they are judged.
    """
    if not rows:
        return []
    distance = np.abs(np.array(values) - np.median(values, axis=0))
    usual = np.median(distance, axis=0)
    is_far = (distance > FAR * usual)[:, usual > 0.0].any(axis=1)
    kept = np.ones(len(rows), dtype=bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_far, [False]])))
    for start, stop in edges.reshape(-1, 2):
        kept[start:stop] = stop - start > _RUN or stop == len(rows)
    return [row for row, is_kept in zip(rows, kept, strict=True) if is_kept]
