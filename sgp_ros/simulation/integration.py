"""Integration of a plant over a short step, with the switches of dry friction located in time.

Between switches the equation is smooth, so the classical Runge-Kutta method of order 4 keeps its
order. When a sliding joint with dry friction would pass through zero velocity inside the step, the
time of that is found, the velocity is set to exactly 0, and the joint either sticks or slides on.
A joint that sticks stays at exactly 0: there is nothing that could chatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.simulation.plant import Inputs, Plant

_AT_REST = 1e-12
_SAME_TIME = 1e-12
_MOST_ITERATIONS = 60
_MOST_SWITCHES = 20


def integrate(plant: Plant, time_s: float, y: np.ndarray, h: float, inputs: Inputs) -> np.ndarray:
    """Return the state after one step.

    Args:
        plant: the dynamics.
        time_s: at the start of the step [s].
        y: (2 k + s,) state at the start.
        h: length of the step [s].
        inputs: constant over the step.
    """
    if not plant.has_dry_friction:
        return _Flow(plant, time_s, y, inputs, ()).after(h)
    rest = h
    for _ in range(_MOST_SWITCHES):
        directions = plant.directions(time_s, y, inputs)
        flow = _Flow(plant, time_s, y, inputs, directions)
        after = flow.after(rest)
        if _margin(flow, after) >= 0.0:
            return after
        passed, y = _first_rest(flow, after, rest)
        time_s, rest = time_s + passed, rest - passed
        if rest <= 0.0:
            return y
    return _Flow(plant, time_s, y, inputs, plant.directions(time_s, y, inputs)).after(rest)


@dataclass(frozen=True, slots=True, eq=False)
class _Flow:
    """The motion from one state on, as long as no joint changes its direction of sliding."""

    plant: Plant
    time_s: float
    y: np.ndarray
    inputs: Inputs
    directions: Sequence[int]

    def after(self, h: float) -> np.ndarray:
        """Return the state `h` later by one step of Runge and Kutta, O(h^5)."""
        half, t, y = 0.5 * h, self.time_s, self.y
        k1 = self._rate(t, y)
        k2 = self._rate(t + half, y + half * k1)
        k3 = self._rate(t + half, y + half * k2)
        k4 = self._rate(t + h, y + h * k3)
        return np.asarray(y + (h / 6.0) * (k1 + 2.0 * (k2 + k3) + k4))

    def _rate(self, time_s: float, y: np.ndarray) -> np.ndarray:
        return self.plant.derivative(time_s, y, self.inputs, self.directions)


def _first_rest(flow: _Flow, after: np.ndarray, longest: float) -> tuple[float, np.ndarray]:
    """Return when a sliding joint comes to rest, with the state at that time.

    Regula falsi with a tilted line (as of Illinois), velocities being nearly straight over so
    short a time; bisection where a joint has only just started.

    Args:
        flow: the motion, in which all joints slide as they should at first.
        after: (2 k + s,) state after `longest`, in which some joint has reversed.
        longest: upper limit of the time [s].
    """
    low, high, y = 0.0, longest, after
    above, below = _margin(flow, flow.y), _margin(flow, after)
    weight = 1.0  # of `above` against `below`; tilts the line when one end stays where it is
    for _ in range(_MOST_ITERATIONS):
        if below > -_AT_REST or high - low <= _SAME_TIME * longest:
            break
        share = weight * above / (weight * above - below) if above > 0.0 else 0.5
        middle = low + share * (high - low)
        y_middle = flow.after(middle)
        margin = _margin(flow, y_middle)
        if margin < 0.0:
            high, y, below = middle, y_middle, margin
            weight = min(0.5 * weight, 1.0)
        else:
            low, above = middle, margin
            weight = max(2.0 * weight, 1.0)
    speeds = flow.plant.sliding(y) * flow.directions
    return high, flow.plant.stopped(y, np.flatnonzero(speeds < 0.0))


def _margin(flow: _Flow, y: np.ndarray) -> float:
    """Return the smallest speed in the direction of sliding; negative once a joint reversed."""
    speeds = flow.plant.sliding(y).tolist()
    return min((w * d for w, d in zip(speeds, flow.directions, strict=True) if d), default=0.0)
