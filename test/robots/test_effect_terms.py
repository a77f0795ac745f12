"""Effects stated in a robot YAML: force terms, efforts that act, the tree, and bad entries."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import yaml

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.errors import ConfigError
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.drive import Drive
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.term import Motion
from sgp_ros.rigid.rigid_body import inverse_dynamics
from sgp_ros.rigid.tree import read_urdf
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.observed_motion import ObservedMotion
from sgp_ros.robots.registry import load_robot
from test.physics.test_stated import URDF

WIDTH = 0.01
TREE = read_urdf(URDF)
OF_EFFORT = ('torque_gain', 'dead_zone', 'saturation', 'load_friction', 'joint_coupling',
             'motor_speed_limit')  # fmt: skip
ON_TREE = ('gravity_tilt', 'payload')
JOINTS = {
    'gravity_tilt': 'base', 'tip_force': 'tool', 'payload': 'elbow', 'limit_friction': 'shoulder',
    'mount_elasticity': 'base',
}  # fmt: skip
KINDS = {'joint_coupling': ('spring', 'torque'), 'position_friction': ('coulomb', 'viscous')}
ONLINE = [
    (name, kind) for name, effect in EFFECTS.items() if effect.is_online and not effect.is_late
    for kind in KINDS.get(name, ('',))
]  # fmt: skip
LATE = [name for name, effect in EFFECTS.items() if effect.is_late]


def _robot(folder, effects, terms='{viscous: all}'):
    (folder / 'arm.urdf').write_text(URDF)
    path = folder / 'arm.yaml'
    text = yaml.safe_dump({'effects': effects})
    path.write_text(f'schema: 1\nurdf: arm.urdf\nterms: {terms}\n{text}')
    return load_robot(str(path))


def _entry(name, kind, std=0.01):
    joint = JOINTS.get(name, 'elbow')
    numbers = {q.name: 0.3 + 0.1 * i for i, q in enumerate(EFFECTS[name].stated_quantities(kind))}
    if name == 'tip_force':
        numbers['fz'] = -2.0
    numbers |= {
        'position_friction': {'hi': 2.5}, 'torque_gain': {'gain': 0.6},
        'mount_elasticity': {'moved_mass': 50.0},
    }.get(name, {})  # fmt: skip
    words = {EFFECTS[name].kind_word: kind} if kind else {}
    words |= {'source_joint': 'shoulder'} if EFFECTS[name].has_source else {}
    parameters = {k: {'value': v, 'std': std} for k, v in numbers.items()}
    parameters |= {k: {'value': v} for k, v in words.items()}
    return {'effect': name, 'joint': joint, 'parameters': parameters}, numbers


def _motion(n=30, seed=0):
    q, v, a, effort = np.random.default_rng(seed).normal(size=(4, n, TREE.size))
    return Motion(3.0 * q, v, a, effort)


def _diagnosed_force(name, kind, numbers, motion):
    """The force that the diagnosis sees, found by its own report from shape and coefficients."""
    n = len(motion.position)
    time = np.arange(n) * 1.0
    drive = Drive(time - 0.5, motion.effort, ((0.0, n),), 1e-3)
    seen = ObservedMotion(
        TREE, time, 0.0, motion.position, motion.velocity, motion.acceleration, motion.effort,
        drive, sign=lambda v: np.tanh(v / WIDTH),
    )  # fmt: skip
    words = {'kind': kind} if kind else {}
    words |= {'source_joint': 'shoulder'} if EFFECTS[name].has_source else {}
    stated = EffectAt.stated(EFFECTS[name], JOINTS.get(name, 'elbow'), numbers | words, TREE)
    place, shape, c = stated.place, stated.shape, stated.coefficients
    if name in {'dead_zone', 'saturation'}:
        u, x = motion.effort[:, place.joint], shape[0]
        clipped = np.clip(u, -x, x)
        columns = ((clipped if name == 'saturation' else u - clipped) - u)[:, None]
    else:
        columns = EFFECTS[name].columns(seen, place, shape)
    if columns.ndim == 3:
        return columns @ c
    force = np.zeros((n, TREE.size))
    force[:, place.joint] = columns @ c
    return force


@pytest.mark.parametrize(('name', 'kind'), ONLINE)
def test_an_effect_of_the_file_is_the_force_of_the_diagnosis(tmp_path, name, kind):
    """`tau + tau_x(tau) - f W` of the effect is its tau_x, wherever it enters the model."""
    entry, numbers = _entry(name, kind)
    robot = _robot(tmp_path, [entry], '{inertial: all}')
    (tmp_path / 'plain').mkdir()
    plain = _robot(tmp_path / 'plain', [], '{inertial: all}')
    motion = _motion()
    force = np.zeros_like(motion.effort)
    if robot.effort_map is not None:
        acting = robot.effort_map(motion.effort, motion.velocity, is_measured=False)
        force += acting - motion.effort
    inertial = len(plain.coefficients)
    w = np.array([c.prior_mean for c in robot.coefficients])
    w[:inertial] = _bodies(name, numbers)
    f = robot.regressor(motion)
    force += plain.regressor(motion) @ TREE.parameters.ravel() - f @ w
    expected = _diagnosed_force(name, kind, numbers, motion)
    assert np.abs(expected).max() > 1e-3
    np.testing.assert_allclose(force, expected, atol=1e-6)  # slopes are differences


def _bodies(name, numbers):
    parameters = TREE.parameters.copy()
    if name == 'payload':
        m, c = numbers['mass'], np.array([numbers[x] for x in 'xyz'])
        tensor = m * (c @ c * np.eye(3) - np.outer(c, c))
        parameters[TREE.outermost[0]] += [
            m, *(m * c), tensor[0, 0], tensor[0, 1], tensor[1, 1], tensor[0, 2], tensor[1, 2],
            tensor[2, 2],
        ]  # fmt: skip
    return parameters.ravel()


@pytest.mark.parametrize(('name', 'kind'), ONLINE)
def test_terms_of_effects_are_affine_in_acceleration_and_blind_to_effort(tmp_path, name, kind):
    """The filter relies on the first, prediction before the target on the second."""
    robot, m = _robot(tmp_path, [_entry(name, kind)[0]]), _motion()

    def rows(acceleration, effort):
        return robot.regressor(Motion(m.position, m.velocity, acceleration, effort))

    a, zero = m.acceleration, np.zeros_like(m.effort)
    half = 0.5 * (rows(a, zero) + rows(-a, zero))
    np.testing.assert_allclose(half, rows(zero, zero), atol=1e-6)
    np.testing.assert_array_equal(rows(a, m.effort), rows(a, zero))


def test_every_effect_of_one_time_is_in_the_model(tmp_path):
    """Terms, efforts that act, or the tree; prior means and spreads are the stated ones."""
    for name, kind in ONLINE:
        robot = _robot(tmp_path, [_entry(name, kind, std=0.02)[0]])
        own = [c for c in robot.coefficients if f'.{name}.' in c.name]
        assert own or robot.effort_map is not None or name in ON_TREE
        assert (robot.effort_map is not None) == (
            name in OF_EFFORT and (name, kind) != ('joint_coupling', 'spring')
        )
        assert all(0.0 < c.prior_std < math.inf for c in own)
    robot = _robot(tmp_path, [_entry('coulomb_friction', '', std=0.02)[0]])
    (c,) = [c for c in robot.coefficients if 'coulomb_friction' in c.name]
    assert (c.name, c.unit, c.joint) == ('elbow.coulomb_friction.level', 'N m', 'elbow')
    assert (c.prior_mean, c.prior_std) == (0.3, pytest.approx(0.02))


@pytest.mark.parametrize(
    'name', [n for n, e in EFFECTS.items() if not e.is_online and n != 'friction_drift']
)
def test_effects_with_memory_are_named_but_not_modelled(tmp_path, name):
    robot = _robot(tmp_path, [_entry(name, next(iter(EFFECTS[name].kinds), ''))[0]])
    assert f'not modelled online: {name} of {JOINTS.get(name, "elbow")}' in robot.description
    assert robot.effort_map is None
    assert len(robot.coefficients) == TREE.size


def test_equal_effects_on_one_joint_keep_apart(tmp_path):
    entry = _entry('position_friction', 'coulomb')[0]
    names = [c.name for c in _robot(tmp_path, [entry, entry]).coefficients]
    assert len(set(names)) == len(names)
    assert 'elbow.position_friction_2.amplitude' in names


def test_a_tilted_base_turns_gravity_alone(tmp_path):
    """Torques at rest of the tilted tree are those of the level one with turned gravity."""
    entry, x = _entry('gravity_tilt', '')
    robot = _robot(tmp_path, [entry], '{inertial: all}')
    m = _motion()
    still = np.zeros_like(m.position)
    cr, sr, cp, sp = np.cos(x['roll']), np.sin(x['roll']), np.cos(x['pitch']), np.sin(x['pitch'])
    R = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]) @ [[1, 0, 0], [0, cr, -sr], [0, sr, cr]]
    turned = replace(TREE, gravity=R.T @ [0.0, 0.0, -9.81])
    expected = inverse_dynamics(turned, TREE.parameters, m.position, still, still)
    found = robot.regressor(Motion(m.position, still, still, still)) @ TREE.parameters.ravel()
    np.testing.assert_allclose(found, expected, atol=1e-10)


def test_a_measured_effort_lies_behind_the_dead_zone(tmp_path):
    """Motor currents show what a drive gives; a wrong torque constant they do not show."""
    names = ('dead_zone', 'saturation', 'torque_gain')
    for name, changes in zip(names, (False, False, True), strict=True):
        robot, m = _robot(tmp_path, [_entry(name, '')[0]]), _motion()
        acting = robot.effort_map(m.effort, m.velocity, is_measured=True)
        assert bool(np.any(acting != m.effort)) == changes


def test_held_commands_act_through_the_drive_exactly(tmp_path):
    """The drive acts on each command, not on the average over a window."""
    entry, _ = _entry('dead_zone', '')
    entry['parameters']['width']['value'] = 0.5
    robot = _robot(tmp_path, [entry])
    settings = {'filter.window': 0.1, 'filter.hop': 0.0, 'reorder_window': 0.0}
    engine = Engine(robot, EngineConfig.from_mapping(settings, robot))
    names, found = robot.joint_names, []
    for i in range(60):
        stamp = i * 10_000_000
        u = 1.0 if i % 2 else -0.4
        command = CommandSample(stamp, frozen_array([u] * 3), names)
        state = JointSample(stamp, names, frozen_array([0.1 * i, 0.0, 0.0]))
        for event in (command, state):
            found += engine.push(event).estimates
    elbow = names.index('elbow')
    efforts = {round(float(e.effort.measured[elbow]), 6) for e in found}
    # half of the time 1 - 0.5, half of it nothing; the average 0.3 alone would give 0
    assert all(0.2 < x < 0.3 for x in efforts)


def _efforts(robot, stamps, values):
    """The averaged effort of every window, under commands (c, 3) that hold from `stamps` [ns]."""
    settings = {'filter.window': 0.1, 'filter.hop': 0.0, 'reorder_window': 0.0}
    engine = Engine(robot, EngineConfig.from_mapping(settings, robot))
    states = [
        JointSample(t, robot.joint_names, frozen_array([1e-9 * t, 0.0, 0.0]))
        for t in range(10**9, 2 * 10**9, 7_000_000)
    ]
    commands = [
        CommandSample(int(t), frozen_array(u), robot.joint_names)
        for t, u in zip(stamps, values, strict=True)
    ]
    found = []
    for event in sorted([*commands, *states], key=lambda event: event.stamp_ns):
        found += engine.push(event).estimates
    return np.array([e.effort.measured for e in found])


@pytest.mark.parametrize('joint', ['elbow', 'all'])
def test_a_stated_delay_is_that_of_commands_that_come_later(tmp_path, joint):
    """In each window exactly, whenever the commands change; other joints are not delayed."""
    rng = np.random.default_rng(3)
    stamps = 10**9 + np.concatenate([[-(10**8)], np.sort(rng.integers(0, 10**9, size=60))])
    values = rng.normal(size=(61, 3))
    entry, _ = _entry('command_delay', '')
    entry |= {'joint': joint, 'parameters': {'delay': {'value': 0.023}}}
    (tmp_path / 'plain').mkdir()
    plain = _robot(tmp_path / 'plain', [])
    found = _efforts(_robot(tmp_path, [entry]), stamps, values)
    late = _efforts(plain, stamps + 23_000_000, values)
    now = _efforts(plain, stamps, values)
    is_late = np.array([joint in {name, 'all'} for name in plain.joint_names])
    np.testing.assert_allclose(found, np.where(is_late, late, now), atol=1e-9)
    assert np.abs(late - now).max() > 0.1


def test_late_drives_take_the_commands_alone(tmp_path):
    """A lag smooths what was commanded; a measured effort lies behind it."""
    for name in LATE:
        entry, _ = _entry(name, '')
        robot, m = _robot(tmp_path, [entry]), _motion()
        measured = robot.effort_map(m.effort, m.velocity, is_measured=True)
        np.testing.assert_array_equal(measured, m.effort)
        stamps = np.arange(-1, 20) * 50_000_000
        found = _efforts(robot, stamps, np.sign(np.sin(np.arange(21)))[:, None] * np.ones(3))
        joint = robot.joint_names.index('elbow')
        assert 0.1 < np.ptp(found[:, joint]) < 3.0
        assert np.abs(found[:, joint] - found[:, joint - 1]).max() > 0.1


def test_drives_that_a_robot_states_stand_in_series(tmp_path):
    """In the order of a drive, not of the file; that of another motor stands alone."""
    limit, late = _entry('saturation', '')[0], _entry('command_delay', '')[0]
    other = _entry('dead_zone', '')[0] | {'joint': 'shoulder'}
    stated = nominal_model(_robot(tmp_path, [limit, other, late])).stated
    before = {s.name: [d.name for d in s.before] for s in stated if s.effect.stage}
    assert before == {'saturation': ['command_delay'], 'dead_zone': [], 'command_delay': []}


def test_a_limit_acts_on_the_command_that_comes_late(tmp_path):
    """The node's effort is that of commands that were limited and came later."""
    rng = np.random.default_rng(3)
    stamps = 10**9 + np.concatenate([[-(10**8)], np.sort(rng.integers(0, 10**9, size=60))])
    values = rng.normal(size=(61, 3))
    late, _ = _entry('command_delay', '')
    limit, _ = _entry('saturation', '')
    late |= {'joint': 'elbow', 'parameters': {'delay': {'value': 0.023}}}
    limit |= {'joint': 'elbow', 'parameters': {'limit': {'value': 0.6}}}
    (tmp_path / 'plain').mkdir()
    plain = _robot(tmp_path / 'plain', [])
    found = _efforts(_robot(tmp_path, [limit, late]), stamps, values)
    expected = _efforts(plain, stamps + 23_000_000, np.clip(values, -0.6, 0.6))
    elbow = plain.joint_names.index('elbow')
    np.testing.assert_allclose(found[:, elbow], expected[:, elbow], atol=1e-9)


