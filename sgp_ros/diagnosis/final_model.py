"""The model a diagnosis ends with: physics that was named, bodies that differ, and a process Z."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.diagnosis.equations import resting
from sgp_ros.diagnosis.prediction import accelerations, imbalance
from sgp_ros.diagnosis.result import Predictions, Proof
from sgp_ros.diagnosis.trajectory import (
    Bandwidth,
    RawTrajectory,
    observe,
    parallel_filter,
)

if TYPE_CHECKING:
    from sgp_ros.diagnosis.candidates import Model
    from sgp_ros.diagnosis.equations import Equations
    from sgp_ros.diagnosis.remainder import Remainder
    from sgp_ros.robots.effects.observed_motion import ObservedMotion
    from sgp_ros.robots.tree import Tree

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

    def prove(self, raw: RawTrajectory, tree: Tree) -> Proof:
        """Return the errors of effort and acceleration on a recording, before and after."""
        cutoff = self.equations.filter.cutoff
        rate = 1.0 / raw.step
        bandwidth = Bandwidth(min(cutoff, 0.3 * rate), min(2.5 * cutoff, 0.4 * rate))
        motion = observe(raw, tree, bandwidth)
        low = parallel_filter(raw, bandwidth)
        rests = resting(raw, motion, bandwidth)
        names = tree.moving_names
        actuated = tree.is_actuated[: tree.size]
        inertial = low(motion.mass_diagonal * motion.acceleration)
        scale = np.where(actuated, low(motion.effort).var(axis=0), inertial.var(axis=0)) + 1e-300
        true = low(motion.acceleration)
        efforts, motions, densities = [], [], []
        for model, remainders in ((self.nominal, ()), (self.model, self.remainders)):
            a = accelerations(model, self.equations, motion, rests, remainders)
            e = low(self._imbalance(model, motion, rests, remainders))
            efforts.append((e**2).mean(axis=0) / scale)
            motions.append(((low(a) - true) ** 2).mean(axis=0) / (true.var(axis=0) + 1e-300))
            variance = model.sigma**2
            densities.append(
                float(
                    np.mean(
                        0.5 * np.log(2 * np.pi * variance) + 0.5 * (e**2).mean(axis=0) / variance
                    )
                )
            )
        named = [dict(zip(names, map(float, x), strict=True)) for x in (*efforts, *motions)]
        return Proof(named[0], named[1], named[2], named[3], densities[0], densities[1])

    def _imbalance(
        self,
        model: Model,
        motion: ObservedMotion,
        rests: np.ndarray,
        remainders: tuple[Remainder, ...],
    ) -> np.ndarray:
        e = imbalance(model, self.equations, motion, remainders)
        for j in {s.place.joint for s in model.suspects if s.effect.holds(s.place)}:
            e[rests[:, j], j] = 0.0
        return e
