"""One robot in several forms: terms with values, `<dynamics>` of the URDF, effects."""

from __future__ import annotations

import re

import numpy as np
import pytest
import yaml

from sgp_ros.apps.identified_robot import write_identified
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.physics.term import Motion
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.observed_motion import ObservedMotion
from sgp_ros.robots.registry import load_robot
from test.apps.test_stated_simulation import Simulated
from test.diagnosis.worlds import CHAINS, events_of, simulate, urdf
from test.physics.test_stated import URDF as RUBBING

URDF = re.sub(r' friction="[^"]*"', '', RUBBING)
LEVEL = 0.4
FORMS = ('terms', 'dynamics', 'effects')


def _arm(folder, urdf, joint, form):
    """Write the robot with a dry friction of `LEVEL` on a joint, stated in one form."""
    document = {'schema': 1, 'urdf': 'arm.urdf'}
    if form == 'dynamics':
        # the joint's own `<dynamics>`, its damping kept
        begin = urdf.index(f'<joint name="{joint}"')
        end = urdf.index('</joint>', begin)
        body = urdf[begin:end]
        had = re.search(r'<dynamics[^>]*damping="([^"]*)"[^>]*/>', body)
        damping = had.group(1) if had else '0'
        body = body.replace(had.group(0), '') if had else body
        body += f'<dynamics damping="{damping}" friction="{LEVEL}"/>'
        urdf = urdf[:begin] + body + urdf[end:]
    if form == 'terms':
        document['terms'] = dict.fromkeys(('inertial', 'viscous', 'coulomb'), 'all')
        document['parameters'] = {f'{joint}.coulomb': {'value': LEVEL, 'std': 0.01, 'unit': 'N m'}}
    if form == 'effects':
        stated = {'level': {'value': LEVEL, 'std': 0.01}}
        document['effects'] = [
            {'effect': 'coulomb_friction', 'joint': joint, 'parameters': stated}
        ]
    folder.mkdir(exist_ok=True)
    (folder / 'arm.urdf').write_text(urdf)
    path = folder / 'arm.yaml'
    path.write_text(yaml.safe_dump(document))
    return str(path)


@pytest.fixture(scope='module')
def rubbing():
    """A pendulum with dry friction, and its URDF."""
    return events_of(simulate(CHAINS[1], 4, 10.0, dry=lambda t, q, s: LEVEL))


@pytest.mark.parametrize('form', FORMS)
def test_friction_that_is_stated_is_not_missing(tmp_path, rubbing, form):
    """In any form; a robot that states none lacks it."""
    text = urdf(CHAINS[1])
    joint = re.search(r'<joint name="([^"]*)"', text).group(1)
    nominal = nominal_model(load_robot(_arm(tmp_path, text, joint, form)))
    found = diagnose(rubbing, nominal.robot, nominal.tree, {}, stated=nominal.stated)
    assert found.verdict == 'no_mismatch', [(f.effect, f.parameters) for f in found.findings]


def _needed(path, motion):
    """Return the efforts that diagnosis and node take for known, (n, k)."""
    nominal = nominal_model(load_robot(path))
    assert nominal.impossible == ()
    n = len(motion.position)
    seen = ObservedMotion(
        nominal.tree, np.zeros(n), 0.0, motion.position, motion.velocity, motion.acceleration,
        motion.effort, None, (0,), nominal.stated, sign=np.sign,
    )  # fmt: skip
    return seen.nominal_effort - seen.stated_force


def _motion(k, n=20):
    q, v, a = np.random.default_rng(1).normal(size=(3, n, k))
    return Motion(q, v + 0.5 * np.sign(v), a, np.zeros((n, k)))


def test_all_forms_are_one_robot(tmp_path):
    """To diagnosis and node, and where it is learned from its prior."""
    joint = 'elbow'
    needed = [_needed(_arm(tmp_path / form, URDF, joint, form), _motion(3)) for form in FORMS]
    plain = _needed(_arm(tmp_path / 'plain', URDF, joint, 'none'), _motion(3))
    names = nominal_model(load_robot(_arm(tmp_path / 'x', URDF, joint, 'none'))).tree.moving_names
    j = names.index(joint)
    for found in needed:
        np.testing.assert_allclose(found, needed[0], atol=1e-12)
        extra = found - plain
        np.testing.assert_allclose(extra[:, j], LEVEL * np.sign(_motion(3).velocity[:, j]))
        assert not np.delete(extra, j, axis=1).any()


