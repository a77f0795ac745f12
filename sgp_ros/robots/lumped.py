"""Robots that are described by a few lumped coefficients, stated as formulas in a robot YAML.

    schema: 1
    name: pendulum
    description: A driven pendulum that hangs at zero
    source: where the equations come from
    target: effort              # or acceleration, what f(u) W predicts
    joints: [{name: hinge}]     # kind: prismatic, actuated: false, effort_unit: V
    constants: {g: 9.81}        # numbers, or formulas of earlier ones
    coefficients:               # one column of f(u) each: its formula in the equation of a joint
      J: {unit: kg m^2, columns: {hinge: 'ddq[hinge]'}, value: 0.15}
      G: {unit: N m, columns: {hinge: 'sin(q[hinge])'}, value: 0.3 * g, meaning: gravity}
    residual_inputs: own        # what Z sees
    bodies:                     # the simplest bodies with these coefficients
      derived: {mass: 4 * (G / g) ** 2 / (3 * J)}
      links: {hinge: {mass: mass, centre: -G / g / mass, inertia: J / 4}}

Accelerations and efforts may enter a column only affinely, because the filters rely on it. The
values are what is known of the robot beforehand; estimates do not start from them. The grammar of
the formulas is that of `physics.formula`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.physics.formula import read_formula
from sgp_ros.physics.grammar import DRIVEN
from sgp_ros.physics.term import Coefficient, Joint, Motion, Term
from sgp_ros.robots.bodies import read_bodies
from sgp_ros.robots.entries import Entries
from sgp_ros.robots.robot import Robot
from sgp_ros.strangers import is_usable

LUMPED_KEYS = frozenset({
    'schema', 'name', 'description', 'source', 'target', 'joints', 'constants', 'coefficients',
    'residual_inputs', 'bodies', 'parameters',
})  # fmt: skip
_COLUMN_KEYS = {'unit', 'columns', 'value', 'source', 'meaning'}
_INPUT_OF = {'acceleration': 'tau', 'effort': 'ddq'}
"""By target, the driven signal that its columns may hold."""


def build_lumped_robot(document: Mapping[str, Any], problems: list[str]) -> Robot | None:
    """Return the robot of a YAML with the key `coefficients`.

    Args:
        document: content of the YAML.
        problems: what is wrong is appended here.

    Returns:
        None where something is wrong.
    """
    known = len(problems)
    entries = Entries(document, problems)
    entries.refuse_others(LUMPED_KEYS)
    joints = _joints(document.get('joints'), problems)
    target = entries.text('target', 'effort')
    if target not in _INPUT_OF:
        problems.append(f'target is {target!r}, not one of {sorted(_INPUT_OF)}')
    constants = _constants(entries)
    terms, values = _coefficients(entries, joints, target, constants)
    bodies = read_bodies(entries.mapping('bodies'), joints, constants, values, problems)
    if len(problems) > known:
        return None
    robot = Robot(
        name=entries.text('name', 'robot'),
        joints=joints,
        target=target,
        terms=terms,
        residual_inputs=((),) * len(joints),
        description=entries.text('description', f'Robot of {len(terms)} coefficients'),
        source={k: v for k, v in document.items() if k not in {'schema', 'parameters'}},
        bodies=bodies,
    )
    try:
        return robot.with_inputs(document.get('residual_inputs', 'own'))
    except ConfigError as error:
        problems.append(str(error))
        return None


def _joints(entry: object, problems: list[str]) -> tuple[Joint, ...]:
    joints = []
    for item in entry if isinstance(entry, list) else ():
        inner = Entries(item if isinstance(item, dict) else {}, problems, 'joints.')
        inner.refuse_others({'name', 'kind', 'actuated', 'effort_unit'})
        kind, is_actuated = inner.text('kind', 'revolute'), inner.document.get('actuated', True)
        if kind not in {'revolute', 'prismatic'} or not isinstance(is_actuated, bool):
            problems.append(f'joint {item!r}: kind revolute or prismatic, actuated true or false')
        unit = inner.document.get('effort_unit', '')
        joints.append(
            Joint(inner.text('name', ''), kind, is_actuated=is_actuated, effort_unit=str(unit))
        )
    names = [joint.name for joint in joints]
    if not joints or not all(names) or len(set(names)) < len(names):
        problems.append(f'joints is {entry!r}, not a list of {{name: text}}, different ones')
        return ()
    return tuple(joints)


def _constants(entries: Entries) -> dict[str, float]:
    """Return the constants by name; each may use those before it."""
    constants: dict[str, float] = {}
    stated = entries.mapping('constants') or {}
    inner = Entries(stated, entries.problems, 'constants.')
    for name in stated:
        constants[str(name)] = _value(inner, name, constants)
    return constants


def _coefficients(
    entries: Entries, joints: Sequence[Joint], target: str, constants: Mapping[str, float]
) -> tuple[tuple[Term, ...], dict[str, float | None]]:
    """Return a term for each coefficient, and its nominal value, None where none is stated."""
    terms: list[Term] = []
    values: dict[str, float | None] = {}
    source = entries.text('source', 'its robot YAML')
    for name, entry in (entries.mapping('coefficients') or {}).items():
        inner = Entries(entry if isinstance(entry, dict) else {}, entries.problems, f'{name}.')
        inner.refuse_others(_COLUMN_KEYS)
        terms.append(_term(str(name), inner, joints, target, source))
        has_value = 'value' in inner.document
        values[str(name)] = _value(inner, 'value', constants) if has_value else None
    return tuple(terms), values


def _value(entries: Entries, key: str, names: Mapping[str, float]) -> float:
    """Return the number of a formula of known names."""
    formula = entries.formula(key, names)
    value = 1.0 if formula is None else formula.value(names)
    if not is_usable(value):
        entries.problems.append(f'{entries.prefix}{key} has the value {value}')
    return value


def _term(name: str, entries: Entries, joints: Sequence[Joint], target: str, source: str) -> Term:
    """Return the term of one coefficient; what is wrong with it is noted."""
    names = [joint.name for joint in joints]
    columns: list[tuple[int, Callable[[Motion], np.ndarray]]] = []
    stated = entries.mapping('columns')
    if not stated:
        entries.problems.append(f'{entries.prefix}columns is {stated!r}, not {{joint: formula}}')
    for joint, text in (stated or {}).items():
        column = _column(text, target, names, f'{entries.prefix}columns', entries.problems)
        if joint not in names:
            entries.problems.append(f'{entries.prefix}columns of {joint!r}, not one of {names}')
        elif column is not None:
            columns.append((names.index(joint), column))
    own = names[columns[0][0]] if len(columns) == 1 else None
    meaning = entries.text('meaning', name)
    coefficient = Coefficient(
        name, entries.text('unit', ''), own, meaning='' if meaning == name else meaning
    )
    return Term((coefficient,), _block(columns), entries.text('source', source))


def _column(
    text: object, target: str, joints: Sequence[str], where: str, problems: list[str]
) -> Callable[[Motion], np.ndarray] | None:
    """Return the column that a formula states; None where it is not a column of a regressor."""
    try:
        formula = read_formula(text)
    except ConfigError as error:
        problems.append(f'{where}: {error}')
        return None
    given = _INPUT_OF.get(target, '')
    driven = {name for name, _ in formula.signals} & set(DRIVEN)
    unknown = sorted({joint for _, joint in formula.signals} - set(joints))
    problem = ''
    if formula.parameters:
        problem = f'has the names {sorted(formula.parameters)}; a column has numbers alone'
    elif unknown:
        problem = f'has the joints {unknown}, not some of {list(joints)}'
    elif not driven <= {given}:
        problem = f'for the target {target} may hold {given}[J], not {sorted(driven - {given})}'
    elif formula.driven_degree > 1.0:
        problem = f'is not affine in {given}[J]: it may stand alone or times functions of q and dq'
    if problem:
        problems.append(f'{where}: {formula.text!r} {problem}')
        return None
    return formula.column(joints)


def _block(
    columns: Sequence[tuple[int, Callable[[Motion], np.ndarray]]],
) -> Callable[[Motion], np.ndarray]:
    def block(motion: Motion) -> np.ndarray:
        values = np.zeros((*motion.position.shape, 1))
        for joint, column in columns:
            values[:, joint, 0] = column(motion)
        return values

    return block
