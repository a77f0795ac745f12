"""Gain of the likelihood with the inertia of joints without a motor, as a slope in w.

The equation of a joint without a motor holds for bodies of any size: `s (M a + b) = s tau_x` for
every s, and a body of no size leaves nothing of it. What is measured is the motion, whose density
has the inertia as a factor, `N log I - N log(rms of the rest)`, which no s changes. Least squares
at a given scale of the rows see the second term alone, and would shrink the bodies without end.
So they get the first one as a linear term, `kappa log I(w)` at the bodies where they start:
`kappa = N (mean square of the rest there) / sigma^2` holds s still, and other joints and the prior
may move it.
"""

from __future__ import annotations

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.rigid.rigid_body import torque_regressor
from sgp_ros.robots.observed_motion import ObservedMotion

_LEAST = 1e-6
"""Of the nominal inertia, the least that bodies are taken for."""


class InertiaSlope:
    """Inertia of the joints without a motor that move, as a linear function of the bodies.

    Args:
        equations: of the recording.

    Attributes:
        joints: without a motor that move, indices.
    """

    def __init__(self, equations: Equations) -> None:
        tree, (still, *pushed) = equations.motion.tree, equations.poses
        self.joints = np.flatnonzero(~tree.is_actuated[: tree.size] & equations.motion.moves)
        self._nominal, self._change = [], []
        for j in self.joints.tolist():
            Y = (_regressor(pushed[j]) - _regressor(still))[:, j]
            change = np.zeros((len(Y), equations.size))
            change[:, equations.instants :] = Y @ equations.directions.T
            self._nominal.append(Y @ tree.parameters.ravel())
            self._change.append(change)

    def _ratios(self, w: np.ndarray) -> np.ndarray:
        """Return inertia by the nominal one, (joints, poses)."""
        return np.array(
            [
                1.0 + change @ w / nominal
                for change, nominal in zip(self._change, self._nominal, strict=True)
            ]
        )

    def pull(
        self, w: np.ndarray, found: np.ndarray, mean_square: np.ndarray, sigma: np.ndarray, N: int
    ) -> np.ndarray:
        """Return the slope at bodies w, (p,).

        Args:
            w: (p,) bodies where it holds the inertia.
            found: (p,) those of a fit, which may be smaller.
            mean_square: (k,) of what that fit leaves.
            sigma: (k,) scale of the rows in the fit that is to come.
            N: rows.
        """
        total = np.zeros(len(w))
        here, there = self._ratios(w), self._ratios(found)
        for i, j in enumerate(self.joints.tolist()):
            grown = np.log(np.maximum(here[i], _LEAST)) - np.log(np.maximum(abs(there[i]), _LEAST))
            rest = mean_square[j] * np.exp(2.0 * grown.mean())
            slope = self._change[i] / np.maximum(here[i], _LEAST)[:, None]
            slope /= self._nominal[i][:, None]
            total += N * min(rest / sigma[j] ** 2, 1.0) * slope.mean(axis=0)
        return total


def _regressor(motion: ObservedMotion) -> np.ndarray:
    return torque_regressor(motion.tree, motion.position, motion.velocity, motion.acceleration)
