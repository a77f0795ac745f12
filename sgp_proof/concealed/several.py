"""Answers of worlds with several effects, the scores of a diagnosis against them, and the rates.

An effect is asked for where what nothing else explains of it reaches the share that counts as
physics (see `unique`). A world is right if every effect that is asked for is asserted at its
joint, under its name or an equivalent one, and nothing else is asserted. Asserted is what has a
probability above one half. "Unknown" where nothing is unknown is no wrong law, and not right
either. What is concealed and not asked for may be asserted, or not.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from sgp_proof.concealed import answers, scoring
from sgp_proof.concealed.unique import Explained, Motion, force_of
from sgp_proof.concealed.unknown import NAME
from sgp_ros.diagnosis.criteria import LEAST_SHARE
from sgp_ros.physics.catalogue import (
    ASYMMETRIC_COULOMB,
    CONSTANT_LOAD,
    COULOMB_FRICTION,
    PAYLOAD,
    STRIBECK_FRICTION,
)
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree

ASSERTED = 0.5
"""Least probability of what counts as asserted, as the schema of diagnosis.json has it [1]."""
_CALM = ('no_mismatch', 'parameters_only')
_HALVES = (COULOMB_FRICTION.name, CONSTANT_LOAD.name)
"""Effects that make up friction that differs with direction."""


def answer(wanted, machine, effects, parts, urdf_path, noise=0.0):
    """Return what is true of a world and what a diagnosis is asked to name.

    Args:
        wanted: kind of the world.
        machine: of the world.
        effects: concealed ones.
        parts: simulated recordings that are diagnosed.
        urdf_path: of the robot file.
        noise: (k,) mean square of that of the recorded efforts.
    """
    motion = Motion.of(parts, noise)
    tree = nominal_tree(load_robot(str(urdf_path)))
    forces = [force_of(effect, machine.true, motion) for effect in effects]
    shares = [np.mean(force**2, axis=0) / motion.mean_square for force in forces]
    explained, unique = Explained(tree, motion), [0.0] * len(effects)
    for i in sorted(range(len(effects)), key=lambda i: -float(shares[i].max())):
        unique[i] = float(explained.left(forces[i]).max())
        explained.add(forces[i])
    entries = []
    for i, effect in enumerate(effects):
        others = Explained(tree, motion)
        for j, force in enumerate(forces):
            if j != i:
                others.add(force)
        entries.append(
            answers.effects_entry(effect, machine.bodies)
            | {
                'share': float(shares[i].max()), 'unique': unique[i],
                'is_asked': bool(unique[i] >= LEAST_SHARE),
                'names': names_of(effect, forces[i], others),
            }
        )  # fmt: skip
    q, bodies = motion.position, machine.bodies
    error = _parameter_share(machine, motion)
    return {
        'verdicts': verdicts(entries, error), 'effects': entries,
        'parameter_errors': machine.errors, 'parameter_share': error, 'wanted': wanted,
        'joints': [body.joint for body in bodies],
        'joint_range': {b.joint: [float(q[:, i].min()), float(q[:, i].max())]
                        for i, b in enumerate(bodies)},
    }  # fmt: skip


def names_of(effect, force, others):
    """Return the sets of names by which an effect may be called, its own first.

    Args:
        effect: concealed.
        force: (n, k) that it exerts.
        others: what bodies and all other effects explain.
    """
    name, joint = effect.at.name, effect.index
    found = [[name]]
    if name == ASYMMETRIC_COULOMB.name:
        found.append([COULOMB_FRICTION.name, CONSTANT_LOAD.name])
    if name in {ASYMMETRIC_COULOMB.name, STRIBECK_FRICTION.name}:
        plain = np.zeros_like(force)
        plain[:, joint] = np.sign(force[:, joint])
        others.add(plain)
        if others.left(force).max() < LEAST_SHARE:
            found.append([COULOMB_FRICTION.name])
    return found


def verdicts(entries, parameter_share):
    """Return the verdicts that are right."""
    if any(entry['effect'] == NAME and entry['is_asked'] for entry in entries):
        return ['unexplained']
    if any(entry['is_asked'] for entry in entries):
        return ['missing_physics']
    found = ['parameters_only'] if parameter_share > 0.0 else ['no_mismatch']
    if 0.0 < parameter_share < LEAST_SHARE:
        found.append('no_mismatch')
    if entries:
        found.append('missing_physics')
    return found


def _parameter_share(machine, motion):
    """Return the greatest share of a joint's effort that wrong bodies make."""
    if not machine.errors:
        return 0.0
    needed = []
    for simulator in (machine.true, machine.nominal):
        rows = []
        for q, v, a in zip(motion.position, motion.velocity, motion.acceleration, strict=True):
            inverse_mass, force = simulator.mechanism.dynamics(q, v)
            rows.append(np.linalg.solve(inverse_mass, a) - force)
        needed.append(np.array(rows))
    return float(np.max(np.mean((needed[0] - needed[1]) ** 2, axis=0) / motion.mean_square))


def asserted(diagnosis):
    """Return the findings that are asserted."""
    return [f for f in diagnosis['findings'] if (f['probability'] or 0.0) > ASSERTED]


