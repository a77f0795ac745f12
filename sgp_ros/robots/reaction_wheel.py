"""The reaction wheel: an unactuated pole with a motor-driven wheel at its end.

Forward model of equations (27) and (28) of Wu and Movellan. The pole angle is zero upright. The
command is the motor voltage. With all ten coefficients the model holds viscous friction and the
back-EMF of the motor; with six it holds none.
"""

from __future__ import annotations

from sgp_ros.physics.term import Coefficient, Joint, Term
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.terms import Signal, effort, position, sine, single_column, velocity

_POLE, _WHEEL = 0, 1
_JOINTS = (Joint('pole', is_actuated=False), Joint('wheel', effort_unit='V'))
_SIGNALS: tuple[tuple[Signal, str], ...] = (
    (sine(_POLE), 'rad/s^2'),
    (position(_WHEEL), '1/s^2'),
    (velocity(_POLE), '1/s'),
    (velocity(_WHEEL), '1/s'),
)
_INPUT = (effort(_WHEEL), 'rad/s^2/V')
_Z_INPUTS = ('velocity:pole', 'velocity:wheel')
"""What evidence chooses for the six-coefficient model (docs/reproduction.md)."""


def _term(number: int, axis: int, signal: tuple[Signal, str], equation: str) -> Term:
    coefficient = Coefficient(f'w{number}', signal[1], _JOINTS[axis].name)
    return single_column(coefficient, axis, signal[0], f'Wu and Movellan, equation ({equation})')


REACTION_WHEEL = Robot(
    name='reaction_wheel',
    joints=_JOINTS,
    target='acceleration',
    terms=tuple(
        [_term(1 + i, _POLE, signal, '27') for i, signal in enumerate(_SIGNALS)]
        + [_term(5 + i, _WHEEL, signal, '27') for i, signal in enumerate(_SIGNALS)]
        + [_term(9, _POLE, _INPUT, '27'), _term(10, _WHEEL, _INPUT, '27')]
    ),
    residual_inputs=(_Z_INPUTS, _Z_INPUTS),
    description='Reaction wheel with ten coefficients, Wu and Movellan, equation (27)',
)

REACTION_WHEEL_6 = Robot(
    name='reaction_wheel_6',
    joints=_JOINTS,
    target='acceleration',
    terms=tuple(
        [_term(1 + i, _POLE, _SIGNALS[i], '28') for i in range(2)]
        + [_term(9, _POLE, _INPUT, '28')]
        + [_term(5 + i, _WHEEL, _SIGNALS[i], '28') for i in range(2)]
        + [_term(10, _WHEEL, _INPUT, '28')]
    ),
    residual_inputs=(_Z_INPUTS, _Z_INPUTS),
    description='Reaction wheel without viscous friction, Wu and Movellan, equation (28)',
)
