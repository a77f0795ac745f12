"""Predicts, scores, then learns each equation of motion, in this order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgp_ros.engine.complement import Complement
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.gate import Before, Gate, without_isolated
from sgp_ros.engine.prediction import check_factor, estimated, predict_soundly, weighted
from sgp_ros.engine.prior_knowledge import (
    baseline_memory,
    empty_baseline,
    empty_regression,
    first_model,
    memory_of_settings,
    model_of_settings,
    prior_of_robot,
)
from sgp_ros.engine.rest import free_targets, is_enough, learnable, without_rest
from sgp_ros.engine.results import Channel, Counts, Estimate
from sgp_ros.engine.scoring import Scoring
from sgp_ros.engine.windows import Equation
from sgp_ros.errors import NumericalError
from sgp_ros.gp.information import Information
from sgp_ros.gp.model import Model, Observations
from sgp_ros.gp.regression import OnlinePrediction, Regression
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
        complement: predicts the other side of the equation of motion.
        waiting, first_off: equations gathered before the first model, and how far samples were
            off in each.
        gate: refuses implausible equations.
        before: what was learned before such equations persisted; None in the usual case.
    """

    def __init__(self, robot: Robot, config: EngineConfig, counts: Counts) -> None:
        self._robot = robot
        self._counts = counts
        k = len(robot.joints)
        columns = robot.residual_columns(config.model_residual_inputs)
        self.inputs = (None,) * k if config.model_method == 'PR' else columns
        self.prior = prior_of_robot(robot, config)
        self._known = Information.of_prior(self.prior).coefficients
        self.complement = Complement(robot, config, columns)
        self._config = config
        self.regression: Regression | None = None
        self.baseline: Regression | None = None
        self.waiting: list[Waiting] = []
        self.first_off: list[np.ndarray] = []
        self.scoring = Scoring(k)
        self.gate = Gate(k)
        self.before: Before | None = None
        if not any(joint.is_automatic for joint in config.hyper):
            self._start([])

    def begin_stream(self, counts: Counts) -> None:
        """Keep the models; count and score anew."""
        self._counts = counts
        self.scoring.begin()
        self.complement.begin_stream()

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
            self.baseline.change(memory=baseline_memory(config))
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
        refused = self._counts.implausible
        estimate = self._estimate(equation)
        if self._counts.implausible > refused:
            self.complement.skip()
        else:
            self.complement.take(equation, self._config.filter_hop)
        return estimate

    def _estimate(self, equation: Equation) -> Estimate:
        is_rough = self.gate.is_rough(equation)
        if self.regression is None:
            if self.gate.judge(equation, is_wrong=is_rough):
                self._counts.implausible += 1
                return estimated(self._robot, equation)
            u, f, y = self._arrays(equation)
            _, held = without_rest(equation.slack, f @ self._known[: f.shape[1]], y)
            self._counts.held += bool(held.any())
            if self._config.learning_enabled:
                self.waiting.append((u, f, y, held))
                self.first_off.append(equation.roughness[0])
                if is_enough([row[3] for row in self.waiting], self._config.learning_initial):
                    self._start(self.waiting)
                    self.waiting = []
            is_learned = self._config.learning_enabled and not held.any()
            return estimated(self._robot, equation, is_learned=is_learned)
        return self._predict_score_learn(self.regression, equation, is_wrong=is_rough)

    def _predict_score_learn(
        self, regression: Regression, equation: Equation, *, is_wrong: bool
    ) -> Estimate:
        u, f, y = self._arrays(equation)
        prediction = predict_soundly(regression, u, f, self._counts)
        model, physics = (regression, prediction), None
        if self.baseline is not None:
            physics = (self.baseline, self.baseline.predict(u, f))
        weight = self.scoring.weight(is_used=self._config.process_weighting != 'off')
        mean, covariance = weighted(weight, model, physics)
        target_name = self._robot.target
        target = self._calibrated(target_name, Channel.raw(y, mean, covariance.diagonal().copy()))
        complement = self._calibrated(
            self._robot.complement,
            self.complement.predict(equation, model, physics, weight, target),
        )
        measured, _ = without_rest(equation.slack, mean, y)
        y, held = without_rest(equation.slack, prediction.mean, y)
        channels = {target_name: target, self._robot.complement: complement}
        errors = measured - mean
        is_wrong |= self.gate.is_surprised(errors, target.raw_variance, held)
        if self.gate.judge(equation, is_wrong=is_wrong):
            self._counts.implausible += 1
            return estimated(self._robot, equation, channels)
        if is_wrong and self.before is None and self._config.learning_enabled:
            self.before = Before.of(regression, self.baseline, self.gate)
        self.gate.take(errors, held)
        if self.before is not None:
            if self.before.is_better(errors, (u, f, y), held):
                return self._revert(self.before, equation)
            if not self.before.left:
                self.before = None
        self._counts.held += bool(held.any())
        is_scored = self._score(replace(target, measured=measured), complement, held)
        if physics is not None:
            if is_scored:
                self._score_baseline(y, y - prediction.mean, physics[1], held)
            self._learn_baseline(physics[1], y, held)
        is_learned = self._learn(regression, prediction, y, held)
        found = estimated(
            self._robot, equation, channels, is_scored=is_scored, is_learned=is_learned
        )
        return found if physics is None else replace(found, physics=physics[1].mean)

    def _revert(self, before: Before, equation: Equation) -> Estimate:
        """Take what was learned before, and have it take the equation."""
        self.regression, self.baseline, self.gate = before.regression, before.baseline, before.gate
        self.before = None
        self._counts.reverted += 1
        return self._predict_score_learn(before.regression, equation, is_wrong=False)

    def _learn(
        self, regression: Regression, prediction: OnlinePrediction, y: np.ndarray, held: np.ndarray
    ) -> bool:
        sample = learnable(regression, prediction, y, held)
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

    def _calibrated(self, channel: str, values: Channel) -> Channel:
        if self._config.intervals_calibration == 'off':
            return values
        return replace(values, variance=self.scoring.calibrated(channel, values.raw_variance))

    def _score(self, target: Channel, complement: Channel, held: np.ndarray) -> bool:
        if not np.isfinite(target.raw_variance).all() or held.all():  # undetermined
            return False
        self._counts.scored += 1
        adapts = self._adapts(self._config.intervals_calibration)
        self.scoring.take_target(target, ~held)
        self.scoring.take(self._robot.target, target, ~held, adapts=adapts)
        # a held joint keeps the other side of the equation from following for all of them
        is_free = np.full(len(held), not held.any())
        self.scoring.take(self._robot.complement, complement, is_free, adapts=adapts)
        return True

    def _adapts(self, mode: str) -> bool:
        return mode == 'always' or (mode == 'learning' and self._config.learning_enabled)

    def _score_baseline(
        self, y: np.ndarray, errors: np.ndarray, prediction: OnlinePrediction, held: np.ndarray
    ) -> None:
        """Score the physics alone, and weigh it against the errors (k,) of the model."""
        assert self.baseline is not None
        variance = prediction.covariance.diagonal() + np.array(self.baseline.model.noise)
        if np.all(np.isfinite(variance)):
            self.scoring.take_baseline(y, prediction.mean, variance, ~held)
            if self._adapts(self._config.process_weighting):
                self.scoring.take_experts(errors, y - prediction.mean, ~held)

    def _learn_baseline(
        self, prediction: OnlinePrediction, y: np.ndarray, held: np.ndarray
    ) -> None:
        assert self.baseline is not None
        sample = learnable(self.baseline, prediction, y, held)
        if sample is not None and self._config.learning_enabled:
            self.baseline.learn(*sample)

    def _start(self, waiting: list[Waiting]) -> None:
        """Make the first model from what was gathered, then learn that."""
        values = [
            np.concatenate([u, y, off])
            for (u, _, y, _), off in zip(waiting, self.first_off, strict=True)
        ]
        kept = without_isolated(waiting, values)
        self.first_off = []
        self._counts.implausible += len(waiting) - len(kept)
        waiting = kept
        columns = [np.array(column) for column in zip(*waiting, strict=True)]
        data = None
        if waiting:
            U, F, y, held_rows = columns
            data = Observations(U, F, free_targets(y, held_rows))
        model = first_model(self._config, self.inputs, data)
        self.regression = empty_regression(model, self.prior, self._config)
        if self._config.model_method == 'SGP':
            self.baseline = empty_baseline(model, self.prior, self._config)
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
            self.regression = empty_regression(model, self.prior, self._config)
        for u, f, y, held in waiting:
            if self.baseline is not None and not is_whole:
                self._learn_baseline(self.baseline.predict(u, f), y, held)
            self._learn(self.regression, self.regression.predict(u, f), y, held)
