"""Builds the session of a node from its parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from rclpy.node import Node

from sgp_ros.engine.config import EngineConfig, describe_settings
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import SettingValue
from sgp_ros.engine.setting import Setting
from sgp_ros.engine.snapshots import snapshot_config
from sgp_ros.robots.registry import load_robot
from sgp_ros.ros.node_settings import MODEL_PATH, NODE_SETTINGS, ROBOT
from sgp_ros.ros.parameters import declare
from sgp_ros.ros.storage import load_model
from sgp_ros.ros.warm_up import warm_up


def build_engine(node: Node) -> tuple[Engine, dict[str, SettingValue]]:
    """Declare all parameters and return the engine, with the settings of the node.

    A saved model brings its own settings as the defaults of the parameters; what the user gives
    wins, where it may change at all.

    Raises:
        ConfigError: no such robot or model, or wrong parameters, all listed in one error.
    """
    first = declare(node, (ROBOT, MODEL_PATH))
    robot = load_robot(str(first['robot']))
    snapshot = load_model(Path(str(first['model.path']))) if first['model.path'] else None
    saved = {} if snapshot is None else snapshot_config(snapshot, robot).to_mapping()
    (kernel,) = (s for s in describe_settings(robot) if s.name == 'model.kernel')
    given = declare(node, _with_defaults((kernel,), saved))  # it names the hyper-parameters
    settings = describe_settings(robot, str(given['model.kernel']))
    rest = [setting for setting in settings if setting.name != kernel.name]
    given |= declare(node, (*NODE_SETTINGS, *_with_defaults(rest, saved)))
    names = {setting.name for setting in settings}
    config = EngineConfig.from_mapping({n: v for n, v in given.items() if n in names}, robot)
    warm_up(robot)
    engine = Engine(robot, config)
    if snapshot is not None:
        engine.restore(snapshot)
        present = engine.config.to_mapping()
        wanted = {n: v for n, v in config.to_mapping().items() if v != present.get(n)}
        if wanted:
            engine.change(wanted)
    return engine, {**first, **{n: v for n, v in given.items() if n not in names}}


def _with_defaults(
    settings: Iterable[Setting], values: Mapping[str, SettingValue]
) -> list[Setting]:
    return [replace(s, default=values.get(s.name, s.default)) for s in settings]
