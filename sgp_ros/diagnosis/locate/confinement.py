"""The region to which a discrepancy without a name is confined: of position, velocity or time.

A discrepancy that acts everywhere has its energy wherever the robot was: an interval that holds
nearly all of it holds nearly all of the rows. Of all intervals of all variables the one with
the fewest rows is taken, so chance must be kept out for the best of many: with half of the rows
it is far from reach for a homogeneous rest, white or correlated (a test simulates both).
"""

from __future__ import annotations

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.locate.variables import own_variables
from sgp_ros.diagnosis.result import Location

ENERGY = 0.95
"""Share of the energy of the discrepancy that a region holds."""
ROWS = 0.5
"""Greatest share of the rows that a region may hold; a larger one is no region."""
LEAST_ROWS = 100
"""Rows below which nothing is said of regions."""


def region(equations: Equations, r: np.ndarray, joint: int) -> Location:
    """Return where the discrepancy r (N,) of a joint is [N m or N]; empty where it is everywhere.

    Intervals of position are of the wrapped one [rad or m], of velocity [rad/s or m/s], of time
    since the first state [s].
    """
    variables = own_variables(equations, joint)
    found = {name: confined(variables[name], r) for name in ('position', 'velocity', 'time')}
    name = min(found, key=lambda n: found[n][2])
    lo, hi, rows = found[name]
    if len(r) < LEAST_ROWS or rows > ROWS:
        return Location()
    if name == 'time':
        return Location(('time',), {}, ((lo, hi),))
    return Location((name,), {name: [[lo, hi]]})


def confined(x: np.ndarray, r: np.ndarray) -> tuple[float, float, float]:
    """Return the interval of x (N,) with the fewest rows that holds `ENERGY` of r (N,), and these.

    Returns:
        Least and largest x, share of the rows.
    """
    order = np.argsort(x, kind='stable')
    energy = np.concatenate([[0.0], np.cumsum(r[order] ** 2)])
    wanted = ENERGY * energy[-1]
    last = np.searchsorted(energy, energy[:-1] + wanted)  # rows [i, last) hold enough
    enough = np.flatnonzero(last < len(energy))
    if not len(enough) or not wanted:
        return float(x[order[0]]), float(x[order[-1]]), 1.0
    start = enough[int(np.argmin(last[enough] - enough))]
    stop = int(last[start])
    return float(x[order[start]]), float(x[order[stop - 1]]), (stop - start) / len(x)
