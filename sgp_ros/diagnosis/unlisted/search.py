"""The search for a law at a joint that listed effects do not describe, or describe only nearly.

First a smooth force of one variable, with a factor in another, takes the place of effects of the
joint, alone and beside those that may be right. Where none is worth more than the listed ones, or
would be with few numbers, no law is looked for. Else the formulas of the best variables and
factors are fitted, each jointly with the bodies and all other effects, as every other model is.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from sgp_ros.diagnosis.criteria import ALIKE, CLEARER
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import distinct, screen
from sgp_ros.diagnosis.locate.remainder import parts_of
from sgp_ros.diagnosis.unlisted.beside import (
    beside,
    earned,
    far_and_near,
    is_slight,
    law_of,
    own_effects,
    refined,
)
from sgp_ros.diagnosis.unlisted.curves import left_out
from sgp_ros.diagnosis.unlisted.formulas import FoundLaw, curve_of, formulas, nodes_of
from sgp_ros.diagnosis.unlisted.searched import Searched
from sgp_ros.diagnosis.unlisted.shapes import (
    FINE,
    SMOOTHED,
    SmoothForce,
    beside_each,
    smooth_at_bound,
    smooth_of,
    unlike,
)
from sgp_ros.diagnosis.unlisted.shorter import idle, shorter
from sgp_ros.diagnosis.unlisted.tried import (
    as_factor,
    is_beaten,
    is_series,
    is_wanted,
    leaves_less,
    more_forces,
    smooth_forces,
    spared_by,
    times_law,
    weighted,
    without_limits,
)
from sgp_ros.diagnosis.unlisted.variables import Variable
from sgp_ros.physics.catalogue import ARMATURE
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place

SMOOTH, SHAPES, FIRST, FITTED = 3, 4, 12, 5
"""Smooth forces fitted beside each choice of kept effects; of all of these, those for which
formulas are tried; texts that become formulas for the best one, and for each other."""
MULTIPLIED, EARNED = 3, 3
"""Best models with a formula: those whose formula is tried as a factor; those in which every
listed effect must earn its price again."""
WEIGHT_STEPS = (0.25, 0.12, 0.06, 0.03, 0.015)
"""By which the weight of a joint that is added is refined, in parts of itself."""


def search(
    columns: Columns, scale: Scale, listed: Model, joint: int, *, is_open: bool = False
) -> Searched | None:
    """Return the laws that explain a joint better than listed effects, at their price, or None.

    Args:
        columns: of the recording.
        scale: of mean squares.
        listed: best model of listed effects, adequate or not.
        joint: index.
        is_open: whether listed effects leave it unexplained.
    """
    scale = scale.of_forms()
    look = _Look(columns, scale, listed, joint, is_open)
    smooth = look.ranked()
    if not smooth:
        return None
    wanted = is_wanted(columns, scale, listed, smooth[0], joint)
    if not (wanted or is_open):
        return None
    is_better = is_beaten(scale, listed, smooth[0], joint)
    slight = not is_better or is_slight(listed, smooth[0], joint)
    laws: dict[object, Model] = {}
    # of a product of two variables, one alone may say little
    for number, model in enumerate(look.shapes(smooth)[: None if wanted else 1]):
        best = max(map(scale.worth, laws.values()), default=-np.inf)
        if scale.worth(model) + spared_by(model, joint) + ALIKE < best:
            continue
        for law in look.formulas(model, FITTED if number else FIRST):
            key = law.key, law.is_free
            if key not in laws or scale.worth(law) > scale.worth(laws[key]):
                laws[key] = law
    ranked = look.best(laws.values())
    if ranked and look.leaves_some(ranked[0]):
        products = look.products(ranked)
        smooth = look.best([*smooth, *products])
        ranked = look.best([*ranked, *(x for m in products for x in look.formulas(m, FITTED))])
    again = [earned(look.columns, scale, m, joint) for m in ranked[:EARNED]]
    ranked = without_limits(look.best([*again, *ranked[EARNED:]]), scale, joint)
    ranked = look.best([*ranked, *(x for m in ranked[:1] for x in shorter(columns, m, joint))])
    first = (i for i, m in enumerate(ranked) if not idle(columns, m, joint))
    ranked = ranked[next(first, 0) :]
    ranked[:1] = [refined(look.columns, scale, m, joint) for m in ranked[:1]]
    free = look.free(ranked[0]) if ranked else np.zeros(0)
    if not (is_better or any(leaves_less(m, listed, joint) for m in ranked[:1])):
        return None
    if any(scale.worth(m) > scale.worth(listed) + ALIKE for m in ranked[:1]):
        slight = slight and is_slight(listed, ranked[0], joint)
    return Searched(joint, listed, smooth[0], tuple(ranked), free, look.floor, slight)


@dataclass(frozen=True, eq=False)
class _Look:
    """Where a law is looked for, and what is there already."""

    columns: Columns
    scale: Scale
    listed: Model
    joint: int
    is_open: bool
    followed: dict[object, list[FoundLaw]] = field(default_factory=dict)

    def ranked(self) -> list[Model]:
        """Return models with a smooth force, best first.

        Forces of two joints, or of the past, are kept only if worth more than any plain one.
        """
        found = self.best(m for m in self.smooth() if not smooth_at_bound(m, self.joint))
        found = self.best([*found, *(self.more(found[0]) if found else ())])
        finer = (self._finer(m, x) for m, x in beside_each(found, self.joint)[:SHAPES])
        found = self.best([*found, *finer])
        plain = [self.scale.worth(m) for m in found if self._variable(m).is_plain]
        least = max(plain) + ALIKE if plain else -np.inf
        return [m for m in found if self._variable(m).is_plain or self.scale.worth(m) > least]

    def best(self, models: Iterable[Model]) -> list[Model]:
        """Return models, the best first."""
        return sorted(models, key=lambda m: -self.scale.worth(m))

    def _variable(self, model: Model) -> Variable:
        return smooth_of(model, self.joint)[1].variable

    def smooth(self) -> Iterator[Model]:
        """Yield models with a smooth force in place of, and beside, effects of the joint."""
        motion = self.columns.equations(frozenset()).motion
        effects = list(smooth_forces(motion, self.joint))
        for base in self._bases():
            own = own_effects(base, self.joint)
            others = [e for e in effects if not any(e.has_form_of(s) for s in own)]
            for is_plain in (True, False):
                alike = [e for e in others if e.variable.is_plain is is_plain]
                yield from self._fitted(base, alike, SMOOTH if is_plain else 1)

    def more(self, best: Model) -> Iterator[Model]:
        """Yield models with smooth forces that are tried where the best other one leaves much.

        They are tried only where listed effects are beaten, or leave the joint unexplained.
        """
        is_beaten = self.scale.worth(best) > self.scale.worth(self.listed) + ALIKE
        if not (self.leaves_some(best) and (self.is_open or is_beaten)):
            return
        placed = smooth_of(best, self.joint)[0]
        bases = [tuple(s for s in best.effects if s is not placed), self._others()]
        effects = list(more_forces(self.columns.equations(frozenset()).motion, self.joint))
        for kept in dict.fromkeys(bases):
            base = self._without(kept, is_free=best.is_free)
            own = own_effects(base, self.joint)
            alike = [e for e in effects if e.gate or not any(e.has_form_of(s) for s in own)]
            for model in list(self._fitted(base, alike, SMOOTH)):
                yield self._with_weight(base, model)

    @property
    def floor(self) -> float:
        """Mean square that errors of signals may leave of the joint."""
        return float(self.scale.power[self.joint] * self.scale.floor[self.joint])

    def leaves_some(self, model: Model) -> bool:
        """Return whether a model leaves clearly more of the joint than that."""
        return bool(model.mean_square[self.joint] > CLEARER * self.floor)

    def products(self, laws: list[Model]) -> list[Model]:
        """Return the best model with a smooth force times a formula of another variable."""
        motion, found = self.columns.equations(frozenset()).motion, list[Model]()
        for model in laws[:MULTIPLIED]:
            for factor, others in as_factor(model, self.joint):
                base = self._without(others, is_free=model.is_free)
                found += self._fitted(base, [*times_law(motion, self.joint, factor)], 1)
        return [self._finer(m, smooth_of(m, self.joint)[1]) for m in self.best(found)[:1]]

    def _with_weight(self, base: Model, model: Model) -> Model:
        """Return a model with the best weight of a joint that is added in its smooth force."""
        motion, best = self.columns.equations(frozenset()).motion, model
        force = smooth_of(model, self.joint)[1]
        for step in WEIGHT_STEPS if force.variable.is_weighted else ():
            added = smooth_of(best, self.joint)[1].variable.other
            assert added is not None
            weights = [added[2] * x for x in (1.0 - step, 1.0 + step)]
            near = [weighted(motion, self.joint, added[0], force.variable.kind, w, force.gate)
                    for w in weights]  # fmt: skip
            best = max((best, *self._fitted(base, near, None)), key=self.scale.worth)
        return best

    def free(self, model: Model) -> np.ndarray:
        """Return what a force of any form beside a formula leaves of parts left out, (N,)."""
        law = law_of(model, self.joint)
        assert law is not None
        assert isinstance(law.effect, FoundLaw)
        r = model.residual[:, self.joint]
        return left_out(nodes_of(law.effect.smooth, model)[1], r, parts_of(len(r)))

    def shapes(self, smooth: list[Model]) -> list[Model]:
        """Return the models with a smooth force for which formulas are tried.

        Waves in whole ratios may have more periods than a spline has pieces: a force of their
        position in their place is tried first, however little it explains.
        """
        found, own = unlike(smooth, self.joint), own_effects(self.listed, self.joint)
        motion = self.columns.equations(frozenset()).motion
        waves = [s for s in own if s.effect.wave(motion, s.place) is not None]
        if not is_series(waves, motion):
            return found[:SHAPES]
        first = [
            m for m in found
            if not m.key & {s.key for s in waves}
            and self._variable(m).is_of(waves[0]) and not smooth_of(m, self.joint)[1].gate
        ]  # fmt: skip
        others = [m for m in found if m not in first[:1]]
        return [*first[:1], *others[:SHAPES]]

    def _finer(self, model: Model, coarse: SmoothForce) -> Model:
        """Return a model with a fine spline in the place of the law or smooth force it has."""
        motion = self.columns.equations(frozenset()).motion
        law = law_of(model, self.joint)
        assert law is not None
        numbers = law.report(motion)
        if isinstance(law.effect, SmoothForce):
            numbers |= dict(zip(law.effect.shape_names(), law.shape.tolist(), strict=True))
        knots = coarse.variable.knots(motion, FINE)
        fine = coarse.changed(coarse.variable, knots, float(numbers.get(SMOOTHED, coarse.width)))
        shape = np.array([numbers[n] for n in fine.shape_names()], dtype=np.float64)
        effects = tuple(EffectAt(fine, s.place, shape) if s is law else s for s in model.effects)
        return fit(self.columns, effects, model.sigma, is_free=model.is_free, w=model.w, rounds=2,
                   steps=4, still=len(effects))  # fmt: skip

    def formulas(self, smooth: Model, count: int) -> Iterator[Model]:
        """Yield models with so many formulas in place of the smooth force of a model."""
        placed, chosen = smooth_of(smooth, self.joint)
        kept = tuple(s for s in smooth.effects if s is not placed)
        base = self._without(kept, is_free=smooth.is_free)
        known = chosen.key, frozenset(s.key for s in kept)
        if known not in self.followed:  # other bodies hardly change what follows it
            floor = len(smooth.residual) * self.floor
            motion, curve = smooth.frame.equations.motion, curve_of(smooth, self.joint)
            self.followed[known] = list(formulas(chosen, motion, curve, floor, count))
        laws = self.followed[known][:count]
        yield from self._fitted(base, laws, None)

    def _fitted(
        self, base: Model, effects: list[SmoothForce] | list[FoundLaw], count: int | None
    ) -> Iterator[Model]:
        """Yield the best of some effects beside a model, fitted; shapes elsewhere are kept."""
        far, near = far_and_near(base, self.joint)
        for trial in distinct(screen(self.columns, base, effects, (self.joint,)), count):
            model = fit(self.columns, (*far, *near, trial), base.sigma, is_free=base.is_free,
                        w=base.w, rounds=2, steps=10, still=len(far))  # fmt: skip
            if model.is_possible() and np.isfinite(model.score):
                yield model

    def _bases(self) -> Iterator[Model]:
        """Yield models of all other joints with some of the effects of this one.

        With bodies as in the file, and free; with a rotor for loads, which may imitate the law.
        """
        others, rotor = self._others(), EffectAt(ARMATURE, Place(self.joint))
        plain = tuple(s for s in others if not s.effect.is_body)
        for more in dict.fromkeys([others, (*plain, rotor) if plain != others else others]):
            for is_free in (False, True):
                for kept in beside(self.listed, self.joint, is_open=self.is_open):
                    unique = {s.key: s for s in (*more, *kept)}
                    yield self._without(tuple(unique.values()), is_free=is_free)

    def _others(self) -> tuple[EffectAt, ...]:
        own = own_effects(self.listed, self.joint)
        return tuple(s for s in self.listed.effects if s not in own)

    def _without(self, kept: tuple[EffectAt, ...], *, is_free: bool) -> Model:
        return fit(self.columns, kept, self.listed.sigma, is_free=is_free, rounds=2, steps=4,
                   still=len(kept))  # fmt: skip
