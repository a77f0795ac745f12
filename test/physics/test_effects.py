"""Contract of every effect of the catalogue, and each formula against plain code."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.confined import inside
from sgp_ros.physics.drive import Drive
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import Quantity
from sgp_ros.physics.place import Place
from sgp_ros.rigid.rigid_body import mass_matrix
from sgp_ros.rigid.tree import read_urdf
from sgp_ros.robots.observed_motion import ObservedMotion

STEP, ROWS = 0.01, 400
SOUTH = (0.0, 0.0, -9.81)
# turns within limits; turns for ever, passive; slides within limits; turns at the tip
KINDS = ('revolute', 'continuous', 'prismatic', 'revolute')
PASSIVE = 1
DRY = (
    'coulomb_friction', 'stribeck_friction', 'position_friction', 'limit_friction',
    'asymmetric_coulomb', 'load_friction', 'friction_drift', 'coupled_friction',
)  # fmt: skip


def _urdf():
    lines = ['<robot name="r">', '<link name="l"/>']
    parent = 'l'
    for j, kind in enumerate(KINDS):
        axis = ('0 1 0', '1 0 0', '0 0 1', '0 1 0')[j]
        lines.append(
            f'<link name="l{j}"><inertial><origin xyz="0.05 0.02 {-0.1 - 0.02 * j}"/>'
            f'<mass value="{1.5 - 0.3 * j}"/><inertia ixx="0.02" iyy="0.03" izz="0.01" ixy="0" '
            f'ixz="0.001" iyz="0"/></inertial></link><joint name="j{j}" type="{kind}">'
            f'<parent link="{parent}"/><child link="l{j}"/><origin xyz="0.1 0 -0.2"/>'
            f'<axis xyz="{axis}"/><limit lower="-1.5" upper="1.8" effort="50" velocity="9"/>'
            f'<dynamics damping="{0.1 * j}"/></joint>'
        )
        parent = f'l{j}'
    lines.append(
        f'<link name="tool0"/><joint name="t" type="fixed"><parent link="{parent}"/>'
        '<child link="tool0"/><origin xyz="0 0.1 -0.3"/></joint>'
        '<ros2_control name="c" type="system">'
    )
    lines += [
        f'<joint name="j{j}"><command_interface name="effort"/></joint>'
        for j in range(len(KINDS)) if j != PASSIVE
    ]  # fmt: skip
    return '\n'.join([*lines, '</ros2_control></robot>'])


TREE = read_urdf(_urdf())


def _motion(*, drive=True, still=()):
    """Sums of sines, with exact derivatives; commands that hold for 0.02 s."""
    rng = np.random.default_rng(3)
    k = TREE.size
    t = STEP * np.arange(ROWS)
    omega, phase = rng.uniform(1.0, 6.0, (k, 2)), rng.uniform(0.0, 6.0, (k, 2))
    size = np.array([0.5, 1.6, 0.4, 0.5])[:, None] * np.ones((k, 2))
    size[list(still)] = 0.0
    angle = omega * t[:, None, None] + phase
    q = (size * np.sin(angle)).sum(axis=2)
    v = (size * omega * np.cos(angle)).sum(axis=2)
    a = -(size * omega**2 * np.sin(angle)).sum(axis=2)
    times = np.arange(-0.2, ROWS * STEP + 0.2, 0.02)
    values = rng.normal(size=(len(times), k)) * TREE.is_actuated
    commands = Drive(times, values, ((0.0, ROWS),), STEP)
    effort = np.column_stack([commands.effort(j) for j in range(k)])
    return ObservedMotion(TREE, t, STEP, q, v, a, effort, commands if drive else None)


MOTION = _motion()
CONTRACT = [
    pytest.param(effect, place, id=f'{effect.name}-{place.joint}{place.kind}{place.side or ""}')
    for effect in EFFECTS.values() for place in effect.places(MOTION)
]  # fmt: skip
SHAPED = [p for p in CONTRACT if len(p.values[0].bounds(MOTION, p.values[1])[0])]


def columns(name, joint, shape=(), motion=MOTION, **variant):
    return EFFECTS[name].columns(motion, Place(joint, **variant), np.array(shape, dtype=float))


def report(name, joint, shape, coefficients, motion=MOTION, **variant):
    place = Place(joint, **variant)
    found = EffectAt(EFFECTS[name], place, np.array(shape), np.array(coefficients))
    return found.report(motion), found.is_possible(motion)


def _starts(effect, place, motion=MOTION):
    starts = effect.starts(motion, place)
    if effect.small is not None:
        c = 0.03 / starts[:, :1] * np.array([0.6, 0.8])
        found = [effect.small.shape(*pair) for pair in zip(starts, c, strict=True)]
        return np.clip(found, *effect.bounds(motion, place))
    if len(starts):
        return starts
    low, high = effect.bounds(motion, place)
    return np.array([[0.7 * low[0] + 0.3 * high[0], 0.3 * low[1] + 0.7 * high[1]]])


@pytest.mark.parametrize(('effect', 'place'), CONTRACT)
def test_columns_are_finite_and_have_the_shape_of_the_motion(effect, place):
    """(n, m) on one joint, (n, k, m) on all; one column for an effect without coefficients."""
    for shape in _starts(effect, place):
        x = effect.columns(MOTION, place, shape)
        assert x.shape[:-1] in {(ROWS,), (ROWS, TREE.size)}
        assert np.isfinite(x).all()
        assert np.any(x != 0.0) or effect.name in {'end_stop', 'backlash'}
        if effect.is_given:
            assert x.shape[-1] == 1


@pytest.mark.parametrize(('effect', 'place'), CONTRACT)
def test_the_report_has_the_names_of_its_quantities_and_finite_numbers(effect, place):
    """A word is a kind or a joint; a number has a unit."""
    shape = _starts(effect, place)[0]
    m = effect.columns(MOTION, place, shape).shape[-1]
    values = EffectAt(effect, place, shape, np.linspace(0.5, 0.8, m)).report(MOTION)
    units = {q.name: q.unit for q in effect.quantities}
    for name, value in values.items():
        if isinstance(value, str):
            assert name in {effect.kind_word, 'source_joint'}
            assert value
        else:
            assert np.isfinite(value)
            assert units[name]
    assert effect.formula


@pytest.mark.parametrize(('effect', 'place'), SHAPED)
def test_bounds_are_ordered_and_hold_every_start(effect, place):
    """A search begins inside."""
    low, high = effect.bounds(MOTION, place)
    assert np.all(low <= high)
    if not len(effect.starts(MOTION, place)):
        return
    for start in _starts(effect, place):
        assert start.shape == low.shape
        assert np.all(start >= low - 1e-12)
        assert np.all(start <= high + 1e-12)


@pytest.mark.parametrize('effect', EFFECTS.values(), ids=lambda e: e.name)
def test_no_place_on_a_joint_that_does_not_move(effect):
    """Invisible effects are no candidates; a load on the last link is one on all joints."""
    still = _motion(still=(0,))
    for place in effect.places(still):
        assert place.joint != 0
        assert effect.name != 'joint_coupling' or place.kind == 'torque' or place.source != 0
        for shape in _starts(effect, place, still):
            assert np.isfinite(effect.columns(still, place, shape)).all()


@pytest.mark.parametrize('name', [
    'torque_gain', 'dead_zone', 'saturation', 'actuator_lag', 'command_delay', 'load_friction',
    'backlash', 'motor_speed_limit', 'joint_elasticity',
])  # fmt: skip
def test_what_a_motor_does_has_no_place_on_a_passive_joint(name):
    """And every motor has one."""
    places = {p.joint for p in EFFECTS[name].places(MOTION)} - {-3}
    assert places == {0, 2, 3}


@pytest.mark.parametrize(
    'name', ['dead_zone', 'saturation', 'actuator_lag', 'command_delay', 'motor_speed_limit']
)
def test_without_commands_nothing_is_said_of_the_drive(name):
    """A measured effort is behind the drive."""
    assert EFFECTS[name].places(_motion(drive=False)) == []


@pytest.mark.parametrize(('effect', 'place'), SHAPED)
def test_a_number_at_the_end_of_its_range_is_known_as_such(effect, place):
    """At either end, and in no place between."""
    low, high = effect.bounds(MOTION, place)
    middle = _starts(effect, place)[0]
    m = effect.columns(MOTION, place, middle).shape[-1]
    inside = np.clip(middle, low + 1e-3 * (high - low), high - 1e-3 * (high - low))
    found = EffectAt(effect, place, inside, np.linspace(0.5, 0.8, m))
    assert found.at_bounds(MOTION) == frozenset()
    named = {q.name for q in effect.stated_quantities(place.kind)}
    for end in (low, high):
        for i in range(len(end)):
            shape = inside.copy()
            shape[i] = end[i]
            at_end = found.with_shape(shape).at_bounds(MOTION)
            # the motor of a backlash has a share of the link's inertia: another bound
            assert at_end or effect.name == 'backlash'
            assert at_end <= named
    assert {q.name for q in found.sizes} <= named
    assert found.sizes


def test_limits_are_where_the_urdf_has_them():
    """The continuous joint has none; a stop can be anywhere."""
    assert {(p.joint, p.side) for p in EFFECTS['limit_friction'].places(MOTION)} == {
        (j, side) for j in (0, 2, 3) for side in (-1, 1)
    }
    assert len(EFFECTS['end_stop'].places(MOTION)) == 2 * TREE.size


@pytest.mark.parametrize('name', EFFECTS)
def test_only_dry_friction_holds_a_joint(name):
    """Of the kinds, `coulomb` does."""
    effect = EFFECTS[name]
    for place in effect.places(MOTION):
        held = {place.joint, place.source} if name == 'coupled_friction' else {place.joint}
        expected = held if name in DRY and place.kind != 'viscous' else set()
        assert effect.held_joints(place) == expected


@pytest.mark.parametrize('name', EFFECTS)
def test_units_on_a_slide_are_those_of_forces_and_ways_but_a_phase_is_an_angle(name):
    """No radian is left but that of the phase; times and ratios stay."""
    for quantity in EFFECTS[name].quantities:
        assert quantity.unit_on(is_prismatic=False) == quantity.unit
        unit = quantity.unit_on(is_prismatic=True)
        assert ('rad' in unit) == (quantity.name == 'phase')
        assert 'N m' not in unit
    assert Quantity('phase', 'rad').unit_on(is_prismatic=True) == 'rad'


@pytest.mark.parametrize(('effect', 'place'), CONTRACT)
def test_an_effect_without_memory_sees_each_sample_alone(effect, place):
    """In any order of the rows the force is the same; with memory it must not be."""
    order = np.random.default_rng(5).permutation(ROWS)
    sliding = _motion(drive=effect.has_memory)
    sliding = replace(sliding, sign=np.sign)
    fields = ('time', 'position', 'velocity', 'acceleration', 'effort')
    mixed = replace(sliding, **{name: getattr(sliding, name)[order] for name in fields})
    starts = _starts(effect, place)
    shape = starts[len(starts) // 2]
    given, found = (effect.columns(m, place, shape) for m in (sliding, mixed))
    scale = np.abs(given).max() + 1e-300
    agree = np.abs(found - given[order]).max() < 1e-10 * scale
    assert agree == (not effect.has_memory)


@pytest.mark.parametrize(('effect', 'place'), CONTRACT)
def test_an_effect_says_whether_it_sees_the_acceleration(effect, place):
    """Where it does not, its force at a state is one, however the robot accelerates there."""
    other = replace(MOTION, acceleration=MOTION.acceleration + 3.0)
    sees = [
        not np.array_equal(
            effect.columns(MOTION, place, shape), effect.columns(other, place, shape)
        )
        for shape in _starts(effect, place)
    ]
    assert any(sees) == effect.sees_acceleration


def _q(j):
    return MOTION.position[:, j]


def _v(j):
    return MOTION.velocity[:, j]


def _steady():
    """Rows whose cell holds no reversal of any joint."""
    sign = np.sign(MOTION.velocity)
    same = np.ones(ROWS, dtype=bool)
    same[1:-1] = (sign[1:-1] == sign[2:]).all(axis=1) & (sign[1:-1] == sign[:-2]).all(axis=1)
    return same


@pytest.mark.parametrize('j', range(4))
def test_friction_opposes_the_motion_as_the_formulas_say(j):
    """Away from reversals direction is the sign of the velocity."""
    rows, s, v, t = _steady(), np.sign(_v(j)), _v(j), MOTION.time
    load = np.abs(MOTION.effort[:, j])

    def check(expected, name, shape, c, **variant):
        x = columns(name, j, shape, **variant) @ np.array(c)
        np.testing.assert_allclose(x[rows], expected[rows], atol=1e-12)

    check(-0.3 * v, 'viscous_friction', [], [0.3])
    check(-0.3 * s, 'coulomb_friction', [], [0.3])
    level = 0.2 + (0.5 - 0.2) * np.exp(-((v / 0.4) ** 2))
    check(-level * s, 'stribeck_friction', [0.4], [0.2, 0.3])
    check(-0.3 * np.abs(v) * v, 'quadratic_drag', [], [0.3])
    check(np.where(v > 0, -0.4, 0.1), 'asymmetric_coulomb', [], [0.4, 0.1])
    if TREE.is_actuated[j]:
        check(-(0.2 + 0.1 * load) * s, 'load_friction', [], [0.2, 0.1])
    fade = np.exp(-t / 1.5)
    check(-(0.2 + 0.5 * fade) * s, 'friction_drift', [1.5], [0.2, 0.7], kind='coulomb')
    check(-(0.2 + 0.5 * fade) * v, 'friction_drift', [1.5], [0.2, 0.7], kind='viscous')
    check(-0.3 * v * (np.abs(_q(j)) < 99), 'position_friction', [-99, 99], [0.3], kind='viscous')


@pytest.mark.parametrize(
    ('name', 'shape', 'c', 'variant', 'expected'),
    [
        ('stribeck_friction', [0.4], [0.2, 0.3], {},
         {'coulomb': 0.2, 'static': 0.5, 'stribeck_velocity': 0.4}),
        ('asymmetric_coulomb', [], [0.4, 0.1], {}, {'level_pos': 0.4, 'level_neg': 0.1}),
        ('friction_drift', [1.5], [0.2, 0.7], {'kind': 'viscous'},
         {'start': 0.7, 'end': 0.2, 'time_constant': 1.5, 'kind': 'viscous'}),
        ('position_friction', [0.4, 0.1], [0.7], {'kind': 'coulomb'},
         {'amplitude': 0.7, 'lo': 0.1, 'hi': 0.4, 'kind': 'coulomb'}),
        ('limit_friction', [1.0], [0.7], {'side': 1}, {'amplitude': 0.7, 'onset': 1.0}),
        ('load_friction', [], [0.2, 0.1], {}, {'level': 0.2, 'mu': 0.1}),
        ('spring', [], [3.0, 0.6], {}, {'stiffness': 3.0, 'rest': 0.2}),
        ('torque_gain', [], [-0.1], {}, {'gain': 0.9}),
        ('armature', [], [0.02], {}, {'inertia': 0.02}),
        ('constant_load', [], [-0.3], {}, {'force': -0.3}),
        ('end_stop', [1.0], [300.0, 4.0], {'side': 1},
         {'position': 1.0, 'stiffness': 300.0, 'damping': 4.0}),
        ('joint_coupling', [], [0.2], {'kind': 'torque', 'source': 2},
         {'kind': 'torque', 'coefficient': 0.2, 'source_joint': 'j2'}),
        ('joint_coupling', [0.5], [4.0], {'kind': 'spring', 'source': 2},
         {'kind': 'spring', 'stiffness': 4.0, 'ratio': 0.5, 'source_joint': 'j2'}),
        ('hysteresis', [0.05], [0.3], {}, {'level': 0.3, 'presliding': 0.05}),
        ('coupled_friction', [-2.0], [0.3, 0.1], {'source': 2},
         {'ratio': -2.0, 'coulomb': 0.3, 'viscous': 0.1, 'source_joint': 'j2'}),
        ('backlash', [0.1, 0.01, 0.2, 0.4], [1.0], {},
         {'gap': 0.01, 'motor_coulomb': 0.2, 'motor_viscous': 0.4,
          'motor_inertia': 0.1 * float(np.mean(MOTION.mass_diagonal[:, 0]))}),
    ],
    ids=lambda x: x if isinstance(x, str) else '',
)  # fmt: skip
def test_the_report_says_the_numbers_that_went_into_the_columns(name, shape, c, variant, expected):
    """In the words of the schema, and such numbers are possible."""
    values, possible = report(name, 0, shape, c, **variant)
    assert values == pytest.approx({k: v for k, v in expected.items() if not isinstance(v, str)}
                                   ) or values == expected  # fmt: skip
    assert possible


@pytest.mark.parametrize(
    ('name', 'shape', 'c', 'variant'),
    [
        ('viscous_friction', [], [-0.1], {}), ('coulomb_friction', [], [-0.1], {}),
        ('quadratic_drag', [], [-0.1], {}), ('stribeck_friction', [0.4], [0.2, -0.1], {}),
        ('load_friction', [], [0.2, -0.1], {}), ('asymmetric_coulomb', [], [0.4, -0.2], {}),
        ('friction_drift', [1.0], [-0.2, -0.2], {'kind': 'coulomb'}),
        ('limit_friction', [1.0], [-0.7], {'side': 1}), ('spring', [], [-3.0, 0.0], {}),
        ('armature', [], [-0.02], {}), ('hysteresis', [0.1], [-0.3], {}),
        ('joint_coupling', [0.5], [-4.0], {'kind': 'spring', 'source': 2}),
        ('end_stop', [1.0], [-300.0, 4.0], {'side': 1}), ('torque_gain', [], [-1.5], {}),
        ('payload', [-0.1, 0, 0, 0], [1.0], {}),
        ('coupled_friction', [1.0], [0.3, -0.2], {'source': 2}),
        ('coupled_friction', [0.002], [0.3, 0.2], {'source': 2}),
        ('command_delay', [0.0], [1.0], {}), ('encoder_eccentricity', [3.0, 0.3, 0.1], [1.0], {}),
    ],
)  # fmt: skip
def test_what_no_physics_can_do_is_not_possible(name, shape, c, variant):
    """Friction does not drive, springs do not repel, encoders do not run backwards."""
    assert not report(name, 0, shape, c, **variant)[1]


@pytest.mark.parametrize(('ratio', 'is_one'), [(0.002, False), (0.8, True), (-200.0, False)])
def test_a_cable_that_feels_one_joint_alone_couples_none(ratio, is_one):
    """It may be stated so, but is not found so."""
    law, place = EFFECTS['joint_coupling'], Place(0, 'spring', 2)
    at = EffectAt(law, place, np.array([ratio]), np.array([4.0]))
    assert law.is_inside(at, MOTION) is is_one
    assert law.is_possible(at, MOTION)


@pytest.mark.parametrize('side', [1, -1])
def test_friction_near_a_limit_rises_linearly_to_it(side):
    """0 at the onset, all at the limit of the URDF, none on the other side."""
    limit = TREE.upper[0] if side > 0 else TREE.lower[0]
    ramp = np.clip((_q(0) - 0.2 * side) / (limit - 0.2 * side), 0.0, 1.0)
    x = columns('limit_friction', 0, [0.2 * side], side=side)[:, 0]
    rows = _steady()
    np.testing.assert_allclose(x[rows], (-ramp * np.sign(_v(0)))[rows], atol=1e-12)
    effect = EFFECTS['limit_friction']
    region = effect.interval(EffectAt(effect, Place(0, side=side), np.array([0.2 * side])), MOTION)
    assert region == ('position', [sorted([0.2 * side, limit])])


@pytest.mark.parametrize('j', range(4))
def test_loads_pull_as_the_formulas_say(j):
    """Spring, constant load, rotor, gain and coupling, element by element."""
    q, a = _q(j), MOTION.acceleration[:, j]
    other = 2 if j != 2 else 0
    np.testing.assert_allclose(columns('spring', j) @ [3.0, 0.6], -3.0 * (q - 0.2))
    np.testing.assert_array_equal(columns('constant_load', j)[:, 0], np.ones(ROWS))
    np.testing.assert_array_equal(columns('armature', j)[:, 0], -a)
    np.testing.assert_array_equal(columns('torque_gain', j)[:, 0], MOTION.effort[:, j])
    x = columns('joint_coupling', j, kind='torque', source=other)
    np.testing.assert_array_equal(x[:, 0], MOTION.effort[:, other])
    x = columns('joint_coupling', j, [0.5], kind='spring', source=other)[:, :, 0]

    def energy(mine, source):
        return 0.5 * (mine - 0.5 * source) ** 2

    h = 1e-6
    np.testing.assert_allclose(
        x[:, j], -(energy(q + h, _q(other)) - energy(q - h, _q(other))) / (2 * h), atol=1e-8
    )
    np.testing.assert_allclose(
        x[:, other], -(energy(q, _q(other) + h) - energy(q, _q(other) - h)) / (2 * h), atol=1e-8
    )


@pytest.mark.parametrize('ratio', [1.0, -0.7])
def test_a_motor_on_two_joints_rubs_with_their_sum(ratio):
    """Its force does on both joints the work `-(coulomb |w| + viscous w^2)`, on no other any."""
    x = columns('coupled_friction', 3, [ratio], source=2) @ [0.3, 0.2]
    w = _v(3) + ratio * _v(2)
    np.testing.assert_array_equal(x[:, :2], 0.0)
    np.testing.assert_allclose(x[:, 2], ratio * x[:, 3])
    same = np.sign(w)
    steady = np.flatnonzero((same[1:-1] == same[2:]) & (same[1:-1] == same[:-2])) + 1
    work = (x * MOTION.velocity).sum(axis=1)
    np.testing.assert_allclose(work[steady], -(0.3 * np.abs(w) + 0.2 * w**2)[steady], atol=1e-12)
    pairs = {(p.joint, p.source) for p in EFFECTS['coupled_friction'].places(MOTION)}
    assert pairs == {(2, 1), (3, 2)}  # each motor with the joint that carries it


@pytest.mark.parametrize('j', range(4))
def test_cogging_has_the_amplitude_periods_and_phase_it_reports(j):
    """Periods count per revolution, or per metre on a slide."""
    x = columns('cogging', j, [5.0]) @ [0.3 * math.cos(0.7), 0.3 * math.sin(0.7)]
    turn = 2.0 * math.pi if TREE.is_prismatic[j] else 1.0
    np.testing.assert_allclose(x, 0.3 * np.sin(5.0 * turn * _q(j) + 0.7), atol=1e-12)
    values, _ = report('cogging', j, [5.0], [0.3 * math.cos(0.7), 0.3 * math.sin(0.7)])
    assert values == pytest.approx({'amplitude': 0.3, 'periods': 5.0, 'phase': 0.7})


@pytest.mark.parametrize('side', [1, -1])
def test_a_stop_pushes_back_beyond_its_position_only(side):
    """Stiffness times depth and damping times depth rate, against the side it stands on."""
    stop = float(np.quantile(_q(0), 0.5 + 0.3 * side))
    depth = side * (_q(0) - stop)
    reach = 0.5 * np.abs(_v(0)) * STEP + 1e-9
    x = columns('end_stop', 0, [stop], side=side)
    free, pressed = depth < -reach, depth > reach
    assert free.any()
    assert pressed.any()
    assert not x[free].any()
    np.testing.assert_allclose(x[pressed, 0], -side * depth[pressed])
    np.testing.assert_allclose(x[pressed, 1], -_v(0)[pressed])


def test_a_level_robot_is_not_tilted_and_a_tilt_turns_gravity():
    """The force is that of inverse dynamics with gravity in the axes of the tilted base."""
    assert np.abs(columns('gravity_tilt', -1, [0.0, 0.0])).max() < 1e-12
    roll, pitch = 0.1, -0.2
    rx = np.array([[1, 0, 0], [0, math.cos(roll), -math.sin(roll)],
                   [0, math.sin(roll), math.cos(roll)]])  # fmt: skip
    ry = np.array([[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0],
                   [-math.sin(pitch), 0, math.cos(pitch)]])  # fmt: skip
    tilted = replace(TREE, gravity=(ry @ rx).T @ np.array(SOUTH))
    needed = replace(MOTION, tree=tilted).nominal_effort
    x = columns('gravity_tilt', -1, [roll, pitch])[:, :, 0]
    np.testing.assert_allclose(x, MOTION.nominal_effort - needed, atol=1e-10)


def _heights(q, offset):
    """Return the position of a point of the last link in root axes, (n, 3), by plain matrices."""
    result = []
    for row in q:
        R, p = np.eye(3), np.zeros(3)
        for j, x in enumerate(row):
            p = p + R @ TREE.translations[j]
            axis = TREE.axes[j]
            if TREE.is_prismatic[j]:
                p = p + R @ axis * x
                continue
            K = np.cross(np.eye(3), axis)
            R = R @ (np.eye(3) + math.sin(x) * K + (1 - math.cos(x)) * K @ K)
        result.append(p + R @ offset)
    return np.array(result)


def test_a_force_at_the_tool_does_the_work_of_its_way():
    """J^T F against differences of the tool's position."""
    offset = next(f.translation for f in TREE.frames if f.name == 'tool0')
    x = columns('tip_force', -2)
    for j in range(TREE.size):
        h = np.zeros(TREE.size)
        h[j] = 1e-6
        way = _heights(MOTION.position + h, offset) - _heights(MOTION.position - h, offset)
        np.testing.assert_allclose(x[:, j], way / 2e-6, atol=1e-8)


