"""`robot_diagnosed.yaml`: what it says, that it loads, and that it predicts better."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from sgp_ros.apps.diagnosed_robot import URDF_NAME, YAML_NAME, replayed, write_diagnosed
from sgp_ros.diagnosis.result import Diagnosis, Finding, Location, Parameter
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.recordings.reader import open_recording
from sgp_ros.rigid.tree import read_urdf
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree
from test.physics.test_stated import URDF

PRACTICE = Path(__file__).parents[2].parent / 'shared' / 'practice'
needs_cases = pytest.mark.skipif(not PRACTICE.exists(), reason='needs the practice cases')


def _finding(effect, joint, values, location=None):
    parameters = {
        name: Parameter(x) if isinstance(x, str) else Parameter(float(x), 0.02 * abs(x) + 1e-3)
        for name, x in values.items()
    }
    return Finding(joint, effect, parameters, location or Location(), 50.0, 0.9, 0.1)


def _diagnosis(findings=(), bodies=None):
    empty = {f.name: () for f in fields(Diagnosis)}
    return Diagnosis(**(empty | {'findings': tuple(findings), 'bodies': bodies}))


def _written(folder, urdf, findings=(), bodies=None, yaml_text=''):
    (folder / 'nominal.urdf').write_text(urdf)
    (folder / 'nominal.yaml').write_text(f'schema: 1\nurdf: nominal.urdf\n{yaml_text}')
    name = 'nominal.yaml' if yaml_text else 'nominal.urdf'
    out = folder / 'out'
    out.mkdir()
    write_diagnosed(out, load_robot(str(folder / name)), _diagnosis(findings, bodies))
    return out


def _scores(robot_file, bag):
    """Prequential nMSE of the physics alone, by channel and joint."""
    robot = load_robot(str(robot_file))
    engine = Engine(robot, EngineConfig.from_mapping({'model.method': 'PR'}, robot))
    replay(engine, open_recording(bag).events(), lambda _: None)
    return {
        (channel, joint): score.nmse
        for joint, channels in engine.scores().items()
        for channel, score in channels.items()
    }


@needs_cases
@pytest.mark.parametrize('number', ['05', '45', '32'])
def test_the_diagnosed_robot_predicts_better_than_the_nominal_one(tmp_path, number):
    """With the same terms, on a recording that nobody fitted; the effects are the true ones."""
    case = PRACTICE / 'cases' / f'case_{number}'
    answer = json.loads((PRACTICE / 'answers' / f'case_{number}.json').read_text())
    findings = [_finding(e['effect'], e['joint'], e['parameters']) for e in answer['effects']]
    for name, found in (('diagnosed', findings), ('nominal', [])):
        (tmp_path / name).mkdir()
        _written(tmp_path / name, (case / 'robot.urdf').read_text(), found)
    before, after = (
        _scores(tmp_path / name / 'out' / YAML_NAME, case / 'real_test.mcap')
        for name in ('nominal', 'diagnosed')
    )
    for channel in ('effort', 'acceleration'):
        # bodies that adapt may hide a discrepancy of one joint at the cost of another
        worst = [max(x[channel, j] for j in answer['joints']) for x in (before, after)]
        assert worst[1] < 0.1 * worst[0]
        assert all(after[channel, j] < 1.1 * before[channel, j] for j in answer['joints'])


@pytest.mark.parametrize('side', ['lower', 'upper'])
def test_the_side_of_an_effect_is_written_from_its_region(tmp_path, side):
    """The onset alone does not say towards which limit the friction rises."""
    region = [0.4, 2.0] if side == 'upper' else [-1.0, 0.4]
    location = Location(('position',), {'position': [region]})
    finding = _finding('limit_friction', 'shoulder', {'amplitude': 0.5, 'onset': 0.4}, location)
    out = _written(tmp_path, URDF, [finding])
    (effect,) = yaml.safe_load((out / YAML_NAME).read_text())['effects']
    assert effect['parameters']['side'] == {'value': side}
    load_robot(str(out / YAML_NAME))


def test_findings_come_back_with_values_and_spreads(tmp_path):
    """Into the prior of the next run; what is unknown has no place in a model."""
    findings = [
        _finding('coulomb_friction', 'elbow', {'level': 0.3}),
        _finding('unknown', 'elbow', {}),
        _finding('velocity_filter_lag', 'elbow', {'time_constant': 0.01}),
    ]
    findings = [
        Finding(f.joint, f.effect, {
            n: Parameter(p.value, p.std, {'level': 'N m'}.get(n, 's'))
            for n, p in f.parameters.items()
        }, f.location, 1.0, 0.9, 0.1)
        for f in findings
    ]  # fmt: skip
    robot = load_robot(str(_written(tmp_path, URDF, findings) / YAML_NAME))
    (c,) = [c for c in robot.coefficients if 'coulomb_friction' in c.name]
    assert (c.prior_mean, c.prior_std) == (0.3, pytest.approx(0.007))
    assert 'not modelled online: velocity_filter_lag of elbow' in robot.description
    assert 'unknown' not in robot.description


def test_what_was_known_stays_known(tmp_path):
    """Effects of the nominal robot come before those that were found, also of the same kind."""
    known = '{effect: viscous_friction, joint: elbow, parameters: {b: {value: 0.1}}}'
    found = _finding('viscous_friction', 'elbow', {'b': 0.2})
    out = _written(tmp_path, URDF, [found], yaml_text=f'effects: [{known}]\n')
    effects = yaml.safe_load((out / YAML_NAME).read_text())['effects']
    assert [e['parameters']['b']['value'] for e in effects] == [0.1, 0.2]
    load_robot(str(out / YAML_NAME))


def test_a_stated_payload_is_no_part_of_the_bodies_that_are_written(tmp_path):
    """It would count twice in the next run."""
    entry = '{mass: {value: 0.5}, x: {value: 0.0}, y: {value: 0.0}, z: {value: -0.2}}'
    (tmp_path / 'nominal.urdf').write_text(URDF)
    path = tmp_path / 'nominal.yaml'
    (last,) = (tree := read_urdf(URDF)).outermost
    joint = tree.moving_names[last]
    path.write_text(f'schema: 1\nurdf: nominal.urdf\neffects: [{{effect: payload, joint: {joint}, '
                    f'parameters: {entry}}}]\n')  # fmt: skip
    nominal = nominal_model(load_robot(str(path)))
    mass = nominal.plain.parameters[last, 0]
    assert nominal.tree.parameters[last, 0] == pytest.approx(mass + 0.5)
    np.testing.assert_allclose(
        nominal.without_stated(nominal.tree.parameters), nominal.plain.parameters, atol=1e-12
    )


def test_the_urdf_has_the_bodies_that_were_found(tmp_path):
    tree = read_urdf(URDF)
    bodies = 1.2 * tree.parameters
    bodies[bodies[:, 0] <= 0.0, 0] = 0.01
    bodies[:, [4, 6, 9]] += 1e-3
    out = _written(tmp_path, URDF, bodies=bodies)
    again = read_urdf(out / URDF_NAME)
    np.testing.assert_allclose(again.parameters, bodies, atol=1e-9)
    assert again.damping.tolist() == tree.damping.tolist()


TEXTS = ['locked: {elbow: 0.2}\n', 'payload: {link: tool0, mass: 0.5}\n']


def _heavier(folder, text, factor):
    """Return the robot of a YAML and its bodies, heavier by a factor and wide enough to exist."""
    (folder / 'nominal.urdf').write_text(URDF)
    (folder / 'nominal.yaml').write_text(f'schema: 1\nurdf: nominal.urdf\n{text}')
    bodies = factor * nominal_tree(load_robot(str(folder / 'nominal.yaml'))).parameters
    bodies[bodies[:, 0] <= 0.0, 0] = 0.01
    bodies[:, [4, 6, 9]] += 0.1
    return bodies


@pytest.mark.parametrize('text', TEXTS)
def test_bodies_are_written_less_what_hangs_on_locked_joints_and_the_payload(tmp_path, text):
    """Read again by the same YAML they are those that were found."""
    bodies = _heavier(tmp_path, text, 1.2)
    out = _written(tmp_path, URDF, bodies=bodies, yaml_text=text)
    assert yaml.safe_load((out / YAML_NAME).read_text()).items() >= yaml.safe_load(text).items()
    again = nominal_tree(load_robot(str(out / YAML_NAME)))
    np.testing.assert_allclose(again.parameters, bodies, atol=1e-9)


@pytest.mark.parametrize('text', TEXTS)
def test_a_urdf_that_cannot_hold_the_bodies_keeps_its_own(tmp_path, text):
    """A body lighter than what hangs on its link leaves nothing for the link."""
    bodies = _heavier(tmp_path, text, 0.01)
    out = _written(tmp_path, URDF, bodies=bodies, yaml_text=text)
    np.testing.assert_array_equal(
        read_urdf(out / URDF_NAME).parameters, read_urdf(URDF).parameters
    )
    load_robot(str(out / YAML_NAME))


def test_dry_friction_of_the_urdf_stays_and_is_a_term(tmp_path):
    """The nominal robot has it, so that a finding is what comes on top."""
    out = _written(tmp_path, URDF)
    again = read_urdf(out / URDF_NAME)
    assert again.friction.tolist() == read_urdf(URDF).friction.tolist()
    assert again.damping.tolist() == read_urdf(URDF).damping.tolist()
    robot = load_robot(str(out / YAML_NAME))
    rubbing = [c for c in robot.coefficients if c.name.endswith('.coulomb')]
    assert [(c.joint, c.prior_mean) for c in rubbing] == [('elbow', 0.2)]


_STATED = (
    'effects:\n- {{effect: coulomb_friction, joint: elbow, parameters: '
    '{{level: {{value: {}, unit: N m}}}}}}\n'
)


@pytest.mark.parametrize(
    ('yaml_text', 'place', 'levels'),
    [
        ('', 'urdf', [0.05]),
        ('parameters: {elbow.coulomb: {value: 0.5}}\n', 'parameters', [0.35]),
        (_STATED.format(0.5), 'effects', [0.2, 0.35]),
        (_STATED.format(0.1), 'urdf', [0.15]),
    ],
)  # fmt: skip
def test_what_was_stated_too_much_of_is_less_where_it_was_stated(
    tmp_path, yaml_text, place, levels
):
    """The URDF has 0.2; the rest of it stays, and no effect is negative or zero."""
    found = [_finding('coulomb_friction', 'elbow', {'level': -0.15})]
    out = _written(tmp_path, URDF, found, yaml_text=yaml_text)
    model = nominal_model(load_robot(str(out / YAML_NAME)))
    known = [x.coefficients[0] for x in model.stated if x.name == 'coulomb_friction']
    assert sorted(known) == pytest.approx(levels)
    written = yaml.safe_load((out / YAML_NAME).read_text())
    assert bool(written['effects']) is (place == 'effects')
    assert bool(written['parameters']) is (place == 'parameters')
    assert (out / URDF_NAME).read_text() != URDF or place != 'urdf'


def test_what_a_simulation_has_less_of_too_is_less(tmp_path):
    """Shared by simulation and machine, and still not in the robot file."""
    (tmp_path / 'nominal.urdf').write_text(URDF)
    shared = (_finding('coulomb_friction', 'elbow', {'level': -0.15}),)
    robot = load_robot(str(tmp_path / 'nominal.urdf'))
    write_diagnosed(tmp_path, robot, replace(_diagnosis(), shared=shared))
    model = nominal_model(load_robot(str(tmp_path / YAML_NAME)))
    known = [x.coefficients[0] for x in model.stated if x.name == 'coulomb_friction']
    assert known == pytest.approx([0.05])


def _stream(joints, n=400):
    """States of a robot on a swing, with efforts of their own."""
    t = np.arange(n)[:, None] * 0.01
    q = np.sin(t * np.linspace(2.0, 4.0, joints)) + 0.3 * np.sin(7.0 * t)
    effort = 3.0 * np.cos(3.0 * t) * np.ones(joints)
    return [
        JointSample(i * 10_000_000, ('shoulder', 'elbow', 'grip'), *map(frozen_array, row))
        for i, row in enumerate(zip(q, np.gradient(q, 0.01, axis=0), effort, strict=True))
    ]


def test_what_a_node_does_not_model_is_said_with_what_a_replay_leaves(tmp_path):
    """Backlash needs more than one time, and the process of an unknown effect is in no file."""
    coulomb = _finding('coulomb_friction', 'elbow', {'level': 0.3})
    events = _stream(3)

    backlash = _finding('backlash', 'elbow', {'gap': 0.01, 'motor_inertia': 0.02})
    unknown = _finding('unknown', 'shoulder', {})
    out = _written(tmp_path, URDF, [backlash, unknown])
    nominal = load_robot(str(tmp_path / 'nominal.urdf'))
    assert replayed(nominal, _diagnosis([coulomb], None), None, events, 'auto') is None
    found = replayed(nominal, _diagnosis([backlash, unknown], None), None, events, 'auto')
    robot = load_robot(str(out / YAML_NAME))
    engine = Engine(robot, EngineConfig.from_mapping({}, robot))
    replay(engine, events, lambda _: None)
    scores = {j: x['effort'].nmse for j, x in engine.scores().items() if 'effort' in x}
    assert scores
    assert found.content() == {
        'left_out': [{'joint': 'elbow', 'effect': 'backlash'},
                     {'joint': 'shoulder', 'effect': 'unknown'}],
        'effort_nmse': scores,
    }  # fmt: skip
    said = found.remark({'elbow': 0.0012})
    assert 'does not model backlash of elbow, the unexplained part at shoulder' in said
    assert f'elbow {scores["elbow"]:.2g} (here 0.0012)' in said
