"""Model files of other programs, read into a robot."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.rigid.rigid_body import inverse_dynamics
from sgp_ros.robots.gains import checked_gains
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot

ARM = """<mujoco model="arm"><compiler angle="degree"/>
<default><joint damping="0.3" armature="0.05" frictionloss="0.2"/>
  <default class="light"><joint armature="0.01"/></default></default>
<worldbody><body name="upper" pos="0 0 .5" euler="10 20 30">
  <joint name="j1" axis="0 1 0" pos="0 0 .1" ref="30" range="-90 90"/>
  <geom type="capsule" fromto="0 0 0 .4 0 0" size=".03" mass="2"/>
  <body name="fore" pos=".4 0 0" euler="0 0 40">
    <joint name="j2" axis="0 1 1" stiffness="3" springref="20" ref="10"/>
    <joint name="j3" type="slide" axis="1 0 0" ref=".1" class="light"/>
    <geom type="box" size=".1 .05 .03" pos=".1 .02 0" mass="1"/>
    <body name="tool0" pos=".2 0 0"><geom size=".02" mass=".1" contype="0" conaffinity="0"/>
    </body></body></body></worldbody>
<actuator>%s</actuator>%s</mujoco>"""
SERVOS = """<position joint="j1" kp="100" kv="5" forcerange="-20 20"/>
<position joint="j2" kp="50" kv="2" gear="2"/><position joint="j3" kp="10" kv="1"/>"""

SDF = """<sdf version="1.7"><model name="arm"><pose>0 0 1 0 0 0.5</pose>
<link name="base"><inertial><mass>3</mass></inertial></link>
<joint name="ground" type="fixed"><parent>world</parent><child>base</child></joint>
<link name="upper"><pose relative_to="j1">0.1 0 0 0 0.3 0</pose>
  <inertial><pose>0.2 0 0.01 0.1 0 0</pose><mass>2</mass><inertia><ixx>0.01</ixx><ixy>0.001</ixy>
  <ixz>0</ixz><iyy>0.02</iyy><iyz>0</iyz><izz>0.03</izz></inertia></inertial></link>
<joint name="j1" type="revolute"><pose relative_to="base">0 0 0.2 0.4 0 0</pose>
  <parent>base</parent><child>upper</child><axis><xyz expressed_in="base">0 1 0</xyz>
  <limit><lower>-1.5</lower><upper>1.5</upper><effort>20</effort></limit>
  <dynamics><damping>0.3</damping><friction>0.2</friction><spring_stiffness>4</spring_stiffness>
  <spring_reference>0.1</spring_reference></dynamics></axis></joint>%s</model></sdf>"""


def _robot(folder, text, name='arm.xml'):
    (folder / name).write_text(text)
    return load_robot(str(folder / name))


def _moved(model, names, rows):
    """Return the efforts that MuJoCo's rigid bodies take, without joint forces but damping."""
    data = mujoco.MjData(model)
    for bit in ('CONTACT', 'EQUALITY', 'CONSTRAINT'):
        model.opt.disableflags |= int(getattr(mujoco.mjtDisableBit, f'mjDSBL_{bit}'))
    model.jnt_stiffness[:], model.dof_armature[:], model.dof_frictionloss[:] = 0.0, 0.0, 0.0
    order = [int(model.joint(name).dofadr[0]) for name in names]
    found = []
    for q, v, a in rows:
        data.qpos[order], data.qvel[order], data.qacc[order] = q, v, a
        mujoco.mj_inverse(model, data)
        found.append(data.qfrc_inverse[order])
    return np.array(found)


def test_mjcf_has_the_dynamics_of_mujoco(tmp_path):
    """Anchors, references, two joints of a body, turned frames: the same efforts to rounding."""
    nominal = nominal_model(_robot(tmp_path, ARM % (SERVOS, '')))
    tree = nominal.tree
    rows = np.random.default_rng(0).normal(size=(5, 3, 3))
    wanted = _moved(
        mujoco.MjModel.from_xml_path(str(tmp_path / 'arm.xml')), tree.joint_names, rows
    )
    q, v, a = rows.transpose(1, 0, 2)
    found = inverse_dynamics(tree, tree.parameters, q, v, a) + tree.damping * v
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)


