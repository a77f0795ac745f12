"""Laws that no list has: found with their numbers, or refused with what can be said."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.criteria import (
    ALIKE,
    COUNTED_SHARE,
    INTERVAL,
    LACKING,
    LAW_REST,
    SIGNIFICANT,
)
from sgp_ros.diagnosis.decide.decision import Decision, decide
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.comparison import compare_models
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.mapping import diagnosis_mapping
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.diagnosis.unlisted import assertion, searched, shapes, statement, tried
from sgp_ros.diagnosis.unlisted import search as searching
from sgp_ros.diagnosis.unlisted.assertion import _in_plain_laws, with_laws
from sgp_ros.diagnosis.unlisted.beside import earned, is_bent, law_of, refined
from sgp_ros.diagnosis.unlisted.formulas import Range, texts
from sgp_ros.diagnosis.unlisted.formulas import law as a_law
from sgp_ros.diagnosis.unlisted.search import search
from sgp_ros.diagnosis.unlisted.searched import Searched, leaves_more
from sgp_ros.diagnosis.unlisted.sentences import COEFFICIENTS
from sgp_ros.diagnosis.unlisted.shapes import (
    FINE,
    GATES,
    LAW,
    MORE_GATES,
    PIECES,
    LawAsFactor,
    SmoothForce,
)
from sgp_ros.diagnosis.unlisted.tried import (
    as_factor,
    is_series,
    more_forces,
    promises,
    smooth_forces,
    times_law,
    without_limits,
)
from sgp_ros.diagnosis.unlisted.variables import Variable
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.formula import read_formula
from sgp_ros.physics.law import FormulaLaw
from sgp_ros.physics.place import Place
from sgp_ros.physics.units import read_unit, unit_of
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, events_of, simulate


def _brake(t, q, v):
    return (-0.8 * v[0] / (1.0 + (v[0] / 1.5) ** 2),)


@pytest.fixture(scope='module')
def braked(robots):
    """A link with a brake that grips less at speed, as a diagnosis tells it."""
    robot, tree = robots[1]
    events = events_of(simulate(CHAINS[1], 11, 10.0, force=_brake))
    return diagnose(events, robot, tree, {}, holds_out=True)


def test_a_law_is_found_with_its_numbers(braked):
    """A formula with its units, that says the true force beyond the speeds that were seen."""
    assert braked.verdict == 'missing_physics'
    (finding,) = braked.findings
    assert finding.effect == 'law'
    assert finding.probability > 0.7
    text = finding.formula.partition('=')[2]
    values = {name: p.value for name, p in finding.parameters.items()}
    force = read_formula(text, is_law=True).compiled(
        lambda name: lambda _v: values[name], lambda kind, joint: lambda v: v
    )
    for v in (0.2, 1.5, 4.0, 12.0):
        assert force(v) == pytest.approx(_brake(0.0, (0.0,), (v,))[0], rel=0.05)
    assert braked.proofs['held_out'].nmse_after['joint0'] < 1e-3


def test_the_shape_is_described_in_words_and_numbers(braked):
    """With a band, in the file too."""
    (search,) = braked.law_searches
    assert search.why_not == ''
    assert search.variable == 'dq[joint0]'
    assert search.left < 0.1 * search.left_listed
    assert search.factor in {'', 'sign(dq[joint0])'}
    true = np.array([_brake(0.0, (0.0,), (v,))[0] for v in search.x])
    true *= np.sign(search.x) if search.factor else 1.0
    outside = np.abs(search.mean - true) > search.half + 0.02 * np.abs(true).max()
    assert outside.mean() < 0.2
    shown = np.interp(search.seen_x, search.x, search.mean)
    assert np.abs(search.seen - shown).mean() < 0.05 * np.abs(true).max()
    best = search.formulas[0].curve
    assert np.abs(best - shown)[np.isfinite(best)].max() < 0.1 * np.abs(true).max()
    assert (np.diff(search.seen_x) >= 0.0).all()
    assert search.words.startswith('resists the motion with a force that rises to 0.6')
    far = np.array([_brake(0.0, (0.0,), (v,))[0] for v in search.beyond_x])
    far *= np.sign(search.beyond_x) if search.factor else 1.0
    assert search.beyond_x[-1] > 1.4 * search.x[-1]
    assert search.formulas[0].beyond == pytest.approx(far, abs=0.02 * np.abs(true).max())
    assert search.formulas[0].is_alike
    assert 'an eddy-current brake' in [t.words for t in search.formulas]
    written = diagnosis_mapping(braked)['law_search']
    json.dumps(written, allow_nan=False)
    assert written[0]['is_asserted']
    assert len(written[0]['shape']['mean']) == len(search.x)


@pytest.mark.long
@pytest.mark.parametrize('name', ['noise', 'time'])
def test_what_is_no_function_of_the_motion_has_no_law(equations_for, name):
    """Neither a disturbance that wanders, nor one that comes and goes by the clock."""
    rng = np.random.default_rng(5)
    walk = np.cumsum(rng.normal(0.0, 0.05, 2000))

    def force(t, q, v):
        if name == 'time':
            return (0.8 * math.sin(2.0 * math.pi * 0.37 * t) ** 3,)
        return (float(np.interp(t, 0.006 * np.arange(2000), walk)),)

    _, equations = equations_for(simulate(CHAINS[1], 12, 10.0, force=force))
    comparison = compare_models(equations, lambda _share: None)
    decision = decide(equations, comparison)
    found = with_laws(equations, comparison, decision)
    assert law_of(found.decision.model, 0) is None
    assert found.decision.verdict == decision.verdict


def _with_brake(equations, *names):
    """Return the columns of a recording, and a model of the brake beside listed effects."""
    motion, columns = equations.motion, Columns(equations)
    smooth = next(s for s in smooth_forces(motion, 0) if (s.variable.kind, s.gate) == ('dq', ''))
    text, seen = 'a*X/(1 + (X/v0)**2)', Range.of_variable(smooth.variable, motion)
    assert text in texts(smooth)
    law = a_law(smooth, motion, seen, text, {'v0': 1.5})
    place = Place(0)
    effects = [EffectAt(law, place, np.array([1.5]))]
    effects += [EffectAt(EFFECTS[n], place) for n in names]
    start = np.sqrt((equations.d**2).mean(axis=0))
    return columns, fit(columns, tuple(effects), start, is_free=False)


@pytest.mark.parametrize('friction', [0.0, 0.3])
def test_a_listed_effect_beside_a_formula_earns_its_price_again(equations_for, friction):
    """One that only stood for a part of the formula goes, one that is there stays."""

    def force(t, q, v):
        return (_brake(t, q, v)[0] - friction * math.tanh(v[0] / 0.01),)

    _, equations = equations_for(simulate(CHAINS[1], 11, 10.0, force=force))
    columns, model = _with_brake(equations, 'torque_gain', 'coulomb_friction')
    scale = Scale.of(equations, compare_models(equations, lambda _share: None))
    scale = scale.of_forms()
    left = earned(columns, scale, model, 0)
    names = [s.name for s in left.effects]
    assert names == ['law', 'coulomb_friction'][: 1 + (friction > 0.0)]
    assert scale.worth(left) > scale.worth(model)


def test_a_listed_law_that_a_formula_hid_is_found_beside_it(equations_for):
    """A brake beside cogging and friction, of which the list alone had named nothing."""

    def force(t, q, v):
        return (_brake(t, q, v)[0] + 0.2 * math.sin(9.0 * q[0]) - 0.1 * math.tanh(v[0] / 0.01),)

    _, equations = equations_for(simulate(CHAINS[1], 11, 10.0, force=force))
    columns, model = _with_brake(equations)
    scale = Scale.of(equations, compare_models(equations, lambda _share: None)).of_forms()
    found = refined(columns, scale, model, 0)
    assert {s.name for s in found.effects} == {'law', 'cogging', 'coulomb_friction'}
    periods = next(s for s in found.effects if s.name == 'cogging').report(equations.motion)
    assert periods['periods'] == pytest.approx(9.0, rel=0.01)
    assert scale.excess(found)[0] < 1.0 < scale.excess(model)[0]


@pytest.mark.parametrize('name', ['plain', 'brake'])
def test_a_sum_of_plain_laws_stands_in_place_of_a_formula(equations_for, monkeypatch, name):
    """A formula in which a shifted step imitates a constant load; that of a brake remains.

    Also where all coefficients of the formula are distinguished from zero.
    """
    monkeypatch.setattr(assertion, 'idle', lambda *_: frozenset())

    def force(t, q, v):
        return (0.4 - 0.5 * v[0],) if name == 'plain' else _brake(t, q, v)

    _, equations = equations_for(simulate(CHAINS[1], 11, 10.0, force=force))
    motion = equations.motion
    smooth = next(s for s in smooth_forces(motion, 0) if (s.variable.kind, s.gate) == ('dq', ''))
    text, start = {
        'plain': ('a*X + b*tanh((X - x0)/w0)', {'x0': -12.0, 'w0': 2.0}),
        'brake': ('a*X/(1 + (X/v0)**2)', {'v0': 1.5}),
    }[name]
    law = a_law(smooth, motion, Range.of_variable(smooth.variable, motion), text, start)
    listed = compare_models(equations, lambda _share: None)
    scale = np.sqrt((equations.d**2).mean(axis=0))
    shape = np.array(list(start.values()))
    model = fit(Columns(equations), (EffectAt(law, Place(0), shape),), scale, is_free=False)
    found = Searched(0, listed.base, model, (model,), (np.zeros(0), 0), 0.0)
    plain = _in_plain_laws(equations, listed, found)
    if name == 'brake':
        assert plain is None
        return
    assert {s.name for s in plain.effects} == {'constant_load', 'viscous_friction'}
    assert not plain.is_free


def test_a_listed_effect_keeps_its_name(equations_for, viscous):
    """Where it says all, nothing without a name is worth more."""
    _, equations = equations_for(viscous)
    comparison = compare_models(equations, lambda _share: None)
    decision = decide(equations, comparison)
    found = with_laws(equations, comparison, decision)
    assert found.searched == ()
    assert found.decision is decision
    assert Scale.of(equations, comparison).worth(decision.model) > 0.0


@pytest.mark.long
def test_friction_that_is_hardly_different_keeps_its_name(equations_for):
    """A force without form says it better, but by less than counts."""

    def force(_t, _q, v):
        return (-0.6 * math.tanh(v[0] / 0.02) * (1.0 + 0.05 * math.cos(2.0 * v[0])),)

    _, equations = equations_for(simulate(CHAINS[1], 11, 10.0, force=force))
    comparison = compare_models(equations, lambda _share: None)
    decision = decide(equations, comparison)
    assert [s.name for s in decision.model.effects] == ['coulomb_friction']
    assert search(Columns(equations), Scale.of(equations, comparison), decision.model, 0) is None
    assert with_laws(equations, comparison, decision).decision is decision


@pytest.mark.long
def test_a_listed_law_is_not_bent_to_stand_for_another(equations_for):
    """Friction at a place says most of what friction behind a cardan joint does, not all."""

    def dry(_t, q, _s):
        return 0.6 / (1.0 - 0.25 * math.cos(2.7 * q[0]))

    _, equations = equations_for(simulate(CHAINS[1], 11, 10.0, dry=dry))
    comparison = compare_models(equations, lambda _share: None)
    listed = decide(equations, comparison).model
    assert {s.name for s in listed.effects} == {'coulomb_friction', 'position_friction'}
    found = search(Columns(equations), Scale.of(equations, comparison), listed, 0)
    assert found is not None
    assert is_bent(listed, found.smooth, 0)
    assert not is_bent(listed, replace(listed, residual=0.99 * listed.residual), 0)


@pytest.mark.long
def test_a_formula_is_held_against_any_form(equations_for):
    """Four catches at odd places: no text says so."""

    def force(_t, q, _v):
        catches = ((-1.1, 0.12, 0.8), (-0.5, 0.1, 0.7), (0.1, 0.1, -0.6), (1.2, 0.12, 1.0))
        return (sum(a * math.exp(-(((q[0] - x) / w) ** 2)) for x, w, a in catches),)

    _, equations = equations_for(simulate(CHAINS[1], 11, 10.0, force=force))
    comparison = compare_models(equations, lambda _share: None)
    decision = decide(equations, comparison)
    scale, listed = Scale.of(equations, comparison), decision.tentative or decision.model
    found = search(Columns(equations), scale, listed, 0, is_open=True)
    assert found is not None
    ratio, chance = found.lack_of_fit
    assert ratio > LACKING
    assert chance < SIGNIFICANT


@pytest.mark.long
def test_a_law_is_found_beside_friction_that_was_not_named(equations_for):
    """A cable that stiffens, on a bearing: where nothing was asserted, friction may be there."""
    world = simulate(
        CHAINS[1], 11, 10.0, force=lambda _t, q, v: (-0.5 * q[0] ** 3 - 0.2 * v[0],),
        dry=lambda _t, _q, _s: 0.4,
    )  # fmt: skip
    _, equations = equations_for(world)
    comparison = compare_models(equations, lambda _share: None)
    found = search(
        Columns(equations), Scale.of(equations, comparison), fitted(equations), 0, is_open=True
    )
    assert found is not None
    assert found.laws
    names = {s.effect.name for s in found.laws[0].effects}
    assert {'coulomb_friction', 'viscous_friction'} < names
    assert found.laws[0].left[0] < 0.1 * COUNTED_SHARE


@pytest.mark.long
@pytest.mark.parametrize('is_kept', [True, False])
def test_names_stay_only_beside_a_formula_that_differs_little_too(
    equations_for, monkeypatch, is_kept
):
    """A better formula without them says that the listed laws were bent to imitate it."""
    monkeypatch.setattr(
        searching, 'is_slight',
        lambda _listed, m, _joint: is_kept or not isinstance(m.effects[-1].effect, FormulaLaw),
    )  # fmt: skip
    _, equations = equations_for(simulate(CHAINS[1], 11, 10.0, force=_brake))
    comparison, listed = compare_models(equations, lambda _share: None), fitted(equations)
    found = search(Columns(equations), Scale.of(equations, comparison), listed, 0)
    assert found is not None
    assert found.is_slight is is_kept


@pytest.mark.long
def test_a_formula_that_bodies_would_imitate_is_not_asserted(equations_for, monkeypatch):
    monkeypatch.setattr(assertion, 'acts_as_bodies', lambda *_: True)
    _, equations = equations_for(simulate(CHAINS[1], 11, 10.0, force=_brake))
    comparison = compare_models(equations, lambda _share: None)
    found = with_laws(equations, comparison, decide(equations, comparison))
    assert law_of(found.decision.model, 0) is None
    assert found.why_not[0].startswith('other bodies')


@pytest.mark.long
def test_a_law_in_a_narrow_region_is_found_beside_friction(equations_for):
    """A magnet that holds near one pose: too narrow for the spline that is compared first."""
    a, x0, w0 = -19.0, 0.4, 0.15

    def well(_t, q, _v):
        return (a * (q[0] - x0) * math.exp(-(((q[0] - x0) / w0) ** 2)),)

    world = simulate(CHAINS[1], 11, 20.0, force=well, dry=lambda _t, _q, _s: 0.3, reach=2.0)
    _, equations = equations_for(world)
    comparison = compare_models(equations, lambda _share: None)
    listed = fitted(equations, 'torque_gain')  # stands for friction as long as the well is there
    found = search(Columns(equations), Scale.of(equations, comparison), listed, 0, is_open=True)
    assert found is not None
    (friction,) = (s for s in found.laws[0].effects if s.name == 'coulomb_friction')
    assert friction.coefficients[0] == pytest.approx(0.3, rel=0.03)
    numbers = law_of(found.laws[0], 0).report(equations.motion)
    assert [numbers[x] for x in ('a', 'x0', 'w0')] == pytest.approx([a, x0, w0], rel=0.03)


def test_each_choice_of_listed_effects_gets_a_finer_spline(monkeypatch):
    """The best beside each, of the joint's own speed and of anything else."""

    def model(*listed, own_speed=False):
        force = SimpleNamespace(is_of_own_speed=own_speed)
        return SimpleNamespace(key=frozenset({*listed, 'smooth'}), force=force)

    monkeypatch.setattr(
        shapes, 'smooth_of', lambda m, _joint: (SimpleNamespace(key='smooth'), m.force)
    )
    best, worse, other = model('gain'), model('gain'), model('friction')
    fast, slow = model('gain', own_speed=True), model('gain', own_speed=True)
    found = shapes.beside_each([fast, best, worse, slow, other], 0)
    assert found == [(m, m.force) for m in (fast, best, other)]


