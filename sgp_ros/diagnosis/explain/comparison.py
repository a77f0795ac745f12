"""Comparison of models: inertial parameters alone, single effects, pairs of effects, more."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import COUNTED_SHARE, PER_EFFECT, SLIGHT_REST
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.credibility import ranked
from sgp_ros.diagnosis.explain.fitted_model import Model, first_scale
from sgp_ros.diagnosis.explain.joint_search import uncoupled
from sgp_ros.diagnosis.explain.more_effects import more
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.physics.effect_at import EffectAt, one_of_each

FIRST, SECOND, PARENTS = 12, 5, 6
"""Screened candidates that are fitted alone, as a second effect; effects that get a second."""

MOST_SINGLES, MOST_PAIRS = 8, 3
"""Of those the best that are fitted to all rows of a long recording, for each base and parent."""
EXCHANGES = 2
"""Times that an effect of the best pair is exchanged for another."""


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

    @property
    def is_calm(self) -> bool:
        """Whether likely bodies leave too little for any effect."""
        return bool(self.base.left.max() < SLIGHT_REST and self.base.strain < PER_EFFECT)


def compare_models(equations: Equations, progress: Callable[[float], None]) -> Comparison:
    """Fit the models that could explain the discrepancy.

    Every model comes in two variants: with bodies as the nominal robot has them, and with bodies
    that may differ. The freedom of the second has its price in evidence. Where bodies leave too
    little for any effect, none is looked for but what would explain the same as other bodies.
    """
    columns = Columns(equations)
    start = first_scale(equations)
    bases = [fit(columns, (), start, is_free=is_free) for is_free in (False, True)]
    progress(0.05)
    plain = Comparison(bases[0], bases[1], (), ())
    if plain.is_calm:
        progress(1.0)
        found = _singles(columns, plain.nominal) if plain.base.is_free else ()
        return replace(plain, singles=tuple(ranked(found)))
    singles: list[Model] = []
    for number, base in enumerate(bases):
        singles += _singles(columns, base)
        progress(0.05 + 0.2 * (number + 1))
    singles = ranked(singles)
    pairs: list[Model] = []
    parents, effects = _varied(singles), tuple(equations.motion.catalogue.values())
    for number, single in enumerate(parents):
        second = _distinct(screen(columns, single, effects), SECOND)
        pairs += _fitted(columns, single, [(*single.effects, s) for s in second], MOST_PAIRS)
        progress(0.45 + 0.55 * (number + 1) / len(parents))
    pairs = ranked([*pairs, *_exchanged(columns, ranked(pairs))])
    pairs = [m for m in pairs if one_of_each(m.effects) == m.effects]
    pairs = ranked([*pairs, *_plain(columns, (*singles[:1], *pairs[:1]))])
    longer = more(columns, plain.nominal, plain.base, (*singles, *pairs))
    return replace(plain, singles=tuple(singles), pairs=tuple(pairs), more=tuple(longer))


def _singles(columns: Columns, base: Model) -> list[Model]:
    """Return the models of single effects beside bodies as those of a model."""
    effects = tuple(columns.equations(frozenset()).motion.catalogue.values())
    first = _distinct(screen(columns, base, effects), FIRST)
    return _fitted(columns, base, [(s,) for s in first], MOST_SINGLES)


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
        for m in ranked(first(columns.sample))[:most]
    ]


def _plain(columns: Columns, models: Iterable[Model]) -> Iterator[Model]:
    """Yield models with plain laws in place of those that couple or drift."""
    for model in models:
        for s in model.effects:
            if s.effect.plain:
                others = tuple(o for o in model.effects if o is not s)
                without = fit(columns, others, model.sigma, is_free=model.is_free, w=model.w)
                yield from uncoupled(columns, without, s)


def _exchanged(columns: Columns, pairs: list[Model]) -> list[Model]:
    """Return pairs like the best one with another effect in place of either.

    Of two effects that are seen only together, neither need be among the best alone. As long as
    that is better and leaves what counts as physics, it is done again with the best of them.
    """
    found: list[Model] = []
    effects = columns.equations(frozenset()).motion.catalogue.values()
    best = pairs[0] if pairs else None
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
        better = ranked(trials)
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
