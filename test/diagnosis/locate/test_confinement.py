"""The region of a discrepancy without a name."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from sgp_ros.diagnosis.locate.confinement import ROWS, confined, region
from test.diagnosis.worlds import CHAINS, simulate


@pytest.fixture(scope='module')
def equations(equations_for):
    return equations_for(simulate(CHAINS[2], 7, 30.0))[1]


def _overlap(a, b):
    return max(min(a[1], b[1]) - max(a[0], b[0]), 0.0) / (max(a[1], b[1]) - min(a[0], b[0]))


def test_a_homogeneous_rest_is_confined_to_nothing():
    """In none of a thousand, white or correlated over twenty rows, of any variable."""
    rng = np.random.default_rng(0)
    shares = []
    for seed in range(1000):
        rows = int(rng.integers(100, 600))
        r = rng.normal(size=rows)
        if seed % 2:
            r = signal.lfilter([1.0], [1.0, -0.9], r)
        x = np.sin(np.linspace(0.0, rng.uniform(3.0, 60.0), rows))
        shares += [confined(x, r)[2], confined(np.arange(rows, dtype=float), r)[2]]
    assert min(shares) > ROWS


def test_a_burst_is_found_in_time(equations):
    rest = np.where((equations.time > 8.0) & (equations.time < 12.0), 1.0, 0.01)
    found = region(equations, rest, 1)
    assert found.variables == ('time',)
    assert found.intervals == {}
    assert _overlap(found.time[0], (8.0, 12.0)) > 0.8


@pytest.mark.parametrize('name', ['position', 'velocity'])
def test_a_part_of_the_motion_is_found(equations, name):
    """Where it is confined to, not to what else goes with it."""
    motion, low = equations.motion, equations.filter
    x = {'position': motion.wrapped[low.rows, 0], 'velocity': low(motion.velocity)[:, 0]}[name]
    lo, hi = np.quantile(x, [0.6, 0.85])
    rest = np.where((x > lo) & (x < hi), np.sign(np.sin(40.0 * equations.time)), 0.01)
    found = region(equations, rest, 0)
    assert found.variables == (name,)
    assert found.time == ()
    assert _overlap(found.intervals[name][0], (lo, hi)) > 0.85


def test_nothing_is_said_of_few_rows_or_of_nothing(equations):
    rest = np.zeros(len(equations.time))
    assert region(equations, rest, 0).variables == ()
    rest[3] = 1.0
    short = rest[:60]
    assert confined(equations.time[:60], short)[2] < 0.1
