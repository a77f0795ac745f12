"""Efforts that are a small difference of large forces: what is named there, and what is not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.criteria import FORCE_ACCURACY
from sgp_ros.diagnosis.decide import cancelling
from sgp_ros.diagnosis.decide.cancelling import within_accuracy
from sgp_ros.diagnosis.decide.decision import decide
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.physics.place import Place
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, simulate

LEVEL = 0.15
"""Dry friction [N m]."""
EFFORT = 0.2
"""Root mean square of the effort, of that of the inertial force."""


def _swinging(equations, error, force=0.0):
    """Return equations of a joint whose weight drives it, with an error of inertial forces.

    Args:
        equations: of a driven chain.
        error: of the inertial forces of its joints, a smooth function of their motion [1].
        force: that no law of the list describes, (N,) [N m].
    """
    motion = equations.motion
    inertial = equations.filter(motion.mass_diagonal * motion.acceleration)
    q, v = (equations.filter(x) for x in (motion.position, motion.velocity))
    wrong = error * inertial * np.cos(3.0 * q + v) * np.sqrt(2.0)
    effort = EFFORT**2 * (inertial**2).mean(axis=0)
    return replace(equations, d=equations.d + wrong + np.reshape(force, (-1, 1)), power=effort)


def _decided(equations, *names):
    bases = (fitted(equations, is_free=f) for f in (False, True))
    return decide(equations, Comparison(*bases, (fitted(equations, *names),), ()))


@pytest.fixture(scope='module')
def rubbed(equations_for):
    world = simulate(CHAINS[1], 5, 40.0, dry=lambda t, q, s: LEVEL, reach=2.5)
    return equations_for(world)[1]


@pytest.fixture(scope='module')
def smooth(equations_for):
    return equations_for(simulate(CHAINS[1], 5, 40.0, reach=2.5))[1]


def test_friction_is_named_beside_an_error_of_the_forces_that_cancel(rubbed):
    """Which is more of the effort than an adequate model leaves."""
    equations = _swinging(rubbed, 0.5 * FORCE_ACCURACY)
    decision = _decided(equations, 'coulomb_friction')
    assert decision.verdict == 'missing_physics'
    (friction,) = decision.model.effects
    assert friction.coefficients[0] == pytest.approx(LEVEL, rel=0.15)
    assert 0.1 < decision.excess[0] < 0.5


def test_beyond_the_accuracy_of_the_forces_nothing_is_named(rubbed):
    equations = _swinging(rubbed, 1.2 * FORCE_ACCURACY)
    assert _decided(equations, 'coulomb_friction').verdict == 'unexplained'


def test_a_law_that_a_process_says_as_well_is_not_named(smooth):
    """Damping that stands for a smooth force of another form, within the accuracy."""
    motion = smooth.motion
    inertial = smooth.filter(motion.mass_diagonal * motion.acceleration).std()
    v = smooth.filter(motion.velocity)[:, 0]
    force = -FORCE_ACCURACY * inertial * np.expm1(0.7 * v / v.std())
    equations = _swinging(smooth, 0.3 * FORCE_ACCURACY, force)
    model = fitted(equations, 'viscous_friction')
    assert model.mean_square[0] < (FORCE_ACCURACY * inertial) ** 2
    assert _decided(equations, 'viscous_friction').verdict == 'unexplained'


def test_only_what_stands_beside_the_process_is_kept(rubbed):
    """Friction does; a rotor, which the body of the joint says as well, does not."""
    equations = _swinging(rubbed, 0.5 * FORCE_ACCURACY)
    model = fitted(equations, 'coulomb_friction', 'armature')
    found, excess, _ = within_accuracy(equations, model, np.array([3.0]))
    assert [s.name for s in found.effects] == ['coulomb_friction']
    assert excess[0] < 1.0


def test_a_law_that_few_joints_have_does_not_stand(rubbed, monkeypatch):
    """The same one, if few joints had it."""
    model = fitted(_swinging(rubbed, 0.5 * FORCE_ACCURACY), 'coulomb_friction')
    monkeypatch.setattr(cancelling, 'adds_to_usual', lambda _law: False)
    found, excess, _ = within_accuracy(model.frame.equations, model, np.array([3.0]))
    assert found is model
    assert excess[0] == 3.0


@pytest.mark.long
def test_a_joint_where_no_law_stands_stays_open_beside_one_where_a_law_does(equations_for):
    """However much it leaves, for that is within the accuracy of the forces."""

    def friction(_t, _q, v):
        return -LEVEL * math.tanh(v[0] / 0.02), 0.0

    world = simulate(CHAINS[2], 5, 40.0, force=friction, reach=2.5)
    equations = _swinging(equations_for(world)[1], FORCE_ACCURACY * np.array([0.2, 0.6]))
    decision = _decided(equations, 'coulomb_friction')
    left = decision.model.left
    assert left[1] > 2.0 * left[0]
    assert decision.verdict == 'missing_physics'
    assert [s.key for s in decision.model.effects] == [('coulomb_friction', Place(0))]
    assert decision.unknown == (1,)


def test_few_rows_let_nothing_stand(rubbed):
    equations = _swinging(rubbed, 0.5 * FORCE_ACCURACY)
    model = fitted(equations, 'coulomb_friction')
    few = replace(equations, d=equations.d[:4], bases=(equations.bases[0][:4],))
    short = replace(model, residual=model.residual[:4], parts=(model.parts[0][:4],))
    found, excess, _ = within_accuracy(few, short, np.array([3.0]))
    assert found is short
    assert excess[0] == 3.0
