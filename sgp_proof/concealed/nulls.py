"""Statistics of the verdict where their null hypotheses hold.

    python -m sgp_proof.concealed.nulls --tier B --seeds 1000:1100

Draws robots without concealed physics: as the nominal one, with wrong inertial parameters, or with
something unlisted that makes less of the squared effort than counts as physics. Then robots with
one effect of the list, to which nothing is to be added, and robots with an unlisted one, for which
nothing is adequate. Every model that is compared is fitted; its statistics go to
`sgp_proof/results/nulls_<tier>.json`. A test holds the thresholds of
`sgp_ros.diagnosis.decide.decision` to these.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from sgp_proof.concealed import balance, draw, sizes
from sgp_proof.concealed import world as worlds
from sgp_proof.concealed.kinds import draw_effect
from sgp_proof.concealed.robots import urdf
from sgp_proof.concealed.unknown import NAME as OUTSIDE
from sgp_proof.result_files import RESULTS, seed_range, write_result
from sgp_ros.apps.simulation import write_simulated
from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.decide.cross_validation import structure
from sgp_ros.diagnosis.decide.decision import decide
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.decide.visibility import hides_friction
from sgp_ros.diagnosis.explain.comparison import compare_models
from sgp_ros.physics.catalogue import VELOCITY_FILTER_LAG
from sgp_ros.physics.drawing import UnsuitableError
from sgp_ros.physics.place import joint_name
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree

NOTHING, PARAMETERS, SLIGHT = 'nothing', 'wrong parameters', 'slight unlisted effect'
LISTED, UNLISTED = 'one effect of the list', 'unlisted effect'
KINDS = (NOTHING, PARAMETERS, SLIGHT, LISTED, UNLISTED)
NAMES = tuple(name for name in draw.FIRST_LAWS if name != VELOCITY_FILTER_LAG.name)
"""Effects that are concealed alone; the lag of a sensor's velocity is no force."""
_CONCEALED = {SLIGHT: (2e-4, 3e-3), LISTED: (0.006, 0.2), UNLISTED: (0.006, 0.2)}
"""Range of the share of the squared effort that a concealed effect makes."""
_TRIES = 40
_KEPT = 3


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--tier', choices=('A', 'B'), default='B')
    parser.add_argument('--seeds', default='1000:1100', help='FIRST:LAST+1')
    parser.add_argument('--out', type=Path, default=RESULTS, help='folder of the result')
    arguments = parser.parse_args()
    path = arguments.out / f'nulls_{arguments.tier.lower()}.json'
    rows = []
    for seed in seed_range(arguments.seeds):
        begin = time.perf_counter()
        row = drawn(seed, arguments.tier)
        if row is None:
            continue
        rows.append(row)
        print(seed, row['kind'], row['robot'], row['verdict'],
              f'{time.perf_counter() - begin:.0f} s', flush=True)  # fmt: skip
        report = {'tier': arguments.tier, 'seeds': arguments.seeds, 'worlds': rows}
        write_result(path, report, indent=None)


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
    is_wrong = kind == PARAMETERS or (kind in _CONCEALED and rng.random() < 0.5)
    world = worlds.draw_world(seed, rng, tier, 0.3 if is_wrong else 0.0)
    world, motion, _ = draw.observed(rng, world, tier)
    concealed = []
    if kind in _CONCEALED:
        name = str(rng.choice(NAMES)) if kind == LISTED else OUTSIDE
        concealed = [draw_effect(rng, name, world.bodies, motion, tier == 'B')]
        low, high = _CONCEALED[kind]
        sizes.sized(world, concealed[0], math.exp(rng.uniform(math.log(low), math.log(high))))
    recording = world.run('near', 33.0, 1, concealed)
    share = max(sizes.own_share(recording, world, e) for e in concealed) if concealed else 0.0
    if concealed and (share < sizes.SMALLEST_SHARE) != (kind == SLIGHT):
        raise UnsuitableError(f'{concealed[0].at.name} makes {share:.2e}')
    error = max(x['nominal'] for x in balance.nominal_share(recording, world).values())
    if kind == PARAMETERS and error < sizes.SMALLEST_SHARE:
        raise UnsuitableError(f'wrong parameters make {error:.2e}')
    what = concealed[0].at.name if concealed else ''
    joint = concealed[0].at.joint if concealed else ''
    if what == OUTSIDE:
        what = concealed[0].at.parameters['kind']
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        (path / 'robot.urdf').write_text(urdf(world.family, world.bodies), encoding='utf-8')
        write_simulated(
            recording, path / 'real.mcap', draw.draw_transport(rng, tier), seed=10 * seed,
            command_topic=draw.TOPIC,
        )  # fmt: skip
        found = statistics(path, (what, joint) if kind == LISTED else None)
    return {'seed': seed, 'kind': kind, 'extra': what, 'share': share, 'nominal': error,
            'robot': world.family, 'rate_hz': world.rate_hz, **found}  # fmt: skip


