"""Laws of what /diagnostics says of the model; no graph is needed."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.fitting import FitResult
from sgp_ros.engine.joint_merging import JointMerger
from sgp_ros.engine.replay import Swap
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.gp.model import Model
from sgp_ros.ros.fit_health import FitHealth
from sgp_ros.ros.health import Health
from sgp_ros.ros.verdict import OK, WARN
from test.engine.worlds import PENDULUM, config, pendulum_events

SOURCES = {'joint_states': ('/joint_states', ('/a',)), 'command': ('/command', ('/a',))}
MERGER = JointMerger(PENDULUM.joint_names)


def _fit_status(events):
    engine = Engine(PENDULUM, config(buffer__budget=60))
    health = FitHealth(1, 0.3, 1.0)
    for event in events:
        health.take(engine.push(event).estimates, PENDULUM)
    statuses = health.statuses(engine, 'node')
    return next(status for status in statuses if status.name == 'node: fit hinge')


def test_a_robot_that_stays_the_same_is_fine():
    """No word of drift, and its level is a number."""
    status = _fit_status(pendulum_events(1500, noise=1e-4))
    assert status.level == OK
    assert 0.0 <= float(status.values['drift']) < 1.0


def test_a_robot_that_changed_is_reported():
    """An actuator that loses a third of its gain is a warning in plain words."""
    events = pendulum_events(1500, noise=1e-4)
    weaker = [
        dataclasses.replace(event, effort=event.effort * 1.5)
        if isinstance(event, CommandSample)
        else event
        for event in events[2000:]
    ]
    status = _fit_status([*events[:2000], *weaker])
    assert status.level == WARN
    assert 'errors have grown' in status.message
    assert float(status.values['drift']) > 1.0


@pytest.mark.parametrize(('grown', 'level'), [(0.9, OK), (1.003, OK), (1.006, WARN)])
def test_errors_that_drift_are_reported_once_they_have_grown(monkeypatch, grown, level):
    """By more than counts as physics: of a joint whose errors are all noise that is none."""
    engine = Engine(PENDULUM, config(buffer__budget=60))
    health = FitHealth(1, 0.3, 1.0)
    for event in pendulum_events(1500, noise=1e-4):
        health.take(engine.push(event).estimates, PENDULUM)
    running = engine.estimator.scoring.scores[PENDULUM.target][0]
    before = engine.scores()['hinge'][PENDULUM.target]
    noisy = dataclasses.replace(before, nmse=1.0)
    monkeypatch.setattr(engine, 'scores', lambda: {'hinge': {PENDULUM.target: noisy}})
    health._square[0] = grown * running.target_squares / running.n
    monkeypatch.setattr(
        Engine, 'drift', [SimpleNamespace(level=2.0, is_drifting=True)], raising=True
    )
    status = next(s for s in health.statuses(engine, 'node') if s.name == 'node: fit hinge')
    assert status.level == level


@pytest.mark.parametrize(
    ('model', 'evidence', 'refusal', 'said'),
    [
        ('found', 5.0, '', 'log evidence rose by 3 nat'),
        ('found', 1.5, 'no_better', 'no improvement, log evidence 0.5 nat lower'),
        (None, -np.inf, 'diverged', 'diverged'),
        ('found', np.nan, 'diverged', 'diverged'),
        ('found', 5.0, 'no_factor', 'singular'),
    ],
)
def test_the_reason_of_a_refused_fit_is_reported(model, evidence, refusal, said):
    """A fit that diverged asks for another look at the data; one that is no better does not."""
    engine = Engine(PENDULUM, config())
    for event in pendulum_events(100):
        engine.push(event)
    health = Health(MERGER)
    found = Model((None,), (1.0,)) if model else None
    health.note_fit(FitResult(0, found, evidence, 2.0, 5), refusal)
    statuses = health.statuses(engine, 'node', 1.0, SOURCES)
    values = next(status for status in statuses if status.name == 'node: model').values
    assert said in values['last_refit']


def test_refused_fits_are_counted_by_reason():
    """The sum and its parts stand side by side."""
    engine = Engine(PENDULUM, config())
    for event in pendulum_events(100):
        engine.push(event)
    Swap(engine, FitResult(0, None, -np.inf, 2.0, 5))
    statuses = Health(MERGER).statuses(engine, 'node', 1.0, SOURCES)
    values = next(status for status in statuses if status.name == 'node: model').values
    assert values['refits_refused'] == values['refits_refused.diverged'] == '1'
    assert values['refits_refused.no_better'] == values['refits_refused.no_factor'] == '0'


def test_a_parameter_that_is_not_determined_is_reported_once(monkeypatch):
    """A warning with its name, then information; one more that gets lost is a new warning."""
    engine = Engine(PENDULUM, config(buffer__budget=60))
    for event in pendulum_events(1200):
        engine.push(event)
    known, lost = SimpleNamespace(name='b', std=0.1), SimpleNamespace(name='J', std=None)
    shown = [known, lost]
    monkeypatch.setattr(engine, 'parameters', lambda: shown)
    health = FitHealth(1, 0.3, 1.0)

    def reported():
        status = health.statuses(engine, 'arm/node')[-1]
        assert status.name == 'arm/node: parameters'
        return status.level, status.message

    level, message = reported()
    assert level == WARN
    assert '1 of 2 parameters not determined so far: J; move' in message
    assert reported()[0] == OK
    shown[0] = SimpleNamespace(name='b', std=None)
    assert reported()[0] == WARN


@pytest.mark.parametrize(('window', 'wait'), [(0.1, 0.02), (0.2, 0.05)])
def test_the_delay_is_what_the_settings_choose_and_what_was_measured(window, wait):
    """From the stamp to the publication: the wait for the order of stamps and half a window."""
    engine = Engine(PENDULUM, config(filter__window=window, reorder_window=wait))
    for event in pendulum_events(100):
        engine.push(event)
    health = Health(MERGER)
    for delay_s in (0.1, 0.2, 0.3, 1e6):  # the last is of another clock
        health.note_delay(delay_s)
    for waited_s in (0.0, 0.002):
        health.note_push(0.003 + waited_s, 0.003)
        health.note_callback(0.01 + waited_s, 0.008)
    status = health.statuses(engine, 'node', 1.0, SOURCES)[1]
    assert status.name == 'node: timing'
    assert float(status.values['delay_s_chosen']) == pytest.approx(wait + 0.5 * window, abs=0.02)
    assert float(status.values['delay_s_p50']) == pytest.approx(0.2)
    assert float(status.values['delay_s_max']) == pytest.approx(0.3)
    assert float(status.values['push_ms_max']) == pytest.approx(5.0)
    assert float(status.values['push_cpu_ms_max']) == pytest.approx(3.0)
    assert float(status.values['callback_ms_max']) == pytest.approx(12.0)
    assert float(status.values['callback_cpu_ms_max']) == pytest.approx(8.0)


def test_only_joints_of_the_robot_are_told_to_have_no_effort():
    """A gripper in the same message or in another needs none; what another driver brings stays."""
    health = Health(JointMerger(('shoulder', 'elbow')))

    def told(**efforts):
        values = frozen_array([*efforts.values()])
        known = None if np.isnan(values).all() else values
        health.note_joints(JointSample(0, tuple(efforts), values, effort=known))
        return health.without_effort

    nan = np.nan
    assert told(finger=nan, elbow=nan, shoulder=1.0) == ('elbow',)
    assert told(finger=nan, elbow=nan, shoulder=nan) == ('shoulder', 'elbow')
    assert told(finger=1.0) == told(finger=nan) == ('shoulder', 'elbow')
    assert told(shoulder=1.0) == ('elbow',)
    assert told(elbow=1.0) == ()
