"""A mechanism together with the effects that act on it, as one differential equation.

The state is `y = (position, velocity, memories of the effects)`. Dry friction makes the equation
switch: the directions, one of -1, 0 (sticks), 1 per axis along which it acts, are part of its
arguments. An axis is a joint, or a motor that turns with two joints.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.errors import NumericalError
from sgp_ros.simulation.dry_friction import directions_from_rest, hold_axes, hold_still
from sgp_ros.simulation.effects import Action, Moment
from sgp_ros.simulation.mechanism import Mechanism

_SHORT_S = 1e-6
_AT_REST = 1e-12
"""Speed that is rounding alone where a motor holds two joints together [rad/s or m/s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Inputs:
    """External inputs of a plant.

    Attributes:
        command: (m,) in force [unit of the command].
        noise: force of the surroundings on the joints, (k,) [N m or N].
    """

    command: np.ndarray
    noise: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """Ideal sensor values of the robot, without noise, k joints.

    Attributes:
        position: (k,) of the encoders [rad or m].
        velocity: (k,) of the encoders [rad/s or m/s].
        acceleration: (k,) of the encoders, without the noise of the surroundings.
        measured_velocity: (k,) as it is measured [rad/s or m/s].
        effort: (k,) that the currents of the motors stand for [N m or N].
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    measured_velocity: np.ndarray
    effort: np.ndarray


class Plant:
    """True dynamics of a robot with its effects.

    Args:
        mechanism: the equation of motion.
        k: number of joints with encoders; hidden coordinates of the mechanism follow them.
        actions: the effects; those on the current, then those behind it act in this order.
    """

    def __init__(self, mechanism: Mechanism, k: int, actions: Iterable[Action]) -> None:
        self.mechanism = mechanism
        self._shown = k
        self.k = k = k + len(mechanism.hidden)
        ends = 2 * k
        pairs: list[tuple[Action, slice]] = []
        for action in sorted(actions, key=_place):
            size = len(action.start(0.0, 0.0)) if action.start else 0
            pairs.append((action, slice(ends, ends + size)))
            ends += size
        self._actions = tuple(pairs)
        self._currents = tuple(x for x in pairs if x[0].current)
        self._behind = tuple(x for x in pairs if not x[0].current)
        self._inertias = tuple(
            (j, sum(x.inertia for x, _ in pairs if x.joint == j))
            for j in dict.fromkeys(x.joint for x, _ in pairs if x.inertia)
        )  # a rotor that one law adds is taken from the link by another
        dry = [x for x in pairs if x[0].dry_level is not None]
        joints = sorted({x.joint for x, _ in dry if x.geared is None})
        geared = list(dict.fromkeys((x.joint, *x.geared) for x, _ in dry if x.geared))
        self._dry_joints = joints
        self._axes = np.zeros((len(joints) + len(geared), k))
        self._axes[range(len(joints)), joints] = 1.0
        for axis, (joint, other, ratio) in zip(self._axes[len(joints) :], geared, strict=True):
            axis[joint], axis[other] = 1.0, ratio
        self._dry = tuple(
            (x, part, joints.index(x.joint) if x.geared is None
             else len(joints) + geared.index((x.joint, *x.geared)))
            for x, part in dry
        )  # fmt: skip

    def initial(self, position: Sequence[float], velocity: Sequence[float]) -> np.ndarray:
        """Return the state at the start, (2 k + s,)."""
        memories = [
            x
            for action, _ in self._actions
            if action.start
            for x in action.start(position[action.joint], velocity[action.joint])
        ]
        hidden = self.mechanism.hidden
        states = [*position, *hidden, *velocity, *np.zeros(len(hidden)), *memories]
        return np.array(states, dtype=np.float64)

    def derivative(
        self,
        time_s: float,
        y: np.ndarray,
        inputs: Inputs,
        directions: Sequence[int],
    ) -> np.ndarray:
        """Return dy/dt, (2 k + s,).

        Args:
            time_s: since the start [s].
            y: (2 k + s,) state.
            inputs: in force.
            directions: of sliding along the axes of dry friction.

        Raises:
            NumericalError: an effect that takes more inertia from a joint than it has.
        """
        rate = np.empty_like(y)
        rate[: self.k] = y[self.k : 2 * self.k]
        inverse_mass, force, drive = self._smooth(time_s, y, inputs, rate)
        for action, part, axis in self._dry:
            direction = directions[axis]
            if direction:
                moment = self._moment(time_s, y, drive, part)
                force -= (direction * self._level(action, moment, direction)) * self._axes[axis]
        rate[self.k : 2 * self.k] = self._held(inverse_mass, inverse_mass @ force, directions)
        return rate

    def _held(
        self, inverse_mass: np.ndarray, acceleration: np.ndarray, directions: Sequence[int]
    ) -> np.ndarray:
        """Return the accelerations (k,) once the axes that stick are held."""
        if 0 not in directions:
            return acceleration
        stuck = [axis for axis, direction in enumerate(directions) if direction == 0]
        joints = [self._dry_joints[axis] for axis in stuck if axis < len(self._dry_joints)]
        free = np.ones(self.k)
        free[joints] = 0.0
        geared = [a for a in stuck if a >= len(self._dry_joints) and (self._axes[a] * free).any()]
        if not geared:
            return hold_still(inverse_mass, acceleration, joints)
        held = hold_axes(inverse_mass, acceleration, self._axes[[*stuck[: len(joints)], *geared]])
        return held * free

    @property
    def has_dry_friction(self) -> bool:
        """Whether the equation switches."""
        return bool(self._dry)

    def sliding(self, y: np.ndarray) -> np.ndarray:
        """Return the speeds along the axes of dry friction; exactly 0 at rest."""
        speeds: np.ndarray = self._axes @ y[self.k : 2 * self.k]
        if len(speeds) > len(self._dry_joints):
            speeds[np.abs(speeds) < _AT_REST] = 0.0
        return speeds

    def stopped(self, y: np.ndarray, axes: Iterable[int]) -> np.ndarray:
        """Return the state with exactly no speed along some axes that were about to reverse."""
        y, k = y.copy(), self.k
        for axis in axes:
            joint = int(np.argmax(self._axes[axis] == 1.0))
            y[k + joint] = 0.0 if axis < len(self._dry_joints) else (
                y[k + joint] - self._axes[axis] @ y[k : 2 * k]
            )  # fmt: skip
        return y

    def directions(self, time_s: float, y: np.ndarray, inputs: Inputs) -> tuple[int, ...]:
        """Return the directions of sliding along the axes of dry friction from now on.

        0 where it holds.
        """
        found = [(w > 0.0) - (w < 0.0) for w in self.sliding(y).tolist()]
        resting = [axis for axis, direction in enumerate(found) if direction == 0]
        if resting:
            inverse_mass, force, drive = self._smooth(time_s, y, inputs, np.empty_like(y))
            up, down = np.zeros(len(found)), np.zeros(len(found))
            for action, part, axis in self._dry:
                moment, direction = self._moment(time_s, y, drive, part), found[axis]
                if direction:
                    force -= direction * self._level(action, moment, direction) * self._axes[axis]
                else:
                    up[axis] += self._level(action, moment, 1)
                    down[axis] += self._level(action, moment, -1)
            G = self._axes[resting]
            starts = directions_from_rest(
                G @ inverse_mass @ G.T, G @ (inverse_mass @ force), up[resting], down[resting]
            )
            for axis, start in zip(resting, starts, strict=True):
                found[axis] = start
        return tuple(found)

    def shown(self, time_s: float, y: np.ndarray, command: np.ndarray) -> Shown:
        """Return what sensors without noise show from now on under `command` (m,)."""
        inputs = Inputs(command, np.zeros(self._shown))
        rate = self.derivative(time_s, y, inputs, self.directions(time_s, y, inputs))
        effort = self.mechanism.drive(command, y[self.k : 2 * self.k])
        effort = self._through(self._currents, time_s, y, effort, None)
        q, v = self._encoders(time_s, y, effort)
        acceleration, measured = rate[self.k : 2 * self.k].copy(), v.copy()
        for action, part in self._actions:
            joint = action.joint
            if action.sense is not None:
                later = self._encoders(time_s + _SHORT_S, y + _SHORT_S * rate, effort)[1]
                earlier = self._encoders(time_s - _SHORT_S, y - _SHORT_S * rate, effort)[1]
                acceleration[joint] = (later[joint] - earlier[joint]) / (2.0 * _SHORT_S)
            if action.sense_velocity is not None:
                measured[joint] = action.sense_velocity(self._moment(time_s, y, effort, part))
        return Shown(*(x[: self._shown] for x in (q, v, acceleration, measured, effort)))

    def _encoders(
        self, time_s: float, y: np.ndarray, drive: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        position, velocity = y[: self.k].copy(), y[self.k : 2 * self.k].copy()
        for action, part in self._actions:
            if action.sense is not None:
                moment = Moment(time_s, position, velocity, drive, y[part])
                position[action.joint], velocity[action.joint] = action.sense(moment)
        return position, velocity

    def _smooth(
        self, time_s: float, y: np.ndarray, inputs: Inputs, rate: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return inverse mass, all smooth forces and the drive; fill the rates of the memories."""
        q, v = y[: self.k], y[self.k : 2 * self.k]
        inverse_mass, force = self.mechanism.dynamics(q, v)
        for joint, inertia in self._inertias:  # one term of rank one each (Sherman, Morrison 1950)
            column = inverse_mass[:, joint]
            share = 1.0 + inertia * column[joint]
            if share <= 0.0:
                raise NumericalError(
                    f'{-inertia:g} kg m^2 or kg taken from the inertia of joint {joint}',
                    f'less than the {1.0 / column[joint]:g} that it has',
                )
            scale = inertia / share
            inverse_mass = inverse_mass - scale * np.outer(column, column)
        drive = self.mechanism.drive(inputs.command, v)
        drive = self._through(self._currents, time_s, y, drive, rate)
        drive = self._through(self._behind, time_s, y, drive, rate)
        force = force + drive
        force[: self._shown] += inputs.noise
        for action, part in self._behind:
            if action.force is not None:
                force[action.joint] += action.force(self._moment(time_s, y, drive, part))
        return inverse_mass, force, drive

    def _through(
        self,
        pairs: Iterable[tuple[Action, slice]],
        time_s: float,
        y: np.ndarray,
        drive: np.ndarray,
        rate: np.ndarray | None,
    ) -> np.ndarray:
        """Return the drive behind effects; fill the rates of their memories."""
        for action, part in pairs:
            replaced = action.current or action.drive
            if rate is not None and action.state_rate is not None:
                rate[part] = action.state_rate(self._moment(time_s, y, drive, part))
            if replaced is not None:
                moment = self._moment(time_s, y, drive, part)
                drive = drive.copy()
                drive[action.joint] = replaced(moment)
        return drive

    def _moment(self, time_s: float, y: np.ndarray, drive: np.ndarray, part: slice) -> Moment:
        return Moment(time_s, y[: self.k], y[self.k : 2 * self.k], drive, y[part])

    @staticmethod
    def _level(action: Action, moment: Moment, direction: int) -> float:
        assert action.dry_level is not None
        return action.dry_level(moment, direction)


def _place(action: Action) -> int:
    """Return the rank of an action in the chain from the command to the joint."""
    return 0 if action.current else 1 if action.drive else 2
