"""The toy pendulum of Wu and Movellan, section I.A: acceleration `w sin(theta)`, no motor."""

from __future__ import annotations

from sgp_ros.physics.term import Coefficient, Joint
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.terms import sine, single_column

TOY_PENDULUM = Robot(
    name='toy_pendulum',
    joints=(Joint('hinge', is_actuated=False),),
    target='acceleration',
    terms=(
        single_column(
            Coefficient('w', 'rad/s^2', 'hinge'), 0, sine(0), 'Wu and Movellan, section I.A'
        ),
    ),
    residual_inputs=(('position:hinge',),),
    description='Pendulum without friction, Wu and Movellan, section I.A',
)
