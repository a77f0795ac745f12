"""Gains that change with time: from a table into a recording, and from there into efforts."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from sgp_ros.apps.recorded import gains_of, read_events
from sgp_ros.cli import main
from sgp_ros.diagnosis.compare.trajectory import Bandwidth, collect, observe
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.errors import RecordingError
from sgp_ros.recordings.typestore import full_type
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot

MJCF = """<mujoco model="swing"><compiler angle="radian"/><worldbody><body pos="0 0 1">
<joint name="hinge" axis="0 1 0" damping="0.2" range="-3 3" limited="true"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1.5"/></body></worldbody>
<actuator><motor joint="hinge"/></actuator></mujoco>"""
T = np.arange(1200) * 0.005
Q = np.sin(3.0 * T)
TARGET = Q + 0.2 * np.cos(2.0 * T)
KP = np.where(T < 3.0, 40.0, 15.0)
KD = 2.0 + np.sin(T) ** 2


@pytest.fixture(scope='module')
def robot(tmp_path_factory):
    path = tmp_path_factory.mktemp('robot') / 'swing.xml'
    path.write_text(MJCF)
    return str(path)


def _imported(folder, robot, **columns):
    np.savez(folder / 'log.npz', t=T, q=Q[:, None], q_des=TARGET[:, None], **columns)
    words = ['import', str(folder / 'log.npz'), '--robot', robot, '--out', str(folder)]
    return main([*words, '--force']), folder / 'log.mcap'


@pytest.fixture(scope='module')
def bag(robot, tmp_path_factory):
    folder = tmp_path_factory.mktemp('log')
    status, path = _imported(folder, robot, kp=KP[:, None], kd=KD[:, None])
    assert status == 0
    return path


def test_gains_of_each_row_stand_beside_the_targets(bag, robot):
    said = yaml.safe_load((bag.parent / 'log_map.yaml').read_text())['gains']
    assert said == {x: {'hinge': {'column': x, 'index': 0}} for x in ('kp', 'kd')}
    assert not (bag.parent / 'log_gains.yaml').exists()
    commands = [e for e in read_events(str(bag), None, None, []) if isinstance(e, CommandSample)]
    np.testing.assert_allclose([c.gains['hinge'] for c in commands], np.column_stack([KP, KD]))


def test_efforts_follow_from_the_gains_in_force(bag, robot):
    """`tau = kp(t) (q_des - q) - kd(t) dq`, also behind a scale of the gains."""
    nominal, remarks = nominal_model(load_robot(robot)), []
    events = read_events(str(bag), None, None, remarks)
    gains = gains_of(None, nominal, events, remarks)
    assert gains.is_recorded
    raw = collect(events, nominal.robot, gains=gains)
    motion = observe(raw, nominal.tree, Bandwidth(25.0, 60.0))
    rows = np.abs(motion.time - 3.0) > 0.1  # away from the switch and the ends
    rows[:50], rows[-50:] = False, False
    held = 0.5 * (TARGET + np.roll(TARGET, 1))  # on average over a step to either side
    wanted = KP * (held - Q) - KD * 3.0 * np.cos(3.0 * T)
    np.testing.assert_allclose(motion.effort[rows, 0], wanted[: len(rows)][rows], atol=0.02)
    half = Correction.none(1)
    half.kp[0], half.scale[0] = 0.5, 2.0
    assert half.recording(raw).gains.kp == pytest.approx([1.0])
    assert half.recording(raw).drive.values[:, 2] == pytest.approx(raw.drive.values[:, 2])
    assert half.recording(raw).drive.values[:, 0] == pytest.approx(raw.drive.values[:, 0] / 2.0)


def test_given_gains_count_before_recorded_ones(bag, robot, tmp_path):
    (tmp_path / 'gains.yaml').write_text('kp: {hinge: 9.0}\nkd: {hinge: 1.0}\n')
    nominal, remarks = nominal_model(load_robot(robot)), []
    events = read_events(str(bag), None, None, [])
    gains = gains_of(str(tmp_path / 'gains.yaml'), nominal, events, remarks)
    assert (gains.is_recorded, list(gains.kp)) == (False, [9.0])
    assert remarks == ['The given gains are used, not those recorded with the targets.']


def test_a_recording_without_gains_beside_one_with_is_refused(bag, robot):
    nominal = nominal_model(load_robot(robot))
    events = read_events(str(bag), None, None, [])
    gains = gains_of(None, nominal, events, [])
    bare = [
        CommandSample(e.stamp_ns, e.effort, e.names, e.kind) if isinstance(e, CommandSample) else e
        for e in events
    ]
    with pytest.raises(
        RecordingError, match='the targets come with gains of no joint; expected kp'
    ):
        collect(bare, nominal.robot, gains=gains)


@pytest.mark.parametrize('kind', ['std_msgs/Float64MultiArray', 'std_msgs/String', 'acme/Gains'])
def test_a_topic_of_gains_of_another_type_is_said_and_not_used(kind, tmp_path):
    path = tmp_path / 'x.mcap'
    state = JointSample(10**18, ('hinge',), frozen_array([0.5]))
    with RecordingWriter(path) as writer:
        writer.write_event(state)
        schema = writer._writer.register_schema(full_type(kind), 'ros2msg', b'')
        channel = writer._writer.register_channel('/gains', 'cdr', schema)
        writer._writer.add_message(channel, 10**18, b'anything', 10**18)
    remarks = []
    assert read_events(str(path), None, None, remarks)[0].stamp_ns == state.stamp_ns
    assert remarks == [f'/gains is not used: its type is {kind}, not sensor_msgs/JointState']


def test_gains_of_the_wrong_length_are_refused(robot, tmp_path, capsys):
    status, _ = _imported(tmp_path, robot, kp=np.ones(3), kd=np.ones(3))
    said = capsys.readouterr().err
    assert status == 2
    assert 'kp contains 3 gains for 1 joints; expected one gain, one per joint' in said
    assert said.count('\n') == 1
    status, _ = _imported(tmp_path, robot, kp=-KP[:, None], kd=KD[:, None])
    assert status == 2
    assert 'kp of hinge is -40 in row 0; expected a number of at least 0' in (
        capsys.readouterr().err
    )