BAD = [
    (7, 'is 7, not a list'),
    ([3], 'effects[0] is 3'),
    ([{'effect': 'magnetism', 'joint': 'elbow', 'parameters': {}}], "'magnetism', not one of"),
    ([{'effect': 'coulomb_friction', 'joint': 'knee', 'parameters': {'level': {'value': 1}}}],
     'of knee: the joint is not one of'),
    ([{'effect': 'coulomb_friction', 'joint': 'elbow', 'parameters': {}}], 'level is None'),
    ([{'effect': 'coulomb_friction', 'joint': 'elbow', 'parameters': {'level': {'value': -1}}}],
     'are physically impossible'),
    ([{'effect': 'dead_zone', 'joint': 'elbow', 'parameters': {'width': {'value': 0}}}],
     'not a positive number'),
    ([{'effect': 'coulomb_friction', 'joint': 'elbow',
       'parameters': {'level': {'value': 1, 'std': 0}}}], 'std of level is 0'),
    ([{'effect': 'coulomb_friction', 'joint': 'elbow',
       'parameters': {'level': {'value': 1, 'unit': 'N'}}}], "in 'N', not in 'N m'"),
    ([{'effect': 'coulomb_friction', 'joint': 'elbow',
       'parameters': {'level': {'value': 1}, 'mu': {'value': 1}}}], "unknown parameter 'mu'"),
    ([{'effect': 'position_friction', 'joint': 'elbow', 'parameters': {'kind': 'dry'}}],
     "kind is 'dry'"),
    ([{'effect': 'joint_coupling', 'joint': 'elbow', 'parameters': {'kind': 'torque',
       'source_joint': 'elbow', 'coefficient': {'value': 0.1}}}], "source_joint is 'elbow'"),
    ([{'effect': 'gravity_tilt', 'joint': 'elbow', 'parameters': {}}], "not one of ['base']"),
]  # fmt: skip


