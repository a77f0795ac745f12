"""Predicts the other side of the equation of motion from the measured target.

For a robot whose target is the effort this is the acceleration, for the other ones the effort.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.prediction import solve_complement, update_complement, weighted
from sgp_ros.engine.prior_knowledge import complement_columns
from sgp_ros.engine.results import Channel
from sgp_ros.engine.windows import Equation
from sgp_ros.gp.autoregression import Autoregression
from sgp_ros.gp.regression import OnlinePrediction, Regression
from sgp_ros.robots.robot import Robot

Expert = tuple[Regression, OnlinePrediction]
"""A model and what it predicted for the measured complement."""


class Complement:
    """Complement signals of one robot: predicted from their own past, then from the target.

    Attributes:
        signals: prior of the next values of the signals that the robot has.
        last_ns: stamp of the last equation [ns]; None before.
    """

    def __init__(
        self, robot: Robot, config: EngineConfig, inputs: Sequence[Sequence[int]]
    ) -> None:
        self._robot = robot
        self._columns = sorted(complement_columns(robot))
        self._is_seen = config.model_method != 'PR' and any(
            set(self._columns) & set(seen) for seen in inputs
        )
        self._is_known = config.model_method != 'GP'
        self.signals = Autoregression(len(self._columns))
        self.last_ns: int | None = None

    def begin_stream(self) -> None:
        """Keep what is known of the signals; what follows does not continue them."""
        self.signals.begin()
        self.last_ns = None

    def skip(self) -> None:
        """Have what follows not continue an equation that was refused."""
        self.signals.begin()

    def take(self, equation: Equation, hop_s: float) -> None:
        """Take the signals of an equation after they were predicted."""
        measured = self._measured(equation)[list(equation.complement_joints)]
        if self.last_ns is not None:
            passed = 1e-9 * (equation.stamp_ns - self.last_ns)
            if passed > max(2.0 * hop_s, equation.span_s):
                self.signals.begin()
        self.last_ns = equation.stamp_ns
        self.signals.add(measured)

    def predict(
        self,
        equation: Equation,
        model: Expert,
        physics: Expert | None,
        weight: np.ndarray,
        target: Channel,
    ) -> Channel:
        """Return the complement signals that explain the measured target.

        Args:
            equation: of which only the target is revealed.
            model: with Z, at the measured complement.
            physics: without; None where there is none.
            weight: of Z for each joint, (k,).
            target: measured, with both variances; S is scaled by their ratio.
        """
        measured = self._measured(equation)
        joints = list(equation.complement_joints)
        if not joints or not self._is_known:
            return Channel.unknown(measured)
        slope = model[0].information.products(equation.slopes).T  # (k, c)
        if physics is not None and np.any(weight < 1.0):
            alone = physics[0].information.products(equation.slopes).T
            slope = alone + weight[:, None] * (slope - alone)
        if not np.isfinite(target.variance).all():
            return Channel.unknown(measured)
        root = np.sqrt(target.variance / target.raw_variance)

        def predict(signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            f = equation.regressor(signal)
            seen = self._at(model, f, signal)
            other = None if physics is None else self._at(physics, f, signal)
            mean, covariance = weighted(weight, seen, other)
            return mean, covariance * np.outer(root, root)

        iterations = 2 if self._is_seen else 1
        prior = self.signals.predict()
        if prior is None:
            noise = np.array(model[0].model.noise)
            start = model[0].information.products(equation.state_rows)
            solved = solve_complement(target.measured, slope, noise, start, predict, iterations)
        else:
            solved = update_complement(prior, target.measured, slope, predict, iterations)
        if solved is None:
            return Channel.unknown(measured)
        mean, variance = np.zeros(len(measured)), np.zeros(len(measured))
        mean[joints], variance[joints] = solved[0], np.diag(solved[1])
        return Channel.raw(measured, mean, variance)

    def state(self) -> dict[str, np.ndarray]:
        """Return everything as arrays; `restore` takes it back."""
        last = [] if self.last_ns is None else [self.last_ns]
        return self.signals.state() | {'last_ns': np.array(last, dtype=np.int64)}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""
        self.signals.restore(state)
        self.last_ns = int(state['last_ns'][0]) if len(state['last_ns']) else None

    def _at(self, expert: Expert, f: np.ndarray, signal: np.ndarray) -> Expert:
        regression, prediction = expert
        if not self._is_seen:
            return regression, regression.with_regressor(prediction, f)
        u = prediction.u.copy()
        u[self._columns] = signal
        return regression, regression.predict(u, f)

    def _measured(self, equation: Equation) -> np.ndarray:
        values: np.ndarray = getattr(equation.motion, self._robot.complement)[0]
        return values
