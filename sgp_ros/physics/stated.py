"""Shape and coefficients of an effect from its stated values, the inverse of `Effect.report`.

A file states effects in the words of the schema. The side of the range on which an effect sits is
not among its values; it follows from where the values lie, unless the word `side` says it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect import Place, Quantity
from sgp_ros.rigid.tree import Tree

Numbers = Mapping[str, float]

PLACES = {'base': -1, 'tool': -2, 'all': -3}
"""Words for places that are no joint."""
PLACED = {'gravity_tilt': 'base', 'tip_force': 'tool'}
"""Effects that sit at such a place alone."""
SIDES = {'lower': -1, 'upper': 1}
SIDED = ('limit_friction', 'end_stop')
"""Effects at one end of the range."""
KINDS = {
    'position_friction': ('coulomb', 'viscous'),
    'friction_drift': ('coulomb', 'viscous'),
    'joint_coupling': ('torque', 'spring'),
}
"""Effects that come in kinds."""
VELOCITY_FILTER_LAG = 'velocity_filter_lag'
"""An effect of the velocity sensor, which exerts no force."""
_COUPLING = {'torque': ('coefficient',), 'spring': ('stiffness', 'ratio')}
_FRICTION_UNIT = Quantity('', 'N m s/rad')


def effect_names() -> tuple[str, ...]:
    """Return the names of all effects that can be stated."""
    return (*EFFECTS, VELOCITY_FILTER_LAG)


def stated_quantities(effect: str, kind: str = '') -> tuple[Quantity, ...]:
    """Return the numbers that state an effect, with their units on a revolute joint."""
    if effect == VELOCITY_FILTER_LAG:
        return (Quantity('time_constant', 's'),)
    quantities = EFFECTS[effect].quantities
    if effect == 'joint_coupling':
        return tuple(q for q in quantities if q.name in _COUPLING.get(kind, ()))
    if kind == 'viscous':
        return tuple(
            Quantity(q.name, _FRICTION_UNIT.unit if q.unit == 'N m' else q.unit)
            for q in quantities
        )
    return quantities


def coefficient_quantities(effect: str, kind: str = '') -> tuple[Quantity, ...]:
    """Return names and units of the linear coefficients, in the order of the columns."""
    if effect in _COEFFICIENTS:
        return _COEFFICIENTS[effect]
    known = {q.name: q for q in stated_quantities(effect, kind)}
    return tuple(known[name] for name in _LINEAR.get(effect, known) if name in known)


def inverse(effect: str, kind: str = '') -> Callable[[Numbers], tuple[list[float], list[float]]]:
    """Return the function from stated numbers to shape and coefficients."""
    return _INVERSE[f'{effect} {kind}' if effect == 'joint_coupling' else effect]


def shape_and_coefficients(
    effect: str, kind: str, numbers: Numbers
) -> tuple[np.ndarray, np.ndarray]:
    """Return what `Effect.columns` takes and what its columns are multiplied with.

    Args:
        effect: name in `EFFECTS`.
        kind: where there are kinds.
        numbers: by the names of `stated_quantities`.

    Returns:
        shape (s,) and coefficients (m,); a NaN where the numbers do not say it.
    """
    shape, coefficients = inverse(effect, kind)(numbers)
    return np.array(shape, dtype=np.float64), np.array(coefficients, dtype=np.float64)


def coefficient_std(effect: str, kind: str, numbers: Numbers, std: Numbers) -> np.ndarray:
    """Return the standard deviations of the coefficients from those of the numbers, (m,).

    Errors of the numbers count as independent, to first order:
    `var c_i = sum_k (dc_i / dx_k)^2 var x_k`. Infinite where one that matters is not known, or
    none does.
    """
    if effect in _SIZE:  # its coefficient scales the whole
        size = _SIZE[effect]
        return np.array([std.get(size, math.inf) / max(abs(numbers[size]), 1e-300)])
    _, c = shape_and_coefficients(effect, kind, numbers)
    variance = np.zeros(len(c))
    for name, value in numbers.items():
        step = 1e-6 * max(abs(value), 1.0)
        ends = (
            shape_and_coefficients(effect, kind, {**numbers, name: value + sign * step})[1]
            for sign in (1.0, -1.0)
        )
        slope = np.subtract(*ends) / (2.0 * step)
        matters = slope != 0.0
        variance[matters] += (slope[matters] * std.get(name, math.inf)) ** 2
    return np.sqrt(np.where(variance > 0.0, variance, math.inf))


def place_of(
    effect: str, joint: str, words: Mapping[str, str], numbers: Numbers, tree: Tree
) -> Place:
    """Return the place of an effect.

    Args:
        effect: name in `EFFECTS`.
        joint: name of a joint that moves on its own, or one of `PLACES`.
        words: `kind`, `source_joint` and `side`, where there are such.
        numbers: the stated ones.
        tree: the robot.

    Raises:
        ValueError: a joint that does not move on its own.
    """
    names = tree.moving_names
    at = PLACES[joint] if joint in PLACES else names.index(joint)
    source = names.index(words['source_joint']) if 'source_joint' in words else -1
    side = 0
    if effect in SIDED:
        edge = numbers['onset' if effect == 'limit_friction' else 'position']
        side = SIDES[words['side']] if 'side' in words else _side(tree, at, edge)
    return Place(at, words.get('kind', ''), source, side)


def stated_words(effect: str, place: Place, tree: Tree) -> dict[str, str]:
    """Return the words that `place_of` takes beside the joint, also the side."""
    words = {'kind': place.kind} if place.kind else {}
    if place.source >= 0:
        words['source_joint'] = tree.joint_names[place.source]
    if effect in SIDED:
        words['side'] = 'upper' if place.side > 0 else 'lower'
    return words


def _side(tree: Tree, joint: int, edge: float) -> int:
    """Return the nearer end of the range; without limits, which side of zero."""
    lower, upper = float(tree.lower[joint]), float(tree.upper[joint])
    if not (math.isfinite(lower) and math.isfinite(upper)):
        return 1 if edge > 0.0 else -1
    return 1 if upper - edge < edge - lower else -1


def _plain(*names: str) -> Callable[[Numbers], tuple[list[float], list[float]]]:
    return lambda x: ([], [x[name] for name in names])


def _shaped(*names: str) -> Callable[[Numbers], tuple[list[float], list[float]]]:
    return lambda x: ([x[name] for name in names], [1.0])


def _wave(x: Numbers) -> tuple[list[float], list[float]]:
    """`A sin(z + phase) = A cos(phase) sin z + A sin(phase) cos z`."""
    amplitude, phase = x['amplitude'], x['phase']
    return [x['periods']], [amplitude * math.cos(phase), amplitude * math.sin(phase)]


_INVERSE: dict[str, Callable[[Numbers], tuple[list[float], list[float]]]] = {
    'viscous_friction': _plain('b'),
    'coulomb_friction': _plain('level'),
    'stribeck_friction': lambda x: (
        [x['stribeck_velocity']], [x['coulomb'], x['static'] - x['coulomb']]
    ),
    'quadratic_drag': _plain('c'),
    'position_friction': lambda x: ([x['lo'], x['hi']], [x['amplitude']]),
    'limit_friction': lambda x: ([x['onset']], [x['amplitude']]),
    'asymmetric_coulomb': _plain('level_pos', 'level_neg'),
    'load_friction': _plain('level', 'mu'),
    'friction_drift': lambda x: ([x['time_constant']], [x['end'], x['start']]),
    'spring': lambda x: ([], [x['stiffness'], x['stiffness'] * x['rest']]),
    'gravity_tilt': _shaped('roll', 'pitch'),
    'cogging': _wave,
    'armature': _plain('inertia'),
    'joint_coupling torque': _plain('coefficient'),
    'joint_coupling spring': lambda x: ([x['ratio']], [x['stiffness']]),
    'constant_load': _plain('force'),
    'tip_force': _plain('fx', 'fy', 'fz'),
    'payload': _shaped('mass', 'x', 'y', 'z'),
    'end_stop': lambda x: ([x['position']], [x['stiffness'], x['damping']]),
    'torque_gain': lambda x: ([], [x['gain'] - 1.0]),
    'dead_zone': _shaped('width'),
    'saturation': _shaped('limit'),
    'actuator_lag': _shaped('time_constant'),
    'command_delay': _shaped('delay'),
    # the motor's share of the inertia changes with the pose: its inertia alone does not say it
    'backlash': lambda x: ([math.nan, x['gap']], [1.0]),
    'hysteresis': lambda x: ([x['presliding']], [x['level']]),
    'encoder_eccentricity': lambda x: ([x['periods'], *_wave(x)[1]], [1.0]),
}  # fmt: skip

_COEFFICIENTS = {
    'stribeck_friction': (Quantity('coulomb', 'N m'), Quantity('stribeck', 'N m')),
    'spring': (Quantity('stiffness', 'N m/rad'), Quantity('preload', 'N m')),
    'cogging': (Quantity('sine', 'N m'), Quantity('cosine', 'N m')),
    'encoder_eccentricity': (Quantity('scale', '1'),),
}
"""Of effects whose coefficients are no stated numbers."""
_SIZE = {'encoder_eccentricity': 'amplitude'}
"""Of effects whose shape says all, but which are linear in one number: that number."""
_LINEAR = {
    'position_friction': ('amplitude',), 'limit_friction': ('amplitude',),
    'friction_drift': ('end', 'start'), 'hysteresis': ('level',),
    'end_stop': ('stiffness', 'damping'), 'joint_coupling': ('coefficient', 'stiffness'),
}  # fmt: skip
"""Stated numbers that are coefficients, of effects that state a shape too."""
