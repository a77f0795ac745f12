"""The numbers of a run in the form of `metrics.json`."""

from __future__ import annotations

import math
import platform
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from sgp_ros import __version__
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.results import ParameterEstimate, Score

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
    return {
        'schema': SCHEMA,
        'robot': engine.robot.name,
        'recording': recording,
        'seed': seed,
        'samples': {'read': counts.read, 'used': counts.used, 'refused': dict(counts.refused)},
        'commands': {'read': counts.commands_read, 'refused': dict(counts.commands_refused)},
        'joints': {
            joint: {channel: _score(score) for channel, score in channels.items()}
            for joint, channels in engine.scores().items()
        },
        'physics_alone': {
            joint: {channel: _score(score) for channel, score in channels.items()}
            for joint, channels in baseline.items()
            if channels
        },
        'parameters': [_parameter(p) for p in engine.parameters()],
        'physics_parameters': [_parameter(p) for p in engine.physics_parameters()],
        'estimates': {
            'made': counts.estimated,
            'scored': counts.scored,
            'learned': counts.learned,
            'repeating': counts.unlearnable,
            'refits': counts.refits,
            'refits_refused': counts.refits_refused,
            'refits_refused_for': dict(counts.refits_refused_for),
        },
        'factor': {
            'checks': counts.factor_checks,
            'drift': counts.factor_drift,
            'rebuilt': counts.factor_rebuilt,
        },
        'timing': _timing(timing),
        'delay_s': engine.delay_s,
        'settings': {k: _plain(v) for k, v in engine.config.to_mapping().items()},
        'versions': versions(),
        'remarks': list(remarks),
    }


def versions() -> dict[str, str]:
    """Return the versions that the numbers depend on."""
    found = {'sgp_ros': __version__, 'python': platform.python_version()}
    found |= {name: version(name) for name in _PACKAGES}
    with suppress(PackageNotFoundError):
        found['rclpy'] = version('rclpy')
    return found


def _score(score: Score) -> dict[str, float]:
    return {'nmse': score.nmse, 'nlpd': score.nlpd, 'coverage95': score.coverage95, 'n': score.n}


def _parameter(parameter: ParameterEstimate) -> dict[str, Any]:
    return {
        'name': parameter.name,
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
