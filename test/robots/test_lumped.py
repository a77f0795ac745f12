"""A robot of lumped coefficients is one file: loaded, listed, simulated, diagnosed."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
import yaml

from sgp_ros.cli import main
from sgp_ros.errors import ConfigError
from sgp_ros.physics.term import Motion
from sgp_ros.robots import registry, shipped
from sgp_ros.robots.registry import load_robot, robot_names

DUMMY = """
schema: 1
name: dummy
description: A motor that winds up a spring
source: Hooke
target: effort
joints: [{name: drum-1}]
constants: {mass: 2, radius: 0.1}
coefficients:
  J: {unit: kg m^2, columns: {drum-1: 'ddq["drum-1"]'}, value: 0.5 * mass * radius ** 2}
  b: {unit: N m s/rad, columns: {drum-1: 'dq["drum-1"]'}, value: 0.02}
  k: {unit: N m/rad, columns: {drum-1: 'q["drum-1"]'}, value: 0.4}
bodies:
  links: {drum-1: {mass: mass, inertia: J, damping: b}}
  effects:
  - effect: spring
    joint: drum-1
    parameters: {stiffness: {value: k, unit: N m/rad}, rest: {value: 0, unit: rad}}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The robots of the package and one more file."""
    config = tmp_path / 'config'
    shutil.copytree(shipped.shipped_folder() / 'robots', config / 'robots')
    (config / 'robots' / 'dummy.yaml').write_text(DUMMY)
    monkeypatch.setattr(registry, 'shipped_folder', lambda: config)
    return config


def test_one_file_more_is_one_robot_more(folder):
    """Nothing else is touched for it to be known by its name."""
    assert 'dummy' in robot_names()
    robot = load_robot('dummy')
    q, v, a, effort = np.random.default_rng(0).normal(size=(4, 5, 1))
    rows = robot.regressor(Motion(q, v, a, effort))
    np.testing.assert_array_equal(rows, np.stack([a, v, q], axis=2))
    assert [c.joint for c in robot.coefficients] == ['drum-1'] * 3


@pytest.mark.long
def test_a_robot_of_one_file_is_simulated_and_diagnosed_by_its_name(folder, tmp_path):
    bag = tmp_path / 'bag'
    effect = 'coulomb_friction:joint=drum-1,level=0.1'
    arguments = ['simulate', 'dummy', '--duration', '20', '--effect', effect, '--out', str(bag)]
    assert main(arguments) == 0
    found = tmp_path / 'found'
    recording = str(bag / 'dummy.mcap')
    assert main(['diagnose', recording, '--robot', 'dummy', '--out', str(found)]) == 0
    diagnosis = json.loads((found / 'diagnosis.json').read_text(encoding='utf-8'))
    (finding,) = diagnosis['findings']
    assert (finding['effect'], finding['joint']) == ('coulomb_friction', 'drum-1')
    assert finding['parameters']['level']['value'] == pytest.approx(0.1, rel=0.1)


def _problems(tmp_path, **change):
    document = yaml.safe_load(DUMMY) | change
    path = tmp_path / 'changed.yaml'
    path.write_text(yaml.safe_dump(document))
    with pytest.raises(ConfigError) as caught:
        load_robot(str(path))
    assert '\n' not in str(caught.value)
    return str(caught.value)


def _column(text, **more):
    return {'c': {'unit': '1', 'columns': {'drum-1': text}, **more}}


@pytest.mark.parametrize(
    ('change', 'problem'),
    [
        ({'joints': []}, 'joints is []'),
        ({'joints': [{'name': 'a'}, {'name': 'a'}]}, 'different names'),
        ({'joints': [{'name': 'drum-1', 'kind': 'ball'}]}, 'revolute or prismatic'),
        ({'target': 'speed'}, "target is 'speed'"),
        ({'colour': 'red'}, "unknown key 'colour'"),
        ({'constants': {'a': 'b + 1'}}, 'constants.a'),
        ({'constants': {'a': '1 / 0'}}, 'the value inf'),
        ({'coefficients': {'c': 1}}, 'c.columns'),
        ({'coefficients': _column('ddq["drum-1"] ** 2')}, 'not affine in ddq[J]'),
        ({'coefficients': _column('sin(ddq["drum-1"])')}, 'not affine in ddq[J]'),
        ({'coefficients': _column('tau["drum-1"]')}, "may hold ddq[J], not ['tau']"),
        ({'coefficients': _column('q[drum]')}, "the joints ['drum']"),
        ({'coefficients': _column('k * q["drum-1"]')}, "the names ['k']"),
        ({'coefficients': _column('import os')}, 'cannot be read'),
        ({'coefficients': _column('1', value='x')}, 'c.value'),
        ({'coefficients': {'c': {'unit': '1', 'columns': {'arm': '1'}}}}, "columns of 'arm'"),
        ({'residual_inputs': 'speed'}, "residual input 'speed'"),
        ({'bodies': {'links': {}}}, 'bodies.links'),
        ({'bodies': {'links': {'drum-1': {'mass': 'x'}}}}, 'bodies.links.drum-1.mass'),
        ({'bodies': {'links': {'drum-1': {'weight': 1}}}}, 'weight'),
        (
            {'bodies': {'links': {'drum-1': {}}, 'effects': [{'effect': 'spring', 'joint': 'a'}]}},
            "joint is 'a'",
        ),
    ],
)  # fmt: skip
def test_a_wrong_entry_is_refused_with_its_place(tmp_path, change, problem):
    assert problem in _problems(tmp_path, **change)


def test_all_problems_of_a_lumped_robot_are_listed_at_once(tmp_path):
    text = _problems(tmp_path, target='speed', constants={'a': 'b'}, colour='red')
    for part in ('speed', 'constants.a', 'colour'):
        assert part in text


def test_a_robot_of_one_file_elsewhere_keeps_its_equations_when_identified(tmp_path):
    """Its file may be out of reach of what was identified."""
    path = tmp_path / 'dummy.yaml'
    path.write_text(DUMMY)
    robot = load_robot(str(path))
    again = tmp_path / 'again.yaml'
    again.write_text(yaml.safe_dump({'schema': 1, **robot.source}))
    q, v, a, effort = np.random.default_rng(0).normal(size=(4, 5, 1))
    motion = Motion(q, v, a, effort)
    rows = load_robot(str(again)).regressor(motion)
    np.testing.assert_array_equal(rows, robot.regressor(motion))
