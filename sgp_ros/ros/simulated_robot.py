"""A node that steps a simulated robot by the time that really passes.

Each state is stamped with the time up to which the simulation was integrated, so stamps and motion
agree exactly however late a timer fires. A command with a header carries the stamp of the state at
which it was given, from which it truly holds: pairing is exact. A command without a header
is paired by its time of receipt, which is later by the transport and by the last stretch of the
integration (half a millisecond at 100 Hz); to keep that short, most of a period is integrated
ahead while the node is idle.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from sgp_ros.engine.samples import CommandSample, JointSample, SettingValue
from sgp_ros.engine.setting import Setting
from sgp_ros.errors import MessageError
from sgp_ros.physics.example import example_effect
from sgp_ros.recordings.command_types import COMMAND_TYPES, FLOAT64_ARRAY
from sgp_ros.recordings.messages import joint_state_message
from sgp_ros.ros.messages import message_class, new_message
from sgp_ros.ros.parameters import declare
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.sensors import Sensors
from sgp_ros.simulation.stepping import SimulatedSample, Simulation

ROBOT = 'reaction_wheel'
EXTERNAL = 'external'
_AHEAD = 0.9
_LONGEST_PAUSE_NS = 1_000_000_000


def simulator_settings() -> tuple[Setting, ...]:
    """Return the settings of the node."""
    return (
        Setting(
            'rate', 'float', 100.0, 'Rate of joint states and control.',
            unit='Hz', low=1.0, high=2000.0, read_only=True,
        ),
        Setting('seed', 'int', 0, 'Seed of noise and motion.', low=0, read_only=True),
        Setting(
            'controller', 'str', 'sinusoids',
            'Controller of the robot; external: subscribe to topic command instead of publishing '
            'it.',
            choices=('sinusoids', 'balance', 'zero', EXTERNAL), read_only=True,
        ),
        Setting(
            'command.type', 'str', FLOAT64_ARRAY,
            'Message type on topic command; a header stamp is the time at which the command takes '
            'effect.',
            choices=tuple(COMMAND_TYPES), read_only=True,
        ),
        Setting(
            'effects', 'str_array', ('',),
            'Effects added to the simulated robot, such as '
            f"'{example_effect('pole', 0.01)}'.",
            read_only=True,
        ),
        Setting(
            'encoder_resolution', 'float', 0.0015339807878856412,
            'Resolution of the encoders; 0: ideal.',
            unit='rad', low=0.0, high=1.0, read_only=True,
        ),
        Setting(
            'publish_velocity', 'bool', default=False, description='Publish velocities too.',
            read_only=True,
        ),
    )  # fmt: skip


class SimulatedRobotNode(Node):  # type: ignore[misc]  # rclpy is untyped
    """Publishes `joint_states`, and `command` unless the controller is external.

    Raises:
        ConfigError: parameters with which it cannot start.
    """

    def __init__(self) -> None:
        super().__init__(ROBOT)
        settings = declare(self, simulator_settings())
        self._kind = COMMAND_TYPES[str(settings['command.type'])]
        self._is_external = settings['controller'] == EXTERNAL
        self._period_ns = round(1e9 / float(self.get_parameter('rate').value))
        self._states = self.create_publisher(JointState, 'joint_states', 10)
        self._simulated_ns, self._pauses_ns = self._now_ns, 0
        self._simulation = _simulation(settings, self._simulated_ns)
        if self._is_external:
            quality = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
            self.create_subscription(
                message_class(self._kind.name), 'command', self._obey, quality
            )
        else:
            self._commands = self.create_publisher(message_class(self._kind.name), 'command', 10)
        self.create_timer(1e-9 * self._period_ns, self._step)

    @property
    def _now_ns(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _elapse(self) -> int:
        """Return by how much the simulation lags behind the clock [ns], and count it as simulated.

        A pause of this process is left out: it shows as a gap in the stamps.
        """
        elapsed_ns = self._now_ns - self._pauses_ns - self._simulated_ns
        if elapsed_ns > _LONGEST_PAUSE_NS:
            self._pauses_ns += elapsed_ns - self._period_ns
            elapsed_ns = self._period_ns
        elapsed_ns = max(elapsed_ns, 0)
        self._simulated_ns += elapsed_ns
        return elapsed_ns

    def _step(self) -> None:
        sample = self._simulation.step(self._elapse())
        stamp_ns = sample.stamp_ns + self._pauses_ns
        if not self._is_external:
            self._commands.publish(self._command(stamp_ns, sample))
        self._states.publish(
            joint_state_message(
                new_message,
                JointSample(
                    stamp_ns, self._simulation.joint_names, sample.position, sample.velocity
                ),
            )
        )
        if not self._is_external:
            ahead_ns = int(_AHEAD * self._period_ns)
            self._simulation.advance(ahead_ns)
            self._simulated_ns += ahead_ns

    def _command(self, stamp_ns: int, sample: SimulatedSample) -> Any:
        names = self._simulation.command_joints if self._kind.has_names else None
        return self._kind.message(new_message, CommandSample(stamp_ns, sample.command, names))

    def _obey(self, message: Any) -> None:
        """Hold a command from now on, as the receiver of a real motor would."""
        joints = self._simulation.command_joints
        try:
            command = self._kind.decode(message, self._now_ns)
        except MessageError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=1.0)
            return
        given = dict(zip(command.names or joints, command.effort.tolist(), strict=False))
        effort = np.array([given.get(joint, np.nan) for joint in joints])
        if len(command.effort) != len(joints) or not np.all(np.isfinite(effort)):
            text = f'command {command.effort.tolist()}: expected one number for each of {joints}'
            self.get_logger().warning(text, throttle_duration_sec=1.0)
            return
        self._simulation.advance(self._elapse())
        self._simulation.hold(effort)


def _simulation(settings: dict[str, SettingValue], start_ns: int) -> Simulation:
    effects = settings['effects']
    assert isinstance(effects, tuple)
    return make_simulation(
        ROBOT,
        seed=int(str(settings['seed'])),
        rate_hz=float(str(settings['rate'])),
        controller=str(settings['controller']),
        effects=[str(effect) for effect in effects if effect],
        sensors=Sensors(
            resolution=(float(str(settings['encoder_resolution'])),),
            measures_velocity=bool(settings['publish_velocity']),
        ),
        start_ns=start_ns,
    )
