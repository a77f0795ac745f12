"""Kernel of the process Z: one class that declares all that the rest of the package needs.

Its name chooses it (`model.kernel`), its hyper-parameters carry name, unit, range and bounds of
the search, `scales` tells where the search starts, `values` and `of_values` save and restore it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

Value = float | tuple[float, ...]


@dataclass(frozen=True, slots=True)
class HyperParameter:
    """One number of a kernel, or one per input.

    Attributes:
        name: attribute of the kernel, and last part of the setting `hyper.<joint>.<name>`.
        description: what it is.
        target: exponent of the unit of Z in its own unit; 2 for a variance of Z.
        is_per_input: whether there is one per input.
        high: largest value that a setting may have.
        below, above: factors under and over its typical value between which it is searched for.
    """

    name: str
    description: str
    target: int = 0
    is_per_input: bool = False
    high: float = 1e50
    below: float = 1e4
    above: float = 1e4

    def unit(self, target: str) -> str:
        """Return its unit as text, for Z in the unit `target`; empty where inputs differ."""
        return f'({target})^2' if self.target == 2 else ''


SIGNAL_VARIANCE = HyperParameter(
    'signal_variance', 'Prior variance of Z', target=2, high=1e100, below=1e8
)
LENGTHSCALES = HyperParameter('lengthscales', 'Length scale of Z per input', is_per_input=True)


class Kernel(ABC):
    """Covariance function of one component of Z.

    A subclass is a frozen dataclass with one field per hyper-parameter and, last, `inputs`. It
    evaluates itself and contracts its own gradient, so the evidence never holds an array larger
    than n x n. A stationary kernel derives from `Stationary` and is two formulas:

    >>> import numpy as np
    >>> from sgp_ros.gp.kernel import Stationary
    >>> class RationalQuadratic(Stationary):
    ...     '''`kappa = signal_variance / (1 + r^2 / 2)`: many length scales at once.'''
    ...     name = 'rational_quadratic'
    ...     @staticmethod
    ...     def correlation(squares):
    ...         return 1.0 / (1.0 + 0.5 * squares)
    ...     @staticmethod
    ...     def slope(squares):
    ...         return -0.5 / (1.0 + 0.5 * squares) ** 2
    >>> kernel = RationalQuadratic(2.0, lengthscales=(0.5,), inputs=(0,))
    >>> kernel.matrix(np.array([[0.0], [1.0]]))
    array([[2.        , 0.66666667],
           [0.66666667, 2.        ]])

    With `KERNELS[RationalQuadratic.name] = RationalQuadratic` (`gp.kernels`) it is a choice
    of `model.kernel`: learnt, saved, restored, and shown as ROS parameters.

    Attributes:
        name: by which `model.kernel` chooses it.
        parameters: hyper-parameters, in the order of the fields and of `values`.
        lengthscales: one per input [unit of the input].
        inputs: columns of U that the kernel sees.
    """

    __slots__ = ()
    name: ClassVar[str]
    parameters: ClassVar[tuple[HyperParameter, ...]]
    lengthscales: tuple[float, ...]
    inputs: tuple[int, ...]

    def __post_init__(self) -> None:
        """Refuse anything but a kernel.

        Raises:
            ValueError: a number of hyper-parameters that is not that of the inputs, no input, or a
                hyper-parameter that is not positive.
        """
        for parameter in self.parameters:
            value = getattr(self, parameter.name)
            if parameter.is_per_input and (len(value) != len(self.inputs) or not value):
                count = f'{len(value)} {parameter.name}, {len(self.inputs)} inputs'
                raise ValueError(f'{count}: as many length scales and the like as inputs')
        if not np.all(self.values > 0.0):
            raise ValueError('variances, length scales and the like must be positive')

    @classmethod
    def of_values(cls, values: Iterable[float], inputs: tuple[int, ...]) -> Kernel:
        """Return the kernel with these `values` (h,) that sees `inputs`."""
        left = iter(values)
        fields = [
            tuple(float(next(left)) for _ in inputs) if p.is_per_input else float(next(left))
            for p in cls.parameters
        ]
        return cls(*fields, inputs)  # type: ignore[call-arg]  # the fields of the subclass

    @classmethod
    def spread_over(cls, numbers: Iterable[float], d: int) -> np.ndarray:
        """Return one number per hyper-parameter as one per value for d inputs, (h,)."""
        pairs = zip(numbers, cls.parameters, strict=True)
        return np.concatenate([[x] * (d if p.is_per_input else 1) for x, p in pairs])

    @property
    def values(self) -> np.ndarray:
        """All hyper-parameters in one row, (h,)."""
        return np.concatenate([np.atleast_1d(getattr(self, p.name)) for p in self.parameters])

    @property
    def is_variance(self) -> np.ndarray:
        """Which of `values` are variances of Z, (h,) of bool."""
        flags = (p.target == 2 for p in self.parameters)
        return self.spread_over(flags, len(self.inputs)).astype(bool)

    @property
    def variance(self) -> float:
        """Prior variance of Z; of a kernel without variances, one length scale from the origin."""
        return float(sum(self.values[self.is_variance])) or 1.0

    @property
    def log_parameters(self) -> np.ndarray:
        """Logarithms of `values`, (h,)."""
        return np.log(self.values)

    def with_log_parameters(self, theta: np.ndarray) -> Kernel:
        """Return the kernel with the values whose logarithms are `theta`, (h,)."""
        return self.of_values(np.exp(theta), self.inputs)

    def with_lengthscales(self, lengthscales: tuple[float, ...]) -> Kernel:
        """Return the kernel with other length scales."""
        return replace(self, lengthscales=lengthscales)  # type: ignore[type-var]

    def without(self, index: int) -> Kernel:
        """Return the kernel that no longer sees one of its inputs."""
        names = [p.name for p in self.parameters if p.is_per_input]
        changes = {
            name: (value := getattr(self, name))[:index] + value[index + 1 :]
            for name in (*names, 'inputs')
        }
        return replace(self, **changes)  # type: ignore[type-var]

    def scale(self, U: np.ndarray) -> np.ndarray:
        """Return the inputs it sees in units of their length scales, (n, d)."""
        return U[:, self.inputs] / np.array(self.lengthscales)

    @classmethod
    @abstractmethod
    def scales(cls, power: float, spread: np.ndarray) -> np.ndarray:
        """Return typical `values` (h,), from which a search starts.

        Args:
            power: variance of the component.
            spread: standard deviations of the inputs it sees, (d,).
        """

    @abstractmethod
    def matrix(self, U: np.ndarray, V: np.ndarray | None = None) -> np.ndarray:
        """Return covariances between rows of U (n, d) and of V (m, d), or of U, (n, m)."""

    @abstractmethod
    def diagonal(self, U: np.ndarray) -> np.ndarray:
        """Return the prior variances at rows of U (n, d), (n,)."""

    @abstractmethod
    def vector(self, S: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return covariances of one scaled input s (d,) with scaled inputs S (n, d), (n,)."""

    @abstractmethod
    def gradient(self, U: np.ndarray, H: np.ndarray) -> np.ndarray:
        """Contract a symmetric H (n, n) with the derivatives by `log_parameters`, (h,)."""

    def gradient_from(self, K: np.ndarray, U: np.ndarray, H: np.ndarray) -> np.ndarray:
        """Return `gradient` where `K = matrix(U)` is at hand; a kernel that can use it does."""
        del K
        return self.gradient(U, H)


