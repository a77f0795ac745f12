"""The reaction wheel of Wu and Movellan (section IV.B), from physical parameters.

The pole angle p is absolute, 0 upright; the wheel angle w is relative to the pole, as the encoder
between them sees it. With kinetic energy `J_p p'^2 / 2 + J_w (p' + w')^2 / 2`, potential energy
`G cos p` and the motor torque between pole and wheel, Lagrange's equations are

    (J_p + J_w) p'' + J_w w'' = G sin p - b_p p'
    J_w p'' + J_w w''         = k_t (m - k_e w') / R - b_w w'

Solved for the accelerations they are equation (27), with `J = J_p J_w / (J_p + J_w)`:

    w1 = G / J_p      w3 = -b_p / J_p    w4 = (k_t k_e / R + b_w) / J_p    w9  = -k_t / (R J_p)
    w5 = -w1          w7 = -w3           w8 = -(k_t k_e / R + b_w) / J     w10 = k_t / (R J)

So w3 and w7 come from the viscosity of the pole bearing, w4 and w8 from back-EMF and wheel bearing
together. Nothing depends on the wheel angle: w2 = w6 = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from sgp_ros.errors import NumericalError
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.simulation.controllers import Controller, ControllerChoice, external, sinusoids, zero
from sgp_ros.simulation.mechanism import Mechanism, SimulatedJoint, TrueCoefficient, quantity
from sgp_ros.simulation.sensors import Sensors, encoder_resolution
from sgp_ros.simulation.simulator import Simulator

_STATE_COST = (100.0, 1.0, 1e-3)
_COMMAND_COST = 0.1


def discrete_regulator(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, period_s: float
) -> np.ndarray:
    """Return the gain K (m, n) of `command = -K x`, with the command held for `period_s`.

    The held system is exact (matrix exponential); K solves the discrete Riccati equation.

    Args:
        A: (n, n) of `dx/dt = A x + B command`.
        B: (n, m).
        Q: (n, n) cost of the state.
        R: (m, m) cost of the command.
        period_s: sampling period [s].

    Raises:
        NumericalError: no gain exists, or it is beyond the range of numbers.
    """
    n, m = B.shape
    joint = np.zeros((n + m, n + m))
    joint[:n] = np.hstack([A, B])
    try:
        held = linalg.expm(joint * period_s)
        Ad, Bd = held[:n, :n], held[:n, n:]
        S = linalg.solve_discrete_are(Ad, Bd, Q, R)
        gain: np.ndarray = np.linalg.solve(R + Bd.T @ S @ Bd, Bd.T @ S @ Ad)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise NumericalError(
            f'no regulator balances the robot ({error})', 'a robot that its command can balance',
            'choose more usual physical parameters, or another controller',
        ) from error  # fmt: skip
    return gain


def balance(mechanism: Mechanism, _rng: np.random.Generator, period_s: float) -> Controller | None:
    """Build the regulator of pole angle, pole velocity and wheel velocity about upright."""
    w = {c.name: c.value for c in mechanism.coefficients()}
    A = np.array([[0.0, 1.0, 0.0], [w['w1'], w['w3'], w['w4']], [w['w5'], w['w7'], w['w8']]])
    B = np.array([[0.0], [w['w9']], [w['w10']]])
    cost = np.diag(_STATE_COST), np.array([[_COMMAND_COST]])
    gain = discrete_regulator(A, B, *cost, period_s)
    return lambda _t, q, v: -gain @ np.array([q[0], v[0], v[1]])


_UNITS = ('rad/s^2', '1/s^2', '1/s', '1/s') * 2 + ('rad/s^2/V',) * 2


@dataclass(frozen=True, slots=True)
class ReactionWheel:
    """Physical parameters and equation of motion of pole and wheel; the command is a voltage."""

    pole_mass: float = quantity(0.2, 'kg', 'mass of the uniform pole', is_positive=True)
    pole_length: float = quantity(0.25, 'm', 'pivot to wheel axis', is_positive=True)
    wheel_mass: float = quantity(0.25, 'kg', 'mass of wheel and motor', is_positive=True)
    wheel_inertia: float = quantity(1e-3, 'kg m^2', 'J_w about its own axis', is_positive=True)
    torque_constant: float = quantity(0.06, 'N m/A', 'k_t of the motor', is_positive=True)
    back_emf_constant: float = quantity(0.06, 'V s/rad', 'k_e; 0 for a current-driven motor')
    resistance: float = quantity(2.0, 'ohm', 'R of the winding', is_positive=True)
    pole_viscosity: float = quantity(4e-3, 'N m s/rad', 'b_p of the pole bearing')
    wheel_viscosity: float = quantity(2e-4, 'N m s/rad', 'b_w of the wheel bearing')
    gravity: float = quantity(9.81, 'm/s^2', 'acceleration of gravity')

    @property
    def pole_inertia(self) -> float:
        """J_p: pole and mass of the wheel about the pivot [kg m^2]."""
        return (self.pole_mass / 3.0 + self.wheel_mass) * self.pole_length**2

    @property
    def gravity_torque(self) -> float:
        """G: torque of gravity with the pole horizontal [N m]."""
        return (self.pole_mass / 2.0 + self.wheel_mass) * self.pole_length * self.gravity

    def dynamics(
        self, position: np.ndarray, velocity: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return inverse mass matrix and forces of gravity and bearings.

        The first is the inverse of [[J_p + J_w, J_w], [J_w, J_w]], (2, 2) [1/(kg m^2)], the
        second (2,) [N m].
        """
        x = 1.0 / self.pole_inertia
        torque = self.gravity_torque * math.sin(position[0]) - self.pole_viscosity * velocity[0]
        inverse_mass = np.array([[x, -x], [-x, x + 1.0 / self.wheel_inertia]])
        return inverse_mass, np.array([torque, -self.wheel_viscosity * velocity[1]])

    @property
    def hidden(self) -> tuple[float, ...]:
        """Nothing moves that no encoder shows."""
        return ()

    def drive(self, command: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the motor torque under the voltage `command` (1,), (2,) [N m]."""
        voltage = command[0] - self.back_emf_constant * velocity[1]
        return np.array([0.0, self.torque_constant / self.resistance * voltage])

    def built_in(self) -> tuple[EffectAt, ...]:
        """Return no effects: all friction of the nominal robot is viscous."""
        return ()

    def coefficients(self) -> tuple[TrueCoefficient, ...]:
        """Return w1 to w10 of equation (27)."""
        pole = 1.0 / self.pole_inertia
        wheel = pole + 1.0 / self.wheel_inertia
        gain = self.torque_constant / self.resistance
        damping = gain * self.back_emf_constant + self.wheel_viscosity
        w1, w3 = self.gravity_torque * pole, -self.pole_viscosity * pole
        drift = (w1, 0.0, w3, damping * pole, -w1, 0.0, -w3, -damping * wheel)
        values = (*drift, -gain * pole, gain * wheel)
        return tuple(
            TrueCoefficient(f'w{number}', value, unit)
            for number, (value, unit) in enumerate(zip(values, _UNITS, strict=True), start=1)
        )


# The pole swings at 1.05 Hz, slower when it swings far; driven there it may turn over.
_RESONANCE_HZ = (0.8, 1.2)
_HANGING = ((math.pi, 0.0), (0.0, 0.0))
_UPRIGHT = ((0.05, 0.0), (0.0, 0.0))

REACTION_WHEEL = Simulator(
    name='reaction_wheel',
    joints=(
        SimulatedJoint('pole', is_continuous=True),
        SimulatedJoint('wheel', is_continuous=True),
    ),
    command_joints=('wheel',),
    command_unit='V',
    mechanism=ReactionWheel(),
    controllers={
        'sinusoids': ControllerChoice(sinusoids((6.0,), avoided_hz=_RESONANCE_HZ), *_HANGING),
        'balance': ControllerChoice(balance, *_UPRIGHT),
        'zero': ControllerChoice(zero(1), *_HANGING),
        'external': ControllerChoice(external, *_HANGING),
    },
    sensors=Sensors(resolution=(encoder_resolution(12),)),
    torque_noise=(1e-3, 1e-4),
    same_physics={
        ('viscous_friction', 'pole'): ('b', 'pole_viscosity'),
        ('viscous_friction', 'wheel'): ('b', 'wheel_viscosity'),
    },
    description='Reaction wheel of Wu and Movellan, section IV.B',
)
