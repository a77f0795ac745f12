"""Effort left by the online engine for each time over which joints are taken to rest.

    python -m sgp_proof.concealed.rest_span WORLDS [--out FILE]

WORLDS is what `sgp_proof.concealed.draw --tier A --only coulomb_friction` writes, or with another
dry friction: true bodies, and answers that say the friction. Each training recording runs with its
true robot and one `engine.rest.SPAN_S` after the other. The worst joint of a world counts.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from unittest.mock import patch

import yaml

from sgp_proof.result_files import make_parser, write_result
from sgp_ros.engine import rest
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot

SPANS_S = (0.01, 0.02, 0.03, 0.05, 0.08, 0.15)
_SPREAD = 0.05
_STD = 0.01


def true_robot(world: Path, effects: list[dict]) -> Robot:
    """Return the robot of a world with the effects of its answer, bodies and damping as stated."""
    terms = ('inertial', 'viscous')
    document = {
        'schema': 1,
        'urdf': (world / 'robot.urdf').read_text(encoding='utf-8'),
        'terms': dict.fromkeys(terms, 'all'),
        'prior': {name: {'spread': _SPREAD} for name in terms},
        'effects': [
            {
                'effect': effect['effect'], 'joint': effect['joint'],
                'parameters': {
                    name: {'value': x} if isinstance(x, str)
                    else {'value': x, 'std': _STD * abs(x) + 1e-9}
                    for name, x in effect['parameters'].items()
                },
            }
            for effect in effects
        ],
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'robot.yaml'
        path.write_text(yaml.safe_dump(document), encoding='utf-8')
        return load_robot(str(path))


def left(robot: Robot, recording: Path, span_s: float) -> dict[str, float]:
    """Return the largest nMSE of the effort of a joint, and the share of equations held."""
    settings = {'filter.window': -1.0, 'model.method': 'PR', 'refit.enabled': False}
    engine = Engine(robot, EngineConfig.from_mapping(settings, robot))
    with patch.object(rest, 'SPAN_S', span_s):
        replay(engine, open_recording(str(recording)).events(), lambda _: None)
    worst = max(s['effort'].nmse for s in engine.scores().values() if 'effort' in s)
    return {'effort_nmse': worst, 'held': engine.counts.held / max(engine.counts.estimated, 1)}


def main() -> None:
    """Print one line a world, and write the result."""
    parser = make_parser(__doc__, 'rest_span')
    parser.add_argument('worlds', type=Path, nargs='+', help='folders with cases and answers')
    arguments = parser.parse_args()
    results = []
    for folder in arguments.worlds:
        for world in sorted((folder / 'cases').iterdir()):
            path = folder / 'answers' / f'{world.name}.json'
            answer = json.loads(path.read_text(encoding='utf-8'))
            robot = true_robot(world, answer['effects'])
            spans = {f'{s:g}': left(robot, world / 'real.mcap', s) for s in SPANS_S}
            found = ', '.join(f'{s}: {x["effort_nmse"]:.2g}' for s, x in spans.items())
            names = [e['effect'] for e in answer['effects']]
            print(f'{folder.name} {world.name} {answer["robot"]} {names}  {found}', flush=True)
            results.append({'world': f'{folder.name} {world.name}', 'robot': answer['robot'],
                            'effects': names, 'spans': spans})  # fmt: skip
    write_result(arguments.out, {'worlds': results})


if __name__ == '__main__':
    main()
