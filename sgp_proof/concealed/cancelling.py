"""Names where large forces cancel in an effort, and these are not known exactly.

    python -m sgp_proof.concealed.cancelling --seeds 0:60

Pendulums of one or two joints move as their robots say. To the discrepancy of one joint an error
of its inertial force is added, a smooth function of the motion, and in turn nothing, dry
friction, or a law that no list has; efforts are a small part of the inertial force. Each
discrepancy is decided with the accuracy of forces that the criteria allow, and without any.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from unittest import mock

import numpy as np

from sgp_proof.concealed.unlisted import FAMILIES
from sgp_proof.result_files import ROOT, make_parser, seed_range, write_result
from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.decide import cancelling
from sgp_ros.diagnosis.decide.certainty import settled
from sgp_ros.diagnosis.decide.decision import decide
from sgp_ros.diagnosis.explain.comparison import compare_models
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.physics import catalogue as laws
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.simulation.assembly import make_simulation
from sgp_ros.simulation.recording import simulate
from sgp_ros.simulation.tree_simulator import tree_simulator

ROBOTS = ('simple_pendulum', 'double_pendulum_a0')
SECONDS, RATE_HZ = 40.0, 200.0
ERROR, EFFORT, CONCEALED = (0.02, 0.08), (0.1, 0.4), (0.3, 0.8)
"""Error and effort relative to the inertial force, what is concealed relative to the effort."""
KINDS = ('nothing', 'dry friction', 'unlisted')
DRY = {law.name for law in (laws.COULOMB_FRICTION, laws.ASYMMETRIC_COULOMB, laws.HYSTERESIS,
                            laws.STRIBECK_FRICTION)}  # fmt: skip
OWN = [name for name in FAMILIES if not name.endswith('other') and name != 'walk']
"""Families of unlisted laws of the joint's own motion."""


def discrepancy(seed):
    """Return the equations of a drawn world, the joint, what is concealed there, and its level."""
    rng = np.random.default_rng((seed, 11))
    path = str(ROOT / f'config/robots/{ROBOTS[seed // len(KINDS) % len(ROBOTS)]}.urdf')
    run = simulate(make_simulation(tree_simulator(path), seed=seed, rate_hz=RATE_HZ), SECONDS)
    nominal = nominal_model(load_robot(path))
    names, events = nominal.robot.joint_names, []
    for stamp, q, u in zip(run.stamps_ns, run.position, run.command, strict=True):
        events.append(CommandSample(int(stamp), frozen_array(u)))
        events.append(JointSample(int(stamp), names, frozen_array(q)))
    raw = collect(events, nominal.robot, nominal.stated)
    equations = make_equations(raw, nominal.tree, choose_bandwidth(raw, nominal.tree))
    motion, joint = equations.motion, int(rng.integers(len(names)))
    inertial = equations.filter(motion.mass_diagonal * motion.acceleration)
    size = np.sqrt((inertial**2).mean(axis=0))
    q, v = motion.position / motion.position.std(axis=0), motion.velocity
    v = v / v.std(axis=0)
    wave = np.cos((np.hstack([q, v]) * rng.uniform(0.5, 2.0, 2 * len(names))).sum(axis=1)
                  + rng.uniform(0.0, 2.0 * np.pi))  # fmt: skip
    wrong = rng.uniform(*ERROR) * equations.filter(wave[:, None])[:, 0] * inertial[:, joint]
    power = rng.uniform(*EFFORT) ** 2 * size**2
    kind, level = KINDS[seed % len(KINDS)], 0.0
    name, force = kind, np.zeros(len(motion.time))
    if kind == 'unlisted':
        name = OWN[int(rng.integers(len(OWN)))]
        at = {'reach': 1.0, 'v': 1.0}
        force = np.array([FAMILIES[name](a, b, None, at) for a, b in zip(*(
            x[:, joint] - x[:, joint].mean() for x in (q, v)), strict=True)])  # fmt: skip
    elif kind == 'dry friction':
        force = -np.sign(v[:, joint])
    if force.any():
        level = float(rng.uniform(*CONCEALED) * np.sqrt(power[joint] / (force**2).mean()))
    d = equations.d.copy()
    d[:, joint] += wrong * np.sqrt(2.0) + equations.filter(level * force[:, None])[:, 0]
    return replace(equations, d=d, power=power), joint, name, level


def said(equations, comparison):
    """Return verdict and names at joints that are probable."""
    decision, _, chances = settled(equations, comparison, decide(equations, comparison))
    model = decision.model
    named = [(s, chances.of(model, i)) for i, s in enumerate(model.effects)]
    if decision.verdict != 'missing_physics':
        named = []
    return decision.verdict, [(s.name, s.place.joint, float(s.coefficients[0]), p)
                              for s, p in named if p >= 0.5]  # fmt: skip


def drawn(seed):
    """Return what was concealed in a world and what is said, with and without the accuracy."""
    equations, joint, name, level = discrepancy(seed)
    comparison = compare_models(equations, lambda _share: None)
    verdict, named = said(equations, comparison)
    with mock.patch.object(cancelling, 'FORCE_ACCURACY', 0.0):
        before, named_before = said(equations, comparison)
    kind = KINDS[seed % len(KINDS)]
    return {
        'seed': seed, 'kind': kind, 'concealed': name, 'joint': joint, 'level': level,
        'verdict': verdict, 'named': named, 'verdict_before': before, 'named_before': named_before,
        **{f'is_{what}{when}': value
           for when, found in (('', named), ('_before', named_before))
           for what, value in zip(('right', 'wrong'), _judged(kind, joint, found), strict=True)},
    }  # fmt: skip


def _judged(kind, joint, named):
    """Return whether what is there is named, and whether anything else is."""
    right = [kind == 'dry friction' and n in DRY and j == joint for n, j, _, _ in named]
    return any(right), not all(right)


def main():
    """Draw and decide worlds, and write what came of them."""
    parser = make_parser(__doc__, 'cancelling')
    parser.add_argument('--seeds', type=seed_range, default=range(60), metavar='FIRST:LAST+1')
    arguments = parser.parse_args()
    rows = []
    for seed in arguments.seeds:
        rows.append(drawn(seed))
        print(rows[-1], flush=True)
    count = Counter()
    for row in rows:
        count[row['kind']] += 1
        for what in ('is_right', 'is_wrong', 'is_right_before', 'is_wrong_before'):
            count[f'{row["kind"]}: {what[3:].replace("_", " ")}'] += row[what]
    seeds = [arguments.seeds.start, arguments.seeds.stop]
    write_result(arguments.out, {'seeds': seeds, 'summary': dict(count), 'worlds': rows})
    print(dict(count))


if __name__ == '__main__':
    main()
