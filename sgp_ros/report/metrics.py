"""The numbers of a run in the form of `metrics.json`."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from sgp_ros import __version__
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.results import Counts, ParameterEstimate, Score
from sgp_ros.robots.nominal import nominal_model

SCHEMA = 1
_PACKAGES = ('numpy', 'scipy', 'numba')


@dataclass(slots=True)
class Timing:
    """Times of a run.

    Attributes:
        push_s: duration of every push [s].
        wall_s: of the whole run [s].
        recorded_s: length of the recording [s].
    """

    push_s: list[float] = field(default_factory=list)
    wall_s: float = 0.0
    recorded_s: float = 0.0


def collect_metrics(
    engine: Engine,
    recording: str,
    *,
    timing: Timing,
    seed: int | None = None,
    remarks: Sequence[str] = (),
) -> dict[str, Any]:
    """Return the metrics of a finished run; a quantity the robot does not have is absent."""
    counts = engine.counts
    baseline = engine.baseline_scores()
    meanings = {c.name: c.meaning for c in engine.robot.coefficients}
    return {
        'schema': SCHEMA,
        'robot': engine.robot.name,
        'recording': recording,
        'seed': seed,
        **_stream(counts),
        'joints': {
            joint: {channel: _score(score) for channel, score in channels.items()}
            for joint, channels in engine.scores().items()
        },
        'physics_alone': {
            joint: {channel: _score(score) for channel, score in channels.items()}
            for joint, channels in baseline.items()
            if channels
        },
        'process_weight': _weights(engine),
        'parameters': [_parameter(p, meanings) for p in engine.parameters()],
        'physics_parameters': [_parameter(p, meanings) for p in engine.physics_parameters()],
        **_learning(counts),
        'timing': _timing(timing),
        'delay_s': engine.delay_s,
        'settings': {k: _plain(v) for k, v in engine.config.to_mapping().items()},
        'versions': versions(),
        'remarks': list(remarks),
    }  # fmt: skip


def model_remarks(engine: Engine, asked: EngineConfig) -> list[str]:
    """Return what a reader of the scores must know of the filter and of the model.

    Args:
        engine: after the recording.
        asked: the settings that it began with.
    """
    remarks, robot = [], engine.robot
    if asked.filter_window < 0.0:
        config = engine.config
        remarks.append(
            f'filter.window = {config.filter_window:g} s and filter.velocity = '
            f'{config.filter_velocity} were chosen from the first seconds'
        )
    if robot.source.get('effects'):
        effects = nominal_model(robot).effects
        left_out = [f'{e.name} of {e.joint}' for e in effects if not e.effect.is_online]
        held = sorted({e.joint for e in effects if e.is_holding})
        if held:
            counts = engine.counts
            remarks.append(
                f'dry friction can hold {", ".join(held)} at rest, where the motion does not '
                f'determine the effort: {counts.held} of {counts.estimated} equations are not '
                'scored for the joint at rest, and a model with Z does not learn from them'
            )
        if left_out:
            remarks.append(
                'not modelled online, so these joints are predicted less well than in the '
                f'diagnosis: {", ".join(left_out)}'
            )
    remarks += [
        f'Z of {joint} predicted worse than the physics alone: its weight in predictions was '
        f'{weight.mean:.2f} on average and ended at {weight.value:.2f}'
        for joint, weight in engine.process_weights().items()
        if weight.n and weight.mean < 0.5
    ]
    remarks += [
        f'{p.name} ended at {p.value:.3g} {p.unit}, below {c.low:g}, which is impossible: '
        'physics is missing from the model, or the motion does not determine the parameter'
        for p, c in zip(engine.parameters(), robot.coefficients, strict=False)
        if p.value < c.low
    ]
    return remarks


def stream_remarks(engine: Engine, failures: Sequence[str]) -> list[str]:
    """Return what a reader must know of the stream.

    Args:
        engine: after the recording.
        failures: errors that only a bug can cause, one line each.
    """
    remarks, counts = [], engine.counts
    if counts.clock_jumps:
        remarks.append(
            f'the clock of the recording jumped {counts.clock_jumps} times: each began a new '
            'segment, and what was learned was kept'
        )
    remarks += [
        f'{n} changes of settings in the recording were refused: {reason}'
        for reason, n in counts.changes_refused.items()
        if n
    ]
    if failures:
        remarks.append(f'{len(failures)} internal errors, please report the first: {failures[0]}')
    return remarks


def versions() -> dict[str, str]:
    """Return the versions that the numbers depend on."""
    found = {'sgp_ros': __version__, 'python': platform.python_version()}
    found |= {name: version(name) for name in _PACKAGES}
    with suppress(PackageNotFoundError):
        found['rclpy'] = version('rclpy')
    return found


def _stream(counts: Counts) -> dict[str, Any]:
    return {
        'samples': {'read': counts.read, 'used': counts.used, 'refused': dict(counts.refused)},
        'commands': {
            'read': counts.commands_read,
            'used': counts.commands_used,
            'refused': dict(counts.commands_refused),
        },
        'changes_refused': dict(counts.changes_refused),
        'clock_jumps': counts.clock_jumps,
    }


def _learning(counts: Counts) -> dict[str, Any]:
    return {
        'estimates': {
            'made': counts.estimated,
            'scored': counts.scored,
            'learned': counts.learned,
            'held': counts.held,
            'repeating': counts.unlearnable,
            'implausible': counts.implausible,
            'reverted': counts.reverted,
            'refits': counts.refits,
            'refits_refused': counts.refits_refused,
            'refits_refused_for': dict(counts.refits_refused_for),
        },
        'factor': {
            'checks': counts.factor_checks,
            'drift': counts.factor_drift,
            'rebuilt': counts.factor_rebuilt,
        },
    }


def _weights(engine: Engine) -> dict[str, dict[str, float]]:
    weights = engine.process_weights()
    return {joint: {'now': w.value, 'mean': w.mean} for joint, w in weights.items()}


def _score(score: Score) -> dict[str, float]:
    return asdict(score)


def _parameter(parameter: ParameterEstimate, meanings: Mapping[str, str]) -> dict[str, Any]:
    return {
        'name': parameter.name,
        'meaning': meanings.get(parameter.name, ''),
        'joint': parameter.joint,
        'value': parameter.value,
        'std': parameter.std,
        'unit': parameter.unit,
        'identifiable': parameter.is_identifiable,
    }


def _timing(timing: Timing) -> dict[str, Any]:
    times = 1e3 * np.array(timing.push_s) if timing.push_s else np.zeros(1)
    factor = timing.recorded_s / timing.wall_s if timing.wall_s > 0.0 else 0.0
    return {
        'push_ms': {
            'p50': float(np.quantile(times, 0.5)),
            'p99': float(np.quantile(times, 0.99)),
            'max': float(times.max()),
        },
        'realtime_factor': factor if math.isfinite(factor) else 0.0,
    }


def _plain(value: object) -> object:
    return list(value) if isinstance(value, tuple) else value
