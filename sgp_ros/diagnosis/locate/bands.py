"""Z of each joint over one variable, and where it differs from zero: one simultaneous band.

Z over a variable and the direction of motion has a part common to both directions and a part that
is odd in them, like friction: `cov(Z(x, s), Z(x', s')) = (a^2 + b^2 s s') exp(-|x - x'|^2 /
(2 l^2))` with s = -1 or 1; the distance of angles that wrap is that of points on a circle. The N
rows are reduced to the means of cells between quantiles of x, apart for both directions.

The rest of the discrepancy, which other variables cause, is treated as noise, and it is correlated
in time. The covariance R of stationary noise is nowhere larger than its greatest spectral density
times the identity, so the mean of n rows is given the variance of n independent ones of that
density: too wide for coloured noise, never too narrow, whatever the order of the cells.

A place is called different where the mean of Z leaves the band `c std`. The factor c is the 95 %
quantile of the largest standardised error that draws of the posteriors have anywhere, with their
correlations, over every joint, variable, direction and place. Noise
that is slower than the smoothing of its spectrum has a larger density than was found, so a region
also needs a dependence on its variable that such noise does not have (`dependence`).

Of recordings in which Z is zero everywhere at most one in twenty shows any region, by either of
the two. The band says where Z is not zero, never where it is: what acts everywhere leaves the
band first where it is strongest. What an effect is confined to is judged by its energy
(`confinement`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, optimize

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import REGION_LEAST_ROWS, SIGNIFICANT
from sgp_ros.diagnosis.locate.dependence import own_variables
from sgp_ros.diagnosis.shown import Band, Dependence

CELLS, LEAST_ROWS = 32, 8
"""Greatest number of cells in each direction; rows per cell, at least, on average."""
LAG_SHARE = 12
"""The spectrum is smoothed to lags of this part of the recording."""
SHORTEST, LONGEST = 0.05, 3.0
"""Bounds of the length scale, in standard deviations of x."""
_AMPLITUDES = np.log((1e-3, 5.0))
"""Bounds of a and b, in root mean squares of the residual."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Rows sorted into m cells of a variable and two directions.

    Attributes:
        of: (N,) cell of each row; the direction counts fast, backward before forward.
        edges: (m, 2) least and greatest value seen in each.
        centre: (m,) mean value.
        count: (2 m,) rows.
    """

    of: np.ndarray
    edges: np.ndarray
    centre: np.ndarray
    count: np.ndarray


def cells_of(x: np.ndarray, forward: np.ndarray) -> Cells:
    """Return the cells of a variable (N,) and of whether the joint moves forward, (N,) of bool."""
    size = max(1, min(CELLS, len(x) // (2 * LEAST_ROWS)))
    ascending = np.sort(x)
    least = np.unique(ascending[np.arange(size) * len(x) // size])  # of each cell: none is empty
    at, m = np.searchsorted(least, x, side='right') - 1, len(least)
    greatest = ascending[np.append(np.searchsorted(ascending, least[1:]), len(x)) - 1]
    of = 2 * at + forward
    return Cells(
        of,
        np.column_stack([least, greatest]),
        np.bincount(at, weights=x, minlength=m) / np.bincount(at, minlength=m),
        np.bincount(of, minlength=2 * m).astype(float),
    )


def noise_density(r: np.ndarray) -> float:
    """Return the greatest spectral density of r (N,), as the variance of white noise of it.

    The spectrum is that of Blackman and Tukey (1958) with the window of Parzen (1961). Cost
    O(N log N).
    """
    n, lags = len(r), max(len(r) // LAG_SHARE, 1)
    spectrum = np.abs(np.fft.rfft(r - r.mean(), 2 * n)) ** 2
    covariance = np.fft.irfft(spectrum, 2 * n)[: lags + 1] / n
    lag = np.arange(lags + 1) / (lags + 1)
    window = np.where(lag < 0.5, 1.0 - 6.0 * lag**2 * (1.0 - lag), 2.0 * (1.0 - lag) ** 3)
    tapered = np.zeros(max(512, 4 * lags))
    tapered[: lags + 1] = covariance * window
    density = 2.0 * np.fft.rfft(tapered).real - tapered[0]
    return float(max(density.max(), covariance[0]))


@dataclass(frozen=True, eq=False)
class Field:
    """Posterior of Z at the 2 m cells of a variable.

    Attributes:
        cells: of the rows.
        mean: (2 m,) [N m or N].
        covariance: (2 m, 2 m).
        gain: evidence beyond that of noise alone [nats].
    """

    cells: Cells
    mean: np.ndarray
    covariance: np.ndarray
    gain: float

    @property
    def std(self) -> np.ndarray:
        """Standard deviations, (2 m,) [N m or N]."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))


def learn_field(cells: Cells, r: np.ndarray, density: float, *, is_angle: bool) -> Field:
    """Return Z of a residual r (N,), its hyper-parameters by evidence. Cost O(m^3).

    Args:
        cells: of the variable.
        r: residual [N m or N].
        density: of the noise, as a variance per row [N^2 m^2 or N^2].
        is_angle: whether the variable wraps.
    """
    size = len(cells.count)
    total = np.bincount(cells.of, weights=r, minlength=size)
    if not density > 0.0:
        return Field(cells, np.zeros(size), np.zeros((size, size)), 0.0)
    seen = cells.count > 0.0
    squares, signs = _geometry(cells.centre, is_angle=is_angle)
    y, noise = total[seen] / cells.count[seen], density / cells.count[seen]
    power = float(r @ r) / len(r)
    inside = np.ix_(seen, seen)
    evidence = _Evidence(y / np.sqrt(power), noise / power, squares[inside], signs[inside])
    found = evidence.maximised()
    K = _covariance(found, squares, signs)
    factor = linalg.cho_factor(K[inside] + np.diag(evidence.noise))
    mean = K[:, seen] @ linalg.cho_solve(factor, evidence.y)
    left = K - K[:, seen] @ linalg.cho_solve(factor, K[seen])
    gain = float(evidence.without - evidence(found)[0])
    return Field(cells, np.sqrt(power) * mean, power * left, gain)


