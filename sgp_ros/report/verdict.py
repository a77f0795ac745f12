"""The verdict of a diagnosis in one sentence, against the robot or against a simulation."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from sgp_ros.diagnosis.criteria import LEAST_SHARE
from sgp_ros.diagnosis.result import Diagnosis, Finding
from sgp_ros.physics.catalogue import exerts_force
from sgp_ros.physics.law import NAME as LAW
from sgp_ros.report.diagnosis_proof import recording_name
from sgp_ros.report.diagnosis_text import (
    UNKNOWN,
    differences_text,
    effect_name,
    explained,
    gain_text,
    numbers,
    parameter_errors_text,
    percent,
    phrase,
    place,
    plain_name,
    sure_phrase,
    taken_off,
    worst_joint,
)

_MOST_VARIABLES = 2


def verdict_sentence(found: Diagnosis) -> str:
    """Return the finding in one sentence; `+-` is half of a 95 % interval."""
    if found.setup:
        each = [f'{place(f)}: {sure_phrase(f)}' for f in found.setup]
        head = f'The recording and the robot file contradict each other: {"; ".join(each)}.'
        rest = verdict_sentence(replace(found, setup=()))
        return head if found.verdict == 'setup_error' else f'{head} In addition: {rest}'
    if _is_compared(found):
        return _against_simulation(found)
    if found.verdict == 'missing_physics':
        return _missing(found)
    if found.verdict == 'parameters_only':
        head = 'No physics is missing, only inertial parameters are wrong'
        if found.certainty is None:
            head = 'Inertial parameters are wrong, and no missing physics shows'
        return (
            f'{head}: {parameter_errors_text(found.parameter_errors)} '
            f'({certainty_text(found.certainty)}); '
            f'{gain_text("correcting them explains", found)}.'
        )
    if found.verdict == 'no_mismatch':
        return _calm(found)
    return _unexplained(found)


def certainty_text(certainty: float | None) -> str:
    """Return a certainty [1] in words; None is none, as remarks say."""
    return 'no certainty, see the remarks' if certainty is None else f'certainty {certainty:.2f}'


def held_out_sentence(found: Diagnosis) -> str:
    """Say how the error of the effort changes on recordings that nothing was fitted to."""
    parts = []
    for stem, proof in found.proofs.items():
        if stem == 'train':
            continue
        joint = worst_joint(proof)
        before, after = percent(proof.nmse_before[joint]), percent(proof.nmse_after[joint])
        change = before if found.verdict == 'no_mismatch' else f'{before} before, {after} after'
        parts.append(f'{change} on {recording_name(stem)} ({joint})')
    if not parts:
        return 'No recording was held out, so nothing shows how well the finding generalises.'
    return (
        'Share of the variance of the effort that remains on held-out data: '
        + '; '.join(parts)
        + '.'
    )


def _missing(found: Diagnosis) -> str:
    if not found.findings:
        return (
            'No physics is missing in all recordings alike, but the recordings differ: '
            f'{"; ".join(differences_text(found))}.'
        )
    first = found.findings[0]
    text = 'Too much is stated' if taken_off(first) else 'Missing'
    text += f' {place(first)}: {sure_phrase(first)}'
    for previous, f in pairwise(found.findings):
        where = '' if f.joint == previous.joint else f'{place(f)}: '
        text += f'; and {where}{sure_phrase(f)}'
    if any(exerts_force(f.effect) for f in found.findings):
        subject = 'it explains' if len(found.findings) == 1 else 'together they explain'
        if found.parameter_errors:
            subject = 'with corrected bodies it explains'
            if len(found.findings) > 1:
                subject = 'with corrected bodies they explain'
        text += f'; {gain_text(subject, found)}'
    differ = f' The recordings differ: {"; ".join(differences_text(found))}.'
    return f'{text}.{differ if found.differences else ""}'


def _calm(found: Diagnosis) -> str:
    proof = found.proofs['train']
    name = worst_joint(proof)
    j = found.joints.index(name)
    left = float(np.sqrt((found.traces.before[:, j] ** 2).mean()))
    noise, unit = float(found.traces.noise[j]), found.units[j]
    text = (
        f'No mismatch: the residual of the nominal robot is {left:.2g} {unit} rms on {name}, '
        f'{percent(proof.nmse_before[name])} of the variance of the effort'
    )
    if left <= 2.0 * noise:
        text += f' and no more than the encoder noise explains ({noise:.2g} {unit})'
    else:
        small = proof.nmse_before[name] < LEAST_SHARE
        part = '' if small else 'of which the part that is not noise is '
        text += f', {part}too little to count as missing physics'
    return f'{text} ({certainty_text(found.certainty)}).'


def _unexplained(found: Diagnosis) -> str:
    beside = [f for f in found.findings if f.effect != UNKNOWN]
    if beside:
        each = [f'{place(f)}: {sure_phrase(f)}' for f in beside]
        alone = replace(found, findings=tuple(f for f in found.findings if f not in beside))
        return f'{_unexplained(alone)} Missing beside it {"; and ".join(each)}.'
    named = [f for f in found.findings if f.effect == UNKNOWN]
    joint = named[0].joint if named else found.joints[0]
    certainty = named[0].probability if named and found.certainty else found.certainty
    share = named[0].share if named else explained(found)
    text = (
        f'Unexplained on {joint}: {percent(share)} of the mean squared effort '
        f'({certainty_text(certainty)})'
    )
    of = next((d for d in found.dependences if d.joint == joint), None)
    scores = {} if of is None else {n: s for n, s in of.scores.items() if of.is_significant(n)}
    leading = sorted(scores, key=lambda name: -scores[name])[:_MOST_VARIABLES]
    on = [f'{name} ({percent(scores[name])})' for name in leading if scores[name] > 0.05]
    text += f'; it depends on {" and ".join(on)}' if on else '; no single variable explains much'
    formulas = {f.log_bayes_factor for f in found.alternatives if f.effect == LAW}
    listed = [f for f in found.alternatives if f.log_bayes_factor not in formulas]
    if not listed:
        return f'{text}. No listed effect explains it.'
    top = listed[0]
    nearest = [f for f in listed if f.log_bayes_factor == top.log_bayes_factor]
    names = ' with '.join(dict.fromkeys(plain_name(f.effect) for f in nearest))
    why = f': {top.why}' if top.why else ''
    return f'{text}. No listed effect is asserted; the nearest is {names}{why}.'


def _is_compared(found: Diagnosis) -> bool:
    """Return whether a simulation that has physics of its own is the reference."""
    measured = [p.std for f in found.findings for p in f.in_simulation.values()]
    return bool(found.shared) or any(std is not None for std in measured)


def _against_simulation(found: Diagnosis) -> str:
    """Return what the machine has that its simulation has not, and the other way round."""
    both = '; '.join(f'{place(f)}: {effect_name(f)}' for f in found.shared)
    both = f' Both have {both}.' if both else ''
    if found.findings:
        each = [
            f'{place(f)}: {phrase(f)}, in the simulation {", ".join(simulated(f)) or "unknown"} '
            f'(probability {f.probability:.2f})'
            for f in found.findings
        ]
        bodies = f' Bodies differ, too: {parameter_errors_text(found.parameter_errors)}.'
        bodies = bodies if found.parameter_errors else ''
        return f'The machine differs from its simulation {"; ".join(each)}.{bodies}{both}'
    if found.verdict == 'parameters_only':
        return (
            'The machine has the physics of its simulation, only inertial parameters differ '
            f'({certainty_text(found.certainty)}).{both}'
        )
    return (
        'No mismatch: machine and simulation differ by too little to count as missing physics '
        f'({certainty_text(found.certainty)}).{both}'
    )


def simulated(finding: Finding) -> list[str]:
    """Return the parameters that the simulation has."""
    return numbers(replace(finding, parameters=finding.in_simulation))
