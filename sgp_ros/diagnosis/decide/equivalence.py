"""Rivals that explain a recording as well as the asserted model, and a motion to separate them.

Two models are told apart by their residuals. Where the likelihoods differ by less than the odds
of one to twenty, the recording prefers neither; only their size does. Such rivals are carried over
to other motions, and the one on which their efforts differ most is the excitation to ask for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import ADEQUATE_REST, ALIKE, CLEARER, LEAST_SHARE, PER_PARAMETER
from sgp_ros.diagnosis.decide.decision import Decision
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.fitted_model import Model, imbalance
from sgp_ros.diagnosis.result import Equivalent
from sgp_ros.physics.drive import Drive
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import joint_name
from sgp_ros.robots.observed_motion import ObservedMotion

MOST = 3
LONGEST = 4000
"""Rows of the recording that are carried over to other motions."""
RECORDED = 'the motion of the recording'
MOTIONS = {
    'a motion over the whole range of the joints': (np.inf, 1.0, 0.0),
    'a motion half as wide': (0.5, 1.0, 0.0),
    'a motion twice as fast': (1.0, 2.0, 0.0),
    'a motion half as fast': (1.0, 0.5, 0.0),
    'the same motion about another position': (1.0, 1.0, 1.5),
}
"""Width and speed relative to the recording, shift of the middle in standard deviations.

