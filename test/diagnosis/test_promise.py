"""A diagnosis promises the error that the online engine delivers with the diagnosed robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml

from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.robots.registry import load_robot
from test.diagnosis.worlds import CHAINS, events_of, robot_of


@pytest.mark.parametrize('velocity_noise', [None, 5e-3])
def test_the_online_effort_is_as_good_as_promised_within_a_factor_of_two(
    tmp_path, perfect, velocity_noise
):
    """No window was set: the engine chose it, and passes over a velocity field that is coarse."""
    robot, tree = robot_of(tmp_path, CHAINS[1])
    world, velocity = perfect[1], None
    if velocity_noise is not None:
        rng = np.random.default_rng(0)
        velocity = world.velocity + velocity_noise * rng.normal(size=world.velocity.shape)
    events = events_of(replace(world), velocity=velocity)
    promised = diagnose(events, robot, tree, {}).proofs['train'].nmse_after
    path = tmp_path / 'diagnosed.yaml'
    terms = {'inertial': 'all', 'viscous': 'all'}
    document = {
        'schema': 1, 'urdf': robot.source['urdf'], 'terms': terms, 'effects': [],
        'prior': {name: {'spread': 0.05} for name in terms},
    }  # fmt: skip
    path.write_text(yaml.safe_dump(document), encoding='utf-8')
    diagnosed = load_robot(str(path))
    engine = Engine(diagnosed, EngineConfig.from_mapping({}, diagnosed))
    replay(engine, events, lambda _: None)
    for joint, scores in engine.scores().items():
        assert scores['effort'].nmse < 2.0 * promised[joint]
