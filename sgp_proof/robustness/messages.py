"""Messages of all kinds into the callbacks of a node, by seed: nothing escapes, all is counted.

    python -m sgp_proof.robustness.messages --seeds 0:100 --messages 10000

Each seed draws a robot, settings, a type of commands and a stream of
`sgp_proof.robustness.garbage`, makes a node, and hands it the messages as the middleware would:
wrong names, lengths, numbers and stamps, several publishers with a part of the joints, changed
parameters, calls of services, timers. Nothing may reach the last resort of the node, where errors
are counted that only a bug can cause. Results of several calls add up in one file.
"""

from __future__ import annotations

import os
import resource
import tempfile
import time
from array import array
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from sgp_proof.result_files import make_parser, read_result, seed_range, write_result
from sgp_proof.robustness.events import LONGEST_S, MOST_KILOBYTES, SPOILED, Faults, check
from sgp_proof.robustness.garbage import Stream
from sgp_ros.apps.live_processes import graph_environment
from sgp_ros.engine.results import NOTHING
from sgp_ros.engine.samples import CommandSample, JointSample, Reset, SettingsChange
from sgp_ros.recordings.command_types import COMMAND_TYPES, NO_COMMAND
from sgp_ros.recordings.messages import joint_sample
from sgp_ros.robots.registry import load_robot
from sgp_ros.ros.nodes import SgpNode
from sgp_ros.ros.parameters import to_ros

ROBOTS = ('reaction_wheel', 'toy_pendulum', 'double_pendulum')
ODD = 0.05
"""Share of messages that are made odd as messages are, beside what the stream spoils."""
_NAMES = ('', 'x' * 5000, 'pole', 'a/b', '\u00e4\u4f60', 'pole wheel', '{', '%s')
_MOST_PARTS = 20_000


class Fuzzed:
    """A node that is fed without a graph.

    Args:
        seed: of everything.
        folder: for its record.
    """

    def __init__(self, seed: int, folder: Path) -> None:
        self._rng = rng = np.random.default_rng((seed, 6))
        robot = load_robot(str(rng.choice(ROBOTS)))
        self._stream = Stream(robot, seed, float(rng.choice(SPOILED)))
        kind = str(rng.choice([*COMMAND_TYPES, NO_COMMAND]))
        settings = {**self._stream.settings(), 'refit.enabled': False, 'robot': robot.name,
                    'command.type': kind, 'save.path': str(folder / 'model.npz')}  # fmt: skip
        if rng.integers(2):
            settings['record.path'] = str(folder / f'run{seed}.mcap')
        self._node = SgpNode(parameter_overrides=[
            Parameter(name, value=to_ros(value)) for name, value in settings.items()
        ])  # fmt: skip
        self._kind = kind
        self.identification: Any = self._node._identification
        self.given: Counter[str] = Counter()

    @property
    def engine(self) -> Any:
        """The engine behind the node."""
        return self.identification._session.engine

    def close(self) -> None:
        """End the node."""
        self._node.destroy_node()

    def steps(self, n: int) -> Iterator[str]:
        """Hand over n messages, and what else reaches a node; yield the kind of each."""
        for event in self._stream.events(n):
            if isinstance(event, JointSample):
                self._hear('state', joint_sample, self._state(event))
                yield 'state'
            elif isinstance(event, CommandSample) and self._kind != NO_COMMAND:
                convert = COMMAND_TYPES[self._kind].decode
                self._hear('command', convert, self._command(event))
                yield 'command'
            elif isinstance(event, SettingsChange):
                self._change(event)
                yield 'parameter'
            elif isinstance(event, Reset):
                self._call()
                yield 'service'
            if self._rng.random() < 0.005:
                self._tick()
                yield 'timer'

    def _hear(self, kind: str, convert: Any, message: Any) -> None:
        self.given[kind] += 1
        self.identification._guarded(self.identification._hear, convert, message)

    def _state(self, sample: JointSample) -> JointState:
        names, velocity, effort = list(sample.names), sample.velocity, sample.effort
        fields = [sample.position, () if velocity is None else velocity,
                  () if effort is None else effort]  # fmt: skip
        if self._rng.random() < ODD:
            names, fields = self._odd(names, fields)
        message = JointState(name=names)
        self._stamp(message, sample.stamp_ns)
        message.position, message.velocity, message.effort = (array('d', x) for x in fields)
        return message

    def _odd(self, names: list[str], fields: list[Any]) -> tuple[list[str], list[Any]]:
        """Return a part of the joints, others, none, very many, or some twice."""
        which = int(self._rng.integers(6))
        if which == 0:
            keep = [j for j in range(len(names)) if self._rng.integers(2)]
            return [names[j] for j in keep], [[x[j] for j in keep if j < len(x)] for x in fields]
        if which == 1:
            return [*names, str(self._rng.choice(_NAMES))], [[*x, 0.5] for x in fields]
        if which == 2:
            return [str(self._rng.choice(_NAMES)) for _ in names], fields
        if which == 3:
            return [], [[], [], []]
        if which == 4:
            return names + [f'j{i}' for i in range(3000)], [[*x, *[0.1] * 3000] for x in fields]
        return [*names, *names], [[*x, *x] for x in fields]

    def _stamp(self, message: Any, stamp_ns: int) -> None:
        sec, nanosec = divmod(stamp_ns, 10**9)
        stamp = message.header.stamp
        if -(2**31) <= sec < 2**31:
            stamp.sec, stamp.nanosec = sec, nanosec
        if self._rng.random() < 0.1 * ODD:
            stamp.nanosec = int(self._rng.integers(2**32))

    def _command(self, command: CommandSample) -> Any:
        """Return a command of the type that the node takes."""
        numbers = array('d', command.effort)
        names = list(command.names or ())
        if self._rng.random() < ODD:
            names, (numbers, *_) = self._odd(names, [numbers, [], []])
            numbers = array('d', numbers)
        if self._kind == 'std_msgs/Float64':
            return Float64(data=numbers[0] if len(numbers) else float('nan'))
        if self._kind == 'std_msgs/Float64MultiArray':
            return Float64MultiArray(data=numbers)
        field = str(self._rng.choice(['effort', 'effort', 'effort', 'position', 'velocity']))
        if self._kind == 'sensor_msgs/JointState':
            message: Any = JointState(name=names, **{field: numbers})
        else:
            plural = {'position': 'positions', 'velocity': 'velocities'}.get(field, field)
            points = [JointTrajectoryPoint(**{plural: numbers})]
            points = points[: int(self._rng.integers(2) or self._rng.random() > ODD)]
            message = JointTrajectory(joint_names=names, points=points * 2)
        self._stamp(message, command.stamp_ns)
        return message

    def _change(self, change: SettingsChange) -> None:
        self.given['parameter'] += 1
        for name, value in change.settings.items():
            if self._node.has_parameter(name) and not name.startswith(('refit', 'save', 'record')):
                self._node.set_parameters([Parameter(name, value=to_ros(value))])

    def _call(self) -> None:
        self.given['service'] += 1
        services = self.identification._services
        name = str(self._rng.choice(['reset', 'learn', 'save', 'cancel', 'diagnose']))
        answer = getattr(services, f'_{name}')
        if name == 'learn':
            request = SetBool.Request(data=bool(self._rng.integers(2)))
            services._guarded(answer, request, SetBool.Response())
        elif name != 'diagnose' or self._rng.integers(20) == 0:  # each takes a process
            services._guarded(answer, Trigger.Request(), Trigger.Response())

    def _tick(self) -> None:
        self.given['timer'] += 1
        node = self.identification
        actions = (node._poll, node._session.flush_record, node._report,
                   node._publish_parameters)  # fmt: skip
        self.identification._guarded(actions[int(self._rng.integers(len(actions)))])

    def faults(self) -> list[str]:
        """Return what is wrong with the node now."""
        session = self.identification._session
        found = [] if self._is_counted() else ['a message that is not counted']
        found += check(self.engine, NOTHING, None)
        if session.health.failures:
            found.append(session.health.first_failure)
            session.health.failures, session.health.first_failure = 0, ''
        merger = session._merger
        if sum(len(source.parts) for source in merger.sources.values()) > _MOST_PARTS:
            found.append('messages wait without bound')
        return found

    def _is_counted(self) -> bool:
        """Whether every message became a sample, or is counted where it did not."""
        session = self.identification._session
        received = session.health._totals(self.engine.counts)
        return received['messages'] + received['commands_read'] + received['unreadable'] == (
            self.given['state'] + self.given['command']
        )


