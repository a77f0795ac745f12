"""Cost of a push, in calls that no clock and no load of the machine can change."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import sgp_ros
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import JointSample, frozen_array
from test.engine.worlds import INVERSE_PENDULUM, PENDULUM, config, motion, pendulum_events

PACKAGE = str(Path(sgp_ros.__file__).parent)
STATE_CALLS, EQUATION_CALLS = 34, 344
"""Most calls of functions of the package, generators included, that a push may make: one whose
state completes no window, and one that an equation of motion follows. A version without gates and
journal made 36 and 396."""


def _calls(engine, event):
    """Return the calls within the package that a push makes, and the equations that follow."""
    calls = 0

    def count(frame, kind, _):
        nonlocal calls
        calls += kind == 'call' and frame.f_code.co_filename.startswith(PACKAGE)

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        step = engine.push(event)
    finally:
        sys.setprofile(before)
    return calls, len(step.estimates)


def _counted(robot, events, settled):
    engine = Engine(robot, config(robot, refit__enabled=False, filter__hop=0.05))
    for event in events[:settled]:
        engine.push(event)
    return [_calls(engine, event) for event in events[settled:]]


def _measured_events(n):
    t, q, v, m = motion(n, 100.0, 3, noise=1e-5)
    return [
        JointSample(round(1e9 * s) + 1, ('hinge',), *(frozen_array([x]) for x in row))
        for s, *row in zip(t, q, v, m, strict=True)
    ]


@pytest.mark.parametrize(
    ('robot', 'events'),
    [(PENDULUM, pendulum_events(700)), (INVERSE_PENDULUM, _measured_events(700))],
    ids=['commanded', 'measured'],
)
def test_a_push_makes_few_calls(robot, events):
    """Checks of every message and every equation cost calls, and none may come unnoticed."""
    found = _counted(robot, events, len(events) - 100)
    plain = [calls for calls, equations in found if not equations]
    whole = [calls for calls, equations in found if equations == 1]
    assert len(plain) > 50
    assert len(whole) > 5
    assert max(plain) <= STATE_CALLS
    assert np.median(whole) <= EQUATION_CALLS
