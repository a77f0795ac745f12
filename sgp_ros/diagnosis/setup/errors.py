"""Errors of how a robot was connected: the name of each, and the correction that undoes it.

An entry proposes its hypotheses for a robot: numbers to start from, and how numbers become a
correction on top of another. Names, parameters and signs are those of the schema.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product

import numpy as np

from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.physics.catalogue import COMMAND_DELAY
from sgp_ros.physics.servo import Servo
from sgp_ros.robots.observed_motion import ObservedMotion

BASE, ALL = 'base', 'all'
_FACTORS = ('scale', 'kp', 'kd')
CHANNELS = {'position': (True, False), 'effort': (False, True), 'all': (True, True)}
"""Whether an error is one of the positions, and one of the efforts."""

DEGREES = 180.0 / math.pi
_SCALES = (0.01, 0.1, 0.3, 0.6, 0.9, 1.1, 1.6, 3.0, 10.0, 100.0)
_UNITS = (1e-3, 1.0 / 9.80665, 100.0 / 9.80665, 1e3)
"""Recorded per SI unit of force: k, kgf, kgf cm, m."""
_ANGLES = (-2.4, -1.6, -0.8, -0.2, -0.03, 0.03, 0.2, 0.8, 1.6, 2.4)
_CLOCKS = (-0.3, -0.1, -0.03, -0.008, 0.008, 0.03, 0.1, 0.3)
_DELAYS = np.geomspace(0.002, 0.12, 24)
_TURNS = (-0.1, 0.1, 0.5 * math.pi, -0.5 * math.pi, math.pi)

EFFORT_SCALE, ORIENTATION = 'effort_scale', 'base_orientation'
_REMEDIES = {
    'encoder_offset': 'Re-zero {joint}, or subtract {offset:.4g} from its positions.',
    'position_scale': 'Divide the positions of {joint} by {scale:.5g}: check unit and gear ratio.',
    'joint_sign': 'Reverse the sign of {joint} ({channels}).',
    'swapped_joints': 'Exchange {joint} and {other_joint} ({channels}).',
    EFFORT_SCALE: 'Divide the efforts of {joint} by {scale:.4g}: check unit, gear ratio and '
    'torque constant.',
    'clock_offset': 'Stamp the efforts or commands {offset:.4g} s earlier.',
    ORIENTATION: 'State how the base is mounted: roll {roll:.3g}, pitch {pitch:.3g} rad.',
    'joint_origin': 'Move the origin of {joint} by ({x:.4g}, {y:.4g}, {z:.4g}) m.',
    'gain_scale': 'Correct the gains of {joint}: its drive has {kp:.3g} times the stated kp and '
    '{kd:.3g} times the stated kd.',
}


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One error at one place.

    Attributes:
        effect: name in the schema.
        joint: name, `base` or `all`.
        names: of its numbers.
        units: of its numbers.
        starts: (s, m) numbers to start from; m = 0 where there is nothing to estimate.
        steps: (m,) first steps of a search [units]; of scales and delays relative to these.
        applied: returns a correction with the error of these numbers (m,) undone too.
        words: parameters that are words.
        is_possible: whether it can have these numbers (m,).
        canonical: returns the one of several equal sets of numbers (m,) that is reported.
        is_physics: whether it is physics, which hides errors of the connection while present.
        exact: numbers of one parameter that come from a mistaken unit, not from a measurement.
        least: size of one number below which it is how signals are sampled, and no error.
    """

    effect: str
    joint: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    starts: np.ndarray
    steps: np.ndarray
    applied: Callable[[Correction, np.ndarray], Correction]
    words: Mapping[str, str] = field(default_factory=dict)
    is_possible: Callable[[np.ndarray], bool] = lambda _: True
    canonical: Callable[[np.ndarray], np.ndarray] = lambda x: x
    is_physics: bool = False
    exact: tuple[float, ...] = ()
    least: float = 0.0

    def remedy(self, values: Mapping[str, float]) -> str:
        """Return what to do about the error of these numbers, a sentence."""
        joint = 'all joints' if self.joint == ALL else self.joint
        return _REMEDIES[self.effect].format(joint=joint, **values, **self.words)

    @property
    def neutral(self) -> np.ndarray:
        """Numbers of no error, (m,)."""
        return np.array([1.0 if name in _FACTORS else 0.0 for name in self.names])

    @property
    def is_of_gains(self) -> bool:
        """Whether its numbers are factors of the gains of a drive."""
        return 'kp' in self.names

    def steps_at(self, x: np.ndarray) -> np.ndarray:
        """Return first steps of a search from numbers (m,); of factors and delays relative."""
        return self.steps * np.abs(x) if 'scale' in self.names or self.is_physics else self.steps

    @property
    def key(self) -> tuple[str, str, tuple[str, ...]]:
        """Assertion without its numbers."""
        return self.effect, self.joint, tuple(self.words.values())


