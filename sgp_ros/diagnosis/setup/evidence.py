"""How well a recording agrees with its robot once its connections are corrected.

`d = low(tau_nominal(q, v, a) - tau) = low(X) b + noise` with everyday unknowns b: inertial
parameters and, per joint, viscous and dry friction and an offset, each with a wide normal prior.
The evidence is that of the recorded motion and efforts, with b integrated out (Laplace), for the
nominal robot alone, with bodies, and with friction too; the best of the three counts, so that an
error of the connection must explain what none of them does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import body_directions
from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.diagnosis.compare.trajectory import Bandwidth, RawTrajectory, observe
from sgp_ros.diagnosis.criteria import INDEPENDENT_ROWS, SHAPE_ERROR
from sgp_ros.diagnosis.setup.correction import Acting, Correction, delayed
from sgp_ros.physics.drive import Servo
from sgp_ros.rigid.rigid_body import mass_matrix, torque_regressor
from sgp_ros.rigid.tree import Tree

_MOST_ROWS = 1000
_STRETCHES = 4
"""Parts of the recording, spread evenly, that are looked at."""
_PER_PERIOD = 8.0
"""Rows per period of the cut-off before the filter."""
_ROUNDS = 4
_KEPT = 50
"""Clock offsets of which the efforts are remembered."""
FRICTION = 0.3
"""Prior standard deviation of friction and offset, relative to the rms of the joint's effort."""


@dataclass(frozen=True, eq=False)
class Agreement:
    """How well a corrected recording agrees with its robot.

    Attributes:
        evidence: logarithm, best of the sets of unknowns [nats].
        unknowns: number of the set that is best: 0 none, 1 bodies, 2 bodies and friction.
        left: (k,) share of the mean squared effort that is left with them.
        discrepancy: (N, k) from the nominal robot, relative to the rms effort of each joint.
    """

    evidence: float
    unknowns: int
    left: np.ndarray
    discrepancy: np.ndarray

    def distance(self, other: Agreement) -> float:
        """Return the greatest share of a joint's effort by which two discrepancies differ."""
        return float(((self.discrepancy - other.discrepancy) ** 2).mean(axis=0).max())


