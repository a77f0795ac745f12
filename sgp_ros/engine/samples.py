"""The stamped values that enter the engine.

Live and replay differ only in who makes these values. A stamp is an integer number of nanoseconds;
an array is float64 and read-only. Nothing here knows of messages, files or clocks.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

EFFORT, POSITION, VELOCITY = 'effort', 'position', 'velocity'
"""Quantities that a command can ask for."""

SettingValue = bool | int | float | str | tuple[float, ...] | tuple[str, ...]


def frozen_array(values: Iterable[float]) -> np.ndarray:
    """Return a read-only float64 copy of `values`, shape (m,)."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


@dataclass(frozen=True, slots=True, eq=False)
class JointSample:
    """State of some joints at one time, in any order.

    Attributes:
        stamp_ns: time of the state (header stamp) [ns].
        names: joint names, m of them.
        position: (m,) [rad] or [m].
        velocity: (m,) [rad/s] or [m/s]; None when the source has none. NaN marks a single
            missing interface.
        effort: (m,) [N m] or [N]; None when the source has none.
    """

    stamp_ns: int
    names: tuple[str, ...]
    position: np.ndarray
    velocity: np.ndarray | None = None
    effort: np.ndarray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class CommandSample:
    """A command that holds until the next one.

    Attributes:
        stamp_ns: time from which it holds [ns]: the header stamp, or the time of receipt.
        effort: (m,) commanded effort [N m], [N] or the unit the robot's description states.
        names: the joints the numbers belong to; None for an array without names, whose order is
            the setting `command.joints`.
        kind: what the numbers are, `EFFORT`, `POSITION` or `VELOCITY`; numbers without names may
            be any.
        velocity: (m,) target of the velocity beside one of the position; None without.
        gains: recorded kp and kd of drives that follow it, by joint; None where they are constant.
    """

    stamp_ns: int
    effort: np.ndarray
    names: tuple[str, ...] | None = None
    kind: str = EFFORT
    velocity: np.ndarray | None = None
    gains: Mapping[str, tuple[float, float]] | None = None


@dataclass(frozen=True, slots=True)
class SettingsChange:
    """New values of settings, in force from the first sample after `stamp_ns`.

    A live parameter change and the result of a hyper-parameter fit are both written like this, so
    that a replay applies them between the same two samples.
    """

    stamp_ns: int
    settings: Mapping[str, SettingValue]


@dataclass(frozen=True, slots=True)
class Reset:
    """Forget everything that was learned, keep the settings."""

    stamp_ns: int


Event = JointSample | CommandSample | SettingsChange | Reset
