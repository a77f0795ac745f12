"""All effects that a diagnosis can name, except that of the velocity sensor."""

from __future__ import annotations

from sgp_ros.physics import actuation, friction, loads, memory
from sgp_ros.physics.effect import Effect

EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        friction.VISCOUS_FRICTION,
        friction.COULOMB_FRICTION,
        friction.STRIBECK_FRICTION,
        friction.QUADRATIC_DRAG,
        friction.POSITION_FRICTION,
        friction.LIMIT_FRICTION,
        friction.ASYMMETRIC_COULOMB,
        friction.LOAD_FRICTION,
        friction.FRICTION_DRIFT,
        loads.SPRING,
        loads.GRAVITY_TILT,
        loads.COGGING,
        loads.ARMATURE,
        loads.JOINT_COUPLING,
        loads.CONSTANT_LOAD,
        loads.TIP_FORCE,
        loads.PAYLOAD,
        loads.END_STOP,
        actuation.TORQUE_GAIN,
        actuation.DEAD_ZONE,
        actuation.SATURATION,
        actuation.ACTUATOR_LAG,
        actuation.COMMAND_DELAY,
        memory.BACKLASH,
        memory.HYSTERESIS,
        memory.ENCODER_ECCENTRICITY,
    )
}
