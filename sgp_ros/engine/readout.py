"""Reads parameters and scores out of what was learned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.results import ParameterEstimate, Score
from sgp_ros.gp.regression import Regression
from sgp_ros.gp.scores import RunningScore
from sgp_ros.robots.robot import Robot


def read_parameters(
    robot: Robot, config: EngineConfig, model: Regression | None
) -> tuple[ParameterEstimate, ...]:
    """Return the posterior of every coefficient under a model; empty without one."""
    if model is None or config.model_method == 'GP':
        return ()
    information = model.information
    std = np.sqrt(np.diag(information.covariance))
    known = information.is_identifiable
    return tuple(
        ParameterEstimate(c.name, c.joint, float(w), float(s) if k else None, c.unit, bool(k))
        for c, w, s, k in zip(
            robot.coefficients, information.coefficients, std, known, strict=True
        )
    )


def read_scores(
    robot: Robot, scores: Mapping[str, Sequence[RunningScore]]
) -> dict[str, dict[str, Score]]:
    """Return scores by joint and channel; what has no samples or a constant target is absent."""
    found: dict[str, dict[str, Score]] = {}
    for j, joint in enumerate(robot.joint_names):
        channels = {channel: _score(running[j]) for channel, running in scores.items()}
        found[joint] = {c: score for c, score in channels.items() if score is not None}
    return found


def _score(running: RunningScore) -> Score | None:
    if running.n == 0 or not np.isfinite(running.nmse):
        return None
    return Score(running.nmse, running.nlpd, running.coverage95, running.n)
