"""`sgp export`: a robot as a file of another program, with a list of what it cannot hold."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sgp_ros.errors import ConfigError
from sgp_ros.report.files import replacing_results, write_text
from sgp_ros.report.next_steps import after_export, next_lines
from sgp_ros.robots.exports.handover import Handover, hand_over
from sgp_ros.robots.exports.mjcf import write_mjcf
from sgp_ros.robots.exports.sdf import write_sdf
from sgp_ros.robots.exports.settings import write_control, write_isaaclab, write_json
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot

URDF_HELD = ('damping', 'friction')
FORMATS = {
    'mjcf': '.xml', 'urdf': '.urdf', 'sdf': '.sdf', 'isaaclab': '_isaaclab.py',
    'ros2_control': '_ros2_control.yaml', 'json': '.json',
}  # fmt: skip
"""Name of a format to the end of its file."""


def run_export(
    robot: str, out: Path, progress: Callable[[float], None], *, to: str,
    model: str | None = None, ranges: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Write a robot as a file of another program.

    Args:
        robot: robot YAML, such as robot_diagnosed.yaml, or a model file.
        out: folder of the results.
        progress: called with the share that is done.
        to: a key of `FORMATS`.
        model: MJCF file that is changed; None for the one that the robot came from.
        ranges: whether the ranges of its numbers are written as JSON, for randomisation.

    Raises:
        ConfigError: no such robot, or one that the format cannot hold.
    """
    nominal = nominal_model(load_robot(robot))
    handed = hand_over(nominal)
    text, left = _written(handed, to, _origin(handed, model), out)
    path = out / f'{nominal.robot.name}{FORMATS[to]}'
    place = out / f'{nominal.robot.name}_ranges.json'
    with replacing_results(out, 'export'):
        write_text(path, text)
        if ranges:
            write_text(place, json.dumps(handed.ranges(), indent=1, allow_nan=False) + '\n')
    print(f'{nominal.robot.name} as {to} in {path}')
    result: dict[str, Any] = {'path': str(path), 'left_out': [*left, *nominal.remarks]}
    if ranges:
        print(f'ranges (value +- 2 std) in {place}')
        result['ranges'] = str(place)
    for said in left:
        print(f'  not in {to}: {said}')
    for said in nominal.remarks:
        print(f'  remark: {said}')
    print(next_lines(after_export(path)))
    progress(1.0)
    return result


def _origin(handed: Handover, model: str | None) -> Path | None:
    """Return the MJCF file that is to be changed; None where there is none."""
    stated = handed.nominal.robot.source.get('model')
    if model is None and not stated:
        return None
    path = Path(str(model or stated))
    if not path.is_file():
        raise ConfigError(f'no MJCF at {path}', 'the MJCF of the robot', 'name it with --model')
    return path


def _written(handed: Handover, to: str, origin: Path | None, out: Path) -> tuple[str, list[str]]:
    if to == 'mjcf':
        return write_mjcf(handed, origin, out)
    if to == 'urdf':
        return handed.urdf, handed.left_out(URDF_HELD)
    writers = {
        'sdf': write_sdf, 'isaaclab': write_isaaclab, 'ros2_control': write_control,
        'json': write_json,
    }  # fmt: skip
    return writers[to](handed)
