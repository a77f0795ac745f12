"""A rival: incremental sparse spectrum Gaussian process regression, without physics.

Gijsberts and Metta, Neural Networks 41, 2013: a process in random Fourier features (Rahimi and
Recht 2007) whose weights are learned by recursive least squares. No Python library has it.
"""

from __future__ import annotations

import numpy as np

from sgp_ros.gp.information import Information
from sgp_ros.gp.model import CoefficientPrior


class IncrementalFeatures:
    """The process of one component in random features.

    Args:
        kernel: squared exponential.
        noise: variance.
        features: an even number.
        seed: of the frequencies.
    """

    def __init__(self, kernel, noise, features, seed):
        rng = np.random.default_rng(seed)
        self._kernel = kernel
        self._noise = noise
        self._frequencies = rng.normal(size=(len(kernel.inputs), features // 2))
        prior = CoefficientPrior.from_std(np.zeros(features), np.ones(features))
        self._information = Information.of_prior(prior)

    def _features(self, u):
        angle = self._kernel.scale(u[None])[0] @ self._frequencies
        scale = np.sqrt(self._kernel.variance / len(angle))
        return scale * np.concatenate([np.cos(angle), np.sin(angle)])

    def predict(self, u):
        """Return mean and variance of the observation at an input u (d,)."""
        phi = self._features(u)
        spread = self._information.spread(phi[None])[0]
        return float(phi @ self._information.coefficients), float(spread @ spread) + self._noise

    def learn(self, u, y):
        """Learn observation y at input u (d,)."""
        root = np.sqrt(self._noise)
        self._information.absorb(np.append(self._features(u), y)[None] / root)