def run(seed: int, messages: int, folder: Path, faults: Faults) -> Counter[str]:
    """Feed one node; return what became of the messages."""
    fuzzed = Fuzzed(seed, folder)
    try:
        began = time.process_time()
        for i, kind in enumerate(fuzzed.steps(messages)):
            if time.process_time() - began > LONGEST_S:
                faults.note(f'{kind}: longer than 10 s', seed)
            if i % 50 == 0 or fuzzed.identification._session.health.failures:
                for fault in fuzzed.faults():
                    faults.note(fault, seed)
            began = time.process_time()
        for fault in fuzzed.faults():
            faults.note(fault, seed)
        totals = fuzzed.identification._session.health._totals(fuzzed.engine.counts)
        return fuzzed.given + Counter({k: v for k, v in totals.items() if v})
    finally:
        fuzzed.close()


def main() -> None:
    """Run the seeds and add what came of them to the result."""
    parser = make_parser(__doc__, 'robust_messages')
    parser.add_argument('--seeds', type=seed_range, default=range(5), metavar='FIRST:LAST+1')
    parser.add_argument('--messages', type=int, default=2000, help='of each seed')
    parser.add_argument('--minutes', type=float, default=1e9, help='after which no seed begins')
    arguments = parser.parse_args()
    before = read_result(arguments.out)
    faults, total = Faults(before.get('faults', {})), Counter(before.get('counts', {}))
    end, done = time.monotonic() + 60.0 * arguments.minutes, 0
    with tempfile.TemporaryDirectory() as name, graph_environment(Path(name)) as graph:
        os.environ.update(graph)
        rclpy.init()
        for seed in arguments.seeds:
            if time.monotonic() > end:
                break
            total.update(run(seed, arguments.messages, Path(name), faults))
            done += 1
        rclpy.try_shutdown()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    if peak > MOST_KILOBYTES:
        faults.note('more than 1 GiB', arguments.seeds.start)
    write_result(arguments.out, {
        'runs': [*before.get('runs', []), {
            'seeds': [arguments.seeds.start, arguments.seeds.start + done],
            'messages': arguments.messages,
        }],
        'messages': total['state'] + total['command'],
        'peak_megabytes': max(before.get('peak_megabytes', 0), peak // 1024),
        'counts': dict(total), 'faults': dict(faults),
    })  # fmt: skip
    print(total['state'] + total['command'], dict(faults), f'{peak // 1024} MB')


if __name__ == '__main__':
    main()
