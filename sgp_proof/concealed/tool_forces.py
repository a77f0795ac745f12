"""Machines with a force on the tool that no list has, drawn, diagnosed and scored.

    python -m sgp_proof.concealed.tool_forces --seeds 0:20 [--worlds DIR] [--name tool_forces]

The machines are those of `dirty`, with friction and rotors at every joint, of at least two joints.
A seed takes one family after the other; those of `BEYOND` have no formula among those that are
searched, and `none` has no force on the tool at all.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from sgp_proof.concealed import blemishes, dirty
from sgp_proof.concealed.concealed_effect import Concealed
from sgp_proof.concealed.robots import urdf
from sgp_proof.concealed.run import OUTCOME, diagnose_case
from sgp_proof.result_files import RESULTS, seed_range, write_result
from sgp_ros.diagnosis.explain.fitted_model import adds_to_usual
from sgp_ros.physics.catalogue import CONSTANT_LOAD, EFFECTS
from sgp_ros.physics.drawing import UnsuitableError
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.formula import read_formula
from sgp_ros.physics.parts import LawParameter
from sgp_ros.physics.tool_law import (
    ANCHOR,
    ATTACHED,
    AXES,
    DISTANCE,
    MOTION,
    STATED,
    UNITS,
    ToolLaw,
    tool_point,
)
from sgp_ros.robots.observed_motion import ObservedMotion
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree

NONE = 'none'
SAME, NEAR = 0.02, 0.1
"""Greatest error of a force that is the true one, and of one that is not wrong, relative to the
effort that it takes."""
_SHARE, _MOST = (0.01, 0.2), 1.0
"""Share of the mean squared effort of some joint that springs, loads and friction leave of the
force; the most of all efforts that the force may be."""
_TRIES = 40


@dataclass(frozen=True)
class Family:
    """A law over its size: path and formula, in `a`, a length `l` and a speed `u`."""

    path: str
    formula: str


FAMILIES = {
    'rope': Family(DISTANCE, '-a*(1 + 0.6*(s - l)/l)'),
    'pull': Family(DISTANCE, '-a'),
    'slack': Family(DISTANCE, '-a*max(s - l, 0)/l'),
    'floor': Family('z', 'a*max(l - s, 0)/l'),
    'axis_spring': Family('axis', '-a*(s - l)/l'),
    'drag': Family(MOTION, '-a*ds/u'),
    'fluid': Family(MOTION, '-a*ds**2/u**2'),
    'rubbing': Family(MOTION, '-a'),
    'damper': Family(DISTANCE, '-a*ds/u'),
    NONE: Family(DISTANCE, '0*a'),
    'gas_spring': Family(DISTANCE, 'a*(l/s)**1.6'),
    'hardening': Family('axis', '-a*((s - l)/l)**3'),
    'blade': Family(MOTION, '-a*(ds/u)**1.5'),
    'waves': Family('axis', 'a*sin(6*s/l)'),
}
BEYOND = ('gas_spring', 'hardening', 'blade', 'waves')


def draw_case(seed, out):
    """Write one world; return the name of its family."""
    kind = list(FAMILIES)[seed % len(FAMILIES)]
    for attempt in range(_TRIES):
        with suppress(UnsuitableError):
            return _attempt(seed, attempt, kind, out)
    return f'no suitable world of {kind}'


def _attempt(seed, attempt, kind, out):
    hidden = [i for i, wanted in enumerate(dirty.PLAN) if wanted == dirty.HIDDEN]
    drawn = len(dirty.PLAN) * seed + hidden[seed % len(hidden)]
    _, machine, effects, spoilt, rng = dirty.draw_world(drawn, attempt)
    if len(machine.bodies) < 2:
        raise UnsuitableError('one joint')
    case, seconds = f'case_{seed:03d}', float(rng.uniform(24.0, 45.0))
    folder = out / 'cases' / case
    for path in (folder, out / 'answers'):
        path.mkdir(parents=True, exist_ok=True)
    robot_file = folder / 'robot.urdf'
    robot_file.write_text(urdf(machine.family, machine.bodies), encoding='utf-8')
    tree, force, size = nominal_tree(load_robot(str(robot_file))), None, 0.0
    if kind != NONE:
        pilot = machine.run(12.0, 90, effects)
        force, size = _sized(rng, FAMILIES[kind], _motion(tree, pilot), pilot.effort)
        effects = [*effects, Concealed(force, -2, lambda _: force.parameters, 1.0)]
    parts = [machine.run(seconds / spoilt.parts, 1 + i, effects) for i in range(spoilt.parts)]
    for name, recordings in (('real', parts), ('real_test', [machine.run(15.0, 11, effects)])):
        found = blemishes.samples(recordings, machine.every, spoilt, rng)
        blemishes.write_samples(found, folder / f'{name}.mcap', rng)
    law = None if force is None else _described(force)
    answer = {
        'case': case, 'kind': kind, 'family': machine.family, 'joints': len(machine.bodies),
        'share': size, 'law': law,
        'effects': [[e.at.name, e.at.joint] for e in effects if e.index >= 0],
    }  # fmt: skip
    path = (out / 'answers' / case).with_suffix('.json')
    path.write_text(json.dumps(answer, indent=1) + '\n', encoding='utf-8')
    np.savez(out / 'answers' / f'{case}_motion.npz', q=parts[0].true_position[::5],
             v=parts[0].true_velocity[::5])  # fmt: skip
    return kind


def _motion(tree, recording):
    return _states(tree, recording.true_position, recording.true_velocity)


def _states(tree, q, v):
    still = np.zeros_like(q)
    return ObservedMotion(tree, np.arange(float(len(q))), 1.0, q, v, still, still, None)


def _law(path, formula, numbers, unit='1'):
    """Return a law of the tool whose numbers are all known, or start there."""
    formula = read_formula(formula, is_law=True)
    names = formula.parameters - UNITS.keys() | {*ToolLaw.point_names(path)}
    return ToolLaw(formula, path, [LawParameter(n, unit, start=numbers[n]) for n in sorted(names)])


def _force(law, numbers, motion):
    values = {q.name: numbers[q.name] for q in law.quantities}
    return EffectAt.stated(law, 'tool', values, motion.tree).force(motion)


def _sized(rng, family, motion, effort):
    """Return the effect with all its numbers, and its share of the effort of some joint."""
    tree = motion.tree
    at = tool_point(tree) + rng.uniform(-0.05, 0.05, 3) * (rng.random() < 0.6)
    seen = motion.tool.points(at)
    reach = float(np.ptp(seen, axis=0).max())
    path = family.path if family.path != 'axis' else str(rng.choice(AXES))
    away = rng.normal(size=3)
    away = seen.mean(axis=0) + away / np.linalg.norm(away) * reach * rng.uniform(0.8, 3.0)
    numbers = dict(zip(ATTACHED, at.tolist(), strict=True))
    numbers |= dict(zip(ANCHOR, away.tolist(), strict=True)) if path == DISTANCE else {}
    way = seen[:, AXES.index(path)] if path in AXES else np.linalg.norm(seen - away, axis=1)
    J = motion.tool.columns(at)
    fast = np.linalg.norm(np.einsum('nkx,nk->nx', J, motion.velocity), axis=1)
    numbers |= {'a': 1.0, 'l': float(np.quantile(way, rng.uniform(0.3, 0.6))),
                'u': float(np.sqrt(np.mean(fast**2)))}  # fmt: skip
    if abs(numbers['l']) < 0.05 * reach:
        raise UnsuitableError('a length near zero')
    law = _law(path, family.formula, numbers)
    force = _force(law, numbers, motion)
    left = _beyond_listed(force, motion)
    share = np.mean(left**2, axis=0) / np.maximum(np.mean(effort**2, axis=0), 1e-300)
    wanted = float(np.exp(rng.uniform(*np.log(_SHARE))))
    numbers['a'] = float(np.sqrt(wanted / share.max()))
    if np.mean((numbers['a'] * force) ** 2) > _MOST * np.mean(effort**2):
        raise UnsuitableError('a force that is hardly more than springs, loads and friction')
    values = {q.name: numbers[q.name] for q in law.quantities}
    return EffectAt.wanted(_law(path, family.formula, numbers), 'tool', values), wanted


def _beyond_listed(force, motion):
    """Return what springs, loads and friction of each joint leave of a force, (n, k).

    And a constant force on the tool.
    """
    n, k = force.shape
    columns = [
        np.eye(k)[j] * x[:, None] for j, (q, v) in
        enumerate(zip(motion.position.T, motion.velocity.T, strict=True))
        for x in (np.ones(n), q, v, np.sign(v))
    ]  # fmt: skip
    X = np.stack([*columns, *np.moveaxis(motion.tool_columns, 2, 0)], axis=2).reshape(n * k, -1)
    y = force.ravel()
    return (y - X @ np.linalg.lstsq(X, y, rcond=None)[0]).reshape(n, k)


def _described(at):
    numbers = {n: float(x) for n, x in at.parameters.items()}
    return {'path': at.effect.path, 'formula': at.effect.law.text, 'numbers': numbers}


def score(answer, motion, diagnosis):
    """Return what was said of one world."""
    findings = [f for f in diagnosis['findings'] if (f['probability'] or 0.0) > 0.5]
    known = {tuple(e) for e in answer['effects']}
    everyday = {e.name for e in EFFECTS.values() if adds_to_usual(e)} | {
        CONSTANT_LOAD.name,
        'unknown',
    }
    law = next((f for f in findings if STATED.match(f.get('formula') or '')), None)
    others = [
        [f['effect'], f['joint']] for f in findings
        if f is not law and (f['effect'], f['joint']) not in known
        and f['effect'] not in everyday
    ]  # fmt: skip
    error = None
    if law is not None:
        path, _, text = law['formula'].partition('=')
        found = {n: x['value'] for n, x in law['parameters'].items()}
        force = _force(_law(STATED.match(path)[1], text.strip(), found), found, motion)
        true = np.zeros_like(force)
        if answer['law']:
            known_law = answer['law']
            true = _force(_law(known_law['path'], known_law['formula'], known_law['numbers']),
                          known_law['numbers'], motion)  # fmt: skip
        error = float(np.sqrt(np.mean((force - true) ** 2) / max(np.mean(true**2), 1e-300)))
    return {
        'case': answer['case'], 'kind': answer['kind'], 'joints': answer['joints'],
        'share': answer['share'], 'verdict': diagnosis['verdict'],
        'said': None if law is None else law['formula'], 'error': error, 'others': others,
        'unknown': [f['joint'] for f in findings if f['effect'] == 'unknown'],
        'found': error is not None and error <= SAME and not others,
        'wrong': bool(others) or (error is not None and error > NEAR),
    }  # fmt: skip


def _scored(worlds, outputs, seed):
    case = f'case_{seed:03d}'
    if not (worlds / 'answers' / f'{case}.json').exists():
        draw_case(seed, worlds)
    if not (outputs / case / OUTCOME).exists():
        diagnose_case(worlds / 'cases' / case, outputs / case)
    answer = json.loads((worlds / 'answers' / f'{case}.json').read_text(encoding='utf-8'))
    tree = nominal_tree(load_robot(str(worlds / 'cases' / case / 'robot.urdf')))
    with np.load(worlds / 'answers' / f'{case}_motion.npz', allow_pickle=False) as found:
        motion = _states(tree, found['q'], found['v'])
    said = outputs / case / 'diagnosis.json'
    diagnosis = json.loads(said.read_text(encoding='utf-8')) if said.exists() else {
        'verdict': 'failed', 'findings': []}  # fmt: skip
    outcome = json.loads((outputs / case / OUTCOME).read_text(encoding='utf-8'))
    row = score(answer, motion, diagnosis) | {'seconds': outcome['seconds']}
    print(json.dumps(row), flush=True)
    return row


def summary(rows):
    """Return how many laws were found, left unknown and told wrong."""
    inside = [r for r in rows if r['kind'] not in {*BEYOND, NONE}]
    return {
        'worlds': len(rows), 'with_a_formula': len(inside),
        'found': sum(r['found'] for r in inside) / max(len(inside), 1),
        'wrong': sum(r['wrong'] for r in rows) / max(len(rows), 1),
    }  # fmt: skip


def main():
    """Draw, diagnose and score worlds, and write the result."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--seeds', default='0:20', help='FIRST:LAST+1')
    parser.add_argument('--worlds', type=Path, help='where worlds are kept, with the diagnoses')
    parser.add_argument('--processes', type=int, default=2)
    parser.add_argument('--name', default='tool_forces', help='of the file of results')
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        worlds = arguments.worlds or Path(folder)
        with ThreadPoolExecutor(arguments.processes) as pool:
            rows = list(pool.map(partial(_scored, worlds, worlds / 'out'),
                                 seed_range(arguments.seeds)))  # fmt: skip
    report = {'seeds': arguments.seeds, 'summary': summary(rows), 'cases': rows}
    write_result(RESULTS / f'{arguments.name}.json', report)
    print(json.dumps(report['summary'], indent=1))


if __name__ == '__main__':
    main()
