"""Loads and forces on the robot: springs, tilt, payload, cogging, constant and tip forces."""

from __future__ import annotations

import math

import numpy as np

from sgp_ros.physics.effect import EMPTY, Effect, Numbers
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import (
    BASE,
    LAST,
    TOOL,
    OwnMotion,
    Place,
    Placed,
    Quantity,
    TermForm,
    Value,
)

GRAVITY = 9.81
_MECHANICS = 'Khalil and Dombre 2002, Modeling, Identification and Control of Robots, chapter 9'


def per_turn(motion: SeenMotion, joint: int) -> float:
    """Return the phase per position and period, 1 on a revolute and 2 pi on a prismatic joint."""
    return 2.0 * math.pi if motion.tree.is_prismatic[joint] else 1.0


def wave_coefficients(x: Numbers) -> tuple[float, float]:
    """Return sine and cosine: `A sin(z + phase) = A cos(phase) sin z + A sin(phase) cos z`."""
    amplitude, phase = x['amplitude'], x['phase']
    return amplitude * math.cos(phase), amplitude * math.sin(phase)


class Spring(Effect):
    """`tau_x = -stiffness (q - rest)`: a torsion spring, or a cable under tension."""

    name = 'spring'
    words = 'a spring'
    formula = 'tau_x = -stiffness (q - rest)'
    source = _MECHANICS
    appearance = 'the effort that is left is a straight line over the position'
    quantities = (Quantity('stiffness', 'N m/rad', low=0.0), Quantity('rest', 'rad'))
    linear = ('stiffness', 'rest')
    term = TermForm('spring', ('stiffness',))

    def coefficient_quantities(self, kind: str = '') -> tuple[Quantity, ...]:
        return Quantity('stiffness', 'N m/rad'), Quantity('preload', 'N m')

    def model(self, numbers: Numbers, kind: str = '') -> tuple[np.ndarray, np.ndarray]:
        stiffness = numbers['stiffness']
        return EMPTY, np.array([stiffness, stiffness * numbers['rest']])

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        stiffness, force = map(float, at.coefficients)
        return {'stiffness': stiffness, 'rest': force / stiffness}

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        return bool(at.coefficients[0] > 0.0)

    def local(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        return -x.q, np.ones_like(x.q)


class ConstantLoad(Effect):
    """`tau_x = force`."""

    name = 'constant_load'
    words = 'a constant load'
    formula = 'tau_x = force'
    source = _MECHANICS
    appearance = 'the effort that is left is the same everywhere'
    quantities = (Quantity('force', 'N m'),)
    linear = ('force',)
    term = TermForm('offset', ('offset',), sign=-1.0)

    def local(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        return (np.ones_like(x.q),)


class Armature(Effect):
    """`tau_x = -inertia a`: the rotor of the motor."""

    name = 'armature'
    words = 'rotor inertia'
    formula = 'tau_x = -inertia a'
    source = _MECHANICS
    appearance = 'the effort that is left is proportional to the acceleration'
    quantities = (Quantity('inertia', 'kg m2', low=0.0),)
    linear = ('inertia',)
    term = TermForm('armature', ('armature',))
    drawn_over = 'acceleration'
    is_inertial = True
    sees_acceleration = True

    def local(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        return (-x.a,)


class GravityTilt(Effect):
    """A base that is not level: its orientation in the world is `Ry(pitch) Rx(roll)`."""

    name = 'gravity_tilt'
    words = 'a base that is not level'
    formula = 'gravity in base axes = (Ry(pitch) Rx(roll))^T (0, 0, -9.81)'
    source = _MECHANICS
    appearance = 'efforts that hold the arm differ as if gravity came from another direction'
    quantities = (Quantity('roll', 'rad'), Quantity('pitch', 'rad'))
    site = BASE
    uses_bodies = True
    is_on_tree = True

    def gravity(self, shape: np.ndarray, magnitude: float) -> np.ndarray:
        roll, pitch = shape
        return -magnitude * np.array([
            -math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll),
        ])  # fmt: skip

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        return bool(np.hypot(*at.shape) < 0.7)

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return the force of the change of gravity, (n, k, 1)."""
        change = self.gravity(shape, GRAVITY) - motion.tree.gravity
        return -(motion.gravity_columns @ change)[:, :, None]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        ways = [[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [1, -1], [-1, 1], [-1, -1]]
        return 0.03 * np.array(ways)

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        return np.full(2, -0.7), np.full(2, 0.7)


class Payload(Effect):
    """A point mass that is fixed to the last link, in the frame of that link."""

    name = 'payload'
    words = 'a payload'
    formula = 'a point mass that is fixed to the last link'
    source = _MECHANICS
    appearance = 'all joints below carry and accelerate more than the bodies of the file'
    quantities = (
        Quantity('mass', 'kg', low=0.0, is_positive=True),
        Quantity('x', 'm', is_scored=False), Quantity('y', 'm', is_scored=False),
        Quantity('z', 'm', is_scored=False),
    )  # fmt: skip
    site = LAST
    drawn_over = 'seconds'
    sees_acceleration = True
    is_body = True
    is_on_tree = True

    def added_body(self, shape: np.ndarray) -> np.ndarray:
        mass, x, y, z = shape
        return mass * np.array(
            [1.0, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y]
        )

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return -(motion.last_body_columns @ self.added_body(shape))[:, :, None]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        tree, body = motion.tree, motion.tree.parameters[place.joint]
        tools = [f.translation for f in tree.frames if f.name == 'tool0' and f.body == place.joint]
        centres = [body[1:4] / max(float(body[0]), 1e-9), *tools]
        return np.array([[0.3 * float(body[0]), *centre] for centre in centres])

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        reach = _reach(motion, place.joint)
        heavy = 3.0 * float(motion.tree.parameters[place.joint, 0])
        return np.array([0.0, -reach, -reach, -reach]), np.array([heavy, reach, reach, reach])


def _reach(motion: SeenMotion, joint: int) -> float:
    """Return how far from its joint a load may sit on a link [m]."""
    tree = motion.tree
    values = tree.parameters[joint]
    radius = math.sqrt(max(0.5 * (values[4] + values[6] + values[9]) / max(values[0], 1e-9), 1e-4))
    frames = [np.linalg.norm(f.translation) for f in tree.frames if f.body == joint]
    return float(max([2.0 * radius, *(1.2 * length for length in frames)]))


class TipForce(Effect):
    """A constant force in the axes of the root at the origin of `tool0`."""

    name = 'tip_force'
    words = 'a constant force on the tool'
    formula = 'tau_x = J_tool(q)^T (fx, fy, fz)'
    source = _MECHANICS
    appearance = 'efforts that change with the pose as the lever arms of one force do'
    quantities = (Quantity('fx', 'N'), Quantity('fy', 'N'), Quantity('fz', 'N'))
    linear = ('fx', 'fy', 'fz')
    site = TOOL

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return motion.tool_columns


class Cogging(Effect):
    """A ripple over the position; columns are its sine and cosine, the shape its periods."""

    name = 'cogging'
    words = 'cogging'
    formula = 'tau_x = amplitude sin(periods q + phase)'
    source = 'Holtz and Springob 1996'
    appearance = 'a wave of the effort over the position, the same in both directions'
    quantities = (
        Quantity('amplitude', 'N m'),
        Quantity('periods', '1/revolution'),
        Quantity('phase', 'rad', is_scored=False),
    )
    linear = ('amplitude', 'phase')

    def coefficient_quantities(self, kind: str = '') -> tuple[Quantity, ...]:
        return Quantity('sine', 'N m'), Quantity('cosine', 'N m')

    def model(self, numbers: Numbers, kind: str = '') -> tuple[np.ndarray, np.ndarray]:
        return np.array([numbers['periods']]), np.array(wave_coefficients(numbers))

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        c = at.coefficients
        return {
            'amplitude': float(math.hypot(c[0], c[1])),
            'periods': float(at.shape[0]),
            'phase': float(math.atan2(c[1], c[0])),
        }

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        angle = shape[0] * per_turn(motion, place.joint) * motion.position[:, place.joint]
        return np.column_stack([np.sin(angle), np.cos(angle)])

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return periods: at least one in the range of motion, spaced a third of a period."""
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

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        periods = self.starts(motion, place)
        return 0.9 * periods[0], 1.1 * periods[-1]


class JointCoupling(Effect):
    """Torque of another motor, or a cable of energy `stiffness/2 (q - ratio q_source)^2`."""

    name = 'joint_coupling'
    words = 'a coupling between joints'
    formula = 'tau_x = coefficient tau_source, or the force of stiffness/2 (q - ratio q_source)^2'
    source = _MECHANICS
    appearance = 'the effort that is left follows the effort or the position of another joint'
    quantities = (
        Quantity('coefficient', '1', kinds=('torque',)),
        Quantity('stiffness', 'N m/rad', low=0.0, kinds=('spring',)),
        Quantity('ratio', '1', is_scored=False, kinds=('spring',)),
    )
    linear = ('coefficient', 'stiffness')
    kinds = ('torque', 'spring')
    has_source = True

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        if place.kind == 'torque':
            return motion.effort[:, place.source, None]
        n, k = motion.position.shape
        columns = np.zeros((n, k, 1))
        stretch = motion.position[:, place.joint] - shape[0] * motion.position[:, place.source]
        columns[:, place.joint, 0] = -stretch
        columns[:, place.source, 0] = shape[0] * stretch
        return columns

    def effort_columns(self, kind: str) -> tuple[int, ...]:
        return (0,) if kind == 'torque' else ()

    def places(self, motion: SeenMotion) -> list[Place]:
        tree, moving = motion.tree, motion.moving_joints
        torques = [
            Place(j, 'torque', i) for j in moving for i in range(tree.size)
            if i != j and tree.is_actuated[i]
        ]  # fmt: skip
        return torques + [Place(j, 'spring', i) for j in moving for i in moving if i != j]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        if place.kind == 'torque':
            return np.zeros((1, 0))
        return np.array([-2.0, -1.0, -0.5, 0.5, 1.0, 2.0])[:, None]

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        shapes = 1 if place.kind == 'spring' else 0
        return np.full(shapes, -5.0), np.full(shapes, 5.0)