A width without bound is what the limits of the joints allow, a turn where there are none.
"""


class Contrasts:
    """How far rivals differ from the asserted model, on the recorded motion and on others.

    The efforts of the asserted model for these motions are computed once.

    Args:
        equations: of the recording.
        asserted: the model to compare with.
    """

    def __init__(self, equations: Equations, asserted: Model) -> None:
        self._equations = equations
        self._asserted = asserted
        self._known: dict[Model, dict[str, float]] = {}

    def of(self, rival: Model) -> dict[str, float]:
        """Return the mean square by which the efforts differ, relative, by motion.

        Summed over joints; `RECORDED` is the motion of the recording.
        """
        if rival not in self._known:
            self._known[rival] = {
                name: self._difference(rival, *there) for name, there in self._motions.items()
            }
        return self._known[rival]

    def is_same_law(self, rival: Model) -> bool:
        """Return whether a rival gives the same efforts on any motion, but for less than physics.

        So does a law with one parameter more whose value makes it the simpler one.
        """
        return max(self.of(rival).values()) < LEAST_SHARE

    def is_longer(self, rival: Model, scale: Scale) -> bool:
        """Return whether a rival is a formula of more numbers that fits no better.

        Every formula has such ones, which differ from it where nothing was seen.
        """
        found = self._asserted
        own, others = (
            {s.key for s in m.effects if not s.effect.has_chosen_form} for m in (found, rival)
        )
        is_alike = own == others and len(own) < len(found.effects) == len(rival.effects)
        gains = scale.fit(rival) - scale.fit(found)
        return is_alike and rival.size > found.size and gains < 0.5 * PER_PARAMETER

    def stands_for(self, rival: Model, effect: EffectAt) -> bool:
        """Return whether an effect of a rival is an asserted one under another name.

        On any motion they differ by less than what an adequate model leaves of what it explains,
        as dry friction and a hysteresis whose presliding nobody can resolve; or it is a richer law
        that on the recorded motion is mostly the asserted one, as friction that drifts a little;
        or it says what several asserted ones do, as friction that differs with direction says what
        Coulomb friction and a constant load do.
        """
        return any(
            self._is_richer(effect, other)
            or self._is_same_force(effect, other)
            or self._is_part(effect, other)
            for other in rival.effects
        )

    def _is_richer(self, effect: EffectAt, other: EffectAt) -> bool:
        if effect.name not in other.effect.plain or effect.place.joint != other.place.joint:
            return False
        motion = self._equations.motion
        x, force = effect.columns(motion), other.force(motion)[:, effect.place.joint]
        left = force - x @ np.linalg.lstsq(x, force, rcond=None)[0]
        return other.place.source < 0 and bool((left**2).sum() < 0.5 * (force**2).sum())

    def _is_same_force(self, effect: EffectAt, other: EffectAt) -> bool:
        for motion, _, _ in self._motions.values():
            force = effect.force(motion)
            apart = ((force - other.force(motion)) ** 2).sum()
            if not apart < ADEQUATE_REST * (force**2).sum():
                return False
        return True

    def _is_part(self, effect: EffectAt, other: EffectAt) -> bool:
        """Return whether asserted laws add up to another one, this one with much the same size."""
        joint, motion = effect.place.joint, self._equations.motion
        own = [s for s in self._asserted.effects if s.place == effect.place]
        if joint < 0 or other.place != effect.place or len(own) < 2:
            return False
        columns = [s.columns(motion) for s in own]
        x = np.concatenate([a if a.ndim == 2 else a[:, joint] for a in columns], axis=1)
        c = np.linalg.lstsq(x, other.force(motion)[:, joint], rcond=1e-9)[0]
        ends = np.cumsum([len(s.coefficients) for s in own])[:-1]
        parts = [replace(s, coefficients=a) for s, a in zip(own, np.split(c, ends), strict=True)]
        part, force = (s.force(motion) for s in (parts[own.index(effect)], effect))
        if not ((part - force) ** 2).sum() < 0.5 * (force**2).sum():
            return False
        for there, _, _ in self._motions.values():
            whole = other.force(there)
            apart = ((whole - sum(s.force(there) for s in parts)) ** 2).sum()
            if not apart < ADEQUATE_REST * (whole**2).sum():
                return False
        return True

    @cached_property
    def _motions(self) -> dict[str, tuple[ObservedMotion, np.ndarray, np.ndarray]]:
        """Motions with the asserted model's imbalance (n, k) and the powers (k,) of efforts."""
        found = {}
        for name, how in {RECORDED: (1.0, 1.0, 0.0), **MOTIONS}.items():
            motion = moved(self._equations.motion, *how)
            driven = motion.tree.is_actuated[: motion.tree.size]
            inertial = motion.mass_diagonal * motion.acceleration
            power = np.where(driven, (motion.effort**2).mean(axis=0), (inertial**2).mean(axis=0))
            lacks = imbalance(self._asserted, self._equations, motion)
            if motion.is_static:  # the nominal robot may need no effort to hold its poses
                power = np.maximum(power, (lacks**2).mean(axis=0))
            found[name] = motion, lacks, power
        return found

    def _difference(
        self, rival: Model, motion: ObservedMotion, asserted: np.ndarray, power: np.ndarray
    ) -> float:
        apart = asserted - imbalance(rival, self._equations, motion)
        share = (apart**2).mean(axis=0) / np.maximum(power, 1e-300)
        return float(share[motion.moves].sum()) + 1e-300


def equivalents(
    equations: Equations, comparison: Comparison, decision: Decision, contrasts: Contrasts
) -> tuple[Equivalent, ...]:
    """Return what the recording cannot tell from the asserted model, best first.

    Laws of a joint with something unknown were refused there; they are in place of nothing.

    Args:
        equations: of the recording.
        comparison: its models.
        decision: `unexplained` has no model to tell anything from.
        contrasts: of the rivals to the asserted model.
    """
    if decision.verdict == 'unexplained':
        return ()
    scale, best = Scale.of(equations, comparison), decision.model
    unlikely = _without_prior(equations, comparison.parameters)
    others = {*decision.rivals, comparison.nominal, comparison.parameters} - {best}
    others = {m for m in others if not any(s.place.joint in decision.unknown for s in m.effects)}
    found: list[Equivalent] = []
    known: list[Model] = [best]
    least = scale.fit(best) - ALIKE
    for rival in (unlikely, *sorted(others, key=scale.worth, reverse=True)):
        if len(found) == MOST:
            break
        prior = rival.strain if rival is unlikely else 0.0
        is_other = not any(_contains(rival, m) for m in known)
        if is_other and scale.fit(rival) + prior > least:
            known.append(rival)
            if not contrasts.is_same_law(rival):
                found.append(_equivalent(equations, rival, contrasts.of(rival)))
    return tuple(found)


