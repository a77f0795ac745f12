"""`sgp check`: whether a recording is fit for a diagnosis, and how the robot is connected."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from sgp_ros.apps.recorded import gains_of, read_events
from sgp_ros.batch.contradictions import require_sense
from sgp_ros.batch.recording_check import RecordingCheck, check_recording
from sgp_ros.diagnosis.connected import Connected
from sgp_ros.diagnosis.connecting import connect, with_laws
from sgp_ros.diagnosis.gathered import Knowledge, gather
from sgp_ros.diagnosis.mapping import finding_content
from sgp_ros.diagnosis.result import Finding
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import Event
from sgp_ros.engine.setting import EFFORT_SOURCES
from sgp_ros.errors import ConfigError, SgpError
from sgp_ros.report.check import KINDS, render_check
from sgp_ros.report.diagnosis_text import phrase, plain_name
from sgp_ros.report.files import replacing_results, write_text
from sgp_ros.report.next_steps import Given, after_check, ending
from sgp_ros.robots.nominal import Nominal, nominal_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot


def run_check(
    bag: str, robot: str, out: Path, *, progress: Callable[[float], None],
    joint_states: str | None = None, command: str | None = None, effort: str = 'auto',
    gains: str | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Check a recording; write check.json and a page.

    Args:
        bag: the recording.
        robot: built-in name, robot YAML or model file.
        out: folder of the results.
        progress: called with the share that is done.
        joint_states: topic of the states; None for the one there is.
        command: topic of the commands; None for the one there is.
        effort: the effort that acts, a key of `EFFORT_SOURCES`.
        gains: YAML file of the gains of drives whose commands are positions.

    Raises:
        ConfigError: a robot without nominal bodies, or given gains that are not its own.
        RecordingError: the recording cannot be read, or its base moves.
    """
    model = load_robot(robot)
    remarks: list[str] = []
    events = read_events(bag, joint_states, command, remarks)
    nominal, known, unknown = _known(model, gains, events, effort, remarks)
    found = check_recording(events, model, None if known is None else known.gains)
    print_check(Path(bag).name, found, remarks)
    content: dict[str, Any] = {'recording': Path(bag).name, 'robot': model.name,
                               **found.content()}  # fmt: skip
    content['remarks'] += [*remarks, *found.refusals]
    setup: Sequence[Finding] = ()
    progress(0.1)
    try:
        if nominal is None or known is None:
            raise ConfigError(unknown)
        require_sense(Path(bag).name, found.refusals)
        recordings = gather({'': events}, {}, nominal.tree, known, holds_out=False)
        connected = connect(recordings, nominal.tree, lambda x: progress(0.1 + 0.8 * x))
        if connected.findings:  # a law that no list has may look like one of these
            connected = with_laws(connected)
    except SgpError as error:
        said = f'The set-up cannot be checked: {error}'
        content |= {'setup': None, 'is_fit': False}
        content['remarks'].append(said)
        print(f'  remark    {said}')
    else:
        content |= {
            'setup': [finding_content(f) for f in connected.findings],
            'equivalents': [[list(x) for x in e.effects] for e in connected.equivalents],
            'is_fit': not found.missing,
        }
        content['remarks'] += connected.remarks
        setup = connected.findings
        _print_setup(connected)
    steps = after_check(Given(bag, robot, gains), is_fit=content['is_fit'] and not setup)
    with replacing_results(out, 'check'):
        write_text(out / 'check.json', json.dumps(content, indent=1, allow_nan=False) + '\n')
        write_text(out / 'report.html', render_check(content, events, model, setup, steps))
    print(ending(out, steps))
    progress(1.0)
    return content


def _known(
    model: Robot, gains: str | None, events: Sequence[Event], effort: str, remarks: list[str]
) -> tuple[Nominal | None, Knowledge | None, str]:
    """Return what is known of the machine; None and why where it is not enough."""
    nominal = None
    try:
        nominal = nominal_model(model)
        stated = gains_of(gains, nominal, events, remarks)
    except SgpError as error:
        if nominal is not None and gains is not None:  # what was given is refused
            raise
        return None, None, str(error)
    config = EngineConfig(effort_source=EFFORT_SOURCES[effort])
    return nominal, Knowledge(nominal.robot, nominal.stated, config, stated), ''


def print_check(name: str, found: RecordingCheck, remarks: Sequence[str] = ()) -> None:
    """Print what a recording holds, and what was said when it was read."""
    print(f'{name}: {found.states} states in {found.seconds:.4g} s, {found.rate_hz:.4g} Hz, '
          f'jitter {100.0 * found.jitter:.2f} %')  # fmt: skip
    if found.commands:
        kinds = ', '.join(KINDS.get(kind, kind) for kind in found.command_kinds)
        print(f'  commands  {found.commands} at {found.command_rate_hz:.4g} Hz, {kinds}')
    for joint, j in found.joints.items():
        channels = [c for c in ('velocity', 'effort') if getattr(j, c) > 0.0]
        share = '' if j.range_share != j.range_share else f' ({100.0 * j.range_share:.0f} %)'
        print(f'  joint     {joint}: {j.lower:.4g} to {j.upper:.4g}{share}, {j.reversals} '
              f'reversals, rms speed {j.speed:.3g}; position'
              f'{"".join(f", {c}" for c in channels)}')  # fmt: skip
    for remark in (*found.remarks, *remarks):
        print(f'  remark    {remark}')


def _print_setup(connected: Connected) -> None:
    if not connected.findings:
        print('  set-up    no set-up error found')
    for f in connected.findings:
        print(f'  set-up    p {f.probability:.2f}  {f.joint}: {phrase(f)}')
    for e in connected.equivalents:
        rival = ' with '.join(f'{plain_name(effect)} of {joint}' for joint, effect in e.effects)
        print(f'  alike     this motion cannot separate missing physics from {rival}')
    for remark in connected.remarks:
        print(f'  remark    {remark}')
