"""Drives in series: what a command passes on its way to the torque of a motor.

A delay, a dead zone, a limit, a lag, a torque that falls with speed and a gain stand one behind
the other. Each is the change of the effort that reaches it, so that the sum of all changes and the
command is the torque behind all of them: with a delay D and a limit C in front of a motor,
`(D u - u) + (C(D u) - D u) = C(D u) - u`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sgp_ros.physics.motion import Commands, SeenMotion


class Stage(Protocol):
    """A drive at a place, as the drives behind it see it."""

    @property
    def delay(self) -> float:
        """Time by which it delays its command [s]."""

    @property
    def characteristic(self) -> Callable[[np.ndarray], np.ndarray] | None:
        """From commands to what it gives at the same time; None for no change."""

    @property
    def coefficients(self) -> np.ndarray:
        """Of its columns, (1,); empty of a candidate, whose coefficient is 1."""

    def columns(self, motion: SeenMotion) -> np.ndarray:
        """Return what it changes per coefficient, (n, 1) of one motor or (n, k, 1)."""


@dataclass(frozen=True, slots=True, eq=False)
class InSeries:
    """Commands behind drives of one motor.

    Attributes:
        commands: in front of them.
        joint: index of the motor.
        stages: the drives, from the first.
    """

    commands: Commands
    joint: int
    stages: tuple[Stage, ...]

    @property
    def values(self) -> np.ndarray:
        """Commands in front of the drives, (c, k) [N m or N]."""
        return self.commands.values

    def effort(
        self, joint: int, *, delay: float = 0.0, time_constant: float = 0.0,
        characteristic: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Return the effort of a joint, (n,), see `Commands`."""
        if joint != self.joint:
            return self.commands.effort(
                joint, delay=delay, time_constant=time_constant, characteristic=characteristic
            )
        given = [s.characteristic for s in self.stages] + [characteristic]
        found = [f for f in given if f is not None]

        def passed(u: np.ndarray) -> np.ndarray:
            for f in found:
                u = f(u)
            return u

        return self.commands.effort(
            joint, delay=delay + sum(s.delay for s in self.stages), time_constant=time_constant,
            characteristic=passed if found else None,
        )  # fmt: skip


def behind(motion: SeenMotion, joint: int, stages: Sequence[Stage]) -> SeenMotion:
    """Return a motion as a drive of a joint sees it that stands behind others, from the first."""
    if not stages or motion.drive is None:
        return motion
    effort = motion.effort.copy()
    for s in stages:
        change = s.columns(motion)[..., 0] * (s.coefficients[0] if len(s.coefficients) else 1.0)
        effort[:, joint] += change if change.ndim == 1 else change[:, joint]
    return motion.driven(effort, InSeries(motion.drive, joint, tuple(stages)))
