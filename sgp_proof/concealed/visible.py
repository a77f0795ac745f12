"""Whether effects are found at twice the size that a recording says it would show, not at half.

    python -m sgp_proof.concealed.visible --tier B --seeds 3000:3008

Draws robots as the nominal one and asks a recording of each what it would have shown at least.
Then the same motion is recorded with each of these effects, on a joint that can have it, at half
and at twice that size, and diagnosed. Results go to `sgp_proof/results/visible_<tier>.json`.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from pathlib import Path

import numpy as np

from sgp_proof.concealed import draw
from sgp_proof.concealed import world as worlds
from sgp_proof.concealed.kinds import draw_effect
from sgp_proof.concealed.robots import urdf
from sgp_proof.concealed.scoring import rate
from sgp_proof.result_files import RESULTS, seed_range, write_result
from sgp_ros.apps.simulation import write_simulated
from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.decide.decision import decide
from sgp_ros.diagnosis.decide.visibility import visibility
from sgp_ros.diagnosis.explain.comparison import compare_models
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.drawing import UnsuitableError
from sgp_ros.physics.place import PLACES, joint_name
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree

FACTORS = (0.5, 2.0)
SOUGHT = tuple(e.name for e in EFFECTS.values() if any(q.is_sought for q in e.quantities))
_SECONDS, _TRIES = 33.0, 20


def main() -> None:
    """Draw the worlds, diagnose them and count what was found."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--tier', choices=('A', 'B'), default='B')
    parser.add_argument('--seeds', default='3000:3008', help='FIRST:LAST+1')
    parser.add_argument('--out', type=Path, default=RESULTS, help='folder of the result')
    arguments = parser.parse_args()
    rows = []
    for seed in seed_range(arguments.seeds):
        for row in drawn(seed, arguments.tier):
            rows.append(row)
            print(seed, row['effect'], row['joint'], row['factor'], row['said'], flush=True)
            report = {
                'tier': arguments.tier, 'seeds': arguments.seeds, 'summary': summary(rows),
                'rows': rows,
            }  # fmt: skip
            write_result(arguments.out / f'visible_{arguments.tier.lower()}.json', report)


def summary(rows):
    """Return in how many recordings each effect was named, by its size over the stated one."""
    found = {}
    for factor in FACTORS:
        own = [r for r in rows if r['factor'] == factor]
        found[str(factor)] = {
            name: rate(r['is_named'] for r in own if name in {'all', r['effect']})
            for name in ('all', *SOUGHT)
        }
    return found


def drawn(seed, tier):
    """Yield what is said of one robot with effects of the sizes that it states."""
    for attempt in range(_TRIES):
        rng = np.random.default_rng([seed, ord(tier), attempt])
        try:
            world = worlds.draw_world(seed, rng, tier, 0.0)
            world, motion, _ = draw.observed(rng, world, tier)
            with tempfile.TemporaryDirectory() as folder:
                _, decision, stated = diagnosed(Path(folder), world, tier, ())
            break
        except UnsuitableError:
            continue
    else:
        return
    least = {(effect, joint): p.value for (joint, effect, _), p in stated.items()}
    for name in SOUGHT:
        try:
            effect = draw_effect(rng, name, world.bodies, motion, tier == 'B')
        except UnsuitableError:
            continue
        value = least.get((name, effect.at.joint), math.inf)
        if effect.at.joint in PLACES or not math.isfinite(value):
            continue
        for factor in FACTORS:
            effect.size = factor * value
            try:
                with tempfile.TemporaryDirectory() as folder:
                    equations, decision, _ = diagnosed(Path(folder), world, tier, (effect,))
            except UnsuitableError:
                continue
            said = [
                [s.effect.name, joint_name(equations.motion, s.place.joint)]
                for s in decision.model.effects
            ]
            yield {
                'seed': seed, 'robot': world.family, 'effect': name, 'joint': effect.at.joint,
                'stated': value, 'factor': factor, 'verdict': decision.verdict, 'said': said,
                'is_named': [name, effect.at.joint] in said,
            }  # fmt: skip


def diagnosed(folder, world, tier, effects):
    """Return equations, decision and visibility of a recording of a world."""
    recording = world.run('near', _SECONDS, 1, effects)
    (folder / 'robot.urdf').write_text(urdf(world.family, world.bodies), encoding='utf-8')
    write_simulated(
        recording, folder / 'real.mcap', draw.draw_transport(np.random.default_rng(0), tier),
        seed=world.seed, command_topic=draw.TOPIC,
    )  # fmt: skip
    robot = load_robot(str(folder / 'robot.urdf'))
    tree = nominal_tree(robot)
    raw = collect(open_recording(str(folder / 'real.mcap')).events(None, None), robot)
    equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
    comparison = compare_models(equations, lambda _share: None)
    decision = decide(equations, comparison)
    return equations, decision, {} if effects else visibility(equations, comparison, decision)


if __name__ == '__main__':
    main()
