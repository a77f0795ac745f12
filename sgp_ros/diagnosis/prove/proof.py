"""Errors of the nominal and the final model on a recording, with 95 % intervals.

Efforts, accelerations and roll-outs are scored. Neighbours in time are not independent. For the
interval of a mean, or of a ratio of means, the values are cut into blocks of several correlation
times, and the scatter of the blocks' means gives the standard error (batch means), with Student's
t for the few blocks that there are. The correlation time is that of the initial positive pairs
of autocovariances (Geyer 1992, Practical Markov chain Monte Carlo).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy import spatial, special

from sgp_ros.batch.zero_phase import ZeroPhase
from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.diagnosis.compare.rest import resting
from sgp_ros.diagnosis.compare.trajectory import Bandwidth, RawTrajectory, observe, parallel_filter
from sgp_ros.diagnosis.criteria import CARRIED_ERROR, CARRIED_REST, LEAST_SHARE
from sgp_ros.diagnosis.prove.prediction import FinalModel, accelerations
from sgp_ros.diagnosis.prove.rollouts import cut, roll_out
from sgp_ros.diagnosis.result import Proof
from sgp_ros.errors import RecordingError
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.observed_motion import ObservedMotion

MOST_BLOCKS, LEAST_BLOCKS = 30, 4
TIMES_A_BLOCK = 4.0
"""Correlation times in a block, at least."""
_LEVEL = 0.975

Interval = tuple[float, float]


def mean_interval(x: np.ndarray) -> Interval | None:
    """Return the 95 % interval of the mean of x (n,); None where x is too short for one."""
    half = _half_width(x)
    return None if half is None else (float(x.mean()) - half, float(x.mean()) + half)


def ratio_interval(x: np.ndarray, y: np.ndarray) -> Interval | None:
    """Return the 95 % interval of `mean(x) / mean(y)` for x, y (n,) that are not negative.

    To first order the ratio r deviates by `mean(x - r y) / mean(y)`; the interval is symmetric
    for `log r`, so it never reaches below zero. None where there is too little, or no ratio.
    """
    if len(x) == 0 or not (x.mean() > 0.0 and y.mean() > 0.0):
        return None
    r = float(x.mean() / y.mean())
    half = _half_width((x - r * y) / x.mean())
    return None if half is None else (r * math.exp(-half), r * math.exp(half))


def correlation_time(x: np.ndarray) -> float:
    """Return how many neighbours of x (n,) are worth one independent value, at least 1."""
    n = len(x)
    deviation = x - x.mean()
    power = np.abs(np.fft.rfft(deviation, 2 * n)) ** 2
    covariance = np.fft.irfft(power, 2 * n)[:n]
    if not covariance[0] > 0.0:
        return 1.0
    pairs = covariance[: n - n % 2].reshape(-1, 2).sum(axis=1) / covariance[0]
    negative = np.flatnonzero(pairs <= 0.0)
    initial = pairs[: negative[0]] if len(negative) else pairs
    return max(1.0, 2.0 * float(initial.sum()) - 1.0)


def _half_width(x: np.ndarray) -> float | None:
    """Return half of the 95 % interval of the mean of x (n,)."""
    if len(x) < LEAST_BLOCKS:
        return None
    blocks = min(MOST_BLOCKS, int(len(x) / (TIMES_A_BLOCK * correlation_time(x))))
    if blocks < LEAST_BLOCKS:
        return None
    means = np.array([part.mean() for part in np.array_split(x, blocks)])
    error = float(means.std(ddof=1)) / math.sqrt(blocks)
    return float(special.stdtrit(blocks - 1, _LEVEL)) * error


_MOST_STATES = 4000


@dataclass
class _Scores:
    """Mean squares relative to their yardsticks with their intervals, by name and joint."""

    joints: tuple[str, ...]
    values: dict[str, dict[str, float]] = field(default_factory=dict)
    intervals: dict[str, dict[str, Interval]] = field(default_factory=dict)
    yardsticks: dict[str, dict[str, float]] = field(default_factory=dict)

    def add(self, name: str, squared: np.ndarray, yardstick: np.ndarray) -> None:
        """Take squared errors (n, k) and what they are measured by (n, k)."""
        self.values[name], self.intervals[name] = {}, {}
        scale = np.sqrt(yardstick.mean(axis=0)).tolist()
        self.yardsticks[name.rpartition('_')[0]] = dict(zip(self.joints, scale, strict=True))
        for j, joint in enumerate(self.joints):
            x, y = squared[:, j], yardstick[:, j]
            self.values[name][joint] = _ratio(float(x.mean()), float(y.mean()))
            interval = ratio_interval(x, y)
            if interval is not None:
                self.intervals[name][joint] = interval


def _ratio(error: float, yardstick: float) -> float:
    """Return the quotient of two mean squares; infinite if only the second is zero."""
    if yardstick > 0.0:
        return error / yardstick
    return math.inf if error > 0.0 else 0.0


def reasons_to_doubt(
    proofs: Mapping[str, Proof], still: Collection[str]
) -> dict[str, tuple[str, ...]]:
    """Return by joint why it is doubted: a constant predicts no worse than the model.

    Args:
        proofs: by stem of the recording; `train` is what was learned from.
        still: joints that do not move, of which nothing is claimed.
    """
    found: dict[str, list[str]] = {}
    for stem, proof in proofs.items():
        for joint, error in proof.nmse_after.items():
            if joint in still or error <= 1.0:
                continue
            if math.isfinite(error):
                found.setdefault(joint, []).append(
                    f'The final model explains the effort of {joint} in {stem} no better than a '
                    f'constant would (nMSE {error:.2g}): nothing is certain about this joint.'
                )
            elif stem == 'train':
                found.setdefault(joint, []).append(
                    f'The effort of {joint} in {stem} is constant, so no model explains more than '
                    'a constant does: nothing is certain about this joint.'
                )
    for joint, reason in not_carried_over(proofs, still).items():
        found.setdefault(joint, []).append(reason)
    return {joint: tuple(reasons) for joint, reasons in found.items()}


def not_carried_over(proofs: Mapping[str, Proof], still: Collection[str]) -> dict[str, str]:
    """Return the joints at which the final model fails on held-out data, and a sentence each.

    It leaves more than `CARRIED_REST` of what the nominal robot does, more than counts as physics,
    and `CARRIED_ERROR` times what it leaves where it was fitted; by the lower end of the interval.
    Or it leaves what counts as physics where the nominal robot leaves less, by both intervals.

    Args:
        proofs: by stem of the recording; `train` is what was learned from.
        still: joints that do not move, of which nothing is claimed.
    """
    train, found = proofs['train'], {}
    for stem, proof in proofs.items():
        for joint, (low, _) in proof.intervals.get('nmse_after', {}).items():
            before = proof.nmse_before[joint]
            unit = proof.yardsticks['nmse'][joint] / max(train.yardsticks['nmse'][joint], 1e-300)
            is_large = low > max(CARRIED_REST * before, LEAST_SHARE)
            known = proof.intervals.get('nmse_before', {}).get(joint)
            is_harm = known is not None and low > known[1]
            is_large |= is_harm and proof.nmse_after[joint] > LEAST_SHARE
            if stem == 'train' or joint in still or not is_large:
                continue
            if low * unit**2 > CARRIED_ERROR * train.nmse_after[joint]:
                found[joint] = (
                    f'What explains {joint} does not carry over: in {stem} it leaves '
                    f'{100 * proof.nmse_after[joint] / before:.2g} % of the discrepancy, in the '
                    f'training recording {_of_train(train, joint)}.'
                )
    return found


def _of_train(train: Proof, joint: str) -> str:
    before = train.nmse_before[joint]
    return f'{100 * train.nmse_after[joint] / before:.2g} %' if before > 0.0 else 'none'


def prove(final: FinalModel, raw: RawTrajectory, tree: Tree, name: str) -> Proof:
    """Return the errors on a recording, before and after, with their intervals.

    Args:
        final: nominal and final model, fitted on the training recording.
        raw: any recording of the robot.
        tree: nominal robot.
        name: of the recording.

    Raises:
        RecordingError: too short for a row behind the filters.
    """
    cutoff, rate = final.equations.filter.cutoff, 1.0 / raw.step
    bandwidth = Bandwidth(min(cutoff, 0.3 * rate), min(2.5 * cutoff, 0.4 * rate))
    if raw.approach is not None:
        bandwidth = choose_bandwidth(raw, tree)
    motion, low = observe(raw, tree, bandwidth), parallel_filter(raw, bandwidth)
    if not len(low.rows):
        raise RecordingError(
            f'{len(raw.time) * raw.step:.3g} s of {name} give no row below {low.cutoff:.2g} Hz',
            'a longer recording',
            'leave it out, or record longer',
        )
    scores = _Scores(tree.moving_names)
    densities = _one_step(final, motion, low, resting(raw, motion, bandwidth), scores)
    counts = _rolled_out(final, motion, ZeroPhase(rate, bandwidth.state_cutoff).trim, scores)
    values = scores.values
    return Proof(
        values['nmse_before'], values['nmse_after'],
        values.get('acceleration_nmse_before', {}), values.get('acceleration_nmse_after', {}),
        float(densities[0].mean()), float(densities[1].mean()),
        values.get('rollout_nmse_before', {}), values.get('rollout_nmse_after', {}),
        scores.intervals, (mean_interval(densities[0]), mean_interval(densities[1])),
        *counts, _distance(final.equations.motion, motion), scores.yardsticks,
    )  # fmt: skip


def _one_step(
    final: FinalModel,
    motion: ObservedMotion,
    low: ParallelFilter,
    rests: np.ndarray,
    scores: _Scores,
) -> tuple[np.ndarray, np.ndarray]:
    """Score efforts and accelerations; return the negative log densities of the efforts, (N,)."""
    k = motion.tree.size
    inertial = low(motion.mass_diagonal * motion.acceleration)
    driven = np.where(motion.tree.is_actuated[:k], low(motion.effort), inertial)
    true = low(motion.acceleration)
    densities = []
    for when, model, remainders in (
        ('before', final.nominal, ()), ('after', final.model, final.remainders),
    ):  # fmt: skip
        e = low(final.imbalance(model, motion, rests, remainders))
        scores.add(f'nmse_{when}', e**2, (driven - driven.mean(axis=0)) ** 2)
        if not motion.is_static:
            a = low(accelerations(model, final.equations, motion, rests, remainders))
            scores.add(
                f'acceleration_nmse_{when}', (a - true) ** 2, (true - true.mean(axis=0)) ** 2
            )
        variance = model.sigma**2
        nats = 0.5 * np.log(2 * np.pi * variance) + 0.5 * e**2 / variance
        densities.append(nats.mean(axis=1))
    return densities[0], densities[1]


def _rolled_out(
    final: FinalModel, motion: ObservedMotion, trim: int, scores: _Scores
) -> tuple[int, int]:
    """Score the roll-outs that both models finish; return the number of all and of the others."""
    if motion.is_static:
        return 0, 0
    windows = cut(motion, trim)
    if not len(windows.first):
        return 0, 0
    before, ends_before = roll_out(windows, final.nominal, final.equations)
    after, ends_after = roll_out(windows, final.model, final.equations, final.remainders)
    both = ends_before & ends_after
    counts = len(both), int((~both).sum())
    if not both.any():
        return counts
    steps, held = windows.steps, windows.held[both]
    scores.add('rollout_nmse_before', windows.squared(before)[both] / steps, held / steps)
    scores.add('rollout_nmse_after', windows.squared(after)[both] / steps, held / steps)
    return counts


def _distance(learned: ObservedMotion, motion: ObservedMotion) -> float:
    """Return how far the states of a motion lie from those learned from, the median.

    Positions and velocities in standard deviations of those learned from, Euclidean, over the
    root of their number: 1 is one standard deviation per coordinate.
    """
    known, asked = _states(learned), _states(motion)
    spread = known.std(axis=0)
    spread = np.where(spread > 0.0, spread, 1.0)
    distance, _ = spatial.cKDTree(known / spread).query(asked / spread)
    return float(np.median(distance) / np.sqrt(known.shape[1]))


def _states(motion: ObservedMotion) -> np.ndarray:
    n = len(motion.time)
    rows = np.linspace(0, n - 1, min(n, _MOST_STATES)).astype(int)
    return np.hstack([motion.wrapped[rows], motion.velocity[rows]])
