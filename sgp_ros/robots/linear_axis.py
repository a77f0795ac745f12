"""A driven linear axis: `effort = M a + Fv v + Fc sign(v) + offset` (inverse model)."""

from __future__ import annotations

from sgp_ros.physics.term import Coefficient, Joint
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.terms import acceleration, constant, direction, single_column, velocity

_SOURCE = 'Janot, Gautier, Brunot 2019, EMPS benchmark'

LINEAR_AXIS = Robot(
    name='linear_axis',
    joints=(Joint('axis', kind='prismatic'),),
    target='effort',
    terms=(
        single_column(Coefficient('M', 'kg', 'axis'), 0, acceleration(0), _SOURCE),
        single_column(Coefficient('Fv', 'N s/m', 'axis'), 0, velocity(0), _SOURCE),
        single_column(Coefficient('Fc', 'N', 'axis'), 0, direction(0), _SOURCE),
        single_column(Coefficient('offset', 'N', 'axis'), 0, constant, _SOURCE),
    ),
    residual_inputs=(('velocity:axis',),),
    description='Linear axis with viscous and Coulomb friction and a constant offset',
)
