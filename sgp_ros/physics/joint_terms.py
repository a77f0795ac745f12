"""Terms of a robot YAML: laws of the catalogue in `effort = ... + coefficient * column`.

A dry friction would jump with the sign of the velocity; `tanh(v / width)` is that sign, made
smooth over `width`, because a measured velocity near zero has a sign by chance. Coefficients are
named and signed as the `TermForm` of their law says: friction and inertia that take effort from
the motor are positive, and so is an `offset` that it must give.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.parts import OwnMotion, TermForm
from sgp_ros.physics.term import Coefficient, Joint, Motion, Term


@dataclass(frozen=True, slots=True)
class Shape:
    """Settings of the columns that are not linear.

    Attributes:
        coulomb_width: velocity over which dry friction changes its sign [rad/s or m/s].
        stribeck_velocity: velocity at which the Stribeck effect has fallen to 1/e [rad/s or m/s].
    """

    coulomb_width: float = 0.01
    stribeck_velocity: float = 0.1

    def of(self, law: Effect) -> np.ndarray:
        """Return the shape of a law, (s,)."""
        return np.array([getattr(self, name) for name in law.shape_names()])


def term_laws() -> dict[str, tuple[Effect, TermForm]]:
    """Return the laws that are terms of single joints, by the name of the term."""
    return {e.term.name: (e, e.term) for e in EFFECTS.values() if e.term is not None}


def joint_term(
    name: str, joints: Sequence[Joint], chosen: Sequence[int], shape: Shape | None = None
) -> Term:
    """Return a term for some joints of a robot.

    Args:
        name: of the term.
        joints: all k joints of the robot.
        chosen: indices of those that get it.
        shape: None for the defaults.
    """
    (law, form), settings = term_laws()[name], shape or Shape()
    index = np.array(chosen, dtype=np.intp)
    quantities = [law.coefficient_quantities()[i] for i in form.columns]
    coefficients = tuple(
        Coefficient(
            f'{joints[j].name}.{part}',
            _raised(quantity.unit_on(is_prismatic=joints[j].kind == 'prismatic')),
            joints[j].name,
            low=quantity.low,
        )
        for j in chosen
        for part, quantity in zip(form.names, quantities, strict=True)
    )
    width, own_shape = len(form.names), settings.of(law)

    def columns(motion: Motion) -> np.ndarray:
        n, k = motion.position.shape
        block = np.zeros((n, k, len(index) * width))
        v = motion.velocity[:, index]
        own = OwnMotion(
            motion.position[:, index], v, motion.acceleration[:, index],
            np.tanh(v / settings.coulomb_width),
        )  # fmt: skip
        for part, signal in enumerate(law.term_columns(own, own_shape)):
            block[:, index, width * np.arange(len(index)) + part] = signal
        return block

    return Term(coefficients, columns, law.source)


def _raised(unit: str) -> str:
    """Return a unit with `^` before its exponents, as coefficients have it."""
    return re.sub(r'(?<=[a-z])2', '^2', unit)
