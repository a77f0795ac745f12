"""Statements on models that were not asserted, and the certainty of the rest."""

from __future__ import annotations

import math
from copy import copy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.criteria import (
    ALIKE,
    COUNTED_SHARE,
    DOUBTED,
    LEAST_ASSERTED,
    LEAST_SHARE,
)
from sgp_ros.diagnosis.decide import certainty
from sgp_ros.diagnosis.decide import simpler as simpler_models
from sgp_ros.diagnosis.decide.certainty import (
    Probabilities,
    certainty_of,
    doubted,
    rests_on,
    settled,
)
from sgp_ros.diagnosis.decide.cross_validation import physics_left
from sgp_ros.diagnosis.decide.decision import UNKNOWN, decide
from sgp_ros.diagnosis.decide.reasons import why_not
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.decide.simpler import simpler
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.findings import asserted, doubted_beside, doubted_if_late, doubted_if_none
from sgp_ros.diagnosis.result import Finding, Location, Parameter
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from sgp_ros.physics.servo import Servo
from test.diagnosis.fitted_models import fitted, with_coefficients
from test.diagnosis.worlds import CHAINS, simulate


def _comparison(equations, *models):
    bases = (fitted(equations, is_free=f) for f in (False, True))
    return Comparison(*bases, models, ())


@pytest.fixture(scope='module')
def rubbing(equations_for):
    """Equations of a joint with Coulomb friction of 0.5 N m and viscous of 0.3 N m s/rad."""
    world = simulate(
        CHAINS[1], 4, 10.0, dry=lambda t, q, s: 0.5, force=lambda t, q, v: (-0.3 * v[0],)
    )
    return equations_for(world)[1]


def test_what_is_improbable_is_not_asserted_beside_others(equations_for, viscous, monkeypatch):
    """The rest is fitted again without it; the most probable one stays whatever it is."""
    _, equations = equations_for(viscous)
    pair = fitted(equations, 'viscous_friction', 'quadratic_drag')
    comparison = _comparison(equations, fitted(equations, 'spring'))
    scale = Scale.of(equations, comparison)
    decision = replace(decide(equations, comparison), verdict='missing_physics', model=pair)
    names = [s.key for s in pair.effects]
    chances = Probabilities({names[0]: 0.3, names[1]: 9e-5}, np.zeros(1), scale)
    monkeypatch.setattr(certainty, 'probabilities', lambda *_: chances)
    kept, _, _ = settled(equations, comparison, decision)
    assert max(chances.by_key.values()) < LEAST_ASSERTED
    assert [s.key for s in kept.model.effects] == names[:1]
    assert kept.rivals[0] is pair
    assert 'a simpler model is nearly as good' in why_not(pair, kept, scale)


def test_beside_an_unknown_a_law_goes_that_is_impossible_without_an_improbable_one(
    equations_for, viscous
):
    """Friction that only a negative drag made positive is driven without it."""
    _, equations = equations_for(viscous)
    numbers = replace(equations, d=equations.d + 0.1 * equations.filter(
        equations.motion.direction))  # fmt: skip
    pair = fitted(numbers, 'viscous_friction', 'coulomb_friction')
    assert pair.effects[1].coefficients[0] < 0.0
    chances = Probabilities({s.key: 0.9 for s in pair.effects}, np.zeros(1), None)
    kept = certainty._probable(numbers, pair, chances)
    assert [s.name for s in kept.effects] == ['viscous_friction']
    sound = fitted(equations, 'viscous_friction')
    assert certainty._probable(equations, sound, chances) is sound


def test_a_law_stays_without_which_its_joint_is_not_described(rubbing, monkeypatch):
    """However improbable its name is: the drag would have to do what the dry friction does."""
    pair = fitted(rubbing, 'viscous_friction', 'coulomb_friction')
    comparison = _comparison(rubbing, fitted(rubbing, 'spring'))
    scale = Scale.of(rubbing, comparison)
    decision = replace(decide(rubbing, comparison), verdict='missing_physics', model=pair)
    p = dict(zip((s.key for s in pair.effects), (0.9, 0.3), strict=True))
    chances = Probabilities(p, np.zeros(1), scale)
    monkeypatch.setattr(certainty, 'probabilities', lambda *_: chances)
    kept, _, _ = settled(rubbing, comparison, decision)
    assert kept.model is pair


