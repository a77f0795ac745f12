"""The efforts that held commands give behind a delay, a characteristic and a first-order lag.

Every effort is averaged with the hat of one step to either side of its grid point, and sharpened,
as a second difference treats the position (Fornberg 1988). The averages are exact for any times of
change: of the mean A and the first moment B of the effort over every step, the average at t is
`B(t - h) + A(t) - B(t)`. A lag `T y' + y = u` leaves an exponential behind each command. Online
the kernel of a window, linear between the samples, takes the place of the hat.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

_SHARPEN = (1.0, -1 / 12, 1 / 90)
LEAD_S = 1.0
"""Time around a stretch of which the commands count: longer than delays and lags of drives."""


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """Commands of a recording and the grids on which their efforts are wanted.

    Attributes:
        times: (c,) from which each command holds [s], strictly increasing.
        values: (c, k) [N m or N].
        grids: first time [s] and number of points of each stretch.
        step: of the grids [s].
    """

    times: np.ndarray
    values: np.ndarray
    grids: tuple[tuple[float, int], ...]
    step: float

    def effort(
        self,
        joint: int,
        *,
        delay: float = 0.0,
        time_constant: float = 0.0,
        characteristic: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> np.ndarray:
        """Return the effort of one joint on the grids, (n,) [N m or N].

        Args:
            joint: index.
            delay: of the command [s].
            time_constant: of the lag behind the characteristic [s].
            characteristic: from commands to what the motor is asked for; None for the same.
        """
        u = self.values[:, joint]
        if characteristic is not None:
            u = characteristic(u)
        return _averaged(self.times + delay, u, time_constant, self.grids, self.step)

    @property
    def rows(self) -> int:
        """Number n of points of all grids."""
        return sum(n for _, n in self.grids)

    def on(self, stretches: Sequence[slice]) -> Drive:
        """Return the commands of some stretches of the rows, each within one grid.

        Those of `LEAD_S` before each are kept, for delays and lags.
        """
        ends = np.cumsum([n for _, n in self.grids])
        grids, needed = [], np.zeros(len(self.times), dtype=bool)
        for s in stretches:
            i = int(np.searchsorted(ends, s.start, side='right'))
            first, count = self.grids[i]
            start = first + self.step * (s.start - (int(ends[i]) - count))
            grids.append((start, s.stop - s.start))
            stop = start + self.step * (s.stop - s.start) + LEAD_S
            a, b = np.searchsorted(self.times, (start - LEAD_S, stop), side='right')
            needed[max(a - 1, 0) : b] = True
        times, values = self.times[needed], self.values[needed]
        return replace(self, times=times, values=values, grids=tuple(grids))

    def changed(self, change: Callable[[np.ndarray], np.ndarray], later: float) -> Drive:
        """Return other commands (c, k), some time later [s]."""
        return replace(self, times=self.times + later, values=change(self.values))

    def at(
        self, joint: int, times: np.ndarray, *, delay: float = 0.0, time_constant: float = 0.0,
        characteristic: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Return the effort of one joint at given times, (n,), as `effort` but not averaged."""
        u = self.values[:, joint]
        if characteristic is not None:
            u = characteristic(u)
        knots = self.times + delay
        i = np.maximum(np.searchsorted(knots, times, side='right') - 1, 0)
        if time_constant <= 0.0:
            return u[i]
        y = lagged(knots, u, time_constant)
        return u[i] + (y[i] - u[i]) * np.exp(-np.maximum(times - knots[i], 0.0) / time_constant)


