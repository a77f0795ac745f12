"""The compiled loops of the gates against the same in NumPy, and what a saved gate keeps."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sgp_ros.engine import gate_loops
from sgp_ros.engine.gate import Gate

K, M = 3, 9
LIMITS = 0.3, 30.0, 5


@pytest.fixture
def rng():
    return np.random.default_rng(4)


def test_roughness_is_the_deleted_residual_beside_the_range(rng):
    signal, followed = rng.normal(size=(2, M, K))
    followed[:, 1] = signal[:, 1] * (1.0 + 1e-14)  # rounding is no distance
    others = rng.uniform(0.1, 1.0, size=M)
    found = np.full((2, 2 * K), -1.0)
    gate_loops.fill_roughness(signal, followed, others, K, found)
    distance = (np.abs(signal - followed) / others[:, None]).max(axis=0)
    distance[1] = 0.0
    np.testing.assert_array_equal(found[:, K:], [distance, np.ptp(signal, axis=0)])
    np.testing.assert_array_equal(found[:, :K], -1.0)


@pytest.mark.parametrize('distance', [0.2, 0.4, 5.0])
def test_a_window_is_rough_by_range_and_by_median(rng, distance):
    usual = rng.uniform(0.05, 0.15, size=(K, 31))
    known = np.array([3, 6, 100])
    for span in (0.0, 1.0, 2.0):
        for j in range(K):
            rough = np.zeros((2, K))
            rough[:, j] = distance, span
            median = np.median(usual[j, : known[j]])
            expected = known[j] >= 5 and distance > 0.3 * span > 0.0 and distance > 30.0 * median
            assert gate_loops.is_far_off(rough, usual, known, LIMITS) == expected


def test_errors_are_held_against_the_larger_deviation(rng):
    for _ in range(50):
        errors, n = 10.0 * rng.normal(size=K), rng.integers(0, 60, size=K)
        variance, square = rng.uniform(0.0, 2.0, size=(2, K)) ** 4
        held = rng.random(K) < 0.3
        known = ~held & (n >= 30)
        expected = np.abs(errors[known]) > 20.0 * np.sqrt(np.maximum(variance, square)[known])
        found = gate_loops.is_beyond(errors, variance, held, square, n, (20.0, 30))
        assert found == expected.any()


def test_mean_squares_are_means_and_then_fade(rng):
    errors = rng.normal(size=(300, K))
    held = np.array([False, True, False])
    square, n = np.zeros(K), np.zeros(K, dtype=np.int64)
    for row in errors:
        gate_loops.take_errors(row, held, square, n, 400)
    np.testing.assert_allclose(square, (errors**2).mean(axis=0) * ~held, rtol=1e-12)
    before = square.copy()
    gate_loops.take_errors(errors[0], held, square, n, 10)
    np.testing.assert_allclose(
        square[~held], (before + (errors[0] ** 2 - before) / 10)[~held], rtol=1e-12
    )


@pytest.mark.parametrize('which', range(4))
def test_each_bound_is_tested_and_no_number_is_within_none(rng, which):
    bounds = np.array([[-1.0] * K, [1.0] * K, [2.0] * K, [3.0] * K])
    state = [rng.uniform(-1.0, 1.0, size=K) for _ in range(3)]
    assert gate_loops.is_within(*state, bounds)
    wrong = [-1.1, 1.1, -2.1, 3.1][which]
    for value in (wrong, np.nan):
        spoiled = [x.copy() for x in state]
        spoiled[max(which - 1, 0)][1] = value
        assert not gate_loops.is_within(*spoiled, bounds)
    nothing = gate_loops.NOTHING
    assert gate_loops.is_within(state[0], nothing, nothing, bounds)


@pytest.mark.parametrize('windows', [4, 31, 75])
def test_a_saved_gate_goes_on_with_the_same_windows(rng, windows):
    """Before its memory is full, when it just is, and when the oldest ones were replaced."""
    rows = rng.uniform(0.1, 1.0, size=(windows + 40, 2, 2 * K))
    gate = Gate(K)
    kept = [[] for _ in range(2 * K)]
    for row in rows[:windows]:
        gate_loops.keep_distances(row, gate.usual, gate.known)
        for known, distance in zip(kept, row[0], strict=True):
            known[:] = [*known, distance][-31:]
    state = json.loads(json.dumps(gate.state()))
    assert state['usual'] == kept
    again = Gate(K)
    again.restore(state)
    for row in rows[windows:]:
        for one in (gate, again):
            gate_loops.keep_distances(row, one.usual, one.known)
        assert again.state() == gate.state()