def test_mjcf_states_its_physics(tmp_path):
    """Defaults are resolved; degrees become radians; a gear counts twice in a gain."""
    nominal = nominal_model(_robot(tmp_path, ARM % (SERVOS, '')))
    found = {(e.name, e.joint): e.numbers for e in nominal.effects}
    assert found == {
        ('armature', 'j1'): {'inertia': pytest.approx(0.05)},
        ('armature', 'j2'): {'inertia': pytest.approx(0.05)},
        ('armature', 'j3'): {'inertia': pytest.approx(0.01)},
        ('spring', 'j2'): {
            'stiffness': pytest.approx(3.0), 'rest': pytest.approx(np.radians(20.0))
        },
    }  # fmt: skip
    tree = nominal.tree
    np.testing.assert_allclose(tree.friction, 0.2)
    np.testing.assert_allclose(tree.effort_limit, [20.0, np.inf, np.inf])
    np.testing.assert_allclose(tree.upper, [np.pi / 2, np.inf, np.inf])
    names = tree.moving_names
    gains = checked_gains(nominal.robot.source['gains'], 'arm', names, names)
    np.testing.assert_allclose(gains.kp, [100.0, 200.0, 10.0])
    np.testing.assert_allclose(gains.kd, [5.0, 8.0, 1.0])
    assert any('gear: j2 2' in r for r in nominal.remarks)


def test_mjcf_motors_have_lag_delay_rotor_and_limit(tmp_path):
    """Numbers of an actuator count at the joint: rotor and damping by the gear squared."""
    motors = (
        '<general joint="j1" dyntype="filter" dynprm="0.02" gainprm="1" forcerange="-9 9"/>'
        '<motor joint="j2" gear="2" armature="0.1" damping="0.5"/>'
        '<motor joint="j3" delay="0.01" nsample="10"/>'
    )
    nominal = nominal_model(_robot(tmp_path, ARM % (motors, '')))
    found = {(e.name, e.joint): e.numbers for e in nominal.effects}
    assert found['actuator_lag', 'j1'] == {'time_constant': pytest.approx(0.02)}
    assert found['command_delay', 'j3'] == {'delay': pytest.approx(0.01)}
    assert found['armature', 'j2'] == {'inertia': pytest.approx(0.05 + 4 * 0.1)}
    np.testing.assert_allclose(nominal.tree.damping, [0.3, 0.3 + 4 * 0.5, 0.3])
    assert nominal.tree.effort_limit[0] == 9.0
    assert 'gains' not in nominal.robot.source
    assert any('j2 2' in r and 'effort_gain' in r for r in nominal.remarks)


def test_linear_equality_is_a_joint_that_follows(tmp_path):
    """`q1 - ref1 = a + b (q2 - ref2)`, in the positions that MuJoCo shows."""
    text = ARM % (
        '<motor joint="j1"/>',
        '<equality><joint joint1="j2" joint2="j1" polycoef="0.1 -0.5 0 0 0"/></equality>',
    )
    tree = nominal_model(_robot(tmp_path, text)).tree
    assert tree.moving_names == ('j1', 'j3')
    j2 = tree.joint_names.index('j2')
    assert tree.multipliers[j2] == -0.5
    assert tree.offsets[j2] == pytest.approx(np.radians(10.0) + 0.1 + 0.5 * np.radians(30.0))


@pytest.mark.parametrize(
    ('old', 'new', 'said'),
    [
        ('<joint name="j1"', '<freejoint/><joint name="none"', 'more than one free'),
        ('<body name="tool0"',
         '<body><joint type="ball"/><geom size=".1"/></body><body name="tool0"',
         'has a ball joint'),
        ('<worldbody>', '<worldbody><geom type="box" size="1 1 1"/>', 'touch'),
        ('<worldbody>', '<worldbody><body pos="5 5 5"><freejoint/><geom size=".1"/></body>',
         'has a free joint'),
        ('</worldbody>',
         '</worldbody><equality><connect body1="tool0" anchor="0 0 0"/></equality>',
         'closes a loop'),
        ('<joint name="j1"', '<joint nome="j1"', 'nome'),
    ],
)  # fmt: skip
def test_mjcf_that_is_no_fixed_tree_is_refused(tmp_path, old, new, said):
    """One line names what was found."""
    text = (ARM % ('', '')).replace(old, new, 1)
    assert text != ARM % ('', '')
    with pytest.raises(ConfigError) as error:
        _robot(tmp_path, text)
    assert '\n' not in str(error.value)
    if 'more than one' not in said:
        assert said in str(error.value)


