"""Prediction of signals from their own earlier values.

A robot's acceleration has a prior: it is finite, and it follows from the one before. Each of k
signals is an autoregression of second order with a constant, `x_t = c_1 x_(t-1) + c_2 x_(t-2) +
c_0 + e_t`, by least squares over all values; the
covariance of e over the signals fades, as motions change. Without predecessors, the mean and
covariance of the signals are the prior.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

ORDER = 2
FIRST = 8
"""Values before their mean and covariance are a prior."""
ENOUGH = 30
"""Values before the autoregression is one: ten for each coefficient of one signal. With eight, one
early error of an arm widened its prior for hundreds of values."""
MEMORY = 100
"""Values over which the covariance of the errors fades."""
_RIDGE = 1e-9


class Autoregression:
    """One-step predictions of k signals; O(k^2) memory and time.

    Attributes:
        n: values seen.
        mean, covariance: of the signals, (k,) and (k, k).
        products: sums of products of the rows (latest value, the one before, 1) with themselves
            and the next value, (k, 3, 4).
        errors: values predicted so far.
        error_covariance: of these errors, (k, k).
        past: the last values without a gap, latest first, (at most 2, k).
    """

    def __init__(self, k: int) -> None:
        size = ORDER + 1
        self.n = self.errors = 0
        self.mean, self.covariance = np.zeros(k), np.zeros((k, k))
        self.products = np.zeros((k, size, size + 1))
        self.error_covariance = np.zeros((k, k))
        self.past = np.zeros((0, k))
        self._coefficients: np.ndarray | None = None

    @property
    def coefficients(self) -> np.ndarray:
        """Coefficients (k, 3), latest value first, then the constant.

        The ridge is relative to each column, so no unit enters; a signal that rests at zero has
        coefficients of zero.
        """
        if self._coefficients is None:
            self._coefficients = self._solved()
        return self._coefficients

    def _solved(self) -> np.ndarray:
        size = np.sqrt(np.diagonal(self.products[:, :, :-1], axis1=1, axis2=2))
        size = np.where(size > 0.0, size, 1.0)
        A = self.products[:, :, :-1] / (size[:, :, None] * size[:, None, :])
        b = self.products[:, :, -1:] / size[:, :, None]
        solved = np.linalg.solve(A + _RIDGE * np.eye(A.shape[1]), b)[:, :, 0]
        return np.asarray(solved / size)

    def begin(self) -> None:
        """Forget the last values: what follows does not continue them."""
        self.past = self.past[:0]

    def predict(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Return mean (k,) and covariance (k, k) of the next values; None before `FIRST`."""
        if self.n < FIRST:
            return None
        if len(self.past) < ORDER or self.errors < ORDER + 1:
            return self.mean, self.covariance
        return (self._rows() * self.coefficients).sum(axis=1), self.error_covariance

    def add(self, x: np.ndarray) -> None:
        """Take the next values (k,)."""
        if len(self.past) == ORDER:
            rows = self._rows()  # (k, 3)
            if self.n >= ENOUGH:  # before, coefficients follow the values themselves
                error = x - (rows * self.coefficients).sum(axis=1)
                self.errors += 1
                share = 1.0 / min(self.errors, MEMORY)
                change = np.outer(error, error) - self.error_covariance
                self.error_covariance = self.error_covariance + share * change
            self.products = self.products + rows[:, :, None] * np.column_stack([rows, x])[:, None]
            self._coefficients = None
        self.n += 1
        step = x - self.mean
        self.mean = self.mean + step / self.n
        change = np.outer(step, x - self.mean) - self.covariance
        self.covariance = self.covariance + 0.5 * (change + change.T) / self.n
        self.past = np.vstack([x, self.past])[:ORDER]

    def state(self) -> dict[str, np.ndarray]:
        """Return everything as arrays; `restore` takes it back."""
        found = {name: np.asarray(getattr(self, name)) for name in _ARRAYS}
        return found | {'counts': np.array([self.n, self.errors])}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue exactly where `state` was taken."""
        for name in _ARRAYS:
            setattr(self, name, np.array(state[name]))
        self._coefficients = None
        self.n, self.errors = (int(count) for count in state['counts'])

    def _rows(self) -> np.ndarray:
        return np.vstack([self.past, np.ones(self.past.shape[1])]).T  # (k, 3)


_ARRAYS = ('mean', 'covariance', 'products', 'error_covariance', 'past')
