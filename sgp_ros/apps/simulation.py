"""`sgp simulate`: a recording of a simulated robot, with the truth beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from sgp_ros.apps.simulated_files import write_simulated, write_truth
from sgp_ros.apps.simulated_robot import find_robot
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.effect_text import parse_physical
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.sensor_text import parse_sensors

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

    Raises:
        ConfigError: a robot, controller, effect or value that does not exist.
    """
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
    out.mkdir(parents=True, exist_ok=True)
    path = out / f'{name}.mcap'
    write_simulated(recording, path, transport, seed=seed)
    truth, motion = write_truth(recording, out)
    n = len(recording.stamps_ns)
    print(simulator.description)
    print(f'{n} samples of {", ".join(recording.joint_names)} in {path}, the truth in {truth}')
    return {
        'recording': str(path), 'truth': str(truth), 'motion': str(motion), 'samples': n,
        'seed': seed,
    }  # fmt: skip
