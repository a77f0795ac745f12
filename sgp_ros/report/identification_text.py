"""Results of an identification in plain sentences, for the terminal and its page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sgp_ros.batch.identification import HELD_OUT

_UNREAL = 0.01
"""Standard deviations to the nearest real bodies that are worth a word."""
_CORRELATED = 0.2
"""Correlation from row to row that is worth a word: the filter alone leaves some tenth."""


def called(name: str) -> str:
    """Return a name of held-out data as it stands in a sentence."""
    return 'the held-out part' if name == HELD_OUT else name


def drawn(scores: Mapping[str, Any]) -> str:
    """Return the method that speaks for the identification, from `scores` by method."""
    return 'SGP' if 'SGP' in scores else next(iter(scores))


def verdict(findings: Mapping[str, Any]) -> str:
    """Say how well what was held out is predicted, and what Z adds."""
    parts = []
    for name in findings['held_out']:
        scores = {m: s[name].get('mean_nmse') for m, s in findings['scores'].items()}
        sgp, physics = scores.get('SGP'), scores.get('PR')
        best = sgp if sgp is not None else next(iter(scores.values()))
        if best is None:
            parts.append(f'nothing of {called(name)}: it needs parameters that are not determined')
            continue
        text = f'the {findings["target"]} in {called(name)} with a mean nMSE of {best:.2g}'
        if sgp is not None and physics is not None:
            text += f' (physics alone {physics:.2g})'
        parts.append(text)
    scale = ' 0 is perfect, 1 no better than a constant.'
    return 'The model predicts ' + '; '.join(parts) + '.' + scale + _learned(findings['inputs'])


def _learned(inputs: Sequence[Sequence[str]] | None) -> str:
    if inputs is None or any(inputs):
        return ''
    return ' A learned process Z beside the physics would not predict better.'


def cautions(findings: Mapping[str, Any]) -> list[str]:
    """Say what is not to be trusted, and why."""
    found = []
    plan = findings['filter']
    rows = [c['rows'] for c in plan['candidates'] if c['cutoff_hz'] == plan['cutoff_hz']]
    by_chance = max(_CORRELATED, 3.0 / max(rows, default=1) ** 0.5)  # white noise has the latter
    if not plan['is_white'] and plan['residual_autocorrelation'] > by_chance:
        found.append(
            'The residual of the physics is not white (correlation '
            f'{plan["residual_autocorrelation"]:.2f} from row to row): physics is missing, or the '
            'noise is coloured. The intervals of the parameters allow for this correlation, but '
            'not for a bias.'
        )
    narrow = [
        f'{joint} ({100 * score["coverage95"]:.0f} %)'
        for name, scores in findings['scores'].get('SGP', {}).items()
        if name in findings['held_out']
        for joint, score in scores.get('joints', {}).items()
        if score['coverage95'] < 0.9
    ]
    if narrow:
        found.append(f'Intervals of SGP are too narrow on held-out data: {", ".join(narrow)}.')
    if _is_unreal(findings['consistency']):
        found.append(
            'The fitted parameters are physically impossible: a mass or inertia is not positive, '
            'or a friction coefficient is negative. '
            + _nearest(findings['consistency']['distance'])
        )
    return found


def _is_unreal(consistency: Mapping[str, Any] | None) -> bool:
    """Return whether no real bodies have the fitted parameters, by more than what counts."""
    if not consistency or consistency['was_consistent']:
        return False
    distance = consistency['distance']
    return distance is None or float(distance) ** 0.5 > _UNREAL


def _nearest(distance: float | None) -> str:
    if distance is None:
        return 'None was found near them, so no URDF is written: record more motion.'
    return f'The nearest possible ones are {distance**0.5:.2g} standard deviations away.'


def excitation(found: Mapping[str, Any]) -> str:
    """Say how many combinations of parameters the motion determines."""
    text = (
        f'This motion determines {found["rank"]} combinations of parameters, of '
        f'{found["structural_rank"]} that some motion could show. Condition number: '
        f'{found["condition"]:.3g}.'
    )
    if found['not_excited']:
        text += ' Not determined: ' + '; '.join(found['not_excited']) + '.'
    return text


def filter_choice(plan: Mapping[str, Any]) -> str:
    """Say which filter was chosen."""
    taken = 'as measured' if plan['velocity_source'] == 'measured' else 'from the position'
    return (
        'Both sides of the equation of motion were filtered by a zero-phase low-pass of '
        f'{plan["cutoff_hz"]:g} Hz; {plan["rate_hz"]:.3g} rows per second were kept. '
        f'The velocity was taken {taken}.'
    )


def filter_sentence(plan: Mapping[str, Any]) -> str:
    """Say which filter was chosen and why."""
    text = filter_choice(plan)
    if len({c['velocity_source'] for c in plan['candidates']}) > 1:
        text += ' This predicted held-out data better than the alternative.'
    return text + (
        ' The curve shows the prediction loss of each cut-off on held-out stretches, summed over '
        'all bands; the smallest was chosen.'
    )


def unknown(status: str) -> str:
    """Say why a parameter has no value."""
    if status == 'structural':
        return 'known only in combination with others'
    return 'not determined by this motion'
