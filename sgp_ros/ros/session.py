"""One run of an engine with its record and its fits: all that the node does beside messages."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.fitting import FitResult
from sgp_ros.engine.joint_merging import JointMerger
from sgp_ros.engine.replay import Swap
from sgp_ros.engine.results import Step
from sgp_ros.engine.samples import Event, JointSample, SettingValue
from sgp_ros.engine.snapshots import take_snapshot
from sgp_ros.recordings.command_types import FLOAT64_ARRAY
from sgp_ros.recordings.model_files import save_model
from sgp_ros.recordings.predictions import Outputs, outputs
from sgp_ros.ros.fit_health import FitHealth
from sgp_ros.ros.fit_process import FitProcess, WorkerLost
from sgp_ros.ros.health import Health
from sgp_ros.ros.record import Record


class Session:
    """Feeds an engine, records it, and has its hyper-parameters fitted elsewhere.

    Args:
        engine: identifies the robot.
        record: takes what the engine took and gave; None for no record.
        command_type: as the setting `command.type`.
        monitor: shortest excursion that alarms [s], and false alarms accepted an hour.

    Attributes:
        health, fit_health: of what arrives, and of how well it is predicted.
        has_alarm_changed: whether an alarm began or ended since this was last set to False.
    """

    def __init__(
        self,
        engine: Engine,
        record: Record | None = None,
        command_type: str = FLOAT64_ARRAY,
        monitor: tuple[float, float] = (0.3, 1.0),
    ) -> None:
        self.engine = engine
        self._merger = JointMerger(engine.robot.joint_names)
        self.health = Health(self._merger, command_type)
        self.fit_health = FitHealth(len(engine.robot.joints), *monitor)
        self.has_alarm_changed = False
        self._record = record
        self._fits = FitProcess()
        self._swap: Swap | None = None
        self._saving: threading.Thread | None = None
        self._save_problem: OSError | None = None

    def merged(self, event: Event) -> Sequence[Event]:
        """Return what the engine is to take: states of all joints instead of parts of them."""
        if not isinstance(event, JointSample):
            return (event,)
        self.health.note_joints(event)
        return self._merger.take(event)

    def take(self, event: Event) -> list[Outputs]:
        """Push an event; return what is to be published."""
        with self._fits.held():
            started, used = time.perf_counter(), time.thread_time()
            step = self.engine.push(event)
            self.health.note_push(time.perf_counter() - started, time.thread_time() - used)
        found = self._settle(step)
        self._hand_out_fit()
        return found

    def change(self, settings: Mapping[str, SettingValue]) -> None:
        """Change settings between two samples.

        Raises:
            ConfigError: a wrong setting; nothing has changed.
            NumericalError: impossible hyper-parameters; nothing has changed.
        """
        change = self.engine.change(settings)
        if any(name.startswith('hyper.') for name in settings):
            self._swap = None  # what the user says is newer than the fit
        self._write_event(change)

    def reset(self) -> None:
        """Forget everything that was learned."""
        self._swap = None
        self._write_event(self.engine.reset())

    def refit(self) -> bool:
        """Ask for a fit now; False while there is no model to fit."""
        asked = self.engine.request_refit()
        self._hand_out_fit()
        return asked

    def poll_fit(self) -> str:
        """Put a part of a finished fit in force; return a warning for the log, or nothing."""
        answer = self._fits.poll()
        if isinstance(answer, FitResult):
            self._swap = Swap(self.engine, answer)
            self._note_fit(self._swap)
        elif isinstance(answer, WorkerLost):
            self.health.last_fit = f'lost: its worker process ended with code {answer.exit_code}'
            return f'fit {self.health.last_fit}; a new worker starts with the next fit'
        elif self._swap is not None:
            change = self._swap.step()
            if change is not None:
                self._write_event(change)
            self._note_fit(self._swap)
        self._hand_out_fit()
        return ''

    def _note_fit(self, swap: Swap) -> None:
        if swap.is_done:
            self.health.note_fit(swap.fit, swap.refusal)
            self._swap = None

    def save(self, path: Path) -> None:
        """Save the model, its settings within.

        Raises:
            OSError: the file cannot be written.
        """
        self._end_saving()
        save_model(path, take_snapshot(self.engine))

    def save_beside(self, path: Path) -> None:
        """Save the model in a thread, which writes a copy while messages are served.

        Raises:
            OSError: the file of the last call could not be written.
        """
        if self._saving is not None and self._saving.is_alive():
            return
        self._end_saving()
        model = {name: np.array(array) for name, array in take_snapshot(self.engine).items()}

        def save() -> None:
            try:
                save_model(path, model)
            except OSError as error:
                self._save_problem = error

        self._saving = threading.Thread(target=save)
        self._saving.start()

    def _end_saving(self) -> None:
        if self._saving is not None:
            self._saving.join()
            self._saving = None
        problem, self._save_problem = self._save_problem, None
        if problem is not None:
            raise problem

    def flush_record(self) -> None:
        """Make the record so far survive a crash."""
        self._write(lambda record: record.flush())

    def close(self) -> None:
        """End the stream: release what waits, complete the record, kill the worker."""
        with contextlib.suppress(OSError):
            self._end_saving()
        self._fits.close()
        self._settle(self.engine.flush())
        self._write(lambda record: record.close())
        self._record = None

    def _settle(self, step: Step) -> list[Outputs]:
        for failure in step.failures:
            self.health.note_failure(str(failure))
        for event in step.released:
            self._write_event(event)
        robot = self.engine.robot
        self.has_alarm_changed |= self.fit_health.take(step.estimates, robot)
        found = [o for o in map(outputs, step.estimates) if o is not None]
        for output in found:
            self._write(partial(Record.write_outputs, outputs=output))
        return found

    def _write_event(self, event: Event) -> None:
        self._write(lambda record: record.write_event(event, self.engine))
        self.health.unrecorded += bool(self.health.record_problem)

    def _write(self, action: Callable[[Record], None]) -> None:
        """Write to the record; a full disk ends the record, not the node."""
        if self._record is not None:
            try:
                action(self._record)
            except OSError as error:
                self.health.record_problem = f'the record stopped: {error}'
                self._record.give_up()
                self._record = None

    def _hand_out_fit(self) -> None:
        if self._fits.is_free and self._swap is None:
            request = self.engine.take_fit_request()
            self.health.fit_since_s = None if request is None else time.perf_counter()
            if request is not None:
                self._fits.submit(request)
