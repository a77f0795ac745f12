"""Effects stated by the nominal robot are no discrepancy, in a diagnosis from end to end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.compare.velocity_sensor import lagged, sensor_lags
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.physics.catalogue import EFFECTS as LAWS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from sgp_ros.report.diagnosis_text import phrase
from sgp_ros.report.verdict import verdict_sentence
from sgp_ros.robots.stated_effects import read_effects, typical_motion
from test.diagnosis.worlds import CHAINS, PERIOD, delayed, events_of, simulate

EFFECTS = {
    'viscous_friction': {'b': 0.3},
    'coulomb_friction': {'level': 0.5},
    'spring': {'stiffness': 2.0, 'rest': 0.4},
    'command_delay': {'delay': 0.02},
    'armature': {'inertia': 0.03},
}
LEFT = 1e-2
"""Share of the discrepancy that may remain: filters round off where dry friction lets go."""


def _world(name):
    if name == 'viscous_friction':
        return simulate(CHAINS[1], 3, 10.0, force=lambda t, q, v: (-0.3 * v[0],))
    if name == 'coulomb_friction':
        return simulate(CHAINS[1], 4, 10.0, dry=lambda t, q, s: 0.5)
    if name == 'spring':
        return simulate(CHAINS[1], 5, 10.0, force=lambda t, q, v: (-2.0 * (q[0] - 0.4),))
    if name == 'command_delay':
        return simulate(CHAINS[1], 6, 10.0, motor=delayed(0.02))
    (link,) = CHAINS[1]
    heavier = (type(link)(link.mass, link.centre, link.inertia + 0.03, link.length, link.damping),)
    return simulate(heavier, 7, 10.0)


@pytest.fixture(params=EFFECTS)
def named(request):
    """An effect, a world that has it, and events of it."""
    return request.param, events_of(_world(request.param))


def _stated(name, tree, **changed):
    entry = {key: {'value': value} for key, value in (EFFECTS[name] | changed).items()}
    problems = []
    found = read_effects(
        [{'effect': name, 'joint': tree.joint_names[0], 'parameters': entry}], tree, problems
    )
    assert not problems
    return found


def _equations(events, robot, tree, stated):
    raw = collect(events, robot, stated)
    return make_equations(raw, tree, choose_bandwidth(raw, tree))


def test_the_discrepancy_vanishes_where_the_truth_is_stated(named, robots):
    """Friction that holds the joint, what comes late, and inertia among them."""
    name, events = named
    robot, tree = robots[1]
    before = _equations(events, robot, tree, ())
    after = _equations(events, robot, tree, _stated(name, tree))
    assert (after.d**2).mean() < LEFT * (before.d**2).mean()


def test_a_joint_that_stated_friction_holds_asks_nothing(robots, dry):
    """As under the hypothesis of dry friction, once and not twice."""
    robot, tree = robots[1]
    raw = collect(events_of(dry), robot, _stated('coulomb_friction', tree, level=1.2))
    equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
    found = _equations(events_of(dry), robot, tree, ()).with_dry_friction(frozenset([0]))
    assert (equations.moving[equations.rests] == 0.0).all()
    assert equations.with_dry_friction(frozenset([0])) is equations
    force = equations.filter(equations.motion.stated_force * equations.moving)
    np.testing.assert_allclose(equations.d, found.d - force, atol=1e-9)


@pytest.mark.parametrize(
    'name', ['coulomb_friction', pytest.param('command_delay', marks=pytest.mark.long)]
)
def test_a_robot_that_states_what_it_has_shows_no_mismatch(robots, name):
    """And predicts, before any finding, as well as one of which the effect was found."""
    robot, tree = robots[1]
    events = events_of(_world(name))
    stated = diagnose(events, robot, tree, {}, stated=_stated(name, tree))
    found = diagnose(events, robot, tree, {})
    assert stated.verdict == 'no_mismatch'
    assert [f.effect for f in found.findings] == [name]
    for stem, proof in found.proofs.items():
        own = stated.proofs[stem]
        assert own.nmse_before == pytest.approx(proof.nmse_after, rel=0.1, abs=1e-6)
        assert own.acceleration_before == pytest.approx(
            proof.acceleration_after, rel=0.1, abs=1e-6
        )


def test_a_stated_lag_of_the_velocity_is_not_found_again(robots, perfect):
    robot, tree = robots[1]
    world = perfect[1]
    late = np.column_stack([lagged(world.velocity[:, 0], 0.02, PERIOD)])
    events = events_of(world, velocity=late)
    entry = {'time_constant': {'value': 0.02}}
    problems = []
    stated = read_effects(
        [{'effect': 'velocity_filter_lag', 'joint': tree.joint_names[0], 'parameters': entry}],
        tree, problems,
    )  # fmt: skip
    assert not problems
    for known, is_physics in (((), True), (stated, False)):
        raw = collect(events, robot, known)
        equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
        assert [lag.is_physics for lag in sensor_lags(raw, equations)] == [is_physics]


@pytest.mark.long
def test_roll_outs_of_the_nominal_robot_have_what_it_states(named, robots):
    """A robot whose truth is stated ends where it did; without, it does not."""
    name, events = named
    robot, tree = robots[1]
    known, unknown = (
        diagnose(events, robot, tree, {}, stated=stated)
        for stated in (_stated(name, tree), ())
    )  # fmt: skip
    assert known.verdict == 'no_mismatch'
    after, before = (
        found.proofs['train'].rollout_before[tree.joint_names[0]] for found in (known, unknown)
    )
    assert after < 0.05 * before
    assert known.proofs['train'].failed == 0


@pytest.mark.parametrize(
    'name',
    [
        pytest.param(x, marks=pytest.mark.long)
        for x in ('coulomb_friction', 'viscous_friction', 'spring')
    ],
)
def test_what_the_robot_states_too_much_of_is_taken_off(robots, name):
    """The sentence says so."""
    robot, tree = robots[1]
    number, size = next(iter(EFFECTS[name].items()))
    stated = _stated(name, tree, **{number: 1.6 * size})
    found = diagnose(events_of(_world(name)), robot, tree, {}, stated=stated)
    assert found.verdict == 'missing_physics'
    (finding,) = found.findings
    assert finding.effect == name
    assert finding.parameters[number].value == pytest.approx(-0.6 * size, rel=0.1)
    assert phrase(finding).endswith('less than the robot file states')
    assert verdict_sentence(found).startswith('Too much is stated on joint0: ')


def test_no_more_is_taken_off_than_is_stated(robots):
    """A tenth more, which a unit may be off; without a statement nothing."""
    _, tree = robots[1]
    stated = _stated('coulomb_friction', tree)
    motion = replace(typical_motion(tree), stated=stated)
    law = stated[0].effect
    levels = {x: EffectAt(law, Place(0), coefficients=np.array([x])) for x in (-0.6, -0.52, 0.1)}
    assert [x.is_possible(motion) for x in levels.values()] == [False, True, True]
    bare = replace(motion, stated=())
    assert [x.is_possible(bare) for x in levels.values()] == [False, False, True]
    either = EffectAt(LAWS['asymmetric_coulomb'], Place(0), coefficients=np.array([-0.1, -0.3]))
    assert either.is_possible(motion)
    assert not either.is_possible(bare)
