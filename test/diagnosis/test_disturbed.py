"""Stretches of time in which something else acts on the robot."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis import disturbed
from sgp_ros.diagnosis.connected import Connected
from sgp_ros.diagnosis.disturbed import _is_of_load, disturbance
from sgp_ros.diagnosis.gathered import Recordings
from sgp_ros.diagnosis.pipeline import diagnose
from test.diagnosis.worlds import CHAINS, events_of, simulate


def _pushed(start, end):
    """A hand that pushes between two times, beside dry and viscous friction."""
    return lambda t, q, v: (
        -0.3 * np.tanh(v[0] / 0.02) - 0.2 * v[0] + 3.0 * (start < t < end) * np.sin(3.0 * t),
    )


def _detent(_t, q, v):
    """A strong force at one position, passed in little time."""
    d = (q[0] - 0.3) / 0.03
    return (-0.2 * v[0] - 5.0 * d * np.exp(-0.5 * d**2),)


@pytest.mark.parametrize(
    ('second', 'is_law'),
    [(1.0, True), (-1.0, False), (None, False)],
    ids=['the same twice', 'another the second time', 'once'],
)
def test_what_is_the_same_under_the_same_load_is_a_law(second, is_law):
    """A motor that fails under a large load does so each time, a hand pushes as it likes."""
    t = np.arange(2000) % 1000 / 1000.0
    load, rest = np.sin(12.0 * t), 20.0 * np.sin(60.0 * t)
    rest[1000:] *= second or 1.0
    is_out = (t > 0.4) & (t < 0.5) & ((np.arange(2000) < 1000) | (second is not None))
    motion = SimpleNamespace(nominal_effort=load[:, None])
    equations = SimpleNamespace(motion=motion, filter=SimpleNamespace(rows=slice(None)))
    assert _is_of_load(equations, 0, rest, is_out) is is_law


@pytest.mark.parametrize(
    ('force', 'found'),
    [
        (_pushed(5.0, 5.8), [(5.0, 5.8)]),
        (_pushed(0.0, 0.0), []),
        (_pushed(-1.0, 0.7), []),
        (_pushed(2.0, 8.0), []),
        (_detent, []),
    ],
    ids=[
        'a push',
        'friction alone',
        'at the start',
        'a push half of the time',
        'a force at one place',
    ],
)
def test_only_what_states_of_other_times_lack_is_a_disturbance(equations_for, force, found):
    """Its ends are found to a hundredth of the recording and the length of the filter."""
    _, equations = equations_for(simulate(CHAINS[1], 4, 12.0, force=force))
    spans = disturbance(equations)
    assert len(spans) == len(found)
    for (a, b), (start, end) in zip(spans, found, strict=True):
        assert start - 0.5 < a < start + 0.12
        assert end - 0.12 < b < end + 0.5


def test_what_follows_the_load_is_no_disturbance(equations_for, monkeypatch):
    _, equations = equations_for(simulate(CHAINS[1], 4, 12.0, force=_pushed(5.0, 5.8)))
    assert disturbance(equations)
    monkeypatch.setattr('sgp_ros.diagnosis.disturbed._is_of_load', lambda *_: True)
    assert disturbance(equations) == ()


@pytest.mark.parametrize(('unknown', 'is_left_out'), [((), True), ((1,), False)])
def test_time_is_left_out_only_where_all_others_are_explained(monkeypatch, unknown, is_left_out):
    """A law that no list has stays unknown: half of it would else be called a hand."""
    raw = SimpleNamespace(recording=None, approach=None, time=np.arange(10.0))
    recordings = Recordings(('run',), raw, {}, {}, (), ())

    def connected(recordings, _tree, _progress):
        left = (0, 1) if len(recordings.learned.time) == 10 else unknown
        several = SimpleNamespace(decision=SimpleNamespace(unknown=left))
        return Connected(recordings, None, several)

    for name, stub in {
        'connect': connected, 'disturbance': lambda _: ((2.0, 3.0),),
        'part_of': lambda raw, kept: SimpleNamespace(time=raw.time[kept]),
    }.items():  # fmt: skip
        monkeypatch.setattr(disturbed, name, stub)
    found = disturbed.undisturbed(recordings, None, lambda _: None)
    assert len(found.recordings.learned.time) == (8 if is_left_out else 10)
    assert bool(found.remarks) is is_left_out


@pytest.mark.long
def test_physics_is_named_without_the_time_in_which_a_hand_pushes(robots):
    """With that time it was unexplained."""
    robot, tree = robots[1]
    events = events_of(simulate(CHAINS[1], 4, 12.0, force=_pushed(5.0, 5.8)))
    found = diagnose(events, robot, tree, {})
    assert found.verdict == 'missing_physics'
    numbers = {f.effect: f.parameters for f in found.findings}
    assert numbers['coulomb_friction']['level'].value == pytest.approx(0.3, rel=0.05)
    assert numbers['viscous_friction']['b'].value == pytest.approx(0.2, rel=0.05)
    (said,) = (r for r in found.remarks if 'Something else acted' in r)
    assert 'from 4.' in said
