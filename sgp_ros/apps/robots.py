"""`sgp robots`: the robots that come with the package."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from sgp_ros.report.next_steps import after_robots, next_lines
from sgp_ros.robots.listing import listed_robots


def run_robots(out: Path | None, progress: Callable[[float], None]) -> dict[str, Any]:  # noqa: ARG001 - it writes nothing
    """List the built-in robots.

    Args:
        out: of every command; not used.
        progress: called with the share that is done.
    """
    found = list(listed_robots())
    width = max(len(robot.name) for robot in found)
    for robot in found:
        print(f'{robot.name:{width}s}  {robot.description}')
        print(f'{"":{width}s}  joints: {", ".join(robot.joints)}')
    print('Any URDF, MJCF, SDF or robot YAML can be given instead of a name.')
    print(next_lines(after_robots(found[0].name)))
    progress(1.0)
    return {'robots': [asdict(robot) for robot in found]}
