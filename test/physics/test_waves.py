"""The transform over positions: bounded whatever the positions are."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.physics.waves import Wave


def _strongest(span, rate=5.0, n=2000):
    phase = np.sort(np.random.default_rng(0).uniform(0.0, span, n))
    wave = Wave(phase, (np.ones((n, 1)),), 0.9, 12.0)
    return wave.strongest(np.arange(n), np.sin(rate * phase)[:, None], np.ones(1))


def test_the_period_of_a_wave_is_found():
    assert _strongest(6.0)[0, 0] == pytest.approx(5.0, abs=0.2)


@pytest.mark.parametrize('span', [1e6, 1e12, 1e29, 1e300])
def test_positions_that_no_rows_resolve_cost_no_memory(span, monkeypatch):
    """Counts of an encoder for radians: such waves are not looked for."""
    monkeypatch.setattr(np.fft, 'rfft', None)
    np.testing.assert_allclose(_strongest(span, rate=0.0), [[0.9], [12.0]])
