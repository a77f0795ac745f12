"""Simpler models that are hardly worth less than the one that was decided."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import ALIKE, INTERVAL
from sgp_ros.diagnosis.decide.cross_validation import without
from sgp_ros.diagnosis.decide.decision import Decision
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.credibility import is_credible
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.uncertainty import reported_std
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place


def simpler(equations: Equations, decision: Decision, scale: Scale) -> Model | None:
    """Return a model without a law that few joints have and that is hardly worth more.

    With its plain law in its place, where there is one, on either joint or both if it has two; or
    a usual one that looks alike, or a law of fewer numbers that a rival has there. Where what it
    adds to its plain law may be nothing, this takes its place if it leaves no physics.
    """
    model = decision.model
    least = scale.worth(model) - ALIKE
    near = [m for m in decision.rivals if scale.worth(m) > least]
    for s in model.effects:
        if s.effect.is_usual or s.is_further_wave:
            continue
        laws = [
            *((EffectAt(EFFECTS[name], Place(s.place.joint)),) for name in s.effect.alike),
            *_on_its_joints(s),
            *((law,) for law in _of_fewer_numbers(s, near)),
        ]
        without_it = (without_one(equations, model, s),)
        for trial in chain(without_it, _exchanged(equations, model, s, laws)):
            if trial.effects and is_credible(trial) and scale.worth(trial) > least:
                return trial
        plain = without_it[0]
        is_plain = bool(s.effect.plain) and (s.effect.plain[0], s.place) in plain.key
        if (
            is_plain
            and adds_nothing(equations, model, s)
            and not (scale.excess(plain) >= np.maximum(scale.excess(model), 1.0)).any()
        ):
            return plain
    return None


def adds_nothing(equations: Equations, model: Model, effect: EffectAt) -> bool:
    """Return whether the 95 % interval of all that sets a law apart from its plain one is none.

    Such as friction that grows with a load which hardly changes.
    """
    known = {q.name for q in EFFECTS[effect.effect.plain[0]].quantities}
    own = [q for q in effect.sizes if q.name not in known]
    if len(own) == len(effect.sizes) or not own:
        return False
    index = [s is effect for s in model.effects].index(True)
    std = reported_std(model, Columns(equations))[index]
    numbers = effect.report(equations.motion)
    return all(
        abs(float(numbers[q.name]) - q.neutral) < INTERVAL * std.get(q.name, 0.0) for q in own
    )


def _on_its_joints(effect: EffectAt) -> Iterator[tuple[EffectAt, ...]]:
    """Yield a plain law of one that acts between two joints, on both of them and on each."""
    joints = (effect.place.joint, effect.place.source)
    for name in effect.effect.plain if joints[1] >= 0 else ():
        each = tuple(EffectAt(EFFECTS[name], Place(j)) for j in joints)
        yield from (each, each[:1], each[1:])


def _of_fewer_numbers(effect: EffectAt, rivals: list[Model]) -> list[EffectAt]:
    """Return the laws of fewer numbers that rivals have in the place of an effect.

    Which of several formulas says it best is decided before, where each has its price.
    """
    numbers, is_formula = len(effect.effect.quantities), effect.effect.has_chosen_form
    found = {s.key: s for m in rivals for s in m.effects
             if s.place == effect.place and len(s.effect.quantities) < numbers
             and not (is_formula and s.effect.has_chosen_form)}  # fmt: skip
    return list(found.values())


def _exchanged(
    equations: Equations, model: Model, effect: EffectAt, laws: list[tuple[EffectAt, ...]]
) -> Iterator[Model]:
    """Yield models with other laws, one or more, in the place of an effect."""
    others = tuple(s for s in model.effects if s is not effect)
    for some in laws:
        new = tuple(law for law in some if law.key not in model.key)
        if new:
            yield fit(Columns(equations), (*others, *new), model.sigma, is_free=model.is_free,
                      w=model.w, still=len(others))  # fmt: skip


def without_one(equations: Equations, model: Model, effect: EffectAt) -> Model:
    """Return a model with the plain law of an effect in its place, or else without it."""
    fewer = without(equations, model, lambda s: s is effect)
    place, plain = effect.place, effect.effect.plain[:1]
    if not plain or place.source >= 0 or place.kind or (plain[0], place) in model.key:
        return fewer
    plainest = (*fewer.effects, EffectAt(EFFECTS[plain[0]], place))
    trial = fit(Columns(equations), plainest, model.sigma, is_free=model.is_free, w=model.w,
                still=len(fewer.effects))  # fmt: skip
    return trial if is_credible(trial) else fewer
