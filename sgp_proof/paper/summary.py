"""Tables of many outcomes: mean, median and spread over seeds, and outlying seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sgp_proof.paper.protocol import Outcome
from sgp_ros.gp.kernel import Kernel
from sgp_ros.gp.kernels import Linear

SCORES = ('nmse', 'nmse_measured', 'nlpd', 'coverage95')
EQUAL = 1.15
"""Medians within 15 % count as equal."""
BAD = 10.0
"""A seed is named bad where its nMSE is this many times the median."""


def summarise(outcomes: Mapping[str, Sequence[Outcome]]) -> dict[str, Any]:
    """Return `{METHOD: {REGION: {CHANNEL: {score: {mean, median, std}}}}}` of one experiment.

    Args:
        outcomes: per method, one outcome per seed, in the order of seeds.
    """
    return {
        method: {
            region: {
                channel: {
                    score: _spread(_values(runs, region, channel, score)) for score in SCORES
                }
                for channel in runs[0].scores[region]
            }
            for region in runs[0].scores
        }
        for method, runs in outcomes.items()
    }


def bad_seeds(outcomes: Mapping[str, Sequence[Outcome]]) -> dict[str, list[int]]:
    """Return the seeds whose nMSE is far above the median, per method, region and channel."""
    found = {}
    for method, runs in outcomes.items():
        for region, channels in runs[0].scores.items():
            for channel in channels:
                values = _values(runs, region, channel, 'nmse')
                seeds = np.flatnonzero(values > BAD * np.median(values))
                if len(seeds):
                    found[f'{method} {region} {channel}'] = [int(s) for s in seeds]
    return found


def behind_physics(outcomes: Mapping[str, Sequence[Outcome]]) -> dict[str, list[int]]:
    """Return the seeds in which the nMSE of SGP is not below that of PR, per region, channel."""
    found = {}
    for region, channels in outcomes['SGP'][0].scores.items():
        for channel in channels:
            ours, physics = (_values(outcomes[m], region, channel, 'nmse') for m in ('SGP', 'PR'))
            seeds = np.flatnonzero(ours >= physics)
            if len(seeds):
                found[f'{region} {channel}'] = [int(s) for s in seeds]
    return found


def not_best(outcomes: Mapping[str, Sequence[Outcome]]) -> dict[str, dict[str, Any]]:
    """Return the cells in which the median nMSE of SGP is over 15 % above the best method's."""
    found = {}
    for region, channels in outcomes['SGP'][0].scores.items():
        for channel in channels:
            medians = {
                method: float(np.median(_values(runs, region, channel, 'nmse')))
                for method, runs in outcomes.items()
            }
            best = min(medians, key=lambda method: medians[method])
            if medians['SGP'] > EQUAL * medians[best]:
                found[f'{region} {channel}'] = {
                    'best': best, 'nmse': medians[best], 'nmse_of_sgp': medians['SGP']
                }  # fmt: skip
    return found


def coefficient_errors(outcomes: Mapping[str, Sequence[Outcome]]) -> dict[str, dict[str, Any]]:
    """Return the spread of the absolute relative error of W per method and index."""
    return {
        method: {
            str(i): _spread(np.array([abs(run.errors[i]) for run in runs])) for i in runs[0].errors
        }
        for method, runs in outcomes.items()
        if runs[0].errors
    }


def chosen_inputs(outcomes: Mapping[str, Sequence[Outcome]]) -> dict[str, int]:
    """Return how often each kernel and set of inputs was chosen by evidence."""
    counts: dict[str, int] = {}
    for run in outcomes.get('SGP', ()):
        chosen = ', '.join(_described(kernel) for kernel in run.kernels)
        counts[chosen] = counts.get(chosen, 0) + 1
    return dict(sorted(counts.items(), key=lambda item: -item[1]))


def _described(kernel: Kernel | None) -> str:
    if kernel is None:
        return 'no Z'
    name = 'linear' if isinstance(kernel, Linear) else 'smooth'
    return f'{name} {kernel.inputs}'


def calibration(outcomes: Mapping[str, Sequence[Outcome]]) -> dict[str, dict[str, list[float]]]:
    """Return PIT histograms of ten bins (1 is uniform) per method and region, all channels."""
    found: dict[str, dict[str, list[float]]] = {}
    for method, runs in outcomes.items():
        found[method] = {}
        for region in runs[0].pit:
            values = np.concatenate([run.pit[region].ravel() for run in runs])
            counts, _ = np.histogram(values, bins=10, range=(0.0, 1.0))
            found[method][region] = [float(c) for c in 10.0 * counts / max(len(values), 1)]
    return found


def markdown(title: str, summary: Mapping[str, Any], seeds: int) -> str:
    """Return the table of one experiment: nMSE as mean +- spread (median), NLPD, coverage."""
    lines = [f'## {title}', '', f'{seeds} seeds.', '']
    regions = next(iter(summary.values()))
    for region, channels in regions.items():
        for channel in channels:
            lines += [
                f'### {region}, {channel}',
                '',
                '| method | nMSE mean | median | std | measured nMSE | NLPD | coverage of 95 % |',
                '|---|---|---|---|---|---|---|',
            ]
            for method, found in summary.items():
                cell = found[region][channel]
                nmse, measured = cell['nmse'], cell['nmse_measured']
                lines.append(
                    f'| {method} | {nmse["mean"]:.4g} | {nmse["median"]:.4g} | {nmse["std"]:.3g} '
                    f'| {measured["median"]:.3g} | {cell["nlpd"]["median"]:.3g} '
                    f'| {100 * cell["coverage95"]["mean"]:.1f} % |'
                )
            lines.append('')
    return '\n'.join(lines)


def _values(runs: Sequence[Outcome], region: str, channel: str, score: str) -> np.ndarray:
    return np.array([run.scores[region][channel][score] for run in runs])


def _spread(values: np.ndarray) -> dict[str, float]:
    return {
        'mean': float(values.mean()),
        'median': float(np.median(values)),
        'std': float(values.std()),
    }
