"""Free swings: names of what robots without motors lose until they rest.

    python -m sgp_proof.concealed.swings --seeds 0:60

Hanging links, one or two, whose equations are written out here, are let go and lose their energy,
in turn, to nothing, to viscous or dry friction, to drag, or to drag and dry friction. Encoders
count or are noisy. The robot file is 1 % off in every number of its bodies, in one world in six
further. Nothing but positions is recorded.
"""

from __future__ import annotations

import math
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from sgp_proof.result_files import make_parser, seed_range, write_result
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.physics.catalogue import COULOMB_FRICTION, QUADRATIC_DRAG, VISCOUS_FRICTION
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree

GRAVITY = 9.81
VISCOUS, DRY, DRAG = VISCOUS_FRICTION.name, COULOMB_FRICTION.name, QUADRATIC_DRAG.name
LAWS = {
    'nothing': (), 'wrong bodies': (), VISCOUS: (VISCOUS,), DRY: (DRY,), DRAG: (DRAG,),
    f'{DRAG} and {DRY}': (DRAG, DRY),
}  # fmt: skip
KINDS = tuple(LAWS)
SECONDS, RATES_HZ, SWING = (20.0, 80.0), (50.0, 60.0, 100.0, 200.0), (0.5, 1.5)
DECAY, NOISE = (0.3, 2.0), (2e-4, 2e-3)
"""Friction in e-folds of the swing within the recording, errors of encoders [rad]."""
_HEAD = '<robot name="swing"><link name="base"/>'


