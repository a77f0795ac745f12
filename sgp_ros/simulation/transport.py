"""Transport of measurements and commands into a recording.

Stamps have noise, logs are late, messages get lost, joints stand in another order. A message is
dated by its stamp. A command without a header has no other time than that of its log, so that one
is exact: the time from which the command holds.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.simulation.recording import SimulatedRecording


@dataclass(frozen=True, slots=True)
class Transport:
    """The way from the sensors to the file.

    Attributes:
        stamp_noise_s: standard deviation of the stamps of states [s].
        log_latency_s: logs of messages with a header are late by up to this much, uniformly [s].
        drop: share of the messages that are lost.
        is_permuted: whether the joints of a state stand in a random order.
        has_named_commands: whether commands name their joints, in a random order, with a stamp.
    """

    stamp_noise_s: float = 0.0
    log_latency_s: float = 0.0
    drop: float = 0.0
    is_permuted: bool = False
    has_named_commands: bool = False

    def checked(self) -> Transport:
        """Return this transport if its numbers make sense.

        Raises:
            ConfigError: negative or infinite times, a share outside 0 to 1.
        """
        times = (self.stamp_noise_s, self.log_latency_s)
        if not all(0.0 <= x < math.inf for x in times) or not 0.0 <= self.drop < 1.0:
            raise ConfigError(
                f'transport {asdict(self)}', 'times of at least 0 s, a dropped share below 1'
            )
        return self


@dataclass(frozen=True, slots=True, eq=False)
class DeliveredState:
    """A state as it was logged.

    Attributes:
        log_ns: time of the log [ns].
        stamp_ns: time in the header [ns].
        names: of the joints.
        position: (k,) [rad or m].
        velocity: (k,) [rad/s or m/s]; None when it is not measured.
        effort: (k,) [N m or N]; None when it is not measured.
    """

    log_ns: int
    stamp_ns: int
    names: tuple[str, ...]
    position: np.ndarray
    velocity: np.ndarray | None
    effort: np.ndarray | None


@dataclass(frozen=True, slots=True, eq=False)
class DeliveredCommand:
    """A command as it was logged.

    Attributes:
        log_ns: time of the log [ns].
        stamp_ns: time from which it holds [ns].
        names: of the joints; None for an array in the order of the command joints.
        effort: (m,) [unit of the command].
    """

    log_ns: int
    stamp_ns: int
    names: tuple[str, ...] | None
    effort: np.ndarray


def deliver(
    recording: SimulatedRecording, transport: Transport, seed: int = 0
) -> list[DeliveredState | DeliveredCommand]:
    """Return what arrives of a recording, in the order of the logs.

    Args:
        recording: of a simulation.
        transport: what happens on the way.
        seed: of the noise.
    """
    rng = np.random.default_rng([seed, 1])
    order, shuffled = np.arange(len(recording.joint_names)), None
    if transport.is_permuted:
        order = rng.permutation(order)
    if transport.has_named_commands:
        shuffled = rng.permutation(len(recording.command_joints))
    n = len(recording.stamps_ns)
    noise = np.round(1e9 * transport.stamp_noise_s * rng.normal(size=n)).astype(np.int64)
    late = np.round(1e9 * transport.log_latency_s * rng.random((2, n))).astype(np.int64)
    kept = rng.random((2, n)) >= transport.drop
    messages: list[DeliveredState | DeliveredCommand] = []
    for i in range(n):
        if kept[0, i]:
            messages.append(_state(recording, order, i, noise[i], late[0, i]))
        if kept[1, i] and recording.command_joints:
            messages.append(_command(recording, shuffled, i, late[1, i]))
    return sorted(messages, key=lambda m: (m.log_ns, isinstance(m, DeliveredState)))


def _state(
    recording: SimulatedRecording, order: np.ndarray, i: int, noise: int, late: int
) -> DeliveredState:
    stamp_ns = int(recording.stamps_ns[i] + noise)
    return DeliveredState(
        stamp_ns + int(late),
        stamp_ns,
        tuple(recording.joint_names[j] for j in order),
        recording.position[i][order],
        None if recording.velocity is None else recording.velocity[i][order],
        None if recording.effort is None else recording.effort[i][order],
    )


def _command(
    recording: SimulatedRecording, shuffled: np.ndarray | None, i: int, late: int
) -> DeliveredCommand:
    given_ns = int(recording.command_stamps_ns[i])
    if shuffled is None:
        return DeliveredCommand(given_ns, given_ns, None, recording.command[i])
    names = tuple(recording.command_joints[j] for j in shuffled)
    return DeliveredCommand(given_ns + int(late), given_ns, names, recording.command[i][shuffled])
