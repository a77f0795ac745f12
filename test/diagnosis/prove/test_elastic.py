"""Roll-outs of a robot with a spring between motor and link."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.prove.rollouts import cut, roll_out
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.robots.gains import Gains
from test.physics.test_elasticity import LAW, SPRING, equations

GAINS = Gains(np.array([20.0, 5.0]), np.array([1.0, 0.2]), holds_gravity=False)


@pytest.mark.parametrize('gains', [None, GAINS], ids=['efforts', 'drives'])
@pytest.mark.parametrize('encoder', ['motor', 'link'])
def test_a_spring_is_rolled_out_with_its_states(encoder, gains):
    """With a resonance of the bandwidth every window ends, where the encoder is, at its place."""
    found = equations(encoder)
    truth = EffectAt.stated(LAW, 'elbow', SPRING | {'encoder': encoder}, found.motion.tree)
    start = np.sqrt((found.d**2).mean(axis=0)) + 1e-9
    windows = cut(found.motion, 40)
    left = []
    for effects in ((), (truth,)):
        model = fit(Columns(found), effects, start, is_free=False)
        q, is_settled = roll_out(windows, model, found, gains=gains)
        assert is_settled.all()
        left.append(windows.squared(q).sum(axis=0)[1] / windows.held.sum(axis=0)[1])
    assert left[1] < 0.02 * left[0]
