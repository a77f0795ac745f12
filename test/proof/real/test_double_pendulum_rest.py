"""Columns that are a law of the machine predict runs that were left out; others do not."""

import numpy as np

from sgp_proof.real.double_pendulum_rest import left


def _worlds():
    rng = np.random.default_rng(5)
    bodies, law, other = (rng.normal(size=(200, 2, c)) for c in (3, 1, 1))
    noise = 0.1 * rng.normal(size=(200, 2))
    y = bodies @ np.array([0.5, -1.0, 0.2]) + 2.0 * law[:, :, 0] + noise
    return y, bodies, law, other, np.repeat(np.arange(4), 50)


def test_a_law_leaves_the_noise_of_runs_left_out():
    y, bodies, law, _, run = _worlds()
    learned, outside, found = left(y, bodies, law, run)
    np.testing.assert_allclose(found, [0.5, -1.0, 0.2, 2.0], atol=0.03)
    np.testing.assert_allclose(learned, 0.01, rtol=0.3)
    np.testing.assert_allclose(outside, 0.01, rtol=0.3)


def test_another_column_leaves_the_law():
    y, bodies, _, other, run = _worlds()
    assert (left(y, bodies, other, run)[1] > 3.0).all()


def test_a_column_that_every_run_needs_differently_is_no_law():
    y, bodies, law, _, run = _worlds()
    y = y + law[:, :, 0] * np.where(run % 2, 3.0, -3.0)[:, None]
    learned, outside, _ = left(y, bodies, law, run)
    assert (outside > 1.2 * learned).all()


def test_a_column_of_zeros_changes_nothing():
    y, bodies, law, _, run = _worlds()
    with_zeros = np.concatenate([law, np.zeros_like(law)], axis=2)
    plain, padded = left(y, bodies, law, run), left(y, bodies, with_zeros, run)
    for one, two in zip(plain[:2], padded[:2], strict=True):
        np.testing.assert_allclose(one, two)
    np.testing.assert_allclose(np.append(plain[2], 0.0), padded[2], atol=1e-9)