def test_a_force_of_the_own_speed_gets_a_finer_spline(equations_for):
    """A motor on the mains lets go of a joint that leaves its speed, within a fifth of that."""

    def mains(_t, _q, v):
        x = v[0] - 1.6
        return (-4.0 * x / (1.0 + (x / 0.3) ** 2),)

    _, equations = equations_for(simulate(CHAINS[1], 6, 10.0, force=mains))
    scale = Scale.of(equations, compare_models(equations, lambda _share: None)).of_forms()
    listed = fitted(equations, 'viscous_friction')
    found = searching._Look(Columns(equations), scale, listed, 0, is_open=True).ranked()
    fine = [m for m in found if len(shapes.smooth_of(m, 0)[1].linear) == FINE + 3]
    assert any(shapes.smooth_of(m, 0)[1].is_of_own_speed for m in fine)


def test_a_finer_spline_has_columns_of_its_own(equations_for):
    """Columns known for a spline are not those of one with other pieces."""
    _, equations = equations_for(simulate(CHAINS[1], 11, 10.0, force=_brake))
    columns, motion = Columns(equations), equations.motion
    for pieces in (PIECES, FINE):
        variable = Variable('dq', 0, 'joint0')
        smooth = SmoothForce(0, variable, 'sign', variable.knots(motion, pieces), 'joint0')
        x = columns.of(EffectAt(smooth, Place(0), np.zeros(0)), equations)
        assert x.shape[2] == pieces + 3


