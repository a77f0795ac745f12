"""Parameters that a robot can show, beside those that a recording showed.

Some directions of the parameters never reach a torque: the rank over random motions tells. Others
would, had this recording moved the right joint in the right pose: see `suggestions`.
Where nothing moves, or no effort does, nothing can be identified: see `require_motion`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sgp_ros.batch.signals import Signals
from sgp_ros.errors import RecordingError
from sgp_ros.physics.term import Joint, Motion
from sgp_ros.rigid.base_parameters import BaseParameters, RegressorFactor
from sgp_ros.robots.robot import Robot

_NOISE = 0.5
"""Correlation from state to state below which a position is noise around one place: motion that
is sampled often enough to be differentiated has nearly 1, white noise 0."""


def require_motion(signals: Signals, robot: Robot) -> None:
    """Refuse a recording of a robot that stands still or has no effort. O(n k).

    A joint at rest beside others that move is not a reason; an effort that is one number
    throughout is, where it is what f(u) W predicts: its joint is not measured.

    Args:
        signals: of the recording.
        robot: whose joints they are.

    Raises:
        RecordingError: no joint moves, or the effort of an actuated joint never changes.
    """
    names = list(robot.joint_names)
    if not any(_moves(q) for q in signals.position.T):
        raise RecordingError(
            f'none of the joints {names} moves more than noise',
            'a robot in motion',
            'record the robot while it moves',
        )
    if robot.target != 'effort':
        return
    actuated = [j for j, joint in enumerate(robot.joints) if joint.is_actuated]
    constant = [names[j] for j in actuated if not np.ptp(signals.effort[:, j])]
    if constant or not actuated:
        raise RecordingError(
            f'the effort of {constant or names} is constant',
            'measured or commanded efforts of the joints that are identified',
            'record them, or lock these joints in the robot file',
        )


def _moves(q: np.ndarray) -> bool:
    centred = q - q.mean()
    power = float(centred @ centred)
    return bool(np.ptp(q) > 0.0) and float(centred[1:] @ centred[:-1]) > _NOISE * power


IDENTIFIABLE, NOT_EXCITED, STRUCTURAL = 'identifiable', 'not_excited', 'structural'
"""A parameter by itself: known from this motion; from another one; only in combinations."""


@dataclass(frozen=True, slots=True)
class JointRange:
    """Limits of the motion of a joint; metres in place of radians for a prismatic one.

    Attributes:
        lower: least position [rad].
        upper: largest position [rad].
        velocity: largest speed [rad/s].
        acceleration: largest acceleration [rad/s^2].
    """

    lower: float = -np.pi
    upper: float = np.pi
    velocity: float = 2.0
    acceleration: float = 5.0

    @classmethod
    def of(cls, joint: Joint) -> JointRange:
        """Return the range that a joint's file states; what it leaves open turns once around.

        Limits that leave no room, such as zeros of a file that states none, are taken for open.
        """
        lower = joint.lower if math.isfinite(joint.lower) else min(-np.pi, joint.upper - np.pi)
        upper = joint.upper if math.isfinite(joint.upper) else max(np.pi, lower + np.pi)
        if not lower < upper:
            lower, upper = -np.pi, np.pi
        speed = joint.velocity_limit if joint.velocity_limit > 0.0 else math.inf
        return cls(lower, upper, min(cls().velocity, speed))


def joint_ranges(
    robot: Robot, ranges: Mapping[str, JointRange] | None = None
) -> dict[str, JointRange]:
    """Return the range of each joint: the given one, else what the robot's file states."""
    return {
        joint.name: (ranges or {}).get(joint.name, JointRange.of(joint)) for joint in robot.joints
    }


@dataclass(frozen=True, slots=True, eq=False)
class Excitation:
    """A recording beside what the robot can show.

    Attributes:
        structural: base parameters over random motions.
        excited: base parameters of the recording.
        status: per parameter `identifiable`, `not_excited` or `structural`.
        unexcited: structural base parameters that the recording does not determine, in words.
    """

    structural: BaseParameters
    excited: BaseParameters
    status: tuple[str, ...]
    unexcited: tuple[str, ...]

    @property
    def missing(self) -> int:
        """Number of directions that another motion would show."""
        return self.structural.rank - self.excited.rank


def structural_base(
    robot: Robot,
    rng: np.random.Generator,
    samples: int | None = None,
    ranges: Mapping[str, JointRange] | None = None,
) -> BaseParameters:
    """Return the base parameters that some motion of the robot determines.

    Positions, velocities, accelerations and efforts are drawn independently, so that the rank is
    the largest possible, with probability one.

    Args:
        robot: any.
        rng: of the random motion.
        samples: number of states; None takes four times as many rows as parameters.
        ranges: by joint; what is missing is that of the robot's file.
    """
    k, p = len(robot.joints), len(robot.coefficients)
    n = samples or 8 + -(-4 * p // k)
    limits = joint_ranges(robot, ranges).values()
    lower, upper, speed, push = np.array(
        [(x.lower, x.upper, x.velocity, x.acceleration) for x in limits]
    ).T
    q = rng.uniform(lower, upper, size=(n, k))
    signed = rng.uniform(-1.0, 1.0, size=(3, n, k))
    motion = Motion(q, signed[0] * speed, signed[1] * push, signed[2])
    factor = RegressorFactor.nothing(p).with_rows(robot.regressor(motion))
    return factor.base_parameters([c.name for c in robot.coefficients])


def judge_excitation(structural: BaseParameters, recorded: RegressorFactor) -> Excitation:
    """Return what a recording shows beside what the robot can show.

    Args:
        structural: of `structural_base`.
        recorded: factor of the recording's regressor, in the same order of parameters.
    """
    excited = recorded.base_parameters(structural.names)
    status = tuple(
        IDENTIFIABLE if seen else NOT_EXCITED if possible else STRUCTURAL
        for seen, possible in zip(excited.identifiable, structural.identifiable, strict=True)
    )
    shown = excited.determines(structural.combinations)
    unexcited = tuple(
        t for t, is_shown in zip(structural.texts, shown, strict=True) if not is_shown
    )
    return Excitation(structural, excited, status, unexcited)
