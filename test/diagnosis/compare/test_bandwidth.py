"""The band that noise of encoders leaves."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.bandwidth import (
    LOWEST_CUTOFF_HZ,
    NOISE_SHARE,
    USUAL_CUTOFF_HZ,
    choose_bandwidth,
)
from sgp_ros.diagnosis.compare.trajectory import Bandwidth, collect, observe
from sgp_ros.diagnosis.criteria import SLIGHT_REST
from test.diagnosis.worlds import events_of

STEP = 0.025


@pytest.fixture
def slow(robots, perfect):
    """A joint on a vertical axis that turns at a frequency [Hz] for so many seconds."""
    robot, tree = robots[1]
    level = replace(tree, gravity=np.zeros(3))
    raw = collect(events_of(perfect[1]), robot)

    def make(frequency_hz, seconds, sigma):
        t = STEP * np.arange(int(seconds / STEP))
        position = np.sin(2.0 * math.pi * frequency_hz * t)[:, None]
        noise = np.random.default_rng(1).normal(0.0, sigma, position.shape)
        whole = replace(
            raw, time=t, step=STEP, position=position, velocity=None, drive=None,
            segments=(slice(0, len(t)),), effort=np.zeros_like(position),
            noise_density=np.array([2.0 * sigma**2 * STEP]), recording=None,
        )  # fmt: skip
        effort = observe(whole, level, Bandwidth(4.0, 10.0)).nominal_effort
        return replace(whole, position=position + noise, effort=effort), level

    return make


def _noise_share(raw, tree, cutoff):
    """Return the share of the effort that the force of white noise takes below a cut-off."""
    inertia = observe(raw, tree, Bandwidth(4.0, 10.0)).mass_diagonal.mean()
    noise = inertia**2 * (2.0 * math.pi) ** 4 * raw.noise_density[0] / 5.0
    return noise * cutoff**5 / raw.effort.var()


def test_a_slow_machine_is_looked_at_below_the_usual_band(slow):
    """Above, its acceleration would be noise: of that no more is left than nobody takes for a law.

    Noise as large in a faster motion is small, and the usual band stays.
    """
    raw, tree = slow(0.05, 600.0, 1e-3)
    cutoff = choose_bandwidth(raw, tree).cutoff
    assert LOWEST_CUTOFF_HZ < cutoff < 0.5 * USUAL_CUTOFF_HZ
    assert NOISE_SHARE < _noise_share(raw, tree, cutoff) < 1.1 * SLIGHT_REST
    assert _noise_share(raw, tree, USUAL_CUTOFF_HZ) > 10.0 * SLIGHT_REST
    raw, tree = slow(1.0, 600.0, 1e-3)
    assert _noise_share(raw, tree, USUAL_CUTOFF_HZ) < SLIGHT_REST
    assert choose_bandwidth(raw, tree).cutoff >= USUAL_CUTOFF_HZ


def test_a_narrower_band_keeps_the_motion_and_enough_rows(slow):
    """Where it cannot, the noise stays."""
    raw, tree = slow(0.05, 100.0, 1e-3)
    assert choose_bandwidth(raw, tree).cutoff > choose_bandwidth(*slow(0.05, 600.0, 1e-3)).cutoff
    raw, tree = slow(0.05, 40.0, 1e-3)
    assert choose_bandwidth(raw, tree).cutoff == USUAL_CUTOFF_HZ
    raw, tree = slow(2.0, 600.0, 0.1)
    assert _noise_share(raw, tree, USUAL_CUTOFF_HZ) > SLIGHT_REST
    assert choose_bandwidth(raw, tree).cutoff > 2.0
