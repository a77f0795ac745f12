"""`sgp check`: what a recording holds, and what is refused before anything is made of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sgp_ros.apps.recorded import read_events
from sgp_ros.batch.command_kinds import hold_targets
from sgp_ros.batch.recording_check import check_recording
from sgp_ros.cli import main
from sgp_ros.engine.samples import (
    EFFORT,
    POSITION,
    VELOCITY,
    CommandSample,
    JointSample,
    frozen_array,
)
from sgp_ros.errors import RecordingError
from sgp_ros.recordings.messages import JOINT_STATE
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.typestore import new_message
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.report.check import position_charts
from sgp_ros.robots.registry import load_robot
from test.report.pages import content_of

ROOT = Path(__file__).parents[2]

MJCF = """<mujoco model="swing"><compiler angle="radian"/><worldbody><body pos="0 0 1">
<joint name="hinge" axis="0 1 0" damping="0.2" range="-3 3" limited="true"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1.5"/></body></worldbody>
<actuator>%s</actuator></mujoco>"""
MOTOR, SERVO = '<motor joint="hinge"/>', '<position joint="hinge" kp="9" kv="1"/>'
SECOND = 10**9


def _robot(folder, actuator=MOTOR):
    (folder / 'swing.xml').write_text(MJCF % actuator)
    return str(folder / 'swing.xml')


def _states(t, q, effort=None):
    return [
        JointSample(
            SECOND + round(x * 1e9), ('hinge',), frozen_array([y]), None,
            None if effort is None else frozen_array([effort[i]]),
        )
        for i, (x, y) in enumerate(zip(t, q, strict=True))
    ]  # fmt: skip


def _commands(t, values, kind, names=('hinge',)):
    return [
        CommandSample(SECOND + round(x * 1e9), frozen_array([y]), names, kind)
        for x, y in zip(t, values, strict=True)
    ]


T = np.arange(1000) * 0.01


def test_clock_motion_and_channels_are_reported(tmp_path):
    """Gaps, backward stamps and the share of the range, of samples as they came."""
    t = T + np.where(np.arange(1000) >= 500, 1.0, 0.0)
    t[700] = t[698]
    found = check_recording(_states(t, np.sin(T), np.cos(T)), load_robot(_robot(tmp_path)))
    assert found.rate_hz == pytest.approx(100.0)
    assert (found.gaps, found.backward, found.repeated) == (1, 1, 0)
    joint = found.joints['hinge']
    assert joint.moves
    assert joint.range_share == pytest.approx(2.0 / 6.0, rel=0.01)
    assert (joint.velocity, joint.effort) == (0.0, 1.0)
    assert any('1 gaps' in said for said in found.remarks)
    json.dumps(found.content(), allow_nan=False)


def test_a_still_joint_and_a_copied_target_are_named(tmp_path):
    rng = np.random.default_rng(0)
    robot = load_robot(_robot(tmp_path))
    still = check_recording(_states(T, 1e-4 * rng.normal(size=1000)), robot)
    assert any(
        'No motion above the noise, so not diagnosed: hinge' in said for said in still.remarks
    )
    assert any('Neither effort nor command for hinge' in said for said in still.remarks)
    q = np.sin(T)
    copied = check_recording([*_states(T, q), *_commands(T, q, POSITION)], robot)
    assert any('equals the measured position' in said for said in copied.remarks)


def test_the_kind_of_a_command_comes_from_its_type_or_from_the_motion(tmp_path):
    """Numbers without names are targets only where positions follow them."""
    robot, q = load_robot(_robot(tmp_path)), np.sin(T)
    states = _states(T, q)
    assert hold_targets([*states, *_commands(T, 5.0 * q, POSITION)], robot)
    assert hold_targets([*states, *_commands(T, q, VELOCITY)], robot)
    assert not hold_targets([*states, *_commands(T, np.sin(T + 0.05), EFFORT)], robot)
    assert hold_targets([*states, *_commands(T, np.sin(T + 0.05), EFFORT, None)], robot)
    assert not hold_targets([*states, *_commands(T, np.cos(9.0 * T), EFFORT, None)], robot)


def _odometry(x):
    point = new_message('geometry_msgs/Point', x=x, y=0.0, z=0.0)
    turn = new_message('geometry_msgs/Quaternion', x=0.0, y=0.0, z=0.0, w=1.0)
    pose = new_message('geometry_msgs/Pose', position=point, orientation=turn)
    stamp = new_message('builtin_interfaces/Time', sec=1, nanosec=0)
    head = new_message('std_msgs/Header', stamp=stamp, frame_id='world')
    return new_message('geometry_msgs/PoseStamped', header=head, pose=pose)


@pytest.mark.parametrize('way', [0.0, 0.5])
def test_a_moving_base_is_refused(tmp_path, way):
    path = tmp_path / 'walk.mcap'
    with RecordingWriter(path) as writer:
        for i, state in enumerate(_states(T[:50], np.sin(T[:50]))):
            writer.write_event(state)
            writer._write('/base_pose', 'geometry_msgs/PoseStamped', state.stamp_ns,
                          _odometry(way * i / 50))  # fmt: skip
    if way:
        with pytest.raises(RecordingError, match=r'the base moves 0\.49 m in /base_pose'):
            read_events(str(path), None, None, [])
    else:
        read_events(str(path), None, None, [])


@pytest.mark.long
def test_the_command_writes_json_with_the_set_up(tmp_path, capsys):
    """A pendulum whose encoder is turned by 0.2 rad cannot be told from one on a tilted base."""
    robot = _robot(tmp_path)
    words = ['simulate', robot, '--duration', '8', '--out', str(tmp_path), '--force']
    assert main(words) == 0
    with RecordingWriter(tmp_path / 'turned.mcap') as writer:
        for event in open_recording(tmp_path / 'swing.mcap').events():
            is_state = isinstance(event, JointSample)
            turned = replace(event, position=event.position + 0.2) if is_state else event
            writer.write_event(turned)
    out = tmp_path / 'out'
    words = ['check', str(tmp_path / 'turned.mcap'), '--robot', robot, '--out', str(out)]
    assert main(words) == 0
    found = json.loads((out / 'check.json').read_text())
    page = content_of((out / 'report.html').read_text())
    assert 'can be diagnosed' in page
    assert 'cannot separate missing physics from' in page
    assert '<svg class="robot"' in page
    assert found['setup'] == []
    assert found['equivalents'] == [[['hinge', 'encoder_offset']]]
    assert (
        'cannot separate missing physics from encoder offset of hinge' in capsys.readouterr().out
    )


def test_gains_of_the_model_are_used_where_positions_are_commanded(tmp_path, capsys):
    """A position actuator of the MJCF needs no file of gains; velocity targets want kp 0."""
    robot, names = _robot(tmp_path, SERVO), ('hinge',)
    with RecordingWriter(tmp_path / 'log.mcap', command_type=JOINT_STATE) as writer:
        for state, command in zip(_states(T, np.sin(T)), _commands(T, np.cos(T), VELOCITY, names),
                                  strict=True):  # fmt: skip
            writer.write_event(command)
            writer.write_event(state)
    out = str(tmp_path / 'out')
    assert main(['diagnose', str(tmp_path / 'log.mcap'), '--robot', robot, '--out', out]) == 2
    said = capsys.readouterr().err
    assert 'the commands are velocity targets, but kp is not 0; expected kp 0' in said
    assert said.count('\n') == 1


@pytest.mark.long
def test_given_gains_are_refused_where_wrong_and_kept_for_the_next_command(tmp_path, capsys):
    """The next command has them too; without, it would refuse the targets."""
    t = np.arange(0.0, 4.0, 0.01)
    target = 0.8 * np.sin(2.0 * t)
    bag, robot, gains = tmp_path / 'a.mcap', _robot(tmp_path), tmp_path / 'gains.yaml'
    with RecordingWriter(bag, command_type=JOINT_STATE) as writer:
        for event in (*_states(t, target), *_commands(t, target, POSITION)):
            writer.write_event(event)
    words = ['check', str(bag), '--robot', robot, '--gains', str(gains)]
    words += ['--out', str(tmp_path / 'out')]
    gains.write_text('kp: [9, 9]\nkd: [1, 1]\n')
    assert main(words) == 2
    assert 'kp is 2 numbers without names' in capsys.readouterr().err
    gains.write_text('kp: {hinge: 9}\nkd: {hinge: 1}\n')
    assert main(words) == 0
    assert f'--gains {gains}' in capsys.readouterr().out.splitlines()[-1]


def test_a_robot_without_any_inertia_is_checked(tmp_path):
    """Laws that need one are left out; nothing else is known of an axis on a bench."""
    robot = str(ROOT / 'config' / 'robots' / 'revolute_axis.urdf')
    out = str(tmp_path)
    assert main(['simulate', robot, '--duration', '4', '--out', out, '--quiet']) == 0
    bag = str(tmp_path / 'revolute_axis.mcap')
    assert main(['check', bag, '--robot', robot, '--out', out, '--quiet']) == 0


@pytest.mark.parametrize('value', [np.nan, np.inf])
def test_a_recording_without_a_finite_position_is_checked(value, tmp_path, capsys):
    with RecordingWriter(tmp_path / 'x.mcap') as writer:
        for state in _states(T, np.full(len(T), value), np.cos(T)):
            writer.write_event(state)
    words = ['check', str(tmp_path / 'x.mcap'), '--robot', _robot(tmp_path)]
    assert main([*words, '--out', str(tmp_path / 'out')]) == 0
    assert 'No motion above the noise, so not diagnosed: hinge' in capsys.readouterr().out
    assert '<td data-label="to">none' in (tmp_path / 'out' / 'report.html').read_text()


def test_a_position_is_not_drawn_across_a_gap(tmp_path):
    """Nobody knows how the joint moved there."""
    t = T[:40] + np.where(np.arange(40) >= 20, 1.0, 0.0)
    (chart,) = position_charts(_states(t, t), load_robot(_robot(tmp_path))).values()
    assert np.flatnonzero(np.isnan(chart.series[0].y)).tolist() == [20]
    assert t[19] < chart.x[20] + t[0] < t[20]
