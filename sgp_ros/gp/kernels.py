"""Covariance functions of the process Z.

A kernel belongs to one component of X and says which columns of the inputs it sees. It evaluates
itself and contracts its own gradient, so the evidence never holds an array larger than n x n.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from sgp_ros.gp.linear_algebra import turn_into_exponents
from sgp_ros.gp.linear_kernel import Linear

T = TypeVar('T')


class Kernel(Protocol):
    """What the inference asks of a kernel.

    Attributes:
        lengthscales: one per input [unit of the input].
        inputs: columns of U that the kernel sees.
    """

    @property
    def inputs(self) -> tuple[int, ...]:
        """Columns of U that the kernel sees."""

    @property
    def lengthscales(self) -> tuple[float, ...]:
        """One per input [unit of the input]."""

    @property
    def variance(self) -> float:
        """Prior variance of the component."""

    @property
    def log_parameters(self) -> np.ndarray:
        """Logarithms of variances, then length scales."""

    def with_log_parameters(self, theta: np.ndarray) -> Kernel:
        """Return the kernel with other parameters."""

    def with_lengthscales(self, lengthscales: tuple[float, ...]) -> Kernel:
        """Return the kernel with other length scales."""

    def without(self, index: int) -> Kernel:
        """Return the kernel that no longer sees one of its inputs."""

    def scale(self, U: np.ndarray) -> np.ndarray:
        """Return the inputs it sees in units of their length scales, (n, d)."""

    def matrix(self, U: np.ndarray, V: np.ndarray | None = None) -> np.ndarray:
        """Return covariances between rows of U (n, d) and of V (m, d), (n, m)."""

    def diagonal(self, U: np.ndarray) -> np.ndarray:
        """Return the prior variances at rows of U (n, d), (n,)."""

    def vector(self, S: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return covariances of one scaled input s (d,) with scaled inputs S (n, d), (n,)."""

    def gradient(self, U: np.ndarray, H: np.ndarray) -> np.ndarray:
        """Contract a symmetric H (n, n) with the derivatives by `log_parameters`."""

    def scales(self, power: float, spread: np.ndarray) -> np.ndarray:
        """Return typical values of `log_parameters`, before the logarithm.

        Args:
            power: variance of the component.
            spread: standard deviations of the inputs it sees, (d,).
        """


