"""Effects that a motion cannot tell apart are named, with the motion that would."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.criteria import CLEARER
from sgp_ros.diagnosis.decide.decision import Decision, decide
from sgp_ros.diagnosis.decide.equivalence import MOTIONS, Contrasts, equivalents, moved
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.comparison import Comparison, compare_models
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from test.diagnosis.fitted_models import fitted, with_coefficients
from test.diagnosis.worlds import CHAINS, events_of, robot_of, simulate


def _equivalents(equations, best, rivals, unknown=()):
    bases = fitted(equations), fitted(equations, is_free=True)
    comparison = Comparison(*bases, (best, *rivals), ())
    decision = Decision('missing_physics', best, tuple(rivals), 0.0, 0, unknown)
    return equivalents(equations, comparison, decision, Contrasts(equations, best))


@pytest.fixture(scope='module')
def narrow(equations_for):
    """One link with a spring that hardly leaves the middle: sin q is a straight line."""
    world = simulate(CHAINS[1], 5, 10.0, force=lambda t, q, v: (-0.6 * q[0],), reach=0.2)
    return equations_for(world)[1]


def test_a_spring_seen_at_small_angles_may_be_a_wrong_body(narrow):
    """The wider motion separates them, for the weight follows the sine."""
    found = _equivalents(narrow, fitted(narrow, 'spring'), [])
    assert [e.effects for e in found] == [()]
    assert found[0].motion == 'a motion over the whole range of the joints'
    assert found[0].contrast > CLEARER


def test_a_spring_seen_at_large_angles_has_no_equivalent(equations_for):
    world = simulate(CHAINS[1], 5, 10.0, force=lambda t, q, v: (-0.6 * q[0],), reach=3.0)
    equations = equations_for(world)[1]
    rivals = [fitted(equations, name) for name in ('viscous_friction', 'armature')]
    assert _equivalents(equations, fitted(equations, 'spring'), rivals) == ()


def test_what_contains_the_finding_is_no_other_explanation(narrow):
    spring, more = fitted(narrow, 'spring'), fitted(narrow, 'spring', 'viscous_friction')
    found = _equivalents(narrow, spring, [more, fitted(narrow, 'spring', is_free=True)])
    assert all(('joint0', 'spring') not in e.effects for e in found)


def test_laws_that_were_refused_at_an_unknown_joint_are_in_place_of_nothing(narrow):
    """Beside what stands there, which leaves the unknown, any of them fits better."""
    rub, rivals = fitted(narrow, 'viscous_friction'), [fitted(narrow, 'spring')]
    said = {
        unknown: [e.effects for e in _equivalents(narrow, rub, rivals, unknown)]
        for unknown in ((), (0,))
    }
    assert (('joint0', 'spring'),) in said[()]
    assert (('joint0', 'spring'),) not in said[(0,)]


def test_the_diagnosis_says_what_it_cannot_tell(robots):
    """Beside the asserted explanation of a spring at small angles, the other one is named."""
    world = simulate(CHAINS[1], 5, 10.0, force=lambda t, q, v: (-0.6 * q[0],), reach=0.2)
    robot, tree = robots[1]
    found = diagnose(events_of(world), robot, tree, {})
    named = {f.effect for f in found.findings} or {'bodies'}
    others = {effect for e in found.equivalents for _, effect in e.effects or (('', 'bodies'),)}
    assert named | others >= {'spring', 'bodies'}


@pytest.mark.parametrize(
    ('size', 'fit', 'beside', 'is_longer'),
    [(3, 0.0, 'friction', True), (2, 0.0, 'friction', False), (3, 2.0, 'friction', False),
     (3, 0.0, 'spring', False)],
)  # fmt: skip
def test_a_longer_formula_that_fits_no_better_is_no_rival(size, fit, beside, is_longer):
    """Unless it has as few numbers, explains more, or stands beside something else."""

    def model(size, fit, beside):
        laws = [(key, SimpleNamespace(has_chosen_form=key == 'law')) for key in ('law', beside)]
        effects = tuple(SimpleNamespace(key=key, effect=effect) for key, effect in laws)
        return SimpleNamespace(size=size, fit=fit, effects=effects)

    scale = SimpleNamespace(fit=lambda model: model.fit)
    contrasts = Contrasts(None, model(2, 0.0, 'friction'))
    assert contrasts.is_longer(model(size, fit, beside), scale) is is_longer


def test_nothing_is_equivalent_to_what_is_unexplained(narrow):
    comparison = compare_models(narrow, lambda _share: None)
    asserted = decide(narrow, comparison)
    unknown = Decision('unexplained', comparison.base, asserted.rivals, 1.0, 0)
    contrasts = Contrasts(narrow, comparison.base)
    assert equivalents(narrow, comparison, unknown, contrasts) == ()


@pytest.mark.parametrize('how', MOTIONS.values())
def test_a_moved_motion_is_consistent(narrow, how):
    """Velocity and acceleration are the slopes of position and velocity; it keeps its rows."""
    motion = moved(narrow.motion, *how)
    for signal, slope in (
        (motion.position, motion.velocity), (motion.velocity, motion.acceleration),
    ):  # fmt: skip
        found = np.gradient(signal, motion.step, axis=0)[50:-50]
        np.testing.assert_allclose(found, slope[50:-50], atol=0.02 * np.abs(slope).max())
    np.testing.assert_allclose(np.diff(motion.time), motion.step)


@pytest.mark.long
def test_a_weak_motor_may_be_heavy_bodies_that_the_prior_thinks_unlikely(tmp_path):
    """With one joint without damping `gain u = J a + G sin q`: no motion separates the two."""
    (link,) = CHAINS[1]
    chain = (replace(link, damping=0.0),)
    world = simulate(chain, 5, 10.0, motor=lambda commands, t: (0.4 * commands[-1][0],))
    found = diagnose(events_of(world), *robot_of(tmp_path, chain), {})
    assert [f.effect for f in found.findings] == ['torque_gain']
    assert found.equivalents[0].effects == ()
    assert found.equivalents[0].motion == ''


def test_a_richer_name_of_the_same_law_is_no_other_explanation(equations_for):
    """Friction that differs with direction, but does not, is Coulomb friction."""
    world = simulate(CHAINS[1], 4, 10.0, dry=lambda t, q, s: 0.5)
    equations = equations_for(world)[1]
    best, richer = (fitted(equations, n) for n in ('coulomb_friction', 'asymmetric_coulomb'))
    contrasts = Contrasts(equations, best)
    assert contrasts.is_same_law(richer)
    assert not contrasts.is_same_law(fitted(equations, 'viscous_friction'))
    assert _equivalents(equations, best, [richer]) == ()


def test_one_law_of_two_names_is_one(narrow):
    """Dry friction, and hysteresis with a presliding that is too short to be seen or long."""
    dry = with_coefficients(fitted(narrow, 'coulomb_friction'), np.array([0.4]))
    contrasts = Contrasts(narrow, dry)
    for presliding, is_same in ((1e-5, True), (0.3, False)):
        other = EffectAt(EFFECTS['hysteresis'], Place(0), np.array([presliding]), np.array([0.4]))
        assert contrasts.stands_for(replace(dry, effects=(other,)), dry.effects[0]) == is_same


def test_friction_that_grows_with_the_load_vouches_for_dry_friction(narrow):
    """And for no other law."""
    load = EffectAt(EFFECTS['load_friction'], Place(0), np.empty(0), np.array([0.4, 0.02]))
    for name in ('coulomb_friction', 'viscous_friction'):
        model = fitted(narrow, name)
        rival = replace(model, effects=(load,))
        is_vouched_for = Contrasts(narrow, model).stands_for(rival, model.effects[0])
        assert is_vouched_for == (name == 'coulomb_friction')


@pytest.mark.long
def test_noise_does_not_hide_that_bodies_may_be_heavier(tmp_path):
    """Their residual of effort is larger because their inertia is: the motion fits as well."""
    (link,) = CHAINS[1]
    chain = (replace(link, damping=0.0),)
    world = simulate(chain, 5, 10.0, motor=lambda commands, t: (0.35 * commands[-1][0],))
    found = diagnose(events_of(world, quantum=0.1), *robot_of(tmp_path, chain), {})
    assert 'torque_gain' in {f.effect for f in found.findings}
    assert () in [e.effects for e in found.equivalents]


def test_a_law_that_says_what_two_say_counts_for_both(equations_for):
    """Friction that differs with direction is Coulomb friction under a constant load."""
    world = simulate(CHAINS[1], 4, 10.0, dry=lambda t, q, s: 0.5, force=lambda t, q, v: (0.2,))
    equations = equations_for(world)[1]
    asserted = fitted(equations, 'coulomb_friction', 'constant_load')
    contrasts = Contrasts(equations, asserted)
    richer = fitted(equations, 'asymmetric_coulomb')
    assert all(contrasts.stands_for(richer, s) for s in asserted.effects)
    load = next(s for s in asserted.effects if s.name == 'constant_load')
    assert not contrasts.stands_for(fitted(equations, 'coulomb_friction'), load)


def test_a_law_that_moves_all_joints_is_compared_at_its_own(equations_for, viscous):
    """An encoder's error shifts the whole equation; beside it friction is told from a drift."""
    equations = equations_for(viscous)[1]
    friction = fitted(equations, 'viscous_friction')
    error = EffectAt(EFFECTS['encoder_eccentricity'], Place(0), np.array([1.0, 0.01, 0.01]))
    asserted = fit(Columns(equations), (*friction.effects, error), friction.sigma)
    assert {s.columns(equations.motion).ndim for s in asserted.effects} == {2, 3}
    rival = fitted(equations, 'asymmetric_coulomb')
    assert not Contrasts(equations, asserted).stands_for(rival, asserted.effects[0])
