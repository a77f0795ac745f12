"""Laws of which sample leaves a full buffer."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.errors import NumericalError
from sgp_ros.gp.factor import GrowingFactor
from sgp_ros.gp.kernels import SquaredExponential
from sgp_ros.gp.model import CoefficientPrior, Model, OutputGroup
from sgp_ros.gp.online import OnlineRegression
from sgp_ros.gp.regression import Memory
from sgp_ros.gp.retention import RETENTIONS
from test.gp.worlds import random_problem

FLAT = CoefficientPrior.flat(3)


def _learn(online, data):
    """Learn all samples; return the indices that left, in order."""
    held, left = [], []
    for i, (u, f, y) in enumerate(zip(data.U, data.F, data.y, strict=True)):
        online.learn(online.predict(u, f), y)
        held.append(i)
        kept = {tuple(row) for row in online.buffer.U}
        gone = [j for j in held if tuple(data.U[j]) not in kept]
        held = [j for j in held if j not in gone]
        left += gone
    return left


def _covariance(model, data, j, rows):
    K = model.kernels[j].matrix(data.U[rows])
    return K + model.noise[j] * np.eye(len(rows))


@given(st.integers(0, 10_000), st.integers(1, 10), st.integers(0, 3), st.data())
def test_a_column_of_the_inverse_is_that_of_the_library(seed, n, start, data):
    """Compiled substitution and LAPACK solve the same system, wherever the factor begins."""
    m = data.draw(st.integers(0, n - 1))
    rng = np.random.default_rng(seed)
    kernel = SquaredExponential(1.0, (0.5,), (0,))
    factor = GrowingFactor(OutputGroup(kernel, 0.1, (0,), (1.0,)), 0, n + 1)
    U = rng.normal(size=(n + start, 1))
    for u in U:
        if factor.size == n:
            factor.drop(0)
        factor.append(factor.whiten(u), np.zeros((1, 1)))
    inverse = np.linalg.inv(kernel.matrix(U[start:]) + 0.1 * np.eye(n))
    np.testing.assert_allclose(factor.inverse_column(m), inverse[m], atol=1e-10)


@given(st.integers(0, 1000))
def test_least_informative_is_the_smallest_gain_about_z(seed):
    """Each sample that leaves tells least of Z beside the others, by dense conditionals."""
    model, data = random_problem(seed, n=14)
    budget = 6
    held = []
    for i, gone in enumerate(
        _learn(OnlineRegression(model, FLAT, Memory(budget, policy='least_informative')), data)
    ):
        held = list(range(budget + 1)) if i == 0 else [*held, budget + i]
        gains = np.zeros(len(held))
        for j in range(2):
            conditional = 1.0 / np.diag(np.linalg.inv(_covariance(model, data, j, held)))
            gains += 0.5 * np.log(conditional / model.noise[j])
        assert gains[held.index(gone)] == pytest.approx(gains.min(), abs=1e-10)
        held.remove(gone)


def test_a_shared_factor_counts_for_each_of_its_outputs():
    """Outputs with one covariance choose as they would with factors of their own.

    The other model parts them by 1e-10 of a noise variance, which moves no gain past another.
    """
    base, data = random_problem(3, n=60, k=3)
    a, b, _ = base.kernels
    shared = Model((a, b, a), (0.1, 0.2, 0.1))
    parted = Model((a, b, a), (0.1, 0.2, 0.1 * (1.0 + 1e-10)))
    single = Model((a, b), (0.1, 0.2))
    two = type(data)(data.U, data.F[:, :2], data.y[:, :2])
    found, wanted, other = (
        _learn(OnlineRegression(model, FLAT, Memory(12, policy='least_informative')), samples)
        for model, samples in ((shared, data), (parted, data), (single, two))
    )
    assert found == wanted
    assert found != other


@given(st.integers(0, 1000))
def test_coverage_parts_the_closest_pair(seed):
    """The sample that leaves is the older one of the two that are closest."""
    model, data = random_problem(seed, n=14)
    budget = 6
    held = []
    for i, gone in enumerate(
        _learn(OnlineRegression(model, FLAT, Memory(budget, policy='coverage')), data)
    ):
        held = list(range(budget + 1)) if i == 0 else [*held, budget + i]
        S = np.concatenate([kernel.scale(data.U[held]) for kernel in model.kernels], axis=1)
        distance = np.linalg.norm(S[:, None] - S[None], axis=2) + np.diag(np.full(len(S), np.inf))
        a, b = np.unravel_index(distance.argmin(), distance.shape)
        assert gone == held[min(a, b)]
        held.remove(gone)


@pytest.mark.parametrize('policy', RETENTIONS)
def test_who_leaves_has_no_part_in_what_is_known_of_w(policy):
    """W is learned from the whole stream, the same to the bit for any samples that Z keeps."""
    model, data = random_problem(4, n=30)
    one, other = (OnlineRegression(model, FLAT, Memory(5, policy=x)) for x in (policy, 'oldest'))
    left = [_learn(online, data) for online in (one, other)]
    assert policy == 'oldest' or left[0] != left[1]
    np.testing.assert_array_equal(one.information.R, other.information.R)
    np.testing.assert_array_equal(one.information.z, other.information.z)


@pytest.mark.parametrize('policy', RETENTIONS)
def test_stop_save_restore_continue_equals_never_stopped(policy):
    """A policy's own memory is part of the state, to the bit."""
    model, data = random_problem(8, n=30)
    one, other = (OnlineRegression(model, FLAT, Memory(6, policy=policy)) for _ in range(2))
    for i in range(30):
        if i == 15:
            other.restore(one.state())
        one.learn(one.predict(data.U[i], data.F[i]), data.y[i])
        if i >= 15:
            other.learn(other.predict(data.U[i], data.F[i]), data.y[i])
    for name, array in other.state().items():
        np.testing.assert_array_equal(array, one.state()[name])


