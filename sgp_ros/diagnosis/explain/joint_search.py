"""Selection of effects joint by joint, for robots that lack several at every joint.

Bodies are shared by all joints. The effects of one joint after the other are chosen beside those
of all others (block-coordinate descent): the one that promises most is added as long as that is
worth its price, then whatever is not, or no longer, is taken out or replaced by a simpler law.
Candidates are screened for each joint in its own units, so that a light wrist is never ranked
against a shoulder. Sweeps end when one changes nothing; a joint fit of all effects and bodies
follows.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.batch.least_squares import correlation_factor
from sgp_ros.diagnosis.criteria import (
    COUNTED_SHARE,
    INDEPENDENT_ROWS,
    PER_EFFECT,
    PER_PARAMETER,
    SLIGHT_REST,
)
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import Model, beyond_plain
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import WIDEST, Trial, are_apart, screen
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import JOINT, MOTOR, PLACES, Place
from sgp_ros.robots.observed_motion import ObservedMotion

SWEEPS = 4
"""Most sweeps over the joints."""
TRIALS = 3
"""Screened candidates that are fitted."""


def gain(trial: Model, model: Model, *, is_whole: bool = True) -> float:
    """Return what a trial is worth more than a model of the same recording [nats].

    The log likelihood, less the prices of effects and parameters. Rows that are correlated in
    time count as fewer, joint by joint, and never as more than `INDEPENDENT_ROWS`. What is missing
    is correlated too: only the model that leaves less tells how much, and only once all is there.

    Args:
        trial: to compare.
        model: with it.
        is_whole: whether all that there is may be in one of them; else no row counts as fewer.
    """
    of = trial if np.log(trial.sigma).sum() < np.log(model.sigma).sum() else model
    factors = np.array([correlation_factor(r) if is_whole else 1.0 for r in of.residual.T])  # (k,)
    rows = np.minimum(len(of.residual) / factors, INDEPENDENT_ROWS)
    prior = 0.5 * float(model.w @ model.w - trial.w @ trial.w)
    inertia = float(rows.mean()) * (trial.log_inertia - model.log_inertia)
    price = PER_EFFECT * (trial.laws - model.laws)
    price += PER_PARAMETER * (trial.size - model.size)
    return float(rows @ np.log(model.sigma / trial.sigma)) + inertia + prior - price


@dataclass(frozen=True, eq=False)
class _Block:
    """What is chosen together: the laws of one joint, or those of no joint.

    Attributes:
        effects: laws.
        joints: indices of places; None for all.
    """

    effects: tuple[Effect, ...]
    joints: tuple[int, ...] | None

    def holds(self, candidate: EffectAt) -> bool:
        """Return whether a candidate belongs to it."""
        is_here = self.joints is None or candidate.place.joint in self.joints
        return is_here and candidate.effect in self.effects

    def left(self, model: Model) -> float:
        """Return the greatest share of the mean squared effort that a model leaves here."""
        share = model.mean_square / model.frame.equations.power
        return float(share[list(self.joints)].max() if self.joints else share.max())


def by_joint(columns: Columns, model: Model) -> list[Model]:
    """Return the model that a search joint by joint ends with, and its rivals of one change.

    Args:
        columns: of the recording.
        model: to start from; its freedom of the bodies is kept.
    """
    start = model
    for _ in range(SWEEPS):
        before = model.key
        for block in _blocks(model):
            model = _shrunk(columns, _grown(columns, model, block), block)
        if model.key == before:
            break
    if model is start:
        return []
    model = fit(columns, model.effects, model.sigma, is_free=model.is_free, w=model.w, rounds=2,
                steps=6)  # fmt: skip
    rivals = [t for block in _blocks(model) for t in _changes(columns, model, block)]
    return [m for m in (model, *rivals) if m.effects and is_credible(m)]


def _blocks(model: Model) -> Iterator[_Block]:
    laws = model.frame.equations.motion.catalogue.values()
    own = tuple(e for e in laws if e.site in {JOINT, MOTOR})
    joints = np.flatnonzero(model.frame.equations.motion.moves)
    yield from (_Block((*own,), (int(j),)) for j in joints)
    yield _Block(tuple(e for e in laws if e not in own), None)


def _arranged(model: Model, block: _Block, dropped: EffectAt | None = None) -> _Arranged:
    kept = [s for s in model.effects if s is not dropped]
    others = [s for s in kept if not block.holds(s)]
    return tuple(others) + tuple(s for s in kept if block.holds(s)), len(others)


_Arranged = tuple[tuple[EffectAt, ...], int]
"""Effects, those of a block last, and the number of the others."""


def _fitted(columns: Columns, model: Model, arranged: _Arranged, *more: EffectAt) -> Model:
    """Return a model with other effects, in which those of other blocks keep their shapes."""
    effects, still = arranged
    return fit(columns, (*effects, *more), model.sigma, is_free=model.is_free, w=model.w,
               rounds=2, steps=4, still=still)  # fmt: skip


def _best(model: Model, trials: Iterable[Model], *, is_whole: bool = True) -> Model | None:
    """Return the trial that is worth most, if it is worth more than the model."""
    gains = {t: gain(t, model, is_whole=is_whole) for t in trials if is_credible(t)}
    best = max(gains, key=lambda t: gains[t], default=None)
    return best if best is not None and gains[best] > 0.0 else None


def is_credible(model: Model) -> bool:
    """Return whether all effects have signs, sizes and regions that they can have."""
    motion = model.frame.equations.motion
    is_finite = model.is_possible() and bool(np.isfinite(model.score))
    is_finite = is_finite and are_apart(model.effects, motion)
    power = model.frame.equations.power
    return is_finite and all(
        _is_confined(s, motion) and _is_needed(s, motion, power) for s in model.effects
    )


def _is_needed(s: EffectAt, motion: ObservedMotion, power: np.ndarray) -> bool:
    """Return whether plain laws would leave more of a law than is adequate in any case.

    Not so one whose shape is at its lower bound: there it is one of them.
    """
    if not s.effect.plain or s.place.source >= 0:
        return True
    if s.is_least(motion):
        return False
    left = beyond_plain(s, s.columns(motion) @ s.coefficients, motion)
    return float((left**2).mean()) > SLIGHT_REST * float(power[s.place.joint])


def _is_confined(s: EffectAt, motion: ObservedMotion) -> bool:
    """Return whether an effect of a region of positions has one: a stop everywhere is a spring."""
    inside = s.effect.interval(s, motion)
    if inside is None or inside[0] != 'position':
        return True
    q = motion.wrapped[:, s.place.joint]
    return float(sum(((q >= a) & (q <= b)).mean() for a, b in inside[1])) < WIDEST


def _grown(columns: Columns, model: Model, block: _Block) -> Model:
    """Add the effects of a block that are worth their price, as long as something is left."""
    while block.left(model) > COUNTED_SHARE:
        found = _distinct(screen(columns, model, block.effects, block.joints), TRIALS)
        arranged = _arranged(model, block)
        trials = [_fitted(columns, model, arranged, s) for s in found]
        large = [t for t in trials if t.shares[-1] > COUNTED_SHARE]
        better = _best(model, large, is_whole=False)
        if better is None:
            break
        model = better
    return model


def _shrunk(columns: Columns, model: Model, block: _Block) -> Model:
    """Take out, or replace by a law of one number, what is not worth its price."""
    while any(block.holds(s) for s in model.effects):
        better = _best(model, _changes(columns, model, block, is_simple=True))
        if better is None:
            break
        model = better
    return model


def _changes(
    columns: Columns, model: Model, block: _Block, *, is_simple: bool = False
) -> Iterator[Model]:
    """Yield the model without each effect of a block, and with the best other law in its place.

    Of simple ones, a law of one number stands for one of several.
    """
    for s in model.effects:
        if not block.holds(s):
            continue
        arranged = _arranged(model, block, s)
        without = _fitted(columns, model, arranged)
        yield without
        if s.effect.plain:
            yield from uncoupled(columns, without, s)
        others = [e for e in block.effects if e is not s.effect and not (
            is_simple and (len(e.quantities) > 1 or e.shape_names()))]  # fmt: skip
        is_richer = len(s.effect.quantities) > 1
        if others and (is_richer or not is_simple):
            joints = (s.place.joint,) if s.place.joint not in PLACES.values() else block.joints
            found = _distinct(screen(columns, without, others, joints), 1)
            yield from (_fitted(columns, model, arranged, other) for other in found)


def uncoupled(columns: Columns, without: Model, coupled: EffectAt) -> Iterator[Model]:
    """Yield models with the plain laws of each joint in place of one that couples or drifts.

    Of two joints on one, on the other, on both; laws that drive, or are too small, are left out.
    """
    place = coupled.place
    both = (place.joint, place.source)
    for joints in ((place.joint,), (place.source,), both) if place.source >= 0 else (both[:1],):
        alone = [EffectAt(EFFECTS[n], Place(j)) for j in joints for n in coupled.effect.plain]
        alone = [s for s in alone if s.key not in without.key]
        motion = without.frame.equations.motion
        while alone:
            trial = _fitted(columns, without, (without.effects, len(without.effects)), *alone)
            own = list(zip(trial.effects, trial.shares, strict=True))[-len(alone) :]
            kept = [EffectAt(s.effect, s.place) for s, share in own
                    if s.is_possible(motion) and share > COUNTED_SHARE]  # fmt: skip
            if len(kept) == len(alone):
                yield trial
                break
            alone = kept


def _distinct(found: Sequence[Trial], count: int) -> list[EffectAt]:
    """Return the best shape of each of the best `count` effects at places."""
    best: dict[object, EffectAt] = {}
    for _, candidate in found:
        best.setdefault(candidate.key, candidate)
    return list(best.values())[:count]
