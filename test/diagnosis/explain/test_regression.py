"""Laws of the projection of inertial parameters, and of the models fitted with it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare import equations as compared
from sgp_ros.diagnosis.criteria import INDEPENDENT_ROWS
from sgp_ros.diagnosis.explain.candidates import fit, passed_on
from sgp_ros.diagnosis.explain.fitted_model import floors, shown_inertia
from sgp_ros.diagnosis.explain.frame import Frame
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.formula import read_formula
from sgp_ros.physics.law import FormulaLaw, LawParameter
from sgp_ros.physics.place import Place
from sgp_ros.physics.servo import Servo
from sgp_ros.rigid.rigid_body import mass_matrix, torque_regressor
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, simulate

NONE = np.zeros(0)


def _start(equations):
    return np.sqrt((equations.d**2).mean(axis=0) + floors(equations))


def _candidate(name, joint, shape=()):
    return EffectAt(EFFECTS[name], Place(joint), np.array(shape, dtype=float))


@pytest.mark.parametrize('k', [1, 2])
def test_projection_equals_dense_ridge_regression(equations_for, heavy, k):
    """Columns and w together by normal equations with the prior of w as a ridge."""
    _, equations = equations_for(heavy[k])
    sigma = _start(equations)
    frame = Frame.of(equations, sigma, is_free=True)
    N, _, p = equations.base.shape
    x = Columns(equations).of(_candidate('viscous_friction', k - 1), equations)
    X = np.concatenate([x, equations.base], axis=2) / sigma[:, None]
    X = X.reshape(N * k, 1 + p)
    y = (equations.d / sigma).ravel()
    ridge = frame.weight * np.diag([0.0, *np.ones(p)])
    dense = np.linalg.solve(X.T @ X + ridge, X.T @ y)
    projected = frame.projected(x)
    c = np.linalg.lstsq(projected, frame.y, rcond=None)[0]
    np.testing.assert_allclose(c, dense[:1], rtol=1e-6, atol=1e-9)
    w = frame.parameters(equations.d - x @ c)
    np.testing.assert_allclose(w, dense[1:], rtol=1e-5, atol=1e-7)
    D, one = X[:, 1:].T @ X[:, 1:], np.eye(p)
    determinant = np.linalg.slogdet(D / frame.weight + one)[1]
    np.testing.assert_allclose(determinant, 2.0 * frame.occam, rtol=1e-9)
    inverse = np.linalg.inv(D + frame.weight * one)
    errors = inverse @ (D + frame.weight**2 * one) @ inverse
    np.testing.assert_allclose(frame.covariance, errors, rtol=1e-6, atol=1e-12)
    # bodies may be as wrong as usual, though they were taken for more accurate
    wrong = inverse @ (D + frame.weight**2 * 25.0 * one) @ inverse
    trusting = replace(frame, equations=replace(equations, accuracy=0.2))
    np.testing.assert_allclose(trusting.covariance, wrong, rtol=1e-6, atol=1e-12)
    assert frame.weight == max(1.0, N / INDEPENDENT_ROWS)


def test_frames_of_any_scale_share_the_factors_of_the_joints(equations_for, heavy):
    """Basis and triangle are those of all rows; dry friction factors only what it changes."""
    _, equations = equations_for(heavy[2])
    N, k, p = equations.base.shape
    for sigma in (_start(equations), np.array([1e-3, 10.0])):
        frame = Frame.of(equations, sigma, is_free=True)
        prior = np.sqrt(frame.weight) * np.eye(p)
        rows = np.concatenate([(equations.base / sigma[:, None]).reshape(N * k, p), prior])
        np.testing.assert_allclose(frame.Q.T @ frame.Q, np.eye(p), atol=1e-12)
        np.testing.assert_allclose(frame.Q @ frame.R, rows, atol=1e-11 * np.abs(rows).max())
    rests = np.zeros_like(equations.rests)
    rests[100:200], rests[300:400, 1] = True, True
    free = replace(equations, rests=rests)
    held, both = (free.with_dry_friction(frozenset(joints)) for joints in ({1}, {0, 1}))
    assert held.factors[0] is free.factors[0]
    assert both.factors[1] is held.factors[1]
    assert both.factors[0] is not free.factors[0]
    for base, factor in zip(both.bases, both.factors, strict=True):
        np.testing.assert_allclose(factor.Q @ factor.R, base, atol=1e-11)


def test_a_held_joint_tells_nothing_where_it_rests(equations_for, heavy, monkeypatch):
    """Its discrepancy and base are the filtered ones of the other rows, in blocks of any size."""
    _, equations = equations_for(heavy[2])
    rests = np.zeros_like(equations.rests)
    rests[100:200, 1] = True
    still = replace(
        equations.motion,
        velocity=np.where(rests, 0.0, equations.motion.velocity),
        acceleration=np.where(rests, 0.0, equations.motion.acceleration),
    )
    Y = torque_regressor(still.tree, still.position, still.velocity, still.acceleration)[:, 1]
    needed = still.effort_for(still.position, still.velocity, still.acceleration) - still.effort
    change = equations.filter(np.where(rests, needed, 0.0))[:, 1]
    base = equations.bases[1] + equations.filter(rests[:, [1]] * (Y @ equations.directions.T))
    for block in (7, 2000):
        monkeypatch.setattr(compared, '_BLOCK', block)
        held = replace(equations, rests=rests).with_dry_friction(frozenset({1}))
        np.testing.assert_allclose(held.d[:, 1], equations.d[:, 1] - change, atol=1e-12)
        np.testing.assert_allclose(held.bases[1], base, atol=1e-12)
        np.testing.assert_array_equal(held.d[:, 0], equations.d[:, 0])


def test_what_remains_is_told_apart_by_joint(equations_for, heavy):
    """Mean squares in the units of the efforts, the rows of the prior left out."""
    _, equations = equations_for(heavy[2])
    frame = Frame.of(equations, _start(equations), is_free=False)
    np.testing.assert_allclose(frame.by_joint(frame.y), (equations.d**2).mean(axis=0))
    assert frame.determined == 0
    assert not frame.parameters(equations.d).any()
    free = Frame.of(equations, _start(equations), is_free=True)
    assert 0 < free.determined <= 20


def test_viscous_friction_is_found_with_its_size(equations_for, viscous):
    """The linear coefficient and nothing else; the residual is that of a perfect model."""
    _, equations = equations_for(viscous)
    model = fit(Columns(equations), (_candidate('viscous_friction', 0),), _start(equations),
                is_free=False)  # fmt: skip
    np.testing.assert_allclose(model.effects[0].coefficients, [0.3], rtol=2e-3)
    assert model.mean_square[0] < 2e-5 * equations.power[0]
    assert model.size == 1
    assert model.is_possible()
    assert model.filtered_shares == [pytest.approx(model.net_share)]
    np.testing.assert_allclose(equations.d, model.forces[0] + model.residual, atol=1e-12)


def test_free_bodies_do_not_fit_worse_and_cost_evidence(equations_for, viscous):
    """The score is what remains less the price of freedom."""
    _, equations = equations_for(viscous)
    candidates = (_candidate('viscous_friction', 0),)
    tight = fit(Columns(equations), candidates, _start(equations), is_free=False)
    free = fit(Columns(equations), candidates, _start(equations))
    assert free.mean_square[0] <= tight.mean_square[0] * (1.0 + 1e-9)
    assert free.freedom > tight.freedom
    assert tight.score > free.score


def test_a_search_finds_the_shape_from_a_distant_start(equations_for):
    """The delay by Levenberg-Marquardt, within its bounds."""
    from test.diagnosis.worlds import delayed

    world = simulate(CHAINS[1], 5, 8.0, motor=delayed(0.012))
    _, equations = equations_for(world)
    model = fit(Columns(equations), (_candidate('command_delay', 0, [0.03]),), _start(equations),
                is_free=False)  # fmt: skip
    assert model.effects[0].shape[0] == pytest.approx(0.012, rel=0.02)
    assert model.size == 1


def test_screening_ranks_what_is_there_first(equations_for, viscous):
    """And does not offer what the model has already."""
    _, equations = equations_for(viscous)
    columns = Columns(equations)
    base = fit(columns, (), _start(equations), is_free=False)
    trials = screen(columns, base, EFFECTS.values())
    assert trials[0][1].key == ('viscous_friction', Place(0))
    assert [gain for gain, _ in trials] == sorted((g for g, _ in trials), reverse=True)
    model = fit(columns, (trials[0][1],), base.sigma, is_free=False)
    again = screen(columns, model, EFFECTS.values())
    assert ('viscous_friction', Place(0)) not in {s.key for _, s in again}
    assert again[0][0] < 0.05 * trials[0][0]


def test_screening_finds_the_interval_of_friction_in_a_place(equations_for):
    """By bins of the range, to the width of one or two of them."""
    world = simulate(
        CHAINS[1], 6, 10.0,
        force=lambda t, q, v: (-0.6 * v[0] if 0.1 < q[0] < 0.5 else 0.0,),
    )  # fmt: skip
    _, equations = equations_for(world)
    columns = Columns(equations)
    base = fit(columns, (), _start(equations), is_free=False)
    best = screen(columns, base, [EFFECTS['position_friction']])[0][1]
    assert best.place == Place(0, 'viscous')
    bin_width = np.ptp(world.position) / 40
    np.testing.assert_allclose(best.shape, [0.1, 0.5], atol=2.0 * bin_width)


def test_slopes_of_motions_that_are_done_with_are_let_go(equations_for, heavy, monkeypatch):
    """Those of a long recording take hundreds of megabytes a model; asked again, the same."""
    _, equations = equations_for(heavy[2])
    columns = Columns(equations)
    bodies = np.random.default_rng(5).normal(size=(3, equations.size))
    first, second = (columns.corrected(w) for w in bodies[:2])
    before = [x.copy() for x in first.effort_slopes(1)]
    assert first.remembered == 3 * first.position.size
    monkeypatch.setattr('sgp_ros.diagnosis.explain.regression.MOST_SLOPES', 0)
    assert columns.corrected(bodies[0]) is first
    assert first.remembered
    columns.corrected(bodies[2])
    assert first.remembered == second.remembered == 0
    for one, other in zip(before, first.effort_slopes(1), strict=True):
        np.testing.assert_array_equal(one, other)


def test_slopes_of_efforts_are_their_derivatives(equations_for, heavy):
    """By position and velocity those of central differences, by acceleration the mass matrix."""
    motion = equations_for(heavy[2])[1].motion
    h = 1e-4 * np.eye(2)[1]
    q, v, a = motion.position, motion.velocity, motion.acceleration
    by_q, by_v, by_a = motion.effort_slopes(1)
    scale = np.abs(by_a).max()
    apart = motion.effort_for(q + h, v, a) - motion.effort_for(q - h, v, a)
    np.testing.assert_allclose(by_q, apart / 2e-4, atol=1e-4 * np.abs(by_q).max())
    apart = motion.effort_for(q, v + h, a) - motion.effort_for(q, v - h, a)
    np.testing.assert_allclose(by_v, apart / 2e-4, atol=1e-4 * scale)
    M = mass_matrix(motion.tree, motion.tree.parameters, q)
    np.testing.assert_allclose(by_a, M[:, :, 1], atol=1e-9 * scale)


def test_a_motor_that_delivers_half_is_as_exact_where_its_joint_is_held(equations_for, perfect):
    """With half the inertia it leaves half of all forces, and predicts the same motion."""
    equations = equations_for(perfect[1])[1]
    held = np.arange(len(equations.moving))[:, None] < len(equations.moving) // 4
    resting = replace(equations, moving=1.0 - held, carried=np.full(1, 0.3))
    half = EffectAt(EFFECTS['torque_gain'], Place(0), coefficients=np.array([-0.5]))
    whole = shown_inertia(resting, np.full(1, 0.2), ())
    other = shown_inertia(resting, np.full(1, np.log(0.5) + 0.2), (half,))
    assert whole - other == pytest.approx(np.log(2.0))


def test_an_inertia_counts_only_where_its_joint_may_move(equations_for, perfect):
    """Where dry friction holds a joint, its motion is the same with any inertia."""
    equations = equations_for(perfect[1])[1]
    moving = fitted(equations, 'armature')
    held = np.arange(len(equations.moving))[:, None] < len(equations.moving) // 4
    resting = fitted(replace(equations, moving=1.0 - held), 'armature')
    assert moving.log_inertia == pytest.approx(moving.inertia[0])
    assert resting.log_inertia == pytest.approx(0.75 * resting.inertia[0], rel=1e-3)
    price = len(equations.d) * (moving.log_inertia - resting.log_inertia)
    assert moving.score - resting.score == pytest.approx(price)


@pytest.mark.parametrize('has_gains', [True, False])
def test_a_motor_that_passes_nothing_on_leaves_no_stiffness(has_gains):
    """A drive at its limit does not hold the motion, nor does one whose motor gives nothing."""
    effort = np.random.default_rng(0).normal(size=(200, 4))
    servo = Servo(None, 0.01, (0,), np.ones(4), np.ones(4), effort, effort, effort)
    motion = SimpleNamespace(
        drive=servo if has_gains else None, effort=effort, tree=SimpleNamespace(size=4)
    )
    half = replace(_candidate('torque_gain', 1), coefficients=np.array([-0.5]))
    laws = [
        half,
        _candidate('saturation', 2, [1e-9]),
        _candidate('saturation', 3, [9.0]),
        _candidate('command_delay', -5, [0.01]),  # of all motors
        _candidate('command_delay', 0, [0.01]),  # of targets
        _candidate('actuator_lag', 0, [0.01]),
    ]
    passed = passed_on(laws, SimpleNamespace(motion=motion))
    assert passed == pytest.approx([1.0, 0.5, 0.0, 1.0] if has_gains else [1.0] * 4, abs=1e-6)


def test_a_formula_that_takes_the_command_away_passes_nothing_on():
    """As a torque constant of zero does: an effort and its formula are then worth nothing."""

    @dataclass(frozen=True)
    class Seen:
        drive: Servo
        effort: np.ndarray
        position: np.ndarray
        tree: SimpleNamespace

    effort = np.random.default_rng(0).normal(size=(200, 2))
    servo = Servo(None, 0.01, (0,), np.ones(2), np.ones(2), effort, effort, effort)
    seen = Seen(servo, effort, effort, SimpleNamespace(size=2, moving_names=('a', 'b')))
    formula = read_formula('c*tau[b] + d*tau[a]', is_law=True)
    numbers = [LawParameter(name, '1', start=1.0) for name in ('c', 'd')]
    law = EffectAt(FormulaLaw(formula, 'b', numbers), Place(1), coefficients=np.array([-0.9, 3.0]))
    assert passed_on([law], SimpleNamespace(motion=seen)) == pytest.approx([1.0, 0.1])
