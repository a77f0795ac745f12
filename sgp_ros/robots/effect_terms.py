"""Effects that a robot YAML states as parts of the robot's model.

They enter in one of three places, each by the same columns as in a diagnosis. What is a force of
the motion, `tau_x = columns @ coefficients` in `M a + h = tau + tau_x`, becomes a physics term of
the efforts, `tau = M a + h - tau_x`. What depends on the effort itself (gain, dead zone,
saturation, friction under load, torque from another joint) changes the recorded effort into the
one that acts, `tau + tau_x(tau)`. Tilt and payload belong to the tree.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.physics.observed_motion import ObservedMotion
from sgp_ros.physics.stated import coefficient_quantities
from sgp_ros.physics.term import Coefficient, Motion, Term
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.stated_effects import StatedEffect

ON_TREE = ('gravity_tilt', 'payload')
"""Effects that change the tree instead of adding a force."""
_OF_COMMAND = ('dead_zone', 'saturation')
"""Of the drive's input: a measured effort lies behind them."""
_OF_EFFORT = {
    'torque_gain': (0,), 'dead_zone': (0,), 'saturation': (0,), 'joint_coupling torque': (0,),
    'load_friction': (1,),
}  # fmt: skip
"""Effects to the columns that depend on the effort."""
_SOURCE = 'stated effect of a diagnosis'


def changed_tree(tree: Tree, effects: Sequence[StatedEffect]) -> Tree:
    """Return the tree with stated tilt of the base and payload.

    With the base oriented by `Ry(pitch) Rx(roll)`, gravity in its axes is that transposed times
    `(0, 0, -g)`.
    """
    for stated in effects:
        if stated.name == 'gravity_tilt':
            roll, pitch = stated.shape
            down = np.array([
                -math.sin(pitch), math.cos(pitch) * math.sin(roll),
                math.cos(pitch) * math.cos(roll),
            ])  # fmt: skip
            tree = replace(tree, gravity=-float(np.linalg.norm(tree.gravity)) * down)
        elif stated.name == 'payload':
            parameters = tree.parameters.copy()
            parameters[tree.size - 1] += _point_mass(*stated.shape)
            tree = replace(tree, parameters=parameters)
    return tree


def _point_mass(mass: float, x: float, y: float, z: float) -> np.ndarray:
    """Return the inertial parameters of a point mass, (10,)."""
    centre = np.array([x, y, z])
    tensor = (centre @ centre) * np.eye(3) - np.outer(centre, centre)
    rows, columns = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)
    return mass * np.concatenate([[1.0], centre, tensor[rows, columns]])


def effect_terms(
    tree: Tree, effects: Sequence[StatedEffect], coulomb_width: float
) -> tuple[Term, ...]:
    """Return a term for each effect that is a force of the motion.

    Its coefficients have the stated values as prior means. The shape is taken as it is.

    Args:
        tree: nominal robot.
        effects: stated ones.
        coulomb_width: velocity over which dry friction changes its sign [rad/s or m/s].
    """
    seen: Counter[tuple[str, str]] = Counter()
    terms = []
    for stated in effects:
        if not stated.is_online or stated.name in ON_TREE or stated.place is None:
            continue
        key = stated.name, stated.joint
        seen[key] += 1
        name = stated.name if seen[key] == 1 else f'{stated.name}_{seen[key]}'
        kept = [i for i in range(len(stated.coefficients)) if i not in _effort_columns(stated)]
        if kept:
            terms.append(_term(tree, stated, name, kept, coulomb_width))
    return tuple(terms)


def effort_map(
    tree: Tree, effects: Sequence[StatedEffect], coulomb_width: float
) -> EffortMap | None:
    """Return how recorded efforts become those that act; None where they are the same.

    Args:
        tree: nominal robot.
        effects: stated ones.
        coulomb_width: velocity over which dry friction changes its sign [rad/s or m/s].
    """
    chosen = tuple(e for e in effects if e.is_online and _effort_columns(e))
    return EffortMap(tree, chosen, coulomb_width) if chosen else None


@dataclass(frozen=True, slots=True, eq=False)
class EffortMap:
    """From recorded efforts to those that act, `tau + tau_x(tau)`.

    Attributes:
        tree: nominal robot.
        effects: those that depend on the effort.
        coulomb_width: velocity over which dry friction changes its sign [rad/s or m/s].
    """

    tree: Tree
    effects: tuple[StatedEffect, ...]
    coulomb_width: float

    def __call__(
        self, effort: np.ndarray, velocity: np.ndarray, *, is_measured: bool
    ) -> np.ndarray:
        """Return the efforts that act, (n, k) [N m or N].

        Args:
            effort: recorded, (n, k) [N m or N].
            velocity: (n, k) [rad/s or m/s].
            is_measured: of the motor's current, behind the dead zone and saturation of a drive.
        """
        still = np.zeros_like(velocity)
        motion = Motion(still, velocity, still, effort)
        acting = effort.copy()
        for stated in self.effects:
            if is_measured and stated.name in _OF_COMMAND:
                continue
            columns = list(_effort_columns(stated))
            force = _forces(self.tree, stated, motion, self.coulomb_width)[:, :, columns]
            acting += force @ stated.coefficients[columns]
        return acting


@dataclass(frozen=True, slots=True, eq=False)
class _Instant:
    """The efforts of a drive without memory, as effects ask for them."""

    values: np.ndarray

    def effort(
        self, joint: int, *, characteristic: Callable[[np.ndarray], np.ndarray] | None = None
    ) -> np.ndarray:
        u = self.values[:, joint]
        return u if characteristic is None else characteristic(u)


def _effort_columns(stated: StatedEffect) -> tuple[int, ...]:
    name = f'{stated.name} {stated.kind}' if stated.name == 'joint_coupling' else stated.name
    return _OF_EFFORT.get(name, ())


def _forces(tree: Tree, stated: StatedEffect, motion: Motion, width: float) -> np.ndarray:
    """Return the force per coefficient on every joint, (n, k, m).

    The rows stand alone, so the direction of motion is the velocity's, made smooth over `width`.
    """
    assert stated.effect is not None
    assert stated.place is not None
    n, k = motion.position.shape
    seen = ObservedMotion(
        tree, np.zeros(n), 0.0, motion.position, motion.velocity, motion.acceleration,
        motion.effort, _Instant(motion.effort),  # type: ignore[arg-type]  # all they ask of it
    )  # fmt: skip
    seen.__dict__['direction'] = np.tanh(motion.velocity / width)
    columns = stated.effect.columns(seen, stated.place, stated.shape)
    if columns.ndim == 3:
        return columns
    forces = np.zeros((n, k, columns.shape[1]))
    forces[:, stated.place.joint] = columns
    return forces


def _term(
    tree: Tree, stated: StatedEffect, name: str, kept: list[int], coulomb_width: float
) -> Term:
    def columns(motion: Motion) -> np.ndarray:
        return -_forces(tree, stated, motion, coulomb_width)[:, :, kept]

    assert stated.place is not None
    joint = stated.place.joint
    prismatic = joint >= 0 and bool(tree.is_prismatic[joint])
    quantities = coefficient_quantities(stated.name, stated.kind)
    coefficients = tuple(
        Coefficient(
            f'{stated.joint}.{name}.{quantities[i].name}',
            quantities[i].unit_on(is_prismatic=prismatic),
            stated.joint if joint >= 0 else None,
            float(stated.coefficients[i]),
            float(stated.std[i]),
        )
        for i in kept
    )
    return Term(coefficients, columns, _SOURCE)