def test_a_payload_is_a_point_mass_on_an_outermost_link():
    """Its force at rest is the gradient of its height times its weight."""
    rest = replace(MOTION, velocity=np.zeros((ROWS, 4)), acceleration=np.zeros((ROWS, 4)))
    offset = np.array([0.1, -0.05, -0.2])
    two = SimpleNamespace(tree=SimpleNamespace(outermost=(0, 2), size=4))
    assert EFFECTS['payload'].places(two) == [Place(0), Place(2)]
    x = columns('payload', TREE.outermost[0], [0.7, *offset], motion=rest)[:, :, 0]
    for j in range(TREE.size):
        h = np.zeros(TREE.size)
        h[j] = 1e-6
        rise = _heights(MOTION.position + h, offset) - _heights(MOTION.position - h, offset)
        np.testing.assert_allclose(x[:, j], -0.7 * 9.81 * rise[:, 2] / 2e-6, atol=1e-7)


def test_direction_counts_a_reversal_at_its_time():
    """On a straight line through zero the mean of the sign over the cell is exact."""
    t = STEP * np.arange(20)
    for crossing in (0.0951, 0.1, 0.1024):
        v = (t - crossing)[:, None]
        motion = ObservedMotion(TREE, t, STEP, v, v, v, v, None)
        cell = np.clip((t - crossing) / STEP * 2.0, -1.0, 1.0)
        np.testing.assert_allclose(motion.direction[1:-1, 0], cell[1:-1], atol=1e-9)
    np.testing.assert_array_equal(motion.sliding(-1.0).direction, -np.ones((20, 1)))


