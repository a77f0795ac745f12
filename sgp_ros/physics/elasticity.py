"""Springs between motor and link.

A hidden state enters the equations of motion without being simulated. The twist of the spring
follows from the torque in it, `(K + D d/dt) delta = tau`, and this torque from the balance of
either side; none of the two resonates, so the force that the spring makes is a polynomial in d/dt
of known signals, whatever the resonance. Its derivatives are taken up to the bandwidth of the
motion, see `smooth`. Source: Spong 1987.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numba import njit

from sgp_ros.physics.drawing import Drawn, Scene, UnsuitableError
from sgp_ros.physics.effect import Effect, Numbers
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import (
    MOTOR,
    Place,
    Placed,
    Quantity,
    SmallEffect,
    Value,
    relative_scales,
)

_POSES = 200
_MOST_OF_LINK = 0.95
_LEAST_OF_LINK = 0.005
_SOFTEST_HZ = 1.0
"""Frequency of the link on its spring below which no joint is a joint."""
_SOFT = 0.9
"""Part of that softness from which on a fit has run into its bound."""
_SETTLING = 0.2
"""Longest ratio of damping to stiffness, relative to the period of the softest spring."""
_WIDER = 2.0
"""Frequency at which half is left of signals that are differentiated, over the bandwidth."""
_SHARP = 5.0
_SECOND = np.convolve([1 / 90, -1 / 12 - 4 / 90, 1 + 2 / 12 + 6 / 90, -1 / 12 - 4 / 90, 1 / 90],
                      [1.0, -2.0, 1.0])  # fmt: skip
_FIRST = np.array([1.0, -9.0, 45.0, 0.0, -45.0, 9.0, -1.0]) / 60.0


def _convolved(x: np.ndarray, weights: np.ndarray, starts: tuple[int, ...]) -> np.ndarray:
    """Return x (n,) under symmetric or odd weights, the ends repeated, stretch by stretch."""
    ends, parts = np.ones(len(weights) // 2), []
    for part in np.split(x, starts[1:]):
        padded = np.concatenate([part[0] * ends, part, part[-1] * ends])
        parts.append(np.convolve(padded, weights, mode='valid'))
    return np.concatenate(parts)


def smooth(motion: SeenMotion, x: np.ndarray) -> np.ndarray:
    """Return a signal (n,) without what lies far above the bandwidth, where no equation is."""
    wide = _WIDER * motion.bandwidth * motion.step
    if not wide < 0.4:
        return x
    return _convolved(x, _low_pass(wide), motion.starts)


@lru_cache(maxsize=16)
def _low_pass(wide: float) -> np.ndarray:
    """Return weights of a low-pass filter of unit gain, for a frequency per row."""
    half = max(2, round(1.6 / wide))
    t = np.arange(-half, half + 1)
    weights = np.sinc(2.0 * wide * t) * np.kaiser(len(t), _SHARP)
    return np.asarray(weights / weights.sum())


def derivatives(motion: SeenMotion, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the first and the second derivative of a smooth signal, (n,) each."""
    return (_convolved(x, _FIRST, motion.starts) / motion.step,
            _convolved(x, _SECOND, motion.starts) / motion.step**2)  # fmt: skip


@njit(cache=True)
def _behind(x: np.ndarray, time_constant: complex, step: float) -> np.ndarray:
    """Return y of `T y' + y = x`, exact where x is straight between rows; it starts settled."""
    y = x.copy()
    if abs(time_constant) <= 1e-6 * step:
        return y
    keep = np.exp(-step / time_constant)
    slow = (1.0 - keep) * time_constant / step
    for i in range(1, len(x)):
        y[i] = keep * y[i - 1] + (slow - keep) * x[i - 1] + (1.0 - slow) * x[i]
    return y


def resonator(
    u: np.ndarray, a: float, b: float, step: float, *, is_settled: bool = True
) -> np.ndarray:
    """Return y of `a y'' + b y' + y = b u' + u` by partial fractions.

    It starts settled under the first u, or else at rest at 0.
    """
    root = np.sqrt(complex(b * b - 4.0 * a))
    root = root if abs(root) > 1e-6 * abs(b) else complex(1e-6 * b)
    y = np.zeros(len(u), dtype=np.complex128)
    for sign in (1.0, -1.0):
        pole = (sign * root - b) / (2.0 * a)
        residue = (b * pole + 1.0) / (sign * root)
        part = _behind(u.astype(np.complex128), -1.0 / pole, step)
        if not is_settled:
            part -= u[0] * np.exp(pole * step * np.arange(len(u)))
        y += -residue / pole * part
    return y.real


