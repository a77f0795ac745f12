"""Rest of joints: where dry friction makes an equation an inequality."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.rest import resting, without_rest
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.physics.term import Motion
from sgp_ros.robots.registry import load_robot

START_NS = 1_700_000_000_000_000_000
LEVEL = 0.6
CART = """
schema: 1
urdf: |
  <robot name="cart"><link name="base"/>
    <link name="body"><inertial><mass value="2"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="x" type="prismatic"><parent link="base"/><child link="body"/>
      <axis xyz="1 0 0"/><limit lower="-9" upper="9" effort="9" velocity="9"/></joint>
  </robot>
terms: {viscous: all, inertial: all}
prior: {viscous: {spread: 0.05}, inertial: {spread: 0.05}}
"""
FRICTION = """
effects:
  - {effect: coulomb_friction, joint: x, parameters: {level: {value: 0.6, std: 0.01}}}
"""


def _robot(tmp_path, text=CART + FRICTION):
    path = tmp_path / 'cart.yaml'
    path.write_text(text, encoding='utf-8')
    return load_robot(str(path))


def _stick_and_slip(seconds=12.0, rate=200.0):
    """A cart of 2 kg that friction holds half of the time, with an effort that it takes up."""
    t = np.arange(0.0, seconds, 1.0 / rate)
    phase = np.pi * np.mod(t, 2.0)
    is_moving = np.mod(t, 2.0) < 1.0
    sign = np.where(np.mod(t, 4.0) < 2.0, 1.0, -1.0)
    v = np.where(is_moving, sign * np.sin(phase) ** 2, 0.0)
    a = np.where(is_moving, sign * np.pi * np.sin(2.0 * phase), 0.0)
    q = np.cumsum(v) / rate
    held = 0.9 * LEVEL * np.sin(2.0 * phase)
    effort = np.where(is_moving, 2.0 * a + LEVEL * sign, held)
    return t, q, effort


def _run(robot):
    t, q, effort = _stick_and_slip()
    settings = {'model.method': 'PR', 'filter.window': 0.1, 'learning.initial': 20}
    engine = Engine(robot, EngineConfig.from_mapping(settings, robot))
    states = [
        JointSample(START_NS + round(s * 1e9), ('x',), frozen_array([x]), None, frozen_array([u]))
        for s, x, u in zip(t, q, effort, strict=True)
    ]
    found = []
    replay(engine, states, lambda step: found.extend(step.estimates))
    return engine, found


def test_a_joint_rests_where_it_does_not_move_and_not_where_it_reverses():
    t = np.arange(0.0, 0.4, 0.005)
    stopped = np.where(t < 0.2, 0.0, (t - 0.2) ** 2 * 5.0)
    reversing = 4.0 * (t - 0.2) ** 2
    rests = resting(t, np.column_stack([stopped, reversing]), 0.01)
    assert rests[t < 0.2, 0].all()
    assert not rests[t > 0.25, 0].any()
    assert not rests[:, 1].any()


def test_noise_of_the_positions_is_no_motion():
    t = np.arange(0.0, 0.4, 0.005)
    q = 1e-3 * np.random.default_rng(0).normal(size=(len(t), 1))
    assert resting(t, q, 0.01).mean() > 0.8


def test_only_what_lies_outside_the_band_is_an_error():
    slack = np.array([[-1.0, -1.0, 0.0], [2.0, 2.0, 0.0]])
    y, held = without_rest(slack, np.array([1.5, 3.0, 0.5]), np.zeros(3))
    np.testing.assert_array_equal(held, [True, False, False])
    np.testing.assert_array_equal(y, [1.5, 2.0, 0.0])


def test_dry_friction_lies_between_sliding_both_ways(tmp_path):
    friction = _robot(tmp_path).rest_friction
    still = np.zeros((2, 1))
    v = np.array([[0.0], [1.0]])
    least, largest = friction(Motion(still, v, still, still))
    np.testing.assert_allclose(least[:, 0], [-LEVEL, 0.0], atol=1e-9)
    np.testing.assert_allclose(largest[:, 0], [LEVEL, 2.0 * LEVEL], atol=1e-9)


def test_rest_is_neither_scored_nor_learned(tmp_path):
    """With rest among the scores they would be a hundred times worse."""
    engine, found = _run(_robot(tmp_path))
    counts = engine.counts
    assert 0.3 < counts.held / counts.estimated < 0.6
    assert counts.learned + counts.held == counts.estimated == len(found)
    assert counts.scored < counts.learned
    assert all(np.isfinite(e.effort.mean).all() for e in found[100:])
    score = engine.scores()['x']['effort']
    assert score.n == counts.scored
    assert score.nmse < 2e-3


@pytest.mark.parametrize('terms', ['{viscous: all}', '{viscous: all, coulomb: all}'])
def test_a_robot_without_stated_dry_friction_has_no_inequalities(tmp_path, terms):
    """The terms are learned as they were: their levels are not known before."""
    text = CART.replace('terms: {viscous: all, inertial: all}', f'terms: {terms}')
    text = text.replace('prior: {viscous: {spread: 0.05}, inertial: {spread: 0.05}}', '')
    robot = _robot(tmp_path, text)
    assert robot.rest_friction is None
    engine, found = _run(robot)
    assert engine.counts.held == 0
    assert engine.counts.learned == len(found)


TWO_CARTS = """
schema: 1
urdf: |
  <robot name="carts"><link name="base"/>
    <link name="first"><inertial><mass value="2"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <link name="second"><inertial><mass value="2"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="x" type="prismatic"><parent link="base"/><child link="first"/>
      <axis xyz="1 0 0"/><limit lower="-9" upper="9" effort="9" velocity="9"/></joint>
    <joint name="y" type="prismatic"><parent link="first"/><child link="second"/>
      <axis xyz="0 1 0"/><limit lower="-9" upper="9" effort="9" velocity="9"/></joint>
  </robot>
