"""Simulated recordings as files: messages in MCAP, the truth in JSON and NPZ."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from sgp_ros.engine.samples import CommandSample, JointSample
from sgp_ros.recordings.command_types import FLOAT64_ARRAY
from sgp_ros.recordings.messages import JOINT_STATE
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.report.files import write_text
from sgp_ros.simulation.recording import SimulatedRecording
from sgp_ros.simulation.transport import DeliveredState, Transport, deliver


def write_simulated(
    recording: SimulatedRecording,
    path: Path,
    transport: Transport | None = None,
    *,
    seed: int = 0,
    command_topic: str = '/command',
) -> None:
    """Write states and commands; a robot without commands has none.

    Args:
        recording: of a simulation.
        path: of the MCAP file.
        transport: what happens to the messages on the way; None for nothing.
        seed: of what happens.
        command_topic: where the commands are.
    """
    transport = transport or Transport()
    kind = JOINT_STATE if transport.has_named_commands else FLOAT64_ARRAY
    with RecordingWriter(path, command_topic=command_topic, command_type=kind) as writer:
        for m in deliver(recording, transport, seed):
            event = (
                JointSample(m.stamp_ns, m.names, m.position, m.velocity, m.effort)
                if isinstance(m, DeliveredState)
                else CommandSample(m.stamp_ns, m.effort, m.names)
            )
            writer.write_event(event, m.log_ns)


def write_truth(recording: SimulatedRecording, folder: Path) -> tuple[Path, Path]:
    """Write `truth.json`, what is true of the robot, and `truth.npz`, its true motion.

    Position, velocity and acceleration are those of the encoders without noise, `(n, k)` at
    `stamps_ns`.
    """
    text, motion = folder / 'truth.json', folder / 'truth.npz'
    write_text(text, json.dumps(recording.truth, indent=1, allow_nan=False) + '\n')
    growing = folder / 'truth.part.npz'
    np.savez(
        growing,
        stamps_ns=recording.stamps_ns,
        position=recording.shown_position,
        velocity=recording.shown_velocity,
        acceleration=recording.true_acceleration,
    )
    growing.replace(motion)
    return text, motion
