"""A law that is registered once: simulated, drawn, found, named, proven, written, documented."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from sgp_proof.concealed.draw import draw_case
from sgp_ros.cli import main
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.drawing import Drawn
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.parts import Quantity
from sgp_ros.physics.term import Motion
from sgp_ros.robots.registry import load_robot
from sgp_ros.simulation.effects import Action, Law
from sgp_ros.simulation.registry import LAWS

NAME, SEED = 'cubic_drag', 307
SECONDS = {'real': 17.0, 'real_test': 6.0, 'real_far': 2.0}
"""Half of what is drawn for results is enough to see it."""
ROOT = Path(__file__).parents[2]


class CubicDrag(Effect):
    """`tau_x = -c v^3`, in one place."""

    name = NAME
    words = 'cubic drag'
    formula = 'tau_x = -c v^3'
    source = 'this test'
    appearance = 'the effort that is left grows with the third power of the velocity'
    quantities = (Quantity('c', 'N m s3/rad3', low=0.0),)
    linear = ('c',)
    drawn_over = 'velocity'

    def local(self, x, shape):
        return (-(x.v**3),)

    def sized(self, x):
        return Drawn(x.small / x.velocity**3, lambda s: {'c': s})


def _simulated(_joints, joint, values):
    c = float(values['c'])
    return (Action(joint, force=lambda moment: -c * float(moment.velocity[joint]) ** 3),)


@pytest.fixture(scope='module')
def registered():
    """One entry for what it is, one for how it is simulated."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(EFFECTS, NAME, CubicDrag())
        patch.setitem(LAWS, NAME, Law(_simulated))
        yield


@pytest.fixture(scope='module')
def diagnosed(registered, tmp_path_factory):
    """A drawn world with it, its right answer, and what a diagnosis of it leaves."""
    folder = tmp_path_factory.mktemp('drawn')
    for name in ('cases', 'answers'):
        (folder / name).mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('sgp_proof.concealed.draw._SECONDS', SECONDS)
        draw_case(SEED, 'A', NAME, folder)
    (case,) = (folder / 'cases').iterdir()
    answer = json.loads((folder / 'answers' / f'{case.name}.json').read_text())
    out = folder / 'out'
    command = ['diagnose', str(case / 'real.mcap'), '--robot', str(case / 'robot.urdf')]
    assert main([*command, '--test', str(case / 'real_test.mcap'), '--out', str(out)]) == 0
    return answer['effects'][0], out, case


def test_it_is_found_and_named_with_its_numbers(diagnosed):
    """In the file: joint, name, value, unit, formula; and it holds on what was kept back."""
    true, out, _ = diagnosed
    assert true['effect'] == NAME
    assert true['scored'] == ['c']
    found = json.loads((out / 'diagnosis.json').read_text())
    assert found['verdict'] == 'missing_physics'
    (finding,) = found['findings']
    assert (finding['effect'], finding['joint']) == (NAME, true['joint'])
    assert finding['formula'] == 'tau_x = -c v^3'
    c = finding['parameters']['c']
    assert c['unit'] in {'N m s3/rad3', 'N s3/m3'}
    assert c['value'] == pytest.approx(true['parameters']['c'], rel=0.05)
    proof = found['fit']['real_test']
    joint = true['joint']
    assert proof['nmse_after'][joint] < 0.2 * proof['nmse_before'][joint]


def test_it_is_worded_and_sketched_in_the_report(diagnosed):
    """By its own words, over the variable that it names."""
    _, out, _ = diagnosed
    assert 'cubic drag' in (out / 'report.html').read_text()
    assert (out / 'law.png').exists()


def test_it_is_written_and_loaded_again(diagnosed):
    """With a coefficient of its own in the model, and in the simulation of the file."""
    true, out, _ = diagnosed
    path = out / 'robot_diagnosed.yaml'
    (stated,) = yaml.safe_load(path.read_text())['effects']
    assert stated['effect'] == NAME
    robot = load_robot(str(path))
    (i,) = [i for i, c in enumerate(robot.coefficients) if c.name.endswith(f'{NAME}.c')]
    j = robot.joint_names.index(true['joint'])
    v = np.full((1, len(robot.joints)), 2.0)
    column = robot.regressor(Motion(v, v, v, v))[0, :, i]
    assert column[j] == pytest.approx(8.0)
    assert main(['simulate', str(path), '--duration', '1', '--out', str(out / 'again')]) == 0
    truth = json.loads((out / 'again' / 'truth.json').read_text())
    assert NAME in json.dumps(truth)


def test_it_is_simulated_by_its_name(diagnosed, tmp_path):
    """On the command line, with the units of the catalogue in what is refused."""
    true, _, case = diagnosed
    robot, text = str(case / 'robot.urdf'), f'{NAME}:joint={true["joint"]}'
    command = ['simulate', robot, '--duration', '1', '--out', str(tmp_path), '--effect']
    assert main([*command, f'{text},c=0.01']) == 0
    assert main([*command, f'{text},c=-1']) == 2


def test_it_is_documented(registered):
    """By the generator of the page of effects."""
    spec = importlib.util.spec_from_file_location('effects', ROOT / 'docs/generate_effects.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    text = module.text()
    assert f'## `{NAME}`' in text
    assert '| `c` | N m s3/rad3 | at least 0 |' in text
    assert f'This page lists the {len(EFFECTS)} effects' in text
