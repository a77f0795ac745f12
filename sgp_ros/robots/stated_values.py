"""Values that a robot states, brought to one form: bodies, damping, dry friction, effects.

A robot states physics in three places, and each thing counts once. `<dynamics>` of its URDF says
damping and dry friction. A coefficient under `parameters` of the robot YAML, which `sgp identify`
writes, takes the place of what the URDF says of the same thing: of a body, of damping or friction
of a joint, or of nothing. `effects` come on top of both; a coefficient of an effect under
`parameters` takes the place of the number that the effect states. Diagnosis, replay, simulation
and the node read a robot so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.joint_terms import Shape, term_laws
from sgp_ros.physics.place import Place
from sgp_ros.rigid.inertial import PARAMETERS
from sgp_ros.rigid.pseudo_inertia import is_consistent, pseudo_inertia
from sgp_ros.rigid.tree import Tree, read_urdf
from sgp_ros.rigid.urdf_writer import write_urdf
from sgp_ros.robots.effect_terms import coefficient_names
from sgp_ros.robots.nominal_prior import stated_dynamics
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.stated_effects import typical_motion
from sgp_ros.robots.urdf_robot import nominal_tree, urdf_text

Values = Mapping[str, float]
ROUNDING = 1e-9
"""Share of a pseudo-inertia below which it may be negative."""
NO_BODY = 'The stated parameters of {link} are physically impossible: the URDF is used instead.'


def values_of(robot: Robot) -> dict[str, float]:
    """Return the coefficients that the robot YAML states under `parameters`."""
    stated = robot.source.get('parameters') or {}
    assert isinstance(stated, dict)
    return {str(name): float(entry['value']) for name, entry in stated.items()}


def with_values(tree: Tree, values: Values, remarks: list[str]) -> Tree:
    """Return a tree with stated bodies, and with damping and friction of its k joints.

    Args:
        tree: of the URDF, with the payload that the robot states.
        values: coefficients by name.
        remarks: what cannot be is appended here.
    """
    parameters = tree.parameters.copy()
    for body, link in enumerate(tree.link_names):
        names = [f'{link}.{parameter}' for parameter, _ in PARAMETERS]
        said = [values.get(n, x) for n, x in zip(names, parameters[body], strict=True)]
        if said == parameters[body].tolist():
            continue
        if _can_exist(np.array(said)):
            parameters[body] = said
        else:
            remarks.append(NO_BODY.format(link=link))
    dynamics = {'damping': np.zeros(len(tree.damping)), 'friction': np.zeros(len(tree.friction))}
    for attribute, sizes in dynamics.items():
        for j, joint in enumerate(tree.moving_names):
            names = _names_of(joint, attribute)
            known = [values[n] for n in names if n in values]
            split = [n for n in _names_of(joint, attribute, is_same=False) if n in values]
            if known or split:
                sizes[j] = max(sum(known), 0.0)
            else:
                sizes[j] = stated_dynamics(tree, attribute, j)
    return replace(
        tree, parameters=parameters, damping=dynamics['damping'], friction=dynamics['friction']
    )


def _names_of(joint: str, attribute: str, *, is_same: bool = True) -> list[str]:
    """Return the coefficients that say what an attribute of `<dynamics>` says.

    Args:
        joint: its name.
        attribute: `damping` or `friction`.
        is_same: those of one number; else those that say it by several.
    """
    return [
        f'{joint}.{name}'
        for _, form in term_laws().values()
        if form.dynamics == attribute and (len(form.names) == 1) == is_same
        for name in form.names
    ]


def _can_exist(body: np.ndarray) -> bool:
    """Return whether ten parameters are those of a body, which may be flat, thin or a point."""
    J = pseudo_inertia(body)
    return bool(body[0] > 0.0 and np.linalg.eigvalsh(J)[0] > -ROUNDING * np.trace(J))


def term_effects(
    tree: Tree, values: Values, shape: Shape, remarks: list[str]
) -> tuple[EffectAt, ...]:
    """Return the effects that stated coefficients of terms are, beside bodies and `<dynamics>`.

    Args:
        tree: the robot.
        values: coefficients by name.
        shape: of the terms.
        remarks: what no physics can do is appended here.
    """
    found = []
    for law, form in term_laws().values():
        if form.dynamics and len(form.names) == 1:
            continue
        for j, joint in enumerate(tree.moving_names):
            known = [values.get(f'{joint}.{name}', 0.0) for name in form.names]
            if not any(known):
                continue
            c = np.zeros(len(law.coefficient_quantities()))
            c[list(form.columns)] = form.sign * np.array(known)
            effect = _named(EffectAt(law, Place(j), shape.of(law), c, joint), tree)
            if effect.is_possible(typical_motion(tree)):
                found.append(effect)
            else:
                remarks.append(
                    f'The value stated for {law.words} of {joint} is physically impossible: it is '
                    'ignored.'
                )
    return tuple(found)


def with_coefficients(
    effects: Sequence[EffectAt], values: Values, tree: Tree
) -> tuple[EffectAt, ...]:
    """Return effects with the coefficients that are stated of them under `parameters`."""
    found = []
    for effect, names in zip(effects, coefficient_names(effects), strict=True):
        c = effect.coefficients.copy()
        for i, name in names.items():
            c[i] = values.get(name, c[i])
        if np.array_equal(c, effect.coefficients):
            found.append(effect)
            continue
        changed = replace(effect, coefficients=c)
        if effect.effect.size:
            numbers = effect.numbers
            numbers[effect.effect.size] *= float(c[0])
            found.append(replace(changed, parameters={**effect.parameters, **numbers}))
        else:
            found.append(_named(changed, tree))
    return tuple(found)


def _named(effect: EffectAt, tree: Tree) -> EffectAt:
    """Return an effect with its parameters in words of its coefficients."""
    said = effect.report(typical_motion(tree))
    return replace(effect, parameters={**effect.parameters, **said})


def stated_urdf(
    robot: Robot, bodies: np.ndarray | None, dynamics: Mapping[str, tuple[float, float]]
) -> str | None:
    """Return the URDF of a robot with other bodies, damping and friction; None where none can be.

    A moving body is its link, what is fixed to it, what hangs on locked joints behind it, and
    the payload that the robot states under `payload`. Its link takes what is left beside those.

    Args:
        robot: from a URDF.
        bodies: (b, 10) of its tree; None for those of the URDF.
        dynamics: damping [N m s/rad or N s/m] and friction [N m or N] by joint.
    """
    text = urdf_text(robot)
    if bodies is None:
        return write_urdf(text, {}, dynamics)
    nominal, free = nominal_tree(robot), read_urdf(text)
    own = np.array([free.parameters[free.link_names.index(n)] for n in nominal.link_names])
    beside = nominal.parameters - own
    left = bodies - beside
    if not np.all(is_consistent(left) | ~beside.any(axis=1)):
        return None
    try:
        changed = {
            link: x for link, x, y in zip(nominal.link_names, left, own, strict=True)
            if not np.array_equal(x, y)
        }  # fmt: skip
        text = write_urdf(text, changed, dynamics)
        again = nominal_tree(replace(robot, source={**robot.source, 'urdf': text}))
    except ConfigError:
        return None
    floor = 1e-9 * float(np.abs(bodies).max())
    return text if np.allclose(again.parameters, bodies, rtol=1e-6, atol=floor) else None


@dataclass(frozen=True, slots=True)
class Stated:
    """Values that a robot states beside its bodies.

    Attributes:
        effects: as under `effects` of its YAML.
        parameters: as under `parameters`.
        dynamics: damping [N m s/rad or N s/m] and friction [N m or N] of joints whose `<dynamics>`
            are other ones.
    """

    effects: list[Any]
    parameters: dict[str, Any]
    dynamics: dict[str, tuple[float, float]]


def stated_less(robot: Robot, off: Mapping[tuple[str, str], float]) -> Stated:
    """Return what a robot states, less of some laws than it does.

    Args:
        robot: from a URDF.
        off: by name of a law of one coefficient, and joint, how much.
    """
    effects = deepcopy(robot.source.get('effects') or [])
    parameters = deepcopy(robot.source.get('parameters') or {})
    assert isinstance(effects, list)
    assert isinstance(parameters, dict)
    tree, dynamics = nominal_tree(robot), dict[str, tuple[float, float]]()
    for (name, joint), size in off.items():
        law, j, left = EFFECTS[name], tree.joint_names.index(joint), size
        entries = [x['parameters'][law.linear[0]] for x in effects
                   if (x.get('effect'), x.get('joint')) == (name, joint)]  # fmt: skip
        term = law.term.names[0] if law.term else ''
        entries += [parameters[key] for key in [f'{joint}.{term}'] if key in parameters]
        for entry in entries:
            taken = min(float(entry['value']), left)
            entry['value'], left = float(entry['value']) - taken, left - taken
        if law.term and law.term.dynamics and left > 0.0:
            damping, friction = dynamics.get(joint, (tree.damping[j], tree.friction[j]))
            own = {'damping': float(damping), 'friction': float(friction)}
            own[law.term.dynamics] = max(own[law.term.dynamics] - left, 0.0)
            dynamics[joint] = own['damping'], own['friction']
    gone = [x for x in effects if (x.get('effect'), x.get('joint')) in off
            and not x['parameters'][EFFECTS[x['effect']].linear[0]]['value']]  # fmt: skip
    return Stated([x for x in effects if x not in gone], parameters, dynamics)
