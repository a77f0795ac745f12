"""When a quantity changed: a scan for steps whose rate of false alarms has a bound.

Each robot's recordings are cut in two at every place, and the step that fits best is compared
with what chance would give. A campaign is looked at again whenever recordings are added, so the
bound is for all looks together: had one looked after each of the first `HORIZON` recordings of a
robot, quantities that never changed would have raised an alarm in one of a hundred campaigns.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from sgp_ros.campaign.mixed import MixedFit, fit_given, fit_mixed

FALSE_ALARMS = 0.01
"""Bound on the probability that a campaign without any change reports one."""
HORIZON = 1000
"""Recordings of a robot over whose looks the bound is; it grows in proportion beyond."""
EQUIVALENT_TESTS = 7_500.0
"""Independent tests that all looks at HORIZON recordings are worth at this bound, by simulation of
white noise: `sgp_proof/results/campaign.json`, to which a test holds this number."""
_MOST_STEPS, _ROUNDS = 5, 3
LEAST_SIDE = 5
"""Recordings on each side of a step; a single stray estimate then is not a step."""
_LIKELIHOOD_SET = -2.0 * math.log(1.0 - math.sqrt(0.95))
"""Twice the log likelihood that a place of a step may lose within its 95 % set (Yao 1987; Eo and
Morley 2015): the quantile of the larger one of two exponential variables."""


@dataclass(frozen=True, slots=True)
class Step:
    """A step of one robot's level.

    Attributes:
        robot: its number.
        row: the first one after the step.
        first, last: rows that this may be, with 95 % probability.
        gain: twice the log likelihood that it adds.
    """

    robot: int
    row: int
    first: int
    last: int
    gain: float


def chance(t: float, dof: int, recordings: int, scans: int) -> float:
    """Return a bound on the probability that chance alone shows so much anywhere in a campaign.

    Args:
        t: of the step or slope, in its standard deviations.
        dof: degrees of freedom of these.
        recordings: of the robot.
        scans: quantities times robots that are looked at.
    """
    tests = EQUIVALENT_TESTS * max(recordings / HORIZON, 1.0) * scans
    return float(min(1.0, 2.0 * tests * special.stdtr(dof, -abs(t))))


def best_step(fit: MixedFit, time: np.ndarray, robots: np.ndarray) -> Step | None:
    """Return the step that would explain most of what a fit leaves; None for too few recordings.

    Args:
        fit: without it.
        time: (n,) by which recordings are ordered [s].
        robots: (n,) number of the robot.
    """
    columns, places = [], []
    for robot, rows in _by_time(time, robots):
        for k in range(LEAST_SIDE, len(rows) - LEAST_SIDE + 1):
            columns.append(_column(len(time), rows, k))
            places.append((robot, rows, k))
    if not columns:
        return None
    gain = fit.gains(np.array(columns).T)
    i = int(np.argmax(gain))
    robot, rows, k = places[i]
    near = [
        place[2] for place, g in zip(places, gain, strict=True)
        if place[0] == robot and g >= gain[i] - _LIKELIHOOD_SET
    ]  # fmt: skip
    return Step(robot, int(rows[k]), int(rows[min(near)]), int(rows[max(near)]), float(gain[i]))


def column_of(step: Step, time: np.ndarray, robots: np.ndarray) -> np.ndarray:
    """Return (n,) the column of a step: 1 for the rows of its robot from it on."""
    rows = next(rows for robot, rows in _by_time(time, robots) if robot == step.robot)
    return _column(len(time), rows, rows.tolist().index(step.row))


def _column(n: int, rows: np.ndarray, k: int) -> np.ndarray:
    column = np.zeros(n)
    column[rows[k:]] = 1.0
    return column


def _by_time(time: np.ndarray, robots: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Yield each robot with its rows in the order of time."""
    for robot in np.unique(robots).tolist():
        rows = np.flatnonzero(robots == robot)
        yield robot, rows[np.argsort(time[rows], kind='stable')]


@dataclass(slots=True, eq=False)
class Estimates:
    """Estimates of one quantity and what may explain them.

    Attributes:
        y, std: (n,) estimates.
        time: (n,) [s].
        robots: (n,) numbers.
        groups: (n,) numbers of the random intercepts of each kind.
        levels: numbers that a change is known from: sessions or recordings.
        columns: (n,) each, by name.
        scans: quantities times robots that are looked at.
    """

    y: np.ndarray
    std: np.ndarray
    time: np.ndarray
    robots: np.ndarray
    groups: Sequence[np.ndarray]
    levels: int
    columns: dict[str, np.ndarray]
    scans: int

    def X(self, more: Sequence[np.ndarray] = ()) -> np.ndarray:  # noqa: N802  # equation
        """Return (n, p) all columns, `more` behind them."""
        return np.column_stack([*self.columns.values(), *more])

    def fit(self, more: Sequence[np.ndarray] = ()) -> MixedFit:
        """Return the fit with further columns."""
        return fit_mixed(self.y, self.std, self.X(more), self.groups, self.levels)

    def steps(self, found: Sequence[Step]) -> list[np.ndarray]:
        """Return the columns of steps."""
        return [column_of(step, self.time, self.robots) for step in found]

    def chance(self, fit: MixedFit) -> float:
        """Return the probability that the last column of a fit arises by chance."""
        return chance(float(fit.t[-1]), fit.dof, int(np.bincount(self.robots).max()), self.scans)

    def next_step(self, before: Sequence[Step]) -> tuple[Step, MixedFit] | None:
        """Return the best further step and the fit with it; the variances are those with it."""
        without = self.fit(self.steps(before))
        step = best_step(without, self.time, self.robots)
        for _ in range(_ROUNDS):
            if step is None:
                return None
            fit = self.fit(self.steps([*before, step]))
            X = self.X(self.steps(before))
            without = fit_given(self.y, X, fit.spread, fit.theta, self.levels)
            again = best_step(without, self.time, self.robots)
            if again is not None and again.row == step.row:
                return again, fit
            step = again
        return None if step is None else (step, self.fit(self.steps([*before, step])))

    def when(self, days: np.ndarray) -> tuple[list[Step], bool, list[float]]:
        """Return steps beyond chance, or whether a steady drift describes the data better.

        The two are compared by the criterion of Schwarz: a step has a size and a place, a drift a
        slope. The chances are those of the slope and of each step that was tried.
        """
        n, slope = len(days), self.fit([days])
        chances = [self.chance(slope)]
        gain = float(fit_given(self.y, self.X(), slope.spread, slope.theta, self.levels)
                     .gains(days[:, None])[0])  # fmt: skip
        steps: list[Step] = []
        while len(steps) < _MOST_STEPS:
            found = self.next_step(steps)
            chances += [] if found is None else [self.chance(found[1])]
            is_step = found is not None and chances[-1] <= FALSE_ALARMS
            if not steps and chances[0] <= FALSE_ALARMS and not (
                is_step and found is not None and found[0].gain - 2.0 * math.log(n)
                > gain - math.log(n)
            ):  # fmt: skip
                return [], True, chances
            if found is None or not is_step:
                break
            steps.append(found[0])
        return steps, False, chances
