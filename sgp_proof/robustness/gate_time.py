"""Time that the gates add to a step.

    python -m sgp_proof.robustness.gate_time

Two engines take the same stream in turns of `TURN` events, and each begins every other turn; the
gates of one of them do nothing. Times are those of the processor. A step that completes a window
predicts and learns, the others only take a state or a command: each of these kinds has its median,
and what a second of the stream costs is their sum. `whole steps` is measured the same way:
what it costs that a step on which a bug strikes leaves no trace.
"""

from __future__ import annotations

import contextlib
import time
from unittest import mock

import numpy as np

from sgp_proof.result_files import ROOT, make_parser, write_result
from sgp_ros.engine import windows
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.gate import Gate
from sgp_ros.engine.journal import Journal
from sgp_ros.engine.limits import Limits
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.recordings.model_files import load_parameters
from sgp_ros.robots.registry import load_robot
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate

TURN, WARM_UP_S, MEASURED_S = 200, 20.0, 40.0
SETTINGS = {'buffer.budget': 300, 'refit.enabled': False}
STREAMS = {'reaction_wheel': 1000.0, 'panda': 500.0}
"""Robot to the messages a second of its states."""

NOTHING = {
    'gates': (
        (Gate, 'is_rough', lambda *_: False),
        (Gate, 'is_surprised', lambda *_: False),
        (Gate, 'judge', lambda *_, **__: False),
        (Gate, 'take', lambda *_: None),
        (Limits, 'permit', lambda *_: True),
        (windows, 'fill_roughness', lambda *_: None),
    ),
    'whole steps': (
        (Journal, 'begin', lambda *_: None),
        (Journal, 'note', lambda *_: None),
    ),
}
"""Functions that are measured, and their replacements, which do nothing."""


@contextlib.contextmanager
def _without(part):
    with contextlib.ExitStack() as stack:
        for owner, name, nothing in NOTHING[part]:
            stack.enter_context(mock.patch.object(owner, name, nothing))
        yield


def _events(name, rate_hz):
    """Return the stream of a robot, with commands where it has no measured efforts."""
    if name == 'panda':
        from sgp_proof.streams.live_rate import JOINTS, Machine  # noqa: PLC0415 - needs rclpy

        times = np.arange(round((WARM_UP_S + MEASURED_S) * rate_hz)) / rate_hz
        rows = zip(times, *Machine().signals(times), strict=True)
        return [
            JointSample(10**18 + round(1e9 * t), JOINTS, *(frozen_array(x) for x in signals))
            for t, *signals in rows
        ]
    run = simulate(
        make_simulation(name, seed=0, rate_hz=rate_hz, start_ns=10**18), WARM_UP_S + MEASURED_S
    )
    found = []
    for stamp, position, command in zip(run.stamps_ns, run.position, run.command, strict=True):
        found.append(CommandSample(int(stamp), frozen_array(command)))
        found.append(JointSample(int(stamp), run.joint_names, frozen_array(position)))
    return found


def _turn(engine, events, found):
    for event in events:
        began = time.thread_time_ns()
        step = engine.push(event)
        passed = time.thread_time_ns() - began
        found[2 if step.estimates else isinstance(event, CommandSample)].append(passed)


def _measure(name, part):
    robot = load_robot(name)
    values = {**load_parameters(ROOT / 'config' / f'{name}.yaml'), **SETTINGS}
    config = EngineConfig.from_mapping(values, robot)
    events = _events(name, STREAMS[name])
    first = round(len(events) * WARM_UP_S / (WARM_UP_S + MEASURED_S))
    ways = {'with': contextlib.nullcontext, 'without': lambda: _without(part)}
    engines = {way: Engine(robot, config) for way in ways}
    times = {way: _no_times() for way in ways}
    for number, at in enumerate(range(0, len(events), TURN)):
        for way in sorted(ways, reverse=bool(number % 2)):
            found = times[way] if at >= first else _no_times()
            with ways[way]():
                _turn(engines[way], events[at : at + TURN], found)
    counts = [engine.counts.estimated for engine in engines.values()]
    if len(set(counts)) > 1:
        raise SystemExit(f'{name}: the engines differ, {counts} equations')
    return _row(times, engines['with'])


def _no_times():
    """Return lists for states, commands and equations."""
    return [], [], []


def _row(times, engine):
    numbers = np.array([len(kind) for kind in times['with']])
    medians = {
        way: np.array([1e-3 * float(np.median(kind or [0.0])) for kind in kinds])
        for way, kinds in times.items()
    }
    total = {way: float(numbers @ each) for way, each in medians.items()}
    message = {way: float(numbers[:2] @ each[:2] / numbers[:2].sum())
               for way, each in medians.items()}  # fmt: skip
    return {
        'equations': int(numbers[2]), 'other_steps': int(numbers[:2].sum()),
        'us_message': message,
        'us_equation': {way: float(each[2]) for way, each in medians.items()},
        'growth_equation': float(medians['with'][2] / medians['without'][2] - 1.0),
        'growth': total['with'] / total['without'] - 1.0,
        'refused': engine.counts.implausible,
    }  # fmt: skip


def main():
    """Measure every part on every stream and write the result."""
    parser = make_parser(__doc__, 'robust_gate_time', STREAMS)
    arguments = parser.parse_args()
    found = {}
    for name in arguments.names:
        found[name] = {part: _measure(name, part) for part in NOTHING}
        print(name, found[name], flush=True)
    write_result(
        arguments.out,
        {'rates_hz': STREAMS, 'measured_s': MEASURED_S, **SETTINGS, 'streams': found},
    )


if __name__ == '__main__':
    main()
