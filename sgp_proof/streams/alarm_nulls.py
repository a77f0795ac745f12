"""Errors of an undisturbed joint, drawn: how often the monitor of the node alarms on them.

    python -m sgp_proof.streams.alarm_nulls

Twenty errors a second, with the intervals that the calibration gives them. They are white or
correlated, as those of overlapping windows and missing physics are, have heavy tails, or a size
that goes with the motion or wanders.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from sgp_proof.result_files import make_parser, write_result
from sgp_ros.engine.monitoring import ExcursionMonitor
from sgp_ros.gp.calibration import IntervalScale

ASKED = (1.0, 10.0, 100.0)
LEAST_S, RATE_HZ = 0.3, 20.0
_STEP_NS = round(1e9 / RATE_HZ)


def _correlated(correlation, n, rng):
    innovations = np.sqrt(1.0 - correlation**2) * rng.standard_normal(n)
    return lfilter([1.0], [1.0, -correlation], innovations)


def _overlapping(n, rng):
    white = rng.standard_normal(n + 1)
    return (white[1:] + white[:-1]) / np.sqrt(2.0)


def _moving(n, rng):
    """Return errors whose size goes with two motions, by a factor of 30 in all."""
    t, phase = np.arange(n) / RATE_HZ, rng.uniform(0.0, 2.0 * np.pi, 2)
    size = np.sin(2.0 * np.pi * 0.3 * t + phase[0]) + 0.7 * np.sin(
        2.0 * np.pi * 0.11 * t + phase[1]
    )
    return np.exp(size) * _correlated(0.6, n, rng)


NULLS = {
    'white': lambda n, rng: rng.standard_normal(n),
    'heavy tails (Student, 4 degrees)': lambda n, rng: rng.standard_t(4, n),
    'windows that overlap by half': _overlapping,
    'correlation 0.6': lambda n, rng: _correlated(0.6, n, rng),
    'correlation 0.9': lambda n, rng: _correlated(0.9, n, rng),
    'correlation 0.97': lambda n, rng: _correlated(0.97, n, rng),
    'size goes with the motion': _moving,
    'size wanders': lambda n, rng: np.exp(_correlated(0.95, n, rng)) * rng.standard_normal(n),
}


def hourly_alarms(errors):
    """Return the alarms of each hour, for each rate that is asked for, (hours, 3)."""
    scale, hour = IntervalScale(), round(3600.0 * RATE_HZ)
    monitors = [ExcursionMonitor(LEAST_S, rate) for rate in ASKED]
    counts = []
    for i, error in enumerate(errors.tolist()):
        variance = scale.variance(1.0)
        for monitor in monitors:
            monitor.add(i * _STEP_NS, error, variance, 1.0)
        scale.add(error, 1.0)
        if (i + 1) % hour == 0:
            counts.append([monitor.alarms for monitor in monitors])
    return np.diff(counts, axis=0, prepend=0)


def main():
    """Measure and write the result."""
    parser = make_parser(__doc__, 'alarm_nulls')
    parser.add_argument('--series', type=int, default=12)
    parser.add_argument('--hours', type=int, default=6, help='of each series')
    arguments = parser.parse_args()
    found, series = {}, arguments.series
    for name, draw in NULLS.items():
        n = round(3600.0 * RATE_HZ * arguments.hours)
        counts = sum(hourly_alarms(draw(n, np.random.default_rng(i))) for i in range(series))
        found[name] = {
            str(rate): {'first': int(counts[0, i]), 'later': int(counts[1:, i].sum())}
            for i, rate in enumerate(ASKED)
        }
        print(name, found[name], flush=True)
    result = {
        'series': series, 'hours': arguments.hours, 'rate_hz': RATE_HZ, 'least_s': LEAST_S,
        'kinds': found,
    }  # fmt: skip
    write_result(arguments.out, result, schema=1)


if __name__ == '__main__':
    main()