def test_effects_come_on_top_and_parameters_take_the_place_of_the_urdf(tmp_path):
    """The elbow of this URDF rubs with 0.2 N m already."""
    motion = _motion(3)
    levels = {}
    for form in (*FORMS, 'none'):
        nominal = nominal_model(load_robot(_arm(tmp_path / form, RUBBING, 'elbow', form)))
        j = nominal.tree.moving_names.index('elbow')
        needed = _needed(str(tmp_path / form / 'arm.yaml'), motion)
        none = _needed(_arm(tmp_path / 'plain', URDF, 'elbow', 'none'), motion)
        levels[form] = (needed - none)[0, j] * np.sign(motion.velocity[0, j])
    assert levels == pytest.approx({'none': 0.2, 'terms': 0.4, 'dynamics': 0.4, 'effects': 0.6})


@pytest.fixture
def identified(tmp_path):
    """A robot file as `sgp identify` writes it, of real bodies that are not those of the URDF."""
    arm = tmp_path / 'source'
    arm.mkdir()
    (arm / 'arm.urdf').write_text(URDF)
    terms = ['inertial', 'viscous', 'coulomb', 'offset', 'armature', 'quadratic']
    document = {
        'schema': 1,
        'urdf': 'arm.urdf',
        'terms': dict.fromkeys(terms, 'all'),
        'coulomb_width': 1e-5,
    }
    (arm / 'arm.yaml').write_text(yaml.safe_dump(document))
    robot = load_robot(str(arm / 'arm.yaml'))
    values = {}
    bodies = nominal_model(robot).tree.parameters * 1.2
    rng = np.random.default_rng(2)
    inertial = iter(bodies.ravel())
    for c in robot.coefficients:
        is_body = c.name.rpartition('.')[2] in {'mass', 'mx', 'my', 'mz'} or '.I' in c.name
        values[c.name] = float(next(inertial)) if is_body else float(rng.uniform(0.05, 0.4))
    out = tmp_path / 'out'
    out.mkdir()
    found = np.array(list(values.values()))
    write_identified(out, robot, found, 0.01 * np.abs(found) + 1e-6)
    return out, robot, found


def test_an_identified_robot_names_its_own_urdf(identified):
    """So the folder can be moved as it is."""
    out, _, _ = identified
    document = yaml.safe_load((out / 'robot_identified.yaml').read_text())
    assert document['urdf'] == 'robot_identified.urdf'
    moved = out.rename(out.parent / 'moved')
    load_robot(str(moved / 'robot_identified.yaml'))


def test_an_identified_robot_is_one_to_replay_diagnosis_node_and_simulation(identified):
    """Bodies, friction, rotors and offsets: what one takes for known, all do."""
    out, robot, values = identified
    path = str(out / 'robot_identified.yaml')
    again = load_robot(path)
    motion = _motion(len(robot.joints))
    predicted = again.regressor(motion) @ np.array([c.prior_mean for c in again.coefficients])
    np.testing.assert_allclose(predicted, robot.regressor(motion) @ values, rtol=1e-9)
    needed = _needed(path, motion)
    np.testing.assert_allclose(needed, predicted, rtol=1e-9, atol=1e-9)
    simulated = Simulated.of(path)
    scale = np.sqrt((simulated.motion.effort**2).mean())
    assert scale > 0.0
    assert simulated.is_sliding.mean() > 0.3
    np.testing.assert_allclose(simulated.residual(), 0.0, atol=1e-6 * scale)


def test_what_no_physics_can_do_is_left_out_and_said(tmp_path):
    """A rotor of negative inertia, or a body of negative mass, may come out of a regression."""
    (tmp_path / 'arm.urdf').write_text(URDF)
    document = {
        'schema': 1, 'urdf': 'arm.urdf', 'terms': {'inertial': 'all', 'armature': 'all'},
        'parameters': {'elbow.armature': {'value': -0.1}, 'fore.mass': {'value': -1.0}},
    }  # fmt: skip
    (tmp_path / 'arm.yaml').write_text(yaml.safe_dump(document))
    robot = load_robot(str(tmp_path / 'arm.yaml'))
    nominal = nominal_model(robot)
    assert any('rotor inertia of elbow' in remark for remark in nominal.remarks)
    assert nominal.lacks_bodies
    np.testing.assert_array_equal(nominal.tree.parameters, nominal.plain.parameters)
