"""Standard deviations against the spread over recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.batch.least_squares import correlation_factor
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import Bandwidth, collect
from sgp_ros.diagnosis.criteria import STATED_ERROR
from sgp_ros.diagnosis.explain import uncertainty
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import floors
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.uncertainty import covariance, reported_std
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from test.diagnosis.fitted_models import fitted
from test.diagnosis.worlds import CHAINS, events_of, simulate

RUNS = 40


def exact(monkeypatch):
    """Let bodies of robot files have no errors."""
    monkeypatch.setattr(uncertainty, 'STATED_ERROR', 1e-9)


@pytest.mark.parametrize(
    ('name', 'shape', 'force', 'what'),
    [
        ('viscous_friction', (), lambda t, q, v: (-0.3 * v[0],), 'b'),
        ('spring', (), lambda t, q, v: (-2.0 * (q[0] - 0.3),), 'rest'),
    ],
    ids=['viscous', 'spring'],
)
def test_the_std_is_the_spread_over_noises(robots, monkeypatch, name, shape, force, what):
    """White noise on the residual; 30 % are 2.7 deviations of the spread of 40 runs."""
    exact(monkeypatch)
    robot, tree = robots[1]
    raw = collect(events_of(simulate(CHAINS[1], 7, 8.0, force=force)), robot)
    equations = make_equations(raw, tree, Bandwidth(10.0, 25.0))
    rng = np.random.default_rng(0)
    candidate = EffectAt(EFFECTS[name], Place(0), np.array(shape, dtype=float))
    values, stds = [], []
    for _ in range(RUNS):
        noisy = replace(equations, d=equations.d + rng.normal(0.0, 0.1, equations.d.shape))
        columns = Columns(noisy)
        model = fit(columns, (candidate,), np.sqrt(floors(noisy) + 0.01), is_free=False, rounds=1)
        values.append(model.effects[0].report(equations.motion)[what])
        stds.append(reported_std(model, columns)[0][what])
    spread = np.std(values, ddof=1)
    assert 0.7 < np.median(stds) / spread < 1.4
    assert abs(np.mean(values) - (0.3)) < 4.0 * spread / np.sqrt(RUNS) + 0.003


def test_correlation_in_time_widens_it(equations_for, viscous):
    """The same noise in runs of eight rows counts for fewer rows."""
    _, equations = equations_for(viscous)
    rng = np.random.default_rng(1)
    candidate = EffectAt(EFFECTS['viscous_friction'], Place(0), np.zeros(0))
    N = len(equations.d)
    white = rng.normal(0.0, 0.1, (N, 1))
    slow = np.repeat(rng.normal(0.0, 0.1, (N // 8 + 1, 1)), 8, axis=0)[:N]
    found = []
    for noise in (white, slow):
        noisy = replace(equations, d=equations.d + noise)
        columns = Columns(noisy)
        model = fit(columns, (candidate,), np.full(1, 0.1), is_free=False)
        found.append(float(covariance(model, columns)[0, 0] / model.mean_square[0]))
    assert found[1] > 3.0 * found[0]


def test_shapes_have_a_std_and_a_covariance_is_symmetric(equations_for, dry):
    """Two coefficients and a shape of Stribeck friction."""
    _, equations = equations_for(dry)
    columns = Columns(equations)
    candidate = EffectAt(EFFECTS['stribeck_friction'], Place(0), np.array([0.5]))
    model = fit(columns, (candidate,), np.full(1, 0.1), is_free=False)
    C = covariance(model, columns)
    assert C.shape == (3, 3)
    np.testing.assert_allclose(C, C.T, rtol=1e-6, atol=1e-12 * np.abs(C).max())
    assert np.linalg.eigvalsh(C)[0] > -1e-9 * np.abs(C).max()
    std = reported_std(model, columns)[0]
    assert set(std) == {'coulomb', 'static', 'stribeck_velocity'}
    assert all(np.isfinite(x) and x >= 0.0 for x in std.values())


@pytest.mark.parametrize(('name', 'depends'), [('spring', True), ('viscous_friction', False)])
def test_errors_of_stated_bodies_are_in_the_std(robots, monkeypatch, name, depends):
    """Links as wrong as robot files are: a spring is uncertain by that, friction is not."""
    robot, tree = robots[1]
    raw = collect(events_of(simulate(CHAINS[1], 7, 8.0)), robot)
    equations = make_equations(raw, tree, Bandwidth(10.0, 25.0))
    (factor,), rng = equations.factors, np.random.default_rng(3)
    bodies = (factor.Q @ factor.R)[:, equations.instants :]

    def found(w):
        noise = rng.normal(0.0, 0.2, equations.d.shape)
        wrong = replace(equations, d=equations.d + (bodies @ w)[:, None] + noise)
        columns, candidate = Columns(wrong), EffectAt(EFFECTS[name], Place(0))
        model = fit(columns, (candidate,), np.full(1, 0.2), is_free=False)
        return float(model.effects[0].coefficients[0]), float(covariance(model, columns)[0, 0])

    errors = STATED_ERROR * rng.normal(size=(RUNS, bodies.shape[1]))
    values, variances = zip(*(found(w) for w in errors), strict=True)
    assert 0.8 < np.sqrt(np.mean(variances) / np.var(values)) < 2.0
    right = [found(np.zeros(bodies.shape[1]))[1]]
    exact(monkeypatch)
    right.append(found(np.zeros(bodies.shape[1]))[1])
    assert (right[1] < 0.5 * right[0]) == depends


def test_a_residual_that_other_bodies_would_explain_adds_to_that(robots, monkeypatch):
    """Beyond what it adds as noise: the numbers would be others beside those bodies."""
    robot, tree = robots[1]
    raw = collect(events_of(simulate(CHAINS[1], 7, 8.0)), robot)
    equations = make_equations(raw, tree, Bandwidth(10.0, 25.0))
    (factor,), rng = equations.factors, np.random.default_rng(3)
    bodies = (factor.Q @ factor.R)[:, equations.instants :]
    noise = rng.normal(0.0, 0.2, equations.d.shape)
    candidate = EffectAt(EFFECTS['spring'], Place(0))
    added = []
    for size in (0.0, 3.0 * STATED_ERROR):
        wrong = bodies @ (size * rng.normal(size=bodies.shape[1]))
        columns = Columns(replace(equations, d=equations.d + wrong[:, None] + noise))
        model = fit(columns, (candidate,), np.full(1, 0.2), is_free=False)
        with monkeypatch.context() as changed:
            exact(changed)
            alone = covariance(model, columns)[0, 0]
        added.append(float(covariance(model, columns)[0, 0] - alone))
    assert added[1] > 1.5 * added[0]


def test_without_effects_there_is_nothing_to_be_uncertain_of(equations_for, viscous):
    """An empty covariance, an empty list."""
    _, equations = equations_for(viscous)
    columns = Columns(equations)
    model = fit(columns, (), np.full(1, 0.1), is_free=False)
    assert covariance(model, columns).shape == (0, 0)
    assert reported_std(model, columns) == []


def test_a_number_that_nothing_depends_on_may_be_anything(equations_for, viscous):
    """One link cannot tell where a load sits along its axis: a flat distribution in its bounds."""
    _, equations = equations_for(viscous)
    model = fitted(equations, 'payload')
    (std,) = reported_std(model, Columns(equations))
    low, high = EFFECTS['payload'].bounds(equations.motion, Place(0))
    axis = int(np.flatnonzero(np.abs(equations.motion.tree.axes[0]) > 0.5)[0])
    name = 'xyz'[axis]
    assert std[name] == pytest.approx((high - low)[1 + axis] / np.sqrt(12.0), rel=1e-3)
    assert all(np.isfinite(x) for x in std.values())


def test_what_is_unknown_at_one_joint_does_not_widen_the_numbers_of_another(robots, monkeypatch):
    """Slow noise at the second joint, which the model does not describe."""
    exact(monkeypatch)
    robot, tree = robots[2]
    forces = simulate(CHAINS[2], 7, 8.0, force=lambda t, q, v: (-0.3 * v[0], 0.0))
    equations = make_equations(collect(events_of(forces), robot), tree, Bandwidth(10.0, 25.0))
    rng, N = np.random.default_rng(2), len(equations.d)
    slow = np.repeat(rng.normal(0.0, 0.5, N // 40 + 1), 40)[:N]
    noisy = replace(equations, d=equations.d + np.column_stack([rng.normal(0.0, 0.1, N), slow]))
    columns, candidate = Columns(noisy), EffectAt(EFFECTS['viscous_friction'], Place(0))
    model = fit(columns, (candidate,), np.full(2, 0.1), is_free=False)
    common, apart = (float(covariance(model, columns, j)[0, 0]) for j in ((), (1,)))
    alone = max(correlation_factor(model.residual[:, 0]), 1.0)
    assert common > 5.0 * apart
    assert apart == pytest.approx(common * alone / correlation_factor(model.residual[:, 1]))
