"""Effects that are concealed: drawn by the laws of the catalogue, or outside it."""

from __future__ import annotations

from sgp_proof.concealed.concealed_effect import OUTSIDE, Concealed
from sgp_proof.concealed.eighth_families import OF_EFFORT
from sgp_proof.concealed.unknown import NAME, UNKNOWN
from sgp_proof.concealed.unlisted import constants, family_of
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.drawing import Scene, UnsuitableError
from sgp_ros.physics.place import MOTOR


def draw_effect(rng, name, bodies, motion, is_hard):
    """Return an effect of this name on a random joint that can have it."""
    motors = [i for i, b in enumerate(bodies) if b.is_driven]
    has_motor = name != NAME and EFFECTS[name].site is MOTOR
    joint = int(rng.choice(motors if has_motor else list(range(len(bodies)))))
    scene = Scene(rng, bodies, motion, joint, is_hard)
    if name == NAME:
        return _unknown(scene)
    drawn = EFFECTS[name].draw(scene)
    j = joint if drawn.index is None else drawn.index
    place = drawn.place or bodies[j].joint
    where = {}
    if drawn.interval is not None:
        where = {
            'joint': place, 'variables': ['position'],
            'intervals': {'position': [list(drawn.interval)]},
        }  # fmt: skip
    return Concealed.of(
        EFFECTS[name], place, j, drawn.values, drawn.size, drawn.power, drawn.largest, where
    )


def draw_unlisted(rng, seed, bodies, motion):
    """Return a law of the families that are scored, on a random joint."""
    family = family_of(seed, has_others=len(bodies) > 1)
    return _unknown(
        Scene(rng, bodies, motion, int(rng.integers(len(bodies))), is_hard=False), family
    )


def _unknown(scene, family=''):
    rng, bodies, motion, j = scene.rng, scene.bodies, scene.motion, scene.joint
    kind = family or str(rng.choice(list(UNKNOWN)))
    if kind == 'position_gain':
        j = int(rng.choice(scene.motors))
    others = [i for i in range(len(bodies)) if i != j]
    if kind in {'other_velocity', 'other_position_gain'} and not others:
        kind = 'sine_friction'
    force, v = motion.effort[j], motion.velocity[j]
    start = rng.uniform(4.0, 18.0)
    fixed = {
        'kind': kind, 'v': v, 'reach': 0.5 * (motion.high[j] - motion.low[j]),
        'start': start, 'end': start + rng.uniform(3.0, 9.0), 'hz': rng.uniform(0.4, 2.0),
        'source': int(rng.choice(others)) if others else -1,
        'source_v': float(motion.velocity[others].mean()) if others else 1.0,
    }  # fmt: skip
    width = motion.high - motion.low
    fixed |= constants(kind, rng, float(0.5 * width[fixed['source']]))
    if kind in OF_EFFORT:
        source = bodies[fixed['source']]
        if source.is_prismatic or not source.is_driven:
            raise UnsuitableError(f'the effort of {source.joint} hardly varies')
        fixed['source_effort'] = float(motion.effort[fixed['source']])
    place = {}
    if kind == 'burst':
        place = {
            'joint': bodies[j].joint, 'variables': ['time'],
            'time': [[fixed['start'], fixed['end']]],
        }  # fmt: skip
    size = 0.3 if kind == 'position_gain' else 0.4 * force
    return Concealed.of(
        OUTSIDE, bodies[j].joint, j, lambda s: {**fixed, 'a': s}, size, location=place
    )
