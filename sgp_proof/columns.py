"""Columns of models that are written by hand: one signal into the equation of one joint."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sgp_ros.physics.term import Coefficient, Motion, Term

Signal = Callable[[Motion], np.ndarray]


def single_column(coefficient: Coefficient, joint: int, signal: Signal, source: str) -> Term:
    """Return the term `coefficient * signal(u)` in the equation of one joint.

    Args:
        coefficient: name, unit and prior.
        joint: index of the joint whose equation it enters.
        signal: from a motion of n times to (n,).
        source: where the equation comes from.
    """

    def columns(motion: Motion) -> np.ndarray:
        block = np.zeros((*motion.position.shape, 1))
        block[:, joint, 0] = signal(motion)
        return block

    return Term((coefficient,), columns, source)


def position(joint: int) -> Signal:
    """Return the position of a joint [rad or m]."""
    return lambda motion: motion.position[:, joint]


def sine(joint: int) -> Signal:
    """Return the sine of the position of a revolute joint [1]."""
    return lambda motion: np.sin(motion.position[:, joint])


def velocity(joint: int) -> Signal:
    """Return the velocity of a joint [rad/s or m/s]."""
    return lambda motion: motion.velocity[:, joint]


def direction(joint: int) -> Signal:
    """Return the sign of the velocity of a joint, 0 at rest [1]."""
    return lambda motion: np.sign(motion.velocity[:, joint])


def acceleration(joint: int) -> Signal:
    """Return the acceleration of a joint [rad/s^2 or m/s^2]."""
    return lambda motion: motion.acceleration[:, joint]


def effort(joint: int) -> Signal:
    """Return the effort of a joint [N m, N or the joint's command unit]."""
    return lambda motion: motion.effort[:, joint]


def constant(motion: Motion) -> np.ndarray:
    """Return ones [1]."""
    return np.ones(len(motion.position))
