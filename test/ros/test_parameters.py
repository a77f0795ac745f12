"""Settings as parameters, without a graph."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from rclpy.parameter import Parameter

from sgp_ros.engine.config import EngineConfig, describe_settings
from sgp_ros.engine.setting import Setting
from sgp_ros.robots.registry import load_robot, robot_names
from sgp_ros.ros.parameters import descriptor, from_ros, to_ros
from sgp_ros.ros.settings import FIRST, node_settings

SETTINGS = (*FIRST, *node_settings(), *describe_settings(load_robot('reaction_wheel')))
CONFIG = Path(__file__).parents[2] / 'config'


@pytest.mark.parametrize('setting', SETTINGS, ids=lambda setting: setting.name)
def test_a_default_survives_the_way_through_a_parameter(setting: Setting) -> None:
    parameter = Parameter(setting.name, value=to_ros(setting.default))
    assert parameter.type_.value == descriptor(setting).type
    assert setting.convert(from_ros(parameter)) == setting.default
    assert setting.problem(from_ros(parameter)) is None


@pytest.mark.parametrize('setting', SETTINGS, ids=lambda setting: setting.name)
def test_every_parameter_is_described(setting: Setting) -> None:
    described = descriptor(setting)
    assert described.description
    assert described.read_only == setting.read_only
    assert setting.unit in described.additional_constraints
    ranges = {'int': described.integer_range, 'float': described.floating_point_range}
    for kind, found in ranges.items():
        assert len(found) == (setting.kind == kind)


def test_no_path_can_change_while_a_node_runs() -> None:
    """Whoever may set parameters would else choose which file `~/save` replaces."""
    paths = [setting for setting in SETTINGS if setting.name.endswith('.path')]
    assert {'save.path', 'record.path', 'model.path'} <= {setting.name for setting in paths}
    assert all(descriptor(setting).read_only for setting in paths)


def test_a_range_allows_every_value_in_it() -> None:
    described = descriptor(Setting('a', 'float', 1.0, 'b', low=0.0))
    (limits,) = described.floating_point_range
    assert (limits.from_value, limits.step) == (0.0, 0.0)
    assert limits.to_value > 1e300


@pytest.mark.parametrize('path', sorted(CONFIG.glob('*.yaml')), ids=lambda path: path.stem)
def test_a_shipped_file_configures_the_robot_of_its_name(path: Path) -> None:
    document = yaml.safe_load(path.read_text())
    assert list(document) == ['/**']  # a section named after the node would miss a renamed one
    given = _flat('', document['/**']['ros__parameters'])
    robot = given.pop('robot')
    assert robot == path.stem  # a name is found from anywhere
    known = {setting.name: setting for setting in node_settings()}
    for name in set(given) & set(known):
        assert known[name].problem(given.pop(name)) is None
    EngineConfig.from_mapping(given, load_robot(robot))


def test_every_robot_has_a_file() -> None:
    assert {path.stem for path in CONFIG.glob('*.yaml')} <= set(robot_names())


def _flat(prefix: str, tree: dict[str, object]) -> dict[str, object]:
    found: dict[str, object] = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            found |= _flat(f'{prefix}{key}.', value)
        else:
            found[f'{prefix}{key}'] = value
    return found
