"""`sgp replay`: a recording through the online engine, with everything it tells."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.apps.identified_robot import nominal_coefficients, write_identified
from sgp_ros.apps.terminal import warned
from sgp_ros.batch.bodies import nearest_bodies
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import is_record, replay
from sgp_ros.engine.results import Step
from sgp_ros.engine.samples import CommandSample, Event, JointSample
from sgp_ros.engine.setting import EFFORT_SOURCES
from sgp_ros.engine.snapshots import restored, take_snapshot
from sgp_ros.errors import ConfigError, NumericalError, RecordingError
from sgp_ros.recordings.model_files import (
    load_model,
    load_parameters,
    save_model,
)
from sgp_ros.recordings.predictions import PredictionTopics, outputs, write_outputs
from sgp_ros.recordings.reader import Recording, open_recording
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.report.figures import History
from sgp_ros.report.files import replacing_results, write_text
from sgp_ros.report.html import write_report
from sgp_ros.report.metrics import Timing, collect_metrics, model_remarks, stream_remarks
from sgp_ros.report.next_steps import after_replay, ending
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.shipped import find_shipped
from sgp_ros.strangers import read_text, readable


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """Choices of a replay.

    Attributes:
        joint_states: topic of the states; None chooses it.
        command: topic of the commands; None chooses it, `none` takes no commands.
        effort: the effort that acts, a key of `EFFORT_SOURCES`; `auto` leaves the settings.
        params: ROS 2 parameter file, or saved model; None takes the robot's, if one is shipped.
        model: saved model to continue from; None starts anew.
        is_learning: whether to learn, or only to predict and score.
        truth: `truth.json` of a simulation to compare the parameters with.
    """

    joint_states: str | None = None
    command: str | None = None
    effort: str = 'auto'
    params: str | None = None
    model: str | None = None
    is_learning: bool = True
    truth: str | None = None


def run_replay(
    bag: str, robot: str, out: Path, *, progress: Callable[[float], None], **options: Any
) -> dict[str, Any]:
    """Replay a recording and write predictions, metrics, report, model and identified robot.

    Args:
        bag: the recording.
        robot: built-in name, robot YAML or URDF.
        out: folder of the results.
        progress: called with the share that is done.
        options: fields of `ReplayOptions`.

    Raises:
        ConfigError: a wrong robot, parameter file, model or truth.
        RecordingError: nothing in the recording can be used.
    """
    chosen = ReplayOptions(**options)
    truth = load_truth(chosen.truth) if chosen.truth else None
    recording = open_recording(bag)
    engine = _make_engine(load_robot(robot), chosen)
    with replacing_results(out, 'replay'):
        metrics = _replay_into(out, engine, recording, chosen, truth, progress)
    print_summary(metrics, truth)
    print(ending(out, after_replay(out)))
    return metrics


def _replay_into(
    out: Path,
    engine: Engine,
    recording: Recording,
    options: ReplayOptions,
    truth: Mapping[str, float] | None,
    progress: Callable[[float], None],
) -> dict[str, Any]:
    """Write all files of a replay and return the content of metrics.json."""
    asked = engine.config
    history, timing = History(), Timing()
    failures: list[str] = []
    with RecordingWriter(out / 'predictions.mcap') as writer:

        def keep(step: Step) -> None:
            history.take(engine, step)
            failures.extend(map(str, step.failures))
            for estimate in step.estimates:
                found = outputs(estimate)
                if found is not None:
                    write_outputs(writer, PredictionTopics(), found)

        run_events(engine, recording, options, keep, timing, progress)
        _check_use(engine, recording, options)
    remarks = [*recording.remarks, *stream_remarks(engine, failures)]
    remark = write_identified_robot(out, engine)
    remarks += [remark] if remark else []
    remarks += model_remarks(engine, asked=asked)
    metrics = collect_metrics(engine, recording.path.name, timing=timing, remarks=remarks)
    write_text(out / 'metrics.json', json.dumps(metrics, indent=1, allow_nan=False) + '\n')
    save_model(out / 'model.npz', take_snapshot(engine))
    write_report(out, engine, history, metrics, truth=truth, steps=after_replay(out))
    return metrics


def run_events(
    engine: Engine,
    recording: Recording,
    options: ReplayOptions,
    on_step: Callable[[Step], None],
    timing: Timing,
    progress: Callable[[float], None],
) -> None:
    """Push every event of a recording, timing each push; obey the changes of a live record."""
    obey = is_record(recording.events(options.joint_states, options.command))
    total = sum(topic.count or 0 for topic in recording.topics)
    stamps: list[int] = []
    began = time.perf_counter()
    replay(
        engine,
        _counted(recording.events(options.joint_states, options.command), total, stamps, progress),
        on_step,
        obey_record=obey,
        push=_timed(engine.push, timing),
    )
    timing.wall_s = time.perf_counter() - began
    if stamps:
        timing.recorded_s = (max(stamps) - min(stamps)) * 1e-9
    progress(1.0)


def _timed(push: Callable[[Event], Step], timing: Timing) -> Callable[[Event], Step]:
    def timed(event: Event) -> Step:
        began = time.perf_counter()
        step = push(event)
        timing.push_s.append(time.perf_counter() - began)
        return step

    return timed


def _counted(
    events: Iterator[Event], total: int, stamps: list[int], progress: Callable[[float], None]
) -> Iterator[Event]:
    for i, event in enumerate(events):
        stamps.append(event.stamp_ns)
        if total and i % 100 == 0:
            progress(min(i / total, 0.99))
        yield event


def load_truth(path: str) -> dict[str, float]:
    """Return the true coefficients of a `truth.json` by name.

    Raises:
        ConfigError: no such file or no coefficients in it.
    """
    with readable(path, ConfigError, 'a truth.json of `sgp simulate`'):
        document = json.loads(read_text(Path(path)))
        return {name: float(c['value']) for name, c in document['coefficients'].items()}


def write_identified_robot(out: Path, engine: Engine) -> str:
    """Write the identified robot: of real bodies, where it has bodies.

    Returns:
        Where none are found the estimate itself is written, and this says so; else empty.
    """
    robot, remark, bodies = engine.robot, '', None
    values, root = engine.information()
    std = np.array([math.inf if p.std is None else p.std for p in engine.parameters()])
    if len(values):
        try:
            bodies = nearest_bodies(robot, values, root, nominal_coefficients(robot))
        except NumericalError as error:
            remark = f'the identified robot may be physically impossible: {error}'
    values = values if bodies is None else bodies.coefficients
    write_identified(out, robot, values, std, has_bodies=not remark)
    return remark


def print_summary(metrics: Mapping[str, Any], truth: Mapping[str, float] | None) -> None:
    """Print scores per joint and parameters with their intervals."""
    samples = metrics['samples']
    refused = {reason: n for reason, n in samples['refused'].items() if n}
    print(f'{samples["read"]} states read, {samples["used"]} used, refused: {refused or "none"}')
    for joint, channels in metrics['joints'].items():
        for channel, score in channels.items():
            alone = metrics['physics_alone'].get(joint, {}).get(channel)
            beside = f', physics alone {alone["nmse"]:.3g}' if alone else ''
            print(
                f'{joint:12s} {channel:12s} nMSE {score["nmse"]:.3g}{beside}; '
                f'{100 * score["coverage95"]:.1f} % inside the 95 % interval'
            )
    for parameter in metrics['parameters']:
        print(_parameter_line(parameter, truth))
    for remark in metrics['remarks']:
        print(warned(f'remark: {remark}'))


def _parameter_line(parameter: Mapping[str, Any], truth: Mapping[str, float] | None) -> str:
    name, std = parameter['name'], parameter['std']
    if std is None:
        return f'{name:12s} not determined by this motion'
    text = f'{name:12s} {parameter["value"]:11.5g} +- {1.96 * std:<9.3g} {parameter["unit"]}'
    if truth and name in truth:
        text += f'   true {truth[name]:.5g}'
    return f'{text}   {parameter["meaning"]}'.rstrip()


def _make_engine(robot: Robot, options: ReplayOptions) -> Engine:
    # settings are shipped for built-in robots; a URDF may have the same name by chance
    is_built_in = options.params is None and not robot.source
    shipped = find_shipped(f'{robot.name}.yaml') if is_built_in else None
    source = options.params or shipped
    settings = load_parameters(source) if source else {}
    config = EngineConfig.from_mapping(settings, robot)
    engine = Engine(robot, config)
    if options.model:
        engine = restored(robot, load_model(Path(options.model)))
        engine.begin_stream()
    if options.effort != 'auto':
        engine.change({'effort.source': EFFORT_SOURCES[options.effort]})
    if not options.is_learning:
        engine.change({'learning.enabled': False})
    return engine


def _check_use(engine: Engine, recording: Recording, options: ReplayOptions) -> None:
    """Raise where not one state could be used, saying why."""
    counts = engine.counts
    if counts.used > 0:
        return
    reasons = {reason: n for reason, n in counts.refused.items() if n}
    found = f'{recording.path}: none of {counts.read} states can be used, refused: {reasons}'
    if reasons.get('unknown_joint'):
        seen: Sequence[str] = next(
            (
                event.names
                for event in recording.events(options.joint_states, options.command)
                if isinstance(event, JointSample)
            ),
            (),
        )
        raise RecordingError(
            f'{found}; its joints are {list(seen)}',
            f'joints {list(engine.robot.joint_names)} of robot {engine.robot.name}',
            'rename them with `joints:` in a robot YAML',
        )
    if reasons.get('unpaired'):
        has_commands = any(
            isinstance(event, CommandSample)
            for event in recording.events(options.joint_states, options.command)
        )
        raise RecordingError(
            found,
            'a command before each state (command.timeout) or effort in the states',
            'raise command.timeout' if has_commands else 'name the topic with --command',
        )
    raise RecordingError(found, 'finite positions with increasing stamps')
