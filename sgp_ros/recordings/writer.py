"""MCAP files of events and results that any ROS 2 tool opens.

The log time of an event is its stamp, so that a type without a header keeps it, and a recording
reads back in the order of stamps. A result of a command appears under its name only when it is
complete; a live record grows under its final name, and what was written before the last `flush`
survives a crash.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

import numpy as np
from mcap.writer import Writer
from typing_extensions import Self

from sgp_ros.engine.samples import CommandSample, Event, JointSample
from sgp_ros.recordings.command_types import COMMAND_TYPES, FLOAT64_ARRAY, TRAJECTORY
from sgp_ros.recordings.messages import (
    DIAGNOSTICS,
    JOINT_STATE,
    TEXT,
    Message,
    Point,
    Status,
    change_to_text,
    diagnostics_message,
    joint_state_message,
    trajectory_message,
)
from sgp_ros.recordings.topics import CHANGES_TOPIC, GAINS_TOPIC
from sgp_ros.recordings.typestore import definition, full_type, new_message, serialize
from sgp_ros.strangers import create_beside, discard, take_place


class RecordingWriter:
    """An MCAP file that is being written; a context manager.

    Args:
        path: of the file; an existing one is replaced.
        joint_states_topic: where `write_event` puts states.
        command_topic: where it puts commands.
        command_type: type of the commands, a key of `COMMAND_TYPES`.
        changes_topic: where it puts changes of settings and resets.
        is_live: write under the final name from the start, for the record of a running node.
            Else the file gets its name in `close`, and an error leaves nothing behind.
    """

    def __init__(
        self,
        path: str | Path,
        joint_states_topic: str = '/joint_states',
        command_topic: str = '/command',
        command_type: str = FLOAT64_ARRAY,
        changes_topic: str = CHANGES_TOPIC,
        *,
        is_live: bool = False,
    ) -> None:
        if command_type not in COMMAND_TYPES:
            msg = f'command type {command_type!r}: expected one of {sorted(COMMAND_TYPES)}'
            raise ValueError(msg)
        self.path = Path(path)
        self._joint_states_topic = joint_states_topic
        self._command_topic = command_topic
        self._command_type = command_type
        self._changes_topic = changes_topic
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[str, str], int] = {}
        _prepare(command_type)  # takes time: an interruption in it leaves no file
        self._file: BinaryIO
        if is_live:
            self._file, self._growing = self.path.open('wb'), self.path
        else:
            self._file, self._growing = create_beside(self.path)
        self._writer = Writer(self._file)
        self._writer.start(profile='ros2', library='sgp_ros')

    def write_event(self, event: Event, log_ns: int | None = None) -> None:
        """Write one event.

        Args:
            event: what happened.
            log_ns: log time [ns]; None for the stamp of the event.

        Raises:
            ValueError: a command that the command type cannot hold.
        """
        if isinstance(event, JointSample):
            message = joint_state_message(new_message, event)
            self._write(self._joint_states_topic, JOINT_STATE, event.stamp_ns, message, log_ns)
        elif isinstance(event, CommandSample):
            message = COMMAND_TYPES[self._command_type].message(new_message, event)
            self._write(self._command_topic, self._command_type, event.stamp_ns, message, log_ns)
            if event.gains is not None:
                kp, kd = (np.array(x) for x in zip(*event.gains.values(), strict=True))
                gains = JointSample(event.stamp_ns, tuple(event.gains), kp, kd)
                self.write_joint_state(GAINS_TOPIC, gains)
        else:
            message = new_message(TEXT, data=change_to_text(event))
            self._write(self._changes_topic, TEXT, event.stamp_ns, message, log_ns)

    def write(self, topic: str, kind: str, stamp_ns: int, message: Message) -> None:
        """Write a message of type `kind`, log time `stamp_ns` [ns]."""
        self._write(topic, kind, stamp_ns, message)

    def write_joint_state(self, topic: str, sample: JointSample) -> None:
        """Write a JointState; what the sample lacks stays empty."""
        message = joint_state_message(new_message, sample)
        self._write(topic, JOINT_STATE, sample.stamp_ns, message)

    def write_trajectory(
        self, topic: str, stamp_ns: int, names: Sequence[str], point: Point
    ) -> None:
        """Write a JointTrajectory of one point, header stamp and log time `stamp_ns` [ns]."""
        message = trajectory_message(new_message, stamp_ns, names, point)
        self._write(topic, TRAJECTORY, stamp_ns, message)

    def write_diagnostics(self, topic: str, stamp_ns: int, entries: Iterable[Status]) -> None:
        """Write a DiagnosticArray with one status per entry, at `stamp_ns` [ns]."""
        self._write(
            topic, DIAGNOSTICS, stamp_ns, diagnostics_message(new_message, stamp_ns, entries)
        )

    def flush(self) -> None:
        """Make everything written so far readable even if the process dies now."""
        self._writer.flush()  # type: ignore[no-untyped-call] # mcap leaves it without types

    def close(self) -> None:
        """Complete the file; a second call does nothing."""
        if self._file.closed:
            return
        try:
            self._writer.finish()  # type: ignore[no-untyped-call] # mcap leaves it without types
            if self._growing != self.path:
                take_place(self._file, self._growing, self.path)
        finally:
            self.give_up()

    def give_up(self) -> None:
        """Leave a file that cannot be completed, as on a full disk; only a live record is kept."""
        if self._growing == self.path:
            with contextlib.suppress(OSError):
                self._file.close()
        elif not self._file.closed:
            discard(self._file, self._growing)

    def __enter__(self) -> Self:
        """Return the writer itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Complete the file; after an error only a live record is kept."""
        if kind is None or self._growing == self.path:
            self.close()
        else:
            self.give_up()

    def _write(
        self, topic: str, kind: str, stamp_ns: int, message: Message, log_ns: int | None = None
    ) -> None:
        channel = self._channels.get((topic, kind)) or self._register(topic, kind)
        logged = stamp_ns if log_ns is None else log_ns
        self._writer.add_message(channel, logged, serialize(kind, message), stamp_ns)

    def _register(self, topic: str, kind: str) -> int:
        if kind not in self._schemas:
            text = definition(kind).encode()
            self._schemas[kind] = self._writer.register_schema(full_type(kind), 'ros2msg', text)
        channel = self._writer.register_channel(topic, 'cdr', self._schemas[kind])
        self._channels[topic, kind] = channel
        return channel


@cache
def _prepare(command_type: str) -> None:
    """Serialise one message of each kind: the first of a kind costs a tenth of a second.

    A node that did so while it runs would stamp the commands that wait meanwhile too late.
    """
    kind = COMMAND_TYPES[command_type]
    command = CommandSample(0, np.zeros(1), ('joint',) if kind.has_names else None)
    state = JointSample(0, ('joint',), np.zeros(1))
    for name, message in (
        (JOINT_STATE, joint_state_message(new_message, state)),
        (command_type, kind.message(new_message, command)),
        (TRAJECTORY, trajectory_message(new_message, 0, ('joint',), Point())),
        (TEXT, new_message(TEXT, data='')),
        (DIAGNOSTICS, diagnostics_message(new_message, 0, ())),
    ):
        serialize(name, message)
        definition(name)
