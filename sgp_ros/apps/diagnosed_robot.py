"""Diagnosed robots as files for the next run: robot_diagnosed.yaml beside its URDF.

The YAML states the effects that were found in the words of diagnosis.json, with their standard
deviations, behind those that the nominal robot states; the URDF has the bodies of the final model.
Where a node does not model all that was found, a replay measures what it leaves.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sgp_ros.diagnosis.result import Diagnosis, Finding, Parameter
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import Event
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.formula import read_formula
from sgp_ros.physics.joint_terms import term_laws
from sgp_ros.physics.law import NAME as LAW
from sgp_ros.physics.law import is_online
from sgp_ros.report.diagnosis_text import taken_off
from sgp_ros.report.files import write_text
from sgp_ros.rigid.urdf_writer import write_urdf
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.stated_effects import dry_friction
from sgp_ros.robots.stated_laws import is_open
from sgp_ros.robots.stated_values import stated_less, stated_urdf
from sgp_ros.robots.urdf_robot import DEFAULT_TERMS, nominal_tree, urdf_text
from sgp_ros.scratch import Scratch

YAML_NAME, URDF_NAME = 'robot_diagnosed.yaml', 'robot_diagnosed.urdf'
SPREAD = 0.05
"""Relative prior spread of bodies and damping: the diagnosis kept or corrected them. On three
practice recordings any from 0.01 to 0.2 gives the same scores within a tenth."""

_REPLAYED_S = 30.0
"""Most of a recording that is replayed for what a node does not model [s]."""


def write_diagnosed(out: Path, robot: Robot, found: Diagnosis, gains: Gains | None = None) -> None:
    """Write `robot_diagnosed.yaml` and `robot_diagnosed.urdf`.

    Args:
        out: folder.
        robot: nominal robot from a URDF.
        found: the diagnosis of a recording of it.
        gains: of its drives; None where their commands are efforts.

    Raises:
        ConfigError: the URDF is no longer what it was.
    """
    every = *found.findings, *found.shared
    off = {(f.effect, f.joint): size for f in every if (size := taken_off(f)) > 0.0}
    known = stated_less(robot, off)
    text = None if found.bodies is None else stated_urdf(robot, found.bodies, known.dynamics)
    write_text(out / URDF_NAME, text or write_urdf(urdf_text(robot), {}, known.dynamics))
    stated = known.parameters
    if text is not None:  # its bodies are those of the diagnosis
        links = nominal_tree(robot).link_names
        stated = {k: x for k, x in stated.items() if k.rpartition('.')[0] not in links}
    effects = [item for item in known.effects if not is_open(item)]  # tried, and found or not
    document = {
        'schema': 1,
        'name': robot.name,
        **_physics(robot),
        **robot.source,
        'urdf': URDF_NAME,
        **({} if gains is None or gains.is_recorded else {'gains': _gains(robot, found, gains)}),
        'effects': [*effects, *stated_findings(f for f in every if not taken_off(f))],
        'parameters': stated,
    }
    write_text(out / YAML_NAME, yaml.safe_dump(document, sort_keys=False))


@dataclass(frozen=True, slots=True)
class Online:
    """Effort error of a node with a diagnosed robot that does not hold all findings.

    Attributes:
        left_out: the findings that a node does not model.
        effort_nmse: of a replay of what was diagnosed, by joint.
        seconds: that were replayed, from the first on; infinite for all of it.
    """

    left_out: tuple[Finding, ...]
    effort_nmse: Mapping[str, float]
    seconds: float

    def remark(self, promised: Mapping[str, float]) -> str:
        """Return what a reader of the diagnosis must know of the file.

        Args:
            promised: what the diagnosis leaves of the effort, by joint.
        """
        named = ', '.join(
            f'the unexplained part at {f.joint} (a node learns a Gaussian process of its own)'
            if f.effect not in {*EFFECTS, LAW} else f'{f.effect} of {f.joint}'
            for f in self.left_out
        )  # fmt: skip
        numbers = ', '.join(
            f'{joint} {x:.2g} (here {promised[joint]:.2g})'
            for joint, x in self.effort_nmse.items()
            if joint in promised
        )
        part = '' if math.isinf(self.seconds) else f' of the first {self.seconds:g} s'
        end = f'gave an nMSE of the effort of {numbers}' if numbers else 'did not start to learn'
        return f'The online node does not model {named}. A replay{part} with {YAML_NAME} {end}.'

    def content(self) -> dict[str, Any]:
        """Return the same for diagnosis.json."""
        left_out = [{'joint': f.joint, 'effect': f.effect} for f in self.left_out]
        return {'left_out': left_out, 'effort_nmse': dict(self.effort_nmse)}


def replayed(
    robot: Robot,
    found: Diagnosis,
    gains: Gains | None,
    events: Sequence[Event],
    effort_source: str,
) -> Online | None:
    """Return the residual of a node with the diagnosed robot; None where it models all findings.

    Args:
        robot: nominal robot from a URDF.
        found: the diagnosis of a recording of it.
        gains: of its drives; None where their commands are efforts.
        events: of a motion that was diagnosed; none of settled points.
        effort_source: setting `effort.source`.
    """
    left_out = tuple(f for f in found.findings if not _is_online(f))
    if not left_out or not events:
        return None
    with Scratch() as folder:
        write_diagnosed(folder, robot, found, gains)
        robot = load_robot(str(folder / YAML_NAME))
    engine = Engine(robot, EngineConfig.from_mapping({'effort.source': effort_source}, robot))
    stamps = [event.stamp_ns for event in events]
    end_ns = min(stamps) + round(_REPLAYED_S * 1e9)
    replay(engine, (e for e in events if e.stamp_ns <= end_ns), lambda _: None)
    errors = {
        joint: scores['effort'].nmse for joint, scores in engine.scores().items()
        if 'effort' in scores and math.isfinite(scores['effort'].nmse)
    }  # fmt: skip
    return Online(left_out, errors, math.inf if max(stamps) <= end_ns else _REPLAYED_S)


def _is_online(finding: Finding) -> bool:
    if finding.effect == LAW:
        return is_online(read_formula(finding.formula.partition('=')[2], is_law=True))
    return finding.effect in EFFECTS and EFFECTS[finding.effect].is_online


def stated_findings(findings: Iterable[Finding]) -> list[dict[str, Any]]:
    """Return the findings as the `effects` of a robot YAML; unknown ones have no effect."""
    return [
        _stated_law(finding)
        if finding.effect == LAW
        else {
            'effect': finding.effect,
            'joint': finding.joint,
            'parameters': {name: _entry(p) for name, p in finding.parameters.items()}
            | _side(finding),
        }
        for finding in findings
        if finding.effect in {*EFFECTS, LAW} and not _is_none(finding)
    ]


def _is_none(finding: Finding) -> bool:
    """Return whether the simulation alone has the effect."""
    sizes = [finding.parameters[name].value for name in finding.difference]
    return bool(sizes) and not any(sizes)


def _stated_law(finding: Finding) -> dict[str, Any]:
    parameters = {name: _entry(p) for name, p in finding.parameters.items()}
    law = {'joint': finding.joint, 'formula': finding.formula, 'parameters': parameters}
    return {LAW: law}


def _gains(robot: Robot, found: Diagnosis, gains: Gains) -> dict[str, Any]:
    """Return the gains in force, which may not be those that were stated."""
    names = robot.joint_names
    content = gains.content(names)
    for f in found.setup:
        for key, table in (('kp', content['kp']), ('kd', content['kd'])):
            scale = f.parameters.get(key)
            if scale is None or isinstance(scale.value, str):
                continue
            for name in table if f.joint == 'all' else [f.joint]:
                table[name] *= scale.value
    return content


def _entry(parameter: Parameter) -> dict[str, Any]:
    if isinstance(parameter.value, str):
        return {'value': parameter.value}
    entry: dict[str, Any] = {'value': float(parameter.value)}
    if parameter.std is not None and np.isfinite(parameter.std) and parameter.std > 0.0:
        entry['std'] = float(parameter.std)
    return entry | ({'unit': parameter.unit} if parameter.unit else {})


def _side(finding: Finding) -> dict[str, Any]:
    """Return at which end of the range an effect sits: its region begins where it sets in."""
    regions = finding.location.intervals.get('position')
    name = EFFECTS[finding.effect].edge
    if not name or not regions:
        return {}
    edge = finding.parameters[name].value
    assert not isinstance(edge, str)
    lo, hi = regions[0]
    return {'side': {'value': 'upper' if abs(lo - edge) < abs(hi - edge) else 'lower'}}


def _physics(robot: Robot) -> dict[str, Any]:
    """Return what a diagnosis takes for known: bodies, damping and friction of the URDF."""
    if 'terms' in robot.source:
        return {}
    of = {form.dynamics: name for name, (_, form) in term_laws().items() if form.is_assumed}
    terms: dict[str, object] = dict.fromkeys(('inertial', of['damping']), 'all')
    prior = {'prior': {name: {'spread': SPREAD} for name in terms}}
    tree = nominal_tree(robot)
    rubbing = [e.joint for e in dry_friction(tree)]
    if 'parameters' in robot.source:
        return {'terms': dict(DEFAULT_TERMS), **prior}
    if rubbing:
        terms[of['friction']] = rubbing
        prior['prior'][of['friction']] = {'spread': SPREAD}
    return {'terms': terms, **prior}
