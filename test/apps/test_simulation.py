"""Laws of `sgp simulate` for a robot from a URDF."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sgp_ros.cli import main
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot
from test.simulation.trees import arm

EFFECT = 'coulomb_friction:joint=elbow,level=0.3'


@pytest.fixture
def urdf(tmp_path):
    """A planar arm on disk."""
    path = tmp_path / 'arm.urdf'
    path.write_text(arm(), encoding='utf-8')
    return path


def simulated(urdf, out, *more):
    assert main(['simulate', str(urdf), '--duration', '2', '--out', str(out), *more]) == 0
    return out


def test_recording_and_truth_of_a_urdf_robot(urdf, tmp_path):
    """Messages, effects with units and the true motion."""
    out = simulated(urdf, tmp_path / 'o', '--effect', EFFECT, '--sensor', 'effort=yes')
    truth = json.loads((out / 'truth.json').read_text(encoding='utf-8'))
    assert truth['effects'] == [
        {
            'effect': 'coulomb_friction',
            'joint': 'elbow',
            'parameters': {'level': {'value': 0.3, 'unit': 'N m'}},
        }
    ]
    motion = np.load(out / 'truth.npz', allow_pickle=False)
    assert motion['acceleration'].shape == (400, 2)
    assert (out / 'arm.mcap').stat().st_size > 10_000


def test_equal_seeds_write_equal_files(urdf, tmp_path):
    """Byte for byte, with noise on the way."""
    sensors = ['--sensor', 'bits=14', '--sensor', 'drop=0.01', '--sensor', 'log_latency=0.001']
    first, again = (simulated(urdf, tmp_path / x, *sensors, '--effect', EFFECT) for x in 'ab')
    for name in ('arm.mcap', 'truth.json', 'truth.npz'):
        assert (first / name).read_bytes() == (again / name).read_bytes()


@pytest.mark.parametrize(
    'more',
    [
        ['--effect', 'coulomb_friction:joint=wrist,level=1'],
        ['--effect', 'joint_coupling:joint=elbow,source_joint=elbow,kind=torque,coefficient=1'],
        ['--effect', 'backlash:joint=elbow,gap=0.01,motor_inertia=10'],
        ['--sensor', 'drop=2'],
        ['--controller', 'dance'],
        ['--gains', 'gains.yaml'],
        ['--nominal', 'other.urdf'],
    ],
)
def test_what_the_robot_cannot_have_ends_in_one_line(urdf, tmp_path, capsys, more):
    """Exit status 2, one line on stderr."""
    assert main(['simulate', str(urdf), '--out', str(tmp_path / 'o'), *more]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


STATED_LIMIT = (
    'limit_friction, joint: elbow, parameters: {amplitude: {value: 0.5}, onset: {value: 0.4}, '
    'side: {value: upper}}'
)
STATED = {
    EFFECT: 'coulomb_friction, joint: elbow, parameters: {level: {value: 0.3}}',
    'joint_coupling:joint=elbow,source_joint=shoulder,kind=torque,coefficient=0.2': (
        'joint_coupling, joint: elbow, parameters: {source_joint: {value: shoulder}, '
        'kind: {value: torque}, coefficient: {value: 0.2}}'
    ),
    'gravity_tilt:roll=0.1,pitch=-0.05': (
        'gravity_tilt, joint: base, parameters: {roll: {value: 0.1}, pitch: {value: -0.05}}'
    ),
    'limit_friction:joint=elbow,amplitude=0.5,onset=0.4,side=upper': STATED_LIMIT,
}  # fmt: skip


def _yaml(urdf, *effects):
    path = urdf.with_name('stated.yaml')
    listed = ', '.join(f'{{effect: {effect}}}' for effect in effects)
    path.write_text(f'schema: 1\nurdf: {urdf.name}\neffects: [{listed}]\n', encoding='utf-8')
    return path


@pytest.mark.parametrize('text', STATED)
def test_a_stated_effect_moves_the_robot_as_that_of_the_command_line(urdf, tmp_path, text):
    """The recordings are equal byte for byte."""
    said = simulated(urdf, tmp_path / 'said', '--effect', text)
    stated = simulated(_yaml(urdf, STATED[text]), tmp_path / 'stated')
    assert (said / 'arm.mcap').read_bytes() == (stated / 'stated.mcap').read_bytes()
    effects = [json.loads((x / 'truth.json').read_text())['effects'] for x in (said, stated)]
    assert effects[0] == effects[1]


def test_effects_of_the_command_line_come_beside_those_that_are_stated(urdf, tmp_path):
    out = simulated(_yaml(urdf, STATED[EFFECT]), tmp_path / 'o', '--effect',
                    'viscous_friction:joint=shoulder,b=0.1')  # fmt: skip
    effects = json.loads((out / 'truth.json').read_text(encoding='utf-8'))['effects']
    assert [e['effect'] for e in effects] == ['coulomb_friction', 'viscous_friction']


@pytest.mark.parametrize(
    ('effect', 'said'),
    [
        ('backlash, joint: elbow, parameters: {gap: {value: 0.01}}', 'motor_inertia is miss'),
        (STATED_LIMIT.replace('0.4', '4.0'), 'an onset between them'),
    ],
)
def test_what_a_simulation_cannot_take_from_a_yaml_ends_in_one_line(
    urdf, tmp_path, capsys, effect, said
):
    path = _yaml(urdf, effect)
    assert main(['simulate', str(path), '--out', str(tmp_path / 'o')]) == 2
    error = capsys.readouterr().err.strip()
    assert said in error
    assert '\n' not in error


def test_a_robot_yaml_without_urdf_is_simulated_with_its_numbers(tmp_path):
    """A built-in robot becomes the simplest bodies that have its coefficients."""
    path = tmp_path / 'wheel.yaml'
    path.write_text('schema: 1\nrobot: reaction_wheel\njoints: [p, w]\n', encoding='utf-8')
    truth = json.loads((simulated(path, tmp_path / 'o') / 'truth.json').read_text('utf-8'))
    assert truth['joints'] == ['p', 'w']
    assert truth['command_joints'] == ['w']
    assert truth['effort_gain'] == {'p': 1.0, 'w': 0.03}


@pytest.mark.parametrize('more', ['', ', motor_inertia: {value: 0.001}'])
def test_backlash_is_left_out_of_a_nominal_model_for_its_numbers_say_too_little(urdf, more):
    """The motor's share of the inertia changes with the pose."""
    play = f'backlash, joint: elbow, parameters: {{gap: {{value: 0.01}}{more}}}'
    path = _yaml(urdf, play, STATED[EFFECT])
    nominal = nominal_model(load_robot(str(path)))
    assert 'backlash of elbow' in ' '.join(nominal.remarks)
    assert [e.name for e in nominal.stated] == ['coulomb_friction']
