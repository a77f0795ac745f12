"""Units that a map may state, and those that the numbers of a column tell."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sgp_ros.recordings.table_turns import MARGIN, TURN, counted_on, has_wraps

_KGF = 9.80665
ANGLES = {'rad': 1.0, 'deg': math.pi / 180.0, 'rev': TURN}
"""Units of an angle [rad]."""
_POSITION = {'m': 1.0, 'mm': 1e-3, **ANGLES}
UNITS: dict[str, dict[str, float | None]] = {
    'position': {**_POSITION, 'counts': None},
    'velocity': {
        **{f'{unit}/s': factor for unit, factor in _POSITION.items()},
        'rpm': TURN / 60.0, 'counts/s': None,
    },
    'effort': {
        'N': 1.0, 'mN': 1e-3, 'kN': 1e3, 'N m': 1.0, 'Nm': 1.0, 'mN m': 1e-3, 'mNm': 1e-3,
        'kN m': 1e3, 'kNm': 1e3, 'N mm': 1e-3, 'N cm': 1e-2, 'kgf cm': _KGF * 1e-2, 'kgf': _KGF,
        'A': None, 'mA': None, 'V': None, '%': None, '‰': None, 'counts': None,
    },
}  # fmt: skip
"""Unit to its factor to SI, per quantity; None where only a `scale` can tell."""
SCALED_AS = {'mA': ('A', 1e-3)}
"""Units whose `scale` is that of another one, times a factor: torque constants are per A."""

TIME_UNITS = {'s': 1_000_000_000, 'ms': 1_000_000, 'us': 1000, 'ns': 1}

_EPOCHS = ((1e17, 'ns'), (1e14, 'us'), (1e11, 'ms'), (1e8, 's'))
"""Least number of a time since 1970, and its unit."""
_RATES_HZ = (5.0, 20_000.0)
"""Of logs."""
PER_SECOND = {unit: 1e9 / ns for unit, ns in TIME_UNITS.items()}
"""Unit of time to its number in a second."""


def as_numbers(column: np.ndarray) -> np.ndarray | None:
    """Return a column as float64, nothing as NaN; None where it holds no numbers."""
    if column.dtype.kind in 'fiub':
        return column.astype(np.float64)
    if column.dtype.kind != 'U' or (np.char.find(column, '_') >= 0).any():
        return None  # Python takes 1_0 for 10
    try:
        return np.where(column == '', 'nan', column).astype(np.float64)
    except ValueError:
        return None


def is_number(cell: str) -> bool:
    """Return whether a cell holds a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return '_' not in cell


def time_unit(stamps: np.ndarray, said: str) -> tuple[str, bool]:
    """Return the unit of times and whether it is sure; no unit where they do not grow.

    Args:
        stamps: (n,).
        said: unit in the name of the column; empty for none.
    """
    finite = stamps[np.isfinite(stamps)]
    steps = np.diff(finite)
    steps = steps[steps > 0.0]
    if len(steps) < 1 or len(steps) < 0.5 * (len(finite) - 1):
        return '', False
    if said in PER_SECOND:
        return said, True
    for least, unit in _EPOCHS:
        if finite[0] >= least:
            return unit, True
    step = float(np.median(steps))
    fitting = [u for u, per in PER_SECOND.items() if _RATES_HZ[0] <= per / step <= _RATES_HZ[1]]
    if not fitting:
        return 's', False
    # rates of logs lie in one decade of a thousand, but between 5 and 20 Hz
    return fitting[0], len(fitting) == 1


_MOVES = 0.1
"""Part of its range over which a joint moves."""


