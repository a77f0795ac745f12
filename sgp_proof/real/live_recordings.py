"""Real recordings through `sgp replay` and through the node over DDS, number by number.

    python -m sgp_proof.real.live_recordings [NAME ...]

The recorded states are published with their own stamps, at the recorded rate or a stated multiple
of it, to a real node in another process. What the node predicted is held against a replay of what
it recorded, bit for bit; its scores stand beside those of `sgp replay` of the whole recording,
which fits hyper-parameters at the sample counts, where the node puts them in force when they are
ready. The simple pendulum's recordings are cut before hands push it.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import rclpy
from sensor_msgs.msg import JointState

from sgp_proof.environment import environment
from sgp_ros.apps.demo import compare
from sgp_ros.apps.live_processes import LiveProcesses, graph_environment
from sgp_ros.apps.parameter_file import load_parameters
from sgp_ros.apps.replay import ReplayOptions, run_events
from sgp_ros.cli import main as sgp
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import JointSample
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.report.metrics import Timing, collect_metrics
from sgp_ros.robots.registry import load_robot
from sgp_ros.ros.publications import joint_state

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / 'shared' / 'data'
RESULT = Path(__file__).parent / 'results' / 'live_recordings.json'
NODE = 'sgp_ros.ros.sgp_node'
WALL_S = 20.0
"""Longest stretch that is played [s of the clock on the wall]."""
_START_LIMIT_S, _QUIET_S = 30.0, 2.5
_SECOND_NS = 1_000_000_000
DOUBLE = 'dfki_double_pendulum/design_{}__sys_id__trajectory_00.npz'
SIMPLE = 'dfki_simple_pendulum/{}.csv'


@dataclass(frozen=True)
class Case:
    """A recording, its robot and its settings.

    `speed` is in multiples of the recorded rate, `seconds` cuts the recording.
    """

    file: str
    robot: str
    config: str
    mapping: str = ''
    speed: float = 1.0
    seconds: float | None = None


CASES = {
    'emps': Case('emps/emps_id.csv', 'linear_axis', 'linear_axis', 'emps'),
    'panda': Case('panda/panda_exciting.npz', 'config/robots/panda.yaml', 'panda', 'panda'),
    # Its first half only gathers; four times as fast, all of it fits into the stretch.
    'tiago': Case(
        'tiago/mcap_tiago_dynamic', 'config/robots/tiago_arm.yaml', 'tiago_arm', speed=4.0
    ),
    'double_pendulum_a0': Case(
        DOUBLE.format('A.0__20220815'), 'double_pendulum', 'double_pendulum',
        'dfki_double_pendulum',
    ),
    'double_pendulum_c0': Case(
        DOUBLE.format('C.0__20220914'), 'double_pendulum', 'double_pendulum',
        'dfki_double_pendulum',
    ),
    'simple_pendulum': Case(
        SIMPLE.format('energy_shaping'), 'simple_pendulum', 'simple_pendulum',
        'dfki_simple_pendulum', seconds=3.9,
    ),
    'simple_pendulum_1kg': Case(
        SIMPLE.format('energy_shaping_1kg'), 'simple_pendulum', 'simple_pendulum',
        'dfki_simple_pendulum', seconds=7.0,
    ),
}  # fmt: skip


def _bag(case, folder):
    """Return the recording as a bag, imported where it is a table."""
    if not case.mapping:
        return DATA / case.file
    bag = imported(case.file, case.mapping, folder)
    return bag if case.seconds is None else cut_bag(bag, case.seconds)


def imported(file, name_of_map, folder):
    """Return a table of the shared data as a bag."""
    mapping = ROOT / 'config' / 'import' / f'{name_of_map}.yaml'
    if sgp(['import', str(DATA / file), '--map', str(mapping), '--out', str(folder)]):
        raise SystemExit(f'{file} cannot be imported')
    return folder / f'{Path(file).stem}.mcap'


def cut_bag(bag, seconds):
    """Return a bag of the first seconds of another one."""
    events = list(open_recording(bag).events())
    cut = bag.with_name(f'{bag.stem}_{seconds:g}s.mcap')
    with RecordingWriter(cut) as writer:
        for event in events:
            if event.stamp_ns - events[0].stamp_ns <= 1e9 * seconds:
                writer.write_event(event)
    return cut


def _replayed(case, bag, folder):
    """Run `sgp replay` as a user would; return its metrics."""
    out = folder / 'replay'
    arguments = ['--robot', _robot(case), '--params', str(_config(case)), '--out', str(out)]
    if sgp(['replay', str(bag), *arguments]):
        raise SystemExit(f'{bag} cannot be replayed')
    return json.loads((out / 'metrics.json').read_text(encoding='utf-8'))


def _robot(case):
    return str(ROOT / case.robot) if case.robot.endswith('.yaml') else case.robot


def _config(case):
    return ROOT / 'config' / f'{case.config}.yaml'


def _play(case, bag, record, graph):
    """Publish the recording to a node that records; return the number of states published."""
    processes = LiveProcesses(graph)
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=int(graph['ROS_DOMAIN_ID']))
    player = rclpy.create_node('player', context=context)
    try:
        settings = load_parameters(_config(case))
        node = processes.start(NODE, {
            **settings, 'robot': _robot(case), 'command.type': 'none',
            'record.path': str(record), 'qos.depth': 5000,
        })  # fmt: skip
        publisher = player.create_publisher(JointState, 'joint_states', 5000)
        processes.wait_for(
            node, publisher.get_subscription_count, _START_LIMIT_S, 'to listen to the player'
        )
        processes.wait_for(node, record.exists, _START_LIMIT_S, 'to open its record')
        count = _publish(publisher, open_recording(bag).events(), case.speed)
        end = time.monotonic() + _QUIET_S
        processes.wait_for(node, lambda: time.monotonic() > end, 2 * _QUIET_S, 'to take it all')
    finally:
        processes.stop()
        player.destroy_node()
        context.try_shutdown()
    processes.check_exit()
    return count


def _publish(publisher, events, speed):
    states = (event for event in events if isinstance(event, JointSample))
    first = next(states)
    shift = _SECOND_NS if first.stamp_ns == 0 else 0  # a stamp of zero says that there is none
    began, count = time.monotonic(), 0
    for sample in itertools.chain([first], states):
        due = began + 1e-9 * (sample.stamp_ns - first.stamp_ns) / speed
        if due - began > WALL_S:
            break
        time.sleep(max(0.0, due - time.monotonic()))
        publisher.publish(joint_state(replace(sample, stamp_ns=sample.stamp_ns + shift)))
        count += 1
    return count


def _record_replayed(case, record):
    """Replay what the node recorded; return the comparison and the metrics."""
    robot = load_robot(_robot(case))
    engine = Engine(robot, EngineConfig.from_mapping(load_parameters(_config(case)), robot))
    estimates, timing = [], Timing()
    options = ReplayOptions('/joint_states', 'none')
    run_events(
        engine, open_recording(record), options,
        lambda step: estimates.extend(step.estimates), timing, lambda _share: None,
    )  # fmt: skip
    metrics = collect_metrics(engine, record.name, timing=timing)
    return compare(record, estimates), metrics


def _run(name, case, graph):
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        bag = _bag(case, place)
        replay = _replayed(case, bag, place)
        record = place / 'live.mcap'
        published = _play(case, bag, record, graph)
        comparison, live = _record_replayed(case, record)
    print(f'{name}: {comparison.sentence}')
    return {
        'recording': bag.name,
        'robot': case.robot,
        'params': f'config/{case.config}.yaml',
        'speed': case.speed,
        'seconds': case.seconds,
        'replay': {key: replay[key] for key in ('samples', 'joints', 'parameters', 'timing')},
        'live': {'published': published}
        | {key: live[key] for key in ('samples', 'joints', 'parameters')},
        'live_equals_replay': comparison.to_mapping(),
    }


def main() -> None:
    """Run the named recordings, or all, and write the result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('names', nargs='*', choices=[*CASES, []], default=[])
    names = parser.parse_args().names or list(CASES)
    found = {}
    if RESULT.is_file():
        found = json.loads(RESULT.read_text(encoding='utf-8'))['recordings']
    with tempfile.TemporaryDirectory() as logs, graph_environment(Path(logs)) as graph:
        graph['PYTHONPATH'] = str(ROOT)
        os.environ.update(graph)
        for name in names:
            found[name] = _run(name, CASES[name], graph)
    result = {
        'schema': 1, 'environment': environment(), 'wall_s': WALL_S,
        'recordings': {name: found[name] for name in CASES if name in found},
    }  # fmt: skip
    RESULT.write_text(json.dumps(result, indent=1, allow_nan=False) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