def test_inside_is_the_share_of_the_way_that_lies_inside():
    """Compared with many points in each cell; parts that adjoin add up to the whole."""
    points = np.linspace(-0.5, 0.5, 2001)
    for j in range(4):
        lo, hi = np.quantile(MOTION.wrapped[:, j], [0.3, 0.6])
        fine = MOTION.wrapped[:, j, None] + points * _v(j)[:, None] * STEP
        expected = ((fine >= lo) & (fine <= hi)).mean(axis=1)
        np.testing.assert_allclose(inside(MOTION, j, lo, hi), expected, atol=2e-3)
        middle = 0.5 * (lo + hi)
        parts = inside(MOTION, j, lo, middle) + inside(MOTION, j, middle, hi)
        np.testing.assert_allclose(parts, inside(MOTION, j, lo, hi), atol=1e-9)


def test_an_interval_of_a_continuous_joint_goes_round():
    """At +pi and -pi the same place is meant."""
    q = np.zeros((3, 4))
    q[:, 1] = [math.pi - 0.01, math.pi + 0.01, 5.0]
    still = np.zeros((3, 4))
    motion = ObservedMotion(TREE, STEP * np.arange(3), STEP, q, still, still, still, None)
    np.testing.assert_array_equal(inside(motion, 1, 3.0, 3.3), [1.0, 1.0, 0.0])
    np.testing.assert_array_equal(inside(motion, 1, -3.3, -3.0), [1.0, 1.0, 0.0])


