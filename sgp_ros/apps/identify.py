"""`sgp identify`: a robot from a whole recording: parameters, intervals, URDF and a report."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.apps.held_rollouts import best_coefficients, roll_out_held
from sgp_ros.apps.identified_robot import nominal_coefficients, write_identified
from sgp_ros.apps.recorded import checked, gains_of, read_events
from sgp_ros.apps.terminal import strong, warned
from sgp_ros.batch.identification import HELD_OUT, Identification, IdentificationOptions, identify
from sgp_ros.batch.signals import Signals, collect_signals
from sgp_ros.diagnosis.gathered import Knowledge, driven, setup_remarks
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.setting import EFFORT_SOURCES
from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.report.files import replacing_results, write_text
from sgp_ros.report.findings import collect_findings
from sgp_ros.report.identification import write_identification
from sgp_ros.report.identification_text import (
    called,
    cautions,
    excitation,
    filter_choice,
    unknown,
    verdict,
)
from sgp_ros.report.next_steps import Steps, after_identification, ending
from sgp_ros.robots.nominal import Nominal, nominal_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class IdentifyOptions:
    """How a recording is read and identified.

    Attributes:
        tests: recordings that are only scored on; without any, a part of the recording.
        joint_states: topic of the states; None for the one there is.
        command: topic of the commands; None for the one there is.
        effort: where efforts come from, a key of `EFFORT_SOURCES`.
        inputs: what Z sees, such as `own:velocity`; None lets the data choose.
        holdout: the part held out without tests, `tail` or `alternate`.
        share: how much of it.
        stretch: length of alternate stretches [s].
        cutoff: of the low-pass [Hz]; None chooses from the data.
        gains: YAML file of the gains of drives whose commands are positions; None for efforts.
    """

    tests: Sequence[str] = ()
    joint_states: str | None = None
    command: str | None = None
    effort: str = 'auto'
    inputs: Sequence[str] | None = None
    holdout: str = 'tail'
    share: float = 0.4
    stretch: float = 6.0
    cutoff: float | None = None
    gains: str | None = None

    @property
    def identification(self) -> IdentificationOptions:
        """Options of the fit and of the held-out part."""
        return IdentificationOptions(
            residual_inputs=None if self.inputs is None else tuple(self.inputs),
            holdout=self.holdout,
            share=self.share,
            stretch_s=self.stretch,
            cutoff=self.cutoff,
        )


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiedRecording:
    """A finished identification, and its findings and remarks.

    Attributes:
        found: the identification.
        findings: the content of identification.json.
        robot: as it was given.
    """

    found: Identification
    findings: dict[str, Any]
    robot: str

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on the recordings."""
        return tuple(self.findings['remarks'])


def run_identify(
    bag: str, robot: str, out: Path, *, progress: Callable[[float], None], **options: Any
) -> dict[str, Any]:
    """Identify a robot and write findings, report, robot YAML and URDF.

    Args:
        bag: the recording that is learned from.
        robot: built-in name, robot YAML or URDF.
        out: folder of the results.
        progress: called with the share that is done.
        options: fields of `IdentifyOptions`.

    Raises:
        ConfigError: a wrong robot, method or hold-out.
        RecordingError: nothing in the recording can be used.
    """
    require_folder(out)
    identified = identify_recording(bag, robot, progress=progress, **options)
    write_identified_recording(out, identified)
    print_findings(identified.findings)
    print(ending(out, _steps(out, identified)))
    return identified.findings


def identify_recording(
    bag: str,
    robot: str,
    *,
    progress: Callable[[float], None] = lambda _share: None,
    **options: Any,
) -> IdentifiedRecording:
    """Identify a robot, write nothing; arguments and errors are those of `run_identify`."""
    chosen = IdentifyOptions(**options)
    model = load_robot(robot)
    remarks: list[str] = []
    nominal = _nominal(model)
    signals = read_signals(bag, model, chosen, remarks, nominal)
    tests = {
        name: read_signals(path, model, chosen, remarks, nominal)
        for name, path in names_of_tests(chosen.tests).items()
    }
    progress(0.1)
    found = identify(
        signals, model, tests, chosen.identification,
        nominal=nominal_coefficients(model), progress=lambda share: progress(0.1 + 0.7 * share),
    )  # fmt: skip
    rollouts = roll_out_held(found, signals, tests)
    progress(0.95)
    counts = {'states on the grid': len(signals.time)}
    for what, refused in (('states', signals.refused), ('commands', signals.commands_refused)):
        counts |= {f'{what} refused: {reason}': n for reason, n in refused.items() if n}
    if signals.left_out:
        counts['states in stretches too short to be filtered'] = signals.left_out
    findings = collect_findings(found, Path(bag).name, rollouts, counts, remarks)
    progress(1.0)
    return IdentifiedRecording(found, findings, robot)


