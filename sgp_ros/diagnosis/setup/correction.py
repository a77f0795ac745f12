"""Correction of connection errors, as one affine map of a recording and its robot.

`q = (q_recorded[order] - offset) / scale`, `tau = tau_recorded[effort_order] / effort_scale`,
commands and efforts taken `clock` later than they are stamped, gravity turned with the base, and
the origins of joints displaced in the axes of their parent links.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.trajectory import RawTrajectory
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.observed_motion import ObservedMotion

_BEYOND = 0.5
"""Way beyond its limits that a joint may have gone, of their distance: they are stated roughly."""


@dataclass(frozen=True, slots=True, eq=False)
class Acting:
    """Recorded efforts (n, k) by what makes them [N m or N].

    Attributes:
        proportional, damping: of drives that hold position targets.
        other: commanded or measured, and feed-forward.
    """

    proportional: np.ndarray
    damping: np.ndarray
    other: np.ndarray

    def size(self, kp: np.ndarray | float, kd: np.ndarray | float) -> np.ndarray:
        """Return the mean squares of the parts behind factors of the gains, summed, (k,)."""
        parts = (kp * self.proportional) ** 2 + (kd * self.damping) ** 2 + self.other**2
        return np.asarray(np.maximum(parts.mean(axis=0), 1e-300))

    def each(self, change: Callable[[np.ndarray], np.ndarray]) -> Acting:
        """Return the parts (n, k), each changed."""
        return Acting(change(self.proportional), change(self.damping), change(self.other))


@dataclass(frozen=True, eq=False)
class Correction:
    """An affine correction of k joints.

    Attributes:
        order: (k,) recorded column that shows the motion of each joint.
        offset: (k,) recorded position less scaled true position [rad or m].
        scale: (k,) recorded per true position [1].
        effort_order: (k,) recorded column that holds the effort of each joint.
        effort_scale: (k,) recorded effort per true effort [1].
        kp, kd: (k,) gains in force relative to those stated [1].
        clock: stamps of commands or efforts minus those of the states [s].
        roll, pitch: orientation of the base in the world, `Ry(pitch) Rx(roll)` [rad].
        origins: (k, 3) displacement of the joints' origins in the axes of the parent links [m].
    """

    order: np.ndarray
    offset: np.ndarray
    scale: np.ndarray
    effort_order: np.ndarray
    effort_scale: np.ndarray
    kp: np.ndarray
    kd: np.ndarray
    clock: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    origins: np.ndarray | None = None

    @classmethod
    def none(cls, k: int) -> Correction:
        """Return the correction that changes nothing."""
        same = np.arange(k)
        return cls(same, np.zeros(k), np.ones(k), same, np.ones(k), np.ones(k), np.ones(k))

    @property
    def moves(self) -> tuple[object, ...]:
        """Part of it that changes motion and robot; the rest changes efforts alone."""
        origins = b'' if self.origins is None else self.origins.tobytes()
        columns = (self.order.tobytes(), self.offset.tobytes(), self.scale.tobytes())
        return *columns, self.roll, self.pitch, origins

    def tree(self, tree: Tree) -> Tree:
        """Return the robot as it stands."""
        cr, sr, cp, sp = (
            np.cos(self.roll),
            np.sin(self.roll),
            np.cos(self.pitch),
            np.sin(self.pitch),
        )
        base = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]) @ np.array(
            [[1, 0, 0], [0, cr, -sr], [0, sr, cr]]
        )
        translations = tree.translations.copy()
        if self.origins is not None:
            translations[: len(self.origins)] += self.origins
        return replace(tree, gravity=base.T @ tree.gravity, translations=translations)

    def keeps_limits(self, motion: ObservedMotion) -> bool:
        """Return whether no joint was far beyond limits within which it is recorded."""
        tree, k, recorded = motion.tree, len(self.order), motion.position
        room = _BEYOND * (tree.upper[:k] - tree.lower[:k])
        low, high = tree.lower[:k] - room, tree.upper[:k] + room
        ends = np.stack([recorded.min(axis=0), recorded.max(axis=0)])
        true = (ends[:, self.order] - self.offset) / self.scale
        is_inside = ((ends > low) & (ends < high)).all(axis=0)
        return bool((((true > low) & (true < high)) | ~is_inside).all())

    def motion(self, motion: ObservedMotion, acting: Acting) -> ObservedMotion:
        """Return an observed motion as it was.

        Args:
            motion: of the recording.
            acting: recorded efforts, taken `clock` later than they are stamped.
        """
        late = acting.proportional * self.kp + acting.damping * self.kd + acting.other
        return replace(
            motion,
            tree=self.tree(motion.tree),
            position=(motion.position[:, self.order] - self.offset) / self.scale,
            velocity=motion.velocity[:, self.order] / self.scale,
            acceleration=motion.acceleration[:, self.order] / self.scale,
            effort=late[:, self.effort_order] / self.effort_scale,
            drive=None,
        )

    def recording(self, raw: RawTrajectory) -> RawTrajectory:
        """Return a recording as it was."""
        drive, effort, velocity, gains = raw.drive, raw.effort, raw.velocity, raw.gains
        if drive is not None:
            change = self._commands if gains is None else self._targets
            drive = drive.changed(change, -self.clock)
        if gains is not None:
            size = self.scale / self.effort_scale
            gains = replace(gains, kp=gains.kp[self.order], kd=gains.kd[self.order])
            gains = gains.scaled(self.kp * size, self.kd * size)
        if effort is not None:
            effort = effort[:, self.effort_order] / self.effort_scale
            if drive is None:
                effort = delayed(effort, raw, self.clock)
        if velocity is not None:
            velocity = velocity[:, self.order] / self.scale
        return replace(
            raw,
            position=(raw.position[:, self.order] - self.offset) / self.scale,
            velocity=velocity, effort=effort, drive=drive, gains=gains,
            noise_density=raw.noise_density[self.order] / self.scale**2,
        )  # fmt: skip

    def _commands(self, values: np.ndarray) -> np.ndarray:
        return np.asarray(values[:, self.effort_order] / self.effort_scale)

    def _targets(self, values: np.ndarray) -> np.ndarray:
        blocks = np.split(values, values.shape[1] // len(self.order), axis=1)
        position, velocity, *gains = (x[:, self.order] for x in blocks)
        position = (position - self.offset) / self.scale
        return np.column_stack([position, velocity / self.scale, *gains])


def delayed(effort: np.ndarray, raw: RawTrajectory, clock: float) -> np.ndarray:
    """Return efforts (n, k) of a uniform grid at times `clock` later; ends are held."""
    if not clock:
        return effort
    found = np.empty_like(effort)
    for rows in raw.segments:
        t = raw.time[rows]
        for j, column in enumerate(effort[rows].T):
            found[rows, j] = np.interp(t + clock, t, column)
    return found
