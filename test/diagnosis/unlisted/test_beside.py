"""Which listed names a smooth force puts in question."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.criteria import COUNTED_SHARE
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.comparison import compare_models
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.unlisted import assertion, beside, tried
from sgp_ros.diagnosis.unlisted import search as searching
from sgp_ros.diagnosis.unlisted.beside import acts_as_bodies, is_bent, is_creep, is_slight
from sgp_ros.diagnosis.unlisted.searched import Searched
from sgp_ros.diagnosis.unlisted.shapes import FINE, SmoothForce
from sgp_ros.diagnosis.unlisted.tried import smooth_forces
from sgp_ros.diagnosis.unlisted.variables import Variable
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import JOINT, Place
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, simulate


@pytest.fixture(scope='module')
def damped(equations_for, viscous):
    return equations_for(viscous)[1]


def _with_rest(model, share):
    """The same model with a residual that is more by a share of the mean squared effort."""
    power = model.frame.equations.power
    return replace(model, residual=model.residual + (share * power) ** 0.5)


def test_only_laws_whose_place_a_smooth_force_takes_are_in_question(damped):
    smooth = fitted(damped, 'cogging', 'viscous_friction')
    listed = _with_rest(smooth, 0.5 * COUNTED_SHARE)
    without = fitted(damped, 'viscous_friction')
    assert is_slight(listed, smooth, 0)
    assert not is_slight(listed, replace(without, residual=smooth.residual), 0)
    assert not is_slight(_with_rest(smooth, 2.0 * COUNTED_SHARE), smooth, 0)
    assert not is_bent(listed, smooth, 0)


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_friction_less_than_the_file_states_is_in_question_too(damped, sign):
    """With dry friction beside it, it imitates friction of another form."""
    both = fitted(damped, 'coulomb_friction', 'viscous_friction')
    effects = tuple(replace(s, coefficients=x * np.ones(1))
                    for s, x in zip(both.effects, (0.1, 0.3 * sign), strict=True))  # fmt: skip
    smooth = replace(fitted(damped), residual=both.residual)
    listed = _with_rest(replace(both, effects=effects), 0.5 * COUNTED_SHARE)
    assert is_slight(listed, smooth, 0) is (sign > 0.0)


def _brake(_t, _q, v):
    return (-0.4 * v[0] / (1.0 + (v[0] / 1.5) ** 2),)


def _blurred(_t, _q, v):
    return (-0.3 * np.tanh(v[0] / 0.1),)


@pytest.mark.parametrize(
    ('force', 'law', 'is_refined'),
    [(_blurred, 'coulomb_friction', True), (_brake, 'viscous_friction', False)],
)
def test_friction_that_grows_within_a_small_speed_keeps_its_name(
    equations_for, force, law, is_refined
):
    """Not a brake, which plain friction says as little at great speeds as at small ones."""
    _, equations = equations_for(simulate(CHAINS[1], 4, 10.0, force=force))
    columns, listed = Columns(equations), fitted(equations, law)
    speed = Variable('dq', 0, 'joint0')
    form = SmoothForce(0, speed, '', speed.knots(equations.motion, FINE), 'joint0')
    candidate = EffectAt(form, Place(0), form.starts(equations.motion, Place(0))[0])
    smooth = fit(columns, (candidate,), listed.sigma, is_free=False)
    adequate = SimpleNamespace(excess=lambda _: np.zeros(1))
    assert smooth.mean_square[0] < 0.5 * listed.mean_square[0]
    assert is_creep(columns, adequate, listed, smooth, 0) is is_refined


def test_adequate_friction_keeps_its_name_against_an_earlier_speed(damped):
    """Not against a force of the speed now, of a position, nor where it is not adequate."""
    scale, columns = Scale.of(damped, compare_models(damped, lambda _: None)), Columns(damped)
    listed = fitted(damped, 'viscous_friction')
    unused = fitted(damped, 'viscous_friction', 'cogging')
    forces = {e.variable.text: e for e in smooth_forces(damped.motion, 0) if not e.gate}

    def smooth(text):
        candidate = EffectAt(
            forces[text], Place(0), forces[text].starts(damped.motion, Place(0))[0]
        )
        return fit(columns, (candidate,), listed.sigma, is_free=False)

    late = smooth('lag(dq[joint0], T)')
    assert is_creep(columns, scale, listed, late, 0)
    assert is_creep(columns, scale, unused, late, 0)
    assert not is_creep(columns, scale, fitted(damped, 'cogging'), late, 0)
    assert not is_creep(columns, scale, listed, smooth('dq[joint0]'), 0)
    assert not is_creep(columns, scale, listed, smooth('lag(q[joint0], T)'), 0)
    asked = []

    def excess(model):
        asked.append([s.name for s in model.effects])
        return np.ones(1)

    creeps = fitted(damped, 'hysteresis', 'cogging', 'constant_load')
    assert not is_creep(columns, SimpleNamespace(excess=excess), creeps, late, 0)
    assert asked == [['hysteresis', 'constant_load']]


def test_a_force_that_other_bodies_would_have_is_told_from_one_that_no_body_has(equations_for):
    """A link a third heavier would; one twice as heavy is not likely, a wave no body."""
    _, equations = equations_for(simulate(CHAINS[2], 4, 10.0))
    weight = equations.bases[1][:, equations.instants + 10]
    q = equations.filter(equations.motion.position[:, 1:])[:, 0]
    assert acts_as_bodies(equations, 1.3 * weight, 1)
    assert not acts_as_bodies(equations, 4.0 * weight, 1)
    assert not acts_as_bodies(equations, weight.std() * np.sin(9.0 * q), 1)
    mixed = weight + 0.6 * weight.std() * np.sin(9.0 * q)  # a quarter of it
    assert not acts_as_bodies(equations, mixed, 1)
    _, alone = equations_for(simulate(CHAINS[1], 4, 10.0))
    assert not acts_as_bodies(alone, 1.3 * alone.bases[0][:, alone.instants], 0)


@pytest.mark.parametrize(
    ('excess', 'is_much', 'added'),
    [(2.0, True, beside._FURTHER), (2.0, False, beside._FURTHER),
     (0.5, True, beside._FURTHER), (0.5, False, 0)],
)  # fmt: skip
def test_few_laws_are_added_beside_a_formula_however_much_each_is_worth(
    monkeypatch, excess, is_much, added
):
    """Where more is left than a model may, or a law; beside a wrong one all is worth something."""
    motion = SimpleNamespace(catalogue={})

    def model(effects):
        frame = SimpleNamespace(equations=SimpleNamespace(motion=motion))
        return SimpleNamespace(effects=effects, frame=frame, key=frozenset(), is_free=False,
                               sigma=None, w=None)  # fmt: skip

    at = SimpleNamespace(key=0, place=Place(0), effect=SimpleNamespace(site=None))
    fakes = {
        'far_and_near': lambda m, _: ((), m.effects), 'own_effects': lambda *_: (),
        'screen': lambda *_: [at], 'distinct': lambda found, _: found, '_friction': lambda _: (),
        'fit': lambda _, effects, *__, **___: model(effects), 'is_credible': lambda _: True,
        'earned': lambda _columns, _scale, m, _joint: m, 'law_of': lambda *_: at,
        'leaves_more': lambda *_: is_much,
    }  # fmt: skip
    for name, fake in fakes.items():
        monkeypatch.setattr(beside, name, fake)
    scale = SimpleNamespace(excess=lambda _: np.full(1, excess), worth=lambda m: len(m.effects))
    assert len(beside.refined(None, scale, model(()), 0).effects) == added


@pytest.mark.parametrize(
    ('names', 'is_open', 'is_tried'),
    [
        (('viscous_friction',), False, False),
        (('viscous_friction',), True, True),
        (('viscous_friction', 'position_friction'), False, True),
        (('armature', 'viscous_friction'), True, True),
        (('armature', 'position_friction'), False, True),
    ],
)
def test_plain_friction_is_tried_in_place_of_a_rare_law(names, is_open, is_tried):
    """Such as friction in a part of the range, which imitated a part of the law looked for."""
    listed = SimpleNamespace(effects=tuple(EffectAt(EFFECTS[n], Place(0)) for n in names))
    kept = [{s.name for s in some} for some in beside.beside(listed, 0, is_open=is_open)]
    rotor = {'armature'} & set(names)
    assert set(names) in kept
    assert ({'coulomb_friction', *rotor} in kept) is is_tried
    assert ({'coulomb_friction', 'viscous_friction', *rotor} in kept) is is_tried


@pytest.mark.parametrize('rare', ['payload', 'position_friction'])
def test_other_bodies_take_the_place_of_a_load_beside_a_formula(monkeypatch, rare):
    """With it, bodies as in the file were enough while nothing else was known."""
    law = EffectAt(SimpleNamespace(site=JOINT), Place(0))
    other = EffectAt(EFFECTS[rare], Place(0))

    def fit(_columns, effects, _sigma, *, is_free, **_):
        worth = 3.0 if is_free and other not in effects else 1.0
        return SimpleNamespace(effects=effects, is_free=is_free, sigma=None, worth=worth,
                               score=0.0, is_possible=lambda: True)  # fmt: skip

    monkeypatch.setattr(beside, 'fit', fit)
    monkeypatch.setattr(beside, 'law_of', lambda *_: law)
    scale = SimpleNamespace(worth=lambda m: m.worth)
    start = SimpleNamespace(effects=(law, other), is_free=False, sigma=None, worth=2.0)
    found = beside.earned(None, scale, start, 0)
    assert found.is_free is (rare == 'payload')
    assert (found is start) is (rare != 'payload')


@pytest.mark.parametrize('rare', ['payload', 'tip_force'])
def test_a_rotor_is_tried_in_the_place_of_a_load(monkeypatch, rare):
    """Beside a law that is not known yet, the weight of a load may have imitated it."""
    load, dry = EffectAt(EFFECTS[rare], Place(-2)), EffectAt(EFFECTS['coulomb_friction'], Place(0))
    monkeypatch.setattr(
        searching._Look, '_without', lambda _self, kept, *, is_free: (kept, is_free)
    )
    look = searching._Look(None, None, SimpleNamespace(effects=(load, dry)), 0, is_open=False)
    tried = {(frozenset(s.name for s in kept), free) for kept, free in look._bases()}
    for is_free in (False, True):
        assert (frozenset({rare, 'coulomb_friction'}), is_free) in tried
        with_rotor = (frozenset({'armature', 'coulomb_friction'}), is_free)
        assert (with_rotor in tried) is EFFECTS[rare].is_body


@pytest.mark.parametrize(
    ('left', 'worth', 'is_asked'),
    [(0.1, 40.0, True), (0.1, 10.0, False), (0.5, 40.0, False), (0.5, 70.0, True)],
)
def test_a_formula_is_looked_for_where_it_may_be_worth_more_than_a_spline(
    monkeypatch, left, worth, is_asked
):
    """If the spline leaves much less: of its numbers a formula has few."""
    fakes = {
        'is_slight': False, 'is_bent': True, 'is_creep': False, 'is_series': False,
        'own_effects': (), 'smooth_of': (SimpleNamespace(coefficients=np.zeros(9)), None),
    }  # fmt: skip
    for name, found in fakes.items():
        monkeypatch.setattr(tried, name, lambda *_, found=found: found)
    listed, smooth = (
        SimpleNamespace(mean_square=np.array([x]), worth=w)
        for x, w in ((1.0, 50.0), (left, worth))
    )
    columns = SimpleNamespace(equations=lambda _: SimpleNamespace(motion=None))
    scale = SimpleNamespace(worth=lambda m: m.worth)
    assert tried.is_wanted(columns, scale, listed, smooth, 0) is is_asked


@pytest.mark.parametrize(
    ('smooth', 'is_slight', 'is_listed'),
    [(40.0, False, True), (90.0, False, False), (90.0, True, True)],
)
def test_listed_laws_must_say_as_much_as_a_force_without_a_formula(
    monkeypatch, smooth, is_slight, is_listed
):
    """That no formula was found for a force does not make two waves of it; a trifle does."""
    scale = SimpleNamespace(worth=lambda m: m.worth, counts=lambda _: True)
    monkeypatch.setattr(assertion.Scale, 'of', lambda *_: SimpleNamespace(of_forms=lambda: scale))
    listed, formula = SimpleNamespace(worth=50.0), SimpleNamespace(worth=45.0)
    comparison = SimpleNamespace(singles=(), pairs=(listed,), more=())
    found = SimpleNamespace(
        laws=(formula,), smooth=SimpleNamespace(worth=smooth), is_slight=is_slight
    )
    assert assertion._is_listed(None, comparison, found) is is_listed


@pytest.mark.parametrize('links', [1, 2])
def test_a_mount_that_acts_on_one_joint_alone_is_a_part_of_its_force(equations_for, links):
    """Beside it friction stands, however the base of a robot with one joint is tilted."""
    none = (0.0,) * (links - 1)
    _, equations = equations_for(simulate(
        CHAINS[links], 11, 10.0,
        force=lambda _t, q, v: (-0.6 * q[0] ** 3 - 0.4 * np.tanh(50.0 * v[0]), *none),
    ))  # fmt: skip
    columns, motion = Columns(equations), equations.motion
    smooth = next(e for e in smooth_forces(motion, 0) if e.variable.kind == 'q' and not e.gate)
    tilt = EFFECTS['gravity_tilt']
    place = tilt.places(motion)[0]
    effects = (
        EffectAt(smooth, Place(0)), EffectAt(EFFECTS['coulomb_friction'], Place(0)),
        EffectAt(tilt, place, np.array([1e-3, 1e-3])),
    )  # fmt: skip
    model = fit(columns, effects, fitted(equations).sigma, still=3)
    found = Searched(0, model, model, (), np.zeros(0), 0.0)
    scale = Scale.of(equations, compare_models(equations, lambda _share: None))
    without, std = found.everyday(columns, scale)
    assert {s.name for s in without.effects} == {
        'coulomb_friction', *(['gravity_tilt'] if links > 1 else [])
    }  # fmt: skip
    assert [name for name, _ in std] == ['coulomb_friction']
