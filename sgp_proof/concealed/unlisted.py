"""Laws that no list has, kept apart from those that the search was developed on (`unknown`).

    python -m sgp_proof.concealed.draw --seeds 6000:6024 --tier A --only unlisted --out DIR
    python -m sgp_proof.concealed.unlisted DIR --seal
    python -m sgp_proof.concealed.unlisted DIR [--outputs DIR] [--name unlisted]

The first writes worlds, each seed a family in turn. The second adds the hashes of the answers
to `sgp_proof/results/unlisted_hashes.json`, which is committed before anything is scored. The
third diagnoses what was not diagnosed yet, scores what `diagnosis.json` says, and refuses answers
with other hashes. A tool of another kind enters by the same file: verdict, joint, and findings
with effect `law`, a formula and its parameters.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import re
from collections import ChainMap
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from sgp_proof.concealed import eighth_families as eighth
from sgp_proof.concealed import fifth_families as fifth
from sgp_proof.concealed import fourth_families as fourth
from sgp_proof.concealed import ninth_families as ninth
from sgp_proof.concealed import second_families as second
from sgp_proof.concealed import seventh_families as seventh
from sgp_proof.concealed import sixth_families as sixth
from sgp_proof.concealed import third_families as third
from sgp_proof.concealed.family_set import ALONG, LISTED, STEP_S
from sgp_proof.concealed.unknown import OF_TIME, force
from sgp_proof.result_files import RESULTS, write_result
from sgp_ros.physics.drawing import UnsuitableError
from sgp_ros.physics.formula import read_formula

HASHES = RESULTS / 'unlisted_hashes.json'
SAME = 0.02
"""Greatest error of a law that is the true one, relative, over the states of the joint."""
STATES = 2000
EFFORT = np.random.default_rng(1).normal(size=STATES)
"""States at which laws are compared, and efforts over the usual."""
FAILED = {'verdict': 'failed', 'findings': [], 'fit': {}}
"""Of a diagnosis that ended without an answer: a miss."""
_REMEMBERS = re.compile(r'\b(lag|play|delay)\(').search


def _contact(q, _v, _m, p):
    return -2.0 * max(q / p['reach'] - 0.3, 0.0) ** 1.5


def _gas_spring(q, _v, _m, p):
    angle = 1.7 * q / p['reach']
    return -math.sin(angle) / (1.0 + 0.5 * math.cos(angle))


def _detent(q, _v, _m, p):
    u = q / p['reach']
    return 2.0 * u / (1.0 + 4.0 * u * u) ** 2


def _speed_of_other(_q, v, m, p):
    other = abs(float(m.velocity[p['source']])) / p['source_v']
    return -other * math.tanh(v / (0.2 * p['v']))


def _walk(_q, _v, m, p):
    steps = np.random.default_rng(round(1e6 * p['hz'])).normal(size=400).cumsum() / 10.0
    return float(np.interp(m.time_s, 0.1 * np.arange(400), steps))


FAMILIES = {
    'magnetic_brake': lambda _q, v, _m, p: -2.0 * (v / p['v']) / (1.0 + (v / (0.7 * p['v'])) ** 2),
    'log_friction': lambda _q, v, _m, p: -math.copysign(math.log1p(abs(v) / (0.3 * p['v'])), v),
    'one_sided_contact': _contact,
    'exponential_spring': lambda q, _v, _m, p: -0.6 * math.expm1(q / p['reach']),
    'capstan': lambda q, v, _m, p: -0.5 * math.exp(q / p['reach']) * math.tanh(v / (0.1 * p['v'])),
    'damping_off_centre': lambda q, v, _m, p: -((q / p['reach']) ** 2) * v / p['v'],
    'gas_spring': _gas_spring,
    'detent': _detent,
    'fifth_power': lambda q, _v, _m, p: -2.0 * (q / p['reach']) ** 5,
    'speed_of_other': _speed_of_other,
    'wave_of_other': lambda _q, _v, m, p: -math.sin(2.0 * float(m.position[p['source']])),
    'walk': _walk,
}
"""Name to force over its size. The last is no function of the motion: nothing is to be found."""
SECOND_FROM, THIRD_FROM, FOURTH_FROM, FIFTH_FROM = 20_000, 40_000, 60_000, 70_000
SIXTH_FROM, SEVENTH_FROM, EIGHTH_FROM, NINTH_FROM = 80_000, 90_000, 100_000, 110_000
"""Seeds from here on conceal a law of the second set, of the third, and so on."""
_LATER = ninth, eighth, seventh, sixth, fifth, fourth, third
_FROM = NINTH_FROM, EIGHTH_FROM, SEVENTH_FROM, SIXTH_FROM, FIFTH_FROM, FOURTH_FROM, THIRD_FROM
_SETS = (
    *((begin, x.FAMILIES, '') for begin, x in zip(_FROM, _LATER, strict=True)),
    (SECOND_FROM, second.FAMILIES, 'air_spring'),
    (0, FAMILIES, 'gas_spring'),
)
"""First seed, laws, and the law of robots of one joint in place of one of another joint."""
_LAWS = dict(ChainMap(FAMILIES, *(x.FAMILIES for x in (second, *_LATER))))
_REMEMBER = dict(ChainMap(*(x.REMEMBER for x in (second, *_LATER))))
_ALSO = dict.fromkeys(fifth.OF_CLOCK, 't') | dict.fromkeys(eighth.OF_EFFORT, 'tau')
_LISTED_PARTS = dict(ChainMap(*(x.LISTED_PARTS for x in _LATER)))
BUILDERS = {name: force(law) for name, law in _LAWS.items()}
BUILDERS |= {name: x.SET.builder(name) for x in _LATER for name in x.FAMILIES}
BUILDERS |= {name: second.remembering(*x, _LAWS[name]) for name, x in _REMEMBER.items()}


def family_of(seed, *, has_others):
    """Return the family that a seed conceals.

    Raises:
        UnsuitableError: the family of another joint has no other one in its set.
    """
    known, alone = next(x[1:] for x in _SETS if seed >= x[0])
    kind = list(known)[seed % len(known)]
    if has_others or not kind.endswith('other'):
        return kind
    if not alone:
        raise UnsuitableError('a robot of one joint')
    return alone


def constants(kind, rng, source_reach):
    """Return what is drawn for a world of a family, beside what all have."""
    drawn = (x.SET.constants(kind, rng, source_reach) for x in _LATER)
    return {name: value for some in drawn for name, value in some.items()}


def true_force(parameters, q, v):
    """Return the force of a family at states (n,), those of its own joint and of the source.

    Of one that remembers they are a motion in steps of `STEP_S`.
    """
    kind, memory = parameters['kind'], np.zeros(len(q[0]))
    effort = parameters.get('source_effort', 0.0) * EFFORT
    if kind in _REMEMBER:
        memory = second.memory_along(*_REMEMBER[kind], q[0], v[0], STEP_S, parameters)
    law = _LAWS[kind]
    return np.array([
        parameters['a'] * law(q[0][i], v[0][i], SimpleNamespace(
            position={parameters['source']: q[1][i]}, velocity={parameters['source']: v[1][i]},
            time_s=STEP_S * i, state=(memory[i],), drive={parameters['source']: effort[i]},
        ), parameters)
        for i in range(len(q[0]))
    ])  # fmt: skip


def _states(p):
    """Return positions and velocities of a joint and its source, (n,) each, at random."""
    rng = np.random.default_rng(0)
    q = [s * rng.uniform(-1.0, 1.0, STATES) for s in (p['reach'], p.get('source_reach', 1.0))]
    return q, [s * rng.normal(0.0, 1.2, STATES) for s in (p['v'], p['source_v'])]


def _motion(p):
    """Return a motion with about such states, sums of two sines that do not repeat."""
    t, found = STEP_S * np.arange(STATES), ([], [])
    source = p.get('source_reach', 1.0), p['source_v'], 1.414
    for reach, usual, ratio in ((p['reach'], p['v'], 1.618), source):
        rate = usual / reach * np.array([1.0, ratio])
        size = 0.6 * reach * np.array([1.0, 0.7])
        found[0].append(np.sin(t[:, None] * rate) @ size)
        found[1].append(np.cos(t[:, None] * rate) @ (size * rate))
    return found


def law_error(effect, finding, beside=()):
    """Return the error of a found law, relative, over states as in the motion; inf for no law.

    `beside` are findings of listed effects that are part of it.
    """
    p = effect['parameters']
    if p['kind'] in OF_TIME:
        return math.inf
    q, v = _motion(p) if p['kind'] in _REMEMBER or _REMEMBERS(finding['formula']) else _states(p)
    names = [effect['joint'], p['source'] if isinstance(p['source'], str) else '']
    true = true_force(p, q, v)
    numbers = {name: x['value'] for name, x in finding['parameters'].items()}
    formula = read_formula(finding['formula'].partition('=')[2], is_law=True)
    refused, whose = {'tau', 't'} - {_ALSO.get(p['kind'])}, {'t': [''], 'tau': names[1:]}
    if any(k in refused or j not in whose.get(k, names) for k, j in formula.signals):
        return math.inf

    def signal(kind, joint):
        of = {'q': q, 'tau': (None, p.get('source_effort', 0.0) * EFFORT)}.get(kind, v)
        return lambda _at: of[names.index(joint)]

    numbers['t'] = STEP_S * np.arange(len(q[0]))
    found = formula.compiled(
        lambda name: lambda _at: numbers[name], signal, lambda name, _signals: ALONG.get(name)
    )(None)
    for part in beside:
        values = {name: x['value'] for name, x in part['parameters'].items()}
        found = found + LISTED[part['effect']](q[0], v[0], values)
    return float(np.sqrt(np.mean((found - true) ** 2) / np.mean(true**2)))


def score(answer, diagnosis):
    """Return what was said of one world, from plain files."""
    (effect,) = answer['effects']
    findings = [f for f in diagnosis['findings'] if f['probability'] >= 0.5]
    laws = [f for f in findings if f['effect'] == 'law']
    part = _LISTED_PARTS.get(effect['parameters']['kind']), effect['joint']
    parts = [f for f in findings if (f['effect'], f['joint']) == part]
    errors = [law_error(effect, f, parts) for f in laws]
    listed = [[f['effect'], f['joint']] for f in findings if f['effect'] not in {'law', 'unknown'}]
    listed = [named for named in listed if tuple(named) != part]
    said = diagnosis['findings'][0]['joint'] if diagnosis['findings'] else ''
    is_found = not listed and len(errors) == 1 and errors[0] <= SAME
    is_found = is_found and laws[0]['joint'] == effect['joint']
    far = diagnosis['fit'].get('real_far', {})
    ratio = {x: far.get(f'nmse_{x}', {}).get(effect['joint']) for x in ('before', 'after')}
    return {
        'case': answer['case'], 'kind': effect['parameters']['kind'],
        'share': answer.get('effect_share_of_torque', {}).get(effect['joint']),
        'verdict': diagnosis['verdict'], 'right_joint': said == effect['joint'],
        'formulas': [f['formula'] for f in laws],
        'law_error': [e if math.isfinite(e) else None for e in errors],
        'listed': listed, 'found': is_found,
        'wrong': bool(listed) or any(e > SAME for e in errors), 'far': ratio,
    }  # fmt: skip


def summary(rows):
    """Return the rates over all worlds with a law, and of wrong names over all."""
    lawful = [r for r in rows if r['kind'] not in OF_TIME]
    n = max(len(lawful), 1)
    return {
        'worlds': len(rows), 'with_a_law': len(lawful),
        'found': sum(r['found'] for r in lawful) / n,
        'right_joint': sum(r['right_joint'] for r in lawful) / n,
        'wrong_names': sum(r['wrong'] for r in rows) / max(len(rows), 1),
    }  # fmt: skip


def hash_of(path):
    """Return the hash of an answer.

    Its numbers have three digits, for the last ones depend on the processor that draws the world.
    """
    answer = json.loads(
        path.read_text(encoding='utf-8'), parse_float=lambda x: float(f'{float(x):.3g}')
    )
    return hashlib.sha256(json.dumps(answer, sort_keys=True).encode()).hexdigest()


def _is_sealed(path, sealed):
    """Return whether an answer has the hash that was sealed; of all digits, as once was."""
    whole = hashlib.sha256(path.read_bytes()).hexdigest()
    return sealed.get(path.stem) in {hash_of(path), whole}


def main():
    from sgp_proof.concealed.run import diagnose_case  # noqa: PLC0415 - only to score

    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('worlds', type=Path)
    parser.add_argument('--seal', action='store_true', help='write the hashes of the answers')
    parser.add_argument('--outputs', type=Path, help='where diagnoses are kept')
    parser.add_argument('--diagnosed', action='store_true', help='score what was diagnosed alone')
    parser.add_argument('--name', default='unlisted', help='of the file of results')
    arguments = parser.parse_args()
    answers = sorted((arguments.worlds / 'answers').glob('*.json'))
    sealed = json.loads(HASHES.read_text(encoding='utf-8')) if HASHES.exists() else {}
    if arguments.seal:
        write_result(HASHES, {path.stem: hash_of(path) for path in answers} | sealed)
        return
    outputs = arguments.outputs or arguments.worlds / 'out'
    rows = []
    for path in answers:
        if not _is_sealed(path, sealed):
            raise SystemExit(f'{path.name} is not the answer that was sealed')
        out = outputs / path.stem
        if not (out / 'outcome.json').exists() and not arguments.diagnosed:
            diagnose_case(arguments.worlds / 'cases' / path.stem, out)
        if not (out / 'outcome.json').exists():
            continue
        said = out / 'diagnosis.json'
        diagnosis = json.loads(said.read_text(encoding='utf-8')) if said.exists() else FAILED
        rows.append(score(json.loads(path.read_text(encoding='utf-8')), diagnosis))
        print(json.dumps(rows[-1]), flush=True)
    report = {'sealed': len(answers), 'summary': summary(rows), 'cases': rows}
    write_result(RESULTS / f'{arguments.name}.json', report)
    print(json.dumps(report['summary'], indent=1))


if __name__ == '__main__':
    main()
