"""Effect of too little motion, or too few rows, on a diagnosis.

    python -m sgp_proof.concealed.guards

Encoders at rest, drawn with white noise, with a count that flickers and with single jumps, give
the largest motion that is none. Drawn worlds give the smallest that is one, and the verdicts on
their first seconds: whether it is right, by the number of rows beside the number of parameters
that the nominal model leaves free. Results go to `sgp_proof/results/diagnosis_guards.json`. A test
holds the criteria of `sgp_ros.diagnosis.criteria` to them.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import numpy as np

from sgp_proof.concealed.draw import draw_case
from sgp_proof.result_files import make_parser, write_result
from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.sufficiency import motion_to_noise
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.decide.certainty import certainty_of, probabilities
from sgp_ros.diagnosis.decide.decision import decide
from sgp_ros.diagnosis.decide.equivalence import Contrasts
from sgp_ros.diagnosis.explain.comparison import compare_models
from sgp_ros.diagnosis.findings import asserted
from sgp_ros.diagnosis.locate.dependence import dependences
from sgp_ros.engine.samples import JointSample
from sgp_ros.errors import RecordingError
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot

SEEDS = (2, 7, 8, 9, 19, 20, 33, 34, 44, 47, 48, 59)
"""Worlds of tier B: nothing, wrong parameters, listed and unlisted effects."""
SECONDS = (1.0, 1.5, 2.0, 3.0, 4.5, 7.0, 11.0, 33.0)
DRAWS = 40


def main() -> None:
    """Draw encoders at rest and worlds, and diagnose the first seconds of these."""
    options = make_parser(__doc__, 'diagnosis_guards').parse_args()
    result = {
        'command': 'python -m sgp_proof.concealed.guards',
        'at_rest': at_rest(),
        'worlds': [found for seed in SEEDS for found in world(seed)],
    }
    write_result(options.out, result)


def at_rest() -> dict[str, float]:
    """Return the largest range of encoders at rest, in units of their noise, by kind."""
    rng = np.random.default_rng(0)
    found: dict[str, float] = {}
    for rows in (64, 1000, 20_000, 200_000):
        for _ in range(DRAWS if rows < 200_000 else 4):
            white = rng.normal(size=rows)
            drawn = {
                'white noise': white,
                'noise of heavy tails': rng.laplace(size=rows),
                'noise of half a count': np.round(0.5 * white + rng.uniform()),
                'noise of three counts': np.round(3.0 * white),
                'flicker of one count': (np.cumsum(rng.random(rows) < 0.01) % 2).astype(float),
                'one jump of a count': (np.arange(rows) > rng.integers(rows)).astype(float),
                'creep over five counts': np.round(5.0 * np.arange(rows) / rows + 0.2 * white),
            }
            for name, q in drawn.items():
                found[name] = max(found.get(name, 0.0), motion_to_noise(q))
    return found


def world(seed: int) -> list[dict]:
    """Return the diagnoses of the first seconds of a drawn world."""
    with tempfile.TemporaryDirectory() as folder:
        for name in ('cases', 'answers'):
            (Path(folder) / name).mkdir()
        draw_case(seed, 'B', None, Path(folder))
        case = Path(folder) / 'cases' / f'case_{seed:03d}'
        if not case.exists():
            return []
        answer = json.loads((Path(folder) / 'answers' / f'case_{seed:03d}.json').read_text())
        nominal = nominal_model(load_robot(str(case / 'robot.urdf')))
        events = list(open_recording(str(case / 'real.mcap')).events())
    begin = min(event.stamp_ns for event in events)
    return [
        diagnosed(seed, nominal, [e for e in events if e.stamp_ns < begin + s * 1e9], s, answer)
        for s in SECONDS
    ]


def diagnosed(seed, nominal, events, seconds, answer) -> dict:
    """Return what the models say of a recording, whatever its length, beside the truth."""
    robot, tree = nominal.robot, nominal.tree
    states = [e for e in events if isinstance(e, JointSample)]
    motion = [
        motion_to_noise(np.array([e.position[e.names.index(name)] for e in states]))
        for name in tree.moving_names
    ]
    found = {'seed': seed, 'key': answer['key'], 'seconds': seconds, 'motion': min(motion)}
    try:
        raw = collect(events, robot)
        equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
        comparison = compare_models(equations, lambda _share: None)
        decision = decide(equations, comparison)
        contrasts = Contrasts(equations, decision.model)
        chances = probabilities(equations, comparison, decision, contrasts)
        depends = dependences(equations, comparison.base.residual)
        findings, _ = asserted(equations, decision, [], (), chances, depends)
    except (RecordingError, np.linalg.LinAlgError, ValueError, IndexError) as error:
        return {**found, 'refused': ' '.join(str(error).split())[:120]}
    right = {(a['verdict'], a['effect']) for a in answer['accepted']}
    top = findings[0].effect if findings else None
    row = {
        **found, 'joints': tree.size, 'rows': len(equations.d),
        'cutoff_hz': equations.filter.cutoff,
        'determined': comparison.parameters.frame.determined,
        'freedom': decision.model.freedom,
        'noise': float((equations.noise**2 / equations.power).max()),
        'left': float((decision.model.mean_square / equations.power).max()),
        'verdict': decision.verdict, 'effect': top, 'truth': answer['verdict'],
        'certainty': certainty_of(findings, comparison),
        'is_right': (decision.verdict, top) in right,
        'verdict_is_right': decision.verdict in {v for v, _ in right},
    }  # fmt: skip
    print(row, flush=True)
    return row


if __name__ == '__main__':
    main()