def _without_prior(equations: Equations, parameters: Model) -> Model:
    """Return the model of the bodies alone that may differ by any amount.

    Bodies that are unlikely by the prior still explain the recording: a motor that delivers a
    third, or bodies three times as heavy.
    """
    base = equations.base / parameters.sigma[:, None]
    N, k, p = base.shape
    w = np.linalg.lstsq(
        base.reshape(N * k, p), (equations.d / parameters.sigma).ravel(), rcond=1e-6
    )[0]
    inertia = equations.inertia(w, np.zeros((k, k)), np.ones(k))
    return replace(
        parameters, w=w, inertia=inertia,
        residual=equations.d - equations.force_of(w),
    )  # fmt: skip


def _contains(rival: Model, model: Model) -> bool:
    """Return whether a rival is a model with more freedom, which necessarily fits as well."""
    return model.key <= rival.key and (rival.is_free or not model.is_free)


def _equivalent(equations: Equations, rival: Model, contrasts: Mapping[str, float]) -> Equivalent:
    """Return a rival with the motion that would tell it from the asserted model."""
    name = max(MOTIONS, key=lambda n: contrasts[n])
    effects = tuple(
        (joint_name(equations.motion, s.place.joint), s.effect.name) for s in rival.effects
    )
    if contrasts[name] < CLEARER * contrasts[RECORDED]:
        return Equivalent(effects, '', 1.0)
    return Equivalent(effects, name, contrasts[name] / contrasts[RECORDED])


def moved(motion: ObservedMotion, width: float, speed: float, shift: float) -> ObservedMotion:
    """Return a motion like a given one, under the efforts that the nominal robot takes for it.

    `q' = c + shift sd + width (q - c)` about the middle c, run `speed` times as fast.

    Args:
        motion: given; its first stretch without a pause is used.
        width: factor of the amplitudes; infinite for the whole range of the joints.
        speed: factor of the speed.
        shift: of the middle in standard deviations of the position.
    """
    ends = [*motion.starts[1:], len(motion.time)]
    rows = slice(motion.starts[0], min(ends[0], motion.starts[0] + LONGEST))
    q = motion.position[rows]
    middle, wide = q.mean(axis=0), np.full(q.shape[1], width)
    if np.isinf(width):
        middle, wide = _whole_range(motion, q)
    time = (motion.time[rows] - motion.time[rows][0]) / speed
    changed = replace(
        motion, time=time, step=motion.step / speed, starts=(0,), drive=None,
        bandwidth=speed * motion.bandwidth,
        position=middle + shift * q.std(axis=0) + wide * (q - q.mean(axis=0)),
        velocity=wide * speed * motion.velocity[rows],
        acceleration=wide * speed**2 * motion.acceleration[rows],
        effort=np.zeros_like(q),
    )  # fmt: skip
    driven = motion.tree.is_actuated[: motion.tree.size]
    effort = np.where(driven, changed.nominal_effort, 0.0)
    drive = None
    if motion.drive is not None:
        drive = Drive(time, effort, ((0.0, len(time)),), changed.step)
    return replace(changed, effort=effort, drive=drive)


def _whole_range(motion: ObservedMotion, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle of the range of each joint, and how much wider it is than a motion."""
    k = motion.tree.size
    lower, upper = motion.tree.lower[:k], motion.tree.upper[:k]
    is_limited = np.isfinite(lower) & np.isfinite(upper)
    low = np.where(is_limited, lower, q.mean(axis=0) - np.pi)
    high = np.where(is_limited, upper, q.mean(axis=0) + np.pi)
    wide = np.where(motion.moves, (high - low) / np.maximum(np.ptp(q, axis=0), 1e-12), 1.0)
    return 0.5 * (low + high), np.maximum(wide, 1.0)