def _fine_effort(times, values, delay, lag, characteristic, step, n):
    """Integrate the drive on a fine grid and average it with the hat of one step."""
    fine, reach = 100, 8
    h = step / fine
    t = (np.arange(-(reach + 40) * fine, (n + reach) * fine) + 0.5) * h
    i = np.maximum(np.searchsorted(times + delay, t, side='right') - 1, 0)
    u = characteristic(values[i])
    if lag:
        y = np.empty_like(u)
        y[0] = u[0]
        decay = math.exp(-h / lag)
        for m in range(1, len(u)):
            y[m] = u[m] + (y[m - 1] - u[m]) * decay
        u = y
    hat = np.concatenate([np.arange(fine) + 0.5, (np.arange(fine) + 0.5)[::-1]]) / fine**2
    centres = (np.arange(-3, n + 3) + reach + 40) * fine
    mean = np.array([hat @ u[c - fine : c + fine] for c in centres])
    second = np.diff(mean, 2)
    return mean[3:-3] - second[2:-2] / 12.0 + np.diff(second, 2)[1:-1] / 90.0


@pytest.mark.parametrize(
    ('delay', 'lag', 'characteristic'),
    [
        (0.0, 0.0, None), (0.0137, 0.0, None), (0.0, 0.03, None), (0.0061, 0.012, None),
        (0.0, 0.0, lambda u: np.clip(u, -0.5, 0.5)),
        (0.004, 0.02, lambda u: u - np.clip(u, -0.3, 0.3)),
    ],
)  # fmt: skip
def test_a_drive_gives_what_a_fine_simulation_of_it_gives(delay, lag, characteristic):
    """Characteristic, delay and lag at uneven times; the rest is the step of the simulation."""
    rng = np.random.default_rng(5)
    times = np.cumsum(rng.uniform(0.004, 0.03, 60)) - 0.1
    values = rng.normal(size=(60, 2))
    drive = Drive(times, values, ((0.0, 60),), STEP)
    found = drive.effort(1, delay=delay, time_constant=lag, characteristic=characteristic)
    plain = characteristic or (lambda u: u)
    fine = _fine_effort(times, values[:, 1], delay, lag, plain, STEP, 60)
    np.testing.assert_allclose(found, fine, atol=0.04)
    assert np.sqrt(np.mean((found - fine) ** 2)) < 0.01


