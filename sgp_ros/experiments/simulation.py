"""`sgp simulate`: a recording of a simulated robot, with the truth beside it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from sgp_ros.engine.samples import CommandSample, JointSample
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.report.files import write_text
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.effect_text import parse_physical
from sgp_ros.simulation.recording import simulate

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from sgp_ros.simulation.recording import SimulatedRecording

START_NS = 1_700_000_000_000_000_000
"""Stamp of the first sample: a fixed one, since a recording is a function of its seed."""


def run_simulation(
    robot: str,
    out: Path,
    progress: Callable[[float], None],
    *,
    duration_s: float,
    rate_hz: float | None = None,
    seed: int = 0,
    controller: str | None = None,
    effects: Sequence[str] = (),
    physical: Sequence[str] = (),
) -> dict[str, Any]:
    """Simulate a robot and write `<robot>.mcap` and `truth.json` into `out`.

    Args:
        robot: name of a simulated robot.
        out: folder of the results.
        progress: called with the share that is done.
        duration_s: length [s].
        rate_hz: of sampling and control [Hz]; None for the usual one.
        seed: of all random numbers.
        controller: name; None for the usual one.
        effects: texts such as `coulomb_friction:joint=pole,level=0.01`.
        physical: texts such as `pole_viscosity=0.01`.

    Raises:
        ConfigError: a robot, controller, effect or value that does not exist.
    """
    simulation = make_simulation(
        robot,
        seed=seed,
        rate_hz=rate_hz,
        controller=controller,
        effects=effects,
        physical=parse_physical(physical),
        start_ns=START_NS,
    )
    recording = simulate(simulation, duration_s, progress)
    out.mkdir(parents=True, exist_ok=True)
    path = out / f'{robot}.mcap'
    _write(recording, path)
    truth = out / 'truth.json'
    write_text(truth, json.dumps(recording.truth, indent=1, allow_nan=False) + '\n')
    n = len(recording.stamps_ns)
    print(f'{n} samples of {", ".join(recording.joint_names)} in {path}, the truth in {truth}')
    return {'recording': str(path), 'truth': str(truth), 'samples': n, 'seed': seed}


def _write(recording: SimulatedRecording, path: Path) -> None:
    """Write commands and states; a robot without commands has none."""
    velocity = recording.velocity
    with RecordingWriter(path) as writer:
        for i, stamp in enumerate(recording.stamps_ns):
            if recording.command_joints:
                writer.write_event(
                    CommandSample(int(recording.command_stamps_ns[i]), recording.command[i])
                )
            writer.write_event(
                JointSample(
                    int(stamp),
                    recording.joint_names,
                    recording.position[i],
                    None if velocity is None else velocity[i],
                )
            )
