"""Starts the node that identifies a robot, with its parameter file and topics as arguments."""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Return the node with its parameter file and topics as arguments."""
    robot = LaunchConfiguration('robot')
    shipped = PathJoinSubstitution([FindPackageShare('sgp_ros'), 'config', [robot, '.yaml']])
    return LaunchDescription(
        [
            DeclareLaunchArgument('robot', default_value='reaction_wheel'),
            DeclareLaunchArgument('params_file', default_value=shipped),
            DeclareLaunchArgument('joint_states', default_value='joint_states'),
            DeclareLaunchArgument('command', default_value='command'),
            DeclareLaunchArgument('record', default_value=''),
            Node(
                package='sgp_ros',
                executable='sgp_node',
                output='screen',
                parameters=[
                    LaunchConfiguration('params_file'),
                    {'record.path': LaunchConfiguration('record')},
                ],
                remappings=[
                    ('joint_states', LaunchConfiguration('joint_states')),
                    ('command', LaunchConfiguration('command')),
                ],
            ),
        ]
    )
