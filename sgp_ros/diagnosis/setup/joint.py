"""Numbers of several errors of a connection, searched all at once.

Errors look alike: a delay that is shorter by d, with `kd'/kp' = kd/kp + d`, moves a slow robot the
same to second order. Searched one after the other they would stop anywhere in that valley, with
intervals that hold the other numbers fixed. So the evidence is maximised over all numbers by steps
of Levenberg and Marquardt, and their covariance is the inverse of its curvature (Laplace). Of
gains it is expected that they are stated rightly to a factor, which holds them where nothing
else does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import optimize

from sgp_ros.diagnosis.criteria import GAINS_STD
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.diagnosis.setup.errors import Hypothesis
from sgp_ros.diagnosis.setup.evidence import Probe
from sgp_ros.diagnosis.setup.unknowns import Agreement

_FLAT = 1e-3
"""Curvature below which a direction changes nothing [nats per squared step]."""
_UNCHANGED = 1e-3
"""Evidence below which a number changes nothing [nats]."""
_WIDER = (1.0, 3.0, 9.0, 27.0)
"""Steps, relative to the first, at which a scale is asked whether it changes anything."""
_IMPOSSIBLE = 1e9
_SLOPE = 0.02
"""Difference from which slopes are taken [steps]."""
_ROUNDS, _POLISH = 25, 10
_TRIED = 6
"""Steps along one direction: at the top of the evidence, rounding lets none be good enough."""
_ENOUGH = 0.002
"""Gain below which a search ends [nats]."""
_STUCK = 1e6
"""Damping at which no step is of use any more [1]."""


@dataclass(frozen=True, eq=False)
class Together:
    """Several errors with their numbers, on one recording.

    Attributes:
        probe: the recording.
        hypotheses: what is wrong, in the order in which it is undone.
        numbers: of each, (m_i,) [units of the hypothesis].
        unknowns: numbers of sets of unknowns beside them, see `Probe.agreement`.
    """

    probe: Probe
    hypotheses: tuple[Hypothesis, ...]
    numbers: tuple[np.ndarray, ...]
    unknowns: tuple[int, ...] = ()

    @cached_property
    def correction(self) -> Correction:
        """Correction of all errors together."""
        correction = Correction.none(self.probe.motion.tree.size)
        for h, x in zip(self.hypotheses, self.numbers, strict=True):
            correction = h.applied(correction, x)
        return correction

    @cached_property
    def agreement(self) -> Agreement:
        """Agreement of the recording that is corrected so."""
        return self.probe.agreement(self.correction, *self.unknowns)

    @cached_property
    def evidence(self) -> float:
        """Its evidence with the prior of the gains; none where numbers are impossible [nats]."""
        pairs = zip(self.hypotheses, self.numbers, strict=True)
        is_possible = all(h.is_possible(x) for h, x in pairs if len(x))
        if not (is_possible and self.correction.keeps_limits(self.probe.motion)):
            return -np.inf
        return self.agreement.evidence - 0.5 * float(self._off @ self._off)

    @property
    def _off(self) -> np.ndarray:
        """Logarithms of the gains' factors in prior standard deviations; 0 of others, (M,)."""
        off = [np.log(x) / GAINS_STD if h.is_of_gains else np.zeros(len(x))
               for h, x in zip(self.hypotheses, self.numbers, strict=True)]  # fmt: skip
        return np.concatenate([np.zeros(0), *off])

    @property
    def _steps(self) -> np.ndarray:
        found = [h.steps_at(x) for h, x in zip(self.hypotheses, self.numbers, strict=True)]
        return np.concatenate([np.zeros(0), *found])

    def _moved(self, change: np.ndarray) -> Together:
        """Return the same with numbers that are changed by (M,), one after the other."""
        ends = np.cumsum([len(x) for x in self.numbers])[:-1]
        parts = zip(self.numbers, np.split(change, ends), strict=True)
        return replace(self, numbers=tuple(x + dx for x, dx in parts))

    def best(self) -> Together:
        """Return the errors with the numbers of the greatest evidence near these.

        Beside rotors all gains may grow together, and only without any are they fixed, so a search
        without unknowns is one of two. What the steps do not see, such as prior and volume, a
        quasi-Newton search adds.
        """
        if not len(self._steps):
            return self
        near = [replace(self, unknowns=(n,)).near() for n in {0, self.agreement.unknowns}]
        found = max((replace(f, unknowns=()) for f in near), key=lambda f: f.evidence)
        return found.polished()

    def near(self) -> Together:
        """Return the errors after steps of Levenberg and Marquardt, which follow curved valleys.

        They are taken on what is left, each joint weighed by its variance.
        """
        now, damping = self, 1e-3
        for _ in range(_ROUNDS):
            trial, damping = now._marquardt(damping)
            gain = trial.evidence - now.evidence
            now = trial
            if gain < _ENOUGH:
                break
        return now

    def _slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return what is left in its standard deviations (R,), and its slopes (R, M) per step."""
        now, steps = self.agreement, self._steps
        weight = np.sqrt(now.rows / len(now.rest) / now.share)
        left = np.concatenate([(now.rest * weight).ravel(), self._off])
        J = np.empty((len(left), len(steps)))
        for i, step in enumerate(steps):
            e = np.zeros(len(steps))
            e[i] = _SLOPE * step
            there = self._moved(e)
            moved = np.concatenate([(there.agreement.rest * weight).ravel(), there._off])  # noqa: SLF001 - its own
            J[:, i] = (moved - left) / _SLOPE
        return left, J

    def _marquardt(self, damping: float) -> tuple[Together, float]:
        """Return the errors after one step, and the damping of the next one."""
        left, J = self._slopes()
        A, g = J.T @ J, J.T @ left
        size = np.diag(np.diag(A) + _FLAT)
        while damping < _STUCK:
            trial = self._moved(-self._steps * np.linalg.solve(A + damping * size, g))
            if trial.evidence > self.evidence:
                return trial, max(0.1 * damping, 1e-9)
            damping *= 10.0
        return self, damping

    def polished(self) -> Together:
        """Return the errors after a quasi-Newton search."""
        steps = self._steps

        def missing(y: np.ndarray) -> float:
            evidence = self._moved(steps * y).evidence
            return -evidence if np.isfinite(evidence) else _IMPOSSIBLE

        found = optimize.minimize(
            missing, np.zeros(len(steps)), method='L-BFGS-B',
            options={'eps': _SLOPE, 'gtol': _SLOPE, 'maxiter': _POLISH, 'maxls': _TRIED},
        )  # fmt: skip
        moved = self._moved(steps * found.x)
        moved = moved if moved.evidence > self.evidence else self
        parts = zip(moved.hypotheses, moved.numbers, strict=True)
        return replace(moved, numbers=tuple(h.canonical(x) for h, x in parts))

    def std(self) -> tuple[np.ndarray, ...]:
        """Return the standard deviations of all numbers, with all others free."""
        fixed = replace(self, unknowns=(self.agreement.unknowns,))
        _, J = fixed._slopes()  # noqa: SLF001 - its own
        values, vectors = np.linalg.eigh(J.T @ J)
        variance = (vectors**2 / np.maximum(values, _FLAT)).sum(axis=1)
        ends = np.cumsum([len(x) for x in self.numbers])[:-1]
        return tuple(np.split(np.abs(self._steps) * np.sqrt(variance), ends))


def value_of(
    probe: Probe, base: Correction, h: Hypothesis, x: np.ndarray, *unknowns: int
) -> float:
    """Return the evidence of a hypothesis with its numbers x on top of a correction [nats].

    Beside sets of unknowns, see `Probe.agreement`.
    """
    correction = h.applied(base, x)
    if not (h.is_possible(x) and correction.keeps_limits(probe.motion)):
        return -np.inf
    return probe.agreement(correction, *unknowns).evidence


def spread(probe: Probe, base: Correction, h: Hypothesis, x: np.ndarray) -> np.ndarray:
    """Return the standard deviations of numbers from the curvature of the evidence, (m,)."""
    std = np.full(len(x), np.inf)
    centre = value_of(probe, base, h, x)
    for i, step in enumerate(h.steps_at(x)):
        for wider in _WIDER if h.exact else (1.0,):  # bodies may make up for most of a scale
            e = np.zeros(len(x))
            e[i] = 0.3 * wider * step
            bend = 2.0 * centre - value_of(probe, base, h, x - e) - value_of(probe, base, h, x + e)
            if bend > _UNCHANGED:
                std[i] = e[i] / np.sqrt(bend)
                break
    return std
