"""Starts the simulated reaction wheel and the node that identifies it."""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import Value
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Return both nodes under one parameter file."""
    robot = LaunchConfiguration('robot')
    params = PathJoinSubstitution([FindPackageShare('sgp_ros'), 'config', [robot, '.yaml']])
    seed = Value(LaunchConfiguration('seed'), value_type=int)
    return LaunchDescription(
        [
            DeclareLaunchArgument('robot', default_value='reaction_wheel_6'),
            DeclareLaunchArgument('seed', default_value='0'),
            DeclareLaunchArgument('controller', default_value='sinusoids'),
            DeclareLaunchArgument('record', default_value=''),
            Node(
                package='sgp_ros',
                executable='reaction_wheel',
                parameters=[
                    params,
                    {'seed': seed, 'controller': LaunchConfiguration('controller')},
                ],
            ),
            Node(
                package='sgp_ros',
                executable='sgp_node',
                output='screen',
                parameters=[params, {'record.path': LaunchConfiguration('record')}],
            ),
        ]
    )
