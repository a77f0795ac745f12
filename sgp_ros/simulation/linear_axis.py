"""A driven linear axis: `M a = F - Fv v - Fc sign(v) - offset`, F being the command.

The numbers are near those of a ball-screw positioning system (Janot, Gautier, Brunot 2019, EMPS).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.physics.catalogue import COULOMB_FRICTION
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.simulation.controllers import (
    ControllerChoice,
    external,
    pd_reference,
    sinusoids,
    zero,
)
from sgp_ros.simulation.mechanism import SimulatedJoint, TrueCoefficient, quantity
from sgp_ros.simulation.sensors import Sensors
from sgp_ros.simulation.simulator import Simulator


@dataclass(frozen=True, slots=True)
class LinearAxis:
    """Physical parameters and equation of motion of the carriage; the command is a force."""

    mass: float = quantity(95.11, 'kg', 'M, with the inertia of the motor', is_positive=True)
    viscosity: float = quantity(203.5, 'N s/m', 'Fv')
    coulomb: float = quantity(20.39, 'N', 'Fc')
    offset: float = quantity(-3.165, 'N', 'force that the motor needs in addition')

    def dynamics(
        self,
        position: np.ndarray,  # noqa: ARG002 - constant here
        velocity: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return 1 / M, (1, 1) [1/kg], and viscous friction with offset, (1,) [N]."""
        force = np.array([-self.viscosity * velocity[0] - self.offset])
        return np.array([[1.0 / self.mass]]), force

    @property
    def hidden(self) -> tuple[float, ...]:
        """Nothing moves that no encoder shows."""
        return ()

    def drive(self, command: np.ndarray, velocity: np.ndarray) -> np.ndarray:  # noqa: ARG002 - a force source
        """Return the force `command` (1,) itself, (1,) [N]."""
        return command

    def built_in(self) -> tuple[EffectAt, ...]:
        """Return the dry friction of the carriage, unless it is 0."""
        if self.coulomb == 0.0:
            return ()
        return (EffectAt.wanted(COULOMB_FRICTION, 'axis', {'level': self.coulomb}),)

    def coefficients(self) -> tuple[TrueCoefficient, ...]:
        """Return M, Fv, Fc and offset of `F = M a + Fv v + Fc sign(v) + offset`."""
        return (
            TrueCoefficient('M', self.mass, 'kg'),
            TrueCoefficient('Fv', self.viscosity, 'N s/m'),
            TrueCoefficient('Fc', self.coulomb, 'N'),
            TrueCoefficient('offset', self.offset, 'N'),
        )


_AT_REST = ((0.0,), (0.0,))

LINEAR_AXIS = Simulator(
    name='linear_axis',
    joints=(SimulatedJoint('axis', is_prismatic=True),),
    command_joints=('axis',),
    command_unit='N',
    mechanism=LinearAxis(),
    controllers={
        'pd_reference': ControllerChoice(pd_reference, *_AT_REST),
        'sinusoids': ControllerChoice(sinusoids((60.0,)), *_AT_REST),
        'zero': ControllerChoice(zero(1), *_AT_REST),
        'external': ControllerChoice(external, *_AT_REST),
    },
    sensors=Sensors(resolution=(1e-6,)),
    torque_noise=(0.1,),
    rate_hz=200.0,
    same_physics={
        ('viscous_friction', 'axis'): ('b', 'viscosity'),
        ('coulomb_friction', 'axis'): ('level', 'coulomb'),
    },
    description='Linear axis with dry friction, near the EMPS benchmark',
)
