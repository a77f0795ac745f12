"""Starts the node that identifies a robot. An argument left empty changes nothing.

    ros2 launch sgp_ros sgp.launch.py params_file:=/my/sgp.yaml
    ros2 launch sgp_ros sgp.launch.py robot:=panda namespace:=left record:='left_{time}'

Values are read as plain text when the launch starts, so no substitution is nested in another.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

ARGUMENTS = {
    'namespace': 'Namespace of the node and of its topics.',
    'use_sim_time': 'true: time comes from topic /clock, as of a simulator or a played bag.',
    'robot': 'Built-in robot, or path of a robot file; empty: that of params_file, or else topic '
    'robot_description.',
    'params_file': 'Parameter file (YAML); empty: the one shipped for a built-in robot, if any.',
    'command_type': 'Message type of the commands, or none if joint states contain the effort.',
    'joint_states': 'Topic of the joint states.',
    'command': 'Topic of the commands.',
    'record': 'File to record inputs and predictions in; may contain {time} and {node}.',
    'respawn': 'true: start the node again whenever it ends.',
    'managed': 'true: start a lifecycle node, to be configured and activated.',
    'prefix': 'Command that starts the node, such as nice -n -5 or taskset -c 3.',
    'log_level': 'debug, info, warn, error or fatal.',
}
PARAMETERS = {'robot': 'robot', 'command_type': 'command.type', 'record': 'record.path'}


def generate_launch_description() -> LaunchDescription:
    """Return the node with its arguments."""
    arguments = [
        DeclareLaunchArgument(name, default_value='', description=text)
        for name, text in ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_node)])


def _node(context: object) -> list[Node]:
    """Return the node; what was left empty is left out."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    parameters: list[object] = []
    file = given['params_file'] or _shipped(given['robot'])
    if file:
        parameters.append(file)
    own: dict[str, object] = {
        parameter: ParameterValue(given[name], value_type=str)
        for name, parameter in PARAMETERS.items()
        if given[name]
    }
    if given['use_sim_time']:
        own['use_sim_time'] = _is_true('use_sim_time', given)
    if own:
        parameters.append(own)
    level = given['log_level']
    return [
        Node(
            package='sgp_ros',
            executable='sgp_lifecycle_node' if _is_true('managed', given) else 'sgp_node',
            namespace=given['namespace'] or None,
            output='screen',
            parameters=parameters,
            remappings=[(n, given[n]) for n in ('joint_states', 'command') if given[n]],
            arguments=['--ros-args', '--log-level', level] if level else [],
            prefix=given['prefix'] or None,
            respawn=_is_true('respawn', given),
            respawn_delay=1.0,
        )
    ]


def _shipped(robot: str) -> str:
    path = Path(get_package_share_directory('sgp_ros')) / 'config' / f'{robot}.yaml'
    return str(path) if robot and path.is_file() else ''


def _is_true(name: str, given: dict[str, str]) -> bool:
    """Return a switch; what is neither true nor false is refused, because it was misspelt."""
    text = given[name].lower()
    if text in ('true', '1', 'yes', 'on'):
        return True
    if text in ('', 'false', '0', 'no', 'off'):
        return False
    raise RuntimeError(f'launch argument {name}:={given[name]} is neither true nor false')