def hypotheses(motion: ObservedMotion) -> list[Hypothesis]:
    """Return the errors that a recording of a robot may have."""
    tree = motion.tree
    joints = [int(j) for j in range(tree.size) if motion.moves[j]]
    found: list[Hypothesis] = []
    for j in joints:
        found += _of_joint(motion, j)
    for i, j in combinations(joints, 2):
        found += _swaps(motion, i, j)
    driven = [j for j in joints if tree.is_actuated[j]]
    if len(driven) > 1 and not isinstance(motion.drive, Servo):
        found.append(_effort_scale(driven, ALL))
    if driven:
        found.append(_clock(motion.step, has_commands=motion.drive is not None))
    if isinstance(motion.drive, Servo):
        found.append(_late_targets())
    turning = [j for j in joints if not tree.is_prismatic[j]]
    if len(turning) > 1:
        found.append(_position_scale(turning, ALL, (DEGREES, 1.0 / DEGREES)))
    if np.linalg.norm(tree.gravity) > 0.0:
        found.append(_orientation())
    return found


def _of_joint(motion: ObservedMotion, j: int) -> Iterator[Hypothesis]:
    tree = motion.tree
    name, slides = tree.joint_names[j], bool(tree.is_prismatic[j])
    size = float(np.ptp(motion.position[:, j])) if slides else 1.0
    unit = 'm' if slides else 'rad'
    yield Hypothesis(
        'encoder_offset', name, ('offset',), (unit,), _column(np.array(_ANGLES) * size),
        np.array([0.02 * size]),
        lambda c, x: replace(c, offset=_at(c.offset, j, c.offset[j] + x[0] * c.scale[j])),
    )  # fmt: skip
    special = (1e3, 1e-3) if slides else (DEGREES, 1.0 / DEGREES)
    yield _position_scale([j], name, (*_SCALES, *special))
    for channels, (moves, acts) in _channels(motion):
        if acts and not tree.is_actuated[j]:
            continue
        yield _discrete('joint_sign', name, _sign(j, moves, acts), {'channels': channels})
    if tree.is_actuated[j]:
        yield _gain_scale(j, name) if isinstance(motion.drive, Servo) else _effort_scale([j], name)
    if tree.parents[j] >= 0:
        reach = max(float(np.linalg.norm(tree.translations[: tree.size], axis=1).max()), 0.01)
        yield Hypothesis(
            'joint_origin', name, ('x', 'y', 'z'), ('m', 'm', 'm'), np.zeros((1, 3)),
            np.full(3, 0.03 * reach),
            lambda c, x: replace(c, origins=_moved(c.origins, tree.size, j, x)),
        )  # fmt: skip


def _channels(motion: ObservedMotion) -> list[tuple[str, tuple[bool, bool]]]:
    """Return the channels that may be wrong together.

    A drive that holds a target by a position of the wrong sign, or of another joint, runs away.
    """
    is_closed = isinstance(motion.drive, Servo)
    return [(name, both) for name, both in CHANNELS.items() if all(both) or not is_closed]


def _position_scale(joints: Sequence[int], name: str, starts: Sequence[float]) -> Hypothesis:
    return Hypothesis(
        'position_scale', name, ('scale',), ('1',), _column(np.array(starts)), np.array([0.02]),
        lambda c, x: replace(c, scale=_times(c.scale, joints, x[0])), is_possible=_is_positive,
        exact=(1e-3, 1e3, DEGREES, 1.0 / DEGREES),
    )  # fmt: skip


def _effort_scale(joints: Sequence[int], name: str) -> Hypothesis:
    return Hypothesis(
        EFFORT_SCALE, name, ('scale',), ('1',), _column(np.array([*_SCALES, *_UNITS])),
        np.array([0.02]),
        lambda c, x: replace(c, effort_scale=_times(c.effort_scale, joints, x[0])),
        is_possible=_is_positive, exact=_UNITS,
    )  # fmt: skip


