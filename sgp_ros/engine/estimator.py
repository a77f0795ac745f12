"""Predicts, scores, then learns each equation of motion, in this order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.hyperparameters import kernel_named
from sgp_ros.engine.prediction import check_factor, predict_soundly, solve_complement
from sgp_ros.engine.prior_knowledge import (
    complement_columns,
    empty_regression,
    memory_of_settings,
    model_of_settings,
    prior_of_robot,
)
from sgp_ros.engine.rest import free_targets, is_enough, told, without_rest
from sgp_ros.engine.results import Channel, Counts, Estimate
from sgp_ros.engine.scoring import Scoring
from sgp_ros.engine.windows import Equation
from sgp_ros.errors import NumericalError
from sgp_ros.gp.information import Information
from sgp_ros.gp.learning import initial_model
from sgp_ros.gp.model import Model, Observations
from sgp_ros.gp.online import OnlineRegression
from sgp_ros.gp.regression import Memory, OnlinePrediction, Regression
from sgp_ros.robots.robot import Robot

Arrays = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Input u (4 k,), regressor f (k, p) and target y (k,) of one equation."""
Waiting = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""The same, and which joints dry friction may hold (k,)."""


class Estimator:
    """The model of one robot while it learns.

    Attributes:
        regression: physics and process; None until enough samples started it.
        baseline: physics alone on the same samples; None where the method has no process.
        scoring: what the errors so far tell.
        waiting: equations gathered before the first model.
    """

    def __init__(self, robot: Robot, config: EngineConfig, counts: Counts) -> None:
        self._robot = robot
        self._counts = counts
        k = len(robot.joints)
        columns = robot.residual_columns(config.model_residual_inputs)
        self.inputs = (None,) * k if config.model_method == 'PR' else columns
        self._prior = prior_of_robot(robot, config)
        self._known = Information.of_prior(self._prior).coefficients
        self._complement_columns = complement_columns(robot)
        self._sees_complement = config.model_method != 'PR' and any(
            self._complement_columns & set(seen) for seen in columns
        )
        self._config = config
        self.regression: Regression | None = None
        self.baseline: Regression | None = None
        self.waiting: list[Waiting] = []
        self.scoring = Scoring(k)
        if not any(joint.is_automatic for joint in config.hyper):
            self._start([])

    def begin_stream(self, counts: Counts) -> None:
        """Keep the models; count and score anew."""
        self._counts = counts
        self.scoring.begin()

    def configure(self, config: EngineConfig) -> None:
        """Take new settings between two samples.

        Raises:
            NumericalError: the buffer has no factor under new hyper-parameters; nothing changed.
        """
        old = self._config
        self._config = config
        if self.regression is None:
            return
        model = model_of_settings(config, self.inputs, self.regression.model)
        memory = memory_of_settings(config)
        if model == self.regression.model and memory == self.regression.memory:
            return
        try:
            self.regression.change(model, memory)
        except NumericalError:
            self._config = old
            raise
        if self.baseline is not None and config.forgetting_samples != old.forgetting_samples:
            self.baseline.change(memory=_baseline_memory(config))
        self._refresh_baseline()

    def _refresh_baseline(self) -> None:
        """Give the physics alone the noise that its own errors show."""
        scores = self.scoring.baseline
        if self.baseline is None or not all(score.squared_error > 0.0 for score in scores):
            return
        noise = tuple(score.squared_error / score.n for score in scores)
        self.baseline.change(Model(self.baseline.model.kernels, noise))

    def take(self, equation: Equation) -> Estimate:
        """Predict an equation, score the prediction, then learn it."""
        self._counts.estimated += 1
        if self.regression is None:
            u, f, y = self._arrays(equation)
            _, held = without_rest(equation.slack, f @ self._known[: f.shape[1]], y)
            self._counts.held += bool(held.any())
            if self._config.learning_enabled:
                self.waiting.append((u, f, y, held))
                if is_enough([row[3] for row in self.waiting], self._config.learning_initial):
                    self._start(self.waiting)
                    self.waiting = []
            return self._unknown(equation, is_learned=not held.any())
        return self._predict_score_learn(self.regression, equation)

    def _predict_score_learn(self, regression: Regression, equation: Equation) -> Estimate:
        u, f, y = self._arrays(equation)
        prediction = predict_soundly(regression, u, f, self._counts)
        noise = np.array(regression.model.noise)
        target = self._calibrated(
            self._robot.target,
            Channel.raw(y, prediction.mean, np.diag(prediction.covariance) + noise),
        )
        complement = self._calibrated(
            self._robot.complement, self._complement(regression, equation, prediction)
        )
        y, held = without_rest(equation.slack, prediction.mean, y)
        self._counts.held += bool(held.any())
        is_scored = self._score(replace(target, measured=y), complement, held)
        self._take_baseline(u, f, y, held, is_scored=is_scored)
        is_learned = self._learn(regression, prediction, y, held)
        channels = {self._robot.target: target, self._robot.complement: complement}
        return Estimate(
            equation.stamp_ns,
            self._robot.joint_names,
            equation.motion.position[0],
            equation.motion.velocity[0],
            channels['acceleration'],
            channels['effort'],
            is_scored,
            is_learned,
        )

    def _learn(
        self, regression: Regression, prediction: OnlinePrediction, y: np.ndarray, held: np.ndarray
    ) -> bool:
        sample = told(regression, prediction, y, held)
        if sample is None or not self._config.learning_enabled:
            return False
        try:
            regression.learn(*sample)
        except NumericalError:
            self._counts.unlearnable += 1
            return False
        self._counts.learned += 1
        if self._counts.learned % self._config.buffer_check_period == 0:
            check_factor(regression, self._counts)
        return True

    def _arrays(self, equation: Equation) -> Arrays:
        """Return input (4 k,), regressor (k, p) and target (k,)."""
        motion = equation.motion
        u = self._robot.inputs(motion)[0]
        k = len(self._robot.joints)
        start = {'acceleration': 2 * k, 'effort': 3 * k}
        u[start[self._robot.target] : start[self._robot.target] + k] = 0.0
        complement = self._measured(equation, self._robot.complement)
        f = equation.regressor(complement[list(equation.complement_joints)])
        if self._config.model_method == 'GP':
            f = f[:, :0]
        return u, f, self._measured(equation, self._robot.target)

    @staticmethod
    def _measured(equation: Equation, channel: str) -> np.ndarray:
        values: np.ndarray = getattr(equation.motion, channel)[0]
        return values

    def _complement(
        self, regression: Regression, equation: Equation, prediction: OnlinePrediction
    ) -> Channel:
        measured = self._measured(equation, self._robot.complement)
        k = len(measured)
        unknown = Channel.unknown(measured)
        joints = list(equation.complement_joints)
        if not joints or self._config.model_method == 'GP':
            return unknown
        w = regression.information.coefficients
        zero = equation.state_rows
        slope = (equation.slopes @ w).T  # (k, c)

        def predict(signal: np.ndarray) -> OnlinePrediction:
            f = equation.regressor(signal)
            if not self._sees_complement:
                return regression.with_regressor(prediction, f)
            u = prediction.u.copy()
            columns = sorted(self._complement_columns)
            u[columns] = signal
            return regression.predict(u, f)

        solved = solve_complement(
            self._measured(equation, self._robot.target),
            slope,
            np.array(regression.model.noise),
            zero @ w,
            predict,
            2 if self._sees_complement else 1,
        )
        if solved is None:
            return unknown
        mean, variance = np.zeros(k), np.zeros(k)
        mean[joints], variance[joints] = solved[0], np.diag(solved[1])
        return Channel.raw(measured, mean, variance)

    def _calibrated(self, channel: str, values: Channel) -> Channel:
        if self._config.intervals_calibration == 'off':
            return values
        return self.scoring.calibrated(channel, values)

    def _score(self, target: Channel, complement: Channel, held: np.ndarray) -> bool:
        is_known = np.isfinite(target.raw_variance) & (target.raw_variance > 0.0)
        if not is_known.all() or held.all():  # unknown: undetermined, or far outside all samples
            return False
        self._counts.scored += 1
        mode = self._config.intervals_calibration
        adapts = mode == 'always' or (mode == 'learning' and self._config.learning_enabled)
        self.scoring.take_target(target, ~held)
        self.scoring.take(self._robot.target, target, ~held, adapts=adapts)
        # a held joint keeps the other side of the equation from following for all of them
        is_free = np.full(len(held), not held.any())
        self.scoring.take(self._robot.complement, complement, is_free, adapts=adapts)
        return True

    def _take_baseline(
        self, u: np.ndarray, f: np.ndarray, y: np.ndarray, held: np.ndarray, *, is_scored: bool
    ) -> None:
        if self.baseline is None:
            return
        prediction = self.baseline.predict(u, f)
        variance = np.diag(prediction.covariance) + np.array(self.baseline.model.noise)
        if is_scored and np.all(np.isfinite(variance)):
            self.scoring.take_baseline(y, prediction.mean, variance, ~held)
        sample = told(self.baseline, prediction, y, held)
        if sample is not None and self._config.learning_enabled:
            self.baseline.learn(*sample)

    def make_regression(self, model: Model) -> Regression:
        """Return an empty model with these hyper-parameters."""
        return empty_regression(model, self._prior, self._config)

    def make_baseline(self, model: Model) -> OnlineRegression:
        """Return an empty model of the physics alone."""
        return OnlineRegression(model, self._prior, _baseline_memory(self._config))

    def _start(self, waiting: list[Waiting]) -> None:
        """Make the first model from what was gathered, then learn that."""
        columns = [np.array(column) for column in zip(*waiting, strict=True)]
        data = None
        if waiting:
            U, F, y, held_rows = columns
            data = Observations(U, F, free_targets(y, held_rows))
        kernel = kernel_named(self._config.model_kernel)
        start = None if data is None else initial_model(data, self.inputs, kernel=kernel)
        model = model_of_settings(self._config, self.inputs, start)
        self.regression = self.make_regression(model)
        if self._config.model_method == 'SGP':
            self.baseline = self.make_baseline(Model((None,) * len(model.kernels), model.noise))
        if data is None:
            return
        is_whole = not columns[3].any()
        if self.baseline is not None and is_whole:
            self.baseline.learn_all(data)
        try:
            if is_whole:
                self.regression.learn_all(data)  # nothing was held, so these are the targets
                self._counts.learned += len(data.U)
                return
        except NumericalError:  # some repeat others to rounding: the rest is learned without them
            self.regression = self.make_regression(model)
        for u, f, y, held in waiting:
            if not is_whole:
                self._take_baseline(u, f, y, held, is_scored=False)
            self._learn(self.regression, self.regression.predict(u, f), y, held)

    def _unknown(self, equation: Equation, *, is_learned: bool) -> Estimate:
        return Estimate(
            equation.stamp_ns,
            self._robot.joint_names,
            equation.motion.position[0],
            equation.motion.velocity[0],
            Channel.unknown(self._measured(equation, 'acceleration')),
            Channel.unknown(self._measured(equation, 'effort')),
            is_scored=False,
            is_learned=is_learned and self._config.learning_enabled,
        )


def _baseline_memory(config: EngineConfig) -> Memory:
    return Memory(1, forgetting=config.forgetting_samples)
