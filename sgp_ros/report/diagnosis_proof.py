"""The proof of a diagnosis as rows and sentences: before and after, near and far."""

from __future__ import annotations

import math

from sgp_ros.diagnosis.prove.held_out import HELD_OUT
from sgp_ros.diagnosis.prove.rollouts import HORIZON_S
from sgp_ros.diagnosis.result import Diagnosis, Proof

_NAMES = {'train': 'learned from', HELD_OUT: 'the part held out'}


def recording_name(stem: str) -> str:
    """Return what a page calls a recording."""
    return _NAMES.get(stem, stem)


def proof_rows(found: Diagnosis) -> list[dict[str, object]]:
    """Return a row for each recording and joint: its name and six numbers with intervals."""
    return [
        {
            'stem': recording_name(stem),
            'joint': joint,
            'cells': [
                {
                    'value': _short(table[joint]) if joint in table else '',
                    'interval': interval_text(proof, name, joint),
                }
                for name, table in proof.errors().items()
            ],
        }
        for stem, proof in found.proofs.items()
        for joint in found.joints
    ]


def columns(found: Diagnosis) -> list[str]:
    """Return the errors that a table has columns for, with units."""
    length = '/'.join(dict.fromkeys('m' if unit == 'N' else 'rad' for unit in found.units))
    named = {
        'nmse_before': f'effort [{"/".join(dict.fromkeys(found.units))}]',
        'acceleration_nmse_before': f'acceleration [{length}/s²]',
        'rollout_nmse_before': f'roll-outs of {HORIZON_S:g} s [{length}]',
    }
    return [
        text
        for name, text in named.items()
        if any(p.errors()[name] for p in found.proofs.values())
    ]


def errors_in_units(found: Diagnosis) -> list[dict[str, object]]:
    """Return a row for each recording and joint: its name and root mean square errors."""
    rows: list[dict[str, object]] = []
    for stem, proof in found.proofs.items():
        tables = [proof.rms(name) for name in proof.errors()][: 2 * len(columns(found))]
        rows += [
            {'stem': recording_name(stem), 'joint': joint,
             'cells': [f'{t[joint]:.3g}' if joint in t else '' for t in tables]}
            for joint in found.joints
        ]  # fmt: skip
    return rows


def interval_text(proof: Proof, name: str, joint: str) -> str:
    """Return the 95 % interval of an error as `0.1 to 0.2`; empty where there is none."""
    interval = proof.intervals.get(name, {}).get(joint)
    if interval is None or not all(map(math.isfinite, interval)):
        return ''
    return f'{_short(interval[0])} to {_short(interval[1])}'


def densities(found: Diagnosis) -> list[dict[str, str]]:
    """Return the negative log predictive density of the effort by recording [nats]."""
    return [
        {
            'stem': recording_name(stem),
            'before': _nats(proof.nlpd_before, proof.nlpd_intervals[0]),
            'after': _nats(proof.nlpd_after, proof.nlpd_intervals[1]),
        }
        for stem, proof in found.proofs.items()
    ]


def near_and_far(found: Diagnosis) -> str:
    """Say how far the recordings held out lie from what was learned; empty without any."""
    held = {stem: p for stem, p in found.proofs.items() if stem != 'train'}
    if not held:
        return ''
    parts = [
        f'{recording_name(stem)} {p.distance:.2g}'
        for stem, p in sorted(held.items(), key=lambda item: item[1].distance)
    ]
    return (
        'Median distance of the states from the nearest state learned from, in standard '
        f'deviations per coordinate: {", ".join(parts)}.'
    )


def rollouts_sentences(found: Diagnosis) -> str:
    """Explain roll-outs, how they end far from the training data, and how many were left out.

    Empty where none were made.
    """
    made = {stem: p for stem, p in found.proofs.items() if p.rollout_before}
    if not made:
        return ''
    parts = [
        f'{recording_name(stem)} {p.rollouts}'
        + (f' ({p.failed} left out, as one of the models diverged)' if p.failed else '')
        for stem, p in made.items()
    ]
    stem, far = max(made.items(), key=lambda item: item[1].distance)
    joint = max(far.rollout_before, key=lambda name: far.rollout_before[name])
    misses = [_way(table[joint]) for table in (far.rollout_before, far.rollout_after)]
    on = 'On what was learned from' if stem == 'train' else f'On {recording_name(stem)}'
    return (
        f'Roll-outs start from measured states and last {HORIZON_S:g} s under the recorded '
        'commands; 1 is the error of staying at the start position, and a model that is '
        f'worse exceeds it. {on}, the rms error of {joint} is {misses[0]} its travel for the '
        f'nominal robot and {misses[1]} it for the diagnosed robot. '
        f'Number of roll-outs: {", ".join(parts)}.'
    )


def _way(nmse: float) -> str:
    """Return the root of an error as a share of the way, or as a multiple of it."""
    share = math.sqrt(nmse)
    return f'{100.0 * share:.2g} % of' if share < 0.995 else f'{share:.3g} times'


def _nats(value: float, interval: tuple[float, float] | None) -> str:
    text = f'{value:.3g}'
    return text if interval is None else f'{text} ({interval[0]:.3g} to {interval[1]:.3g})'


def _short(x: float) -> str:
    return f'{x:.2g}'
