"""How much of each concealed effect nothing else explains: what a diagnosis can be asked to name.

Of the force `x` that an effect exerts along the true motion, what remains after projecting on the
forces of all inertial parameters and of larger effects. Where this is less than counts as physics
an effect need not be named: no diagnosis could tell it from wrong bodies or from the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgp_ros.rigid.rigid_body import torque_regressor
from sgp_ros.simulation.effects import Moment
from sgp_ros.simulation.scenario import effect_actions

_MOST_ROWS = 1500
_STILL = 1e-9


@dataclass(frozen=True)
class Motion:
    """The true motion of simulated recordings, thinned.

    Attributes:
        time: (n,) since the beginning of its recording [s].
        position, velocity, acceleration: (n, k) [rad or m, per second].
        effort: (n, k) without noise [N m or N].
        noise: (k,) mean square of that of the recorded efforts, which shares refer to too.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray
    noise: np.ndarray | float = 0.0

    @classmethod
    def of(cls, parts, noise=0.0):
        """Take some rows of simulated recordings."""
        total = sum(len(part.stamps_ns) for part in parts)
        every = max(1, total // _MOST_ROWS)
        return cls(
            np.concatenate([1e-9 * (x.stamps_ns - x.stamps_ns[0])[::every] for x in parts]),
            np.vstack([x.true_position[::every] for x in parts]),
            np.vstack([x.true_velocity[::every] for x in parts]),
            np.vstack([x.true_acceleration[::every] for x in parts]),
            np.vstack([x.effort[::every] for x in parts]),
            noise,
        )

    @property
    def mean_square(self):
        """Mean squared recorded effort of each joint, (k,)."""
        return np.mean(self.effort**2, axis=0) + self.noise


def force_of(effect, simulator, motion):
    """Return the force of an effect along a motion, (n, k) [N m or N]; 0 at rest for dry friction.

    Args:
        effect: concealed.
        simulator: of the machine.
        motion: of the machine.
    """
    chosen = effect.chosen()
    actions = effect.unlisted(simulator.joints)
    if chosen is not None:
        actions = effect_actions(simulator, chosen)
    force = np.zeros_like(motion.position)
    rows = zip(motion.time, motion.position, motion.velocity, motion.effort, strict=True)
    moments = [Moment(*row, np.zeros(0)) for row in rows]
    for action in actions:
        j = action.joint
        force[:, j] -= action.inertia * motion.acceleration[:, j]
        for i, moment in enumerate(moments):
            if action.force is not None:
                force[i, j] += action.force(moment)
            if action.drive is not None:
                force[i, j] += action.drive(moment) - moment.drive[j]
            v = moment.velocity[j]
            if action.dry_level is not None and abs(v) > _STILL:
                way = 1 if v > 0.0 else -1
                force[i, j] -= way * action.dry_level(moment, way)
    return force


class Explained:
    """Forces that bodies and effects so far explain, in units of each joint's rms effort.

    Args:
        tree: of the nominal robot.
        motion: of the machine.
    """

    def __init__(self, tree, motion):
        self._scale = 1.0 / np.sqrt(motion.mean_square + 1e-18)
        Y = torque_regressor(tree, motion.position, motion.velocity, motion.acceleration)
        self._k = Y.shape[1]
        columns = (Y * self._scale[:, None]).reshape(-1, Y.shape[2])  # (n k, 10 b)
        u, s, _ = np.linalg.svd(columns / (np.linalg.norm(columns, axis=0) + 1e-12),
                                full_matrices=False)  # fmt: skip
        self._basis = u[:, s > 1e-6 * s[0]]

    def left(self, force):
        """Return the share of the mean squared effort that a force (n, k) leaves, (k,)."""
        rest = self._rest(force).reshape(-1, self._k)
        return np.mean(rest**2, axis=0)

    def add(self, force):
        """Take the force (n, k) of an effect among what is explained."""
        rest = self._rest(force)
        size = np.linalg.norm(rest)
        if size > 1e-9 * np.linalg.norm(force * self._scale):
            self._basis = np.column_stack([self._basis, rest / size])

    def _rest(self, force):
        x = (force * self._scale).ravel()
        for _ in range(2):
            x = x - self._basis @ (self._basis.T @ x)
        return x
