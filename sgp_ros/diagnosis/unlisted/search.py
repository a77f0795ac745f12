"""The search for a law at a joint that listed effects do not describe, or describe only nearly.

First a smooth force of one variable, with a factor in another, takes the place of effects of the
joint, alone and beside those that may be right. Where none is worth more than the listed ones, no
law is looked for. Else the formulas of the best variables and factors are fitted, each jointly
with the bodies and all other effects, as every other model is.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from sgp_ros.batch.least_squares import correlation_factor
from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import ALIKE, NEARLY
from sgp_ros.diagnosis.decide.decision import Scale
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.diagnosis.unlisted.formulas import FoundLaw, formulas
from sgp_ros.diagnosis.unlisted.shapes import FINE, SmoothForce, smooth_forces
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.law import FormulaLaw
from sgp_ros.physics.parts import JOINT, MOTOR

SMOOTH, SHAPES, FITTED = 3, 4, 6
"""Smooth forces fitted beside each choice of kept effects; of all of these, those for which
formulas are screened; formulas fitted for each but the best, of which all are."""
EARNED = 3
"""Best models with a formula in which every listed effect must earn its price again."""


@dataclass(frozen=True, eq=False)
class Searched:
    """What a search at one joint ended with.

    Attributes:
        joint: index.
        listed: best model of listed effects.
        smooth: best model with a smooth force at the joint.
        laws: models with a formula there, best first.
        fine: model like the first of them, with a spline that follows any law.
    """

    joint: int
    listed: Model
    smooth: Model
    laws: tuple[Model, ...]
    fine: Model | None

    @property
    def lack_of_fit(self) -> tuple[float, float]:
        """Ratio of what the first formula leaves to what the fine spline does, and its chance.

        The chance is that of the F test on as many rows as are independent (Fisher 1922).
        """
        assert self.fine is not None
        law, fine = (float(m.mean_square[self.joint]) for m in (self.laws[0], self.fine))
        more = self.fine.size - self.laws[0].size
        r = self.fine.residual[:, self.joint]
        rows = len(r) / max(correlation_factor(r), 1.0) - self.fine.size
        excess = (law - fine) / max(fine, 1e-300) * rows / max(more, 1)
        return law / max(fine, 1e-300), float(stats.f.sf(excess, max(more, 1), max(rows, 1.0)))


def law_of(model: Model, joint: int) -> EffectAt | None:
    """Return the formula or the smooth force of a model at a joint; None where there is none."""
    found = (
        s for s in model.effects
        if s.place.joint == joint and isinstance(s.effect, (FormulaLaw, SmoothForce))
    )  # fmt: skip
    return next(found, None)


def search(equations: Equations, scale: Scale, listed: Model, joint: int) -> Searched | None:
    """Return what explains a joint better than listed effects, at its price; None for nothing.

    Args:
        equations: of the recording.
        scale: of mean squares.
        listed: best model of listed effects, adequate or not.
        joint: index.
    """
    scale = replace(scale, nominal=np.zeros_like(scale.nominal))  # splines have no shape to err in
    look = _Look(Columns(equations), scale, listed, joint)
    smooth = sorted(look.smooth(), key=lambda m: -scale.worth(m))
    if not smooth or scale.worth(smooth[0]) < scale.worth(listed) + ALIKE:
        return None
    if smooth[0].mean_square[joint] > NEARLY * listed.mean_square[joint]:
        return None
    laws: dict[object, Model] = {}
    for number, model in enumerate(smooth[:SHAPES]):
        for law in look.formulas(model, FITTED if number else None):
            key = law.key, law.is_free
            if key not in laws or scale.worth(law) > scale.worth(laws[key]):
                laws[key] = law
    ranked = sorted(laws.values(), key=lambda m: -scale.worth(m))
    again = [earned(look.columns, scale, m, joint) for m in ranked[:EARNED]]
    ranked = sorted([*again, *ranked[EARNED:]], key=lambda m: -scale.worth(m))
    fine = look.fine(ranked[0]) if ranked else None
    return Searched(joint, listed, smooth[0], tuple(ranked), fine)


@dataclass(frozen=True, eq=False)
class _Look:
    """Where a law is looked for, and what is there already."""

    columns: Columns
    scale: Scale
    listed: Model
    joint: int

    def smooth(self) -> Iterator[Model]:
        """Yield models with a smooth force in place of, and beside, effects of the joint."""
        motion = self.columns.equations(frozenset()).motion
        effects = list(smooth_forces(motion, self.joint))
        for base in self._bases():
            own = own_effects(base, self.joint)
            others = [e for e in effects if e.gate not in {'', 'sign'}
                      or not any(e.variable.is_of(s) for s in own)]  # fmt: skip
            yield from self._fitted(base, others, SMOOTH)

    def fine(self, model: Model) -> Model:
        """Return a model with a fine spline in place of its formula."""
        law = law_of(model, self.joint)
        assert law is not None
        assert isinstance(law.effect, FoundLaw)
        motion = self.columns.equations(frozenset()).motion
        coarse = law.effect.smooth
        knots = coarse.variable.knots(motion, FINE)
        width, name = law.report(motion).get('v1', 0.0), motion.tree.moving_names[self.joint]
        fine = SmoothForce(self.joint, coarse.variable, coarse.gate, knots, name, float(width))
        effects = tuple(EffectAt(fine, s.place) if s is law else s for s in model.effects)
        return fit(self.columns, effects, model.sigma, is_free=model.is_free, w=model.w, rounds=2,
                   steps=4, still=len(effects))  # fmt: skip

    def formulas(self, smooth: Model, count: int | None) -> Iterator[Model]:
        """Yield models with so many formulas in place of the smooth force of a model."""
        chosen = law_of(smooth, self.joint)
        assert chosen is not None
        assert isinstance(chosen.effect, SmoothForce)
        kept = tuple(s for s in smooth.effects if s is not chosen)
        base = self._without(kept, is_free=smooth.is_free)
        motion = self.columns.equations(frozenset()).motion
        yield from self._fitted(base, list(formulas(chosen.effect, motion)), count)

    def _fitted(
        self, base: Model, effects: list[SmoothForce] | list[FoundLaw], count: int | None
    ) -> Iterator[Model]:
        """Yield the best of some effects beside a model, fitted."""
        best: dict[object, EffectAt] = {}
        for _, trial in screen(self.columns, base, effects, (self.joint,)):
            best.setdefault(trial.key, trial)
        for trial in list(best.values())[:count]:
            model = fit(self.columns, (*base.effects, trial), base.sigma, is_free=base.is_free,
                        w=base.w, rounds=2, steps=10)  # fmt: skip
            if model.is_possible() and np.isfinite(model.score):
                yield model

    def _bases(self) -> Iterator[Model]:
        """Yield models of all other joints with some of the effects of this one.

        None, all, and all but one; with bodies as in the robot's file, and free.
        """
        for is_free in (False, True):
            for kept in _subsets(own_effects(self.listed, self.joint)):
                yield self._without((*self._others(), *kept), is_free=is_free)

    def _others(self) -> tuple[EffectAt, ...]:
        own = own_effects(self.listed, self.joint)
        return tuple(s for s in self.listed.effects if s not in own)

    def _without(self, kept: tuple[EffectAt, ...], *, is_free: bool) -> Model:
        return fit(self.columns, kept, self.listed.sigma, is_free=is_free, rounds=2, steps=4,
                   still=len(kept))  # fmt: skip


def earned(columns: Columns, scale: Scale, model: Model, joint: int) -> Model:
    """Return a model without the listed effects that are not worth their price beside its formula.

    They were chosen before the formula was known, and may have stood for a part of it. One after
    the other goes, and the formula and all others are fitted again, as long as that is worth more.

    Args:
        columns: of the recording.
        scale: of mean squares.
        model: with a formula at the joint.
        joint: index.
    """
    law = law_of(model, joint)
    trials = []
    for out in model.effects:
        left = tuple(s for s in model.effects if s is not out)
        if out is not law:
            trials += [
                fit(columns, left, model.sigma, is_free=is_free, rounds=2, steps=10)
                for is_free in dict.fromkeys((False, model.is_free))
            ]
    possible = [t for t in trials if t.is_possible() and np.isfinite(t.score)]
    best = max(possible, key=scale.worth, default=model)
    if scale.worth(best) <= scale.worth(model):
        return model
    return earned(columns, scale, best, joint)


def own_effects(model: Model, joint: int) -> tuple[EffectAt, ...]:
    """Return the effects that a model has at a joint alone."""
    own = {JOINT, MOTOR}
    return tuple(s for s in model.effects if s.place.joint == joint and s.effect.site in own)


def _subsets(effects: tuple[EffectAt, ...]) -> Iterable[tuple[EffectAt, ...]]:
    found = [(), effects, *(tuple(s for s in effects if s is not out) for out in effects)]
    return dict.fromkeys(found)
