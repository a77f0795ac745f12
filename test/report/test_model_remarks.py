"""Laws of what a replay remarks on its filter and its model."""

from __future__ import annotations

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.report.metrics import model_remarks
from sgp_ros.robots.registry import load_robot
from test.engine.worlds import START_NS

ROBOT = """schema: 1
urdf: |
  <robot name="axis"><link name="base"/>
  <link name="cart"><inertial><mass value="2"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="x" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
  <limit lower="-9" upper="9" effort="99" velocity="9"/></joint></robot>
terms: {inertial: all}
prior: {inertial: {spread: 0.01}}
effects:
  - {effect: armature, joint: x, parameters: {inertia: {value: 0.3, std: 0.2, unit: kg}}}
  - effect: hysteresis
    joint: x
    parameters: {level: {value: 0.01, unit: N}, presliding: {value: 0.001, unit: m}}
"""


def _run(tmp_path, mass):
    path = tmp_path / 'robot.yaml'
    path.write_text(ROBOT, encoding='utf-8')
    robot = load_robot(str(path))
    engine = Engine(robot, EngineConfig.from_mapping({'model.method': 'PR'}, robot))
    asked, t = engine.config, np.arange(0.0, 8.0, 0.01)
    states = [
        JointSample(START_NS + round(s * 1e9), ('x',), frozen_array([np.sin(3.0 * s)]), None,
                    frozen_array([-9.0 * mass * np.sin(3.0 * s)]))
        for s in t
    ]  # fmt: skip
    replay(engine, states, lambda _: None)
    return model_remarks(engine, asked)


def test_a_negative_armature_is_said(tmp_path):
    """Of a cart of 2 kg that moves as if it had 1.5 kg."""
    below = [r for r in _run(tmp_path, 1.5) if 'below 0' in r]
    assert len(below) == 1
    assert 'x.armature.inertia ended at -0.' in below[0]
    assert not [r for r in _run(tmp_path, 2.5) if 'below 0' in r]


def test_what_is_not_modelled_online_and_what_was_chosen_are_said(tmp_path):
    """Hysteresis needs the past of the motion."""
    remarks = _run(tmp_path, 2.3)
    assert any('not modelled online' in r and 'hysteresis of x' in r for r in remarks)
    assert any('filter.window = ' in r and 'chosen' in r for r in remarks)


def test_a_robot_without_effects_has_nothing_to_remark():
    """Settings as they were given, coefficients that may have any sign."""
    robot = load_robot('reaction_wheel')
    engine = Engine(robot, EngineConfig.from_mapping({}, robot))
    assert model_remarks(engine, engine.config) == []
