"""Saved models with a right hash and wrong content: refused in one line, or of use.

Chance does not make them, since any damage breaks the hash. One array or one entry of the text of
a model that learned is replaced, and the model is saved anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from sgp_proof.robustness.harmful_files import crafted_models
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.results import Step
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.engine.snapshots import restored, take_snapshot
from sgp_ros.recordings.model_files import load_model, save_model
from sgp_ros.robots.registry import load_robot

ROBOT = 'reaction_wheel'
SETTINGS = {'buffer.budget': 20, 'learning.initial': 20}
TAUGHT, TRIED = 120, 30
"""States from which the model learned, and that a crafted one is given."""


def states(n: int) -> Iterator[JointSample]:
    """Yield a motion of the robot at 100 Hz with its efforts."""
    names = load_robot(ROBOT).joint_names
    for i in range(n):
        x = frozen_array([np.sin(0.05 * i), np.cos(0.03 * i)])
        yield JointSample(10**18 + i * 10**7, names, x, effort=frozen_array(x * 0.1))


def taught(settings: dict[str, object] = SETTINGS) -> dict[str, np.ndarray]:
    """Return the snapshot of an engine that learned."""
    robot = load_robot(ROBOT)
    engine = Engine(robot, EngineConfig.from_mapping(settings, robot))
    replay(engine, list(states(TAUGHT)), lambda _: None)
    assert engine.is_ready
    return take_snapshot(engine)


def write_crafted(path: Path, rng: np.random.Generator) -> None:
    """Save, over an intact model, one with something wrong in it."""
    models = list(crafted_models(load_model(path)))
    save_model(path, models[int(rng.integers(len(models)))][1])


def use_model(path: Path) -> None:
    """Go on from a saved model as the node does; raise `ConfigError` where it is refused."""
    engine = restored(load_robot(ROBOT), load_model(path))
    engine.begin_stream()
    replay(engine, list(states(TRIED)), _require_well)
    engine.parameters(), engine.scores(), engine.process_weights()


def _require_well(step: Step) -> None:
    assert not step.failures, step.failures
