"""Recordings as commands read them, and what is refused before anything is computed."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from sgp_ros.batch.command_kinds import has_gains, hold_targets, require_gains_of_velocity
from sgp_ros.batch.contradictions import require_sense, require_shared_motion
from sgp_ros.batch.recording_check import RecordingCheck, check_recording
from sgp_ros.engine.samples import CommandSample, Event
from sgp_ros.errors import RecordingError
from sgp_ros.recordings.messages import JOINT_STATE
from sgp_ros.recordings.reader import Recording, open_recording
from sgp_ros.recordings.topics import GAINS_TOPIC
from sgp_ros.robots.gains import Gains, checked_gains, read_gains
from sgp_ros.robots.nominal import Nominal
from sgp_ros.robots.robot import Robot

_ODOMETRY = ('nav_msgs/Odometry', 'geometry_msgs/PoseStamped')
_BASE_TOPICS = ('odom', 'base', 'floating')
_FAR_M, _FAR_TURN = 0.02, 0.02
"""Way [m] and change of the quaternion from which on a base moves."""


def read_events(
    bag: str, joint_states: str | None, command: str | None, remarks: list[str]
) -> list[Event]:
    """Return the events of a recording; what is wrong with it is appended to `remarks`.

    Raises:
        RecordingError: it cannot be read, or the base of the robot moves in it.
    """
    recording = open_recording(bag)
    _refuse_moving_base(recording)
    events = list(recording.events(joint_states, command))
    types = {topic.name: topic.type for topic in recording.topics}
    if types.get(GAINS_TOPIC) == JOINT_STATE:
        events = _with_gains(recording, events)
    elif GAINS_TOPIC in types:
        remarks.append(f'{GAINS_TOPIC} is not used: its type is {types[GAINS_TOPIC]}, '
                       f'not {JOINT_STATE}')  # fmt: skip
    remarks += recording.remarks
    return events


def _with_gains(recording: Recording, events: list[Event]) -> list[Event]:
    """Return events whose targets have the gains that are recorded beside them."""
    rows = sorted(recording.joint_samples(GAINS_TOPIC), key=lambda x: x.stamp_ns)
    stamps = [x.stamp_ns for x in rows]
    found: list[Event] = []
    for e in events:
        at = bisect_right(stamps, e.stamp_ns) - 1
        if isinstance(e, CommandSample) and at >= 0:
            kp, kd = rows[at].position, rows[at].velocity
            if kd is None:
                raise RecordingError(
                    f'{recording.path.name}: no kd in {GAINS_TOPIC}',
                    'kp as position and kd as velocity of each joint',
                )  # fmt: skip
            pairs = zip(map(float, kp), map(float, kd), strict=True)
            gains = dict(zip(rows[at].names, pairs, strict=True))
            found.append(replace(e, gains=gains))
        else:
            found.append(e)
    return found


def checked(
    recordings: Mapping[str, Iterable[Event]], robot: Robot, gains: Gains | None,
    remarks: list[str], simulation: Iterable[Event] | None = None,
) -> dict[str, RecordingCheck]:  # fmt: skip
    """Return the contents of recordings, by stem; oddities are appended to `remarks`.

    Args:
        recordings: events by stem.
        robot: whose joints are looked for.
        gains: of drives whose commands are targets; None where they are not known.
        remarks: of the user.
        simulation: events of a simulation that is to be compared; None without.

    Raises:
        RecordingError: one contradicts itself, or shares no motion with the simulation.
    """
    found = {stem: check_recording(events, robot, gains) for stem, events in recordings.items()}
    for stem, check in found.items():
        require_sense(stem, check.refusals)
        head = '' if len(found) == 1 else f'{stem}: '
        remarks += [f'{head}{said}' for said in check.remarks]
    if simulation is not None:
        theirs = check_recording(simulation, robot, gains).moving
        remarks += require_shared_motion([c.moving for c in found.values()], theirs)
    return found


def gains_of(
    path: str | None, nominal: Nominal, events: Iterable[Event], remarks: list[str]
) -> Gains | None:
    """Return the gains of drives that hold targets: given, recorded, or those of the robot's file.

    The last apply where the commands are targets: by the type of their messages, or, where that
    says nothing, because positions follow them.

    Args:
        path: of a file of gains; None without.
        nominal: the robot.
        events: of a recording.
        remarks: what was decided is appended here.

    Raises:
        ConfigError: gains that are not those of the robot.
        RecordingError: targets of velocity beside gains of a position.
    """
    tree, stated = nominal.tree, nominal.robot.source.get('gains')
    names = tree.moving_names
    driven = [name for name, on in zip(names, tree.is_actuated, strict=False) if on]
    known = list(events)
    if path is not None:
        found = read_gains(Path(path), names, driven)
        if has_gains(known):
            remarks.append('The given gains are used, not those recorded with the targets.')
    elif has_gains(known):
        found = Gains(np.ones(len(names)), np.ones(len(names)), is_recorded=True)
    elif stated is None or not hold_targets(known, nominal.robot):
        return None
    else:
        remarks.append('The commands are targets: the gains of the robot file are used.')
        found = checked_gains(stated, 'gains of the robot', names, driven)
    require_gains_of_velocity(known, found)
    return found


def _refuse_moving_base(recording: Recording) -> None:
    """Refuse a recording whose odometry moves: the base is taken to be fixed to the ground.

    Raises:
        RecordingError: with the topic and how far it moves.
    """
    for topic in recording.topics:
        plain = topic.type.replace('/msg/', '/')
        if plain not in _ODOMETRY or not any(word in topic.name for word in _BASE_TOPICS):
            continue
        poses = [
            pose.pose if hasattr(pose, 'pose') else pose
            for _, message in recording.messages(topic.name)
            for pose in (message.pose,)
        ]
        if len(poses) < 2:
            continue
        place = np.array([[p.position.x, p.position.y, p.position.z] for p in poses])
        turn = np.array([
            [p.orientation.w, p.orientation.x, p.orientation.y, p.orientation.z] for p in poses
        ])  # fmt: skip
        way = float(np.linalg.norm(np.ptp(place, axis=0)))
        turned = float(np.abs(1.0 - np.abs(turn @ turn[0])).max())
        if way > _FAR_M or turned > _FAR_TURN:
            raise RecordingError(
                f'the base moves {way:.3g} m in {topic.name}',
                'a base that is fixed to the ground',
                'record the robot on a stand, or remove the parts in which the base moves',
            )  # fmt: skip
