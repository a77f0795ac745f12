"""Comparison of models: inertial parameters alone, single effects, pairs of effects, more."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import (
    ADEQUATE_REST,
    BENT_BODIES,
    COUNTED_SHARE,
    PER_EFFECT,
    SLIGHT_REST,
)
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.credibility import gain, is_credible
from sgp_ros.diagnosis.explain.fitted_model import Model, first_scale
from sgp_ros.diagnosis.explain.growth import blocks_of, crossed
from sgp_ros.diagnosis.explain.joint_search import (
    built_up,
    by_joint,
    large,
    shrunk,
    uncoupled,
    usual,
)
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.physics.catalogue import COMMAND_DELAY
from sgp_ros.physics.drive import Servo
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.robots.observed_motion import ObservedMotion

FIRST, SECOND, PARENTS = 12, 5, 6
"""Screened candidates that are fitted alone, as a second effect; effects that get a second."""

MOST_SINGLES, MOST_PAIRS = 8, 3
"""Of those the best that are fitted to all rows of a long recording, for each base and parent."""
EXCHANGES = 2
"""Times that an effect of the best pair is exchanged for another."""
_CARRYING = 3
"""Best models with other bodies for which a load is tried in place of these."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """All fitted models.

    Attributes:
        nominal: the nominal robot as it is.
        parameters: wrong inertial parameters alone.
        singles, pairs: best first.
        more: with three effects, four, and so on.
    """

    nominal: Model
    parameters: Model
    singles: tuple[Model, ...]
    pairs: tuple[Model, ...]
    more: tuple[Model, ...] = ()

    @property
    def base(self) -> Model:
        """The better of the two models without effects."""
        return self.nominal if self.nominal.score >= self.parameters.score else self.parameters


def compare_models(equations: Equations, progress: Callable[[float], None]) -> Comparison:
    """Fit the models that could explain the discrepancy.

    Every model comes in two variants: with bodies as the nominal robot has them, and with bodies
    that may differ. The freedom of the second has its price in evidence.
    """
    columns = Columns(equations)
    start = first_scale(equations)
    bases = [fit(columns, (), start, is_free=is_free) for is_free in (False, True)]
    progress(0.05)
    effects = tuple(equations.motion.catalogue.values())
    singles: list[Model] = []
    for number, base in enumerate(bases):
        first = _distinct(screen(columns, base, effects), FIRST)
        singles += _fitted(columns, base, [(s,) for s in first], MOST_SINGLES)
        progress(0.05 + 0.2 * (number + 1))
    singles = _ranked(singles)
    pairs: list[Model] = []
    parents = _varied(singles)
    for number, single in enumerate(parents):
        second = _distinct(screen(columns, single, effects), SECOND)
        pairs += _fitted(columns, single, [(*single.effects, s) for s in second], MOST_PAIRS)
        progress(0.45 + 0.55 * (number + 1) / len(parents))
    ranked = _ranked([*pairs, *_exchanged(columns, _ranked(pairs))])
    ranked = _ranked([*ranked, *_plain(columns, (*singles[:1], *ranked[:1]))])
    found = Comparison(bases[0], bases[1], tuple(singles), tuple(ranked))
    return replace(found, more=tuple(_more(columns, found)))


def _fitted(
    columns: Columns, start: Model, candidates: Sequence[tuple[EffectAt, ...]], most: int
) -> list[Model]:
    """Fit candidates from the scale and the bodies of a model.

    Of a long recording all are fitted to a few rows, see `sampled`, and only the best `most` of
    these to all rows.
    """
    sigma, is_free, w = start.sigma, start.is_free, start.w

    def first(rows: Columns) -> list[Model]:
        rounds, steps = (3, 12) if not start.effects else (2, 8)
        return [
            fit(rows, s, sigma, is_free=is_free, w=w, rounds=rounds, steps=steps)
            for s in candidates
        ]

    if columns.sample is columns:
        return first(columns)
    return [
        fit(columns, m.effects, m.sigma, is_free=is_free, w=m.w, rounds=1)
        for m in _ranked(first(columns.sample))[:most]
    ]


def _plain(columns: Columns, models: Iterable[Model]) -> Iterator[Model]:
    """Yield models with plain laws in place of those that couple or drift."""
    for model in models:
        for s in model.effects:
            if s.effect.plain:
                others = tuple(o for o in model.effects if o is not s)
                without = fit(columns, others, model.sigma, is_free=model.is_free, w=model.w)
                yield from uncoupled(columns, without, s)


def _more(columns: Columns, found: Comparison) -> list[Model]:
    """Return models of a search joint by joint, where the best credible model does not suffice.

    It does not if its residual counts as physics, if it is not adequate, or if its bodies are so
    unlikely that they may imitate missing physics. The search starts from that model and from the
    laws that nearly every joint has, with bodies that may differ, or with a load; and from
    friction that builds up at every joint, where no more is missing. Bodies that change at all may
    imitate a rotor, a load, a spring: it starts from the best model with those of the file, too.
    """
    by_score = _ranked([found.base, *found.singles, *found.pairs])
    sound = [m for m in by_score if not m.effects or is_credible(m)]
    best = next(iter(sound), found.base)
    limit = np.clip(ADEQUATE_REST * found.base.left, SLIGHT_REST, COUNTED_SHARE)
    of_file = next((m for m in sound if not m.is_free), found.nominal)
    is_bent = best.is_free and best.strain > BENT_BODIES
    stated = _as_stated(columns, best, of_file) if is_bent else []
    if (best.left < limit).all() and best.strain < PER_EFFECT:
        return _ranked(stated)
    everyday = usual(columns, fit(columns, (), found.nominal.sigma, is_free=True))
    loaded = _loaded(columns, everyday)
    starts = [best] if loaded else [best, everyday]
    built = built_up(columns, everyday)
    if (built.left < limit).all():
        starts.append(built)
    if isinstance(best.frame.equations.motion.drive, Servo):
        starts += _late(columns, best.sigma)
    ends = [stated, loaded, *(by_joint(columns, start) for start in starts)]
    models = _crossed(columns, [end for end in ends if end])
    models += [*_carrying(columns, models), *_freed(columns, models)]
    return _ranked(m for m in models if len(m.effects) > 2)


def _carrying(columns: Columns, models: list[Model]) -> list[Model]:
    """Return the best models with other bodies, with a load in place of these."""
    free = sorted((m for m in models if m.is_free), key=lambda m: -gain(m, models[0]))
    loads = [(x,) for x in _loads(columns.equations(frozenset()).motion)]
    return [
        fit(columns, (*model.effects, *load), model.sigma, is_free=False)
        for model in free[:_CARRYING]
        for load in ([()] if any(s.effect.is_body for s in model.effects) else loads)
    ]


def _freed(columns: Columns, models: list[Model]) -> Iterator[Model]:
    """Yield the best model with the bodies of the file, with others in place of some laws.

    A torque constant, a rotor, a spring may have stood for bodies that are a little different.
    """
    stated = [m for m in models if not m.is_free]
    for best in sorted(stated, key=lambda m: -gain(m, stated[0]))[:1]:
        laws = tuple(s for s in best.effects if not s.effect.is_body)
        free = fit(columns, laws, best.sigma, is_free=True)
        for block in blocks_of(free):
            free = shrunk(columns, free, block)
        yield from filter(is_credible, (free, large(columns, free)))


def _loads(motion: ObservedMotion) -> list[EffectAt]:
    return [
        EffectAt(law, place, shape)
        for law in motion.catalogue.values() if law.is_body
        for place in law.places(motion)
        for shape in law.starts(motion, place)
    ]  # fmt: skip


def _crossed(columns: Columns, ends: list[list[Model]]) -> list[Model]:
    """Return the models of all searches, and of one from the best with laws from the others."""
    models = [model for end in ends for model in end]
    if len(ends) > 1:
        first = [end[0] for end in ends]
        best = max(first, key=lambda m: gain(m, first[0]))
        better = crossed(columns, best, first)
        models += by_joint(columns, better) if better is not best else []
    return models


def _as_stated(columns: Columns, best: Model, stated: Model) -> list[Model]:
    """Return models of a search beside the bodies of the robot file.

    Args:
        columns: of the recording.
        best: model with other bodies, whose laws a second search starts from if the first one does
            not lead to a better model.
        stated: best model with the bodies of the file.
    """
    found = by_joint(columns, stated)
    if any(gain(m, best) > 0.0 for m in found):
        return found
    laws = fit(columns, best.effects, best.sigma, is_free=False)
    return [*found, *by_joint(columns, laws)]


def _loaded(columns: Columns, everyday: Model) -> list[Model]:
    """Return models of a search from the laws that nearly every joint has beside a load.

    A load is no law to add to bodies that may differ, and beside stated bodies not the first law
    that a robot asks for whose joints all have friction. None where changed bodies are as good, or
    where the load goes as other laws come.
    """
    motion = columns.equations(frozenset()).motion
    base = fit(columns, (), everyday.sigma, is_free=False)
    starts = [usual(columns, base, (load,)) for load in _loads(motion)]
    best = max(starts, key=lambda m: m.score, default=everyday)
    found = by_joint(columns, best) if gain(best, everyday) > PER_EFFECT else []
    return [m for m in found if any(s.effect.is_body for s in m.effects)]


def _late(columns: Columns, sigma: np.ndarray) -> Iterator[Model]:
    """Yield the laws that nearly every joint has beside a delay of targets, in both variants.

    A target that is late by T acts at every joint much as viscous friction kp T and a rotor
    kd T - kp T^2/2; a search that has taken these would not come back to the delay.
    """
    motors = COMMAND_DELAY.places(columns.equations(frozenset()).motion)
    for is_free in (False, True):
        base = fit(columns, (), sigma, is_free=is_free)
        found = [s for _, s in screen(columns, base, [COMMAND_DELAY]) if s.place in motors[-1:]]
        yield from (usual(columns, base, (s,)) for s in found[:1])


def _exchanged(columns: Columns, ranked: list[Model]) -> list[Model]:
    """Return pairs like the best one with another effect in place of either.

    Of two effects that are seen only together, neither need be among the best alone. As long as
    that is better and leaves what counts as physics, it is done again with the best of them.
    """
    found: list[Model] = []
    effects = columns.equations(frozenset()).motion.catalogue.values()
    best = ranked[0] if ranked else None
    for _ in range(EXCHANGES):
        if best is None or best.left.max() < COUNTED_SHARE:
            break
        trials: list[Model] = []
        for kept in best.effects:
            parent = fit(columns, (kept,), best.sigma, is_free=best.is_free, w=best.w, rounds=2,
                         steps=4)  # fmt: skip
            second = _distinct(screen(columns, parent, effects), SECOND)
            trials += _fitted(columns, best, [(*parent.effects, s) for s in second], MOST_PAIRS)
        found += trials
        better = _ranked(trials)
        best = better[0] if better and better[0].score > best.score else None
    return found


def _varied(singles: list[Model]) -> list[Model]:
    """Return the first effects that get a second one: the best of each variant."""
    variants = [[m for m in singles if m.is_free == is_free] for is_free in (False, True)]
    return [m for some in variants for m in some[: PARENTS // 2]]


def _distinct(found: list[tuple[float, EffectAt]], count: int) -> list[EffectAt]:
    """Return the best `count` effects at places, with both of their shapes."""
    kept = list(dict.fromkeys(candidate.key for _, candidate in found))[:count]
    return [candidate for _, candidate in found if candidate.key in kept]


def _ranked(models: Iterable[Model]) -> list[Model]:
    best: dict[object, Model] = {}
    for model in models:
        if not model.is_possible() or not np.isfinite(model.score):
            continue
        key = model.key, model.is_free
        if key not in best or model.score > best[key].score:
            best[key] = model
    return sorted(best.values(), key=lambda model: -model.score)
