"""The settings of the node that are none of the engine."""

from __future__ import annotations

from sgp_ros.engine.setting import Setting
from sgp_ros.recordings.messages import CONVERTERS, FLOAT64_ARRAY

NO_COMMAND = 'none'

ROBOT = Setting(
    'robot', 'str', 'reaction_wheel',
    'Name of a built-in robot, or path of a robot YAML or URDF.', read_only=True,
)  # fmt: skip
MODEL_PATH = Setting(
    'model.path', 'str', '',
    'Saved model (.npz) to go on from, with its settings where none are given; empty: none.',
    read_only=True,
)  # fmt: skip

NODE_SETTINGS = (
    Setting(
        'command.type', 'str', FLOAT64_ARRAY,
        'Message type on topic command; none: the effort comes in the joint states.',
        choices=(NO_COMMAND, *CONVERTERS), read_only=True,
    ),
    Setting(
        'qos.depth', 'int', 200, 'Messages kept for the node while it is busy.',
        low=1, high=100_000, read_only=True,
    ),
    Setting(
        'record.path', 'str', '',
        'MCAP file for what the node consumes and predicts; empty: no record.', read_only=True,
    ),
    Setting(
        'save.path', 'str', '',
        'File (.npz) that service save writes; empty: <node name>.npz where the node started.',
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
        'parameters.period', 'float', 1.0, 'Time between two messages on ~/parameters.',
        unit='s', low=0.02, high=3600.0, read_only=True,
    ),
)  # fmt: skip