def test_sdf_has_the_dynamics_that_it_states(tmp_path):
    """The same arm written as a URDF by hand moves alike."""
    nominal = nominal_model(_robot(tmp_path, SDF % '', 'arm.sdf'))
    tree = nominal.tree
    assert tree.moving_names == ('j1',)
    assert (tree.damping[0], tree.friction[0], tree.effort_limit[0]) == (0.3, 0.2, 20.0)
    (spring,) = nominal.effects
    assert (spring.name, spring.numbers) == ('spring', {'stiffness': 4.0, 'rest': 0.1})
    # the axis is y of the base; the centre lies where both poses put it
    c3, s3 = np.cos(0.3), np.sin(0.3)
    in_joint = np.array([0.1 + 0.2 * c3 + 0.01 * s3, 0.0, -0.2 * s3 + 0.01 * c3])
    c4, s4 = np.cos(0.4), np.sin(0.4)
    x, y, z = in_joint
    at = np.array([x, c4 * y - s4 * z, s4 * y + c4 * z])
    torque = inverse_dynamics(tree, tree.parameters, *np.zeros((3, 1, 1)))[0, 0]
    assert torque == pytest.approx(-2.0 * 9.81 * at[0])


def test_sdf_names_what_it_leaves_out(tmp_path):
    """Plugins and a missing ground are said; a model within the model is refused."""
    text = (SDF % '<plugin filename="x" name="y"/>').replace(
        '<joint name="ground" type="fixed"><parent>world</parent><child>base</child></joint>', ''
    )
    remarks = ' '.join(nominal_model(_robot(tmp_path, text, 'arm.sdf')).remarks)
    assert 'Plugins are ignored: x.' in remarks
    assert 'fixed to the ground: base.' in remarks
    with pytest.raises(ConfigError, match='within the model'):
        _robot(tmp_path, SDF % '<include/>', 'arm.sdf')
    with pytest.raises(ConfigError, match="of type 'ball'"):
        _robot(tmp_path, (SDF % '').replace('"revolute"', '"ball"'), 'arm.sdf')
    digits = '9' * 5000
    with pytest.raises(ConfigError, match='expected finite numbers') as caught:
        _robot(tmp_path, (SDF % '').replace('<pose>0 0 1', f'<pose>{digits} 0 1'), 'arm.sdf')
    assert len(str(caught.value)) < 500, 'digits of a damaged file fill the line'


XACRO = """<robot name="axis" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:property name="m" value="${2 * 0.5}"/><link name="base"/>
<link name="arm"><inertial><mass value="${m}"/><origin xyz="0.3 0 0"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<dynamics damping="0.1" friction="0.2"/></joint></robot>"""


def test_xacro_is_expanded(tmp_path):
    """By the package that ROS uses."""
    tree = nominal_model(_robot(tmp_path, XACRO, 'axis.urdf.xacro')).tree
    assert (tree.parameters[0, 0], tree.friction[0]) == (1.0, 0.2)
    with pytest.raises(ConfigError, match='xacro broken'):
        _robot(tmp_path, XACRO.replace('${m}', '${unknown}'), 'broken.xacro')


def test_a_package_is_found_above(tmp_path):
    """As in a source tree that is not installed."""
    folder = tmp_path / 'my_robot' / 'urdf'
    folder.mkdir(parents=True)
    (folder / 'plain.urdf').write_text(XACRO.replace('${m}', '1'))
    (tmp_path / 'my_robot' / 'axis.yaml').write_text(
        'schema: 1\nurdf: package://my_robot/urdf/plain.urdf\n'
    )
    with pytest.raises(ConfigError, match='no package nowhere'):
        load_robot('package://nowhere/robot.urdf')
    assert load_robot(str(tmp_path / 'my_robot' / 'axis.yaml')).joint_names == ('j',)
