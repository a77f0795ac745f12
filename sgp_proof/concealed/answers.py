"""Right answers to a concealed effect, effects that cannot be told from it included."""

from __future__ import annotations

from sgp_proof.concealed.unknown import NAME, OF_TIME
from sgp_ros.physics.catalogue import (
    ARMATURE,
    ASYMMETRIC_COULOMB,
    COMMAND_DELAY,
    CONSTANT_LOAD,
    COULOMB_FRICTION,
    GRAVITY_TILT,
    JOINT_COUPLING,
    LIMIT_FRICTION,
    PAYLOAD,
    POSITION_FRICTION,
    TORQUE_GAIN,
)
from sgp_ros.physics.law import NAME as LAW


def effects_entry(concealed, bodies):
    """Return the entry of `effects` for one effect."""
    at = concealed.at
    parameters = {
        name: value if isinstance(value, str) else float(value)
        for name, value in at.parameters.items()
    }
    known = at.effect.stated_quantities(parameters.get('kind', ''))
    if at.name == NAME and parameters['source'] >= 0:
        parameters['source'] = bodies[int(parameters['source'])].joint
    return {
        'effect': at.name, 'joint': at.joint, 'parameters': parameters,
        'scored': [q.name for q in known if q.is_scored],
    }  # fmt: skip


def accepted(concealed, bodies, motion):
    """Return the answers that are right for one effect."""
    name, joint = concealed.at.name, concealed.at.joint
    body = bodies[concealed.index]
    is_fixed_axis = body.parent < 0 and joint == body.joint
    verdict = 'unexplained' if name == NAME else 'missing_physics'
    answers = [_answer(verdict, name, joint, 'true')]
    if name == NAME and concealed.at.parameters['kind'] not in OF_TIME:
        answers.append(_answer('missing_physics', LAW, joint, 'its law'))
    same = 'same motion'
    if name == ASYMMETRIC_COULOMB.name:
        both = (COULOMB_FRICTION.name, CONSTANT_LOAD.name)
        for one, other in (both, both[::-1]):
            answers.append(_answer(verdict, one, joint, 'identical away from rest', [other]))
    if (
        name == PAYLOAD.name
        or (name == ARMATURE.name and is_fixed_axis)
        or (name in {TORQUE_GAIN.name, GRAVITY_TILT.name} and len(bodies) == 1)
    ):
        answers.append(_answer('parameters_only', None, '*', same))
    if name == CONSTANT_LOAD.name and is_fixed_axis and body.is_prismatic:
        answers.append(_answer(verdict, GRAVITY_TILT.name, 'base', same))
    if name == LIMIT_FRICTION.name:
        answers.append(_answer(verdict, POSITION_FRICTION.name, joint, same))
    if name == POSITION_FRICTION.name and body.kind != 'continuous':
        lo, hi = (concealed.at.parameters[end] for end in ('lo', 'hi'))
        low, high = motion.low[concealed.index], motion.high[concealed.index]
        if lo < low + 0.05 * (high - low) or hi > high - 0.05 * (high - low):
            answers.append(_answer(verdict, LIMIT_FRICTION.name, joint, same))
    answers += [_answer(verdict, name, other, same) for other in _other_joints(concealed, bodies)]
    return answers


def _other_joints(concealed, bodies):
    """Return the joints at which the same effect would give the same motion."""
    at, joint = concealed.at, concealed.at.joint
    driven = [b.joint for b in bodies if b.is_driven]
    if at.name == JOINT_COUPLING.name and 'stiffness' in at.parameters:
        return [at.parameters['source_joint']]
    if joint == 'all':
        return driven
    return ['all'] if at.name == COMMAND_DELAY.name and len(driven) == 1 else []


def without_effect(errors, bodies):
    """Return verdict and right answers of a world without missing physics."""
    if not errors:
        return 'no_mismatch', [_answer('no_mismatch', None, '*', 'true')]
    answers = [_answer('parameters_only', None, '*', 'true')]
    if [error['link'] for error in errors] == [bodies[-1].link] and errors[0]['mass'] > 1.0:
        answers.append(
            _answer('missing_physics', PAYLOAD.name, '*', 'mass error of the last link')
        )
    return 'parameters_only', answers


def _answer(verdict, effect, joint, why, requires=()):
    entry = {'verdict': verdict, 'effect': effect, 'joint': joint, 'why': why}
    return entry | ({'requires': list(requires)} if requires else {})
