"""Filtered equations of motion from the accepted states of a stream, one window at a time.

One filter for both sides of the equation of motion, for stamps of any spacing.

A least-squares fit over a window gives weights `c_j` with `a = sum_j c_j q(t_j)`. The weights
annihilate what a motion without acceleration does, so `a = integral kappa(s) q''(s) ds` holds
exactly, with the Peano kernel `kappa(s) = sum_j c_j max(t_j - s, 0)` (from positions) or
`kappa(s) = sum_{t_j > s} c_j` (from velocities), which has unit area. Averaging every other term
of the equation with the same kernel filters the equation instead of approximating it.

Source: Peano 1913 for the kernel; Savitzky and Golay 1964 for the fit.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.intake import CommandHistory, State
from sgp_ros.engine.rest import friction_slack
from sgp_ros.physics.term import Motion
from sgp_ros.robots.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class WeakForm:
    """Weights of one window of m samples at times t.

    Attributes:
        times: (m,) [s], increasing.
        weights: (m,) `c_j`; times positions [1/s^2] or velocities [1/s] they give acceleration.
        left, right: (m - 1,) kernel at both ends of each interval, linear in between [1/s].
    """

    times: np.ndarray
    weights: np.ndarray
    left: np.ndarray
    right: np.ndarray

    @classmethod
    def from_positions(cls, times: np.ndarray) -> WeakForm:
        """Return the weights of a quadratic fit to positions at `times` (m,), m >= 3."""
        centred, half = _scaled(times)
        basis = np.linalg.pinv(np.vander(centred, 3, increasing=True))  # (3, m)
        weights = 2.0 * basis[2] / half**2
        tail = np.cumsum(weights[::-1])[::-1]
        moment = np.cumsum((weights * times)[::-1])[::-1]
        kernel = moment - times * tail  # sum over i >= j of c_i (t_i - t_j)
        kernel[0] = kernel[-1] = 0.0
        return cls(times, weights, kernel[:-1], kernel[1:])

    @classmethod
    def from_velocities(cls, times: np.ndarray) -> WeakForm:
        """Return the weights of a linear fit to velocities at `times` (m,), m >= 2."""
        centred, half = _scaled(times)
        basis = np.linalg.pinv(np.vander(centred, 2, increasing=True))  # (2, m)
        weights = basis[1] / half
        kernel = np.cumsum(weights[::-1])[::-1][1:]
        return cls(times, weights, kernel, kernel)

    @property
    def averaging(self) -> np.ndarray:
        """Weights that average a signal, linear between samples, with the kernel; (m,), sum 1."""
        steps = np.diff(self.times) / 6.0
        shares = np.zeros(len(self.times))
        shares[:-1] += steps * (2.0 * self.left + self.right)
        shares[1:] += steps * (self.left + 2.0 * self.right)
        return shares

    def cumulative(self, seconds: np.ndarray) -> np.ndarray:
        """Integrate the kernel from the first sample to `seconds` (r,) after it, (r,)."""
        steps = np.diff(self.times)
        areas = np.concatenate([[0.0], np.cumsum(0.5 * steps * (self.left + self.right))])
        since = np.clip(seconds, 0.0, self.times[-1] - self.times[0])
        offsets = self.times - self.times[0]
        index = np.clip(np.searchsorted(offsets, since, side='right') - 1, 0, len(steps) - 1)
        inside = since - offsets[index]
        slope = (self.right[index] - self.left[index]) / steps[index]
        return areas[index] + inside * (self.left[index] + 0.5 * slope * inside)


def polynomial_smoother(times: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrices that smooth and differentiate samples at `times` (m,).

    A polynomial of `degree`, or of m - 1 if that is less, is fitted by least squares.

    Returns:
        values (m, m) and slopes (m, m) [1/s]: times the samples they give the polynomial and its
        derivative at the same times.
    """
    centred, half = _scaled(times)
    powers = np.arange(min(degree, len(times) - 1) + 1)
    basis = centred[:, None] ** powers  # (m, degree + 1)
    fit = np.linalg.pinv(basis)
    derivative = np.zeros_like(basis)
    derivative[:, 1:] = powers[1:] * basis[:, :-1] / half
    return basis @ fit, derivative @ fit


