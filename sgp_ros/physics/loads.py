"""Loads and forces on the robot: springs, tilt, payload, cogging, constant and tip forces."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sgp_ros.physics.effect import (
    Effect,
    Fitted,
    Place,
    Quantity,
    Value,
    always,
    every_joint,
    is_positive,
    named,
    no_shape,
    shaped,
)
from sgp_ros.physics.observed_motion import ObservedMotion
from sgp_ros.rigid.rigid_body import inverse_dynamics

GRAVITY = 9.81


def _spring(motion: ObservedMotion, place: Place, _shape: np.ndarray) -> np.ndarray:
    q = motion.position[:, place.joint]
    return np.column_stack([-q, np.ones_like(q)])


def _constant(motion: ObservedMotion, _place: Place, _shape: np.ndarray) -> np.ndarray:
    return np.ones((len(motion.time), 1))


def _base(_motion: ObservedMotion) -> list[Place]:
    return [Place(-1)]


def _tilt(motion: ObservedMotion, _place: Place, shape: np.ndarray) -> np.ndarray:
    """Return the force of the change of gravity under roll and pitch, (n, k, 1)."""
    roll, pitch = shape
    # R = Ry(pitch) Rx(roll); gravity in base axes is R^T (0, 0, -g)
    gravity = -GRAVITY * np.array(
        [-math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll)]
    )
    return -(motion.gravity_columns @ (gravity - motion.tree.gravity))[:, :, None]


def _tilts(_motion: ObservedMotion, _place: Place) -> np.ndarray:
    a = 0.03
    return np.array([[a, 0.0], [-a, 0.0], [0.0, a], [0.0, -a], [a, a], [a, -a], [-a, a], [-a, -a]])


def _last(motion: ObservedMotion) -> list[Place]:
    return [Place(motion.tree.size - 1)]


def _payload(motion: ObservedMotion, _place: Place, shape: np.ndarray) -> np.ndarray:
    """Return the force of a point mass on the last link, (n, k, 1)."""
    mass, centre = shape[0], shape[1:]
    x, y, z = centre
    load = mass * np.array(
        [1.0, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y]
    )
    return -(motion.last_body_columns @ load)[:, :, None]


def _reach(motion: ObservedMotion, joint: int) -> float:
    """Return how far from its joint a load may sit on a link [m]."""
    tree = motion.tree
    values = tree.parameters[joint]
    radius = math.sqrt(max(0.5 * (values[4] + values[6] + values[9]) / max(values[0], 1e-9), 1e-4))
    frames = [np.linalg.norm(f.translation) for f in tree.frames if f.body == joint]
    return float(max([2.0 * radius, *(1.2 * length for length in frames)]))


def _payloads(motion: ObservedMotion, place: Place) -> np.ndarray:
    tree, body = motion.tree, motion.tree.parameters[place.joint]
    tools = [f.translation for f in tree.frames if f.name == 'tool0' and f.body == place.joint]
    centres = [body[1:4] / max(float(body[0]), 1e-9), *tools]
    return np.array([[0.3 * float(body[0]), *centre] for centre in centres])


def _payload_bounds(motion: ObservedMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
    reach = _reach(motion, place.joint)
    heavy = 3.0 * float(motion.tree.parameters[place.joint, 0])
    return np.array([0.0, -reach, -reach, -reach]), np.array([heavy, reach, reach, reach])


def _tip(motion: ObservedMotion, _place: Place, _shape: np.ndarray) -> np.ndarray:
    """Return the force per newton along each root axis at the tool, (n, k, 3)."""
    frame = next((f for f in motion.tree.frames if f.name == 'tool0' and f.body >= 0), None)
    n, k = motion.position.shape
    if frame is None:
        return np.zeros((n, k, 0))
    mass = np.zeros_like(motion.tree.parameters)
    mass[frame.body, 0] = 1.0
    mass[frame.body, 1:4] = frame.translation
    still = np.zeros((n, k))
    columns = [
        -inverse_dynamics(replace(motion.tree, gravity=axis), mass, motion.position, still, still)
        for axis in np.eye(3)
    ]
    return np.stack(columns, axis=2)


def _tools(motion: ObservedMotion) -> list[Place]:
    has_tool = any(f.name == 'tool0' and f.body >= 0 for f in motion.tree.frames)
    return [Place(-2)] if has_tool else []


def per_turn(motion: ObservedMotion, joint: int) -> float:
    """Return the phase per position and period, 1 on a revolute and 2 pi on a prismatic joint."""
    return 2.0 * math.pi if motion.tree.is_prismatic[joint] else 1.0


def _cogging(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    angle = shape[0] * per_turn(motion, place.joint) * motion.position[:, place.joint]
    return np.column_stack([np.sin(angle), np.cos(angle)])


def _periods(motion: ObservedMotion, place: Place) -> np.ndarray:
    """Return trial periods: at least one in the range of motion, spaced a third of a period."""
    q = motion.position[:, place.joint]
    turn = per_turn(motion, place.joint)
    span = float(np.ptp(q)) * turn / (2.0 * math.pi)
    speed = np.quantile(np.abs(motion.velocity[:, place.joint]), 0.5) * turn / (2.0 * math.pi)
    fastest = 0.2 / motion.step / max(speed, 1e-9)
    least = 3.0 if turn == 1.0 else 1.0 / max(span, 1e-9)
    most = min(60.0 if turn == 1.0 else 60.0 / max(span, 1e-9), fastest)
    step = 1.0 / 3.0 / max(span, 1e-9)
    step = float(np.clip(step, 0.02, 1.0)) if turn == 1.0 else step
    count = int(np.clip((most - least) / step, 1, 300))
    return np.linspace(least, max(most, least + step), count + 1)[:, None]


def wave(f: Fitted) -> dict[str, Value]:
    """Return amplitude, periods and phase of `c0 sin(periods q) + c1 cos(periods q)`."""
    c = f.coefficients
    return {
        'amplitude': float(math.hypot(c[0], c[1])),
        'periods': float(f.shape[0]),
        'phase': float(math.atan2(c[1], c[0])),
    }


def _armature(motion: ObservedMotion, place: Place, _shape: np.ndarray) -> np.ndarray:
    return -motion.acceleration[:, place.joint, None]


def _couplings(motion: ObservedMotion) -> list[Place]:
    tree = motion.tree
    k = tree.size
    moving = motion.moving_joints
    torques = [
        Place(j, 'torque', i) for j in moving for i in range(k)
        if i != j and tree.is_actuated[i]
    ]  # fmt: skip
    springs = [Place(j, 'spring', i) for j in moving for i in moving if i != j]
    return torques + springs


def _coupling(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    if place.kind == 'torque':
        return motion.effort[:, place.source, None]
    n, k = motion.position.shape
    columns = np.zeros((n, k, 1))
    stretch = motion.position[:, place.joint] - shape[0] * motion.position[:, place.source]
    columns[:, place.joint, 0] = -stretch
    columns[:, place.source, 0] = shape[0] * stretch
    return columns


def _ratios(_motion: ObservedMotion, place: Place) -> np.ndarray:
    if place.kind == 'torque':
        return np.zeros((1, 0))
    return np.array([-2.0, -1.0, -0.5, 0.5, 1.0, 2.0])[:, None]


def _end_stop(motion: ObservedMotion, place: Place, shape: np.ndarray) -> np.ndarray:
    q, v = motion.position[:, place.joint], motion.velocity[:, place.joint]
    reach = 0.5 * np.abs(v) * motion.step + 1e-9
    depth = place.side * (q - shape[0])
    share = np.clip(0.5 * (depth / reach + 1.0), 0.0, 1.0)
    # mean of max(depth, 0) over the way of one step
    pressed = np.where(
        np.abs(depth) < reach, (depth + reach) ** 2 / (4.0 * reach), np.maximum(depth, 0.0)
    )
    return -place.side * np.column_stack([pressed, share * place.side * v])


def _stops(motion: ObservedMotion) -> list[Place]:
    return [Place(j, side=side) for j in motion.moving_joints for side in (-1, 1)]


def _stop_positions(motion: ObservedMotion, place: Place) -> np.ndarray:
    q = motion.position[:, place.joint]
    low, high = q.min(), q.max()
    shares = np.concatenate([np.linspace(0.5, 0.9, 9), np.linspace(0.92, 0.99, 8)])
    found = low + (high - low) * (shares if place.side > 0 else 1.0 - shares)
    return found[:, None]


def _stop_bounds(motion: ObservedMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
    q = motion.position[:, place.joint]
    return np.array([q.min()]), np.array([q.max()])


def _elasticity(f: Fitted) -> dict[str, Value]:
    stiffness, force = map(float, f.coefficients)
    return {'stiffness': stiffness, 'rest': force / stiffness}


def _coupled(f: Fitted) -> dict[str, Value]:
    source: Value = f.motion.tree.joint_names[f.place.source]
    size = float(f.coefficients[0])
    if f.place.kind == 'torque':
        return {'kind': 'torque', 'coefficient': size, 'source_joint': source}
    ratio = float(f.shape[0])
    return {'kind': 'spring', 'stiffness': size, 'ratio': ratio, 'source_joint': source}


def _ratio_bounds(_motion: ObservedMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
    shapes = 1 if place.kind == 'spring' else 0
    return np.full(shapes, -5.0), np.full(shapes, 5.0)


def _beyond(f: Fitted) -> tuple[str, list[list[float]]]:
    q = f.motion.position[:, f.place.joint]
    end = q.max() if f.place.side > 0 else q.min()
    return 'position', [sorted([float(f.shape[0]), float(end)])]


SPRING = Effect(
    'spring', (Quantity('stiffness', 'N m/rad'), Quantity('rest', 'rad')), _spring, every_joint,
    no_shape, _elasticity, lambda f: bool(f.coefficients[0] > 0.0),
    'tau_x = -stiffness (q - rest)',
)  # fmt: skip
CONSTANT_LOAD = Effect(
    'constant_load', (Quantity('force', 'N m'),), _constant, every_joint, no_shape,
    named('force'), always, 'tau_x = force',
)  # fmt: skip
GRAVITY_TILT = Effect(
    'gravity_tilt', (Quantity('roll', 'rad'), Quantity('pitch', 'rad')), _tilt, _base, _tilts,
    shaped('roll', 'pitch'), lambda f: bool(np.hypot(*f.shape) < 0.7),
    'gravity in base axes = (Ry(pitch) Rx(roll))^T (0, 0, -9.81)', is_given=True,
    uses_bodies=True, bounds=lambda _motion, _place: (np.full(2, -0.7), np.full(2, 0.7)),
)  # fmt: skip
PAYLOAD = Effect(
    'payload',
    (Quantity('mass', 'kg'), Quantity('x', 'm'), Quantity('y', 'm'), Quantity('z', 'm')),
    _payload, _last, _payloads, shaped('mass', 'x', 'y', 'z'),
    lambda f: bool(f.shape[0] > 0.0), 'a point mass that is fixed to the last link',
    is_given=True, sees_acceleration=True, is_body=True, bounds=_payload_bounds,
)  # fmt: skip
TIP_FORCE = Effect(
    'tip_force', (Quantity('fx', 'N'), Quantity('fy', 'N'), Quantity('fz', 'N')), _tip, _tools,
    no_shape, named('fx', 'fy', 'fz'), always, 'tau_x = J_tool(q)^T (fx, fy, fz)',
)  # fmt: skip
COGGING = Effect(
    'cogging',
    (Quantity('amplitude', 'N m'), Quantity('periods', '1/revolution'), Quantity('phase', 'rad')),
    _cogging, every_joint, _periods, wave, always, 'tau_x = amplitude sin(periods q + phase)',
    bounds=lambda motion, place: (
        0.9 * _periods(motion, place)[0], 1.1 * _periods(motion, place)[-1]
    ),
)  # fmt: skip
ARMATURE = Effect(
    'armature', (Quantity('inertia', 'kg m2'),), _armature, every_joint, no_shape,
    named('inertia'), is_positive, 'tau_x = -inertia a', is_inertial=True, sees_acceleration=True,
)  # fmt: skip
JOINT_COUPLING = Effect(
    'joint_coupling',
    (Quantity('coefficient', '1'), Quantity('stiffness', 'N m/rad'), Quantity('ratio', '1')),
    _coupling, _couplings, _ratios, _coupled,
    lambda f: bool(f.place.kind == 'torque' or f.coefficients[0] > 0.0),
    'tau_x = coefficient tau_source, or the force of stiffness/2 (q - ratio q_source)^2',
    bounds=_ratio_bounds,
)  # fmt: skip
END_STOP = Effect(
    'end_stop',
    (Quantity('position', 'rad'), Quantity('stiffness', 'N m/rad'),
     Quantity('damping', 'N m s/rad')),
    _end_stop, _stops, _stop_positions,
    lambda f: {
        'position': float(f.shape[0]), 'stiffness': float(f.coefficients[0]),
        'damping': float(f.coefficients[1]),
    },
    lambda f: bool(f.coefficients[0] > 0.0 and f.coefficients[1] > -0.1 * f.coefficients[0]),
    'pushes back with stiffness x depth + damping x rate beyond position, never pulls',
    bounds=_stop_bounds, interval=_beyond,
)  # fmt: skip
