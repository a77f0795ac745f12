"""The paper's own robots simulated and diagnosed by name, as their user does it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sgp_ros.apps.simulated_robot import find_robot
from sgp_ros.cli import main
from sgp_ros.diagnosis.criteria import DOUBTED
from sgp_ros.engine.samples import CommandSample
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot
from sgp_ros.simulation.assembly import make_simulation


def _diagnosed(folder, simulated, robot, *more):
    """Return the content of diagnosis.json for a simulated robot."""
    assert main(['simulate', simulated, '--out', str(folder / 'bag'), *more]) == 0
    bag = folder / 'bag' / f'{simulated}.mcap'
    assert main(['diagnose', str(bag), '--robot', robot, '--out', str(folder / 'found')]) == 0
    return json.loads((folder / 'found' / 'diagnosis.json').read_text(encoding='utf-8'))


def _values(finding):
    return {name: entry['value'] for name, entry in finding['parameters'].items()}


def _moved_again(folder, simulated, seconds):
    """Return true positions, and those of the diagnosed robot from the same start and commands."""
    truth = np.load(folder / 'bag' / 'truth.npz', allow_pickle=False)
    events = open_recording(str(folder / 'bag' / f'{simulated}.mcap')).events()
    given = [e.effort for e in events if isinstance(e, CommandSample)]
    found = find_robot(str(folder / 'found' / 'robot_diagnosed.yaml'))
    start = {name: truth[name][0] for name in ('position', 'velocity')}
    simulation = make_simulation(
        found.simulator, effects=found.effects, rate_hz=100.0, **start,
        controller='external' if given else 'zero',
    )  # fmt: skip
    count = round(100 * seconds)
    moved = np.empty((count, len(found.simulator.joints)))
    for i in range(count):
        moved[i] = simulation.step().true_position
        if given:
            simulation.hold(given[i])
    return truth['position'][:count], moved


@pytest.mark.long
@pytest.mark.parametrize('robot', ['reaction_wheel', 'linear_axis'])
def test_a_simulated_robot_is_the_one_of_its_name(tmp_path, robot):
    """Back-EMF, dry friction and offset of the truth are all in the nominal model."""
    assert _diagnosed(tmp_path, robot, robot)['verdict'] == 'no_mismatch'


@pytest.mark.long
def test_friction_that_is_added_to_the_wheel_is_found_with_its_number(tmp_path):
    """And what is written then moves as the truth under the same voltages."""
    effect = 'viscous_friction:joint=wheel,b=0.001'
    found = _diagnosed(tmp_path, 'reaction_wheel', 'reaction_wheel', '--effect', effect)
    (finding,) = found['findings']
    assert (finding['effect'], finding['joint']) == ('viscous_friction', 'wheel')
    assert _values(finding) == pytest.approx({'b': 0.001}, rel=0.1)
    true, moved = _moved_again(tmp_path, 'reaction_wheel', 5.0)
    assert np.all(np.mean((moved - true) ** 2, axis=0) < 0.01 * np.var(true, axis=0))


@pytest.mark.long
def test_the_friction_that_equation_28_leaves_out_is_found(tmp_path):
    """Bearing and back-EMF of the wheel; the pole's is too small to count as physics."""
    found = _diagnosed(tmp_path, 'reaction_wheel', 'reaction_wheel_6')
    finding, slight = found['findings']
    assert (slight['joint'], slight['effect']) == ('pole', 'viscous_friction')
    assert slight['probability'] <= DOUBTED
    assert (finding['effect'], finding['joint']) == ('viscous_friction', 'wheel')
    assert _values(finding) == pytest.approx({'b': 0.002}, rel=0.05)


@pytest.mark.long
def test_the_irregularity_of_the_toy_pendulum_is_found_without_a_motor(tmp_path):
    """The written robot moves as the truth and diagnoses the same recording without a finding."""
    found = _diagnosed(tmp_path, 'toy_pendulum', 'toy_pendulum')
    (finding,) = found['findings']
    assert (finding['effect'], finding['joint']) == ('position_friction', 'hinge')
    wanted = {'amplitude': 6.0, 'lo': 2.0, 'hi': 2.5, 'kind': 'coulomb'}
    assert _values(finding).pop('kind') == wanted.pop('kind')
    assert {name: _values(finding)[name] for name in wanted} == pytest.approx(wanted, rel=0.02)
    true, moved = _moved_again(tmp_path, 'toy_pendulum', 5.0)
    assert np.mean((moved - true) ** 2) < 0.01 * np.var(true)
    again, robot = tmp_path / 'again', tmp_path / 'found' / 'robot_diagnosed.yaml'
    load_robot(str(robot))
    bag = tmp_path / 'bag' / 'toy_pendulum.mcap'
    assert main(['diagnose', str(bag), '--robot', str(robot), '--out', str(again)]) == 0
    content = json.loads((again / 'diagnosis.json').read_text(encoding='utf-8'))
    assert content['verdict'] == 'no_mismatch'
