"""Processor time and calls of the engine along a stream: states, equations of motion, one fit."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import sgp_ros
from sgp_proof.bench.rivals import Rivals
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.fitting import fit
from sgp_ros.engine.samples import CommandSample, Event, JointSample, frozen_array
from sgp_ros.physics.term import Motion
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate

START_NS = 1_700_000_000 * 10**9
SECONDS, QUICK_SECONDS = 60.0, 12.0
RATES_HZ = (200.0, 1000.0)
SETTINGS = {'filter.window': 0.1, 'filter.hop': 0.05, 'refit.enabled': False}
COUNTED = 40
"""Equations, and states without one, whose calls are counted."""


def bench_replay(
    rivals: Rivals, progress: Callable[[float], None], *, is_quick: bool
) -> list[dict[str, Any]]:
    """Return one row per robot and rate; there is no rival for a stream."""
    del rivals
    cases = [(name, rate) for name in STREAMS for rate in (RATES_HZ[:1] if is_quick else RATES_HZ)]
    rows = []
    for i, (name, rate) in enumerate(cases):
        rows.append(_row(name, rate, QUICK_SECONDS if is_quick else SECONDS))
        progress((i + 1) / len(cases))
    return rows


def _row(name: str, rate_hz: float, seconds: float) -> dict[str, Any]:
    """Run a stream twice, once for its time and once for its calls near the end."""
    robot, events, settings = STREAMS[name](rate_hz, seconds)
    config = EngineConfig.from_mapping({**SETTINGS, **settings}, robot)
    _timed(Engine(robot, config), events[: len(events) // 3])  # compiles
    engine = Engine(robot, config)
    began, wall = time.thread_time(), time.perf_counter()
    state, equation = _timed(engine, events)
    whole, wall = time.thread_time() - began, time.perf_counter() - wall
    engine.request_refit()
    request = engine.take_fit_request()
    began = time.thread_time()
    if request is not None:
        fit(request)
    state_calls, equation_calls = _counted(engine, STREAMS[name](rate_hz, 1.2 * seconds)[1])
    return {
        'robot': name, 'joints': len(robot.joints), 'coefficients': len(robot.coefficients),
        'rate_hz': rate_hz, 'seconds': seconds, 'equations': engine.counts.estimated,
        'n': engine.buffer_size, 'processor_s': whole, 'wall_s': wall, 'state_us': 1e6 * state,
        'equation_ms': 1e3 * equation, 'state_calls': state_calls,
        'equation_calls': equation_calls, 'fit_s': time.thread_time() - began,
    }  # fmt: skip


def _timed(engine: Engine, events: list[Event]) -> tuple[float, float]:
    """Return the median processor time of a push without an equation, and with one [s]."""
    times: tuple[list[float], list[float]] = ([], [])
    for event in events:
        began = time.thread_time()
        step = engine.push(event)
        times[bool(step.estimates)].append(time.thread_time() - began)
    engine.flush()
    return tuple(float(np.median(x)) if x else float('nan') for x in times)  # type: ignore[return-value]  # two


def _counted(engine: Engine, events: list[Event]) -> tuple[int, int]:
    """Return the median of calls within the package, without an equation and with one."""
    later = [event for event in events if event.stamp_ns > (engine.order.newest_ns or 0)]
    calls: tuple[list[int], list[int]] = ([], [])
    for event in later:
        found, step = calls_of(lambda e=event: engine.push(e))
        calls[bool(step.estimates)].append(found)
        if min(map(len, calls)) >= COUNTED:
            break
    return tuple(int(np.median(x)) if x else 0 for x in calls)  # type: ignore[return-value]  # two


def calls_of(work: Callable[[], Any]) -> tuple[int, Any]:
    """Return how many functions of the package were called, and what `work` returned."""
    package, calls = str(Path(sgp_ros.__file__).parent), 0

    def count(frame: Any, kind: str, _: object) -> None:
        nonlocal calls
        calls += kind == 'call' and frame.f_code.co_filename.startswith(package)

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        found = work()
    finally:
        sys.setprofile(before)
    return calls, found


def _wheel(rate_hz: float, seconds: float) -> tuple[Robot, list[Event], dict[str, Any]]:
    run = simulate(
        make_simulation(
            'reaction_wheel', seed=1, controller='sinusoids', rate_hz=rate_hz, start_ns=START_NS
        ),
        seconds,
    )
    events: list[Event] = []
    for stamp, position, command in zip(run.stamps_ns, run.position, run.command, strict=True):
        events.append(CommandSample(int(stamp), frozen_array(command)))
        events.append(JointSample(int(stamp), run.joint_names, frozen_array(position)))
    return load_robot('reaction_wheel'), events, {}


def _arm(rate_hz: float, seconds: float) -> tuple[Robot, list[Event], dict[str, Any]]:
    """Draw a motion of sines; its efforts are those of random coefficients, and what Z is for."""
    robot = load_robot('panda')
    rng, k = np.random.default_rng(0), len(robot.joints)
    t = np.arange(round(seconds * rate_hz)) / rate_hz
    rates = 2.0 * np.pi * rng.uniform(0.1, 0.8, size=(5, k))
    size, phase = rng.uniform(0.05, 0.25, size=(5, k)), rng.uniform(0.0, 2.0 * np.pi, size=(5, k))
    angle = t[:, None, None] * rates + phase
    q = (size * np.sin(angle)).sum(axis=1)
    v = (size * rates * np.cos(angle)).sum(axis=1)
    a = -(size * rates**2 * np.sin(angle)).sum(axis=1)
    w = rng.normal(0.0, 0.05, len(robot.coefficients))
    effort = robot.regressor(Motion(q, v, a, np.zeros_like(q))) @ w + 0.3 * np.sin(3.0 * q)
    effort += rng.normal(0.0, 0.05, size=effort.shape)
    events: list[Event] = [
        JointSample(START_NS + round(1e9 * s), robot.joint_names, *map(frozen_array, row))
        for s, *row in zip(t, q, v, effort, strict=True)
    ]
    return robot, events, {'effort.source': 'state', 'learning.initial': 160}


STREAMS = {'reaction_wheel': _wheel, 'panda': _arm}
"""Robot to its stream: two joints that are commanded, and seven with all measured."""