@pytest.mark.parametrize('is_free', [True, False])
def test_a_gain_beside_free_bodies_is_as_sure_as_the_worst_joint(equations_for, viscous, is_free):
    """Bodies are its measure, and take up what is not known elsewhere."""
    _, equations = equations_for(viscous)
    model = fitted(equations, 'torque_gain', is_free=is_free)
    comparison = _comparison(equations, model)
    bodies = replace(comparison.base, residual=10.0 * comparison.base.residual)
    comparison = replace(comparison, nominal=bodies, parameters=bodies)
    decided = replace(decide(equations, comparison), model=model, excess=np.array([0.0, 3.0]))
    contrasts = certainty.Contrasts(equations, model)
    chances = certainty.probabilities(equations, comparison, decided, contrasts)
    assert (chances.of(model, 0) <= 0.1) is is_free


@pytest.mark.parametrize(('gain', 'is_doubted'), [(0.5, False), (0.23, True)])
def test_numbers_that_no_machine_has_are_doubted(equations_for, viscous, gain, is_doubted):
    """A torque constant that is half of what is stated happens; less than a quarter does not."""
    _, equations = equations_for(viscous)
    model = with_coefficients(fitted(equations, 'torque_gain'), np.array([gain - 1.0]))
    comparison = _comparison(equations, model)
    scale = Scale.of(equations, comparison)
    bodies = replace(comparison.base, residual=10.0 * comparison.base.residual)
    comparison = replace(comparison, nominal=bodies, parameters=bodies)
    decision = replace(decide(equations, comparison), model=model, excess=np.zeros(1), unknown=())
    contrasts = certainty.Contrasts(equations, model)
    chances = certainty.probabilities(equations, comparison, decision, contrasts)
    assert scale.counts(model)
    assert (chances.of(model, 0) <= DOUBTED) is is_doubted


@pytest.mark.parametrize(('name', 'ripple', 'is_doubted'), [
    ('quadratic_drag', 0.0, False), ('quadratic_drag', 0.8, True),
    ('viscous_friction', 0.8, False),
])  # fmt: skip
def test_a_rare_law_beside_what_counts_as_physics_is_doubted(
    equations_for, name, ripple, is_doubted
):
    """A ripple that no law here describes may bend it; friction is there in any case."""

    def force(_t, q, v):
        drag = 1.5 * v[0] if name == 'viscous_friction' else 0.2 * abs(v[0]) * v[0]
        return (ripple * math.sin(5.0 * q[0]) - drag,)

    _, equations = equations_for(simulate(CHAINS[1], 4, 10.0, force=force))
    model = fitted(equations, name)
    left = physics_left(equations, model, ())
    assert bool(left[0] > LEAST_SHARE) is (ripple > 0.0)
    finding = Finding('joint0', name, {}, Location(), 9.0, 0.99, 0.9, '')
    found = doubted_beside(finding, model.effects[0], left)
    assert (found.probability == DOUBTED) is is_doubted
    assert ('counts as physics' in found.why) is is_doubted
    assert found is finding or is_doubted
    assert physics_left(equations, model, (0,))[0] == 0.0
    comparison = _comparison(equations, model)
    decision = replace(decide(equations, comparison), model=model, excess=np.zeros(1), unknown=())
    chances = Probabilities({s.key: 0.99 for s in model.effects}, np.zeros(1), None)
    (said,), _ = asserted(equations, decision, (), (), chances, ())
    assert ('counts as physics' in said.why) is is_doubted


