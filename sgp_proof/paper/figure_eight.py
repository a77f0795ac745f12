"""A three-joint arm that follows figure-eight curves under proportional control.

The first joint turns about the vertical, the other two pitch; the tip follows a curve in a
horizontal or a vertical plane (Wu and Movellan, figure 8). Dry friction of the third joint grows
towards its limits, which both curves approach.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_proof.paper.serial_arm import ArmLink, JointFriction, SerialArm

SHOULDER, UPPER, FORE = 0.3, 0.4, 0.35
"""Height of the second joint, length of the second and of the third link [m]."""
GAIN = np.array([100.0, 120.0, 40.0])
"""Proportional gains [N m/rad]."""
STEP_S, STEPS_A_SAMPLE = 1e-3, 10
SETTLING = 50
"""Samples that are dropped at the start, while the arm catches up with its reference."""
MEMORY = 0.9
"""Correlation of the disturbance from one sample to the next."""

ARM = SerialArm(
    (
        ArmLink((0, 0, 1), (0, 0, SHOULDER), 4.0, (0.02, 0.01, -0.1),
                (0.030, 0.001, 0.030, 0.002, -0.003, 0.025)),
        ArmLink((0, 1, 0), (0, 0, 0), 2.0, (0.2, 0.005, 0.01),
                (0.004, 0.001, 0.030, 0.002, -0.001, 0.030)),
        ArmLink((0, 1, 0), (UPPER, 0, 0), 1.0, (0.18, -0.005, 0.01),
                (0.002, 0.0005, 0.012, 0.0003, -0.0002, 0.012)),
    ),
    (
        JointFriction(2.0, 0.6),
        JointFriction(2.0, 0.6),
        JointFriction(0.5, 0.3, growth=2.5, lower=0.5, upper=2.4, onset=0.7),
    ),
    width=0.02,
)  # fmt: skip
"""The arm of the experiment: yaw, pitch, pitch."""


@dataclass(frozen=True, slots=True)
class FigureEight:
    """`centre + size (along sin(phi) + across sin(2 phi))`, `phi = 2 pi t / period + phase`.

    Attributes:
        centre: of the curve [m].
        along: half its length with its direction [m].
        across: half its width with its direction [m].
        period: of one turn [s].
        phase: at the start [rad].
        swing: share by which the size swings, so that lobes differ from turn to turn.
        swing_period: of that swing [s].
    """

    centre: tuple[float, float, float]
    along: tuple[float, float, float]
    across: tuple[float, float, float]
    period: float
    phase: float = 0.0
    swing: float = 0.0
    swing_period: float = 1.0

    def at(self, time: np.ndarray) -> np.ndarray:
        """Return the points at times (n,) [s], (n, 3) [m]."""
        phi = 2.0 * np.pi * time[:, None] / self.period + self.phase
        size = 1.0 + self.swing * np.sin(2.0 * np.pi * time[:, None] / self.swing_period)
        shape = np.sin(phi) * np.array(self.along) + np.sin(2.0 * phi) * np.array(self.across)
        return np.array(self.centre) + size * shape


@dataclass(frozen=True, slots=True, eq=False)
class ArmRun:
    """True motion and torque of a run at its n samples; each array is (n, 3).

    Attributes:
        position: [rad].
        velocity: [rad/s].
        acceleration: [rad/s^2].
        torque: of controller and disturbance together [N m].
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    torque: np.ndarray


def joint_positions(points: np.ndarray) -> np.ndarray:
    """Return the joint positions that bring the tip to points (n, 3), elbow up, (n, 3) [rad].

    Raises:
        ValueError: a point out of reach.
    """
    x, y, z = points.T
    reach, height = np.hypot(x, y), z - SHOULDER
    cosine = (reach**2 + height**2 - UPPER**2 - FORE**2) / (2.0 * UPPER * FORE)
    if np.any(np.abs(cosine) > 1.0):
        raise ValueError('the curve leaves the reach of the arm')
    elbow = np.arccos(cosine)
    lift = np.arctan2(height, reach) + np.arctan2(
        FORE * np.sin(elbow), UPPER + FORE * np.cos(elbow)
    )
    return np.column_stack([np.arctan2(y, x), -lift, elbow])


def tip_positions(q: np.ndarray) -> np.ndarray:
    """Return where the tip is at joint positions (n, 3) [rad], (n, 3) [m]."""
    height = SHOULDER - UPPER * np.sin(q[:, 1]) - FORE * np.sin(q[:, 1] + q[:, 2])
    reach = UPPER * np.cos(q[:, 1]) + FORE * np.cos(q[:, 1] + q[:, 2])
    return np.column_stack([reach * np.cos(q[:, 0]), reach * np.sin(q[:, 0]), height])


def follow(
    curves: tuple[FigureEight, ...],
    count: int,
    disturbance: np.ndarray,
    rng: np.random.Generator,
    arm: SerialArm = ARM,
) -> tuple[ArmRun, ...]:
    """Follow curves at 100 samples a second by `torque = GAIN (reference - position)`.

    All curves are followed at once, each by its own arm; classical Runge-Kutta of 1 ms.

    Args:
        curves: one per run.
        count: samples per run that are kept.
        disturbance: (3,) standard deviation of a torque that shakes the joints [N m].
        rng: of the disturbance.
        arm: the true dynamics.
    """
    samples = count + SETTLING
    times = 0.5 * STEP_S * np.arange(2 * STEPS_A_SAMPLE * samples + 1)
    reference = np.stack([joint_positions(c.at(times)) for c in curves], axis=1)
    shaking = disturbance * _coloured(rng.standard_normal((samples, len(curves), 3)))
    y = np.stack([reference[0], np.zeros_like(reference[0])])  # position, velocity
    kept = []
    for sample in range(samples):
        first = 2 * STEPS_A_SAMPLE * sample
        kept.append(_seen(arm, y, reference[first], shaking[sample]))
        for step in range(STEPS_A_SAMPLE):
            targets = reference[first + 2 * step : first + 2 * step + 3]
            y = _advanced(arm, y, targets, shaking[sample])
    found = np.stack(kept[SETTLING:])  # (count, 4, runs, 3)
    return tuple(ArmRun(*np.moveaxis(found[:, :, run], 1, 0)) for run in range(len(curves)))


def _coloured(white: np.ndarray) -> np.ndarray:
    """Return noise of the same deviation with correlation `MEMORY` from row to row."""
    noise = white.copy()
    for i in range(1, len(noise)):
        noise[i] = MEMORY * noise[i - 1] + np.sqrt(1.0 - MEMORY**2) * white[i]
    return noise


def _seen(arm: SerialArm, y: np.ndarray, reference: np.ndarray, shaking: np.ndarray) -> np.ndarray:
    torque = GAIN * (reference - y[0]) + shaking
    return np.stack([*y, arm.acceleration(y[0], y[1], torque), torque])


def _advanced(
    arm: SerialArm, y: np.ndarray, references: np.ndarray, shaking: np.ndarray
) -> np.ndarray:
    """Return the state one step later, by the references at its start, middle and end."""

    def rate(y: np.ndarray, reference: np.ndarray) -> np.ndarray:
        torque = GAIN * (reference - y[0]) + shaking
        return np.stack([y[1], arm.acceleration(y[0], y[1], torque)])

    start, middle, end = references
    k1 = rate(y, start)
    k2 = rate(y + 0.5 * STEP_S * k1, middle)
    k3 = rate(y + 0.5 * STEP_S * k2, middle)
    k4 = rate(y + STEP_S * k3, end)
    return y + STEP_S / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
