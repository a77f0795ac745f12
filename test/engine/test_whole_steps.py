"""Laws of steps that fail: whole or nothing, counted, and the stream goes on."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.engine import journal
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.estimator import Estimator
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import CommandSample, JointSample, SettingsChange, frozen_array
from test.engine.worlds import PENDULUM, START_NS, config, pendulum_events


@pytest.fixture(autouse=True)
def _field(monkeypatch):
    """As in the field: what a bug raises is undone."""
    monkeypatch.setattr('sgp_ros.engine.engine.RAISES_FAILURES', False)


def _run(events, engine=None):
    engine = engine or Engine(PENDULUM, config())
    estimates, failures = [], []

    def keep(step):
        estimates.extend(step.estimates)
        failures.extend(step.failures)

    replay(engine, events, keep)
    return engine, estimates, failures


def _numbers(estimates):
    return np.array([np.concatenate([e.acceleration.mean, e.effort.variance]) for e in estimates])


def test_a_step_that_fails_half_way_leaves_what_never_saw_it(monkeypatch):
    """With the model already changed when it strikes, all goes on as if the filter began anew."""
    events = pendulum_events(400)
    take, strikes = Estimator.take, [0]
    at = {}

    def striking(self, equation):
        result = take(self, equation)
        strikes[0] += 1
        if 'stamp' not in at and self.regression is not None and strikes[0] == 40:
            at['stamp'] = equation.stamp_ns
        if at.get('stamp') == equation.stamp_ns:
            self.regression.refresh()
            self.scoring.begin()
            raise ZeroDivisionError('struck')
        return result

    monkeypatch.setattr(Estimator, 'take', striking)
    settings = config(reorder_window=0.0, refit__enabled=False)
    engine, estimates, failures = _run(events, Engine(PENDULUM, settings))
    monkeypatch.undo()
    monkeypatch.setattr('sgp_ros.engine.engine.RAISES_FAILURES', False)
    (failure,) = failures
    assert isinstance(failure.error, ZeroDivisionError)
    assert engine.counts.refused['error'] == 1
    assert engine.counts.read == engine.counts.used + sum(engine.counts.refused.values())
    assert str(failure).startswith(f'JointSample of {failure.event.stamp_ns} ns')
    # The same stream, the filter begun anew where the event was.
    other, found = Engine(PENDULUM, settings), []
    for event in events:
        if event is failure.event:
            other.filter.windows.restart()
            other.intake.commands.forget_before(other.intake.commands.stamps_ns[-1])
            continue
        found.extend(other.push(event).estimates)
    found.extend(other.flush().estimates)
    assert len(found) > 60
    np.testing.assert_array_equal(_numbers(estimates), _numbers(found))


@pytest.mark.parametrize('length', [7, journal.COPY_EVENTS])
def test_an_undone_step_folds_changes_and_fits_anew(monkeypatch, length):
    """Events since the copy, fits and changes included, are folded again to the same bits."""
    monkeypatch.setattr(journal, 'COPY_EVENTS', length)
    events = pendulum_events(400)
    whole, expected, _ = _run(events)
    broken = JointSample(START_NS, ('hinge',), None)  # without an array, as only a bug makes it
    engine = Engine(PENDULUM, config())
    with_bugs = list(events)
    for place in range(len(events), 0, -50):
        with_bugs.insert(place, broken)
    engine, estimates, failures = _run(with_bugs, engine)
    assert len(failures) == len(events) // 50
    np.testing.assert_array_equal(_numbers(estimates), _numbers(expected))
    for name in ('used', 'learned', 'scored', 'refits', 'estimated'):
        assert getattr(engine.counts, name) == getattr(whole.counts, name)
    assert engine.counts.refused['error'] == len(failures)
    assert engine.counts.refits > 0


def test_a_wrong_change_in_a_stream_is_refused():
    """A record may come from another version, or from anybody."""
    events = pendulum_events(100)
    wrong = [
        SettingsChange(events[100].stamp_ns, {'filter.hop': 'often'}),
        SettingsChange(events[100].stamp_ns, {'no.such': 1}),
        SettingsChange(START_NS - 10**12, {'filter.hop': 0.0}),
    ]
    engine, _, failures = _run([*events[:101], *wrong, *events[101:]])
    assert not failures
    assert engine.counts.changes_refused == {
        'late': 0, 'clock': 1, 'invalid': 2, 'no_factor': 0, 'reset': 0, 'error': 0,
    }  # fmt: skip
    assert engine.config.filter_hop == config().filter_hop


def test_commands_without_states_stay_in_bounded_memory(monkeypatch):
    """Beyond a bound every second one goes; what windows need is there again after the pause."""
    monkeypatch.setattr('sgp_ros.engine.fold.MOST_COMMANDS', 50)
    monkeypatch.setattr('sgp_ros.engine.ordering.MOST_HELD', 30)
    engine = Engine(PENDULUM, config())
    for i in range(1000):
        engine.push(CommandSample(START_NS + i * 10**7, frozen_array([float(i)])))
    assert len(engine.intake.commands.stamps_ns) <= 50
    assert engine.intake.commands.efforts[-1][0] > 980.0
    for _ in range(500):  # a clock that stands still
        engine.push(JointSample(START_NS + 10**10, ('hinge',), frozen_array([0.0])))
    assert sum(engine.waiting_events) <= 30
    assert engine.counts.refused['duplicate'] > 400
