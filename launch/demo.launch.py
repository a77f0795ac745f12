"""Starts the simulated reaction wheel and the node that identifies it.

ros2 launch sgp_ros demo.launch.py
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription

ARGUMENTS = {
    'robot': ('reaction_wheel_6', 'reaction_wheel, or reaction_wheel_6 without friction.'),
    'seed': ('0', 'Seed of noise and motion of the simulation.'),
    'controller': ('sinusoids', 'What drives the wheel: sinusoids, balance or zero.'),
    'record': ('', 'File to record inputs and predictions in; empty: no recording.'),
}


def generate_launch_description() -> LaunchDescription:
    """Return both nodes with their arguments."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])


def _nodes(context: object) -> list[Node]:
    """Return simulator and node under one parameter file."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    share = Path(get_package_share_directory('sgp_ros'))
    params = str(share / 'config' / f'{given["robot"]}.yaml')
    simulated = {'seed': int(given['seed']), 'controller': given['controller']}
    recorded = [{'record.path': given['record']}] if given['record'] else []
    return [
        Node(package='sgp_ros', executable='reaction_wheel', parameters=[params, simulated]),
        Node(
            package='sgp_ros',
            executable='sgp_node',
            output='screen',
            parameters=[params, *recorded],
        ),
    ]
