"""Published and recorded values of one estimate, before it is a message of any library.

The same values go to the topics, into a record and into the result of a replay.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.engine.results import Estimate
from sgp_ros.engine.samples import JointSample
from sgp_ros.recordings.messages import Point
from sgp_ros.recordings.writer import RecordingWriter

_NONE = np.zeros(0)
INTERVAL_95 = 1.959963984540054
"""Half width of the central 95 % interval of a standard normal variable."""


@dataclass(frozen=True, slots=True, eq=False)
class Outputs:
    """Published values of one estimate.

    Attributes:
        stamp_ns: of the sample predicted [ns].
        names: joints, k of them.
        prediction: query and means.
        variance: calibrated variances, noise included [units squared]; no positions or
            velocities.
        raw_variance: the same as the model states them.
        joint_state: measured state with the predicted effort.
        residual: measured less predicted effort; None where no effort is predicted.
        band: lower and upper ends of the calibrated 95 % interval of the effort; None likewise.
        measured: effort that was predicted, filtered as the equation is; None likewise.
    """

    stamp_ns: int
    names: tuple[str, ...]
    prediction: Point
    variance: Point
    raw_variance: Point
    joint_state: JointSample
    residual: JointSample | None = None
    band: tuple[JointSample, JointSample] | None = None
    measured: JointSample | None = None


def outputs(estimate: Estimate) -> Outputs | None:
    """Return what is published of `estimate`; None where it predicts nothing."""
    acceleration, effort = (
        (_NONE,) * 3 if np.all(np.isnan(c.mean)) else (c.mean, c.variance, c.raw_variance)
        for c in (estimate.acceleration, estimate.effort)
    )
    if not (len(acceleration[0]) or len(effort[0])):
        return None
    state = (estimate.position, estimate.velocity)
    return Outputs(
        estimate.stamp_ns,
        estimate.names,
        Point(*state, acceleration[0], effort[0]),
        Point(_NONE, _NONE, acceleration[1], effort[1]),
        Point(_NONE, _NONE, acceleration[2], effort[2]),
        JointSample(
            estimate.stamp_ns, estimate.names, *state, effort[0] if len(effort[0]) else None
        ),
        *_error(estimate),
    )


def _error(
    estimate: Estimate,
) -> tuple[JointSample | None, tuple[JointSample, JointSample] | None, JointSample | None]:
    """Return residual, band and measured effort; NaN for joints without one."""
    effort = estimate.effort
    if np.all(np.isnan(effort.mean)):
        return None, None, None
    half = INTERVAL_95 * np.sqrt(effort.variance)
    residual, low, high, measured = (
        JointSample(estimate.stamp_ns, estimate.names, _NONE, effort=values)
        for values in (
            effort.measured - effort.mean, effort.mean - half, effort.mean + half, effort.measured,
        )
    )  # fmt: skip
    return residual, (low, high), measured


@dataclass(frozen=True, slots=True)
class PredictionTopics:
    """Names of the topics that predictions are written to."""

    prediction: str = '/sgp_node/prediction'
    prediction_variance: str = '/sgp_node/prediction_variance'
    predicted_joint_states: str = '/sgp_node/predicted_joint_states'
    prediction_raw_variance: str = '/sgp_node/prediction_raw_variance'


def write_outputs(writer: RecordingWriter, topics: PredictionTopics, found: Outputs) -> None:
    """Write what is published of one estimate into a recording."""
    stamp_ns, names = found.stamp_ns, found.names
    writer.write_trajectory(topics.prediction, stamp_ns, names, found.prediction)
    writer.write_trajectory(topics.prediction_variance, stamp_ns, names, found.variance)
    writer.write_trajectory(topics.prediction_raw_variance, stamp_ns, names, found.raw_variance)
    writer.write_joint_state(topics.predicted_joint_states, found.joint_state)