@pytest.mark.parametrize(('memory', 'text', 'expected'), [
    (('stretch', 0.2), '(q[joint0] - play(q[joint0], T))',
     lambda q, v: np.clip(q - q[0], -0.1, 0.1)),
    (('lead', 0.3), '(q[joint0] + T*dq[joint0])', lambda q, v: q + 0.3 * v),
])  # fmt: skip
def test_a_variable_is_read_from_its_text_as_it_is_computed(equations_for, memory, text, expected):
    """The way ahead of its play, while a joint turns one way, and its position some time ahead."""
    _, equations = equations_for(simulate(CHAINS[1], 11, 3.0, force=_brake))
    motion, variable = equations.motion, Variable('q', 0, 'joint0', memory=memory)
    found = variable.values(motion)
    assert variable.text == text
    law = a_law(
        SmoothForce(0, variable, '', variable.knots(motion, PIECES), 'joint0'), motion,
        Range.of_variable(variable, motion), 'a*X', {},
    )  # fmt: skip
    place = law.places(motion)[0]
    np.testing.assert_allclose(law.columns(motion, place, np.array(memory[1:]))[:, 0], found)
    q, v = motion.position[:, 0], motion.velocity[:, 0]
    turned = np.flatnonzero(np.sign(v) != np.sign(v[0]))[0]
    np.testing.assert_allclose(found[:turned], expected(q, v)[:turned], atol=1e-12)


