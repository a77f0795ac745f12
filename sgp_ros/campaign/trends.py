"""How each friction and gain depends on time and covariates over the recordings of a campaign.

Warm-up and wear both raise or lower a friction with time, one within a session, the other from
session to session. A session is what lies between pauses that let the robot cool; within it the
friction returns to its level as exp(-age / tau), whose size and tau are fitted beside the slope.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import special

from sgp_ros.campaign.changes import Estimates, Step
from sgp_ros.campaign.frame import Frame, Key, Series, frame_of, series_of
from sgp_ros.campaign.mixed import MixedFit, fit_given

LEAST_RECORDINGS = 12
_LEAST_SESSIONS = 3
_ROUNDS = 3
_TAUS = 12
_NEW = 1e-6
"""Share of a column that those before it must leave."""
_DAY_S = 86400.0
PER_DAY, WARM_UP = 'per day', 'warm-up'


@dataclass(frozen=True, slots=True)
class Term:
    """One coefficient of a trend.

    Attributes:
        name: `level`, `per day`, `warm-up`, or that of a covariate.
        value: [unit of the quantity], per unit of the covariate.
        low, high: 95 % interval.
    """

    name: str
    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Change:
    """A change of the level at some recording.

    Attributes:
        robot: its name.
        recording: the first one after it.
        first, last: recordings that this may be, with 95 % probability.
        size: [unit], with its 95 % interval.
        chance: bound on the probability that chance alone shows as much anywhere.
    """

    robot: str
    recording: str
    first: str
    last: str
    size: float
    low: float
    high: float
    chance: float


@dataclass(frozen=True, slots=True, eq=False)
class Trend:
    """Trend and changes of one quantity.

    Attributes:
        key: which one.
        unit: of it.
        rows: (n,) numbers of the recordings that have it.
        value, std: (n,) estimates.
        fitted: (n,) mean of the model.
        terms: `level` first.
        tau_s: of the warm-up [s]; None without one.
        scatter: standard deviations beyond the intervals: of recordings, sessions, robots.
        changes: steps beyond chance, in the order in which they were found.
        is_drift: whether the level drifts with time, which a slope describes better than steps.
        chance: bound on the probability that chance alone shows as much change of the level.
        remarks: what could not be determined.
    """

    key: Key
    unit: str
    rows: np.ndarray
    value: np.ndarray
    std: np.ndarray
    fitted: np.ndarray
    terms: Sequence[Term]
    tau_s: float | None
    scatter: Mapping[str, float]
    changes: Sequence[Change]
    is_drift: bool
    chance: float
    remarks: Sequence[str] = ()

    def content(self) -> dict[str, Any]:
        """Return what JSON holds."""
        return {
            **dict(zip(('task', 'joint', 'effect', 'parameter'), self.key, strict=True)),
            'unit': self.unit, 'recordings': len(self.rows), 'tau_s': self.tau_s,
            'terms': [{'name': t.name, 'value': t.value, 'low': t.low, 'high': t.high}
                      for t in self.terms],
            'scatter': dict(self.scatter), 'is_drift': self.is_drift, 'chance': self.chance,
            'changes': [{k: getattr(c, k) for k in Change.__dataclass_fields__}
                        for c in self.changes],
            'remarks': list(self.remarks),
        }  # fmt: skip


def find_trends(results: Sequence[Mapping[str, Any]]) -> list[Trend]:
    """Return the trend of every friction and gain that enough recordings have."""
    frame = frame_of(results)
    found = {key: s for key, s in sorted(series_of(results).items())
             if len(s.rows) >= LEAST_RECORDINGS}  # fmt: skip
    scans = sum(len(np.unique(frame.robots[s.rows])) for s in found.values())
    return [_trend(key, s, frame, scans) for key, s in found.items()]


def _trend(key: Key, series: Series, frame: Frame, scans: int) -> Trend:
    """Return the trend of one quantity."""
    remarks: list[str] = []
    pick, covariates = _usable(np.array(series.rows), frame, remarks)
    rows = np.array(series.rows)[pick]
    time, n = frame.time[rows], len(rows)
    has_time = bool(np.isfinite(time).all()) and len(np.unique(time)) >= _LEAST_SESSIONS
    sessions, robots = (
        np.unique(x[rows], return_inverse=True)[1] for x in (frame.sessions, frame.robots)
    )
    has_sessions = has_time and int((np.bincount(sessions) > 1).sum()) >= _LEAST_SESSIONS
    groups = {'sessions': sessions} if has_sessions else {}
    groups |= {'robots': robots} if robots.max() > 0 else {}
    levels = (int(sessions.max()) + 1 if has_sessions else n) - int(robots.max())
    problem = Estimates(
        np.array(series.value)[pick], np.array(series.std)[pick], time, robots,
        list(groups.values()), levels, {'level': np.ones(n)}, scans,
    )  # fmt: skip
    for name, x in covariates.items():
        _add(problem.columns, name, x[rows] - x[rows].mean(), remarks)
    tau = _warm_up(problem, frame.age[rows]) if has_sessions else None
    names, is_drift, chances = [*problem.columns], False, [1.0]
    steps: list[Step] = []
    days = (time - time.mean()) / _DAY_S
    if not has_time:
        remarks.append(
            'the start times of the recordings are unknown; give them in a column `time`'
        )
        fit = problem.fit()
    elif not _add(dict(problem.columns), PER_DAY, days, remarks):
        fit = problem.fit()
    else:
        steps, is_drift, chances = problem.when(days)
        fit = problem.fit(problem.steps(steps) if steps else [days])
        names += [] if steps else [PER_DAY]
    terms, changes = _terms(fit, names), []
    for step, p, term in zip(steps, chances[1:], terms[len(names) :], strict=False):
        at, first, last = (frame.names[rows[i]] for i in (step.row, step.first, step.last))
        robot = frame.robot_names[frame.robots[rows[step.row]]]
        changes.append(Change(robot, at, first, last, term.value, term.low, term.high, p))
    scatter = dict(zip(('recordings', *groups), np.sqrt(fit.theta).tolist(), strict=True))
    return Trend(
        key, series.unit, rows, problem.y, problem.std, problem.y - fit.residual,
        [term for term in terms if term.name], tau, scatter, changes, is_drift, min(chances),
        remarks,
    )  # fmt: skip


def _usable(
    rows: np.ndarray, frame: Frame, remarks: list[str]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return which of some recordings are used, and the covariates; what is missing is said."""
    covariates = {c: x for c, x in frame.covariates.items() if np.isfinite(x[rows]).any()}
    has_all = np.isfinite(frame.time[rows])
    for x in covariates.values():
        has_all &= np.isfinite(x[rows])
    if has_all.sum() < LEAST_RECORDINGS:
        remarks.append('time and covariates are known for too few recordings: neither is used')
        return np.ones(len(rows), bool), {}
    if not has_all.all():
        remarks.append(f'{(~has_all).sum()} recordings without time or covariates are left out')
    return has_all, covariates


