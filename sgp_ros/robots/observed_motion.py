"""The motion of a robot in a recording, with what its nominal model makes of it.

All arrays stand on one uniform grid. The direction of motion is averaged over each cell of the
grid, so that a reversal between two samples counts at its time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sgp_ros.physics.catalogue import ARMATURE, EFFECTS
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.motion import Commands, RecordedCommands
from sgp_ros.physics.servo import Servo
from sgp_ros.rigid.kinematics import LinkMotion
from sgp_ros.rigid.rigid_body import inverse_dynamics, mass_matrix, torque_regressor
from sgp_ros.rigid.tree import Tree

_BLOCK = 8000
"""Rows whose regressor is held at a time: that of a long recording would not fit in memory."""
_DAMPING, _ROTOR = 'damping', ARMATURE.quantities[0].joint_number
"""Numbers of a joint: that which is part of the tree, and its inertia beside the bodies."""
_STEP = 1e-6
"""Change of position and velocity whose effect on efforts is a slope [rad or m, per second]."""
STILL = 1e-9
"""Range of the position within which a joint does not move [rad or m]."""


@dataclass(frozen=True, eq=False)
class ObservedMotion:
    """n rows of the k joints of a robot on a uniform grid.

    Attributes:
        tree: nominal robot.
        time: (n,) since the first state of the recording [s].
        step: of the grid [s].
        position, velocity, acceleration: (n, k), lightly smoothed.
        effort: (n, k) commanded, or measured where there are no commands; 0 for passive joints.
        drive: what the drives receive; None where only efforts were measured.
        starts: rows at which the grid begins anew after a pause.
        stated: effects that the nominal robot has, beside those that are part of the tree, and
            laws that it may have or not.
        recording: (n,) index of the recording that each row is from, of several that a diagnosis
            learns from; None for any other motion.
        sign: from velocities to what stands for their sign; None takes its mean over the cells
            of the grid.
        bandwidth: frequency up to which equations are formed of it [Hz].
        is_static: settled points, each of which stands for itself, not a motion.
    """

    tree: Tree
    time: np.ndarray
    step: float
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray
    drive: Commands | None
    starts: tuple[int, ...] = (0,)
    stated: tuple[EffectAt, ...] = ()
    recording: np.ndarray | None = None
    sign: Callable[[np.ndarray], np.ndarray] | None = None
    is_static: bool = False
    bandwidth: float = np.inf

    @cached_property
    def direction(self) -> np.ndarray:
        """Mean of sign(v) over each cell of the grid, (n, k)."""
        return self.direction_of(self.velocity)

    def direction_of(self, speed: np.ndarray) -> np.ndarray:
        """Return the mean of the sign of speeds (n, ...) over each cell of the grid, (n, ...)."""
        v = speed
        if self.sign is not None:
            return self.sign(v)
        middle = 0.5 * (v[1:] + v[:-1])
        before = np.concatenate([v[:1], middle])
        after = np.concatenate([middle, v[-1:]])
        return 0.5 * (_mean_sign(before, v) + _mean_sign(v, after))

    @cached_property
    def wrapped(self) -> np.ndarray:
        """Positions, those of continuous joints wrapped to [-pi, pi), (n, k)."""
        q = self.position.copy()
        turns = self.is_continuous
        q[:, turns] = (q[:, turns] + np.pi) % (2 * np.pi) - np.pi
        return q

    @cached_property
    def moves(self) -> np.ndarray:
        """Whether each joint moves at all, (k,); one that does not cannot be identified."""
        return np.asarray(np.ptp(self.position, axis=0) > STILL)

    @property
    def moving_joints(self) -> tuple[int, ...]:
        """Indices of the joints that move."""
        return tuple(int(j) for j in np.flatnonzero(self.moves))

    @property
    def is_commanded(self) -> np.ndarray:
        """Whether the effort of each joint is a command, known before it acts, (k,).

        A measured effort is what models have to predict; nothing may be explained by it.
        """
        return self.tree.is_actuated[: self.tree.size] & (self.drive is not None)

    @property
    def has_all_efforts(self) -> bool:
        """Whether every joint has a recorded effort that no drive makes of the motion."""
        is_driven = self.tree.is_actuated[: self.tree.size].all()
        return bool(is_driven) and not isinstance(self.drive, Servo)

    @property
    def is_continuous(self) -> np.ndarray:
        """Whether each joint turns without limits, (k,)."""
        k = self.tree.size
        return ~self.tree.is_prismatic[:k] & ~np.isfinite(self.tree.lower[:k])

    @cached_property
    def rotors(self) -> np.ndarray:
        """Inertia that the nominal robot states beside its bodies, (k,) [kg m^2 or kg]."""
        return np.array([self.stated_number(_ROTOR, j) for j in range(self.tree.size)])

    @cached_property
    def mass_diagonal(self) -> np.ndarray:
        """Diagonal of the nominal mass matrix, rotors included, (n, k) [kg m^2 or kg]."""
        M = mass_matrix(self.tree, self.tree.parameters, self.position)
        return np.einsum('njj->nj', M) + self.rotors

    @cached_property
    def nominal_effort(self) -> np.ndarray:
        """Efforts that the nominal robot takes for this motion, (n, k) [N m or N]."""
        return self.effort_for(self.position, self.velocity, self.acceleration)

    @cached_property
    def catalogue(self) -> Mapping[str, Effect]:
        """All laws that the robot may have beside its nominal ones, by what tells them apart."""
        return EFFECTS | {x.effect.key: x.effect for x in self.stated if x.effect.is_open}

    @property
    def known(self) -> tuple[EffectAt, ...]:
        """The effects that the nominal robot has, beside those that are part of the tree."""
        return tuple(x for x in self.stated if not x.effect.is_open)

    @cached_property
    def stated_force(self) -> np.ndarray:
        """Force of the effects that the nominal robot has, (n, k) [N m or N]."""
        force = np.zeros(self.position.shape)
        for effect in self.known:
            force += effect.force(self)
        return force

    def driven(self, effort: np.ndarray, drive: Commands) -> ObservedMotion:
        """Return the same motion of other efforts (n, k) by other commands."""
        return replace(self, effort=effort, drive=drive)

    def stated_number(self, name: str, joint: int) -> float:
        """Return what the nominal robot states of a number of a joint, see `joint_number`."""
        found = float(self.tree.damping[joint]) if name == _DAMPING else 0.0
        for x in self.known:
            if x.place.joint == joint:
                named = zip(x.effect.coefficient_quantities(x.kind), x.coefficients, strict=False)
                sizes = [float(c) for q, c in named if q.joint_number == name]
                found += sum(sizes) / max(len(sizes), 1)  # of either direction, their mean
        return found

    @property
    def is_swing(self) -> bool:
        """Whether one joint moves, of a robot without motors: its energy is its own."""
        return not self.tree.is_actuated.any() and int(self.moves.sum()) == 1

    @property
    def dry_joints(self) -> frozenset[int]:
        """Indices of the joints that the nominal robot's dry friction may hold."""
        return frozenset(j for x in self.known for j in x.held_joints)

    @cached_property
    def gravity_columns(self) -> np.ndarray:
        """Efforts that hold the robot against a unit of gravity along each root axis (n, k, 3)."""
        q, still, held = self.position, np.zeros_like(self.position), self.tree.parameters
        return np.stack(
            [inverse_dynamics(self.tree, held, q, still, still, axis) for axis in np.eye(3)],
            axis=2,
        )

    @cached_property
    def tool_columns(self) -> np.ndarray:
        """Efforts of a unit force along the root axes at `tool0`, (n, k, 3); else (n, k, 0)."""
        if self.tool is None or self.tree.tool is None:
            return np.zeros((*self.position.shape, 0))
        return self.tool.columns(self.tree.tool.translation)

    @cached_property
    def tool(self) -> LinkMotion | None:
        """Motion of the link that carries the tool; None where several are outermost."""
        body = self.tree.tool_body
        return None if body < 0 else LinkMotion.of(self.tree, self.position, body)

    @cached_property
    def _slopes(self) -> dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]]:
        return {}

    def effort_slopes(self, joint: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the slopes of the nominal efforts, (n, k) each.

        They are the derivatives by position, velocity and acceleration of one joint: differences,
        exact for the last one, which is a column of the mass matrix, its rotor included.
        """
        if joint not in self._slopes:
            found = []
            for which, step in enumerate((_STEP, _STEP, 1.0)):
                states = [self.position, self.velocity, self.acceleration]
                states[which] = states[which] + step * np.eye(self.tree.size)[joint]
                found.append((self.effort_for(*states) - self.nominal_effort) / step)
            found[2][:, joint] += self.rotors[joint]
            self._slopes[joint] = found[0], found[1], found[2]
        return self._slopes[joint]

    @property
    def remembered(self) -> int:
        """How many numbers `effort_slopes` holds."""
        return sum(3 * by_q.size for by_q, _, _ in self._slopes.values())

    def forget(self) -> None:
        """Let go of what `effort_slopes` holds; it is computed again when it is asked for."""
        self._slopes.clear()

    @cached_property
    def load_columns(self) -> dict[int, np.ndarray]:
        """Efforts per inertial parameter of each outermost link, by its joint, (n, k, 10)."""
        found = {j: np.empty((*self.position.shape, 10)) for j in self.tree.outermost}
        for first in range(0, len(self.position), _BLOCK):
            rows = slice(first, first + _BLOCK)
            states = self.position[rows], self.velocity[rows], self.acceleration[rows]
            of_all = torque_regressor(self.tree, *states)
            for j, of_one in found.items():
                of_one[rows] = of_all[:, :, 10 * j : 10 * j + 10]
        return found

    def on(self, stretches: Sequence[slice]) -> ObservedMotion:
        """Return some stretches of the rows, after each of which the grid begins anew."""
        pick = np.concatenate([np.arange(s.start, s.stop) for s in stretches])
        ends, drive = np.cumsum([s.stop - s.start for s in stretches]), self.drive
        if drive is not None:
            assert isinstance(drive, RecordedCommands)  # a node has no stretches
            drive = drive.on(stretches)
        return replace(
            self, time=self.time[pick], position=self.position[pick],
            velocity=self.velocity[pick], acceleration=self.acceleration[pick],
            effort=self.effort[pick], drive=drive,
            starts=(0, *map(int, ends[:-1])),
            recording=None if self.recording is None else self.recording[pick],
        )  # fmt: skip

    def sliding(self, direction: float) -> ObservedMotion:
        """Return the same motion with every joint about to slide in one direction."""
        return replace(self, sign=lambda v: np.full(v.shape, direction))

    def free_inertia(self, joint: int, rows: slice) -> float:
        """Return the least inertia of a joint while all others are free [kg m^2 or kg].

        It is 0 where the robot states none.

        Args:
            joint: index.
            rows: those that are looked at.
        """
        M = mass_matrix(self.tree, self.tree.parameters, self.position[rows])
        M += np.diag(self.rotors)
        try:
            return 1.0 / float(np.linalg.inv(M)[:, joint, joint].max())
        except np.linalg.LinAlgError:
            return 0.0

    def effort_for(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the efforts of the nominal robot for a motion, (n, k) [N m or N]."""
        rigid = inverse_dynamics(self.tree, self.tree.parameters, q, v, a)
        return rigid + self.tree.damping[: self.tree.size] * v


def _mean_sign(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the mean of sign on the straight line from a to b."""
    rise = b - a
    flat = np.abs(rise) <= 1e-300
    return np.where(flat, np.sign(a), (np.abs(b) - np.abs(a)) / np.where(flat, 1.0, rise))
