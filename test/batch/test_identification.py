"""Planted parameters are found again, and nothing is scored on what it was learned from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.batch.identification import HELD_OUT, IdentificationOptions, identify
from sgp_ros.batch.signals import collect_signals
from sgp_ros.engine.config import EngineConfig
from sgp_ros.errors import ConfigError, RecordingError
from sgp_ros.rigid.inertial import PARAMETERS
from sgp_ros.rigid.pseudo_inertia import is_consistent
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_robot
from test.batch.arm_world import COULOMB, VISCOUS, arm_motion, arm_samples, write_arm
from test.batch.worlds import AXIS_TRUTH, axis_signals, moved_axis

LINEAR_AXIS = load_robot('linear_axis')

QUICK = IdentificationOptions(methods=('PR', 'SGP'))
PHYSICS = IdentificationOptions(methods=('PR',))
FOUR_SIGMA = 4.0
"""Beyond this a parameter of thirty lies once in five hundred worlds."""


@pytest.fixture(scope='module')
def arm_robot(tmp_path_factory):
    return load_robot(write_arm(tmp_path_factory.mktemp('arm')))


@pytest.fixture(scope='module')
def nominal(arm_robot):
    """Coefficients of the URDF, which the simulated arm has; offsets are zero."""
    return np.array([c.prior_mean for c in nominal_robot(arm_robot).coefficients])


@pytest.fixture(scope='module')
def arm(arm_robot, nominal):
    """The arm, identified without knowing its URDF's inertias."""
    return identify(_arm_signals(arm_robot), arm_robot, {}, QUICK, nominal=0.5 * nominal)


def _arm_signals(robot, **choices):
    return collect_signals(arm_samples(rate=50.0, **choices), robot, EngineConfig(max_gap=0.25))


def _coefficients(robot, *names):
    return [[c.name for c in robot.coefficients].index(name) for name in names]


@pytest.mark.long
def test_parameters_of_a_simulated_axis_lie_in_their_intervals():
    """With the motor's command held between samples, as a machine is driven."""
    found = identify(axis_signals(20.0), LINEAR_AXIS, {}, PHYSICS).physics.coefficients
    assert found.is_identifiable.all()
    assert np.all(np.abs(found.mean - AXIS_TRUTH) < FOUR_SIGMA * found.std)
    assert np.all(found.std < 0.05 * np.abs(AXIS_TRUTH))


def test_intervals_hold_the_truth_as_often_as_they_say():
    """Over worlds: 95 % of four times fifteen, up to three standard deviations of the count."""
    inside = []
    for seed in range(15):
        signals = moved_axis(seed, duration=20.0, encoder=1e-5)
        found = identify(signals, LINEAR_AXIS, {}, PHYSICS).physics.coefficients
        inside.append(np.abs(found.mean - AXIS_TRUTH) < 1.96 * found.std)
    spread = np.sqrt(0.95 * 0.05 / np.size(inside))
    assert np.mean(inside) > 0.95 - 3.0 * spread


def test_every_determined_combination_of_the_arm_lies_in_its_interval(arm, nominal):
    """Torques are Pinocchio's, the regressor is not: gravity, axes and frames must agree."""
    base, physics = arm.excitation.excited, arm.physics.coefficients
    error = base.combinations @ (physics.mean - nominal)
    spread = base.combinations @ physics.covariance @ base.combinations.T
    assert base.rank == arm.excitation.structural.rank
    assert np.all(np.abs(error) < FOUR_SIGMA * np.sqrt(np.diag(spread)))


def test_friction_of_the_arm_is_found(arm):
    """To one per cent, without what the URDF says of it."""
    names = [f'{j}.{kind}' for kind in ('viscous', 'coulomb') for j in arm.robot.joint_names]
    found = arm.physics.coefficients.mean[_coefficients(arm.robot, *names)]
    assert found == pytest.approx([*VISCOUS, *COULOMB], rel=0.01)


def test_consistent_bodies_are_positive_definite_and_fit_as_well(arm, nominal):
    """From a reference of half the mass: where data speak, it has no say."""
    w = arm.consistent.coefficients
    for i, c in enumerate(arm.robot.coefficients):
        if c.name.endswith('.mass'):
            assert is_consistent(w[i : i + len(PARAMETERS)])
        if c.name.endswith(('.viscous', '.coulomb')):
            assert w[i] >= 0.0
    error = np.mean((arm.data.y - arm.data.F @ w) ** 2, axis=0)
    least = np.mean((arm.data.y - arm.data.F @ arm.physics.coefficients.mean) ** 2, axis=0)
    assert np.all(error < 1.05 * least)


