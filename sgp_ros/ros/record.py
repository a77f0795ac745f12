"""The record of a run: what the engine took and gave, in order, so that a replay repeats the run.

It opens with the settings in force, stamped one nanosecond before the first event. A run never
writes into the file of another one: a name that is taken gets a number. With a limit of size or
age the record is a folder of files, each complete when the next begins, and a replay takes the
folder.
"""

from __future__ import annotations

import datetime as dt
import re
import time
from dataclasses import dataclass
from pathlib import Path

from sgp_ros.engine.clock import LEAST_JUMP_S
from sgp_ros.engine.config import describe_settings
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import Event, Reset, SettingsChange, SettingValue
from sgp_ros.errors import ConfigError
from sgp_ros.recordings.command_types import FLOAT64_ARRAY, NO_COMMAND
from sgp_ros.recordings.predictions import Outputs, PredictionTopics, write_outputs
from sgp_ros.recordings.writer import RecordingWriter

_MOST_NUMBERS = 100_000
_JUMP_NS = round(1e9 * LEAST_JUMP_S)


@dataclass(frozen=True, slots=True)
class Topics:
    """Full names of the topics of a node, as the record shows them."""

    joint_states: str
    command: str
    predictions: PredictionTopics


def filled_name(template: str, node: str) -> str:
    """Return a name with `{time}` and `{node}` filled in.

    Args:
        template: of a file; `{time}` is the time of day, as 20261122_104500.
        node: full name, such as `/left/sgp_node`; its slashes become dots.

    Raises:
        ConfigError: another name in braces.
    """
    known = {
        '{time}': dt.datetime.now().astimezone().strftime('%Y%m%d_%H%M%S'),
        '{node}': node.strip('/').replace('/', '.'),
    }
    unknown = set(re.findall(r'\{[^}]*\}', template)) - set(known)
    if unknown:
        raise ConfigError(f'{", ".join(sorted(unknown))} in {template}', ' or '.join(known))
    for name, value in known.items():
        template = template.replace(name, value)
    return template


def save_file(given: str, node: str) -> Path:
    """Return the file of saved models: setting `save.path`, by default the full name of the node.

    Raises:
        ConfigError: as `filled_name`.
    """
    name = filled_name(given or '{node}.npz', node)
    return Path(name if name.endswith('.npz') else f'{name}.npz').absolute()


def free_name(path: Path, *, is_folder: bool = False) -> Path:
    """Create a file or folder that did not exist, and return it.

    Args:
        path: wanted; `run.mcap` becomes `run_2.mcap` where it is taken.
        is_folder: whether a folder is wanted.

    Raises:
        OSError: it cannot be created.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    for number in range(1, _MOST_NUMBERS):
        tried = path if number == 1 else path.with_name(f'{path.stem}_{number}{path.suffix}')
        try:
            if is_folder:
                tried.mkdir()
            else:
                tried.touch(exist_ok=False)
        except FileExistsError:
            if tried.is_char_device():
                return tried
            continue
        return tried
    raise OSError(f'{path}: {_MOST_NUMBERS} recordings have this name')


class Record:
    """A growing MCAP file, or a folder of them; what was flushed survives a crash.

    Args:
        path: of the file; missing folders are made, and nothing is overwritten.
        topics: names in the file.
        command_type: as the setting `command.type`.
        most_mb, most_s: size [MB] and age [s], from its first message on, at which a next file
            begins; 0 for no limit. With a limit `path` less its suffix is a folder.

    Attributes:
        path: what a replay takes.

    Raises:
        OSError: the file cannot be written.
    """

    def __init__(
        self,
        path: Path,
        topics: Topics,
        command_type: str,
        most_mb: float = 0.0,
        most_s: float = 0.0,
    ) -> None:
        self._most_bytes, self._most_s = 1e6 * most_mb, most_s
        self._is_split = most_mb > 0.0 or most_s > 0.0
        path = path.absolute()
        whole = path.with_suffix('') if self._is_split else path
        self.path = free_name(whole, is_folder=self._is_split)
        self._topics = topics
        self._kind = FLOAT64_ARRAY if command_type == NO_COMMAND else command_type
        self._number = 0
        self._is_open = False
        self._newest_ns: int | None = None
        self._shift_ns = 0
        self._began: float | None = None
        self._begin()

    def write_event(self, event: Event, engine: Engine) -> None:
        """Write an event that took effect; `engine` has the settings in force.

        Changes before the first sample are part of the settings with which the record opens.
        """
        if not self._is_open:
            if isinstance(event, (SettingsChange, Reset)):
                return
            self._is_open = True
            opening = SettingsChange(max(event.stamp_ns - 1, 0), _changeable(engine))
            self._writer.write_event(opening)
        if self._began is None:
            self._began = time.monotonic()
        self._writer.write_event(event, self._log_ns(event.stamp_ns))

    def write_outputs(self, outputs: Outputs) -> None:
        """Write what was published of one estimate."""
        write_outputs(self._writer, self._topics.predictions, outputs)

    def flush(self) -> None:
        """Make everything written so far readable even if the process dies now."""
        self._writer.flush()
        if self._is_split and self._is_full():
            self._writer.close()
            self._begin()

    def close(self) -> None:
        """Complete the file."""
        self._writer.close()

    def give_up(self) -> None:
        """Leave the file as it is, readable up to the last chunk that is whole."""
        self._writer.give_up()

    def _begin(self) -> None:
        path = self.path
        if self._is_split:
            path = self.path / f'{self.path.name}_{self._number}.mcap'
        topics = self._topics
        self._writer = RecordingWriter(
            path, topics.joint_states, topics.command, self._kind, is_live=True
        )
        self._file, self._number = path, self._number + 1
        self._began = None

    def _is_full(self) -> bool:
        if self._began is None:
            return False
        is_large = 0.0 < self._most_bytes <= self._file.stat().st_size
        return is_large or 0.0 < self._most_s <= time.monotonic() - self._began

    def _log_ns(self, stamp_ns: int) -> int:
        """Return the log time of an event: its stamp, or later where a clock was set back.

        A reader goes by log time, so that it must not go back. A clock that comes and goes, as
        between the times of a simulation and of the wall, is moved by no more than that takes.
        """
        newest_ns = stamp_ns if self._newest_ns is None else self._newest_ns
        if abs(stamp_ns + self._shift_ns - newest_ns) > _JUMP_NS:
            self._shift_ns = max(newest_ns - stamp_ns, 0)
        self._newest_ns = max(newest_ns, stamp_ns + self._shift_ns)
        return self._newest_ns


def _changeable(engine: Engine) -> dict[str, SettingValue]:
    fixed = {s.name for s in describe_settings(engine.robot) if s.read_only}
    return {n: v for n, v in engine.config.to_mapping().items() if n not in fixed}
