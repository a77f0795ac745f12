"""Friction of the robot file that creeps on the machine is known friction."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.creeping import (
    creeping_friction,
    creeping_remark,
    with_creeping,
)
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.physics.memory import bristle
from sgp_ros.robots.stated_effects import read_effects
from test.diagnosis.worlds import CHAINS, events_of, simulate

LEVEL, WAY = 0.5, 0.02


def _stated(tree, level=LEVEL):
    problems = []
    entry = {'effect': 'coulomb_friction', 'joint': tree.joint_names[0],
             'parameters': {'level': {'value': level}}}  # fmt: skip
    found = read_effects([entry], tree, problems)
    assert not problems
    return found


@pytest.fixture(scope='module')
def creeps():
    return _creeping(LEVEL)


def _creeping(level):
    """Measured efforts that overcome friction which builds up over a way."""
    world = simulate(CHAINS[1], 4, 20.0)
    held = level * bristle(world.position[:, 0], WAY)
    return events_of(world, effort=world.command + held[:, None], commands=False)


def _equations(raw, tree):
    return make_equations(raw, tree, choose_bandwidth(raw, tree))


def test_stated_friction_has_its_level_and_the_way_of_the_machine(creeps, robots):
    robot, tree = robots[1]
    raw = collect(creeps, robot, _stated(tree))
    found = creeping_friction(raw, tree)
    (creeping,) = found.values()
    assert creeping.coefficients[0] == LEVEL
    assert creeping.shape[0] == pytest.approx(WAY, rel=0.35)
    known = _equations(with_creeping(raw, found), tree)
    assert (known.d**2).mean() < 0.1 * (_equations(raw, tree).d ** 2).mean()
    assert known.motion.dry_joints == {0}
    (said,) = creeping_remark(found)
    assert 'joint0 (0.0' in said


def test_friction_that_acts_at_once_stays_as_it_is_stated(dry, robots):
    """So does friction that is not there, and nothing is said of a robot without any."""
    robot, tree = robots[1]
    events = events_of(dry, effort=dry.command, commands=False)
    assert creeping_friction(collect(events, robot, _stated(tree, 1.2)), tree) == {}
    assert creeping_friction(collect(events, robot), tree) == {}
    assert creeping_remark({}) == ()
    none = simulate(CHAINS[1], 4, 10.0)
    raw = collect(events_of(none, effort=none.command, commands=False), robot, _stated(tree, 0.2))
    assert creeping_friction(raw, tree) == {}


def test_a_way_that_noise_would_give_is_not_stated(robots):
    robot, tree = robots[1]
    world = simulate(CHAINS[1], 4, 20.0)
    held = LEVEL * bristle(world.position[:, 0], WAY)
    noise = np.random.default_rng(1).normal(0.0, 10.0, len(held))
    effort = world.command + (held + noise)[:, None]
    raw = collect(events_of(world, effort=effort, commands=False), robot, _stated(tree))
    assert creeping_friction(raw, tree) == {}


def test_friction_that_a_bundle_of_cables_adds_is_none_of_the_file(robots):
    """Its level is another one, and what the file states acts at once beside it."""
    robot, tree = robots[1]
    world = simulate(CHAINS[1], 4, 20.0)
    q, v = world.position[:, 0], world.velocity[:, 0]
    held = 1.5 * bristle(q, 0.08) + 0.4 * np.sign(v)
    effort = world.command + held[:, None]
    raw = collect(events_of(world, effort=effort, commands=False), robot, _stated(tree, 0.4))
    assert creeping_friction(raw, tree) == {}


@pytest.mark.long
def test_a_machine_whose_stated_friction_creeps_shows_no_mismatch(creeps, robots):
    robot, tree = robots[1]
    found = diagnose(creeps, robot, tree, {}, stated=_stated(tree))
    assert found.verdict == 'no_mismatch'
    assert any('builds up over a way' in said for said in found.remarks)


@pytest.mark.long
def test_simulations_hold_where_friction_takes_most_of_the_effort(robots):
    """A force along the motion before answers too late: nearly all of its windows diverge."""
    robot, tree = robots[1]
    found = diagnose(_creeping(20.0), robot, tree, {}, stated=_stated(tree, 20.0))
    assert any('builds up over a way' in said for said in found.remarks)
    proof = found.proofs['train']
    assert proof.rollouts > 20
    assert proof.failed == 0
    assert proof.rollout_after['joint0'] < 0.1
