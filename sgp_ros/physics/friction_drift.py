"""Friction that changes with time."""

from __future__ import annotations

import math

import numpy as np

from sgp_ros.physics.drawing import Drawn, JointScene
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.friction import KINDS, rubbing
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import Quantity, Value, relative_scales
from sgp_ros.physics.place import Place, Placed

WARM_S, WARM_SPREAD = 10.0, 0.7
"""Time constant below which a warm-up is unlikely [s], spread of its logarithm [1]. Convention."""


class FrictionDrift(Effect):
    """Friction that changes from the beginning of a recording on, as it warms up."""

    name = 'friction_drift'
    words = 'friction that drifts with time'
    formula = 'level(t) = end + (start - end) exp(-t / time_constant)'
    source = 'Simoni, Beschi, Legnani, Visioli 2015'
    appearance = 'friction differs between the start and the end of a recording'
    quantities = (
        Quantity('start', 'N m', low=0.0),
        Quantity('end', 'N m', low=0.0),
        Quantity('time_constant', 's', low=1e-3, is_positive=True),
    )
    plain = ('coulomb_friction', 'viscous_friction')
    linear = ('end', 'start')
    kinds = KINDS
    drawn_over = 'time'
    is_dry = True
    is_online = False

    def places(self, motion: SeenMotion) -> list[Place]:
        """Return the joints; none of a free swing, whose size tells the time as it decays."""
        is_driven = motion.tree.is_actuated[: motion.tree.size].any()
        return super().places(motion) if is_driven else []

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return friction that comes, and friction that goes."""
        fade = np.exp(-motion.time / shape[0])
        x = rubbing(motion, place)
        return -np.column_stack([(1.0 - fade) * x, fade * x])

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether it never drives."""
        c = at.coefficients
        return bool(np.all(c > -0.1 * np.max(np.abs(c))) and np.max(c) > 0.0)

    def surprise(self, at: Placed) -> float:
        """Return the price of a fast drift: grease and seals warm up in tens of seconds."""
        return 0.5 * (min(math.log(float(at.shape[0]) / WARM_S), 0.0) / WARM_SPREAD) ** 2

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return shares of the duration."""
        return np.asarray(motion.time.max() * np.array([0.01, 0.04, 0.1, 0.25, 0.6])[:, None])

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return a hundredth of the duration, and twice all of it.

        A faster one is a transient at the start, a slower one a straight line over time.
        """
        return self.starts(motion, place)[0], np.array([2.0 * float(motion.time.max())])

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return relative_scales(*self.bounds(motion, place), shape)

    def sized(self, x: JointScene) -> Drawn:
        def values(s: float) -> dict[str, Value]:
            start, end = x.levels(s)
            return {'start': start, 'end': end, 'time_constant': x.seconds, 'kind': x.kind}

        return Drawn(x.small / x.unit, values)
