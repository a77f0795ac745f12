"""Statuses on how well the model holds, joint by joint, and on the parameters that it finds.

A level above OK means that something has to be done: the errors of a joint have grown beyond
chance, and so far that the growth counts as physics; or they left their interval for longer than
chance allows, just now.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from sgp_ros.diagnosis.criteria import LEAST_SHARE
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.monitoring import ExcursionMonitor
from sgp_ros.engine.results import Estimate
from sgp_ros.recordings.messages import Status
from sgp_ros.robots.robot import Robot
from sgp_ros.ros.verdict import OK, WARN

_MEMORY = 100
_ENOUGH = 5
"""Parameters are reported as undetermined from this many times `learning.initial` samples on."""


class FitHealth:
    """Follows the errors of one-step predictions.

    Args:
        joints: number of joints.
        least_s: shortest excursion that alarms [s].
        per_hour: false alarms of the whole robot that are accepted an hour.

    Attributes:
        monitors: one per joint.
    """

    def __init__(self, joints: int, least_s: float, per_hour: float) -> None:
        self.monitors = [ExcursionMonitor(least_s, per_hour / joints) for _ in range(joints)]
        self._square = np.full(joints, np.nan)
        self._surprise = np.full(joints, np.nan)
        self._reported: set[str] = set()

    def take(self, estimates: Iterable[Estimate], robot: Robot) -> bool:
        """Take estimates; return whether an alarm began or ended.

        Errors that the model refuses as implausible count here, because a collision is one.
        """
        has_changed = False
        for estimate in estimates:
            channel = getattr(estimate, robot.target)
            errors = channel.measured - channel.mean
            if estimate.is_scored:
                self._follow(errors**2, channel.variance)
            rests = _rests(estimate, robot)
            rows = zip(errors, channel.variance, channel.raw_variance, rests, strict=True)
            for monitor, (error, variance, raw, is_resting) in zip(
                self.monitors, rows, strict=True
            ):
                if 0.0 < variance < math.inf and 0.0 < raw < math.inf and not is_resting:
                    has_changed |= monitor.add(estimate.stamp_ns, error, variance, raw)
        return has_changed

    def statuses(self, engine: Engine, node: str) -> list[Status]:
        """Return one status per joint, and one on the parameters."""
        robot = engine.robot.name
        found = []
        for j, joint in enumerate(engine.robot.joint_names):
            level, message, values = self._joint(engine, j, joint)
            found.append(Status(f'{node}: fit {joint}', level, message, robot, values))
        level, message, values = self._parameters(engine)
        return [*found, Status(f'{node}: parameters', level, message, robot, values)]

    def monitor_statuses(self, engine: Engine, node: str) -> list[Status]:
        """Return one status per joint on its excursions, WARN while it alarms."""
        return [
            Status(
                f'{node}: monitor {joint}', WARN if monitor.is_alarmed else OK,
                _excursion(joint, monitor), engine.robot.name,
                {
                    'alarm': str(int(monitor.is_alarmed)),
                    'ratio': f'{monitor.ratio:.3f}',
                    'outside_s': f'{monitor.lasting_s:.3f}',
                    'needed': str(monitor.needed),
                    'alarms': str(monitor.alarms),
                },
            )
            for joint, monitor in zip(engine.robot.joint_names, self.monitors, strict=True)
        ]  # fmt: skip

    def _follow(self, squares: np.ndarray, variance: np.ndarray) -> None:
        with np.errstate(invalid='ignore', divide='ignore'):
            ratios = squares / variance
        for old, new in ((self._square, squares), (self._surprise, ratios)):
            step = np.where(np.isnan(old), new, old + (new - old) / _MEMORY)
            old[:] = np.where(np.isfinite(new), step, old)

    def _joint(self, engine: Engine, j: int, joint: str) -> tuple[int, str, dict[str, str]]:
        scores = engine.scores()[joint]
        values = {
            f'{channel}.{name}': f'{getattr(score, name):.6g}'
            for channel, score in scores.items()
            for name in ('nmse', 'nlpd', 'coverage95', 'raw_coverage95', 'n')
        }
        target = scores.get(engine.robot.target)
        if target is None or np.isnan(self._square[j]):
            return OK, 'no prediction scored yet', values
        running = engine.estimator.scoring.scores[engine.robot.target][j]
        recent = float(self._square[j]) * running.n / running.target_squares
        drift = engine.drift[j]
        values |= {
            'recent_nmse': f'{recent:.6g}',
            'surprise': f'{self._surprise[j]:.4f}',
            'drift': f'{drift.level:.4f}',
        }
        message = f'nMSE {target.nmse:.3g}, coverage {100 * target.coverage95:.1f} %'
        weight = engine.process_weights().get(joint)
        if weight is not None:
            values['process_weight'] = f'{weight.value:.4f}'
            if weight.value < 0.5:
                message += (
                    f'; Z predicts worse than the physics alone: its weight is {weight.value:.2f}'
                )
        if not (drift.is_drifting and recent - target.nmse > LEAST_SHARE):
            return OK, message, values
        message = (
            f'{joint}: errors have grown significantly, recent nMSE {recent:.2g} (before '
            f'{target.nmse:.2g}); the robot has changed (load, wear, temperature) or moves in '
            'a new way: inspect it, or call ~/diagnose'
        )
        return WARN, message, values

    def _parameters(self, engine: Engine) -> tuple[int, str, dict[str, str]]:
        """Warn once of each parameter that stays undetermined."""
        found = engine.parameters()
        unknown = [parameter.name for parameter in found if parameter.std is None]
        values = {'parameters': str(len(found)), 'undetermined': str(len(unknown))}
        if not unknown:
            return OK, f'all {len(found)} parameters determined', values
        some = ', '.join(unknown[:8]) + (' ...' if len(unknown) > 8 else '')
        message = f'{len(unknown)} of {len(found)} parameters not determined so far: {some}'
        is_early = engine.counts.learned < _ENOUGH * engine.config.learning_initial
        if is_early or set(unknown) <= self._reported:
            return OK, message, values
        self._reported |= set(unknown)
        return WARN, f'{message}; move all joints, faster and farther', values


def _rests(estimate: Estimate, robot: Robot) -> np.ndarray:
    """Return which joints stated dry friction may hold, (k,): their errors are its freedom."""
    friction = robot.rest_friction
    rests = np.zeros(len(robot.joints), dtype=bool)
    if friction is not None:
        joints = sorted(friction.joints)
        rests[joints] = np.abs(estimate.velocity[joints]) < friction.coulomb_width
    return rests


def _excursion(joint: str, monitor: ExcursionMonitor) -> str:
    if not monitor.is_alarmed:
        return 'no alarm'
    return (
        f'{joint}: the error is {monitor.ratio:.3g} times the half-width of its 95 % interval, '
        f'and has been outside for {monitor.lasting_s:.1f} s; check the joint for a collision, a '
        'new load or a fault'
    )