def _geometry(centre: np.ndarray, *, is_angle: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return squared distances in standard deviations, products of directions, (2 m, 2 m)."""
    x = np.repeat(centre, 2)
    apart = np.subtract.outer(x, x)
    if is_angle:
        apart = 2.0 * np.sin(0.5 * apart)
    s = np.tile([-1.0, 1.0], len(centre))
    return apart**2 / max(float(centre.var()), 1e-300), np.multiply.outer(s, s)


def _covariance(theta: np.ndarray, squares: np.ndarray, signs: np.ndarray) -> np.ndarray:
    common, odd, scale = np.exp(2.0 * theta)
    return np.asarray((common + odd * signs) * np.exp(-0.5 * squares / scale))


@dataclass(frozen=True, eq=False)
class _Evidence:
    """Negative log evidence of logarithms of a, b and l, with its gradient."""

    y: np.ndarray
    noise: np.ndarray
    squares: np.ndarray
    signs: np.ndarray

    def __call__(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        common, odd, scale = np.exp(2.0 * theta)
        shape = np.exp(-0.5 * self.squares / scale)
        K = (common + odd * self.signs) * shape
        factor = linalg.cho_factor(K + np.diag(self.noise), lower=True)
        alpha = linalg.cho_solve(factor, self.y)
        inner = linalg.cho_solve(factor, np.eye(len(K))) - np.outer(alpha, alpha)
        slopes = (common * shape, odd * self.signs * shape, 0.5 * K * self.squares / scale)
        value = 0.5 * float(self.y @ alpha) + float(np.log(np.diag(factor[0])).sum())
        return value, np.array([float((inner * slope).sum()) for slope in slopes])

    @property
    def without(self) -> float:
        """Its value without Z."""
        return float(0.5 * (self.y**2 / self.noise + np.log(self.noise)).sum())

    def maximised(self) -> np.ndarray:
        """Return logarithms of a, b and l of greatest evidence, (3,)."""
        bounds = [tuple(_AMPLITUDES)] * 2 + [(np.log(SHORTEST), np.log(LONGEST))]
        start = np.log([0.5, 0.5, 0.4])
        found = optimize.minimize(
            self, start, jac=True, method='L-BFGS-B', bounds=bounds, options={'maxiter': 30}
        )
        return np.asarray(found.x)


DRAWS = 2000


def bands(
    equations: Equations, residual: np.ndarray, dependences: Sequence[Dependence]
) -> tuple[Band, ...]:
    """Return Z of every joint over position, velocity, effort and time, with its band.

    Cost O(k N log N), and a few milliseconds for each joint and variable.

    Args:
        equations: of the recording.
        residual: (N, k) of the bodies [N m or N].
        dependences: of it on the motion, per joint.
    """
    motion = equations.motion
    if len(residual) < REGION_LEAST_ROWS:
        return ()
    velocity = equations.filter(motion.velocity)
    looks, fields = [], []
    for j, dependence in enumerate(dependences):
        r = residual[:, j]
        for variable, x in own_variables(equations, j).items():
            cells = cells_of(x, velocity[:, j] > 0.0)
            is_angle = variable == 'position' and bool(motion.is_continuous[j])
            field = learn_field(cells, r, noise_density(r), is_angle=is_angle)
            if dependence.is_significant(variable):  # a significant variable does not cause noise
                rest = r - field.mean[cells.of]
                field = learn_field(cells, r, noise_density(rest), is_angle=is_angle)
            looks.append((dependence, variable))
            fields.append(field)
    c = critical_value(fields)
    return tuple(_band(*look, field, c) for look, field in zip(looks, fields, strict=True))


def critical_value(fields: Sequence[Field]) -> float:
    """Return the factor c of the standard deviations of all fields together."""
    rng = np.random.default_rng(0)
    largest = np.zeros(DRAWS)
    for field in fields:
        C = field.covariance / np.multiply.outer(field.std, field.std)
        values, vectors = np.linalg.eigh(C)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        draws = rng.standard_normal((DRAWS, len(values))) @ root.T
        largest = np.maximum(largest, np.abs(draws).max(axis=1))
    return float(np.quantile(largest, 1.0 - SIGNIFICANT))


def _band(dependence: Dependence, variable: str, field: Field, c: float) -> Band:
    cells = field.cells
    seen = cells.count.reshape(-1, 2) > 0.0
    mean = np.where(seen, field.mean.reshape(-1, 2), np.nan)
    half = np.where(seen, c * field.std.reshape(-1, 2), np.nan)
    differs = np.asarray((np.abs(mean) > half).any(axis=1))
    runs = merged(differs) if dependence.is_significant(variable) else []
    held = sum(float(cells.count[2 * a : 2 * b + 2].sum()) for a, b in runs)
    regions = tuple((float(cells.edges[a, 0]), float(cells.edges[b, 1])) for a, b in runs)
    return Band(
        dependence.joint, variable, cells.centre, mean, half, regions, held / len(cells.of)
    )


def merged(differs: np.ndarray) -> list[tuple[int, int]]:
    """Return first and last cell of each run of (m,) of bool; a gap of one cell is bridged."""
    runs: list[tuple[int, int]] = []
    for i in np.flatnonzero(differs):
        if runs and i - runs[-1][1] <= 2:
            runs[-1] = (runs[-1][0], int(i))
        else:
            runs.append((int(i), int(i)))
    return runs
