"""The simulation of a law of a force on the tool that a formula states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from sgp_ros.physics.formula import Formula
from sgp_ros.physics.parts import Value
from sgp_ros.physics.tool_law import ANCHOR, ATTACHED, AXES, DISTANCE, ToolLaw


@dataclass(frozen=True, slots=True, eq=False)
class ToolPull:
    """Force on a point of the last link, along the axes of the root.

    Attributes:
        path: along which it acts.
        formula: of it.
        numbers: of the formula and of the points.
        at: (3,) the point of the link, in its frame [m].
    """

    path: str
    formula: Formula
    numbers: Mapping[str, float]
    at: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        """Keep the point as an array."""
        object.__setattr__(self, 'at', np.array([self.numbers[n] for n in ATTACHED]))

    @classmethod
    def of(cls, law: ToolLaw, values: Mapping[str, Value]) -> ToolPull:
        """Return that of a law with its numbers."""
        numbers = {**law.known, **values}
        return cls(law.path, law.law, {n: float(x) for n, x in numbers.items()})

    def force(self, place: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the force where its point is and moves, (3,) [N]."""
        if self.path in AXES:
            i = AXES.index(self.path)
            return self._size(place[i], velocity[i], place) * np.eye(3)[i]
        to = place - [self.numbers[n] for n in ANCHOR] if self.path == DISTANCE else velocity
        size = float(np.linalg.norm(to))
        if size == 0.0:
            return np.zeros(3)
        rate = float(to @ velocity) / size
        return self._size(size, rate, place) * to / size

    def _size(self, way: float, rate: float, place: np.ndarray) -> float:
        seen = {'s': way, 'ds': rate} | dict(zip(AXES, place.tolist(), strict=True))
        return self.formula.value({**self.numbers, **seen})
