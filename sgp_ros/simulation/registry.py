"""The simulated robots and the kinds of effects, by name."""

from __future__ import annotations

from sgp_ros.simulation import actuation, friction, loads, measurement, varying_friction
from sgp_ros.simulation.effects import EffectKind
from sgp_ros.simulation.linear_axis import LINEAR_AXIS
from sgp_ros.simulation.reaction_wheel import REACTION_WHEEL
from sgp_ros.simulation.simulator import Simulator
from sgp_ros.simulation.toy_pendulum import TOY_PENDULUM

SIMULATORS: dict[str, Simulator] = {
    simulator.name: simulator for simulator in (REACTION_WHEEL, TOY_PENDULUM, LINEAR_AXIS)
}

EFFECTS: dict[str, EffectKind] = {
    kind.name: kind
    for kind in (
        friction.VISCOUS_FRICTION,
        friction.COULOMB_FRICTION,
        friction.STRIBECK_FRICTION,
        friction.QUADRATIC_DRAG,
        friction.ASYMMETRIC_COULOMB,
        friction.LOAD_FRICTION,
        varying_friction.POSITION_FRICTION,
        varying_friction.LIMIT_FRICTION,
        varying_friction.FRICTION_DRIFT,
        varying_friction.HYSTERESIS,
        loads.SPRING,
        loads.CONSTANT_LOAD,
        loads.COGGING,
        loads.END_STOP,
        loads.JOINT_COUPLING,
        loads.ARMATURE,
        loads.GRAVITY_TILT,
        loads.PAYLOAD,
        loads.TIP_FORCE,
        actuation.COMMAND_DELAY,
        actuation.DEAD_ZONE,
        actuation.ACTUATOR_LAG,
        actuation.SATURATION,
        actuation.TORQUE_GAIN,
        actuation.BACKLASH,
        measurement.ENCODER_ECCENTRICITY,
        measurement.VELOCITY_FILTER_LAG,
    )
}
"""Several effects in a motor act in this order, from the command to the joint."""
