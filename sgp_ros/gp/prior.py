"""The Gaussian prior of the coefficients W, kept as a square root of its precision.

`Lambda = root^T root` is the inverse of sigma_w. Knowing nothing (sigma_w infinite) is then simply
a root without rows, and no digit is lost on the way there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg


@dataclass(frozen=True, slots=True, eq=False)
class CoefficientPrior:
    """W ~ N(mu, sigma_w) (Wu and Movellan, equation 1), possibly flat in some directions.

    Attributes:
        root: (r, p), full row rank; `root^T root` is the precision.
        target: (r,), `root mu`.
        log_det: logarithm of the determinant of the precision over the r informed directions.
    """

    root: np.ndarray
    target: np.ndarray
    log_det: float

    @property
    def size(self) -> int:
        """Number of coefficients p."""
        return int(self.root.shape[1])

    @classmethod
    def flat(cls, p: int) -> CoefficientPrior:
        """Return the prior that knows nothing of p coefficients."""
        return cls(np.zeros((0, p)), np.zeros(0), 0.0)

    @classmethod
    def from_std(cls, mean: np.ndarray, std: np.ndarray) -> CoefficientPrior:
        """Return independent priors.

        Args:
            mean: (p,) [unit of each coefficient].
            std: (p,), positive; infinite where nothing is known.

        Raises:
            ValueError: a standard deviation that is not positive.
        """
        if not np.all(std > 0.0):
            raise ValueError(f'prior standard deviations must be positive: {std}')
        known = np.isfinite(std)
        scale = 1.0 / std[known]
        root = np.zeros((int(known.sum()), len(std)))
        root[np.arange(len(scale)), np.flatnonzero(known)] = scale
        return cls(root, scale * mean[known], float(2.0 * np.log(scale).sum()))

    @classmethod
    def from_covariance(cls, mean: np.ndarray, covariance: np.ndarray) -> CoefficientPrior:
        """Return the prior with mean (p,) and positive definite covariance (p, p).

        Raises:
            ValueError: the covariance is not positive definite.
        """
        try:
            lower = linalg.cholesky(covariance, lower=True)
        except linalg.LinAlgError as error:
            raise ValueError('the prior covariance is not positive definite') from error
        root = linalg.solve_triangular(lower, np.eye(len(mean)), lower=True)
        return cls(root, root @ mean, float(-2.0 * np.log(np.diag(lower)).sum()))

    def scaled(self, factor: float) -> CoefficientPrior:
        """Return this prior with every standard deviation times `factor`, about the same mean."""
        log_det = self.log_det - 2.0 * len(self.target) * float(np.log(factor))
        return CoefficientPrior(self.root / factor, self.target / factor, log_det)
