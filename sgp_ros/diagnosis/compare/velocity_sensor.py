"""Lag of the measured velocity behind the positions.

The velocity field is compared with the derivative of the position, both through one filter. A
first-order low-pass with time constant T shows `v_T`, `T dv_T/dt + v_T = v`; T follows by least
squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # its parts load when they are used

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.compare.trajectory import RawTrajectory
from sgp_ros.diagnosis.criteria import COUNTED_SHARE, EVIDENCE, SENSOR_REST
from sgp_ros.physics.catalogue import VELOCITY_FILTER_LAG
from sgp_ros.robots.observed_motion import ObservedMotion


@dataclass(frozen=True, slots=True)
class SensorLag:
    """A velocity sensor behind a low-pass.

    Attributes:
        joint: index.
        time_constant: [s].
        std: of it.
        share: mean square of what the lag takes away, over the variance of the velocity.
        rest: mean square that it leaves, over that of the difference it explains.
        nats: evidence for it.
    """

    joint: int
    time_constant: float
    std: float
    share: float
    rest: float
    nats: float

    @property
    def is_physics(self) -> bool:
        """Return whether it is large enough, significant, and explains the difference."""
        return self.share > COUNTED_SHARE and self.nats > EVIDENCE and self.rest < SENSOR_REST


def lagged(v: np.ndarray, time_constant: float, step: float) -> np.ndarray:
    """Return v (n,) behind a first-order low-pass, exact for straight lines between samples."""
    if time_constant <= 0.0:
        return v
    x = step / time_constant
    decay = np.exp(-x)
    ramp = (1.0 - decay) / x
    b = [1.0 - ramp, ramp - decay]
    start = [decay * v[0] + b[1] * v[0]]
    return np.asarray(scipy.signal.lfilter(b, [1.0, -decay], v, zi=start)[0])


def known_lag(raw: RawTrajectory, motion: ObservedMotion, joint: int) -> np.ndarray:
    """Return the velocity of a joint behind the lags that the nominal robot states, (n,)."""
    v = motion.velocity[:, joint]
    for effect in raw.stated:
        if effect.effect is VELOCITY_FILTER_LAG and effect.place.joint == joint:
            v = lagged(v, effect.numbers['time_constant'], motion.step)
    return v


def sensor_lags(raw: RawTrajectory, equations: Equations) -> list[SensorLag]:
    """Return the lag of each joint's velocity, none without measured velocities."""
    if raw.velocity is None:
        return []
    motion, low = equations.motion, equations.filter
    found = []
    for j in range(motion.tree.size):
        true, shown = known_lag(raw, motion, j), low(raw.velocity[:, j])

        def rest(T: float, true: np.ndarray = true, shown: np.ndarray = shown) -> float:
            return float(((shown - low(lagged(true, T, motion.step))) ** 2).mean())

        best = scipy.optimize.minimize_scalar(rest, bounds=(0.0, 0.3), method='bounded',
                                        options={'xatol': 1e-6})  # fmt: skip
        T = float(best.x)
        before, after = rest(0.0), rest(T)
        floor = 1e-6 * float(low(true).var()) + 1e-300
        step = max(1e-2 * T, 1e-5)
        slope = low(lagged(true, T + step, motion.step) - lagged(true, T, motion.step)) / step
        N = len(shown)
        gone = float((low(true - lagged(true, T, motion.step)) ** 2).mean())
        found.append(SensorLag(
            j, T, float(np.sqrt(after / max(float(slope @ slope), 1e-300))),
            gone / max(float(low(true).var()), 1e-300), after / max(before, 1e-300),
            0.5 * N * float(np.log((before + floor) / (after + floor))) - 0.5 * float(np.log(N)),
        ))  # fmt: skip
    return found
