"""Estimates as messages of a recording, laid out as the node publishes them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.engine.samples import JointSample

if TYPE_CHECKING:
    from collections.abc import Iterable

    from sgp_ros.engine.results import Estimate
    from sgp_ros.recordings.writer import RecordingWriter

PREDICTION = '/sgp_node/prediction'
VARIANCE = '/sgp_node/prediction_variance'
OVERLAY = '/sgp_node/predicted_joint_states'


def write_predictions(writer: RecordingWriter, estimates: Iterable[Estimate]) -> None:
    """Write mean, variance and overlay of every estimate; a channel without value stays empty."""
    for estimate in estimates:
        writer.write_trajectory_point(
            PREDICTION,
            estimate.stamp_ns,
            estimate.names,
            estimate.position,
            estimate.velocity,
            known(estimate.acceleration.mean),
            known(estimate.effort.mean),
        )
        writer.write_trajectory_point(
            VARIANCE,
            estimate.stamp_ns,
            estimate.names,
            accelerations=known(estimate.acceleration.variance),
            effort=known(estimate.effort.variance),
        )
        overlay = JointSample(
            estimate.stamp_ns,
            estimate.names,
            estimate.position,
            estimate.velocity,
            known(estimate.effort.mean),
        )
        writer.write_joint_state(OVERLAY, overlay)


def known(values: np.ndarray) -> np.ndarray:
    """Return the values (k,), or none where all are NaN."""
    return values[:0] if np.all(np.isnan(values)) else values