@pytest.mark.parametrize(
    ('name', 'rippled', 'is_doubted'),
    [('coupled_friction', (0,), False), ('coupled_friction', (1,), False),
     ('coupled_friction', (0, 1), True), ('quadratic_drag', (0,), True),
     ('quadratic_drag', (1,), False)],
)  # fmt: skip
def test_a_law_that_says_the_same_at_another_joint_is_not_doubted(
    equations_for, name, rippled, is_doubted
):
    """A motor that turns with two joints rubs on both; at one of them nothing is left."""

    def force(_t, q, v):
        rubs = (2.0 * sum(v),) * 2 if name == 'coupled_friction' else (0.2 * abs(v[0]) * v[0], 0.0)
        return tuple(0.8 * math.sin(5.0 * q[j]) * (j in rippled) - rubs[j] for j in range(2))

    _, equations = equations_for(simulate(CHAINS[2], 4, 10.0, force=force))
    model = fitted(equations, name)
    left = physics_left(equations, model, ())
    assert [bool(x) for x in left] == [j in rippled for j in range(2)]
    comparison = _comparison(equations, model)
    decision = replace(decide(equations, comparison), model=model, excess=np.zeros(2), unknown=())
    chances = Probabilities({s.key: 0.99 for s in model.effects}, np.zeros(2), None)
    (said,), _ = asserted(equations, decision, (), (), chances, ())
    assert ('counts as physics' in said.why) is is_doubted


def test_two_joints_that_rub_are_no_motor_that_turns_with_both(equations_for):
    """With a large ratio that motor rubs on the source, and a little on its own joint."""
    world = simulate(CHAINS[2], 4, 10.0, force=lambda _t, _q, v: (-3.0 * v[0], -0.3 * v[1]))
    _, equations = equations_for(world)
    motor = EffectAt(EFFECTS['coupled_friction'], Place(1, source=0), np.array([10.0]))
    start = np.sqrt((equations.d**2).mean(axis=0))
    model = fit(Columns(equations), (motor,), start, is_free=False)
    scale = Scale.of(equations, _comparison(equations, model))
    plainer = simpler(equations, SimpleNamespace(model=model, rivals=()), scale)
    assert plainer.key == {('viscous_friction', Place(j)) for j in (0, 1)}
    assert scale.worth(plainer) > scale.worth(model)


def test_a_rotor_takes_the_place_of_a_gain_that_is_worth_as_much(equations_for):
    """A motor of half the torque is a motor of twice the inertia, where no gravity tells them."""
    chain = (replace(CHAINS[1][0], inertia=CHAINS[1][0].inertia + 0.05),)
    _, equations = equations_for(simulate(chain, 4, 10.0))
    model = fitted(equations, 'torque_gain')
    alike, better = SimpleNamespace(worth=lambda _: 0.0), SimpleNamespace(worth=_worth_of_gains)
    decision = SimpleNamespace(model=model, rivals=())
    plainer = simpler(equations, decision, alike)
    assert [s.effect.name for s in plainer.effects] == ['armature']
    assert plainer.effects[0].coefficients[0] == pytest.approx(0.05, rel=0.05)
    assert simpler(equations, decision, better) is None


def test_a_law_of_fewer_numbers_that_is_worth_as_much_is_named(equations_for, monkeypatch):
    """The limit of a drive, in place of one that falls with a speed that hardly matters."""
    limit = 4.0
    world = simulate(CHAINS[1], 4, 10.0, motor=lambda u, _now: [min(max(u[-1][0], -limit), limit)])
    _, equations = equations_for(world)
    none = fitted(equations)
    model, rival = (
        fit(Columns(equations), (EffectAt(EFFECTS[name], Place(0), np.array(shape)),), none.sigma)
        for name, shape in (('motor_speed_limit', [4.0, 400.0]), ('saturation', [3.5]))
    )  # fmt: skip
    alike = SimpleNamespace(worth=lambda _: 0.0)
    found = simpler(equations, SimpleNamespace(model=model, rivals=(rival,)), alike)
    assert [s.effect.name for s in found.effects] == ['saturation']
    assert found.effects[0].shape == pytest.approx(rival.effects[0].shape, rel=0.02)
    assert simpler(equations, SimpleNamespace(model=model, rivals=()), alike) is None
    far = SimpleNamespace(worth=lambda m: 2.0 * ALIKE * (m is model))
    assert simpler(equations, SimpleNamespace(model=model, rivals=(rival,)), far) is None
    assert simpler(equations, SimpleNamespace(model=rival, rivals=(model,)), alike) is None
    for name in ('motor_speed_limit', 'saturation'):  # of formulas the best was taken before
        monkeypatch.setattr(EFFECTS[name], 'has_chosen_form', True)
    assert simpler(equations, SimpleNamespace(model=model, rivals=(rival,)), alike) is None


