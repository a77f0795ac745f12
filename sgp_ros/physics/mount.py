"""A base on a flexible mount: a mode of the base that no encoder sees.

The base moves by s along a root axis. With the momentum `p(q) dq` that the arm has along it, and
the mass m of all that moves on the mount, `m (s'' + 2 ratio w s' + w^2 s) = -d(p dq)/dt`, and the
joints feel `p s''`. What the arm does is known, so `s'' = -H (d(p dq)/dt) / m`, where H is the
high-pass of the mode, and the force is linear in 1/m. Source: Siciliano and Khatib 2016, Springer
Handbook of Robotics, chapter 11.
"""

from __future__ import annotations

import math

import numpy as np

from sgp_ros.physics.carried import GRAVITY
from sgp_ros.physics.drawing import Drawn, Scene, UnsuitableError
from sgp_ros.physics.effect import Effect, Numbers
from sgp_ros.physics.hidden_states import derivatives, resonator, smooth
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import Quantity, Value, relative_scales
from sgp_ros.physics.place import BASE, Place, Placed

AXES = ('x', 'y', 'z')
_SOFTEST_HZ = 0.3
_PERIODS = 5.0
"""Least periods of the softest mount in the recording for a resonance."""
_STIFFEST = 3.0
"""Stiffest mount over the bandwidth."""
_DAMPING, _USUAL_RATIO = (1e-3, 1.0), 0.1
_MOST_DAMPED = 0.5
"""Damping ratio from which on a resonance amplifies nothing."""
_DECAYS = 3.0
"""Times of decay after which nothing is left of a ring at a start."""
_MOST_GIVE = 0.25
"""Most that a mount gives way under the weight that it carries, along its axis [m].

What swings more slowly is as well a load that hangs on a rope of this length.
"""
_LARGEST_RING = 3.0
"""Largest ring at a start over the largest one that the motion causes."""
_LIGHTEST = 0.75
"""Least mass on the mount over the nominal one of the arm, whose prior is 25 %."""


def _rows(part: slice, step: float, shape: np.ndarray) -> int:
    """Return the rows of a stretch in which a ring at its start is seen, at least one period."""
    decay = _DECAYS / (2.0 * math.pi * shape[0] * max(shape[1], _DAMPING[0]))
    return min(part.stop - part.start, math.ceil(max(decay, 1.0 / shape[0]) / step))


