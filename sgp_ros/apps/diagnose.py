"""`sgp diagnose`: what physics a recording has that the nominal robot lacks."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sgp_ros.apps.diagnosed_robot import replayed, write_diagnosed
from sgp_ros.apps.finding_file import write_viewed
from sgp_ros.apps.finding_rerun import rerun_package, write_rerun
from sgp_ros.apps.recorded import checked, gains_of, read_events
from sgp_ros.apps.terminal import strong, warned
from sgp_ros.batch.acceptance import USUAL, require_joints
from sgp_ros.batch.recording_check import RecordingCheck
from sgp_ros.diagnosis.compare.open_bodies import open_bodies
from sgp_ros.diagnosis.mapping import diagnosis_mapping
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.diagnosis.result import Diagnosis, Finding, Proof
from sgp_ros.engine.clock import on_one_clock
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import Event, JointSample
from sgp_ros.engine.setting import EFFORT_SOURCES
from sgp_ros.errors import RecordingError
from sgp_ros.report.diagnosis import write_diagnosis, write_predictions
from sgp_ros.report.diagnosis_proof import interval_text
from sgp_ros.report.diagnosis_text import (
    chance,
    differences_text,
    equivalence_sentences,
    parameter_errors_text,
    phrase,
    visibility_sentences,
)
from sgp_ros.report.files import replacing_results, write_text
from sgp_ros.report.next_steps import Given, Steps, after_diagnosis, ending
from sgp_ros.report.overlay import write_overlay
from sgp_ros.report.verdict import simulated, verdict_sentence
from sgp_ros.robots.bare import simulated_model
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.given_bodies import with_bodies
from sgp_ros.robots.models.door import is_model
from sgp_ros.robots.nominal import Nominal, nominal_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot

_RIVALS = 3


@dataclass(frozen=True, slots=True)
class DiagnoseOptions:
    """Inputs of a diagnosis.

    Attributes:
        sim: recording or model file of the simulation that the machine is compared with; None
            for the robot.
        tests: held-out recordings; a part of the training recording without any.
        joint_states: topic of the states; None for the one there is.
        command: topic of the commands; None for the one there is.
        effort: the effort that acts, a key of `EFFORT_SOURCES`; the simulation is read as `auto`.
        gains: YAML file of the gains of drives whose commands are positions; None for efforts.
        bodies: YAML file of bodies that the robot's file lacks; None for none.
        static: whether the recordings hold settled points, one row a pose.
    """

    sim: str | None = None
    tests: Sequence[str] = ()
    joint_states: str | None = None
    command: str | None = None
    effort: str = 'auto'
    bodies: str | None = None
    gains: str | None = None
    static: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Examined:
    """A finished diagnosis, and what it was made from.

    Attributes:
        nominal: the robot that was taken for known.
        found: the diagnosis.
        events: of a motion that a node could meet; empty for settled points and position targets.
        given: the first recording, the robot and the gains.
        effort_source: setting `effort.source`.
        gains: of drives that hold position targets; None where commands are efforts.
        start_ns: stamp of its first state [ns].
        checks: what each recording holds, by stem.
    """

    nominal: Nominal
    found: Diagnosis
    events: Sequence[Event]
    given: Given
    effort_source: str
    gains: Gains | None
    start_ns: int
    checks: Mapping[str, RecordingCheck]


def run_diagnose(
    bag: str | Sequence[str], robot: str, out: Path, *, progress: Callable[[float], None],
    rerun: bool = False, **options: Any,
) -> dict[str, Any]:  # fmt: skip
    """Diagnose one or several recordings; write diagnosis.json, predictions and the report.

    Args:
        bag: the recording, or several of one machine.
        robot: a URDF, or a robot YAML with one, or a built-in name.
        out: folder of the results.
        progress: called with the share that is done.
        rerun: whether a file for the viewer Rerun is written too.
        options: fields of `DiagnoseOptions`.

    Raises:
        SgpError: as `examine` does.
    """
    if rerun:
        rerun_package()  # before minutes of work
    examined = examine(bag, robot, progress=progress, **options)
    content, found = write_examined(out, examined, rerun=rerun)
    print_diagnosis(found)
    print(ending(out, _steps(examined, found, out)))
    return content


def examine(
    bag: str | Sequence[str],
    robot: str,
    *,
    progress: Callable[[float], None] = lambda _share: None,
    **options: Any,
) -> Examined:
    """Diagnose one or several recordings, write nothing.

    Args:
        bag: the recording, or several of one machine.
        robot: a URDF, or a robot YAML with one, or a built-in name.
        progress: called with the share that is done.
        options: fields of `DiagnoseOptions`.

    Raises:
        ConfigError: a robot without nominal bodies or inertias, or a file of another kind.
        RecordingError: nothing in the recording can be used, or nothing moves.
        NumericalError: the motion leaves the equations without a solution.
    """
    chosen = DiagnoseOptions(**options)
    nominal = _nominal(robot, chosen)
    model, tree = nominal.robot, nominal.tree
    simulated = None
    if chosen.sim is not None and is_model(chosen.sim):
        nominal, simulated = simulated_model(chosen.sim, nominal)
        model, tree = nominal.robot, nominal.tree
    open_bodies(model.name, tree)  # refuses one that cannot move before much is read
    remarks = list(nominal.remarks)
    bags = [bag] if isinstance(bag, str) else list(bag)
    events = _read(bags, model, chosen, remarks)
    tests = _read(chosen.tests, model, chosen, remarks, taken=('train', *events))
    gains = gains_of(chosen.gains, nominal, next(iter(events.values())), remarks)
    simulation = None
    if chosen.sim is not None and simulated is None:
        simulation = _events(chosen.sim, model, chosen, remarks)
    source = EFFORT_SOURCES[chosen.effort]
    # settled points are no motion: neither is compared, nor do remarks on a motion apply
    compared, said = (None, []) if chosen.static else (simulation, remarks)
    checks = checked(events, model, gains, said, compared)
    found = diagnose(
        events, model, tree, tests, stated=nominal.stated, holds_out=not chosen.tests,
        is_static=chosen.static, gains=gains, simulation=simulation, simulated=simulated,
        has_overlays=True, progress=progress, config=EngineConfig(effort_source=source),
    )  # fmt: skip
    found = replace(found, remarks=(*found.remarks, *remarks))
    # a node meets one recording of a motion, as it is; settled points are not a motion
    is_met = gains is None and not chosen.static and not found.setup
    first = next(iter(events.values())) if is_met else []
    known, _, _ = on_one_clock(next(iter(events.values())), USUAL)
    start_ns = min(e.stamp_ns for e in known if isinstance(e, JointSample))
    given = Given(bags[0], robot, chosen.gains, bags[-1] if len(bags) > 1 else None)
    return Examined(nominal, found, first, given, source, gains, start_ns, checks)


def _nominal(robot: str, options: DiagnoseOptions) -> Nominal:
    """Return the nominal robot, with the bodies that are given beside its file."""
    nominal = nominal_model(load_robot(robot))
    if options.bodies is None:
        return nominal
    return nominal_model(with_bodies(nominal.robot, options.bodies))


def _read(
    bags: Sequence[str], robot: Robot, options: DiagnoseOptions, remarks: list[str],
    taken: Sequence[str] = (),
) -> dict[str, list[Event]]:  # fmt: skip
    """Return the events of recordings by stem, which must differ from those that are taken."""
    found: dict[str, list[Event]] = {}
    for bag in bags:
        stem = Path(bag).stem
        if stem in found or stem in taken:
            raise RecordingError(
                f'two recordings are named {stem!r}', 'different names', 'rename one'
            )
        found[stem] = _events(bag, robot, options, remarks)
    return found


def write_examined(
    out: Path, examined: Examined, *, rerun: bool = False
) -> tuple[dict[str, Any], Diagnosis]:
    """Write all files; return the content of diagnosis.json, and the diagnosis with new remarks.

    Arguments are those of `run_diagnose`.
    """
    nominal, found = examined.nominal, examined.found
    diagnosed = replace(found, bodies=nominal.without_stated(found.bodies))
    online = replayed(
        nominal.robot, diagnosed, examined.gains, examined.events, examined.effort_source
    )
    if online is not None:
        said = online.remark(found.proofs['train'].nmse_after)
        found = replace(found, remarks=(*found.remarks, said))
    with replacing_results(out, 'diagnose'):
        write_predictions(out, found)
        write_viewed(out, found, nominal.tree, examined.start_ns)
        if rerun:
            write_rerun(out / 'finding.rrd', found, nominal.tree, examined.start_ns)
        write_diagnosed(out, nominal.robot, diagnosed, examined.gains)
        checks = {stem: check.content() for stem, check in examined.checks.items()}
        content = {**diagnosis_mapping(found), 'check': checks}
        if online is not None:
            content['online'] = online.content()
        write_text(out / 'diagnosis.json', json.dumps(content, indent=1, allow_nan=False) + '\n')
        write_overlay(out, found.joints, found.units, found.overlays)
        write_diagnosis(out, found, nominal.tree, _steps(examined, found, out))
    return content, found


def _steps(examined: Examined, found: Diagnosis, out: Path) -> Steps:
    return after_diagnosis(found.verdict, examined.given, out, has_setup_error=bool(found.setup))


def print_diagnosis(found: Diagnosis) -> None:
    """Print the verdict, the findings, their nearest rivals and the proof; `+-` is for 95 %."""
    print(strong(verdict_sentence(found)))
    _print_findings('set-up', found.setup)
    _print_findings('found', found.findings)
    _print_findings('both', found.shared)
    if found.findings:
        for f in found.alternatives[:_RIVALS]:
            print(f'  not       p {chance(f.probability)}  {f.joint}: {phrase(f)}: {f.why}')
    for sentence in equivalence_sentences(found):
        print(f'  or        {sentence}')
    for line in differences_text(found):
        print(f'  differs   {line}')
    if found.parameter_errors:
        print(f'  bodies    {parameter_errors_text(found.parameter_errors)}')
    for sentence in visibility_sentences(found):
        print(f'  unseen    {sentence}')
    for stem, proof in found.proofs.items():
        _print_proof(stem, proof)
    if found.refused:
        counts = ', '.join(f'{count} {reason}' for reason, count in found.refused.items())
        print(f'  refused   states: {counts}')
    for remark in found.remarks:
        print(warned(f'  remark    {remark}'))


def _print_findings(kind: str, findings: Sequence[Finding]) -> None:
    for f in findings:
        where = f'{f.joint}: {phrase(f)}'
        if f.in_simulation:
            where += f' (simulation: {", ".join(simulated(f))})'
        print(f'  {kind:9s} p {f.probability:.2f}  {where}{f"; {f.why}" if f.why else ""}')
        if f.formula:
            print(f'                    {f.formula}')


def _print_proof(stem: str, proof: Proof) -> None:
    """Print the errors of effort and roll-outs before and after, with 95 % intervals."""
    head = stem
    for kind, what in (('nmse', 'nMSE of the effort'), ('rollout_nmse', 'nMSE of roll-outs')):
        before, after = (proof.errors()[f'{kind}_{when}'] for when in ('before', 'after'))
        each = []
        for joint, x in before.items():
            interval = interval_text(proof, f'{kind}_after', joint)
            each.append(f'{joint} {x:.2g} -> {after[joint]:.2g}')
            each[-1] += f' ({interval})' if interval else ''
        if each:
            print(f'  {head:9s} {what}: {", ".join(each)}')
        head = ''


def _events(bag: str, robot: Robot, options: DiagnoseOptions, remarks: list[str]) -> list[Event]:
    """Return what a recording holds of a robot."""
    events = read_events(bag, options.joint_states, options.command, remarks)
    require_joints(events, robot, Path(bag).name)
    return events
