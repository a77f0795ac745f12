"""The paper's own robots simulated and diagnosed by name, as their user does it."""

from __future__ import annotations

import json

import pytest

from sgp_ros.cli import main
from sgp_ros.robots.registry import load_robot


def _diagnosed(folder, simulated, robot, *more):
    """Return the content of diagnosis.json for a simulated robot."""
    assert main(['simulate', simulated, '--out', str(folder / 'bag'), *more]) == 0
    bag = folder / 'bag' / f'{simulated}.mcap'
    assert main(['diagnose', str(bag), '--robot', robot, '--out', str(folder / 'found')]) == 0
    return json.loads((folder / 'found' / 'diagnosis.json').read_text(encoding='utf-8'))


def _values(finding):
    return {name: entry['value'] for name, entry in finding['parameters'].items()}


@pytest.mark.parametrize('robot', ['reaction_wheel', 'linear_axis'])
def test_a_simulated_robot_is_the_one_of_its_name(tmp_path, robot):
    """Back-EMF, dry friction and offset of the truth are all in the nominal model."""
    assert _diagnosed(tmp_path, robot, robot)['verdict'] == 'no_mismatch'


def test_friction_that_is_added_to_the_wheel_is_found_with_its_number(tmp_path):
    effect = 'viscous_friction:joint=wheel,b=0.001'
    found = _diagnosed(tmp_path, 'reaction_wheel', 'reaction_wheel', '--effect', effect)
    (finding,) = found['findings']
    assert (finding['effect'], finding['joint']) == ('viscous_friction', 'wheel')
    assert _values(finding) == pytest.approx({'b': 0.001}, rel=0.1)


def test_the_friction_that_equation_28_leaves_out_is_found(tmp_path):
    """Bearing and back-EMF of the wheel; the pole's is too small to count as physics."""
    found = _diagnosed(tmp_path, 'reaction_wheel', 'reaction_wheel_6')
    (finding,) = found['findings']
    assert (finding['effect'], finding['joint']) == ('viscous_friction', 'wheel')
    assert _values(finding) == pytest.approx({'b': 0.002}, rel=0.05)


def test_the_irregularity_of_the_toy_pendulum_is_found_without_a_motor(tmp_path):
    """And what is written then diagnoses the same recording without a finding."""
    found = _diagnosed(tmp_path, 'toy_pendulum', 'toy_pendulum')
    (finding,) = found['findings']
    assert (finding['effect'], finding['joint']) == ('position_friction', 'hinge')
    wanted = {'amplitude': 6.0, 'lo': 2.0, 'hi': 2.5, 'kind': 'coulomb'}
    assert _values(finding).pop('kind') == wanted.pop('kind')
    assert {name: _values(finding)[name] for name in wanted} == pytest.approx(wanted, rel=0.02)
    again, robot = tmp_path / 'again', tmp_path / 'found' / 'robot_diagnosed.yaml'
    load_robot(str(robot))
    bag = tmp_path / 'bag' / 'toy_pendulum.mcap'
    assert main(['diagnose', str(bag), '--robot', str(robot), '--out', str(again)]) == 0
    content = json.loads((again / 'diagnosis.json').read_text(encoding='utf-8'))
    assert content['verdict'] == 'no_mismatch'