@pytest.mark.parametrize('policy', RETENTIONS)
def test_a_policy_taken_later_goes_on_from_the_buffer(policy):
    """A change rebuilds the state that would have grown sample by sample."""
    model, data = random_problem(9, n=40)
    changed = OnlineRegression(model, FLAT, Memory(8))
    for i in range(8):
        changed.learn(changed.predict(data.U[i], data.F[i]), data.y[i])
    changed.change(memory=Memory(8, policy=policy))
    always = OnlineRegression(model, FLAT, Memory(8, policy=policy))
    for i in range(40):
        always.learn(always.predict(data.U[i], data.F[i]), data.y[i])
        if i >= 8:
            changed.learn(changed.predict(data.U[i], data.F[i]), data.y[i])
    np.testing.assert_array_equal(changed.buffer.U, always.buffer.U)


@pytest.mark.parametrize('policy', RETENTIONS)
@pytest.mark.parametrize('budget', [20, 30])
def test_a_refused_change_changes_nothing(policy, budget):
    """A model without factor is refused whole: budget, policy, buffer and bits stay."""
    model, data = random_problem(9, n=40)
    data.U[:20] = data.U[0] + 1e-9 * np.arange(20)[:, None]
    lost = Model(model.kernels, (1e-300, 1e-300))
    online, untouched = (
        OnlineRegression(model, FLAT, Memory(budget, policy=policy)) for _ in range(2)
    )
    for i in range(40):
        for one in (online, untouched):
            one.learn(one.predict(data.U[i], data.F[i]), data.y[i])
        if i == 18:
            with pytest.raises(NumericalError):
                online.change(lost, Memory(12, policy='oldest', remember=False))
    for name, array in untouched.state().items():
        np.testing.assert_array_equal(array, online.state()[name])


@pytest.mark.parametrize('policy', RETENTIONS)
def test_where_z_is_zero_the_oldest_goes(policy):
    """Without a process no sample is nearer or more telling than another."""
    model, data = random_problem(5, n=12, noise_like='parametric')
    assert _learn(OnlineRegression(model, FLAT, Memory(4, policy=policy)), data) == list(range(8))


@pytest.mark.parametrize('policy', ['least_informative', 'coverage'])
def test_a_long_stay_leaves_what_was_seen_elsewhere(policy):
    """A robot that stands still does not forget where it was."""
    model, data = random_problem(6, n=10, k=1)
    online = OnlineRegression(model, FLAT, Memory(10, policy=policy))
    _learn(online, data)
    rng = np.random.default_rng(1)
    for _ in range(200):
        u = 5.0 + 0.01 * rng.normal(size=3)
        online.learn(online.predict(u, data.F[0]), data.y[0])
    assert sum(bool((u < 4.0).any()) for u in online.buffer.U) >= 7


def test_rounding_does_not_gather_in_the_diagonal_of_the_inverse():
    """After thousands of updates at a condition number above 1e5 it is that of the factor."""
    base, _ = random_problem(7, k=1)
    model = Model(base.kernels, (1e-4,))
    online = OnlineRegression(model, FLAT, Memory(30, policy='least_informative'))
    rng = np.random.default_rng(2)
    for _ in range(5000):
        u = rng.uniform(-1.0, 1.0, size=3)
        online.learn(online.predict(u, np.zeros((1, 3))), np.zeros(1))
    K = model.kernels[0].matrix(online.buffer.U) + 1e-4 * np.eye(30)
    expected = np.diag(np.linalg.inv(K))
    np.testing.assert_allclose(online.state()['retention_precision'][0], expected, rtol=1e-6)


def test_a_precision_that_rounding_made_negative_is_of_the_sample_to_drop():
    """Nothing is warned of, and the others stay."""
    kernel = SquaredExponential(1.0, (0.5,), (0,))
    factor = GrowingFactor(OutputGroup(kernel, 0.1, (0,), (1.0,)), 0, 4)
    retention = RETENTIONS['least_informative']()
    for x in (0.0, 1.0, 2.0):
        factor.append(factor.whiten(np.array([x])), np.zeros((1, 1)))
        retention.append([factor], np.array([x]))
    retention._precision[0, 1] = -1e-3
    assert retention.choose([factor]) == 1
