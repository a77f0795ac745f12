"""Records what the engine took and gave, in order, so that a replay repeats the run.

The record opens with the settings in force, stamped one nanosecond before the first event.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sgp_ros.engine.config import describe_settings
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import Event, Reset, SettingsChange, SettingValue
from sgp_ros.recordings.messages import FLOAT64_ARRAY
from sgp_ros.recordings.predictions import Outputs, PredictionTopics, write_outputs
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.ros.node_settings import NO_COMMAND


@dataclass(frozen=True, slots=True)
class Topics:
    """Full names of the topics of a node, as the record shows them."""

    joint_states: str
    command: str
    predictions: PredictionTopics


class Record:
    """A growing MCAP file; what was flushed survives a crash.

    Args:
        path: of the file; missing folders are made.
        topics: names in the file.
        command_type: as the setting `command.type`.

    Raises:
        OSError: the file cannot be written.
    """

    def __init__(self, path: Path, topics: Topics, command_type: str) -> None:
        self.path = path.absolute()
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._topics = topics
        kind = FLOAT64_ARRAY if command_type == NO_COMMAND else command_type
        self._writer = RecordingWriter(
            self.path, topics.joint_states, topics.command, kind, is_live=True
        )
        self._is_open = False

    def write_event(self, event: Event, engine: Engine) -> None:
        """Write an event that took effect; `engine` tells the settings in force.

        Changes before the first sample are part of the settings with which the record opens.
        """
        if not self._is_open:
            if isinstance(event, (SettingsChange, Reset)):
                return
            self._is_open = True
            opening = SettingsChange(event.stamp_ns - 1, _changeable(engine))
            self._writer.write_event(opening)
        self._writer.write_event(event)

    def write_outputs(self, outputs: Outputs) -> None:
        """Write what was published of one estimate."""
        write_outputs(self._writer, self._topics.predictions, outputs)

    def flush(self) -> None:
        """Make everything written so far readable even if the process dies now."""
        self._writer.flush()

    def close(self) -> None:
        """Complete the file."""
        self._writer.close()


def _changeable(engine: Engine) -> dict[str, SettingValue]:
    fixed = {s.name for s in describe_settings(engine.robot) if s.read_only}
    return {n: v for n, v in engine.config.to_mapping().items() if n not in fixed}
