"""A fitted hypothesis: effects with their numbers, bodies, and what they leave."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from sgp_ros.diagnosis.compare.bodies import shrinkage
from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import FLOOR_SHARE, PER_EFFECT, PER_UNUSUAL
from sgp_ros.diagnosis.explain.frame import Frame
from sgp_ros.diagnosis.explain.regression import dry_joints
from sgp_ros.physics.catalogue import EFFECTS, TORQUE_GAIN
from sgp_ros.physics.effect import EMPTY, Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from sgp_ros.robots.observed_motion import ObservedMotion


@dataclass(frozen=True, eq=False)
class Model:
    """A fitted hypothesis.

    Attributes:
        effects: with their places, shapes and coefficients.
        w: (p,) inertial parameters' changes in standard deviations.
        sigma: (k,) root mean square of the residual with its floor.
        inertia: (k,) log of that of its bodies and rotors, see `Equations.inertia`.
        score: log likelihood less penalties [nats].
        residual: (N, k) [N m or N].
        parts: filtered force of each effect, (N, k), or (N,) on its joint.
    """

    effects: tuple[EffectAt, ...]
    w: np.ndarray
    sigma: np.ndarray
    inertia: np.ndarray
    score: float
    residual: np.ndarray
    parts: tuple[np.ndarray, ...]
    frame: Frame = field(repr=False)

    @property
    def log_inertia(self) -> float:
        """Mean of log det(M / M nominal) over the rows in which joints may move."""
        return shown_inertia(self.frame.equations, self.inertia, self.effects)

    @property
    def key(self) -> frozenset[tuple[str, Place]]:
        """Effects and places, without their order."""
        return frozenset(s.key for s in self.effects)

    @property
    def is_free(self) -> bool:
        """Whether inertial parameters may differ from the nominal ones."""
        return self.frame.is_free

    @cached_property
    def strain(self) -> float:
        """Prior that its bodies cost [nats]."""
        equations = self.frame.equations
        bodies = self.w[equations.instants :]
        smaller = shrinkage(equations.directions, equations.motion.tree, bodies)
        return 0.5 * float(self.w @ self.w) + smaller

    @property
    def delivered(self) -> np.ndarray:
        """Logs of what motors deliver of recorded efforts, (k,): of half of one, half can err."""
        return _delivered(self.effects, len(self.inertia))

    @property
    def mean_square(self) -> np.ndarray:
        """Mean squares of the residual, (k,)."""
        return np.asarray((self.residual**2).mean(axis=0))

    @property
    def left(self) -> np.ndarray:
        """Shares of the mean squared efforts that it leaves beyond errors of the signals, (k,)."""
        equations = self.frame.equations
        return np.maximum(self.mean_square - equations.model_error, 0.0) / equations.power

    @property
    def size(self) -> int:
        """Number of fitted parameters of the effects."""
        return sum(
            len(s.shape) + (0 if s.effect.is_given else len(s.coefficients)) for s in self.effects
        )

    @property
    def laws(self) -> int:
        """Number of laws: one of two joints holds its plain ones, waves at one place are one."""
        return sum((not s.is_further_wave) + _extra_laws(s) for s in self.effects)

    @property
    def surprise(self) -> float:
        """Price of numbers that laws seldom have [nats]."""
        return sum(s.effect.surprise(s) for s in self.effects)

    @property
    def law_price(self) -> float:
        """Price of the laws, higher where few joints with a motor have them [nats].

        Laws with a prior on their numbers have paid by that, further waves with the first.
        """
        unusual = sum(
            type(e).surprise is Effect.surprise and not (e.is_open or adds_to_usual(e))
            for e in (s.effect for s in self.effects if not s.is_further_wave)
        )
        unusual *= not self.frame.equations.motion.is_swing
        return PER_EFFECT * self.laws + PER_UNUSUAL * unusual

    @property
    def cost(self) -> float:
        """Price of the freedom of the model [nats]."""
        return price_of(self.frame, self.size)

    @property
    def likelihood(self) -> float:
        """Score before its freedom is paid for [nats]."""
        return self.score + self.cost

    def is_possible(self) -> bool:
        """Return whether every effect has signs and sizes that it can have."""
        motion = self.frame.equations.motion
        return all(s.is_possible(motion) for s in self.effects)

    @property
    def freedom(self) -> int:
        """Number of parameters of effects and bodies that the data determine."""
        return self.size + self.frame.determined

    @property
    def forces(self) -> tuple[np.ndarray, ...]:
        """Filtered force of each effect, (N, k) [N m or N]."""
        return tuple(self._force([i]) for i in range(len(self.parts)))

    @property
    def net_force(self) -> np.ndarray:
        """Filtered force of all effects, (N, k) [N m or N]."""
        return self._force(range(len(self.parts)))

    def _force(self, effects: Iterable[int]) -> np.ndarray:
        force = np.zeros_like(self.residual)
        for i in effects:
            add_force(force, self.effects[i].place.joint, self.parts[i])
        return force

    @property
    def net_share(self) -> float:
        """Share that all effects together have of the mean squared effort, over all joints."""
        net = (self.net_force**2).mean(axis=0)
        return float((net / self.frame.equations.power).sum())

    @property
    def filtered_shares(self) -> list[float]:
        """Greatest shares that the filtered effects have of the mean squared effort of a joint."""
        power = self.frame.equations.power
        pairs = zip(self.effects, self.parts, strict=True)
        own = ((x, power if x.ndim == 2 else power[s.place.joint]) for s, x in pairs)
        return [float(((x**2).mean(axis=0) / size).max()) for x, size in own]

    @cached_property
    def shares(self) -> list[float]:
        """Greatest shares that the effects have of the mean squared effort of a joint.

        Before any filter, as the schema has it, unless an effect follows the acceleration, which
        is mostly noise up there. Of one that couples joints what plain laws do not say counts.
        """
        equations = self.frame.equations
        found = []
        for s, filtered in zip(self.effects, self.filtered_shares, strict=True):
            if s.effect.sees_acceleration and not s.effect.has_memory:
                found.append(filtered)
                continue
            force = s.whole(equations.motion)
            if s.place.source >= 0:
                force = beyond_plain(s, force, equations)
            power = equations.power if force.ndim == 2 else equations.power[s.place.joint]
            found.append(float(((force**2).mean(axis=0) / power).max()))
        return found


def adds_to_usual(law: Effect) -> bool:
    """Return whether nearly every joint with a motor has a law, or the plain one of it."""
    return law.is_usual or any(EFFECTS[name].is_usual for name in law.plain)


def _extra_laws(s: EffectAt) -> int:
    return len(s.effect.plain) * (s.place.source >= 0)


def beyond_plain(s: EffectAt, force: np.ndarray, equations: Equations) -> np.ndarray:
    """Return what plain laws of one joint leave of a force, (n, k) or (n,), while it may move."""
    if not s.effect.plain:
        return force
    left, motion = force.copy(), equations.motion
    for joint in (s.place.joint, s.place.source):
        if joint >= 0:
            moving = equations.moving[:, joint]
            alone = [EFFECTS[n].columns(motion, Place(joint), EMPTY) for n in s.effect.plain]
            x = np.concatenate(alone, axis=1) * moving[:, None]
            own = left if left.ndim == 1 else left[:, joint]
            own *= moving
            own -= x @ np.linalg.lstsq(x, own, rcond=1e-9)[0]
    return left


def first_scale(equations: Equations) -> np.ndarray:
    """Return the scale of the rows of each joint from which models are fitted, (k,) [N m or N]."""
    return np.sqrt((equations.d**2).mean(axis=0) + floors(equations))


def floors(equations: Equations, inertia: np.ndarray | None = None) -> np.ndarray:
    """Return the least variance of a residual, (k,), with this log of inertia or that shown."""
    noise = equations.effort_noise
    whole = FLOOR_SHARE * equations.power + equations.model_error
    beyond = 0.0 if inertia is None else inertia - equations.carried
    return least_variance(whole, noise, beyond) + 1e-300


def _delivered(effects: Iterable[EffectAt], joints: int) -> np.ndarray:
    found = np.zeros(joints)
    for s in effects:
        if s.effect is TORQUE_GAIN:
            found[s.place.joint] += np.log(max(abs(1.0 + float(s.coefficients[0])), 1e-9))
    return found


def shown_inertia(
    equations: Equations, inertia: np.ndarray, effects: Iterable[EffectAt],
    carried: np.ndarray | float | None = None,
) -> float:  # fmt: skip
    """Return the sum of the log of inertias (k,), each over the rows in which its joint may move.

    Where dry friction holds a joint, its motion is the same with any inertia, and predicted no
    worse than by a model that lets it move: there it is what efforts show, `carried` (k,), in the
    unit of efforts that motors deliver. Without dry friction a joint may move in all rows.
    """
    moving = equations.moving.mean(axis=0).clip(min=1e-9)
    held = (equations.carried if carried is None else carried) + _delivered(effects, len(inertia))
    return float((inertia * moving + held * (1.0 - moving)).sum())


def least_variance(whole: np.ndarray, noise: np.ndarray, beyond: np.ndarray | float) -> np.ndarray:
    """Return what a perfect model leaves, (k,), of which the noise of measured efforts is a part.

    Errors of the motion become larger ones of the effort with the inertia, that noise does not.

    Args:
        whole: (k,) what it leaves where it has the inertia that the efforts show.
        noise: (k,) part of it.
        beyond: (k,) log of the inertia of a model relative to that.
    """
    return np.asarray((whole - noise) * np.exp(2.0 * np.maximum(beyond, -50.0)) + noise)


def price_of(frame: Frame, size: int) -> float:
    """Return what the freedom of a model costs [nats]."""
    return 0.5 * size * float(np.log(len(frame.equations.d))) + frame.occam


def extra_force(model: Model, motion: ObservedMotion) -> np.ndarray:
    """Return the force of all effects at the full rate, (n, k) [N m or N]."""
    force = motion.stated_force.copy()
    for s in model.effects:
        add_force(force, s.place.joint, s.columns(motion) @ s.coefficients)
    return force


def add_force(force: np.ndarray, joint: int, part: np.ndarray) -> None:
    """Add to forces (n, k) that of an effect, (n, k), or (n,) on its joint."""
    if part.ndim == 2:
        force += part
    else:
        force[:, joint] += part


def held_joints(model: Model, motion: ObservedMotion) -> frozenset[int]:
    """Return the joints that dry friction may hold, of the model or of the nominal robot."""
    return motion.dry_joints | dry_joints(model.effects)


def imbalance(model: Model, equations: Equations, motion: ObservedMotion) -> np.ndarray:
    """Return what the motion takes beyond the efforts and effects of a model, (n, k) [N m or N].

    `e(a) = tau_nominal(q, v, a) - tau - tau_x - base w` at the full rate, without any filter.

    Args:
        model: fitted on `equations`.
        equations: of the training recording.
        motion: n rows of any recording.
    """
    changed = equations.with_bodies(motion, model.w)
    needed = changed.effort_for(motion.position, motion.velocity, motion.acceleration)
    return np.asarray(needed - motion.effort - extra_force(model, changed))
