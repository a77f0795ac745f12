"""Selection of effects joint by joint."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.criteria import (
    COUNTED_SHARE,
    EVIDENCE,
    INDEPENDENT_ROWS,
    PER_EFFECT,
    PER_UNUSUAL,
    SLIGHT_REST,
)
from sgp_ros.diagnosis.decide.support import support
from sgp_ros.diagnosis.explain import growth, joint_search
from sgp_ros.diagnosis.explain.candidates import fit, split
from sgp_ros.diagnosis.explain.credibility import gain, is_credible
from sgp_ros.diagnosis.explain.fitted_model import beyond_plain, first_scale, floors
from sgp_ros.diagnosis.explain.frame import Frame
from sgp_ros.diagnosis.explain.growth import (
    Block,
    crossed,
    elsewhere,
    grown,
    in_common,
    two_for_one,
)
from sgp_ros.diagnosis.explain.joint_search import (
    built_up,
    by_joint,
    coupled,
    large,
    richer,
    uncoupled,
    usual,
)
from sgp_ros.diagnosis.explain.more_effects import _carrying
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import are_apart, distinct, screen
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt, one_of_each
from sgp_ros.physics.place import PLACES, Place, joint_name
from test.diagnosis.worlds import CHAINS, heavier, recorded, simulate
from test.simulation.trees import arm

TRUTH = {('viscous_friction', 0), ('spring', 0), ('viscous_friction', 1)}


@pytest.fixture(scope='module')
def equations(equations_for):
    """Two joints, of which one lacks two laws and the other one."""
    world = simulate(
        CHAINS[2], 7, 10.0,
        force=lambda t, q, v: (-4.0 * (q[0] - 0.3) - 1.5 * v[0], -0.8 * v[1]),
    )  # fmt: skip
    return equations_for(world)[1]


def _start(equations):
    sigma = np.sqrt((equations.d**2).mean(axis=0) + floors(equations))
    columns = Columns(equations)
    return columns, fit(columns, (), sigma, is_free=True)


def _keys(model):
    return {(s.name, s.place.joint) for s in model.effects}


def _pair(equations):
    columns, base = _start(equations)
    pair = tuple(EffectAt(EFFECTS[n], Place(0)) for n in ('spring', 'viscous_friction'))
    return columns, fit(columns, pair, base.sigma, is_free=True)


def test_every_joint_gets_the_laws_that_it_lacks(equations):
    """Laws that the best pair lacks are added at their joint, and nothing beside them."""
    columns, pair = _pair(equations)
    found, *rivals = by_joint(columns, pair)
    assert _keys(found) == TRUTH
    assert all(gain(rival, found) <= 0.0 for rival in rivals)
    assert any(len(rival.effects) < len(found.effects) for rival in rivals)


def test_searches_that_meet_look_once(monkeypatch, equations):
    """From the laws that a search ended with, another one ends without a fit of candidates."""
    columns = Columns(equations)
    found, *_ = by_joint(columns, fit(columns, (), first_scale(equations)))
    monkeypatch.setattr(joint_search, 'grown', None)  # nothing is looked at
    assert by_joint(columns, found) == []
    apart = replace(found, sigma=1.1 * found.sigma)
    with pytest.raises(TypeError):
        by_joint(columns, apart)
    with pytest.raises(TypeError):
        by_joint(Columns(equations), found)


def test_each_joint_takes_its_laws_from_the_model_that_describes_it_best(equations):
    """Of two models, each right at one joint; and nothing from one that is nowhere better."""
    columns, base = _start(equations)

    def model(*laws):
        effects = tuple(EffectAt(EFFECTS[n], Place(j)) for n, j in laws)
        return fit(columns, effects, base.sigma, is_free=True)

    first = model(('spring', 0), ('viscous_friction', 0), ('spring', 1))
    second = model(('coulomb_friction', 0), ('viscous_friction', 1))
    right = crossed(columns, first, [first, second])
    assert _keys(right) == TRUTH
    assert crossed(columns, right, [first, second, right]) is right


def test_what_is_not_worth_its_price_is_taken_out(equations):
    columns, pair = _pair(equations)
    wave = next(c for _, c in screen(columns, pair, [EFFECTS['cogging']], (0,)))
    rich = fit(columns, (*pair.effects, wave), pair.sigma, is_free=True)
    found, *_ = by_joint(columns, rich)
    assert _keys(found) == TRUTH


def test_a_rare_law_that_is_too_small_goes_and_takes_nothing_with_it(equations):
    columns, pair = _pair(equations)
    wave = next(c for _, c in screen(columns, pair, [EFFECTS['cogging']], (0,)))
    rich = fit(columns, (*pair.effects, wave), pair.sigma, is_free=True)
    assert rich.shares[-1] < COUNTED_SHARE
    found = large(columns, rich)
    assert found.key == pair.key
    assert large(columns, found) is found


def test_a_law_that_another_makes_superfluous_becomes_plain(equations_for):
    """A torque constant takes the place of a load, and friction need not differ with direction.

    Of a law that is new no plain one is made: it is tried by itself.
    """
    world = simulate(
        CHAINS[1], 4, 10.0, dry=lambda t, q, s: 0.5, force=lambda t, q, v: (-0.3 * v[0],)
    )
    columns = Columns(equations_for(world)[1])
    richer, viscous = (EffectAt(EFFECTS[n], Place(0)) for n in (
        'asymmetric_coulomb', 'viscous_friction'))  # fmt: skip
    model = fit(columns, (richer,), np.ones(1))
    trial = growth.refitted(columns, model, ((richer,), 0), viscous)
    assert [s.name for s in trial.effects] == ['viscous_friction', 'coulomb_friction']
    assert is_credible(trial)
    new = growth.refitted(columns, model, ((viscous,), 0), richer)
    assert [s.name for s in new.effects] == ['viscous_friction', 'asymmetric_coulomb']


def test_a_gain_is_what_the_other_way_loses(equations):
    columns, base = _start(equations)
    (_, best), *_ = screen(columns, base, EFFECTS.values())
    trial = fit(columns, (best,), base.sigma, is_free=True)
    assert gain(trial, base) == pytest.approx(-gain(base, trial))
    assert gain(trial, base) > 0.0


def test_effects_that_stay_keep_their_shapes_and_are_fitted_with_the_others(equations):
    columns, base = _start(equations)
    wrong = [c for _, c in screen(columns, base, [EFFECTS['cogging']])][:2]
    model = fit(columns, tuple(wrong), base.sigma, is_free=True, still=1)
    np.testing.assert_array_equal(model.effects[0].shape, wrong[0].shape)
    assert np.abs(model.effects[1].shape - wrong[1].shape).max() > 0.0


def test_a_screened_gain_is_that_of_the_fit(equations):
    """The products give what least squares with all columns gives."""
    columns, base = _start(equations)
    laws = [EFFECTS[n] for n in ('viscous_friction', 'spring', 'joint_coupling')]
    for promised, candidate in screen(columns, base, laws)[:6]:
        if len(candidate.shape):
            continue
        frame = Frame.of(equations, base.sigma, is_free=True)
        y, A, _ = split(frame, columns, (candidate,), base.w)
        left = y - A @ np.linalg.lstsq(A, y, rcond=None)[0]
        before, after = (frame.by_joint(r) + floors(equations) for r in (y, left))
        expected = 0.5 * len(equations.d) * np.log(before / after).sum()
        size = columns.of(candidate, equations).shape[-1]
        expected -= 0.5 * size * np.log(len(equations.d))
        assert promised == pytest.approx(expected, rel=1e-6)


def test_a_joint_is_screened_alone(equations):
    columns, base = _start(equations)
    found = screen(columns, base, EFFECTS.values(), (1,))
    assert {candidate.place.joint for _, candidate in found} == {1}


def test_friction_that_couples_nothing_is_that_of_each_joint(equations):
    """Friction of two joints alone is no coupling, and their own laws are its rival."""
    columns, base = _start(equations)
    coupled, place = EFFECTS['coupled_friction'], Place(1, source=0)
    alone, both = (
        fit(columns, (EffectAt(coupled, place, np.array([ratio])),), base.sigma, still=1)
        for ratio in (0.0, 1.0)
    )
    assert alone.filtered_shares[0] > COUNTED_SHARE
    assert alone.shares[0] < 1e-6 * alone.filtered_shares[0]
    assert both.shares[0] > COUNTED_SHARE
    _, pair = _pair(equations)
    spring = fit(columns, pair.effects[:1], base.sigma)
    rivals = [_keys(m) for m in uncoupled(columns, spring, alone.effects[0])]
    assert TRUTH in rivals


def test_a_drift_that_shows_only_at_the_start_is_none(equations):
    columns, base = _start(equations)
    motion, place = equations.motion, Place(1, 'viscous')
    drift = EffectAt(EFFECTS['friction_drift'], place)
    short, long = (
        fit(columns, (drift.with_shape(np.array([tau])),), base.sigma, still=1)
        for tau in (motion.step, 0.5 * motion.time[-1])
    )
    faded = [
        replace(m, effects=(replace(m.effects[0], coefficients=np.array([0.8, 1.6])),))
        for m in (short, long)
    ]
    assert [is_credible(m) for m in faded] == [False, True]


def test_hysteresis_over_no_way_is_coulomb_friction(equations):
    """At the lower bound of its presliding it is a jump at reversals, and asserted as such."""
    columns, base = _start(equations)
    motion, place = equations.motion, Place(1)
    hysteresis = EFFECTS['hysteresis']
    least, _ = hysteresis.bounds(motion, place)
    found = [
        fit(columns, (EffectAt(hysteresis, place, way),), base.sigma, still=1)
        for way in (least, hysteresis.starts(motion, place)[3])
    ]
    found = [replace(m, effects=(replace(m.effects[0], coefficients=np.ones(1)),)) for m in found]
    assert [is_credible(m) for m in found] == [False, True]


def test_several_waves_are_found_at_one_joint(equations_for):
    """Each with its own period; two of nearly one period are one wave."""
    world = simulate(
        CHAINS[1], 5, 10.0,
        force=lambda t, q, v: (0.9 * np.sin(12.0 * q[0]) + 0.6 * np.cos(31.0 * q[0]),),
    )  # fmt: skip
    _, equations = equations_for(world)
    columns, base = _start(equations)
    cogging = EFFECTS['cogging']
    (_, first), *_ = screen(columns, base, [cogging])
    one = fit(columns, (first,), base.sigma)
    (_, second), *_ = screen(columns, one, [cogging])
    both = fit(columns, (*one.effects, second), one.sigma)
    assert len({s.key for s in both.effects}) == 2
    assert sorted(float(s.shape[0]) for s in both.effects) == pytest.approx([12.0, 31.0], rel=0.01)
    assert both.laws == 1
    assert is_credible(both)
    near = both.effects[0].with_shape(both.effects[1].shape + 0.1)
    assert not is_credible(replace(both, effects=(near, both.effects[1])))


def test_usual_laws_count_where_the_motor_delivers_little_of_what_is_asked(monkeypatch, equations):
    """A late target asks for many times the effort that moves the robot."""
    columns = Columns(equations)
    base = fit(columns, (), np.sqrt((equations.d**2).mean(axis=0)), is_free=True)
    assert usual(columns, base, least=1.0).effects == ()
    monkeypatch.setattr(joint_search, 'acting_share', lambda _model: np.full(2, 1e-3))
    assert usual(columns, base, least=1.0).effects != ()


def test_the_usual_laws_of_every_joint_are_those_that_can_be_there(equations):
    """None pushes, none is smaller than what counts as physics."""
    columns, base = _start(equations)
    found = usual(columns, base)
    assert {('viscous_friction', 0), ('viscous_friction', 1)} <= _keys(found)
    assert all(s.is_possible(equations.motion) for s in found.effects)
    assert min(found.filtered_shares) > COUNTED_SHARE


def test_no_usual_law_stands_beside_one_that_holds_it(equations_for):
    """Two Coulomb frictions of one joint would share one number as they like."""
    world = simulate(CHAINS[1], 7, 10.0, force=lambda t, q, v: (-0.5 * np.tanh(v[0] / 1e-3),))
    columns, base = _start(equations_for(world)[1])
    stribeck = EffectAt(EFFECTS['stribeck_friction'], Place(0), np.array([0.3]))
    plain = ('coulomb_friction', 0)
    assert plain in _keys(usual(columns, base, least=-1.0))
    assert plain not in _keys(usual(columns, base, (stribeck,), least=-1.0))


@pytest.mark.long
def test_friction_that_builds_up_at_every_joint_is_found_at_once(tmp_path):
    """At one joint after the other a play or a lag would first imitate it."""
    truth = {'shoulder': (2.0, 0.004), 'elbow': (1.0, 0.006)}
    raw, tree = recorded(tmp_path, arm(), [
        f'hysteresis:joint={joint},level={level},presliding={way}'
        for joint, (level, way) in truth.items()
    ])  # fmt: skip
    columns, base = _start(make_equations(raw, tree, choose_bandwidth(raw, tree)))
    effects = built_up(columns, usual(columns, base)).effects
    found = {tree.moving_names[s.place.joint]: s for s in effects if s.name == 'hysteresis'}
    assert set(found) == set(truth)
    for joint, (level, way) in truth.items():
        assert found[joint].coefficients[0] == pytest.approx(level, rel=0.05)
        assert found[joint].shape[0] == pytest.approx(way, rel=0.3)


def test_an_elastic_joint_is_looked_for_where_it_was_not_found(tmp_path):
    """At the shoulder it fits a little, for that of the elbow moves the shoulder, too."""
    text = 'joint_elasticity:joint=elbow,stiffness=8.0,damping=0.02,motor_inertia=0.003'
    raw, tree = recorded(tmp_path, arm(), [f'{text},encoder=motor'], seconds=6.0)
    columns, base = _start(make_equations(raw, tree, choose_bandwidth(raw, tree)))
    law, motion = EFFECTS['joint_elasticity'], base.frame.equations.motion
    place = next(p for p in law.places(motion) if p.joint == 0)
    shoulder = EffectAt(law, place, law.starts(motion, place)[0])
    wrong = fit(columns, (shoulder,), base.sigma, is_free=False)
    best = growth.best_of(wrong, elsewhere(columns, wrong))
    assert best is not None
    assert [s.place.joint for s in best.effects] == [1]
    assert best.mean_square.sum() < 0.1 * wrong.mean_square.sum()


def test_a_delay_of_all_motors_takes_the_place_of_what_imitates_it_at_each(tmp_path):
    """A lag at one, a delay of its own at another; what made up for a part of it goes."""
    raw, tree = recorded(tmp_path, arm(), ['command_delay:joint=all,delay=0.03'], seconds=6.0)
    columns, base = _start(make_equations(raw, tree, choose_bandwidth(raw, tree)))
    apart = [('actuator_lag', 0, [0.03]), ('command_delay', 1, [0.03])]
    apart += [(name, j, []) for name in ('viscous_friction', 'coulomb_friction') for j in (0, 1)]
    effects = tuple(EffectAt(EFFECTS[n], Place(j), np.array(x)) for n, j, x in apart)
    wrong = fit(columns, effects, base.sigma, is_free=False)
    (found,) = in_common(columns, wrong)
    assert is_credible(found)
    assert ('command_delay', PLACES['all']) in _keys(by_joint(columns, wrong)[0])
    delay = next(s for s in found.effects if s.name == 'command_delay')
    assert joint_name(base.frame.equations.motion, delay.place.joint) == 'all'
    assert delay.shape[0] == pytest.approx(0.03, rel=0.05)
    assert not any(s.name == 'actuator_lag' for s in found.effects)
    assert gain(found, wrong) > PER_EFFECT
    assert not list(in_common(columns, base))


@pytest.mark.parametrize(('nominal', 'is_slight'), [(0.01, False), (0.05, True)])
def test_a_joint_is_looked_at_again_for_a_part_of_its_own_friction(equations, nominal, is_slight):
    """Three parts in ten thousand of the effort are much where friction is a hundredth of it."""
    d = np.sqrt(nominal * equations.power) * np.ones_like(equations.d)
    frame = SimpleNamespace(equations=replace(equations, d=d))
    model = SimpleNamespace(left=np.full(2, 0.75 * SLIGHT_REST), frame=frame)
    assert Block((), (1,)).is_slight(model) is is_slight
    assert Block((), None).is_slight(model)


@pytest.mark.parametrize('excess', [0.3, 0.0])
def test_friction_that_differs_with_direction_is_tried_at_all_joints_at_once(
    equations_for, excess
):
    """Other bodies hold up what both are more one way; the joint that has none stays plain."""

    def force(_t, _q, v):
        one_way = 0.5 * np.tanh(v[0] / 1e-3) + excess
        return -one_way, -0.3 * np.tanh(v[1] / 1e-3)

    _, equations = equations_for(simulate(CHAINS[2], 7, 10.0, force=force))
    columns, base = _start(equations)
    plain = [EffectAt(EFFECTS['coulomb_friction'], Place(j)) for j in (0, 1)]
    model = fit(columns, tuple(plain), base.sigma)
    found = [_keys(m) for m in richer(columns, model) if gain(m, model) > 0.0]
    expected = [{('asymmetric_coulomb', 0), ('coulomb_friction', 1)}]
    assert found == (expected if excess else [])


def test_a_coupling_law_takes_the_place_of_all_that_stands_for_it(equations_for):
    """Friction of both joints and two couplings imitate a motor that turns with both."""

    def force(_t, q, v):
        both = 0.5 * np.tanh((v[0] + v[1]) / 1e-3) + 0.4 * (v[0] + v[1])
        return -both - 0.6 * v[0], -both

    _, equations = equations_for(simulate(CHAINS[2], 7, 10.0, force=force))
    columns, base = _start(equations)
    plain = [
        EffectAt(EFFECTS[n], Place(j))
        for n in ('coulomb_friction', 'viscous_friction') for j in (0, 1)
    ]  # fmt: skip
    couplings = [
        EffectAt(EFFECTS['joint_coupling'], Place(j, 'torque', source=1 - j)) for j in (0, 1)
    ]
    imitation = fit(columns, (*plain, *couplings), base.sigma)
    trials = [t for t in coupled(columns, imitation) if gain(t, imitation) > 0.0]
    assert trials
    assert all('joint_coupling' not in {name for name, _ in _keys(t)} for t in trials)
    found, *_ = by_joint(columns, imitation)
    assert _keys(found) in ({('coupled_friction', j), ('viscous_friction', 0)} for j in (0, 1))


def test_a_law_of_the_source_takes_the_place_of_one_that_couples(equations):
    """A spring of one joint is hardly less than one that depends a little on another."""
    columns, pair = _pair(equations)
    coupling = EffectAt(EFFECTS['joint_coupling'], Place(1, 'spring', source=0), np.array([-4.0]))
    others = (pair.effects[1], EffectAt(EFFECTS['viscous_friction'], Place(1)))
    model = fit(columns, (*others, coupling), pair.sigma, is_free=True)
    blocks = growth.blocks_of(model)
    rivals = [_keys(t) for b in blocks for t in joint_search._changes(columns, model, b)]
    assert TRUTH in rivals


def test_dry_friction_of_a_joint_has_one_level(monkeypatch, equations):
    """Where it builds up a part of it that does not is no second friction."""
    columns, pair = _pair(equations)
    dry, built = (
        EffectAt(EFFECTS[n], Place(1), np.array(x))
        for n, x in (('coulomb_friction', []), ('hysteresis', [0.01]))
    )
    assert one_of_each((*pair.effects, dry, built)) == (*pair.effects, built)
    monkeypatch.setattr(joint_search, 'SWEEPS', 0)
    model = fit(columns, (*pair.effects, dry, built), pair.sigma, is_free=True)
    found, *_ = by_joint(columns, model)
    assert _keys(found) == {*_keys(pair), ('hysteresis', 1)}


def test_both_motors_of_a_differential_are_found(equations_for):
    """One turns with the sum of the joints, one with the difference; each has its friction."""

    def force(_t, q, v):
        own, other = (
            level * np.tanh(w / 1e-3) + b * w
            for level, b, w in ((0.2, 0.15, v[1] + v[0]), (0.5, 0.3, v[1] - v[0]))
        )
        return -own + other, -own - other

    _, equations = equations_for(simulate(CHAINS[2], 7, 10.0, force=force))
    columns, base = _start(equations)
    found, *_ = by_joint(columns, base)
    assert [s.name for s in found.effects] == ['coupled_friction'] * 2
    levels = {float(s.shape[0]): s.coefficients.tolist() for s in found.effects}
    assert sorted(levels) == pytest.approx([-1.0, 1.0], abs=0.05)
    assert levels[min(levels)] == pytest.approx([0.5, 0.3], rel=0.1)
    assert levels[max(levels)] == pytest.approx([0.2, 0.15], rel=0.1)
    assert found.laws == 2 * (1 + len(EFFECTS['coupled_friction'].plain))


@pytest.mark.parametrize(('ratio', 'is_one'), [(-0.5, True), (0.5, False)])
def test_the_motors_of_a_differential_turn_against_each_other(ratio, is_one):
    """Two that turn with nearly the same sum are one."""
    law, place = EFFECTS['coupled_friction'], Place(1, source=0)
    motors = [EffectAt(law, replace(place, number=i), np.array([x]))
              for i, x in enumerate((1.0, ratio))]  # fmt: skip
    assert are_apart(motors, motion=None) is is_one


def test_a_rotor_is_found_where_bodies_could_stand_for_it(equations_for):
    """A link of ten times its inertia would leave as little, but is unlikely."""
    first, second = CHAINS[2]
    world = simulate(
        (replace(first, inertia=10.0 * first.inertia), second), 7, 10.0,
        force=lambda t, q, v: (-1.5 * v[0], -0.8 * v[1]),
    )  # fmt: skip
    equations = equations_for(world)[1]
    columns, base = _start(equations)
    friction = tuple(EffectAt(EFFECTS['viscous_friction'], Place(j)) for j in (0, 1))
    bodies = fit(columns, friction, base.sigma, is_free=True)
    frame = Frame.of(equations, base.sigma * 1e-3, is_free=True, weight=1.0)
    unexplained = equations.d - sum(bodies.forces)
    imitation = frame.parameters(unexplained)
    rest = ((unexplained - equations.force_of(imitation)) ** 2).mean(axis=0)
    left = bodies.mean_square / equations.power
    assert (rest / equations.power).max() < COUNTED_SHARE < left.max()
    found = by_joint(columns, bodies)[0]
    assert _keys(found) == {('viscous_friction', 0), ('viscous_friction', 1), ('armature', 0)}
    assert found.w @ found.w < 0.1 * (imitation @ imitation)
    assert min(support(columns, found, floors(equations), INDEPENDENT_ROWS)) > EVIDENCE


def test_friction_too_small_to_count_is_found_beside_what_counts(equations_for):
    """Left out, it would make any smooth force say more than what is named."""
    world = simulate(
        CHAINS[1], 7, 10.0, force=lambda t, q, v: (2.0 * np.sin(5.0 * q[0]) - 0.03 * v[0],)
    )
    equations = equations_for(world)[1]
    columns, base = _start(equations)
    place = Place(0)
    start = fit(columns, (EffectAt(EFFECTS['cogging'], place, np.array([5.0])),), base.sigma)
    left = (start.mean_square / equations.power).max()
    assert SLIGHT_REST < left < COUNTED_SHARE
    found = by_joint(columns, start)[0]
    assert _keys(found) == {('cogging', 0), ('viscous_friction', 0)}
    assert min(found.shares) < COUNTED_SHARE


def test_unlikely_bodies_make_room_only_for_a_law_that_makes_them_likelier(
    equations_for, monkeypatch
):
    """Beside a rest that does not count, a rare law may not come for the sake of the rest."""
    equations = equations_for(simulate(heavier(CHAINS[2], 1, 4.0), 7, 10.0))[1]
    columns, model = _start(equations)
    assert model.left.max() < COUNTED_SHARE
    assert 0.5 * float(model.w @ model.w) > PER_EFFECT
    rare = Block((EFFECTS['backlash'],), (0,))
    monkeypatch.setattr(
        'sgp_ros.diagnosis.explain.growth.best_of',
        lambda _model, trials, **_: next(iter(trials), None),
    )
    assert grown(columns, model, rare) is model


def test_laws_that_few_joints_have_cost_more_once(equations):
    _, base = _start(equations)

    def price(*effects):
        return replace(base, effects=effects).law_price

    usual_one, rare = (
        EffectAt(EFFECTS[n], Place(0)) for n in ('viscous_friction', 'quadratic_drag')
    )
    waves = [EffectAt(EFFECTS['cogging'], Place(0, number=i), np.array([5.0 + i])) for i in (0, 1)]
    assert price(rare) - price(usual_one) == pytest.approx(PER_UNUSUAL)
    assert price(*waves) == price(waves[0]) == price(rare)
    assert price(EffectAt(EFFECTS['stribeck_friction'], Place(0))) == price(usual_one)
    assert price(EffectAt(EFFECTS['torque_gain'], Place(0))) == price(usual_one)


def test_joints_that_move_in_turn_show_no_motor_that_turns_with_both(equations):
    """Plain friction of each joint explains the force wherever the other one rests."""
    moving = np.ones(equations.motion.position.shape)
    moving[: len(moving) // 2, 0] = moving[len(moving) // 2 :, 1] = 0.0
    motion = replace(equations.motion, velocity=moving * equations.motion.velocity)
    law = EffectAt(
        EFFECTS['coupled_friction'], Place(1, source=0), np.array([1.5]), np.array([1.0, 0.5])
    )
    for known, is_shown in (
        (replace(equations, motion=motion, moving=moving), False),
        (equations, True),
    ):
        force = law.columns(known.motion) @ law.coefficients
        left = beyond_plain(law, force, known)
        assert ((left**2).mean() > 1e-3 * (force**2).mean()) == is_shown


@pytest.mark.parametrize('takes_command', [True, False])
def test_drives_that_take_the_command_away_take_no_turn(
    equations_for, dry, monkeypatch, takes_command
):
    """They promise most where bodies may vanish; other laws that cannot be end the search."""
    _, equations = equations_for(dry)
    columns = Columns(equations)
    base = fit(columns, (), np.sqrt((equations.d**2).mean(axis=0)), is_free=False)
    laws = tuple(e for e in EFFECTS.values() if e.is_force and not e.is_on_tree)
    block = Block(laws, (0,))
    promised = distinct(screen(columns, base, laws, (0,)))
    first = {s.key for s in promised[: growth.TRIALS]}
    monkeypatch.setattr(growth, '_takes_commands', lambda _m, s: takes_command and s.key in first)

    def others(model):
        return is_credible(model) and not first & model.key

    monkeypatch.setattr(growth, 'is_credible', others)
    found = grown(columns, base, block)
    assert bool(found.effects) is takes_command
    assert not first & found.key


def test_a_load_and_a_tilt_are_tried_in_place_of_changed_bodies(equations_for, heavy):
    """Beside the laws of the best such models; not a second load."""
    _, equations = equations_for(heavy[2])
    columns, start = Columns(equations), np.sqrt((equations.d**2).mean(axis=0))
    law = EffectAt(EFFECTS['viscous_friction'], Place(0))
    free = fit(columns, (law,), start, is_free=True)
    found = _carrying(columns, [free])
    assert found
    for model in found:
        assert not model.is_free
        assert model.effects[0].name == 'viscous_friction'
    assert {s.name for m in found for s in m.effects[1:]} == {'payload', 'gravity_tilt'}
    again = _carrying(columns, [replace(found[0], frame=free.frame)])
    assert [len(m.effects) for m in again] == [2]


@pytest.mark.parametrize(
    ('is_open', 'worth', 'found'),
    [
        (True, {'a': -3.0, 'b': -4.0, 'c': -9.0, 'ab': -1.0, 'bc': 8.0}, 'bc'),
        (True, {'a': 5.0, 'b': -4.0, 'c': -9.0, 'ab': 2.0, 'bc': 8.0}, 'bc'),
        (True, {'a': 15.0, 'b': -4.0, 'c': -9.0, 'ab': 2.0, 'bc': 18.0}, 'a'),
        (True, {'a': -3.0, 'b': -4.0, 'c': -9.0, 'ab': -1.0, 'bc': -2.0}, ''),
        (False, {'a': -3.0, 'b': -4.0, 'c': -9.0, 'ab': -1.0, 'bc': 8.0}, ''),
    ],
    ids=['two', 'better than one', 'one that is clear', 'none', 'a joint that is explained'],
)
def test_two_laws_are_found_that_hide_each_other(monkeypatch, is_open, worth, found):
    """One that is hardly worth its price is taken for as long as a second one is looked for."""
    after = {'': 'abc', 'a': 'b', 'b': 'ac'}
    worth = {'': 0.0, **worth}
    monkeypatch.setattr(growth, '_counted', lambda _c, m, _b: [
        ''.join(sorted(m + more)) for more in after.get(m, '')])  # fmt: skip
    monkeypatch.setattr(growth, 'gain', lambda t, m, **_: worth[t] - worth[m])
    monkeypatch.setattr(growth, 'is_credible', lambda _: True)
    monkeypatch.setattr(Block, 'is_open', lambda *_: is_open)
    assert grown(None, '', Block((), (0,))) == found


def test_a_joint_is_open_while_much_of_its_discrepancy_is_left(equations):
    """Laws of no joint are not looked for two at a time."""
    _, base = _start(equations)
    left = replace(base, residual=equations.d)
    assert Block((), (0,)).is_open(left)
    assert not Block((), (0,)).is_open(replace(base, residual=0.1 * equations.d))
    assert not Block((), None).is_open(left)


def test_two_laws_of_the_speed_take_the_place_of_one_that_imitates_both(equations_for):
    """Dry friction and drag by the square of the speed look like damping, each more than it."""
    world = simulate(
        CHAINS[1], 3, 20.0, force=lambda t, q, v: (-0.15 * abs(v[0]) * v[0],),
        dry=lambda t, q, s: 0.3,
    )  # fmt: skip
    columns, model = _start(equations_for(world)[1])
    alone = [
        fit(columns, (EffectAt(EFFECTS[name], Place(0)),), model.sigma, is_free=True)
        for name in ('viscous_friction', 'quadratic_drag', 'coulomb_friction')
    ]
    assert max(alone, key=lambda m: m.score) is alone[0]
    found = max(two_for_one(columns, alone[0]), key=lambda m: gain(m, alone[0]))
    assert {s.name for s in found.effects} == {'coulomb_friction', 'quadratic_drag'}
    assert gain(found, alone[0]) > PER_EFFECT
    assert not list(two_for_one(columns, alone[2]))
