"""Worlds with laws of families apart: their answers are sealed, and formulas are scored."""

from __future__ import annotations

import hashlib
import json
import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_proof.concealed import eighth_families as eighth
from sgp_proof.concealed import fifth_families as fifth
from sgp_proof.concealed import fourth_families as fourth
from sgp_proof.concealed import ninth_families as ninth
from sgp_proof.concealed import second_families as second
from sgp_proof.concealed import seventh_families as seventh
from sgp_proof.concealed import sixth_families as sixth
from sgp_proof.concealed import sizes, unlisted
from sgp_proof.concealed import third_families as third
from sgp_proof.concealed.kinds import draw_unlisted
from sgp_proof.concealed.unknown import OF_TIME, UNKNOWN
from sgp_proof.concealed.unlisted import (
    EIGHTH_FROM,
    FAMILIES,
    FIFTH_FROM,
    FOURTH_FROM,
    NINTH_FROM,
    SECOND_FROM,
    SEVENTH_FROM,
    SIXTH_FROM,
    THIRD_FROM,
    family_of,
    law_error,
    score,
    summary,
    true_force,
)
from sgp_ros.physics.drawing import UnsuitableError

P = {
    'kind': 'magnetic_brake', 'a': 0.5, 'v': 1.5, 'reach': 1.0, 'source': -1.0, 'source_v': 1.0,
    'source_effort': 1.0,
}  # fmt: skip
EFFECT = {'effect': 'unknown', 'joint': 'elbow', 'parameters': P}
RIGHT = {
    'effect': 'law', 'joint': 'elbow', 'probability': 0.9,
    'formula': 'tau_x[elbow] = a*dq[elbow]/(1 + (dq[elbow]/v0)**2)',
    'parameters': {'a': {'value': -1.0 / 1.5}, 'v0': {'value': 1.05}},
}  # fmt: skip
WRONG = {**RIGHT, 'formula': 'tau_x[elbow] = a*tanh(dq[elbow]/v0)'}
UNNAMED = {'effect': 'unknown', 'joint': 'elbow', 'probability': 0.9, 'parameters': {}}
LISTED = {**UNNAMED, 'effect': 'coulomb_friction'}


def _scored(*findings):
    answer = {'case': 'case_1', 'effects': [EFFECT]}
    verdict = 'missing_physics'
    return score(answer, {'verdict': verdict, 'findings': [*findings], 'fit': {}})


def test_a_formula_is_compared_with_the_true_force():
    """The same law in other letters is right; one that saturates is not."""
    assert law_error(EFFECT, RIGHT) < 1e-12
    assert law_error(EFFECT, WRONG) > 0.1
    assert law_error(EFFECT, {**RIGHT, 'formula': 'tau_x[elbow] = a*dq[wrist]'}) == math.inf


@pytest.mark.parametrize(
    ('findings', 'found', 'wrong'),
    [((RIGHT,), 1, 0), ((WRONG,), 0, 1), ((UNNAMED,), 0, 0), ((RIGHT, LISTED), 0, 1)],
)
def test_names_are_right_wrong_or_withheld(findings, found, wrong):
    """A listed effect beside the law is a wrong name too."""
    row = _scored(*findings)
    assert (row['found'], row['wrong'], row['right_joint']) == (found, wrong, True)
    rates = summary([row])
    assert (rates['found'], rates['wrong_names']) == (found, wrong)


def test_the_families_are_apart():
    """From those that the search was developed on; every one is drawn in turn."""
    assert not set(FAMILIES) & set(UNKNOWN)
    assert {family_of(s, has_others=True) for s in range(len(FAMILIES))} == set(FAMILIES)
    assert set(OF_TIME) & set(FAMILIES)


def test_the_second_set_is_apart_from_all_others():
    """Every family of it is drawn in turn too; what it says of known shapes is of its own."""
    assert not set(second.FAMILIES) & (set(FAMILIES) | set(UNKNOWN))
    seeds = range(SECOND_FROM, SECOND_FROM + len(second.FAMILIES))
    assert {family_of(s, has_others=True) for s in seeds} == set(second.FAMILIES)
    assert set(second.KNOWN_SHAPES) <= set(second.FAMILIES)


