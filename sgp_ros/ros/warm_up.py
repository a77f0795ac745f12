"""Compiles what the engine needs before the first message comes.

The first call of a compiled loop takes seconds, in which a queue of messages would overflow.
"""

from __future__ import annotations

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.robots.robot import Robot

_PERIOD_NS = 1_000_000
_SAMPLES = 40


def warm_up(robot: Robot) -> None:
    """Run a short made-up stream through an engine that is then thrown away."""
    values: dict[str, object] = {
        'filter.window': 0.008, 'filter.hop': 0.0, 'buffer.budget': 4, 'learning.initial': 4,
    }  # fmt: skip
    for joint in robot.joint_names:
        values[f'hyper.{joint}.signal_variance'] = 1.0
        values[f'hyper.{joint}.noise_variance'] = 1.0
    engine = Engine(robot, EngineConfig.from_mapping(values, robot))
    rng = np.random.default_rng(0)
    k = len(robot.joints)
    for i in range(_SAMPLES):
        position, effort = rng.normal(size=(2, k))
        sample = JointSample(
            i * _PERIOD_NS, robot.joint_names, frozen_array(position), effort=frozen_array(effort)
        )
        engine.push(sample)
    engine.flush()