@dataclass(frozen=True, slots=True)
class Stationary(Kernel):
    """Kernel of the distance between two inputs, with one length scale per input.

    `kappa(u, u') = signal_variance rho(r^2)` with `r^2 = sum_i (u_i - u'_i)^2 / l_i^2`. A subclass
    gives `correlation`, rho, and its derivative by r^2, `slope`.

    Attributes:
        signal_variance: `sigma_z` [unit of the component squared].
        lengthscales: `l`, one per input [unit of the input].
        inputs: columns of U that the kernel sees, as many as length scales.
    """

    parameters: ClassVar[tuple[HyperParameter, ...]] = (SIGNAL_VARIANCE, LENGTHSCALES)
    signal_variance: float
    lengthscales: tuple[float, ...]
    inputs: tuple[int, ...]

    @staticmethod
    @abstractmethod
    def correlation(squares: np.ndarray) -> np.ndarray:
        """Return `rho(r^2)` for squared distances of any shape; 1 at 0."""

    @staticmethod
    @abstractmethod
    def slope(squares: np.ndarray) -> np.ndarray:
        """Return the derivative of `rho` by `r^2`, not above 0."""

    @classmethod
    def scales(cls, power: float, spread: np.ndarray) -> np.ndarray:
        """Return the variance of the component and the spreads of the inputs, (1 + d,)."""
        return np.array([power, *spread])

    def matrix(self, U: np.ndarray, V: np.ndarray | None = None) -> np.ndarray:
        """Return the covariances between rows of U (n, d) and of V (m, d), (n, m). O(n m d)."""
        S = self.scale(U)
        T = S if V is None else self.scale(V)
        return self.signal_variance * self.correlation(_squares(S, T))

    def diagonal(self, U: np.ndarray) -> np.ndarray:
        """Return the prior variances at rows of U (n, d), (n,)."""
        return np.full(len(U), self.signal_variance)

    def vector(self, S: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return the covariances of one scaled input s (d,) with scaled inputs S (n, d), (n,)."""
        difference = S - s
        squares = np.einsum('ij,ij->i', difference, difference)
        return self.signal_variance * self.correlation(squares)

    def gradient(self, U: np.ndarray, H: np.ndarray) -> np.ndarray:
        """Contract a symmetric H (n, n) with dK/dtheta, (1 + d,). O(n^2 d)."""
        S = self.scale(U)
        squares = _squares(S, S)
        height = self.signal_variance * float((H * self.correlation(squares)).sum())
        weighted = -2.0 * self.signal_variance * H * self.slope(squares)
        return np.array([height, *distance_sums(S, weighted)])


def distance_sums(S: np.ndarray, weighted: np.ndarray) -> np.ndarray:
    """Return `sum_ab weighted_ab (s_a - s_b)^2` per column of S (n, d), (d,).

    For symmetric weights (n, n) it is `2 (sum_a r_a s_a^2 - s^T weighted s)` with row sums r: no
    n x n x d array.
    """
    rows = weighted.sum(axis=1)
    return np.asarray(2.0 * (rows @ (S * S) - np.einsum('ai,ai->i', S, weighted @ S)))


def _squares(S: np.ndarray, T: np.ndarray) -> np.ndarray:
    """Return squared distances of rows of S (n, d) and T (m, d), (n, m), none below zero."""
    halves = 0.5 * (S * S).sum(axis=1)[:, None] + 0.5 * (T * T).sum(axis=1)
    return np.maximum(2.0 * (halves - S @ T.T), 0.0)
