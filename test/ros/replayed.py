"""Predictions of a record, as the node wrote them and as a replay computes them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rosbags.highlevel import AnyReader
from threadpoolctl import threadpool_limits

from sgp_ros.engine.config import EngineConfig, describe_settings
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.results import Step
from sgp_ros.recordings.predictions import outputs
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot

Numbers = dict[int, tuple[bytes, bytes]]
"""Stamp [ns] to the bytes of predicted accelerations and efforts."""


def recorded_predictions(*paths: Path) -> Numbers:
    """Return what the node wrote into complete files."""
    found: Numbers = {}
    with AnyReader(list(paths)) as reader:
        topics = [c for c in reader.connections if c.topic == '/sgp_node/prediction']
        for connection, _, raw in reader.messages(topics):
            message = reader.deserialize(raw, connection.msgtype)
            stamp = message.header.stamp
            (point,) = message.points
            found[stamp.sec * 10**9 + stamp.nanosec] = (
                point.accelerations.tobytes(), point.effort.tobytes(),
            )  # fmt: skip
    return found


def replayed_predictions(path: Path, given: Mapping[str, object]) -> Numbers:
    """Return what an engine computes from the recorded events, on one thread as the node."""
    robot = load_robot('reaction_wheel')
    names = {setting.name for setting in describe_settings(robot)}
    values = {name: value for name, value in given.items() if name in names}
    engine = Engine(robot, EngineConfig.from_mapping(values, robot))
    found: Numbers = {}

    def note(step: Step) -> None:
        for output in filter(None, map(outputs, step.estimates)):
            point = output.prediction
            found[output.stamp_ns] = (point.accelerations.tobytes(), point.effort.tobytes())

    with threadpool_limits(1):
        replay(engine, open_recording(path).events(), note, obey_record=True)
    return found