def _some(motion: SeenMotion) -> slice:
    return slice(None, None, max(1, len(motion.time) // _POSES))


def twist_of(
    motion: SeenMotion, place: Place, shape: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return by how much the motor leads the link per 1/K, and two derivatives, (n,) each."""
    j, (J, _, settling) = place.joint, shape
    given = motion.effort[:, j] if place.kind == 'motor' else motion.nominal_effort[:, j]
    torque = smooth(motion, given - J * motion.acceleration[:, j])
    parts = [_behind(x, settling, motion.step) for x in np.split(torque, motion.starts[1:])]
    twist = np.concatenate(parts)
    return twist, *derivatives(motion, twist)


def _of_softness(motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    """Return the force per 1/K of a motor and a settling time, (n, 1) or (n, k, 1)."""
    j, J = place.joint, shape[0]
    twist, speed, change = twist_of(motion, place, shape)
    if place.kind == 'link':
        return np.asarray(-J * change[:, None])
    by_q, by_v, by_a = motion.effort_slopes(j)
    force = by_q * twist[:, None] + by_v * speed[:, None] + by_a * change[:, None]
    force[:, j] -= J * change
    return np.asarray(force[:, :, None])


class JointElasticity(Effect):
    """A spring between motor and link, the motor's inertia being part of the nominal one.

    With J, K and D of motor, spring and damper and `tau` the torque in the spring,
    `J theta'' + tau = u`, `(K + D d/dt)(theta - q) = tau`. Encoder on the link: the nominal robot
    has `tau = M q'' + h - J q''` and lacks `J (theta - q)''`. Encoder on the motor:
    `tau = u - J theta''`, and the nominal efforts, but for those of the motor, are those of
    another position; to first order in the twist. Shape is (J, 1/K, D/K).
    """

    name = 'joint_elasticity'
    words = 'an elastic joint'
    formula = (
        'u = motor_inertia ddtheta + tau, tau = stiffness (theta - q) + damping (dtheta - dq)'
    )
    source = 'Spong 1987'
    appearance = 'the residual effort grows with the fourth derivative of the motion'
    quantities = (
        Quantity('stiffness', 'N m/rad', low=0.0, is_positive=True),
        Quantity('damping', 'N m s/rad', low=0.0, is_scored=False),
        Quantity('motor_inertia', 'kg m2', 1e-12, is_positive=True, is_scored=False),
    )  # fmt: skip
    small = SmallEffect(_of_softness, lambda start, c: np.array([start[0], c[0], start[2]]))
    kinds = ('motor', 'link')
    kind_word = 'encoder'
    site = MOTOR
    drawn_over = 'seconds'
    is_online = False
    uses_bodies = True
    sees_acceleration = True
    has_memory = True

    def model(self, numbers: Numbers, kind: str = '') -> tuple[np.ndarray, np.ndarray]:
        K = numbers['stiffness']
        damping = numbers.get('damping', 0.0)
        return np.array([numbers.get('motor_inertia', math.nan), 1.0 / K, damping / K]), np.ones(1)

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        J, compliance, settling = (float(x) for x in at.shape)
        return {
            'stiffness': 1.0 / compliance, 'damping': settling / compliance, 'motor_inertia': J,
            self.kind_word: at.place.kind,
        }  # fmt: skip

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        return bool(at.shape[0] > 0.0 and at.shape[1] > 0.0 and at.shape[2] >= 0.0)

    def is_inside(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether it is a spring; a fit that ends at the softest one is something else."""
        return bool(at.shape[1] < _SOFT * self.bounds(motion, at.place)[1][1])

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return np.asarray(shape[1] * _of_softness(motion, place, shape))

    def whole(self, motion: SeenMotion, at: Placed) -> np.ndarray:
        """Return the force with its resonance, (n,), as that of a joint whose others are free.

        `c s^2 / (a s^2 + b s + 1)` times the effort, with `a = J (M - J) / (M K)`, `b = D / K`,
        M the inertia while the others are free. c is a, or for an encoder on the motor
        `(M - J) (M_jj - J) / (M K)`.
        """
        j, (J, compliance, settling) = at.place.joint, at.shape
        M = motion.free_inertia(j, _some(motion))
        a = compliance * J * (M - J) / M
        c = a
        if at.place.kind == 'motor':
            c *= (float(motion.mass_diagonal[:, j].mean()) - J) / J
        u = motion.effort[:, j]
        parts = [x - resonator(x, a, settling, motion.step)
                 for x in np.split(u, motion.starts[1:])]  # fmt: skip
        return c / a * np.concatenate(parts)

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return motors and dampers of several sizes; the softness follows from the residual.

        None where nothing is known of the inertia.
        """
        if motion.free_inertia(place.joint, _some(motion)) <= 0.0:
            return np.zeros((0, 3))
        (least, stiff, _), (most, _, slowest) = self.bounds(motion, place)
        return np.array([[J, stiff, T] for J in np.geomspace(least, most, 5)[1:]
                         for T in (0.0, 0.05 * slowest)])  # fmt: skip

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return a little motor, a rigid joint, no damping; and a little link on a soft spring."""
        j = place.joint
        free = motion.free_inertia(j, _some(motion))
        rate = 2.0 * math.pi * _SOFTEST_HZ
        softest = 1.0 / (float(motion.mass_diagonal[:, j].mean()) * rate**2)
        low = np.array([_LEAST_OF_LINK * free, 1e-9 * softest, 0.0])
        return low, np.array([_MOST_OF_LINK * free, softest, _SETTLING / rate])

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return relative_scales(*self.bounds(motion, place), shape)

    def draw(self, scene: Scene) -> Drawn:
        """Return a spring of a motor whose link carries no other, by its softness."""
        bodies, motors = scene.bodies, scene.motors
        leaves = [i for i in motors if not any(b.parent == i for b in bodies)]
        if not leaves:
            raise UnsuitableError(self.name)
        j = scene.choice(leaves)
        body, axis = bodies[j], np.array(bodies[j].axis)
        own = body.mass if body.is_prismatic else axis @ body.inertia @ axis
        motor, ratio = scene.rng.uniform(0.2, 0.5) * own, scene.rng.uniform(0.02, 0.1)
        kind = str(scene.rng.choice(self.kinds))

        def values(size: float) -> dict[str, Value]:
            K = own * (2.0 * math.pi * 10.0) ** 2 / size
            damping = 2.0 * ratio * math.sqrt(K * motor)
            return {'stiffness': K, 'damping': damping, 'motor_inertia': motor,
                    self.kind_word: kind}  # fmt: skip

        return Drawn(0.5, values, 25.0, 2.0, index=j)
