"""Kernels to choose from, by the name that `model.kernel` takes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from sgp_ros.gp.kernel import (
    LENGTHSCALES,
    SIGNAL_VARIANCE,
    HyperParameter,
    Kernel,
    Stationary,
    distance_sums,
)
from sgp_ros.gp.linear_algebra import turn_into_exponents
from sgp_ros.gp.whitening_loops import MATERN32, MATERN52, SQUARED_EXPONENTIAL

_FAR = 1e6
"""Square of a distance at which a Matern kernel is zero in double precision. Without an end the
product of a polynomial and an exponential would be infinity times zero."""


class SquaredExponential(Stationary):
    """Squared exponential kernel: functions with derivatives of every order.

    `kappa(u, u') = signal_variance exp(-r^2 / 2)` with `r^2 = sum_i (u_i - u'_i)^2 / l_i^2`
    (Wu and Movellan, equation 4).
    """

    __slots__ = ()
    name = 'squared_exponential'

    @staticmethod
    def correlation(squares: np.ndarray) -> np.ndarray:
        """Return `exp(-r^2 / 2)`."""
        return np.exp(-0.5 * squares)

    @staticmethod
    def slope(squares: np.ndarray) -> np.ndarray:
        """Return its derivative by `r^2`."""
        return -0.5 * np.exp(-0.5 * squares)

    def matrix(self, U: np.ndarray, V: np.ndarray | None = None) -> np.ndarray:
        """Return the covariances between rows of U (n, d) and of V (m, d), (n, m), in place."""
        S = self.scale(U)
        T = S if V is None else self.scale(V)
        K = S @ T.T
        turn_into_exponents(K, 0.5 * (S * S).sum(axis=1), 0.5 * (T * T).sum(axis=1))
        np.exp(K, out=K)
        K *= self.signal_variance
        return K

    def gradient(self, U: np.ndarray, H: np.ndarray) -> np.ndarray:
        """Contract a symmetric H (n, n) with dK/dtheta, (1 + d,); one exponential serves all."""
        return self.gradient_from(self.matrix(U), U, H)

    def gradient_from(self, K: np.ndarray, U: np.ndarray, H: np.ndarray) -> np.ndarray:
        """Return `gradient` from `K = matrix(U)`: no exponential is taken again."""
        weighted = K * H
        return np.array([weighted.sum(axis=1).sum(), *distance_sums(self.scale(U), weighted)])


class Matern32(Stationary):
    """Matern kernel of smoothness 3/2: functions with one derivative.

    `kappa(u, u') = signal_variance (1 + sqrt(3) r) exp(-sqrt(3) r)`
    (Rasmussen and Williams 2006, equation 4.17).
    """

    __slots__ = ()
    name = 'matern32'

    @staticmethod
    def correlation(squares: np.ndarray) -> np.ndarray:
        """Return `(1 + sqrt(3) r) exp(-sqrt(3) r)`."""
        r = np.sqrt(np.minimum(3.0 * squares, _FAR))
        return (1.0 + r) * np.exp(-r)

    @staticmethod
    def slope(squares: np.ndarray) -> np.ndarray:
        """Return its derivative by `r^2`."""
        return -1.5 * np.exp(-np.sqrt(3.0 * squares))


class Matern52(Stationary):
    """Matern kernel of smoothness 5/2: functions with two derivatives.

    `kappa(u, u') = signal_variance (1 + sqrt(5) r + 5 r^2 / 3) exp(-sqrt(5) r)`
    (Rasmussen and Williams 2006, equation 4.17).
    """

    __slots__ = ()
    name = 'matern52'

    @staticmethod
    def correlation(squares: np.ndarray) -> np.ndarray:
        """Return `(1 + sqrt(5) r + 5 r^2 / 3) exp(-sqrt(5) r)`."""
        r = np.sqrt(np.minimum(5.0 * squares, _FAR))
        return (1.0 + r + r * r / 3.0) * np.exp(-r)

    @staticmethod
    def slope(squares: np.ndarray) -> np.ndarray:
        """Return its derivative by `r^2`."""
        r = np.sqrt(np.minimum(5.0 * squares, _FAR))
        return -5.0 / 6.0 * (1.0 + r) * np.exp(-r)


@dataclass(frozen=True, slots=True)
class AdditiveSquaredExponential(Kernel):
    """Sum of squared exponential kernels, one per input (Duvenaud, Nickisch, Rasmussen 2011).

    `kappa(u, u') = sum_i signal_variance_i exp(-(u_i - u'_i)^2 / (2 l_i^2))`: Z is a sum of
    functions of one input each, which still predicts where only one input leaves the data.

    Attributes:
        signal_variances: one per input [unit of the component squared].
        lengthscales: one per input [unit of the input].
        inputs: columns of U that the kernel sees.
    """

    name: ClassVar[str] = 'additive_squared_exponential'
    parameters: ClassVar[tuple[HyperParameter, ...]] = (
        HyperParameter(
            'signal_variances', 'Prior variance of Z per input',
            target=2, is_per_input=True, high=SIGNAL_VARIANCE.high, below=SIGNAL_VARIANCE.below,
        ),
        LENGTHSCALES,
    )  # fmt: skip
    signal_variances: tuple[float, ...]
    lengthscales: tuple[float, ...]
    inputs: tuple[int, ...]

    @classmethod
    def scales(cls, power: float, spread: np.ndarray) -> np.ndarray:
        """Return the variance of the component d times, then the spreads, (2 d,)."""
        return np.array([power] * len(spread) + [*spread])

    def matrix(self, U: np.ndarray, V: np.ndarray | None = None) -> np.ndarray:
        """Return the covariances between rows of U (n, d) and of V (m, d), (n, m)."""
        S = self.scale(U)
        T = S if V is None else self.scale(V)
        K = np.zeros((len(S), len(T)))
        for i, variance in enumerate(self.signal_variances):
            K += variance * _bell(S[:, i], T[:, i])
        return K

    def diagonal(self, U: np.ndarray) -> np.ndarray:
        """Return the prior variances at rows of U (n, d), (n,)."""
        return np.full(len(U), self.variance)

    def vector(self, S: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return the covariances of one scaled input s (d,) with scaled inputs S (n, d), (n,)."""
        return np.exp(-0.5 * (S - s) ** 2) @ np.array(self.signal_variances)

    def gradient(self, U: np.ndarray, H: np.ndarray) -> np.ndarray:
        """Contract a symmetric H (n, n) with dK/dtheta, (2 d,). O(n^2 d)."""
        S = self.scale(U)
        heights, widths = [], []
        for i, variance in enumerate(self.signal_variances):
            s = S[:, i]
            weighted = variance * H * _bell(s, s)
            rows = weighted.sum(axis=1)
            heights.append(rows.sum())
            widths.append(2.0 * (rows @ (s * s) - s @ weighted @ s))
        return np.array([*heights, *widths])


