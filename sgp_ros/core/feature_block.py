"""What a stream tells of the Z of one component, in features of a bounded number of inputs.

The features at u are `phi(u) = L^-1 k(B, u)` with inducing inputs B and `L L^T = K(B, B)`, their
weights standard normal: Z as the values at B predict it. What they cannot predict, the remainder
`kappa(u, u) - phi phi^T`, counts as noise of its own at each sample (Snelson and Ghahramani 2006).
An input joins B when its remainder is no longer small beside the noise; features that exist do not
change by that, so nothing absorbed before has to be seen again.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.core.factor import GrowingFactor
from sgp_ros.core.output_groups import OutputGroup
from sgp_ros.core.trapezoid import absorb_equation, solve_transposed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from sgp_ros.core.factor import Whitening
    from sgp_ros.core.forgetting import Forgetting
    from sgp_ros.core.kernels import Kernel

REMAINDER = 0.01
"""Share of the noise variance above which the remainder makes an input join. The features then
leave out a hundredth of the noise, and the squares of the pivots of L stay above that."""


class FeatureBlock:
    """Square-root information on the weights of one component, coupled to W.

    Attributes:
        S: (capacity, p + 1) coupling to W and right side; the first `size` rows count.
        is_resolved: whether the last sample left a remainder that is small beside the noise.

    Args:
        kernel: of the component; None where Z is zero.
        noise: its noise variance.
        p: number of coefficients.
        capacity: most inducing inputs.
    """

    def __init__(self, kernel: Kernel | None, noise: float, p: int, capacity: int) -> None:
        dense = capacity if kernel is not None else 0
        self._noise = noise
        self._capacity = dense
        self._factor = GrowingFactor(OutputGroup(kernel, 0.0, (0,), (1.0,)), 0, dense)
        self._R = np.zeros((dense, dense))
        self.S = np.zeros((dense, p + 1))
        self.is_resolved = True

    @property
    def size(self) -> int:
        """Inducing inputs held."""
        return self._factor.size

    def features(self, u: np.ndarray) -> Whitening:
        """Return phi(u), (size,), as `v`, for an input u (d,). O(size^2 / 2)."""
        return self._factor.whiten(u)

    def gain(self, features: Whitening) -> np.ndarray:
        """Return g (size,) with `phi theta = g (z - S W)` plus noise of variance g g^T."""
        g = features.v.copy()
        solve_transposed(self._R, self.size, g)
        return g

    def absorb(
        self, features: Whitening, f: np.ndarray, y: float, weight: float = 1.0
    ) -> np.ndarray:
        """Learn observation y with regressor f (p,) at the input of these features.

        Args:
            features: of the input.
            f: regressor.
            y: observation.
            weight: by which its equation of unit noise counts; less than one for an old sample.

        Returns:
            What it tells of W alone: a row of unit noise and its value, (p + 1,).
        """
        rest = np.append(f, y)
        phi, remainder = features.v, remainder_of(features)
        is_new = remainder > REMAINDER * self._noise
        self.is_resolved = not is_new or self.size < self._capacity
        if is_new and self.is_resolved:
            self._factor.append(features, np.zeros((1, 1)))
            self._R[self.size - 1, self.size - 1] = 1.0
            phi, remainder = np.append(phi, math.sqrt(remainder)), 0.0
        scale = weight / math.sqrt(self._noise + remainder)
        rest *= scale
        absorb_equation(self._R, self.S, self.size, scale * phi, rest)
        return rest

    def fade(self, forgetting: Forgetting) -> np.ndarray:
        """Forget a little of the data, nothing of the prior: the weights in turn get theirs back.

        Returns:
            What that leaves on W: rows of unit noise and their values, (1, p + 1), or none.
        """
        m = self.size
        if not m:
            return np.zeros((0, self.S.shape[1]))
        self._R[:m, :m] *= forgetting.factor
        self.S[:m] *= forgetting.factor
        phi, rest = np.zeros(m), np.zeros(self.S.shape[1])
        phi[forgetting.turn % m] = forgetting.lost(m)
        absorb_equation(self._R, self.S, m, phi, rest)
        return rest[None]

    def state(self) -> dict[str, np.ndarray]:
        """Return what `restore` needs, as arrays."""
        m = self.size
        arrays = {f'inducing_{name}': array for name, array in self._factor.state().items()}
        return arrays | {'R': self._R[:m, :m], 'C': self.S[:m]}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""
        prefix = 'inducing_'
        self._factor.restore(
            {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
        )
        m = self.size
        self._R[:m, :m], self.S[:m] = state['R'], state['C']


def remainder_of(features: Whitening) -> float:
    """Return the variance of Z that features do not hold."""
    return max(features.variance, 0.0)