def position_unit(
    columns: Sequence[tuple[np.ndarray, float, float]], *, are_joints_known: bool = False
) -> tuple[str, bool]:
    """Return `rad` or `deg` of turning joints and whether it is sure.

    What is within its range in radians is so in degrees, too. Where more joints move within their
    ranges in radians than leave them, and none goes beyond one turn, these are other errors, such
    as angles of a motor.

    Args:
        columns: of each joint its numbers (n,) and its range [rad], infinite for none.
        are_joints_known: from the file of a robot; then a joint without a range turns endlessly,
            and how far it went does not tell the unit.
    """
    votes = {'rad': 0, 'deg': 0}
    largest, moving = 0.0, 0
    for numbers, lower, upper in columns:
        low, high = np.nanmin(numbers), np.nanmax(numbers)
        if not are_joints_known or np.isfinite(lower) or np.isfinite(upper):
            largest = max(largest, abs(low), abs(high))
        for unit, factor in (('rad', 1.0), ('deg', np.pi / 180.0)):
            if np.isfinite(lower) and np.isfinite(upper):
                low, high = _ends(factor * numbers, lower, upper)
                is_inside = low >= lower - MARGIN and high <= upper + MARGIN
                votes[unit] += is_inside
                moving += unit == 'rad' and is_inside and high - low > _MOVES * (upper - lower)
    if 0 < votes['deg'] - votes['rad'] < moving and largest <= TURN + MARGIN:
        return 'rad', False
    if votes['rad'] != votes['deg']:
        return ('rad', True) if votes['rad'] > votes['deg'] else ('deg', True)
    if largest <= TURN + MARGIN:
        return 'rad', all(np.nanmax(np.abs(x)) <= TURN + MARGIN for x, _, _ in columns)
    return ('deg' if largest > 6.0 * np.pi else 'rad'), False


def _ends(angle: np.ndarray, lower: float, upper: float) -> tuple[float, float]:
    """Return the least and the greatest of angles (n,), counted on where they wrap [rad]."""
    if has_wraps(angle):
        angle = counted_on(angle, np.arange(float(len(angle))), limits=(lower, upper))
    return float(np.nanmin(angle)), float(np.nanmax(angle))


def slide_unit(numbers: np.ndarray, lower: float, upper: float) -> str:
    """Return `mm` of a sliding joint whose range [m] holds its numbers (n,) only so, else `m`."""
    low, high, margin = np.nanmin(numbers), np.nanmax(numbers), 0.1 * (upper - lower)

    def fits(factor: float) -> bool:
        return bool(low * factor >= lower - margin and high * factor <= upper + margin)

    return 'mm' if np.isfinite(margin) and fits(1e-3) and not fits(1.0) else 'm'


def velocity_unit(
    velocity: np.ndarray, position: np.ndarray, seconds: np.ndarray, unit: str, said: str
) -> tuple[str, str]:
    """Return the unit of a velocity, and what is not sure of it.

    The slope of the velocity on the change of the position tells degrees from radians.

    Args:
        velocity: (n,).
        position: (n,).
        seconds: (n,) [s].
        unit: of the position.
        said: unit in the name of the column; empty for none.
    """
    if said in {'rpm', 'rad/s', 'deg/s', 'rev/s', 'm/s', 'mm/s'}:
        return said, ''
    usual = f'{unit}/s'
    if unit in ANGLES:
        position = counted_on(ANGLES[unit] * position, seconds) / ANGLES[unit]
    step = np.diff(seconds)
    good = (step > 0.0) & np.isfinite(np.diff(position)) & np.isfinite(velocity[1:])
    rate = np.diff(position)[good] / step[good]
    mean = 0.5 * (velocity[1:] + velocity[:-1])[good]
    power = float(rate @ rate)
    if good.sum() < 10 or power == 0.0:
        return usual, ''
    slope = float(mean @ rate) / power
    explained = slope * float(mean @ rate) / max(float(mean @ mean), 1e-300)
    if explained < 0.5:
        return usual, 'does not match the change of the position'
    other = {'rad': ('deg/s', 57.3), 'deg': ('rad/s', 1.0 / 57.3)}.get(unit)
    if other is not None and 0.7 < slope / other[1] < 1.4:
        return other[0], f'is assumed to be in {other[0]}, judging by the change of the position'
    if not 0.7 < slope < 1.4:
        return usual, f'is {slope:.3g} times the rate of change of the position'
    return usual, ''


def follows(command: np.ndarray, position: np.ndarray) -> float:
    """Return the share of the spread of a position that stays within its command, 0 to 1."""
    both = np.isfinite(command) & np.isfinite(position)
    if both.sum() < 10:
        return 0.0
    spread = float(np.var(position[both]))
    apart = float(np.mean((command[both] - position[both]) ** 2))
    return max(0.0, 1.0 - apart / spread) if spread > 0.0 else 0.0


def is_constant(numbers: np.ndarray) -> bool:
    """Return whether numbers are all the same, to rounding."""
    finite = numbers[np.isfinite(numbers)]
    if not len(finite):
        return False
    return bool(np.ptp(finite) <= 1e-9 * max(1.0, float(np.abs(finite).max())))
