"""Chains of rigid bodies and random motions of them."""

from __future__ import annotations

import numpy as np

from sgp_ros.physics.term import Joint, Motion
from sgp_ros.rigid.base_parameters import RegressorFactor
from sgp_ros.rigid.inertial import inertial_term, revolute_chain
from sgp_ros.robots.robot import Robot


def chain(axes, offsets):
    """A robot of revolute joints that is nothing but its rigid bodies."""
    names = [f'j{i + 1}' for i in range(len(axes))]
    term = inertial_term(revolute_chain(names, axes, offsets))
    return Robot('chain', tuple(Joint(n) for n in names), 'effort', (term,), ((),) * len(axes))


def recorded_motion(robot, q, v, a):
    motion = Motion(q, v, a, np.zeros_like(q))
    return RegressorFactor.nothing(len(robot.coefficients)).with_rows(robot.regressor(motion))


def states(seed, k, n=80):
    return np.random.default_rng(seed).normal(size=(3, n, k))
