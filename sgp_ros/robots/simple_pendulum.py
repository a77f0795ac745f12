"""A driven pendulum: `effort = J a + G sin(q) + Fv v + Fc sign(v) + offset` (inverse model)."""

from __future__ import annotations

from sgp_ros.physics.term import Coefficient, Joint
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.terms import acceleration, constant, direction, sine, single_column, velocity

_SOURCE = 'Wiebe et al. 2022, torque-limited simple pendulum (doi:10.21105/joss.03884)'

SIMPLE_PENDULUM = Robot(
    name='simple_pendulum',
    joints=(Joint('pendulum'),),
    target='effort',
    terms=(
        single_column(Coefficient('J', 'kg m^2', 'pendulum'), 0, acceleration(0), _SOURCE),
        single_column(Coefficient('G', 'N m', 'pendulum'), 0, sine(0), _SOURCE),
        single_column(Coefficient('Fv', 'N m s/rad', 'pendulum'), 0, velocity(0), _SOURCE),
        single_column(Coefficient('Fc', 'N m', 'pendulum'), 0, direction(0), _SOURCE),
        single_column(Coefficient('offset', 'N m', 'pendulum'), 0, constant, _SOURCE),
    ),
    residual_inputs=(('position:pendulum', 'velocity:pendulum'),),
    description='Pendulum hanging at zero with viscous and Coulomb friction and an offset',
)
