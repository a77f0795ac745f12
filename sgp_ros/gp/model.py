"""Observed data, hyper-parameters, groups of outputs that share a factor, and the prior of W.

The prior is kept as a square root of its precision: `Lambda = root^T root` is the inverse of
sigma_w. Knowing nothing (sigma_w infinite) is then simply a root without rows, and no digit is
lost on the way there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from sgp_ros.gp.kernel import Kernel


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """n observations of `Y = g(u) X(u) + V` with `X(u) = f(u) W + Z(u)`.

    Attributes:
        U: inputs, (n, d).
        F: regressors f(u), (n, k, p).
        y: observed values, (n, m).
        G: observation matrices g(u), (n, m, k); None where Y = X + V, then m = k.
    """

    U: np.ndarray
    F: np.ndarray
    y: np.ndarray
    G: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Refuse shapes that do not belong together.

        Raises:
            ValueError: naming the shapes.
        """
        n, k, _ = self.F.shape
        gain_fits = self.G is None or self.G.shape == (n, self.y.shape[1], k)
        direct_fits = self.G is not None or self.y.shape[1] == k
        if len(self.U) != n or len(self.y) != n or not gain_fits or not direct_fits:
            gain = None if self.G is None else self.G.shape
            raise ValueError(f'U {self.U.shape}, F {self.F.shape}, y {self.y.shape}, G {gain}')


@dataclass(frozen=True, slots=True)
class Model:
    """Hyper-parameters: a kernel per component of X, a noise variance per component of Y.

    Attributes:
        kernels: k of them; None where Z is zero (parametric regression).
        noise: m variances of V [unit of the observation squared], positive.
    """

    kernels: tuple[Kernel | None, ...]
    noise: tuple[float, ...]

    @property
    def log_parameters(self) -> np.ndarray:
        """Logarithms of all hyper-parameters: kernels in order, then noise."""
        parts = [kernel.log_parameters for kernel in self.kernels if kernel is not None]
        return np.concatenate([*parts, np.log(np.array(self.noise))])

    def with_log_parameters(self, theta: np.ndarray) -> Model:
        """Return this model with the hyper-parameters whose logarithms are `theta`."""
        kernels: list[Kernel | None] = []
        start = 0
        for kernel in self.kernels:
            if kernel is None:
                kernels.append(None)
                continue
            stop = start + len(kernel.values)
            kernels.append(kernel.with_log_parameters(theta[start:stop]))
            start = stop
        return Model(tuple(kernels), tuple(float(x) for x in np.exp(theta[start:])))

    def output(self, j: int) -> Model:
        """Return the model of component j alone."""
        return Model(self.kernels[j : j + 1], self.noise[j : j + 1])

    def with_output(self, j: int, other: Model) -> Model:
        """Return this model with component j of the one that `other` has."""
        kernels, noise = list(self.kernels), list(self.noise)
        (kernels[j],), (noise[j],) = other.kernels, other.noise
        return Model(tuple(kernels), tuple(noise))


_SAME = 1e-12
"""Relative difference of signal-to-noise ratios up to which they are one ratio: rounding."""


@dataclass(frozen=True, slots=True)
class OutputGroup:
    """Outputs whose covariance is `scale^2 (K + noise I)` with one K.

    Attributes:
        kernel: of the first output; None where Z is zero.
        noise: of the first output.
        outputs: their indices.
        scales: one per output, 1 for the first.
    """

    kernel: Kernel | None
    noise: float
    outputs: tuple[int, ...]
    scales: tuple[float, ...]

    @property
    def place(self) -> slice | list[int]:
        """The outputs as an index; a slice, which copies nothing, where they follow each other."""
        first, last = self.outputs[0], self.outputs[-1]
        if last - first + 1 == len(self.outputs):
            return slice(first, last + 1)
        return list(self.outputs)


def output_groups(model: Model) -> tuple[OutputGroup, ...]:
    """Return the groups of a model in the order of their first outputs."""
    found: list[OutputGroup] = []
    for j, (kernel, noise) in enumerate(zip(model.kernels, model.noise, strict=True)):
        for i, group in enumerate(found):
            if _is_multiple(kernel, noise, group):
                scales = (*group.scales, float(np.sqrt(noise / group.noise)))
                found[i] = OutputGroup(group.kernel, group.noise, (*group.outputs, j), scales)
                break
        else:
            found.append(OutputGroup(kernel, noise, (j,), (1.0,)))
    return tuple(found)


def separable(one: Model, other: Model) -> tuple[tuple[int, ...], ...]:
    """Return the finest sets of outputs that share no factor with others under either model."""
    sets = [{j} for j in range(len(one.noise))]
    for group in (*output_groups(one), *output_groups(other)):
        joined = [s for s in sets if s.intersection(group.outputs)]
        sets = [s for s in sets if s not in joined] + [set().union(*joined)]
    return tuple(tuple(sorted(s)) for s in sorted(sets, key=min))


def group_of(model: Model, outputs: tuple[int, ...]) -> OutputGroup:
    """Return some outputs of one group as a group of their own."""
    first = outputs[0]
    noise = model.noise[first]
    scales = tuple(float(np.sqrt(model.noise[j] / noise)) for j in outputs)
    return OutputGroup(model.kernels[first], noise, outputs, scales)


def _is_multiple(kernel: Kernel | None, noise: float, group: OutputGroup) -> bool:
    other = group.kernel
    if kernel is None or other is None:
        return kernel is other
    if (type(kernel), kernel.inputs) != (type(other), other.inputs):
        return False
    is_height, values, others = kernel.is_variance, kernel.values, other.values
    if not np.array_equal(values[~is_height], others[~is_height]):
        return False
    ratio = np.log(noise / group.noise)
    if not is_height.any():
        return bool(ratio == 0.0)
    heights = np.log(values[is_height]) - np.log(others[is_height])
    return bool(np.all(np.abs(heights - ratio) <= _SAME))


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