def write_identified_recording(out: Path, identified: IdentifiedRecording) -> None:
    """Write findings, report, robot YAML and URDF into a folder."""
    found, findings = identified.found, identified.findings
    with replacing_results(out, 'identify'):
        text = json.dumps(findings, indent=1, allow_nan=False) + '\n'
        write_text(out / 'identification.json', text)
        known = found.physics.coefficients
        std = np.where(known.is_identifiable, known.std, np.inf)
        values, has_bodies = best_coefficients(found), found.consistent is not None
        write_identified(out, found.robot, values, std, has_bodies=has_bodies)
        steps = _steps(out, identified)
        tree = None
        if 'urdf' in found.robot.source:
            from sgp_ros.robots.urdf_robot import nominal_tree  # noqa: PLC0415 - loads Pinocchio

            tree = nominal_tree(found.robot)
        write_identification(out, found, findings, steps, tree)


def _steps(out: Path, identified: IdentifiedRecording) -> Steps:
    source = identified.found.robot.source
    return after_identification(identified.robot, out, has_bodies='urdf' in source)


def require_folder(out: Path) -> None:
    """Refuse a place where no result can be written, before anything is computed.

    Raises:
        ConfigError: there is a file of that name.
    """
    places = [out, *out.parents]
    files = [place for place in places if place.exists() and not place.is_dir()]
    if files:
        raise ConfigError(f'{files[0]} is a file', 'a folder for the results', 'change --out')


def names_of_tests(tests: Sequence[str]) -> dict[str, str]:
    """Return the recordings to score on by names that differ from each other and from `train`."""
    named: dict[str, str] = {}
    for path in tests:
        stem, name, count = Path(path).stem or path, Path(path).stem or path, 1
        while name in {*named, 'train', HELD_OUT}:
            count += 1
            name = f'{stem} {count}'
        named[name] = path
    return named


def read_signals(
    bag: str, robot: Robot, options: IdentifyOptions, remarks: list[str],
    nominal: Nominal | None = None,
) -> Signals:  # fmt: skip
    """Return the signals of a recording, checked; what is odd about it is appended to `remarks`.

    Args:
        bag: the recording.
        robot: that it shows.
        options: how it is read.
        remarks: of the user.
        nominal: the robot with known bodies, against which the connection is checked, and for
            which gains make efforts of targets; None without.

    Raises:
        RecordingError: nothing can be used, or the recording contradicts itself.
    """
    said: list[str] = []
    events = read_events(bag, options.joint_states, options.command, said)
    config = EngineConfig(effort_source=EFFORT_SOURCES[options.effort])
    try:
        gains = None if nominal is None else gains_of(options.gains, nominal, events, said)
        checked({Path(bag).stem: events}, robot, gains, said)
        if nominal is not None:
            known = Knowledge(nominal.robot, nominal.stated, config, gains)
            said += setup_remarks(events, nominal.tree, known)
            events = events if gains is None else driven(events, nominal.tree, known)
        signals = collect_signals(events, robot, config)
    except RecordingError as error:
        raise RecordingError(f'{bag}: {error.found}', error.expected, error.remedy) from error
    remarks += [f'{bag}: {remark}' for remark in (*said, *signals.remarks)]
    return signals


def _nominal(robot: Robot) -> Nominal | None:
    """Return the robot with known bodies; None where it has none."""
    try:
        return nominal_model(robot)
    except ConfigError:
        return None


def print_findings(findings: Mapping[str, Any]) -> None:
    """Print scores per method, parameters with 95 % intervals, and what is not to be trusted."""
    print(strong(verdict(findings)))
    print(filter_choice(findings['filter']))
    _print_scores(findings)
    _print_rollouts(findings)
    print('\nparameters of the physics, with 95 % intervals:')
    width = max((len(p['name']) for p in findings['parameters']), default=0)
    for p in findings['parameters']:
        known = unknown(p['status'])
        if p['std'] is not None:
            known = f'{p["value"]:12.5g} +- {INTERVAL_95 * p["std"]:<9.3g} {p["unit"]}'
        print(f'  {p["name"]:{width}s} {known}')
    print(excitation(findings['excitation']))
    for text in findings['excitation']['suggestions']:
        print(f'a motion that would determine more: {text}')
    for text in cautions(findings):
        print(warned(f'caution: {text}'))
    for text in findings['remarks']:
        print(warned(f'remark: {text}'))


def _print_scores(findings: Mapping[str, Any]) -> None:
    units = findings['units'][findings['target']]
    for name in findings['held_out']:
        print(f'\n{findings["target"]} in {called(name)}, not learned from: nMSE (rms error)')
        for method, scores in findings['scores'].items():
            each = '   '.join(
                f'{joint} {_short(s["nmse"])} ({_short(s["rmse"])} {units[joint]})'
                for joint, s in scores[name].get('joints', {}).items()
            )
            print(f'  {method:4s} {each or "needs parameters that are not determined"}')


def _print_rollouts(findings: Mapping[str, Any]) -> None:
    units = findings['units']['position']
    for name, all_ in findings['rollouts'].items():
        print(f'\nposition in {called(name)}, simulated from measured efforts: nMSE (rms error)')
        for score in all_:
            each = '   '.join(
                f'{joint} {_short(s["nmse_end"])} ({_short(s["rms_end"])} {units[joint]})'
                for joint, s in score['joints'].items()
            )
            lost = f'   {score["diverged"]} of {score["n"]} diverged' if score['diverged'] else ''
            print(f'  after {score["horizon_s"]:.3g} s: {each}{lost}')


def _short(x: float | None) -> str:
    return 'none' if x is None else f'{x:.3g}'
