"""Exponential forgetting of what was learned of W, for robots that drift.

After each sample all information counts `lambda = exp(-1 / N)` of what it did, as in recursive
least squares (Ljung 1999, section 11.2): what is N samples old counts 1/e. The prior is
knowledge of the robot, not of a time: its equations are added again in turn with the weight they
lost meanwhile, so a direction that is not excited falls back to the prior and no further.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from sgp_ros.gp.information import Information


class Forgetting:
    """Fades information, sample by sample.

    Attributes:
        factor: `sqrt(lambda)`, by which equations of unit noise shrink at each sample.
        turn: samples so far, which says whose turn among the equations of the prior it is.

    Args:
        samples: N, after which information counts 1/e; 0 never forgets.
        prior: of W.
    """

    def __init__(self, samples: float, prior: Information) -> None:
        self.factor = math.exp(-0.5 / samples) if samples > 0.0 else 1.0
        self.turn = 0
        self._prior = prior

    def fade(self, total: Information, parts: Iterable[Information]) -> None:
        """Fade `total`, which holds the prior, and parts, which do not. O(p^2)."""
        if self.factor == 1.0:
            return
        for information in (total, *parts):
            information.fade(self.factor)
        p = len(self._prior.z)
        if p:
            share, i = self.lost(p), self.turn % p
            total.absorb(share * np.append(self._prior.R[i], self._prior.z[i])[None])
        self.turn += 1

    def lost(self, samples: int) -> float:
        """Return the root of the share of information that so many samples fade away."""
        return math.sqrt(1.0 - self.factor ** (2 * samples))
