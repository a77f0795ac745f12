"""Laws of what /diagnostics says of the model; no graph is needed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.fitting import FitResult
from sgp_ros.engine.joint_merging import JointMerger
from sgp_ros.engine.replay import Swap
from sgp_ros.engine.samples import CommandSample
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


def test_a_robot_that_changed_is_told():
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
def test_the_reason_of_a_refused_fit_is_told(model, evidence, refusal, said):
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
