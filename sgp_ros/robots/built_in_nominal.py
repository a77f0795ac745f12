"""Nominal bodies of the built-in robots: URDFs that have their coefficients.

A built-in robot is a few lumped coefficients. The bodies here are the simplest that have them: a
link that swings is a uniform rod, or has its mass at the tip. What the coefficients do not
determine is chosen so, and changes no motion; mass and centre of a link are then no measurement.

Numbers that a robot YAML states under `parameters` are taken; the others are those of the
simulated robot of the same name. The two driven pendulums have none of their own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from sgp_ros.errors import ConfigError
from sgp_ros.rigid.chain_urdf import ChainBody, chain_urdf
from sgp_ros.robots.robot import Robot

Values = Mapping[str, float]
Entry = dict[str, object]

GRAVITY = 9.81
"""Acceleration of gravity [m/s^2]."""
VOLT = 0.03
"""Torque of the reaction wheel's motor per voltage, `k_t / R` [N m/V]. A forward model in volts
does not say how large torques are: this is the simulated motor, and what is said in N m scales
with it."""
_POLE_MASS, _WHEEL_MASS, _LENGTH, _WHEEL_INERTIA = 0.2, 0.25, 0.25, 1e-3
_POLE_VISCOSITY, _WHEEL_DAMPING = 4e-3, 2e-4 + 0.06 * VOLT
"""Bearing of the pole; bearing of the wheel and back-EMF of the motor [N m s/rad]."""


def _wheel_coefficients(pole_viscosity: float, wheel_damping: float) -> Values:
    pole = 1.0 / ((_POLE_MASS / 3.0 + _WHEEL_MASS) * _LENGTH**2)
    wheel = pole + 1.0 / _WHEEL_INERTIA
    w1 = (0.5 * _POLE_MASS + _WHEEL_MASS) * _LENGTH * GRAVITY * pole
    return {
        'w1': w1, 'w2': 0.0, 'w3': -pole_viscosity * pole, 'w4': wheel_damping * pole,
        'w5': -w1, 'w6': 0.0, 'w7': pole_viscosity * pole, 'w8': -wheel_damping * wheel,
        'w9': -VOLT * pole, 'w10': VOLT * wheel,
    }  # fmt: skip


_WITHOUT_FRICTION = _wheel_coefficients(0.0, 0.0)
NOMINAL: Mapping[str, Values] = {
    'reaction_wheel': _wheel_coefficients(_POLE_VISCOSITY, _WHEEL_DAMPING),
    'reaction_wheel_6': {
        name: _WITHOUT_FRICTION[name] for name in ('w1', 'w2', 'w9', 'w5', 'w6', 'w10')
    },
    'toy_pendulum': {'w': 9.81},
    'linear_axis': {'M': 95.11, 'Fv': 203.5, 'Fc': 20.39, 'offset': -3.165},
    'simple_pendulum': {},
    'double_pendulum': {},
}
"""Coefficients of the simulated robot, by robot and name."""


@dataclass(frozen=True, slots=True)
class _Model:
    """Bodies from the base on, effects beside them, and torque per unit of the command."""

    bodies: tuple[ChainBody, ...]
    effects: tuple[Entry, ...] = ()
    effort_gain: Mapping[str, float] = field(default_factory=dict)


def built_in_document(robot: Robot) -> dict[str, object]:
    """Return the entries of a robot YAML with URDF that describe a built-in robot.

    Raises:
        ConfigError: a coefficient without a value, or values that no bodies have.
    """
    values = _values(robot)
    try:
        model = _MODELS[robot.name](values, robot.joint_names)
    except ZeroDivisionError:
        model = _Model(())
    if not model.bodies or not all(body.can_exist for body in model.bodies):
        listed = ', '.join(f'{name} = {value:g}' for name, value in values.items())
        raise ConfigError(
            f'robot {robot.name} with {listed}', 'bodies with positive inertia',
            'correct the parameters of its robot YAML',
        )  # fmt: skip
    document: dict[str, object] = {
        'name': robot.name,
        'urdf': chain_urdf(robot.name, robot.joints, model.bodies),
    }
    if not any(joint.is_actuated for joint in robot.joints):
        document['passive'] = list(robot.joint_names)
    if model.effort_gain:
        document['effort_gain'] = dict(model.effort_gain)
    if model.effects:
        document['effects'] = list(model.effects)
    return document


def _values(robot: Robot) -> dict[str, float]:
    known = NOMINAL[robot.name]
    values = {}
    for c in robot.coefficients:
        is_stated = c.prior_mean != 0.0 or math.isfinite(c.prior_std)
        if is_stated or c.name in known:
            values[c.name] = c.prior_mean if is_stated else known[c.name]
    missing = [c.name for c in robot.coefficients if c.name not in values]
    if missing:
        raise ConfigError(
            f'robot {robot.name} has no nominal values of {", ".join(missing)}',
            'a robot YAML that states them under `parameters`',
            'sgp identify writes one: robot_identified.yaml',
        )
    return values


def _reaction_wheel(w: Values, joints: Sequence[str]) -> _Model:
    """Equation (27): zero is upright, the wheel's angle relative to the pole.

    With `J = J_p J_w / (J_p + J_w)`: `w9 = -gain / J_p`, `w10 = gain / J`, `w1 = G / J_p`,
    `w3 = -b_p / J_p`, `w8 = -d / J`. The masses of pole and wheel are as those of the simulation.
    """
    pole = -VOLT / w['w9']
    both = VOLT / w['w10']
    wheel = 1.0 / (1.0 / both - 1.0 / pole)
    share = _POLE_MASS / _WHEEL_MASS
    length = GRAVITY / w['w1'] * (share / 2.0 + 1.0) / (share / 3.0 + 1.0)
    mass = pole / (share / 3.0 + 1.0) / length**2
    rod = share * mass
    return _Model(
        (
            ChainBody(rod, 0.5 * length, rod * length**2 / 12.0, -w.get('w3', 0.0) * pole),
            ChainBody(mass, 0.0, wheel, -w.get('w8', 0.0) * both, place=length),
        ),
        effort_gain={joints[1]: VOLT},
    )


def _toy_pendulum(values: Values, _joints: Sequence[str]) -> _Model:
    """A point mass of 1 kg above the axis, at the length that has `w = g / l`."""
    return _Model((ChainBody(1.0, GRAVITY / values['w'], 0.0, 0.0),))


def _linear_axis(values: Values, joints: Sequence[str]) -> _Model:
    """A carriage; its dry friction and offset are effects."""
    body = ChainBody(values['M'], 0.0, values['M'] * 1e-4, values['Fv'], slides=True)
    return _Model((body,), _dry(joints[0], values['Fc'], values['offset'], 'N'))


def _simple_pendulum(values: Values, joints: Sequence[str]) -> _Model:
    """A uniform rod that hangs at zero."""
    body = _hanging(values['J'], values['G'] / GRAVITY, values['Fv'])
    return _Model((body,), _dry(joints[0], values['Fc'], values['offset'], 'N m'))


def _double_pendulum(values: Values, joints: Sequence[str]) -> _Model:
    """Two uniform rods that hang at zero; what J2 has beyond J12 is the elbow's rotor."""
    lower = _hanging(values['J12'], values['G2'] / GRAVITY, values['Fv2'])
    length = values['H'] * GRAVITY / values['G2']
    carried = lower.mass * length
    upper = _hanging(
        values['J1'] - values['J12'] - carried * length,
        values['G1'] / GRAVITY - carried,
        values['Fv1'],
    )
    rotor = values['J2'] - values['J12']
    effects = (
        *_dry(joints[0], values['Fc1'], values['offset1'], 'N m'),
        *_dry(joints[1], values['Fc2'], values['offset2'], 'N m'),
        *_effect('armature', joints[1], inertia=(rotor, 'kg m2')),
    )
    return _Model((upper, replace(lower, place=-length)), effects)


