"""Sizes of effects for worlds that are drawn: each effect as a function of one open size."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from sgp_ros.physics.parts import COULOMB, VISCOUS, Value

Values = Callable[[float], Mapping[str, Value]]


class UnsuitableError(Exception):
    """The robot or its motion cannot show this effect."""


class Body(Protocol):
    """A body of a drawn robot, on its joint."""

    joint: str
    parent: int
    kind: str
    limit: float
    mass: float
    inertia: np.ndarray
    axis: Sequence[float]
    tip: Sequence[float]

    @property
    def is_driven(self) -> bool:
        """Whether a motor drives it."""

    @property
    def is_prismatic(self) -> bool:
        """Whether it slides."""


@dataclass(frozen=True, slots=True, eq=False)
class PilotRun:
    """Statistics of a pilot run of the nominal robot: rms and extremes, (k,) each."""

    effort: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    spread: np.ndarray
    low: np.ndarray
    high: np.ndarray
    positions: np.ndarray


@dataclass(frozen=True, slots=True)
class Drawn:
    """Parameters of an effect whose size is still open.

    Attributes:
        size: to start from.
        values: from the size to the parameters.
        largest: greatest size.
        power: of the size, with which its share of the squared effort grows.
        index: joint it acts on, -1 for none; None for the one that was drawn.
        place: word for a place other than a joint; empty for the joint itself.
        interval: of the position it is confined to.
    """

    size: float
    values: Values
    largest: float = math.inf
    power: float = 2.0
    index: int | None = None
    place: str = ''
    interval: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A robot and its usual motion, on which an effect is drawn.

    Attributes:
        rng: of the world.
        bodies: of the robot.
        motion: that it usually makes.
        joint: index of a joint that was drawn.
        is_hard: whether the world is a hard one.
    """

    rng: np.random.Generator
    bodies: Sequence[Body]
    motion: PilotRun
    joint: int
    is_hard: bool = False

    @property
    def motors(self) -> list[int]:
        """Indices of the driven joints."""
        return [i for i, b in enumerate(self.bodies) if b.is_driven]

    def reach(self, joint: int) -> float:
        """Return the range of the motion [rad or m]."""
        return float(self.motion.high[joint] - self.motion.low[joint])

    def choice(self, joints: Sequence[int] | int) -> int:
        """Return one of some joints."""
        return int(self.rng.choice(joints))


@dataclass(slots=True)
class JointScene:
    """One joint in its usual motion, with numbers that are drawn in the same order for all laws.

    Attributes:
        scene: the whole robot.
        force, velocity, acceleration, spread: root mean squares of the joint.
        small: a third of its effort.
        reach: range of its motion.
        ratio, sign, phase, kind, periods, turns, rest, slow, presliding, seconds, mean, swaps:
            drawn.
    """

    scene: Scene
    force: float = field(init=False)
    velocity: float = field(init=False)
    acceleration: float = field(init=False)
    spread: float = field(init=False)
    small: float = field(init=False)
    reach: float = field(init=False)
    is_prismatic: bool = field(init=False)
    ratio: float = field(init=False)
    sign: float = field(init=False)
    phase: float = field(init=False)
    kind: str = field(init=False)
    periods: float = field(init=False)
    turns: float = field(init=False)
    rest: float = field(init=False)
    slow: float = field(init=False)
    presliding: float = field(init=False)
    seconds: float = field(init=False)
    mean: float = field(init=False)
    swaps: bool = field(init=False)

    def __post_init__(self) -> None:
        """Draw the numbers."""
        rng, motion, j = self.scene.rng, self.scene.motion, self.scene.joint
        self.force, self.velocity = motion.effort[j], motion.velocity[j]
        self.acceleration, self.spread = motion.acceleration[j], motion.spread[j]
        self.small, self.reach = 0.3 * self.force, motion.high[j] - motion.low[j]
        self.is_prismatic = self.scene.bodies[j].is_prismatic
        self.ratio, self.sign = rng.uniform(0.2, 0.6), rng.choice([-1.0, 1.0])
        self.phase = rng.uniform(-3.0, 3.0)
        self.kind = str(rng.choice([COULOMB, VISCOUS]))
        linear = self.is_prismatic
        self.periods = float(rng.integers(8, 40) if linear else rng.integers(3, 16))
        self.turns = float(rng.integers(2, 8) if linear else rng.integers(1, 4))
        self.rest = rng.uniform(motion.low[j], motion.high[j])
        self.slow = rng.uniform(0.1, 0.5) * self.velocity
        self.presliding = rng.uniform(0.03, 0.15) * self.reach
        self.seconds, self.mean = rng.uniform(5.0, 14.0), rng.uniform(1.5, 3.0)
        self.swaps = bool(rng.random() < 0.5)

    @property
    def unit(self) -> float:
        """Speed that a level of this kind of friction is per, 1 for dry friction."""
        return 1.0 if self.kind == COULOMB else self.velocity

    def levels(self, size: float) -> tuple[float, float]:
        """Return two levels, one of them smaller."""
        small, large = size * self.ratio, size
        return (small, large) if self.swaps else (large, small)