def _middle(text, seen):
    names = read_formula(text.replace('X', 'x'), is_law=True).parameters - {*COEFFICIENTS, 'x'}
    ends = {name: seen.ends(name)[:2] for name in names}
    return {name: 0.4 * low + 0.6 * high for name, (low, high) in ends.items()}


@pytest.mark.long
def test_every_formula_has_the_unit_of_a_force(equations_for, perfect):
    """As a user's own would be checked, and each is read again as it is written."""
    _, equations = equations_for(perfect[2])
    motion = equations.motion
    seen = set()
    more = {
        (s.gate, s.factor_of, s.variable.kind, s.variable.memory, s.variable.is_weighted): s
        for s in more_forces(motion, 1)
    }
    some = next(s for s in smooth_forces(motion, 1) if s.variable.text == 'q[joint0]')
    first = a_law(some, motion, Range.of_variable(some.variable, motion),
                  'a*X*exp(X/w0)', {'w0': 0.7})  # fmt: skip
    place = first.places(motion)[0]
    factor = LawAsFactor.of(
        EffectAt(first, place, first.starts(motion, place)[0], np.ones(1)), some.variable
    )
    for smooth in (*smooth_forces(motion, 1), *more.values(), *times_law(motion, 1, factor)):
        seen.add((smooth.gate, smooth.variable.kind, smooth.variable.index))
        seen_range = Range.of_variable(smooth.variable, motion)
        for text in texts(smooth):
            law = a_law(smooth, motion, seen_range, text, _middle(text, seen_range))
            units = {p.name: p.unit for p in law.quantities}
            again = read_formula(law.formula.partition('=')[2], is_law=True)
            assert unit_of(again, units, lambda _joint: 'rad') == read_unit('N m'), law.formula
            starts = law.starts(motion, law.places(motion)[0])
            columns = law.columns(motion, law.places(motion)[0], starts[0])
            assert np.isfinite(columns).all()
    assert {gate for gate, _, _ in seen} == {*GATES, *MORE_GATES, LAW}
    assert {kind for _, kind, _ in seen} == {'q', 'dq', 'tau'}
    assert {gate for gate, of, *_ in more if of[0] == 0} == {'speed', 'effort'}
    assert ('', 'q', 0) in seen


