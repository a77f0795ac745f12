"""Growth of a model by the effects of one joint, beside those of all others.

Bodies are shared by all joints. The effect of a joint that promises most is added as long as that
is worth its price. Candidates are screened for each joint in its own units, so that a light wrist
is never ranked against a shoulder.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from sgp_ros.diagnosis.criteria import ADEQUATE_REST, COUNTED_SHARE, PER_EFFECT, SLIGHT_REST
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.credibility import (
    gain,
    is_credible,
    is_needed,
    nominal_share,
    slight_rest,
)
from sgp_ros.diagnosis.explain.fitted_model import Model, adds_to_usual
from sgp_ros.diagnosis.explain.regression import Columns, dry_joints
from sgp_ros.diagnosis.explain.screening import distinct, screen
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import JOINT, MOTOR, PLACES

_MOVED = 2
"""Other places at which a law is tried in place of its own."""

AHEAD = 2
"""Candidates that are taken for as long as a second one beside them is looked for."""
TRIALS, MOST_TRIALS = 3, 12
"""Screened candidates that are fitted; at most, with drives that take the command away."""


@dataclass(frozen=True, eq=False)
class Block:
    """Laws that are chosen together: those of one joint, or those of no joint.

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

    def is_open(self, model: Model) -> bool:
        """Return whether it is a joint of which much of the discrepancy is left."""
        if self.joints is None:
            return False
        adequate = ADEQUATE_REST * nominal_share(model.frame.equations)
        is_open = model.left > np.maximum(COUNTED_SHARE, adequate)
        return bool(is_open[list(self.joints)].any())

    def is_slight(self, model: Model) -> bool:
        """Return whether what a model leaves here is slight."""
        if self.joints is None:
            return self.left(model) < SLIGHT_REST
        return bool((model.left < slight_rest(model.frame.equations))[list(self.joints)].all())

    def left(self, model: Model) -> float:
        """Return the greatest share of the mean squared effort that a model leaves here."""
        return float((model.left[list(self.joints)] if self.joints else model.left).max())


def blocks_of(model: Model) -> Iterator[Block]:
    """Yield the laws of each joint that moves, then those of no joint."""
    laws = model.frame.equations.motion.catalogue.values()
    own = tuple(e for e in laws if e.site in {JOINT, MOTOR})
    joints = np.flatnonzero(model.frame.equations.motion.moves)
    yield from (Block((*own,), (int(j),)) for j in joints)
    yield Block(tuple(e for e in laws if e not in own), None)


def arrangement(model: Model, block: Block, dropped: EffectAt | None = None) -> Arranged:
    """Return the effects of a model but one, those of a block last."""
    kept = [s for s in model.effects if s is not dropped]
    others = [s for s in kept if not block.holds(s)]
    return tuple(others) + tuple(s for s in kept if block.holds(s)), len(others)


Arranged = tuple[tuple[EffectAt, ...], int]
"""Effects, those of a block last, and the number of the others."""


def refitted(columns: Columns, model: Model, arranged: Arranged, *more: EffectAt) -> Model:
    """Return a model with other effects, in which those of other blocks keep their shapes.

    Laws of the block that were richer because of one that went, such as friction that differed
    with direction in place of a torque constant, become plain.
    """

    def fitted(effects: tuple[EffectAt, ...]) -> Model:
        return fit(columns, effects, model.sigma, is_free=model.is_free, w=model.w, rounds=2,
                   steps=4, still=still)  # fmt: skip

    effects, still = arranged
    trial = fitted((*effects, *more))
    equations = trial.frame.equations
    vain = [s for s in trial.effects[still : len(effects)]
            if not s.place.kind and not is_needed(s, equations)]  # fmt: skip
    if not vain:
        return trial
    rest = tuple(s for s in trial.effects if s not in vain)
    plain = (EffectAt(EFFECTS[s.effect.plain[0]], s.place) for s in vain)
    return fitted((*rest, *(s for s in plain if all(s.key != o.key for o in rest))))


def best_of(model: Model, trials: Iterable[Model], *, is_whole: bool = True) -> Model | None:
    """Return the trial that is worth most, if it is worth more than the model."""
    gains = {t: gain(t, model, is_whole=is_whole) for t in trials if is_credible(t)}
    best = max(gains, key=lambda t: gains[t], default=None)
    return best if best is not None and gains[best] > 0.0 else None


def crossed(columns: Columns, model: Model, others: Iterable[Model]) -> Model:
    """Return a model with laws of a joint as another one has them, where that is worth more.

    A search joint by joint ends at the best model near its start. Of two such models one may
    describe one joint better, and one another joint.
    """
    for block in blocks_of(model):
        kept, still = arrangement(model, block)
        own = {s.key for s in kept[still:]}
        found = [tuple(s for s in other.effects if block.holds(s)) for other in others]
        unique = {frozenset(s.key for s in laws): laws for laws in found}
        trials = [refitted(columns, model, (kept[:still], still), *laws)
                  for keys, laws in unique.items() if keys != own]  # fmt: skip
        model = best_of(model, trials) or model
    return model


def _tried(columns: Columns, model: Model, block: Block, found: list[EffectAt]) -> list[Model]:
    """Return the models with each of the best candidates.

    Laws that take the command away, where the bodies may vanish too, promise most and say nothing:
    they take no other candidate's turn.
    """
    arranged, trials, turns = arrangement(model, block), list[Model](), 0
    for s in found[:MOST_TRIALS]:
        trials.append(refitted(columns, model, arranged, s))
        turns += not _takes_commands(model, s) or is_credible(trials[-1])
        if turns == TRIALS:
            break
    return trials


