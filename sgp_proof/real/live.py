"""Real recordings through `sgp replay` and through the node over DDS, compared number by number.

    python -m sgp_proof.real.live [NAME ...]

The recorded states are published with their own stamps, at the recorded rate or a stated multiple
of it, to a real node in another process. What the node predicted is held against a replay of what
it recorded, bit for bit; its scores stand beside those of `sgp replay` of the whole recording,
which fits hyper-parameters at the sample counts, where the node puts them in force when they are
ready. The simple pendulum's recordings are cut before hands push it.
"""

from __future__ import annotations

import itertools
import json
import os
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import rclpy
from sensor_msgs.msg import JointState

from sgp_proof.real.recordings import MACHINES
from sgp_proof.result_files import ROOT, make_parser, read_result, write_result
from sgp_ros.apps.demo import compare
from sgp_ros.apps.live_processes import LiveProcesses, graph_environment
from sgp_ros.apps.replay import ReplayOptions, run_events
from sgp_ros.cli import main as sgp
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import JointSample
from sgp_ros.recordings.messages import joint_state_message
from sgp_ros.recordings.model_files import load_parameters
from sgp_ros.recordings.reader import open_recording
from sgp_ros.report.metrics import Timing, collect_metrics
from sgp_ros.ros.messages import new_message

NODE = 'sgp_ros.ros.sgp_node'
WALL_S = 20.0
"""Longest stretch that is played [s of the clock on the wall]."""
_START_LIMIT_S, _QUIET_S = 30.0, 2.5
_SECOND_NS = 1_000_000_000


def _replayed(case, bag, folder):
    """Run `sgp replay` as a user would; return its metrics."""
    out = folder / 'replay'
    arguments = ['--robot', case.robot_argument, '--params', str(case.params), '--out', str(out)]
    if sgp(['replay', str(bag), *arguments]):
        raise SystemExit(f'{bag} cannot be replayed')
    return json.loads((out / 'metrics.json').read_text(encoding='utf-8'))


def _play(case, bag, record, graph):
    """Publish the recording to a node that records; return the number of states published."""
    processes = LiveProcesses(graph)
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=int(graph['ROS_DOMAIN_ID']))
    player = rclpy.create_node('player', context=context)
    try:
        settings = load_parameters(case.params)
        node = processes.start(NODE, {
            **settings, 'robot': case.robot_argument, 'command.type': 'none',
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
        shifted = replace(sample, stamp_ns=sample.stamp_ns + shift)
        publisher.publish(joint_state_message(new_message, shifted))
        count += 1
    return count


def _record_replayed(case, record):
    """Replay what the node recorded; return the comparison and the metrics."""
    robot = case.load_robot()
    engine = Engine(robot, EngineConfig.from_mapping(load_parameters(case.params), robot))
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
        bag = case.bag(place)
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
    arguments = make_parser(__doc__, 'live_recordings', MACHINES).parse_args()
    found = read_result(arguments.out).get('recordings', {})
    with tempfile.TemporaryDirectory() as logs, graph_environment(Path(logs)) as graph:
        graph['PYTHONPATH'] = str(ROOT)
        os.environ.update(graph)
        for name in arguments.names:
            found[name] = _run(name, MACHINES[name], graph)
    result = {
        'wall_s': WALL_S,
        'recordings': {name: found[name] for name in MACHINES if name in found},
    }  # fmt: skip
    write_result(arguments.out, result)


if __name__ == '__main__':
    main()
