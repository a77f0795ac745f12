"""The numbers of a diagnosis that a reader asks for first, and the share of each joint."""

from __future__ import annotations

import math
from typing import Any

from sgp_ros.diagnosis.result import Diagnosis
from sgp_ros.report.charts import spoken
from sgp_ros.report.diagnosis_proof import recording_name
from sgp_ros.report.diagnosis_text import explained, is_calm, percent, worst_joint
from sgp_ros.report.overlay_charts import motion_card

_WITHOUT_FORCES = ('parameters_only', 'unexplained')
_SHORT = {'less than': '<', 'more than': '>'}


def cards(found: Diagnosis) -> list[dict[str, str]]:
    """Return certainty, the explained share, and errors on held-out data, before and after."""
    shown = []
    if found.certainty is not None:
        label = 'probability that the verdict is right'
        shown.append({'value': f'{found.certainty:.2f}', 'label': label})
    if found.traces.forces or found.verdict in _WITHOUT_FORCES:
        by = {
            'unexplained': 'the final model',
            'parameters_only': 'corrected inertial parameters',
        }.get(found.verdict, 'the finding')
        label = (
            f'of the residual of the nominal robot, in the data learned from, is explained by {by}'
        )
        shown.append({'value': percent(max(explained(found), 0.0)), 'label': label})
    shown += [_effort_card(found, stem) for stem in found.proofs if stem != 'train']
    motion = motion_card(found)
    if motion:
        shown.append(motion)
    for card in shown:
        for word, sign in _SHORT.items():
            card['value'] = card['value'].replace(word, sign)
            card['label'] = card['label'].replace(word, sign)
    return shown


def _effort_card(found: Diagnosis, stem: str) -> dict[str, str]:
    """Return the error of the effort on a held-out recording, in units where these are known."""
    proof = found.proofs[stem]
    joint = worst_joint(proof)
    unit = found.units[found.joints.index(joint)]
    whens = ('before',) if is_calm(found) else ('before', 'after')
    left = [(proof.nmse_before if when == 'before' else proof.nmse_after)[joint] for when in whens]
    shares = ' -> '.join(map(percent, left))
    errors = [proof.rms(f'nmse_{when}').get(joint) for when in whens]
    known = [spoken(x) for x in errors if x is not None]
    on = f'{joint}, {recording_name(stem)}'
    if len(known) < len(whens):
        return {'value': shares, 'label': f'of the variance of the effort is left on {on}'}
    return {
        'value': f'{" -> ".join(known)} {unit}',
        'label': f'rms error of the effort on {on}: {shares} of its variance',
    }


def joint_shares(found: Diagnosis) -> list[tuple[str, float]]:
    """Return the share of each joint of all that the nominal robot leaves."""
    left = found.proofs['train'].nmse_before
    known = {name: x for name, x in left.items() if math.isfinite(x)}
    total = sum(known.values())
    return [(name, known.get(name, 0.0) / total if total else 0.0) for name in found.joints]


def share_rows(found: Diagnosis) -> list[dict[str, Any]]:
    """Return the share of each joint as rows of a table."""
    left = found.proofs['train'].nmse_before
    return [
        {'joint': name, 'share': share, 'percent': percent(share), 'own': percent(left[name])}
        for name, share in joint_shares(found)
    ]
