"""Springs between motor and link.

The twist of the spring follows from the torque in it, `(K + D d/dt) delta = tau`, and this torque
from the balance of the side without friction: of the link, where the encoder is on it; else of
the motor, whose friction is then looked for on the link, or of the link, on its spring under a
motor that moves as measured. Derivatives reach up to the bandwidth of the motion, see `smooth`.
Source: Spong 1987.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sgp_ros.physics.drawing import Drawn, Scene, UnsuitableError
from sgp_ros.physics.effect import Effect, Numbers
from sgp_ros.physics.hidden_states import behind, derivatives, on_spring, resonator, smooth
from sgp_ros.physics.memory import BARE, BEYOND
from sgp_ros.physics.motion import SeenMotion, Structure
from sgp_ros.physics.parts import Quantity, SmallEffect, Value, relative_scales
from sgp_ros.physics.place import MOTOR, Place, Placed

_POSES = 200
_MOST_OF_LINK = 0.95
_LEAST_OF_LINK = 0.005
_LEAST_STIFFNESS = 0.1
"""Of spring and gravity together, relative to the spring alone."""
_SOFTEST_HZ = 1.0
"""Frequency of the link on its spring below which no joint is a joint."""
_SOFT, _MOST_BESIDE = 0.9, 20.0
"""Part of that softness at which a fit is at its bound; largest motor beside, over the link."""
_SETTLING = 0.2
"""Longest ratio of damping to stiffness, relative to the period of the softest spring."""


def some_poses(motion: SeenMotion) -> slice:
    """Return the rows, some hundreds at most, in whose poses an inertia is looked at."""
    return slice(None, None, max(1, len(motion.time) // _POSES))


def is_on_motor(place: Place) -> bool:
    """Return whether the encoder is on the motor."""
    return place.kind != 'link'


def _inside(place: Place, shape: np.ndarray) -> float:
    """Return the part of a motor's inertia that the nominal robot has."""
    return 0.0 if place.kind == BARE else float(shape[0])


def _on_motor(motion: SeenMotion, place: Place, shape: np.ndarray) -> float:
    """Return the nominal damping that acts on a motor with the encoder."""
    damping = float(motion.tree.damping[place.joint])
    return float(shape[3]) * damping if is_on_motor(place) else 0.0