def test_a_drive_at_a_time_is_the_held_or_lagged_command():
    """Before the first command that one holds; the lag is the exact exponential."""
    drive = Drive(np.array([0.0, 1.0]), np.array([[1.0], [3.0]]), ((0.0, 9),), STEP)
    np.testing.assert_array_equal(drive.at(0, np.array([-1.0, 0.5, 1.0])), [1.0, 1.0, 3.0])
    np.testing.assert_array_equal(drive.at(0, np.array([1.1, 1.3]), delay=0.2), [1.0, 3.0])
    lagged = drive.at(0, np.array([1.05]), time_constant=0.05, characteristic=np.negative)
    np.testing.assert_allclose(lagged, -(3.0 - 2.0 * math.exp(-1.0)))


@pytest.mark.parametrize(
    ('name', 'shape', 'options'),
    [
        ('dead_zone', 0.3, {'characteristic': lambda u: u - np.clip(u, -0.3, 0.3)}),
        ('saturation', 0.8, {'characteristic': lambda u: np.clip(u, -0.8, 0.8)}),
        ('actuator_lag', 0.03, {'time_constant': 0.03}),
        ('command_delay', 0.012, {'delay': 0.012}),
    ],
)
def test_what_a_drive_does_is_the_effort_it_gives_less_the_command(name, shape, options):
    """With coefficient 1; the delay of all drives is the sum of their delays."""
    change = MOTION.drive.effort(2, **options) - MOTION.effort[:, 2]
    np.testing.assert_array_equal(columns(name, 2, [shape])[:, 0], change)
    if name == 'command_delay':
        together = columns(name, -3, [shape])[:, :, 0]
        np.testing.assert_array_equal(together[:, 2], change)
        assert not together[:, PASSIVE].any()


