"""A diagnosis as the content of diagnosis.json."""

from __future__ import annotations

import math
from typing import Any

from sgp_ros.diagnosis.prove.rollouts import HORIZON_S
from sgp_ros.diagnosis.result import Diagnosis, Difference, Finding, Parameter, Proof
from sgp_ros.diagnosis.shown import LawSearch


def diagnosis_mapping(found: Diagnosis) -> dict[str, Any]:
    """Return the content of diagnosis.json; no number is infinite or NaN."""
    fit: dict[str, Any] = {'target': 'torque'}
    fit |= {stem: _proof(proof) for stem, proof in found.proofs.items()}
    fit['predictions'] = {stem: f'pred_{stem}.csv' for stem in found.predictions}
    return {
        'schema': 2,
        'verdict': found.verdict,
        'certainty': found.certainty,
        'reference': found.reference,
        'setup': [finding_content(f) for f in found.setup],
        'shared': [finding_content(f) for f in found.shared],
        'findings': [finding_content(f) for f in found.findings],
        'alternatives': [finding_content(f) for f in found.alternatives],
        'equivalents': [
            {'effects': [{'joint': joint, 'effect': effect} for joint, effect in e.effects],
             'separating_motion': e.motion, 'contrast': _finite(e.contrast)}
            for e in found.equivalents
        ],
        'recordings': [_difference(d) for d in found.differences],
        'parameter_errors': [
            {
                'link': e.link, 'parameter': e.parameter, 'value': _finite(e.value),
                'std': _finite(e.std), 'nominal': _finite(e.nominal), 'unit': e.unit,
            }
            for e in found.parameter_errors
        ],
        'visibility': _visibility(found),
        'law_search': [_law_search(s) for s in found.law_searches],
        'fit': fit,
        'simulation': {name: _finite(x) for name, x in found.simulation.items()},
        'dependence': [
            {'joint': d.joint, 'share': _finite(d.share),
             'scores': {k: _finite(v) for k, v in d.scores.items()},
             'p_value': {k: _finite(v) for k, v in d.p_values.items()},
             'regions': {b.variable: [list(ends) for ends in b.regions]
                         for b in found.bands if b.joint == d.joint}}
            for d in found.dependences
        ],
        'settings': {
            'robot': found.robot, 'joints': list(found.joints), 'cutoff_hz': found.cutoff_hz,
            'rate_hz': found.rate_hz, 'rows': found.rows, 'refused': dict(found.refused),
            'remarks': list(found.remarks),
        },
    }  # fmt: skip


def _difference(d: Difference) -> dict[str, Any]:
    return {
        'recording': d.recording, 'effect': d.effect, 'joint': d.joint,
        'parameters': {name: _parameter(p) for name, p in d.parameters.items()},
        'difference': {name: _parameter(p) for name, p in d.difference.items()},
        'probability': _finite(d.probability), 'share': _finite(d.share),
    }  # fmt: skip


def _law_search(s: LawSearch) -> dict[str, Any]:
    return {
        'joint': s.joint, 'words': s.words, 'is_asserted': not s.why_not, 'why_not': s.why_not,
        'left': _finite(s.left), 'left_by_listed': _finite(s.left_listed),
        'shape': {
            'variable': s.variable, 'unit': s.unit, 'factor': s.factor, 'force_unit': s.force_unit,
            **{name: [_finite(x) for x in values]
               for name, values in (('x', s.x), ('mean', s.mean), ('half_band', s.half))},
        },
        'beyond_x': [_finite(x) for x in s.beyond_x],
        'formulas': [
            {'formula': t.formula, 'nearest': t.words, 'left': _finite(t.left),
             'fits_as_well': t.is_alike, 'beyond': [_finite(x) for x in t.beyond],
             'parameters': {name: {'value': _finite(x), 'unit': unit}
                            for name, (x, unit) in t.parameters.items()}}
            for t in s.formulas
        ],
    }  # fmt: skip


def _visibility(found: Diagnosis) -> list[dict[str, Any]]:
    return [
        {'joint': joint, 'effect': effect, 'parameter': name, **_parameter(p)}
        for (joint, effect, name), p in found.visibility.items()
    ]


def finding_content(f: Finding) -> dict[str, Any]:
    """Return a finding as JSON holds it."""
    return {
        'joint': f.joint,
        'effect': f.effect,
        'parameters': {name: _parameter(p) for name, p in f.parameters.items()},
        'location': {
            'variables': list(f.location.variables),
            'intervals': {k: [list(i) for i in v] for k, v in f.location.intervals.items()},
            'time': [list(i) for i in f.location.time],
        },
        'log_bayes_factor': _finite(f.log_bayes_factor),
        'probability': _finite(f.probability),
        'share': _finite(f.share),
        'formula': f.formula,
        'why': f.why,
        **{
            side: {name: _parameter(p) for name, p in numbers.items()}
            for side, numbers in (('in_simulation', f.in_simulation), ('difference', f.difference))
            if numbers
        },
    }


def _parameter(p: Parameter) -> dict[str, Any]:
    if isinstance(p.value, str):
        return {'value': p.value}
    entry: dict[str, Any] = {'value': _finite(p.value)}
    if p.std is not None and math.isfinite(p.std):
        entry['std'] = p.std
    return entry | {'unit': p.unit}


def _proof(p: Proof) -> dict[str, Any]:
    entry: dict[str, Any] = {}
    for name, table in p.errors().items():
        entry[name] = {joint: _finite(x) for joint, x in table.items()}
        intervals = p.intervals.get(name, {})
        entry[f'{name}_interval'] = {joint: _ends(x) for joint, x in intervals.items()}
        entry[name.replace('nmse', 'rms')] = {j: _finite(x) for j, x in p.rms(name).items()}
    for name, value, interval in zip(
        ('nlpd_before', 'nlpd_after'), (p.nlpd_before, p.nlpd_after), p.nlpd_intervals, strict=True
    ):
        entry[name] = _finite(value)
        entry[f'{name}_interval'] = None if interval is None else _ends(interval)
    counts = {'windows': p.rollouts, 'failed': p.failed, 'horizon_s': HORIZON_S}
    return entry | {'rollouts': counts, 'distance_from_train': _finite(p.distance)}


def _ends(interval: tuple[float, float]) -> list[float | None]:
    return [_finite(x) for x in interval]


def _finite(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None
