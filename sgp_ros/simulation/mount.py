"""A base that slides along one axis against a spring and a damper, and that no encoder shows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sgp_ros.physics.parts import Value

MOUNT = 'mount'
"""Name of the joint below the base."""


@dataclass(frozen=True, slots=True)
class Mount:
    """Elastic mount of the base.

    Attributes:
        axis: of the root along which it gives way: 0, 1, 2.
        frequency: of the base with all that it carries, without damping [Hz].
        damping_ratio: of this mode [1].
        moved_mass: of base and arm [kg].
    """

    axis: int
    frequency: float
    damping_ratio: float
    moved_mass: float

    @classmethod
    def of(cls, values: Mapping[str, Value]) -> Mount:
        """Return the mount that the parameters of the effect state."""
        names = ('frequency', 'damping_ratio', 'moved_mass')
        return cls('xyz'.index(str(values['axis'])), *(float(values[name]) for name in names))

    @property
    def direction(self) -> np.ndarray:
        """Unit vector of the axis, (3,)."""
        return np.asarray(np.eye(3)[self.axis])

    @property
    def stiffness(self) -> float:
        """Spring constant [N/m]."""
        return self.moved_mass * (2.0 * math.pi * self.frequency) ** 2

    @property
    def damping(self) -> float:
        """Force per speed [N s/m]."""
        return 2.0 * self.damping_ratio * math.sqrt(self.stiffness * self.moved_mass)
