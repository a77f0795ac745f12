"""Where Z differs from zero: one simultaneous band over all joints, variables and places.

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

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.locate.confinement import LEAST_ROWS
from sgp_ros.diagnosis.locate.field import Field, cells_of, learn_field, noise_density
from sgp_ros.diagnosis.locate.variables import own_variables
from sgp_ros.diagnosis.result import SIGNIFICANT, Band, Dependence

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
    if len(residual) < LEAST_ROWS:
        return ()
    velocity = equations.filter(motion.velocity)
    looks, fields = [], []
    for j, dependence in enumerate(dependences):
        r = residual[:, j]
        for variable, x in own_variables(equations, j).items():
            cells = cells_of(x, velocity[:, j] > 0.0)
            is_angle = variable == 'position' and bool(motion.is_continuous[j])
            field = learn_field(cells, r, noise_density(r), is_angle=is_angle)
            if dependence.is_significant(variable):  # what this variable causes is no noise
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
    """Return first and last cell of each run of (m,) of bool; a gap of one cell is none."""
    runs: list[tuple[int, int]] = []
    for i in np.flatnonzero(differs):
        if runs and i - runs[-1][1] <= 2:
            runs[-1] = (runs[-1][0], int(i))
        else:
            runs.append((int(i), int(i)))
    return runs
