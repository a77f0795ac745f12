"""Law of units: efforts in another unit give the same answer in that unit."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import JointSample, frozen_array
from test.engine.worlds import INVERSE_PENDULUM, START_NS, config, motion


def _run(scale):
    engine, found = Engine(INVERSE_PENDULUM, config(INVERSE_PENDULUM)), []
    t, positions, _, effort = motion(400, 100.0, 0, 1e-5)
    events = [
        JointSample(START_NS + round(a * 1e9), ('hinge',), frozen_array([q]), None,
                    frozen_array([m * scale]))
        for a, q, m in zip(t, positions, effort, strict=True)
    ]  # fmt: skip
    replay(engine, events, lambda step: found.extend(step.estimates))
    mean = np.array([e.effort.mean[0] for e in found]) / scale
    std = np.sqrt([e.effort.raw_variance[0] for e in found]) / scale
    return engine, np.array([mean, std]), [p.value / scale for p in engine.parameters()]


@pytest.mark.parametrize('scale', [1e-12, 1e12])
def test_scaled_efforts_give_the_scaled_answer(scale):
    """Fits of hyper-parameters end within their tolerance of each other, all else in rounding."""
    engine, expected, values = _run(1.0)
    other, found, scaled = _run(scale)
    assert other.counts == engine.counts
    assert engine.counts.refits > 0
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4 * np.nanstd(expected[0]))
    np.testing.assert_allclose(scaled, values, rtol=1e-4)
    learned = other.hyper_settings()
    taken = EngineConfig.from_mapping(learned, INVERSE_PENDULUM).to_mapping()
    assert {name: taken[name] for name in learned} == learned
