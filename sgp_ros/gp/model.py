"""What the inference works on: the observed data, and the hyper-parameters of the model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.gp.kernels import Kernel


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
            stop = start + len(kernel.log_parameters)
            kernels.append(kernel.with_log_parameters(theta[start:stop]))
            start = stop
        return Model(tuple(kernels), tuple(float(x) for x in np.exp(theta[start:])))
