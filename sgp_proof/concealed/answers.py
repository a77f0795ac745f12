"""Right answers to a concealed effect, effects that cannot be told from it included."""

from __future__ import annotations

from sgp_proof.concealed.concealed_effect import SCORED


def effects_entry(concealed, bodies):
    """Return the entry of `effects` for one effect."""
    parameters = {
        name: value if isinstance(value, str) else float(value)
        for name, value in concealed.parameters.items()
    }
    scored = list(SCORED.get(concealed.name, []))
    if concealed.name == 'joint_coupling':
        scored = ['coefficient' if parameters['kind'] == 'torque' else 'stiffness']
    if concealed.name == 'unknown' and parameters['source'] >= 0:
        parameters['source'] = bodies[int(parameters['source'])].joint
    return {
        'effect': concealed.name, 'joint': concealed.joint, 'parameters': parameters,
        'scored': scored,
    }  # fmt: skip


def accepted(concealed, bodies, motion):
    """Return the answers that are right for one effect."""
    name, joint = concealed.name, concealed.joint
    body = bodies[concealed.index]
    is_fixed_axis = body.parent < 0 and joint == body.joint
    verdict = 'unexplained' if name == 'unknown' else 'missing_physics'
    answers = [_answer(verdict, name, joint, 'true')]
    same = 'same motion'
    if name == 'asymmetric_coulomb':
        both = ('coulomb_friction', 'constant_load')
        for one, other in (both, both[::-1]):
            answers.append(_answer(verdict, one, joint, 'identical away from rest', [other]))
    if (
        name == 'payload'
        or (name == 'armature' and is_fixed_axis)
        or (name in {'torque_gain', 'gravity_tilt'} and len(bodies) == 1)
    ):
        answers.append(_answer('parameters_only', None, '*', same))
    if name == 'constant_load' and is_fixed_axis and body.is_prismatic:
        answers.append(_answer(verdict, 'gravity_tilt', 'base', same))
    if name == 'limit_friction':
        answers.append(_answer(verdict, 'position_friction', joint, same))
    if name == 'position_friction' and body.kind != 'continuous':
        lo, hi = concealed.parameters['lo'], concealed.parameters['hi']
        low, high = motion.low[concealed.index], motion.high[concealed.index]
        if lo < low + 0.05 * (high - low) or hi > high - 0.05 * (high - low):
            answers.append(_answer(verdict, 'limit_friction', joint, same))
    answers += [_answer(verdict, name, other, same) for other in _other_joints(concealed, bodies)]
    return answers


def _other_joints(concealed, bodies):
    """Return the joints at which the same effect would give the same motion."""
    name, joint = concealed.name, concealed.joint
    driven = [b.joint for b in bodies if b.is_driven]
    if name == 'joint_coupling' and concealed.parameters['kind'] == 'spring':
        return [concealed.parameters['source_joint']]
    if joint == 'all':
        return driven
    return ['all'] if name == 'command_delay' and len(driven) == 1 else []


def without_effect(errors, bodies):
    """Return verdict and right answers of a world without missing physics."""
    if not errors:
        return 'no_mismatch', [_answer('no_mismatch', None, '*', 'true')]
    answers = [_answer('parameters_only', None, '*', 'true')]
    if [error['link'] for error in errors] == [bodies[-1].link] and errors[0]['mass'] > 1.0:
        answers.append(_answer('missing_physics', 'payload', '*', 'mass error of the last link'))
    return 'parameters_only', answers


def _answer(verdict, effect, joint, why, requires=()):
    entry = {'verdict': verdict, 'effect': effect, 'joint': joint, 'why': why}
    return entry | ({'requires': list(requires)} if requires else {})
