"""Results of an identification, as data for JSON: `identification.json`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sgp_ros.batch.blocks import distance_to
from sgp_ros.batch.excitation import IDENTIFIABLE
from sgp_ros.batch.fit import OfflineFit
from sgp_ros.batch.identification import Identification
from sgp_ros.batch.regression_data import FilteredData
from sgp_ros.batch.rollout_scores import RolloutScore
from sgp_ros.errors import NumericalError
from sgp_ros.gp.scores import coverage95, nlpd
from sgp_ros.report.metrics import versions

SCHEMA = 1


def collect_findings(
    found: Identification,
    recording: str,
    rollouts: Mapping[str, tuple[RolloutScore, ...]],
    counts: Mapping[str, Any],
    remarks: Sequence[str] = (),
) -> dict[str, Any]:
    """Return all numbers of an identification.

    Args:
        found: the identification.
        recording: name of the recording.
        rollouts: by name of the recording, one score per horizon.
        counts: states and commands read and refused.
        remarks: on the recordings.

    Raises:
        NumericalError: numbers so large that no error of them is finite.
    """
    names = found.robot.joint_names
    regions = _regions(found)
    return {
        'schema': SCHEMA,
        'robot': found.robot.name,
        'recording': recording,
        'joints': list(names),
        'target': found.robot.target,
        'units': {
            channel: {joint.name: joint.unit(channel) for joint in found.robot.joints}
            for channel in ('position', found.robot.target)
        },
        'held_out': list(found.held),
        'counts': dict(counts),
        'remarks': list(remarks),
        'filter': _filter(found),
        'rows': {name: len(data.time) for name, data in regions.items()},
        'scores': {
            method: {name: _scores(fit, data, names) for name, data in regions.items()}
            for method, fit in found.fits.items()
        },
        'noise': {
            method: dict(zip(names, (math.sqrt(x) for x in fit.model.noise), strict=True))
            for method, fit in found.fits.items()
        },
        'inputs': None if found.inputs is None else [list(n) for n in found.inputs.names],
        'parameters': _parameters(found),
        'base_parameters': _base_parameters(found),
        'excitation': _excitation(found),
        'consistency': _consistency(found),
        'rollouts': {
            name: [_rollout(score, names) for score in scores] for name, scores in rollouts.items()
        },
        'versions': versions(),
    }  # fmt: skip


def _regions(found: Identification) -> dict[str, FilteredData]:
    """Return training data, held-out data, and the near and far halves of these."""
    regions = {'train': found.train, **found.held}
    for name, data in found.held.items():
        is_far = far_half(found.train, data)
        regions[f'{name}, near'] = data.rows(~is_far)
        regions[f'{name}, far'] = data.rows(is_far)
    return regions


def _excitation(found: Identification) -> dict[str, Any]:
    excited = found.excitation.excited
    return {
        'rank': excited.rank,
        'structural_rank': found.excitation.structural.rank,
        'condition': excited.condition,
        'tolerance': excited.tolerance,
        'not_excited': list(found.excitation.unexcited),
        'suggestions': [s.text for s in found.suggestions],
    }


def far_half(train: FilteredData, data: FilteredData) -> np.ndarray:
    """Say which rows belong to the half that lies further from `train`, (n,) of bool.

    The halves differ by one row at most, also where distances are equal.
    """
    order = np.argsort(distance_to(train, data), kind='stable')
    is_far = np.zeros(len(order), dtype=bool)
    is_far[order[(len(order) + 1) // 2 :]] = True
    return is_far


def _consistency(found: Identification) -> dict[str, Any] | None:
    if found.consistent is not None:
        return {
            'was_consistent': found.consistent.was_consistent,
            'distance': found.consistent.distance,
        }
    has_bodies = any(c.name.endswith('.mass') for c in found.robot.coefficients)
    return {'was_consistent': False, 'distance': None} if has_bodies else None


def _filter(found: Identification) -> dict[str, Any]:
    choice = found.choice
    finite = [c for c in choice.candidates if math.isfinite(c.regret) and math.isfinite(c.error)]
    if choice.candidates and not finite:
        raise NumericalError(
            f'{found.robot.name}: no low-pass leaves a finite error', 'numbers that a robot has',
            'check the units of the recording',
        )  # fmt: skip
    return {
        'cutoff_hz': choice.plan.cutoff,
        'state_cutoff_hz': choice.plan.state_cutoff,
        'decimation': choice.plan.decimation,
        'rate_hz': found.data.rate,
        'velocity_source': choice.plan.velocity_source,
        'residual_autocorrelation': choice.autocorrelation,
        'is_white': choice.is_white,
        'candidates': [
            {
                'cutoff_hz': c.plan.cutoff,
                'velocity_source': c.plan.velocity_source,
                'rows': c.rows,
                'autocorrelation': c.autocorrelation,
                'regret': c.regret,
                'error': c.error,
            }
            for c in finite
        ],
    }


def _scores(fit: OfflineFit, data: FilteredData, names: tuple[str, ...]) -> dict[str, Any]:
    """Return scores per joint, their mean, and the share of all squared error.

    `stacked` is the sum of the joints' squared errors over the sum of their variances. What is
    constant, such as the effort of a passive joint, has no nMSE.
    """
    if not len(data.time):
        return {'n': 0, 'unknown': 0}
    mean, variance = fit.predict(data)
    known = np.isfinite(variance).all(axis=1)
    y, mean, variance = data.y[known], mean[known], variance[known]
    if not len(y):
        return {'n': 0, 'unknown': len(known)}
    squares, spread = ((y - mean) ** 2).mean(axis=0), y.var(axis=0)
    errors = np.divide(squares, spread, out=np.full_like(squares, np.nan), where=spread > 0.0)
    each = zip(
        names, errors, nlpd(y, mean, variance), coverage95(y, mean, variance), np.sqrt(squares),
        strict=True,
    )  # fmt: skip
    varies, power = spread > 0.0, (y**2).sum()
    return {
        'joints': {
            name: {
                'nmse': _finite(e),
                'nlpd': float(p),
                'coverage95': float(c),
                'rmse': float(r),
            }
            for name, e, p, c, r in each
        },
        'mean_nmse': float(errors[varies].mean()) if varies.any() else None,
        'stacked_nmse': float(squares.sum() / spread.sum()) if varies.any() else None,
        'relative_error': float(np.sqrt(((y - mean) ** 2).sum() / power)) if power else None,
        'n': len(y),
        'unknown': int((~known).sum()),
    }


def _parameters(found: Identification) -> list[dict[str, Any]]:
    physics, sgp = found.physics.coefficients, found.fits.get('SGP')
    beside = None if sgp is None else sgp.coefficients
    rows = []
    for i, c in enumerate(found.robot.coefficients):
        is_known = found.excitation.status[i] == IDENTIFIABLE and bool(physics.is_identifiable[i])
        row: dict[str, Any] = {
            'name': c.name,
            'meaning': c.meaning,
            'joint': c.joint,
            'value': float(physics.mean[i]),
            'std': float(physics.std[i]) if is_known else None,
            'unit': c.unit,
            'identifiable': is_known,
            'status': found.excitation.status[i],
        }
        if beside is not None and is_known:
            row['beside_z'] = {'value': float(beside.mean[i]), 'std': _finite(beside.std[i])}
        if found.consistent is not None:
            row['consistent'] = float(found.consistent.coefficients[i])
        rows.append(row)
    return rows


def _base_parameters(found: Identification) -> list[dict[str, Any]]:
    base, physics = found.excitation.excited, found.physics.coefficients
    values = base.combinations @ physics.mean
    spread = np.einsum('rp,pq,rq->r', base.combinations, physics.covariance, base.combinations)
    return [
        {'text': text, 'value': float(value), 'std': math.sqrt(max(float(variance), 0.0))}
        for text, value, variance in zip(base.texts, values, spread, strict=True)
    ]


def _rollout(score: RolloutScore, names: tuple[str, ...]) -> dict[str, Any]:
    return {
        'horizon_s': score.horizon,
        'n': score.n,
        'diverged': score.diverged,
        'joints': {
            name: {
                key: _finite(getattr(score, key)[j])
                for key in ('nmse_end', 'nmse_path', 'rms_end', 'rms_path')
            }
            for j, name in enumerate(names)
        },
    }


def _finite(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None
