"""Effects with a memory of the motion: hysteresis and backlash."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numba import njit

from sgp_ros.physics.drawing import Drawn, JointScene, Scene, UnsuitableError
from sgp_ros.physics.effect import Effect, Numbers
from sgp_ros.physics.motion import SeenMotion, Structure
from sgp_ros.physics.parts import Quantity, Value, relative_scales
from sgp_ros.physics.place import MOTOR, Place, Placed

_POSES = 200
BARE = 'motor beside'
"""Encoder on a motor whose inertia the nominal robot lacks: an `armature` of the joint has it."""
BEYOND = 0.1
"""By which friction of a motor may leave what makes sense: that there is none is no bound."""
_MOST_OF_LINK = 0.9


@njit(cache=True)
def deflected(z: np.ndarray, way: np.ndarray, presliding: float) -> np.ndarray:
    """Return z of `dz/dt = (v - |v| z) / presliding` after a way in one direction."""
    sign = np.sign(way)
    return sign + (z - sign) * np.exp(-np.abs(way) / presliding)


@njit(cache=True)
def bristle(q: np.ndarray, presliding: float) -> np.ndarray:
    """Return z of `dz/dt = (v - |v| z) / presliding`, exact for a steady direction per step."""
    z = np.zeros(len(q))
    for i in range(1, len(q)):
        z[i] = deflected(z[i - 1], q[i] - q[i - 1], presliding)
    return z


class Hysteresis(Effect):
    """Friction that builds up over a way: `tau_x = -level z`."""

    name = 'hysteresis'
    words = 'hysteresis (presliding friction)'
    formula = 'tau_x = -level z, dz/dt = (v - |v| z) / presliding'
    source = 'Dahl 1968'
    appearance = (
        'steps at reversals that build up over a short distance; hysteresis loops over the '
        'position'
    )
    quantities = (
        Quantity('level', 'N m', low=0.0, joint_number='friction'),
        Quantity('presliding', 'rad', 1e-9, is_positive=True),
    )
    linear = ('level',)
    plain = ('coulomb_friction',)
    drawn_over = 'velocity'
    is_online = False
    has_memory = True

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return -bristle(motion.position[:, place.joint], float(shape[0]))[:, None]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        q = motion.position[:, place.joint]
        span = np.quantile(q, 0.95) - np.quantile(q, 0.05)
        return np.asarray(span * np.array([0.003, 0.01, 0.03, 0.07, 0.15, 0.3, 0.6])[:, None])

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return a twentieth of the way of a row, which is Coulomb friction, and twice the range.

        Over the range, a longer presliding is a spring.
        """
        q = motion.position[:, place.joint]
        row = 0.05 * float(np.mean(np.abs(motion.velocity[:, place.joint]))) * motion.step
        starts = self.starts(motion, place)
        return np.minimum(starts[0], row), np.maximum(starts[-1], [2.0 * float(np.ptp(q))])

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return relative_scales(*self.bounds(motion, place), shape)

    def sized(self, x: JointScene) -> Drawn:
        return Drawn(x.small, lambda s: {'level': s, 'presliding': x.presliding})


@njit(cache=True)
def _play(needed: np.ndarray, relative: np.ndarray, gap: float, step: float) -> np.ndarray:
    """Return how far the motor leads the link, between half a gap to either side, (n,)."""
    n = len(needed)
    lead = np.zeros(n)
    x = 0.5 * gap if needed[0] > 0.0 else -0.5 * gap
    v = 0.0
    for i in range(n):
        at_high, at_low = x >= 0.5 * gap, x <= -0.5 * gap
        if (at_high and needed[i] >= 0.0) or (at_low and needed[i] <= 0.0):
            v = 0.0
        else:
            v += relative[i] * step
            x += v * step
            if x >= 0.5 * gap:
                x, v = 0.5 * gap, 0.0
            elif x <= -0.5 * gap:
                x, v = -0.5 * gap, 0.0
        lead[i] = x
    return lead


def _second_difference(x: np.ndarray, step: float) -> np.ndarray:
    return np.diff(np.pad(x, 1, mode='edge'), 2) / step**2


