"""`sgp effects`: the physics that a robot may have beside its bodies, and what one has."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.report.files import replacing_results, write_text
from sgp_ros.report.next_steps import after_effects, next_lines
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot


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
    own = () if robot is None else nominal_model(load_robot(robot)).effects
    found = {
        'effects': [_entry(law) for law in EFFECTS.values()],
        'robot': [_stated(effect) for effect in own],
    }
    with replacing_results(out, 'effects'):
        write_text(out / 'effects.json', json.dumps(found, indent=1, allow_nan=False) + '\n')
    for entry in found['effects']:
        print(_line(entry))
    if robot is not None:
        print(f'{robot} states{":" if own else " none."}')
    for entry in found['robot']:
        numbers = ', '.join(f'{name} {x:g}' for name, x in entry['values'].items())
        sought = 'estimated, starting from ' if entry['is_open'] else ''
        print(f'{_line(entry)}\n{"":24s}of {entry["joint"]}: {sought}{numbers or "no parameters"}')
    print(next_lines(after_effects(robot)))
    progress(1.0)
    return found


def _entry(law: Effect) -> dict[str, Any]:
    return {
        'effect': law.name, 'words': law.words, 'formula': law.formula, 'source': law.source,
        'place': law.site.value, 'kinds': list(law.kinds), 'is_online': law.is_online,
        'drawn_over': law.drawn_over,
        'parameters': {q.name: q.unit for q in law.quantities},
    }  # fmt: skip


def _stated(effect: EffectAt) -> dict[str, Any]:
    return {
        **_entry(effect.effect), 'joint': effect.joint, 'values': effect.numbers,
        'is_open': effect.effect.is_open,
    }  # fmt: skip


def _line(entry: dict[str, Any]) -> str:
    units = ', '.join(f'{name} [{unit}]' for name, unit in entry['parameters'].items())
    late = '' if entry['is_online'] else ' (not online)'
    return f'{entry["effect"]:24s}{entry["words"]}{late}\n{"":24s}{entry["formula"]}; {units}'
