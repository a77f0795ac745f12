"""The simulated robots with dynamics of their own, and the law of each effect, by name.

A law is one entry here. Names, parameters, units, kinds and places are those of the catalogue in
`physics`; the laws share no code with its columns, so that a truth is not checked with itself.
"""

from __future__ import annotations

from sgp_ros.simulation import actuation, friction, loads
from sgp_ros.simulation.effects import EffectParameter, Law
from sgp_ros.simulation.linear_axis import LINEAR_AXIS
from sgp_ros.simulation.reaction_wheel import REACTION_WHEEL
from sgp_ros.simulation.simulator import Simulator
from sgp_ros.simulation.toy_pendulum import TOY_PENDULUM
from sgp_ros.simulation.tree import mounted

SIMULATORS: dict[str, Simulator] = {
    simulator.name: simulator for simulator in (REACTION_WHEEL, TOY_PENDULUM, LINEAR_AXIS)
}

_EDGE = EffectParameter('edge', 'rad', low=0.0, default=0.0)
_CONTACT_HZ = EffectParameter('contact_hz', 'Hz', low=1.0, default=60.0)
_MOTOR_FRICTION = EffectParameter('motor_friction', '1', kinds=('motor',), default=0.0)
_OF_MOTOR = tuple(
    EffectParameter(name, unit, default=0.0)
    for name, unit in (('motor_coulomb', 'N m'), ('motor_viscous', 'N m s/rad'))
)

# simulated friction is all on the link, whatever part of it a diagnosis gave the motor
LAWS: dict[str, Law] = {
    'viscous_friction': Law(friction.viscous),
    'coulomb_friction': Law(friction.coulomb),
    'stribeck_friction': Law(friction.stribeck, ordered=('coulomb', 'static')),
    'quadratic_drag': Law(friction.quadratic),
    'asymmetric_coulomb': Law(friction.asymmetric),
    'load_friction': Law(friction.load),
    'position_friction': Law(friction.position, ordered=('lo', 'hi'), own=(_EDGE,)),
    'limit_friction': Law(friction.limit),
    'friction_drift': Law(friction.drift),
    'hysteresis': Law(friction.hysteresis),
    'spring': Law(loads.spring),
    'constant_load': Law(loads.constant),
    'cogging': Law(loads.cogging),
    'end_stop': Law(loads.end_stop),
    'joint_coupling': Law(loads.coupling),
    'armature': Law(loads.armature),
    'gravity_tilt': Law(physical={'roll': 'base_roll', 'pitch': 'base_pitch'}),
    'payload': Law(
        physical={'mass': 'payload_mass', 'x': 'payload_x', 'y': 'payload_y', 'z': 'payload_z'}
    ),
    'tip_force': Law(physical={'fx': 'tip_fx', 'fy': 'tip_fy', 'fz': 'tip_fz'}),
    'command_delay': Law(actuation.delay),
    'dead_zone': Law(actuation.dead_zone),
    'actuator_lag': Law(actuation.lag),
    'saturation': Law(actuation.saturation),
    'torque_gain': Law(actuation.gain),
    'backlash': Law(actuation.backlash, own=(_CONTACT_HZ, *_OF_MOTOR)),
    'encoder_eccentricity': Law(actuation.eccentricity),
    'velocity_filter_lag': Law(actuation.velocity_lag),
    'coupled_friction': Law(friction.coupled),
    'motor_speed_limit': Law(actuation.speed_limit),
    'joint_elasticity': Law(actuation.elasticity, own=(_MOTOR_FRICTION,)),
    'mount_elasticity': Law(changed=mounted),
}
"""Several effects in a motor act in this order, from the command to the joint."""