@pytest.mark.parametrize(
    ('excess', 'left', 'opens'),
    [((0.5, 2.0), (1.0, 1.5), True), ((1.5, 2.0), (1.0, 1.5), False),
     ((1.5, 9.0), (1.0, 4.0), True), ((0.5, 0.9), (1.0, 9.0), False)],
)  # fmt: skip
def test_a_model_that_leaves_clearly_more_opens_a_joint(excess, left, opens):
    """Also where the better one leaves some: a relay left 0.7 % of what friction left 6 %."""
    model, fewer = (SimpleNamespace(name=i, mean_square=np.array([x, 1.0]))
                    for i, x in enumerate(left))  # fmt: skip
    scale = SimpleNamespace(excess=lambda m: np.array([excess[m.name], 0.1]))
    assert certainty._opens(scale, model, fewer) is opens


@pytest.mark.parametrize(
    ('spread', 'excess', 'is_plain'), [(0.1, 0.5, True), (0.1, 1.5, False), (0.01, 0.5, False)]
)
def test_friction_whose_growth_with_the_load_may_be_none_is_plain(
    rubbing, monkeypatch, spread, excess, is_plain
):
    """However much better it fits: its numbers say that it may be plain, unless much is left."""
    model = fitted(rubbing, 'load_friction', 'viscous_friction')
    (load,) = (s for s in model.effects if s.name == 'load_friction')
    mu = abs(float(load.report(rubbing.motion)['mu']))
    std = [{'level': 0.01, 'mu': mu * spread / 0.05} if s is load else {'b': 0.1}
           for s in model.effects]  # fmt: skip
    monkeypatch.setattr(simpler_models, 'reported_std', lambda *_: std)
    scale = SimpleNamespace(
        worth=lambda m: 2.0 * ALIKE * (load.key in m.key),
        excess=lambda m: np.full(1, 0.5 if load.key in m.key else excess),
    )
    found = simpler(rubbing, SimpleNamespace(model=model, rivals=()), scale)
    assert (found is not None) is is_plain
    if found is not None:
        assert {s.name for s in found.effects} == {'coulomb_friction', 'viscous_friction'}


def _worth_of_gains(model):
    return 2.0 * ALIKE * any(s.effect.name == 'torque_gain' for s in model.effects)


def test_a_plain_law_takes_the_place_of_a_richer_one_that_is_not_probable(rubbing, monkeypatch):
    """Friction that may differ with direction, or not, is friction."""
    pair = fitted(rubbing, 'viscous_friction', 'asymmetric_coulomb')
    comparison = _comparison(rubbing, fitted(rubbing, 'spring'))
    scale = Scale.of(rubbing, comparison)
    decision = replace(decide(rubbing, comparison), verdict='missing_physics', model=pair)
    p = {'viscous_friction': 0.9, 'coulomb_friction': 0.8, 'asymmetric_coulomb': 0.3}
    chances = Probabilities({(n, Place(0)): x for n, x in p.items()}, np.zeros(1), scale)
    monkeypatch.setattr(certainty, 'probabilities', lambda *_: chances)
    kept, _, _ = settled(rubbing, comparison, decision)
    numbers = {s.name: s.coefficients[0] for s in kept.model.effects}
    assert numbers == pytest.approx({'viscous_friction': 0.3, 'coulomb_friction': 0.5}, rel=0.05)


