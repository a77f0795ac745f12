"""How a diagnosis ended, as statuses of /diagnostics: one for the verdict, one for each finding.

A verdict speaks of the recent past of a robot. It is a warning for as long as that past lasted,
and information from then on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sgp_ros.diagnosis.result import Diagnosis
from sgp_ros.recordings.messages import Status
from sgp_ros.ros.verdict import ERROR, OK, WARN

CANCELLED = 'cancelled'
_CALM = 'no_mismatch'
_REMEDY = (
    'Inspect the joint, or correct the robot file: sgp diagnose RECORD writes robot_diagnosed.yaml'
)
_REMEDIES = {
    _CALM: '',
    'setup_error': 'Correct what the robot file or the driver states: signs, gains, units, mount',
    'unexplained': 'Record a longer motion of all joints, and look at it with sgp diagnose RECORD',
}


@dataclass(frozen=True, slots=True)
class DiagnosisDone:
    """A finished diagnosis.

    Attributes:
        content: of diagnosis.json.
        sentence: the verdict in words and numbers.
        phrases: the same for each error of the set-up, then each finding.
    """

    content: Mapping[str, Any]
    sentence: str
    phrases: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class DiagnosisFailed:
    """A diagnosis without a result.

    Attributes:
        reason: one sentence.
    """

    reason: str


def with_sentences(found: Diagnosis) -> DiagnosisDone:
    """Return a diagnosis with its sentences; what they need is loaded here."""
    from sgp_ros.diagnosis.mapping import diagnosis_mapping
    from sgp_ros.report.diagnosis_text import phrase, place
    from sgp_ros.report.verdict import verdict_sentence

    phrases = (f'{place(f)}: {phrase(f)}' for f in (*found.setup, *found.findings))
    return DiagnosisDone(diagnosis_mapping(found), verdict_sentence(found), tuple(phrases))


def outcome_statuses(
    outcome: DiagnosisDone | DiagnosisFailed, name: str, robot: str, *, is_fresh: bool
) -> list[Status]:
    """Return the statuses of an outcome.

    Args:
        outcome: of the last diagnosis.
        name: of the status of the verdict, and beginning of the others.
        robot: that was diagnosed.
        is_fresh: whether what it speaks of is recent, so that it may warn.
    """
    if isinstance(outcome, DiagnosisFailed):
        reason = outcome.reason
        if reason == CANCELLED:
            return [Status(name, OK, reason, robot, {'state': reason})]
        text = f'no diagnosis of {robot}: {reason}; move all joints, then call ~/diagnose again'
        return [Status(name, ERROR if is_fresh else OK, text, robot, {'state': 'failed'})]
    content = outcome.content
    verdict = str(content['verdict'])
    entries = [*content['setup'], *content['findings']]
    values = {
        'state': 'done', 'verdict': verdict, 'findings': str(len(entries)),
        'certainty': 'not stated' if content['certainty'] is None else str(content['certainty']),
    }  # fmt: skip
    level = WARN if is_fresh and verdict != _CALM else OK
    remedy = _REMEDIES.get(verdict, _REMEDY)
    sentence = f'{outcome.sentence} {remedy}'.strip()
    return [
        Status(name, level, sentence, robot, values),
        *(
            Status(f'{name} {place}', level, f'{text}. {remedy}'.strip(), robot, _values(entry))
            for place, text, entry in zip(_places(entries), outcome.phrases, entries, strict=True)
        ),
    ]


def _places(entries: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return effect and joint of each finding, numbered where one effect acts twice on a joint."""
    found: list[str] = []
    for entry in entries:
        twins = sum(
            (e['effect'], e['joint']) == (entry['effect'], entry['joint'])
            for e in entries[: len(found)]
        )
        number = f' {twins + 1}' if twins else ''
        found.append(f'{entry["effect"]}{number} {entry["joint"]}')
    return found


def _values(finding: Mapping[str, Any]) -> dict[str, str]:
    values = {key: str(finding[key]) for key in ('joint', 'effect', 'probability')}
    for parameter, entry in finding['parameters'].items():
        values[parameter] = str(entry['value'])
        values |= {f'{parameter}.{k}': str(entry[k]) for k in ('std', 'unit') if k in entry}
    return values
