"""Filtered equations of motion from the accepted states of a stream, one window at a time.

One filter for both sides of the equation of motion, for stamps of any spacing.

Coefficients of the acceleration are averaged together with it: `integral kappa M(q) a ds` is the
averaged M times the averaged a plus their covariance within the window, for which a comes from
the polynomial that follows the motion.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.gate_loops import fill_roughness
from sgp_ros.engine.held_commands import CommandHistory
from sgp_ros.engine.intake import State
from sgp_ros.engine.rest import friction_slack
from sgp_ros.engine.weak_form import WeakForm, polynomial_smoother
from sgp_ros.physics.term import Motion
from sgp_ros.robots.robot import Robot

_stamp = attrgetter('stamp_ns')
_LEAST_STATES = 3
_LEAST_SHARE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Equation:
    """The equation of motion averaged over one window: `target = f W + Z(u)`.

    Attributes:
        stamp_ns: stamp of the state at its centre [ns].
        span_s: length of the window [s].
        motion: (1, k) state at the centre with filtered acceleration and effort.
        state_rows: (k, p) part of f that the state alone determines.
        slopes: (c, k, p) change of f per unit of each complement signal.
        complement_joints: the c joints those signals belong to.
        slack: (2, k) least and largest effort by which the target may exceed the rows where dry
            friction holds a joint: the equation is then an inequality. None where it holds none.
        roughness: (2, 2 k) largest distance of a sample from the polynomial that follows the
            others, then the range of the samples: of the positions, and of measured velocities, 0
            without.
    """

    stamp_ns: int
    span_s: float
    motion: Motion
    state_rows: np.ndarray
    slopes: np.ndarray
    complement_joints: tuple[int, ...]
    slack: np.ndarray | None
    roughness: np.ndarray

    def regressor(self, complement: np.ndarray) -> np.ndarray:
        """Return f (k, p) for complement signals (c,)."""
        return self.state_rows + _weighted(complement, self.slopes)


class WindowFilter:
    """Collects states and yields an equation whenever a window is complete.

    The window of a state holds every state within half of `filter.window`, and at least its two
    neighbours. The delay is half a window.
    """

    def __init__(self, robot: Robot, config: EngineConfig) -> None:
        self._robot = robot
        self._half_ns = round(0.5e9 * config.filter_window)
        self._hop_ns = round(0.999e9 * config.filter_hop)
        self._degree = config.filter_degree
        self._velocity = config.filter_velocity
        self._complement_joints = tuple(
            j
            for j, joint in enumerate(robot.joints)
            if robot.complement == 'acceleration' or joint.is_actuated
        )
        self.states: list[State] = []
        self.next_ns: int | None = None
        self._cached: tuple[np.ndarray, bool, _Weights] | None = None

    def restart(self) -> None:
        """Forget the states so far: what follows does not continue them."""
        self.states = []
        self.next_ns = None

    def push(self, state: State, commands: CommandHistory) -> list[Equation]:
        """Take the next state and return the equations that became complete.

        A window holds efforts of one source: another one begins anew.
        """
        if self.states and (self.states[-1].effort is None) != (state.effort is None):
            self.restart()
        self.states.append(state)
        if self.next_ns is None:
            self.next_ns = state.stamp_ns + self._half_ns
        equations = []
        while (centre := self._ready_centre()) is not None:
            equations.append(self._equation(centre, commands))
            self.next_ns = self.states[centre].stamp_ns + max(self._hop_ns, 1)
        self._forget(commands)
        return equations

    def _ready_centre(self) -> int | None:
        newest, states = self.states[-1].stamp_ns, self.states
        assert self.next_ns is not None
        if newest < self.next_ns + self._half_ns or len(states) < _LEAST_STATES:
            return None
        index = bisect_left(states, self.next_ns, 1, len(states) - 1, key=_stamp)
        if index == len(states) - 1 or newest < states[index].stamp_ns + self._half_ns:
            return None
        return index

    def _forget(self, commands: CommandHistory) -> None:
        assert self.next_ns is not None
        first = self.next_ns - self._half_ns
        keep = bisect_left(self.states, first, key=_stamp)
        # One state before the window may still be the left neighbour of its centre.
        if keep > 1 or len(self.states) == 1:
            del self.states[: max(keep - 1, 0)]
            commands.forget_before(self.states[0].stamp_ns)

    def _equation(self, centre: int, commands: CommandHistory) -> Equation:
        stamp = self.states[centre].stamp_ns
        first = bisect_left(self.states, stamp - self._half_ns, key=_stamp)
        last = bisect_right(self.states, stamp + self._half_ns, key=_stamp)
        first, last = min(first, centre - 1), max(last, centre + 2)
        window, at = self.states[first:last], centre - first
        measured = self._velocity != 'position' and all(s.velocity is not None for s in window)
        weights = self._weights(
            np.array([state.stamp_ns - stamp for state in window]), measured=measured
        )
        position = np.array([state.position for state in window])  # (m, k)
        source = position
        if measured:
            source = np.array([state.velocity for state in window])
        velocity, acceleration = weights.derivatives(source, measured=measured)
        smooth = weights.values @ position
        k = position.shape[1]
        roughness = np.zeros((2, 2 * k))
        fill_roughness(position, smooth, weights.others, 0, roughness)
        if measured:
            fill_roughness(source, velocity, weights.others, k, roughness)
        return self._assemble(
            window,
            at,
            weights,
            acceleration,
            roughness,
            Motion(
                smooth,
                velocity,
                (weights.form.weights @ source)[None],
                self._effort(window, velocity, weights.form, commands)[None],
            ),
        )

    def _effort(
        self, window: list[State], velocity: np.ndarray, form: WeakForm, commands: CommandHistory
    ) -> np.ndarray:
        if not any(joint.is_actuated for joint in self._robot.joints):
            return np.zeros(len(self._robot.joints))
        effort_map = self._robot.effort_map
        if all(state.effort is not None for state in window):
            measured = np.array([state.effort for state in window])
            if effort_map is not None:
                measured = effort_map(measured, velocity, is_measured=True)
            return form.averaging @ measured
        span = window[0].stamp_ns, window[-1].stamp_ns
        if effort_map is None:
            return commands.average(*span, form.cumulative)

        def acting(held: np.ndarray, seconds: np.ndarray) -> np.ndarray:
            offsets = form.times - form.times[0]
            v = np.column_stack([np.interp(seconds, offsets, column) for column in velocity.T])
            return effort_map(held, v, is_measured=False)

        now = commands.average(*span, form.cumulative, acting)
        return now + effort_map.late_effort(commands.drive(span[0], form))[0]

    def _assemble(
        self,
        window: list[State],
        at: int,
        weights: _Weights,
        within: np.ndarray,
        roughness: np.ndarray,
        motion: Motion,
    ) -> Equation:
        """Return the equation of a window, with accelerations (m, k) that follow the motion."""
        m, k = motion.position.shape
        joints = self._complement_joints
        probes = 1 + len(joints)
        nodes, shares = weights.nodes
        forward = self._robot.target == 'acceleration'
        drive = np.zeros((m + len(nodes) * probes, k))
        if not forward:
            drive[:m] = within - weights.form.averaging @ within
        each = drive[m:].reshape(len(nodes), probes, k)
        each[:, np.arange(1, probes), joints] = 1.0
        still = np.zeros_like(drive)
        extended = Motion(
            np.vstack([motion.position, np.repeat(motion.position[nodes], probes, axis=0)]),
            np.vstack([motion.velocity, np.repeat(motion.velocity[nodes], probes, axis=0)]),
            still if forward else drive,
            drive if forward else still,
        )
        rows = self._robot.regressor(extended)  # (m + 3 probes, k, p)
        probed = rows[m:].reshape(len(nodes), probes, *rows.shape[1:])
        measured = np.array([state.position for state in window])
        centre = motion.position[at][None], motion.velocity[at][None]
        return Equation(
            window[at].stamp_ns,
            (window[-1].stamp_ns - window[0].stamp_ns) * 1e-9,
            Motion(*centre, motion.acceleration, motion.effort),
            _weighted(weights.form.averaging, rows[:m]),
            _weighted(shares, probed[:, 1:] - probed[:, :1]),
            joints,
            friction_slack(self._robot, motion, measured, weights.form),
            roughness,
        )

    def _weights(self, offsets_ns: np.ndarray, *, measured: bool) -> _Weights:
        cached = self._cached
        if cached and cached[1] == measured and np.array_equal(cached[0], offsets_ns):
            return cached[2]
        times = offsets_ns * 1e-9
        form = WeakForm.from_velocities(times) if measured else WeakForm.from_positions(times)
        values, slopes, curvatures = polynomial_smoother(times, self._degree)
        others = np.maximum(1.0 - values.diagonal(), _LEAST_SHARE)
        weights = _Weights(form, form.nodes(), values, slopes, curvatures, others)
        self._cached = (offsets_ns, measured, weights)
        return weights


def _weighted(weights: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the sum of rows (m, ...) by weights (m,), as `np.tensordot` in fewer calls."""
    flat = rows.reshape(len(rows), math.prod(rows.shape[1:]))
    return np.asarray(np.dot(weights[None], flat).reshape(rows.shape[1:]))


@dataclass(frozen=True, slots=True, eq=False)
class _Weights:
    form: WeakForm
    nodes: tuple[np.ndarray, np.ndarray]
    values: np.ndarray
    slopes: np.ndarray
    curvatures: np.ndarray
    others: np.ndarray

    def derivatives(self, source: np.ndarray, *, measured: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return velocities and accelerations of measured velocities, or of positions."""
        if measured:
            return self.values @ source, self.slopes @ source
        return self.slopes @ source, self.curvatures @ source
