"""A Gaussian prediction of several components at several queries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Predicted X(q) at q queries.

    Attributes:
        mean: (q, k).
        covariance: (q, k, k); the diagonal is infinite where an undetermined direction of W
            enters.
    """

    mean: np.ndarray
    covariance: np.ndarray

    @property
    def variance(self) -> np.ndarray:
        """Variances of the components, (q, k)."""
        return np.einsum('qkk->qk', self.covariance)

    def observed(self, noise: np.ndarray, G: np.ndarray | None = None) -> Prediction:
        """Return the prediction of Y = g X + V.

        Args:
            noise: (m,) variances of V.
            G: (q, m, k) observation matrices; None for the identity.
        """
        if G is None:
            return Prediction(self.mean, self.covariance + np.diag(noise))
        mean = np.einsum('qmk,qk->qm', G, self.mean)
        covariance = np.einsum('qmk,qkl,qnl->qmn', G, self.covariance, G) + np.diag(noise)
        return Prediction(mean, covariance)
