"""Models that are asserted, and models that are not although they fit."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.criteria import (
    COUNTED_SHARE,
    EVIDENCE,
    LEAST_SHARE,
    SHARE_TOLERANCE,
    SLIGHT_REST,
    UNNAMED_EXCESS,
)
from sgp_ros.diagnosis.decide import decision
from sgp_ros.diagnosis.decide.decision import _opened, _passed_on, decide
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import added_inertia, fit
from sgp_ros.diagnosis.explain.comparison import Comparison, compare_models
from sgp_ros.diagnosis.explain.credibility import is_sound
from sgp_ros.diagnosis.explain.fitted_model import floors
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from sgp_ros.rigid.rigid_body import mass_matrix
from test.diagnosis.fitted_models import fitted, with_coefficients
from test.diagnosis.worlds import CHAINS, events_of, robot_of, simulate


def _comparison(equations, *models):
    bases = (fitted(equations, is_free=f) for f in (False, True))
    return Comparison(*bases, tuple(m for m in models if m), ())


@pytest.fixture(scope='module')
def damped(equations_for, viscous):
    return equations_for(viscous)[1]


def test_where_likely_bodies_leave_too_little_no_effect_is_asserted(equations_for, heavy):
    """However much it gains: the bodies of the file and a law may be alike a little better."""
    _, equations = equations_for(heavy[1])
    gain, bodies = fitted(equations, 'torque_gain'), fitted(equations, is_free=True)
    part = np.sqrt(0.5 * SLIGHT_REST * equations.power)
    comparison = Comparison(
        fitted(equations), replace(bodies, residual=bodies.residual + part),
        (replace(gain, residual=0.0 * gain.residual, score=1e6),), (),
    )  # fmt: skip
    assert comparison.is_calm
    assert decide(equations, comparison).verdict == 'parameters_only'


def test_an_effect_that_explains_all_is_asserted(damped):
    right, wrong = fitted(damped, 'viscous_friction'), fitted(damped, 'spring')
    decision = decide(damped, _comparison(damped, wrong, right))
    assert decision.verdict == 'missing_physics'
    assert decision.model is right
    assert wrong not in decision.rivals[:1] or decision.excess.max() < 0.5


def test_among_equal_fits_the_simpler_is_asserted(damped):
    """The richer model leaves no more, and loses."""
    simple = fitted(damped, 'viscous_friction')
    rich = fitted(damped, 'viscous_friction', 'quadratic_drag')
    assert rich.mean_square[0] <= simple.mean_square[0] * (1.0 + 1e-9)
    assert decide(damped, _comparison(damped, rich, simple)).model is simple


@pytest.mark.parametrize(('seen', 'counts'), [(2.0, True), (0.5, False)])
def test_a_force_above_the_band_counts_only_as_far_as_it_is_seen(damped, seen, counts):
    """A ripple that is filtered away but for what is adequate in any case (2 and half of it)."""
    model = fitted(damped, 'cogging')
    part = np.sqrt(seen * SLIGHT_REST / model.filtered_shares[0])
    model = replace(model, parts=tuple(part * x for x in model.parts))
    model.__dict__['shares'] = [2.0 * COUNTED_SHARE]
    assert Scale.is_large(model) is counts


def test_what_leaves_much_is_not_asserted(damped):
    """A spring where friction is missing: nothing adequate is there, on joint 0."""
    decision = decide(damped, _comparison(damped, fitted(damped, 'spring')))
    assert decision.verdict == 'unexplained'
    assert decision.worst == 0


def test_an_effect_too_small_to_be_physics_is_not_asserted(equations_for):
    """It is significant by far, and makes less than the schema counts."""
    world = simulate(CHAINS[1], 3, 10.0, force=lambda t, q, v: (-0.02 * v[0],))
    _, equations = equations_for(world)
    small = fitted(equations, 'viscous_friction')
    comparison = _comparison(equations, small)
    assert small.score > comparison.base.score + EVIDENCE
    assert small.shares[0] < SHARE_TOLERANCE * LEAST_SHARE
    decision = decide(equations, comparison)
    assert decision.verdict in {'no_mismatch', 'parameters_only'}
    assert decision.model is comparison.base


def test_noise_of_the_effort_leaves_an_adequate_model(damped):
    """White noise that is a tenth of what friction makes is no physics; a pattern is."""
    right = fitted(damped, 'viscous_friction')
    discrepancy = damped.d.std()
    noise = 0.3 * discrepancy * np.random.default_rng(0).normal(size=damped.d.shape)
    noisy = replace(damped, d=damped.d + noise)
    decision = decide(noisy, _comparison(noisy, fitted(noisy, 'viscous_friction')))
    assert decision.verdict == 'missing_physics'
    q = damped.motion.position[damped.filter.rows]
    wavy = replace(damped, d=damped.d + 0.4 * discrepancy * np.sin(5.0 * q))
    decision = decide(wavy, _comparison(wavy, fitted(wavy, 'viscous_friction')))
    assert decision.verdict == 'unexplained'
    assert right.mean_square[0] < 1e-3 * discrepancy**2


def test_noise_alone_is_not_unexplained(equations_for, perfect):
    """It leaves more than counts as physics, and nothing predicts it."""
    _, equations = equations_for(perfect[1])
    rng = np.random.default_rng(1)
    noise = 0.1 * np.sqrt(equations.power) * rng.normal(size=equations.d.shape)
    noisy = replace(equations, d=equations.d + noise)
    assert decide(noisy, _comparison(noisy)).verdict in {'no_mismatch', 'parameters_only'}


def test_effects_that_cancel_each_other_do_not_count(damped):
    model = fitted(damped, 'viscous_friction', 'quadratic_drag')
    (net,) = [sum(model.forces)]
    opposed = replace(model, parts=(10.0 * net, -9.0 * net))
    agreeing = replace(model, parts=(0.5 * net, 0.5 * net))
    opposed.__dict__['shares'] = agreeing.__dict__['shares'] = [1.0, 1.0]
    assert opposed.net_share == pytest.approx(agreeing.net_share)
    assert is_sound(agreeing)
    assert not is_sound(opposed)


def test_a_share_is_measured_before_the_filter(equations_for):
    """A ripple above the cut-off is physics too."""
    world = simulate(CHAINS[1], 6, 10.0, force=lambda t, q, v: (-0.3 * v[0],))
    _, equations = equations_for(world)
    at = EFFECTS['cogging'].starts(equations.motion, Place(0))[0]
    start = np.sqrt((equations.d**2).mean(axis=0) + floors(equations))
    ripple = EffectAt(EFFECTS['cogging'], Place(0), np.full_like(at, 150.0))
    model = fit(Columns(equations), (ripple,), start, is_free=False, rounds=1, steps=1)
    loud = with_coefficients(model, np.array([1.0, 0.0]))
    assert loud.shares[0] > 0.05
    assert loud.filtered_shares[0] < 0.2 * loud.shares[0]


def test_more_than_two_effects_are_found_where_joints_lack_several(equations_for):
    """Three effects on two joints, found by the search joint by joint."""
    world = simulate(
        CHAINS[2], 7, 12.0,
        force=lambda t, q, v: (-1.5 * v[0] - 0.8 * abs(v[0]) * v[0], -0.8 * v[1]),
    )  # fmt: skip
    _, equations = equations_for(world)
    comparison = compare_models(equations, lambda _share: None)
    found = {(s.effect.name, s.place.joint) for m in comparison.more for s in m.effects}
    decision = decide(equations, comparison)
    asserted = {(s.effect.name, s.place.joint) for s in decision.model.effects}
    truth = {('quadratic_drag', 0), ('viscous_friction', 0), ('viscous_friction', 1)}
    assert truth <= found
    assert asserted == truth


@pytest.mark.long
@pytest.mark.parametrize('mass', [1.0, 2.0])
def test_a_load_is_found_beside_friction_of_all_joints(equations_for, mass):
    """More than the last link weighs: bodies that may differ would stand for it, or for a part.

    The inertia that the efforts show is that of the load too, and so is what a perfect model
    leaves: the friction of the wrist stays above it.
    """
    first, last = CHAINS[2]
    whole, tip = last.mass + mass, 0.35
    centre = (last.mass * last.centre + mass * tip) / whole
    about = last.inertia + last.mass * (last.centre - centre) ** 2 + mass * (tip - centre) ** 2
    loaded = replace(last, mass=whole, centre=centre, inertia=about)
    world = simulate(
        (first, loaded), 1, 12.0, reach=1.5,
        force=lambda t, q, v: (-1.5 * v[0] - 0.5 * math.tanh(100.0 * v[0]),
                               -0.4 * v[1] - 0.3 * math.tanh(100.0 * v[1])),
    )  # fmt: skip
    _, equations = equations_for(world)
    model = decide(equations, compare_models(equations, lambda _share: None)).model
    found = {(s.name, s.place.joint): s.report(equations.motion) for s in model.effects}
    friction = {(f'{kind}_friction', j) for kind in ('viscous', 'coulomb') for j in (0, 1)}
    assert set(found) == {('payload', 1), *friction}
    assert found['payload', 1]['mass'] == pytest.approx(mass, rel=0.01)
    assert found['payload', 1]['z'] == pytest.approx(-tip, rel=0.01)


def test_what_leaves_next_to_nothing_is_adequate_whatever_it_explained(damped):
    """A rest that is no physics condemns no model, though there was little to explain."""
    comparison = _comparison(damped, fitted(damped, 'viscous_friction'))
    scale, (model,) = Scale.of(damped, comparison), comparison.singles
    small = replace(scale, base=10.0 * model.left, nominal=10.0 * model.left)
    assert small.rest(model) > 0.05
    assert small.excess(model).max() < 0.1


def test_few_rows_tell_less(damped):
    """A recording of fewer rows than count as independent weighs a fit by what it has."""
    comparison = _comparison(damped, fitted(damped, 'viscous_friction'))
    few = replace(damped, d=damped.d[:40])
    whole, part = (Scale.of(e, comparison) for e in (damped, few))
    (model,) = comparison.singles
    gains = [s.fit(model) - s.fit(comparison.nominal) for s in (whole, part)]
    assert gains[1] == pytest.approx(gains[0] * 40.0 / whole.rows)


def test_no_larger_effect_takes_the_place_of_a_better_one_that_is_too_small(damped):
    small = fitted(damped, 'viscous_friction')
    large = fitted(damped, 'viscous_friction', 'quadratic_drag')
    small.__dict__['shares'], large.__dict__['shares'] = [0.1 * LEAST_SHARE], [1.0, 1.0]
    comparison = _comparison(damped, small, large)
    scale = Scale.of(damped, comparison)
    assert scale.worth(small) > scale.worth(large)
    assert scale.excess(large).max() < 1.0
    assert decide(damped, comparison).verdict != 'missing_physics'


def test_a_law_that_couples_nothing_hides_no_law_of_a_joint(damped):
    """Its size is that of all it says, though only what no plain law says counts of it."""
    imitation, plain = fitted(damped, 'viscous_friction'), fitted(damped, 'quadratic_drag')
    (s,) = imitation.effects
    coupled = replace(imitation, effects=(replace(s, place=replace(s.place, source=0)),))
    coupled.__dict__['shares'] = [0.0]
    comparison = _comparison(damped, coupled, plain)
    scale = Scale.of(damped, comparison)
    assert scale.worth(coupled) > scale.worth(plain)
    decision = decide(damped, comparison)
    assert plain in (decision.model, decision.tentative)


@pytest.fixture(scope='module')
def half_known(equations_for):
    """Two joints: friction on the second, and on the first a push that no law describes."""
    world = simulate(
        CHAINS[2], 7, 12.0,
        force=lambda t, q, v: (6.0 * math.sin(9.0 * t + 1.0), -0.2 * v[1]),
    )  # fmt: skip
    return equations_for(world)[1]


def test_what_is_known_of_a_joint_stands_beside_a_larger_unknown(half_known):
    comparison = compare_models(half_known, lambda _share: None)
    decision = decide(half_known, comparison)
    assert decision.verdict == 'unexplained'
    assert decision.unknown == (0,)
    assert {(s.name, s.place.joint) for s in decision.model.effects} == {('viscous_friction', 1)}
    assert decision.model.effects[0].coefficients[0] == pytest.approx(0.2, rel=0.01)


def test_a_law_of_two_joints_is_unknown_where_one_of_them_is():
    """It acts on both, and what is unknown there would undo it; one that acts on one stands."""

    def excess(source, acts_on_it):
        law = SimpleNamespace(place=Place(0, source=source))
        force = np.array([[1.0, float(acts_on_it), 0.0]])
        model = SimpleNamespace(effects=(law,), forces=(force,))
        return _passed_on(model, np.array([0.1, 3.0, 0.2])).tolist()

    assert excess(1, acts_on_it=True) == [UNNAMED_EXCESS, 3.0, 0.2]
    assert excess(1, acts_on_it=False) == [0.1, 3.0, 0.2]
    assert excess(2, acts_on_it=True) == [0.1, 3.0, 0.2]
    assert excess(-1, acts_on_it=True) == [0.1, 3.0, 0.2]


def test_friction_of_two_joints_goes_where_one_is_unknown(half_known):
    place, law = Place(1, source=0), EFFECTS['coupled_friction']
    start = law.starts(half_known.motion, place)[0]
    base = fitted(half_known)
    model = fit(Columns(half_known), (EffectAt(law, place, start),), base.sigma, is_free=False)
    comparison = _comparison(half_known, model)
    scale = Scale.of(half_known, comparison)
    found = _opened(half_known, scale, comparison, model, (), np.array([3.0, 0.1]))
    assert set(found.unknown) == {0, 1}
    assert found.model.effects == ()


def test_small_everyday_laws_stand_beside_larger_ones(equations_for):
    """Two laws of one joint leave little; the friction of the other is worth it all the same."""
    world = simulate(
        CHAINS[2], 8, 12.0,
        force=lambda t, q, v: (-0.5 * v[0] - 0.4 * math.tanh(50.0 * v[0]), -0.005 * v[1]),
    )  # fmt: skip
    equations = equations_for(world)[1]
    comparison = compare_models(equations, lambda _share: None)
    best = max(comparison.more, key=lambda m: m.score)
    assert ('viscous_friction', 1) in {(s.name, s.place.joint) for s in best.effects}


def test_a_joint_is_judged_by_what_there_was_to_explain_there(half_known):
    """However much a law explains at another one."""
    law, start = EffectAt(EFFECTS['viscous_friction'], Place(1)), np.ones(2)
    model = fit(Columns(half_known), (law,), start)
    scale = Scale.of(half_known, _comparison(half_known, model))
    scale = replace(scale, base=np.array([model.left[0], 1e3]))
    assert scale.excess(model)[0] > 10.0
    assert scale.excess(model)[1] < 1.0


def test_the_worst_joint_is_one_that_is_not_described(half_known):
    """Not one of which more was explained."""
    model = fitted(half_known, 'viscous_friction')
    comparison = _comparison(half_known, model)
    scale = replace(Scale.of(half_known, comparison), base=np.array([0.1, 5.0]))
    found = _opened(half_known, scale, comparison, model, (), np.array([3.0, 0.0]))
    assert (found.verdict, found.worst, found.unknown) == ('unexplained', 0, (0,))


def test_what_is_known_stands_beside_bodies_that_can_be(half_known, monkeypatch):
    """Other bodies would imitate what is unknown at the other joint, with masses below zero."""
    model = fitted(half_known, 'viscous_friction', is_free=True)
    friction = EffectAt(EFFECTS['viscous_friction'], Place(1))
    model = fit(Columns(half_known), (*model.effects, friction), model.sigma, is_free=True)
    for can_be, is_free in ((True, True), (False, False)):
        monkeypatch.setattr(decision, 'is_credible', lambda m, can=can_be: can or not m.is_free)
        known = decision._described(half_known, model, np.array([0]))
        assert [(s.name, s.place.joint) for s in known.effects] == [('viscous_friction', 1)]
        assert known.is_free is is_free


def test_noise_of_the_acceleration_makes_no_rotor_large(equations_for):
    """Coarse encoders: above the cut-off a rotor would follow their noise."""
    world = simulate(CHAINS[1], 3, 10.0)
    _, equations = equations_for(world, quantum=2e-3)
    model = fitted(equations, 'armature')
    force = model.effects[0].effect.columns(equations.motion, Place(0), np.zeros(0))
    raw = float(np.mean((force @ model.effects[0].coefficients) ** 2) / equations.power[0])
    assert model.shares[0] == pytest.approx(model.filtered_shares[0])
    assert raw > 2.0 * model.shares[0]


def test_a_weak_motor_and_heavy_bodies_fit_alike(tmp_path):
    """Half of the effort, or twice the inertia and weight: what is left of the motion is equal."""
    (link,) = CHAINS[1]
    chain = (replace(link, damping=0.0),)
    world = simulate(
        chain, 6, 10.0, motor=lambda commands, t: (0.5 * commands[-1][0],),
        force=lambda t, q, v: (0.1 * math.sin(37.0 * t),),
    )  # fmt: skip
    robot, tree = robot_of(tmp_path, chain)
    raw = collect(events_of(world), robot)
    equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
    weak, heavy = fitted(equations, 'torque_gain'), fitted(equations, is_free=True)
    scale = Scale.of(equations, _comparison(equations, weak))
    prior = 0.5 * float(heavy.w @ heavy.w)
    assert heavy.log_inertia == pytest.approx(math.log(2.0), abs=0.05)
    assert weak.log_inertia == 0.0
    assert heavy.mean_square[0] > 3.0 * weak.mean_square[0]
    assert scale.fit(heavy) + prior == pytest.approx(scale.fit(weak), abs=5.0)


def test_a_load_and_a_heavier_body_have_the_same_inertia(equations_for):
    """A point mass adds to the mass matrix as its body parameters do."""
    _, equations = equations_for(simulate(CHAINS[2], 2, 6.0))
    load = EffectAt(EFFECTS['payload'], Place(1), np.array([0.4, 0.0, 0.0, -0.2]), np.ones(1))
    rotor = EffectAt(EFFECTS['armature'], Place(0), coefficients=np.array([0.03]))
    added = added_inertia((load, rotor), equations)
    tree, q = equations.motion.tree, equations.poses[0].position
    heavier = tree.parameters.copy()
    heavier[1] += 0.4 * np.array([1.0, 0.0, 0.0, -0.2, 0.04, 0.0, 0.04, 0.0, 0.0, 0.0])
    wanted = mass_matrix(tree, heavier, q) - mass_matrix(tree, tree.parameters, q)
    np.testing.assert_allclose(added, wanted + np.diag([0.03, 0.0]), atol=1e-12)


def test_what_nearly_every_joint_has_may_be_small_beside_others(damped):
    """Another law that is too small to be physics may not."""

    def large(*sized):
        model = fitted(damped, *(name for name, _ in sized))
        model.__dict__['shares'] = [share for _, share in sized]
        return Scale.is_large(model)

    little, much = 0.1 * COUNTED_SHARE, 10.0 * COUNTED_SHARE
    assert large(('viscous_friction', much), ('armature', little))
    assert not large(('viscous_friction', much), ('quadratic_drag', little))
    assert not large(('viscous_friction', little), ('armature', little))


@pytest.mark.parametrize(('part', 'verdict'), [(0.02, 'parameters_only'), (0.04, 'unexplained')])
def test_bodies_may_leave_a_small_part_of_what_they_explain(damped, part, verdict):
    """More than counts as physics where they explain little; signals err in proportion."""
    nominal, bodies = (fitted(damped, is_free=f) for f in (False, True))
    q = damped.motion.position[damped.filter.rows]
    wave = np.sin(5.0 * q) / np.sin(5.0 * q).std()
    discrepancy = np.sqrt(damped.power) * np.ones_like(wave)
    nominal = replace(nominal, residual=discrepancy)
    left = replace(bodies, residual=np.sqrt(part * damped.power) * wave)
    assert left.left.max() > LEAST_SHARE
    assert decide(damped, Comparison(nominal, left, (), ())).verdict == verdict


def test_bodies_that_leave_next_to_nothing_leave_no_law(damped):
    """Unless they are so unlikely that they stand for one."""
    law = fitted(damped, 'viscous_friction')
    nominal, bodies = (fitted(damped, is_free=f) for f in (False, True))
    slight = replace(bodies, residual=1e-3 * bodies.residual, score=law.score - 2.0 * EVIDENCE)
    calm = decide(damped, Comparison(nominal, slight, (law,), ()))
    assert calm.verdict == 'parameters_only'
    strained = replace(slight, w=np.full_like(bodies.w, 30.0))
    assert decide(damped, Comparison(nominal, strained, (law,), ())).verdict == 'missing_physics'
