"""Worlds in which a robot is connected or described wrongly.

A world of tier B with nominal or wrong bodies, or with one listed effect, is recorded with one
error of the connection, with two, or with none.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace

from sgp_proof.concealed import sizes
from sgp_proof.concealed import world as worlds
from sgp_proof.concealed.draw import TOPIC, draw_transport, observed
from sgp_proof.concealed.kinds import draw_effect
from sgp_proof.concealed.robots import urdf
from sgp_proof.connection.miswired import corrupted, standing
from sgp_proof.connection.seeds import draw_suitable
from sgp_ros.apps.simulation import write_simulated
from sgp_ros.physics.catalogue import COULOMB_FRICTION, VISCOUS_FRICTION
from sgp_ros.physics.drawing import UnsuitableError
from sgp_ros.rigid.rigid_body import inverse_dynamics
from sgp_ros.rigid.tree import read_urdf

KINDS = (
    'encoder_offset', 'position_scale', 'joint_sign', 'swapped_joints', 'effort_scale',
    'clock_offset', 'base_orientation', 'joint_origin',
)  # fmt: skip
NOTHING, PAIR = 'none', 'pair'
PLAN = (*KINDS, NOTHING, PAIR, *KINDS, NOTHING, NOTHING)
_LEAST_SHARE = 0.01
_PHYSICS = (COULOMB_FRICTION.name, VISCOUS_FRICTION.name)


def draw_case(seed, sealed, answer_file):
    """Write recordings, robot and answer of a world; return whether there is one."""
    return draw_suitable(seed, 'S', lambda rng: _attempt(seed, rng, sealed, answer_file))


def _attempt(seed, rng, sealed, answer_file):
    wanted = PLAN[seed % len(PLAN)]
    kinds = [] if wanted == NOTHING else [wanted]
    if wanted == PAIR:
        kinds = [str(k) for k in rng.choice(KINDS[:6], 2, replace=False)]
    beside = str(rng.choice(['nothing', 'bodies', 'physics']))
    world = worlds.draw_world(seed, rng, 'B', 0.15 if beside == 'bodies' else 0.0)
    world, motion, _ = observed(rng, world, 'B')
    errors = [_drawn(rng, kind, world) for kind in kinds]
    stood = standing(world, errors)
    effects = []
    if beside == 'physics':
        effect = draw_effect(rng, str(rng.choice(_PHYSICS)), world.bodies, motion, True)  # noqa: FBT003
        sizes.sized(world, effect, math.exp(rng.uniform(math.log(0.02), math.log(0.1))))
        effects = [effect]
    recording = stood.run('near', 25.0, 1, effects)
    shown = recording
    for error in errors:
        shown = corrupted(shown, error)
    if errors:
        _require_size(world, recording, errors, stood)
    sealed.mkdir(parents=True, exist_ok=True)
    answer_file.parent.mkdir(parents=True, exist_ok=True)
    (sealed / 'robot.urdf').write_text(urdf(world.family, world.bodies), encoding='utf-8')
    write_simulated(shown, sealed / 'real.mcap', draw_transport(rng, 'B'), seed=seed,
                    command_topic=TOPIC)  # fmt: skip
    answer = {
        'robot': world.family, 'joints': [b.joint for b in world.bodies], 'setup': errors,
        'bodies': world.errors, 'physics': [[e.at.name, e.at.joint] for e in effects],
    }  # fmt: skip
    answer_file.write_text(json.dumps(answer, indent=1) + '\n', encoding='utf-8')


def _drawn(rng, kind, world):
    bodies, motors = world.bodies, world.motors
    joint = int(rng.integers(len(bodies)))
    sign = float(rng.choice([-1.0, 1.0]))
    entry = {'effect': kind, 'joint': bodies[joint].joint, 'parameters': {}}
    if kind == 'encoder_offset':
        size = 0.03 if bodies[joint].is_prismatic else 1.0
        offset = sign * size * math.exp(rng.uniform(math.log(0.03), math.log(1.5)))
        entry['parameters'] = {'offset': offset}
    elif kind == 'position_scale':
        scale = math.exp(sign * rng.uniform(0.04, 1.0))
        turns = not bodies[joint].is_prismatic
        entry['parameters'] = {'scale': 180.0 / math.pi if turns and rng.random() < 0.2 else scale}
    elif kind == 'joint_sign':
        channels = ['position', 'effort', 'all'] if joint in motors else ['position']
        entry['parameters'] = {'channels': str(rng.choice(channels))}
    elif kind == 'swapped_joints':
        if len(bodies) < 2:
            raise UnsuitableError('one joint')
        i, j = sorted(int(x) for x in rng.choice(len(bodies), 2, replace=False))
        channels = ['position', 'effort', 'all'] if {i, j} <= set(motors) else ['position']
        entry |= {'joint': bodies[i].joint, 'parameters': {
            'other_joint': bodies[j].joint, 'channels': str(rng.choice(channels))}}  # fmt: skip
    elif kind == 'effort_scale':
        entry['joint'] = bodies[int(rng.choice(motors))].joint if rng.random() < 0.5 else 'all'
        scale = math.exp(sign * rng.uniform(1.2, 4.0))
        entry['parameters'] = {'scale': float(rng.choice([scale, 10.197, 1000.0]))}
    elif kind == 'clock_offset':
        entry |= {'joint': 'all', 'parameters': {'offset': float(rng.uniform(0.01, 0.2))}}
    elif kind == 'base_orientation':
        roll, pitch = float(rng.uniform(-3.1, 3.1)), float(rng.uniform(-1.4, 1.4))
        entry |= {'joint': 'base', 'parameters': {'roll': roll, 'pitch': pitch}}
    else:
        if bodies[joint].parent < 0:
            raise UnsuitableError('an origin without consequences')
        x, y, z = rng.normal(0.0, 0.05, 3).tolist()
        entry['parameters'] = {'x': x, 'y': y, 'z': z}
    return entry


def _require_size(world, recording, errors, stood):
    """Refuse errors that make less than a share of every effort: they have no consequences.

    Nominal inverse dynamics of the shown motion are compared with shown efforts.
    """
    if any(e['effect'] == 'clock_offset' for e in errors):
        return
    given, real = (
        read_urdf(urdf(world.family, w.bodies), joints=recording.joint_names)
        for w in (world, stood)
    )
    motion = recording.true_position, recording.true_velocity, recording.true_acceleration
    shown = replace(recording, effort=inverse_dynamics(real, real.parameters, *motion))
    for error in errors:
        shown = corrupted(shown, error)
    motion = shown.true_position, shown.true_velocity, shown.true_acceleration
    d = inverse_dynamics(given, given.parameters, *motion) - shown.effort
    if ((d**2).mean(axis=0) / (shown.effort**2).mean(axis=0)).max() < _LEAST_SHARE:
        raise UnsuitableError('an error without consequences')
