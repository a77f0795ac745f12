"""A free swing needs no efforts: where nothing drives a robot they are zero."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.sufficiency import without_motors
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.criteria import PER_EFFECT, PER_UNUSUAL
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.engine.samples import frozen_array
from sgp_ros.errors import RecordingError
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.recordings.imports import import_table
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, events_of, shown, simulate, urdf

LEVEL = 0.08
UNDAMPED = (replace(CHAINS[1][0], damping=0.0),)
MAP = {
    'time': {'column': 't', 'unit': 's'},
    'joints': {'joint0': {'position': {'column': 'q', 'unit': 'rad'}}},
}


@pytest.fixture(scope='module')
def passive(tmp_path_factory):
    """Robot and nominal tree of one link without a motor."""
    folder = tmp_path_factory.mktemp('passive')
    (folder / 'chain.urdf').write_text(urdf(CHAINS[1]))
    (folder / 'robot.yaml').write_text('schema: 1\nurdf: chain.urdf\npassive: [joint0]\n')
    robot = load_robot(str(folder / 'robot.yaml'))
    return robot, nominal_tree(robot)


def _swing(**forces):
    return simulate(CHAINS[1], 1, 6.0, motor=lambda _commands, _t: (0.0,), **forces)


def test_a_free_swing_without_efforts_is_diagnosed(passive):
    """Of a perfect model, which nothing is missing from."""
    events = events_of(_swing(), commands=False)
    assert all(event.effort is None for event in events)
    assert diagnose(events, *passive, {}).verdict == 'no_mismatch'


@pytest.mark.parametrize(('force', 'is_passive'), [(0.0, True), (4.0, False)])
def test_efforts_of_zero_are_of_a_link_that_nothing_drives(robots, force, is_passive):
    """Not where the motion needs some, that were not recorded."""
    robot, tree = robots[1]
    world = _swing(
        dry=lambda _t, _q, _s: LEVEL,
        force=lambda t, _q, _v: (force * np.sin(7.0 * t) * np.cos(2.3 * t),),
    )  # fmt: skip
    events = events_of(world, effort=np.zeros_like(world.command), commands=False)
    raw = collect(events, robot)
    found, said = without_motors(raw, tree)
    assert found.is_actuated.tolist() == [not is_passive]
    assert [text.startswith('The recorded effort of joint0 is zero') for text in said] == (
        [True] if is_passive else []
    )
    if is_passive:
        diagnosed = diagnose(events, robot, tree, {})
        assert [f.effect for f in diagnosed.findings] == ['coulomb_friction']
        assert said[0] in diagnosed.remarks


def test_a_driven_link_without_efforts_is_refused(robots):
    events = events_of(_swing(), commands=False)
    with pytest.raises(RecordingError, match=r'has an effort, .* passive: \[joint0\]'):
        diagnose(events, *robots[1], {})


@pytest.fixture(scope='module')
def light(tmp_path_factory):
    """Robot and nominal tree of one link without a motor that nothing damps."""
    folder = tmp_path_factory.mktemp('light')
    (folder / 'chain.urdf').write_text(urdf(UNDAMPED))
    (folder / 'robot.yaml').write_text('schema: 1\nurdf: chain.urdf\npassive: [joint0]\n')
    robot = load_robot(str(folder / 'robot.yaml'))
    return robot, nominal_tree(robot)


@pytest.mark.parametrize(
    ('level', 'c', 'longer', 'named'),
    [
        (0.0, 0.0, 1.0, []),
        pytest.param(0.004, 0.0, 1.0, ['coulomb_friction'], marks=pytest.mark.long),
        pytest.param(0.004, 0.012, 1.01, ['coulomb_friction', 'quadratic_drag'],
                     marks=pytest.mark.long),
    ],
)  # fmt: skip
def test_what_a_free_swing_loses_is_named(light, level, c, longer, named):
    """However small it is beside the weight; friction that fades with the swing is no drift."""
    link = replace(UNDAMPED[0], centre=longer * UNDAMPED[0].centre)
    world = simulate(
        (link,), 1, 25.0, motor=lambda _commands, _t: (0.0,), dry=lambda _t, _q, _s: level,
        force=lambda _t, _q, v: (-c * abs(v[0]) * v[0],),
    )  # fmt: skip
    found = diagnose(events_of(world, commands=False), *light, {})
    assert found.verdict == ('missing_physics' if named else 'no_mismatch')
    assert sorted(f.effect for f in found.findings) == named
    for finding in found.findings:
        (number,) = finding.parameters.values()
        wanted = level if finding.effect == 'coulomb_friction' else c
        assert number.value == pytest.approx(wanted, rel=0.15)
        assert abs(number.value - wanted) < 3.0 * number.std


def test_of_two_joints_the_one_without_efforts_is_named(robots):
    """As of a cart with a pole: only one of them has a motor."""
    events = [
        replace(event, effort=frozen_array([0.1, np.nan]))
        for event in events_of(simulate(CHAINS[2], 1, 3.0), commands=False)
    ]
    with pytest.raises(RecordingError, match=r'has an effort of joint1, .* passive: \[joint1\]'):
        diagnose(events, *robots[2], {})


def test_laws_of_motors_and_of_the_clock_have_no_place_in_a_free_swing(passive, robots):
    """Without a motor there is no rotor; as a swing decays its size tells the time."""
    for (robot, tree), count in ((passive, 0), (robots[1], 1)):
        raw = collect(events_of(_swing(), commands=bool(count)), robot)
        motion = make_equations(raw, tree, choose_bandwidth(raw, tree)).motion
        assert len(EFFECTS['armature'].places(motion)) == count
        assert bool(EFFECTS['friction_drift'].places(motion)) == bool(count)


def test_bodies_of_a_free_swing_keep_the_inertia_of_the_file(light):
    """No motion tells a common scale; the place of the centre it tells."""
    robot, tree = light
    link = replace(UNDAMPED[0], centre=1.1 * UNDAMPED[0].centre)
    world = simulate((link,), 1, 8.0, motor=lambda _commands, _t: (0.0,))
    raw = collect(events_of(world, commands=False), robot)
    equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
    model = fitted(equations, 'viscous_friction', is_free=True)
    assert abs(model.inertia[0]) < 0.005
    assert model.mean_square[0] < 0.01 * fitted(equations, is_free=False).mean_square[0]


def test_no_law_is_unusual_where_no_joint_has_a_motor(passive, robots):
    """Drag in the air is not rarer there than friction in a bearing."""
    prices = []
    for robot, tree in (passive, robots[1]):
        raw = collect(events_of(_swing(), commands=tree.is_actuated.any()), robot)
        equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
        prices.append(fitted(equations, 'quadratic_drag').law_price)
    assert prices == [PER_EFFECT, PER_EFFECT + PER_UNUSUAL]


@pytest.mark.parametrize(('noise', 'is_certain'), [(1e-4, True), (0.02, False)])
def test_noise_hides_what_a_free_swing_loses(light, noise, is_certain):
    """It is not certain then that it loses nothing."""
    world = simulate(UNDAMPED, 1, 25.0, motor=lambda _commands, _t: (0.0,))
    seen = world.position + noise * np.random.default_rng(0).standard_normal(world.position.shape)
    found = diagnose(events_of(replace(world, position=seen), commands=False), *light, {})
    assert found.verdict == 'no_mismatch'
    assert (found.certainty is not None) == is_certain
    assert any('a third of its energy would not show' in x for x in found.remarks) != is_certain


def test_bodies_without_a_motor_do_not_vanish(passive):
    """A body of no size would leave nothing of a push that nobody knows."""
    robot, tree = passive
    world = _swing(force=lambda t, _q, _v: (0.4 * np.sin(37.0 * t) * np.sin(0.9 * t * t),))
    raw = collect(events_of(world, commands=False), robot)
    equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
    nominal = fitted(equations, is_free=False)
    model = fitted(equations, 'viscous_friction', is_free=True)
    assert abs(model.inertia[0]) < 0.1
    assert model.mean_square[0] > 0.5 * nominal.mean_square[0]


def test_friction_of_a_free_swing_is_found_in_an_imported_table(passive, tmp_path):
    """A table of times and positions alone is enough."""
    world = _swing(dry=lambda _t, _q, _s: LEVEL)
    rows = [f'{t:.6f},{q:.9f}' for t, q in zip(world.time, np.ravel(shown(world.position)),
                                                    strict=True)]  # fmt: skip
    (tmp_path / 'swing.csv').write_text('\n'.join(['t,q', *rows]) + '\n')
    (tmp_path / 'map.yaml').write_text(json.dumps(MAP))
    bag = import_table(tmp_path / 'swing.csv', tmp_path / 'map.yaml', tmp_path).path
    found = diagnose(list(open_recording(bag).events(None, None)), *passive, {})
    assert [f.effect for f in found.findings] == ['coulomb_friction']
    assert found.findings[0].parameters['level'].value == pytest.approx(LEVEL, rel=0.02)
