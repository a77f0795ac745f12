"""Laws of the filter that the first seconds choose."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.engine.config import AUTOMATIC, EngineConfig, describe_settings
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.filter_choice import TRIALS_S, WINDOWS
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import CommandSample, JointSample, SettingsChange, frozen_array
from sgp_ros.engine.snapshots import restored, take_snapshot
from test.engine.worlds import PENDULUM, START_NS, config, motion

AUTO = {'filter__window': AUTOMATIC, 'refit__enabled': False}


def _events(position_noise=1e-6, velocity_noise=None, n=800, still_s=0.0):
    rng = np.random.default_rng(1)
    t, q, v, command = motion(n, 100.0, 0, position_noise)
    events = []
    for i in range(round(100 * still_s)):
        stamp = START_NS + round((t[i] - still_s) * 1e9)
        rest = frozen_array([q[0] + position_noise * rng.normal()])
        events += [CommandSample(stamp, frozen_array([0.0])), JointSample(stamp, ('hinge',), rest)]
    for i, time in enumerate(t):
        stamp = START_NS + round(time * 1e9)
        velocity = None
        if velocity_noise is not None:
            velocity = frozen_array([v[i] + velocity_noise * rng.normal()])
        events.append(CommandSample(stamp, frozen_array([command[i]])))
        events.append(JointSample(stamp, ('hinge',), frozen_array([q[i]]), velocity))
    return events


def _run(engine, events):
    steps = []
    replay(engine, events, steps.append)
    found = [e for step in steps for e in step.estimates]
    rows = [np.concatenate([[e.stamp_ns], e.acceleration.mean, e.effort.mean]) for e in found]
    return np.array(rows), [event for step in steps for event in step.released]


def test_more_noise_asks_for_a_longer_window():
    """The shortest window that is good enough; the longest where none is."""
    chosen = []
    for noise in (1e-7, 1e-5, 1e-4, 1e-2):
        engine = Engine(PENDULUM, config(**AUTO))
        _run(engine, _events(noise))
        chosen.append(engine.config.filter_window)
    assert chosen == sorted(chosen)
    assert (chosen[0], chosen[-1]) == (WINDOWS[0], WINDOWS[-1])
    assert chosen[1] < chosen[2]


@pytest.mark.parametrize(
    ('position', 'velocity', 'source'), [(1e-6, 1e-2, 'position'), (1e-3, 1e-5, 'measured')]
)
def test_the_less_noisy_source_of_velocity_is_chosen(position, velocity, source):
    """Unless the settings name one."""
    engine = Engine(PENDULUM, config(**AUTO))
    _run(engine, _events(position, velocity))
    assert engine.config.filter_velocity == source
    engine = Engine(PENDULUM, config(**AUTO, filter__velocity='position'))
    _run(engine, _events(position, velocity))
    assert engine.config.filter_velocity == 'position'


def test_the_chosen_filter_gives_what_it_would_have_given_from_the_start():
    """No state is lost to the choice."""
    events = _events(1e-5)
    engine = Engine(PENDULUM, config(**AUTO))
    found, _ = _run(engine, events)
    chosen = engine.config.filter_window
    fixed = Engine(PENDULUM, config(refit__enabled=False, filter__window=chosen,
                                    filter__velocity='position'))  # fmt: skip
    np.testing.assert_array_equal(found, _run(fixed, events)[0])
    assert engine.counts == fixed.counts


def test_a_replay_of_the_record_makes_the_choice_again():
    """Bit for bit; the record says when it was made."""
    live, record = _run(Engine(PENDULUM, config(**AUTO)), _events(1e-5))
    changes = [event for event in record if isinstance(event, SettingsChange)]
    assert [set(c.settings) for c in changes] == [{'filter.window', 'filter.velocity'}]
    assert changes[0].stamp_ns == START_NS + TRIALS_S[0] * 1e9
    again, _ = _run(Engine(PENDULUM, config(**AUTO)), record)
    np.testing.assert_array_equal(live, again)


@pytest.mark.parametrize('stop', [300, 700])
def test_an_engine_that_stopped_before_the_choice_makes_it_all_the_same(stop):
    """The gathered states are part of the snapshot."""
    events = _events(1e-5)
    engine = Engine(PENDULUM, config(**AUTO))
    first = [e for event in events[:stop] for e in engine.push(event).estimates]
    file = io.BytesIO()
    np.savez(file, **take_snapshot(engine))
    file.seek(0)
    with np.load(file, allow_pickle=False) as snapshot:
        again = restored(PENDULUM, snapshot)
    np.testing.assert_array_equal(_run(again, events[stop:])[0], _run(engine, events[stop:])[0])
    assert (len(first) == 0) == (stop == 300)
    assert again.config == engine.config


def test_a_robot_at_rest_has_the_choice_wait_for_its_motion():
    """Noise of a joint at rest tells nothing about its acceleration."""
    engine = Engine(PENDULUM, config(**AUTO))
    _, record = _run(engine, _events(1e-6, still_s=4.0))
    (change,) = [event for event in record if isinstance(event, SettingsChange)]
    assert change.stamp_ns == START_NS - 4e9 + TRIALS_S[1] * 1e9
    assert change.settings['filter.window'] < WINDOWS[-1]


def test_a_short_stream_is_filtered_at_its_end():
    """With what there was to choose on."""
    engine = Engine(PENDULUM, config(**AUTO))
    found, _ = _run(engine, _events(n=150))
    assert len(found) > 10
    assert engine.config.filter_window > 0.0


def test_a_robot_that_states_effects_has_its_filter_chosen():
    """The file that a diagnosis leaves has no settings beside it."""
    (window,) = [s for s in describe_settings(PENDULUM) if s.name == 'filter.window']
    assert window.default == EngineConfig().filter_window
    diagnosed = replace(PENDULUM, source={'effects': []})
    (window,) = [s for s in describe_settings(diagnosed) if s.name == 'filter.window']
    assert window.default == AUTOMATIC
    assert EngineConfig.from_mapping({}, diagnosed).filter_window == AUTOMATIC
    given = EngineConfig.from_mapping({'filter.window': 0.2}, diagnosed)
    assert EngineConfig.from_mapping(given.to_mapping(), diagnosed) == given
