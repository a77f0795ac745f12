"""Results of a diagnosis in plain sentences, for the terminal and the top of the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.result import (
    Diagnosis,
    Difference,
    Equivalent,
    Finding,
    Parameter,
    ParameterError,
    Proof,
)
from sgp_ros.diagnosis.setup.errors import ORIENTATION
from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.physics.catalogue import EFFECTS, words_of
from sgp_ros.physics.parts import COULOMB
from sgp_ros.physics.place import BASE, TOOL, place_of_word
from sgp_ros.physics.tool_law import STATED

UNKNOWN = 'unknown'
"""Name of what no effect of the catalogue describes."""
_WORDS = {UNKNOWN: 'an unknown effect', 'gain_scale': 'a factor on the stated gains'}
_PLACES = {'base': 'at the base', 'tool': 'at the tool', 'all': 'on all joints'}
_ENTRIES = {f'com_{axis}': f'{axis} of the centre of mass' for axis in 'xyz'}
_MEANINGLESS = 1e6
"""Error over variance that only a constant effort gives."""
_MOST_ERRORS = 3
_LEAST_CHANCE = 0.005
_MIXED_UP = {math.pi / 180.0: 'radians were taken for degrees',
             180.0 / math.pi: 'degrees were taken for radians'}  # fmt: skip
"""Scale of positions or velocities to what makes it."""


def is_calm(found: Diagnosis) -> bool:
    """Return whether the nominal robot is right, once errors of the set-up are undone."""
    return found.verdict in {'no_mismatch', 'setup_error'}


def scored_joints(proof: Proof) -> list[str]:
    """Return the joints with a meaningful score: an effort that never changes has no score."""
    return [
        name
        for name, before in proof.nmse_before.items()
        if before < _MEANINGLESS and math.isfinite(proof.nmse_after[name])
    ] or list(proof.nmse_before)


def worst_joint(proof: Proof) -> str:
    """Return the joint of which the nominal robot leaves most."""
    return max(scored_joints(proof), key=lambda name: proof.nmse_before[name])


def explained(found: Diagnosis) -> float:
    """Return the share of the nominal robot's residual that the final model explains.

    Mean squares of the training recording, relative to the effort of each joint, summed.
    """
    proof = found.proofs['train']
    joints = scored_joints(proof)
    before = sum(proof.nmse_before[name] for name in joints)
    return 1.0 - sum(proof.nmse_after[name] for name in joints) / max(before, 1e-300)


def gain_text(subject: str, found: Diagnosis) -> str:
    """Say which share of the nominal robot's residual is explained, or that nothing is."""
    share = explained(found)
    if share <= 0.0:
        return 'this does not make the residual of the nominal robot smaller'
    return f'{subject} {percent(share)} of the residual of the nominal robot'


def phrase(finding: Finding | Difference) -> str:
    """Return an effect in plain words, with its interval and parameters."""
    less = ['less than the robot file states'] if taken_off(finding) > 0.0 else []
    return ', '.join([effect_name(finding), *numbers(finding), *less, *_mixed_up(finding)])


def taken_off(finding: Finding | Difference) -> float:
    """Return how much less of a law there is than the robot file states; 0 of any other."""
    law = EFFECTS.get(finding.effect)
    if law is None or not law.linear or isinstance(finding, Difference):
        return 0.0
    first = next(q for q in law.quantities if q.name == law.linear[0])
    is_stated = law.is_usual or bool(first.joint_number)
    return max(-float(finding.parameters[first.name].value), 0.0) if is_stated else 0.0


def _mixed_up(finding: Finding | Difference) -> list[str]:
    """Say which units a scale of positions or velocities mixes up, if it does."""
    scale = finding.parameters.get('scale')
    if finding.effect not in {'position_scale', 'velocity_scale'} or scale is None:
        return []
    value = float(scale.value)
    return [said for ratio, said in _MIXED_UP.items() if math.isclose(value, ratio, rel_tol=0.02)]


def sure_phrase(finding: Finding) -> str:
    """Return an effect with its probability, and why that is low."""
    why = f': {finding.why}' if finding.why else ''
    return f'{phrase(finding)} (probability {finding.probability:.2f}{why})'


def plain_name(effect: str) -> str:
    """Return the plain name of an effect, also of an unknown one."""
    return _WORDS.get(effect) or words_of(effect)


def effect_name(finding: Finding | Difference) -> str:
    """Return the plain name of an effect and of its variant."""
    words = {name: p.value for name, p in finding.parameters.items() if isinstance(p.value, str)}
    name = plain_name(finding.effect)
    kind = str(words.get('kind', ''))
    if 'source_joint' in words:
        return f'{name} ({f"{kind} from" if kind else "with"} {words["source_joint"]})'
    if 'encoder' in words:
        return f'{name} (encoder on the {words["encoder"]})'
    return f'{"Coulomb" if kind == COULOMB else kind} {name}'.strip()


def place(finding: Finding | Difference) -> str:
    """Return where an effect acts, in plain words."""
    if isinstance(finding, Finding) and STATED.match(finding.formula):
        return _PLACES[TOOL.value]
    return _where(finding.effect, finding.joint)


def _where(effect: str, joint: str) -> str:
    site = EFFECTS[effect].site if effect in EFFECTS else BASE if effect == ORIENTATION else None
    is_joint = place_of_word(joint, site) is None
    return f'on {joint}' if is_joint else _PLACES[joint]