def _hanging(inertia: float, moment: float, damping: float) -> ChainBody:
    """Return a uniform rod of an inertia about its end and a first moment [kg m], below it."""
    if moment == 0.0:
        return ChainBody(1.0, 0.0, inertia, damping)
    mass = 4.0 * moment**2 / (3.0 * inertia)
    return ChainBody(mass, -moment / mass, inertia / 4.0, damping)


def _dry(joint: str, level: float, offset: float, unit: str) -> tuple[Entry, ...]:
    return (
        *_effect('coulomb_friction', joint, level=(level, unit)),
        *_effect('constant_load', joint, force=(-offset, unit)),
    )


def _effect(effect: str, joint: str, **parameters: tuple[float, str]) -> tuple[Entry, ...]:
    """Return the entry of an effect; none where its parameters are zero."""
    if not any(value for value, _ in parameters.values()):
        return ()
    stated = {name: {'value': value, 'unit': unit} for name, (value, unit) in parameters.items()}
    return ({'effect': effect, 'joint': joint, 'parameters': stated},)


_MODELS: Mapping[str, Callable[[Values, Sequence[str]], _Model]] = {
    'reaction_wheel': _reaction_wheel,
    'reaction_wheel_6': _reaction_wheel,
    'toy_pendulum': _toy_pendulum,
    'linear_axis': _linear_axis,
    'simple_pendulum': _simple_pendulum,
    'double_pendulum': _double_pendulum,
}