def statistics(folder, truth=None):
    """Return verdict and statistics of the models that are compared on a recording.

    Args:
        folder: with `robot.urdf` and `real.mcap`.
        truth: effect and joint that are there; None for none of the list.
    """
    robot = load_robot(str(folder / 'robot.urdf'))
    tree = nominal_tree(robot)
    raw = collect(open_recording(str(folder / 'real.mcap')).events(None, None), robot)
    equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
    comparison = compare_models(equations, lambda _share: None)
    scale, base = Scale.of(equations, comparison), comparison.base
    decision = decide(equations, comparison)
    models = (*comparison.singles, *comparison.pairs, *comparison.more)
    ranked = sorted(models, key=scale.worth, reverse=True)
    best = next((m for m in ranked if scale.counts(m)), None)
    found = {
        'verdict': decision.verdict,
        'said': [_key(equations, s) for s in decision.model.effects],
        'cutoff_hz': equations.filter.cutoff,
        'left': float(comparison.parameters.left.max()),
        'hides_friction': decision.verdict in ('no_mismatch', 'parameters_only')
        and bool(hides_friction(equations, comparison, decision)),
        'base': _terms(scale, base),
        'models': [_terms(scale, model) for model in ranked[:_KEPT]],
        'structured_rest': None if best is None else _structured(equations, scale, best),
    }
    right = [m for m in ranked if [_key(equations, s) for s in m.effects] == [list(truth or ())]]
    if right:
        found |= {
            'right': _terms(scale, right[0]),
            'right_structured_rest': _structured(equations, scale, right[0]),
            'superfluous': _superfluous(scale, right[0], ranked),
            'richer': _richer(scale, right[0], comparison.singles),
        }
    return found


def _key(equations, candidate):
    return [candidate.effect.name, joint_name(equations.motion, candidate.place.joint)]


def _structured(equations, scale, model):
    return round(scale.rest(model, structure(equations, model.residual)), 6)


def _superfluous(scale, right, models):
    """Return the greatest gain of one more effect than there is, and its parameters."""
    more = [
        (scale.fit(m) - scale.fit(right), m.freedom - right.freedom)
        for m in models
        if right.key < m.key and len(m.effects) == 2 and m.is_free == right.is_free
        and scale.counts(m)
    ]  # fmt: skip
    return _most(more)


def _richer(scale, right, models):
    """Return the greatest gain of another effect with more parameters, and how many more."""
    more = [
        (scale.fit(m) - scale.fit(right), m.freedom - right.freedom)
        for m in models
        if m.key != right.key and m.freedom > right.freedom and m.is_free == right.is_free
        and scale.counts(m)
    ]  # fmt: skip
    return _most(more)


def _most(gains):
    if not gains:
        return None
    gain, parameters = max(gains)
    return {'gain': round(gain, 3), 'parameters': int(parameters)}


def _terms(scale, model):
    return {
        'effects': [s.effect.name for s in model.effects],
        'is_free': bool(model.is_free),
        'freedom': int(model.freedom),
        'fit': round(scale.fit(model), 2),
        'worth': round(scale.worth(model), 2),
        'shares': [round(share, 6) for share in model.shares],
        'counts': bool(model.effects) and scale.counts(model),
        'rest': round(scale.rest(model), 5),
    }


if __name__ == '__main__':
    main()
