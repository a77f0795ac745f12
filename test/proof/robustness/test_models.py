"""Models with a right hash and wrong content are refused, or can be used."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_proof.robustness.harmful_files import crafted_models
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.engine.snapshots import restored, take_snapshot
from sgp_ros.errors import ConfigError
from sgp_ros.recordings.model_files import load_model, save_model
from sgp_ros.robots.registry import load_robot

EACH = 5
"""One of so many is tried; a prime, so that all kinds are."""


def _states(names, n):
    for i in range(n):
        x = frozen_array([np.sin(0.05 * i), np.cos(0.03 * i)])
        yield JointSample(10**18 + i * 10**7, names, x, effort=frozen_array(x * 0.1))


def test_a_crafted_model_is_refused_in_one_line_or_goes_on(tmp_path):
    robot = load_robot('reaction_wheel')
    engine = Engine(
        robot, EngineConfig.from_mapping({'buffer.budget': 20, 'learning.initial': 20}, robot)
    )
    states = list(_states(robot.joint_names, 120))
    replay(engine, states, lambda _: None)
    assert engine.is_ready
    restored(robot, take_snapshot(engine))
    path, loaded = tmp_path / 'model.npz', 0
    for number, (what, model) in enumerate(crafted_models(take_snapshot(engine))):
        if number % EACH:
            continue
        save_model(path, model)
        found = _restored(robot, path)
        if isinstance(found, ConfigError):
            assert '\n' not in str(found), what
            continue
        loaded += 1
        found.begin_stream()
        replay(found, states[:30], lambda step, what=what: _all_well(step, what))
        found.parameters(), found.scores(), found.process_weights()
    assert 0 < loaded < number / EACH / 2


def _restored(robot, path):
    try:
        return restored(robot, load_model(path))
    except ConfigError as error:
        return error


def _all_well(step, what):
    assert not step.failures, what


def test_a_model_with_a_sample_that_has_no_neighbour_is_read_back():
    """Its distance is infinite; no other number of a model may be."""
    robot = load_robot('reaction_wheel')
    settings = {'buffer.budget': 20, 'learning.initial': 20, 'buffer.policy': 'coverage'}
    engine = Engine(robot, EngineConfig.from_mapping(settings, robot))
    replay(engine, list(_states(robot.joint_names, 120)), lambda _: None)
    model = take_snapshot(engine)
    (name,) = (n for n in model if n.endswith('_gap'))
    assert restored(robot, {**model, name: np.full_like(model[name], np.inf)}).is_ready
    with pytest.raises(ConfigError, match='gap'):
        restored(robot, {**model, name: np.full_like(model[name], np.nan)})