class Probe:
    """A recording on which corrections are tried.

    Attributes:
        full: its motion at the full rate.
        motion: the same, thinned.
    """

    def __init__(self, raw: RawTrajectory, tree: Tree, bandwidth: Bandwidth) -> None:
        motion = observe(raw, tree, bandwidth)
        every = max(1, int(1.0 / (raw.step * _PER_PERIOD * bandwidth.cutoff)))
        self._raw, self.every = raw, every
        kept = _spread(raw, every)
        ends = np.cumsum([len(rows) for rows in kept])
        segments = [slice(int(e) - len(rows), int(e)) for e, rows in zip(ends, kept, strict=True)]
        self.rows = np.concatenate(kept)
        pick = self.rows
        self.motion = replace(
            motion, time=motion.time[pick], step=motion.step * every,
            position=motion.position[pick], velocity=motion.velocity[pick],
            acceleration=motion.acceleration[pick], effort=motion.effort[pick], drive=None,
            starts=tuple(s.start for s in segments),
        )  # fmt: skip
        self.full = motion
        self.filter = ParallelFilter(1.0 / self.motion.step, bandwidth.cutoff, tuple(segments))
        self.directions = body_directions(tree)
        k = tree.size
        self.driven = tree.is_actuated[:k]
        effort = (self.motion.effort**2).mean(axis=0)
        inertial = (self.motion.mass_diagonal * self.motion.acceleration).var(axis=0)
        self.power = np.where(self.driven, effort, inertial)
        self.power = np.where(self.power > 0.0, self.power, 1.0)
        self._pose = np.linspace(0, len(pick) - 1, 24).astype(int)
        M = mass_matrix(tree, tree.parameters, self.motion.position[self._pose])
        self.nominal_inertia = float(np.linalg.slogdet(M)[1].mean())
        self._known: dict[float, Acting] = {}

    def acting(self, clock: float) -> Acting:
        """Return the recorded efforts taken `clock` later."""
        if clock not in self._known:
            if len(self._known) > _KEPT:
                self._known.clear()
            self._known[clock] = self._taken(clock).rows(self.rows)
        return self._known[clock]

    def _taken(self, clock: float) -> Acting:
        drive = self.full.drive
        none = np.zeros_like(self.full.effort)
        proportional, damping, other = none, none, none.copy()
        if isinstance(drive, Servo):
            proportional, damping, other = none.copy(), none.copy(), drive.feedforward
        for j in np.flatnonzero(self.driven):
            if isinstance(drive, Servo):
                proportional[:, j], damping[:, j] = drive.parts(int(j), -clock)
            elif drive is not None:
                other[:, j] = drive.effort(int(j), delay=-clock)
        if drive is None:
            other = delayed(self.full.effort, self._raw, clock)
        return Acting(proportional, damping, other)

    def agreement(self, correction: Correction) -> Agreement:
        """Return how well the recording agrees with the robot once it is corrected."""
        motion = correction.motion(self.motion, self.acting(correction.clock))
        tree = motion.tree
        k = tree.size
        Y = torque_regressor(tree, motion.position, motion.velocity, motion.acceleration)
        nominal = Y @ tree.parameters.ravel() + tree.damping[:k] * motion.velocity
        d = self.filter(nominal - motion.effort - motion.stated_force)
        n = len(Y)
        bodies = -self.filter((Y.reshape(n * k, -1) @ self.directions.T).reshape(n, -1))
        bodies = bodies.reshape(len(d), k, -1)
        power = self.power[correction.effort_order] / correction.effort_scale**2
        power = np.where(self.driven, power, self.power)
        rms = np.sqrt(power)
        extra = np.zeros((len(d), k, 3 * k))
        for j in range(k):
            v = motion.velocity[:, j]
            size = max(float(np.sqrt((v * v).mean())), 1e-12)
            columns = np.column_stack([v / size, motion.direction[:, j], np.ones(n)])
            extra[:, j, 3 * j : 3 * j + 3] = FRICTION * rms[j] * self.filter(columns)
        poses = motion.position[self._pose]
        sets = (bodies[:, :, :0], bodies, np.concatenate([bodies, extra], axis=2))
        found = []
        for X in sets:
            value, left, b = self._with(d, X, power)
            w = np.zeros(bodies.shape[2])
            w[: len(b)] = b[: len(w)]
            shift = self._log_inertia(tree, w, poses) + correction.log_volume(self.driven)
            found.append((value + min(INDEPENDENT_ROWS, len(d)) * shift, left))
        best = max(range(3), key=lambda i: found[i][0])
        return Agreement(found[best][0], best, found[best][1], d / rms)

    def _log_inertia(self, tree: Tree, w: np.ndarray, poses: np.ndarray) -> float:
        """Return the mean of log det M of changed bodies less that of the nominal robot."""
        changed = tree.parameters + (w @ self.directions).reshape(tree.parameters.shape)
        M = mass_matrix(tree, changed, poses)
        if not np.isfinite(M).all() or np.linalg.eigvalsh(M)[:, 0].min() <= 0.0:
            return -np.inf
        return float(np.linalg.slogdet(M)[1].mean()) - self.nominal_inertia

    def _with(
        self, d: np.ndarray, X: np.ndarray, power: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """Return the evidence of efforts with unknowns of unit prior, what is left, and these."""
        N, _, p = X.shape
        rows = min(INDEPENDENT_ROWS, N)
        floor = (1e-5 + SHAPE_ERROR * np.minimum((d**2).mean(axis=0) / power, 1.0)) * power
        variance = (d**2).mean(axis=0) + floor
        occam, b = 0.0, np.zeros(p)
        left = d
        if p:
            G = np.einsum('njp,njq->jpq', X, X, optimize=True)
            g = np.einsum('njp,nj->jp', X, d, optimize=True)
            for _ in range(_ROUNDS):
                weight = rows / N / variance
                A = np.tensordot(weight, G, 1) + np.eye(p)
                b = np.linalg.solve(A, weight @ g)
                left = d - X @ b
                variance = (left**2).mean(axis=0) + floor
            occam = 0.5 * float(np.linalg.slogdet(A)[1])
        share = variance / power
        value = -0.5 * rows * float(np.log(share).sum()) - 0.5 * float(b @ b) - occam
        return value, (left**2).mean(axis=0) / power, b


def _spread(raw: RawTrajectory, every: int) -> list[np.ndarray]:
    """Return rows of stretches that are spread over a recording, every `every`-th each."""
    whole = [np.arange(s.start, s.stop, every) for s in raw.segments]
    total = sum(len(rows) for rows in whole)
    if total <= _MOST_ROWS:
        return whole
    share, kept = _MOST_ROWS / total, []
    for rows in whole:
        parts = max(1, round(_STRETCHES * len(rows) / total))
        split = np.array_split(rows, parts)
        kept += [part[: max(64, int(share * len(part)))] for part in split]
    return kept