def _scaled(times: np.ndarray) -> tuple[np.ndarray, float]:
    half = 0.5 * float(times[-1] - times[0])
    return (times - 0.5 * (times[0] + times[-1])) / half, half


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
    """

    stamp_ns: int
    span_s: float
    motion: Motion
    state_rows: np.ndarray
    slopes: np.ndarray
    complement_joints: tuple[int, ...]
    slack: np.ndarray | None = None

    def regressor(self, complement: np.ndarray) -> np.ndarray:
        """Return f (k, p) for complement signals (c,)."""
        return self.state_rows + np.tensordot(complement, self.slopes, axes=1)


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
        newest = self.states[-1].stamp_ns
        assert self.next_ns is not None
        for index in range(1, len(self.states) - 1):
            stamp = self.states[index].stamp_ns
            if stamp >= self.next_ns:
                return index if newest >= stamp + self._half_ns else None
        return None

    def _forget(self, commands: CommandHistory) -> None:
        assert self.next_ns is not None
        first = self.next_ns - self._half_ns
        keep = bisect_left(self.states, first, key=lambda state: state.stamp_ns)
        # One state before the window may still be the left neighbour of its centre.
        del self.states[: max(keep - 1, 0)]
        commands.forget_before(self.states[0].stamp_ns)

    def _equation(self, centre: int, commands: CommandHistory) -> Equation:
        stamp = self.states[centre].stamp_ns
        window = [
            state
            for index, state in enumerate(self.states)
            if abs(state.stamp_ns - stamp) <= self._half_ns or abs(index - centre) == 1
        ]
        at = next(i for i, state in enumerate(window) if state.stamp_ns == stamp)
        measured = self._velocity != 'position' and all(s.velocity is not None for s in window)
        weights = self._weights(
            np.array([state.stamp_ns - stamp for state in window]), measured=measured
        )
        position = np.array([state.position for state in window])  # (m, k)
        source = position
        if measured:
            source = np.array([state.velocity for state in window])
        velocity = weights.slopes @ source if source is position else weights.values @ source
        return self._assemble(
            window,
            at,
            weights,
            Motion(
                weights.values @ position,
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

        return commands.average(*span, form.cumulative, acting)

    def _assemble(
        self, window: list[State], at: int, weights: _Weights, motion: Motion
    ) -> Equation:
        m, k = motion.position.shape
        joints = self._complement_joints
        probes = 1 + len(joints)
        drive = np.zeros((m + probes, k))
        drive[np.arange(m + 1, m + probes), joints] = 1.0
        still = np.zeros_like(drive)
        forward = self._robot.target == 'acceleration'
        extended = Motion(
            np.vstack([motion.position, np.repeat(motion.position[at][None], probes, axis=0)]),
            np.vstack([motion.velocity, np.repeat(motion.velocity[at][None], probes, axis=0)]),
            still if forward else drive,
            drive if forward else still,
        )
        rows = self._robot.regressor(extended)  # (m + probes, k, p)
        measured = np.array([state.position for state in window])
        centre = motion.position[at][None], motion.velocity[at][None]
        return Equation(
            window[at].stamp_ns,
            (window[-1].stamp_ns - window[0].stamp_ns) * 1e-9,
            Motion(*centre, motion.acceleration, motion.effort),
            np.tensordot(weights.form.averaging, rows[:m], axes=1),
            rows[m + 1 :] - rows[m],
            joints,
            friction_slack(self._robot, motion, measured, weights.form),
        )

    def _weights(self, offsets_ns: np.ndarray, *, measured: bool) -> _Weights:
        cached = self._cached
        if cached and cached[1] == measured and np.array_equal(cached[0], offsets_ns):
            return cached[2]
        times = offsets_ns * 1e-9
        form = WeakForm.from_velocities(times) if measured else WeakForm.from_positions(times)
        weights = _Weights(form, *polynomial_smoother(times, self._degree))
        self._cached = (offsets_ns, measured, weights)
        return weights


@dataclass(frozen=True, slots=True, eq=False)
class _Weights:
    form: WeakForm
    values: np.ndarray
    slopes: np.ndarray