def test_a_motor_at_speed_loses_what_drives_above_its_line_alone():
    """Braking effort is limited as at rest; nothing drives beyond the speed without load."""
    u = np.array([1.0, 1.0, 1.0, -1.0, -1.0, 0.3, 1.0])
    v = np.array([0.0, 2.0, -2.0, 2.0, -2.0, 2.0, 5.0])
    n = len(u)
    flat = np.zeros((n, 1))
    motion = ObservedMotion(TREE, STEP * np.arange(n), STEP, flat, v[:, None], flat,
                            u[:, None], None)  # fmt: skip
    lost = columns('motor_speed_limit', 0, [0.8, 4.0], motion)[:, 0]
    np.testing.assert_allclose(lost, [-0.2, -0.6, -0.2, 0.2, 0.6, 0.0, -1.0])


def test_hysteresis_solves_its_equation():
    """dz/dt = (v - |v| z)/presliding by an adaptive integrator, from z = 0."""
    t = 0.001 * np.arange(3000)
    q = np.sin(2.0 * t) + 0.3 * np.sin(7.0 * t)

    def slope(s, z):
        v = 2.0 * math.cos(2.0 * s) + 2.1 * math.cos(7.0 * s)
        return (v - abs(v) * z) / 0.1

    z = solve_ivp(slope, (0.0, t[-1]), [0.0], t_eval=t, rtol=1e-9, atol=1e-10, max_step=0.01)
    flat = np.zeros((3000, 1))
    motion = ObservedMotion(TREE, t, 0.001, q[:, None], flat, flat, flat, None)
    x = columns('hysteresis', 0, [0.1], motion=motion)[:, 0]
    np.testing.assert_allclose(x, -z.y[0], atol=2e-3)