@dataclass(frozen=True, slots=True, eq=False)
class WindowDrive:
    """Commands of the recent past, whose efforts are wanted averaged with the kernel of a window.

    Attributes:
        times: (c,) from which each command holds [s], strictly increasing.
        values: (c, k) [N m or N].
        samples: (m,) times of the window's samples [s].
        left, right: (m - 1,) kernel at both ends of each interval, linear in between [1/s].
    """

    times: np.ndarray
    values: np.ndarray
    samples: np.ndarray
    left: np.ndarray
    right: np.ndarray

    def effort(
        self,
        joint: int,
        *,
        delay: float = 0.0,
        time_constant: float = 0.0,
        characteristic: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> np.ndarray:
        """Return the average effort of one joint, (1,), see `Drive.effort`.

        In a piece of length h with the kernel `a + b x` the lag leaves of its distance from the
        command `int (a + b x) exp(-x / T) dx = T (a E + b (T E - h exp(-h / T)))`,
        `E = 1 - exp(-h / T)`.
        """
        u = self.values[:, joint]
        if characteristic is not None:
            u = characteristic(u)
        knots, samples = self.times + delay, self.samples
        inside = (samples[0] < knots) & (knots < samples[-1])
        edges = np.union1d(samples, knots[inside])
        start, h = edges[:-1], np.diff(edges)
        i = np.maximum(np.searchsorted(knots, start, side='right') - 1, 0)
        at = np.searchsorted(samples, start, side='right') - 1
        b = (self.right - self.left)[at] / np.diff(samples)[at]
        a = self.left[at] + b * (start - samples[at])
        held = float((h * (a + 0.5 * b * h)) @ u[i])
        if time_constant <= 0.0:
            return np.array([held])
        T = time_constant
        y = lagged(knots, u, T)
        behind = (y[i] - u[i]) * np.exp(-np.maximum(start - knots[i], 0.0) / T)
        E = -np.expm1(-h / T)
        return np.array([held + float(behind @ (T * (a * E + b * (T * E - h * (1.0 - E)))))])


def _averaged(
    knots: np.ndarray, u: np.ndarray, time_constant: float,
    grids: tuple[tuple[float, int], ...], step: float,
) -> np.ndarray:  # fmt: skip
    """Return the averages on all grids, one after the other."""
    y = lagged(knots, u, time_constant) if time_constant > 0.0 else u
    parts = []
    for start, n in grids:
        beyond = np.zeros((2, n + 2 * len(_SHARPEN) - 1))
        _moments(knots, u, y, time_constant, start - step * len(_SHARPEN), step, beyond)
        term = beyond[1, :-1] + beyond[0, 1:] - beyond[1, 1:]
        found = np.zeros(n)
        for power, factor in enumerate(_SHARPEN):
            margin = len(_SHARPEN) - 1 - power
            found += factor * term[margin : len(term) - margin]
            term = term[2:] - 2.0 * term[1:-1] + term[:-2]
        parts.append(found)
    return np.concatenate(parts)


@njit(cache=True)
def _moments(
    knots: np.ndarray, u: np.ndarray, y: np.ndarray, time_constant: float, start: float,
    step: float, out: np.ndarray,
) -> None:  # fmt: skip
    """Add mean and first moment of the effort over the steps of a grid to `out` (2, n).

    Args:
        knots: times from which commands hold (c,) [s].
        u: commands (c,).
        y: the output of the lag at those times (c,).
        time_constant: of the lag; none at 0 [s].
        start: of the first step [s].
        step: of the grid [s].
        out: what is added to, zeros at first.
    """
    i = max(np.searchsorted(knots, start, side='right') - 1, 0)
    for p in range(out.shape[1]):
        t, a = start + step * p, 0.0
        while a < 1.0:
            b, is_last = 1.0, i + 1 == len(knots) or knots[i + 1] >= t + step
            if not is_last:
                b = max((knots[i + 1] - t) / step, a)
            out[0, p] += u[i] * (b - a)
            out[1, p] += 0.5 * u[i] * (b * b - a * a)
            if time_constant > 0.0:
                rate = step / time_constant
                since = max(t + step * a - knots[i], 0.0)
                behind = (y[i] - u[i]) * np.exp(-since / time_constant)
                faded = -np.expm1(-rate * (b - a)) / rate
                out[0, p] += behind * faded
                out[1, p] += behind * (
                    a * faded + (faded - (b - a) * np.exp(-rate * (b - a))) / rate
                )
            if is_last:
                break
            a, i = b, i + 1


@njit(cache=True)
def lagged(knots: np.ndarray, u: np.ndarray, time_constant: float) -> np.ndarray:
    """Return the output of the lag when each command begins, (c,); it starts settled."""
    y = np.empty(len(u))
    y[0] = u[0]
    for i in range(1, len(u)):
        y[i] = u[i - 1] + (y[i - 1] - u[i - 1]) * np.exp(
            -(knots[i] - knots[i - 1]) / time_constant
        )
    return y
