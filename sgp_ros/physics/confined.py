"""Friction and contacts in a part of a joint's range."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from sgp_ros.physics.drawing import Drawn, Scene, UnsuitableError
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.friction import KINDS, rubbing
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import Quantity, Value
from sgp_ros.physics.place import Place, Placed

_BINS = 40


def inside(motion: SeenMotion, joint: int, lo: float, hi: float) -> np.ndarray:
    """Return the share of each cell of the grid that lies in [lo, hi], (n,).

    The position counts as uniform within half a step's way of the sample. On a continuous joint
    the interval may cross the wrap.
    """
    q = motion.wrapped[:, joint]
    reach = 0.5 * np.abs(motion.velocity[:, joint]) * motion.step
    width = np.maximum(2.0 * reach, 1e-9)
    turn = 2.0 * math.pi
    shifts = (-turn, 0.0, turn) if motion.is_continuous[joint] else (0.0,)
    share = np.zeros(len(q))
    for shift in shifts:
        low = np.maximum(q + shift - 0.5 * width, lo)
        high = np.minimum(q + shift + 0.5 * width, hi)
        share += np.clip((high - low) / width, 0.0, 1.0)
    return np.minimum(share, 1.0)


def limit_of(motion: SeenMotion, place: Place) -> float:
    """Return the limit of the joint on the side of the place [rad or m]."""
    tree = motion.tree
    return float(tree.upper[place.joint] if place.side > 0 else tree.lower[place.joint])


class PositionFriction(Effect):
    """Friction within an interval of the position."""

    name = 'position_friction'
    words = 'friction in a part of the range'
    formula = 'tau_x = -amplitude sign(v), or -amplitude v, where lo <= q <= hi'
    source = 'Armstrong-Helouvry, Dupont, Canudas de Wit 1994, section 2.5'
    appearance = 'friction that is present only at certain positions'
    quantities = (
        Quantity('amplitude', 'N m', low=0.0),
        Quantity('lo', 'rad', is_scored=False),
        Quantity('hi', 'rad', is_scored=False),
    )
    linear = ('amplitude',)
    kinds = KINDS
    is_dry = True

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        lo, hi = sorted(shape)
        return -(inside(motion, place.joint, lo, hi) * rubbing(motion, place))[:, None]

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        """Return the amplitude and the interval, its lower end first."""
        lo, hi = sorted(map(float, at.shape))
        return super().report(at, motion) | {'lo': lo, 'hi': hi}

    def interval(self, at: Placed, motion: SeenMotion) -> tuple[str, list[list[float]]]:
        return 'position', [[float(min(at.shape)), float(max(at.shape))]]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return none: intervals are searched by their bins."""
        return np.zeros((0, 2))

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        q = motion.wrapped[:, place.joint]
        margin = 0.02 * (q.max() - q.min())
        return np.full(2, q.min() - margin), np.full(2, q.max() + margin)

    def bins(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        q = motion.wrapped[:, place.joint]
        edges = np.linspace(q.min(), q.max(), _BINS + 1)
        rub = rubbing(motion, place)
        columns = [-inside(motion, place.joint, a, b) * rub for a, b in pairwise(edges)]
        return np.column_stack(columns), edges

    def draw(self, scene: Scene) -> Drawn:
        """Return an interval that the motion passes through."""
        rng, motion, j = scene.rng, scene.motion, scene.joint
        kind = str(rng.choice(list(self.kinds)))
        low, high = motion.low[j], motion.high[j]
        if scene.bodies[j].kind == 'continuous' and max(-low, high) > math.pi:
            low, high = -3.0, 3.0
        width = rng.uniform(0.08, 0.2) * (high - low)
        wanted = (0.02, 0.08) if scene.is_hard and rng.random() < 0.5 else (0.06, 0.4)
        q = motion.positions[:, j]
        for _ in range(50):
            lo = rng.uniform(low, high - width)
            if wanted[0] <= float(np.mean((q > lo) & (q < lo + width))) <= wanted[1]:
                break
        else:
            raise UnsuitableError(self.name)
        size = motion.effort[j] * 0.6 / (1.0 if kind == 'coulomb' else motion.velocity[j])

        def values(s: float) -> dict[str, Value]:
            return {'amplitude': s, 'lo': lo, 'hi': lo + width, 'kind': kind, 'edge': 0.05 * width}

        return Drawn(size, values, interval=(lo, lo + width))


class LimitFriction(Effect):
    """Dry friction that rises linearly from its onset to the limit of the joint."""

    name = 'limit_friction'
    words = 'friction that rises towards the limit'
    formula = 'tau_x = -amplitude clip((q - onset)/(limit - onset), 0, 1) sign(v)'
    source = 'a piecewise linear level'
    appearance = 'steps at reversals that grow towards one end of the range'
    quantities = (Quantity('amplitude', 'N m', low=0.0), Quantity('onset', 'rad'))
    linear = ('amplitude',)
    edge = 'onset'
    needs_limits = True
    is_dry = True

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        limit = limit_of(motion, place)
        q = motion.position[:, place.joint]
        span = limit - shape[0]
        ramp = np.clip((q - shape[0]) / (span if abs(span) > 1e-9 else 1e-9), 0.0, 1.0)
        return -(ramp * motion.direction[:, place.joint])[:, None]

    def interval(self, at: Placed, motion: SeenMotion) -> tuple[str, list[list[float]]]:
        return 'position', [sorted([float(at.shape[0]), limit_of(motion, at.place)])]

    def places(self, motion: SeenMotion) -> list[Place]:
        return [p for p in super().places(motion) if np.isfinite(limit_of(motion, p))]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        q = motion.position[:, place.joint]
        limit = limit_of(motion, place)
        shares = np.linspace(0.05, 0.95, 16)
        found = np.quantile(q, shares) if place.side > 0 else np.quantile(q, 1.0 - shares)
        even = q.min() + (q.max() - q.min()) * (shares if place.side > 0 else 1.0 - shares)
        both = np.unique(np.concatenate([found, even]))
        return both[(limit - both) * place.side > 0][:, None]

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        q = motion.position[:, place.joint]
        limit = limit_of(motion, place)
        span = abs(limit - (q.min() if place.side > 0 else q.max()))
        if place.side > 0:
            return np.array([q.min()]), np.array([limit - 0.02 * span])
        return np.array([limit + 0.02 * span]), np.array([q.max()])

    def draw(self, scene: Scene) -> Drawn:
        """Return an onset on one side of a joint with limits."""
        rng, motion = scene.rng, scene.motion
        able = [i for i, b in enumerate(scene.bodies) if b.kind != 'continuous']
        if not able:
            raise UnsuitableError(self.name)
        j = scene.choice(able)
        side, limit = rng.choice([-1.0, 1.0]), scene.bodies[j].limit
        end = motion.high[j] if side > 0 else -motion.low[j]
        onset = side * rng.uniform(0.2, 0.6) * min(end, limit)
        if end <= 0.1 * limit:
            raise UnsuitableError(self.name)
        return Drawn(2.0 * motion.effort[j], lambda s: {'amplitude': s, 'onset': onset}, index=j)


class EndStop(Effect):
    """A contact beyond a position that pushes back, never pulls."""

    name = 'end_stop'
    words = 'an end stop'
    formula = 'pushes back with stiffness x depth + damping x rate beyond position, never pulls'
    source = 'Kelvin-Voigt contact, Hunt and Crossley 1975'
    appearance = 'a steep rise of the effort at one end of the motion'
    quantities = (
        Quantity('position', 'rad'),
        Quantity('stiffness', 'N m/rad', low=0.0, is_scored=False),
        Quantity('damping', 'N m s/rad', low=0.0, is_scored=False),
    )
    linear = ('stiffness', 'damping')
    edge = 'position'

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        q, v = motion.position[:, place.joint], motion.velocity[:, place.joint]
        reach = 0.5 * np.abs(v) * motion.step + 1e-9
        depth = place.side * (q - shape[0])
        share = np.clip(0.5 * (depth / reach + 1.0), 0.0, 1.0)
        # mean of max(depth, 0) over the way of one step
        pressed = np.where(
            np.abs(depth) < reach, (depth + reach) ** 2 / (4.0 * reach), np.maximum(depth, 0.0)
        )
        return -place.side * np.column_stack([pressed, share * place.side * v])

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        stiffness, damping = at.coefficients
        return bool(stiffness > 0.0 and damping > -0.1 * stiffness)

    def interval(self, at: Placed, motion: SeenMotion) -> tuple[str, list[list[float]]]:
        q = motion.position[:, at.place.joint]
        end = q.max() if at.place.side > 0 else q.min()
        return 'position', [sorted([float(at.shape[0]), float(end)])]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        q = motion.position[:, place.joint]
        low, high = q.min(), q.max()
        shares = np.concatenate([np.linspace(0.05, 0.9, 18), np.linspace(0.92, 0.99, 8)])
        found = low + (high - low) * (shares if place.side > 0 else 1.0 - shares)
        return np.asarray(found[:, None])

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        q = motion.position[:, place.joint]
        return np.array([q.min()]), np.array([q.max()])

    def draw(self, scene: Scene) -> Drawn:
        """Return a stop within the motion."""
        rng, motion, j = scene.rng, scene.motion, scene.joint
        side = rng.choice([-1.0, 1.0])
        end = motion.high[j] if side > 0 else -motion.low[j]
        is_free = scene.bodies[j].kind == 'continuous'
        if end <= 0.3 * motion.spread[j] or (is_free and end > 6.0):
            raise UnsuitableError(self.name)
        position = side * rng.uniform(0.5, 0.85) * end
        share = rng.uniform(0.005, 0.03)
        return Drawn(
            8.0 * motion.effort[j] / scene.reach(j),
            lambda s: {'position': position, 'stiffness': s, 'damping': share * s},
            400.0 * motion.effort[j] / scene.reach(j), 1.0,
        )  # fmt: skip
