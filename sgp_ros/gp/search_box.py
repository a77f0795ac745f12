"""The box in which hyper-parameters are searched for, relative to the data.

A covariance has a factor in double precision while its noise stays above what rounding leaves
in its largest entries: `noise >= n eps variance` (Higham, Accuracy and Stability of Numerical
Algorithms, 2002, section 10.1). A first box is small enough for that at its every corner. Where
the evidence still rises at the top of a variance, which a function that is nearly constant,
linear or a sum of its inputs makes it do, a second box opens as far as the noise found allows.
"""

from __future__ import annotations

import numpy as np

from sgp_ros.gp.model import Model, Observations

_NOISE_FLOOR = 1e-8
_NOISE_TOP = 1e2
_RANGE = 1e4
_TOUCHING = 1e-6


def search_box(data: Observations, start: Model) -> np.ndarray:
    """Return the least and largest logarithm of each hyper-parameter of `start`, (h, 2).

    Length scales within 1e4 of the spread of their input, variances of Z from 1e-8 to 1e4 times
    the variance of the target, noise from 1e-8 to 1e2 times that.
    """
    power = variance_or_one(data.y)
    spread = np.sqrt(variance_or_one(data.U))
    rows: list[tuple[float, float]] = []
    for component, kernel in enumerate(start.kernels):
        if kernel is None:
            continue
        variance = power[component] if data.G is None else power.mean()
        scales = kernel.scales(float(variance), spread[list(kernel.inputs)])
        heights = len(scales) - len(kernel.inputs)
        rows += [(x / _RANGE**2, x * _RANGE) for x in scales[:heights]]
        rows += [(x / _RANGE, x * _RANGE) for x in scales[heights:]]
    rows += [(_NOISE_FLOOR * x, _NOISE_TOP * x) for x in power]
    return np.log(np.array(rows))


def opened_box(
    box: np.ndarray, best: np.ndarray, data: Observations, start: Model
) -> np.ndarray | None:
    """Return a higher box (h, 2) about `best` (h,); None where no variance touches the top.

    A linear function of an input whose length scale is 1e4 spreads has 1e8 times the variance of
    the target; so far the new box goes, with the mean square of the target in place of its
    variance, for Z has to explain the mean too. It ends where the noise of `best` would be lost
    in rounding, and its least noise is what the rounding of its tops leaves.
    """
    rounding = data.y.size * float(np.finfo(float).eps)
    square = np.maximum((data.y**2).mean(axis=0), variance_or_one(data.y))
    wider = box.copy()
    noise = len(best) - len(start.noise)
    is_open = False
    row = 0
    for component, kernel in enumerate(start.kernels):
        if kernel is None:
            continue
        seen = slice(component, component + 1) if data.G is None else slice(None)
        heights = slice(row, row + len(kernel.log_parameters) - len(kernel.inputs))
        row += len(kernel.log_parameters)
        if not np.any(best[heights] > box[heights, 1] - _TOUCHING):
            continue
        least_noise = best[noise:][seen].min()
        top = min(np.log(_RANGE**2 * square[seen].mean()), least_noise - np.log(rounding))
        wider[heights, 1] = np.maximum(box[heights, 1], top)
        lowest = wider[heights, 1].max() + np.log(rounding)
        noises = wider[noise:][seen]
        noises[:, 0] = np.clip(lowest, noises[:, 0], np.maximum(noises[:, 0], least_noise))
        is_open = True
    return wider if is_open else None


def variance_or_one(x: np.ndarray) -> np.ndarray:
    """Return the variances of the columns of x (n, d), one where there is none, (d,)."""
    variance = x.var(axis=0)
    return np.where(variance > 0.0, variance, 1.0)
