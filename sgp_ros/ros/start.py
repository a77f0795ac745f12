"""Engine of a node, built from its parameters and warmed up.

The first call of a compiled loop takes seconds, in which a queue of messages would overflow, so a
made-up stream comes before the first message.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from rclpy.node import Node

from sgp_ros.engine.config import EngineConfig, describe_settings
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import CommandSample, JointSample, SettingValue, frozen_array
from sgp_ros.engine.setting import Setting
from sgp_ros.engine.snapshots import restored, snapshot_config
from sgp_ros.recordings.model_files import load_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot
from sgp_ros.ros.parameters import declare
from sgp_ros.ros.record import save_file
from sgp_ros.ros.robot_source import refuse_unknown
from sgp_ros.ros.settings import FIRST, ROBOT, node_settings

_PERIOD_NS = 1_000_000
_SAMPLES = 40


def build_engine(node: Node, name: str) -> tuple[Engine, dict[str, SettingValue]]:
    """Declare all parameters and return the engine, with the settings of the node.

    A saved model brings its own settings as the defaults of the parameters; what the user gives
    wins, where it may change at all.

    Args:
        node: that the parameters are declared on.
        name: of the robot, or its description, as `load_robot` takes it.

    Raises:
        ConfigError: no such robot or model, or wrong parameters, all listed in one error.
    """
    first = declare(node, FIRST)
    robot = load_robot(name)
    model = str(first['model.path']) or _left_over(node)
    snapshot = load_model(Path(model)) if model else None
    saved = {} if snapshot is None else snapshot_config(snapshot, robot).to_mapping()
    (kernel,) = (s for s in describe_settings(robot) if s.name == 'model.kernel')
    given = declare(node, _with_defaults((kernel,), saved))  # it names the hyper-parameters
    settings = describe_settings(robot, str(given['model.kernel']))
    rest = [setting for setting in settings if setting.name != kernel.name]
    given |= declare(node, (*node_settings(), *_with_defaults(rest, saved)))
    names = {setting.name for setting in settings}
    refuse_unknown(node, names | set(first) | set(given), is_complete=True)
    config = EngineConfig.from_mapping({n: v for n, v in given.items() if n in names}, robot)
    warm_up(robot)
    engine = Engine(robot, config) if snapshot is None else restored(robot, snapshot)
    if snapshot is not None:
        present = engine.config.to_mapping()
        wanted = {n: v for n, v in config.to_mapping().items() if v != present.get(n)}
        if wanted:
            engine.change(wanted)
    own = {n: v for n, v in given.items() if n not in names}
    return engine, {**first, **own, ROBOT.name: name}


def _left_over(node: Node) -> str:
    """Return the file that an earlier run saved, where it is to be gone on from."""
    settings = [s for s in node_settings() if s.name in ('save.path', 'save.restore')]
    given = declare(node, settings)
    path = save_file(str(given['save.path']), node.get_fully_qualified_name())
    if not given['save.restore'] or not path.is_file():
        return ''
    node.get_logger().info(f'continuing from {path}')
    return str(path)


def _with_defaults(
    settings: Iterable[Setting], values: Mapping[str, SettingValue]
) -> list[Setting]:
    return [replace(s, default=values.get(s.name, s.default)) for s in settings]


def warm_up(robot: Robot) -> None:
    """Run a short made-up stream through an engine that is then thrown away.

    Its efforts are commanded first, then measured.
    """
    values: dict[str, object] = {
        'filter.window': 0.008, 'filter.hop': 0.0, 'buffer.budget': 4, 'learning.initial': 4,
    }  # fmt: skip
    for joint in robot.joint_names:
        values[f'hyper.{joint}.signal_variance'] = 1.0
        values[f'hyper.{joint}.noise_variance'] = 1.0
    engine = Engine(robot, EngineConfig.from_mapping(values, robot))
    rng = np.random.default_rng(0)
    k = len(robot.joints)
    names = tuple(joint.name for joint in robot.joints if joint.is_actuated)
    engine.push(CommandSample(0, frozen_array([0.0] * len(names)), names))
    for i in range(2 * _SAMPLES):
        position, effort = rng.normal(size=(2, k))
        measured = frozen_array(effort) if i >= _SAMPLES else None
        engine.push(
            JointSample(i * _PERIOD_NS, robot.joint_names, frozen_array(position), effort=measured)
        )
    engine.flush()
