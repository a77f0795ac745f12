"""Inducing-point features of the Z of outputs that share a kernel, as square-root information.

The features at u are `phi(u) = L^-1 k(B, u)` with inducing inputs B and `L L^T = K(B, B)`, their
weights standard normal: Z as the values at B predict it. What they cannot predict, the remainder
`kappa(u, u) - phi phi^T`, counts as noise of its own at each sample (FITC: Snelson and Ghahramani
2006). An input joins B when its remainder is no longer small beside the noise; features that exist
do not change by that, so nothing absorbed before has to be seen again. Where B has no room for it,
the remainder may be the same at each return, and n samples with the same error of variance r
tell no more than one: the n-th counts with the variance n r.

Two systems are kept: one that holds the prior of the weights, which W and predictions need, and
one of the data alone, which other hyper-parameters need (`gp.inducing_information`). The second
could be had from the first by taking the prior off, but where data tell little beside the prior
that difference is rounding; rotations into a second triangle lose no digit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy import linalg

from sgp_ros.gp.factor import GrowingFactor, Whitening, part_of
from sgp_ros.gp.information import Forgetting, Information
from sgp_ros.gp.model import OutputGroup
from sgp_ros.gp.rotations import (
    absorb_equation,
    absorb_sample,
    absorbed_equations_numpy,
    solve_transposed,
)

REMAINDER = 0.01
"""Share of the noise variance above which the remainder makes an input join. The features then
leave out a hundredth of the noise."""

JITTER = 1e-12
"""Share of the variance of Z by which inducing values stray from Z, so that L keeps its digits."""

LEAST = 1e-9
"""Share of the variance of Z below which a remainder is rounding: no input joins for it."""


class InducingPoints:
    """Square-root information on the weights of one group of outputs, coupled to W.

    Attributes:
        group, place: the outputs, their kernel and noise; where the outputs stand.
        inputs: inducing inputs, (d,) each.
        is_resolved: whether the last sample left a remainder that is small beside the noise.
        tally: of the samples, as much as they count: their number, their variances over that of
            the noise, and the number of those without room.

    Args:
        group: of outputs.
        p: number of coefficients.
        capacity: most inducing inputs.
    """

    def __init__(self, group: OutputGroup, p: int, capacity: int) -> None:
        self.group, self.place = group, group.place
        self.inputs: list[np.ndarray] = []
        self.is_resolved = True
        self.tally = np.zeros(3)
        k = len(group.outputs)
        self._shape = (k, p + 1)
        self._residual_R, self._residual_z = np.zeros((k, p, p)), np.zeros((k, p))
        self._scales = np.array(group.scales)  # (k,)
        self._capacity = dense = capacity if group.kernel is not None else 0
        variance = 0.0 if group.kernel is None else group.kernel.variance
        own = OutputGroup(group.kernel, JITTER * variance, (0,), (1.0,))
        self._factor = GrowingFactor(own, 0, dense)
        self._least = max(REMAINDER * group.noise, LEAST * variance)
        self._R, self._S = np.zeros((dense, dense)), np.zeros((dense, k * (p + 1)))
        self._data_R, self._data_S = np.zeros_like(self._R), np.zeros_like(self._S)
        self._phi, self._alone = np.zeros(dense), np.zeros(self._shape)

    @property
    def size(self) -> int:
        """Inducing inputs held."""
        return self._factor.size

    @property
    def capacity(self) -> int:
        """Most inducing inputs, 0 where Z is zero."""
        return self._capacity

    @property
    def lower(self) -> np.ndarray:
        """The factor L of K(B, B), a view (size, size)."""
        return self._factor.lower

    @property
    def data(self) -> tuple[np.ndarray, np.ndarray]:
        """The system without the prior, views (size, size) and (size, k (p + 1))."""
        m = self.size
        return self._data_R[:m, :m], self._data_S[:m]

    @property
    def residuals(self) -> tuple[Information, ...]:
        """Equations left on W once the weights are eliminated, one per output, not copied."""
        return tuple(map(Information, self._residual_R, self._residual_z))

    def features(self, u: np.ndarray) -> Whitening:
        """Return phi(u), (size,), as `v`, for an input u (d,). O(size^2 / 2)."""
        return self._factor.whiten(u)

    def feature_rows(self, U: np.ndarray) -> np.ndarray:
        """Return phi at inputs U (n, d), (n, size). O(n size^2 / 2)."""
        if self.group.kernel is None or not self.inputs:
            return np.zeros((len(U), 0))
        K = self.group.kernel.matrix(np.array(self.inputs), U)
        return np.asarray(linalg.solve_triangular(self.lower, K, lower=True, check_finite=False)).T

    def gain(self, features: Whitening) -> np.ndarray:
        """Return g (size,) with `phi theta = g (z - S W)` plus noise of variance g g^T."""
        g = features.v.copy()
        solve_transposed(self._R, g)
        return g

    def explain(
        self, features: Whitening, gain: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the prediction at an input: of each regressor, of Z, and its variance.

        Args:
            features: of the input.
            gain: of these.

        Returns:
            Shapes (k, p), (k,) and (k,): Z is the second less the first times W.
        """
        coupling = self._scales[:, None] * (gain @ self._S[: len(gain)]).reshape(self._shape)
        variance = np.square(self._scales) * (gain @ gain + remainder_of(features))
        return coupling[:, :-1], coupling[:, -1], variance

    def join(self, u: np.ndarray, features: Whitening) -> Whitening:
        """Take the input u (d,) of these features into B if they leave out too much and room is.

        Returns:
            The features of u afterwards, with what they still leave out.
        """
        remainder = remainder_of(features)
        self.is_resolved = remainder <= REMAINDER * self.group.noise
        if remainder <= self._least or self.size == self._capacity:
            return features
        self.is_resolved = True
        own = remainder / self._factor.pivot(features)
        self._factor.append(features, np.zeros((1, 1)))
        self.inputs.append(u.copy())
        self._R[self.size - 1, self.size - 1] = 1.0
        v = np.append(features.v, own)
        return features._replace(v=v, reduction=features.reduction + own * own)

    def absorb(
        self, u: np.ndarray, features: Whitening, data: np.ndarray, weight: float = 1.0
    ) -> np.ndarray:
        """Learn regressors and, last, observations (k, p + 1) at the input u (d,).

        Args:
            u: input.
            features: of it.
            data: of the outputs of the group.
            weight: by which the equations of unit noise count; less than one for an old sample.

        Returns:
            Their information on W alone: rows of unit noise and their values, (k, p + 1).
        """
        found = self.join(u, features)
        remainder, noise = remainder_of(found), self.group.noise
        tally = self.tally
        tally[0] += weight**2
        tally[1] += weight**2 * (1.0 + remainder / noise)
        if not self.is_resolved:
            tally[2] += weight**2
            remainder *= max(float(tally[2]), 1.0)
        rest = np.empty(self._shape)
        absorb_sample(
            self._R, self._S, self._data_R, self._data_S, self._residual_R, self._residual_z,
            found.v, data, self._scales, weight / math.sqrt(noise + remainder),
            self._phi, rest, self._alone,
        )  # fmt: skip
        return rest

    def learn_anew(self, U: np.ndarray, data: np.ndarray, weights: np.ndarray) -> None:
        """Learn all outputs (n, k, p + 1) at the inputs U (n, d), weighted by (n,), in order."""
        own = data[:, self.place]
        for u, row, weight in zip(U, own, weights, strict=True):
            self.absorb(u, self.features(u), row, float(weight))

    def take(self, R: np.ndarray, S: np.ndarray) -> None:
        """Hold data of unit noise, weights `R` (r, size) and the rest `S` (r, k (p + 1)), instead.

        The equations that are left on W once the weights are eliminated enter `residuals`. O(m^3).
        """
        m = self.size
        R, S, alone = absorbed_equations_numpy(R, S, np.zeros((m, m)), np.zeros((m, S.shape[1])))
        self._data_R[:m, :m], self._data_S[:m] = R, S
        R, S, _ = absorbed_equations_numpy(np.eye(m), np.zeros_like(S), R, S)
        self._R[:m, :m], self._S[:m] = R, S
        for j, residual in enumerate(self.residuals):
            residual.absorb(alone.reshape(-1, *self._shape)[:, j])

    def marginals(self) -> tuple[Information, ...]:
        """Return the data's information on W per output, the weights integrated out. O(m^3)."""
        m = self.size
        _, _, rest = absorbed_equations_numpy(
            np.eye(m), np.zeros((m, self._S.shape[1])), *self.data
        )
        rows = rest.reshape(-1, *self._shape)
        return tuple(
            residual.with_rows(rows[:, j, :-1], rows[:, j, -1])
            for j, residual in enumerate(self.residuals)
        )

    def fade(self, forgetting: Forgetting) -> np.ndarray:
        """Forget a little of the data, nothing of the prior: the weights in turn get theirs back.

        Returns:
            What that leaves on W: rows of unit noise and their values, (r, p + 1).
        """
        m = self.size
        self.tally *= forgetting.factor**2
        if not m:
            return np.zeros((0, self._shape[1]))
        for R, S in ((self._R, self._S), (self._data_R, self._data_S)):
            R[:m, :m] *= forgetting.factor
            S[:m] *= forgetting.factor
        phi, rest = np.zeros(m), np.zeros(self._S.shape[1])
        phi[forgetting.turn % m] = forgetting.lost(m)
        absorb_equation(self._R, self._S, phi, rest)
        return rest.reshape(self._shape)

    def state(self) -> dict[str, np.ndarray]:
        """Return what `restore` needs, as arrays."""
        m = self.size
        arrays = {f'inducing_{name}': array for name, array in self._factor.state().items()}
        return arrays | {
            'outputs': np.array(self.group.outputs), 'inputs': np.array(self.inputs),
            'tally': self.tally,
            'R': self._R[:m, :m], 'C': self._S[:m],
            'data_R': self._data_R[:m, :m], 'data_C': self._data_S[:m],
            'residual_R': self._residual_R, 'residual_z': self._residual_z,
        }  # fmt: skip

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""
        self._factor.restore(part_of(state, 'inducing_'))
        self.inputs = [np.array(u) for u in state['inputs']]
        self.tally[:] = state['tally']
        m = self.size
        self._R[:m, :m], self._S[:m] = state['R'], state['C']
        self._data_R[:m, :m], self._data_S[:m] = state['data_R'], state['data_C']
        self._residual_R[:], self._residual_z[:] = state['residual_R'], state['residual_z']


def remainder_of(features: Whitening) -> float:
    """Return the variance of Z that features do not hold."""
    return max(features.variance, 0.0)
