"""Bodies and forces that act on many joints: tilt of the base, payload, force on the tool."""

from __future__ import annotations

import math

import numpy as np

from sgp_ros.physics.drawing import Drawn, Scene, UnsuitableError
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.motion import SeenMotion
from sgp_ros.physics.parts import Quantity
from sgp_ros.physics.place import BASE, LAST, TOOL, Place, Placed

GRAVITY = 9.81
_MECHANICS = 'Khalil and Dombre 2002, Modeling, Identification and Control of Robots, chapter 9'

_FARTHER = 2.0
"""Distance of a load over that of the farthest frame of its link."""
_STRONGER = 2.0
"""Load over that for which the efforts of the recording would just do."""


LEVEL = 0.1
"""Prior standard deviation of a tilt about either axis [rad]. Convention."""
MOST_TILT = 0.35
"""Beyond it a base does not stand badly, it is mounted in another orientation [rad]."""


class GravityTilt(Effect):
    """A base that is not level: its orientation in the world is `Ry(pitch) Rx(roll)`."""

    name = 'gravity_tilt'
    words = 'a base that is not level'
    formula = 'gravity in base axes = (Ry(pitch) Rx(roll))^T (0, 0, -9.81)'
    source = _MECHANICS
    appearance = 'holding efforts differ as if gravity had another direction'
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
        return True

    def surprise(self, at: Placed) -> float:
        """Return the price of a tilt: a base that is meant to be level stands within 0.1 rad."""
        return 0.5 * float(at.shape @ at.shape) / LEVEL**2

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return the force of the change of gravity, (n, k, 1)."""
        change = self.gravity(shape, GRAVITY) - motion.tree.gravity
        return -(motion.gravity_columns @ change)[:, :, None]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        ways = [[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [1, -1], [-1, 1], [-1, -1]]
        return 0.03 * np.array(ways)

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return tilts; a base that is mounted otherwise is stated wrongly, not tilted."""
        most = np.full(2, MOST_TILT)
        return -most, most

    def draw(self, scene: Scene) -> Drawn:
        """Return a tilt in a direction."""
        if len(scene.bodies) < 2:
            raise UnsuitableError(self.name)
        angle = scene.rng.uniform(0.0, 2.0 * math.pi)
        return Drawn(
            0.08, lambda s: {'roll': s * math.cos(angle), 'pitch': s * math.sin(angle)}, 0.3,
            index=-1, place=self.site.value,
        )  # fmt: skip


class Payload(Effect):
    """A point mass that is fixed to an outermost link, in the frame of that link."""

    name = 'payload'
    words = 'a payload'
    formula = 'a point mass that is fixed to an outermost link'
    source = _MECHANICS
    appearance = 'all joints carry and accelerate more mass than the robot file states'
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
        return -(motion.load_columns[place.joint] @ self.added_body(shape))[:, :, None]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        tree, body = motion.tree, motion.tree.parameters[place.joint]
        tools = [f.translation for f in tree.frames if f.name == 'tool0' and f.body == place.joint]
        centres = [body[1:4] / max(float(body[0]), 1e-9), *tools]
        return np.array([[0.3 * float(body[0]), *centre] for centre in centres])

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return what the efforts could carry at the centre of the link, and how far it may be."""
        reach, body = link_reach(motion, place.joint), motion.tree.parameters[place.joint]
        unit = self.added_body(np.array([1.0, *(body[1:4] / max(float(body[0]), 1e-9))]))
        efforts = np.hypot(motion.effort, motion.nominal_effort)
        of_unit = motion.load_columns[place.joint] @ unit
        carried = np.sqrt((efforts**2).sum() / max((of_unit**2).sum(), 1e-300))
        heavy = max(_STRONGER * float(carried), 3.0 * float(body[0]))
        return np.array([0.0, -reach, -reach, -reach]), np.array([heavy, reach, reach, reach])

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        low, high = self.bounds(motion, place)
        link = float(motion.tree.parameters[place.joint, 0])
        mass = min(float(high[0]), 4.0 * max(float(shape[0]), 0.3 * link))
        return np.array([mass, *(high - low)[1:]])

    def draw(self, scene: Scene) -> Drawn:
        """Return a mass at the tip."""
        last = scene.bodies[-1]
        where = dict(zip('xyz', map(float, last.tip), strict=True))
        return Drawn(
            0.2 * last.mass, lambda s: {'mass': s, **where}, 1.5 * last.mass,
            index=len(scene.bodies) - 1,
        )  # fmt: skip


def link_reach(motion: SeenMotion, joint: int) -> float:
    """Return how far from its joint a load may sit on a link [m]."""
    tree = motion.tree
    values = tree.parameters[joint]
    radius = math.sqrt(max(0.5 * (values[4] + values[6] + values[9]) / max(values[0], 1e-9), 1e-4))
    frames = [float(np.linalg.norm(f.translation)) for f in tree.frames if f.body == joint]
    return _FARTHER * float(max([2.0 * radius, *frames]))


class TipForce(Effect):
    """A constant force in the axes of the root at the origin of `tool0`."""

    name = 'tip_force'
    words = 'a constant force on the tool'
    formula = 'tau_x = J_tool(q)^T (fx, fy, fz)'
    source = _MECHANICS
    appearance = 'the residual effort changes with the pose as the lever arms of one force do'
    quantities = (Quantity('fx', 'N'), Quantity('fy', 'N'), Quantity('fz', 'N'))
    linear = ('fx', 'fy', 'fz')
    site = TOOL

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        return motion.tool_columns

    def draw(self, scene: Scene) -> Drawn:
        """Return a force in a direction."""
        if len(scene.bodies) < 2:
            raise UnsuitableError(self.name)
        axis = scene.rng.normal(size=3)
        axis = axis / np.linalg.norm(axis)
        return Drawn(
            0.5 * float(np.median(scene.motion.effort)),
            lambda s: dict(zip(self.linear, (float(s * x) for x in axis), strict=True)),
            index=-1, place=self.site.value,
        )  # fmt: skip
