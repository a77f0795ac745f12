"""Decision whether a law that was found is asserted, with the reason where it is not.

A formula is asserted where it is worth more than every listed effect, every shorter formula and
the smooth force without form, predicts parts left out, describes its joint as any law must, has
all its numbers inside their ranges, is finite over the range of the joints, and holds most of the
odds against all formulas that would predict something else in other motions. Else the joint is
unexplained, and listed effects that explain it less well than the smooth force are not asserted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import (
    ALIKE,
    BENT_BODIES,
    LACKING,
    LEAST_LAW,
    NEARLY,
    SIGNIFICANT,
)
from sgp_ros.diagnosis.decide.certainty import probabilities
from sgp_ros.diagnosis.decide.cross_validation import structure
from sgp_ros.diagnosis.decide.decision import Decision, decide, refused
from sgp_ros.diagnosis.decide.equivalence import Contrasts, moved
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.fitted_model import Model, adds_to_usual
from sgp_ros.diagnosis.explain.joint_search import usual
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.unlisted.beside import PLAIN, acts_as_bodies, law_of, own_effects
from sgp_ros.diagnosis.unlisted.search import search
from sgp_ros.diagnosis.unlisted.searched import Searched, leaves_more
from sgp_ros.diagnosis.unlisted.shapes import smooth_of
from sgp_ros.diagnosis.unlisted.shorter import idle
from sgp_ros.diagnosis.unlisted.tried import is_beaten, promises
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place

MOST_JOINTS = 3
"""Joints at which a law is looked for, those first of which most is left or explained."""
_RIVALS = 8
_STEPS = 8


@dataclass(frozen=True, eq=False)
class Explained:
    """Decision after the search for unlisted laws.

    Attributes:
        comparison: with the models of formulas.
        decision: on these.
        searched: at each joint where a smooth force is worth more than listed effects.
        why_not: by joint, why no formula is asserted there; absent where one is.
    """

    comparison: Comparison
    decision: Decision
    searched: tuple[Searched, ...]
    why_not: dict[int, str]


def with_laws(equations: Equations, comparison: Comparison, decision: Decision) -> Explained:
    """Return the decision with unlisted laws, where listed effects explain too little.

    Args:
        equations: of one recording.
        comparison: of listed effects.
        decision: on these.
    """
    found, columns = Explained(comparison, decision, (), {}), Columns(equations)
    scale, joints = Scale.of(equations, comparison), _joints(equations, comparison, decision)
    named = [j for j in joints if j not in decision.unknown]
    coloured = _coloured(equations, scale, decision.model, named)
    bent = _bent(decision.model)
    open_ = {*decision.unknown, *coloured, *_remembering(decision.model), *bent}
    apart, waiting = _apart(columns, decision, bent), list[Searched]()
    for joint in joints:
        listed = found.decision.tentative or found.decision.model
        listed = waiting[-1].laws[0] if waiting else apart or listed
        is_open = joint in open_
        if not is_open and not promises(columns, listed, joint):
            continue
        searched = search(columns, scale, listed, joint, is_open=is_open)
        if searched is None or (joint in bent and not _is_better(scale, searched, decision)):
            continue
        more = replace(found, searched=(*found.searched, searched))
        more = _decided(equations, more, searched, waiting)
        is_law = law_of(more.decision.model, joint) is not None
        if not searched.is_slight or is_law:
            found = more
        if is_law:
            apart, waiting = None, []
        elif joint in decision.unknown and not _objection(equations, comparison, searched):
            waiting.append(searched)
    return found


def _is_better(scale: Scale, searched: Searched, decision: Decision) -> bool:
    """Return whether a force beats all that is asserted."""
    asserted, forms = decision.tentative or decision.model, scale.of_forms()
    found = (searched.smooth, *searched.laws[:1])
    return any(is_beaten(forms, asserted, m, searched.joint) for m in found)


def _bent(model: Model) -> set[int]:
    """Return the joints of rare laws beside unlikely bodies: both may imitate another law."""
    if not model.is_free or model.strain < BENT_BODIES:
        return set()
    rare = (s.place for s in model.effects if not adds_to_usual(s.effect))
    return {j for place in rare for j in (place.joint, place.source) if j >= 0}


def _apart(columns: Columns, decision: Decision, bent: set[int]) -> Model | None:
    """Return the best model with everyday laws in place of those of two unknown joints.

    And of rare laws beside bent bodies. None where it has none. They may imitate another law.
    """
    model = decision.tentative or decision.model
    kept = tuple(
        s
        for s in model.effects
        if (s.place.source < 0 or not {s.place.joint, s.place.source} <= {*decision.unknown})
        and (adds_to_usual(s.effect) or s.place.joint not in bent)
    )
    return None if kept == model.effects else usual(columns, model, kept, least=0.0)


def _coloured(equations: Equations, scale: Scale, model: Model, named: list[int]) -> list[int]:
    """Return the named joints where more is left than noise, though no law of the motion now.

    A force that remembers the motion looks like that beside listed laws, as a disturbance does.
    """
    if (scale.excess(model)[named] < 1.0).all():
        return []
    share = structure(equations, model.residual)
    excess = scale.excess(model, np.stack([share, share]))
    return [j for j in named if excess[j] >= 1.0]


def _remembering(model: Model) -> list[int]:
    """Return the joints with a listed law that remembers the way; one that forgets looks alike."""
    return [s.place.joint for s in model.effects if s.effect.has_memory]


def _joints(equations: Equations, comparison: Comparison, decision: Decision) -> list[int]:
    """Return the joints that are unexplained, then those with effects that are asserted."""
    model = decision.tentative or decision.model
    k = equations.d.shape[1]
    named = [j for j in range(k) if own_effects(model, j)]
    size = Scale.of(equations, comparison).found(model)
    order = sorted(named, key=lambda j: -size[j])
    return list(dict.fromkeys((*decision.unknown, *order)))[:MOST_JOINTS]


def _decided(
    equations: Equations, found: Explained, searched: Searched, waiting: Sequence[Searched]
) -> Explained:
    """Return what is decided with the laws of one more joint.

    Those of the joints that are waiting, which alone would leave others unexplained, are in them.
    """
    is_open = searched.joint in found.decision.unknown
    if not is_open and _is_listed(equations, found.comparison, searched):
        return found
    plain = _in_plain_laws(equations, found.comparison, searched)
    if plain is not None:
        comparison = replace(found.comparison, more=(*found.comparison.more, plain))
        return replace(found, comparison=comparison, decision=decide(equations, comparison))
    why = _objection(equations, found.comparison, searched)
    if not why:
        laws, more = searched.laws[:_RIVALS], found.comparison.more
        # which formula says it best is known: errors of a column's shape count between names only
        decision = decide(equations, replace(found.comparison, more=(*more, laws[0])))
        decision = replace(decision, rivals=(*laws[1:], *decision.rivals))
        laws = (*laws, *_rivals(equations, laws[0], waiting))
        comparison = replace(found.comparison, more=(*more, *laws))
        doubts = (_doubt(equations, comparison, decision, s) for s in (searched, *waiting))
        why = next(filter(None, doubts), '')
        if not why:
            said = {s.joint for s in waiting}
            why_not = {j: x for j, x in found.why_not.items() if j not in said}
            return replace(found, comparison=comparison, decision=decision, why_not=why_not)
    joint = equations.motion.tree.joint_names[searched.joint]
    named = f'a force without a formula describes {joint} better than listed effects do'
    decision = refused(equations, found.comparison, found.decision, searched.joint, named)
    laws = searched.laws[:_RIVALS]
    refusals = dict(decision.refusals) | {m.key: f'no formula is asserted: {why}' for m in laws}
    beside = searched.everyday(Columns(equations), Scale.of(equations, found.comparison))
    is_friction = smooth_of(searched.smooth, searched.joint)[1].is_of_own_speed
    if beside is None and is_friction:  # which may be any friction: none is told apart from it
        beside = decision.model, {}
    shaped = {**decision.shaped, **({searched.joint: beside} if beside else {})}
    decision = replace(
        decision, rivals=(*laws, *decision.rivals), refusals=refusals, shaped=shaped
    )
    return replace(found, decision=decision, why_not=found.why_not | {searched.joint: why})


def _rivals(equations: Equations, best: Model, waiting: Sequence[Searched]) -> Iterator[Model]:
    """Yield a model with other formulas in place of those of the joints that are waiting."""
    columns = Columns(equations)
    for searched in waiting:
        law = law_of(best, searched.joint)
        others = tuple(s for s in best.effects if s is not law)
        for rival in searched.laws[1:_RIVALS]:
            other = law_of(rival, searched.joint)
            assert other is not None
            yield fit(columns, (*others, other), best.sigma, is_free=best.is_free, w=best.w,
                      rounds=2, steps=_STEPS, still=len(others))  # fmt: skip


def _is_listed(equations: Equations, comparison: Comparison, searched: Searched) -> bool:
    """Return whether listed laws, with bodies of any kind, say as much as the best formula.

    And as much as a force without a formula, where that differs from them by more than a trifle.
    """
    if not searched.laws:
        return False
    scale = Scale.of(equations, comparison).of_forms()
    listed = (*comparison.singles, *comparison.pairs, *comparison.more)
    found = searched.laws[:1] if searched.is_slight else (searched.laws[0], searched.smooth)
    least = max(map(scale.worth, found)) - ALIKE
    return any(scale.worth(m) > least and scale.counts(m) for m in listed)


def _in_plain_laws(
    equations: Equations, comparison: Comparison, searched: Searched
) -> Model | None:
    """Return the best model with plain laws of friction and load in place of the best formula.

    None where the formula needs all its coefficients, and is worth more than any sum of them and
    leaves clearly less: three laws that every joint may have are likelier than a formula of five
    numbers, whatever their number costs.
    """
    if not searched.laws:
        return None
    best, joint, columns = searched.laws[0], searched.joint, Columns(equations)
    scale = Scale.of(equations, comparison).of_forms()
    law = law_of(best, joint)
    others = tuple(s for s in best.effects if s is not law)
    missing = [e for e in PLAIN if all(s.effect is not e for s in own_effects(best, joint))]
    sums = (c for n in range(len(missing)) for c in combinations(missing, n + 1))
    tried = [
        fit(
            columns, (*others, *(EffectAt(e, Place(joint)) for e in added)), best.sigma,
            is_free=is_free, still=len(others),
        )
        for added in sums
        for is_free in dict.fromkeys((False, best.is_free))
    ]  # fmt: skip
    if not tried:
        return None
    most = max(tried, key=scale.worth)
    plain = fit(columns, most.effects, most.sigma, is_free=most.is_free, w=most.w, steps=_STEPS)
    is_near = best.mean_square[joint] > NEARLY * plain.mean_square[joint]
    is_as_good = is_near or scale.worth(best) < scale.worth(plain) + ALIKE
    return plain if is_as_good or idle(columns, best, joint) else None


def _objection(equations: Equations, comparison: Comparison, searched: Searched) -> str:
    """Return the objection to the best formula by itself; empty for none."""
    if not searched.laws:
        return 'every formula tried would need impossible parameters'
    best, scale = searched.laws[0], Scale.of(equations, comparison).of_forms()
    if scale.worth(best) < scale.worth(searched.smooth):
        return 'no formula tried stays within the 95 % band of the shape'
    law, (ratio, chance) = law_of(best, searched.joint), searched.lack_of_fit
    assert law is not None
    if (ratio > LACKING and chance < SIGNIFICANT) or leaves_more(equations, best, law):
        return 'the best formula follows the force only approximately'
    motion = equations.motion
    if law.at_bounds(motion):
        return 'a parameter of the best formula is at the limit of what this motion determines'
    if acts_as_bodies(equations, best.parts[best.effects.index(law)], searched.joint):
        return 'other bodies, or other lengths, than those of the robot file would act much alike'
    wide = law.force(moved(motion, np.inf, 1.0, 0.0))
    return '' if np.isfinite(wide).all() else 'the best formula is not finite over the range'


def _doubt(
    equations: Equations, comparison: Comparison, decision: Decision, searched: Searched
) -> str:
    """Return why the decision on all models does not assert the law; empty where it does."""
    law = law_of(decision.model, searched.joint)
    if decision.verdict != 'missing_physics' or law is None or searched.joint in decision.unknown:
        return 'the best formula leaves more than noise, or fails to predict held-out parts'
    model = decision.model
    contrasts = Contrasts(equations, model)
    chances = probabilities(equations, comparison, decision, contrasts)
    index = [s is law for s in model.effects].index(True)
    if chances.of(model, index) < LEAST_LAW:
        return 'other formulas fit this motion equally well but differ on other motions'
    return ''
