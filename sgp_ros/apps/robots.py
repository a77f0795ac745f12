"""`sgp robots`: the robots that come with the package."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sgp_ros.report.files import replacing_results, write_text
from sgp_ros.report.next_steps import after_robots, next_lines
from sgp_ros.robots.registry import load_robot, robot_names


def run_robots(out: Path, progress: Callable[[float], None]) -> dict[str, Any]:
    """List the built-in robots; write them to robots.json.

    Args:
        out: folder of the results.
        progress: called with the share that is done.
    """
    names, entries = robot_names(), []
    for i, name in enumerate(names):
        robot = load_robot(name)
        entries.append({
            'name': name,
            'description': robot.description,
            'joints': list(robot.joint_names),
            'coefficients': [c.name for c in robot.coefficients],
        })  # fmt: skip
        progress((i + 1) / len(names))
    with replacing_results(out, 'robots'):
        write_text(out / 'robots.json', json.dumps(entries, indent=1) + '\n')
    width = max(map(len, names))
    for entry in entries:
        print(f'{entry["name"]:{width}s}  {entry["description"]}')
        print(f'{"":{width}s}  joints: {", ".join(entry["joints"])}')
    print('Any URDF, MJCF, SDF or robot YAML can be given instead of a name.')
    print(next_lines(after_robots(names[0])))
    return {'robots': entries}
