"""How a recording is filtered, and the choice of it from the recording itself.

A cut-off may not be judged on the data that it makes: a lower one removes noise from what is to be
predicted, a higher one lets the noise of the columns attenuate the coefficients, and each predicts
its own data best. So every candidate gives coefficients from its own data, and these predict the
held-out blocks of every candidate's data in turn. On one such reference all candidates face the
same target and the same noise; what differs is the error of the coefficients, seen through that
band. The regret there is the logarithm of the squared error above the least one, times half of the
independent rows [nat]. The candidate with the least sum of regrets is chosen: it is good in every
band instead of best in its own.

A band in which the noise of the columns prevails would still reward attenuated coefficients. It is
known by its own coefficients, which fail in lower bands: a reference counts by the trust
`exp(-r)`, r being the largest regret per row of its own coefficients at lower references.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.batch.least_squares import autocorrelation, joined, least_squares, solved, triangles
from sgp_ros.batch.regression_data import FilteredData, FilterPlan, filtered_data
from sgp_ros.batch.signals import Signals
from sgp_ros.errors import RecordingError
from sgp_ros.robots.robot import Robot

CUTOFFS = (1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0, 22.0, 32.0, 45.0, 64.0)
"""Cut-offs that are tried [Hz]."""

WHITE = 0.1
"""Lag-one autocorrelation below which a residual passes for white."""

_HIGHEST_SHARE = 1 / 6  # of the rate, where the central differences are still good to 0.3 %
_STATE_FACTOR = 5.0
_STATE_SHARE = 0.4
_FINE = 8.0  # rows per period of the cut-off before they are thinned out
_WHITE_SPACING = 0.55  # periods of the cut-off after which filtered white noise is white again
_BLOCK_S = 6.0
_FEWEST_BLOCKS, _MOST_BLOCKS = 4, 10
_MOST_SAMPLES, _MOST_NUMBERS = 40_000, 12_000_000


@dataclass(frozen=True, slots=True)
class Candidate:
    """A plan that was tried.

    Attributes:
        plan: the plan.
        rows: that it leaves.
        autocorrelation: largest over the joints, of the physics' residual from row to row [1].
        regret: summed over all references [nat]; less is better.
        error: held-out root mean square error over that of the target, on the candidate's own
            data, geometric mean over the joints [1]. Not comparable between cut-offs.
    """

    plan: FilterPlan
    rows: int
    autocorrelation: float
    regret: float
    error: float


@dataclass(frozen=True, slots=True)
class PlanChoice:
    """The chosen plan and what it was chosen from.

    Attributes:
        plan: with the least regret.
        candidates: all that were tried.
        autocorrelation: of the chosen one.
    """

    plan: FilterPlan
    candidates: tuple[Candidate, ...]
    autocorrelation: float

    @property
    def is_white(self) -> bool:
        """Whether thinning left a residual that passes for white.

        Where the physics is incomplete no thinning does; rows then stand as far apart as
        white noise would need.
        """
        return self.autocorrelation < WHITE

    def least_regret(self, velocity_source: str) -> Candidate | None:
        """Return the best candidate of a source of velocity; None where it was not tried."""
        tried = [c for c in self.candidates if c.plan.velocity_source == velocity_source]
        return min(tried, key=lambda c: c.regret, default=None)


def choose_plan(signals: Signals, robot: Robot, cutoffs: Sequence[float] = CUTOFFS) -> PlanChoice:
    """Choose cut-off, decimation and source of velocity from a recording.

    Of a long recording a part of each block is used. Cost: columns and filters once per cut-off
    and source, least squares once more.

    Args:
        signals: the recording.
        robot: whose physics judges.
        cutoffs: that are tried [Hz].

    Raises:
        RecordingError: too short for every cut-off.
    """
    signals = _excerpt(signals, robot)
    sources = ['position'] if signals.velocity is None else ['measured', 'position']
    trials = [
        trial
        for cutoff in cutoffs
        if cutoff <= _HIGHEST_SHARE * signals.rate
        for source in sources
        if (trial := _Trial.of(signals, robot, cutoff, source)) is not None
    ]
    if not trials:
        longest = max(s.stop - s.start for s in signals.segments) / signals.rate
        raise RecordingError(
            f'{len(signals.time) / signals.rate:.3g} s of recording at {signals.rate:.3g} Hz, '
            f'longest stretch without a gap {longest:.3g} s',
            f'about {3 * len(robot.coefficients)} rows after a low-pass of {cutoffs[0]:g} Hz',
            'record longer, without gaps, or choose another cut-off',
        )
    regret = _total_regret(trials)
    candidates = tuple(
        Candidate(t.plan, len(t.data.time), t.autocorrelation, float(r), t.own_error())
        for t, r in zip(trials, regret, strict=True)
    )
    best = min(candidates, key=lambda candidate: candidate.regret)
    return PlanChoice(best.plan, candidates, best.autocorrelation)


def _total_regret(trials: list[_Trial]) -> np.ndarray:
    """Return the sum over all references of what each candidate loses there, (candidates,)."""
    cutoffs = sorted({trial.plan.cutoff for trial in trials})
    regrets = np.array([_regret(trials, cutoff) for cutoff in cutoffs])  # (references, trials)
    total = np.zeros(len(trials))
    for place, cutoff in enumerate(cutoffs):
        own = [i for i, trial in enumerate(trials) if trial.plan.cutoff == cutoff]
        carried = regrets[:place, own].min(axis=1)
        trust = math.exp(-max(carried, default=0.0))
        reference = trials[own[0]].reference
        total += 0.5 * reference.y.size * trust * regrets[place]
    return total


def _regret(trials: list[_Trial], cutoff: float) -> np.ndarray:
    """Return the log of each candidate's squared error at one cut-off above the least, (trials,).

    Each candidate predicts with its own source of velocity; where that was not tried at this
    cut-off, with the other one.
    """
    references = {t.plan.velocity_source: t for t in trials if t.plan.cutoff == cutoff}
    usual = next(iter(references.values()))
    losses = np.array(
        [references.get(t.plan.velocity_source, usual).loss_of(t.left_out) for t in trials]
    )
    return np.asarray(losses - losses.min())


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """Recording under one cut-off and source of velocity.

    Attributes:
        plan: with the decimation found.
        data: thinned out by it.
        autocorrelation: largest over the joints.
        number: of the held-out block of each row of `data`.
        left_out: coefficients without each block, (blocks, p).
        reference: the data thinned out as white noise needs, the same for both sources.
        reference_number: of the block of its rows.
    """

    plan: FilterPlan
    data: FilteredData
    autocorrelation: float
    number: np.ndarray
    left_out: np.ndarray
    reference: FilteredData
    reference_number: np.ndarray

    @classmethod
    def of(cls, signals: Signals, robot: Robot, cutoff: float, source: str) -> _Trial | None:
        state_cutoff = min(_STATE_FACTOR * cutoff, _STATE_SHARE * signals.rate)
        first = max(1, math.floor(signals.rate / (_FINE * cutoff)))
        plan = FilterPlan(cutoff, state_cutoff, first, source)
        try:
            fine = filtered_data(signals, robot, plan)
        except RecordingError:
            return None
        usual = max(1, round(_WHITE_SPACING * fine.rate / cutoff))
        step = _decimation(fine, usual)
        data = fine.thinned(step)
        edges = _edges(signals)
        number = _block_numbers(edges, data.time)
        present = np.unique(number)
        unknowns = data.F.shape[2]
        if len(present) < len(edges) - 1 or data.y.size < 3 * unknowns:
            return None
        blocks = [triangles(data.F[number == i], data.y[number == i]) for i in present]
        w, scale = least_squares(data.F, data.y, np.concatenate(blocks, axis=1))
        parts = [joined(block, scale) for block in blocks]
        left_out = [solved(parts[:i] + parts[i + 1 :]) for i in range(len(parts))]
        whiteness = autocorrelation(data.y - data.F @ w, data.block, 1)
        reference = fine.thinned(usual)
        return cls(
            replace(plan, decimation=first * step),
            data,
            float(np.abs(whiteness).max()),
            number,
            np.array(left_out),
            reference,
            _block_numbers(edges, reference.time),
        )

    def loss_of(self, left_out: np.ndarray) -> float:
        """Return the mean over joints of the log of the held-out squared error.

        The error is relative to the target, which may depend on the source of velocity.
        """
        relative = _held_out(self.reference, self.reference_number, left_out)
        return float(np.log(relative).mean())

    def own_error(self) -> float:
        relative = _held_out(self.data, self.number, self.left_out)
        return float(np.exp(0.5 * np.log(relative).mean()))


def _held_out(data: FilteredData, number: np.ndarray, left_out: np.ndarray) -> np.ndarray:
    """Return the squared error of each joint over the mean square of its target, (k,)."""
    error = data.y - np.einsum('nkp,np->nk', data.F, left_out[number])
    power = np.mean(data.y**2, axis=0)
    tiny = np.finfo(float).eps ** 2
    moves = power > 0.0
    relative = np.mean(error**2, axis=0)[moves] / power[moves]
    return np.maximum(relative, tiny)


def _decimation(fine: FilteredData, usual: int) -> int:
    """Return the least step to a white residual, `usual` where there is none before twice that."""
    w, _ = least_squares(fine.F, fine.y)
    residual = fine.y - fine.F @ w
    for step in range(1, min(2 * usual, len(residual) - 1) + 1):
        if np.abs(autocorrelation(residual, fine.block, step)).max() < WHITE:
            return step
    return usual


def _edges(signals: Signals) -> np.ndarray:
    """Return the times between blocks of equally many samples, (blocks + 1,)."""
    n = len(signals.time)
    blocks = int(np.clip(n / signals.rate / _BLOCK_S, _FEWEST_BLOCKS, _MOST_BLOCKS))
    edges = signals.time[np.linspace(0, n - 1, blocks + 1).astype(int)]
    edges[0], edges[-1] = -np.inf, np.inf
    return np.asarray(edges)


def _block_numbers(edges: np.ndarray, time: np.ndarray) -> np.ndarray:
    return np.searchsorted(edges, time, side='right') - 1


def _excerpt(signals: Signals, robot: Robot) -> Signals:
    """Return the signals with segments cut short where the recording is long."""
    n = len(signals.time)
    numbers = len(robot.joints) * max(len(robot.coefficients), 1)
    most = min(_MOST_SAMPLES, _MOST_NUMBERS // numbers)
    if n <= most:
        return signals
    bounds = np.linspace(0, n, _MOST_BLOCKS + 1).astype(int)
    pieces = [
        slice(max(segment.start, int(low)), min(segment.stop, int(low) + most // _MOST_BLOCKS))
        for low in bounds[:-1]
        for segment in signals.segments
    ]
    return replace(signals, segments=tuple(piece for piece in pieces if piece.stop > piece.start))
