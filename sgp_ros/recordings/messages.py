"""ROS messages beside the commands: their samples, and how they are built.

A message is read by its fields only, and built by what is given for making messages, so the same
functions serve messages of rclpy (in the node) and of rosbags (in a file): what is live and what
is recorded cannot differ here. NaN stays in a sample, the engine refuses and counts it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from sgp_ros.engine.samples import JointSample, Reset, SettingsChange, SettingValue, frozen_array
from sgp_ros.errors import MessageError

Message = Any
"""A ROS message of any library; its fields are those of its definition."""

Make = Callable[..., Message]
"""Makes a message from its type `package/Type` and all its fields as keywords: numbers, texts,
messages, lists of these, (n,) arrays, and bytes of length one for an octet."""

JOINT_STATE = 'sensor_msgs/JointState'
DIAGNOSTICS = 'diagnostic_msgs/DiagnosticArray'
TEXT = 'std_msgs/String'

_NONE = np.zeros(0)
_SECOND_NS = 1_000_000_000
_MOST_NS = 1 << 62
"""Greatest stamp and least: differences fit into 64 bits; headers hold up to 1 << 32 seconds."""
_MOST_INTEGER = 1 << 63
_CHANGE = '{"change": "settings" or "reset", "stamp_ns": integer, "settings": {...}}'


class Status(NamedTuple):
    """One entry of a DiagnosticArray.

    Attributes:
        name: of what is described.
        level: 0 ok, 1 warning, 2 error, 3 stale.
        message: one sentence.
        hardware_id: of the device.
        values: key to value, in order.
    """

    name: str
    level: int
    message: str
    hardware_id: str
    values: Mapping[str, str]


class Point(NamedTuple):
    """The one point of a trajectory: (k,) each, or empty where there is nothing to say.

    Attributes:
        positions: [rad] or [m].
        velocities: [rad/s] or [m/s].
        accelerations: [rad/s^2] or [m/s^2].
        effort: [N m] or [N].
    """

    positions: np.ndarray = _NONE
    velocities: np.ndarray = _NONE
    accelerations: np.ndarray = _NONE
    effort: np.ndarray = _NONE


def joint_sample(message: Message, receipt_ns: int) -> JointSample:
    """Return the state that a `sensor_msgs/JointState` holds.

    Args:
        message: the JointState; empty `velocity` or `effort` means that the source has none.
        receipt_ns: log time or time of receipt [ns], taken where the header stamp is zero.

    Raises:
        MessageError: no joint, a repeated joint, or arrays whose lengths differ.
    """
    names = joint_names(message.name)
    return JointSample(
        stamp_ns(message, receipt_ns),
        names,
        matching(message.position, names, 'position'),
        matching(message.velocity, names, 'velocity') if len(message.velocity) else None,
        matching(message.effort, names, 'effort') if len(message.effort) else None,
    )


def stamp_ns(message: Message, receipt_ns: int) -> int:
    """Return the header stamp of `message`, or `receipt_ns` where it is zero [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * _SECOND_NS + int(stamp.nanosec) or receipt_ns


def require_stamp(stamp_ns: int) -> None:
    """Refuse a stamp [ns] that no clock has; arithmetic with it would overflow.

    Raises:
        MessageError: it is more than 146 years from 1970.
    """
    if abs(stamp_ns) > _MOST_NS:
        raise MessageError('a stamp after the year 2116', 'nanoseconds since 1970')


def joint_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return the joints that a message names.

    Raises:
        MessageError: none, or one of them twice.
    """
    return _checked(tuple(names))


@lru_cache(maxsize=256)
def _checked(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names that were equal first: all messages of a recording share one tuple."""
    if not names:
        raise MessageError('a message without joint names', 'one name per joint')
    if len(set(names)) != len(names):
        raise MessageError(f'repeated joint names in {list(names)}', 'each joint once')
    return names


def matching(values: Sequence[float], names: tuple[str, ...], what: str) -> np.ndarray:
    """Return one number per joint, (m,), read-only.

    Raises:
        MessageError: more or fewer numbers than names.
    """
    if len(values) != len(names):
        raise MessageError(
            f'{what} of length {len(values)}', f'length {len(names)}, one per joint name'
        )
    return frozen_array(values)


def header(make: Make, stamp_ns: int) -> Message:
    """Return a header with this stamp [ns]."""
    sec, nanosec = divmod(stamp_ns, _SECOND_NS)
    stamp = make('builtin_interfaces/Time', sec=sec, nanosec=nanosec)
    return make('std_msgs/Header', stamp=stamp, frame_id='')


def joint_state_message(make: Make, sample: JointSample) -> Message:
    """Return a `sensor_msgs/JointState`; what the sample lacks stays empty."""
    return make(
        JOINT_STATE,
        header=header(make, sample.stamp_ns),
        name=list(sample.names),
        position=sample.position,
        velocity=_NONE if sample.velocity is None else sample.velocity,
        effort=_NONE if sample.effort is None else sample.effort,
    )


def trajectory_message(make: Make, stamp_ns: int, names: Sequence[str], point: Point) -> Message:
    """Return a `trajectory_msgs/JointTrajectory` of one point, at its stamp [ns]."""
    return make(
        'trajectory_msgs/JointTrajectory',
        header=header(make, stamp_ns),
        joint_names=list(names),
        points=[
            make(
                'trajectory_msgs/JointTrajectoryPoint',
                positions=point.positions,
                velocities=point.velocities,
                accelerations=point.accelerations,
                effort=point.effort,
                time_from_start=make('builtin_interfaces/Duration', sec=0, nanosec=0),
            )
        ],
    )


def diagnostics_message(make: Make, stamp_ns: int, statuses: Iterable[Status]) -> Message:
    """Return a `diagnostic_msgs/DiagnosticArray` at this stamp [ns]."""
    return make(
        DIAGNOSTICS,
        header=header(make, stamp_ns),
        status=[
            make(
                'diagnostic_msgs/DiagnosticStatus',
                level=bytes([status.level]),
                name=status.name,
                message=status.message,
                hardware_id=status.hardware_id,
                values=[
                    make('diagnostic_msgs/KeyValue', key=key, value=value)
                    for key, value in status.values.items()
                ],
            )
            for status in statuses
        ],
    )


def change_to_text(change: SettingsChange | Reset) -> str:
    """Return a change of settings as one line of JSON that reads back exactly.

    A float has the shortest digits that give the same float, an array is a list. JSON keeps `1`
    and `1.0` apart, so the types of the settings survive.
    """
    if isinstance(change, Reset):
        return json.dumps({'change': 'reset', 'stamp_ns': change.stamp_ns})
    return json.dumps(
        {
            'change': 'settings',
            'stamp_ns': change.stamp_ns,
            'settings': dict(change.settings),
        }
    )


def change_from_text(text: str) -> SettingsChange | Reset:
    """Return the change that `change_to_text` wrote.

    Raises:
        MessageError: the text is something else, or holds numbers beyond 64 bits.
    """
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise MessageError('a settings change that is not JSON', _CHANGE) from error
    if not isinstance(content, dict) or type(content.get('stamp_ns')) is not int:
        raise MessageError('a settings change without a stamp', _CHANGE)
    require_stamp(content['stamp_ns'])
    if content.get('change') == 'reset':
        return Reset(content['stamp_ns'])
    settings = content.get('settings')
    if content.get('change') != 'settings' or not isinstance(settings, dict):
        raise MessageError('a settings change of unknown kind', _CHANGE)
    values = {name: _setting(name, value) for name, value in settings.items()}
    return SettingsChange(content['stamp_ns'], values)


def _setting(name: str, value: object) -> SettingValue:
    values = value if isinstance(value, list) else [value]
    if any(isinstance(x, int) and abs(x) >= _MOST_INTEGER for x in values):
        raise MessageError(f'setting {name} with an integer beyond 64 bits', 'a smaller one')
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, list):
        if all(isinstance(item, str) for item in value):
            return tuple(value)
        if all(isinstance(item, (int, float)) for item in value):
            return tuple(value)
    raise MessageError(
        f'setting {name} of an unsupported type', 'a number, a string or a list of one of them'
    )
