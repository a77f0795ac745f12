"""Rank, base parameters and identifiability of regressors whose null space is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.rigid.base_parameters import RegressorFactor, base_parameters, rank_tolerance

SEEDS = st.integers(0, 2**32 - 1)


def _regressor(seed, n=60, p=9, rank=5):
    """A regressor of known rank, its columns in units that differ by eight orders."""
    rng = np.random.default_rng(seed)
    units = 10.0 ** rng.uniform(-4.0, 4.0, size=p)
    return rng.normal(size=(n, rank)) @ rng.normal(size=(rank, p)) * units


def _names(p):
    return [f'w{i}' for i in range(p)]


@given(SEEDS)
def test_rank_is_found_whatever_the_units(seed):
    """Columns are scaled before any of them is called small."""
    assert base_parameters(_regressor(seed), _names(9)).rank == 5


@given(SEEDS)
def test_base_parameters_predict_what_all_parameters_predict(seed):
    """`F w = F[:, independent] beta`, to the error that the base's condition allows."""
    F = _regressor(seed)
    base = base_parameters(F, _names(9))
    w = np.random.default_rng(seed).normal(size=9) / base.scale
    predicted = F[:, base.independent] @ (base.combinations @ w)
    bound = 1e3 * np.finfo(float).eps * base.condition * np.linalg.norm(base.scale * w)
    assert np.linalg.norm(predicted - F @ w) <= bound


@given(SEEDS)
def test_the_null_space_is_invisible_in_every_row(seed):
    """As many directions as the rank lacks, and the regressor gives zero along each."""
    F = _regressor(seed)
    base = base_parameters(F, _names(9))
    assert base.null.shape == (9, 4)
    assert np.linalg.norm(F @ base.null) <= base.tolerance * 4
    assert np.all(base.determines(base.combinations))


@given(SEEDS)
def test_a_parameter_is_identifiable_where_no_other_can_take_its_place(seed):
    """Leaving out its column costs rank exactly then."""
    F = _regressor(seed, rank=3)
    F[:, 7:] = np.random.default_rng(seed + 1).normal(size=(60, 2))
    base = base_parameters(F, _names(9))
    without = [base_parameters(np.delete(F, j, axis=1), _names(8)).rank for j in range(9)]
    assert base.rank == 5
    assert list(base.identifiable) == [rank == 4 for rank in without]
    assert list(base.identifiable) == [False] * 7 + [True] * 2


@given(SEEDS, st.lists(st.integers(1, 59), max_size=5))
def test_chunks_give_what_the_whole_regressor_gives(seed, cuts):
    """A long recording needs no long matrix."""
    F = _regressor(seed)
    factor = RegressorFactor.nothing(9)
    for chunk in np.split(F, sorted(cuts)):
        factor = factor.with_rows(chunk)
    in_chunks, whole = factor.base_parameters(_names(9)), base_parameters(F, _names(9))
    assert factor.rows == 60
    assert in_chunks.rank == whole.rank
    assert np.allclose(in_chunks.scale, whole.scale, rtol=1e-12)
    assert np.allclose(in_chunks.singular_values, whole.singular_values, atol=whole.tolerance)
    assert list(in_chunks.identifiable) == list(whole.identifiable)


def test_combinations_are_said_in_words():
    """Independent parameter first; factors of one are left out, identifiable ones stand alone."""
    a, b, c = np.random.default_rng(0).normal(size=(3, 20))
    F = np.column_stack([3.0 * a, 0.3 * 3.0 * a, b, -c, c, 0.0 * a])
    base = base_parameters(F, ['mx', 'mass', 'Izz', 'up', 'down', 'still'])
    assert base.rank == 3
    assert base.texts[1] == 'Izz'
    assert base.texts[0] in {'mx + 0.3 * mass', 'mass + 3.33333 * mx'}
    assert base.texts[2] in {'up - down', 'down - up'}
    assert list(base.identifiable) == [False, False, True, False, False, False]


def test_noise_in_the_motion_does_not_pass_for_excitation():
    """A tolerance that knows the error of the columns finds the rank below the noise."""
    F = _regressor(1, n=2000)
    base = base_parameters(F, _names(9))
    noisy = F + 1e-4 * base.scale / np.sqrt(2000) * np.random.default_rng(2).normal(size=F.shape)
    assert base_parameters(noisy, _names(9)).rank == 9
    tolerance = rank_tolerance(2000, 9, relative_error=1e-4)
    assert base_parameters(noisy, _names(9), tolerance=tolerance).rank == 5


def test_nothing_moves_nothing_is_known():
    """Without rows, or with zeros alone, the rank is zero and no parameter identifiable."""
    for base in (
        RegressorFactor.nothing(3).base_parameters(_names(3)),
        base_parameters(np.zeros((7, 3)), _names(3)),
    ):
        assert base.rank == 0
        assert not base.identifiable.any()
        assert base.texts == ()
        assert base.null.shape == (3, 3)
    assert base_parameters(np.zeros((7, 0)), []).rank == 0


def test_wrong_shapes_are_refused():
    """Names and columns belong together, and so do chunks."""
    with pytest.raises(ValueError, match='2 names'):
        base_parameters(np.ones((4, 3)), ['a', 'b'])
    with pytest.raises(ValueError, match='finite'):
        base_parameters(np.full((4, 1), np.nan), ['a'])
    with pytest.raises(ValueError, match='3 columns'):
        RegressorFactor.nothing(3).with_rows(np.ones((2, 4)))