LATER_SETS = third, fourth, fifth, sixth, seventh, eighth, ninth
LATER = {kind: law for x in LATER_SETS for kind, law in x.FAMILIES.items()}
REMEMBER = [kind for x in LATER_SETS for kind in x.REMEMBER]
EARLIER = set(FAMILIES) | set(second.FAMILIES) | set(UNKNOWN)


def _drawn(kind):
    return {**P, 'kind': kind, **unlisted.constants(kind, np.random.default_rng(1), 0.7)}


@pytest.mark.parametrize(
    ('known', 'begin', 'earlier'),
    [
        (third.FAMILIES, THIRD_FROM, EARLIER),
        (fourth.FAMILIES, FOURTH_FROM, EARLIER | set(third.FAMILIES)),
        (fifth.FAMILIES, FIFTH_FROM, EARLIER | set(third.FAMILIES) | set(fourth.FAMILIES)),
        (sixth.FAMILIES, SIXTH_FROM, EARLIER | (set(LATER) - set(sixth.FAMILIES))),
        (seventh.FAMILIES, SEVENTH_FROM, EARLIER | (set(LATER) - set(seventh.FAMILIES))),
        (eighth.FAMILIES, EIGHTH_FROM, EARLIER | (set(LATER) - set(eighth.FAMILIES))),
        (ninth.FAMILIES, NINTH_FROM, EARLIER | (set(LATER) - set(ninth.FAMILIES))),
    ],
)
def test_a_later_set_is_apart_from_all_others(known, begin, earlier):
    """Each has its share of seeds: no robot of one joint takes the turn of a law of another."""
    assert not set(known) & earlier
    seeds = range(begin, begin + len(known))
    assert {family_of(s, has_others=True) for s in seeds} == set(known)
    of_other = [s for s in seeds if family_of(s, has_others=True).endswith('other')]
    assert of_other
    for seed in of_other:
        with pytest.raises(UnsuitableError):
            family_of(seed, has_others=False)


@pytest.mark.parametrize(
    ('known', 'begin'),
    [
        (fourth, FOURTH_FROM),
        (fifth, FIFTH_FROM),
        (sixth, SIXTH_FROM),
        (seventh, SEVENTH_FROM),
        (eighth, EIGHTH_FROM),
        (ninth, NINTH_FROM),
    ],
)
def test_a_later_set_has_its_seeds_in_order(known, begin):
    """Twenty families, from its first seed on."""
    kinds = [family_of(s, has_others=True) for s in range(begin, begin + 20)]
    assert kinds == list(known.FAMILIES)


def test_other_sets_draw_no_constants():
    """Their worlds stay what they were."""
    assert not unlisted.constants('air_spring', np.random.default_rng(1), 0.7)


@pytest.mark.parametrize('kind', LATER)
def test_constants_are_drawn_within_their_ranges(kind):
    """And the reach of the source is kept with them."""
    known = next(x for x in LATER_SETS if kind in x.FAMILIES)
    for seed in range(5):
        drawn = known.SET.constants(kind, np.random.default_rng(seed), 0.7)
        assert drawn.pop('source_reach') == 0.7
        assert set(drawn) == set(known.SET.ranges[kind])
        assert all(low <= drawn[x] <= high for x, (low, high) in known.SET.ranges[kind].items())


@pytest.mark.parametrize('kind', LATER)
def test_a_law_of_a_later_set_is_finite(kind):
    """Twice as wide and fast as its motion too, the same each time, and simulated as scored."""
    p, rng = _drawn(kind), np.random.default_rng(2)
    states = rng.uniform(-2.0, 2.0, (2, 2, 200))
    if kind in REMEMBER:
        t = unlisted.STEP_S * np.arange(2000)
        states = 2.0 * np.array([[np.sin(t)] * 2, [np.cos(t)] * 2])
    force = true_force(p, *states)
    assert np.isfinite(force).all()
    assert (force == true_force(_drawn(kind), *states)).all()
    assert force.std() > 0.05
    if kind in REMEMBER:
        return
    source = p['source']
    (action,) = unlisted.BUILDERS[kind](0, p, ())
    for k, expected in enumerate(force):
        q, v = ({0: x[0, k], source: x[1, k]} for x in states)
        moment = SimpleNamespace(
            position=q, velocity=v, time_s=k * unlisted.STEP_S, drive={source: unlisted.EFFORT[k]}
        )
        exerted = action.force(moment) if action.force else 0.0
        if action.dry_level:
            direction = int(np.sign(v[0]))
            assert action.dry_level(moment, direction) >= 0.0
            exerted -= direction * action.dry_level(moment, direction)
        assert exerted == pytest.approx(expected)


