"""What a stream is told of X before each sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.gp.factor import Whitening


@dataclass(frozen=True, slots=True, eq=False)
class OnlinePrediction:
    """Prediction of X at one input, with what learning it reuses.

    Attributes:
        mean: (k,).
        covariance: (k, k) of X, without noise; infinite on the diagonal where an undetermined
            direction of W enters.
        u, f: the input (d,) and regressor (k, p) it was made for.
        whitenings: the input against the samples, one per factor; in a basis against the inducing
            inputs, one per component.
        version: state of the model it was made with.
        gains: of a basis, by which data enter the features, (m,) per component; else none.
    """

    mean: np.ndarray
    covariance: np.ndarray
    u: np.ndarray
    f: np.ndarray
    whitenings: tuple[Whitening, ...]
    version: int
    gains: tuple[np.ndarray, ...] = ()