def test_of_two_models_worth_the_same_the_plainer_is_named(equations_for, monkeypatch):
    """However probable friction that differs with direction is, its second number is none."""
    world = simulate(CHAINS[1], 4, 10.0, dry=lambda t, q, s: 0.5)
    _, equations = equations_for(world)
    richer, other = (fitted(equations, n) for n in ('asymmetric_coulomb', 'coulomb_friction'))
    comparison = _comparison(equations, richer, other)
    scale = Scale.of(equations, comparison)
    assert abs(scale.worth(richer) - scale.worth(other)) < ALIKE
    decision = replace(decide(equations, comparison), verdict='missing_physics', model=richer)
    chances = Probabilities({richer.effects[0].key: 0.99}, np.zeros(1), scale)
    monkeypatch.setattr(certainty, 'probabilities', lambda *_: chances)
    kept, _, _ = settled(equations, comparison, decision)
    assert [s.name for s in kept.model.effects] == ['coulomb_friction']
    assert kept.rivals[0] is richer


def test_an_improbable_law_is_none_where_bodies_leave_no_physics(
    equations_for, viscous, monkeypatch
):
    """Alone it stays only where something counts that it may stand for."""
    _, equations = equations_for(viscous)
    model = fitted(equations, 'viscous_friction')
    comparison = _comparison(equations, model)
    decision = decide(equations, comparison)
    for left, verdict in ((0.9 * LEAST_SHARE, 'parameters_only'), (0.1, 'missing_physics')):
        scale = replace(Scale.of(equations, comparison), base=np.array([left]))
        chances = Probabilities({model.effects[0].key: 0.45}, np.zeros(1), scale)
        monkeypatch.setattr(certainty, 'probabilities', lambda *_, now=chances: now)
        assert settled(equations, comparison, decision)[0].verdict == verdict


def test_a_finding_too_small_to_count_is_doubted(equations_for, viscous):
    """A rotor that keeps bodies where they are is in the model, and makes no verdict unsure."""
    _, equations = equations_for(viscous)
    finding = Finding(
        'joint0', 'armature', {'inertia': Parameter(0.1, 0.001, 'kg m2')}, Location(), 1.0, 0.99,
        0.5 * COUNTED_SHARE,
    )  # fmt: skip
    doubted = doubted_if_none(finding, EffectAt(EFFECTS['armature'], Place(0)))
    assert doubted.probability <= DOUBTED
    assert 'too small' in doubted.why
    sure = replace(finding, effect='spring', share=0.1, probability=0.97)
    assert certainty_of([doubted, sure], _comparison(equations)) == 0.97


@pytest.mark.parametrize(
    ('change', 'step', 'is_doubted'),
    [(-0.06, 0.005, True), (-0.06, 0.0004, False), (0.06, 0.005, False)],
)
def test_friction_that_a_drive_takes_off_by_acting_late_is_doubted(change, step, is_doubted):
    """By kp times the lag, which is part of a sample; not friction that is there."""
    one = np.ones((1, 1))
    drive = Servo(None, step, (0,), 110.0 * one[0], one[0], one, one, one)
    known = {'b': Parameter(change, 0.001, 'N m s/rad')}
    finding = Finding('joint0', 'viscous_friction', known, Location(), 1.0, 0.99, 0.1)
    s = EffectAt(EFFECTS['viscous_friction'], Place(0), coefficients=np.array([change]))
    doubted = doubted_if_late(finding, s, SimpleNamespace(drive=drive, step=step))
    assert (doubted.probability <= DOUBTED) is is_doubted
    assert ('0.55 ms old' in doubted.why) is is_doubted
    effort = SimpleNamespace(drive=None, step=step)
    assert doubted_if_late(finding, s, effort) is finding


@pytest.mark.parametrize(('std', 'is_doubted'), [(0.3, True), (0.2, False), (0.05, False)])
def test_a_drift_without_a_known_change_is_doubted(std, is_doubted):
    """Its end may be the start, or none; where both are there for certain friction is, too."""
    known = {'start': Parameter(0.8, 0.05, 'N m'), 'end': Parameter(0.4, std, 'N m')}
    finding = Finding('joint0', 'friction_drift', known, Location(), 1.0, 0.97, 0.1)
    place = Place(0, kind='coulomb')
    doubted = doubted_if_none(finding, EffectAt(EFFECTS['friction_drift'], place))
    assert (doubted.probability <= DOUBTED) is is_doubted
    assert ('sets it apart' in doubted.why) is is_doubted