@pytest.mark.parametrize('kind', REMEMBER)
def test_a_law_that_remembers_is_simulated_as_it_is_scored(kind):
    """Along a motion in parts of the steps of the score."""
    p, step = _drawn(kind), unlisted.STEP_S / second.PARTS
    (action,) = unlisted.BUILDERS[kind](0, p, ())
    t = step * np.arange(4000)
    q, v = 0.9 * np.sin(2.0 * t), 1.8 * np.cos(2.0 * t)
    expected = true_force(p, *(np.array([x, x])[:, :: second.PARTS] for x in (q, v)))
    state, found = action.start(q[0], v[0]), []
    for at in zip(q, v, strict=True):
        moment = SimpleNamespace(position={0: at[0]}, velocity={0: at[1]}, state=state)
        found.append(action.force(moment))
        state = tuple(
            z + step * rate for z, rate in zip(state, action.state_rate(moment), strict=True)
        )
    assert found[:: second.PARTS] == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize('is_apart', [True, False])
def test_listed_friction_in_a_law_may_be_named_beside_the_rest(is_apart):
    """Or within the formula; elsewhere it is a wrong name."""
    (kind,) = third.LISTED_PARTS
    p = {name: float(x) if name != 'kind' else x for name, x in _drawn(kind).items()}
    whole = f'-0.35*(g/max(q[elbow] + g, 0.6))**2{"" if is_apart else " - r*sign(dq[elbow])"}'
    numbers = {'g': {'value': p['gap']}, 'r': {'value': 0.5 * p['gland']}}
    law = {**RIGHT, 'formula': f'tau_x[elbow] = {whole}', 'parameters': numbers}
    dry = {**LISTED, 'effect': third.LISTED_PARTS[kind], 'parameters': {'level': numbers['r']}}
    answer = {'case': 'case_1', 'effects': [{**EFFECT, 'parameters': p}]}
    for findings, right in (
        ([law, dry], is_apart), ([law], not is_apart), ([law, {**dry, 'joint': 'j2'}], False),
    ):  # fmt: skip
        row = score(answer, {'verdict': 'missing_physics', 'findings': findings, 'fit': {}})
        assert (row['found'], row['wrong']) == (right, not right)


@pytest.mark.parametrize(
    ('kind', 'rest', 'parameters'),
    [
        (
            'flow_valve', '-0.5*(1 - back)*min(dq[elbow]/1.5, 0)**2',
            lambda _p: {'c': 0.5 / 1.5**2},
        ),
        (
            'foil_bearing',
            '-0.25*(1 - film)*(1 - tanh((abs(dq[elbow])/1.5 - lift)/0.2))*sign(dq[elbow])',
            lambda p: {'level': 0.5 * p['film']},
        ),
        (
            'leaf_pack', '-0.5*rub*abs(q[elbow])*sign(dq[elbow])',
            lambda _p: {'stiffness': 0.5, 'rest': 0.0},
        ),
        (
            'shorted_winding', '0.25*dq[elbow]*cos(2*(poles*q[elbow] + phase))',
            lambda _p: {'b': 0.25},
        ),
        (
            'leaf_set_by_other', '0.5*q[elbow]*(1 - 1/max(1 - lever*q[wrist]/0.7, 0.3)**2)',
            lambda _p: {'stiffness': 0.5, 'rest': 0.0},
        ),
        (
            'galloping_in_wind', '-0.75*(dq[elbow]/1.5)**3/steady**2',
            lambda _p: {'b': -0.5},
        ),
        (
            'damper_swung_by_other', '-dq[elbow]/3*cos(2*(swing*q[wrist]/0.7 + lean))',
            lambda _p: {'b': 1.0 / 3.0},
        ),
        (
            'thickening_fluid', '-0.25*dq[elbow]*(1 + tanh((abs(dq[elbow])/1.5 - jam)/over))',
            lambda p: {'b': 0.5 * p['thin']},
        ),
        (
            'drag_crisis',
            (
                'drop*abs(dq[elbow])*dq[elbow]/9'
                '*(1 + tanh((abs(dq[elbow])/1.5 - crisis)/over))'
            ),
            lambda _p: {'c': 0.5 / 1.5**2},
        ),
    ],
)  # fmt: skip
def test_a_listed_part_may_be_named_beside_the_rest(kind, rest, parameters):
    """As that effect with its numbers; without it the rest is a wrong law."""
    p = {**_drawn(kind), 'source': 'wrist'}
    known = next(x for x in LATER_SETS if kind in x.FAMILIES)
    numbers = {name: {'value': p[name]} for name in known.SET.ranges[kind]}
    law = {**RIGHT, 'formula': f'tau_x[elbow] = {rest}', 'parameters': numbers}
    values = {name: {'value': x} for name, x in parameters(p).items()}
    part = {**LISTED, 'effect': known.LISTED_PARTS[kind], 'parameters': values}
    answer = {'case': 'case_1', 'effects': [{**EFFECT, 'parameters': p}]}
    for findings, right in (([law, part], True), ([law], False)):
        row = score(answer, {'verdict': 'missing_physics', 'findings': findings, 'fit': {}})
        assert (row['found'], row['wrong']) == (right, not right)


