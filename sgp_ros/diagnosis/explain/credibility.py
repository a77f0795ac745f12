"""Credibility of a fitted model: its gain over another, and whether its laws are what they say."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from sgp_ros.batch.least_squares import correlation_factor
from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import (
    ADEQUATE_REST,
    COUNTED_SHARE,
    INDEPENDENT_ROWS,
    MOST_OPPOSED,
    NEARLY,
    PER_PARAMETER,
    SLIGHT_REST,
)
from sgp_ros.diagnosis.explain.fitted_model import Model, add_force, beyond_plain
from sgp_ros.diagnosis.explain.screening import WIDEST, are_apart
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.motor_beside import has_rotor
from sgp_ros.physics.place import MOTOR
from sgp_ros.robots.observed_motion import ObservedMotion

_SAME = 0.01
"""Relative difference of rests of models that are the same one, found twice [1]."""
_MANY = 20.0
"""Whole waves that are more than a wave of three numbers could follow by chance."""


def gain(trial: Model, model: Model, *, is_whole: bool = True) -> float:
    """Return what a trial is worth more than a model of the same recording [nats].

    The log likelihood, less the prices of effects and parameters. Rows that are correlated in
    time count as fewer, joint by joint, and never as more than `INDEPENDENT_ROWS`; by how much
    depends on how fast that changes by which the models differ. Missing physics is correlated too;
    only the model with the smaller residual shows how much, and only once it is complete.

    Args:
        trial: to compare.
        model: with it.
        is_whole: whether all that there is may be in one of them; else no row counts as fewer.
    """
    of = trial if np.log(trial.sigma).sum() < np.log(model.sigma).sum() else model
    apart = (trial.residual - model.residual).T
    factors = np.array([correlation_factor(r, x) if is_whole else 1.0
                        for r, x in zip(of.residual.T, apart, strict=True)])  # (k,)  # fmt: skip
    rows = np.minimum(len(of.residual) / factors, INDEPENDENT_ROWS)
    prior = model.strain + model.surprise - trial.strain - trial.surprise
    inertia = float(rows.mean()) * (trial.log_inertia - model.log_inertia)
    price = trial.law_price - model.law_price + PER_PARAMETER * (trial.size - model.size)
    return float(rows @ np.log(model.sigma / trial.sigma)) + inertia + prior - price


def is_credible(model: Model) -> bool:
    """Return whether all effects have signs, sizes and regions that they can have together."""
    motion = model.frame.equations.motion
    is_finite = model.is_possible() and bool(np.isfinite(model.score))
    is_finite = is_finite and are_apart(model.effects, motion) and is_sound(model)
    is_finite = is_finite and _delivers(model)
    is_finite = is_finite and all(has_rotor(s.place, model.effects) for s in model.effects)
    equations = model.frame.equations
    return is_finite and all(
        s.effect.is_inside(s, motion)
        and _is_confined(s, motion)
        and is_needed(s, equations)
        and shows_waves(s, equations)
        for s in model.effects
    )


def is_sound(model: Model) -> bool:
    """Return whether effects do not merely cancel each other, or the bodies."""
    equations = model.frame.equations
    nominal = float(nominal_share(equations).sum())
    there = max(min(model.net_share, nominal), 1e-12)
    return sum(model.filtered_shares) < MOST_OPPOSED * there


def _delivers(model: Model) -> bool:
    """Return whether motors deliver more of each command than counts as physics at all.

    A law that takes nearly all of a command away leaves the motion as unexplained as it was: the
    command is in another unit.
    """
    laws = [s.place.joint for s in model.effects if s.effect.site == MOTOR and s.place.joint >= 0]
    return not laws or bool((acting_share(model) > COUNTED_SHARE)[laws].all())


def acting_share(model: Model) -> np.ndarray:
    """Return what motors deliver of what is asked for while joints may move, (k,) mean squares."""
    asked = model.frame.equations.effort
    acting = asked.copy()
    for s, part in zip(model.effects, model.parts, strict=True):
        if s.effect.site == MOTOR:
            add_force(acting, s.place.joint, part)
    given, wanted = ((x**2).mean(axis=0) for x in (acting, asked))
    return np.asarray(np.divide(given, wanted, out=np.ones_like(given), where=wanted > 0.0))


def is_needed(s: EffectAt, equations: Equations) -> bool:
    """Return whether plain laws would leave more of a law than any adequate model may.

    A law with its shape at the lower bound is not needed: there it is a plain law.
    """
    if not s.effect.plain or s.place.source >= 0:
        return True
    if s.is_least(equations.motion):
        return False
    left = beyond_plain(s, s.columns(equations.motion) @ s.coefficients, equations)
    j = s.place.joint
    return float((left**2).mean()) > float(slight_rest(equations)[j] * equations.power[j])


def nominal_share(equations: Equations) -> np.ndarray:
    """Return the share of each effort that the nominal robot leaves, (k,)."""
    return np.asarray((equations.d**2).mean(axis=0) / equations.power)


def slight_rest(equations: Equations) -> np.ndarray:
    """Return the share of each effort that is slight beside what the nominal robot leaves, (k,).

    No more than an adequate model may leave of that, where it counts as physics at all.
    """
    nominal = nominal_share(equations)
    adequate = np.minimum(ADEQUATE_REST * nominal, SLIGHT_REST)
    return np.where(nominal > COUNTED_SHARE, adequate, SLIGHT_REST)


def shows_waves(s: EffectAt, equations: Equations) -> bool:
    """Return whether a ripple is seen over whole waves, wherever it is seen.

    A short wave passes the filter only where the joint turns back. There it is one number for each
    place, and would explain whatever else happens at rest; unless it turns back in so many places
    that they see all parts of the wave many times. The way and the visits are weighted by the
    power that passes.
    """
    wave = s.effect.wave(equations.motion, s.place)
    if wave is None:
        return True
    angle = s.shape[0] * wave.phase
    x = equations.compact(
        np.column_stack([np.cos(angle), np.sin(angle)]), s.place.joint, is_inertial=False
    )
    z = x[:, 0] + 1j * x[:, 1]
    power = np.abs(z) ** 2
    turned = np.abs(np.angle(z[1:] * np.conj(z[:-1])))
    waves = float((np.minimum(power[1:], power[:-1]) * turned).sum()) / (2.0 * np.pi)
    visits = 0.5 * float(np.abs(np.diff(power)).sum())
    is_spread = abs((np.abs(z) * z).sum()) < NEARLY * power.sum()
    return waves >= visits or (waves > _MANY and is_spread)


def _is_confined(s: EffectAt, motion: ObservedMotion) -> bool:
    """Return whether an effect of a region of positions has one: a stop everywhere is a spring."""
    inside = s.effect.interval(s, motion)
    if inside is None or inside[0] != 'position':
        return True
    q = motion.wrapped[:, s.place.joint]
    return float(sum(((q >= a) & (q <= b)).mean() for a, b in inside[1])) < WIDEST


def trace(model: Model) -> tuple[object, ...]:
    """Return laws, freedom and rest of a model, by which two searches know that they have met."""
    rest = np.round(np.log(model.sigma) / _SAME)
    return model.key, model.is_free, *rest.tolist()


def ranked(models: Iterable[Model]) -> list[Model]:
    """Return the models that are possible, the better of those that are alike, best first."""
    best: dict[object, Model] = {}
    for model in models:
        if not model.is_possible() or not np.isfinite(model.score):
            continue
        key = model.key, model.is_free
        if key not in best or model.score > best[key].score:
            best[key] = model
    return sorted(best.values(), key=lambda model: -model.score)
