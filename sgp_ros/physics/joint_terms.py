"""Physics of single joints by name: friction, offset, rotor inertia, spring.

Each enters the equation of its own joint with one or two columns of the joint's motion, so that
`effort = ... + coefficient * column`. A dry friction would jump with the sign of the velocity;
`tanh(v / width)` is that sign, made smooth over `width`, because a measured velocity near zero has
a sign by chance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.physics.term import Coefficient, Joint, Motion, Term

_FRICTION = 'Armstrong-Helouvry, Dupont, Canudas de Wit 1994'
_MECHANICS = 'Khalil and Dombre 2002, Modeling, Identification and Control of Robots, chapter 9'


@dataclass(frozen=True, slots=True)
class Shape:
    """Settings of the columns that are not linear.

    Attributes:
        coulomb_width: velocity over which dry friction changes its sign [rad/s or m/s].
        stribeck_velocity: velocity at which the Stribeck effect has fallen to 1/e [rad/s or m/s].
    """

    coulomb_width: float = 0.01
    stribeck_velocity: float = 0.1


@dataclass(frozen=True, slots=True)
class JointTerm:
    """A term of single joints.

    Attributes:
        names: of its coefficients, one or two, each after the name of the joint.
        revolute_unit: unit of the coefficients of a revolute joint.
        prismatic_unit: unit of those of a prismatic joint.
        columns: from position, velocity, acceleration, (n, j) each, to one (n, j) per name.
        source: where the equation comes from.
    """

    names: tuple[str, ...]
    revolute_unit: str
    prismatic_unit: str
    columns: Callable[[np.ndarray, np.ndarray, np.ndarray, Shape], tuple[np.ndarray, ...]]
    source: str


def _asymmetric(v: np.ndarray, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    sign = np.tanh(v / shape.coulomb_width)
    return np.maximum(sign, 0.0), np.minimum(sign, 0.0)


def _stribeck(v: np.ndarray, shape: Shape) -> np.ndarray:
    return np.tanh(v / shape.coulomb_width) * np.exp(-((v / shape.stribeck_velocity) ** 2))


JOINT_TERMS: dict[str, JointTerm] = {
    'viscous': JointTerm(
        ('viscous',), 'N m s/rad', 'N s/m', lambda _q, v, _a, _s: (v,), _FRICTION
    ),
    'coulomb': JointTerm(
        ('coulomb',), 'N m', 'N', lambda _q, v, _a, s: (np.tanh(v / s.coulomb_width),), _FRICTION
    ),
    'asymmetric_coulomb': JointTerm(
        ('coulomb_positive', 'coulomb_negative'), 'N m', 'N',
        lambda _q, v, _a, s: _asymmetric(v, s), _FRICTION,
    ),
    'stribeck': JointTerm(
        ('stribeck',), 'N m', 'N', lambda _q, v, _a, s: (_stribeck(v, s),), _FRICTION
    ),
    'quadratic': JointTerm(
        ('quadratic',), 'N m s^2/rad^2', 'N s^2/m^2',
        lambda _q, v, _a, _s: (v * np.abs(v),), _FRICTION,
    ),
    'offset': JointTerm(
        ('offset',), 'N m', 'N', lambda q, _v, _a, _s: (np.ones_like(q),), _MECHANICS
    ),
    'armature': JointTerm(
        ('armature',), 'kg m^2', 'kg', lambda _q, _v, a, _s: (a,), _MECHANICS
    ),
    'spring': JointTerm(
        ('stiffness',), 'N m/rad', 'N/m', lambda q, _v, _a, _s: (q,), _MECHANICS
    ),
}  # fmt: skip
"""Name in a robot YAML to term. Positive coefficients of the first four and `quadratic` oppose the
motion; `coulomb_positive` acts at positive velocity, `coulomb_negative` at negative."""


def joint_term(
    name: str, joints: Sequence[Joint], chosen: Sequence[int], shape: Shape | None = None
) -> Term:
    """Return a term of `JOINT_TERMS` for some joints of a robot.

    Args:
        name: in `JOINT_TERMS`.
        joints: all k joints of the robot.
        chosen: indices of those that get it.
        shape: None for the defaults.
    """
    term, shape = JOINT_TERMS[name], shape or Shape()
    index = np.array(chosen, dtype=np.intp)
    coefficients = tuple(
        Coefficient(
            f'{joints[j].name}.{part}',
            term.revolute_unit if joints[j].kind == 'revolute' else term.prismatic_unit,
            joints[j].name,
        )
        for j in chosen
        for part in term.names
    )
    width = len(term.names)

    def columns(motion: Motion) -> np.ndarray:
        n, k = motion.position.shape
        block = np.zeros((n, k, len(index) * width))
        signals = term.columns(
            motion.position[:, index], motion.velocity[:, index], motion.acceleration[:, index],
            shape,
        )  # fmt: skip
        for part, signal in enumerate(signals):
            block[:, index, width * np.arange(len(index)) + part] = signal
        return block

    return Term(coefficients, columns, term.source)
