"""Robots with an elastic joint or mount: is it named, and is anything else bent into its place.

    python -m sgp_proof.concealed.elastic --seeds 7100:7110 --worlds DIR
    python -m sgp_proof.concealed.elastic --effect mount_elasticity --seeds 7200:7210 --worlds DIR

Draws worlds of tier A with a spring between motor and link, encoder on either side, or with a base
that gives way along an axis, diagnoses each without its simulation, and writes what was said
beside the truth to `sgp_proof/results/elastic.json` or `mount.json`. The resonance of a joint is
that while all others are free, at the middle of its range.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

import numpy as np

from sgp_proof.concealed.draw import draw_case
from sgp_proof.concealed.run import OUTCOME, diagnose_case
from sgp_proof.concealed.scoring import rate
from sgp_proof.result_files import RESULTS, seed_range, write_result
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.elasticity import JointElasticity
from sgp_ros.physics.mount import MountElasticity
from sgp_ros.rigid.rigid_body import mass_matrix
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree

RESULT = {JointElasticity.name: 'elastic.json', MountElasticity.name: 'mount.json'}
NUMBER = {JointElasticity.name: 'stiffness', MountElasticity.name: 'frequency'}
"""Parameter that is compared with the truth."""
LEAST = 0.5
"""Probability from which a finding is asserted."""


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--seeds', default='7100:7110', help='FIRST:LAST+1')
    parser.add_argument('--effect', choices=list(RESULT), default=JointElasticity.name)
    parser.add_argument('--worlds', type=Path, required=True, help='of recordings and diagnoses')
    arguments = parser.parse_args()
    worlds, rows = arguments.worlds, []
    for name in ('cases', 'answers', 'out'):
        (worlds / name).mkdir(parents=True, exist_ok=True)
    for seed in seed_range(arguments.seeds):
        case = f'case_{seed:03d}'
        if not (worlds / 'answers' / f'{case}.json').exists():
            print(draw_case(seed, 'A', arguments.effect, worlds), flush=True)
        out = worlds / 'out' / case
        (worlds / 'cases' / case / 'sim.mcap').unlink(missing_ok=True)
        if not (out / OUTCOME).exists():
            diagnose_case(worlds / 'cases' / case, out)
        answer = json.loads((worlds / 'answers' / f'{case}.json').read_text(encoding='utf-8'))
        diagnosis = json.loads((out / 'diagnosis.json').read_text(encoding='utf-8'))
        rows.append(scored(answer, diagnosis, resonance(worlds / 'cases' / case, answer)))
        print(json.dumps(rows[-1]), flush=True)
        report = {'seeds': arguments.seeds, 'summary': summary(rows), 'worlds': rows}
        write_result(RESULTS / RESULT[arguments.effect], report)


def resonance(folder, answer):
    """Return the frequency at which motor and link, or the base, swing [Hz]."""
    (effect,) = answer['effects']
    if effect['effect'] == MountElasticity.name:
        return effect['parameters']['frequency']
    tree = nominal_tree(load_robot(str(folder / 'robot.urdf')))
    middle = np.array([[np.mean(answer['joint_range'][j]) for j in tree.moving_names]])
    joint = tree.moving_names.index(effect['joint'])
    free = 1.0 / np.linalg.inv(mass_matrix(tree, tree.parameters, middle)[0])[joint, joint]
    J, K = (effect['parameters'][name] for name in ('motor_inertia', 'stiffness'))
    return math.sqrt(K / J + K / (free - J)) / (2.0 * math.pi)


def scored(answer, diagnosis, resonance_hz):
    """Return what was said of one world beside the truth."""
    (effect,) = answer['effects']
    true, name, number = effect['parameters'], effect['effect'], NUMBER[effect['effect']]
    side = EFFECTS[name].kind_word
    asserted = [f for f in diagnosis['findings'] if f['probability'] >= LEAST]
    own = [f for f in asserted if (f['effect'], f['joint']) == (name, effect['joint'])]
    errors = [abs(f['parameters'][number]['value'] / true[number] - 1.0) for f in own]
    return {
        'case': answer['case'], side: true[side], 'rate_hz': answer['rate_hz'],
        'resonance_hz': resonance_hz, 'verdict': diagnosis['verdict'],
        'is_named': bool(own),
        'right_side': any(f['parameters'][side]['value'] == true[side] for f in own),
        f'{number}_error': min(errors, default=None),
        'others': [[f['effect'], f['joint']] for f in asserted if f not in own],
    }  # fmt: skip


def summary(rows):
    """Return the rates over all worlds, and over those whose resonance the samples resolve."""
    seen = [r for r in rows if r['resonance_hz'] < 0.5 * r['rate_hz']]
    found = {}
    for name, some in (('all', rows), ('below_half_the_rate', seen)):
        number = next(key for row in rows for key in row if key.endswith('_error'))
        errors = [r[number] for r in some if r[number] is not None]
        found[name] = {
            'named': rate(r['is_named'] for r in some),
            'right_side': rate(r['right_side'] for r in some if r['is_named']),
            'something_else': rate(r['others'] for r in some),
            f'{number}_median': float(np.median(errors)) if errors else None,
        }
    return found


if __name__ == '__main__':
    main()
