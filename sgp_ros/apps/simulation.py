"""`sgp simulate`: a recording of a simulated robot, with the truth beside it."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.apps.commanded import run_commanded
from sgp_ros.apps.simulated_robot import find_robot
from sgp_ros.engine.samples import CommandSample, JointSample
from sgp_ros.errors import ConfigError
from sgp_ros.recordings.command_types import FLOAT64_ARRAY
from sgp_ros.recordings.messages import JOINT_STATE
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.report.files import replacing_results, write_bytes, write_text
from sgp_ros.report.next_steps import after_simulation, next_lines
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.effect_text import parse_physical
from sgp_ros.simulation.recording import SimulatedRecording, simulate
from sgp_ros.simulation.sensor_text import parse_sensors
from sgp_ros.simulation.transport import DeliveredState, Transport, deliver

START_NS = 1_700_000_000_000_000_000
"""Stamp of the first sample: a fixed one, since a recording is a function of its seed."""


def run_simulation(
    robot: str,
    out: Path,
    progress: Callable[[float], None],
    *,
    duration: float,
    rate: float | None = None,
    seed: int = 0,
    controller: str | None = None,
    effects: Sequence[str] = (),
    physical: Sequence[str] = (),
    sensors: Sequence[str] = (),
    commands: str | None = None,
    nominal: str | None = None,
    gains: str | None = None,
) -> dict[str, Any]:
    """Simulate a robot and write `<robot>.mcap`, `truth.json` and `truth.npz` into `out`.

    Args:
        robot: name of a simulated robot, a URDF file, or a robot YAML.
        out: folder of the results.
        progress: called with the share that is done.
        duration: length [s].
        rate: of sampling and control [Hz]; None for the usual one.
        seed: of all random numbers.
        controller: name; None for the usual one.
        effects: texts such as `coulomb_friction:joint=pole,level=0.01`.
        physical: texts such as `pole_viscosity=0.01`.
        sensors: texts such as `bits=14`.
        commands: recording whose commands are replayed, see `run_commanded`; None to simulate.
        nominal: robot that is replayed beside it.
        gains: of drives in a replay whose commands are targets.

    Raises:
        ConfigError: a robot, controller, effect or value that does not exist.
    """
    if commands is not None:
        return run_commanded(robot, out, progress, commands=commands, nominal=nominal, gains=gains)
    _refuse_given(gains=gains, nominal=nominal)
    found = find_robot(robot)
    simulator, name = found.simulator, found.name
    chosen, transport = parse_sensors(sensors, simulator.sensors, simulator.joints)
    simulation = make_simulation(
        simulator,
        seed=seed,
        rate_hz=rate,
        controller=controller,
        effects=[*found.effects, *effects],
        sensors=chosen,
        physical=parse_physical(physical),
        start_ns=START_NS,
    )
    recording = simulate(simulation, duration, progress)
    recording.truth['transport'] = asdict(transport)
    path = out / f'{name}.mcap'
    with replacing_results(out, 'simulate'):
        write_simulated(recording, path, transport, seed=seed)
        truth, motion = write_truth(recording, out)
    n = len(recording.stamps_ns)
    print(simulator.description)
    joints = ', '.join(recording.joint_names)
    print(f'{n} samples of {joints} in {path}, the true parameters in {truth}')
    print(next_lines(after_simulation(path, robot)))
    return {
        'recording': str(path), 'truth': str(truth), 'motion': str(motion), 'samples': n,
        'seed': seed,
    }  # fmt: skip


def _refuse_given(**options: str | None) -> None:
    """Refuse options of a replay where there are no commands to replay."""
    given = [f'--{name}' for name, value in options.items() if value is not None]
    if given:
        raise ConfigError(
            f'{" and ".join(given)} without --commands',
            'a recording whose commands are replayed',
            'add --commands RECORDING, or leave the option out',
        )


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
    stream = io.BytesIO()
    np.savez(
        stream,
        stamps_ns=recording.stamps_ns,
        position=recording.shown_position,
        velocity=recording.shown_velocity,
        acceleration=recording.true_acceleration,
    )
    write_bytes(motion, stream.getvalue())
    return text, motion
