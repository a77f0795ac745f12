"""Section IV.D of the paper with a fixed seed."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_proof.paper import arm
from sgp_proof.paper.figure_eight import ARM
from sgp_proof.paper.protocol import run_method

pytestmark = pytest.mark.long

SEED = 1


@pytest.fixture(scope='module')
def world():
    """One arm."""
    return arm.make_world(SEED)


@pytest.fixture(scope='module')
def outcomes(world):
    """Every method of the paper on it."""
    prior = arm.make_prior(world)
    return {method: run_method(method, world, prior) for method in ('PR', 'GP', 'PRGP', 'SGP')}


def _nmse(outcomes, method, region):
    return np.array([outcomes[method].scores[region][c]['nmse'] for c in arm.CHANNELS])


def test_the_model_lacks_only_the_growth_of_friction(world):
    """With true coefficients, all that is left is the growth at joint 3 and measured noise."""
    w = np.concatenate([link.parameters() for link in ARM.links])
    w = np.append(w, [f.viscous for f in ARM.frictions] + [f.coulomb for f in ARM.frictions])
    for test in world.tests.values():
        q, v = test.data.U[:, 2], test.data.U[:, 5]
        left = test.truth - test.data.F @ w
        left[:, 2] -= ARM.frictions[2].near_limits(q) * np.tanh(v / ARM.width)
        assert np.all(left.std(axis=0) < 5.0 * arm.ACCELERATION_NOISE)
        assert np.all(left.var(axis=0) < 1e-4 * test.truth.var(axis=0))


def test_both_curves_come_near_the_limits_of_joint_3(world):
    """Else there is nothing to learn or to get wrong."""
    for data in (world.train, *(test.data for test in world.tests.values())):
        extra = ARM.frictions[2].near_limits(data.U[:, 2])
        assert 0.2 < np.mean(extra > 0.0) < 0.9


def test_worlds_repeat():
    """A seed is a world."""
    one, other = arm.make_world(SEED), arm.make_world(SEED)
    assert np.array_equal(one.train.y, other.train.y)
    assert not np.array_equal(one.train.y, one.tests['horizontal'].data.y)


def test_accelerations_are_no_input_of_z(world):
    """They are columns 6 to 8."""
    robot = arm.make_robot()
    seen = {robot.input_name(column).partition(':')[0] for column in world.candidates[0]}
    assert seen == {'position', 'velocity', 'direction'}


def test_the_weak_prior_bounds_what_no_torque_tells(world):
    """The mass of the first link lies over the vertical axis: its column is zero."""
    assert not np.any(world.train.F[:, :, 0])
    prior = arm.make_prior(world)
    assert len(prior.target) == prior.size == 36
    assert np.all(np.isfinite(prior.root))


def test_physics_alone_misses_joint_3_and_nothing_else(outcomes):
    """Section IV.D, left panel of figure 9: `LR failed badly` on joint 3."""
    nmse = _nmse(outcomes, 'PR', 'horizontal')
    assert np.all(nmse[:2] < 0.005)
    assert nmse[2] > 0.02


def test_a_process_alone_fails_on_the_vertical_curve(outcomes):
    """Right panel of figure 9: an order of magnitude above physics."""
    assert np.all(_nmse(outcomes, 'GP', 'vertical') > 10.0 * _nmse(outcomes, 'PR', 'vertical'))


def test_sgp_learns_the_growth_and_keeps_the_physics(outcomes):
    """On joint 3 at most a fifth of PR near the data and a tenth far from them."""
    for region, share in (('horizontal', 0.2), ('vertical', 0.1)):
        sgp, pr = _nmse(outcomes, 'SGP', region), _nmse(outcomes, 'PR', region)
        assert sgp[2] < share * pr[2]
        assert np.all(sgp[:2] < 0.005)


def test_evidence_finds_what_the_growing_friction_depends_on(outcomes):
    """Position and direction of joint 3, columns 2 and 14; the latter is not in the paper."""
    assert outcomes['SGP'].inputs[2] == (2, 14)
