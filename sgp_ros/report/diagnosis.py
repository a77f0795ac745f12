"""The page of a diagnosis, which opens with the finding in one sentence."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from sgp_ros.diagnosis.prove.held_out import HELD_OUT
from sgp_ros.diagnosis.result import Diagnosis, Finding, ParameterError
from sgp_ros.diagnosis.shown import Predictions
from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.report.diagnosis_figures import draw_diagnosis
from sgp_ros.report.diagnosis_maps import band_sentences, important_joints
from sgp_ros.report.diagnosis_proof import densities, near_and_far, proof_rows, rollouts_sentences
from sgp_ros.report.diagnosis_text import (
    differences_text,
    effect_name,
    equivalence_sentence,
    explained,
    numbers,
    percent,
    place,
    quantity,
    visibility_sentences,
    why_it_lost,
    worst_joint,
)
from sgp_ros.report.figures import png
from sgp_ros.report.files import write_bytes, write_text
from sgp_ros.report.html import MEANINGS, embedded
from sgp_ros.report.metrics import versions
from sgp_ros.report.verdict import held_out_sentence, verdict_sentence

_NAMED = ('kind', 'source_joint')
"""Parameters that are part of the name of an effect."""
_SHOWN_RIVALS = 4
"""Effects that change what is measured, not the motion."""
_WITHOUT_FORCES = ('parameters_only', 'unexplained')
_VERDICTS = {
    'missing_physics': 'Physics is missing',
    'parameters_only': 'Only parameters are wrong',
    'no_mismatch': 'No mismatch',
    'unexplained': 'Unexplained',
    'setup_error': 'Connected wrongly',
}


def write_diagnosis(out: Path, found: Diagnosis) -> None:
    """Write `report.html` and its figures as PNG into `out`."""
    figures = {name: png(figure) for name, figure in draw_diagnosis(found).items()}
    for name, content in figures.items():
        write_bytes(out / f'{name}.png', content)
    write_text(out / 'report.html', render(found, figures))


def render(found: Diagnosis, figures: Mapping[str, bytes]) -> str:
    """Return the page as HTML; every text in it is escaped."""
    environment = Environment(
        loader=PackageLoader('sgp_ros.report'), autoescape=True, undefined=StrictUndefined
    )
    best = found.findings[0] if found.findings else None
    large = [found.joints[j] for j in important_joints(found)]
    return environment.get_template('diagnosis.html').render(
        title=f'{_VERDICTS[found.verdict]}: diagnosis of {found.robot}',
        verdict=_typeset(verdict_sentence(found)),
        held_out='' if len(found.proofs) > 1 else held_out_sentence(found),
        cards=_cards(found),
        large=', '.join(large),
        regions=band_sentences(found, large),
        others=', '.join(name for name in found.joints if name not in large),
        is_calm=found.verdict == 'no_mismatch',
        findings=[_finding(f) for f in found.findings],
        rivals=[_rival(f, best) for f in found.alternatives[:_SHOWN_RIVALS]],
        more_rivals=[_rival(f, best) for f in found.alternatives[_SHOWN_RIVALS:]],
        differences=[_typeset(line) for line in differences_text(found)],
        equivalents=[equivalence_sentence(e) for e in found.equivalents],
        hidden=visibility_sentences(found),
        is_unexplained=found.verdict == 'unexplained',
        errors=[_error(e) for e in found.parameter_errors],
        proofs=proof_rows(found),
        has_rollouts=any(p.rollout_before for p in found.proofs.values()),
        rollouts=rollouts_sentences(found),
        near_and_far=near_and_far(found),
        densities=densities(found),
        figures={name: embedded({name: content}, ('',))[0] for name, content in figures.items()},
        settings=_settings(found),
        refusals=[
            {'reason': reason, 'count': count, 'meaning': MEANINGS.get(reason, '')}
            for reason, count in found.refused.items()
            if count
        ],
        remarks=list(found.remarks),
        versions=list(versions().items()),
    )  # fmt: skip


def _cards(found: Diagnosis) -> list[dict[str, str]]:
    """Return the numbers that a reader asks for first."""
    cards = [{'value': f'{found.certainty:.2f}', 'label': 'probability that the verdict is right'}]
    is_calm = found.verdict == 'no_mismatch'
    if found.traces.forces or found.verdict in _WITHOUT_FORCES:
        by = (
            'a learned correction, not by a law'
            if found.verdict == 'unexplained'
            else 'the finding'
        )
        label = f'of what the nominal robot leaves is explained by {by}'
        cards.append({'value': percent(explained(found)), 'label': label})
    for stem, proof in found.proofs.items():
        if stem != 'train':
            joint = worst_joint(proof)
            before, after = percent(proof.nmse_before[joint]), percent(proof.nmse_after[joint])
            value = before if is_calm else f'{before} → {after}'
            held = 'what was held out' if stem == HELD_OUT else f'{stem}, held out'
            label = f'of the variance of the effort of {joint} is left on {held}'
            cards.append({'value': value, 'label': label})
    short = {'less than': '<', 'more than': '>'}
    for card in cards:
        for word, sign in short.items():
            card['value'] = card['value'].replace(word, sign)
    return cards


def _finding(f: Finding) -> dict[str, Any]:
    return {
        'name': effect_name(f),
        'place': place(f),
        'probability': f'{f.probability:.2f}',
        'share': f'{percent(f.share)} of the '
        + (
            'variance of the velocity'
            if f.effect in EFFECTS and not EFFECTS[f.effect].is_force
            else 'mean squared effort'
        ),
        'formula': f.formula,
        'why': f.why[:1].upper() + f.why[1:],
        'parameters': [
            {'name': name.replace('_', ' '), 'value': _typeset(quantity(p))}
            for name, p in f.parameters.items()
            if name not in _NAMED
        ],
        'where': [
            f'{name} from {lo:.3g} to {hi:.3g}'
            for name, intervals in f.location.intervals.items()
            for lo, hi in intervals
        ]
        + [f'time from {lo:.3g} s to {hi:.3g} s' for lo, hi in f.location.time],
    }


def _rival(f: Finding, best: Finding | None) -> dict[str, str]:
    is_rated = best is not None and best.effect != 'unknown'
    return {
        'name': effect_name(f),
        'joint': f.joint,
        'numbers': ', '.join(numbers(f)),
        'probability': f'{f.probability:.2f}' if f.probability >= 0.005 else '< 0.01',
        'why': why_it_lost(f, best if is_rated else None),
    }


def _error(e: ParameterError) -> dict[str, str]:
    half = INTERVAL_95 * e.std
    return {
        'name': f'{e.parameter.replace("_", " ")} of {e.link}',
        'value': f'{e.value:.4g}',
        'interval': f'{e.value - half:.4g} to {e.value + half:.4g}',
        'nominal': f'{e.nominal:.4g}',
        'unit': e.unit,
    }


def _settings(found: Diagnosis) -> list[tuple[str, str]]:
    settings = [
        ('robot', found.robot),
        ('joints', ', '.join(found.joints)),
        ('cut-off of the low-pass', f'{found.cutoff_hz:.3g} Hz'),
        ('rows', f'{found.rows}, at {found.rate_hz:.3g} Hz'),
    ]
    if found.simulation:
        shares = ', '.join(f'{joint} {percent(x)}' for joint, x in found.simulation.items())
        settings.append(('left of the effort of the simulation', shares))
    return settings


def _typeset(text: str) -> str:
    return text.replace('+-', '±')


def write_predictions(folder: Path, found: Diagnosis) -> None:
    """Write `pred_<stem>.csv` for each held-out recording."""
    for stem, prediction in found.predictions.items():
        write_text(folder / f'pred_{stem}.csv', _predictions_table(found.joints, prediction))


def _predictions_table(joints: tuple[str, ...], prediction: Predictions) -> str:
    lines = [','.join(['t', *(f'ddq_{name}' for name in joints)])]
    for t, row in zip(prediction.time, prediction.acceleration, strict=True):
        lines.append(','.join([f'{t:.6f}', *(f'{x:.7g}' for x in row)]))
    return '\n'.join(lines) + '\n'
