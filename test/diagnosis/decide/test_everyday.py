"""Everyday friction beside something unknown: when it is named, and when it is the unknown."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.criteria import INTERVAL, STANDING
from sgp_ros.diagnosis.decide import everyday
from sgp_ros.diagnosis.decide.certainty import settled_of
from sgp_ros.diagnosis.decide.decision import Decision
from sgp_ros.diagnosis.decide.differences import Several
from sgp_ros.diagnosis.decide.everyday import _beside_shape, widened, with_everyday
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.uncertainty import reported_std
from sgp_ros.diagnosis.findings import asserted
from sgp_ros.diagnosis.locate.dependence import dependences
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from sgp_ros.physics.servo import Servo
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, simulate

LEVEL, DAMPING = 0.4, 0.15
"""Dry friction [N m], and friction per speed [N m s/rad]."""


def _wave(size, damping=DAMPING):
    """Return a force of position and time, of no law of the list, beside damping."""
    return lambda t, q, v: (size * math.sin(7.0 * q[0]) * math.sin(1.3 * t) - damping * v[0],)


@pytest.mark.parametrize('damping', [0.0, 0.05])
def test_friction_too_small_to_be_named_widens_intervals(equations_for, damping):
    """It bends the level of dry friction, and only there is more than chance added."""
    world = simulate(CHAINS[1], 21, 20.0, dry=lambda *_: LEVEL,
                     force=lambda t, q, v: (-damping * v[0],))  # fmt: skip
    equations = equations_for(world)[1]
    model = fitted(equations, 'coulomb_friction')
    (plain,), (wide,) = (f(equations, model) for f in (_plain, widened))
    bent = abs(float(model.effects[0].coefficients[0]) - LEVEL)
    assert bent < INTERVAL * wide['level']
    assert (bent > INTERVAL * plain['level']) is bool(damping)
    assert (wide['level'] > 1.5 * plain['level']) is bool(damping)


def _plain(equations, model):
    return reported_std(model, Columns(equations))


class _Lag:
    """A position or speed that something follows, and forgets."""

    def __init__(self, lag_s):
        self.lag_s, self.z, self.t = lag_s, 0.0, 0.0

    def ahead(self, t, x):
        """Return by how much x is ahead of it."""
        self.z += (x - self.z) * min((t - self.t) / self.lag_s, 1.0)
        self.t = t
        return x - self.z


class _Cushion(_Lag):
    """A cushion of air that leaks: it pushes back, and forgets; of no law of the list."""

    def __call__(self, t, q, _v):
        return (1.0 - max(1.0 - 0.6 * self.ahead(t, q[0]), 0.1) ** -1.4,)


class _Stirred(_Lag):
    """Drag in a fluid that follows."""

    def __call__(self, t, _q, v):
        return (-0.6 * self.ahead(t, v[0]),)


def _unexplained(equations):
    """Return a comparison in which nothing describes the joint, and the decision on it."""
    base = fitted(equations)
    comparison = Comparison(base, fitted(equations, is_free=True), (), ())
    return comparison, Decision('unexplained', base, (), np.array([9.0]), 0, (0,), base)


def _decided(equations_for, **world):
    equations = equations_for(simulate(CHAINS[1], 6, 30.0, **world))[1]
    comparison, decision = _unexplained(equations)
    return equations, comparison, with_everyday(equations, comparison, decision)


@pytest.fixture(scope='module')
def rubbed(equations_for):
    return _decided(equations_for, force=_wave(0.5), dry=lambda t, q, s: LEVEL)


def test_friction_is_named_with_intervals_that_hold_it(rubbed):
    found = rubbed[2]
    numbers = {s.name: float(s.coefficients[0]) for s in found.model.effects}
    assert numbers.keys() == {'coulomb_friction', 'viscous_friction'}
    for s in found.model.effects:
        true = {'coulomb_friction': LEVEL, 'viscous_friction': DAMPING}[s.name]
        assert numbers[s.name] == pytest.approx(true, abs=INTERVAL * found.standing[s.key])
        assert found.standing[s.key] < 0.5 * true
    assert found.unknown == (0,)


def test_a_law_that_has_another_sign_in_some_half_is_left_out(equations_for):
    """A joint without any damping beside the unknown has dry friction alone."""
    found = _decided(equations_for, force=_wave(0.5, damping=0.0), dry=lambda t, q, s: LEVEL)[2]
    assert [s.name for s in found.model.effects] == ['coulomb_friction']


@pytest.mark.parametrize('leak_s', [0.14, 0.16, 0.4])
def test_what_leaks_has_no_friction_beside_it(equations_for, leak_s):
    """It takes energy as friction does, which leans on a rest that is larger than itself."""
    found = _decided(equations_for, force=_Cushion(leak_s))[2]
    assert not found.standing


@pytest.mark.parametrize('follow_s', [0.2, 1.0])
def test_drag_in_a_fluid_that_follows_is_no_friction_beside_it(equations_for, follow_s):
    """It resists the motion as friction does, and earlier speeds say how much."""
    found = _decided(equations_for, force=_Stirred(follow_s))[2]
    assert not found.standing


def test_findings_have_its_probability_and_interval(rubbed):
    equations, comparison, _ = rubbed
    unexplained = _unexplained(equations)[1]
    several = Several(equations, comparison, unexplained, unexplained.model, {})
    several, _, chances = settled_of(several)
    found = several.decision
    depends = dependences(equations, comparison.base.residual)
    *named, unknown = asserted(equations, found, (), (), chances, depends)[0][::-1]
    assert unknown.effect == 'unknown'
    assert [f.probability for f in named] == [STANDING, STANDING]
    wide = replace(found, standing=dict.fromkeys(found.standing, 1.0))
    *named, _ = asserted(equations, wide, (), (), chances, depends)[0][::-1]
    sizes = [next(iter(f.parameters.values())) for f in named]
    assert [x.std for x in sizes] == [pytest.approx(1.0, rel=0.01)] * 2


@pytest.mark.parametrize(('size', 'verdict'), [(0.3, 'missing_physics'), (2.5, 'unexplained')])
def test_physics_is_missing_where_friction_explains_most(equations_for, size, verdict):
    found = _decided(equations_for, force=_wave(size), dry=lambda t, q, s: 1.5 * LEVEL)[2]
    assert found.verdict == verdict
    assert found.standing


@pytest.mark.parametrize(
    'unknown',
    [
        {'force': lambda t, q, v: (-math.copysign(abs(v[0]) ** 0.4, v[0]),)},
        {'dry': lambda t, q, s: LEVEL * math.exp(0.7 * q[0])},
        {'force': _wave(6.0), 'dry': lambda t, q, s: 0.1 * LEVEL},
        {'force': lambda t, q, v: (3.0 * math.sin(7.0 * q[0]),)},
    ],
    ids=['of_another_form', 'that_grows_with_position', 'hidden', 'absent'],
)  # fmt: skip
def test_friction_is_not_named_where_it_is_the_unknown_or_not_seen(equations_for, unknown):
    assert not _decided(equations_for, **unknown)[2].standing


@pytest.mark.parametrize('unknown', [(0,), (0, 1)])
@pytest.mark.parametrize('beside', [(), ('spring',)])
def test_what_stands_beside_a_known_shape_has_its_number_there(equations_for, unknown, beside):
    """If that is at the only unknown joint, and was found beside what is told of the others."""
    equations, comparison, _ = _decided(equations_for, force=_wave(6.0), dry=lambda t, q, s: 0.04)
    decision = replace(_unexplained(equations)[1], unknown=unknown, excess=np.full(2, 9.0))
    shaped = fitted(equations, 'coulomb_friction', *beside)
    key = shaped.effects[0].key
    decision = replace(decision, shaped={0: (shaped, {key: 0.02})})
    found = _beside_shape(decision)
    assert (found is None) is (beside != () or len(unknown) > 1)
    if found:
        found = with_everyday(equations, comparison, decision)
        assert found.model is shaped
        assert found.standing == {key: 0.02}


def test_no_friction_is_told_apart_from_an_unknown_force_of_the_speed(equations_for):
    """Where a search for a law found such a force, and nothing that stands beside it."""
    world = {'force': _wave(1.5), 'dry': lambda t, q, s: 1.5 * LEVEL}
    equations, comparison, _ = _decided(equations_for, **world)
    decision = _unexplained(equations)[1]
    assert with_everyday(equations, comparison, decision).standing
    known = replace(decision, shaped={0: (decision.model, {})})
    assert not with_everyday(equations, comparison, known).standing


def test_a_described_joint_stays_as_it_is(rubbed):
    equations, comparison, found = rubbed
    known = replace(found, unknown=(), standing={})
    assert with_everyday(equations, comparison, known) is known


@pytest.mark.parametrize(
    ('later', 'std', 'is_adopted'), [(0.003, 1e-4, True), (0.003, 0.01, False), (0.0, 1e-4, False)]
)
def test_a_delay_of_targets_stands_beside_friction_of_all_joints(
    monkeypatch, equations_for, perfect, later, std, is_adopted
):
    """It takes the place of those that are too small to be worth it."""
    equations = equations_for(perfect[1])[1]
    one = np.ones((1, 1))
    servo = Servo(None, 0.005, (0,), one[0], one[0], one, one, one)
    driven = replace(equations, motion=replace(equations.motion, drive=servo))
    law = EFFECTS['command_delay']
    delay = EffectAt(law, law.places(equations.motion)[0], np.array([0.016]), np.ones(1))
    model = replace(fitted(equations), effects=(delay,))
    rotor = EffectAt(EFFECTS['armature'], Place(0), coefficients=np.array([0.02]))

    def usual(_columns, base, first, least):
        assert base is model
        assert not least
        return replace(model, effects=(first[0].with_shape(first[0].shape - later), rotor))

    monkeypatch.setattr(everyday, 'usual', usual)
    monkeypatch.setattr(everyday, 'is_credible', lambda _model: True)
    monkeypatch.setattr(everyday, 'reported_std', lambda *_: ({'delay': std},))
    decision = Decision('missing_physics', model, (), np.zeros(1), 0)
    found = with_everyday(driven, None, decision)
    names = [s.name for s in found.model.effects]
    assert names == ['command_delay', *(['armature'] * is_adopted)]
    assert list(found.standing) == [rotor.key] * is_adopted
    assert with_everyday(equations, None, decision) is decision
