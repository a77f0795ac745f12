"""The fold over a stream: events in, estimates out, one at a time in the order of stamps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.estimator import Estimator
from sgp_ros.engine.filter_choice import StateFilter
from sgp_ros.engine.fitting import FitRequest
from sgp_ros.engine.hyperparameters import settings_of
from sgp_ros.engine.intake import Intake
from sgp_ros.engine.ordering import ReorderBuffer
from sgp_ros.engine.results import (
    Counts,
    Estimate,
    ParameterEstimate,
    Score,
    Step,
    read_parameters,
    read_scores,
)
from sgp_ros.engine.samples import (
    CommandSample,
    Event,
    JointSample,
    Reset,
    SettingsChange,
    SettingValue,
)
from sgp_ros.engine.windows import Equation
from sgp_ros.gp.scores import DriftTest
from sgp_ros.gp.stacking import ProcessWeight
from sgp_ros.robots.robot import Robot


class Engine:
    """Identifies one robot from a stream of events. No clock, no file, no thread.

    Attributes:
        robot: what is known of the robot.
        config: settings in force.
        counts: what became of every sample.
        delay_s: half the length of the last filter window [s].
        order, intake, filter, estimator: the stages of the fold.
        fits, next_fit: fits handed out so far, and the learned count at which the next is due.
    """

    def __init__(self, robot: Robot, config: EngineConfig) -> None:
        self.robot = robot
        self.config = config
        self.counts = Counts()
        self.delay_s = 0.5 * max(config.filter_window, 0.0)
        self.order = ReorderBuffer(round(config.reorder_window * 1e9))
        self.intake = Intake(robot, config, self.counts)
        self.filter = StateFilter(self.robot, self.config)
        self.estimator = Estimator(robot, config, self.counts)
        self._is_fit_due = False
        self.fits = 0
        self.next_fit = 0

    @property
    def is_ready(self) -> bool:
        """Whether a model exists that predicts."""
        return self.estimator.regression is not None

    @property
    def buffer_size(self) -> int:
        """Number of samples that Z is conditioned on."""
        regression = self.estimator.regression
        return len(self.estimator.waiting) if regression is None else regression.size

    @property
    def drift(self) -> tuple[DriftTest, ...]:
        """Whether the errors of each joint have grown."""
        return self.estimator.scoring.drift

    def push(self, event: Event) -> Step:
        """Take one event; count it as refused if it cannot be used.

        Returns:
            The events that took effect, in order (a record of these reproduces the run), and the
            estimates they made possible.
        """
        if not self.intake.admit(event):
            return Step()
        if self.order.is_late(event):
            self.intake.refuse_late(event)
            return Step()
        return self._take(self.order.push(event))

    def flush(self) -> Step:
        """Release what waits in the reorder window: the stream has ended."""
        step = self._take(self.order.flush())
        changes, estimates = self._estimates(*self.filter.finish(self.intake.commands))
        return Step((*step.released, *changes), (*step.estimates, *estimates))

    def change(self, settings: Mapping[str, object]) -> SettingsChange:
        """Change settings now, between two samples.

        Returns:
            The event to record.

        Raises:
            ConfigError: a wrong setting; nothing has changed.
            NumericalError: no factor exists under new hyper-parameters; nothing has changed.
        """
        config = self.config.changed(settings, self.robot)
        self._apply(config)
        self.order.seal()
        values = config.to_mapping()
        return SettingsChange(self._now_ns, {name: values[name] for name in settings})

    def reset(self) -> Reset:
        """Forget everything that was learned and what waits for its order, keep the settings.

        Returns:
            The event to record.
        """
        now = self._now_ns
        self.order = ReorderBuffer(self.order.window_ns)
        self._forget()
        return Reset(now)

    def request_refit(self) -> bool:
        """Ask for a fit of the hyper-parameters now; False while there is no model to fit."""
        regression = self.estimator.regression
        if regression is None or regression.size < self.config.learning_initial:
            return False
        self._is_fit_due = True
        return True

    def take_fit_request(self) -> FitRequest | None:
        """Return the fit that is due, once, on the buffer as it is now."""
        regression = self.estimator.regression
        if regression is None or not self._is_fit_due:
            return None
        self._is_fit_due = False
        base = regression.base
        self.fits += 1
        return FitRequest(
            self.fits - 1,
            regression.buffer,
            base.R.copy(),
            base.z.copy(),
            regression.model,
            self.config.refit_restarts,
            self.config.seed,
        )

    def hyper_settings(self) -> dict[str, SettingValue]:
        """Return the hyper-parameters in force as settings, also those still automatic."""
        regression = self.estimator.regression
        if regression is None:
            return {}
        return settings_of(self.robot.joint_names, regression.model)

    def parameters(self) -> tuple[ParameterEstimate, ...]:
        """Return the posterior of every coefficient, from the source that the settings name."""
        if self.config.parameters_source == 'physics' and self.estimator.baseline is not None:
            return self.physics_parameters()
        return read_parameters(self.robot, self.config, self.estimator.regression)

    def physics_parameters(self) -> tuple[ParameterEstimate, ...]:
        """Return the coefficients that the physics alone, without Z, fits to the same samples.

        Where Z sees what a column of the physics is made of, the two share that part of the
        motion and the joint posterior of W leaves the split to their priors. This one does not:
        it is the best physical fit, biased by whatever physics is missing.
        """
        model = self.estimator.baseline or self.estimator.regression
        return read_parameters(self.robot, self.config, model)

    def information(self) -> tuple[np.ndarray, np.ndarray]:
        """Return mean (p,) and square-root information (r, p) of what `parameters` reports.

        `R^T R` is the inverse covariance, of any rank; both are empty where there is none.
        """
        is_physics = self.config.parameters_source == 'physics'
        model = self.estimator.baseline if is_physics else None
        model = model or self.estimator.regression
        if model is None or self.config.model_method == 'GP':
            return np.zeros(0), np.zeros((0, 0))
        return model.information.coefficients, model.information.R

    def process_weights(self) -> dict[str, ProcessWeight]:
        """Return the weight of Z beside the physics alone by joint; empty without both."""
        if self.estimator.baseline is None or self.config.process_weighting == 'off':
            return {}
        weights = self.estimator.scoring.weights
        return dict(zip(self.robot.joint_names, weights, strict=True))

    def scores(self) -> dict[str, dict[str, Score]]:
        """Return the scores of each joint's channels; a channel without samples is absent."""
        return read_scores(self.robot, self.estimator.scoring.scores)

    def baseline_scores(self) -> dict[str, dict[str, Score]]:
        """Return the scores of the physics alone on the same samples, target channel only."""
        return read_scores(self.robot, {self.robot.target: self.estimator.scoring.baseline})

    def begin_stream(self) -> None:
        """Keep what was learned; forget stream, counts and scores: another recording follows."""
        self.counts = Counts()
        self.order = ReorderBuffer(self.order.window_ns)
        self.intake = Intake(self.robot, self.config, self.counts)
        self.filter = StateFilter(self.robot, self.config)
        self.estimator.begin_stream(self.counts)
        self._is_fit_due = False
        self.next_fit = self.config.refit_period

    @property
    def _now_ns(self) -> int:
        return self.order.released_ns or 0

    def _take(self, events: list[Event]) -> Step:
        released: list[Event] = []
        estimates: list[Estimate] = []
        for event in events:
            if isinstance(event, JointSample):
                is_duplicate = event.stamp_ns == self.intake.last_state_ns
                state = self.intake.take_state(event)
                if is_duplicate:
                    continue
                changes, found = self._estimates(*self.filter.take(state, self.intake.commands))
                released += [event, *changes]
                estimates += found
                self._schedule_fit()
                continue
            if isinstance(event, CommandSample):
                self.intake.take_command(event)
            elif isinstance(event, SettingsChange):
                self._apply(self.config.changed(event.settings, self.robot))
            else:
                self._forget()
            released.append(event)
        return Step(tuple(released), tuple(estimates))

    def _estimates(
        self, equations: list[Equation], chosen: dict[str, SettingValue]
    ) -> tuple[list[SettingsChange], list[Estimate]]:
        """Take equations, and before them the filter that was chosen for them."""
        changes = []
        if chosen:
            self.config = self.config.changed(chosen, self.robot)
            self.estimator.configure(self.config)
            changes.append(SettingsChange(self._now_ns, chosen))
        estimates = []
        for equation in equations:
            self.delay_s = 0.5 * equation.span_s
            estimates.append(self.estimator.take(equation))
        return changes, estimates

    def _forget(self) -> None:
        self.estimator = Estimator(self.robot, self.config, self.counts)
        self.intake = Intake(self.robot, self.config, self.counts)
        self.filter = StateFilter(self.robot, self.config)
        self._is_fit_due = False
        self.next_fit = self.counts.learned

    def _schedule_fit(self) -> None:
        regression = self.estimator.regression
        if regression is None or not self.config.refit_enabled:
            return
        if self.counts.learned >= self.next_fit and self.request_refit():
            self.next_fit = self.counts.learned + self.config.refit_period

    def _apply(self, config: EngineConfig) -> None:
        self.estimator.configure(config)
        filters = ('filter_window', 'filter_degree', 'filter_hop', 'filter_velocity')
        if any(getattr(config, name) != getattr(self.config, name) for name in filters):
            self.filter = StateFilter(self.robot, config)
        self.config = config
        self.intake.configure(config)
        self.order.window_ns = round(config.reorder_window * 1e9)
