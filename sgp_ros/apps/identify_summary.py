"""What `sgp identify` prints: scores per method, parameters, what is not to be trusted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.report.identification import (
    called,
    cautions,
    excitation,
    filter_choice,
    unknown,
    verdict,
)


def print_findings(findings: Mapping[str, Any]) -> None:
    """Print scores per method, parameters with 95 % intervals, and what is not to be trusted."""
    print(verdict(findings))
    print(filter_choice(findings['filter']))
    _print_scores(findings)
    _print_rollouts(findings)
    print('\nparameters of the physics, with 95 % intervals:')
    width = max((len(p['name']) for p in findings['parameters']), default=0)
    for p in findings['parameters']:
        known = unknown(p['status'])
        if p['std'] is not None:
            known = f'{p["value"]:12.5g} +- {INTERVAL_95 * p["std"]:<9.3g} {p["unit"]}'
        print(f'  {p["name"]:{width}s} {known}')
    print(excitation(findings['excitation']))
    for text in findings['excitation']['suggestions']:
        print(f'a motion that would show more: {text}')
    for text in cautions(findings):
        print(f'caution: {text}')


def _print_scores(findings: Mapping[str, Any]) -> None:
    units = findings['units'][findings['target']]
    for name in findings['held_out']:
        print(f'\n{findings["target"]} in {called(name)}, not learned from: nMSE (rms error)')
        for method, scores in findings['scores'].items():
            each = '   '.join(
                f'{joint} {_short(s["nmse"])} ({_short(s["rmse"])} {units[joint]})'
                for joint, s in scores[name].get('joints', {}).items()
            )
            print(f'  {method:4s} {each or "asks for parameters that are not determined"}')


def _print_rollouts(findings: Mapping[str, Any]) -> None:
    units = findings['units']['position']
    for name, all_ in findings['rollouts'].items():
        print(f'\nposition in {called(name)}, simulated from measured efforts: nMSE (rms error)')
        for score in all_:
            each = '   '.join(
                f'{joint} {_short(s["nmse_end"])} ({_short(s["rms_end"])} {units[joint]})'
                for joint, s in score['joints'].items()
            )
            lost = f'   {score["diverged"]} of {score["n"]} diverged' if score['diverged'] else ''
            print(f'  after {score["horizon_s"]:.3g} s: {each}{lost}')


def _short(x: float | None) -> str:
    return 'none' if x is None else f'{x:.3g}'