@pytest.mark.parametrize('memory', [('lead', 0.3), ('stretch', 0.2), ('slip', 0.3)])
def test_a_formula_is_drawn_beyond_what_was_seen_over_its_own_variable(equations_for, memory):
    """A lead as that of a joint at rest, a stretch or slip as what it is ahead of zero."""
    _, equations = equations_for(simulate(CHAINS[1], 11, 3.0, force=_brake))
    columns, motion = Columns(equations), equations.motion
    variable = Variable('q', 0, 'joint0', memory=memory)
    smooth = SmoothForce(0, variable, '', variable.knots(motion, PIECES), 'joint0')
    seen = Range.of_variable(variable, motion)
    law = a_law(smooth, motion, seen, 'a*tanh(X/v0)', {'v0': 0.5})
    sigma = fitted(equations).sigma
    shape = np.array([memory[1]])
    model = fit(columns, (EffectAt(smooth, Place(0), shape),), sigma, is_free=False, still=1)
    numbers = {'T': memory[1], 'v0': 0.5}
    placed = EffectAt(
        law, Place(0), np.array([numbers[n] for n in law.shape_names()]), np.array([2.0])
    )
    x = np.linspace(-3.0, 3.0, 7)
    found = statement._beyond(placed, Searched(0, model, model, (), np.zeros(0), 0.0), x)
    np.testing.assert_allclose(found, 2.0 * np.tanh(x / 0.5))


@pytest.mark.parametrize(('worth', 'kept'), [(5.0, 'bc'), (5.0 + 2.0 * ALIKE, 'abc')])
def test_a_formula_at_its_limit_is_another_one(monkeypatch, worth, kept):
    """It stays only where it is worth more than all others by what a recording shows."""
    equations = SimpleNamespace(motion=None)
    models = {
        name: SimpleNamespace(name=name, worth=x, frame=SimpleNamespace(equations=equations))
        for name, x in {'a': worth, 'b': 4.0, 'c': 1.0}.items()
    }
    monkeypatch.setattr(tried, 'law_of', lambda model, _joint: SimpleNamespace(
        at_bounds=lambda _motion: {'w0'} if model is models['a'] else set()))  # fmt: skip
    scale = SimpleNamespace(worth=lambda model: model.worth)
    assert ''.join(m.name for m in without_limits([*models.values()], scale, 0)) == kept


def test_a_law_of_one_coefficient_may_be_a_factor(equations_for, perfect):
    """Its parameters get other names, but not the joints that are named as these are."""
    motion = equations_for(perfect[2])[1].motion
    some = next(s for s in smooth_forces(motion, 1) if s.variable.text == 'q[joint0]')
    seen = Range.of_variable(some.variable, motion)

    def factor(text, numbers):
        law = a_law(some, motion, seen, text, numbers)
        place, shape = law.places(motion)[0], np.array(list(numbers.values()))
        return LawAsFactor.of(EffectAt(law, place, shape, np.ones(1)), some.variable)

    found = factor('a*sin(n0*(X - x0))', {'n0': 2.0, 'x0': 0.3})
    assert found.law.law.text == 'sin(n0_f*(q[joint0] - x0_f))'
    assert {p.name: p.start for p in found.parameters} == {'n0_f': 2.0, 'x0_f': 0.3}
    assert found.unit == 'N m'
    for n in (2.0, 1.5):
        true = np.sin(n * (motion.position[:, 0] - 0.3))
        assert found.values(motion, {'n0_f': n}) == pytest.approx(true)
    assert factor('a*X + d', {}) is None
    for smooth in times_law(motion, 1, found):
        assert smooth.variable != some.variable
        assert smooth.factors(motion) == pytest.approx(found.values(motion))
    soft = next(s for s in smooth_forces(motion, 1) if s.variable == some.variable
                and s.gate == 'soft')  # fmt: skip
    law = a_law(soft, motion, seen, 'a*exp(X/w0)', {'w0': 0.7})
    place, shape = law.places(motion)[0], np.array([0.7, 0.2])
    model = SimpleNamespace(effects=(EffectAt(law, place, shape, np.ones(1)),))
    gated, plain = (f for f, _ in as_factor(model, 1))
    assert 'tanh' in gated.law.law.text
    assert plain.law.law.text == 'exp(q[joint0]/w0_f)'
    assert [p.name for p in plain.parameters] == ['w0_f']
    own = Variable('dq', 1, 'joint1')
    assert own not in {s.variable for s in times_law(motion, 1, gated)}
    assert own in {s.variable for s in times_law(motion, 1, plain)}
    assert shapes._renamed('x0*q[x0] + v_s*q["r"]*r') == 'x0_f*q[x0] + v_s_f*q["r"]*r_f'


@pytest.mark.parametrize(
    ('force', 'is_promised'),
    [
        (lambda t, q, v: (-0.4 * v[0],), False),
        (lambda t, q, v: (-0.4 * v[0] - 0.5 * math.sin(2.0 * q[0]) ** 3,), True),
    ],
    ids=['viscous friction alone', 'a force of the position beside it'],
)
def test_a_law_is_looked_for_where_a_force_of_any_form_promises_one(
    equations_for, force, is_promised
):
    """Beside what listed effects explain already."""
    _, equations = equations_for(simulate(CHAINS[1], 5, 8.0, force=force))
    listed = fitted(equations, 'viscous_friction')
    assert promises(Columns(equations), listed, 0) is is_promised


def _waves(*periods):
    return [EffectAt(EFFECTS['cogging'], Place(0), np.array([n]), np.ones(2)) for n in periods]


@pytest.mark.parametrize(
    ('periods', 'is_one'),
    [((7.0, 21.1), True), ((21.1, 7.0), True), ((7.0, 17.5), False), ((7.0, 7.6), False),
     ((7.0,), False), ((), False)],
)  # fmt: skip
def test_waves_in_whole_ratios_are_one_periodic_force(equations_for, periods, is_one):
    """Of one gear, or of a shorter law; neighbours are two."""
    motion = equations_for(simulate(CHAINS[1], 5, 8.0, force=_brake))[1].motion
    wave = EFFECTS['cogging'].wave(motion, Place(0))
    assert 0.2 < wave.width < 3.0
    assert is_series(_waves(*periods), motion) is is_one


