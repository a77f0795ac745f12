"""Volume of the motion that a residual of the effort stands for, joint by joint.

What is measured is the motion. An error x of it, in the band of the filter, is an error of effort
`L(i omega) x` with `L = -M omega^2 + i omega kd + kp`: the log density of a motion has log |L|,
averaged over the band, as a term, see `Equations.inertia`. Under given efforts that is the
inertia. A drive that holds position targets stiffly in that band makes it its gains, and no model
gains from an inertia that the motion does not show.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.physics.servo import Servo
from sgp_ros.robots.observed_motion import ObservedMotion

_LINES = 16
"""Frequencies of the band, spread evenly."""


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """Drives and inertias that hold the motion of k joints within a band.

    Attributes:
        inertia: (k,) nominal [kg m^2 or kg].
        kp, kd: (k,) stated gains of the drives, 0 of none [N m/rad or N/m, and by s].
        omega: (`_LINES`,) frequencies [rad/s].
    """

    inertia: np.ndarray
    kp: np.ndarray
    kd: np.ndarray
    omega: np.ndarray

    @classmethod
    def of(cls, motion: ObservedMotion, cutoff: float) -> Loop:
        """Return the loop of a motion in the band below a cut-off [Hz]."""
        inertia = motion.mass_diagonal.mean(axis=0)
        kp, kd = np.zeros((2, len(inertia)))
        if isinstance(motion.drive, Servo):
            kp, kd = _gains(motion.drive)
        omega = 2.0 * np.pi * cutoff * (np.arange(_LINES) + 0.5) / _LINES
        return cls(inertia, kp, kd, omega)

    @property
    def is_closed(self) -> bool:
        """Whether drives hold positions, so that their gains bound the error of a motion."""
        return bool(self.kp.any())

    def volume(
        self, inertia: np.ndarray, kp: np.ndarray | float = 1.0, kd: np.ndarray | float = 1.0
    ) -> np.ndarray:
        """Return the mean of log |L / L nominal|, (k,).

        Args:
            inertia: (k,) log of the inertia relative to the nominal one; of a motion that was
                recorded in another unit, of the inertia by that unit.
            kp: gains relative to those stated.
            kd: the same of the rates.
        """
        if not np.isfinite(inertia).all() or not self.is_closed:
            return inertia
        return self._log(self.inertia * np.exp(inertia), kp * self.kp, kd * self.kd) - self._log(
            self.inertia, self.kp, self.kd
        )

    def _log(self, inertia: np.ndarray, kp: np.ndarray, kd: np.ndarray) -> np.ndarray:
        w = self.omega[:, None]
        square = (kp - inertia * w * w) ** 2 + (kd * w) ** 2
        return np.asarray(0.5 * np.log(np.maximum(square, 1e-300)).mean(axis=0))


def log_inertia(M: np.ndarray, nominal: np.ndarray) -> np.ndarray:
    """Return the log of the inertia at each joint, relative to the nominal one, (k,).

    Their sum is the mean of log det(M / nominal); joints differ by the diagonal of M. Minus
    infinity where a mass matrix is not positive, infinity where the nominal robot has a joint
    without inertia.

    Args:
        M: mass matrices of some poses, (poses, k, k) [kg m^2 or kg].
        nominal: those of the nominal robot.
    """
    if not np.isfinite(M).all() or np.linalg.eigvalsh(M)[:, 0].min() <= 0.0:
        return np.full(M.shape[1], -np.inf)
    before, now = (np.diagonal(x, 0, 1, 2) for x in (nominal, M))
    if (before <= 0.0).any():
        return np.full(M.shape[1], np.inf)
    whole = (np.linalg.slogdet(M)[1] - np.linalg.slogdet(nominal)[1]).mean()
    own = np.log(now / before).mean(axis=0)
    return np.asarray(own + (whole - own.sum()) / len(own))


def _gains(drive: Servo) -> np.ndarray:
    """Return kp and kd of a drive, (2, k), the means of recorded ones."""
    gains, k = np.stack([drive.kp, drive.kd]), len(drive.kp)
    if not drive.is_recorded:
        return gains
    recorded = [drive.targets.effort(j).mean() for j in range(2 * k, 4 * k)]
    return np.asarray(gains * np.reshape(recorded, (2, k)))


def part_of_noise(noise: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return what part of discrepancies d (N, k) noise of mean squares (k,) makes, (k,)."""
    return np.asarray(np.minimum(noise / np.maximum((d**2).mean(axis=0), 1e-300), 1.0))


def noisy_volume(volume: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return logarithms of the units of residuals, (k,), part of which is noise of efforts.

    Only the part that the motion shows is measured in units of motion.
    """
    if not np.isfinite(volume).all():  # bodies that cannot be
        return volume
    return np.asarray(0.5 * np.log(part + (1.0 - part) * np.exp(2.0 * volume)))


def carried_inertia(
    motion: ObservedMotion, low: ParallelFilter, inertial: np.ndarray, d: np.ndarray
) -> np.ndarray:
    """Return the log of the inertia that efforts show, relative to the nominal one, (k,).

    A rotor behind a gear can be hundreds of times the link that it turns, and what a perfect model
    leaves is relative to it. It is the slope of the discrepancy over the acceleration, beside
    those of other joints, gravity, a spring, and friction; never below the nominal one.

    Args:
        motion: n rows.
        low: from n to N rows.
        inertial: (N, k) forces of each joint's own acceleration, nominal [N m or N].
        d: (N, k) discrepancy [N m or N].
    """
    found = np.zeros(d.shape[1])
    if motion.is_static:
        return found
    q, v = motion.position, motion.velocity
    states = [low(x) for x in (np.ones_like(q), q, np.sin(q), np.cos(q), v, np.sign(v))]
    for j in np.flatnonzero(motion.tree.is_actuated[: len(found)] & motion.moves):
        others = np.delete(inertial, j, axis=1)
        x = np.column_stack([inertial[:, j], *(s[:, j] for s in states), others])
        x = x / np.maximum(np.sqrt((x**2).mean(axis=0)), 1e-300)
        size = max(np.sqrt((inertial[:, j] ** 2).mean()), 1e-300)
        slope = np.linalg.lstsq(x, d[:, j], rcond=1e-6)[0][0] / size
        found[j] = np.log(max(1.0 - slope, 1.0))
    return found
