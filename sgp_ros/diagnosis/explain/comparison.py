"""Comparison of models: inertial parameters alone, single effects, pairs of effects, more."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from sgp_ros.batch.least_squares import correlation_factor
from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.compare.settled import shows
from sgp_ros.diagnosis.criteria import COUNTED_SHARE, EVIDENCE
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import Model, floors
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import Place

FIRST, SECOND, PARENTS = 12, 5, 6
"""Screened candidates that are fitted alone, as a second effect; effects that get a second."""

THIRD = 3
"""Candidates that are fitted as a third, fourth, ... effect."""
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


def compare_models(equations: Equations, progress: Callable[[float], None]) -> Comparison:
    """Fit the models that could explain the discrepancy.

    Every model comes in two variants: with bodies as the nominal robot has them, and with bodies
    that may differ. The freedom of the second has its price in evidence.
    """
    columns = Columns(equations)
    start = np.sqrt((equations.d**2).mean(axis=0) + floors(equations))
    bases = [fit(columns, (), start, is_free=is_free) for is_free in (False, True)]
    progress(0.05)
    effects = tuple(EFFECTS.values())
    singles: list[Model] = []
    for number, base in enumerate(bases):
        first = _distinct(screen(columns, base, effects), FIRST)
        singles += [fit(columns, (s,), base.sigma, is_free=base.is_free, w=base.w) for s in first]
        progress(0.05 + 0.2 * (number + 1))
    singles = _ranked(singles)
    pairs: list[Model] = []
    parents = _varied(singles)
    for number, single in enumerate(parents):
        second = _distinct(screen(columns, single, effects), SECOND)
        pairs += [
            fit(columns, (*single.effects, s), single.sigma, is_free=single.is_free, w=single.w,
                rounds=2, steps=8)
            for s in second
        ]  # fmt: skip
        progress(0.45 + 0.55 * (number + 1) / len(parents))
    ranked = _ranked([*pairs, *_exchanged(columns, _ranked(pairs))])
    best = max([*singles, *ranked], key=lambda m: m.score, default=None)
    more = [] if best is None else _extended(columns, best)
    return Comparison(bases[0], bases[1], tuple(singles), tuple(ranked), tuple(more))


def _exchanged(columns: Columns, ranked: list[Model]) -> list[Model]:
    """Return pairs like the best one with another effect in place of either.

    Of two effects that are seen only together, neither need be among the best alone. As long as
    that is better and leaves what counts as physics, it is done again with the best of them.
    """
    found: list[Model] = []
    power = columns.equations(frozenset()).power
    best = ranked[0] if ranked else None
    for _ in range(EXCHANGES):
        if best is None or (best.mean_square / power).max() < COUNTED_SHARE:
            break
        trials: list[Model] = []
        for kept in best.effects:
            parent = fit(columns, (kept,), best.sigma, is_free=best.is_free, w=best.w, rounds=2,
                         steps=4)  # fmt: skip
            second = _distinct(screen(columns, parent, EFFECTS.values()), SECOND)
            trials += [
                fit(columns, (*parent.effects, s), best.sigma, is_free=best.is_free, w=best.w,
                    rounds=2, steps=8)
                for s in second
            ]  # fmt: skip
        found += trials
        better = _ranked(trials)
        best = better[0] if better and better[0].score > best.score else None
    return found


def _extended(columns: Columns, model: Model) -> list[Model]:
    """Return models with more than two effects, for robots that lack some at several joints.

    As long as a joint has fewer than two and leaves what counts as physics, the best effect on
    such joints is added. Rows that are correlated in time count as fewer.
    """
    found: list[Model] = []
    power = columns.equations(frozenset()).power
    k = len(power)
    while len(model.effects) < 2 * k:
        held = [sum(s.place.joint == j for s in model.effects) for j in range(k)]
        left = model.mean_square / power
        open_ = [j for j in range(k) if left[j] > COUNTED_SHARE and held[j] < 2]
        if not open_:
            break
        second = [s for _, s in screen(columns, model, EFFECTS.values()) if s.place.joint in open_]
        trials = [
            fit(columns, (*model.effects, s), model.sigma, is_free=model.is_free, w=model.w,
                rounds=2, steps=4)
            for s in second[:THIRD]
        ]  # fmt: skip
        gains = _gains(model, _ranked(trials))
        if not gains or max(gains.values()) < EVIDENCE:
            break
        best = max(gains, key=lambda m: gains[m])
        model = best
        found.append(model)
    found = [m for m in found if len(m.effects) > 2]
    return [*found, *_simpler(columns, found[-1])] if found else []


def _simpler(columns: Columns, model: Model) -> list[Model]:
    """Return a model with a law of one number in place of each richer one, and with all of them.

    What was best while other effects were still missing may have more freedom than it needs.
    """
    motion = columns.equations(frozenset()).motion
    simple = [e for e in EFFECTS.values() if len(e.quantities) == 1 and not e.shape_names()]
    found: list[Model] = []
    whole = model
    for i, candidate in enumerate(model.effects):
        if len(candidate.effect.quantities) == 1:
            continue
        place = Place(candidate.place.joint)
        others = [
            EffectAt(e, place)
            for e in simple
            if place in e.places(motion) and shows(e, place, motion)
        ]
        trials = [_replaced(columns, model, i, s) for s in others if s.key not in model.key]
        best = _ranked(trials)
        if best:
            found.append(best[0])
            whole = _replaced(columns, whole, i, best[0].effects[i])
    return _ranked([*found, whole]) if found else []


def _replaced(columns: Columns, model: Model, index: int, candidate: EffectAt) -> Model:
    candidates = (*model.effects[:index], candidate, *model.effects[index + 1 :])
    return fit(
        columns, candidates, model.sigma, is_free=model.is_free, w=model.w, rounds=2, steps=4
    )


def _gains(model: Model, trials: list[Model]) -> dict[Model, float]:
    """Return what each trial gains on a model with one effect less [nats].

    The residual of real robots is correlated in time. Only the trial that leaves least tells how
    much, for what is missing is correlated too.
    """
    factors: dict[int, float] = {}
    for trial in trials:
        j = max(trial.effects[-1].place.joint, 0)
        factors[j] = min(factors.get(j, np.inf), correlation_factor(trial.residual[:, j]))
    return {
        trial: (trial.likelihood - model.likelihood)
        / factors[max(trial.effects[-1].place.joint, 0)]
        - trial.cost + model.cost
        for trial in trials
    }  # fmt: skip


def _varied(singles: list[Model]) -> list[Model]:
    """Return the first effects that get a second one: the best of each variant."""
    chosen = []
    for is_free in (False, True):
        chosen += [m for m in singles if m.is_free == is_free][: PARENTS // 2]
    return chosen


def _distinct(found: list[tuple[float, EffectAt]], count: int) -> list[EffectAt]:
    """Return the best `count` effects at places, with both of their shapes."""
    keys: list[object] = []
    for _, candidate in found:
        if candidate.key not in keys:
            keys.append(candidate.key)
    kept = set(keys[:count])
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
