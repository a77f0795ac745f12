"""`--sim FILE`: the machine is compared with what a model file of its simulation states."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml

from sgp_ros.apps.diagnosed_robot import YAML_NAME
from sgp_ros.cli import main
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot

MJCF = """<mujoco model="swing"><worldbody><body pos="0 0 1">
<joint name="hinge" axis="0 1 0" damping="0.2" frictionloss="0.3" armature="{armature}"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1.5"/></body></worldbody>
<actuator><motor joint="hinge"/></actuator></mujoco>"""


@pytest.fixture(scope='module')
def machine(tmp_path_factory):
    """Return the recording of a machine with more dry friction than its simulation, no rotor."""
    folder = tmp_path_factory.mktemp('machine')
    (folder / 'machine.xml').write_text(
        MJCF.replace('frictionloss="0.3"', 'frictionloss="0.5"').format(armature=0)
    )
    words = ['simulate', str(folder / 'machine.xml'), '--duration', '10', '--out', str(folder)]
    assert main([*words, '--force']) == 0
    return folder / 'machine.mcap'


def _diagnosed(machine, folder, armature, robot=''):
    (folder / 'sim.xml').write_text(MJCF.format(armature=armature))
    sim = str(folder / 'sim.xml')
    out = folder / 'out'
    words = ['diagnose', str(machine), '--robot', robot or sim, '--sim', sim, '--out', str(out)]
    assert main(words) == 0
    return json.loads((out / 'diagnosis.json').read_text()), load_robot(str(out / YAML_NAME))


@pytest.mark.long
def test_machine_and_model_stand_side_by_side(machine, tmp_path):
    """More friction and less rotor than the file states; damping, which both have, is shared."""
    found, diagnosed = _diagnosed(machine, tmp_path, 0.03)
    assert (found['reference'], found['verdict']) == ('simulation', 'missing_physics')
    said = {f['effect']: f for f in found['findings']}
    assert set(said) == {'coulomb_friction', 'armature'}
    level = said['coulomb_friction']
    assert level['parameters']['level']['value'] == pytest.approx(0.5, abs=0.02)
    assert level['in_simulation']['level']['value'] == pytest.approx(0.3)
    assert level['difference']['level']['value'] == pytest.approx(0.2, abs=0.02)
    assert said['armature']['in_simulation']['inertia']['value'] == pytest.approx(0.03)
    assert abs(said['armature']['parameters']['inertia']['value']) < 0.005
    assert [f['effect'] for f in found['shared']] == ['viscous_friction']
    stated = {e.name: e.numbers for e in nominal_model(diagnosed).stated}
    assert stated['coulomb_friction']['level'] == pytest.approx(0.5, abs=0.02)
    assert stated['viscous_friction']['b'] == pytest.approx(0.2, abs=0.03)


@pytest.mark.long
def test_the_motions_of_both_models_lie_over_the_measured_one(machine, tmp_path):
    """In the order of their errors; the series are those of the file's rows."""
    _diagnosed(machine, tmp_path, 0.03)
    found = json.loads((tmp_path / 'out' / 'overlay.json').read_text())
    assert set(found['recordings']) == {'train', 'held_out'}
    train = found['recordings']['train']
    assert set(train['modes']) == {'open_0.5', 'open_2', 'open_whole'}
    for errors in (mode['position_rms'] for mode in train['modes'].values()):
        worst = errors['nominal'] or {'hinge': np.inf}  # which may not be stable
        assert errors['diagnosed']['hinge'] < 0.2 * worst['hinge']
    with np.load(tmp_path / 'out' / 'overlay.npz') as series:
        n = len(series['train/time'])
        assert series['train/open_0.5_diagnosed'].shape == series['train/position'].shape == (n, 1)
        error = series['train/open_0.5_diagnosed'] - series['train/position']
        assert np.nanstd(error) < 0.1 * series['train/position'].std()


@pytest.mark.long
def test_another_machine_is_refused(machine, tmp_path, capsys):
    """One line names the joints of both."""
    (tmp_path / 'sim.xml').write_text(MJCF.format(armature=0).replace('hinge', 'knee'))
    (tmp_path / 'robot.xml').write_text(MJCF.format(armature=0))
    words = ['diagnose', str(machine), '--robot', str(tmp_path / 'robot.xml'),
             '--sim', str(tmp_path / 'sim.xml'), '--out', str(tmp_path / 'out')]  # fmt: skip
    assert main(words) == 2
    said = capsys.readouterr().err
    assert "has the joints ['knee']; expected those of the robot, ['hinge']" in said
    assert said.count('\n') == 1


def test_gains_of_a_model_are_kept_by_the_diagnosed_robot(tmp_path):
    """They stand under `gains` of the robot YAML."""
    text = MJCF.format(armature=0).replace('<motor joint="hinge"/>',
                                           '<position joint="hinge" kp="9" kv="1"/>')  # fmt: skip
    (tmp_path / 'robot.xml').write_text(text)
    source = load_robot(str(tmp_path / 'robot.xml')).source
    assert source['gains'] == {'kp': {'hinge': 9.0}, 'kd': {'hinge': 1.0}}
    (tmp_path / 'robot.yaml').write_text(yaml.safe_dump({'schema': 1, **source}))
    assert load_robot(str(tmp_path / 'robot.yaml')).source['gains'] == source['gains']
