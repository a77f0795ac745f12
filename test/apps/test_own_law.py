"""A law that a user writes down: listed, simulated, found, written, and used again."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml

from sgp_ros.cli import main
from sgp_ros.physics.term import Motion
from sgp_ros.robots.registry import load_robot
from test.simulation.trees import arm

FORMULA = '-a*dq[elbow]/(1 + (dq[elbow]/v0)**2)'
LAW = {
    'joint': 'elbow', 'words': 'an eddy-current brake', 'formula': FORMULA,
    'parameters': {
        'a': {'start': 0.5, 'unit': 'N m s/rad', 'range': [0, 10]},
        'v0': {'start': 2.0, 'unit': 'rad/s', 'range': [0.2, 20]},
    },
}  # fmt: skip


@pytest.fixture(scope='module')
def stated(tmp_path_factory):
    """A robot that may have the law, and one that has."""
    folder = tmp_path_factory.mktemp('law')
    (folder / 'arm.urdf').write_text(arm())
    known = yaml.safe_load(yaml.safe_dump(LAW))
    known['parameters']['a'] = {'value': 0.4, 'unit': 'N m s/rad'}
    known['parameters']['v0'] = {'value': 3.0, 'unit': 'rad/s'}
    for name, law in (('may', LAW), ('has', known)):
        robot = {'schema': 1, 'name': name, 'urdf': 'arm.urdf', 'effects': [{'law': law}]}
        (folder / f'{name}.yaml').write_text(yaml.safe_dump(robot))
    return folder


@pytest.fixture(scope='module')
def written(stated):
    """Findings of a robot that may have the law, in a recording of the one that has."""
    folder = stated
    made = ['simulate', str(folder / 'has.yaml'), '--duration', '12', '--sensor', 'bits=16']
    assert main([*made, '--out', str(folder / 'sim')]) == 0
    bag = str(folder / 'sim' / 'has.mcap')
    found = ['diagnose', bag, '--robot', str(folder / 'may.yaml'), '--out', str(folder / 'out')]
    assert main(found) == 0
    return folder


@pytest.mark.long
def test_it_is_found_with_its_numbers(written):
    """As the effect `law`, with formula and units, in file and report."""
    found = json.loads((written / 'out' / 'diagnosis.json').read_text())
    assert found['verdict'] == 'missing_physics'
    (finding,) = found['findings']
    assert (finding['effect'], finding['joint']) == ('law', 'elbow')
    assert finding['formula'] == f'tau_x[elbow] = {FORMULA}'
    for name, (value, unit) in {'a': (0.4, 'N m s/rad'), 'v0': (3.0, 'rad/s')}.items():
        number = finding['parameters'][name]
        assert number['unit'] == unit
        assert number['value'] == pytest.approx(value, abs=3.0 * number['std'])
        assert number['std'] < 0.1 * value
    assert FORMULA in (written / 'out' / 'report.html').read_text()
    assert (written / 'out' / 'law.png').exists()


@pytest.mark.long
def test_it_is_written_as_known_and_used_again(written, tmp_path):
    """In a robot of which the law is a part: a column of its model, and a simulation."""
    path = written / 'out' / 'robot_diagnosed.yaml'
    (entry,) = yaml.safe_load(path.read_text())['effects']
    assert set(entry['law']['parameters']['a']) == {'value', 'std', 'unit'}
    robot = load_robot(str(path))
    (i,) = [i for i, c in enumerate(robot.coefficients) if c.name == 'elbow.law.a']
    v = np.full((1, 2), 3.0)
    j = robot.joint_names.index('elbow')
    assert robot.regressor(Motion(v, v, v, v))[0, j, i] == pytest.approx(1.5, rel=0.05)
    assert main(['simulate', str(path), '--duration', '1', '--out', str(tmp_path / 'sim')]) == 0
    truth = json.loads((tmp_path / 'sim' / 'truth.json').read_text())
    assert truth['effects'][0]['formula'] == f'tau_x[elbow] = {FORMULA}'


def test_all_laws_are_listed(stated, tmp_path, capsys):
    """Those of the catalogue and the robot's own, with formula and unit."""
    robot = str(stated / 'may.yaml')
    assert main(['effects', '--robot', robot, '--out', str(tmp_path), '--json']) == 0
    listed = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert 'coulomb_friction' in [entry['effect'] for entry in listed['effects']]
    (own,) = listed['robot']
    assert own['words'] == 'an eddy-current brake'
    assert own['formula'] == f'tau_x[elbow] = {FORMULA}'
    assert own['parameters'] == {'a': 'N m s/rad', 'v0': 'rad/s'}
    assert json.loads((tmp_path / 'effects.json').read_text()) == listed
