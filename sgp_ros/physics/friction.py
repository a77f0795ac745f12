"""Friction of a joint: viscous, dry, of both directions, of places, loads and times."""

from __future__ import annotations

import math

import numpy as np

from sgp_ros.physics.effect import (
    Effect,
    Fitted,
    Place,
    Quantity,
    every_joint,
    every_motor,
    is_positive,
    named,
    no_shape,
)
from sgp_ros.physics.observed_motion import ObservedMotion

KINDS = ('coulomb', 'viscous')
_BINS = 40
SELF_LOCKING = 0.5
"""A drive that loses more than half of its torque to friction cannot be driven back."""


def rubbing(motion: ObservedMotion, place: Place) -> np.ndarray:
    """Return `sign(v)` for dry friction, v for viscous friction, (n,)."""
    source = motion.velocity if place.kind == 'viscous' else motion.direction
    return source[:, place.joint]


def _viscous(motion: ObservedMotion, place: Place, _shape: np.ndarray) -> np.ndarray:
    return -motion.velocity[:, place.joint, None]


def _coulomb(motion: ObservedMotion, place: Place, _shape: np.ndarray) -> np.ndarray:
    return -motion.direction[:, place.joint, None]


def _stribeck(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    s = motion.direction[:, place.joint]
    fall = np.exp(-((motion.velocity[:, place.joint] / shape[0]) ** 2))
    return -np.column_stack([s, fall * s])


def _speeds(motion: ObservedMotion, place: Place) -> np.ndarray:
    speed = np.quantile(np.abs(motion.velocity[:, place.joint]), 0.9)
    return speed * np.array([0.02, 0.05, 0.1, 0.2, 0.4, 0.7])[:, None]


def _quadratic(motion: ObservedMotion, place: Place, _shape: np.ndarray) -> np.ndarray:
    v = motion.velocity[:, place.joint]
    return -(np.abs(v) * v)[:, None]


def _asymmetric(motion: ObservedMotion, place: Place, _shape: np.ndarray) -> np.ndarray:
    s = motion.direction[:, place.joint]
    return np.column_stack([-0.5 * (1.0 + s), 0.5 * (1.0 - s)])


def inside(motion: ObservedMotion, joint: int, lo: float, hi: float) -> np.ndarray:
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


def _position(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    lo, hi = sorted(shape)
    return -(inside(motion, place.joint, lo, hi) * rubbing(motion, place))[:, None]


def position_edges(motion: ObservedMotion, joint: int) -> np.ndarray:
    """Return edges of bins over the range of motion, (bins + 1,) [rad or m]."""
    q = motion.wrapped[:, joint]
    return np.linspace(q.min(), q.max(), _BINS + 1)


def _no_starts(_motion: ObservedMotion, _place: Place) -> np.ndarray:
    """Return no shapes: intervals are searched by their bins."""
    return np.zeros((0, 2))


def _range_bounds(motion: ObservedMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
    q = motion.wrapped[:, place.joint]
    margin = 0.02 * (q.max() - q.min())
    return np.full(2, q.min() - margin), np.full(2, q.max() + margin)


def ends(motion: ObservedMotion) -> list[Place]:
    """Return a place at both ends of each moving joint with limits."""
    tree = motion.tree
    return [
        Place(j, side=side)
        for j in motion.moving_joints
        for side in (-1, 1)
        if np.isfinite(tree.upper[j] if side > 0 else tree.lower[j])
    ]


def limit_of(motion: ObservedMotion, place: Place) -> float:
    """Return the limit of the joint on the side of the place [rad or m]."""
    tree = motion.tree
    return float(tree.upper[place.joint] if place.side > 0 else tree.lower[place.joint])


def _limit(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    limit = limit_of(motion, place)
    q = motion.position[:, place.joint]
    span = limit - shape[0]
    ramp = np.clip((q - shape[0]) / (span if abs(span) > 1e-9 else 1e-9), 0.0, 1.0)
    return -(ramp * motion.direction[:, place.joint])[:, None]


def _onsets(motion: ObservedMotion, place: Place) -> np.ndarray:
    q = motion.position[:, place.joint]
    limit = limit_of(motion, place)
    shares = np.linspace(0.05, 0.95, 16)
    found = np.quantile(q, shares) if place.side > 0 else np.quantile(q, 1.0 - shares)
    even = q.min() + (q.max() - q.min()) * (shares if place.side > 0 else 1.0 - shares)
    both = np.unique(np.concatenate([found, even]))
    return both[(limit - both) * place.side > 0][:, None]


def _onset_bounds(motion: ObservedMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
    q = motion.position[:, place.joint]
    limit = limit_of(motion, place)
    span = abs(limit - (q.min() if place.side > 0 else q.max()))
    if place.side > 0:
        return np.array([q.min()]), np.array([limit - 0.02 * span])
    return np.array([limit + 0.02 * span]), np.array([q.max()])


def _load(motion: ObservedMotion, place: Place, _shape: np.ndarray) -> np.ndarray:
    s = motion.direction[:, place.joint]
    return -np.column_stack([s, np.abs(motion.effort[:, place.joint]) * s])


def _grows_with_load(f: Fitted) -> bool:
    """Return whether friction grows with the load, and neither drives nor locks the joint.

    Where nothing but friction loads a motor, `|effort| sign(v)` is the effort itself: with mu = 1
    it would explain everything, by itself.
    """
    level, mu = f.coefficients
    usual = float(np.mean(np.abs(f.motion.effort[:, f.place.joint])))
    return bool(0.0 < mu < SELF_LOCKING and level > -0.1 * mu * usual)


def _kinds(motion: ObservedMotion) -> list[Place]:
    return [Place(j, kind) for j in motion.moving_joints for kind in KINDS]


def _drift(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    fade = np.exp(-motion.time / shape[0])
    x = rubbing(motion, place)
    return -np.column_stack([(1.0 - fade) * x, fade * x])


def _warm_ups(motion: ObservedMotion, _place: Place) -> np.ndarray:
    return motion.time[-1] * np.array([0.04, 0.1, 0.25, 0.6])[:, None]


VISCOUS_FRICTION = Effect(
    'viscous_friction', (Quantity('b', 'N m s/rad'),), _viscous, every_joint, no_shape,
    named('b'), is_positive, 'tau_x = -b v',
)  # fmt: skip
COULOMB_FRICTION = Effect(
    'coulomb_friction', (Quantity('level', 'N m'),), _coulomb, every_joint, no_shape,
    named('level'), is_positive, 'tau_x = -level sign(v)', is_dry=True,
)  # fmt: skip
STRIBECK_FRICTION = Effect(
    'stribeck_friction',
    (Quantity('coulomb', 'N m'), Quantity('static', 'N m'),
     Quantity('stribeck_velocity', 'rad/s')),
    _stribeck, every_joint, _speeds,
    lambda f: {
        'coulomb': float(f.coefficients[0]),
        'static': float(f.coefficients[0] + f.coefficients[1]),
        'stribeck_velocity': float(f.shape[0]),
    },
    lambda f: bool(f.coefficients[1] > 0.0 and f.coefficients[0] > -0.05 * f.coefficients[1]),
    'tau_x = -(coulomb + (static - coulomb) exp(-(v / stribeck_velocity)^2)) sign(v)',
    is_dry=True,
    bounds=lambda motion, place: (_speeds(motion, place)[0], 2.0 * _speeds(motion, place)[-1]),
)  # fmt: skip
QUADRATIC_DRAG = Effect(
    'quadratic_drag', (Quantity('c', 'N m s2/rad2'),), _quadratic, every_joint, no_shape,
    named('c'), is_positive, 'tau_x = -c |v| v',
)  # fmt: skip
POSITION_FRICTION = Effect(
    'position_friction',
    (Quantity('amplitude', 'N m'), Quantity('lo', 'rad'), Quantity('hi', 'rad')),
    _position, _kinds, _no_starts,
    lambda f: {
        'amplitude': float(f.coefficients[0]), 'lo': float(min(f.shape)),
        'hi': float(max(f.shape)), 'kind': f.place.kind,
    },
    is_positive, 'tau_x = -amplitude sign(v), or -amplitude v, where lo <= q <= hi',
    is_dry=True, bounds=_range_bounds,
    interval=lambda f: ('position', [[float(min(f.shape)), float(max(f.shape))]]),
)  # fmt: skip
LIMIT_FRICTION = Effect(
    'limit_friction', (Quantity('amplitude', 'N m'), Quantity('onset', 'rad')),
    _limit, ends, _onsets,
    lambda f: {'amplitude': float(f.coefficients[0]), 'onset': float(f.shape[0])},
    is_positive, 'tau_x = -amplitude clip((q - onset)/(limit - onset), 0, 1) sign(v)',
    is_dry=True, bounds=_onset_bounds,
    interval=lambda f: (
        'position', [sorted([float(f.shape[0]), limit_of(f.motion, f.place)])]
    ),
)  # fmt: skip
ASYMMETRIC_COULOMB = Effect(
    'asymmetric_coulomb', (Quantity('level_pos', 'N m'), Quantity('level_neg', 'N m')),
    _asymmetric, every_joint, no_shape, named('level_pos', 'level_neg'),
    lambda f: bool(np.all(f.coefficients > -0.02 * np.max(np.abs(f.coefficients)))),
    'tau_x = -level_pos for v > 0, +level_neg for v < 0', is_dry=True,
)  # fmt: skip
LOAD_FRICTION = Effect(
    'load_friction', (Quantity('level', 'N m'), Quantity('mu', '1')), _load, every_motor,
    no_shape, named('level', 'mu'), _grows_with_load,
    'tau_x = -(level + mu |motor torque|) sign(v)', is_dry=True,
)  # fmt: skip
FRICTION_DRIFT = Effect(
    'friction_drift',
    (Quantity('start', 'N m'), Quantity('end', 'N m'), Quantity('time_constant', 's')),
    _drift, _kinds, _warm_ups,
    lambda f: {
        'start': float(f.coefficients[1]), 'end': float(f.coefficients[0]),
        'time_constant': float(f.shape[0]), 'kind': f.place.kind,
    },
    lambda f: bool(
        np.all(f.coefficients > -0.1 * np.max(np.abs(f.coefficients)))
        and np.max(f.coefficients) > 0.0
    ),
    'level(t) = end + (start - end) exp(-t / time_constant)', is_dry=True,
    bounds=lambda motion, _place: (
        np.array([0.01 * motion.time[-1]]), np.array([2.0 * motion.time[-1]])
    ),
)  # fmt: skip
