"""Laws of bringing a recording to a uniform grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgp_ros.batch.acceptance import HeldCommands
from sgp_ros.batch.signals import collect_signals
from sgp_ros.batch.zero_phase import ZeroPhase, second_derivative
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.robots.registry import load_robot
from test.batch.worlds import CART, START_NS, cart_events

LINEAR_AXIS = load_robot('linear_axis')
REACTION_WHEEL = load_robot('reaction_wheel')


def _state(time, position, *, velocity=None, effort=None, names=('axis',)):
    arrays = [None if x is None else frozen_array(x) for x in (position, velocity, effort)]
    return JointSample(START_NS + round(time * 1e9), names, *arrays)


def _axis_states(times, **extra):
    return [_state(t, [np.sin(t)], effort=[np.cos(t)], **extra) for t in times]


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_held_commands_are_averaged_exactly(seed):
    """Against a fine quadrature of the staircase, for changes at any times."""
    rng = np.random.default_rng(seed)
    changes = np.sort(rng.choice(np.arange(-200, 1200), 12, replace=False))
    held = HeldCommands(changes.astype(np.int64), rng.normal(size=(12, 2)))
    centred, following = held.averages(0, 100e-9, 10)
    fine = np.arange(-200, 1200) + 0.5
    value = held.effort[np.maximum(np.searchsorted(changes, fine) - 1, 0)]
    for i in range(10):
        hat = np.maximum(0.0, 1.0 - np.abs(fine - 100 * i) / 100) / 100
        box = ((fine > 100 * i) & (fine < 100 * (i + 1))) / 100
        assert centred[i] == pytest.approx(hat @ value, abs=1e-9)
        assert following[i] == pytest.approx(box @ value, abs=1e-9)


def test_effort_and_acceleration_of_a_mass_agree_at_every_sample():
    """No filter is needed between them: commands switch anywhere, arrivals are shuffled."""
    rng = np.random.default_rng(3)
    times = np.arange(400) * 0.01
    switches = np.concatenate([[0.0], np.sort(rng.uniform(0.02, 3.9, 150))])
    forces = rng.normal(size=151)
    signals = collect_signals(
        cart_events(times, switches, forces), CART, EngineConfig(max_gap=0.1)
    )
    force = 2.0 * second_derivative(signals.position, signals.rate)
    inner = slice(8, -8)
    assert signals.effort[inner] == pytest.approx(force[inner], abs=1e-6)
    assert np.abs(force[inner]).max() > 1.0


def test_rounds_of_a_looped_recording_are_not_mixed():
    """Each is a segment of its own, with the signals of the first."""
    events = sorted(
        cart_events(np.arange(400) * 0.01, [0.0, 0.5], [1.0, -1.0]), key=lambda e: e.stamp_ns
    )
    once = collect_signals(events, CART, EngineConfig(max_gap=0.1))
    looped = collect_signals([*events, *events], CART, EngineConfig(max_gap=0.1))
    first, second = looped.segments
    assert np.array_equal(looped.position[first], once.position)
    assert second.stop - second.start == len(once.position) - 1  # the first one ends the pause
    assert looped.position[second] == pytest.approx(once.position[1:], abs=1e-9)
    assert looped.effort[second][1:] == pytest.approx(once.effort[2:], abs=1e-9)
    assert 'The stamps go back: treated as 2 recordings.' in looped.remarks


def test_arrival_order_is_irrelevant():
    """A whole recording can be sorted: nothing is late."""
    events = cart_events(np.arange(100) * 0.01, [0.0, 0.5], [1.0, -1.0])
    first = collect_signals(events, CART, EngineConfig(max_gap=0.1))
    second = collect_signals(events[::-1], CART, EngineConfig(max_gap=0.1))
    assert np.array_equal(first.position, second.position)
    assert np.array_equal(first.effort, second.effort)
    assert first.refused == second.refused == dict.fromkeys(first.refused, 0)


def test_uneven_stamps_and_missing_samples_leave_the_motion_as_it_is():
    """The grid runs at the median rate; a slow sinusoid is met to the order of the spline."""
    rng = np.random.default_rng(0)
    times = np.arange(1000) * 0.01 + rng.uniform(-0.002, 0.002, 1000)
    times = times[rng.random(1000) > 0.1]
    signals = collect_signals(_axis_states(times), LINEAR_AXIS, EngineConfig(max_gap=0.2))
    assert signals.rate == pytest.approx(100.0, rel=0.05)
    assert np.diff(signals.time) == pytest.approx(1.0 / signals.rate, rel=1e-6)
    at = times[0] + signals.time[5:-5]
    assert signals.position[5:-5, 0] == pytest.approx(np.sin(at), abs=1e-7)
    assert signals.effort[5:-5, 0] == pytest.approx(np.cos(at), abs=1e-3)


def test_a_pause_ends_a_segment():
    """Nothing is made up inside a gap, and each segment keeps its own grid."""
    times = np.concatenate([np.arange(100) * 0.01, 5.0 + np.arange(60) * 0.01, [9.0, 9.01]])
    signals = collect_signals(_axis_states(times), LINEAR_AXIS, EngineConfig(max_gap=0.1))
    assert signals.segments == (slice(0, 100), slice(100, 159))
    assert signals.time[100] == pytest.approx(5.01)
    assert signals.refused['gap'] == 2
    assert signals.left_out == 1


def test_each_refused_state_is_counted_for_one_reason():
    """`read = used + sum(refused)`, by the reasons of the online engine."""
    good = _axis_states(np.arange(50) * 0.01)
    bad = [
        _state(0.2, [5.0], effort=[0.0]),
        _state(0.601, [np.nan], effort=[0.0]),
        _state(0.602, [0.0], effort=[np.inf]),
        _state(0.603, [0.0], effort=[0.0], names=('other',)),
        _state(0.585, [0.0]),
    ]
    signals = collect_signals([*good, *bad], LINEAR_AXIS, EngineConfig(max_gap=0.1))
    assert signals.refused == {
        'late': 0, 'duplicate': 1, 'stale': 0, 'nonfinite': 2, 'unpaired': 1, 'unknown_joint': 1,
        'gap': 0, 'clock': 0, 'error': 0, 'implausible': 0, 'reset': 0, 'wrong_length': 0,
    }  # fmt: skip
    assert len(signals.time) == 50


def test_joints_come_in_the_order_of_the_robot():
    """A passive joint has no effort, whatever was measured there."""
    states = [
        _state(0.01 * i, [1.0, 2.0], velocity=[3.0, 4.0], effort=[5.0, 6.0],
               names=('wheel', 'pole'))
        for i in range(30)
    ]  # fmt: skip
    signals = collect_signals(states, REACTION_WHEEL, EngineConfig(max_gap=0.1))
    assert signals.position[3] == pytest.approx([2.0, 1.0])
    assert signals.velocity[3] == pytest.approx([4.0, 3.0])
    assert signals.effort[3] == pytest.approx([0.0, 5.0])


@pytest.mark.parametrize('is_measured', [False, True])
def test_a_gain_turns_recorded_efforts_into_those_of_the_physics(is_measured):
    """A current and its torque constant, measured or commanded."""
    (cart,) = CART.joints
    driven = replace(CART, joints=(replace(cart, effort_gain=-4.0),))
    events = cart_events(np.arange(0.0, 1.0, 0.01), [0.0, 0.4], [3.0, -2.0])
    if is_measured:
        events = [
            replace(e, effort=frozen_array([1.0])) for e in events if isinstance(e, JointSample)
        ]
    plain, scaled = (
        collect_signals(events, robot, EngineConfig(max_gap=0.1)) for robot in (CART, driven)
    )
    np.testing.assert_allclose(scaled.effort, -4.0 * plain.effort, atol=1e-12)


def test_a_stale_command_pairs_with_no_state():
    """The drive's action after the commands stopped is not known."""
    events = cart_events(np.arange(300) * 0.01, [0.0, 0.5], [1.0, -1.0])
    signals = collect_signals(events, CART, EngineConfig(max_gap=0.1))
    assert signals.refused['unpaired'] == 149
    assert signals.time[-1] == pytest.approx(1.5)


