"""`sgp export`: other programs get the same robot, and are told what they cannot hold."""

from __future__ import annotations

import ast
import json

import mujoco
import numpy as np
import pytest
import yaml

from sgp_ros.cli import main
from sgp_ros.engine.samples import CommandSample, JointSample
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot
from test.robots.test_models import ARM, SERVOS

URDF = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.15 0.01 0" rpy="0.1 0 0"/><mass value="2"/>
<inertia ixx="0.004" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.1 0 0.01"/><mass value="1"/>
<inertia ixx="0.001" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<origin xyz="0 0 0.4" rpy="0.2 0 0.3"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="40" velocity="9"/><dynamics damping="0.4"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/>
<origin xyz="0.3 0 0" rpy="0 0 0.2"/><axis xyz="0 1 0"/><dynamics damping="0.2"/></joint>
</robot>"""
EFFECTS = [
    {'effect': 'coulomb_friction', 'joint': 'shoulder',
     'parameters': {'level': {'value': 0.8, 'std': 0.05}}},
    {'effect': 'armature', 'joint': 'elbow', 'parameters': {'inertia': {'value': 0.04}}},
    {'effect': 'spring', 'joint': 'elbow',
     'parameters': {'stiffness': {'value': 3.0}, 'rest': {'value': 0.4}}},
    {'effect': 'command_delay', 'joint': 'all', 'parameters': {'delay': {'value': 0.01}}},
]  # fmt: skip
GAINS = {'kp': {'shoulder': 90.0, 'elbow': 40.0}, 'kd': {'shoulder': 4.0, 'elbow': 2.0}}


def _robot(folder, effects=EFFECTS, **more):
    (folder / 'arm.urdf').write_text(URDF)
    content = {'schema': 1, 'urdf': 'arm.urdf', 'effects': effects, **more}
    (folder / 'arm.yaml').write_text(yaml.safe_dump(content))
    return str(folder / 'arm.yaml')


def _exported(robot, folder, to, *more):
    """Return the file that was written, and what was said to be left out."""
    assert main(['export', robot, '--to', to, '--out', str(folder / 'out'), *more]) == 0
    return next(p for p in (folder / 'out').glob('[!.]*') if 'ranges' not in p.name)


def test_exported_mjcf_finds_its_meshes_when_both_are_moved(tmp_path):
    """The place of meshes is said from the new file on: results are shared with their folder."""
    here = tmp_path / 'here'
    (here / 'meshes').mkdir(parents=True)
    corners = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
    faces = ((1, 3, 2), (1, 2, 4), (1, 4, 3), (2, 3, 4))
    lines = [*(f'v {x} {y} {z}' for x, y, z in corners), *(f'f {a} {b} {c}' for a, b, c in faces)]
    (here / 'meshes' / 'link.obj').write_text('\n'.join(lines))
    (here / 'arm.xml').write_text(
        '<mujoco><compiler meshdir="meshes"/><asset><mesh name="link" file="link.obj"/></asset>'
        '<worldbody><body name="link"><joint name="hinge" axis="0 1 0"/>'
        '<geom type="mesh" mesh="link"/></body></worldbody></mujoco>'
    )
    written = _exported(str(here / 'arm.xml'), here, 'mjcf')
    assert str(tmp_path) not in written.read_text()
    here.rename(tmp_path / 'there')
    moved = tmp_path / 'there' / written.relative_to(here)
    assert mujoco.MjModel.from_xml_path(str(moved)).nmesh == 1


def test_corrected_bodies_take_the_place_of_a_diagonal_inertia(tmp_path):
    """MuJoCo refuses a body that has both a full inertia and a diagonal one."""
    model = tmp_path / 'rod.xml'
    model.write_text(
        '<mujoco><worldbody><body name="rod"><joint name="hinge" axis="0 1 0"/>'
        '<inertial pos="0 0 -0.1" quat="0.9 0.1 0 0" mass="1" diaginertia="0.02 0.02 0.01"/>'
        '</body></worldbody></mujoco>'
    )
    (tmp_path / 'rod.urdf').write_text(
        '<robot name="rod"><link name="base"/><link name="rod"><inertial>'
        '<origin xyz="0 0 -0.2"/><mass value="3"/>'
        '<inertia ixx="0.05" ixy="0" ixz="0" iyy="0.04" iyz="0" izz="0.02"/></inertial></link>'
        '<joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/>'
        '<axis xyz="0 1 0"/></joint></robot>'
    )
    written = _exported(str(tmp_path / 'rod.urdf'), tmp_path, 'mjcf', '--model', str(model))
    found = mujoco.MjModel.from_xml_path(str(written))
    assert found.body_mass[1] == pytest.approx(3.0)
    assert sorted(found.body_inertia[1]) == pytest.approx([0.02, 0.04, 0.05], rel=1e-5)


@pytest.mark.long
def test_exported_mjcf_moves_in_mujoco_as_our_simulation(tmp_path):
    """Under the recorded commands, within 1 % of the motion, over the whole recording."""
    robot = _robot(tmp_path)
    words = [
        'simulate',
        robot,
        '--duration',
        '4',
        '--out',
        str(tmp_path),
        '--seed',
        '3',
        '--force',
    ]
    assert main(words) == 0
    model = mujoco.MjModel.from_xml_path(str(_exported(robot, tmp_path, 'mjcf')))
    events = list(open_recording(tmp_path / 'arm.mcap').events())
    commands = [e for e in events if isinstance(e, CommandSample)]
    states = [e for e in events if isinstance(e, JointSample)]
    order = [model.joint(name).id for name in states[0].names]
    motors = [model.actuator(name).id for name in ('shoulder', 'elbow')]
    with np.load(tmp_path / 'truth.npz') as truth:
        start, wanted = truth['stamps_ns'][0], truth['position']
    data = mujoco.MjData(model)
    data.qpos[order] = wanted[0]
    found = []
    for i, state in enumerate(states):
        while data.time < (state.stamp_ns - start) * 1e-9 - 1e-9:
            held = [c for c in commands if c.stamp_ns <= start + data.time * 1e9 + 1]
            data.ctrl[motors] = held[-1].effort if held else 0.0
            mujoco.mj_step(model, data)
        found.append(data.qpos[order].copy())
        assert i < len(wanted)
    error = np.sqrt(np.mean((np.array(found) - wanted) ** 2, axis=0))
    assert np.all(error < 0.01 * wanted.std(axis=0)), error / wanted.std(axis=0)


@pytest.mark.parametrize('to', ['urdf', 'sdf', 'mjcf'])
def test_what_is_written_is_read_back(tmp_path, to):
    """Bodies, places, damping and friction; of the rest what the format holds."""
    robot = _robot(tmp_path)
    before = nominal_model(load_robot(robot))
    after = nominal_model(load_robot(str(_exported(robot, tmp_path, to))))
    a, b = before.tree, after.tree
    assert a.moving_names == b.moving_names
    np.testing.assert_allclose(b.parameters, a.parameters, atol=1e-6)
    np.testing.assert_allclose(b.rotations, a.rotations, atol=1e-6)
    np.testing.assert_allclose(b.translations, a.translations, atol=1e-6)
    np.testing.assert_allclose(b.damping, a.damping)
    np.testing.assert_allclose(b.friction, [0.8, 0.0])
    found = {(e.name, e.joint) for e in after.effects}
    springs, rotors = {('spring', 'elbow')}, {('armature', 'elbow')}
    delays = {('command_delay', 'shoulder'), ('command_delay', 'elbow')}
    assert found == {'urdf': set(), 'sdf': springs, 'mjcf': springs | rotors | delays}[to]


def test_an_mjcf_keeps_what_it_was(tmp_path, capsys):
    """The file that the robot came from is changed in its numbers alone."""
    (tmp_path / 'arm.xml').write_text(ARM % (SERVOS, ''))
    source = load_robot(str(tmp_path / 'arm.xml')).source
    level = {'effect': 'coulomb_friction', 'joint': 'j2', 'parameters': {'level': {'value': 0.5}}}
    content = {'schema': 1, **source, 'effects': [*source['effects'], level]}
    (tmp_path / 'robot.yaml').write_text(yaml.safe_dump(content))
    path = _exported(str(tmp_path / 'robot.yaml'), tmp_path, 'mjcf')
    assert 'not in mjcf' not in capsys.readouterr().out
    old = mujoco.MjModel.from_xml_path(str(tmp_path / 'arm.xml'))
    new = mujoco.MjModel.from_xml_path(str(path))
    np.testing.assert_allclose(new.dof_frictionloss, [0.2, 0.7, 0.2])
    for name in ('dof_armature', 'dof_damping', 'jnt_stiffness', 'body_mass', 'body_inertia',
                 'body_ipos', 'geom_size', 'actuator_gainprm', 'actuator_biasprm',
                 'actuator_gear', 'actuator_forcerange', 'jnt_range', 'qpos_spring'):  # fmt: skip
        np.testing.assert_allclose(getattr(new, name), getattr(old, name), rtol=1e-5, atol=1e-5)


def test_what_a_format_cannot_hold_is_listed(tmp_path, capsys):
    """Each number and law by name; ranges are two standard deviations to either side."""
    numbers = {'amplitude': 0.1, 'periods': 6.0, 'phase': 0.2}
    wave = {'effect': 'cogging', 'joint': 'elbow'}
    wave['parameters'] = {name: {'value': x} for name, x in numbers.items()}
    robot = _robot(tmp_path, [*EFFECTS, wave], gains=GAINS)
    _exported(robot, tmp_path, 'urdf', '--ranges')
    said = capsys.readouterr().out
    for text in ('elbow: armature 0.04 kg m2', 'shoulder: delay 0.01 s', 'elbow: kp 40 N m/rad',
                 'elbow: stiffness 3 N m/rad', 'periods 6'):  # fmt: skip
        assert text in said
    ranges = json.loads((tmp_path / 'out' / 'arm_ranges.json').read_text())
    assert ranges == {'shoulder': {'friction': [pytest.approx(0.7), pytest.approx(0.9)]}}


@pytest.mark.parametrize(
    ('name', 'numbers', 'level'),
    [
        ('stribeck_friction', {'coulomb': 0.5, 'static': 0.9, 'stribeck_velocity': 0.1}, 0.5),
        ('asymmetric_coulomb', {'level_pos': 0.4, 'level_neg': 0.8}, 0.6),
        ('hysteresis', {'level': 0.7, 'presliding': 0.01}, 0.7),
    ],
)
def test_other_dry_friction_is_written_as_the_nearest_level(tmp_path, name, numbers, level):
    """It counts as friction of the joint, and is told with all its numbers."""
    stated = {key: {'value': x} for key, x in numbers.items()}
    robot = _robot(tmp_path, [{'effect': name, 'joint': 'elbow', 'parameters': stated}])
    found = json.loads(_exported(robot, tmp_path, 'json').read_text())
    assert found['joints']['elbow']['friction'] == pytest.approx(level)
    assert f'(written as dry friction of {level:g})' in str(found)


def test_settings_of_isaac_lab_and_ros2_control(tmp_path):
    """A Python module that names the joints, and parameters of a PID controller."""
    robot = _robot(tmp_path, gains=GAINS)
    module = ast.parse(_exported(robot, tmp_path / 'a', 'isaaclab').read_text())
    text = ast.unparse(module)
    assert "stiffness={'shoulder': 90, 'elbow': 40}" in text
    assert "armature={'shoulder': 0, 'elbow': 0.04}" in text
    control = yaml.safe_load(_exported(robot, tmp_path / 'b', 'ros2_control').read_text())
    gains = control['pid_controller']['ros__parameters']['gains']
    assert gains['shoulder'] == {'p': 90.0, 'i': 0.0, 'd': 4.0}
    found = json.loads(_exported(robot, tmp_path / 'c', 'json').read_text())
    assert found['joints']['elbow']['armature'] == 0.04
