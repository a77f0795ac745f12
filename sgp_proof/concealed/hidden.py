"""Effects concealed together in one machine: friction and rotors at every joint, a few extras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgp_proof.concealed.concealed_effect import Concealed
from sgp_proof.concealed.kinds import draw_effect
from sgp_proof.concealed.unknown import NAME
from sgp_ros.physics.catalogue import (
    ARMATURE,
    ASYMMETRIC_COULOMB,
    CONSTANT_LOAD,
    COULOMB_FRICTION,
    EFFECTS,
    PAYLOAD,
    SPRING,
    STRIBECK_FRICTION,
    VISCOUS_FRICTION,
)
from sgp_ros.physics.loads import Cogging


def draw_hidden(rng, machine, motion, rotors, with_unlisted):
    """Return the bodies as the robot file states them, and what is concealed.

    Args:
        rng: of the world.
        machine: without friction.
        motion: of a pilot run.
        rotors: (k,) inertia seen at the joints [kg m^2 or kg].
        with_unlisted: whether a law outside the list acts as well.
    """
    bodies, loads = machine.bodies, _loads(machine, motion)
    states_viscous = rng.random() < (0.6 if len(bodies) >= 5 else 0.2)
    effects, stated = [], []
    for j, body in enumerate(bodies):
        load, speed = loads[j], machine.gears[j].speed
        viscous = load * rng.uniform(0.2, 0.6) / speed
        effects += _dry(rng, body.joint, j, load * rng.uniform(0.2, 0.6), speed)
        if not states_viscous:
            effects.append(_fixed(VISCOUS_FRICTION, body.joint, j, b=viscous))
        if rotors[j]:
            effects.append(_fixed(ARMATURE, body.joint, j, inertia=rotors[j]))
        stated.append(replace(body, damping=viscous * states_viscous))
    effects += _extras(rng, bodies, loads, motion)
    if with_unlisted:
        effects.append(_unlisted(rng, bodies, loads, motion))
    return stated, effects


def state_friction(rng, machine, motion):
    """Return bodies whose friction the robot file states as it is."""
    loads = _loads(machine, motion)
    return [
        replace(
            body,
            damping=load * rng.uniform(0.2, 0.6) / gear.speed,
            friction=load * rng.uniform(0.2, 0.6),
        )
        for body, gear, load in zip(machine.bodies, machine.gears, loads, strict=True)
    ]


def _loads(machine, motion):
    """Return what the drives are made for, (k,): the usual effort, or a brisk start of the arm."""
    start = machine.inertia * np.array([gear.acceleration for gear in machine.gears])
    return np.sqrt(motion.effort**2 + (0.3 * start) ** 2)


def _dry(rng, joint, j, level, speed):
    """Return the dry friction of a joint as one or two effects."""
    kind = rng.choice(4, p=[0.5, 0.2, 0.1, 0.2])
    if kind == 1:
        levels = level * rng.permutation([1.0, rng.uniform(0.4, 0.8)])
        return [_fixed(ASYMMETRIC_COULOMB, joint, j, level_pos=levels[0], level_neg=levels[1])]
    if kind == 3:
        return [_fixed(STRIBECK_FRICTION, joint, j, coulomb=level,
                       static=level * rng.uniform(1.3, 2.0),
                       stribeck_velocity=speed * rng.uniform(0.03, 0.2))]  # fmt: skip
    found = [_fixed(COULOMB_FRICTION, joint, j, level=level)]
    if kind == 2:
        force = level * rng.uniform(0.3, 1.0) * rng.choice([-1.0, 1.0])
        found.append(_fixed(CONSTANT_LOAD, joint, j, force=force))
    return found


def _extras(rng, bodies, loads, motion):
    """Return a payload, a spring against the weight, cogging; each in some machines."""
    found, last = [], len(bodies) - 1
    if len(bodies) >= 3 and rng.random() < 0.3:
        tip = bodies[last].tip
        found.append(_fixed(
            PAYLOAD, bodies[last].joint, last, mass=bodies[last].mass * rng.uniform(0.3, 1.0),
            x=tip[0], y=tip[1], z=tip[2],
        ))  # fmt: skip
    lifts = [j for j, body in enumerate(bodies) if j < 3 and not body.is_prismatic]
    if lifts and rng.random() < 0.25:
        j = lifts[min(1, len(lifts) - 1)]
        stiffness = loads[j] * rng.uniform(0.4, 1.0) / bodies[j].span
        rest = float(rng.uniform(-0.5, 0.5) * bodies[j].span)
        found.append(_fixed(SPRING, bodies[j].joint, j, stiffness=stiffness, rest=rest))
    if rng.random() < 0.25:
        j = int(rng.integers(len(bodies)))
        least = 1.5 / max(float(motion.high[j] - motion.low[j]), 1e-3)  # waves in the motion
        unit = 1.0 if bodies[j].is_prismatic else 2.0 * np.pi
        periods = float(np.ceil(max(3.0, unit * least) * rng.uniform(1.0, 5.0)))
        found.append(_fixed(
            EFFECTS[Cogging.name], bodies[j].joint, j,
            amplitude=loads[j] * rng.uniform(0.15, 0.35), periods=periods,
            phase=rng.uniform(-3.0, 3.0),
        ))  # fmt: skip
    return found


def _unlisted(rng, bodies, loads, motion):
    drawn = draw_effect(rng, NAME, bodies, replace(motion, effort=loads), is_hard=False)
    return replace(drawn, size=drawn.size * float(rng.uniform(0.7, 1.5)))


def _fixed(effect, joint, j, **numbers):
    """Return a concealed effect of given size."""
    values = {name: float(value) for name, value in numbers.items()}
    return Concealed.of(effect, joint, j, lambda _: values, 1.0)