def numbers(finding: Finding | Difference) -> list[str]:
    """Return the parameters of an effect, its interval first."""
    shown = dict(finding.parameters)
    if {'lo', 'hi'} <= shown.keys():
        lo, hi = shown.pop('lo'), shown.pop('hi')
        interval = [f'from {quantity(lo, is_short=True)} to {quantity(hi)}']
    else:
        interval = []
    numbers = [
        f'{name.replace("_", " ")} {quantity(p)}'
        for name, p in shown.items()
        if not isinstance(p.value, str)
    ]
    return [*interval, *numbers]


def quantity(p: Parameter, *, is_short: bool = False) -> str:
    """Return a number as `0.317 +- 0.002 N m`; the digits end where its interval does.

    Args:
        p: value, standard deviation and unit.
        is_short: leave out interval and unit.
    """
    if isinstance(p.value, str):
        return p.value
    unit = '' if p.unit in {'', '1'} else f' {p.unit}'
    half = INTERVAL_95 * p.std if p.std is not None and math.isfinite(p.std) else 0.0
    if half <= 0.0:
        value = f'{p.value + 0.0:.3g}'  # no negative zero
        return value if is_short else f'{value}{unit}'
    places = int(np.clip(1 - math.floor(math.log10(half)), 0, 12))
    if is_short:
        return f'{p.value:.{places}f}'
    return f'{p.value:.{places}f} +- {half:.{places}f}{unit}'


def differences_text(found: Diagnosis) -> list[str]:
    """Say what differs between several recordings; nothing of one recording."""
    if not found.recordings:
        return []
    if not found.differences:
        return [f'nothing, between {" and ".join(found.recordings)}']
    lines = []
    for d in found.differences:
        text = f'{d.recording} has {place(d)} {phrase(d)}'
        if d.difference != d.parameters:
            own = replace(d, parameters=d.difference)
            text += f', which differs from the others by {", ".join(numbers(own))}'
        lines.append(f'{text} (probability {d.probability:.2f})')
    return lines


def equivalence_sentences(found: Diagnosis) -> list[str]:
    """Return a sentence for each explanation that does as well as the findings, none twice."""
    asserted = [(f.joint, f.effect) for f in found.findings]
    return list(dict.fromkeys(equivalence_sentence(e, asserted) for e in found.equivalents))


def equivalence_sentence(found: Equivalent, asserted: Sequence[tuple[str, str]] = ()) -> str:
    """Say what would do in place of which findings on this motion, and which motion would tell.

    Args:
        found: another explanation.
        asserted: joint and effect of the findings.
    """
    new = [x for x in found.effects if x not in asserted]
    gone = [x for x in asserted if x not in found.effects]
    if len(gone) == len(asserted):
        others = _listed(new) or 'another set of bodies'
    elif gone:
        others = f'{_listed(new) or "no effect, with other bodies,"} in place of {_listed(gone)}'
    else:
        others = f'{_listed(new) or "other bodies"} beside what is found'
    text = f'On this motion {others} would fit equally well'
    if not found.motion:
        return f'{text}; no motion tried can separate them: measure one of them separately.'
    factor = f'{found.contrast:.0f}' if found.contrast < 1e4 else 'more than 10000'
    return (
        f'{text}; {found.motion} separates them: their efforts then differ {factor} times as much.'
    )


def _listed(effects: Sequence[tuple[str, str]]) -> str:
    """Return effects at their joints, such as `a spring on elbow and a delay on all joints`."""
    parts = [f'{plain_name(effect)} {_where(effect, joint)}' for joint, effect in effects]
    return f'{", ".join(parts[:-1])} and {parts[-1]}' if parts[1:] else ''.join(parts)


def percent(share: float) -> str:
    """Return a share as per cent, without promising all of it."""
    if not math.isfinite(share) or share > _MEANINGLESS:
        return 'an unknown share'
    if 0.999 < share < 1.0:
        return 'more than 99.9 %'
    if 0.0 < share < 1e-5:
        return 'less than 0.001 %'
    if share >= 10.0:
        return f'{100.0 * share:.0f} %'
    return f'{100.0 * share:.2g} %' if share < 0.1 else f'{100.0 * share:.3g} %'


def parameter_errors_text(errors: Sequence[ParameterError]) -> str:
    """Return the surest wrong parameters, such as `mass of fore 1.59 kg instead of 1.17 kg`."""
    if not errors:
        return (
            'combinations of masses, centres of mass and inertias that this motion cannot separate'
        )
    surest = sorted(errors, key=lambda e: -abs(e.value - e.nominal) / max(e.std, 1e-300))
    parts = [_error(e) for e in surest[:_MOST_ERRORS]]
    more = len(surest) - len(parts)
    return ', '.join(parts) + (f' and {more} more' if more else '')


def chance(probability: float) -> str:
    """Return a probability in two digits, without calling anything impossible."""
    return f'{probability:.2f}' if probability >= _LEAST_CHANCE else '< 0.01'


def visibility_sentences(found: Diagnosis) -> list[str]:
    """Say, effect by effect, what the recording could not have shown."""
    sentences = []
    for effect in dict.fromkeys(effect for _, effect, _ in found.visibility):
        own = {joint: p for (joint, e, _), p in found.visibility.items() if e == effect}
        never = [joint for joint, p in own.items() if p.value == math.inf]
        seen = [
            f'below {quantity(p)} on {joint}' for joint, p in own.items() if joint not in never
        ]
        seen += [f'of any size on {", ".join(never)}'] if never else []
        sentences.append(f'{plain_name(effect)}: {", ".join(seen)}')
    return sentences


def _error(e: ParameterError) -> str:
    now = quantity(Parameter(e.value, e.std, e.unit))
    name = _ENTRIES.get(e.parameter, e.parameter.replace('_', ' '))
    return f'{name} of {e.link} {now} instead of {e.nominal:.3g} {e.unit}'
