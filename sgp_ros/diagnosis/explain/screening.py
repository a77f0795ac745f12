"""Screening of every effect, place and shape, given the model so far; see `products`."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.settled import shows
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.products import Products, Rest
from sgp_ros.diagnosis.explain.regression import Columns, Seen, dry_joints
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt, in_series
from sgp_ros.physics.memory import BARE
from sgp_ros.physics.motor_beside import has_rotor, is_bare, is_in_file
from sgp_ros.physics.place import Place
from sgp_ros.robots.observed_motion import ObservedMotion

TRIALS = 2
"""Shapes per effect and place that are worth a fit."""
_NEAR = 0.05
"""Change of the bodies with which columns need not be made anew [standard deviations]."""
_DEPENDENT = 1e-6
"""Ratio of singular values from which columns are linearly dependent [1]."""
WIDEST = 0.75
"""Widest interval of position, as a share of the range, that is a region."""

Trial = tuple[float, EffectAt]


def screen(
    columns: Columns,
    model: Model,
    effects: Iterable[Effect],
    joints: Collection[int] | None = None,
) -> list[Trial]:
    """Return candidates with the gain in score they promise, best first.

    In a long recording only some rows are used, see `sampled`.

    Args:
        columns: of the recording.
        model: so far.
        effects: that could be added.
        joints: indices of the places that are looked at; None for all.
    """
    rows, columns = columns.rows, columns.sample
    held = dry_joints(model.effects)
    rests = {held: Rest.of(columns, model, held)}
    before = rests[held].left
    found: list[Trial] = []
    for effect in effects:
        if effect.is_body and model.is_free:
            continue
        for place in _free_places(effect, model, columns.equations(held).motion):
            if joints is not None and place.joint not in joints:
                continue
            is_shown = shows(effect, place, columns.equations(held).motion)
            if not (is_shown and has_rotor(place, model.effects)):
                continue
            dry = held | effect.held_joints(place)
            if dry not in rests:
                rests[dry] = Rest.of(columns, model, dry)
            motion = columns.corrected(model.w if effect.uses_bodies else None, _NEAR)
            look = _Look(columns, rests[dry], before, rows, (*motion.known, *model.effects))
            trials = _trials(look, effect, place, motion)
            if place.number:
                trials = (t for t in trials if are_apart((*model.effects, t[1]), motion))
            found += sorted(trials, key=lambda t: -t[0])[:TRIALS]
    return sorted(found, key=lambda t: -t[0])


def distinct(found: Iterable[Trial], count: int | None = None) -> list[EffectAt]:
    """Return the best shape of each of the best `count` effects at places; None for all."""
    best: dict[object, EffectAt] = {}
    for _, candidate in found:
        best.setdefault(candidate.key, candidate)
    return list(best.values())[:count]


def _free_places(effect: Effect, model: Model, motion: ObservedMotion) -> Iterator[Place]:
    """Yield the places of a law that the model does not have yet; further ones too for a wave.

    And a second one for friction of two joints: a differential has two motors. What is behind a
    motor is behind the one that the model has.
    """
    places = effect.places(motion)
    is_behind = any(p.kind == BARE for p in places)
    for place in places:
        if is_behind and _is_taken(effect, place, model, motion):
            continue
        here = [s.place.number for s in model.effects if _is_like(s, effect, place)]
        if not here:
            yield place
        elif effect.wave(motion, place) is not None or (may_be_two(effect) and len(here) == 1):
            yield replace(place, number=1 + max(here))


def _is_taken(effect: Effect, place: Place, model: Model, motion: ObservedMotion) -> bool:
    """Return whether a joint has the law behind its motor, or another motor than the place has."""
    has_one = any(s.effect is effect and s.place.joint == place.joint for s in model.effects)
    return has_one or (is_in_file(place) and is_bare(place.joint, model.effects, motion))


def _is_like(s: EffectAt, effect: Effect, place: Place) -> bool:
    """Return whether an effect is of this law and place; waves may have several there."""
    return s.effect is effect and replace(s.place, number=0) == place


def may_be_two(effect: Effect) -> bool:
    """Return whether a place may have two of a law: dry friction of the motors of two joints."""
    return effect.has_source and effect.is_dry


def are_apart(effects: Sequence[EffectAt], motion: ObservedMotion) -> bool:
    """Return whether waves of one law at one place differ by one period or more in the motion.

    The two motors of a differential turn with the sum of its joints, and with their difference.
    Two laws that hold the same plain law, such as friction that differs with direction and
    Stribeck friction, have no numbers of their own.
    """
    for i, s in enumerate(effects):
        if any(_overlap(s, o, motion) for o in effects[:i]):
            return False
        first = replace(s.place, number=0)
        others = [o for o in effects[:i] if _is_like(o, s.effect, first)]
        wave = s.effect.wave(motion, s.place) if others else None
        if may_be_two(s.effect) and any(o.shape[0] * s.shape[0] > 0.0 for o in others):
            return False
        if wave and any(abs(o.shape[0] - s.shape[0]) < wave.width for o in others):
            return False
    return True


def _overlap(a: EffectAt, b: EffectAt, motion: ObservedMotion) -> bool:
    """Return whether two laws of one joint are linearly dependent, by a plain law in both."""
    is_alone = a.place == b.place and a.place.source < 0 and a.effect is not b.effect
    if not (is_alone and set(a.effect.plain) & set(b.effect.plain)):
        return False
    columns = [s.columns(motion) for s in (a, b)]
    X = np.hstack([x if x.ndim == 2 else x[:, a.place.joint] for x in columns])
    values = np.linalg.svd(X / np.maximum(np.abs(X).max(axis=0), 1e-300), compute_uv=False)
    return bool(values[-1] < _DEPENDENT * values[0])


@dataclass(frozen=True, eq=False)
class _Look:
    """Trials beside a model.

    Attributes:
        columns: of the rows that are looked at.
        rest: what the model leaves there.
        before: (k,) mean squares that it leaves.
        rows: number of all rows, which those stand for.
        known: effects that the model and the nominal robot have.
    """

    columns: Columns
    rest: Rest
    before: np.ndarray
    rows: int
    known: tuple[EffectAt, ...]

    def gains(self, found: Products, c: np.ndarray, size: int) -> np.ndarray:
        """Return how much better candidates with coefficients c (S, m) leave it, (S,) [nats]."""
        rest = self.rest
        N, floor = self.rows, rest.floor
        change = np.einsum('sjab,sa,sb->sj', found.own, c, c)
        change -= 2.0 * np.einsum('sja,sa->sj', found.cross, c)
        after = np.maximum(rest.left + change / len(rest.r) * rest.frame.sigma**2, 0.0)
        ratio = (self.before + floor) / (after + floor)
        return np.asarray(0.5 * N * np.log(ratio).sum(axis=1) - 0.5 * size * np.log(N))


def _trials(look: _Look, effect: Effect, place: Place, motion: ObservedMotion) -> Iterator[Trial]:
    bins = look.columns.bins(effect, place, look.rest.equations)
    if bins is not None:
        yield from _intervals(look, EffectAt(effect, place), *bins)
        return
    alike = (EffectAt(effect, place, shape) for shape in _starts(look.rest, effect, place))
    starts = [x for s in alike for x in in_series((s,), look.known)]
    if starts:
        yield from _shaped(look, starts, motion)


def _starts(rest: Rest, effect: Effect, place: Place) -> np.ndarray:
    """Return the shapes that are tried; the periods of a wave are where the residual has them."""
    equations = rest.equations
    wave = effect.wave(equations.motion, place)
    if wave is None:
        return effect.starts(equations.motion, place)
    return wave.strongest(equations.filter.rows, rest.r, rest.frame.sigma)


def _shaped(look: _Look, starts: Sequence[EffectAt], motion: ObservedMotion) -> Iterator[Trial]:
    """Yield the trials of the shapes of one law at one place."""
    effect, small = starts[0].effect, starts[0].effect.small
    seen = look.columns.bank(starts, look.rest.equations, motion)
    if not seen.x.shape[-1]:
        return
    found = Products.of(look.rest, seen)
    c = found.coefficients()
    if small is not None:  # linear in its size
        placed = [s.with_shape(small.shape(s.shape, x)) for s, x in zip(starts, c, strict=True)]
        is_possible = [s.is_possible(motion) for s in placed]
        gains = look.gains(found, c, len(placed[0].shape))
    else:
        placed = list(starts)
        if effect.is_given:  # a start may have the wrong size, not the wrong sign
            is_possible = (c[:, 0] > 0.0).tolist()
        else:
            sized = (replace(s, coefficients=x) for s, x in zip(starts, c, strict=True))
            is_possible = [s.is_possible(motion) for s in sized]
        gains = look.gains(found, c, c.shape[1] + len(starts[0].shape))
    for s, gain, is_kept in zip(placed, gains, is_possible, strict=True):
        if is_kept:
            yield float(gain), s


def _intervals(look: _Look, candidate: EffectAt, seen: Seen, edges: np.ndarray) -> Iterator[Trial]:
    """Yield the best interval, and the best that is not its neighbour.

    With the columns of narrow bins and their Gram matrix every interval costs a few sums.
    """
    found, count = Products.of(look.rest, seen), seen.x.shape[1]
    G, b = np.where(np.isfinite(found.G[0]), found.G[0], 0.0), found.b[0]
    i, j = np.triu_indices(len(edges), 1)
    area = np.zeros((len(edges), len(edges)))
    area[1:, 1:] = np.cumsum(np.cumsum(G, axis=0), axis=1)
    size = area[j, j] - area[i, j] - area[j, i] + area[i, i]
    sums = np.concatenate([[0.0], np.cumsum(b)])
    push = sums[j] - sums[i]
    usable = (push > 0.0) & (j - i <= WIDEST * count) & (size > 1e-12 * area[-1, -1])
    gain = np.where(usable, push**2 / np.maximum(size, 1e-300), 0.0)
    order = np.argsort(-gain)
    far = (abs(i[order] - i[order[0]]) > TRIALS * 2) | (abs(j[order] - j[order[0]]) > TRIALS * 2)
    for best in (order[0], order[int(np.argmax(far))]):
        if gain[best] > 0.0:
            c = np.zeros(count)
            c[i[best] : j[best]] = push[best] / size[best]
            shape = np.array([edges[i[best]], edges[j[best]]])
            yield float(look.gains(found, c[None], 3)[0]), candidate.with_shape(shape)
