"""The settings of the node that are none of the engine. Nothing here needs ROS."""

from __future__ import annotations

from sgp_ros.engine.setting import Setting
from sgp_ros.recordings.command_types import COMMAND_TYPES, FLOAT64_ARRAY, NO_COMMAND

ROBOT = Setting(
    'robot', 'str', '',
    'Name of a built-in robot, or path of a robot file; empty: the robot is in robot_description.',
    read_only=True,
)  # fmt: skip
DESCRIPTION = Setting(
    'robot_description', 'str', '',
    'URDF as text; empty: topic robot_description is waited for. Parameter robot comes first.',
    read_only=True,
)  # fmt: skip
JOINTS = Setting(
    'joints', 'str_array', ('',),
    "Joints of robot_description that move, the others are locked; ['']: all of them.",
    read_only=True,
)  # fmt: skip
MODEL_PATH = Setting(
    'model.path', 'str', '',
    'Saved model (.npz) to go on from, with its settings where none are given; empty: none.',
    read_only=True,
)  # fmt: skip
FIRST = (ROBOT, DESCRIPTION, JOINTS, MODEL_PATH)
"""Those that decide which others there are."""


_OTHERS = (
    Setting(
        'qos.depth', 'int', 200, 'Messages kept for the node while it is busy.',
        low=1, high=100_000, read_only=True,
    ),
    Setting(
        'record.path', 'str', '',
        'MCAP file for what the node takes and predicts; may hold {time} and {node}; a taken '
        'name gets a number; empty: no record.', read_only=True,
    ),
    Setting(
        'record.split.size', 'float', 0.0,
        'Size of a record at which its next file begins, in a folder of its name; 0: never.',
        unit='MB', low=0.0, high=1e6, read_only=True,
    ),
    Setting(
        'record.split.age', 'float', 0.0,
        'Age of a record at which its next file begins, in a folder of its name; 0: never.',
        unit='s', low=0.0, high=1e7, read_only=True,
    ),
    Setting(
        'save.path', 'str', '',
        'File (.npz) that service save writes; may hold {node}; empty: {node}.npz where the '
        'node started.', read_only=True,
    ),
    Setting(
        'save.period', 'float', 0.0,
        'Time between two saves by itself, and one at the end; 0: on request alone.',
        unit='s', low=0.0, high=1e6, read_only=True,
    ),
    Setting(
        'save.restore', 'bool', default=False,
        description='Go on from the file of save.path where there is one.', read_only=True,
    ),
    Setting(
        'diagnostics.period', 'float', 1.0, 'Time between two messages on /diagnostics.',
        unit='s', low=0.1, high=3600.0, read_only=True,
    ),
    Setting(
        'diagnosis.window', 'float', 60.0,
        'How much of the past is kept for service diagnose.',
        unit='s', low=1.0, high=3600.0, read_only=True,
    ),
    Setting(
        'monitor.duration', 'float', 0.3,
        'Errors alarm on ~/monitor that lie outside their 95 % interval for at least so long.',
        unit='s', low=0.0, high=60.0, read_only=True,
    ),
    Setting(
        'monitor.false_alarms', 'float', 1.0,
        'False alarms of an undisturbed robot that are accepted; fewer need longer errors.',
        unit='1/h', low=1e-6, high=1000.0, read_only=True,
    ),
    Setting(
        'parameters.period', 'float', 1.0, 'Time between two messages on ~/parameters.',
        unit='s', low=0.02, high=3600.0, read_only=True,
    ),
)  # fmt: skip


def node_settings() -> tuple[Setting, ...]:
    """Return the settings beside `FIRST`, with the command types that are known now."""
    return (
        Setting(
            'command.type', 'str', FLOAT64_ARRAY,
            'Message type on topic command; none: the effort comes in the joint states.',
            choices=(NO_COMMAND, *COMMAND_TYPES), read_only=True,
        ),
        *_OTHERS,
    )  # fmt: skip
