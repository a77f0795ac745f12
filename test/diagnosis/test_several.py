"""Several recordings of one machine: one answer, and what differs between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.several import alone, join
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.mapping import diagnosis_mapping
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.report.diagnosis_text import differences_text
from sgp_ros.report.verdict import verdict_sentence
from test.diagnosis.worlds import CHAINS, QUANTUM, Link, events_of, simulate

SECONDS = 6.0
LOAD, ARM = 0.5, 0.35
"""Point mass [kg] and its distance from the joint [m]."""
FAR = 0.2, 0.7
"""One whose inertia differs more than its weight, as no torque constant does."""
GAIN = 0.86
ZERO = 0.06


def _loaded(link, load=LOAD, arm=ARM):
    """Return a link that carries a point mass."""
    mass = link.mass + load
    centre = (link.mass * link.centre + load * arm) / mass
    inertia = link.inertia + link.mass * (link.centre - centre) ** 2 + load * (arm - centre) ** 2
    return Link(mass, centre, inertia, link.length, link.damping)


def _friction(level):
    return {'dry': lambda t, q, s: level}


def _oil(b):
    """Return the options of a world with viscous friction b [N m s/rad]."""
    return {'force': lambda _t, _q, v: (-b * v[0],)}


def _weak(commands, _now):
    """Return what a motor of a lower torque constant gives."""
    return [GAIN * u for u in commands[-1]]


WORLDS = {
    'alike': ((CHAINS[1], _friction(0.4)), (CHAINS[1], _friction(0.4))),
    'payload': ((CHAINS[1], _friction(0.4)), ((_loaded(CHAINS[1][0]),), _friction(0.4))),
    'friction': ((CHAINS[1], _friction(0.6)), (CHAINS[1], _friction(0.3))),
    'much': (
        (CHAINS[1], _friction(0.4) | _oil(0.1)),
        ((_loaded(CHAINS[1][0], *FAR),), _friction(0.9) | _oil(0.5)),
    ),
    'motor': ((CHAINS[1], _friction(0.4)), (CHAINS[1], _friction(0.4) | {'motor': _weak})),
}
"""Chain and options of the first and the second recording."""


@pytest.fixture(scope='module')
def found(robots):
    """Diagnosis of each pair of recordings, made when first asked for."""
    done = {}

    def make(name):
        if name not in done:
            events = {
                stem: events_of(simulate(chain, seed, SECONDS, **options))
                for stem, seed, (chain, options) in zip(
                    ('cold', 'warm'), (11, 12), WORLDS[name], strict=True
                )
            }
            done[name] = diagnose(events, *robots[1], {})
        return done[name]

    return make


def _require_common_friction(one, level, tolerance):
    """Require Coulomb friction of a level to be all that is common."""
    assert [(f.joint, f.effect) for f in one.findings] == [('joint0', 'coulomb_friction')]
    assert one.findings[0].parameters['level'].value == pytest.approx(level, rel=tolerance)


def _difference(one, effect):
    """Return what differs, an effect in the second recording."""
    (found,) = one.differences
    assert (found.recording, found.joint, found.effect) == ('warm', 'joint0', effect)
    return found


def test_two_recordings_of_one_machine_give_one_answer(found):
    """The friction that both have, and nothing that differs."""
    one = found('alike')
    _require_common_friction(one, 0.4, 0.02)
    assert one.recordings == ('cold', 'warm')
    assert one.differences == ()
    assert differences_text(one) == ['nothing, between cold and warm']
    assert np.all(np.diff(one.traces.time) > 0.0)


@pytest.mark.long
def test_a_load_taken_up_differs_and_what_is_common_stays(found):
    one = found('payload')
    _require_common_friction(one, 0.4, 0.05)
    load = _difference(one, 'payload')
    # one joint tells the moment and the inertia of a mass, not where it is
    mass, z = (load.parameters[name].value for name in ('mass', 'z'))
    assert mass * z == pytest.approx(-LOAD * ARM, rel=0.05)
    assert load.probability > 0.5
    (entry,) = diagnosis_mapping(one)['recordings']
    assert entry.keys() >= {'recording', 'effect', 'joint', 'parameters', 'probability'}


@pytest.mark.long
def test_friction_that_is_lower_in_the_second_differs(found):
    """The first recording stands for what is common."""
    one = found('friction')
    _require_common_friction(one, 0.6, 0.03)
    less = _difference(one, 'coulomb_friction')
    assert less.parameters['level'].value == pytest.approx(0.3, rel=0.03)
    assert less.difference['level'].value == pytest.approx(-0.3, rel=0.03)
    assert less.difference['level'].std > 0.0
    (line,) = differences_text(one)
    assert line.startswith('warm has on joint0 Coulomb friction, level 0.30')
    assert 'Coulomb friction' in verdict_sentence(one)
    assert (
        one.proofs['train'].nmse_after['joint0'] < 0.02 * one.proofs['train'].nmse_before['joint0']
    )


@pytest.mark.long
def test_a_torque_constant_differs_once_a_motor_was_replaced(found):
    """The friction, which the second recording shows larger, is common."""
    one = found('motor')
    _require_common_friction(one, 0.4, 0.03)
    gain = _difference(one, 'torque_gain')
    assert gain.parameters['gain'].value == pytest.approx(GAIN, rel=0.02)
    assert gain.probability > 0.5


@pytest.mark.long
def test_much_that_differs_at_once_is_told_apart(found):
    """Load and friction, each of which is told as a torque constant while others are not there."""
    one = found('much')
    levels = {f.effect: f.parameters for f in one.findings}
    assert levels.keys() == {'coulomb_friction', 'viscous_friction'}
    assert levels['coulomb_friction']['level'].value == pytest.approx(0.4, rel=0.02)
    assert levels['viscous_friction']['b'].value == pytest.approx(0.1, rel=0.05)
    later = {f.effect: f.parameters for f in one.differences if f.recording == 'warm'}
    assert later.keys() == {'coulomb_friction', 'viscous_friction', 'payload'}
    assert later['coulomb_friction']['level'].value == pytest.approx(0.9, rel=0.02)
    assert later['viscous_friction']['b'].value == pytest.approx(0.5, rel=0.03)
    proof = one.proofs['train']  # roll-outs of each recording are with its own load
    assert proof.rollout_after['joint0'] < 0.02 * proof.rollout_before['joint0']
    mass, z = (later['payload'][name].value for name in ('mass', 'z'))
    assert mass * z == pytest.approx(-FAR[0] * FAR[1], rel=0.03)


@pytest.mark.long
def test_an_encoder_that_was_zeroed_anew_differs(robots):
    """Bodies of two recordings that shared one zero would stand for it."""
    rng = np.random.default_rng(0)
    events = {}
    for stem, seed, zero in (('cold', 11, 0.0), ('warm', 12, ZERO)):
        world = simulate(CHAINS[2], seed, SECONDS)
        shift = np.array([0.0, zero]) + QUANTUM * rng.uniform(-0.5, 0.5)
        events[stem] = events_of(replace(world, position=world.position + shift))
    one = diagnose(events, *robots[2], {})
    (found,) = one.differences
    assert (found.recording, found.joint, found.effect) == ('warm', 'joint1', 'encoder_offset')
    assert found.parameters['offset'].value == pytest.approx(ZERO, rel=0.05)
    (line,) = differences_text(one)
    assert line.startswith('warm has on joint1 encoder offset, offset 0.0')


def test_recordings_of_different_rates_lie_on_the_grid_of_the_slower(robots):
    robot, _ = robots[1]
    world = simulate(CHAINS[1], 11, 2.0)
    every, half = events_of(world), events_of(world)
    half = [e for i, e in enumerate(half) if i // 2 % 2 == 0]
    slow = collect(half, robot)
    both = join([collect(every, robot, least_step=slow.step), slow])
    assert both.step == slow.step > collect(every, robot).step
    assert both.segments[1].start == both.segments[0].stop
    np.testing.assert_array_equal(np.unique(both.recording), [0, 1])
    first, second = (both.time[both.recording == i] for i in (0, 1))
    assert first[0] == second[0] == 0.0
    slower = collect(every, robot, least_step=slow.step)
    np.testing.assert_array_equal(both.drive.effort(0)[: len(first)], slower.drive.effort(0))
    for i, one in enumerate((slower, slow)):
        again = alone(both, i)
        for x, y in ((again.time, one.time), (again.position, one.position),
                     (again.drive.effort(0), one.drive.effort(0))):  # fmt: skip
            np.testing.assert_array_equal(x, y)
        assert again.segments == one.segments
        assert again.recording is None
    with pytest.raises(ValueError, match='one step'):
        join([collect(every, robot), slow])
