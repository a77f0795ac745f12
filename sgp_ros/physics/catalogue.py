"""The catalogue of effects: all laws that a robot may have beside its rigid bodies.

What stands here is found by a diagnosis, stated in a robot YAML, named in the report, drawn for
the worlds of `sgp_proof.concealed` and documented in docs/effects.md. A new law is one class in
this folder, one line here, and one law in `simulation`. Laws that a formula states are effects
too (`law`), but stand in no list.
"""

from __future__ import annotations

from sgp_ros.physics import (
    actuation,
    carried,
    confined,
    coupled,
    elasticity,
    friction,
    friction_drift,
    loads,
    memory,
    mount,
    sensing,
)
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.law import NAME as LAW
from sgp_ros.physics.law import law_variable

VISCOUS_FRICTION = friction.ViscousFriction()
COULOMB_FRICTION = friction.CoulombFriction()
STRIBECK_FRICTION = friction.StribeckFriction()
QUADRATIC_DRAG = friction.QuadraticDrag()
ASYMMETRIC_COULOMB = friction.AsymmetricCoulomb()
POSITION_FRICTION = confined.PositionFriction()
LIMIT_FRICTION = confined.LimitFriction()
END_STOP = confined.EndStop()
SPRING = loads.Spring()
CONSTANT_LOAD = loads.ConstantLoad()
COGGING = loads.Cogging()
ARMATURE = loads.Armature()
GRAVITY_TILT = carried.GravityTilt()
PAYLOAD = carried.Payload()
TORQUE_GAIN = actuation.TorqueGain()
ACTUATOR_LAG = actuation.ActuatorLag()
COMMAND_DELAY = actuation.CommandDelay()
HYSTERESIS = memory.Hysteresis()
BACKLASH = memory.Backlash()
JOINT_COUPLING = coupled.JointCoupling()
VELOCITY_FILTER_LAG = sensing.VelocityFilterLag()
ENCODER_OFFSET = sensing.EncoderOffset()
"""It may differ between recordings; for all of them it is an error of the connection."""

EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        VISCOUS_FRICTION,
        COULOMB_FRICTION,
        STRIBECK_FRICTION,
        QUADRATIC_DRAG,
        POSITION_FRICTION,
        LIMIT_FRICTION,
        ASYMMETRIC_COULOMB,
        friction.LoadFriction(),
        friction_drift.FrictionDrift(),
        SPRING,
        GRAVITY_TILT,
        COGGING,
        ARMATURE,
        JOINT_COUPLING,
        CONSTANT_LOAD,
        carried.TipForce(),
        PAYLOAD,
        END_STOP,
        TORQUE_GAIN,
        actuation.DeadZone(),
        actuation.Saturation(),
        ACTUATOR_LAG,
        COMMAND_DELAY,
        BACKLASH,
        HYSTERESIS,
        sensing.EncoderEccentricity(),
        VELOCITY_FILTER_LAG,
        coupled.CoupledFriction(),
        actuation.MotorSpeedLimit(),
        elasticity.JointElasticity(),
        mount.MountElasticity(),
    )
}


def exerts_force(name: str) -> bool:
    """Return whether an effect of this name is known and exerts a force."""
    return name == LAW or (name in EFFECTS and EFFECTS[name].is_force)


def drawn_over(name: str, formula: str) -> str:
    """Return the variable over which the force of a known effect is drawn, see `Effect`."""
    return law_variable(formula) if name == LAW else EFFECTS[name].drawn_over


def words_of(name: str) -> str:
    """Return the plain name of an effect, one word of a law, of what is not known its name."""
    if name == LAW:
        return 'a force law'
    return EFFECTS[name].words if name in EFFECTS else name.replace('_', ' ')


def listed(law: Effect) -> dict[str, object]:
    """Return what a list says of an effect, as JSON can hold it."""
    return {
        'effect': law.name, 'words': law.words, 'formula': law.formula, 'source': law.source,
        'place': law.site.value, 'kinds': list(law.kinds), 'is_online': law.is_online,
        'drawn_over': law.drawn_over,
        'parameters': {q.name: q.unit for q in law.quantities},
    }  # fmt: skip
