"""How machines move in production and when they are identified, and the servo that makes them.

A motion is a table over time, so that each kind is built from pieces: moves with trapezoidal speed
that the limit of the jerk rounds, dwells between them, sweeps, and Fourier excitation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

_STEP_S = 2e-3
_ROUNDED_S = 0.04
KINDS = ('one_by_one', 'together', 'cycles', 'sweep', 'fourier')
"""Kinds of motion; `cycles` repeats a few moves all the time."""


@dataclass(frozen=True)
class Plan:
    """A planned motion of k joints, by tables at even times.

    Attributes:
        position: (n, k) [rad or m].
        velocity: (n, k) [rad/s or m/s].
        acceleration: (n, k) [rad/s^2 or m/s^2].
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

    @classmethod
    def of(cls, position):
        """Round a table of positions (n, k) and differentiate it."""
        for _ in range(2):
            position = uniform_filter1d(
                position, round(_ROUNDED_S / _STEP_S), axis=0, mode='nearest'
            )
        velocity = np.gradient(position, _STEP_S, axis=0)
        return cls(position, velocity, np.gradient(velocity, _STEP_S, axis=0))

    def at(self, t):
        """Return position, velocity and acceleration at time t [s], (k,) each."""
        place = min(t / _STEP_S, len(self.position) - 1.001)
        i = int(place)
        share = place - i
        return tuple(
            (1.0 - share) * table[i] + share * table[i + 1]
            for table in (self.position, self.velocity, self.acceleration)
        )


def plan(rng, kind, seconds, bodies, gears):
    """Return a motion of one kind.

    Args:
        rng: of the motion.
        kind: one of `KINDS`.
        seconds: it lasts at least [s].
        bodies: of the machine.
        gears: of the machine, which say how fast it moves.
    """
    count = int((seconds + 1.0) / _STEP_S)
    if kind == 'fourier':
        return Plan.of(_fourier(rng, count, bodies, gears))
    if kind == 'sweep':
        return Plan.of(_sweep(rng, count, bodies, gears))
    span = np.array([body.span for body in bodies])
    here, tables, total = rng.uniform(-1.0, 1.0, len(bodies)) * span, [], 0
    places = [rng.uniform(-1.0, 1.0, len(bodies)) * span for _ in range(int(rng.integers(3, 6)))]
    speeds = rng.choice([0.3, 0.6, 1.0], len(places))
    turn = 0
    while total < count:
        if kind == 'cycles':
            there, pace = places[turn % len(places)], speeds[turn % len(places)]
        else:
            there, pace = rng.uniform(-1.0, 1.0, len(bodies)) * span, rng.choice([0.3, 0.6, 1.0])
            if kind == 'one_by_one':
                moved = turn % len(bodies)
                there = np.where(np.arange(len(bodies)) == moved, there, here)
        table = _move(here, there, pace, gears)
        tables += [table, np.repeat(there[None, :], int(rng.uniform(0.1, 1.0) / _STEP_S), axis=0)]
        total += len(tables[-2]) + len(tables[-1])
        here, turn = there, turn + 1
    return Plan.of(np.vstack(tables)[:count])


def _move(here, there, pace, gears):
    """Return positions (n, k) of a move with trapezoidal speed that all joints end together."""
    way = np.abs(there - here)
    top = pace * np.array([gear.speed for gear in gears])
    rise = np.array([gear.acceleration for gear in gears])
    alone = np.where(way > top**2 / rise, way / top + top / rise, 2.0 * np.sqrt(way / rise))
    end = max(float(alone.max()), 0.1)
    corner = 0.5 * (end - np.sqrt(np.maximum(end**2 - 4.0 * way / rise, 0.0)))
    corner = np.maximum(corner, 1e-6)
    t = np.arange(int(end / _STEP_S) + 1)[:, None] * _STEP_S  # (n, 1)
    top = way / (end - corner)
    up = 0.5 * top / corner * t**2
    cruise = top * (t - 0.5 * corner)
    down = way - 0.5 * top / corner * np.maximum(end - t, 0.0) ** 2
    gone = np.where(t < corner, up, np.where(t < end - corner, cruise, down))
    return here + np.sign(there - here) * gone


def _sweep(rng, count, bodies, gears):
    """Return slow strokes to and fro at constant speed, each joint with its own."""
    t = np.arange(count) * _STEP_S
    columns = []
    for body, gear in zip(bodies, gears, strict=True):
        speed = gear.speed * np.where(np.sin(0.25 * t + rng.uniform(0.0, 6.0)) > 0.0, 0.15, 0.5)
        way = np.cumsum(speed) * _STEP_S + rng.uniform(0.0, 4.0) * body.span
        columns.append(np.abs((way % (4.0 * body.span)) - 2.0 * body.span) - body.span)
    return np.column_stack(columns)


def _fourier(rng, count, bodies, gears):
    """Return the excitation of identification, five harmonics of a tenth of a hertz, small."""
    t = np.arange(count)[:, None] * _STEP_S
    rate = 2.0 * np.pi * 0.1 * np.array([1, 2, 3, 5, 8])
    columns = []
    for body, gear in zip(bodies, gears, strict=True):
        size = rng.uniform(0.3, 1.0, 5) / np.sqrt(rate)
        wave = np.sin(rate * t + rng.uniform(0.0, 6.3, 5)) @ size
        slope = np.gradient(wave, _STEP_S)
        scale = min(0.7 * body.span / np.abs(wave).max(), gear.speed / np.abs(slope).max())
        columns.append(scale * wave)
    return np.column_stack(columns)


def servo(mechanism, inertia, reference, bandwidth):
    """Return the servo of each joint: stiff, with the weight of the nominal robot fed forward.

    Args:
        mechanism: nominal robot.
        inertia: (k,) that the drives are tuned to, rotors included [kg m^2 or kg].
        reference: motion to follow.
        bandwidth: w of `a_ref + 2 w (v_ref - v) + w^2 (q_ref - q)` [rad/s].
    """
    still = np.zeros(len(inertia))

    def control(t, q, v):
        q_ref, v_ref, a_ref = reference.at(t)
        wanted = a_ref + 2.0 * bandwidth * (v_ref - v) + bandwidth**2 * (q_ref - q)
        return inertia * wanted - mechanism.dynamics(q_ref, still)[1]

    return control