def test_every_listed_part_of_a_law_can_be_scored():
    """The scorer knows the force of each."""
    parts = {kind: part for x in LATER_SETS for kind, part in x.LISTED_PARTS.items()}
    assert set(parts) <= set(LATER)
    assert set(parts.values()) <= set(unlisted.LISTED)


@pytest.mark.parametrize(
    ('kind', 'formula', 'numbers'),
    [
        ('one_way_damper', 'a*max(dq[elbow], 0)', {'a': -0.5 / 1.5}),
        ('lagged_damper', '-a*lag(dq[elbow], T)', {'a': 0.5 / 1.5, 'T': second.LAG_S}),
        ('throttled_balancer', '-a*lag(q[elbow], T)', {'a': 0.5, 'T': 0.25}),
        ('play_spring', '-a*play(q[elbow], w)', {'a': 0.5, 'w': 2.0 * second.HALF_PLAY}),
        (
            'warming_grease', '-a*dq[elbow]*exp(-h*lag(dq[elbow]**2, T))',
            {'a': 1.0 / 1.5, 'h': 0.9 / 1.5**2, 'T': 2.0},
        ),
        (
            'preload_behind_play', '-a*tanh(play(q[elbow], w)/d)',
            {'a': 0.5, 'w': 0.5, 'd': 0.3},
        ),
        (
            'leaky_air_cushion', 'a - a*max(1 - c*(q[elbow] - lag(q[elbow], T)), 0.1)**-1.4',
            {'a': 0.5, 'c': 0.6, 'T': 0.4},
        ),
        (
            'magnet_on_worn_key', '-a*sin(n*play(q[elbow], w) + x)',
            {'a': 0.5, 'n': 3.0, 'w': 0.5, 'x': 0.2},
        ),
        ('one_way_pump', '-a*lag(max(dq[elbow], 0), T)', {'a': 1.0 / 1.5, 'T': 0.4}),
        (
            'paddle_in_stirred_bath',
            '-a*(dq[elbow] - lag(dq[elbow], T))*abs(dq[elbow] - lag(dq[elbow], T))',
            {'a': 0.5 / 1.5**2, 'T': 0.5},
        ),
        (
            'magnet_in_oil', '-a*sin(n*(q[elbow] - lag(q[elbow], T)))',
            {'a': 0.5, 'n': 3.0, 'T': 0.6},
        ),
        (
            'bucket_filled_by_motion', '-a*lag(abs(dq[elbow]), T)*sin(n*q[elbow] + x)',
            {'a': 0.75 / 1.5, 'T': 0.4, 'n': 2.0, 'x': 0.3},
        ),
        (
            'self_excited_brake', '-a*lag(dq[elbow], T)**2*dq[elbow]',
            {'a': 0.75 / 1.5**3, 'T': 0.3},
        ),
        (
            'oil_along_beam', 'a*lag(q[elbow], T)*cos(n*q[elbow] + x)',
            {'a': 1.5, 'T': 0.5, 'n': 2.0, 'x': 0.3},
        ),
        (
            'seat_belt_reel', '-a*dq[elbow]*max(abs(dq[elbow] - lag(dq[elbow], T)) - c, 0)',
            {'a': 1.0 / 1.5**2, 'T': 0.3, 'c': 0.3 * 1.5},
        ),
        (
            'folding_wiper', '-a*sin(n*(q[elbow] - play(q[elbow], w)))',
            {'a': 0.5, 'n': 2.4 / 0.25, 'w': 0.5},
        ),
        (
            'rocking_pad',
            (
                '-a*(q[elbow] - play(q[elbow], w))'
                '*max(dq[elbow]*sign(q[elbow] - play(q[elbow], w)), 0)'
            ),
            {'a': 0.8 / 1.5 / 0.25, 'w': 0.5},
        ),
        (
            'memory_wire', 'a*min(max((lag(dq[elbow]**2, T) - c)/d, 0), 1)',
            {'a': 0.75, 'T': 0.3, 'c': 0.6 * 1.5**2, 'd': 0.7 * 1.5**2},
        ),
        (
            'leaking_tappet', '-a*max(q[elbow] - lag(q[elbow], T) - c, 0)',
            {'a': 1.5, 'T': 0.4, 'c': 0.15},
        ),
        (
            'governor_behind_dashpot', '-a*dq[elbow]*max(lag(abs(dq[elbow]), T) - c, 0)',
            {'a': 1.0 / 1.5**2, 'T': 0.5, 'c': 0.6 * 1.5},
        ),
        (
            'sump_filling_slowly', '-a*dq[elbow]*max(lag(q[elbow], T) - c, 0)',
            {'a': 1.25 / 1.5, 'T': 0.5, 'c': -0.1},
        ),
    ],
)  # fmt: skip
def test_laws_that_remember_are_compared_along_a_motion(kind, formula, numbers):
    """But for the steps of that motion; without its memory none of them is right."""
    chosen = {'fill_s': 0.25, 'heat': 0.9, 'warm_s': 2.0, 'slack': 0.25, 'knee': 0.3,
              'stroke': 0.6, 'leak_s': 0.4, 'poles': 3.0, 'phase': 0.2,
              'follow_s': 0.5, 'oil_s': 0.6, 'swing': 2.0, 'lean': 0.3,
              'coil_s': 0.3, 'run_s': 0.5, 'trip': 0.3, 'ring_s': 0.3, 'fold': 2.4, 'warm': 0.6,
              'over': 0.7, 'heat_s': 0.3, 'lash': 0.15, 'grip': 0.6, 'level': -0.1}  # fmt: skip
    effect = {'joint': 'elbow', 'parameters': {**P, **chosen, 'kind': kind}}
    finding = {'formula': f'tau_x[elbow] = {formula}',
               'parameters': {name: {'value': x} for name, x in numbers.items()}}  # fmt: skip
    assert law_error(effect, finding) < 0.01
    forgets = {**finding, 'formula': 'tau_x[elbow] = -0.3*dq[elbow]'}
    assert law_error(effect, forgets) > 0.1


