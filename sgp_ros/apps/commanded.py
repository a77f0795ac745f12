"""`sgp simulate ROBOT --commands REC`: a robot under the commands of a recording, beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.apps.recorded import checked, gains_of, read_events
from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import RawTrajectory
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import first_scale
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.gathered import Knowledge
from sgp_ros.diagnosis.prove.overlay import overlays
from sgp_ros.diagnosis.prove.prediction import FinalModel
from sgp_ros.diagnosis.shown import Overlay
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import CommandSample, Event, JointSample, frozen_array
from sgp_ros.errors import ConfigError
from sgp_ros.recordings.messages import JOINT_STATE
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.report.files import replacing_results, write_text
from sgp_ros.report.overlay import overlay_content, write_overlay, write_series
from sgp_ros.report.replayed import errors_text, render_replayed
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.nominal import Nominal, nominal_model
from sgp_ros.robots.registry import load_robot

SIMULATED, NOMINAL = 'simulated', 'nominal'


def run_commanded(
    robot: str, out: Path, progress: Callable[[float], None], *, commands: str,
    nominal: str | None = None, gains: str | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Replay recorded commands and write the simulated motion beside the measured one.

    Writes `<robot>_replayed.mcap` (the motion of the longest stable replay), `replay.csv`,
    `overlay.json`, `overlay.npz` and a page.

    Args:
        robot: built-in name, robot YAML (such as robot_diagnosed.yaml) or model file.
        out: folder of the results.
        progress: called with the share that is done.
        commands: the recording.
        nominal: another robot that is replayed beside it; None without.
        gains: YAML file of gains; None for those of the robot, where commands are targets.

    Raises:
        ConfigError: a robot without bodies, or two of other joints.
        RecordingError: nothing in the recording can be used.
    """
    model = nominal_model(load_robot(robot))
    sides = {SIMULATED: model}
    if nominal is not None:
        sides[NOMINAL] = nominal_model(load_robot(nominal))
    remarks: list[str] = []
    events = read_events(commands, None, None, remarks)
    stem, found, raw = Path(commands).stem, dict[str, Overlay](), None
    for name, side in sides.items():
        if side.tree.moving_names != model.tree.moving_names:
            raise ConfigError(
                f'{nominal} has the joints {list(side.tree.moving_names)}',
                f'those of {robot}, {list(model.tree.moving_names)}',
            )
        said: list[str] = []
        stated = gains_of(gains, side, events, said)
        if name == SIMULATED:
            checked({stem: events}, side.robot, stated, said)
            remarks += said
        raw, found[name] = _replayed(side, events, stated, name)
        progress(len(found) / (len(sides) + 1))
    assert raw is not None
    both = _beside(found)
    return _write(out, model, stem, both, events, raw, remarks)


def _replayed(
    nominal: Nominal, events: Sequence[Event], gains: Gains | None, name: str
) -> tuple[RawTrajectory, Overlay]:
    """Return a recording on its grid and the motion of a robot with all it states over it."""
    known = Knowledge(nominal.robot, nominal.stated, EngineConfig(), gains)
    raw = known.collected(events)
    equations = make_equations(raw, nominal.tree, choose_bandwidth(raw, nominal.tree))
    start = first_scale(equations)
    plain = fit(Columns(equations), (), start, is_free=False, steps=1)
    final = FinalModel(plain, plain, equations, ())
    found = overlays(final, {name: raw}, nominal.tree, (name,)).get(name)
    if found is None:
        raise ConfigError('settled points', 'a recording of a motion')
    return raw, found


def _beside(found: dict[str, Overlay]) -> Overlay:
    """Return the overlay of all robots, the nominal one first."""
    first, order = found[SIMULATED], [n for n in (NOMINAL, SIMULATED) if n in found]
    modes = [m for m in first.replays if all(m in found[n].replays for n in order)]
    return replace(
        first,
        efforts={n: found[n].efforts[n] for n in order},
        replays={m: {n: found[n].replays[m][n] for n in order} for m in modes},
    )


def _write(
    out: Path, model: Nominal, stem: str, found: Overlay, events: Sequence[Event],
    raw: RawTrajectory, remarks: Sequence[str],
) -> dict[str, Any]:  # fmt: skip
    joints = model.tree.moving_names
    units = tuple('N' if p else 'N m' for p in model.tree.is_prismatic[: model.tree.size])
    path = out / f'{model.robot.name}_replayed.mcap'
    shown = {stem: found}
    content: dict[str, Any] = overlay_content(joints, units, shown)
    with replacing_results(out, 'simulate'):
        write_overlay(out, joints, units, shown)
        write_series(out / 'replay.csv', joints, found)
        mode = _longest(found)
        if mode is not None:
            _record(path, model, found.replays[mode][SIMULATED].position, found, events, raw)
        write_text(out / 'report.html', render_replayed(model.robot.name, stem, joints, units,
                                                        found, remarks))  # fmt: skip
    print(f'{stem} replayed through {model.robot.name}: rms error of the position')
    print(errors_text(joints, found))
    for said in remarks:
        print(f'  remark    {said}')
    if mode is None:
        print('  remark    no replay was stable: no recording was written')
    else:
        print(f'motion of {mode} in {path}')
    return {**content, 'recording': None if mode is None else str(path)}


def _longest(found: Overlay) -> str | None:
    """Return the longest replay of the robot that is stable."""
    stable = [m for m, x in found.replays.items() if np.isfinite(x[SIMULATED].rms).all()]
    return stable[-1] if stable else None


def _record(
    path: Path, model: Nominal, position: np.ndarray, found: Overlay, events: Sequence[Event],
    raw: RawTrajectory,
) -> None:  # fmt: skip
    """Write a motion (N, k) and what drove it, on the clock of the recording."""
    joints = model.tree.moving_names
    rows = np.flatnonzero(np.isfinite(position).all(axis=1))
    stamps = raw.start_ns + np.round(found.time * 1e9).astype(np.int64)
    given = [
        e for e in events
        if isinstance(e, CommandSample) and stamps[rows[0]] <= e.stamp_ns <= stamps[rows[-1]]
    ]  # fmt: skip
    states = [
        JointSample(
            int(stamps[i]), joints, frozen_array(position[i]),
            effort=None if given else frozen_array(found.effort[i]),
        )
        for i in rows
    ]  # fmt: skip
    driven = tuple(j.name for j in model.robot.joints if j.is_actuated)
    named = [replace(e, names=e.names or driven) for e in given]
    all_events: list[JointSample | CommandSample] = [*named, *states]
    with RecordingWriter(path, command_type=JOINT_STATE) as writer:
        for event in sorted(all_events, key=lambda e: e.stamp_ns):
            writer.write_event(event)
