"""Verdict on the messages that arrive: whether they can be used, and what to do if not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sgp_ros.recordings.command_types import NO_COMMAND

OK, WARN, ERROR = 0, 1, 2
"""Levels of a DiagnosticStatus."""

_FEW = 20
LOST_SHARE = 0.01


@dataclass(frozen=True, slots=True)
class Arrivals:
    """Messages received between two diagnostics, and their sources.

    Attributes:
        joint_states, command: full topic names.
        publishers: of joint states, full names of their nodes.
        command_publishers: of commands.
        robot_joints: joints that the robot wants.
        command_type: as the setting `command.type`.
        seen_joints: joints that the last joint states named.
        without_effort: joints without a finite effort in the last state.
        missing_joints: joints that no message names.
        shared_joints: joints of which several publishers tell.
        silent_joints, losing_joints: joints of which no message came, and some were lost.
        received, lost: messages that came, and those missing by the period of their source.
        read, estimated: states that came, and equations they gave.
        refused: states refused, by reason.
        commands_read, commands_refused: the same for commands.
        unreadable: messages that were no samples.
        unreadable_reason: of the last of these.
    """

    joint_states: str
    command: str
    robot_joints: tuple[str, ...]
    publishers: tuple[str, ...] = ()
    command_publishers: int = 0
    command_type: str = ''
    seen_joints: tuple[str, ...] = ()
    without_effort: tuple[str, ...] = ()
    missing_joints: tuple[str, ...] = ()
    shared_joints: tuple[str, ...] = ()
    silent_joints: tuple[str, ...] = ()
    losing_joints: tuple[str, ...] = ()
    received: int = 0
    lost: int = 0
    read: int = 0
    estimated: int = 0
    refused: Mapping[str, int] = field(default_factory=dict)
    commands_read: int = 0
    commands_refused: Mapping[str, int] = field(default_factory=dict)
    unreadable: int = 0
    unreadable_reason: str = ''


def judge(arrivals: Arrivals) -> tuple[int, str]:
    """Return level and sentence."""
    if arrivals.read == 0:
        return _nothing(arrivals)
    return (
        _most_refused(arrivals)
        or _two_publishers(arrivals)
        or _some_lost(arrivals)
        or (OK, 'all joint states are used')
    )


def _most_refused(arrivals: Arrivals) -> tuple[int, str] | None:
    reason, count = _most(arrivals.refused)
    if 2 * count > arrivals.read:
        remedy = _state_remedy(reason, arrivals)
        return ERROR, (
            f'{count} of {arrivals.read} joint states of joints {list(arrivals.robot_joints)} '
            f'refused, {reason}: {remedy}'
        )
    reason, commands = _most(arrivals.commands_refused)
    if 2 * commands > arrivals.commands_read:
        remedy = _command_remedy(reason, arrivals)
        read = arrivals.commands_read
        return ERROR, (
            f'{commands} of {read} commands of joints {list(arrivals.robot_joints)} refused, '
            f'{reason}: {remedy}'
        )
    return None


def _two_publishers(arrivals: Arrivals) -> tuple[int, str] | None:
    if not arrivals.shared_joints:
        return None
    return WARN, (
        f'joints {list(arrivals.shared_joints)} are published by several nodes on '
        f'{arrivals.joint_states}: {", ".join(arrivals.publishers)}; stop all '
        'but one, or remap them'
    )


def _some_lost(arrivals: Arrivals) -> tuple[int, str] | None:
    if arrivals.lost > LOST_SHARE * (arrivals.received + arrivals.lost):
        return WARN, (
            f'{arrivals.lost} of {arrivals.received + arrivals.lost} messages on '
            f'{arrivals.joint_states} are missing, judging by their period, of joints '
            f'{list(arrivals.losing_joints)}: the source paused, or '
            'messages were lost; raise qos.depth and the receive buffer of the socket, or reduce '
            'the load of computer and network'
        )
    return _some_unreadable(arrivals) or _some_refused(arrivals) or _no_equation(arrivals)


def _some_unreadable(arrivals: Arrivals) -> tuple[int, str] | None:
    if not arrivals.unreadable:
        return None
    return WARN, (
        f'{arrivals.unreadable} messages on {arrivals.joint_states} or {arrivals.command} could '
        f'not be read: {arrivals.unreadable_reason}; correct the node that publishes them: '
        f'{", ".join(arrivals.publishers)}'
    )


def _some_refused(arrivals: Arrivals) -> tuple[int, str] | None:
    each = [
        f'{count} of {arrivals.read} joint states refused, {reason}: '
        f'{_state_remedy(reason, arrivals)}'
        for reason, count in arrivals.refused.items()
        if count
    ] + [
        f'{count} of {arrivals.commands_read} commands on {arrivals.command} refused, {reason}: '
        f'{_command_remedy(reason, arrivals)}'
        for reason, count in arrivals.commands_refused.items()
        if count
    ]
    if not each:
        return None
    return WARN, f'joints {list(arrivals.robot_joints)}: {"; ".join(each)}'


def _no_equation(arrivals: Arrivals) -> tuple[int, str] | None:
    if arrivals.read < _FEW or arrivals.estimated:
        return None
    return WARN, (
        f'{arrivals.read} joint states of joints {list(arrivals.robot_joints)} gave no equation: '
        'too few of them per filter.window; increase filter.window'
    )


def _nothing(arrivals: Arrivals) -> tuple[int, str]:
    if arrivals.unreadable:
        return ERROR, (
            f'none of {arrivals.unreadable} joint states could be read: '
            f'{arrivals.unreadable_reason}; correct the node that publishes '
            f'{arrivals.joint_states}: '
            f'{", ".join(arrivals.publishers)}'
        )
    if arrivals.received:
        return _no_state(arrivals)
    if not arrivals.publishers:
        remedy = 'start the robot, or remap with --ros-args -r joint_states:=/your/topic'
        return WARN, f'no publisher on {arrivals.joint_states}; {remedy}'
    return WARN, (
        f'no message on {arrivals.joint_states} from {len(arrivals.publishers)} publisher(s); '
        'check that the robot runs and that the QoS reliability is compatible'
    )


def _no_state(arrivals: Arrivals) -> tuple[int, str]:
    """Say why messages gave no state of all joints."""
    missing, wanted = list(arrivals.missing_joints), list(arrivals.robot_joints)
    remedy = 'use a robot file with the published joints'
    if missing == wanted:
        return ERROR, (
            f'{arrivals.joint_states} contains the joints {list(arrivals.seen_joints)}, the robot '
            f'has {wanted}; {remedy}'
        )
    if missing:
        return ERROR, (
            f'no message on {arrivals.joint_states} contains the joints {missing} of the robot; '
            f'publish them, or {remedy}'
        )
    return WARN, (
        f'{arrivals.received} messages on {arrivals.joint_states}, none with joints '
        f'{list(arrivals.silent_joints)}: one of {", ".join(arrivals.publishers)} has stopped; '
        'start it again'
    )


def _state_remedy(reason: str, arrivals: Arrivals) -> str:
    names, wanted = list(arrivals.seen_joints), list(arrivals.robot_joints)
    return {
        'unknown_joint': (
            f'they contain the joints {names}, the robot has {wanted}; set parameter robot to a '
            'file with these joint names'
        ),
        'unpaired': _effort_remedy(arrivals)
        if arrivals.command_type == NO_COMMAND
        else (
            f'no command on {arrivals.command} ({arrivals.command_publishers} publishers) within '
            'command.timeout before them; check the topic, command.type and both clocks'
        ),
        'late': 'they arrived later than reorder_window allows; raise it, or check the network',
        'clock': 'their stamps are far from those of other states; check the clock of the source',
        'wrong_length': 'the numbers of positions, velocities or efforts and of names differ',
        'implausible': 'they are far beyond the limits of the robot file; check units and sensors',
        'reset': 'they still waited to be sorted when everything was reset; nothing to do',
        'error': 'an internal error; please report the first one in the log',
        'duplicate': 'stamps repeat; look for several publishers, or a source without stamps',
        'stale': 'the driver sends old numbers again under new stamps; check its rate and bus',
        'nonfinite': 'positions or velocities are not finite; check the sensors',
        'gap': 'pauses are longer than max_gap; raise max_gap or the publishing rate',
    }.get(reason, 'see docs/bringup.md')


def _effort_remedy(arrivals: Arrivals) -> str:
    named = f'joints {list(arrivals.without_effort)}' if arrivals.without_effort else 'some joints'
    return (
        f'no effort for {named}; make the driver publish it (with '
        'ros2_control: state_interface effort), or set command.type and topic command'
    )


def _command_remedy(reason: str, arrivals: Arrivals) -> str:
    return {
        'wrong_kind': (
            'expected efforts, but the commands are position targets; state the gains of the '
            'drives in the robot file, or set command.type to none and publish the effort in the '
            'joint states'
        ),
        'wrong_length': 'expected one number per joint of command.joints',
        'unknown_joint': f'the robot has the joints {list(arrivals.robot_joints)}',
        'late': 'older than reorder_window on arrival; check the clocks',
        'clock': 'their stamps are far from those of the states; check the clocks',
        'nonfinite': 'numbers are not finite; check the controller',
        'reset': 'they still waited to be sorted when everything was reset; nothing to do',
        'error': 'an internal error; please report the first one in the log',
    }.get(reason, 'see docs/bringup.md')


def _most(counts: Mapping[str, int]) -> tuple[str, int]:
    return max(counts.items(), key=lambda item: item[1], default=('', 0))