def _gain_scale(j: int, name: str) -> Hypothesis:
    starts = [(a, b) for a in (0.7, 1.0, 1.4) for b in (0.7, 1.0, 1.4)]
    return Hypothesis(
        'gain_scale', name, ('kp', 'kd'), ('1', '1'), np.array(starts), np.full(2, 0.05),
        lambda c, x: replace(
            c, kp=_at(c.kp, j, c.kp[j] * x[0]), kd=_at(c.kd, j, c.kd[j] * x[1])
        ),
        is_possible=_is_positive,
    )  # fmt: skip


def _sign(j: int, moves: bool, acts: bool) -> Callable[[Correction], Correction]:  # noqa: FBT001 - a row of CHANNELS
    return lambda c: replace(
        c,
        scale=_times(c.scale, [j], -1.0) if moves else c.scale,
        effort_scale=_times(c.effort_scale, [j], -1.0) if acts else c.effort_scale,
    )


def _swap(i: int, j: int, moves: bool, acts: bool) -> Callable[[Correction], Correction]:  # noqa: FBT001 - likewise
    return lambda c: replace(
        c,
        order=_exchanged(c.order, i, j) if moves else c.order,
        effort_order=_exchanged(c.effort_order, i, j) if acts else c.effort_order,
    )


def _swaps(motion: ObservedMotion, i: int, j: int) -> Iterator[Hypothesis]:
    tree = motion.tree
    both = bool(tree.is_actuated[i] and tree.is_actuated[j])
    for channels, (moves, acts) in _channels(motion):
        if both or not acts:
            words = {'other_joint': tree.joint_names[j], 'channels': channels}
            yield _discrete('swapped_joints', tree.joint_names[i], _swap(i, j, moves, acts), words)


def _clock(period: float, *, has_commands: bool) -> Hypothesis:
    """Return the offset of the clock; commands that act late have a delay, which is physics."""
    starts = np.array([x for x in _CLOCKS if x > 0.0 or not has_commands])
    return Hypothesis(
        'clock_offset', ALL, ('offset',), ('s',), _column(starts), np.array([0.004]),
        lambda c, x: replace(c, clock=c.clock + float(x[0])),
        is_possible=lambda x: bool(x[0] > 0.0) or not has_commands,
        least=0.0 if has_commands else period,
    )  # fmt: skip


def _late_targets() -> Hypothesis:
    """Return the delay of targets, which changes the fitted gains."""
    return Hypothesis(
        COMMAND_DELAY.name, ALL, ('delay',), ('s',), _column(_DELAYS), np.array([0.05]),
        lambda c, x: replace(c, clock=c.clock - float(x[0])),
        is_possible=lambda x: bool(x[0] > 0.0), is_physics=True,
    )  # fmt: skip


def _orientation() -> Hypothesis:
    starts = [(r, p) for r, p in product((0.0, *_TURNS), (0.0, *_TURNS[:-1])) if r or p]
    return Hypothesis(
        ORIENTATION, BASE, ('roll', 'pitch'), ('rad', 'rad'), np.array(starts),
        np.full(2, 0.03), lambda c, x: replace(c, roll=float(x[0]), pitch=float(x[1])),
        canonical=_principal,
    )  # fmt: skip


def _principal(x: np.ndarray) -> np.ndarray:
    """Return the same direction of gravity by a pitch within a quarter turn."""
    roll, pitch = x
    up = np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
    return np.array([np.arctan2(up[1], up[2]), np.arcsin(np.clip(-up[0], -1.0, 1.0))])


def _discrete(
    effect: str, joint: str, undo: Callable[[Correction], Correction], words: Mapping[str, str]
) -> Hypothesis:
    """Return an error without numbers."""
    return Hypothesis(
        effect, joint, (), (), np.zeros((1, 0)), np.zeros(0), lambda c, _: undo(c), words
    )


def _is_positive(x: np.ndarray) -> bool:
    """Return whether factors keep the sign; that has its own name."""
    return bool(np.all(x > 0.0))


def _times(values: np.ndarray, joints: Sequence[int], factor: float) -> np.ndarray:
    changed = values.copy()
    changed[list(joints)] *= factor
    return changed


def _column(x: np.ndarray) -> np.ndarray:
    return np.asarray(x, dtype=float)[:, None]


def _at(values: np.ndarray, j: int, x: float) -> np.ndarray:
    changed = values.copy()
    changed[j] = x
    return changed


def _exchanged(order: np.ndarray, i: int, j: int) -> np.ndarray:
    changed = order.copy()
    changed[[i, j]] = changed[[j, i]]
    return changed


def _moved(origins: np.ndarray | None, k: int, j: int, x: np.ndarray) -> np.ndarray:
    changed = np.zeros((k, 3)) if origins is None else origins.copy()
    changed[j] += x
    return changed