def test_time_may_stand_in_the_formula_of_a_law_that_changes_with_it():
    """Since the start; in that of another law it is wrong at any size."""
    chosen = {'swing': 2.0, 'lean': 0.3, 'empty_s': 20.0}
    law = '-a*(1 - t/T)*sin(n*q[elbow] + x)'
    numbers = {'a': 0.75, 'T': 20.0, 'n': 2.0, 'x': 0.3}
    finding = {'formula': f'tau_x[elbow] = {law}',
               'parameters': {name: {'value': x} for name, x in numbers.items()}}  # fmt: skip
    (kind,) = fifth.OF_CLOCK
    effect = {**EFFECT, 'parameters': {**P, **chosen, 'kind': kind, 'source': 'wrist'}}
    assert law_error(effect, finding) < 1e-12
    constant = {**finding, 'formula': finding['formula'].replace('t/T', '0/T')}
    assert law_error(effect, constant) > 0.1
    right_but_for_time = {**RIGHT, 'formula': f'{RIGHT["formula"]} + 0*t'}
    assert law_error(EFFECT, right_but_for_time) == math.inf


def test_the_effort_of_the_source_may_stand_in_the_formula_of_a_law_of_it():
    """That of the joint itself is wrong, as is any in that of another law."""
    (kind,) = eighth.OF_EFFORT
    chosen = {'turn': 2.0, 'phase': 0.3, 'source_effort': 4.0, 'source': 'wrist', 'kind': kind}
    effect = {**EFFECT, 'parameters': {**P, **chosen}}
    numbers = {'a': {'value': 0.5 / 4.0}, 'n': {'value': 2.0}, 'x': {'value': 0.3}}
    law = 'tau_x[elbow] = a*tau[wrist]*sin(n*q[elbow] + x)'
    finding = {'formula': law, 'parameters': numbers}
    assert law_error(effect, finding) < 1e-12
    assert law_error(effect, {**finding, 'formula': law.replace('sin', 'cos')}) > 0.1
    assert law_error(effect, {**finding, 'formula': f'{law} + 0*tau[elbow]'}) == math.inf
    for other in ('wrist', 'elbow'):
        formula = f'{RIGHT["formula"]} + 0*tau[{other}]'
        known = {**EFFECT, 'parameters': {**P, 'source': 'wrist'}}
        assert law_error(known, {**RIGHT, 'formula': formula}) == math.inf