def _add(columns: dict[str, np.ndarray], name: str, x: np.ndarray, remarks: list[str]) -> bool:
    """Add a column, unless those that are there have it already; say so."""
    X = np.column_stack(list(columns.values()))
    left = x - X @ np.linalg.lstsq(X, x, rcond=None)[0]
    is_new = float(np.linalg.norm(left)) > _NEW * max(float(np.linalg.norm(x)), 1e-300)
    if is_new:
        columns[name] = x
    else:
        remarks.append(f'{name} is constant or a combination of others: it has no coefficient')
    return is_new


def _warm_up(problem: Estimates, age: np.ndarray) -> float | None:
    """Add the column w = exp(-age / tau) of the likeliest tau; return tau [s].

    Its derivative by log tau is a column too, without a name: its coefficient corrects tau until
    it is nothing (Gauss and Newton), and intervals then know that tau is an estimate.
    """
    taus = np.geomspace(0.02, 1.0, _TAUS) * float(age.max())
    shapes = np.exp(-age[:, None] / taus)  # (n, taus)
    if not _add(dict(problem.columns), WARM_UP, shapes[:, -1], []):
        return None
    fit = problem.fit([shapes[:, -1]])
    without = fit_given(problem.y, problem.X(), fit.spread, fit.theta, problem.levels)
    tau = float(taus[int(np.argmax(without.gains(shapes)))])
    for _ in range(_ROUNDS):
        w = np.exp(-age / tau)
        size, slope = problem.fit([w, w * age / tau]).beta[-2:]
        tau *= math.exp(np.clip(slope / size, -0.5, 0.5))
        tau = float(np.clip(tau, taus[0], taus[-1]))
    problem.columns[WARM_UP] = np.exp(-age / tau)
    _add(problem.columns, '', problem.columns[WARM_UP] * age / tau, [])
    return tau


def _terms(fit: MixedFit, names: Sequence[str]) -> list[Term]:
    """Return the coefficients with their 95 % intervals; those without a name have none."""
    half = float(special.stdtrit(fit.dof, 0.975)) * np.sqrt(np.diag(fit.covariance))
    called = [*names, *[''] * (len(half) - len(names))]
    return [
        Term(name, float(b), float(b - h), float(b + h))
        for name, b, h in zip(called, fit.beta, half, strict=True)
    ]
