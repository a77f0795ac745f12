"""The state of a stream, and what one event does to it."""

from __future__ import annotations

from collections.abc import Collection

from sgp_ros.engine.clock import StreamClock, Verdict
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.estimator import Estimator
from sgp_ros.engine.filter_choice import StateFilter
from sgp_ros.engine.held_commands import MOST_COMMANDS
from sgp_ros.engine.hyperparameters import settings_of
from sgp_ros.engine.intake import Intake
from sgp_ros.engine.ordering import ReorderBuffer
from sgp_ros.engine.progress import Progress
from sgp_ros.engine.results import NOTHING, Counts, Estimate, Step
from sgp_ros.engine.samples import (
    CommandSample,
    Event,
    JointSample,
    Reset,
    SettingsChange,
    SettingValue,
)
from sgp_ros.engine.windows import Equation
from sgp_ros.errors import ConfigError, NumericalError
from sgp_ros.robots.robot import Robot


class Fold:
    """Takes events in the order of their arrival; an error may leave a step half done.

    Attributes:
        robot: what is known of the robot.
        config: settings in force.
        counts: what became of every sample.
        delay_s: half the length of the last filter window [s].
        clock, order, intake, filter, estimator: the stages of the fold.
        began_ns: stamp of what is done before the first event of a segment leaves [ns].
        fits: of hyper-parameters, handed out so far.
        stale_fits: how many of these were made for a model that is not in force any more.
        next_fit: learned count at which the next fit of hyper-parameters is due.
        progress: of the motion since the last fit.
    """

    def __init__(self, robot: Robot, config: EngineConfig) -> None:
        self.robot = robot
        self.config = config
        self.counts = Counts()
        self.delay_s = 0.5 * max(config.filter_window, 0.0)
        self.clock = StreamClock(config)
        self.order = ReorderBuffer(round(config.reorder_window * 1e9))
        self.intake = Intake(robot, config, self.counts)
        self.filter = StateFilter(self.robot, self.config)
        self.estimator = Estimator(robot, config, self.counts)
        self.next_fit = 0
        self.progress = Progress()
        self.began_ns = 0
        self._taking: Event | None = None
        self._is_fit_due = False
        self.fits = self.stale_fits = 0

    def _fold(self, event: Event | None, failed: Collection[Event | None] = ()) -> Step:
        """Take an event, or the end of the stream for None.

        Args:
            event: that arrives.
            failed: events that are refused because they failed before.
        """
        self._taking = None
        if event is None:
            return self._finish(failed)
        if not self.intake.admit(event):
            return NOTHING
        newest = self.order.newest_ns
        if self.clock.agrees(event.stamp_ns, newest):
            if self.order.is_late(event):
                self.intake.refuse(event, 'late')
                return NOTHING
            return self._take(self.order.push(event), failed)
        return self._settle(self.clock.judge(event, newest), failed)

    def _settle(self, verdict: Verdict, failed: Collection[Event | None]) -> Step:
        """Take the events whose time is settled now."""
        for wrong in verdict.refused:
            self.intake.refuse(wrong, 'clock')
        step = NOTHING
        if verdict.is_jump:
            step = self._begin_segment(verdict.events[0].stamp_ns, failed)
        for event in verdict.events:
            if self.order.is_late(event):
                self.intake.refuse(event, 'late')
            else:
                step = step.then(self._take(self.order.push(event), failed))
        return step

    def _finish(self, failed: Collection[Event | None]) -> Step:
        step = self._settle(self.clock.finish(self.order.newest_ns), failed)
        step = step.then(self._take(self.order.flush(), failed))
        return step.then(Step(*self._estimates(*self.filter.finish(self.intake.commands))))

    def _begin_segment(self, start_ns: int, failed: Collection[Event | None]) -> Step:
        """Keep what was learned; windows and commands of the time so far end here."""
        self.counts.clock_jumps += 1
        newest = self.order.newest_ns
        if newest is None or start_ns > newest:
            return NOTHING  # as after a pause
        step = self._take(self.order.flush(), failed)
        self.began_ns = max(start_ns - 1, 0)
        self.order = ReorderBuffer(self.order.window_ns)
        self.intake.begin_segment()
        self.filter.begin_segment()
        self.estimator.complement.begin_stream()
        return step

    def _take(self, events: list[Event], failed: Collection[Event | None] = ()) -> Step:
        if not events:
            return NOTHING
        released: list[Event] = []
        estimates: list[Estimate] = []
        for event in events:
            self._taking = event
            if failed and any(event is other for other in failed):
                self.intake.refuse(event, 'error')
                self.filter.take(None, self.intake.commands)
                continue
            if isinstance(event, JointSample):
                state = self.intake.take_state(event)
                if self.intake.repeats:
                    continue
                changes, found = self._estimates(*self.filter.take(state, self.intake.commands))
                released += [event, *changes]
                estimates += found
                self._schedule_fit()
                continue
            if isinstance(event, CommandSample):
                self.intake.take_command(event)
                self._bound_commands()
            elif isinstance(event, Reset):
                self._forget()
            elif not self._obey(event):
                continue
            released.append(event)
        self._taking = None
        return Step(tuple(released), tuple(estimates))

    def _bound_commands(self) -> None:
        """Drop some where no state comes that lets them be forgotten."""
        for history in (self.intake.commands, self.intake.targets):
            if len(history.stamps_ns) > MOST_COMMANDS:
                history.thin()

    def _obey(self, change: SettingsChange) -> bool:
        """Return whether a change of settings in the stream took effect."""
        try:
            self._apply(self.config.changed(change.settings, self.robot))
        except (ConfigError, NumericalError) as error:
            reason = 'invalid' if isinstance(error, ConfigError) else 'no_factor'
            self.intake.refuse(change, reason)
            return False
        return True

    def _estimates(
        self, equations: list[Equation], chosen: dict[str, SettingValue]
    ) -> tuple[tuple[Event, ...], tuple[Estimate, ...]]:
        """Take equations, and before them the filter that was chosen for them."""
        changes: list[Event] = []
        if chosen:
            self.config = self.config.changed(chosen, self.robot)
            self.estimator.configure(self.config)
            changes.append(SettingsChange(self._now_ns, chosen))
        estimates = []
        for equation in equations:
            self.delay_s = 0.5 * equation.span_s
            before = self.counts.reverted
            estimates.append(self.estimator.take(equation))
            if estimates[-1].is_learned:
                self.progress.take(equation)
            if self.counts.reverted > before:
                changes.append(self._follow_model())
        return tuple(changes), tuple(estimates)

    def _follow_model(self) -> SettingsChange:
        """Take the hyper-parameters of the model that is in force again as settings."""
        assert self.estimator.regression is not None
        found = settings_of(self.robot.joint_names, self.estimator.regression.model)
        self.config = self.config.changed(found, self.robot)
        self.estimator.configure(self.config)
        self.stale_fits = self.fits
        return SettingsChange(self._now_ns, found)

    def _forget(self) -> None:
        self.estimator = Estimator(self.robot, self.config, self.counts)
        self.intake = Intake(self.robot, self.config, self.counts)
        self.filter = StateFilter(self.robot, self.config)
        self._is_fit_due = False
        self.next_fit = self.counts.learned
        self.progress = Progress()

    def _schedule_fit(self) -> None:
        if not self.config.refit_enabled or not self._can_fit():
            return
        period = self.config.refit_period
        if self.counts.learned >= self.next_fit and self.progress.is_enough(period):
            self._is_fit_due = True
            self.next_fit = self.counts.learned + period
            self.progress.begin()

    def _can_fit(self) -> bool:
        regression = self.estimator.regression
        return regression is not None and regression.size >= self.config.learning_initial

    def _apply(self, config: EngineConfig) -> None:
        self.estimator.configure(config)
        filters = ('filter_window', 'filter_degree', 'filter_hop', 'filter_velocity')
        if any(getattr(config, name) != getattr(self.config, name) for name in filters):
            self.filter = StateFilter(self.robot, config)
        self.config = config
        self.intake.configure(config)
        self.clock.configure(config)
        self.order.window_ns = round(config.reorder_window * 1e9)

    @property
    def _now_ns(self) -> int:
        released = self.order.released_ns
        return self.began_ns if released is None else released
