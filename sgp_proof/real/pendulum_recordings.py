"""What the benchmarks of the pendulums share: smooth motion, regression start, rows of scores."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import signal

from sgp_ros.batch.rollout_windows import cut_windows
from sgp_ros.physics.term import Motion

SMOOTHING_HZ = 25.0
GRID = 0.002
STEP = 0.004


@dataclass(frozen=True)
class Run:
    """A recording on a uniform grid: q and tau as measured, the others zero-phase low-passed."""

    name: str
    time: np.ndarray
    q: np.ndarray
    tau: np.ndarray
    motion: Motion

    def windows(self, horizon, stride, step=STEP):
        """Roll-outs start at the measured position and the smoothed velocity."""
        return cut_windows(
            self.time, self.q, self.motion.velocity, self.tau, horizon, stride, step
        )


def read_run(name, time, q, tau):
    """Bring (s, k) arrays to the grid and smooth them forwards and backwards."""
    grid = np.arange(time[0], time[-1], GRID)
    q, tau = (
        np.stack([np.interp(grid, time, column) for column in x.T], axis=1) for x in (q, tau)
    )
    low_pass = signal.butter(2, 2.0 * GRID * SMOOTHING_HZ, output='sos')

    def smooth(x):
        return signal.sosfiltfilt(low_pass, x, axis=0)

    position = smooth(q)
    velocity = np.gradient(position, GRID, axis=0)
    acceleration = smooth(np.gradient(velocity, GRID, axis=0))
    return Run(name, grid, q, tau, Motion(position, velocity, acceleration, smooth(tau)))


def with_terms(robot, n):
    """The robot with the first n of its terms."""
    return replace(robot, terms=robot.terms[:n])


def regression(robot, runs):
    """Least squares on the inverse model, every tenth sample, ends left out."""
    rows, targets = [], []
    for run in runs:
        inner = slice(50, -50, 10)
        m = run.motion
        part = Motion(m.position[inner], m.velocity[inner], m.acceleration[inner], m.effort[inner])
        rows.append(robot.regressor(part).reshape(-1, len(robot.coefficients)))
        targets.append(part.effort.ravel())
    return np.linalg.lstsq(np.concatenate(rows), np.concatenate(targets), rcond=None)[0]


def row(score):
    """A score as it goes into a result file."""
    return {
        'horizon_s': score.horizon, 'rollouts': score.n, 'diverged': score.diverged,
        'nmse_path': score.nmse_path.tolist(), 'nmse_end': score.nmse_end.tolist(),
        'rms_path_rad': score.rms_path.tolist(), 'rms_end_rad': score.rms_end.tolist(),
    }  # fmt: skip


def parameters(robot, fit):
    """Coefficients with their units and standard deviations, null where there is none."""
    return {
        c.name: {
            'value': float(value),
            'std': float(std) if np.isfinite(std) else None,
            'unit': c.unit,
        }
        for c, value, std in zip(robot.coefficients, fit.W, fit.std, strict=True)
    }