def _pressed(effort):
    """A slow swing of joint 0 under an effort that may change its sign."""
    n = len(effort)
    flat = np.zeros((n, 4))
    torque = flat.copy()
    torque[:, 0] = effort
    level = replace(TREE, gravity=np.zeros(3), damping=np.zeros(4))
    return ObservedMotion(level, STEP * np.arange(n), STEP, flat, flat, flat, torque, None)


def test_the_motor_behind_play_has_less_inertia_than_the_joint_moves_alone():
    """With more, what is left for the link would be no mass matrix and could not be simulated."""
    values, _ = report('backlash', 0, [0.9, 0.01, 0.0, 0.0], [1.0])
    M = mass_matrix(TREE, TREE.parameters, MOTION.position)
    M[:, 0, 0] -= values['motor_inertia']
    assert np.linalg.eigvalsh(M).min() > 0.0


def test_play_exerts_no_force_while_the_gear_presses():
    """In contact motor and link move as one; a change of sign lets them fly, then stops them."""
    steady = _pressed(np.full(50, 2.0))
    assert not columns('backlash', 0, [0.3, 0.01, 0.0, 0.0], motion=steady).any()
    turned = columns(
        'backlash', 0, [0.3, 0.01, 0.0, 0.0], motion=_pressed(np.repeat([2.0, -2.0], 25))
    )
    assert not turned[:23].any()
    assert turned[23:].any()
    # the link is left behind, then caught up with: the impulses cancel
    assert abs(turned.sum()) < 1e-9 * np.abs(turned).sum() + 1e-12


def test_play_behind_a_motor_with_friction_follows_from_its_motion():
    """Efforts that friction on the motor takes up turn the gear over at other times."""
    t, step, half, J, M, b = 0.0, 1e-5, 0.02, 0.02, 0.08, 0.3
    q, v, theta, w, kept = 0.0, 0.0, half, 0.0, []
    for i in range(400_000):
        u = 1.5 * np.sin(9.0 * t)
        twist, spin = theta - q, w - v
        press = 2e3 * (twist - np.clip(twist, -half, half)) + 4.0 * spin * (abs(twist) > half)
        if i % 100 == 0:
            kept.append((theta, w, (u - press - b * w) / J, u - b * w, u))
        v, w = v + step * (press - 0.1 * q) / M, w + step * (u - press - b * w) / J
        q, theta, t = q + step * v, theta + step * w, t + step
    theta, w, a, driven, u = np.array(kept).T
    body = MOTION.tree.parameters.copy()
    motion = replace(
        _pressed(u), position=np.column_stack([theta, *np.zeros((3, len(u)))]),
        velocity=np.column_stack([w, *np.zeros((3, len(u)))]),
        acceleration=np.column_stack([a, *np.zeros((3, len(u)))]), step=1e-3,
    )  # fmt: skip
    inertia = float(motion.mass_diagonal[0, 0])
    scaled = replace(motion, tree=replace(motion.tree, parameters=body * (J + M) / inertia))
    needed = driven - (J + M) * a
    share = J / (J + M)
    rest = {}
    for lost in (0.0, b):
        left = needed + columns('backlash', 0, [share, 2.0 * half, 0.0, lost], motion=scaled)[:, 0]
        rest[lost] = np.std(np.convolve(left, np.full(40, 1.0 / 40.0), 'valid'))
    assert rest[b] < 0.5 * rest[0.0]


def _shown(true, j, size, periods=3.0, phase=0.4):
    """Return what an eccentric encoder of joint j shows of a motion."""
    rate = periods * (2.0 * math.pi if TREE.is_prismatic[j] else 1.0)
    q, v, a = true.position[:, j], true.velocity[:, j], true.acceleration[:, j]
    e = size * np.sin(rate * q + phase)
    de = size * rate * np.cos(rate * q + phase)
    dde = -size * rate**2 * np.sin(rate * q + phase)
    seen = [x.copy() for x in (true.position, true.velocity, true.acceleration)]
    seen[0][:, j] += e
    seen[1][:, j] += de * v
    seen[2][:, j] += de * a + dde * v**2
    return replace(true, position=seen[0], velocity=seen[1], acceleration=seen[2])


def _sine_cosine(size, phase=0.4):
    return size * math.cos(phase), size * math.sin(phase)


def test_an_eccentric_encoder_is_right_to_first_order_of_its_size():
    """Nominal effort of the shown motion less that of the true one, amplitude to zero."""
    small = EFFECTS['encoder_eccentricity'].small
    for j in range(4):
        left, linear = [], []
        for size in (1e-3, 5e-4):
            shown = _shown(MOTION, j, size)
            extra = shown.nominal_effort - MOTION.nominal_effort
            x = columns('encoder_eccentricity', j, [3.0, *_sine_cosine(size)], motion=shown)
            first = small.columns(shown, Place(j), np.array([3.0])) @ np.array(_sine_cosine(size))
            left.append(np.abs(extra - x[:, :, 0]).max() / np.abs(extra).max())
            linear.append(np.abs(extra - first).max() / np.abs(extra).max())
        assert left[0] < 0.1
        assert left[1] < 0.6 * left[0]
        assert left[0] < linear[0]


