"""Priors of coefficients around the nominal values of a URDF.

A relative spread s gives the standard deviation `s * scale`. The scale of an inertial parameter is
that of its body: m, m L and m L^2 for mass, first moment and inertia, where L is the root mean
square distance of the mass from the origin of the joint, `L^2 = (Ixx + Iyy + Izz) / 2 m`; so the
first moment along an axis in which the body is balanced is not taken for known. The scale of a
friction coefficient is its nominal value.

Scales have floors, for a value of zero is rarely meant: 0.01 kg and 0.01 m for bodies, 1 % of the
effort limit for coefficients of a joint (per rad, rad/s, ...), 0.1 N m or N without such a limit.
"""

from __future__ import annotations

import math

import numpy as np

from sgp_ros.physics.joint_terms import term_laws
from sgp_ros.physics.term import Term
from sgp_ros.rigid.tree import Tree

LEAST_MASS = 0.01
"""Floor of the scale of a mass [kg]."""
LEAST_RADIUS = 0.01
"""Floor of the distance of mass from the joint [m]."""
LIMIT_SHARE = 0.01
"""Floor of the scale of a joint's coefficient, as a share of its effort limit."""
LEAST_EFFORT = 0.1
"""That floor where the file states no limit [N m or N]."""


def inertial_prior(
    tree: Tree, bodies: list[int], term: Term, spread: float
) -> dict[str, tuple[float, float]]:
    """Return mean and standard deviation by name of the ten coefficients of each body.

    Args:
        tree: with nominal parameters.
        bodies: indices of those that `term` has columns of, in the same order.
        term: the inertial term.
        spread: relative, positive.
    """
    prior = {}
    names = iter(term.coefficients)
    for body in bodies:
        values = tree.parameters[body]
        mass = max(float(values[0]), LEAST_MASS)
        radius = math.sqrt(max(0.5 * (values[4] + values[6] + values[9]) / mass, LEAST_RADIUS**2))
        scales = mass * np.repeat([1.0, radius, radius**2], [1, 3, 6])
        for value, scale in zip(values, scales, strict=True):
            prior[next(names).name] = (float(value), spread * float(scale))
    return prior


def joint_prior(
    tree: Tree, kind: str, chosen: list[int], term: Term, spread: float
) -> dict[str, tuple[float, float]]:
    """Return mean and standard deviation by name of a term of single joints.

    Viscous and Coulomb friction have a nominal value in `<dynamics>`, with that of joints that
    follow; others have the mean 0.

    Args:
        tree: with nominal friction.
        kind: name of the term.
        chosen: joints that `term` has columns of, in the same order.
        term: the term.
        spread: relative, positive.
    """
    prior = {}
    _, form = term_laws()[kind]
    names = iter(term.coefficients)
    for joint in chosen:
        nominal = stated_dynamics(tree, form.dynamics, joint) if form.dynamics else 0.0
        limit = float(tree.effort_limit[joint])
        floor = LIMIT_SHARE * limit if 0.0 < limit < math.inf else LEAST_EFFORT
        for _ in form.names:
            prior[next(names).name] = (nominal, spread * max(nominal, floor))
    return prior


def stated_dynamics(tree: Tree, attribute: str, joint: int) -> float:
    """Return damping [N m s/rad or N s/m] or friction [N m or N] of `<dynamics>`.

    That of joints that follow counts with its gain.

    Args:
        tree: with nominal friction.
        attribute: `damping` or `friction`.
        joint: that moves on its own.
    """
    group, gains = tree.follows == joint, np.abs(tree.multipliers)
    if attribute == 'damping':
        return float(np.sum((tree.damping * gains**2)[group]))
    return float(np.sum((tree.friction * gains)[group]))