def _takes_commands(model: Model, s: EffectAt) -> bool:
    return model.frame.equations.motion.drive is not None and s.effect.stage > 0


def grown(columns: Columns, model: Model, block: Block) -> Model:
    """Add the effects of a block that are worth their price, as long as something is left.

    That is a residual, or bodies so unlikely that they may imitate the missing physics; then a law
    must make them likelier. Laws that nearly every joint has, or that add to these, may be small
    and are sought in any residual that is not slight.
    """
    while True:
        trials = _counted(columns, model, block)
        better = best_of(model, trials, is_whole=False)
        if better is None or gain(better, model, is_whole=False) < PER_EFFECT:
            two = _with_two(columns, model, block, trials)
            better = best_of(model, two if better is None else [better, *two], is_whole=False)
        if better is None:
            return model
        model = better


def grown_at(columns: Columns, model: Model, joints: set[int]) -> Model:
    """Add the effects of some joints that are worth their price."""
    for block in blocks_of(model):
        if joints & set(block.joints or ()):
            model = grown(columns, model, block)
    return model


def _counted(columns: Columns, model: Model, block: Block) -> list[Model]:
    """Return the models with each of the best candidates that are large enough to count."""
    left, strain = block.left(model), model.strain
    laws = block.effects
    if left < COUNTED_SHARE and strain < PER_EFFECT:
        laws = tuple(e for e in laws if adds_to_usual(e))
    if not laws or (block.is_slight(model) and strain < PER_EFFECT):
        return []
    trials = _tried(columns, model, block, distinct(screen(columns, model, laws, block.joints)))
    if left < COUNTED_SHARE:
        trials = [t for t in trials if adds_to_usual(t.effects[-1].effect)
                  or strain - t.strain > PER_EFFECT]  # fmt: skip
    return [t for t in trials if t.shares[-1] > COUNTED_SHARE or t.effects[-1].effect.is_usual]


def _with_two(
    columns: Columns, model: Model, block: Block, trials: Iterable[Model]
) -> list[Model]:
    """Return the models with two effects of a joint of which much is left.

    A law explains little while a larger one hides what it does. So the best candidates are taken,
    though they are hardly worth their price, for as long as a second one is looked for.
    """
    if not block.is_open(model):
        return []
    ranked = sorted(filter(is_credible, trials), key=lambda t: -gain(t, model, is_whole=False))
    return [t for first in ranked[:AHEAD] for t in _counted(columns, first, block)]


def elsewhere(columns: Columns, model: Model) -> Iterator[Model]:
    """Yield models with a law that moves masses of its own at another joint than where it is.

    An elastic joint, or play, moves all others, too: there it imitates itself.
    """
    laws = (s for s in model.effects if s.effect.has_memory and s.effect.uses_bodies)
    for s in (s for s in laws if s.effect.site in {JOINT, MOTOR}):
        arranged = arrangement(model, Block((), None), s)
        base = refitted(columns, model, arranged)
        found = distinct(screen(columns, base, [s.effect]))
        others = [x for x in found if x.place.joint != s.place.joint]
        yield from (refitted(columns, base, arranged, x) for x in others[:_MOVED])


def in_common(columns: Columns, model: Model) -> Iterator[Model]:
    """Yield a model with one law of all motors in place of those that are late at single ones.

    A clock or a bus makes all late. Where friction hides much of that, a joint alone takes a part
    of it for a lag, and none would give that up for a delay of its own.
    """
    motion = model.frame.equations.motion
    late = [s for s in model.effects if s.effect.stage and s.effect.quantities[0].unit == 's'
            and s.place.joint >= 0]  # fmt: skip
    if not late:
        return
    laws = [e for e in motion.catalogue.values() if e.takes_all]
    kept = tuple(s for s in model.effects if s not in late)
    without = refitted(columns, model, (kept, len(kept)))
    found = [x for x in screen(columns, without, laws) if x[1].place.joint == PLACES['all']]
    for s in distinct(found, 1):
        trial = refitted(columns, without, (kept, len(kept)), s)
        may = tuple(x for x in trial.effects if x.is_possible(motion))
        if len(may) < len(trial.effects):  # they made up for a part of it
            trial = refitted(columns, trial, (may, len(may)))
        yield grown_at(columns, trial, {*range(motion.tree.size)})


def two_for_one(columns: Columns, model: Model) -> Iterator[Model]:
    """Yield models with two laws of a joint's speed in place of the only one of its friction.

    Where that is not dry: one law alone may imitate dry friction and another one, and is better
    than either.
    """
    dry = dry_joints(model.effects)
    for block in blocks_of(model):
        laws = tuple(e for e in block.effects if block.joints and e.drawn_over == 'velocity')
        own = [s for s in model.effects if block.holds(s) and s.effect in laws]
        if len(own) != 1 or own[0].place.joint in dry or block.left(model) < SLIGHT_REST:
            continue
        (s,) = own
        without = refitted(columns, model, arrangement(model, block, s))
        laws = tuple(e for e in laws if e is not s.effect and s.name not in e.plain)
        others = Block(laws, block.joints)
        yield from _with_two(columns, without, others, _counted(columns, without, others))
