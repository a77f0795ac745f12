"""Controllers that any simulated robot may use.

A controller is a function of time and of the measured state; it is asked once a sample and its
command holds until the next one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.simulation.mechanism import Mechanism, SimulatedJoint

_LOWEST_HZ, _HIGHEST_HZ = 0.1, 3.0

Controller = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
"""From time [s], measured position (k,) and velocity (k,) to the command (m,)."""

ControllerBuild = Callable[['Mechanism', np.random.Generator, float], 'Controller | None']
"""From mechanism, generator and sampling period [s] to a controller; None leaves the command to
whoever steps the simulation."""


@dataclass(frozen=True, slots=True, eq=False)
class ControllerChoice:
    """A controller of a robot with the state from which it starts.

    Attributes:
        build: makes the controller.
        position: (k,) at the start [rad or m].
        velocity: (k,) at the start [rad/s or m/s].
    """

    build: ControllerBuild
    position: tuple[float, ...]
    velocity: tuple[float, ...]


def sinusoids(
    rms: Sequence[float], *, count: int = 8, avoided_hz: tuple[float, float] = (0.0, 0.0)
) -> ControllerBuild:
    """Build a mix of sinusoids of random phases and of random frequencies from 0.1 to 3 Hz.

    Source: Wu and Movellan, section IV.B, who give neither number nor range.

    Args:
        rms: (m,) root mean square of each command [unit of the command].
        count: number of sinusoids per command.
        avoided_hz: a band without frequencies, such as a resonance that leads far away.
    """
    start_hz, end_hz = avoided_hz
    highest_hz = _HIGHEST_HZ - (end_hz - start_hz)

    def build(
        _mechanism: Mechanism, rng: np.random.Generator, _period_s: float
    ) -> Controller | None:
        shape = (len(rms), count)
        frequency = rng.uniform(_LOWEST_HZ, highest_hz, shape)
        frequency = frequency + (end_hz - start_hz) * (frequency > start_hz)
        rate = 2.0 * math.pi * frequency
        phase = rng.uniform(0.0, 2.0 * math.pi, shape)
        amplitude = np.asarray(rms, dtype=np.float64)[:, np.newaxis] * math.sqrt(2.0 / count)
        return lambda t, _q, _v: np.sum(amplitude * np.sin(rate * t + phase), axis=1)

    return build


def zero(m: int) -> ControllerBuild:
    """Build a controller that commands nothing, for m commands."""
    return lambda _mechanism, _rng, _period_s: lambda _t, _q, _v: np.zeros(m)


def external(
    _mechanism: Mechanism, _rng: np.random.Generator, _period_s: float
) -> Controller | None:
    """Leave the command to whoever steps the simulation."""
    return None


@dataclass(frozen=True, slots=True, eq=False)
class Multisine:
    """`r(t) = centre + sum amplitude sin(rate t + phase)` for m joints with c sinusoids each.

    Attributes:
        centre: (m,) [rad or m].
        amplitude: (m, c) [rad or m].
        rate: (m, c) [rad/s].
        phase: (m, c) [rad].
    """

    centre: np.ndarray
    amplitude: np.ndarray
    rate: np.ndarray
    phase: np.ndarray

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position, velocity and acceleration at time t [s], (m,) each."""
        angle = self.rate * t + self.phase
        wave = self.amplitude * np.sin(angle)
        slope = self.amplitude * self.rate * np.cos(angle)
        bend = -wave * self.rate**2
        return self.centre + wave.sum(axis=1), slope.sum(axis=1), bend.sum(axis=1)


def random_multisine(
    rng: np.random.Generator,
    centre: np.ndarray,
    span: np.ndarray,
    *,
    lowest_hz: float = 0.08,
    highest_hz: float = 1.6,
    count: int = 6,
) -> Multisine:
    """Return sinusoids of random frequencies and phases whose amplitudes fall with frequency.

    The frequencies are spread over the band, so that two references of equal band move a robot
    alike.

    Args:
        rng: source of the numbers.
        centre: (m,) [rad or m].
        span: (m,) largest distance from the centre [rad or m].
        lowest_hz: of the frequencies [Hz].
        highest_hz: of the frequencies [Hz].
        count: sinusoids per joint.
    """
    shape = (len(centre), count)
    place = (np.arange(count) + rng.random(shape)) / count  # one in each part of the band
    hz = lowest_hz * (highest_hz / lowest_hz) ** place
    weight = rng.uniform(0.3, 1.0, shape) / (0.3 + hz)
    amplitude = span[:, np.newaxis] * weight / weight.sum(axis=1, keepdims=True)
    phase = rng.uniform(0.0, 2.0 * math.pi, shape)
    return Multisine(centre, amplitude, 2.0 * math.pi * hz, phase)