def _ring(
    thrust: np.ndarray, seen: np.ndarray, left: np.ndarray, edge: int, step: float,
    shape: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return how a base rings that does not begin at rest, (n,), beside what shakes it.

    Both phases follow by least squares from what the nominal robot leaves of the efforts there,
    with an offset per joint; nothing where that has no sign of the mount.

    Args:
        thrust: (n,) of a stretch, the base beginning at rest.
        seen: (m, k) effort of the joints per thrust in its first rows.
        left: (m, k) what the nominal robot leaves there.
        edge: so many of these rows tell nothing.
        step: of the grid [s].
        shape: frequency and damping ratio.
    """
    rate, ratio = 2.0 * math.pi * shape[0], shape[1]
    t = step * np.arange(len(thrust))
    swing = rate * math.sqrt(max(1.0 - ratio**2, 0.0)) * t
    phases = np.exp(-ratio * rate * t) * np.stack([np.cos(swing), np.sin(swing)])
    x = np.stack([thrust, *phases])[:, edge : len(seen)]
    seen, left = seen[edge:], left[edge:]
    if not x.size or not all(np.isfinite(part).all() for part in (x, seen, left)):
        return np.zeros_like(thrust)  # too short, or of a roll-out that diverges
    per_joint, offset = x @ seen / x.shape[1], left.mean(axis=0)
    G = (x * (seen**2).sum(axis=1)) @ x.T - x.shape[1] * per_joint @ per_joint.T
    b = x @ (seen * (left - offset)).sum(axis=1)
    size = np.sqrt(np.maximum(np.diag(G), 1e-300))
    mobility, *sizes = np.linalg.lstsq(G / np.outer(size, size), b / size, rcond=1e-12)[0] / size
    ring = np.asarray(sizes @ phases)
    if mobility * float(np.abs(thrust).max()) * _LARGEST_RING <= float(np.abs(ring).max()):
        return np.zeros_like(thrust)
    return np.asarray(ring / mobility)


class MountElasticity(Effect):
    """A base that gives way along one of its axes; the shape is frequency and damping ratio."""

    name = 'mount_elasticity'
    words = 'a flexible mount of the base'
    formula = (
        "tau_x = -p s'', moved_mass (s'' + 2 damping_ratio w s' + w^2 s) = -d(p dq)/dt, "
        'w = 2 pi frequency, p dq: momentum of the arm along the axis'
    )
    source = 'Siciliano and Khatib 2016, Springer Handbook of Robotics, chapter 11'
    appearance = 'all joints ring together at one frequency after the arm starts or stops'
    quantities = (
        Quantity('frequency', 'Hz', low=0.0, is_positive=True),
        Quantity('damping_ratio', '1', low=0.0),
        Quantity('moved_mass', 'kg', low=0.0, is_positive=True, is_scored=False),
    )  # fmt: skip
    linear = ('moved_mass',)
    kinds = AXES
    kind_word = 'axis'
    site = BASE
    drawn_over = 'seconds'
    is_online = False
    uses_bodies = True
    sees_acceleration = True
    has_memory = True

    def coefficient_quantities(self, kind: str = '') -> tuple[Quantity, ...]:
        return (Quantity('mobility', '1/kg'),)

    def shape_names(self, kind: str = '') -> tuple[str, ...]:
        return 'frequency', 'damping_ratio'

    def model(self, numbers: Numbers, kind: str = '') -> tuple[np.ndarray, np.ndarray]:
        shape = [numbers['frequency'], numbers['damping_ratio']]
        return np.array(shape), np.array([1.0 / numbers.get('moved_mass', math.nan)])

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        frequency, ratio = map(float, at.shape)
        mass = 1.0 / float(at.coefficients[0])
        return {
            'frequency': frequency, 'damping_ratio': ratio, 'moved_mass': mass,
            self.kind_word: at.place.kind,
        }  # fmt: skip

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether the mount moves a mass."""
        return bool(at.coefficients[0] > 0.0)

    def is_inside(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether it moves at least the arm, and rings in the band.

        A fit at the ends of the band is a mass or nothing, a mount that gives way more than
        `_MOST_GIVE` or that amplifies nothing is none.
        """
        arm = float(motion.tree.parameters[:, 0].sum())
        low, high = (x[0] for x in self.bounds(motion, at.place))
        softest = math.sqrt(GRAVITY / _MOST_GIVE) / (2.0 * math.pi)
        is_mount = at.coefficients[0] * _LIGHTEST * arm <= 1.0 and at.shape[1] < _MOST_DAMPED
        return bool(is_mount and max(1.02 * low, softest) < at.shape[0] < 0.98 * high)

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return the force per 1/m, (n, k, 1), see `_ring` for how each stretch begins."""
        per_speed = -motion.gravity_columns[:, :, AXES.index(place.kind)]
        momentum = smooth(motion, (per_speed * motion.velocity).sum(axis=1))
        size = np.sqrt((motion.effort**2 + motion.nominal_effort**2).mean(axis=0))
        size[size == 0.0] = 1.0
        left = (motion.nominal_effort - motion.effort) / size
        rate, ratio = 2.0 * math.pi * shape[0], shape[1]
        a, b = 1.0 / rate**2, 2.0 * ratio / rate
        ends = [*motion.starts[1:], len(momentum)]
        parts = [slice(i, j) for i, j in zip(motion.starts, ends, strict=True)]
        swung = [x - resonator(x, a, b, motion.step, is_settled=False)
                 for x in (momentum[part] - momentum[part.start] for part in parts)]  # fmt: skip
        thrust = derivatives(motion, np.concatenate(swung))[0]
        for part in parts:
            rows = slice(part.start, part.start + _rows(part, motion.step, shape))
            seen = per_speed[rows] / size
            edge = math.ceil(0.5 / motion.bandwidth / motion.step)  # accelerations are poor there
            thrust[part] += _ring(thrust[part], seen, left[rows], edge, motion.step, shape)
        return np.asarray((per_speed * thrust[:, None])[:, :, None])

    def places(self, motion: SeenMotion) -> list[Place]:
        """Return the axes along which the arm pushes the base."""
        pushes = np.abs(motion.gravity_columns).max(axis=(0, 1))
        return [Place(-1, kind) for kind, push in zip(AXES, pushes, strict=True) if push > 0.0]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return frequencies a third of an octave apart, with some damping."""
        low, high = (float(x[0]) for x in self.bounds(motion, place))
        count = max(2, round(3.0 * math.log2(high / low)))
        return np.array([[f, _USUAL_RATIO] for f in np.geomspace(1.1 * low, 0.9 * high, count)])

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        seconds = len(motion.time) * motion.step
        low = max(_SOFTEST_HZ, _PERIODS / seconds)
        high = max(min(_STIFFEST * motion.bandwidth, 0.4 / motion.step), 2.0 * low)
        return np.array([low, _DAMPING[0]]), np.array([high, _DAMPING[1]])

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return relative_scales(*self.bounds(motion, place), shape)

    def draw(self, scene: Scene) -> Drawn:
        """Return a mount that carries a little more than the arm, by its softness."""
        if len(scene.bodies) < 2:
            raise UnsuitableError(self.name)
        arm = sum(body.mass for body in scene.bodies)
        mass, ratio = arm * scene.rng.uniform(1.3, 2.5), scene.rng.uniform(0.02, 0.1)
        kind = str(scene.rng.choice(AXES))

        def values(size: float) -> dict[str, Value]:
            return {
                'frequency': 8.0 / math.sqrt(size), 'damping_ratio': ratio, 'moved_mass': mass,
                self.kind_word: kind,
            }  # fmt: skip

        return Drawn(0.5, values, 25.0, 2.0, index=-1, place=self.site.value)
