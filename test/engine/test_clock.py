"""Laws of stamps far from all others: one is an error, two are a new time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.engine.clock import SHORTEST_ROUND, on_one_clock
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import CommandSample, JointSample
from test.engine.worlds import PENDULUM, START_NS, config, pendulum_events

HOUR_NS = 3600 * 10**9


def _moved(events, by_ns):
    return [replace(event, stamp_ns=event.stamp_ns + by_ns) for event in events]


def _fed(events, engine=None):
    engine = engine or Engine(PENDULUM, config())
    estimates = []
    for event in events:
        estimates += engine.push(event).estimates
    estimates += engine.flush().estimates
    return engine, estimates


@pytest.mark.parametrize('by_ns', [-HOUR_NS, HOUR_NS, 10**18 // 4])
def test_what_was_learned_goes_on_after_a_clock_jumped(by_ns):
    """A looped bag, NTP, a simulator that is reset: windows begin anew, W and Z are kept."""
    events = pendulum_events(300)
    engine, estimates = _fed([*events[:300], *_moved(events[300:], by_ns)])
    whole, expected = _fed(events)
    counts = engine.counts
    assert counts.clock_jumps == 1
    assert counts.refused['late'] == counts.refused['clock'] == 0
    assert counts.read == counts.used + sum(counts.refused.values())
    assert len(expected) - len(estimates) <= 4  # a filter window and a half
    assert whole.counts.learned - counts.learned <= 4
    later = [e for e in estimates if abs(e.stamp_ns - START_NS - by_ns) < HOUR_NS // 2]
    assert all(e.is_scored for e in later)
    assert len(later) > 20


@pytest.mark.parametrize('by_ns', [-HOUR_NS, 5 * 10**9, HOUR_NS])
@pytest.mark.parametrize('kind', [JointSample, CommandSample])
def test_one_wrong_stamp_is_refused_and_nothing_else(by_ns, kind):
    """All other estimates are those of a stream without it."""
    events = pendulum_events(300)
    wrong = next(e for e in events[300:] if isinstance(e, kind))
    moved = replace(wrong, stamp_ns=wrong.stamp_ns + by_ns)
    engine, estimates = _fed([*events[:300], moved, *events[300:]])
    _, expected = _fed(events)
    counts = engine.counts
    assert counts.refused['clock'] + counts.commands_refused['clock'] == 1
    assert counts.clock_jumps == 0
    assert [e.stamp_ns for e in estimates] == [e.stamp_ns for e in expected]
    np.testing.assert_array_equal(
        [e.acceleration.mean for e in estimates], [e.acceleration.mean for e in expected]
    )


def test_two_states_of_the_far_future_cost_no_later_one():
    """They are taken for a new time until the next two tell otherwise."""
    events = pendulum_events(300)
    wrong = _moved([e for e in events if isinstance(e, JointSample)][150:152], HOUR_NS)
    engine, _ = _fed([*events[:300], *wrong, *events[300:]])
    assert engine.counts.clock_jumps == 2
    assert engine.counts.refused['late'] == 0
    assert engine.counts.used >= 296


def test_commands_of_another_clock_never_move_the_time():
    """They are refused, however many come, and states go on."""
    events = [
        replace(e, stamp_ns=e.stamp_ns + HOUR_NS) if isinstance(e, CommandSample) else e
        for e in pendulum_events(300)
    ]
    engine, _ = _fed(events)
    assert engine.counts.clock_jumps <= 1  # the first command may have set the time
    assert engine.counts.commands_refused['clock'] >= 298
    assert engine.counts.refused['unpaired'] >= 298


def test_a_stamp_that_no_message_holds_is_refused():
    """Negative ones and those from 2^31 s on: no file could keep them."""
    events = pendulum_events(50)
    state = events[1]
    wrong = [replace(state, stamp_ns=s) for s in (-1, -(10**18), 2**31 * 10**9, 2**64)]
    engine, _ = _fed([*wrong, *events])
    assert engine.counts.refused['clock'] == 4
    assert engine.counts.used == 50


def test_a_recording_of_one_time_is_left_as_it_is():
    """Also where messages came late, and with a command of another clock."""
    events = pendulum_events(300)
    late = [*events[::2], *events[1:40:2]]
    other = [replace(events[0], stamp_ns=START_NS - HOUR_NS), *events]
    for given in (events, late, other, []):
        assert on_one_clock(given, config()) == (given, [], 0)


@pytest.mark.parametrize('by_ns', [-HOUR_NS, -3 * 10**9 + 7])
def test_rounds_of_a_looped_recording_follow_each_other(by_ns):
    """The later one as it was, after a pause; what agrees with neither is of none."""
    events = pendulum_events(300)
    moved = _moved(events, by_ns)
    wrong = replace(events[-1], stamp_ns=START_NS + HOUR_NS)
    found, refused, times = on_one_clock([*events, *moved[:200], wrong, *moved[200:]], config())
    assert (times, refused) == (1, [wrong])
    assert found[: len(events)] == events
    later = found[len(events) :]
    steps = {e.stamp_ns - m.stamp_ns for e, m in zip(later, moved, strict=True)}
    assert len(steps) == 1
    assert later[0].stamp_ns - events[-1].stamp_ns > 10**9 * config().command_timeout


@pytest.mark.parametrize('by_ns', [400_000_000, 800_000_000])
def test_a_clock_that_is_set_back_by_little_costs_some_states_and_not_the_stream(by_ns):
    """A short loop would be late for ever; in a whole recording each of its rounds is kept."""
    events = pendulum_events(80)
    loop = [e for e in events if e.stamp_ns <= events[0].stamp_ns + by_ns]
    looped = [e for _ in range(5) for e in loop]
    states = sum(isinstance(e, JointSample) for e in loop)
    engine, _ = _fed(looped)
    lost = 4 * (SHORTEST_ROUND - 1)
    assert engine.counts.clock_jumps == 4
    assert engine.counts.refused['late'] <= lost
    assert engine.counts.used >= 5 * states - lost - 5
    found, wrong, jumps = on_one_clock(looped, engine.config)
    assert (jumps, wrong) == (4, [])
    stamps = [e.stamp_ns for e in found if isinstance(e, JointSample)]
    assert len(stamps) == 5 * states
    assert stamps == sorted(stamps)