@pytest.mark.long
@pytest.mark.parametrize('is_flap', [True, False])
def test_a_series_of_waves_gives_way_to_a_law_that_says_all_of_it(equations_for, is_flap):
    """A pressure on a flap that turns is nearly two waves; two that are waves stay."""

    def force(_t, q, v):
        wave = math.sin(6.0 * q[0] + 0.7)
        return (-0.6 * (abs(wave) * wave if is_flap else wave + 0.3 * math.sin(12.0 * q[0])),)

    _, equations = equations_for(simulate(CHAINS[1], 5, 20.0, force=force))
    comparison = compare_models(equations, lambda _share: None)
    found = with_laws(equations, comparison, decide(equations, comparison)).decision.model
    names = [s.name for s in found.effects]
    assert (names == ['cogging', 'cogging']) is not is_flap
    law = law_of(found, 0)
    if is_flap:
        assert law.effect.formula.partition(' = ')[2].startswith('a*abs(sin(')


@pytest.mark.long
def test_laws_of_two_joints_are_found_together(equations_for):
    """A gyro turns what one joint does into a force on the other, and back."""

    def force(_t, q, v):
        h = 0.6 * math.cos(q[1])
        return h * v[1] - 0.3 * v[0], -h * v[0] - 0.2 * v[1]

    _, equations = equations_for(simulate(CHAINS[2], 9, 20.0, force=force, reach=0.8))
    comparison = compare_models(equations, lambda _share: None)
    decision = decide(equations, comparison)
    found = with_laws(equations, comparison, decision)
    assert found.decision.verdict == 'missing_physics'
    assert found.decision.unknown == ()
    assert found.why_not == {}
    motion = equations.motion
    for joint, sign in ((0, 1.0), (1, -1.0)):
        law = law_of(found.decision.model, joint)
        expected = sign * 0.6 * np.cos(motion.position[:, 1]) * motion.velocity[:, 1 - joint]
        np.testing.assert_allclose(law.force(motion)[:, joint], expected, atol=0.02)


def _shaped(equations, effects, form=('q', '')):
    """Return a search that ended with a force of one variable, and its columns and scale."""
    columns, motion = Columns(equations), equations.motion
    variable = Variable(form[0], 0, 'joint0')
    smooth = SmoothForce(0, variable, form[1], variable.knots(motion, FINE), 'joint0')
    laws = [EffectAt(EFFECTS[name], Place(0)) for name in effects]
    sigma = fitted(equations).sigma
    model = fit(columns, (EffectAt(smooth, Place(0), np.zeros(0)), *laws), sigma, is_free=False)
    scale = Scale.of(equations, compare_models(equations, lambda _share: None))
    return Searched(0, model, model, (), np.zeros(0), 0.0), columns, scale


def _sprung(damping=0.3):
    """Return a world with a spring that saturates, and friction."""

    def force(_t, q, v):
        return (-1.5 * math.tanh(3.0 * q[0]) - damping * v[0],)

    return simulate(CHAINS[1], 9, 20.0, force=force, dry=lambda *_: 0.25)


_RUBBED = 'viscous_friction', 'coulomb_friction'


@pytest.mark.parametrize(('damping', 'effects', 'standing'), [
    (0.3, _RUBBED, _RUBBED), (0.3, (*_RUBBED, 'armature'), _RUBBED),
    (0.01, _RUBBED, _RUBBED[1:]), (0.3, _RUBBED[:1], ()),
])  # fmt: skip
def test_everyday_laws_stand_beside_a_force_of_known_shape(
    equations_for, damping, effects, standing
):
    """With their numbers there; none where the force and they leave much, or they say nothing."""
    searched, columns, scale = _shaped(equations_for(_sprung(damping))[1], effects)
    found = searched.everyday(columns, scale)
    assert (found is None) is (not standing)
    if not found:
        return
    model, std = found
    assert {s.name for s in model.effects} == {*standing}
    assert std.keys() == model.key
    for s in model.effects:
        true = {'viscous_friction': damping, 'coulomb_friction': 0.25}[s.name]
        close = max(3.0 * std[s.key], 0.02 * true)
        assert float(s.coefficients[0]) == pytest.approx(true, abs=close)
    smooth = searched.smooth
    gone = sum(f for s, f in zip(smooth.effects, smooth.forces, strict=True) if s.key not in std)
    np.testing.assert_allclose(model.residual, smooth.residual + gone)


def _of_speed(gate=''):
    variable = Variable('dq', 0, 'joint0')
    return SmoothForce(0, variable, gate, np.linspace(-1.0, 1.0, 12), 'joint0')


@pytest.mark.parametrize(
    ('gate', 'name', 'is_form'),
    [('', 'coulomb_friction', False), ('', 'viscous_friction', True), ('', 'spring', False),
     ('sign', 'coulomb_friction', True), ('effort', 'coulomb_friction', False)],
)  # fmt: skip
def test_a_spline_of_the_speed_is_damping_and_no_jump(gate, name, is_form):
    assert _of_speed(gate).has_form_of(EffectAt(EFFECTS[name], Place(0))) is is_form


@pytest.mark.parametrize(('gate', 'standing'), [('', {'coulomb_friction'}), ('sign', set())])
def test_of_friction_only_a_jump_stands_beside_a_force_of_the_own_speed(
    equations_for, gate, standing
):
    """Damping is a part of that force; with a sign as its factor so is dry friction."""
    world = simulate(
        CHAINS[1], 9, 20.0, force=lambda _t, q, v: (-0.005 * max(v[0], 0.0) ** 2,),
        dry=lambda *_: 1.5,
    )  # fmt: skip
    searched, columns, scale = _shaped(equations_for(world)[1], _RUBBED[1:], ('dq', gate))
    found = searched.everyday(columns, scale)
    assert ({s.name for s in found[0].effects} if found else set()) == standing


