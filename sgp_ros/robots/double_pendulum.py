"""A planar double pendulum with a geared motor in each joint (inverse model).

Both angles are zero hanging; the elbow's is relative to the upper link. Links have masses m,
distances r to the centre of mass, inertias I about their own joints; the upper link has length
l1; behind a gear of ratio g_r each joint has a rotor of inertia I_r. The torques depend on

    J1 = I1 + I2 + m2 l1^2 + (g_r^2 + 1) I_r    J12 = I2 - g_r I_r    J2 = I2 + g_r^2 I_r
    H = m2 l1 r2                                G1 = (m1 r1 + m2 l1) g    G2 = m2 r2 g

alone: the mass matrix is `[[J1 + 2 H cos q2, J12 + H cos q2], [J12 + H cos q2, J2]]`.
"""

from __future__ import annotations

import numpy as np

from sgp_ros.physics.term import Coefficient, Joint, Motion, Term
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.terms import (
    Signal,
    acceleration,
    constant,
    direction,
    sine,
    single_column,
    velocity,
)

_SHOULDER, _ELBOW = 0, 1
_JOINTS = (Joint('shoulder'), Joint('elbow'))
_SOURCE = 'Wiebe et al. 2023, open source dual-purpose acrobot and pendubot platform'


def _own(name: str, unit: str, axis: int, signal: Signal) -> Term:
    return single_column(Coefficient(name, unit, _JOINTS[axis].name), axis, signal, _SOURCE)


def _inertia_between(motion: Motion) -> np.ndarray:
    """Each acceleration in the equation of the other joint."""
    return motion.acceleration[:, ::-1, None]


def _moving_mass(motion: Motion) -> np.ndarray:
    """What the lower link's first moment does at distance l1: inertia, Coriolis, centrifugal."""
    cosine, sine_q2 = np.cos(motion.position[:, 1]), np.sin(motion.position[:, 1])
    (v1, v2), (a1, a2) = motion.velocity.T, motion.acceleration.T
    shoulder = cosine * (2.0 * a1 + a2) - sine_q2 * v2 * (2.0 * v1 + v2)
    return np.stack([shoulder, cosine * a1 + sine_q2 * v1**2], axis=1)[:, :, None]


def _lower_gravity(motion: Motion) -> np.ndarray:
    lift = np.sin(motion.position.sum(axis=1))
    return np.stack([lift, lift], axis=1)[:, :, None]


DOUBLE_PENDULUM = Robot(
    name='double_pendulum',
    joints=_JOINTS,
    target='effort',
    terms=(
        _own('J1', 'kg m^2', _SHOULDER, acceleration(_SHOULDER)),
        Term((Coefficient('J12', 'kg m^2'),), _inertia_between, _SOURCE),
        _own('J2', 'kg m^2', _ELBOW, acceleration(_ELBOW)),
        Term((Coefficient('H', 'kg m^2'),), _moving_mass, _SOURCE),
        _own('G1', 'N m', _SHOULDER, sine(_SHOULDER)),
        Term((Coefficient('G2', 'N m'),), _lower_gravity, _SOURCE),
        _own('Fv1', 'N m s/rad', _SHOULDER, velocity(_SHOULDER)),
        _own('Fv2', 'N m s/rad', _ELBOW, velocity(_ELBOW)),
        _own('Fc1', 'N m', _SHOULDER, direction(_SHOULDER)),
        _own('Fc2', 'N m', _ELBOW, direction(_ELBOW)),
        _own('offset1', 'N m', _SHOULDER, constant),
        _own('offset2', 'N m', _ELBOW, constant),
    ),
    residual_inputs=(
        ('position:shoulder', 'velocity:shoulder'),
        ('position:elbow', 'velocity:elbow'),
    ),
    description='Planar double pendulum with rotors, viscous and Coulomb friction, offsets',
)
