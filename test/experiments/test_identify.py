"""`sgp identify` as its user sees it, on a simulated axis and an arm of which all is known."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sgp_ros.cli import main
from sgp_ros.core.pseudo_inertia import is_consistent
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.rigid_body import inverse_dynamics
from sgp_ros.robots.tree import read_urdf

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0.15 0 0"/><mass value="1"/>
    <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="50" velocity="8"/>
    <dynamics damping="0.2" friction="0.3"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
    <origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="20" velocity="8"/>
    <dynamics damping="0.1" friction="0.2"/></joint>
</robot>
"""
NOISE = 0.02


def _arm_recording(path, urdf, seed, duration=16.0, rate=200.0):
    """Write a motion of the arm with the torques that it takes, measured with a little noise."""
    rng = np.random.default_rng(seed)
    tree = read_urdf(urdf)
    t = np.arange(0.0, duration, 1.0 / rate)
    w, phase = rng.uniform(1.0, 7.0, size=(4, 2)), rng.uniform(0.0, 6.0, size=(4, 2))
    angle = t[:, None, None] * w + phase
    q = 0.4 * np.sin(angle).sum(axis=1)
    v, a = 0.4 * (w * np.cos(angle)).sum(axis=1), -0.4 * (w**2 * np.sin(angle)).sum(axis=1)
    torque = inverse_dynamics(tree, tree.parameters, q, v, a)
    torque += v * tree.damping + np.tanh(v / 0.01) * tree.friction
    torque += NOISE * rng.normal(size=torque.shape)
    with RecordingWriter(path) as writer:
        for i, seconds in enumerate(t):
            stamp = 1_700_000_000_000_000_000 + round(seconds * 1e9)
            arrays = (frozen_array(x[i]) for x in (q, v, torque))
            writer.write_event(JointSample(stamp, ('shoulder', 'elbow'), *arrays))


@pytest.fixture(scope='module')
def arm(tmp_path_factory):
    """One run of the command on the arm, with a test recording."""
    folder = tmp_path_factory.mktemp('arm')
    (folder / 'arm.urdf').write_text(ARM)
    for seed, name in enumerate(('one', 'two')):
        _arm_recording(folder / f'{name}.mcap', folder / 'arm.urdf', seed)
    status = main([
        'identify', str(folder / 'one.mcap'), '--robot', str(folder / 'arm.urdf'),
        '--test', str(folder / 'two.mcap'), '--out', str(folder / 'out'),
    ])  # fmt: skip
    assert status == 0
    return folder


@pytest.fixture(scope='module')
def findings(arm):
    """What it found."""
    return json.loads((arm / 'out' / 'identification.json').read_text())


def test_planted_friction_lies_in_its_interval(findings):
    """Of both joints; and what torques cannot show is named, with no interval."""
    truth = {
        'shoulder.viscous': 0.2, 'elbow.viscous': 0.1,
        'shoulder.coulomb': 0.3, 'elbow.coulomb': 0.2,
    }  # fmt: skip
    found = {p['name']: p for p in findings['parameters']}
    for name, value in truth.items():
        assert abs(found[name]['value'] - value) < 3.5 * found[name]['std'], name
        assert found[name]['std'] < 0.05
    assert found['upper.mass']['std'] is None
    assert found['upper.mass']['status'] == 'structural'


def test_what_was_held_out_is_predicted_to_the_noise(findings):
    """The other recording, with intervals that hold."""
    score = findings['scores']['PR']['two']
    assert score['mean_nmse'] < 1e-4
    for joint in score['joints'].values():
        assert 0.85 < joint['coverage95'] <= 1.0
    assert findings['rows']['two, near'] + findings['rows']['two, far'] == findings['rows']['two']


def test_the_identified_robot_rolls_out_like_the_real_one(findings):
    """Three tenths of a second under measured torques."""
    (score,) = (s for s in findings['rollouts']['two'] if abs(s['horizon_s'] - 0.3) < 0.01)
    assert score['diverged'] == 0
    for joint in score['joints'].values():
        assert joint['nmse_end'] < 0.01


def test_the_written_robot_is_of_real_bodies_and_predicts_the_same(arm):
    """YAML and URDF load again, and give the torques of the true one."""
    out = arm / 'out'
    tree, truth = read_urdf(out / 'robot_identified.urdf'), read_urdf(arm / 'arm.urdf')
    assert np.all(is_consistent(tree.parameters))
    rng = np.random.default_rng(5)
    q, v, a = rng.normal(size=(3, 40, 2))
    one, other = (inverse_dynamics(t, t.parameters, q, v, a) for t in (tree, truth))
    assert np.abs(one - other).max() < 0.05 * other.std()
    again = load_robot(str(out / 'robot_identified.yaml'))
    assert again.joint_names == ('shoulder', 'elbow')


def test_the_page_says_what_the_numbers_say(arm, findings):
    """Self-contained, with the score of the verdict in it."""
    page = (arm / 'out' / 'report.html').read_text()
    assert f'{findings["scores"]["SGP"]["two"]["mean_nmse"]:.2g}' in page
    assert 'http' not in page.replace('http-equiv', '')
    assert (arm / 'out' / 'prediction_two.png').stat().st_size > 0


@pytest.fixture(scope='module')
def axis(tmp_path_factory):
    """A recording of the simulated axis."""
    folder = tmp_path_factory.mktemp('axis')
    arguments = ['--duration', '20', '--rate', '200', '--seed', '1', '--out', str(folder)]
    assert main(['simulate', 'linear_axis', *arguments]) == 0
    (folder / 'linear_axis.mcap').rename(folder / 'axis.mcap')
    return folder


def test_held_out_stretches_are_learned_from_by_nobody(axis, tmp_path):
    """Rows of both parts add up, also where stretches alternate."""
    for kind in ('tail', 'alternate'):
        status = main([
            'identify', str(axis / 'axis.mcap'), '--robot', 'linear_axis', '--holdout', kind,
            '--share', '0.5', '--stretch', '3', '--cutoff', '8', '--out', str(tmp_path / kind),
        ])  # fmt: skip
        assert status == 0
        rows = json.loads((tmp_path / kind / 'identification.json').read_text())['rows']
        assert abs(rows['train'] - rows['held out']) < 0.3 * rows['train']


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (('--share', '1'), 'share'),
        (('--inputs', 'speed:axis'), 'speed:axis'),
        (('--test', 'nowhere.mcap'), 'nowhere.mcap'),
        (('--cutoff', '0.01'), 'cut-off'),
        (('--robot', 'reaction_wheel'), 'joint'),
    ],
)
def test_bad_input_ends_in_one_line(axis, tmp_path, capsys, arguments, said):
    """With status 2, and no half-written result."""
    base = ['identify', str(axis / 'axis.mcap'), '--robot', 'linear_axis']
    assert main([*base, *arguments, '--out', str(tmp_path / 'out')]) == 2
    error = capsys.readouterr().err.strip()
    assert said in error
    assert '\n' not in error
    assert not list(tmp_path.rglob('*.part'))
