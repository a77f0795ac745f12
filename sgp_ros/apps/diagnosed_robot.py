"""What a diagnosis leaves for the next run: robot_diagnosed.yaml beside its URDF.

The YAML states the effects that were found in the words of diagnosis.json, with their standard
deviations, behind those that the nominal robot states; the URDF has the bodies of the final model,
and no dry friction, which a diagnosis takes for an effect.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sgp_ros.diagnosis.result import Diagnosis, Finding, Parameter
from sgp_ros.errors import ConfigError
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.report.files import write_text
from sgp_ros.rigid.pseudo_inertia import is_consistent
from sgp_ros.rigid.tree import read_urdf
from sgp_ros.rigid.urdf_text import parse_urdf
from sgp_ros.rigid.urdf_writer import write_urdf
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.urdf_robot import nominal_tree, urdf_text

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
    text = _without_friction(urdf_text(robot))
    path = out / URDF_NAME
    if found.bodies is None or not _holds_bodies(path, text, robot, found.bodies):
        write_text(path, text)
    known = robot.source.get('effects') or []
    assert isinstance(known, list)
    document = {
        'schema': 1,
        'name': robot.name,
        **_physics(robot),
        **robot.source,
        'urdf': URDF_NAME,
        'effects': [*known, *stated_findings(found.findings)],
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
    """Return what a diagnosis takes for known: bodies and damping of the URDF."""
    terms = ('inertial', 'viscous')
    if 'terms' in robot.source:
        return {}
    prior = {'prior': {name: {'spread': SPREAD} for name in terms}}
    return {'terms': dict.fromkeys(terms, 'all'), **prior}


def _without_friction(text: str) -> str:
    joints = parse_urdf(text).joints.values()
    return write_urdf(text, {}, {j.name: (j.damping, 0.0) for j in joints if j.friction})


def _holds_bodies(path: Path, text: str, robot: Robot, bodies: np.ndarray) -> bool:
    """Write the URDF with these bodies; return whether the robot read from it has them.

    A moving body is its link, what is fixed to it, what hangs on locked joints behind it, and
    the payload that the robot states. Its link takes what is left beside those two.
    """
    nominal, free = nominal_tree(robot), read_urdf(text)
    own = [free.parameters[free.link_names.index(link)] for link in nominal.link_names]
    beside = nominal.parameters - np.array(own)
    left = bodies - beside
    if not np.all(is_consistent(left) | ~beside.any(axis=1)):
        return False
    try:
        write_text(path, write_urdf(text, dict(zip(nominal.link_names, left, strict=True)), {}))
        again = nominal_tree(replace(robot, source={**robot.source, 'urdf': str(path)}))
    except ConfigError:
        return False
    floor = 1e-9 * float(np.abs(bodies).max())
    return np.allclose(again.parameters, bodies, rtol=1e-6, atol=floor)