def test_refused_commands_are_counted_by_reason():
    """Wrong length, unknown joint, bad number."""
    events = cart_events(np.arange(100) * 0.01, [0.0], [1.0])
    bad = [
        CommandSample(START_NS, frozen_array([1.0, 2.0])),
        CommandSample(START_NS, frozen_array([1.0]), ('other',)),
        CommandSample(START_NS, frozen_array([np.nan])),
    ]
    signals = collect_signals([*events, *bad], CART, EngineConfig(max_gap=0.1))
    assert signals.commands_refused == {
        'late': 0, 'wrong_length': 1, 'unknown_joint': 1, 'wrong_kind': 0, 'nonfinite': 1,
        'clock': 0, 'reset': 0, 'error': 0,
    }  # fmt: skip
    assert signals.effort[3:-3] == pytest.approx(1.0)


def test_a_recording_without_effort_is_refused_with_the_remedy():
    """An actuated joint needs one."""
    states = [_state(0.01 * i, [0.0]) for i in range(30)]
    with pytest.raises(RecordingError, match='command topic'):
        collect_signals(states, LINEAR_AXIS, EngineConfig(max_gap=0.1))
    with pytest.raises(RecordingError, match='no usable state'):
        collect_signals([], LINEAR_AXIS, EngineConfig(max_gap=0.1))
    with pytest.raises(RecordingError, match='record longer'):
        collect_signals(_axis_states([0.0, 0.01]), LINEAR_AXIS, EngineConfig(max_gap=0.1))
    with pytest.raises(ConfigError, match=r'effort\.source'):
        collect_signals(
            states,
            LINEAR_AXIS,
            EngineConfig.from_mapping({'max_gap': 0.1, 'effort.source': 'motor'}, LINEAR_AXIS),
        )


