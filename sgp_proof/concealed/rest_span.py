"""Error of the effort online, for longer and shorter times over which joints are taken to rest.

    python -m sgp_proof.concealed.rest_span WORLDS ... [--out FILE]

WORLDS is what `sgp_proof.concealed.draw --only coulomb_friction` writes, or with another dry
friction: true bodies, and answers that say the friction. Each training recording runs with its
true robot and multiples of the time that `engine.rest` takes. A span that finds rest in more
equations leaves them unscored, so every joint is scored on the equations in which no span takes it
to rest. The worst joint of a world counts.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from unittest.mock import patch

import numpy as np
import yaml

from sgp_proof.result_files import make_parser, write_result
from sgp_ros.engine import rest
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.results import Channel, Step
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot

MULTIPLES = (0.0, 0.5, 1.0, 2.0, 4.0, 16.0)
"""Of the time in which motion leaves the noise."""
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


def replayed(robot: Robot, recording: Path, multiple: float) -> tuple[dict, float]:
    """Return effort and error, NaN where held, by stamp, and the share of equations held."""
    settings = {'filter.window': -1.0, 'model.method': 'PR', 'refit.enabled': False}
    engine = Engine(robot, EngineConfig.from_mapping(settings, robot))
    rows, scored, take = {}, [], engine.estimator.scoring.take_target

    def note(target: Channel, is_free: np.ndarray) -> None:
        scored.append((target.measured, np.where(is_free, target.measured - target.mean, np.nan)))
        take(target, is_free)

    def keep(step: Step) -> None:
        stamps = [e.stamp_ns for e in step.estimates if e.is_scored]
        rows.update(zip(stamps, scored, strict=True))
        scored.clear()

    def spans(noise: np.ndarray, width: float) -> np.ndarray:
        return multiple * rest_spans(noise, width)

    rest_spans = rest.clear_spans
    with (
        patch.object(rest, 'clear_spans', spans),
        patch.object(engine.estimator.scoring, 'take_target', note),
    ):
        replay(engine, open_recording(str(recording)).events(), keep)
    return rows, engine.counts.held / max(engine.counts.estimated, 1)


def left(robot: Robot, recording: Path) -> dict[str, dict[str, float]]:
    """Return the largest nMSE of the effort of a joint and the share held, by multiple."""
    runs = {f'{x:g}': replayed(robot, recording, x) for x in MULTIPLES}
    common = sorted(set.intersection(*(set(rows) for rows, _ in runs.values())))
    free = np.all([[~np.isnan(rows[t][1]) for t in common] for rows, _ in runs.values()], axis=0)
    found = {}
    for name, (rows, held) in runs.items():
        measured, error = (np.array([rows[t][i] for t in common]) for i in (0, 1))
        error[~free] = np.nan
        spread = measured.var(axis=0)
        nmse = np.nanmean(error**2, axis=0)[spread > 0.0] / spread[spread > 0.0]
        found[name] = {'effort_nmse': float(nmse.max()), 'held': held, 'free': int(free.sum())}
    return found


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
            spans = left(robot, world / 'real.mcap')
            found = ', '.join(f'{s}: {x["effort_nmse"]:.3g}' for s, x in spans.items())
            names = [e['effect'] for e in answer['effects']]
            print(f'{folder.name} {world.name} {answer["robot"]} {names}  {found}', flush=True)
            results.append({'world': f'{folder.name} {world.name}', 'robot': answer['robot'],
                            'effects': names, 'spans': spans})  # fmt: skip
    write_result(arguments.out, {'worlds': results})


if __name__ == '__main__':
    main()
