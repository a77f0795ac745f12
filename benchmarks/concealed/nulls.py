"""What the statistics of the verdict look like where no physics is missing.

    python -m benchmarks.concealed.nulls --tier B --seeds 1000:1060

Draws robots without concealed physics: as the nominal one, with wrong inertial parameters, or with
something unlisted that makes less of the squared effort than counts as physics. Every model that
competes is fitted; its statistics go to `benchmarks/results/nulls_<tier>.json`. The thresholds
of `sgp_ros.diagnosis.decision` are read against these.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.concealed import draw, scores, sizes
from benchmarks.concealed import world as worlds
from benchmarks.concealed.kinds import UnsuitableError, draw_effect
from benchmarks.concealed.robots import urdf
from benchmarks.environment import environment
from sgp_ros.diagnosis.decision import Scale, decide
from sgp_ros.diagnosis.equations import make_equations
from sgp_ros.diagnosis.hypotheses import compete
from sgp_ros.diagnosis.trajectory import choose_bandwidth, collect
from sgp_ros.experiments.simulated_files import write_simulated
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree

RESULTS = Path(__file__).parents[1] / 'results'
NOTHING, PARAMETERS, SLIGHT = 'nothing', 'wrong parameters', 'slight unlisted effect'
KINDS = (NOTHING, PARAMETERS, SLIGHT)
_SLIGHT = (2e-4, 3e-3)
_TRIES = 40
_KEPT = 3


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--tier', choices=('A', 'B'), default='B')
    parser.add_argument('--seeds', default='1000:1060', help='FIRST:LAST+1')
    arguments = parser.parse_args()
    first, last = map(int, arguments.seeds.split(':'))
    path = RESULTS / f'nulls_{arguments.tier.lower()}.json'
    rows = []
    for seed in range(first, last):
        begin = time.perf_counter()
        row = drawn(seed, arguments.tier)
        if row is None:
            continue
        rows.append(row)
        print(seed, row['kind'], row['robot'], row['verdict'],
              f'{time.perf_counter() - begin:.0f} s', flush=True)  # fmt: skip
        report = {'schema': 1, 'tier': arguments.tier, 'seeds': arguments.seeds,
                  'environment': environment(), 'worlds': rows}  # fmt: skip
        path.write_text(json.dumps(report, allow_nan=False) + '\n', encoding='utf-8')


def drawn(seed, tier):
    """Return the statistics of one world; None where none of `_TRIES` is suitable."""
    for attempt in range(_TRIES):
        rng = np.random.default_rng([seed, ord(tier), attempt])
        try:
            return _attempt(seed, rng, tier, KINDS[seed % len(KINDS)])
        except UnsuitableError as problem:
            print(f'  seed {seed}: {problem}', file=sys.stderr)
    return None


def _attempt(seed, rng, tier, kind):
    is_wrong = kind == PARAMETERS or (kind == SLIGHT and rng.random() < 0.5)
    world = worlds.draw_world(seed, rng, tier, 0.3 if is_wrong else 0.0)
    motion = worlds.pilot_motion(world.run('near', 12.0, 1), world)
    relative = 0.002 if tier == 'A' else float(rng.choice([0.01, 0.03]))
    noise = tuple(float(relative * v) for v in motion.velocity)
    world = replace(world, sensors=replace(world.sensors, velocity_noise=noise))
    concealed = []
    if kind == SLIGHT:
        concealed = [draw_effect(rng, 'unknown', world.bodies, motion, tier == 'B')]
        low, high = _SLIGHT
        sizes.sized(world, concealed[0], math.exp(rng.uniform(math.log(low), math.log(high))))
    recording = world.run('near', 33.0, 1, concealed)
    share = max(sizes.own_share(recording, world, e) for e in concealed) if concealed else 0.0
    if share > _SLIGHT[1]:
        raise UnsuitableError(f'{concealed[0].name} makes {share:.2e}')
    error = max(x['nominal'] for x in scores.nominal_share(recording, world).values())
    if kind == PARAMETERS and error < sizes.SMALLEST_SHARE:
        raise UnsuitableError(f'wrong parameters make {error:.2e}')
    what = concealed[0].parameters['kind'] if concealed else ''
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        (path / 'robot.urdf').write_text(urdf(world.family, world.bodies), encoding='utf-8')
        write_simulated(
            recording, path / 'real.mcap', draw.draw_transport(rng, tier), seed=10 * seed,
            command_topic=draw.TOPIC,
        )  # fmt: skip
        found = statistics(path)
    return {'seed': seed, 'kind': kind, 'extra': what, 'share': share, 'nominal': error,
            'robot': world.family, 'rate_hz': world.rate_hz, **found}  # fmt: skip


def statistics(folder):
    """Return verdict and statistics of the models that compete on a recording."""
    robot = load_robot(str(folder / 'robot.urdf'))
    tree = nominal_tree(robot)
    raw = collect(open_recording(str(folder / 'real.mcap')).events(None, None), robot)
    equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
    competition = compete(equations, lambda _share: None)
    scale, base = Scale.of(equations, competition), competition.base
    decision = decide(equations, competition)
    models = (*competition.singles, *competition.pairs, *competition.more)
    ranked = sorted(models, key=scale.worth, reverse=True)[:_KEPT]
    return {
        'verdict': decision.verdict,
        'cutoff_hz': equations.filter.cutoff,
        'left': float(scale.shares(competition.parameters).max()),
        'base': _terms(scale, base),
        'models': [_terms(scale, model) for model in ranked],
    }


def _terms(scale, model):
    return {
        'effects': [s.effect.name for s in model.suspects],
        'is_free': bool(model.is_free),
        'freedom': int(model.freedom),
        'fit': round(scale.fit(model), 2),
        'worth': round(scale.worth(model), 2),
        'shares': [round(share, 6) for share in model.shares],
        'counts': bool(model.suspects) and scale.counts(model),
        'rest': round(scale.rest(model), 5),
    }


if __name__ == '__main__':
    main()
