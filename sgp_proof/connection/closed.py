"""Concealed logs of position control: targets and motion alone, no effort, diagnosed and scored.

    python -m sgp_proof.connection.closed --seeds 0:30 [--outputs DIR]

A driven robot follows smooth targets under proportional and derivative gains. Each world conceals
one or two of: gains other than stated, a delay of the target, rotor inertia, dry friction; or
nothing. The truth moves in MuJoCo, whose friction and integration share no code with the package.
A component is named where effect and joint are right and every number is to 15 % or within three
standard deviations. Results go to `sgp_proof/results/closed_loop.json`.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import mujoco
import numpy as np
import yaml

from sgp_proof.concealed import robots
from sgp_proof.concealed.run import OUTCOME
from sgp_proof.result_files import RESULTS, seed_range, write_result
from sgp_ros.engine.samples import POSITION, CommandSample, JointSample, frozen_array
from sgp_ros.physics.catalogue import ARMATURE, COMMAND_DELAY, COULOMB_FRICTION
from sgp_ros.recordings.messages import JOINT_STATE
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.robots.exports.handover import hand_over
from sgp_ros.robots.exports.mjcf import write_mjcf
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot

GAIN, DELAY, ROTOR, DRY = 'gain_scale', COMMAND_DELAY.name, ARMATURE.name, COULOMB_FRICTION.name
PLAN = (
    (GAIN,), (DELAY,), (ROTOR,), (DRY,), (DELAY, ROTOR), (DELAY, DRY), (ROTOR, DRY), (GAIN, DRY),
    (), (DELAY, GAIN), (DRY, DRY), (),
)  # fmt: skip
_FAMILIES = ('arm2', 'arm3', 'scara', 'pendulum', 'axis')
_STEP_S, _LENGTH_S, _STAMP_NS = 2.5e-4, 24.0, 1_700_000_000_000_000_000
_RATES_HZ = (50.0, 100.0, 125.0, 200.0, 250.0, 500.0)
_CLOSE, _STD = 0.15, 3.0


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--seeds', default='0:24', help='FIRST:LAST+1[,...]')
    parser.add_argument('--outputs', type=Path, help='where worlds and diagnoses are kept')
    parser.add_argument('--out', type=Path, default=RESULTS, help='folder of the result')
    parser.add_argument('--seconds', type=float, default=math.inf, help='stop after these')
    arguments = parser.parse_args()
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.outputs or Path(scratch)
        rows = [
            scored(folder, seed)
            for seed in seed_range(arguments.seeds)
            if time.monotonic() - begin < arguments.seconds or _is_done(folder, seed)
        ]
    report = {'seeds': arguments.seeds, 'summary': summary(rows), 'cases': rows}
    write_result(arguments.out / 'closed_loop.json', report)
    print(json.dumps(report['summary'], indent=1))


def _is_done(folder, seed):
    return (folder / f'case_{seed:03d}' / 'out' / OUTCOME).exists()


def scored(folder, seed):
    """Draw, diagnose and score one world, unless that was done before."""
    case = folder / f'case_{seed:03d}'
    answer_file = case / 'answer.json'
    if not answer_file.exists():
        draw_case(seed, case)
    answer = json.loads(answer_file.read_text(encoding='utf-8'))
    if not (case / 'out' / OUTCOME).exists():
        _diagnose(case)
    outcome = json.loads((case / 'out' / OUTCOME).read_text(encoding='utf-8'))
    row = {'case': case.name, **answer, 'seconds': outcome['seconds']}
    if outcome['status']:
        row |= {'said': 'refused', 'why': outcome['why'], 'named': [False] * len(answer['hidden']),
                'spurious': []}  # fmt: skip
    else:
        diagnosis = json.loads((case / 'out' / 'diagnosis.json').read_text(encoding='utf-8'))
        found = [
            f for f in (*diagnosis['setup'], *diagnosis['findings']) if f['probability'] > 0.5
        ]
        row |= {
            'said': [diagnosis['verdict'], *([f['effect'], f['joint']] for f in found)],
            'named': [any(_is(w, f, answer['driven']) for f in found) for w in answer['hidden']],
            'spurious': [
                [f['effect'], f['joint'], round(f['probability'], 3)] for f in found
                if not any(_is_same(w, f, answer['driven']) for w in answer['hidden'])
            ],
        }  # fmt: skip
    print(row['case'], answer['family'], answer['rate_hz'],
          [(h['effect'], h['joint']) for h in answer['hidden']], '->', row['said'], row['named'],
          f'{row["seconds"]:.0f} s', flush=True)  # fmt: skip
    return row


def _is_same(wanted, found, driven):
    """Return whether effect and joint are those of a component; of one motor, all are it."""
    joints = {wanted['joint'], *(driven if wanted['joint'] == 'all' and len(driven) == 1 else ())}
    return found['effect'] == wanted['effect'] and found['joint'] in joints


def _is(wanted, found, driven):
    if not _is_same(wanted, found, driven):
        return False
    for name, true in wanted['parameters'].items():
        number = found['parameters'].get(name, {})
        off = abs(number.get('value', math.inf) - true)
        size = abs(true - 1.0) if wanted['effect'] == GAIN else abs(true)
        floor = 0.02 if wanted['effect'] == GAIN else 0.0
        if off > max(_CLOSE * size + floor, _STD * (number.get('std') or 0.0)):
            return False
    return True


def summary(rows):
    """Return how many components are named, and in how many worlds something wrong is."""
    components = [(h['effect'], n) for r in rows for h, n in zip(r['hidden'], r['named'],
                                                                 strict=True)]  # fmt: skip
    by_effect = {
        effect: [sum(n for e, n in components if e == effect),
                 sum(e == effect for e, _ in components)]
        for effect in (GAIN, DELAY, ROTOR, DRY)
    }  # fmt: skip
    by_rate = {}
    for r in rows:
        named, count = by_rate.setdefault(f'{r["rate_hz"]:g}', [0, 0])
        by_rate[f'{r["rate_hz"]:g}'] = [named + sum(r['named']), count + len(r['named'])]
    return {
        'worlds': len(rows),
        'all_named': sum(all(r['named']) for r in rows if r['hidden']),
        'with_hidden': sum(bool(r['hidden']) for r in rows),
        'components_named': [sum(n for _, n in components), len(components)],
        'worlds_with_spurious': sum(bool(r['spurious']) for r in rows),
        'refused': sum(r['said'] == 'refused' for r in rows),
        'by_effect': by_effect,
        'by_rate_hz': by_rate,
    }


def draw_case(seed, case):
    """Write recording, robot, gains and answer of a world."""
    rng = np.random.default_rng([seed, ord('C')])
    kinds = PLAN[seed % len(PLAN)]
    least = 2 if ROTOR in kinds or kinds == (DRY, DRY) else 1
    while True:
        family, bodies = robots.draw_robot(rng)
        if family in _FAMILIES and all(b.is_driven for b in bodies) and len(bodies) >= least:
            break
    case.mkdir(parents=True, exist_ok=True)
    (case / 'robot.urdf').write_text(robots.urdf(family, bodies), encoding='utf-8')
    model = _model(case / 'robot.urdf')
    names = [b.joint for b in bodies]
    inertia, gravity = _typical(model, bodies)
    frequency, ratio = rng.uniform(3.0, 9.0, len(names)), rng.uniform(0.5, 1.1, len(names))
    kp = inertia * (2.0 * np.pi * frequency) ** 2
    kd = 2.0 * ratio * np.sqrt(kp * inertia)
    kp, kd = (np.array([float(f'{x:.3g}') for x in gains]) for gains in (kp, kd))
    rate = float(rng.choice(_RATES_HZ))
    targets = _targets(rng, bodies, rate)
    effort = inertia * np.abs(np.gradient(np.gradient(targets, 1 / rate, axis=0), 1 / rate,
                                          axis=0)).max(axis=0) + 0.3 * gravity  # fmt: skip
    hidden = [_drawn(rng, kind, names, inertia, effort) for kind in kinds]
    if kinds == (DRY, DRY):
        i, j = rng.choice(len(names), 2, replace=False)
        for entry, at in zip(hidden, (i, j), strict=True):
            level = float(0.2 * effort[at] * rng.uniform(0.5, 1.5))
            entry |= {'joint': names[at], 'parameters': {'level': level}}
    q, v = _simulated(model, names, targets, rate, kp, kd, hidden)
    _write(case, rng, names, rate, targets, q, v)
    gains = {key: dict(zip(names, map(float, x), strict=True)) for key, x in
             (('kp', kp), ('kd', kd))}  # fmt: skip
    (case / 'gains.yaml').write_text(yaml.safe_dump(gains), encoding='utf-8')
    answer = {'family': family, 'rate_hz': rate, 'driven': names, 'hidden': hidden}
    (case / 'answer.json').write_text(json.dumps(answer, indent=1) + '\n', encoding='utf-8')


def _model(path):
    text, _ = write_mjcf(hand_over(nominal_model(load_robot(str(path)))), None)
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep = _STEP_S
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    return model


def _typical(model, bodies):
    """Return the diagonal of the mass matrix and the torque of gravity at the centre, (k,)."""
    data = mujoco.MjData(model)
    order = [model.joint(b.joint).id for b in bodies]
    data.qpos[order] = [b.centre for b in bodies]
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    for column in range(model.nv):
        mujoco.mj_mulM(model, data, M[column], np.eye(model.nv)[column])
    return np.diag(M)[order], np.abs(data.qfrc_bias[order])


def _targets(rng, bodies, rate):
    """Return sums of waves that start at rest, (n, k)."""
    t = np.arange(int(_LENGTH_S * rate)) / rate
    columns = []
    for body in bodies:
        waves = sum(
            rng.uniform(0.4, 1.0) * np.sin(2.0 * np.pi * rng.uniform(0.1, 1.3) * t + phase)
            for phase in rng.uniform(0.0, 2.0 * np.pi, 5)
        )
        span = min(body.span, 1.0) if not body.is_prismatic else body.span
        columns.append(body.centre + 0.7 * span * waves / np.abs(waves).max())
    smooth = np.clip(t / 2.0, 0.0, 1.0)[:, None]
    found = np.array(columns).T
    return found[0] + smooth * (found - found[0])


def _drawn(rng, kind, names, inertia, effort):
    j = int(rng.integers(1 if kind == ROTOR and len(names) > 1 else 0, len(names)))
    entry = {'effect': kind, 'joint': names[j]}
    if kind == GAIN:
        scale = np.exp(rng.choice([-1.0, 1.0], 2) * rng.uniform(0.15, 0.6, 2))
        return entry | {'parameters': {'kp': float(scale[0]), 'kd': float(scale[1])}}
    if kind == DELAY:
        return {'effect': kind, 'joint': 'all', 'parameters': {
            'delay': float(np.exp(rng.uniform(math.log(0.005), math.log(0.04))))}}  # fmt: skip
    if kind == ROTOR:
        size = float(inertia[j] * np.exp(rng.uniform(math.log(0.1), math.log(0.8))))
        return entry | {'parameters': {'inertia': size}}
    return entry | {'parameters': {'level': float(effort[j] * rng.uniform(0.08, 0.35))}}


def _simulated(model, names, targets, rate, kp, kd, hidden):
    """Return positions and velocities at the times of the targets, (n, k) each."""
    order = [model.joint(name).id for name in names]
    kp, kd, delay = kp.copy(), kd.copy(), 0.0
    for h in hidden:
        j, p = names.index(h['joint']) if h['joint'] in names else 0, h['parameters']
        if h['effect'] == GAIN:
            kp[j], kd[j] = kp[j] * p['kp'], kd[j] * p['kd']
        elif h['effect'] == DELAY:
            delay = p['delay']
        elif h['effect'] == ROTOR:
            model.dof_armature[order[j]] = p['inertia']
        else:
            model.dof_frictionloss[order[j]] = p['level']
            model.dof_solref[order[j]] = (0.001, 1.0)
            model.dof_solimp[order[j]] = (0.99, 0.9999, 1e-4, 0.5, 2.0)
    data = mujoco.MjData(model)
    data.qpos[order] = targets[0]
    mujoco.mj_forward(model, data)
    found = np.empty((2, *targets.shape))
    force = np.zeros(model.nv)
    for row in range(len(targets)):
        found[0, row], found[1, row] = data.qpos[order], data.qvel[order]
        while data.time < (row + 1) / rate - 0.5 * _STEP_S:
            at = max(int((data.time - delay) * rate + 1e-6), 0)
            force[order] = kp * (targets[at] - data.qpos[order]) - kd * data.qvel[order]
            data.qfrc_applied[:] = force
            mujoco.mj_step(model, data)
    return found


def _write(case, rng, names, rate, targets, q, v):
    tick = 2.0 * np.pi / 2.0 ** int(rng.integers(16, 20))
    has_velocity = bool(rng.random() < 0.7)
    shown, noise = np.round(q / tick) * tick, 2e-3 * v.std(axis=0)
    with RecordingWriter(case / 'real.mcap', command_type=JOINT_STATE) as writer:
        for i, row in enumerate(shown):
            stamp = _STAMP_NS + round(i * 1e9 / rate)
            writer.write_event(
                CommandSample(stamp, frozen_array(targets[i]), tuple(names), POSITION)
            )
            velocity = frozen_array(v[i] + rng.normal(0.0, noise)) if has_velocity else None
            writer.write_event(JointSample(stamp, tuple(names), frozen_array(row), velocity))


def _diagnose(case):
    begin = time.perf_counter()
    words = ['diagnose', str(case / 'real.mcap'), '--robot', str(case / 'robot.urdf'),
             '--gains', str(case / 'gains.yaml'), '--out', str(case / 'out')]  # fmt: skip
    done = subprocess.run([sys.executable, '-m', 'sgp_ros.cli', *words], capture_output=True,
                          text=True, check=False)  # fmt: skip
    (case / 'out').mkdir(exist_ok=True)
    outcome = {'status': done.returncode, 'why': done.stderr.strip()[-300:],
               'seconds': round(time.perf_counter() - begin, 1)}  # fmt: skip
    (case / 'out' / OUTCOME).write_text(json.dumps(outcome) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
