"""Laws of what /diagnostics says of the model; no graph is needed."""

from __future__ import annotations

import dataclasses

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import CommandSample
from sgp_ros.ros.health import Health
from sgp_ros.ros.verdict import OK, WARN
from test.engine.worlds import PENDULUM, config, pendulum_events

SOURCES = {'joint_states': ('/joint_states', 1), 'command': ('/command', 1)}


def _fit_status(events):
    engine = Engine(PENDULUM, config(buffer__budget=60))
    health = Health()
    for event in events:
        health.note_estimates(engine.push(event).estimates, 'acceleration')
    statuses = health.statuses(engine, 'node', 1.0, SOURCES)
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