_COUNT = 5
_TRACKED_HZ = (0.1, 0.8)
_RMS_M = 0.08
_BANDWIDTH = 15.0
_JOINT_BANDWIDTH = 8.0
_LARGEST_SPAN = 1.2
_SHARE_OF_RANGE = 0.35


def pd_reference(
    mechanism: Mechanism, rng: np.random.Generator, _period_s: float
) -> Controller | None:
    """Build the tracking of a random multi-sine that starts at rest at the origin.

    The reference is the sum of `+-A (1 - cos(2 pi f t))` with f between 0.1 and 0.8 Hz, 0.08 m rms
    about its mean; the gains give critical damping at 15 rad/s.
    """
    mass = next(c.value for c in mechanism.coefficients() if c.name == 'M')
    rate = 2.0 * math.pi * rng.uniform(*_TRACKED_HZ, _COUNT)
    amplitude = rng.choice([-1.0, 1.0], _COUNT) * _RMS_M * math.sqrt(2.0 / _COUNT)
    stiffness, damping = mass * _BANDWIDTH**2, 2.0 * mass * _BANDWIDTH

    def control(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        position = float(np.sum(amplitude * (1.0 - np.cos(rate * t))))
        velocity = float(np.sum(amplitude * rate * np.sin(rate * t)))
        return np.array([stiffness * (position - q[0]) + damping * (velocity - v[0])])

    return control


def computed_force(
    nominal: Mechanism,
    joints: tuple[SimulatedJoint, ...],
    motors: tuple[int, ...],
    reference: Multisine,
    bandwidth: float = _JOINT_BANDWIDTH,
    damping_ratio: float = 0.8,
) -> Controller:
    """Return the computed force that makes the motor joints follow a reference.

    With `a = A (u + h)`, A and h of the nominal robot at the reference of the motor joints and at
    the measured state of the passive ones, u is such that the motor joints accelerate by
    `a_ref + 2 zeta w (v_ref - v) + w^2 (q_ref - q)` (partial feedback linearisation, Spong 1994).
    It is clipped at the limits of the motors.

    Args:
        nominal: what the controller knows of the robot; its commands are forces.
        joints: k of them.
        motors: index of the joint that each of the m commands drives.
        reference: of the m motor joints.
        bandwidth: w [rad/s].
        damping_ratio: zeta.
    """
    index = list(motors)
    limit = np.array([joints[j].effort for j in index])

    def control(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        q_ref, v_ref, a_ref = reference.at(t)
        position, velocity = q.copy(), v.copy()
        position[index], velocity[index] = q_ref, v_ref
        inverse_mass, force = nominal.dynamics(position, velocity)
        wanted = a_ref + 2.0 * damping_ratio * bandwidth * (v_ref - v[index])
        wanted = wanted + bandwidth**2 * (q_ref - q[index])
        lacking = wanted - (inverse_mass @ force)[index]
        u = np.linalg.solve(inverse_mass[np.ix_(index, index)], lacking)
        return np.clip(u, -limit, limit)

    return control


def multisine_tracking(
    joints: tuple[SimulatedJoint, ...], motors: tuple[int, ...], gains: np.ndarray
) -> ControllerBuild:
    """Build the tracking of a random reference about the middle of each motor joint's range.

    Args:
        joints: k of them.
        motors: index of the joint that each of the m commands drives.
        gains: (m,) force per unit of the command [N m or N per unit].
    """
    centre, reach = middle_and_reach(joints)

    def build(
        mechanism: Mechanism, rng: np.random.Generator, _period_s: float
    ) -> Controller | None:
        index = list(motors)
        reference = random_multisine(rng, centre[index], reach[index])
        force = computed_force(mechanism, joints, motors, reference)
        return lambda t, q, v: force(t, q, v) / gains

    return build


def middle_and_reach(joints: tuple[SimulatedJoint, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle of each joint's range and how far a reference goes from it, (k,) each."""
    middle, reach = np.zeros(len(joints)), np.full(len(joints), _LARGEST_SPAN)
    for i, joint in enumerate(joints):
        if math.isfinite(joint.lower + joint.upper):
            middle[i] = 0.5 * (joint.lower + joint.upper)
            reach[i] = min(_SHARE_OF_RANGE * (joint.upper - joint.lower), _LARGEST_SPAN)
    return middle, reach
