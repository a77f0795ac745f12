"""The thresholds of the decision against the committed statistics of null worlds."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest

from sgp_ros.diagnosis.criteria import ADEQUATE_REST, PER_EFFECT, PER_PARAMETER, SHAPE_ERROR

RESULTS = Path(__file__).parents[3] / 'sgp_proof' / 'results'
FALSE_ALARMS, UNKNOWN_CALLED = 0.05, 0.7
"""Promised rates: at most so many, at least so many."""


@pytest.fixture(scope='module')
def worlds():
    """Null worlds of both tiers, by kind."""
    found = {}
    for tier in 'ab':
        for world in json.loads((RESULTS / f'nulls_{tier}.json').read_text())['worlds']:
            found.setdefault(world['kind'], []).append(world)
    return found


def test_robots_that_lack_nothing_are_left_in_peace(worlds):
    calm = [*worlds['nothing'], *worlds['wrong parameters'], *worlds['slight unlisted effect']]
    alarms = sum(w['verdict'] in {'missing_physics', 'unexplained'} for w in calm)
    assert len(calm) >= 40
    assert alarms <= FALSE_ALARMS * len(calm)


def test_an_effect_that_is_not_there_is_never_worth_its_price(worlds):
    gains = [
        m['fit'] - w['base']['fit'] for w in worlds['nothing'] for m in w['models']
    ]  # fmt: skip
    assert max(gains, default=0.0) < PER_EFFECT + PER_PARAMETER


def _right(worlds):
    """Worlds whose one effect was among the models; a load is a change of bodies, as null too."""
    return [
        w for w in worlds['one effect of the list'] if 'right' in w and w['extra'] != 'payload'
    ]  # fmt: skip


@pytest.mark.parametrize(('name', 'effects'), [('superfluous', 1), ('richer', 0)])
def test_more_than_there_is_costs_more_than_it_gains(worlds, name, effects):
    """In 95 of 100 worlds with one effect; in most nothing more than there is counts at all."""
    most = [w[name] or {'gain': 0.0, 'parameters': 1} for w in _right(worlds)]
    price = [effects * PER_EFFECT + m['parameters'] * PER_PARAMETER for m in most]
    paid = [m['gain'] < p for m, p in zip(most, price, strict=True)]
    assert len(paid) >= 10
    assert np.mean(paid) >= 1.0 - FALSE_ALARMS


def test_what_is_adequate_separates_right_models_from_wrong_lists(worlds):
    right = [w['right_structured_rest'] for w in _right(worlds)]
    wrong = [w['structured_rest'] for w in worlds['unlisted effect'] if w['structured_rest']]
    assert np.mean(np.array(right) < ADEQUATE_REST) >= 0.9
    assert np.mean(np.array(wrong) > ADEQUATE_REST) >= UNKNOWN_CALLED


def test_the_shape_error_covers_what_right_columns_leave(worlds):
    """Beyond noise; where it were less, rivals would differ by errors of the filters."""
    right = np.array([w['right_structured_rest'] for w in _right(worlds)])
    assert np.mean(right < SHAPE_ERROR) >= 0.9


def test_certainties_keep_what_they_say():
    """`ROWS` and `TEMPER` make them: in every band at least as much is right as the band begins
    with, as far as the number of worlds can tell."""
    bands = {}
    for tier in 'ab':
        report = json.loads((RESULTS / f'concealed_{tier}.json').read_text())
        for case in report['cases']:
            if case.get('certainty') is not None:
                least = max(b for b in (0.0, 0.5, 0.8, 0.95) if b <= case['certainty'])
                bands.setdefault(least, []).append(case['right'])
    assert len(bands[0.95]) >= 50
    for least, right in bands.items():
        assert binomtest(sum(right), len(right), least, alternative='less').pvalue > FALSE_ALARMS
