"""The model a diagnosis ends with: physics that was named, bodies that differ, and a process Z."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations, resting
from sgp_ros.diagnosis.compare.trajectory import Bandwidth, RawTrajectory, observe
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.locate.remainder import Remainder
from sgp_ros.diagnosis.prove.prediction import accelerations, held_joints, imbalance
from sgp_ros.diagnosis.result import Predictions
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.observed_motion import ObservedMotion

_SHARP = 4.0
"""States are smoothed at this multiple of the cut-off where accelerations are predicted."""


@dataclass(frozen=True, eq=False)
class FinalModel:
    """Effects, bodies and processes, fitted on the training recording."""

    model: Model
    nominal: Model
    equations: Equations
    remainders: tuple[Remainder, ...]

    def predict(self, raw: RawTrajectory, tree: Tree) -> Predictions:
        """Return the accelerations at every time of a recording."""
        cutoff = self.equations.filter.cutoff
        rate = 1.0 / raw.step
        motion = observe(raw, tree, Bandwidth(cutoff, min(_SHARP * cutoff, 0.4 * rate)))
        rests = resting(raw, motion, Bandwidth(cutoff, min(_SHARP * cutoff, 0.4 * rate)))
        a = accelerations(self.model, self.equations, motion, rests, self.remainders)
        return Predictions(motion.time, a)

    def imbalance(
        self,
        model: Model,
        motion: ObservedMotion,
        rests: np.ndarray,
        remainders: tuple[Remainder, ...],
    ) -> np.ndarray:
        """Return e of one of the models, (n, k); 0 where dry friction holds a joint [N m or N]."""
        e = imbalance(model, self.equations, motion, remainders)
        for j in held_joints(model, motion):
            e[rests[:, j], j] = 0.0
        return e
