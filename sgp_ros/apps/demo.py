"""`sgp demo`: identify a simulated robot live over DDS, then prove that a replay agrees."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.apps.live_processes import LiveProcesses, graph_environment
from sgp_ros.apps.replay import ReplayOptions, print_summary, run_events
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.results import Estimate
from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.recordings.messages import Point
from sgp_ros.recordings.predictions import PredictionTopics, outputs
from sgp_ros.recordings.reader import open_recording
from sgp_ros.report.figures import History
from sgp_ros.report.files import replacing_results, write_text
from sgp_ros.report.html import write_report
from sgp_ros.report.metrics import Timing, collect_metrics
from sgp_ros.report.next_steps import after_demo, ending
from sgp_ros.robots.registry import load_robot
from sgp_ros.scratch import Scratch
from sgp_ros.simulation.assembly import make_simulation

ROBOT = 'reaction_wheel_6'
"""The model leaves out viscous friction and back-EMF; the simulated wheel has both."""
_STATES, _COMMAND = '/joint_states', '/command'
_COMMAND_TYPE = 'sensor_msgs/JointState'
_START_LIMIT_S = 30.0
_LEAST_S = 5.0


def run_demo(
    duration: float, seed: int, out: Path, progress: Callable[[float], None]
) -> dict[str, Any]:
    """Run simulator and node as two processes, record, replay, compare, report.

    Args:
        duration: of the live run [s].
        seed: of the simulation.
        out: folder for demo.mcap, metrics.json, report.html and figures.
        progress: called with the share that is done.

    Raises:
        ConfigError: an impossible duration.
        RecordingError: a process ended early or nothing was recorded.
    """
    if not _LEAST_S <= duration <= 3600.0:
        raise ConfigError(f'duration {duration:g} s', f'{_LEAST_S:g} to 3600 s')
    out.mkdir(parents=True, exist_ok=True)
    bag = out / 'demo.mcap'
    print('a simulated reaction wheel and the node, two processes over DDS')
    _run_live(duration, seed, bag, progress)
    robot = load_robot(ROBOT)
    engine = Engine(robot, EngineConfig.from_mapping({}, robot))
    history, timing = History(), Timing()
    options = ReplayOptions(_STATES, _COMMAND)
    recording = open_recording(bag)
    run_events(
        engine, recording, options, lambda step: history.take(engine, step), timing, progress
    )
    comparison = compare(bag, history.estimates)
    truth = _truth(seed)
    remarks = recording.remarks
    metrics = collect_metrics(engine, bag.name, timing=timing, seed=seed, remarks=remarks)
    metrics['live_equals_replay'] = comparison.to_mapping()
    with replacing_results(out, 'demo'):
        write_text(out / 'metrics.json', json.dumps(metrics, indent=1, allow_nan=False) + '\n')
        write_report(
            out, engine, history, metrics, truth=truth,
            checks=[comparison.sentence, _EXPLANATION], steps=after_demo(bag),
        )  # fmt: skip
    print_summary(metrics, truth)
    print(comparison.sentence)
    print(ending(out, after_demo(bag)))
    if not comparison.is_equal:
        raise RecordingError(
            comparison.sentence, 'equality bit for bit', f'report this with {bag}'
        )
    return metrics


_EXPLANATION = (
    'The model contains gravity, the wheel angle and the motor voltage. It lacks the viscous '
    'friction and the back-EMF of the motor, which the simulated wheel has; the process Z learned '
    'them, so that they do not bias the parameters. Compare with the fit of the physics alone.'
)


@dataclass(slots=True)
class Comparison:
    """Live predictions held against replayed ones.

    Attributes:
        compared: numbers compared.
        different: numbers that differ in any bit.
        live: messages in the record.
        replayed: predictions of the replay.
        first: where the first difference is.
    """

    compared: int = 0
    different: int = 0
    live: int = 0
    replayed: int = 0
    first: str = field(default='')

    @property
    def is_equal(self) -> bool:
        """Whether every number agrees to the bit and none is missing."""
        return self.compared > 0 and self.different == 0 and self.live == self.replayed

    @property
    def sentence(self) -> str:
        """Say what was found."""
        if self.is_equal:
            return (
                f'Live and replay agree bit for bit: {self.compared} numbers of {self.live} '
                'messages compared, 0 different.'
            )
        return (
            f'Live and replay differ: {self.different} of {self.compared} numbers, {self.live} '
            f'live and {self.replayed} replayed messages {self.first}'
        )

    def to_mapping(self) -> dict[str, int]:
        """Return the counts for `metrics.json`."""
        return {
            'numbers_compared': self.compared,
            'numbers_different': self.different,
            'live_messages': self.live,
            'replayed_messages': self.replayed,
        }


def compare(bag: Path, estimates: Sequence[Estimate]) -> Comparison:
    """Hold the predictions in a record against replayed estimates, bit for bit."""
    made = [found for found in map(outputs, estimates) if found is not None]
    comparison = Comparison(replayed=3 * len(made))
    topics = PredictionTopics()
    recording = open_recording(bag)
    for topic, points in (
        (topics.prediction, [found.prediction for found in made]),
        (topics.prediction_variance, [found.variance for found in made]),
        (topics.prediction_raw_variance, [found.raw_variance for found in made]),
    ):
        messages = list(recording.messages(topic))
        comparison.live += len(messages)
        for i, ((stamp_ns, message), point) in enumerate(zip(messages, points, strict=False)):
            where = f'at {topic} number {i}, stamp {stamp_ns}'
            for one, other in zip(_live(message), _replayed(point), strict=True):
                _hold(comparison, one, other, where)
    return comparison


def _live(message: Any) -> tuple[np.ndarray, ...]:
    point = message.points[0]
    fields = (point.positions, point.velocities, point.accelerations, point.effort)
    return tuple(np.asarray(values, dtype=np.float64) for values in fields)


def _replayed(point: Point) -> tuple[np.ndarray, ...]:
    return (point.positions, point.velocities, point.accelerations, point.effort)


def _hold(comparison: Comparison, one: np.ndarray, other: np.ndarray, where: str) -> None:
    comparison.compared += max(len(one), len(other))
    if one.tobytes() == other.tobytes():
        return
    same = len(one) == len(other)
    comparison.different += int((one != other).sum()) if same else max(len(one), len(other))
    comparison.first = comparison.first or f'(first {where}: {one} and {other})'


def _run_live(duration_s: float, seed: int, bag: Path, progress: Callable[[float], None]) -> None:
    bag.unlink(missing_ok=True)
    with Scratch() as logs, graph_environment(logs) as environment:
        processes = LiveProcesses(environment)
        try:
            node = processes.start('sgp_ros.ros.sgp_node', {
                'robot': ROBOT, 'command.type': _COMMAND_TYPE,
                'record.path': str(bag.absolute()),
            })  # fmt: skip
            processes.wait_for(node, bag.exists, _START_LIMIT_S, 'to open its record')
            processes.start('sgp_ros.ros.reaction_wheel', {
                'seed': seed, 'command.type': _COMMAND_TYPE,
            })  # fmt: skip
            processes.wait_for(
                node, lambda: bag.stat().st_size > 2000, _START_LIMIT_S, 'to hear the robot'
            )
            began = time.monotonic()
            while (passed := time.monotonic() - began) < duration_s:
                processes.check()
                progress(0.99 * passed / duration_s)
                time.sleep(0.1)
        finally:
            processes.stop()
    processes.check_exit()


def _truth(seed: int) -> dict[str, float]:
    coefficients: Any = make_simulation('reaction_wheel', seed=seed).truth()['coefficients']
    return {name: float(c['value']) for name, c in coefficients.items()}
