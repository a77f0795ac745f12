"""Decision whether a law of the tool that was found is asserted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import ALIKE, COUNTED_SHARE, INTERVAL, LEAST_LAW
from sgp_ros.diagnosis.decide.certainty import probabilities
from sgp_ros.diagnosis.decide.decision import Decision, decide, refused
from sgp_ros.diagnosis.decide.equivalence import Contrasts
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.uncertainty import reported_std
from sgp_ros.diagnosis.unlisted.tool_search import is_asked, tool_law_of, tool_models
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.tool_law import ToolLaw

_RIVALS = 4


def with_tool_law(
    equations: Equations, comparison: Comparison, decision: Decision
) -> tuple[Comparison, Decision]:
    """Return comparison and decision with a law of the tool, where it explains more.

    It is asserted where it leaves no joint that it acts on unexplained, none of its numbers is at
    a bound, no friction beside it is less than stated, which it might stand for, and no other
    formula of a path says as much. Where it is worth more than all listed
    effects and yet not asserted, the joint that it acts on most is unexplained.

    Args:
        equations: of one recording.
        comparison: of listed effects.
        decision: on these.
    """
    columns = Columns(equations)
    if not is_asked(columns, decision):
        return comparison, decision
    scale = Scale.of(equations, comparison).of_forms()
    models = tool_models(columns, scale, decision)
    listed = decision.tentative or decision.model
    if not models or scale.worth(models[0]) <= scale.worth(listed) + ALIKE:
        return comparison, decision
    least = scale.worth(models[0]) - ALIKE
    alike = [m for m in models if not _is_limit(m) and scale.worth(m) > least]
    best = next((m for m in alike if _is_sized(m, columns)), (alike or models)[0])
    rivals = tuple(m for m in models if m is not best)[:_RIVALS]
    with_best = replace(comparison, more=(*comparison.more, best))
    found = decide(equations, with_best)
    found = replace(found, rivals=(*rivals, *found.rivals))
    why = _doubt(equations, replace(with_best, more=(*with_best.more, *rivals)), found)
    if not why:
        return with_best, found
    joint = int(np.argmax(_shares(best)))
    name = equations.motion.tree.joint_names[joint]
    named = f'a force on the tool describes {name} better than listed effects do'
    found = refused(equations, comparison, decision, joint, named)
    refusals = dict(found.refusals) | {m.key: f'not asserted: {why}' for m in (best, *rivals)}
    return comparison, replace(found, rivals=(best, *rivals, *found.rivals), refusals=refusals)


def tool_remarks(decision: Decision) -> tuple[str, ...]:
    """Return what a law of the tool that is asserted says, in words."""
    law = tool_law_of(decision.model)
    if law is None:
        return ()
    assert isinstance(law.effect, ToolLaw)
    return (law.effect.sentence(law, decision.model.frame.equations.motion),)


def _is_limit(model: Model) -> bool:
    """Return whether a number of a law of the tool is at its bound: another formula says it."""
    law = tool_law_of(model)
    return law is not None and bool(law.at_bounds(model.frame.equations.motion))


def _is_sized(model: Model, columns: Columns) -> bool:
    """Return whether the 95 % interval of each size of a law of the tool excludes none."""
    placed = tool_law_of(model)
    assert placed is not None
    std = reported_std(model, columns)[model.effects.index(placed)]
    numbers = placed.report(model.frame.equations.motion)
    return all(abs(float(numbers[q.name]) - q.neutral) > INTERVAL * std.get(q.name, 0.0)
               for q in placed.sizes)  # fmt: skip


def _is_less(s: EffectAt) -> bool:
    """Return whether an effect that takes energy gives it: there is less than is stated."""
    term = s.effect.term
    return term is not None and term.is_dissipative and bool((s.coefficients < 0.0).any())


def _shares(model: Model) -> np.ndarray:
    """Return the share of the mean squared effort that a law of the tool has at joints (k,)."""
    index = [s is tool_law_of(model) for s in model.effects].index(True)
    return np.asarray((model.forces[index] ** 2).mean(axis=0) / model.frame.equations.power)


def _doubt(equations: Equations, comparison: Comparison, decision: Decision) -> str:
    """Return why a law of the tool is not asserted; empty where it is."""
    law = tool_law_of(decision.model)
    if decision.verdict != 'missing_physics' or law is None:
        return 'it leaves more than noise, or fails to predict parts left out'
    if _is_limit(decision.model):
        return 'one of its numbers is at the limit of what this motion determines'
    acted = _shares(decision.model) > COUNTED_SHARE
    if acted[list(decision.unknown)].any():
        return 'it leaves physics at a joint on which it acts'
    if any(_is_less(s) and acted[s.place.joint] for s in decision.model.effects):
        return 'friction beside it is less than the robot file states: it may stand for the rest'
    contrasts = Contrasts(equations, decision.model)
    chances = probabilities(equations, comparison, decision, contrasts)
    index = [s is law for s in decision.model.effects].index(True)
    if chances.of(decision.model, index) < LEAST_LAW:
        return 'other forces on the tool fit this motion as well but differ on other motions'
    return ''
