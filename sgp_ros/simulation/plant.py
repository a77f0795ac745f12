"""A mechanism together with the effects that act on it, as one differential equation.

The state is `y = (position, velocity, memories of the effects)`. Dry friction makes the equation
switch: the directions, one of -1, 0 (sticks), 1 per joint, are part of its arguments.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.simulation.dry_friction import directions_from_rest, hold_still
from sgp_ros.simulation.effects import Moment

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from sgp_ros.simulation.effects import Action
    from sgp_ros.simulation.mechanism import Mechanism


@dataclass(frozen=True, slots=True, eq=False)
class Inputs:
    """What acts on a plant from outside.

    Attributes:
        command: (m,) in force [unit of the command].
        noise: (k,) force of the surroundings [N m or N].
    """

    command: np.ndarray
    noise: np.ndarray


class Plant:
    """True dynamics of a robot with its effects.

    Args:
        mechanism: the equation of motion.
        k: number of joints.
        actions: the effects; those in the drive act in this order.
    """

    def __init__(self, mechanism: Mechanism, k: int, actions: Iterable[Action]) -> None:
        self.mechanism = mechanism
        self.k = k
        ends = 2 * k
        ordered: list[tuple[Action, slice]] = []
        for action in sorted(actions, key=lambda action: action.drive is None):
            ordered.append((action, slice(ends, ends + len(action.initial_state))))
            ends += len(action.initial_state)
        self._actions = tuple(ordered)
        self._dry = tuple(pair for pair in ordered if pair[0].dry_level is not None)
        self.dry_joints = tuple(sorted({action.joint for action, _ in self._dry}))

    def initial(self, position: Sequence[float], velocity: Sequence[float]) -> np.ndarray:
        """Return the state at the start, (2 k + s,)."""
        memories = [x for action, _ in self._actions for x in action.initial_state]
        return np.array([*position, *velocity, *memories], dtype=np.float64)

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
            directions: (k,) of sliding; used for joints with dry friction only.
        """
        rate = np.empty_like(y)
        rate[: self.k] = y[self.k : 2 * self.k]
        force, drive = self._smooth(time_s, y, inputs.command, rate)
        force += inputs.noise
        for action, part in self._dry:
            direction = directions[action.joint]
            if direction:
                force[action.joint] -= direction * self._level(
                    action, self._moment(time_s, y, drive, part), direction
                )
        inverse_mass = self.mechanism.inverse_mass(y[: self.k])
        stuck = [joint for joint in self.dry_joints if directions[joint] == 0]
        rate[self.k : 2 * self.k] = hold_still(inverse_mass, inverse_mass @ force, stuck)
        return rate

    def directions(self, time_s: float, y: np.ndarray, inputs: Inputs) -> tuple[int, ...]:
        """Return the directions of sliding from now on, (k,); 0 where dry friction holds."""
        found = [int(np.sign(v)) for v in y[self.k : 2 * self.k]]
        resting = [joint for joint in self.dry_joints if found[joint] == 0]
        if resting:
            force, drive = self._smooth(time_s, y, inputs.command, np.empty_like(y))
            force += inputs.noise
            up, down = np.zeros(self.k), np.zeros(self.k)
            for action, part in self._dry:
                moment, joint = self._moment(time_s, y, drive, part), action.joint
                if found[joint]:
                    force[joint] -= found[joint] * self._level(action, moment, found[joint])
                else:
                    up[joint] += self._level(action, moment, 1)
                    down[joint] += self._level(action, moment, -1)
            inverse_mass = self.mechanism.inverse_mass(y[: self.k])
            block = inverse_mass[np.ix_(resting, resting)]
            starts = directions_from_rest(
                block, (inverse_mass @ force)[resting], up[resting], down[resting]
            )
            for joint, start in zip(resting, starts, strict=True):
                found[joint] = start
        return tuple(found)

    def acceleration(self, time_s: float, y: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the accelerations (k,) from now on, without noise [rad/s^2 or m/s^2]."""
        inputs = Inputs(command, np.zeros(self.k))
        rate = self.derivative(time_s, y, inputs, self.directions(time_s, y, inputs))
        return rate[self.k : 2 * self.k]

    def seen(
        self, time_s: float, y: np.ndarray, command: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return position and velocity (k,) as effects in the sensors show them."""
        position, velocity = y[: self.k].copy(), y[self.k : 2 * self.k].copy()
        for action, part in self._actions:
            if action.sense is not None:
                drive = self.mechanism.drive(command, velocity)
                moment = Moment(time_s, position, velocity, drive, y[part])
                position[action.joint], velocity[action.joint] = action.sense(moment)
        return position, velocity

    def _smooth(
        self, time_s: float, y: np.ndarray, command: np.ndarray, rate: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return all smooth forces and those of the drive; fill the rates of the memories."""
        q, v = y[: self.k], y[self.k : 2 * self.k]
        drive = self.mechanism.drive(command, v)
        extra = np.zeros(self.k)
        for action, part in self._actions:
            moment = self._moment(time_s, y, drive, part)
            if action.state_rate is not None:
                rate[part] = action.state_rate(moment)
            if action.force is not None:
                extra[action.joint] += action.force(moment)
            if action.drive is not None:
                drive = drive.copy()
                drive[action.joint] = action.drive(moment)
        return self.mechanism.force(q, v) + drive + extra, drive

    def _moment(self, time_s: float, y: np.ndarray, drive: np.ndarray, part: slice) -> Moment:
        return Moment(time_s, y[: self.k], y[self.k : 2 * self.k], drive, y[part])

    @staticmethod
    def _level(action: Action, moment: Moment, direction: int) -> float:
        assert action.dry_level is not None
        return action.dry_level(moment, direction)
