"""The covariance function of a linear process."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Linear:
    """Kernel of a linear function through the origin, whose slopes are not known.

    `kappa(u, u') = sum_i u_i u'_i / l_i^2`. What a squared exponential with very long length
    scales says too, but without a free constant, so the evidence prefers it where it is enough.

    Attributes:
        lengthscales: distance over which the function changes by one unit of the component, one
            per input [unit of the input].
        inputs: columns of U that the kernel sees.
    """

    lengthscales: tuple[float, ...]
    inputs: tuple[int, ...]

    def __post_init__(self) -> None:
        """Refuse what is no kernel.

        Raises:
            ValueError: numbers of length scales and inputs differ, or one is not positive.
        """
        if len(self.lengthscales) != len(self.inputs) or not self.inputs:
            raise ValueError(f'{len(self.lengthscales)} length scales, {len(self.inputs)} inputs')
        if not min(self.lengthscales) > 0.0:
            raise ValueError('the length scales must be positive')

    @property
    def variance(self) -> float:
        """Prior variance of the component one length scale from the origin."""
        return 1.0

    def scale(self, U: np.ndarray) -> np.ndarray:
        """Return the inputs it sees in units of their length scales, (n, d)."""
        return U[:, self.inputs] / np.array(self.lengthscales)

    def matrix(self, U: np.ndarray, V: np.ndarray | None = None) -> np.ndarray:
        """Return the covariances between rows of U (n, d) and of V (m, d), (n, m)."""
        S = self.scale(U)
        return S @ (S if V is None else self.scale(V)).T

    def diagonal(self, U: np.ndarray) -> np.ndarray:
        """Return the prior variances at rows of U (n, d), (n,)."""
        S = self.scale(U)
        return np.einsum('ij,ij->i', S, S)

    def vector(self, S: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return the covariances of one scaled input s (d,) with scaled inputs S (n, d), (n,)."""
        return S @ s

    @property
    def log_parameters(self) -> np.ndarray:
        """Logarithms of the length scales, (d,)."""
        return np.log(np.array(self.lengthscales))

    def with_log_parameters(self, theta: np.ndarray) -> Linear:
        """Return this kernel with the parameters whose logarithms are `theta`, (d,)."""
        return Linear(tuple(float(x) for x in np.exp(theta)), self.inputs)

    def with_lengthscales(self, lengthscales: tuple[float, ...]) -> Linear:
        """Return this kernel with other length scales."""
        return Linear(lengthscales, self.inputs)

    def without(self, index: int) -> Linear:
        """Return this kernel without one of its inputs."""
        return Linear(
            self.lengthscales[:index] + self.lengthscales[index + 1 :],
            self.inputs[:index] + self.inputs[index + 1 :],
        )

    def gradient(self, U: np.ndarray, H: np.ndarray) -> np.ndarray:
        """Contract a symmetric H (n, n) with dK/dtheta, (d,). O(n^2 d)."""
        S = self.scale(U)
        return np.asarray(-2.0 * np.einsum('ai,ai->i', S, H @ S))

    def scales(self, power: float, spread: np.ndarray) -> np.ndarray:
        """Return the spreads of the inputs per deviation of the component, (d,)."""
        return np.asarray(spread / np.sqrt(power))