def test_complete_physics_of_the_arm_gets_no_process(arm):
    assert arm.inputs.names == ((), ())


def test_friction_missing_in_one_joint_is_learned_there(tmp_path):
    """Z sees the direction where no column holds it; held-out error falls by ten."""
    robot = load_robot(
        write_arm(tmp_path, 'terms: {inertial: all, viscous: all, coulomb: [turn]}')
    )
    found = identify(_arm_signals(robot), robot, {}, QUICK)
    assert 'own:direction' in found.inputs.names[1]
    held = found.held[HELD_OUT]
    loss = {m: np.mean((f.predict(held)[0] - held.y) ** 2, axis=0) for m, f in found.fits.items()}
    assert loss['SGP'][1] < 0.1 * loss['PR'][1]


@pytest.mark.parametrize('holdout', ['tail', 'alternate'])
def test_no_held_out_row_is_learned_from(holdout):
    """Rows are divided, none is lost; every fit has as many residuals as rows to learn from."""
    options = replace(QUICK, holdout=holdout, stretch_s=3.0)
    found = identify(moved_axis(0, duration=20.0), LINEAR_AXIS, {}, options)
    held = found.held[HELD_OUT]
    assert not set(found.train.time) & set(held.time)
    np.testing.assert_array_equal(
        np.sort(np.concatenate([found.train.time, held.time])), found.data.time
    )
    for fit in found.fits.values():
        assert fit.points.max() == len(found.train.time) - 1


def test_what_is_held_out_changes_no_fit():
    """Another recording beside it, same predictions: no choice and no fit has seen either."""
    signals = moved_axis(1, duration=12.0)
    tests = {'same': signals, 'other': moved_axis(2, duration=12.0)}
    alone, both = (
        identify(signals, LINEAR_AXIS, {name: tests[name] for name in names}, QUICK)
        for names in (['same'], ['same', 'other'])
    )
    for method, fit in alone.fits.items():
        expected = fit.predict(alone.held['same'])
        found = both.fits[method].predict(both.held['same'])
        np.testing.assert_array_equal(expected, found)


def test_with_other_recordings_all_rows_are_learned_from():
    found = identify(
        moved_axis(0, duration=15.0), LINEAR_AXIS, {'later': moved_axis(1, duration=8.0)}, QUICK
    )
    assert set(found.held) == {'later'}
    np.testing.assert_array_equal(found.train.time, found.data.time)


def test_a_velocity_that_one_recording_lacks_is_used_in_none():
    """All pass one filter."""
    signals = moved_axis(0, duration=15.0)
    measured = replace(signals, velocity=np.gradient(signals.position, signals.time, axis=0))
    found = identify(measured, LINEAR_AXIS, {'without': moved_axis(1, duration=8.0)}, PHYSICS)
    assert found.choice.plan.velocity_source == 'position'


def test_a_motion_of_one_joint_is_told_from_one_that_shows_all(arm_robot):
    """Then motions are suggested; what is not excited is named."""
    samples = arm_samples(rate=50.0)
    still = [
        replace(
            s, position=np.array([0.3, s.position[1]]), velocity=np.array([0.0, s.velocity[1]])
        )
        for s in samples
    ]
    found = identify(
        collect_signals(still, arm_robot, EngineConfig(max_gap=0.25)), arm_robot, {}, PHYSICS
    )
    assert found.excitation.missing > 0
    assert found.suggestions
    assert found.excitation.unexcited
    assert np.all(np.abs(found.physics.coefficients.mean) < 100.0)


def test_a_test_recording_too_short_is_named():
    short = moved_axis(1, duration=0.2)
    with pytest.raises(RecordingError, match='test recording brief'):
        identify(moved_axis(0, duration=15.0), LINEAR_AXIS, {'brief': short}, PHYSICS)


@pytest.mark.parametrize(
    ('change', 'found'),
    [
        ({'methods': ('PR', 'LS')}, 'LS'),
        ({'methods': ()}, 'methods'),
        ({'residual_inputs': ('own:speed',)}, 'speed:axis'),
        ({'share': 1.0}, 'share 1'),
        ({'share': 0.0}, 'share 0'),
        ({'holdout': 'middle'}, 'middle'),
    ],
)
def test_options_that_do_not_exist_are_refused(change, found):
    with pytest.raises(ConfigError, match=found):
        identify(moved_axis(0, duration=8.0), LINEAR_AXIS, {}, replace(PHYSICS, **change))


def test_the_arm_moves_through_most_of_its_poses():
    """The fixture's own premise: both joints turn by more than a radian."""
    assert np.all(np.ptp(arm_motion()[1], axis=0) > 1.0)
