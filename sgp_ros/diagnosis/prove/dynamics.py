"""The forward dynamics of a diagnosed model, for many states at once.

Effects without memory, bodies and processes are evaluated at each state. Friction that creeps has
a state of its own, and so answers the simulated motion. The force of other effects that remember
is handed in with the efforts: it belongs to a trajectory, not to a state.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.explain.fitted_model import Model, extra_force
from sgp_ros.diagnosis.explain.in_recording import InRecording
from sgp_ros.diagnosis.locate.remainder import Remainder
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.elasticity import JointElasticity
from sgp_ros.physics.memory import Hysteresis, bristle, deflected
from sgp_ros.rigid.rigid_body import mass_and_bias
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.effect_terms import changed_tree
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.observed_motion import ObservedMotion

_Forces = tuple[Model, tuple[EffectAt, ...]]
"""Effects of a model, and effects that the nominal robot has."""

_SMALL = 1e-6
"""Difference of positions and velocities [rad or m, per second]."""


@dataclass(frozen=True, eq=False)
class DiagnosedDynamics:
    """Equations of motion `M(q) a = drive` of k joints, see `batch.forward.ForcedMotion`.

    The loads are, row by row, the commanded effort (k), the force of effects that
    remember (k), the time since the first state (1), the recording (1), see `ObservedMotion`, and
    where each friction that creeps was last, with its deflection there (2 each).

    Attributes:
        model: effects without memory, but for those in `rigid` and `rotors`.
        tree: with the bodies of the model, as effects see it.
        rigid: the same with the payload and the gravity of the model.
        rotors: (k,) inertias that are added [kg m^2 or kg].
        step: of the recording [s].
        remainders: processes beside the model.
        stated: effects without memory that the nominal robot has, beside those of its tree.
        bristles: friction that creeps, of both.
    """

    model: Model
    tree: Tree
    rigid: Tree
    rotors: np.ndarray
    step: float
    remainders: tuple[Remainder, ...] = ()
    stated: tuple[EffectAt, ...] = ()
    bristles: tuple[EffectAt, ...] = ()

    def equations(
        self, q: np.ndarray, v: np.ndarray, loads: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return M, (m, k, k), and the drive, (m, k) [N m or N].

        The forces of effects are affine in the acceleration: what each unit adds is inertia.

        Args:
            q: (m, k) [rad or m].
            v: (m, k) [rad/s or m/s].
            loads: (m, 2 k + 2 + 2 b) [N m or N, s].
        """
        m, k = q.shape
        still = np.zeros((m, k))
        M, bias = mass_and_bias(self.rigid, self.rigid.parameters, q, v)
        M[:, range(k), range(k)] += self.rotors
        others, stated = self._beside_acceleration
        here = self._motion(q, v, still, loads, stated)
        drive = loads[:, k : 2 * k] + here.effort - (bias + self.tree.damping[:k] * v)
        drive += extra_force(others, here)
        inertial, stated = self._with_acceleration
        if inertial.effects or stated:
            a = np.repeat(np.vstack([np.zeros((1, k)), np.eye(k)]), m, axis=0)
            pushed = self._motion(np.tile(q, (k + 1, 1)), np.tile(v, (k + 1, 1)), a, loads, stated)
            force = extra_force(inertial, pushed).reshape(k + 1, m, k)
            drive += force[0]
            M -= np.moveaxis(force[1:] - force[0], 0, 2)
        for remainder in self.remainders:
            drive[:, remainder.joint] += remainder.force(here)
        for s, z in zip(self.bristles, self._deflections(q, loads), strict=True):
            drive[:, s.place.joint] -= s.coefficients[0] * z
        return M, drive

    def deflected(self, motion: ObservedMotion, rows: np.ndarray) -> np.ndarray:
        """Return where friction that creeps is at rows of a recording (m,), (m, 2 b)."""
        found = [np.zeros((len(rows), 0))]
        for s in self.bristles:
            q = motion.position[:, s.place.joint]
            found.append(np.column_stack([q, bristle(q, float(s.shape[0]))])[rows])
        return np.concatenate(found, axis=1)

    def creeping(self, q: np.ndarray, loads: np.ndarray) -> np.ndarray:
        """Return the loads once states (m, k or more) are reached."""
        if not self.bristles:
            return loads
        after = loads.copy()
        at = after.shape[1] - 2 * len(self.bristles)
        after[:, at::2] = q[:, [s.place.joint for s in self.bristles]]
        after[:, at + 1 :: 2] = np.stack(self._deflections(q, loads), axis=1)
        return after

    def _deflections(self, q: np.ndarray, loads: np.ndarray) -> list[np.ndarray]:
        last = loads[:, loads.shape[1] - 2 * len(self.bristles) :]
        return [
            deflected(last[:, 2 * i + 1], q[:, s.place.joint] - last[:, 2 * i], float(s.shape[0]))
            for i, s in enumerate(self.bristles)
        ]

    @cached_property
    def _with_acceleration(self) -> _Forces:
        return _part(self.model, _sees_acceleration), tuple(
            filter(_sees_acceleration, self.stated)
        )

    @cached_property
    def _beside_acceleration(self) -> _Forces:
        no = _sees_no_acceleration
        return _part(self.model, no), tuple(filter(no, self.stated))

    def started(self, motion: ObservedMotion, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities at rows of a recording (m,), (m, k) each."""
        return motion.position[rows], motion.velocity[rows]

    def shown(self, x: np.ndarray) -> np.ndarray:
        """Return what the encoders show of positions or velocities (..., k)."""
        return x

    def level_of_dry_friction(self, q: np.ndarray, loads: np.ndarray) -> np.ndarray:
        """Return half the jump of each joint's force as its velocity changes sign, (m, k)."""
        level = np.zeros_like(q)
        dry = [x for x in (*self.model.effects, *self.stated) if x.is_holding]
        if dry:
            still = np.zeros_like(q)
            motion = self._motion(q, still, still, loads)
            up, down = motion.sliding(1.0), motion.sliding(-1.0)
            for x in dry:
                jump = 0.5 * (x.columns(down) - x.columns(up)) @ x.coefficients
                if jump.ndim == 2:  # of several joints, which may turn against each other
                    level += np.abs(jump)
                else:
                    level[:, x.place.joint] += jump
        return level

    def fastest_rate(self, q: np.ndarray, v: np.ndarray, loads: np.ndarray) -> float:
        """Return the fastest rate at which a small deviation changes in these states [1/s].

        The largest eigenvalue of the linearised equations, by differences; infinite where these
        have no finite solution, such as of a body without inertia.
        """
        m, k = q.shape
        v = np.where(v == 0.0, _SMALL, v)  # a difference never crosses a reversal
        M, drive = self.equations(q, v, loads)
        if not (np.isfinite(M).all() and np.linalg.det(M).all()):
            return np.inf
        away = np.where(v < 0.0, -1.0, 1.0)
        A = np.zeros((m, 2 * k, 2 * k))
        A[:, :k, k:] = np.eye(k)
        for j in range(k):
            dq, dv = np.zeros_like(q), np.zeros_like(v)
            dq[:, j], dv[:, j] = _SMALL, _SMALL * away[:, j]
            by_q = (self.equations(q + dq, v, loads)[1] - drive) / _SMALL
            by_v = (self.equations(q, v + dv, loads)[1] - drive) / dv[:, j, None]
            slopes = np.stack([by_q, by_v], axis=2)  # (m, k, 2)
            A[:, k:, [j, k + j]] = np.linalg.solve(M, slopes)
        if not np.isfinite(A).all():
            return np.inf
        return float(np.abs(np.linalg.eigvals(A)).max())

    def _motion(
        self,
        q: np.ndarray,
        v: np.ndarray,
        a: np.ndarray,
        loads: np.ndarray,
        stated: tuple[EffectAt, ...] = (),
    ) -> ObservedMotion:
        """Return states as the effects see them; loads are repeated as often as needed."""
        k = q.shape[1]
        given = loads if len(q) == len(loads) else np.tile(loads, (len(q) // len(loads), 1))
        return ObservedMotion(
            self.tree, given[:, 2 * k], self.step, q, v, a, given[:, :k], None, stated=stated,
            recording=given[:, 2 * k + 1], sign=np.sign,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class ServoedDynamics(DiagnosedDynamics):
    """The same under drives; its loads hold efforts for joints at rest at 0, `tau + kp q + kd v`.

    Attributes:
        kp, kd: (k,) gains [N m/rad, N m s/rad].
    """

    kp: np.ndarray = field(default_factory=lambda: np.zeros(0))
    kd: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(cls, dynamics: DiagnosedDynamics, gains: Gains) -> ServoedDynamics:
        """Return dynamics with drives."""
        return cls(
            **{f.name: getattr(dynamics, f.name) for f in fields(DiagnosedDynamics)},
            kp=gains.kp, kd=gains.kd,
        )  # fmt: skip

    def equations(
        self, q: np.ndarray, v: np.ndarray, loads: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return M and the drive with the efforts that the drives give in these states."""
        return super().equations(q, v, self._acting(q, v, loads))

    def level_of_dry_friction(self, q: np.ndarray, loads: np.ndarray) -> np.ndarray:
        """Return half the jump of each joint's force as its velocity changes sign, (m, k)."""
        return super().level_of_dry_friction(q, self._acting(q, np.zeros_like(q), loads))

    def _acting(self, q: np.ndarray, v: np.ndarray, loads: np.ndarray) -> np.ndarray:
        k = q.shape[1]
        acting = loads.copy()
        acting[:, :k] -= self.kp * q + self.kd * v
        return acting


def dynamics_of(
    model: Model,
    equations: Equations,
    motion: ObservedMotion,
    remainders: tuple[Remainder, ...] = (),
) -> DiagnosedDynamics:
    """Return the dynamics of a model fitted on `equations` for the recording of a motion."""
    tree = equations.with_bodies(motion, model.w).tree
    bristles = tuple(filter(_creeps, (*model.effects, *motion.known)))
    rotors, inertial = np.zeros(tree.size), (*model.effects, *motion.known)
    for s in (s for s in inertial if s.effect.is_inertial and _is_always(s)):
        rotors[s.place.joint] += s.coefficients[0]
    return DiagnosedDynamics(
        _part(model, _is_local), tree, changed_tree(tree, [*filter(_is_always, model.effects)]),
        rotors, motion.step,
        remainders, tuple(filter(_is_local, motion.known)), bristles,
    )  # fmt: skip


def remembered_force(model: Model, motion: ObservedMotion, tree: Tree) -> np.ndarray:
    """Return the force of the effects that remember along a motion, (n, k) [N m or N]."""
    stated = tuple(filter(_has_memory, motion.known))
    return extra_force(_part(model, _has_memory), replace(motion, tree=tree, stated=stated))


def remembers(model: Model, motion: ObservedMotion) -> bool:
    """Return whether some effect of a model or of the nominal robot has memory, but no state."""
    return any(map(_has_memory, (*model.effects, *motion.known)))


def _has_memory(s: EffectAt) -> bool:
    """Return whether an effect, or a drive before it, has memory, but no state."""
    has_states = isinstance(s.effect, JointElasticity) or _creeps(s)
    return (s.effect.has_memory or bool(s.before)) and not has_states


def _creeps(s: EffectAt) -> bool:
    return isinstance(s.effect, Hysteresis)


def _is_local(s: EffectAt) -> bool:
    is_rigid = (s.effect.is_on_tree or s.effect.is_inertial) and _is_always(s)
    return not (s.effect.has_memory or s.before or is_rigid)


def _is_always(s: EffectAt) -> bool:
    return not isinstance(s.effect, InRecording)


def _sees_acceleration(s: EffectAt) -> bool:
    return s.effect.sees_acceleration


def _sees_no_acceleration(s: EffectAt) -> bool:
    return not s.effect.sees_acceleration


def _part(model: Model, is_in: Callable[[EffectAt], bool]) -> Model:
    """Return a model of some of the effects."""
    return replace(model, effects=tuple(filter(is_in, model.effects)))