@pytest.mark.parametrize(('effects', 'message'), BAD)
def test_a_wrong_effect_is_refused_with_the_reason(tmp_path, effects, message):
    with pytest.raises(ConfigError) as caught:
        _robot(tmp_path, effects)
    assert message in str(caught.value)


def test_all_wrong_effects_stand_in_one_error(tmp_path):
    effects = [e[0] for e, _ in BAD if isinstance(e, list) and isinstance(e[0], dict)]
    with pytest.raises(ConfigError) as caught:
        _robot(tmp_path, effects)
    assert all(f'effects[{i}]' in str(caught.value) for i in range(len(effects)))
    assert '\n' not in str(caught.value)


def test_the_place_of_a_stated_side_is_taken(tmp_path):
    """The end of the range an effect sits at, where the nearer one is not meant."""
    entry = {
        'effect': 'end_stop',
        'joint': 'elbow',
        'parameters': {
            'position': {'value': 0.3},
            'stiffness': {'value': 5.0},
            'damping': {'value': 0.1},
        },
    }
    for word, side in (('upper', 1), ('lower', -1)):
        entry['parameters']['side'] = {'value': word}
        robot = _robot(tmp_path, [entry])
        q = np.array([[0.3 + 0.1 * side if n == 'elbow' else 0.0 for n in robot.joint_names]])
        still = np.zeros_like(q)
        own = [i for i, c in enumerate(robot.coefficients) if c.name == 'elbow.end_stop.stiffness']
        pressed = robot.regressor(Motion(q, still, still, still))[0, :, own]
        assert pressed.sum() == pytest.approx(0.1 * side)
