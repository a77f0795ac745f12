"""Tables written as recordings, with the map that was used and the gains that they state."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sgp_ros.engine.samples import POSITION, VELOCITY, CommandSample, JointSample
from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.recordings.table_entries import JointHint
from sgp_ros.recordings.table_files import load_columns
from sgp_ros.recordings.table_formats import feature_names
from sgp_ros.recordings.table_gains import is_recorded
from sgp_ros.recordings.table_groups import one_recording
from sgp_ros.recordings.table_guess import guess_map
from sgp_ros.recordings.table_map import read_map
from sgp_ros.recordings.table_time import approach
from sgp_ros.recordings.table_turns import TURN, counted_on
from sgp_ros.recordings.table_units import ANGLES
from sgp_ros.recordings.tables import Table, read_table
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.strangers import replace_file

_OUTSIDE = 0.5
"""Ranges beyond the limits from which on positions contradict them: stops give way by less."""
_GAP = 5.0
"""Steps without a row that count as a gap."""


@dataclass(frozen=True, slots=True)
class ImportSummary:
    """Result of `import_table`.

    Attributes:
        path: of the recording.
        joints: names of the joints.
        samples: number of states.
        commands: number of commands.
        start_ns: least stamp [ns].
        end_ns: greatest stamp [ns].
        remarks: what was left out of the table.
        unsure: what the guess of a map may have wrong.
        map_path: of the map that was guessed; None where one was given.
        gains_path: of the gains that the table or its map states; None without.
        quality: counts of missing numbers, gaps, backward and repeated stamps.
        has_poses: whether the rows were recognised as settled poses.
    """

    path: Path
    joints: tuple[str, ...]
    samples: int
    commands: int
    start_ns: int
    end_ns: int
    remarks: tuple[str, ...] = ()
    unsure: tuple[str, ...] = ()
    map_path: Path | None = None
    gains_path: Path | None = None
    quality: Mapping[str, Any] = field(default_factory=dict)
    has_poses: bool = False

    def to_mapping(self) -> dict[str, object]:
        """Return the summary as JSON holds it."""
        lists = {k: list(getattr(self, k)) for k in ('joints', 'remarks', 'unsure')}
        files = (self.path, self.map_path, self.gains_path)
        names = dict(zip(('path', 'map_path', 'gains_path'), files, strict=True))
        return {
            **asdict(self), **lists, **{k: None if p is None else str(p) for k, p in names.items()}
        }  # fmt: skip


def import_table(
    path: str | Path, map_path: str | Path | None, out: str | Path,
    hints: Sequence[JointHint] = (), rate_hz: float | None = None,
    require: Callable[[Iterable[JointSample | CommandSample]], None] = lambda _: None,
    group: str | None = None,
) -> ImportSummary:  # fmt: skip
    """Write a table as an MCAP recording.

    Args:
        path: a table, see `load_columns`.
        map_path: YAML map, see `table_map`; None to guess one, which is written beside.
        out: `.mcap` file to write, or the folder to write `<name of the table>.mcap` into, which
            is made; an existing file is replaced.
        hints: joints of the robot, for a guess.
        rate_hz: of a table without times, for a guess; None where it has some.
        require: called with what is to be written; what it raises is raised.
        group: of the file, whose columns alone are read, without its name; None for all.

    Raises:
        ConfigError: what is wrong with the map.
        RecordingError: the table cannot be read.
    """
    path, out = Path(path), Path(out)
    remarks: list[str] = []
    columns, lines = load_columns(path, remarks)
    loaded = one_recording(path, columns, group, is_guessed=map_path is None), lines
    unsure: list[str] = []
    if map_path is None:
        guess = guess_map(loaded[0], hints, feature_names(path), rate_hz)
        content, unsure = guess.content, guess.unsure
    else:
        content = dict(read_map(map_path))
    table = _counted_on(read_table(path, content, loaded), _units(content), hints)
    require(table.events())
    out_path = out if out.suffix == '.mcap' else out / f'{path.stem}.mcap'
    out_path.parent.mkdir(parents=True, exist_ok=True)
    with RecordingWriter(out_path, command_type=table.command_type) as writer:
        for event in table.events():
            writer.write_event(event)
    n = len(table.stamps_ns)
    return ImportSummary(
        out_path, table.joints, n, n if table.commands is not None else 0, min(table.stamps_ns),
        max(table.stamps_ns), (*remarks, *table.remarks), tuple(unsure),
        _written(out_path, 'map', content) if map_path is None else None,
        _gains(out_path, content.get('gains')), quality(table),
        has_poses=map_path is None and bool(approach(loaded[0], content['time'])),
    )  # fmt: skip


def _counted_on(table: Table, units: Mapping[str, str], hints: Sequence[JointHint]) -> Table:
    """Return a table whose angles, and targets of these, do not wrap; a remark says of which.

    Raises:
        RecordingError: angles that are stated in degrees or turns are far out of the limits.
    """
    hinted = {h.name: h for h in hints}
    channels, asked = dict(table.channels), table.commands
    seconds = (np.array(table.stamps_ns) - table.stamps_ns[0]) * 1e-9
    changed = []
    for j, name in enumerate(table.joints):
        hint = hinted.get(name, JointHint(name))
        if hint.slides or not (name in hinted or units.get(name) in ANGLES):
            continue
        angle = table.channels[POSITION][:, j]
        speed = table.channels[VELOCITY][:, j] if VELOCITY in table.channels else None
        found = counted_on(angle, seconds, speed, (hint.lower, hint.upper))
        _require_near(found, units.get(name, ''), hint)
        if np.array_equal(found, angle):
            continue
        changed.append(name)
        channels[POSITION] = _with_column(channels[POSITION], j, found)
        if asked is not None and table.command_kind == POSITION and name in table.command_joints:
            c = table.command_joints.index(name)
            away = TURN * np.round((found - asked[:, c]) / TURN)  # less than half a turn is left
            asked = _with_column(asked, c, asked[:, c] + away)
    if not changed:
        return table
    said = f'angles of {", ".join(changed)} wrap: counted on, and shifted by whole turns'
    return replace(table, channels=channels, commands=asked, remarks=(*table.remarks, said))


def _units(content: Mapping[str, Any]) -> dict[str, str]:
    """Return the unit of the position of each joint that has one in a checked map."""
    joints = content['joints'].items()
    return {str(joint): x[POSITION]['unit'] for joint, x in joints if POSITION in x}


def _with_column(array: np.ndarray, j: int, column: np.ndarray) -> np.ndarray:
    found = array.copy()
    found[:, j] = column
    return found


def _require_near(angle: np.ndarray, unit: str, hint: JointHint) -> None:
    """Refuse angles that are no radians, and far out of the limits of a joint."""
    one, width = ANGLES.get(unit, 1.0), hint.upper - hint.lower
    if one == 1.0 or not (np.isfinite(width) and width > 0.0):
        return
    low, high = float(angle.min()), float(angle.max())
    if low < hint.lower - _OUTSIDE * width or high > hint.upper + _OUTSIDE * width:
        raise RecordingError(
            f'the positions of {hint.name} go from {low / one:.4g} to {high / one:.4g} {unit}',
            f'its limits, {hint.lower / one:.4g} to {hint.upper / one:.4g} {unit}',
            'state its zero (`offset`) or gear ratio (`scale`) in a map, or omit --robot if its '
            'limits are wrong',
        )  # fmt: skip


def quality(table: Table) -> dict[str, Any]:
    """Return the median rate [Hz] and counts of what is missing or out of order."""
    steps = np.diff(np.array(table.stamps_ns, dtype=np.float64)) * 1e-9
    forward = steps[steps > 0.0]
    usual = float(np.median(forward)) if len(forward) else 0.0
    asked = {'command': table.commands} if table.commands is not None else {}
    return {
        'rate_hz': 1.0 / usual if usual > 0.0 else 0.0,
        'gaps': int((steps > _GAP * usual).sum()) if usual > 0.0 else 0,
        'backward': int((steps < 0.0).sum()),
        'repeated': int((steps == 0.0).sum()),
        'missing': {name: _missing(x) for name, x in {**table.channels, **asked}.items()},
    }


def _missing(numbers: np.ndarray) -> int:
    """Return how many numbers (n, k) are missing of joints that have any."""
    is_nan = np.isnan(numbers)
    return int(is_nan[:, ~is_nan.all(axis=0)].sum())


def _gains(out_path: Path, stated: object) -> Path | None:
    """Write the gains of a map as the file that `--gains` takes."""
    if stated is None or is_recorded(stated):  # those of each row are in the recording
        return None
    if not isinstance(stated, dict) or not {'kp', 'kd'} <= set(stated):
        raise ConfigError(f'map: gains is {stated!r}', 'kp and kd for each joint')
    return _written(out_path, 'gains', stated)


def _written(out_path: Path, what: str, content: Mapping[str, Any]) -> Path:
    path = out_path.with_name(f'{out_path.stem}_{what}.yaml')
    text = yaml.safe_dump(dict(content), sort_keys=False, allow_unicode=True)
    replace_file(path, lambda stream: stream.write(text.encode()))
    return path