def score(answer, diagnosis):
    """Return the row of one world."""
    found = {(f['effect'], f['joint']) for f in asserted(diagnosis)}
    named, missed, allowed = [], [], set()
    lopsided = _lopsided(answer)
    for effect in answer['effects']:
        joint = effect['joint']
        sets = [{(name, joint) for name in names} for names in effect['names']]
        if effect['effect'] in _HALVES:
            sets += [{x} for x in lopsided if x[1] == joint]
        allowed |= set().union(*sets)
        if effect['is_asked']:
            hit = any(names <= found for names in sets)
            (named if hit else missed).append([effect['effect'], joint])
    allowed |= _equivalents(answer)
    spurious = [
        [f['effect'], f['joint'], round(f['probability'], 3)]
        for f in asserted(diagnosis)
        if (f['effect'], f['joint']) not in allowed
    ]
    wrong = [x for x in spurious if x[0] != NAME]
    is_calm = not any(effect['is_asked'] for effect in answer['effects'])
    said = diagnosis['verdict']
    return {
        'said': said, 'named': named, 'missed': missed, 'wrong': wrong,
        'unexplained': [x for x in spurious if x[0] == NAME],
        'right_findings': len(found) - len(spurious),
        'right': not missed and not spurious and said in answer['verdicts'],
        'is_calm': is_calm, 'alarm': is_calm and said not in (*_CALM, *answer['verdicts']),
        'parameters': scoring.parameter_scores(answer, diagnosis),
        'certainty': diagnosis['certainty'],
    }  # fmt: skip


def failed(answer):
    """Return the row of a world whose diagnosis ended with an error."""
    missed = [[e['effect'], e['joint']] for e in answer['effects'] if e['is_asked']]
    return {
        'said': 'failed', 'named': [], 'missed': missed, 'wrong': [], 'unexplained': [],
        'right_findings': 0, 'right': False, 'is_calm': not missed, 'alarm': False,
        'parameters': [], 'certainty': None, 'held_out': {},
    }  # fmt: skip


def _lopsided(answer):
    """Return where Coulomb friction and a constant load are friction that differs by direction."""
    level, load = (
        {e['joint']: abs(e['parameters'].get(number, np.inf))
         for e in answer['effects'] if e['effect'] == name}
        for name, number in ((COULOMB_FRICTION.name, 'level'), (CONSTANT_LOAD.name, 'force'))
    )  # fmt: skip
    joints = [j for j in level if load.get(j, np.inf) <= level[j] < np.inf]  # no level is negative
    return {(ASYMMETRIC_COULOMB.name, j) for j in joints}


def _equivalents(answer):
    """Return what is not concealed, and yet right: a payload for a wrong last body."""
    last = answer['joints'][-1]
    return {(PAYLOAD.name, last)} if answer['parameter_errors'] else set()


def summary(rows):
    """Return the rates, each with its 95 % interval (Wilson 1927), and what was confused."""
    hidden = [r for r in rows if r['wanted'] == 'hidden']
    unlisted = [r for r in rows if r['wanted'] == 'unlisted']
    calm = [r for r in rows if r['wanted'] in {'none', 'parameters'}]
    done = [r for r in rows if r['said'] != 'failed']
    ratios = [x for r in done for x in r['held_out'].values()]
    covered = [p['covered'] for r in done for p in r['parameters'] if p['covered'] is not None]
    errors = [p['error'] for r in done for p in r['parameters']]
    return {
        'worlds': len(rows), 'failed': len(rows) - len(done),
        'right': scoring.rate(r['right'] for r in rows),
        'right_hidden': scoring.rate(r['right'] for r in hidden),
        'called_unexplained': scoring.rate(bool(r['unexplained']) for r in hidden),
        'right_unlisted': scoring.rate(r['right'] for r in unlisted),
        'right_calm': scoring.rate(r['right'] for r in calm),
        'false_alarms': scoring.rate(r['alarm'] for r in calm),
        'confidently_wrong': scoring.rate(bool(r['wrong']) for r in rows),
        'recall': scoring.rate(_flags(rows, 'named', 'missed')),
        'precision': scoring.rate(
            flag for r in done
            for flag in [True] * r['right_findings'] + [False] * len(r['wrong'] + r['unexplained'])
        ),
        'effects_asked_median': _median([len(r['named']) + len(r['missed']) for r in hidden]),
        'missed': dict(Counter(name for r in rows for name, _ in r['missed']).most_common()),
        'wrong': dict(Counter(x[0] for r in rows for x in r['wrong']).most_common()),
        'within_two_std': scoring.rate(covered),
        'parameter_error_median': _median(errors),
        'held_out_of_oracle': {
            'joints': len(ratios), 'median': _median(ratios),
            'within_1.3': scoring.rate(x <= 1.3 for x in ratios),
            'largest': max(ratios, default=None),
        },
        'seconds_median': _median([r['seconds'] for r in rows]),
    }  # fmt: skip


def _flags(rows, yes, no):
    return [flag for r in rows for flag in [True] * len(r[yes]) + [False] * len(r[no])]


def _median(values):
    finite = [x for x in values if x is not None and math.isfinite(x)]
    return float(np.median(finite)) if finite else None