def test_joining_uneven_samples_costs_no_acceleration():
    """A monotone cubic loses half a per cent here, straight lines more than one."""
    rng = np.random.default_rng(0)
    times = np.arange(3000) * 0.01 + rng.uniform(-0.003, 0.003, 3000)
    times = times[rng.random(3000) > 0.05]
    omega = 2.0 * np.pi * 3.0
    states = [_state(t, [np.sin(omega * t)], effort=[0.0]) for t in times]
    signals = collect_signals(states, LINEAR_AXIS, EngineConfig(max_gap=0.2))
    zero_phase = ZeroPhase(signals.rate, 10.0)
    _, _, found = zero_phase.states(signals.position)
    at = (signals.start_ns - START_NS) * 1e-9 + signals.time[:, None]
    exact = -(omega**2) * zero_phase.gain(np.array(3.0)) * np.sin(omega * at)
    trim = zero_phase.trim
    error = (found - exact)[trim:-trim]
    assert np.std(error) < 1e-3 * np.std(exact)


class _Delayed:
    """A drive that gives each command `delay` later, as a stated effect."""

    memory_s = 1.0

    def __init__(self, delay):
        self._delay = delay

    def __call__(self, effort, velocity, *, is_measured):
        return effort

    def late_effort(self, drive):
        return (drive.effort(0, delay=self._delay) - drive.effort(0))[:, None]


def test_late_drives_give_the_efforts_of_commands_that_come_later():
    """On the grid; following means of commands, which roll-outs take, come close."""
    rng = np.random.default_rng(1)
    states = [_state(t, [np.sin(t)]) for t in np.arange(200) * 0.01]

    def signals(delay, shift):
        robot = replace(LINEAR_AXIS, effort_map=_Delayed(delay))
        commands = [
            CommandSample(START_NS + round((t + shift) * 1e9), frozen_array([u]), ('axis',))
            for t, u in zip([-0.1, *changes], values, strict=True)
        ]
        return collect_signals([*commands, *states], robot)

    changes, values = np.sort(rng.uniform(0.05, 1.9, size=30)), rng.normal(size=31)
    found, late = signals(0.023, 0.0), signals(0.0, 0.023)
    now = signals(0.0, 0.0)
    # the two are sharpened alike but for the last terms of the series
    for name, share in (('effort', 0.05), ('command', 0.3)):
        one, other, undelayed = (getattr(x, name) for x in (found, late, now))
        assert np.std(one - other) < share * np.std(undelayed - other), name
