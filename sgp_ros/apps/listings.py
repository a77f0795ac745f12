"""Lists of what a robot can be or have: `sgp robots`, `sgp effects`.

What the package itself has is read from its files, without NumPy, so that the lists come at once.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sgp_ros.report.files import replacing_results, write_text
from sgp_ros.report.next_steps import after_effects, after_robots, next_lines
from sgp_ros.robots.shipped import shipped_folder
from sgp_ros.strangers import read_text


def run_robots(out: Path | None, progress: Callable[[float], None]) -> dict[str, Any]:  # noqa: ARG001 - it writes nothing
    """List the built-in robots: `sgp robots`.

    Args:
        out: of every command; not used.
        progress: called with the share that is done.
    """
    found = _shipped('robots')
    width = max(len(robot['name']) for robot in found)
    for robot in found:
        print(f'{robot["name"]:{width}s}  {robot["description"]}')
        print(f'{"":{width}s}  joints: {", ".join(robot["joints"])}')
    print('Any URDF, MJCF, SDF or robot YAML can be given instead of a name.')
    print(next_lines(after_robots(found[0]['name'])))
    progress(1.0)
    return {'robots': found}


def run_effects(
    robot: str | None, out: Path, progress: Callable[[float], None]
) -> dict[str, list[dict[str, Any]]]:
    """List all effects, and those that a robot states; write them to effects.json.

    Args:
        robot: a robot YAML, a URDF or a built-in name; None for the catalogue alone.
        out: folder of the results.
        progress: called with the share that is done.

    Raises:
        ConfigError: no such robot, or one without nominal bodies.
    """
    found = {'effects': _shipped('effects'), 'robot': _stated(robot)}
    with replacing_results(out, 'effects'):
        write_text(out / 'effects.json', json.dumps(found, indent=1, allow_nan=False) + '\n')
    for entry in found['effects']:
        print(_line(entry))
    if robot is not None:
        print(f'{robot} states{":" if found["robot"] else " none."}')
    for entry in found['robot']:
        numbers = ', '.join(f'{name} {x:g}' for name, x in entry['values'].items())
        sought = 'estimated, starting from ' if entry['is_open'] else ''
        print(f'{_line(entry)}\n{"":24s}of {entry["joint"]}: {sought}{numbers or "no parameters"}')
    print(next_lines(after_effects(robot)))
    progress(1.0)
    return found


def _shipped(kind: str) -> list[dict[str, Any]]:
    """Return a list out of the file that `docs/generate_listings.py` writes."""
    entries: list[dict[str, Any]] = json.loads(read_text(shipped_folder() / 'listings.json'))[kind]
    return entries


def _stated(robot: str | None) -> list[dict[str, Any]]:
    """Return the effects that a robot states, with their joints and numbers."""
    if robot is None:
        return []
    from sgp_ros.physics.catalogue import listed  # noqa: PLC0415 - it takes time
    from sgp_ros.robots.nominal import nominal_model  # noqa: PLC0415 - as above
    from sgp_ros.robots.registry import load_robot  # noqa: PLC0415 - as above

    return [
        {**listed(at.effect), 'joint': at.joint, 'values': at.numbers,
         'is_open': at.effect.is_open}
        for at in nominal_model(load_robot(robot)).effects
    ]  # fmt: skip


def _line(entry: dict[str, Any]) -> str:
    units = ', '.join(f'{name} [{unit}]' for name, unit in entry['parameters'].items())
    late = '' if entry['is_online'] else ' (not online)'
    return f'{entry["effect"]:24s}{entry["words"]}{late}\n{"":24s}{entry["formula"]}; {units}'
