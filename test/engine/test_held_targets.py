"""Targets of position and velocity become efforts where the robot states its gains."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import POSITION, VELOCITY, CommandSample, JointSample, frozen_array
from sgp_ros.engine.snapshots import restored, take_snapshot
from sgp_ros.robots.registry import load_robot

INERTIA, KP, KD = 0.7, 40.0, 3.0
START_NS, STEP_NS = 10**18, 5 * 10**6
URDF = """<robot name="axis"><link name="base"/><link name="rotor"><inertial><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="axis" type="continuous"><parent link="base"/><child link="rotor"/>
<axis xyz="0 0 1"/></joint></robot>"""


@pytest.fixture
def robot(tmp_path):
    (tmp_path / 'axis.urdf').write_text(URDF)
    path = tmp_path / 'axis.yaml'
    path.write_text(
        f'schema: 1\nurdf: axis.urdf\ngains: {{kp: {{axis: {KP}}}, kd: {{axis: {KD}}}}}\n'
    )
    return load_robot(str(path))


def _events(n, *, has_velocity=True, kind=POSITION):
    """An axis on its drive, in fine steps; a target every second state."""
    q, v, events, target, rate = 0.0, 0.0, [], 0.0, 0.0
    for i in range(n):
        t = i * STEP_NS * 1e-9
        if i % 2 == 0:
            rate = 2.5 * np.cos(5.0 * t) + 1.1 * np.cos(11.0 * t)
            target = 0.5 * np.sin(5.0 * t) + 0.1 * np.sin(11.0 * t) if kind == POSITION else 0.0
            asked = [target] if kind == POSITION else [rate]
            rates = frozen_array([rate]) if kind == POSITION else None
            events.append(CommandSample(START_NS + i * STEP_NS, frozen_array(asked), ('axis',),
                                        kind, rates))  # fmt: skip
        events.append(JointSample(
            START_NS + i * STEP_NS, ('axis',), frozen_array([q]),
            frozen_array([v]) if has_velocity else None,
        ))  # fmt: skip
        for _ in range(50):
            a = (KP * (target - q) + KD * (rate - v)) / INERTIA
            v += 1e-9 * STEP_NS / 50 * a
            q += 1e-9 * STEP_NS / 50 * v
    return events


def _fed(engine, events):
    for event in events:
        engine.push(event)
    return engine


def test_an_axis_on_its_drive_is_identified_from_targets(robot):
    engine = _fed(Engine(robot, EngineConfig.from_mapping({}, robot)), _events(2000))
    assert engine.counts.commands_refused['wrong_kind'] == 0
    assert engine.counts.used >= 1975  # the rest waits for its order
    inertia = next(p.value for p in engine.parameters() if p.name.endswith('Izz'))
    assert inertia == pytest.approx(INERTIA, rel=0.03)


def test_gains_that_damp_need_measured_velocities(robot):
    engine = _fed(
        Engine(robot, EngineConfig.from_mapping({}, robot)), _events(100, has_velocity=False)
    )
    assert engine.counts.used == 0
    assert engine.counts.refused['unpaired'] >= 75  # the rest waits for its order


def test_targets_of_a_robot_without_gains_are_refused(tmp_path):
    (tmp_path / 'axis.urdf').write_text(URDF)
    robot = load_robot(str(tmp_path / 'axis.urdf'))
    engine = _fed(Engine(robot, EngineConfig.from_mapping({}, robot)), _events(20))
    assert engine.counts.commands_refused['wrong_kind'] == 10
    assert engine.counts.used == 0


@pytest.mark.parametrize('kind', [POSITION, VELOCITY])
def test_a_saved_state_goes_on_with_its_targets(robot, kind):
    """Those in force and those that wait for their order."""
    events = _events(600, kind=kind)
    whole = _fed(Engine(robot, EngineConfig.from_mapping({}, robot)), events)
    first = _fed(Engine(robot, EngineConfig.from_mapping({}, robot)), events[:451])
    again = _fed(restored(robot, take_snapshot(first)), events[451:])
    assert [p.value for p in again.parameters()] == [p.value for p in whole.parameters()]
    assert again.counts == whole.counts