terms: {inertial: all}
prior: {inertial: {spread: 0.2}}
effects:
  - {effect: coulomb_friction, joint: x, parameters: {level: {value: 0.6, std: 0.01}}}
  - {effect: coulomb_friction, joint: y, parameters: {level: {value: 0.6, std: 0.01}}}
"""


@pytest.mark.parametrize('method', ['PR', 'SGP'])
def test_one_joint_is_moved_after_the_other(tmp_path, method):
    """The physics learns the joint that moves from the equation of both; Z has to wait.

    Masses of 2 kg are stated; those of 2.2 and 1.8 kg move.
    """
    t = np.arange(0.0, 12.0, 0.005)
    moves = np.array([t < 6.0, t >= 6.0]).T
    phase = np.pi * t[:, None] * [1.0, 1.0]
    v = np.where(moves, np.sin(phase), 0.0)
    a = np.where(moves, np.pi * np.cos(phase), 0.0)
    q = np.where(moves, (1.0 - np.cos(phase)) / np.pi, 0.0)
    masses = np.array([4.0, 1.8])
    effort = masses * a + np.where(moves, LEVEL * np.sign(v), 0.3 * LEVEL)
    robot = _robot(tmp_path, TWO_CARTS)
    settings = {'model.method': method, 'filter.window': 0.1, 'learning.initial': 20,
                'refit.enabled': False}  # fmt: skip
    engine = Engine(robot, EngineConfig.from_mapping(settings, robot))
    replay(
        engine,
        [JointSample(START_NS + round(s * 1e9), ('x', 'y'), frozen_array(x), None, frozen_array(u))
         for s, x, u in zip(t, q, effort, strict=True)],
        lambda _: None,
    )  # fmt: skip
    assert engine.is_ready
    counts = engine.counts
    assert counts.held > 0.9 * counts.estimated
    assert counts.learned > 0.9 * counts.estimated if method == 'PR' else counts.learned < 20
    found = {p.name: p.value for p in engine.physics_parameters()}
    assert found['second.mass'] == pytest.approx(1.8, rel=0.01)
    assert found['first.mass'] == pytest.approx(2.2, rel=0.01)
