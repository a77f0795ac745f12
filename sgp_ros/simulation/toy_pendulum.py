"""The toy pendulum of Wu and Movellan (sections I.A and IV.A): it swings freely, 0 is upright.

Its one irregularity is dry friction where the angle is in [2, 2.5] rad.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sgp_ros.physics.catalogue import POSITION_FRICTION
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import Value
from sgp_ros.simulation.controllers import ControllerChoice, zero
from sgp_ros.simulation.mechanism import SimulatedJoint, TrueCoefficient, quantity
from sgp_ros.simulation.sensors import Sensors, encoder_resolution
from sgp_ros.simulation.simulator import Simulator


@dataclass(frozen=True, slots=True)
class ToyPendulum:
    """A point mass on a massless rod: `m l^2 a = m g l sin(theta) - friction(theta)`."""

    mass: float = quantity(1.0, 'kg', 'point mass', is_positive=True)
    length: float = quantity(1.0, 'm', 'pivot to mass', is_positive=True)
    gravity: float = quantity(9.81, 'm/s^2', 'acceleration of gravity')
    friction_amplitude: float = quantity(6.0, 'N m', 'dry friction inside the interval')
    friction_lo: float = quantity(2.0, 'rad', 'start of the interval')
    friction_hi: float = quantity(2.5, 'rad', 'end of the interval')

    def dynamics(
        self,
        position: np.ndarray,
        velocity: np.ndarray,  # noqa: ARG002 - no viscosity
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return 1 / (m l^2), (1, 1) [1/(kg m^2)], and the torque of gravity, (1,) [N m]."""
        torque = self.mass * self.gravity * self.length * math.sin(position[0])
        return np.array([[1.0 / (self.mass * self.length**2)]]), np.array([torque])

    @property
    def hidden(self) -> tuple[float, ...]:
        """Nothing moves that no encoder shows."""
        return ()

    def drive(self, command: np.ndarray, velocity: np.ndarray) -> np.ndarray:  # noqa: ARG002 - no motor
        """Return no torque, (1,) [N m]."""
        return np.zeros(1)

    def built_in(self) -> tuple[EffectAt, ...]:
        """Return the friction irregularity, unless its amplitude is 0."""
        if self.friction_amplitude == 0.0:
            return ()
        values: dict[str, Value] = {
            'amplitude': self.friction_amplitude,
            'lo': self.friction_lo,
            'hi': self.friction_hi,
            'kind': 'coulomb',
        }
        return (EffectAt.wanted(POSITION_FRICTION, 'hinge', values),)

    def coefficients(self) -> tuple[TrueCoefficient, ...]:
        """Return w of `a = w sin(theta)`."""
        return (TrueCoefficient('w', self.gravity / self.length, 'rad/s^2'),)


TOY_PENDULUM = Simulator(
    name='toy_pendulum',
    joints=(SimulatedJoint('hinge', is_continuous=True),),
    command_joints=(),
    command_unit='N m',
    mechanism=ToyPendulum(),
    controllers={'zero': ControllerChoice(zero(0), (math.pi,), (10.0,))},
    sensors=Sensors(resolution=(encoder_resolution(14),)),
    torque_noise=(0.01,),
    description='Toy pendulum of Wu and Movellan, section I.A: turns over, then swings freely',
)
