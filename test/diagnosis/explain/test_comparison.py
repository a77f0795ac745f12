"""Which models are compared."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.diagnosis.criteria import COUNTED_SHARE
from sgp_ros.diagnosis.explain import comparison, growth, joint_search, more_effects
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.credibility import gain
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, heavier, simulate


def _falling_friction(t, q, v):
    """Stribeck friction less its Coulomb part, and drag."""
    return (-0.1 * abs(v[0]) * v[0] - 0.9 * np.exp(-((v[0] / 0.4) ** 2)) * np.sign(v[0]),)


def _names(model):
    return {s.effect.name for s in model.effects}


def test_a_load_is_not_compared_with_bodies_that_may_differ(equations_for, heavy):
    """It is one of their changes, with a freedom that has no price."""
    _, equations = equations_for(heavy[1])
    columns, load = Columns(equations), [EFFECTS['payload']]
    assert screen(columns, fitted(equations), load)
    assert screen(columns, fitted(equations, is_free=True), load) == []


@pytest.mark.parametrize('is_heavy', [False, True])
def test_no_effect_is_looked_for_where_bodies_leave_nothing(
    equations_for, perfect, heavy, is_heavy
):
    """Beside wrong bodies only what would say the same: a spring may act as a weight does."""
    _, equations = equations_for(heavy[1] if is_heavy else perfect[1])
    found = comparison.compare_models(equations, lambda _share: None)
    assert found.is_calm
    assert found.base.is_free is is_heavy
    assert bool(found.singles) is is_heavy
    assert not any(m.is_free for m in found.singles)
    assert found.pairs == found.more == ()


def test_effects_that_show_only_together_are_found_by_exchange(equations_for):
    """From two that are neither: one gives way, then the other."""
    world = simulate(CHAINS[1], 4, 12.0, force=_falling_friction, dry=lambda t, q, s: 0.3)
    _, equations = equations_for(world)
    start = fitted(equations, 'coulomb_friction', 'viscous_friction')
    found = comparison._exchanged(Columns(equations), [start])
    best = max(found, key=lambda m: m.score)
    assert _names(best) == {'stribeck_friction', 'quadratic_drag'}
    assert best.score > start.score + 100.0


def test_a_pair_that_leaves_nothing_is_not_exchanged(equations_for, viscous):
    _, equations = equations_for(viscous)
    pair = fitted(equations, 'viscous_friction', 'spring')
    assert comparison._exchanged(Columns(equations), [pair]) == []
    assert comparison._exchanged(Columns(equations), []) == []


@pytest.mark.parametrize(
    ('amplitude', 'drag', 'is_credible', 'is_searched'),
    [(2.0, 0.01, True, False), (0.6, 0.025, True, True), (2.0, 0.01, False, True)],
)
def test_what_is_not_adequate_is_searched_joint_by_joint(
    equations_for, monkeypatch, amplitude, drag, is_credible, is_searched
):
    """Though it leaves less than counts as physics, or where no model that leaves less can be."""
    world = simulate(
        CHAINS[1], 7, 10.0,
        force=lambda t, q, v: (amplitude * np.sin(5.0 * q[0]) - drag * v[0],),
    )  # fmt: skip
    columns = Columns(equations_for(world)[1])
    nominal, bodies = (fitted(equations_for(world)[1], is_free=f) for f in (False, True))
    wave = EffectAt(EFFECTS['cogging'], Place(0), np.array([5.0]))
    best = fit(columns, (wave,), nominal.sigma)
    assert best.left.max() < COUNTED_SHARE
    starts = []
    monkeypatch.setattr(more_effects, 'is_credible', lambda _: is_credible)
    monkeypatch.setattr(more_effects, 'by_joint', lambda _, start: starts.append(start) or [])
    base = Comparison(nominal, bodies, (best,), ()).base
    more_effects.more(columns, nominal, base, (best,))
    assert bool(starts) is is_searched
    assert not starts or (starts[0] is best) is is_credible


def test_a_law_of_one_number_is_tried_in_place_of_a_richer_one(equations_for):
    """Friction that was taken to differ with direction is Coulomb friction when all is there."""
    world = simulate(
        CHAINS[1], 4, 10.0, force=lambda t, q, v: (-0.3 * v[0],), dry=lambda t, q, s: 0.6
    )  # fmt: skip
    _, equations = equations_for(world)
    rich = fitted(equations, 'asymmetric_coulomb', 'viscous_friction')
    (block, *_) = growth.blocks_of(rich)
    found = joint_search._shrunk(Columns(equations), rich, block)
    assert _names(found) == {'coulomb_friction', 'viscous_friction'}
    assert gain(found, rich) > 0.0
    assert joint_search._shrunk(Columns(equations), found, block) is found


@pytest.mark.parametrize('is_load', [False, True])
def test_laws_beside_the_bodies_of_the_file_may_have_stood_for_others(
    equations_for, monkeypatch, is_load
):
    """A torque constant of a link that is a little heavier goes; its friction stays."""
    world = simulate(
        heavier(CHAINS[2], 0, 1.1), 7, 10.0, force=lambda t, q, v: (-0.3 * v[0], 0.0)
    )  # fmt: skip
    _, equations = equations_for(world)
    names = ('torque_gain', 'viscous_friction', *(['payload'] if is_load else []))
    stated = fitted(equations, *names)
    found = list(more_effects._freed(Columns(equations), [stated]))
    assert found
    for model in found:
        assert model.is_free
        assert _names(model) == {'viscous_friction'}
    assert list(more_effects._freed(Columns(equations), found)) == []
    monkeypatch.setattr(more_effects, 'large', lambda *_: found[0])
    assert list(more_effects._freed(Columns(equations), [stated]))[1:] == found[:1]


def test_small_everyday_laws_are_compared_with_a_rarer_one(equations_for):
    """Too small to count, but together likelier than friction that drifts within a second."""
    world = simulate(
        CHAINS[1], 4, 12.0, force=lambda t, q, v: (-0.015 * v[0],), dry=lambda t, q, s: 0.3
    )  # fmt: skip
    _, equations = equations_for(world)
    columns, nominal = Columns(equations), fitted(equations)
    rare, plain = (fitted(equations, x) for x in ('friction_drift', 'coulomb_friction'))
    found = list(more_effects._everyday(columns, rare, nominal.sigma))
    assert [m.is_free for m in found] == [False, True]
    assert {'viscous_friction', 'coulomb_friction'} <= _names(found[0])
    assert min(found[0].shares) < COUNTED_SHARE
    beside = next(more_effects._everyday(columns, plain, nominal.sigma))
    assert {'viscous_friction', 'coulomb_friction'} <= _names(beside)
    assert list(more_effects._everyday(columns, nominal, nominal.sigma)) == []


@pytest.mark.parametrize(
    ('step', 'amplitude', 'drag'), [('_everyday', 2.0, 0.01), ('_freed', 0.6, 0.025)]
)
def test_what_is_asked_beside_the_searches_is_compared(
    equations_for, monkeypatch, step, amplitude, drag
):
    """Where a rarer law suffices, and where models beside the bodies of the file were found."""
    world = simulate(
        CHAINS[1], 7, 10.0,
        force=lambda t, q, v: (amplitude * np.sin(5.0 * q[0]) - drag * v[0],),
    )  # fmt: skip
    _, equations = equations_for(world)
    columns, nominal = Columns(equations), fitted(equations)
    wave = EffectAt(EFFECTS['cogging'], Place(0), np.array([5.0]))
    best = fit(columns, (wave,), nominal.sigma, is_free=False)
    other = fitted(equations, 'spring', 'viscous_friction', 'quadratic_drag')
    monkeypatch.setattr(more_effects, 'by_joint', lambda *_: [])
    monkeypatch.setattr(more_effects, step, lambda *_: [other])
    monkeypatch.setattr(more_effects, 'is_credible', lambda _: True)
    monkeypatch.setattr('sgp_ros.diagnosis.explain.fitted_model.Model.is_possible', lambda _: True)
    assert other in more_effects.more(columns, nominal, nominal, (best,))