def twist_of(
    motion: SeenMotion, place: Place, shape: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return by how much the motor leads the link per 1/K, and two derivatives, (n,) each."""
    j, (J, softness, settling), inside = place.joint, shape[:3], _inside(place, shape)
    share = float(shape[3]) if is_on_motor(place) else 1.0
    a, effort = motion.acceleration[:, j], motion.effort[:, j] - J * motion.acceleration[:, j]
    damping = _on_motor(motion, place, shape)
    link = motion.nominal_effort[:, j] + motion.rotors[j] * a - damping * motion.velocity[:, j]
    given = share * (link - inside * a) + (1.0 - share) * effort
    torque = smooth(motion, given)
    if place.kind == 'link' or share * softness <= 0.0:
        parts = [behind(x, settling, motion.step) for x in np.split(torque, motion.starts[1:])]
    else:
        by_q, by_v, by_a = (x[:, j] for x in motion.effort_slopes(j))
        scale = share * softness
        terms = (scale * np.maximum(by_a - inside, _LEAST_OF_LINK * np.abs(by_a) + 1e-12),
                 np.maximum(settling + scale * (by_v - damping), 0.0),
                 np.maximum(1.0 + scale * by_q, _LEAST_STIFFNESS))  # fmt: skip
        all_ = np.column_stack([torque, *terms, effort, motion.velocity[:, j], a])
        parts = [
            on_spring(x[0], tuple(x[1:4]), x[4], x[5:].T, settling, motion.step)
            for x in (part.T.copy() for part in np.split(all_, motion.starts[1:]))
        ]
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
    force[:, j] -= _inside(place, shape) * change + _on_motor(motion, place, shape) * speed
    return np.asarray(force[:, :, None])


def _word(kind: str) -> str:
    """Return where the encoder is."""
    return 'motor' if kind == BARE else kind


def _with_friction_on_motor(at: Placed) -> np.ndarray | None:
    """Return the shape with friction on the motor in place of the link."""
    is_link = is_on_motor(at.place) and at.shape[3] < 0.5
    return np.array([*at.shape[:3], 1.0]) if is_link else None


class JointElasticity(Effect):
    """A spring between motor and link, the motor's inertia being part of the nominal one.

    With J, K and D of motor, spring and damper and `tau` the torque in the spring,
    `J theta'' + tau = u`, `(K + D d/dt)(theta - q) = tau`. Encoder on the link: the nominal robot
    has `tau = M q'' + h - J q''` and lacks `J (theta - q)''`. Encoder on the motor:
    `tau = u - J theta''`, and the nominal efforts, but for those of the motor, are those of
    another position; to first order in the twist. Shape is (J, 1/K, D/K), and with the encoder on
    the motor the part of the friction that is there. `BARE` is for robot files without rotors: the
    inertia of the link is then all that the nominal robot has; see `motor_beside`.
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
        Quantity('motor_friction', '1', is_optional=True, is_scored=False, kinds=('motor',)),
    )  # fmt: skip
    small = SmallEffect(
        _of_softness, lambda start, c: np.array([start[0], c[0], *start[2:]]),
        _with_friction_on_motor,
    )  # fmt: skip
    kinds = ('motor', 'link')
    kind_word = 'encoder'
    site = MOTOR
    drawn_over = 'seconds'
    is_online = False
    uses_bodies = True
    sees_acceleration = True
    has_memory = True

    def places(self, motion: SeenMotion) -> list[Place]:
        """Return both encoders, and motors without a rotor in the robot file."""
        found = super().places(motion)
        return [*found, *(replace(p, kind=BARE) for p in found if is_on_motor(p))]

    def stated_quantities(self, kind: str = '') -> tuple[Quantity, ...]:
        return super().stated_quantities(_word(kind))

    def stated_words(self, place: Place, tree: Structure) -> dict[str, str]:
        return super().stated_words(replace(place, kind=_word(place.kind)), tree)

    def model(self, numbers: Numbers, kind: str = '') -> tuple[np.ndarray, np.ndarray]:
        K = numbers['stiffness']
        damping = numbers.get('damping', 0.0)
        shape = [numbers.get('motor_inertia', math.nan), 1.0 / K, damping / K]
        share = [numbers.get('motor_friction', 0.0)] if kind != 'link' else []
        return np.array(shape + share), np.ones(1)

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        J, compliance, settling, *share = (float(x) for x in at.shape)
        return {
            'stiffness': 1.0 / compliance, 'damping': settling / compliance, 'motor_inertia': J,
            **({'motor_friction': share[0]} if share else {}),
            self.kind_word: _word(at.place.kind),
        }  # fmt: skip

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        return bool(at.shape[0] > 0.0 and at.shape[1] > 0.0 and at.shape[2] >= 0.0)

    def is_inside(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether it is a spring that can ring.

        A fit that ends at the softest one is something else, and one that ends at the most damping
        a lag or a delay of the drive.
        """
        return bool((at.shape[1:3] < _SOFT * self.bounds(motion, at.place)[1][1:3]).all())

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return np.asarray(shape[1] * _of_softness(motion, place, shape))

    def whole(self, motion: SeenMotion, at: Placed) -> np.ndarray:
        """Return the force with its resonance, (n,), as that of a joint whose others are free.

        `c s^2 / (a s^2 + b s + 1)` times the effort, with `a = J (M - J) / (M K)`, `b = D / K`,
        M the inertia while the others are free. c is a, or for an encoder on the motor
        `(M - J) (M_jj - J) / (M K)`.
        """
        j, (J, compliance, settling) = at.place.joint, at.shape[:3]
        beside = J - _inside(at.place, at.shape)
        M = motion.free_inertia(j, some_poses(motion)) + beside
        a = compliance * J * (M - J) / M
        c = a
        if is_on_motor(at.place):
            c *= (float(motion.mass_diagonal[:, j].mean()) + beside - J) / J
        u = motion.effort[:, j]
        parts = [x - resonator(x, a, settling, motion.step)
                 for x in np.split(u, motion.starts[1:])]  # fmt: skip
        return c / a * np.concatenate(parts)

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return motors and dampers of several sizes; the softness follows from the residual.

        None where nothing is known of the inertia.
        """
        if motion.free_inertia(place.joint, some_poses(motion)) <= 0.0:
            return np.zeros((0, 4 if is_on_motor(place) else 3))
        (least, stiff, *_), (most, _, slowest, *_) = self.bounds(motion, place)
        share = [0.0] if is_on_motor(place) else []
        return np.array([[J, stiff, T, *share] for J in np.geomspace(least, most, 5)[1:]
                         for T in (0.0, 0.05 * slowest)])  # fmt: skip

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return a little motor, a rigid joint, no damping; and a little link on a soft spring."""
        j = place.joint
        free = motion.free_inertia(j, some_poses(motion))
        rate = 2.0 * math.pi * _SOFTEST_HZ
        softest = 1.0 / (float(motion.mass_diagonal[:, j].mean()) * rate**2)
        low, high = (
            [_LEAST_OF_LINK * free, 1e-9 * softest, 0.0],
            [_MOST_OF_LINK * free, softest, _SETTLING / rate],
        )
        if place.kind == BARE:
            high[0] = _MOST_BESIDE * free
        if is_on_motor(place):
            low, high = [*low, -BEYOND], [*high, 1.0 + BEYOND]
        return np.array(low), np.array(high)

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        low, high = self.bounds(motion, place)
        found = relative_scales(low[:3], high[:3], shape[:3])
        return np.concatenate([found, np.ones(len(shape) - 3)])

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
