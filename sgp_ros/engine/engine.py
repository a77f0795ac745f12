"""The fold over a stream: events in, estimates out, one at a time in the order of stamps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from sgp_ros.engine.clock import StreamClock
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.filter_choice import StateFilter
from sgp_ros.engine.fitting import FitRequest
from sgp_ros.engine.fold import Fold
from sgp_ros.engine.hyperparameters import settings_of
from sgp_ros.engine.intake import Intake
from sgp_ros.engine.journal import Failure, Journal
from sgp_ros.engine.ordering import ReorderBuffer
from sgp_ros.engine.results import (
    Counts,
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
from sgp_ros.gp.scores import DriftTest
from sgp_ros.gp.stacking import ProcessWeight
from sgp_ros.robots.robot import Robot

RAISES_FAILURES = False
"""Whether an error that only a bug can cause is raised; the tests want to see it."""


class Engine(Fold):
    """Identifies one robot from a stream of events. No clock, no file, no thread."""

    def __init__(self, robot: Robot, config: EngineConfig) -> None:
        super().__init__(robot, config)
        self._journal = Journal(vars(self), self._unchanging, self._fold)

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

        A step is whole or nothing: an event on which a bug strikes leaves no trace but a count and
        `Step.failures`, and the filter begins anew behind it.

        Returns:
            The events that took effect, in order (a record of these reproduces the run), and the
            estimates they made possible.
        """
        return self._whole(event)

    def flush(self) -> Step:
        """Release what waits in the reorder window: the stream has ended."""
        return self._whole(None)

    def change(self, settings: Mapping[str, object]) -> SettingsChange:
        """Change settings now, between two samples.

        Returns:
            The event to record.

        Raises:
            ConfigError: a wrong setting; nothing has changed.
            NumericalError: no factor exists under new hyper-parameters; nothing has changed.
        """
        config = self.config.changed(settings, self.robot)
        self._journal.do(self._change, config)
        values = config.to_mapping()
        return SettingsChange(self._now_ns, {name: values[name] for name in settings})

    def reset(self) -> Reset:
        """Forget everything that was learned and all waiting events; keep the settings.

        Returns:
            The event to record.
        """
        return Reset(self._journal.do(self._reset, self._now_ns))

    def request_refit(self) -> bool:
        """Ask for a fit of the hyper-parameters now; False while there is no model to fit."""
        if not self._can_fit():
            return False
        self._journal.do(self._mark_fit, True)  # noqa: FBT003 - an action has one argument
        return True

    def take_fit_request(self) -> FitRequest | None:
        """Return the fit that is due, once, on the buffer as it is now."""
        regression = self.estimator.regression
        if regression is None or not self._is_fit_due:
            return None
        self._journal.do(self._mark_fit, False)  # noqa: FBT003 - an action has one argument
        base = regression.base
        return FitRequest(
            self.fits - 1,
            regression.buffer,
            base.R.copy(),
            base.z.copy(),
            regression.model,
            self.config.refit_restarts,
            self.config.seed,
        )

    def count_refit(self, refusal: str) -> None:
        """Count a fit that was put in force, or refused for one of `results.REFIT_REFUSALS`."""
        self._journal.do(self._count_refit, refusal)

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
        self.order, self.clock = ReorderBuffer(self.order.window_ns), StreamClock(self.config)
        self.intake = Intake(self.robot, self.config, self.counts)
        self.filter = StateFilter(self.robot, self.config)
        self.estimator.begin_stream(self.counts)
        self._is_fit_due = False
        self.next_fit = self.config.refit_period
        self._journal.forget()

    @property
    def waiting_events(self) -> tuple[int, int]:
        """How many states and commands are neither used nor refused yet."""
        held = [*self.order.pending, *self.clock.pending]
        states = sum(isinstance(event, JointSample) for event in held)
        return states, sum(isinstance(event, CommandSample) for event in held)

    def _whole(self, event: Event | None) -> Step:
        """Take an event, or the end of the stream, without the events on which it fails."""
        failures: tuple[Failure, ...] = ()
        while True:
            self._journal.begin(self.counts.learned)
            failed = tuple(failure.event for failure in failures) if failures else ()
            try:
                step = self._fold(event, failed)
            except Exception as error:
                if RAISES_FAILURES:
                    raise
                taking = self._taking
                self._journal.undo()
                failures = (*failures, Failure(taking or event, error))
                if taking is None or any(taking is other for other in failed):
                    if event is not None:
                        self._journal.do(self._refuse_failed, event)
                    return Step(failures=failures)
                continue
            if event is None or failures:
                self._journal.forget()
                return replace(step, failures=failures) if failures else step
            self._journal.note(event)
            return step

    def _refuse_failed(self, event: Event) -> None:
        self.intake.refuse_failed(event)

    def _change(self, config: EngineConfig) -> None:
        self._apply(config)
        self.order.seal()

    def _reset(self, now_ns: int) -> int:
        for event in (*self.order.pending, *self.clock.pending):
            self.intake.refuse(event, 'reset')
        self.order, self.clock = ReorderBuffer(self.order.window_ns), StreamClock(self.config)
        self.began_ns = now_ns
        self._forget()
        return now_ns

    def _mark_fit(self, is_due: bool) -> None:  # noqa: FBT001 - an action has one argument
        self._is_fit_due = is_due
        self.fits += not is_due

    def _count_refit(self, refusal: str) -> None:
        if refusal:
            self.counts.refits_refused_for[refusal] += 1
        else:
            self.counts.refits += 1

    def _unchanging(self) -> Iterator[object]:
        """Yield values that no step changes, so that a copy of the state can share them."""
        yield from (self.robot, self.config)
        yield from self.order.pending
        yield from self.clock.pending
        yield from self.filter.windows.states
        yield from self.intake.commands.efforts
        if self.filter.trial is not None:
            yield from self.filter.trial.states