def drawn(seed):
    """Return what a world conceals and what is said of it."""
    rng = np.random.default_rng((seed, 23))
    kind, k = KINDS[seed % len(KINDS)], 1 + (seed // len(KINDS)) % 2
    size, seconds, rate = _log(rng, 0.1, 1.5), rng.uniform(*SECONDS), float(rng.choice(RATES_HZ))
    links = [_link(rng, size) for _ in range(k)]
    stated = [tuple(x * (1.0 + 0.01 * rng.uniform(-1.0, 1.0)) for x in link) for link in links]
    if kind == 'wrong bodies':
        m, c, inertia, length = stated[-1]
        stated[-1] = m, c * float(rng.choice((0.9, 1.12))), 1.2 * inertia, length
    inertias = _mass_matrix(links, 0.0).diagonal()
    pace, swing = math.sqrt(GRAVITY / size), rng.uniform(*SWING)
    b = 2.0 * inertias * _log(rng, *DECAY) / seconds / max(len(LAWS[kind]), 1)
    speed = 0.6 * swing * pace
    force = {VISCOUS: lambda v: b * v, DRY: lambda v: b * speed * np.tanh(1e3 * v / pace),
             DRAG: lambda v: b / speed * np.abs(v) * v}  # fmt: skip
    laws = [force[name] for name in LAWS[kind]]

    def change(_t, x):
        q, v = x[:k], x[k:]
        tau = -sum((law(v) for law in laws), np.zeros(k)) - _bias(links, q, v)
        return np.concatenate([v, np.linalg.solve(_mass_matrix(links, q[-1]), tau)])

    t = np.arange(0.0, seconds, 1.0 / rate)
    x0 = np.concatenate([[swing], np.zeros(2 * k - 1)])
    x = solve_ivp(change, (0.0, seconds), x0, 'LSODA', t, rtol=1e-9, atol=1e-10).y
    q, v, noise = x[:k].T, x[k:].T, _log(rng, *NOISE)
    energy = 0.5 * inertias * (v**2).max(axis=0)
    work = sum(((law(v) * v).sum(axis=0) / rate for law in laws), np.zeros(k))
    is_counted = rng.random() < 0.5
    shown = (
        np.round(q / noise) * noise if is_counted else q + noise * rng.normal(0.0, 0.5, q.shape)
    )
    found = _said(t, shown, stated)
    sizes = {VISCOUS: b, DRY: b * speed, DRAG: b / speed}
    truth = {name: sizes[name].tolist() for name in LAWS[kind]}
    return {'seed': seed, 'kind': kind, 'joints': k, 'truth': truth,
            'lost': (work / energy).tolist(), **found, **_judged(truth, found)}  # fmt: skip


def _log(rng, low, high):
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def _link(rng, size):
    """Return mass, centre below the joint, inertia about it, and length."""
    length, mass = size * rng.uniform(0.5, 1.0), _log(rng, 0.1, 5.0)
    return (
        mass,
        length * rng.uniform(0.4, 1.0),
        mass * (length * rng.uniform(0.15, 0.35)) ** 2,
        length,
    )


def _mass_matrix(links, q):
    """Return that of one or two links, the second turned by q."""
    m, c, inertia, length = links[0]
    if len(links) == 1:
        return np.array([[inertia + m * c * c]])
    m2, c2, i2, _ = links[1]
    arm, last = m2 * length * c2 * math.cos(q), i2 + m2 * c2 * c2
    first = inertia + m * c * c + m2 * length**2 + last + 2.0 * arm
    return np.array([[first, last + arm], [last + arm, last]])


def _bias(links, q, v):
    """Return what gravity and rotation take."""
    m, c, _, length = links[0]
    if len(links) == 1:
        return np.array([m * GRAVITY * c * math.sin(q[0])])
    m2, c2, _, _ = links[1]
    arm, low = m2 * length * c2 * math.sin(q[1]), m2 * c2 * GRAVITY * math.sin(q[0] + q[1])
    high = (m * c + m2 * length) * GRAVITY * math.sin(q[0])
    return np.array([high + low - arm * (2.0 * v[0] * v[1] + v[1] ** 2), low + arm * v[0] ** 2])


def _said(t, q, stated):
    """Return verdict, certainty and what is named, with its size and probability."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'robot.yaml'
        (path.parent / 'swing.urdf').write_text(_urdf(stated), encoding='utf-8')
        joints = ', '.join(f'j{i}' for i in range(len(stated)))
        path.write_text(f'schema: 1\nurdf: swing.urdf\npassive: [{joints}]\n', encoding='utf-8')
        robot = load_robot(str(path))
        events = [JointSample(round(1e9 * s), robot.joint_names, frozen_array(x))
                  for s, x in zip(t, q, strict=True)]  # fmt: skip
        found = diagnose(events, robot, nominal_tree(robot), {})
    named = [(f.effect, f.joint, float(next(iter(f.parameters.values())).value), f.probability)
             for f in found.findings if f.probability >= 0.5 and f.parameters]  # fmt: skip
    return {'verdict': found.verdict, 'certainty': found.certainty, 'named': named}


def _urdf(links):
    text, parent, down = _HEAD, 'base', 0.0
    for i, (mass, centre, inertia, length) in enumerate(links):
        text += (
            f'<joint name="j{i}" type="continuous"><parent link="{parent}"/><child link="l{i}"/>'
            f'<origin xyz="0 0 {-down:.9g}"/><axis xyz="0 -1 0"/></joint><link name="l{i}">'
            f'<inertial><origin xyz="0 0 {-centre:.9g}"/><mass value="{mass:.9g}"/>'
            f'<inertia ixx="{inertia:.9g}" iyy="{inertia:.9g}" izz="{inertia / 5.0:.9g}" ixy="0" '
            'ixz="0" iyz="0"/></inertial></link>'
        )
        parent, down = f'l{i}', length
    return text + '</robot>'


def _judged(truth, found):
    """Return whether what there is is named, whether anything else is, and a claim of nothing."""
    laws = {name for name, *_ in found['named']}
    is_calm = found['verdict'] in {'no_mismatch', 'parameters_only'}
    return {
        'is_right': laws == set(truth) and (bool(truth) or is_calm),
        'is_wrong': bool(laws - set(truth)),
        'is_denied': bool(truth) and is_calm and found['certainty'] is not None,
    }


def main():
    """Draw and diagnose worlds, and write what came of them."""
    parser = make_parser(__doc__, 'swings')
    parser.add_argument('--seeds', type=seed_range, default=range(60), metavar='FIRST:LAST+1')
    arguments = parser.parse_args()
    rows, count = [], Counter()
    for seed in arguments.seeds:
        rows.append(drawn(seed))
        print(rows[-1], flush=True)
        for what in ('is_right', 'is_wrong', 'is_denied'):
            count[f'{rows[-1]["kind"]}: {what[3:]}'] += rows[-1][what]
    seeds = [arguments.seeds.start, arguments.seeds.stop]
    write_result(arguments.out, {'seeds': seeds, 'summary': dict(count), 'worlds': rows})
    print(dict(count))


if __name__ == '__main__':
    main()
