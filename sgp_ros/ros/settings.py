"""Settings of the node that the engine does not have. Nothing here needs ROS."""

from __future__ import annotations

from sgp_ros.engine.setting import Setting
from sgp_ros.recordings.command_types import COMMAND_TYPES, FLOAT64_ARRAY, NO_COMMAND

ROBOT = Setting(
    'robot', 'str', '',
    'Built-in robot, or path of a robot file; empty: use robot_description.',
    read_only=True,
)  # fmt: skip
DESCRIPTION = Setting(
    'robot_description', 'str', '',
    'URDF as text; empty: wait for it on topic robot_description. Ignored if robot is set.',
    read_only=True,
)  # fmt: skip
JOINTS = Setting(
    'joints', 'str_array', ('',),
    "Joints of robot_description, or of a URDF named by robot, that move; all others are locked. "
    "['']: all joints move.",
    read_only=True,
)  # fmt: skip
MODEL_PATH = Setting(
    'model.path', 'str', '',
    'Saved model (.npz) to continue from; settings that are not given are taken from it. '
    'Empty: start without a model.',
    read_only=True,
)  # fmt: skip
SAVE_NAME = Setting(
    'save.name', 'str', '',
    'Name under which the service save writes NAME.npz into the folder of save.path; letters, '
    'digits, _, . and - after the first. Empty: the file at save.path.',
    pattern=r'([A-Za-z0-9_][A-Za-z0-9_.-]{0,99})?',
)  # fmt: skip
FIRST = (ROBOT, DESCRIPTION, JOINTS, MODEL_PATH)
"""Those that decide which others there are."""


_OTHERS = (
    Setting(
        'qos.depth', 'int', 200, 'Number of messages queued while the node is busy.',
        low=1, high=100_000, read_only=True,
    ),
    Setting(
        'record.path', 'str', '',
        'MCAP file to record inputs and predictions in; may contain {time} and {node}; an '
        'existing '
        'file is kept, and a number is added to the name. Empty: no recording.', read_only=True,
    ),
    Setting(
        'record.split.size', 'float', 0.0,
        'File size at which a new file of the record begins; the files share a folder. 0: never.',
        unit='MB', low=0.0, high=1e6, read_only=True,
    ),
    Setting(
        'record.split.age', 'float', 0.0,
        'Time after its first message at which a new file of the record begins; the files share a '
        'folder. 0: never.',
        unit='s', low=0.0, high=1e7, read_only=True,
    ),
    Setting(
        'save.path', 'str', '',
        'File (.npz) that the service save writes; may contain {node}. Empty: {node}.npz in the '
        'working directory.', read_only=True,
    ),
    SAVE_NAME,
    Setting(
        'save.period', 'float', 0.0,
        'Interval of automatic saves, with one more at shutdown; 0: save only on request.',
        unit='s', low=0.0, high=1e6, read_only=True,
    ),
    Setting(
        'save.restore', 'bool', default=False,
        description='Continue from the file at save.path if it exists.', read_only=True,
    ),
    Setting(
        'diagnostics.period', 'float', 1.0, 'Interval of messages on /diagnostics.',
        unit='s', low=0.1, high=3600.0, read_only=True,
    ),
    Setting(
        'diagnosis.window', 'float', 60.0,
        'Length of the recent past kept for the service diagnose.',
        unit='s', low=1.0, high=3600.0, read_only=True,
    ),
    Setting(
        'monitor.duration', 'float', 0.3,
        'Shortest time that an error must stay outside its 95 % interval to raise an alarm on '
        '~/monitor.',
        unit='s', low=0.0, high=60.0, read_only=True,
    ),
    Setting(
        'monitor.false_alarms', 'float', 1.0,
        'Accepted rate of false alarms of an undisturbed robot; a lower rate means later alarms.',
        unit='1/h', low=1e-6, high=1000.0, read_only=True,
    ),
    Setting(
        'parameters.period', 'float', 1.0, 'Interval of messages on ~/parameters.',
        unit='s', low=0.02, high=3600.0, read_only=True,
    ),
)  # fmt: skip


def node_settings() -> tuple[Setting, ...]:
    """Return the settings beside `FIRST`, with the command types that are known now."""
    return (
        Setting(
            'command.type', 'str', FLOAT64_ARRAY,
            'Message type on topic command; none: take the effort from the joint states.',
            choices=(NO_COMMAND, *COMMAND_TYPES), read_only=True,
        ),
        *_OTHERS,
    )  # fmt: skip
