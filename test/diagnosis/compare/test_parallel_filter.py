"""Laws of the one filter for target and columns."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter

RATE = 200.0


def _filter(cutoff=10.0, segments=(slice(0, 600),)):
    return ParallelFilter(RATE, cutoff, tuple(segments))


@pytest.mark.parametrize('cutoff', [3.0, 10.0, 25.0, 90.0])
def test_constants_and_straight_lines_pass(cutoff):
    """Weights of unit sum, symmetric: no gain, no delay."""
    low = _filter(cutoff)
    t = np.arange(600) / RATE
    np.testing.assert_allclose(low.taps.sum(), 1.0)
    np.testing.assert_allclose(low.taps, low.taps[::-1])
    np.testing.assert_allclose(low(np.ones(600)), 1.0)
    np.testing.assert_allclose(low(3.0 * t - 1.0), 3.0 * t[low.rows] - 1.0, atol=1e-12)


def test_half_of_a_sine_at_the_cutoff_passes_and_nothing_far_above():
    """So the cut-off is what it says."""
    low, t = _filter(), np.arange(600) / RATE
    at, above = (low(np.sin(2 * np.pi * f * t)) for f in (10.0, 30.0))
    np.testing.assert_allclose(at, 0.5 * np.sin(20 * np.pi * t[low.rows]), atol=0.01)
    assert np.abs(above).max() < 5e-3


def test_a_column_is_filtered_like_a_target_whatever_stands_beside_it():
    """Linear in its argument, the same for every trailing axis."""
    rng = np.random.default_rng(0)
    low, x = _filter(), rng.normal(size=(600, 2, 3))
    together = low(x)
    for j in range(2):
        np.testing.assert_allclose(low(x[:, j]), together[:, j], atol=1e-14)
        np.testing.assert_allclose(low(x[:, j, 1]), together[:, j, 1], atol=1e-14)
    np.testing.assert_allclose(low(x[:, 0] - 2.0 * x[:, 1]), together[:, 0] - 2 * together[:, 1])


def test_thinning_out_keeps_rows_of_the_full_filter():
    """Every so many rows; about two and a half per period of the cut-off."""
    x = np.random.default_rng(1).normal(size=600)
    low = _filter()
    full = np.convolve(x, low.taps, mode='same')
    np.testing.assert_allclose(low(x), full[low.rows], atol=1e-13)
    assert set(np.diff(low.rows)) == {low.decimation}
    assert 2.0 <= RATE / low.decimation / low.cutoff <= 4.0


def test_no_row_reaches_across_a_pause():
    """A jump between two segments is not seen; segments too short give no rows."""
    low = _filter(segments=(slice(0, 300), slice(300, 320), slice(320, 600)))
    x = np.concatenate([np.zeros(300), np.full(20, 9.0), np.ones(280)])
    parts = [len(kept) for kept in low.kept]
    assert parts[1] == 0
    np.testing.assert_allclose(low(x), np.repeat([0.0, 1.0], [parts[0], parts[2]]), atol=1e-12)


def test_too_short_a_recording_gives_no_rows():
    """Not an error here: who asks decides."""
    low = _filter(segments=(slice(0, 20),))
    assert low(np.ones((20, 2))).shape == (0, 2)


def test_the_correlations_of_filtered_white_noise_are_what_it_says():
    """Between rows out that are none to four apart."""
    low = ParallelFilter(200.0, 16.0, (slice(0, 400_000),))
    rows = low(np.random.default_rng(0).normal(size=400_000))
    measured = [float(rows[i:] @ rows[: len(rows) - i]) / float(rows @ rows) for i in range(5)]
    assert low.correlations(4) == pytest.approx(measured, abs=0.01)
    assert low.correlations(400)[-1] == 0.0


def test_blocks_of_rows_are_filtered_as_the_whole_is():
    """Each from the rows that it needs and no others, across pauses too."""
    x = np.random.default_rng(1).normal(size=(600, 2))
    low = _filter(segments=(slice(0, 250), slice(250, 300), slice(300, 600)))
    found = np.full((len(low.rows), 2), np.nan)
    sizes = []
    for rows, out in low.blocks(7):
        found[out] = low.piece(x[rows], out)
        sizes.append(out.stop - out.start)
    np.testing.assert_allclose(found, low(x), rtol=0, atol=1e-15)
    assert max(sizes) == 7
