"""Where a node has its robot from, and which of the parameters given to it nobody knows.

Parameter `robot` comes first, then the text in parameter `robot_description`, then the latched
topic of that name, which `robot_state_publisher` offers.
"""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import yaml
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from sgp_ros.engine.config import EngineConfig
from sgp_ros.errors import ConfigError, SgpError
from sgp_ros.markup import load_yaml
from sgp_ros.recordings.messages import Status, diagnostics_message
from sgp_ros.robots.models.door import MODEL_ENDINGS, find_file, read_model
from sgp_ros.ros.messages import new_message
from sgp_ros.ros.parameters import declare
from sgp_ros.ros.settings import FIRST, node_settings
from sgp_ros.ros.verdict import ERROR, WARN
from sgp_ros.strangers import read_text

_TOPIC = 'robot_description'
_PERIOD_S = 1.0
_QUIET_S = 10.0
_OF_ROS = ('use_sim_time', 'start_type_description_service', 'qos_overrides.')
_HYPER = 'hyper.'
_SECTION = 'ros__parameters'


class RobotSource:
    """Finds the robot of a node.

    Args:
        node: that the parameters are declared on.

    Attributes:
        robot: what `load_robot` takes; empty while it is waited for.
        problem: why the last description could not be used; empty while all is well.

    Raises:
        ConfigError: wrong parameters.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        given = declare(node, FIRST)
        refuse_unknown(node, [s.name for s in (*FIRST, *node_settings())] + _engine_names())
        joints = given['joints']
        assert isinstance(joints, tuple)
        self._joints = [str(joint) for joint in joints if joint]
        text = str(given['robot_description'])
        name = str(given['robot'])
        self.robot = self._restricted(name) if name else self._described(text) if text else ''
        self.problem = ''
        self._entities: list[Any] = []

    def listen(self, take: Callable[[str], None] | None = None) -> None:
        """Wait for the topic, and say so on /diagnostics.

        Args:
            take: called with each description until it raises no `SgpError`; None only keeps the
                last one in `robot`.
        """
        node = self._node

        def hear(message: String) -> None:
            try:
                robot = self._described(message.data)
                if take is not None:
                    take(robot)
            except (SgpError, ParameterException) as error:
                self.problem = ' '.join(str(error).split())
                node.get_logger().error(f'{_TOPIC}: {self.problem}')
            else:
                self.robot, self.problem = robot, ''
                self.close()

        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._topic = node.resolve_topic_name(_TOPIC)
        self._diagnostics = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._entities = [
            (node.destroy_publisher, self._diagnostics),
            (node.destroy_subscription, node.create_subscription(String, _TOPIC, hear, latched)),
            (node.destroy_timer, node.create_timer(_PERIOD_S, self._report, clock=steady)),
        ]

    def close(self) -> None:
        """Stop to wait."""
        for destroy, entity in self._entities:
            destroy(entity)
        self._entities = []

    def _report(self) -> None:
        if not self._entities:
            return  # the turn of a timer may have come when the description destroyed it
        level, message = ERROR, f'{_TOPIC} cannot be used: {self.problem}'
        if not self.problem:
            count = self._node.count_publishers(self._topic)
            level = WARN
            message = (
                f'waiting for the robot on {self._topic} ({count} publishers); start '
                'robot_state_publisher, or set parameter robot or robot_description'
            )
            self._node.get_logger().warning(message, throttle_duration_sec=_QUIET_S)
        name = self._node.get_fully_qualified_name().lstrip('/')
        status = Status(f'{name}: robot', level, message, '', {})
        now_ns = self._node.get_clock().now().nanoseconds
        self._diagnostics.publish(diagnostics_message(new_message, now_ns, [status]))

    def _restricted(self, name: str) -> str:
        """Return a robot of which only the joints in parameter `joints` move."""
        if not self._joints:
            return name
        if Path(name).suffix.lower() not in MODEL_ENDINGS:
            raise ConfigError(
                f'parameter joints is set for robot {name!r}', 'a model file such as a URDF',
                'a robot YAML states its joints itself, under the key joints',
            )  # fmt: skip
        document = read_model(find_file(name, Path.cwd()))
        return yaml.safe_dump({'schema': 1, **document, 'joints': self._joints})

    def _described(self, text: str) -> str:
        if not text.strip():
            raise ConfigError('an empty robot_description', 'a URDF')
        if not self._joints:
            return text
        return yaml.safe_dump({'schema': 1, 'urdf': text, 'joints': self._joints})


def refuse_unknown(node: Node, known: Iterable[str], *, is_complete: bool = False) -> None:
    """Refuse parameters that were given to a node and that it does not have.

    Args:
        node: whose overrides are looked at.
        known: names of the parameters that it has.
        is_complete: whether `known` names the hyper-parameters too, which follow from the robot.

    Raises:
        ConfigError: there are such parameters; each with the closest name.
    """
    names = set(known)
    given = node._parameter_overrides  # noqa: SLF001 - rclpy tells nowhere else what was given
    unknown = [
        name
        for name in sorted(given)
        if name not in names
        and not name.startswith(_OF_ROS)
        and (is_complete or not name.startswith(_HYPER))
    ]
    if unknown:
        raise ConfigError(
            f'unknown parameters: {", ".join(_with_closest(name, names) for name in unknown)}',
            '',
            'put parameters of other nodes in a section with the name of that node',
        )


def _with_closest(name: str, names: set[str]) -> str:
    close = difflib.get_close_matches(name, sorted(names), n=1)
    return f'{name} (did you mean {close[0]}?)' if close else name


def _engine_names() -> list[str]:
    return [f.metadata['setting'].name for f in fields(EngineConfig) if 'setting' in f.metadata]


def refuse_foreign_files(name: str, arguments: Sequence[str]) -> None:
    """Refuse parameter files without a section for a node: ROS would ignore them in silence.

    Args:
        name: full name of the node, such as `/arm/sgp_node`.
        arguments: command line of the process.

    Raises:
        ConfigError: such a file, with the sections that it has.
    """
    for option, path in itertools.pairwise(arguments):
        if option != '--params-file':
            continue
        try:
            content = load_yaml(read_text(Path(path)))
        except (OSError, yaml.YAMLError, UnicodeDecodeError):
            continue  # ROS itself has refused it
        sections = list(_sections('', content))
        if not any(_is_for(section, name) for section in sections):
            raise ConfigError(
                f'{path} has only parameters of {sections}', f'a section {name}: or /**:'
            )


def _sections(prefix: str, content: object) -> Iterable[str]:
    if isinstance(content, dict):
        for key, value in content.items():
            if key == _SECTION:
                yield prefix
            else:
                yield from _sections(f'{prefix}/{str(key).strip("/")}', value)


def _is_for(section: str, name: str) -> bool:
    """Whether a section holds for a node; `*` stands for one token, `**` for any number."""
    return _matches(section.strip('/').split('/'), name.strip('/').split('/'))


def _matches(pattern: Sequence[str], tokens: Sequence[str]) -> bool:
    if not pattern:
        return not tokens
    if pattern[0] == '**':
        return any(_matches(pattern[1:], tokens[i:]) for i in range(len(tokens) + 1))
    return bool(tokens) and pattern[0] in ('*', tokens[0]) and _matches(pattern[1:], tokens[1:])