@pytest.mark.parametrize(
    ('named', 'unknown', 'expected'),
    [((0.99, 0.96), (), 0.96), ((0.99,), (0.9,), 0.99), ((), (0.7, 0.9), 0.9)],
)
def test_a_verdict_is_as_certain_as_the_least_that_it_rests_on(
    equations_for, viscous, named, unknown, expected
):
    """Beside named effects an unknown one of another joint is no reason for the verdict."""
    _, equations = equations_for(viscous)
    findings = [
        Finding('joint0', effect, {}, Location(), 0.0, p, 0.1)
        for effect, chances in (('spring', named), (UNKNOWN, unknown))
        for p in chances
    ]
    assert certainty_of(findings, _comparison(equations)) == expected
    if unknown:  # where most is unknown, the verdict does not rest on what stands beside it
        likely = certainty_of(findings, _comparison(equations), verdict='unexplained')
        assert likely == max(unknown)


@pytest.mark.parametrize(('std', 'is_doubted'), [(0.002, False), (0.006, True), (None, False)])
def test_an_encoder_that_may_be_centred_is_doubted(std, is_doubted):
    """An amplitude of 0.01 rad, with 95 % intervals that leave zero out or hold it."""
    law = EFFECTS['encoder_eccentricity']
    numbers = {'amplitude': 0.01, 'periods': 1.0, 'phase': 0.3}
    found = {
        name: Parameter(x, std if name == 'amplitude' else 0.1) for name, x in numbers.items()
    }
    finding = Finding('elbow', law.name, found, Location(), 30.0, 0.9, 0.1, law.formula)
    doubted = doubted_if_none(finding, EffectAt(law, Place(0)))
    assert (doubted.probability, bool(doubted.why)) == (
        (0.4, True) if is_doubted else (0.9, False)
    )


@pytest.mark.parametrize(('is_chosen', 'std', 'expected'), [
    (False, 0.3, 0.9), (True, 0.3, 0.4), (True, 0.1, 0.9),
])  # fmt: skip
def test_a_form_of_which_a_part_may_be_none_is_doubted(is_chosen, std, expected):
    """A shorter one would do; of a listed law one number is enough."""
    law = copy(EFFECTS['asymmetric_coulomb'])
    law.has_chosen_form = is_chosen
    found = {'level_pos': Parameter(5.0, 0.1), 'level_neg': Parameter(0.4, std)}
    finding = Finding('elbow', law.name, found, Location(), 30.0, 0.9, 0.1, law.formula)
    assert doubted_if_none(finding, EffectAt(law, Place(0))).probability == expected


def test_a_gain_is_none_at_one():
    """Its size is measured from there."""
    law = EFFECTS['torque_gain']
    for gain, expected in ((1.05, 0.4), (1.5, 0.9)):
        found = {'gain': Parameter(gain, 0.05)}
        finding = Finding('elbow', law.name, found, Location(), 30.0, 0.9, 0.1, law.formula)
        assert doubted_if_none(finding, EffectAt(law, Place(0))).probability == expected


@pytest.mark.parametrize(
    ('in_doubt', 'named', 'is_doubted'),
    [
        (('wrist',), ('elbow',), False),
        (('wrist',), ('elbow', 'wrist'), True),
        (('wrist',), (), True),  # that nothing is missing says something of all joints
        (('wrist',), ('base',), True),
        ((), ('elbow', 'base'), False),
    ],
)
def test_a_verdict_rests_on_the_joints_it_names(in_doubt, named, is_doubted):
    """And only findings there are doubted."""
    findings = [Finding(j, 'spring', {}, Location(), 0.0, 0.99, 0.1) for j in named]
    findings.append(Finding('wrist', UNKNOWN, {}, Location(), 0.0, 0.3, 0.1))
    assert rests_on(in_doubt, findings, ('elbow', 'wrist')) is is_doubted
    for f in doubted(findings[:-1], in_doubt, ('elbow', 'wrist')):
        rests = f.joint in in_doubt or (f.joint == 'base' and in_doubt)
        assert f.probability == (DOUBTED if rests else 0.99)
