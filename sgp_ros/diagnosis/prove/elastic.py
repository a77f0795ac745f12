"""The forward dynamics of a diagnosed model with springs between motors and links.

A motor behind a spring is a coordinate of its own: `J theta'' = u - tau`, and the link keeps the
rest of the nominal inertia, `tau = K (theta - q) + D (theta' - q')`. The states are the positions
of the links, then those of such motors; what is shown is that of the encoder.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np

from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.prove.dynamics import DiagnosedDynamics
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.elasticity import JointElasticity, is_on_motor, twist_of
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.observed_motion import ObservedMotion


@dataclass(frozen=True, eq=False)
class ElasticDynamics(DiagnosedDynamics):
    """Equations of motion of k links and of the motors behind springs.

    Attributes:
        springs: with their numbers.
        kp, kd: (k,) gains of drives on the encoders, see `ServoedDynamics`; 0 without
            [N m/rad, N m s/rad].
    """

    springs: tuple[EffectAt, ...] = ()
    kp: np.ndarray = field(default_factory=lambda: np.zeros(0))
    kd: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(
        cls, dynamics: DiagnosedDynamics, springs: tuple[EffectAt, ...], gains: Gains | None
    ) -> ElasticDynamics:
        """Return dynamics without drives, with springs."""
        none = np.zeros(dynamics.tree.size)
        kp, kd = (none, none) if gains is None else (gains.kp, gains.kd)
        return cls(
            **{f.name: getattr(dynamics, f.name) for f in fields(DiagnosedDynamics)},
            springs=springs, kp=kp, kd=kd,
        )  # fmt: skip

    def started(self, motion: ObservedMotion, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the states at rows of a recording (m,), (m, k + springs) each."""
        seen = replace(motion, tree=self.tree)
        q, v = motion.position[rows], motion.velocity[rows]
        motors = []
        for s in self.springs:
            j = s.place.joint
            twist, rate, _ = (s.shape[1] * x[rows] for x in twist_of(seen, s.place, s.shape))
            if is_on_motor(s.place):
                motors.append((q[:, j].copy(), v[:, j].copy()))
                q[:, j] -= twist
                v[:, j] -= rate
            else:
                motors.append((q[:, j] + twist, v[:, j] + rate))
        return tuple(np.column_stack([x, *(m[i] for m in motors)]) for i, x in enumerate((q, v)))  # type: ignore[return-value]  # two of them

    def shown(self, x: np.ndarray) -> np.ndarray:
        """Return what the encoders show of positions or velocities (..., k + springs)."""
        k = x.shape[-1] - len(self.springs)
        shown = x[..., :k].copy()
        for i, s in enumerate(self.springs):
            if is_on_motor(s.place):
                shown[..., s.place.joint] = x[..., k + i]
        return shown

    def equations(
        self, q: np.ndarray, v: np.ndarray, loads: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return M and the drive of links and motors."""
        k, acting = q.shape[1] - len(self.springs), self._acting(q, v, loads)
        links, drive = super().equations(q[:, :k], v[:, :k], acting)
        M = np.zeros((len(q), q.shape[1], q.shape[1]))
        M[:, :k, :k] = links
        drive = np.column_stack([drive, np.zeros((len(q), len(self.springs)))])
        for i, s in enumerate(self.springs):
            j, motor, (J, compliance, settling) = s.place.joint, k + i, s.shape[:3]
            torque = (q[:, motor] - q[:, j] + settling * (v[:, motor] - v[:, j])) / compliance
            M[:, j, j] -= J
            M[:, motor, motor] = J
            drive[:, j] += torque - acting[:, j]
            drive[:, motor] = acting[:, j] - torque
        return M, drive

    def level_of_dry_friction(self, q: np.ndarray, loads: np.ndarray) -> np.ndarray:
        """Return the levels of the links, and none of the motors."""
        k = q.shape[1] - len(self.springs)
        level = super().level_of_dry_friction(q[:, :k], self._acting(q, np.zeros_like(q), loads))
        return np.column_stack([level, np.zeros((len(q), len(self.springs)))])

    def _acting(self, q: np.ndarray, v: np.ndarray, loads: np.ndarray) -> np.ndarray:
        acting = loads.copy()
        acting[:, : len(self.kp)] -= self.kp * self.shown(q) + self.kd * self.shown(v)
        return acting


def springs_of(model: Model, motion: ObservedMotion) -> tuple[EffectAt, ...]:
    """Return the springs between motors and links of a model, and of the nominal robot."""
    all_ = (*model.effects, *motion.known)
    return tuple(s for s in all_ if isinstance(s.effect, JointElasticity))