def test_what_stands_beside_a_refused_formula_is_part_of_the_decision(monkeypatch, equations_for):
    """With the model that it was fitted in."""
    _, equations = equations_for(_sprung())
    comparison = compare_models(equations, lambda _share: None)
    monkeypatch.setattr(assertion, '_objection', lambda *_: 'it is not asked for')
    found = with_laws(equations, comparison, decide(equations, comparison))
    assert found.decision.unknown == (0,)
    model, std = found.decision.shaped[0]
    assert {s.name for s in model.effects} == {*_RUBBED}
    assert std.keys() == model.key


def test_no_friction_is_looked_for_beside_a_refused_formula_of_the_own_speed(
    monkeypatch, equations_for
):
    """It may be a part of that force, however it is fitted."""
    force = lambda _t, q, v: (-0.05 * max(v[0], 0.0) ** 2,)  # noqa: E731 - a world
    _, equations = equations_for(simulate(CHAINS[1], 9, 20.0, force=force))
    comparison = compare_models(equations, lambda _share: None)
    monkeypatch.setattr(assertion, '_objection', lambda *_: 'it is not asked for')
    found = with_laws(equations, comparison, decide(equations, comparison))
    assert found.decision.unknown == (0,)
    assert not found.decision.shaped[0][1]


def test_an_everyday_law_that_does_not_count_as_physics_is_not_told(monkeypatch, equations_for):
    """However small what is left beside it."""
    found, columns, scale = _shaped(equations_for(_sprung())[1], _RUBBED)
    share = max(x for s, x in zip(found.smooth.effects, found.smooth.filtered_shares, strict=True)
                if s.name in _RUBBED)  # fmt: skip
    monkeypatch.setattr(searched, 'COUNTED_SHARE', 1.1 * share)
    assert found.everyday(columns, scale) is None


@pytest.mark.parametrize(('worth_without', 'is_in_rival', 'stands'), [
    (0.0, True, True), (0.0, False, False), (2.0, True, False),
])  # fmt: skip
def test_an_everyday_law_is_worth_its_price_beside_every_formula(
    equations_for, worth_without, is_in_rival, stands
):
    """Its interval holds the numbers that it has beside formulas that are worth as much."""
    searched, columns, _ = _shaped(equations_for(_sprung())[1], _RUBBED)
    model = searched.smooth
    rub = next(s for s in model.effects if s.name == 'viscous_friction')
    other = replace(rub, coefficients=1.1 * rub.coefficients)
    effects = tuple(other if s is rub else s for s in model.effects if s is not rub or is_in_rival)
    rival = replace(model, effects=effects)
    searched = replace(searched, laws=(rival,))
    scale = SimpleNamespace(worth=lambda m: 1.0 if m in (model, rival) else worth_without)
    _, std = searched.everyday(columns, scale) or (None, {})
    assert (rub.key in std) is stands
    if stands:
        assert std[rub.key] == pytest.approx(0.1 * float(rub.coefficients[0]) / INTERVAL)


@pytest.mark.parametrize(('gate', 'law', 'stands'), [
    ('', 'coulomb_friction', True), ('sign', 'coulomb_friction', False),
    ('sign', 'viscous_friction', True), ('speed', 'viscous_friction', False),
    ('', 'spring', False),
])  # fmt: skip
def test_friction_does_not_stand_beside_a_form_of_itself(equations_for, gate, law, stands):
    """Nor does any law that few joints have."""
    _, equations = equations_for(simulate(CHAINS[1], 11, 3.0, force=_brake))
    variable = Variable('q', 0, 'joint0')
    smooth = SmoothForce(0, variable, gate, variable.knots(equations.motion, PIECES), 'joint0')
    searched = Searched(0, None, None, (), np.zeros(0), 0.0)
    effect = EFFECTS[law]
    shape = effect.starts(equations.motion, Place(0))[0]
    assert searched._may_stand(EffectAt(effect, Place(0), shape), smooth) is stands


@pytest.mark.parametrize(('left', 'share', 'is_more'), [(0.9, 1.0, False), (1.1, 1.0, True),
                                                        (1.1, 0.5, False)])  # fmt: skip
def test_a_formula_leaves_little_that_comes_back_with_the_motion(
    monkeypatch, left, share, is_more
):
    """Relative to its force; noise beside it may be larger."""
    monkeypatch.setattr(searched, 'repeatable', lambda *_: np.array([[share], [1.0]]))
    law, force = SimpleNamespace(place=Place(0)), np.full((5, 1), 2.0)
    model = SimpleNamespace(effects=(law,), forces=(force,), residual=None,
                            mean_square=np.array([4.0 * LAW_REST * left]))  # fmt: skip
    equations = SimpleNamespace(d=np.zeros((5, 1)))
    assert leaves_more(equations, model, law) is is_more


def test_what_is_unknown_at_two_joints_is_looked_for_beside_everyday_laws(equations_for):
    """Not beside a law of both, which may have imitated it."""
    _, equations = equations_for(
        simulate(CHAINS[2], 9, 8.0, force=lambda t, q, v: (-0.3 * v[0], 0))
    )
    columns, place = Columns(equations), Place(1, source=0)
    law = EFFECTS['coupled_friction']
    both = EffectAt(law, place, law.starts(equations.motion, place)[0])
    model = fit(columns, (both,), fitted(equations).sigma, is_free=False)
    decision = Decision('unexplained', model, (), np.ones(2), 0, (0, 1))
    apart = assertion._apart(columns, decision, set())
    assert {s.name for s in apart.effects} <= {'viscous_friction', 'coulomb_friction', 'armature'}
    assert assertion._apart(columns, replace(decision, unknown=(0,)), set()) is None


