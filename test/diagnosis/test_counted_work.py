"""Cost of a diagnosis, in work that no clock and no load of the machine can change."""

from __future__ import annotations

from collections import Counter

import pytest

from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.diagnosis.explain import candidates
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.rigid import rigid_body
from test.diagnosis import worlds
from test.diagnosis.worlds import CHAINS, FINE, events_of, simulate

LOOPS = {'fill_mass': 1, 'fill_torque': 2, 'fill_regressor': 2}
"""Compiled loops over bodies, and which of their arguments has a row for each state."""
MOST = {
    'fill_mass': 121_000, 'fill_torque': 358_000, 'fill_regressor': 249_000, 'calls': 3770,
    'filtered': 8_860_000, 'solved': 505,
}  # fmt: skip
"""Of 8 s at 200 Hz of one link: states gone through by each loop, calls of them, numbers that were
filtered, least-squares fits. A tenth more than when this was written."""


@pytest.fixture
def counted(monkeypatch):
    """Counts of the work that is done from now on."""
    counts = Counter()

    def wrap(module, name, count):
        work = getattr(module, name)

        def counting(*arguments, **options):
            count(arguments)
            return work(*arguments, **options)

        monkeypatch.setattr(module, name, counting)

    for name, place in LOOPS.items():
        wrap(
            rigid_body, name, lambda a, n=name, i=place: counts.update({n: len(a[i]), 'calls': 1})
        )
    wrap(ParallelFilter, 'piece', lambda a: counts.update(filtered=a[1].size))
    wrap(candidates, '_solved', lambda _: counts.update(solved=1))
    return counts


@pytest.mark.parametrize('period_s', [pytest.param(0.005, marks=pytest.mark.long), FINE])
def test_a_diagnosis_does_no_more_work_than_it_did(robots, counted, monkeypatch, period_s):
    """Dry friction: screening, fits, roll-outs, and the search for errors of the connection.

    Five times the rate is no more work where rows may be left out.
    """
    monkeypatch.setattr(worlds, 'PERIOD', period_s)
    world = simulate(CHAINS[1], 11, 8.0, dry=lambda t, q, s: 0.4)
    robot, tree = robots[1]
    found = diagnose(events_of(world), robot, tree, {}, holds_out=True)
    assert [f.effect for f in found.findings] == ['coulomb_friction']
    assert {name: n for name, n in counted.items() if n > MOST[name]} == {}
