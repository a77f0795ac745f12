"""The efforts that drives make of position targets, where these are what is commanded."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sgp_ros.physics.drive import lagged
from sgp_ros.physics.motion import RecordedCommands
from sgp_ros.physics.ripple import Ripple

_MOST_KEPT = 4_000_000
"""Numbers that a drive remembers of its efforts behind delays; each is asked for many times."""


@dataclass(frozen=True, slots=True, eq=False)
class Servo:
    """A drive that holds position targets: `tau = kp (q_des - q) + kd (dq_des - dq) + tau_ff`.

    It is computed in the drive on its own fresh measurements, so a delay is one of the targets.

    Attributes:
        targets: positions, then velocities, of all joints, (c, 2 k) [rad or m]; with recorded
            gains these behind them, (c, 4 k) [N m/rad, N m s/rad].
        step: of the grids [s].
        starts: rows at which the grids begin.
        kp, kd: (k,) gains [N m/rad, N m s/rad], or factors of recorded ones [1].
        position, velocity: (n, k) on the grids.
        feedforward: (n, k) [N m or N].
        is_recorded: whether the gains come with the targets.
        ripple: that the samples show of targets held between them; None for none.
    """

    targets: RecordedCommands
    step: float
    starts: tuple[int, ...]
    kp: np.ndarray
    kd: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    feedforward: np.ndarray
    is_recorded: bool = False
    ripple: Ripple | None = None
    _parts: dict[tuple[int, float], tuple[np.ndarray, np.ndarray]] = field(
        default_factory=dict, init=False
    )

    @property
    def values(self) -> np.ndarray:
        """Efforts on the grids, (n, k) [N m or N]."""
        return np.column_stack([self.effort(j) for j in range(len(self.kp))])

    def effort(
        self, joint: int, *, delay: float = 0.0, time_constant: float = 0.0,
        characteristic: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Return the effort of one joint on the grids, as `Drive.effort`."""
        proportional, damping = self.parts(joint, delay)
        u = proportional + damping + self.feedforward[:, joint]
        if characteristic is not None:
            u = characteristic(u)
        if time_constant <= 0.0:
            return u
        parts = [lagged(self.step * np.arange(len(x)), x, time_constant)
                 for x in np.split(u, self.starts[1:])]  # fmt: skip
        return np.concatenate(parts)

    def changed(self, change: Callable[[np.ndarray], np.ndarray], later: float) -> Servo:
        """Return the drive with other targets, some time later [s]."""
        return replace(self, targets=self.targets.changed(change, later))

    @property
    def rows(self) -> int:
        """Number n of points of all grids."""
        return len(self.position)

    def on(self, stretches: Sequence[slice]) -> Servo:
        """Return the drive on some stretches of the rows, see `Drive.on`."""
        pick = np.concatenate([np.arange(s.start, s.stop) for s in stretches])
        ends = np.cumsum([s.stop - s.start for s in stretches])
        return replace(
            self, targets=self.targets.on(stretches), starts=(0, *map(int, ends[:-1])),
            position=self.position[pick], velocity=self.velocity[pick],
            feedforward=self.feedforward[pick],
            ripple=None if self.ripple is None else self.ripple.on(pick),
        )  # fmt: skip

    def parts(self, joint: int, delay: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Return what kp and kd make of one joint, (n,) each [N m or N]."""
        key = joint, float(delay)
        if key not in self._parts:
            while self._parts and 2 * len(self._parts) * len(self.position) > _MOST_KEPT:
                self._parts.pop(next(iter(self._parts)))
            self._parts[key] = self._made(joint, delay)
        return self._parts[key]

    def _made(self, joint: int, delay: float) -> tuple[np.ndarray, np.ndarray]:
        k = len(self.kp)
        error = self.targets.effort(joint, delay=delay) - self.position[:, joint]
        rate = self.targets.effort(k + joint, delay=delay) - self.velocity[:, joint]
        if self.ripple is not None:
            shown = self.ripple.at(joint, delay)
            error, rate = error + shown, rate + self._slope(shown)
        kp, kd = self.kp[joint], self.kd[joint]
        if self.is_recorded:
            kp = kp * self.targets.effort(2 * k + joint, delay=delay)
            kd = kd * self.targets.effort(3 * k + joint, delay=delay)
        return servo_parts(kp, kd, error, rate)

    def _slope(self, x: np.ndarray) -> np.ndarray:
        """Return the derivative of x (n,) on the grids."""
        parts = [np.gradient(part, self.step) if len(part) > 1 else np.zeros(len(part))
                 for part in np.split(x, self.starts[1:])]  # fmt: skip
        return np.concatenate(parts)


def servo_parts(
    kp: np.ndarray, kd: np.ndarray, error: np.ndarray, rate: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return what the gains of a drive make of an error and of its rate [N m or N]."""
    return kp * error, kd * rate
