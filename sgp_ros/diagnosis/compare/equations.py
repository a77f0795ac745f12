"""The discrepancy of a recording from the nominal robot as filtered linear equations.

For every joint `d = tau_nominal(q, v, a) - tau_stated - tau_commanded = sum tau_x - Y dpi +
noise`: what the motion takes beyond what was commanded, and beyond the effects that the nominal
robot states, comes from effects tau_x, and from wrong inertial parameters. These have a prior: a
body may have another mass, another centre, another inertia. An effort that was measured is read
within half a sampling period of the position with its stamp, not at the same instant, which adds
`t dtau/dt` with an unknown t for each joint.

The nominal values of the robot are the reference, not a fit to its simulation: where the two agree
a fit would add nothing but its own error, and where they do not, the wrong parameters and findings
would no longer be those of the robot that was given. The simulation only checks the robot.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sgp_ros.diagnosis.compare.bodies import Factor, body_directions
from sgp_ros.diagnosis.compare.effort_noise import measured_noise, noise_beside_laws
from sgp_ros.diagnosis.compare.grid import effort_change
from sgp_ros.diagnosis.compare.parallel_filter import ParallelFilter
from sgp_ros.diagnosis.compare.power import at_one_scale, reference_power
from sgp_ros.diagnosis.compare.rest import resting
from sgp_ros.diagnosis.compare.trajectory import (
    Bandwidth,
    RawTrajectory,
    observe,
    parallel_filter,
    smoothing_error,
)
from sgp_ros.diagnosis.compare.volume import (
    Loop,
    carried_inertia,
    log_inertia,
    noisy_volume,
    part_of_noise,
)
from sgp_ros.rigid.rigid_body import mass_matrix, torque_regressor
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.observed_motion import ObservedMotion

_BLOCK = 2000
"""Rows whose regressor is held at a time: that of a long recording would not fit in memory."""
POSES = 32
"""Positions over which the inertia of a robot is averaged."""


@dataclass(frozen=True, eq=False)
class Held:
    """Rows of a joint where dry friction takes up any force while the joint rests.

    Attributes:
        change: what is taken from its discrepancy, (N,) [N m or N].
        base: of it, (N, p).
    """

    change: np.ndarray
    base: np.ndarray

    @cached_property
    def factor(self) -> Factor:
        """Base, factored."""
        return Factor.of(self.base)


@dataclass(frozen=True, eq=False)
class Equations:
    """N rows of k joints.

    Attributes:
        motion: at the full rate, n rows.
        filter: from n to N rows.
        time: (N,) [s].
        d: (N, k) discrepancy [N m or N].
        bases: of each joint, (N, p) force per standard deviation of each measured effort's
            instant, then of each change of inertial parameters; unchanged ones are shared.
        directions: (p - instants, 10 b) changes of inertial parameters.
        power: (k,) mean squared effort that shares refer to [N^2 m^2 or N^2].
        noise: (k,) standard deviation that the encoders' noise gives d [N m or N].
        moving: (n, k) 0 where a joint rests that has, or may have, dry friction, 1 elsewhere.
        rests: (n, k) where joints rest.
        model_error: (k,) mean square that a perfect model leaves: the change of d with the
            smoothing of the states, and the noise of measured efforts.
        noise_part: (k,) part of d that this noise makes, in mean squares.
        effort_noise: (k,) its mean square, the part of `model_error` that no inertia changes.
        carried: (k,) log of the inertia that efforts show, see `carried_inertia` and `inertia`.
        loop: what holds the motion.
        free: the same equations where dry friction holds fewer joints, or None.
        instants: number of efforts whose instant is unknown: k where they are measured, else 0.
        accuracy: errors of the robot file, relative to the usual prior.
    """

    motion: ObservedMotion
    filter: ParallelFilter
    time: np.ndarray
    d: np.ndarray
    bases: tuple[np.ndarray, ...]
    directions: np.ndarray
    power: np.ndarray
    noise: np.ndarray
    moving: np.ndarray
    rests: np.ndarray
    model_error: np.ndarray
    noise_part: np.ndarray
    effort_noise: np.ndarray
    carried: np.ndarray
    loop: Loop
    free: Equations | None = None
    instants: int = 0
    accuracy: float = 1.0

    @cached_property
    def factors(self) -> tuple[Factor, ...]:
        """Base of each joint, factored; a hypothesis of what is held shares those of others."""
        if self.free is None:
            return tuple(Factor.of(base) for base in self.bases)
        return tuple(
            self.free.factors[j] if base is self.free.bases[j] else self.free.held(j).factor
            for j, base in enumerate(self.bases)
        )

    @cached_property
    def is_never_held(self) -> np.ndarray:
        """Whether no row may be held by dry friction of a joint, (k,)."""
        return np.asarray(self.moving.all(axis=0))

    @property
    def size(self) -> int:
        """Number p of instants and of changes of the inertial parameters."""
        return self.instants + len(self.directions)

    @cached_property
    def effort(self) -> np.ndarray:
        """Efforts behind the filter while joints may move, (N, k) [N m or N]."""
        return self.filter(self.motion.effort * self.moving)

    @property
    def base(self) -> np.ndarray:
        """All bases in one new array, (N, k, p)."""
        return np.stack(self.bases, axis=1)

    def force_of(self, w: np.ndarray) -> np.ndarray:
        """Return the force of instants and changed bodies, w (p,), (N, k) [N m or N]."""
        return np.stack([base @ w for base in self.bases], axis=1)

    def force_of_bodies(self, w: np.ndarray) -> np.ndarray:
        """Return the force of the changed bodies of w alone, (N, k) [N m or N]."""
        bodies = w[-len(self.directions) :]
        return np.stack([base[:, self.instants :] @ bodies for base in self.bases], axis=1)

    def with_bodies(self, motion: ObservedMotion, w: np.ndarray) -> ObservedMotion:
        """Return a motion of a robot with the changed bodies of w (p,)."""
        bodies = w[-len(self.directions) :]
        change = (bodies @ self.directions).reshape(motion.tree.parameters.shape)
        tree = replace(motion.tree, parameters=motion.tree.parameters + change)
        return replace(motion, tree=tree)

    def compact(self, columns: np.ndarray, joint: int, *, is_inertial: bool) -> np.ndarray:
        """Return columns (n, m) of one joint as its rows (N, m), or (n, k, m) as (N, k, m).

        What acts on a joint that dry friction holds is taken up by it, except inertial forces:
        their smoothed share of the stop belongs to the motion before and after.
        """
        own = slice(None) if columns.ndim == 3 else joint
        if is_inertial or self.is_never_held[own].all():
            return self.filter(columns)
        return self.filter(columns * self.moving[:, own, None])

    def with_dry_friction(self, joints: frozenset[int]) -> Equations:
        """Return the equations under the hypothesis that dry friction may hold these joints.

        While it does, it takes up any force: such rows do not constrain anything else.
        """
        held = [j for j in sorted(joints) if self.moving[self.rests[:, j], j].any()]
        if not held:
            return self
        d, bases, moving = self.d.copy(), list(self.bases), self.moving.copy()
        for j in held:
            known = self.held(j)
            d[:, j] -= known.change
            bases[j] = known.base
            moving[self.rests[:, j], j] = 0.0
        return replace(self, d=d, bases=tuple(bases), moving=moving, free=self)

    def held(self, j: int) -> Held:
        """Return what changes for a joint that dry friction may hold, whatever others do."""
        if j not in self._held:
            motion, rests = self.motion, self.rests[:, j]
            change, base = np.empty(len(self.d)), self.bases[j].copy()
            late = effort_change(motion.effort[:, [j]], motion.starts) if self.instants else None
            for rows, out in self.filter.blocks(_BLOCK):
                at = rests[rows]
                q = motion.position[rows][at]
                v, a = motion.velocity[rows][at], motion.acceleration[rows][at]
                v[:, j] = a[:, j] = 0.0
                needed = np.zeros((len(at), 1 + self.size))
                acting = (motion.effort[rows, j] + motion.stated_force[rows, j])[at]
                needed[at, 0] = motion.effort_for(q, v, a)[:, j] - acting
                if late is not None:
                    needed[at, 1 + j] = -late[rows, 0][at]
                Y = torque_regressor(motion.tree, q, v, a)[:, j]
                needed[at, 1 + self.instants :] = Y @ self.directions.T
                found = self.filter.piece(needed, out)
                change[out] = found[:, 0]
                base[out] += found[:, 1:]
            self._held[j] = Held(change, base)
        return self._held[j]

    @cached_property
    def _held(self) -> dict[int, Held]:
        return {}

    @cached_property
    def poses(self) -> tuple[ObservedMotion, ...]:
        """Positions over the recording, at rest, and with a unit acceleration of each joint.

        k + 1 motions of `POSES` rows.
        """
        rows = np.linspace(0, len(self.motion.time) - 1, POSES).astype(int)
        q = self.motion.position[rows]
        still = replace(
            self.motion, time=self.motion.time[rows], position=q, velocity=np.zeros_like(q),
            acceleration=np.zeros_like(q), effort=np.zeros_like(q), drive=None, starts=(0,),
            recording=None,
        )  # fmt: skip
        pushed = (replace(still, acceleration=np.tile(x, (len(q), 1))) for x in np.eye(q.shape[1]))
        return still, *pushed

    def inertia(self, w: np.ndarray, added: np.ndarray, passed: np.ndarray) -> np.ndarray:
        """Return the log of the inertia at each joint, relative to the nominal one, (k,).

        Of changed bodies and what is added to M. The motion is measured, so a model of other
        inertia must not gain from smaller residuals, but of noise and behind gains, see `Loop`.

        Args:
            w: (p,) instants and change of the bodies.
            added: (k, k), or (`POSES`, k, k) for the poses [kg m^2 or kg].
            passed: (k,) what motors pass on of changes of what their drives ask for.
        """
        if self.motion.is_static:  # efforts are measured there, no motion is predicted
            return np.zeros(self.motion.tree.size)
        tree = self.with_bodies(self.poses[0], w).tree
        M = mass_matrix(tree, tree.parameters, self.poses[0].position) + added
        log = log_inertia(M, self._nominal_mass)
        return noisy_volume(self.loop.volume(log, passed, passed), self.noise_part)

    @cached_property
    def _nominal_mass(self) -> np.ndarray:
        return mass_matrix(self.motion.tree, self.motion.tree.parameters, self.poses[0].position)


def make_equations(
    raw: RawTrajectory, tree: Tree, bandwidth: Bandwidth, unstated: Collection[int] = (),
    accuracy: float = 1.0,
) -> Equations:  # fmt: skip
    """Return the equations of a recording; a joint that does not move has rows of zeros.

    Args:
        raw: the recording.
        tree: nominal robot.
        bandwidth: of the filters.
        unstated: bodies that the robot's file leaves open.
        accuracy: of the others, see `Equations`.
    """
    motion = observe(raw, tree, bandwidth)
    low = parallel_filter(raw, bandwidth)
    k = tree.size
    d = low(motion.nominal_effort - motion.effort - motion.stated_force) * motion.moves
    directions = at_one_scale(body_directions(tree, unstated, accuracy), motion)
    m = k if motion.drive is None and not motion.is_static else 0
    bases = tuple(np.zeros((len(d), m + len(directions))) for _ in range(k))
    for rows, out in low.blocks(_BLOCK):
        states = motion.position[rows], motion.velocity[rows], motion.acceleration[rows]
        Y = torque_regressor(tree, *states)
        for j in range(k):
            bases[j][out, m:] = -low.piece(Y[:, j] @ directions.T, out) * motion.moves[j]
    if m:
        late = low(effort_change(motion.effort, motion.starts)) * motion.moves
        for j in range(k):
            bases[j][:, j] = late[:, j]
    inertial = low(motion.mass_diagonal * motion.acceleration)
    inertia = motion.mass_diagonal.mean(axis=0)
    variance = inertia**2 * (2 * np.pi) ** 4 * raw.noise_density * bandwidth.cutoff**5 / 5.0
    noise = noise_beside_laws(measured_noise(raw, motion, bandwidth), d, bases, motion, low)
    loop = Loop.of(motion, bandwidth.cutoff)
    carried = loop.volume(carried_inertia(motion, low, inertial, d))
    power, error = reference_power(motion, inertial, variance)
    error += np.exp(2.0 * carried) * smoothing_error(raw, motion, low, bandwidth)
    equations = Equations(
        motion, low, motion.time[low.rows], d, bases, directions, power, np.sqrt(variance),
        np.ones(motion.position.shape), resting(raw, motion, bandwidth),
        error + noise, part_of_noise(noise, d), noise, carried, loop, instants=m,
        accuracy=accuracy,
    )  # fmt: skip
    return replace(equations.with_dry_friction(motion.dry_joints), free=None)
