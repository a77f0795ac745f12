"""Roll-outs of an identified robot over what was held out, from many measured states."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

import numpy as np

from sgp_ros.batch.identification import Identification
from sgp_ros.batch.regression_data import FilteredData, smoothed_motion
from sgp_ros.batch.rollout import cut_windows, joined
from sgp_ros.batch.rollout_scores import RolloutScore, score_windows
from sgp_ros.batch.signals import Signals
from sgp_ros.batch.zero_phase import ZeroPhase
from sgp_ros.errors import RecordingError

Stretch = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]

HORIZONS: tuple[float | None, ...] = (0.0, 0.3, None)
"""One step, 0.3 s, the longest held-out stretch."""
_STRIDE_S = 0.25


def best_coefficients(found: Identification) -> np.ndarray:
    """Return those of real bodies where there are bodies, else those of the physics."""
    if found.consistent is not None:
        return found.consistent.coefficients
    return found.physics.coefficients.mean


def roll_out_held(
    found: Identification, signals: Signals, tests: Mapping[str, Signals]
) -> dict[str, tuple[RolloutScore, ...]]:
    """Simulate the identified robot over what was held out, from many starts.

    Stretches too short for a horizon are left out, and so is a robot whose mass matrix the
    coefficients leave singular.
    """
    scores = {}
    for name, data in found.held.items():
        stretches = stretches_of(found, tests.get(name, signals), data)
        done = [_scored(found, stretches, horizon) for horizon in HORIZONS]
        scores[name] = tuple(score for score in done if score is not None)
    return scores


def stretches_of(found: Identification, signals: Signals, data: FilteredData) -> list[Stretch]:
    """Return time, position, velocity and effort at the full rate of each held-out stretch."""
    plan = found.choice.plan
    light = ZeroPhase(signals.rate, plan.state_cutoff)
    motions = [
        (signals.time[s], smoothed_motion(signals, s, plan.velocity_source, light), s)
        for s in signals.segments
    ]
    stretches = []
    for block in np.unique(data.block):
        rows = data.time[data.block == block]
        for time, motion, segment in motions:
            kept = slice(*np.searchsorted(time, (rows[0], rows[-1])))
            if kept.stop - kept.start > 1:
                effort = signals.effort[segment][kept]
                stretches.append(
                    (time[kept], motion.position[kept], motion.velocity[kept], effort)
                )
    return stretches


def _scored(
    found: Identification, stretches: list[Stretch], horizon: float | None
) -> RolloutScore | None:
    if horizon is None:  # as long as the longest one
        stretches = sorted(stretches, key=lambda s: len(s[0]))[-1:]
    windows = []
    for stretch in stretches:
        with suppress(RecordingError):
            windows.append(cut_windows(*stretch, horizon, _STRIDE_S))
    try:
        return score_windows(joined(windows), found.robot, best_coefficients(found))
    except (ValueError, np.linalg.LinAlgError):
        return None