@dataclass(frozen=True, slots=True)
class SquaredExponential:
    """Squared exponential kernel with one length scale per input.

    `kappa(u, u') = variance exp(-sum_i (u_i - u'_i)^2 / (2 l_i^2))`
    (Wu and Movellan, equation 4).

    Attributes:
        variance: `sigma_z` [unit of the component squared].
        lengthscales: `l`, one per input [unit of the input].
        inputs: columns of U that the kernel sees, as many as length scales.
    """

    variance: float
    lengthscales: tuple[float, ...]
    inputs: tuple[int, ...]

    def __post_init__(self) -> None:
        """Refuse what is no kernel.

        Raises:
            ValueError: numbers of length scales and inputs differ, or one is not positive.
        """
        if len(self.lengthscales) != len(self.inputs) or not self.inputs:
            raise ValueError(f'{len(self.lengthscales)} length scales, {len(self.inputs)} inputs')
        if not min(self.variance, *self.lengthscales) > 0.0:
            raise ValueError('the variance and the length scales must be positive')

    def scale(self, U: np.ndarray) -> np.ndarray:
        """Return the inputs it sees in units of their length scales, (n, d)."""
        return U[:, self.inputs] / np.array(self.lengthscales)

    def matrix(self, U: np.ndarray, V: np.ndarray | None = None) -> np.ndarray:
        """Return the covariances between rows of U (n, d) and of V (m, d), (n, m).

        Cost O(n m d). Without V, the covariances among the rows of U.
        """
        S = self.scale(U)
        T = S if V is None else self.scale(V)
        K = S @ T.T
        turn_into_exponents(K, 0.5 * (S * S).sum(axis=1), 0.5 * (T * T).sum(axis=1))
        np.exp(K, out=K)
        K *= self.variance
        return K

    def diagonal(self, U: np.ndarray) -> np.ndarray:
        """Return the prior variances at rows of U (n, d), (n,)."""
        return np.full(len(U), self.variance)

    def vector(self, S: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return the covariances of one scaled input s (d,) with scaled inputs S (n, d), (n,)."""
        difference = S - s
        return self.variance * np.exp(-0.5 * np.einsum('ij,ij->i', difference, difference))

    @property
    def log_parameters(self) -> np.ndarray:
        """Logarithms of variance and length scales, (1 + d,)."""
        return np.log(np.array([self.variance, *self.lengthscales]))

    def with_log_parameters(self, theta: np.ndarray) -> SquaredExponential:
        """Return this kernel with the parameters whose logarithms are `theta`, (1 + d,)."""
        values = np.exp(theta)
        return SquaredExponential(
            float(values[0]), tuple(float(x) for x in values[1:]), self.inputs
        )

    def with_lengthscales(self, lengthscales: tuple[float, ...]) -> SquaredExponential:
        """Return this kernel with other length scales."""
        return SquaredExponential(self.variance, lengthscales, self.inputs)

    def without(self, index: int) -> SquaredExponential:
        """Return this kernel without one of its inputs."""
        return SquaredExponential(
            self.variance, _without(self.lengthscales, index), _without(self.inputs, index)
        )

    def gradient(self, U: np.ndarray, H: np.ndarray) -> np.ndarray:
        """Contract a symmetric H (n, n) with dK/dtheta, (1 + d,).

        `dK/dlog l_i = K * (s_i - s'_i)^2`, so with `weighted = H * K` the contraction is
        `2 (sum_a r_a s_ia^2 - s_i^T weighted s_i)` with row sums r: O(n^2 d), no n x n x d array.
        """
        S = self.scale(U)
        weighted = self.matrix(U)
        weighted *= H
        rows = weighted.sum(axis=1)
        lengths = 2.0 * (rows @ (S * S) - np.einsum('ai,ai->i', S, weighted @ S))
        return np.concatenate([[rows.sum()], lengths])

    def scales(self, power: float, spread: np.ndarray) -> np.ndarray:
        """Return the variance of the component and the spreads of the inputs, (1 + d,)."""
        return np.array([power, *spread])


@dataclass(frozen=True, slots=True)
class AdditiveSquaredExponential:
    """Sum of squared exponential kernels, one per input (Duvenaud, Nickisch, Rasmussen 2011).

    `kappa(u, u') = sum_i variance_i exp(-(u_i - u'_i)^2 / (2 l_i^2))`: Z is a sum of functions of
    one input each, which still says something where only one input leaves the data.

    Attributes:
        variances: one per input [unit of the component squared].
        lengthscales: one per input [unit of the input].
        inputs: columns of U that the kernel sees.
    """

    variances: tuple[float, ...]
    lengthscales: tuple[float, ...]
    inputs: tuple[int, ...]

    def __post_init__(self) -> None:
        """Refuse what is no kernel.

        Raises:
            ValueError: numbers of parameters and inputs differ, or one is not positive.
        """
        sizes = {len(self.variances), len(self.lengthscales), len(self.inputs)}
        if len(sizes) != 1 or not self.inputs:
            raise ValueError(f'{len(self.lengthscales)} length scales, {len(self.inputs)} inputs')
        if not min(*self.variances, *self.lengthscales) > 0.0:
            raise ValueError('the variances and the length scales must be positive')

    @property
    def variance(self) -> float:
        """Prior variance of the component."""
        return sum(self.variances)

    def scale(self, U: np.ndarray) -> np.ndarray:
        """Return the inputs it sees in units of their length scales, (n, d)."""
        return U[:, self.inputs] / np.array(self.lengthscales)

    def matrix(self, U: np.ndarray, V: np.ndarray | None = None) -> np.ndarray:
        """Return the covariances between rows of U (n, d) and of V (m, d), (n, m)."""
        S = self.scale(U)
        T = S if V is None else self.scale(V)
        K = np.zeros((len(S), len(T)))
        for i, variance in enumerate(self.variances):
            K += variance * _bell(S[:, i], T[:, i])
        return K

    def diagonal(self, U: np.ndarray) -> np.ndarray:
        """Return the prior variances at rows of U (n, d), (n,)."""
        return np.full(len(U), self.variance)

    def vector(self, S: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return the covariances of one scaled input s (d,) with scaled inputs S (n, d), (n,)."""
        return np.exp(-0.5 * (S - s) ** 2) @ np.array(self.variances)

    @property
    def log_parameters(self) -> np.ndarray:
        """Logarithms of variances, then of length scales, (2 d,)."""
        return np.log(np.array([*self.variances, *self.lengthscales]))

    def with_log_parameters(self, theta: np.ndarray) -> AdditiveSquaredExponential:
        """Return this kernel with the parameters whose logarithms are `theta`, (2 d,)."""
        values = tuple(float(x) for x in np.exp(theta))
        d = len(self.inputs)
        return AdditiveSquaredExponential(values[:d], values[d:], self.inputs)

    def with_lengthscales(self, lengthscales: tuple[float, ...]) -> AdditiveSquaredExponential:
        """Return this kernel with other length scales."""
        return AdditiveSquaredExponential(self.variances, lengthscales, self.inputs)

    def without(self, index: int) -> AdditiveSquaredExponential:
        """Return this kernel without one of its inputs."""
        return AdditiveSquaredExponential(
            _without(self.variances, index),
            _without(self.lengthscales, index),
            _without(self.inputs, index),
        )

    def gradient(self, U: np.ndarray, H: np.ndarray) -> np.ndarray:
        """Contract a symmetric H (n, n) with dK/dtheta, (2 d,). O(n^2 d)."""
        S = self.scale(U)
        heights, widths = [], []
        for i, variance in enumerate(self.variances):
            s = S[:, i]
            weighted = variance * H * _bell(s, s)
            rows = weighted.sum(axis=1)
            heights.append(rows.sum())
            widths.append(2.0 * (rows @ (s * s) - s @ weighted @ s))
        return np.array([*heights, *widths])

    def scales(self, power: float, spread: np.ndarray) -> np.ndarray:
        """Return the variance of the component d times, then the spreads, (2 d,)."""
        return np.array([power] * len(self.inputs) + [*spread])


def _bell(s: np.ndarray, t: np.ndarray) -> np.ndarray:
    return np.exp(-0.5 * (s[:, None] - t[None, :]) ** 2)


def _without(values: tuple[T, ...], index: int) -> tuple[T, ...]:
    return values[:index] + values[index + 1 :]


KERNELS: dict[str, type[Kernel]] = {
    'squared_exponential': SquaredExponential,
    'additive_squared_exponential': AdditiveSquaredExponential,
    'linear': Linear,
}
"""Kernels by name; each passes the contract suite."""