@pytest.mark.parametrize(('waves', 'is_one'), [(1.0, False), (1.3, True)])
def test_a_bend_over_the_whole_range_is_no_cogging(waves, is_one):
    """A fit that ends at one wave in the range would go on; where three are in a turn it may."""
    law, j = EFFECTS['cogging'], 0
    low, _ = law.bounds(MOTION, Place(j))
    assert low[0] > 3.0
    at = EffectAt(law, Place(j), waves * low, np.ones(2))
    assert law.is_inside(at, MOTION) is is_one
    far = replace(MOTION, position=20.0 * MOTION.position)
    assert law.is_inside(at.with_shape(np.array([3.0])), far)


@pytest.mark.parametrize(('turns', 'is_one'), [(0.15, False), (2.0, True)])
def test_a_small_part_of_a_wave_is_a_zero_and_a_scale_of_the_encoder(turns, is_one):
    """At any phase, and so at any amplitude."""
    law, j = EFFECTS['encoder_eccentricity'], 0
    periods = turns * 2.0 * math.pi / np.ptp(MOTION.position[:, j])
    for phase in (0.0, 1.5, 3.0):
        shape = np.array([periods, *_sine_cosine(0.02, phase)])
        at = EffectAt(law, Place(j), shape, np.ones(1))
        assert law.is_inside(at, MOTION) == is_one


def test_the_motion_behind_an_eccentric_encoder_is_exact():
    """Where the efforts are linear in position, velocity and acceleration nothing is left.

    That is the last joint without gravity: a slider, whose encoder shows a third too much.
    """
    weightless = replace(MOTION, tree=replace(TREE, gravity=np.zeros(3)))
    j = next(i for i in range(TREE.size) if TREE.is_prismatic[i])
    still = np.zeros((ROWS, TREE.size))
    alone = [still.copy() for _ in range(3)]
    for x, whole in zip(alone, (MOTION.position, MOTION.velocity, MOTION.acceleration),
                        strict=True):  # fmt: skip
        x[:, j] = whole[:, j]
    true = replace(weightless, position=alone[0], velocity=alone[1], acceleration=alone[2])
    size = 0.3 / (3.0 * 2.0 * math.pi)
    shown = _shown(true, j, size)
    extra = (shown.nominal_effort - true.nominal_effort)[:, j]
    x = columns('encoder_eccentricity', j, [3.0, *_sine_cosine(size)], motion=shown)[:, j, 0]
    np.testing.assert_allclose(x, extra, atol=1e-6 * np.abs(extra).max())


def test_bodies_without_mass_give_numbers():
    """A URDF may have a link without mass: no division by it."""
    empty = replace(TREE, parameters=np.zeros_like(TREE.parameters))
    motion = replace(MOTION, tree=empty)
    last = Place(TREE.outermost[0])
    assert np.isfinite(EFFECTS['payload'].starts(motion, last)).all()
    assert np.isfinite(columns('backlash', 0, [0.3, 0.01, 0.0, 0.0], motion=motion)).all()


def test_numbers_that_any_recording_allows_have_a_price():
    """A torque constant is known to a sixth, a base stands level, a warm-up is slow."""
    gain, tilt = (EFFECTS[name] for name in ('torque_gain', 'gravity_tilt'))
    drift = EFFECTS['friction_drift']

    def price(effect, shape, coefficients):
        at = EffectAt(effect, Place(0), np.array(shape), np.array(coefficients))
        return effect.surprise(at)

    assert price(gain, [], [0.0]) == 0.0
    assert price(gain, [], [-0.7]) == pytest.approx(price(gain, [], [1.0 / 0.3 - 1.0]))
    assert price(gain, [], [-0.7]) > 10.0
    assert price(gain, [], [-0.2]) < 1.0
    assert price(tilt, [0.05, 0.0], [1.0]) < 0.2
    assert price(tilt, [0.3, 0.0], [1.0]) > 4.0
    assert price(drift, [30.0], [0.1, 0.3]) == 0.0
    assert price(drift, [0.1], [0.1, 0.3]) > 10.0


@pytest.mark.parametrize(
    ('name', 'shape', 'kind'),
    [
        ('joint_elasticity', (0.05, 1e-3, 1e-3, 0.0), 'motor'),
        ('joint_elasticity', (0.05, 1e-3, 1e-3, 1.0), 'motor'),
        ('joint_elasticity', (0.05, 1e-3, 1e-3), 'link'),
        ('backlash', (0.3, 0.02, 0.1, 0.05), ''),
    ],
)
def test_a_rotor_counts_alike_in_a_body_and_beside_the_bodies(name, shape, kind):
    """Models of MuJoCo state it as the armature of a joint, others as part of a body."""
    rotor, parameters = 0.2, TREE.parameters.copy()
    axis = TREE.axes[0]
    full = rotor * np.outer(axis, axis)
    parameters[0, 4:] += full[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    inside = replace(MOTION, tree=replace(TREE, parameters=parameters))
    stated = EffectAt(EFFECTS['armature'], Place(0), coefficients=np.array([rotor]))
    beside = replace(MOTION, stated=(stated,))
    np.testing.assert_allclose(beside.mass_diagonal, inside.mass_diagonal, atol=1e-12)
    few = slice(0, 400, 50)
    assert beside.free_inertia(0, few) == pytest.approx(inside.free_inertia(0, few))
    np.testing.assert_allclose(
        columns(name, 0, shape, motion=beside, kind=kind),
        columns(name, 0, shape, motion=inside, kind=kind), rtol=1e-6, atol=1e-9,
    )  # fmt: skip
