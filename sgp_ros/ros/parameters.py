"""Settings as ROS parameters, with type, range, unit and description.

A parameter never has an empty list as its value: ROS cannot infer the type of its elements. Empty
is `['']` or `[0.0]`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter

from sgp_ros.engine.samples import SettingValue
from sgp_ros.engine.setting import Setting
from sgp_ros.errors import ConfigError

_TYPES = {
    'bool': Parameter.Type.BOOL,
    'int': Parameter.Type.INTEGER,
    'float': Parameter.Type.DOUBLE,
    'str': Parameter.Type.STRING,
    'float_array': Parameter.Type.DOUBLE_ARRAY,
    'str_array': Parameter.Type.STRING_ARRAY,
}
_LARGEST_FLOAT = 1.7976931348623157e308
_LARGEST_INT = 2**63 - 1


def declare(node: Node, settings: Iterable[Setting]) -> dict[str, SettingValue]:
    """Declare one parameter per setting, where the node does not have it yet.

    Returns:
        The values given at the start of the node, defaults where there were none.

    Raises:
        ConfigError: values of a wrong type or out of range, all listed in one error.
    """
    values: dict[str, SettingValue] = {}
    problems = []
    for setting in settings:
        try:
            if not node.has_parameter(setting.name):
                node.declare_parameter(setting.name, to_ros(setting.default), descriptor(setting))
        except ParameterException as error:
            problems.append(str(error))
            continue
        value = from_ros(node.get_parameter(setting.name))
        problem = setting.problem(value)
        if problem:
            problems.append(problem)
        else:
            values[setting.name] = setting.convert(value)
    if problems:
        raise ConfigError(
            f'{len(problems)} wrong parameter(s): ' + ' | '.join(problems),
            '',
            'write a double with a decimal point',
        )
    return values


def descriptor(setting: Setting) -> ParameterDescriptor:
    """Return how `setting` shows in `ros2 param describe`."""
    result = ParameterDescriptor(
        name=setting.name,
        type=_TYPES[setting.kind].value,
        description=setting.description,
        additional_constraints=_constraints(setting),
        read_only=setting.read_only,
    )
    if setting.kind == 'int':
        result.integer_range = [
            IntegerRange(
                from_value=int(max(setting.low, -_LARGEST_INT)),
                to_value=int(min(setting.high, _LARGEST_INT)),
                step=1,
            )
        ]
    elif setting.kind == 'float':
        result.floating_point_range = [
            FloatingPointRange(
                from_value=max(setting.low, -_LARGEST_FLOAT),
                to_value=min(setting.high, _LARGEST_FLOAT),
                step=0.0,  # any other step refuses values off its grid
            )
        ]
    return result


def to_ros(value: SettingValue) -> Any:
    """Return a setting's value as a parameter holds it."""
    return list(value) if isinstance(value, tuple) else value


def from_ros(parameter: Parameter[Any]) -> Any:
    """Return a parameter's value as settings take it."""
    kinds = (Parameter.Type.DOUBLE_ARRAY, Parameter.Type.STRING_ARRAY)
    return tuple(parameter.value) if parameter.type_ in kinds else parameter.value


def _constraints(setting: Setting) -> str:
    parts = []
    if setting.unit:
        parts.append(f'unit: {setting.unit}')
    if setting.choices:
        parts.append('one of: ' + ', '.join(choice or "''" for choice in setting.choices))
    if setting.kind == 'float_array' and math.isfinite(setting.low):
        parts.append(f'each from {setting.low:g} to {setting.high:g}')
    return '; '.join(parts)
