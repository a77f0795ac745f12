"""Garbage through the engine by seed: no exception, no hang, every event learned or refused.

    python -m sgp_proof.robustness.events --seeds 0:100 --events 10000

Each seed draws a robot, settings and a stream (`sgp_proof.robustness.garbage`) and feeds it to the
fold that the node and `sgp replay` share, fits of hyper-parameters included. After every event the
counts must balance, what waits must be bounded, and no variance may be negative; at the end the
hyper-parameters in force must be settings that the engine accepts, and the state one that it reads
back. Results of several calls add up in one file.
"""

from __future__ import annotations

import resource
import time
import traceback
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from sgp_proof.result_files import make_parser, read_result, seed_range, write_result
from sgp_proof.robustness.garbage import Stream
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.fitting import fit
from sgp_ros.engine.replay import Swap
from sgp_ros.engine.results import Step
from sgp_ros.engine.samples import Event
from sgp_ros.engine.snapshots import restored, take_snapshot
from sgp_ros.robots.registry import load_robot

ROBOTS = ('reaction_wheel', 'toy_pendulum', 'linear_axis', 'simple_pendulum', 'double_pendulum')
SPOILED = (0.0, 0.01, 0.1, 0.5)
LONGEST_S, MOST_KILOBYTES = 10.0, 1 << 20
"""Of the processor [s], which others on a busy computer do not lengthen; and memory."""
MOST_HELD = 60_000
"""Events, states and commands that the engine may keep of a stream."""


class Faults(Counter[str]):
    """Counts of events that must not happen, by kind, with the first seed of each."""

    def note(self, what: str, seed: int) -> None:
        """Count one."""
        if what not in self:
            print(f'seed {seed}: {what}', flush=True)
        self[what] += 1


def run(seed: int, events: int, faults: Faults) -> Engine:
    """Feed one stream and return the engine behind it."""
    rng = np.random.default_rng((seed, 1))
    robot = load_robot(str(rng.choice(ROBOTS)))
    stream = Stream(robot, seed, float(rng.choice(SPOILED)))
    engine = Engine(robot, EngineConfig.from_mapping(stream.settings(), robot))
    for event in stream.events(events):
        began = time.process_time()
        try:
            step = engine.push(event)
            _fit_if_due(engine)
        except Exception as error:  # noqa: BLE001 - any escape is what is looked for
            faults.note(place_of(error), seed)
            return engine
        if time.process_time() - began > LONGEST_S:
            faults.note('longer than 10 s', seed)
        for fault in check(engine, step, event):
            faults.note(fault, seed)
    try:
        end = engine.flush()
        for fault in check(engine, end, None) + check_end(engine):
            faults.note(fault, seed)
    except Exception as error:  # noqa: BLE001 - any escape is what is looked for
        faults.note(place_of(error), seed)
    return engine


def check(engine: Engine, step: Step, _event: Event | None) -> list[str]:
    """Return what is wrong after an event."""
    found, counts = [], engine.counts
    waiting = engine.waiting_events
    if counts.read != counts.used + sum(counts.refused.values()) + waiting[0]:
        found.append('states do not balance')
    if (
        counts.commands_read
        != counts.commands_used + sum(counts.commands_refused.values()) + (waiting[1])
    ):
        found.append('commands do not balance')
    held = sum(waiting) + len(engine.intake.commands.stamps_ns) + len(engine.filter.windows.states)
    if held > MOST_HELD:
        found.append('memory grows without bound')
    if step.failures:
        found += [f'failed: {place_of(failure.error)}' for failure in step.failures]
    for estimate in step.estimates:
        for channel in (estimate.acceleration, estimate.effort):
            for variance in (channel.variance, channel.raw_variance):
                if (variance[np.isfinite(variance)] <= 0.0).any():
                    found.append('a variance that is not positive')
            if not np.isfinite(channel.measured).all():
                found.append('a measurement that is not finite')
    return found


def check_end(engine: Engine) -> list[str]:
    """Return what is wrong with what a stream leaves."""
    found = []
    learned = engine.hyper_settings()
    if learned:
        engine.config.changed(learned, engine.robot)
    again = restored(engine.robot, take_snapshot(engine))
    if again.parameters() != engine.parameters():
        found.append('a snapshot that does not read back')
    if any(not np.isfinite(p.value) for p in engine.parameters()):
        found.append('a parameter that is not finite')
    return found


def _fit_if_due(engine: Engine) -> None:
    request = engine.take_fit_request()
    if request is not None:
        Swap(engine, fit(request)).finish()


def place_of(error: BaseException) -> str:
    """Return kind, place and text of an error."""
    frames = traceback.extract_tb(error.__traceback__)
    at = frames[-1]
    own = next((f for f in reversed(frames) if 'sgp_ros' in f.filename), at)
    return f'{type(error).__name__} in {Path(own.filename).name}:{own.lineno} ({str(error)[:90]})'


def main() -> None:
    """Run the seeds and add what came of them to the result."""
    parser = make_parser(__doc__, 'robust_events')
    parser.add_argument('--seeds', type=seed_range, default=range(20), metavar='FIRST:LAST+1')
    parser.add_argument('--events', type=int, default=2000, help='of each seed')
    arguments = parser.parse_args()
    before = read_result(arguments.out)
    faults, total = Faults(before.get('faults', {})), Counter(before.get('counts', {}))
    for seed in arguments.seeds:
        engine = run(seed, arguments.events, faults)
        total.update(_flat(engine))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    result: dict[str, Any] = {
        'runs': [*before.get('runs', []), {
            'seeds': [arguments.seeds.start, arguments.seeds.stop], 'events': arguments.events,
        }],
        'events': before.get('events', 0) + len(arguments.seeds) * arguments.events,
        'peak_megabytes': max(before.get('peak_megabytes', 0), peak // 1024),
        'counts': dict(total), 'faults': dict(faults),
    }  # fmt: skip
    if peak > MOST_KILOBYTES:
        faults.note('more than 1 GiB', arguments.seeds.start)
    write_result(arguments.out, result)
    print({name: n for name, n in result.items() if name != 'runs'})


def _flat(engine: Engine) -> dict[str, int]:
    counts = engine.counts
    plain = ('read', 'used', 'commands_read', 'commands_used', 'estimated', 'learned', 'refits')
    return {
        **{name: getattr(counts, name) for name in plain},
        **{f'refused {reason}': n for reason, n in counts.refused.items() if n},
        **{f'command refused {reason}': n for reason, n in counts.commands_refused.items() if n},
    }


if __name__ == '__main__':
    main()
