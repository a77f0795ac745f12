"""Laws of the intake: live, replay, identify and diagnose accept and count alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgp_ros.batch.acceptance import accept
from sgp_ros.batch.signals import collect_signals
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.results import REFUSALS
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.engine.snapshots import restored, take_snapshot
from sgp_ros.errors import RecordingError
from sgp_ros.physics.term import Joint
from test.engine.worlds import PENDULUM, START_NS

MS = 1_000_000
ARM = replace(
    PENDULUM,
    joints=(Joint('hinge'), Joint('tip', effort_gain=-2.0), Joint('free', is_actuated=False)),
    residual_inputs=(('velocity:hinge',),) * 3,
)
ORDERS = (('hinge', 'tip', 'free'), ('free', 'extra', 'hinge', 'tip'), ('hinge', 'tip'))
NUMBERS = st.sampled_from([0.5, -1.0, 0.5, -1.0, np.nan, np.inf])


@st.composite
def _events(draw):
    """States and commands in the order of their stamps, with all that may be wrong with them."""
    events, stamp = [], START_NS
    for _ in range(draw(st.integers(1, 60))):
        stamp += draw(st.sampled_from([0, 10, 10, 10, 10, 240, 260, 700])) * MS
        if draw(st.integers(0, 3)) == 0:
            names = draw(st.sampled_from([None, ('hinge',), ('other',), ('tip', 'hinge')]))
            size = draw(st.sampled_from([2, 2, 2, 1])) if names is None else len(names)
            effort = frozen_array([draw(NUMBERS) for _ in range(size)])
            if not (events and events[-1].stamp_ns == stamp):  # else the engine counts it as late
                events.append(CommandSample(stamp, effort, names))
            continue
        names = draw(st.sampled_from([*ORDERS[:2] * 4, ORDERS[2]]))
        arrays = [frozen_array([draw(NUMBERS) if field else 0.1 for _ in names])
                  if draw(st.booleans()) else None for field in (1, 1)]  # fmt: skip
        position = frozen_array([draw(st.sampled_from([0.1] * 9 + [np.nan])) for _ in names])
        events.append(JointSample(stamp, names, position, *arrays))
    return events


def _online(events, config):
    """Return the stamps that the engine accepts, and its counts."""
    engine = Engine(ARM, config)
    push, stamps = engine.filter.windows.push, []

    def spy(state, commands):
        stamps.append(state.stamp_ns)
        return push(state, commands)

    engine.filter.windows.push = spy
    for event in events:
        engine.push(event)
    engine.flush()
    return stamps, engine.counts


@settings(max_examples=150, deadline=None)
@given(
    _events(),
    st.sampled_from(['auto', 'state', 'command']),
    st.sampled_from([0.05, 0.25]),
    st.sampled_from([('',), ('tip', 'hinge')]),
    st.sampled_from(['auto', 'measured']),
)
def test_the_engine_and_a_whole_recording_accept_and_count_alike(
    events, source, max_gap, order, velocity
):
    """The same stamps, the same refusals for the same reasons, and every state exactly once."""
    config = EngineConfig.from_mapping(
        {'effort.source': source, 'max_gap': max_gap, 'command.joints': order,
         'command.timeout': 0.3, 'filter.velocity': velocity, 'filter.window': 0.02},
        ARM,
    )  # fmt: skip
    stamps, counts = _online(events, config)
    assert counts.read == counts.used + sum(counts.refused.values())
    try:
        accepted = accept(events[::-1] if len({e.stamp_ns for e in events}) == len(events)
                          else events, ARM, config)  # fmt: skip
    except RecordingError:
        assert stamps == []
        return
    assert accepted.stamps_ns.tolist() == stamps
    for name in ('read', 'used', 'refused', 'commands_read', 'commands_refused'):
        assert getattr(accepted.counts, name) == getattr(counts, name)


def _states(times, effort):
    names = ORDERS[0]
    return [
        JointSample(START_NS + round(t * 1e9), names, frozen_array(np.sin([t, 2 * t, 3 * t])),
                    None, frozen_array(effort))
        for t in times
    ]  # fmt: skip


def test_identify_and_diagnose_refuse_what_the_engine_refuses():
    """One pause, one repeated stamp, one broken position, one unknown joint, no effort at last."""
    times = [*np.arange(0.0, 1.0, 0.01), *np.arange(2.0, 3.0, 0.01)]
    events = _states(times, [0.2, 0.1, 0.0])
    events[40] = replace(events[40], position=frozen_array([np.nan, 0.0, 0.0]))
    events[50] = replace(events[50], stamp_ns=events[49].stamp_ns)
    events[60] = replace(events[60], names=('a', 'b', 'c'))
    events += _states(np.arange(3.0, 3.05, 0.01), [np.nan] * 3)
    expected = dict.fromkeys(REFUSALS, 0)
    expected |= {'duplicate': 1, 'nonfinite': 1, 'unpaired': 5, 'unknown_joint': 1, 'gap': 1}
    assert (
        _online(events, EngineConfig(hyper=Engine(ARM, _config()).config.hyper))[1].refused
        == expected
    )
    assert collect_signals(events, ARM).refused == expected
    assert collect(events, ARM).refused == expected


def _config(**values):
    return EngineConfig.from_mapping(values, ARM)


@pytest.mark.parametrize('window', [0.02, 0.1])
def test_efforts_that_become_nan_after_a_command_are_unpaired(window):
    """No window holds half a measured effort and half a command that began inside it."""
    finite = _states(np.arange(0.0, 1.0, 0.01), [0.2, 0.1, 0.0])
    command = CommandSample(START_NS + 995 * MS, frozen_array([1.0, 1.0]))
    broken = _states(np.arange(1.0, 2.0, 0.01), [np.nan] * 3)
    stamps, counts = _online([*finite, command, *broken], _config(**{'filter.window': window}))
    assert counts.refused['unpaired'] == len(broken)
    assert stamps == [state.stamp_ns for state in finite]


def test_measured_efforts_take_over_from_commands_in_a_new_window():
    """A driver that starts late: what was accepted before keeps its commands."""
    early = _states(np.arange(0.0, 0.5, 0.01), [np.nan] * 3)
    late = _states(np.arange(0.5, 1.0, 0.01), [0.2, 0.1, 0.0])
    events = [CommandSample(START_NS, frozen_array([1.0, 1.0])), *early, *late]
    accepted = accept(events, ARM)
    assert accepted.counts.used == len(events) - 1
    assert [len(rows) for rows in accepted.stretches(0.25)] == [len(early), len(late)]
    assert _online(events, _config())[1].used == len(events) - 1


def test_a_change_of_the_source_begins_a_new_window():
    """Commands that came after the first state of a window do not reach back."""
    engine = Engine(ARM, _config(**{'effort.source': 'state', 'reorder_window': 0.0}))
    states = _states(np.arange(0.0, 1.0, 0.01), [0.2, 0.1, 0.0])
    for state in states[:50]:
        engine.push(state)
    engine.push(CommandSample(states[50].stamp_ns - MS, frozen_array([1.0, 1.0])))
    engine.change({'effort.source': 'command'})
    for state in states[50:]:
        engine.push(state)
    engine.flush()
    assert engine.counts.refused['unpaired'] == 0
    assert engine.counts.used == len(states)


def test_commands_are_kept_no_longer_than_a_state_needs_them():
    """Also while no state is accepted."""
    engine = Engine(ARM, _config(**{'effort.source': 'state', 'reorder_window': 0.0}))
    for i, state in enumerate(_states(np.arange(0.0, 5.0, 0.01), [np.nan] * 3)):
        engine.push(CommandSample(state.stamp_ns, frozen_array([float(i), 0.0])))
        engine.push(state)
    assert len(engine.intake.commands.stamps_ns) <= 2


def _moving(held, *, is_quantised=False):
    """Two seconds of motion and one of rest, in which each number is sent so many times."""
    i = np.arange(300)
    s = np.minimum(i // held * held, 200) / 100.0
    q = np.stack([np.sin(s), np.sin(2.0 * s), np.sin(3.0 * s)], axis=1)
    v = np.full_like(q, 0.3) if is_quantised else np.cos(q) * (s < 2.0)[:, None]
    rows = [[frozen_array(x[n]) for x in (q, v, q + 1.0)] for n in i]
    return [JointSample(START_NS + 10 * MS * n, ORDERS[0], *row) for n, row in enumerate(rows)]


def _stale(events):
    """Return how many states each of the ways refuses as stale, which must be equal."""
    config = EngineConfig(hyper=Engine(ARM, _config()).config.hyper)
    engine = Engine(ARM, config)
    for i, event in enumerate(events):
        engine.push(event)
        if i == len(events) // 3:
            engine = restored(ARM, take_snapshot(engine))
    engine.flush()
    found = engine.counts.refused['stale']
    assert collect_signals(events, ARM).refused['stale'] == found
    assert engine.counts.refused['gap'] == 0
    return found


def test_numbers_that_are_sent_again_while_joints_move_are_refused():
    """A bus that was late; not what a joint at rest sends, or a coarse encoder."""
    events = _moving(1)
    stop = _stale(events)
    assert stop == 12  # as the joints rest at once
    late = [replace(e, stamp_ns=e.stamp_ns + 10 * MS) for e in events[20:200:20]]
    kept = [e for i, e in enumerate(events) if i % 20 != 1 or not 20 < i < 200]
    assert _stale(sorted([*kept, *late], key=lambda e: e.stamp_ns)) == 9 + stop
    assert _stale(_moving(2)) == 99 + stop  # nothing is known of the first number
    assert _stale(_moving(2, is_quantised=True)) == 0
