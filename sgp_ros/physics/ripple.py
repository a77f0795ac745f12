"""Ripple that held targets put on the motion between samples, as the samples show it.

A target that is held for h and followed by a drive of the gains kp, kd is its mean, half a step
late, and a sawtooth e of the slope -s, where s is the speed of the target. The loop answers it by
a motion r that repeats every h, `M r'' + kd r' + kp r = kp e`. Samples at the rate of the targets
meet it at one phase phi, where it looks like motion that is slow:

    e(phi) = s h / pi sum_m sin(w_m phi) / m,    w_m = 2 pi m / h,
    r(phi) = h / pi sum_m Im(exp(i w_m phi) (Kp - w_m^2 M + i w_m Kd)^-1 Kp s) / m.

At 500 Hz that is nothing. At 50 Hz a stiff drive seems to be late by a hundredth of h at the
instants of new targets, and by more at other phases.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

_HARMONICS = 8
"""The m-th is smaller than the first by m^3."""
_SLIGHT = 0.02
"""Stiffness `h^2 M^-1 kp` below which the ripple is less than 2e-4 h of lateness [1]."""
_SAME = 0.02
"""Difference of rates up to which samples meet one phase for a while [1]."""


@dataclass(frozen=True, slots=True, eq=False)
class Ripple:
    """The ripple of a drive's targets, by its harmonics.

    Attributes:
        turns: (n,) `exp(i w_1 phi)` for the time since the target in force, without a delay [1].
        hold: h, the time for which a target holds [s].
        harmonics: (m, k, n) complex amplitudes [rad or m].
    """

    turns: np.ndarray
    hold: float
    harmonics: np.ndarray

    @classmethod
    def of(
        cls, times: np.ndarray, targets: np.ndarray, rows: np.ndarray, step: float,
        gains: tuple[np.ndarray, np.ndarray], mass: np.ndarray,
    ) -> Ripple | None:  # fmt: skip
        """Return the ripple of a recording; None where samples do not show it.

        Args:
            times: of the targets (c,) [s].
            targets: positions (c, k) [rad or m].
            rows: times of the samples (n,) [s].
            step: between these [s].
            gains: kp, kd of each joint, (k,) [N m/rad, N m s/rad].
            mass: matrices at the samples, (n, k, k) [kg m^2 or kg].
        """
        kp, kd = gains
        h = float(np.median(np.diff(times)))
        stiffness = h * h * np.linalg.solve(mass, np.diag(kp))
        if abs(h / step - 1.0) > _SAME or np.abs(stiffness).max() < _SLIGHT:
            return None
        at = np.clip(
            np.searchsorted(times, rows + _SAME * step, side='right') - 1, 0, len(times) - 2
        )
        slope = (targets[at + 1] - targets[np.maximum(at - 1, 0)]) / (2.0 * h)
        found = []
        for m in range(1, _HARMONICS + 1):
            w = 2.0 * np.pi * m / h
            loop = np.diag(kp + 1j * w * kd) - w * w * mass
            answer = np.linalg.solve(loop, (kp * slope)[..., None])[..., 0]
            found.append(h / (np.pi * m) * answer.T)
        return cls(np.exp(2j * np.pi * (rows - times[at]) / h), h, np.array(found))

    def on(self, pick: np.ndarray) -> Ripple:
        """Return the ripple at some of the samples, by their indices."""
        return replace(self, turns=self.turns[pick], harmonics=self.harmonics[:, :, pick])

    def at(self, joint: int, delay: float) -> np.ndarray:
        """Return what the samples show of one joint behind targets of a delay, (n,) [rad or m]."""
        late = math.ceil(delay / self.hold - 1e-6)
        turns = self.turns * np.exp(-2j * np.pi * delay / self.hold)
        return _sum(turns, self.harmonics[:, joint], late)


@njit(cache=True)
def _sum(turns: np.ndarray, harmonics: np.ndarray, late: int) -> np.ndarray:
    """Return the sum of all harmonics (m, n) of `late` rows before, at their phases (n,)."""
    n = len(turns)
    found = np.empty(n)
    for row in range(n):
        there = min(max(row - late, 0), n - 1)
        shown = 0j
        for m in range(len(harmonics) - 1, -1, -1):
            shown = (shown + harmonics[m, there]) * turns[row]
        found[row] = shown.imag
    return found