@pytest.mark.parametrize(('share', 'joints'), [(0.9, [1]), (0.1, [])])
def test_more_than_noise_that_is_left_is_looked_at(monkeypatch, share, joints):
    """A force that remembers the motion is predicted by rows before, not by the motion now."""
    monkeypatch.setattr(assertion, 'structure', lambda *_: np.array([1.0, share]))
    left = np.array([0.5, 4.0])  # relative to what an adequate model may
    scale = SimpleNamespace(
        excess=lambda _model, part=None: left if part is None else (part * left).max(axis=0)
    )
    model = SimpleNamespace(residual=None)
    assert assertion._coloured(None, scale, model, [1, 0]) == joints
    monkeypatch.setattr(assertion, 'structure', None)  # not asked
    assert assertion._coloured(None, scale, model, [0]) == []
    assert assertion._coloured(None, scale, model, []) == []


def test_a_law_may_stand_for_a_listed_one_that_remembers(monkeypatch, equations_for):
    """Hysteresis, which a force that forgets looks like, is asked again beside friction."""
    _, equations = equations_for(simulate(CHAINS[1], 12, 6.0, force=_brake))
    comparison = compare_models(equations, lambda _share: None)
    decision = decide(equations, comparison)
    asked = []
    monkeypatch.setattr(assertion, 'promises', lambda *_: True)
    monkeypatch.setattr(assertion, 'search', lambda *_args, is_open: asked.append(is_open))
    for name in ('hysteresis', 'coulomb_friction'):
        shape = np.full(len(EFFECTS[name].shape_names()), 0.1)
        one = EffectAt(EFFECTS[name], Place(0), shape, np.ones(1))
        model = fit(Columns(equations), (one,), comparison.base.sigma, rounds=1, steps=0)
        monkeypatch.setattr(assertion, '_coloured', lambda *_: [])
        with_laws(
            equations, comparison, replace(decision, model=model, unknown=(), tentative=None)
        )
    assert asked == [True, False]


@pytest.mark.parametrize(
    ('strain', 'is_free', 'joints'), [(2.0, True, {1, 2}), (0.5, True, set()), (2.0, False, set())]
)
def test_rare_laws_beside_bent_bodies_may_imitate_another(strain, is_free, joints):
    """A spring and a coupling, but no friction of any kind."""
    places = {
        'spring': Place(1), 'joint_coupling': Place(2, source=1), 'coulomb_friction': Place(3),
        'stribeck_friction': Place(0),
    }  # fmt: skip
    effects = tuple(EffectAt(EFFECTS[name], place) for name, place in places.items())
    model = SimpleNamespace(is_free=is_free, strain=strain, effects=effects)
    assert assertion._bent(model) == joints


def test_what_bent_bodies_and_rare_laws_say_is_asked_again(monkeypatch, equations_for):
    """Beside everyday laws; what is found there counts only if it is worth more than they are."""
    _, equations = equations_for(simulate(CHAINS[1], 12, 6.0, force=_brake))
    comparison = compare_models(equations, lambda _share: None)
    decision = decide(equations, comparison)
    asked = []

    def search(_columns, _scale, listed, joint, *, is_open):
        asked.append(({s.name for s in listed.effects} & {'spring'}, is_open))
        return SimpleNamespace(smooth=None, laws=(), joint=joint, is_slight=False)

    monkeypatch.setattr(assertion, 'search', search)
    monkeypatch.setattr(assertion, 'promises', lambda *_: False)
    monkeypatch.setattr(assertion, '_coloured', lambda *_: [])
    monkeypatch.setattr(assertion, '_is_better', lambda *_: False)
    model = fitted(equations, 'spring', is_free=True)
    decision = replace(decision, model=model, unknown=(), tentative=None)
    for is_bent_, expected in ((False, []), (True, [(set(), True)])):
        monkeypatch.setattr(assertion, '_bent', lambda _m, found=is_bent_: {0} if found else set())
        found = with_laws(equations, comparison, decision)
        assert found.searched == ()
        assert asked == expected


@pytest.mark.parametrize(
    ('worth', 'left', 'bends', 'is_better'),
    [
        (ALIKE + 1.0, 0.1, False, True),
        (ALIKE - 1.0, 0.1, True, False),
        (ALIKE + 1.0, 0.6, False, False),
        (ALIKE + 1.0, 0.6, True, True),
    ],
)
def test_a_form_is_better_than_all_that_is_asserted(monkeypatch, worth, left, bends, is_better):
    """By more than a recording prefers between models that are alike, and by what it leaves.

    Or where laws with a shape of their own were distorted to imitate it: a spring and an end stop
    a pull that grows as a hyperbola.
    """
    monkeypatch.setattr(tried, 'is_bent', lambda *_: bends)
    known = ((0.5 * worth, left), (worth, left), (0.0, 1.0))
    smooth, law, asserted = (
        SimpleNamespace(worth=w, mean_square=np.array([9.0, x])) for w, x in known
    )
    scale = SimpleNamespace(of_forms=lambda: SimpleNamespace(worth=lambda m: m.worth))
    searched = SimpleNamespace(joint=1, smooth=smooth, laws=(law, smooth))
    decision = SimpleNamespace(model=asserted, tentative=None)
    assert assertion._is_better(scale, searched, decision) is is_better
