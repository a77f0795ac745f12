"""Laws of the factor that grows, drops and absorbs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit, types

from sgp_ros.gp.factor import ROOM, GrowingFactor
from sgp_ros.gp.factor_loops import (
    absorb_column,
    absorbed_column_numpy,
    append_row,
    close_gap,
    drop_row,
    dropped_sample_numpy,
    move_to_front,
)
from sgp_ros.gp.kernels import COMPILED_FORMS, SquaredExponential
from sgp_ros.gp.model import OutputGroup, output_groups
from sgp_ros.gp.whitening_loops import (
    combine_rows,
    fill_covariances,
    solve_lower,
    whiten_input,
    whiten_vector,
    whitened_numpy,
)
from test.gp.worlds import random_problem

GROUP = OutputGroup(SquaredExponential(1.0, (1.0,), (0,)), 0.1, (0, 1), (1.0, 2.0))
SEEDS = st.integers(0, 10_000)


def _lower(rng, n):
    root = rng.normal(size=(n, n))
    return np.linalg.cholesky(root @ root.T + np.eye(n))


def _placed(L, start):
    """Return U with the columns of L as rows from `start` on."""
    n = len(L)
    U = np.zeros((start + n + 2, start + n + 2))
    U[start : start + n, start : start + n] = L.T
    return U


def _filled(rng, n=6, p=2, capacity=10):
    factor = GrowingFactor(GROUP, p, capacity)
    U, data = rng.normal(size=(n, 1)), rng.normal(size=(n, 2, p + 1))
    factor.fill(U, data)
    return factor, U, data


def _dense(U, data):
    """Return factor and whitened data of GROUP by the solver of the library."""
    L = np.linalg.cholesky(GROUP.kernel.matrix(U) + GROUP.noise * np.eye(len(U)))
    scaled = data / np.array(GROUP.scales)[:, None]
    return L, np.linalg.solve(L, scaled.reshape(len(U), -1)).reshape(scaled.shape)


@given(SEEDS, st.integers(1, 20), st.integers(0, 9))
def test_compiled_solve_equals_lapack(seed, n, start):
    """The forward substitution is that of the library, wherever the factor begins."""
    rng = np.random.default_rng(seed)
    L, x = _lower(rng, n), rng.normal(size=n)
    expected = np.linalg.solve(L, x)
    solve_lower(_placed(L, start), start, x)
    np.testing.assert_allclose(x, expected, atol=1e-9)


@given(SEEDS, st.integers(1, 20), st.integers(0, 9))
def test_the_place_in_memory_changes_no_bit(seed, n, start):
    """Live and restored engines keep their factors at different places and must agree exactly."""
    rng = np.random.default_rng(seed)
    L, x, white = _lower(rng, n), rng.normal(size=n), rng.normal(size=(n, 3))
    found = []
    for place in (0, start):
        U, v, w, extra = _placed(L, place), x.copy(), white.copy(), np.zeros(3)
        solve_lower(U, place, v)
        absorb_column(U, place, x.copy(), w, extra)
        found.append((v, U[place : place + n, place : place + n], w, extra))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


@given(SEEDS, st.integers(0, 8))
def test_compiled_combination_is_a_product(seed, n):
    """The sum over rows is that of the library."""
    rng = np.random.default_rng(seed)
    v, rows, total = rng.normal(size=n), rng.normal(size=(n, 5)), np.full(5, np.nan)
    combine_rows(v, rows, total)
    np.testing.assert_allclose(total, v @ rows, atol=1e-12)


@given(SEEDS, st.integers(0, 9), st.sampled_from(list(COMPILED_FORMS)))
def test_compiled_covariances_are_those_of_the_kernel(seed, n, kind):
    """Each formula that the loops know is that of its class, also where it vanishes."""
    rng = np.random.default_rng(seed)
    kernel = kind(1.7, (0.5, 2.0, 1.0), (0, 1, 2))
    S, s, v = rng.normal(size=(n + 2, 3)), rng.normal(size=3), np.full(n, np.nan)
    S[-1] *= 1e6
    fill_covariances(COMPILED_FORMS[kind], kernel.variance, S, 2, s, v)
    np.testing.assert_allclose(v, kernel.vector(S[2:], s), rtol=1e-12, atol=1e-300)


@given(SEEDS, st.integers(0, 9), st.integers(0, 3))
def test_compiled_whitening_equals_the_library(seed, n, start):
    """Solve, products with the data and the norm, wherever the factor begins."""
    rng = np.random.default_rng(seed)
    L, v, scales = _lower(rng, n), rng.normal(size=n), np.array([1.0, 2.0])
    white, explained = rng.normal(size=(start + n + 2, 6)), np.full(6, np.nan)
    expected = whitened_numpy(L, v, white[start : start + n], scales)
    reduction = whiten_vector(_placed(L, start), white, start, scales, v, explained)
    for one, other in zip((v, explained, reduction), expected, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)


def test_a_kernel_of_ones_own_whitens_alike():
    """A kernel that the loops do not know is evaluated by itself, to the same end."""

    class Own(SquaredExponential):
        __slots__ = ()

    rng = np.random.default_rng(3)
    own = OutputGroup(Own(1.0, (1.0,), (0,)), GROUP.noise, GROUP.outputs, GROUP.scales)
    U, data, u = rng.normal(size=(6, 1)), rng.normal(size=(6, 2, 3)), rng.normal(size=1)
    found = []
    for group in (GROUP, own):
        factor = GrowingFactor(group, 2, 10)
        factor.fill(U, data)
        found.append(factor.whiten(u))
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


@given(SEEDS, st.integers(1, 12))
def test_a_rank_one_change_equals_refactorisation(seed, n):
    """Rotations leave the factor of K + w w^T and the data whitened by it."""
    rng = np.random.default_rng(seed)
    L, w, white = _lower(rng, n), rng.normal(size=n), rng.normal(size=(n, 3))
    expected = absorbed_column_numpy(L, w, white)
    U = _placed(L, 1)
    absorb_column(U, 1, w, white, np.zeros(3))
    np.testing.assert_allclose(U[1 : 1 + n, 1 : 1 + n].T, expected[0], atol=1e-8)
    np.testing.assert_allclose(white, expected[1], atol=1e-8)


@given(SEEDS, st.integers(1, 9))
def test_absorbing_a_column_is_part_of_the_factor(seed, n):
    """The class changes its factor and its data as the loop does."""
    rng = np.random.default_rng(seed)
    factor, _, _ = _filled(rng, n)
    L, white, w = factor.lower.copy(), factor.white.reshape(n, -1).copy(), rng.normal(size=n)
    expected = absorbed_column_numpy(L, w, white)
    factor.absorb(w)
    np.testing.assert_allclose(factor.lower, expected[0], atol=1e-10)
    np.testing.assert_allclose(factor.white.reshape(n, -1), expected[1], atol=1e-10)


@given(SEEDS, st.integers(1, 10), st.data())
def test_dropping_equals_refactorisation(seed, n, data):
    """The factor of the other samples stays, and their data whitened by it."""
    m = data.draw(st.integers(0, n - 1))
    factor, _, _ = _filled(np.random.default_rng(seed), n)
    L, white = dropped_sample_numpy(factor.lower.copy(), factor.white.reshape(n, -1).copy(), m)
    factor.drop(m)
    np.testing.assert_allclose(factor.lower, L, atol=1e-9)
    np.testing.assert_allclose(factor.white.reshape(n - 1, 6), white, atol=1e-8)


@given(SEEDS)
def test_append_then_drop_is_the_identity(seed):
    """A sample that comes and goes leaves no trace in the factor."""
    rng = np.random.default_rng(seed)
    factor, _, _ = _filled(rng)
    before = {name: array.copy() for name, array in factor.state().items()}
    factor.append(factor.whiten(rng.normal(size=1)), rng.normal(size=(2, 3)))
    factor.drop(6)
    for name, array in factor.state().items():
        np.testing.assert_array_equal(array, before[name])


@pytest.mark.parametrize('leaves', ['oldest', 'any'])
def test_a_long_stream_equals_a_fresh_factor(leaves):
    """The window moves to the front of its memory several times; nothing is lost on the way.

    Rounding of 5 ROOM rotations at a condition number below 300 stays below 1e-11.
    """
    rng = np.random.default_rng(0)
    factor, U, data = _filled(rng, n=9)
    for _ in range(5 * ROOM):
        u, row = rng.normal(size=1), rng.normal(size=(2, 3))
        factor.append(factor.whiten(u), row)
        m = 0 if leaves == 'oldest' else int(rng.integers(10))
        factor.drop(m)
        U = np.delete(np.concatenate([U, u[None]]), m, axis=0)
        data = np.delete(np.concatenate([data, row[None]]), m, axis=0)
    L, white = _dense(U, data)
    np.testing.assert_allclose(factor.lower, L, atol=1e-11)
    np.testing.assert_allclose(factor.white, white, atol=1e-10)


def _machine_code(function, signature):
    """Compile without the cache, from which code comes that cannot be read."""
    compiled = njit(function, error_model='numpy')
    compiled.compile(signature)
    code = compiled.inspect_llvm(compiled.signatures[0])
    assert 'define' in code
    return code


@pytest.mark.parametrize(
    'loop',
    [
        solve_lower, combine_rows, absorb_column, close_gap, move_to_front, whiten_input,
        append_row, drop_row,
    ],
)  # fmt: skip
def test_compiled_loops_allocate_nothing(loop):
    """The compiled code of each loop calls no allocator."""
    rng = np.random.default_rng(0)
    U, x = np.eye(12), np.zeros(9)
    solve_lower(U, 0, x)
    combine_rows(x, U[:9], np.zeros(12))
    close_gap(U, 0, 9, 3)
    move_to_front(U, 1, 9)
    absorb_column(U, 0, x, U[:9], np.zeros(12))
    for m in (0, 3, 9):
        factor, _, _ = _filled(rng, n=9)
        for _ in range(2 * ROOM):
            factor.append(factor.whiten(rng.normal(size=1)), rng.normal(size=(2, 3)))
            factor.drop(m)
    for signature in loop.signatures:
        assert 'NRT_MemInfo_alloc' not in _machine_code(loop.py_func, signature)
    array = next(kind for kind in loop.signatures[0] if isinstance(kind, types.Array))
    with_scratch = _machine_code(lambda x: np.zeros(len(x)), (array,))
    assert 'NRT_MemInfo_alloc' in with_scratch  # so this is how an allocation would look


def test_groups_are_covariances_equal_up_to_a_scale():
    """Same length scales, same signal-to-noise ratio; where Z is zero the noise is the scale."""
    model, _ = random_problem(0, k=2)
    a, b = model.kernels
    double = SquaredExponential(2.0 * a.variance, a.lengthscales, a.inputs)

    def grouped(kernels, noise):
        return [group.outputs for group in output_groups(type(model)(kernels, noise))]

    assert grouped((a, b, double), (0.1, 0.1, 0.2)) == [(0, 2), (1,)]
    assert grouped((a, a, double), (0.1, 0.2, 0.1)) == [(0,), (1,), (2,)]
    assert grouped((None, a, None), (0.1, 0.1, 0.4)) == [(0, 2), (1,)]
    assert output_groups(type(model)((None, None), (0.1, 0.4)))[0].scales == (1.0, 2.0)