def _whole(motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    """Return the inertia of motor and link, (n,)."""
    inertia = motion.mass_diagonal[:, place.joint]
    return np.asarray(inertia / (1.0 - shape[0]) if place.kind == BARE else inertia)


def _most_lost(motion: SeenMotion, joint: int) -> np.ndarray:
    """Return the root mean square of an effort, and its ratio to that of the velocity, (2,)."""
    effort, v = (np.sqrt((x[:, joint] ** 2).mean()) for x in (motion.effort, motion.velocity))
    return np.array([effort, effort / v if v > 0.0 else 0.0]) + 1e-12


def _lost(motion: SeenMotion, joint: int) -> np.ndarray:
    """Return dry and viscous friction of a joint, (2,), as far as a regression shows them."""
    q, v, a = (x[:, joint] for x in (motion.position, motion.velocity, motion.acceleration))
    x = np.column_stack([motion.direction[:, joint], v, a, np.ones(len(q)), np.sin(q), np.cos(q)])
    missing = motion.effort[:, joint] - motion.nominal_effort[:, joint]
    found = np.linalg.lstsq(x, missing, rcond=1e-9)[0][:2]
    return np.asarray(found.clip(0.0, _most_lost(motion, joint)))


class Backlash(Effect):
    """Play between motor and link.

    Encoder and damping sit on the motor, of inertia `share M`, with friction of its own; shape is
    (share, gap, dry friction and viscous friction of the motor). Where it leads the link by delta,
    the nominal model asks for `(1 - share) M d^2 delta/dt^2` too much. With tau the effort less
    what the motor loses, the force between them in contact is `(1 - share) tau + share h`; when it
    changes its sign, the two fly freely to the other side, with the relative acceleration
    `tau / (share M) + h / ((1 - share) M)`. Where the nominal robot lacks the motor (`BARE`), its
    M is that of the link alone.
    """

    name = 'backlash'
    words = 'backlash'
    formula = 'motor and link move freely within gap; the encoder is on the motor'
    source = 'Nordin and Gutman 2002'
    appearance = 'bursts of effort each time the load on the gear changes sign'
    quantities = (
        Quantity('gap', 'rad', low=0.0, is_positive=True, is_sought=True),
        Quantity('motor_inertia', 'kg m2', 1e-12, is_positive=True, is_optional=True,
                 is_scored=False),
        Quantity('motor_coulomb', 'N m', is_optional=True, is_scored=False),
        Quantity('motor_viscous', 'N m s/rad', is_optional=True, is_scored=False),
    )  # fmt: skip
    site = MOTOR
    drawn_over = 'seconds'
    is_online = False
    uses_bodies = True
    sees_acceleration = True
    has_memory = True

    def places(self, motion: SeenMotion) -> list[Place]:
        """Return motors with and without a rotor in the robot file."""
        found = super().places(motion)
        return [*found, *(replace(p, kind=BARE) for p in found)]

    def stated_quantities(self, kind: str = '') -> tuple[Quantity, ...]:
        return super().stated_quantities()

    def stated_words(self, place: Place, tree: Structure) -> dict[str, str]:
        return super().stated_words(replace(place, kind=''), tree)

    def model(self, numbers: Numbers, kind: str = '') -> tuple[np.ndarray, np.ndarray]:
        """Return the gap and the friction of the motor alone.

        The motor's share of the inertia changes with the pose: its inertia does not say it.
        """
        lost = [numbers.get(x, 0.0) for x in ('motor_coulomb', 'motor_viscous')]
        return np.array([math.nan, numbers['gap'], *lost]), np.ones(1)

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        """Return gap and the motor's inertia, its share of what the joint has over the motion.

        It is less than the joint moves while all others are free: the link keeps some.
        """
        joint, rows = at.place.joint, slice(None, None, max(1, len(motion.time) // _POSES))
        least = motion.free_inertia(joint, rows)
        inertia = float(at.shape[0]) * float(np.mean(_whole(motion, at.place, at.shape)))
        most = math.inf if at.place.kind == BARE else _MOST_OF_LINK * least
        return {'gap': float(at.shape[1]), 'motor_inertia': min(inertia, most),
                'motor_coulomb': float(at.shape[2]),
                'motor_viscous': float(at.shape[3])}  # fmt: skip

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        return True

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        j, (share, gap, coulomb, viscous) = place.joint, shape
        inertia, v = _whole(motion, place, shape), motion.velocity[:, j]
        damped = motion.tree.damping[j] * v
        nominal = (motion.mass_diagonal[:, j] - motion.rotors[j]) * motion.acceleration[:, j]
        link = motion.nominal_effort[:, j] - nominal - damped
        lost = damped + coulomb * motion.direction[:, j] + viscous * v
        pressed = (1.0 - share) * (motion.effort[:, j] - lost) + share * link
        relative = pressed / np.maximum(share * (1.0 - share) * inertia, 1e-12)
        lead = _play(pressed, relative, float(gap), motion.step)
        return ((1.0 - share) * inertia * _second_difference(lead, motion.step))[:, None]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return motors of some sizes, without friction and with all that the joint shows."""
        span = float(np.ptp(motion.position[:, place.joint]))
        widths = np.geomspace(0.0005, 0.3, 9) * span
        shares = (0.06, 0.12, 0.18, 0.24, 0.3, 0.37, 0.45, 0.55, 0.7)
        some = ((np.zeros(2), shares if place.kind != BARE else ()),
                (_lost(motion, place.joint), shares[1::2]))  # fmt: skip
        return np.array([[share, width, *lost] for lost, of in some for share in of
                         for width in widths])  # fmt: skip

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        most = float(np.ptp(motion.position[:, place.joint]))
        lost = _most_lost(motion, place.joint)
        return np.array([0.01, 1e-9, *-BEYOND * lost]), np.array([0.95, most, *lost])

    def draw(self, scene: Scene) -> Drawn:
        """Return play of a motor whose link carries no other."""
        bodies, motors = scene.bodies, scene.motors
        leaves = [i for i in motors if not any(b.parent == i for b in bodies)]
        if not leaves:
            raise UnsuitableError(self.name)
        j = scene.choice(leaves)
        body, axis = bodies[j], np.array(bodies[j].axis)
        own = body.mass if body.is_prismatic else axis @ body.inertia @ axis
        motor, reach = scene.rng.uniform(0.2, 0.5) * own, scene.reach(j)
        return Drawn(
            0.01 * reach, lambda s: {'gap': s, 'motor_inertia': motor}, 0.05 * reach, 1.0, index=j
        )
