"""Both sides of the equation of motion along a simulated recording, and errors of its models."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from sgp_ros.physics.drawing import PilotRun

WIDTH_S, RATE_HZ = 0.012, 200.0
"""Low-pass under which accelerations are compared: standard deviation of a Gaussian, and rate."""
_SMALLEST = 1e-9


@dataclass(frozen=True)
class Balance:
    """Both sides of the equation of a robot without effects along the motion of the encoders.

    Attributes:
        given: (n, k) the command in force at each sample [N m or N].
        needed: (n, k) `M a - h` [N m or N].
        diagonal: (n, k) `M_jj a_j`, the measure of force on a joint without a motor [N m or N].
        predicted: (n, k) accelerations under the command [rad/s^2 or m/s^2].
    """

    given: np.ndarray
    needed: np.ndarray
    diagonal: np.ndarray
    predicted: np.ndarray

    @classmethod
    def of(cls, recording, mechanism):
        """Evaluate a mechanism at each sample."""
        positions, velocities = recording.shown_position, recording.shown_velocity
        pairs = [mechanism.dynamics(q, v) for q, v in zip(positions, velocities, strict=True)]
        inverse_mass, force = (np.array(x) for x in zip(*pairs, strict=True))
        mass, a = np.linalg.inv(inverse_mass), recording.true_acceleration
        stamps = recording.command_stamps_ns
        index = np.searchsorted(stamps, recording.stamps_ns, side='right') - 1
        given = recording.command[np.maximum(index, 0)] * (index >= 0)[:, np.newaxis]
        given = np.array([mechanism.drive(u, v) for u, v in zip(given, velocities, strict=True)])
        return cls(
            given,
            np.einsum('nij,nj->ni', mass, a) - force,
            np.einsum('njj,nj->nj', mass, a),
            np.einsum('nij,nj->ni', inverse_mass, given + force),
        )


def pilot_motion(recording, world):
    """Return the rms values of a recording that effects are sized by."""
    balance = Balance.of(recording, world.true.mechanism)
    is_driven = [body.is_driven for body in world.bodies]
    effort = np.where(is_driven, balance.given.std(axis=0), balance.diagonal.std(axis=0))
    q = recording.shown_position
    return PilotRun(
        effort + 1e-9, recording.shown_velocity.std(axis=0) + 1e-9,
        recording.true_acceleration.std(axis=0) + 1e-9, q.std(axis=0) + 1e-9,
        q.min(axis=0), q.max(axis=0), q,
    )  # fmt: skip


def recording_scores(recording, world, is_held_out):
    """Return nMSE of torque and acceleration per joint for the nominal and the true model."""
    names, balance = recording.joint_names, Balance.of(recording, world.nominal.mechanism)
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
    return low_passed(np.arange(5 * WIDTH_S, t[-1] - 5 * WIDTH_S, 1.0 / RATE_HZ), t, signal)


def low_passed(grid, t, signal):
    """Return a signal (n, k) at times t (n,) low-passed on an even grid (m,), (m, k)."""
    even = np.column_stack([np.interp(grid, t, x) for x in signal.T])
    return gaussian_filter1d(even, WIDTH_S * RATE_HZ, axis=0, mode='nearest')
