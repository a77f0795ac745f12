"""Whole recordings of a simulation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.simulation.stepping import Simulation


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedRecording:
    """n samples of k joints with m commands; all arrays are read-only.

    Attributes:
        joint_names: k of them.
        command_joints: m of them.
        stamps_ns: (n,) int64, time of the states [ns].
        position: (n, k) measured [rad or m].
        velocity: (n, k) measured [rad/s or m/s]; None when it is not.
        command_stamps_ns: (n,) int64, time from which each command holds [ns].
        command: (n, m) [unit of the command].
        true_position: (n, k) [rad or m].
        true_velocity: (n, k) [rad/s or m/s].
        true_acceleration: (n, k) of the encoders, without the noise of the surroundings
            [rad/s^2 or m/s^2].
        shown_position: (n, k) of the encoders before noise and quantisation [rad or m].
        shown_velocity: (n, k) of the encoders before noise [rad/s or m/s].
        effort: (n, k) measured [N m or N]; None when it is not.
        truth: what is true of the simulation, in a form that JSON can hold.
    """

    joint_names: tuple[str, ...]
    command_joints: tuple[str, ...]
    stamps_ns: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None
    command_stamps_ns: np.ndarray
    command: np.ndarray
    true_position: np.ndarray
    true_velocity: np.ndarray
    true_acceleration: np.ndarray
    shown_position: np.ndarray
    shown_velocity: np.ndarray
    effort: np.ndarray | None
    truth: dict[str, object]


def simulate(
    simulation: Simulation,
    duration_s: float,
    progress: Callable[[float], None] | None = None,
) -> SimulatedRecording:
    """Step a simulation from where it stands and collect the samples.

    Args:
        simulation: as `make_simulation` returns it; it moves on.
        duration_s: length of the recording, `duration_s * rate` samples of it [s].
        progress: called after each sample with the share that is done.

    Raises:
        ConfigError: a duration without a sample.
    """
    count = _count(duration_s, simulation.scenario.period_ns)
    samples = []
    for i in range(count):
        samples.append(simulation.step())
        if progress is not None:
            progress((i + 1) / count)
    velocities = [s.velocity for s in samples if s.velocity is not None]
    efforts = [s.effort for s in samples if s.effort is not None]
    return SimulatedRecording(
        simulation.joint_names,
        simulation.command_joints,
        _frozen([s.stamp_ns for s in samples]),
        _frozen([s.position for s in samples]),
        _frozen(velocities) if velocities else None,
        _frozen([s.command_stamp_ns for s in samples]),
        _frozen([s.command for s in samples]),
        _frozen([s.true_position for s in samples]),
        _frozen([s.true_velocity for s in samples]),
        _frozen([s.true_acceleration for s in samples]),
        _frozen([s.shown_position for s in samples]),
        _frozen([s.shown_velocity for s in samples]),
        _frozen(efforts) if efforts else None,
        simulation.truth(),
    )


def _count(duration_s: float, period_ns: int) -> int:
    count = round(duration_s * 1e9 / period_ns) if math.isfinite(duration_s) else 0
    if count < 1:
        raise ConfigError(
            f'duration {duration_s:g} s', f'a finite one of at least {1e-9 * period_ns:g} s'
        )
    return count


def _frozen(values: list[int] | list[np.ndarray]) -> np.ndarray:
    array = np.array(values)
    array.setflags(write=False)
    return array