def _bell(s: np.ndarray, t: np.ndarray) -> np.ndarray:
    return np.exp(-0.5 * (s[:, None] - t[None, :]) ** 2)


@dataclass(frozen=True, slots=True)
class Linear(Kernel):
    """Kernel of a linear function through the origin with unknown slopes.

    `kappa(u, u') = sum_i u_i u'_i / l_i^2`. What a squared exponential with very long length
    scales says too, but without a free constant, so the evidence prefers it where it is enough.

    Attributes:
        lengthscales: distance over which the function changes by one unit of the component, one
            per input [unit of the input].
        inputs: columns of U that the kernel sees.
    """

    name: ClassVar[str] = 'linear'
    parameters: ClassVar[tuple[HyperParameter, ...]] = (
        HyperParameter(
            'lengthscales', 'Distance over which Z changes by one unit, per input',
            target=-1, is_per_input=True,
        ),
    )  # fmt: skip
    lengthscales: tuple[float, ...]
    inputs: tuple[int, ...]

    @classmethod
    def scales(cls, power: float, spread: np.ndarray) -> np.ndarray:
        """Return the spreads of the inputs per deviation of the component, (d,)."""
        return np.asarray(spread / np.sqrt(power))

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

    def gradient(self, U: np.ndarray, H: np.ndarray) -> np.ndarray:
        """Contract a symmetric H (n, n) with dK/dtheta, (d,). O(n^2 d)."""
        S = self.scale(U)
        return np.asarray(-2.0 * np.einsum('ai,ai->i', S, H @ S))


_BUILT_IN: tuple[type[Kernel], ...] = (
    SquaredExponential,
    Matern32,
    Matern52,
    AdditiveSquaredExponential,
    Linear,
)
COMPILED_FORMS: dict[type[Kernel], int] = {
    SquaredExponential: SQUARED_EXPONENTIAL, Matern32: MATERN32, Matern52: MATERN52,
}  # fmt: skip
"""Numbers by which compiled loops know a kernel; the others are evaluated by `Kernel.vector`."""

KERNELS: dict[str, type[Kernel]] = {kernel.name: kernel for kernel in _BUILT_IN}
"""Choices of `model.kernel`; each passes the contract suite."""
