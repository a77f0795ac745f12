"""A small machine whose truth is known, as a stream of events."""

from __future__ import annotations

import numpy as np

from sgp_proof.columns import (
    acceleration,
    effort,
    sine,
    single_column,
    velocity,
)
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.physics.term import Coefficient, Joint
from sgp_ros.robots.robot import Robot

START_NS = 1_700_000_000_000_000_000
TRUTH = {'gravity': -20.0, 'damping': -0.8, 'gain': 5.0}

PENDULUM = Robot(
    name='pendulum',
    joints=(Joint('hinge'),),
    target='acceleration',
    terms=(
        single_column(Coefficient('gravity', 'rad/s^2', 'hinge'), 0, sine(0), 'test'),
        single_column(Coefficient('damping', '1/s', 'hinge'), 0, velocity(0), 'test'),
        single_column(Coefficient('gain', '1/(kg m^2)', 'hinge'), 0, effort(0), 'test'),
    ),
    residual_inputs=(('velocity:hinge',),),
)

INVERSE_PENDULUM = Robot(
    name='inverse_pendulum',
    joints=(Joint('hinge'),),
    target='effort',
    terms=(
        single_column(Coefficient('inertia', 'kg m^2', 'hinge'), 0, acceleration(0), 'test'),
        single_column(Coefficient('weight', 'N m', 'hinge'), 0, sine(0), 'test'),
        single_column(Coefficient('viscous', 'N m s/rad', 'hinge'), 0, velocity(0), 'test'),
    ),
    residual_inputs=(('velocity:hinge',),),
)


def motion(n, rate_hz, seed, noise=0.0, substeps=10):
    """Integrate the pendulum under a held multi-sine; returns times, positions, commands."""
    rng = np.random.default_rng(seed)
    frequency, phase = rng.uniform(0.2, 2.0, size=5), rng.uniform(0, 2 * np.pi, size=5)
    q = np.array([0.3, 0.0])
    t = np.arange(n) / rate_hz
    command = 3.0 * np.sin(2 * np.pi * np.outer(t, frequency) + phase).sum(axis=1) / 2.0
    positions = np.empty(n)
    velocities = np.empty(n)
    step = 1.0 / rate_hz / substeps

    def slope(x, m):
        return np.array(
            [x[1], TRUTH['gravity'] * np.sin(x[0]) + TRUTH['damping'] * x[1] + TRUTH['gain'] * m]
        )

    for i in range(n):
        positions[i], velocities[i] = q
        for _ in range(substeps):
            k1 = slope(q, command[i])
            k2 = slope(q + 0.5 * step * k1, command[i])
            k3 = slope(q + 0.5 * step * k2, command[i])
            q = q + step * (k1 + 2 * k2 + 2 * k3 + slope(q + step * k3, command[i])) / 6
    return t, positions + noise * rng.normal(size=n), velocities, command


def pendulum_events(n=600, rate_hz=100.0, seed=0, noise=1e-5):
    """Return commands and states of the pendulum in the order of their stamps."""
    t, positions, _, command = motion(n, rate_hz, seed, noise)
    events = []
    for time, q, m in zip(t, positions, command, strict=True):
        stamp = START_NS + round(time * 1e9)
        events.append(CommandSample(stamp, frozen_array([m])))
        events.append(JointSample(stamp, ('hinge',), frozen_array([q])))
    return events


def config(robot=PENDULUM, **settings):
    """Return a configuration; underscores in names stand for dots."""
    values = {'learning.initial': 20, 'refit.period': 40, 'buffer.budget': 60}
    values.update({name.replace('__', '.'): value for name, value in settings.items()})
    return EngineConfig.from_mapping(values, robot)
