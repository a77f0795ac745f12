"""Parameters written into a URDF, read back by Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio
import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.rigid.urdf_writer import write_urdf
from test.rigid.bodies import random_body

URDF = """<?xml version="1.0" encoding="utf-8"?>
<!-- before the robot: a > b -->
<robot name="crane" xmlns:xacro="http://ros.org/wiki/xacro">
  <material name="grün"><color rgba="0 1 0 1"/></material>
  <link name="base"><inertial><mass value="9"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"
    izz="1"/></inertial></link>
  <link name="arm"> <!-- keep me -->
    <visual><geometry><mesh filename="package://a/b.stl"/></geometry></visual>
    <inertial>
      <origin xyz="0 0 1" rpy="0.1 0 0"/>
      <mass value="1"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
    </inertial>
  </link>
  <link name="hook"/>
  <link name="tool">
    <inertial><mass value="3"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  </link>
  <link name="tip"><inertial><mass value="4"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"
    izz="1"/></inertial></link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="arm"/>
    <origin xyz="0 0.3 0.2" rpy="0.4 0 -0.2"/>
    <axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="9" velocity="9"/>
    <dynamics damping="0.5"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="arm"/><child link="hook"/>
    <origin xyz="0 0.3 0.2" rpy="0.4 0.3 -0.2"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="9" velocity="9"/>
  </joint>
  <joint name="weld" type="fixed"><parent link="hook"/><child link="tool"/>
    <origin xyz="1 1 1"/></joint>
  <joint name="glue" type="fixed"><parent link="tool"/><child link="tip"/></joint>
</robot>
<!-- after -->
"""


@pytest.mark.parametrize('seed', range(3))
def test_a_model_of_the_written_file_has_the_torques_of_the_parameters(seed):
    """Regressor of the old file times parameters = Newton-Euler of the new file."""
    bodies = {'arm': random_body(seed), 'hook': random_body(seed + 9)}
    written = pinocchio.buildModelFromXML(write_urdf(URDF, bodies, {}))
    before = pinocchio.buildModelFromXML(URDF)
    w = np.concatenate([bodies['arm'], bodies['hook']])
    rng = np.random.default_rng(seed)
    for _ in range(5):
        q, v, a = rng.normal(size=(3, 2))
        columns = pinocchio.computeJointTorqueRegressor(before, before.createData(), q, v, a)
        torque = pinocchio.rnea(written, written.createData(), q, v, a)
        assert np.allclose(columns @ w, torque, rtol=0.0, atol=1e-12 * np.abs(torque).max())


def test_parameters_of_the_written_file_are_those_given():
    """About the joint, links fixed to it included, in Pinocchio's order."""
    w = random_body(4)
    model = pinocchio.buildModelFromXML(write_urdf(URDF, {'hook': w}, {}))
    read = model.inertias[model.getJointId('slide')].toDynamicParameters()
    assert np.allclose(read, w, rtol=1e-12, atol=1e-13)


def test_damping_and_friction_are_read_back():
    """In the place of the old ones, or added."""
    given = {'turn': (0.1, 1.0 / 3.0), 'slide': (1e-9, 2.0)}
    model = pinocchio.buildModelFromXML(write_urdf(URDF, {}, given))
    assert list(model.damping) == [0.1, 1e-9]
    friction = model.friction if hasattr(model, 'friction') else model.upperDryFrictionLimit
    assert list(friction) == [1.0 / 3.0, 2.0]


def test_everything_else_stays_to_the_byte():
    """Without parameters nothing changes; with some, only the lines they are on."""
    assert write_urdf(URDF, {}, {}) == URDF
    text = write_urdf(URDF, {'arm': random_body(1)}, {'turn': (0.0, 0.0)})
    start, stop = URDF.index('    <inertial>\n'), URDF.index('  <link name="hook"/>')
    assert text.startswith(URDF[:start])
    tail = URDF[stop:].replace(
        '<dynamics damping="0.5"/>', '<dynamics damping="0.0" friction="0.0"/>'
    )
    assert text.endswith(tail)


def test_writing_twice_changes_nothing_more():
    """The written element is found again in its place."""
    w, dynamics = {'arm': random_body(1), 'hook': random_body(2)}, {'slide': (0.3, 0.1)}
    once = write_urdf(URDF, w, dynamics)
    assert write_urdf(once, w, dynamics) == once


def test_windows_line_ends_stay():
    """No line feed without its carriage return."""
    text = write_urdf(URDF.replace('\n', '\r\n'), {'arm': random_body(1)}, {'slide': (0.1, 0.1)})
    assert text.count('\n') == text.count('\r\n')


@pytest.mark.parametrize(
    ('text', 'links', 'joints', 'found'),
    [
        (URDF, {'leg': random_body(0)}, {}, "links \\['leg'\\]"),
        (URDF, {}, {'knee': (0.0, 0.0)}, "joints \\['knee'\\]"),
        (URDF, {'arm': -random_body(0)}, {}, 'link arm'),
        (URDF, {'arm': np.full(10, np.nan)}, {}, 'link arm'),
        (URDF, {'arm': np.ones(9)}, {}, 'link arm'),
        (URDF, {'hook': random_body(0), 'tip': random_body(1)}, {}, 'fixed to link hook'),
        (URDF, {}, {'turn': (np.nan, 0.0)}, 'joint turn'),
        ('<robot><link></robot>', {}, {}, 'not XML'),
        ('', {}, {}, 'not XML'),
        ('<sdf/>', {}, {}, '<sdf>'),
    ],
)
def test_bad_input_is_named_in_one_line(text, links, joints, found):
    """The message says what was found, and where."""
    with pytest.raises(ConfigError, match=found) as caught:
        write_urdf(text, links, joints)
    assert '\n' not in str(caught.value)
