"""Errors of the nominal and of the true model on a recording, as the score wants them."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from sgp_proof.concealed import world as worlds

_WIDTH_S, _RATE_HZ = 0.012, 200.0
_SMALLEST = 1e-9


def recording_scores(recording, world, is_held_out):
    """Return nMSE of torque and acceleration per joint for the nominal and the true model."""
    names, balance = recording.joint_names, worlds.Balance.of(recording, world.nominal.mechanism)
    is_driven = [body.is_driven for body in world.bodies]
    scale = np.where(is_driven, balance.given.var(axis=0), balance.diagonal.var(axis=0))
    torque = np.mean((balance.needed - balance.given) ** 2, axis=0) / scale
    predicted, true = balance.predicted, recording.true_acceleration
    acceleration = np.mean((predicted - true) ** 2, axis=0) / true.var(axis=0)
    found = {'torque': _pairs(names, torque), 'acceleration': _pairs(names, acceleration)}
    if is_held_out:
        smooth = _low_passed(recording, predicted), _low_passed(recording, true)
        error = np.mean((smooth[0] - smooth[1]) ** 2, axis=0) / smooth[1].var(axis=0)
        found['acceleration_vs_truth'] = {
            'nominal': dict(zip(names, error.tolist(), strict=True)),
            'oracle': dict.fromkeys(names, _SMALLEST),
        }
    return found


def nominal_share(recording, world):
    """Return the nMSE of the nominal torque from true signals, per joint."""
    return recording_scores(recording, world, is_held_out=False)['torque']


def _pairs(names, values):
    return {
        name: {'nominal': float(value), 'oracle': _SMALLEST}
        for name, value in zip(names, values, strict=True)
    }


def _low_passed(recording, signal):
    t = 1e-9 * (recording.stamps_ns - recording.stamps_ns[0])
    grid = np.arange(5 * _WIDTH_S, t[-1] - 5 * _WIDTH_S, 1.0 / _RATE_HZ)
    even = np.column_stack([np.interp(grid, t, x) for x in signal.T])
    return gaussian_filter1d(even, _WIDTH_S * _RATE_HZ, axis=0, mode='nearest')