@pytest.mark.parametrize(
    ('is_prismatic', 'is_driven', 'is_suitable'),
    [(False, True, True), (True, True, False), (False, False, False)],
)
def test_a_law_of_an_effort_needs_one_that_varies(is_prismatic, is_driven, is_suitable):
    """Neither that of a slide, which may be its weight alone, nor of a joint without motor."""
    bodies = [
        SimpleNamespace(joint=x, is_prismatic=is_prismatic, is_driven=is_driven) for x in 'ab'
    ]
    motion = SimpleNamespace(
        effort=np.array([3.0, 3.0]), velocity=np.ones(2), low=-np.ones(2), high=np.ones(2)
    )
    (kind,) = eighth.OF_EFFORT
    seed, rng = EIGHTH_FROM + list(eighth.FAMILIES).index(kind), np.random.default_rng(3)
    if is_suitable:
        assert draw_unlisted(rng, seed, bodies, motion).values(1.0)['source_effort'] == 3.0
        return
    with pytest.raises(UnsuitableError, match='hardly varies'):
        draw_unlisted(rng, seed, bodies, motion)


@pytest.mark.parametrize(
    ('formula', 'low', 'high'),
    [(lambda q, v: 3.0 * q - v + np.sign(v) + 0.5, 0.0, 1e-9), (lambda q, _v: q**2, 0.1, 1.0)],
)
def test_a_set_is_measured_by_what_plain_effects_leave(monkeypatch, formula, low, high):
    """Nothing of plain effects, most of another force."""
    t = np.arange(4000) * 0.01
    q, v, a = (x[:, np.newaxis] for x in (np.sin(t), np.cos(t), -np.sin(t)))
    force = formula(q, v)
    balance = SimpleNamespace(given=force, needed=np.zeros_like(force), diagonal=force)
    monkeypatch.setattr(sizes.Balance, 'of', lambda *_: balance)
    motion = SimpleNamespace(shown_position=q, shown_velocity=v, true_acceleration=a)
    world = SimpleNamespace(
        true=SimpleNamespace(mechanism=None), bodies=[SimpleNamespace(is_driven=True)]
    )
    assert low <= sizes.beyond_plain(motion, world, 0) <= high


def test_the_last_digits_of_an_answer_are_not_sealed(tmp_path):
    """Another processor draws the same world with others."""
    hashes = []
    for number, share in enumerate((0.31234567890123, 0.31234567890124, 0.3223)):
        answer = tmp_path / f'{number}.json'
        answer.write_text(json.dumps({'share': share, 'joints': ['elbow']}), encoding='utf-8')
        hashes.append(unlisted.hash_of(answer))
        assert unlisted._is_sealed(answer, {answer.stem: hashes[0]}) is (number < 2)
        whole = hashlib.sha256(answer.read_bytes()).hexdigest()
        assert unlisted._is_sealed(answer, {answer.stem: whole})
    assert hashes[0] == hashes[1] != hashes[2]


def test_another_answer_than_the_sealed_one_is_refused(tmp_path, monkeypatch):
    """Nothing is scored then."""
    (tmp_path / 'answers').mkdir()
    (tmp_path / 'answers' / 'case_1.json').write_text(json.dumps({'case': 'case_1'}))
    sealed = tmp_path / 'hashes.json'
    sealed.write_text(json.dumps({'case_1': 'another'}))
    monkeypatch.setattr(unlisted, 'HASHES', sealed)
    monkeypatch.setattr(sys, 'argv', ['unlisted', str(tmp_path)])
    with pytest.raises(SystemExit, match='not the answer that was sealed'):
        unlisted.main()
