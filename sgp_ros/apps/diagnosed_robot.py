"""Diagnosed robots as files for the next run: robot_diagnosed.yaml beside its URDF.

The YAML states the effects that were found in the words of diagnosis.json, with their standard
deviations, behind those that the nominal robot states; the URDF has the bodies of the final model.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sgp_ros.diagnosis.result import Diagnosis, Finding, Parameter
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.report.files import write_text
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.stated_effects import dry_friction
from sgp_ros.robots.stated_values import stated_urdf
from sgp_ros.robots.urdf_robot import DEFAULT_TERMS, nominal_tree, urdf_text

YAML_NAME, URDF_NAME = 'robot_diagnosed.yaml', 'robot_diagnosed.urdf'
SPREAD = 0.05
"""Relative prior spread of bodies and damping: the diagnosis kept or corrected them. On three
practice recordings any from 0.01 to 0.2 gives the same scores within a tenth."""


def write_diagnosed(out: Path, robot: Robot, found: Diagnosis) -> None:
    """Write `robot_diagnosed.yaml` and `robot_diagnosed.urdf`.

    Args:
        out: folder.
        robot: nominal robot from a URDF.
        found: the diagnosis of a recording of it.

    Raises:
        ConfigError: the URDF is no longer what it was.
    """
    text = None if found.bodies is None else stated_urdf(robot, found.bodies, {})
    write_text(out / URDF_NAME, text or urdf_text(robot))
    stated = robot.source.get('parameters') or {}
    assert isinstance(stated, dict)
    if text is not None:  # its bodies are those of the diagnosis
        links = nominal_tree(robot).link_names
        stated = {k: x for k, x in stated.items() if k.rpartition('.')[0] not in links}
    known = robot.source.get('effects') or []
    assert isinstance(known, list)
    document = {
        'schema': 1,
        'name': robot.name,
        **_physics(robot),
        **robot.source,
        'urdf': URDF_NAME,
        'effects': [*known, *stated_findings(found.findings)],
        'parameters': stated,
    }
    write_text(out / YAML_NAME, yaml.safe_dump(document, sort_keys=False))


def stated_findings(findings: Iterable[Finding]) -> list[dict[str, Any]]:
    """Return the findings as the `effects` of a robot YAML; what is unknown has no effect."""
    return [
        {
            'effect': finding.effect,
            'joint': finding.joint,
            'parameters': {name: _entry(p) for name, p in finding.parameters.items()}
            | _side(finding),
        }
        for finding in findings
        if finding.effect in EFFECTS
    ]


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
    terms: dict[str, object] = dict.fromkeys(('inertial', 'viscous'), 'all')
    prior = {'prior': {name: {'spread': SPREAD} for name in terms}}
    tree = nominal_tree(robot)
    rubbing = [e.joint for e in dry_friction(tree)]
    if 'parameters' in robot.source:
        return {'terms': dict(DEFAULT_TERMS), **prior}
    if rubbing:
        terms['coulomb'] = rubbing
        prior['prior']['coulomb'] = {'spread': SPREAD}
    return {'terms': terms, **prior}
