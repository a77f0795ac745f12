"""Selection of effects joint by joint, for robots that lack several at every joint.

The effects of one joint after the other are chosen beside those of all others (block-coordinate
descent): what is worth its price is added, see `growth`, then whatever is not, or no longer, is
taken out or replaced by a simpler law. Sweeps end when one changes nothing; a joint fit of all
effects and bodies follows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from sgp_ros.diagnosis.compare.settled import shows
from sgp_ros.diagnosis.criteria import COUNTED_SHARE, EVIDENCE, SLIGHT_REST
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.credibility import acting_share, gain, is_credible, trace
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.growth import (
    Block,
    arrangement,
    best_of,
    blocks_of,
    elsewhere,
    grown,
    grown_at,
    in_common,
    refitted,
    two_for_one,
)
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import distinct, may_be_two, screen
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt, one_of_each
from sgp_ros.physics.place import PLACES, Place

SWEEPS = 4
"""Most sweeps over the joints."""
_RATIOS = np.array([[1.0], [-1.0]])
"""Ratios of a differential of equal gears, from which those of any are searched."""
_BUILT_UP = 0.3
"""Way over which friction builds up in a gear, of the shortest one that is looked for alone."""


def by_joint(columns: Columns, model: Model) -> list[Model]:
    """Return the model that a search joint by joint ends with, and its rivals of one change.

    Searches from several starts meet: a joint at which a model was looked at in vain is not looked
    at again, and nothing is returned where another search ended with the same model.

    Args:
        columns: of the recording.
        model: to start from; its freedom of the bodies is kept.
    """
    start = model
    for _ in range(SWEEPS):
        before = model.key
        for block in blocks_of(model):
            asked = block.joints, trace(model)
            if asked not in columns.settled:
                found = _shrunk(columns, grown(columns, model, block), block)
                if found is model:
                    columns.settled.add(asked)
                model = found
        if model.key == before:
            if trace(model) in columns.settled:
                return []
            columns.settled.add(trace(model))
            others = (coupled, two_for_one, elsewhere, in_common)
            better = best_of(model, (t for trials in others for t in trials(columns, model)))
            if better is None:
                break
            model = better
    if model is start and len(model.effects) <= 2:
        return []
    effects = one_of_each(model.effects)
    model = fit(columns, effects, model.sigma, is_free=model.is_free, w=model.w, rounds=2,
                steps=6)  # fmt: skip
    rivals = [t for block in blocks_of(model) for t in _changes(columns, model, block)]
    return [m for m in (model, large(columns, model), *rivals) if m.effects and is_credible(m)]


def large(columns: Columns, model: Model) -> Model:
    """Return a model without its rare laws that turned out too small beside the others."""
    while True:
        seen = zip(model.effects, model.shares, model.filtered_shares, strict=True)
        small = [s for s, share, filtered in seen if not s.effect.is_usual
                 and (share <= COUNTED_SHARE or filtered <= SLIGHT_REST)]  # fmt: skip
        if not small:
            return model
        model = refitted(columns, model, arrangement(model, Block((), None), small[-1]))


def usual(
    columns: Columns, base: Model, first: tuple[EffectAt, ...] = (), least: float = COUNTED_SHARE
) -> Model:
    """Return the model with the laws that nearly every joint has, where they can be seen.

    A search that starts from nothing would first add the law that best imitates all of them.

    Args:
        columns: of the recording.
        base: without effects.
        first: effects beside them, each in the place of its plain law.
        least: share of the mean squared effort that each must have; of the effort that the motor
            delivers, where a late one asks for more.
    """
    motion = base.frame.equations.motion
    held = {(name, s.place.joint) for s in first for name in (s.name, *s.effect.plain[:1])}
    effects = first + tuple(
        EffectAt(law, place)
        for law in EFFECTS.values()
        if law.is_usual
        for place in law.places(motion)
        if motion.moves[place.joint] and shows(law, place, motion)
        and (law.name, place.joint) not in held
    )  # fmt: skip
    while True:
        model = fit(columns, effects, base.sigma, is_free=base.is_free, w=base.w)
        pairs = list(zip(model.effects, model.filtered_shares, strict=True))
        kept = [s for s, _ in pairs if s.is_possible(motion)]
        if len(kept) == len(pairs):
            seen = np.minimum(acting_share(model), 1.0)
            kept = [s for s, x in pairs if x > least * (s.place.joint < 0 or seen[s.place.joint])]
        if len(kept) == len(pairs):
            return model
        effects = tuple(EffectAt(s.effect, s.place, s.shape) for s in kept)


def built_up(columns: Columns, model: Model) -> Model:
    """Return the model with dry friction that builds up at every joint, as it does in gears.

    At one joint after the other another law would first imitate it: a play, a lag, a delay.
    """
    motion = model.frame.equations.motion
    (law,) = (e for e in _richer_laws(model) if e.has_memory)
    return _swapped(columns, model, lambda place: EffectAt(
        law, place, _BUILT_UP * law.starts(motion, place)[0]), law.plain)  # fmt: skip


def richer(columns: Columns, model: Model) -> Iterator[Model]:
    """Yield a model with a richer law in place of the plain one of every joint, as far as needed.

    Such as friction that differs with direction. Bodies that may differ imitate those of all
    joints together, and none alone is worth more beside such bodies.
    """
    for law in _richer_laws(model):
        if law.shape_names() or not any(s.name in law.plain for s in model.effects):
            continue
        trial = _swapped(columns, model, partial(EffectAt, law), law.plain)
        if trial.score > model.score + EVIDENCE:
            yield from filter(is_credible, [without_vain(columns, trial)])


def _richer_laws(model: Model) -> Iterator[Effect]:
    """Yield the laws that add one number to a plain law of the same joint."""
    laws = model.frame.equations.motion.catalogue.values()
    return (e for e in laws if len(e.plain) == 1 and not e.has_source)


def _swapped(
    columns: Columns, model: Model, other: Callable[[Place], EffectAt], plain: tuple[str, ...]
) -> Model:
    """Return a model with another law in place of each plain one."""
    effects = tuple(other(s.place) if s.name in plain else s for s in model.effects)
    return fit(columns, effects, model.sigma, is_free=model.is_free, w=model.w)


def _shrunk(columns: Columns, model: Model, block: Block) -> Model:
    """Remove laws that are not worth their price, or replace them by a law of one number."""
    while any(block.holds(s) for s in model.effects):
        better = best_of(model, _changes(columns, model, block, is_simple=True))
        if better is None:
            break
        model = better
    return model


def without_vain(columns: Columns, model: Model) -> Model:
    """Return a model without laws that are not worth their price, whatever block they are of."""
    for block in blocks_of(model):
        model = _shrunk(columns, model, block)
    return model


def _changes(
    columns: Columns, model: Model, block: Block, *, is_simple: bool = False
) -> Iterator[Model]:
    """Yield the model without each effect of a block, and with the best other law in its place.

    Among simple laws, one with one number replaces one with several. A law that couples two joints
    may be in place of one of either.
    """
    for s in model.effects:
        if not block.holds(s):
            continue
        arranged = arrangement(model, block, s)
        without = refitted(columns, model, arranged)
        yield without
        if s.effect.plain:
            yield from uncoupled(columns, without, s)
        is_own = s.place.joint not in PLACES.values()
        laws = block.effects if is_own else tuple(model.frame.equations.motion.catalogue.values())
        others = [e for e in laws if e is not s.effect and not (
            is_simple and (len(e.quantities) > 1 or e.shape_names()))]  # fmt: skip
        is_richer = len(s.effect.quantities) > 1
        if others and (is_richer or not is_simple):
            ends = [(j,) for j in (s.place.joint, s.place.source) if j >= 0] if is_own else [None]
            found = [distinct(screen(columns, without, others, joints), 1) for joints in ends]
            yield from (refitted(columns, model, arranged, *other) for other in found if other)


def uncoupled(columns: Columns, without: Model, coupled: EffectAt) -> Iterator[Model]:
    """Yield models with the plain laws of each joint in place of one that couples or drifts.

    For a law of two joints: on one, on the other, on both. Laws that drive, or are too small, are
    left out.
    """
    place = coupled.place
    both = (place.joint, place.source)
    for joints in ((place.joint,), (place.source,), both) if place.source >= 0 else (both[:1],):
        alone = [EffectAt(EFFECTS[n], Place(j)) for j in joints for n in coupled.effect.plain]
        alone = [s for s in alone if s.key not in without.key]
        motion = without.frame.equations.motion
        while alone:
            trial = refitted(columns, without, (without.effects, len(without.effects)), *alone)
            own = list(zip(trial.effects, trial.shares, strict=True))[-len(alone) :]
            kept = [EffectAt(s.effect, s.place) for s, share in own
                    if s.is_possible(motion) and share > COUNTED_SHARE]  # fmt: skip
            if len(kept) == len(alone):
                yield trial
                break
            alone = kept


def coupled(columns: Columns, model: Model) -> Iterator[Model]:
    """Yield models with a law that couples two joints in place of the laws that imitate it there.

    The inverse of `uncoupled`: several laws, none of which could go alone, make room for one. Or
    for the two motors of a differential.
    """
    for block in (b for b in blocks_of(model) if b.joints):
        laws = [e for e in block.effects if e.plain and e.has_source]
        for s in distinct(screen(columns, model, laws, block.joints), 1):
            ends = {s.place.joint, s.place.source}
            kept = tuple(o for o in model.effects if not _is_part(o, s, ends))
            trial = fit(columns, kept, model.sigma, is_free=model.is_free, w=model.w,
                        still=len(kept))  # fmt: skip
            found = screen(columns, trial, [s.effect], block.joints)
            for best in distinct([t for t in found if t[1].place == s.place], 1):
                trial = refitted(columns, trial, (kept, len(kept)), best)
                yield grown_at(columns, trial, ends)
    yield from _differentials(columns, model)


def _is_part(other: EffectAt, coupled: EffectAt, ends: set[int]) -> bool:
    """Return whether a law could imitate a part of one that couples two joints.

    Such laws couple the same two joints, or are plain laws of its own joint; laws of the source
    may stand beside it.
    """
    is_own = other.name in coupled.effect.plain and other.place.joint == coupled.place.joint
    return is_own or {other.place.joint, other.place.source} == ends


def _differentials(columns: Columns, model: Model) -> Iterator[Model]:
    """Yield models with two motors that turn with the sum of two joints and their difference.

    Neither motor would be found alone. Laws of the two joints go; those that nearly every joint
    has may stay, and are what both motors must be worth more than.
    """
    motion = model.frame.equations.motion
    places = [(law, place) for law in motion.catalogue.values() if may_be_two(law)
              for place in law.places(motion)]  # fmt: skip
    for law, place in places:
        ends = {place.joint, place.source}
        if model.left[list(ends)].max() < COUNTED_SHARE:
            continue
        others = tuple(s for s in model.effects if not {s.place.joint, s.place.source} & ends)
        plain = tuple(s for s in model.effects if s.place.joint in ends and s.effect.is_usual)
        motors = [EffectAt(law, replace(place, number=i), x) for i, x in enumerate(_RATIOS)]
        usually = refitted(columns, model, (others + plain, len(others + plain)))
        for kept in dict.fromkeys((others, others + plain)):
            trial = refitted(columns, model, (kept, len(kept)), *motors)
            if gain(trial, usually, is_whole=False) > 0.0:
                yield grown_at(columns, trial, ends)
