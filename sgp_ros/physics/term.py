"""Physics that is linear in its coefficients, for any robot: motions, joints, terms.

A `Term` contributes columns of `f` in `X(u) = f(u) W + Z(u)` (Wu and Movellan, equation 2).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

CHANNELS = ('position', 'velocity', 'acceleration', 'effort')
"""The four quantities of a joint."""
INPUT_CHANNELS = (*CHANNELS, 'direction')
"""Inputs of Z at a joint, in the order of `Robot.inputs`."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """State, acceleration and effort of `k` joints at `n` times; each array is (n, k).

    Attributes:
        position: [rad] or [m].
        velocity: [rad/s] or [m/s].
        acceleration: [rad/s^2] or [m/s^2].
        effort: [N m], [N], or the command unit that the joint states; 0 for a passive joint.
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint and its units.

    Attributes:
        name: as in `JointState.name`.
        kind: `revolute` or `prismatic`.
        is_actuated: whether an effort acts that is measured or commanded.
        effort_unit: unit of that effort; empty for [N m] or [N] by kind.
        direction_width: speed at which its direction counts as 76 % certain [rad/s or m/s].
        effort_gain: [N m or N] per unit of the effort in a recording, such as a current; what
            the physics sees is the recorded effort times this.
        lower: least position [rad or m], -inf where none is known.
        upper: greatest position [rad or m], inf where none is known.
        velocity_limit: [rad/s or m/s], inf where none is known.
        effort_limit: [N m or N], inf where none is known.
    """

    name: str
    kind: str = 'revolute'
    is_actuated: bool = True
    effort_unit: str = ''
    direction_width: float = 0.02
    effort_gain: float = 1.0
    lower: float = -math.inf
    upper: float = math.inf
    velocity_limit: float = math.inf
    effort_limit: float = math.inf

    def unit(self, channel: str) -> str:
        """Return the unit of one of `INPUT_CHANNELS`."""
        length = 'rad' if self.kind == 'revolute' else 'm'
        if channel == 'effort':
            return self.effort_unit or ('N m' if self.kind == 'revolute' else 'N')
        return {
            'position': length, 'velocity': f'{length}/s', 'acceleration': f'{length}/s^2',
            'direction': '1',
        }[channel]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Coefficient:
    """One element of W.

    Attributes:
        name: unique in the robot.
        unit: of the coefficient.
        joint: the joint it belongs to, None where it belongs to several.
        prior_mean: mean of its prior [unit].
        prior_std: standard deviation of its prior [unit]; infinite knows nothing.
        low: least value that exists [unit]: no armature and no friction is negative.
        meaning: what it is, in a few words; empty where the name says it.
    """

    name: str
    unit: str
    joint: str | None = None
    prior_mean: float = 0.0
    prior_std: float = math.inf
    low: float = -math.inf
    meaning: str = ''


@dataclass(frozen=True, slots=True)
class Term:
    """One piece of physics: `m` columns of the regressor with their coefficients.

    Attributes:
        coefficients: m of them.
        columns: from a `Motion` of n times to (n, k, m). Acceleration and effort may enter only
            affinely: the filter relies on it.
        source: where the equation comes from.
    """

    coefficients: tuple[Coefficient, ...]
    columns: Callable[[Motion], np.ndarray]
    source: str
