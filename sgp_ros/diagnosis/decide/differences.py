"""Differences between several recordings of one robot: a load taken up, friction, a mount.

All recordings share one model. A difference is a law that acts in one recording alone, on top of
what is common, fitted together with it. Laws that may differ are those without a shape to search,
such as levels of friction, loads and the zero of an encoder, and those that change gravity or
bodies. One after the other is added while it is worth its price and predicts parts that were left
out. A law of the common model that one recording alone needs is moved there; so of two recordings
of which one carries a load, that one is named. Where either is possible, such as friction that is
lower in the second or higher in the first, the first recording is taken as the common one.

What differs would hide what is common. So once differences are found, they are taken off, the
common models are compared anew, and differences are looked for again beside the new one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import COUNTED_SHARE, DOUBTED, EVIDENCE, MOST_CERTAIN, TEMPER
from sgp_ros.diagnosis.decide.decision import Decision, decide, refused
from sgp_ros.diagnosis.decide.each_alone import models_of_each, put_together
from sgp_ros.diagnosis.decide.equivalence import Contrasts
from sgp_ros.diagnosis.decide.scale import Scale, moving_power
from sgp_ros.diagnosis.decide.support import support
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.comparison import Comparison, compare_models
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.in_recording import InRecording, may_differ, own_laws, within
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.physics.catalogue import EFFECTS, ENCODER_OFFSET
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import JOINT, MOTOR, Place

TRIED = 3
"""Laws that are fitted on a recording, each time one is added."""
ALIKE = 0.1
"""Difference in worth below which two models are the same one, found twice [nats]."""


@dataclass(frozen=True, eq=False)
class Several:
    """Common model of several recordings, and their differences.

    Attributes:
        equations: with what differs taken off.
        comparison, decision: of what is common, on these.
        model: effects that are common and effects in one recording, fitted together on all.
        chances: probability of each effect of the model that is in one recording, by its key.
    """

    equations: Equations
    comparison: Comparison
    decision: Decision
    model: Model
    chances: dict[object, float]


def decide_several(
    equations: Equations,
    count: int,
    progress: Callable[[float], None],
    alone: Callable[[int], Equations],
) -> Several:
    """Compare models on several recordings and return what is common and what differs.

    Args:
        equations: of all recordings.
        count: of the recordings.
        progress: called with the share that is done.
        alone: gives the equations of each recording; not asked where a common model explains all.
    """
    part = 1.0 if count == 1 else 0.4
    comparison = compare_models(equations, lambda share: progress(part * share))
    decision = decide(equations, comparison)
    if count == 1:
        return Several(equations, comparison, decision, decision.model, {})
    search = _Search(Columns(equations), Scale.of(equations, comparison), count)
    # the best common model, adequate or not: differences may spoil it
    models = (comparison.base, *comparison.singles, *comparison.pairs, *comparison.more)
    model = max((decision.model, *models), key=search.scale.worth)
    is_explained = decision.verdict != 'unexplained'
    if is_explained:
        model = search.extended(model)
    if own_laws(model.effects) or not is_explained:
        model = max(model, search.from_each(model, alone), key=search.worth)
    progress(0.5)
    own = own_laws(model.effects)
    if not own:
        return Several(equations, comparison, decision, decision.model, {})
    left = replace(equations, d=equations.d - force_of(model, own))
    comparison = compare_models(left, lambda share: progress(0.5 + 0.4 * share))
    decision = decide(left, comparison)
    model = search.possible(search.fitted(decision.model, (*decision.model.effects, *own)))
    if decision.verdict != 'unexplained':
        model = search.extended(model)
    chances: dict[object, float] = {
        s.key: search.chance(model, s) for s in own_laws(model.effects)
    }
    if decision.verdict == 'unexplained':  # what is unknown may differ by chance
        chances = {key: min(p, DOUBTED) for key, p in chances.items()}
    return Several(left, comparison, decision, model, chances)


def force_of(model: Model, some: tuple[EffectAt, ...]) -> np.ndarray:
    """Return the filtered force of some effects of a model, (N, k) [N m or N]."""
    parts = zip(model.effects, model.forces, strict=True)
    return np.asarray(sum(force for s, force in parts if s in some))


def without_laws_of(several: Several, joints: Mapping[str, str]) -> Several:
    """Return the decision with the laws of some joints refused.

    With several recordings, differences depend on the common model, and nothing is refused.

    Args:
        several: decided.
        joints: names, and why: a sentence each.
    """
    decision, names = several.decision, several.equations.motion.tree.joint_names
    own = {
        s.place.joint for s in decision.model.effects
        if s.effect.site in {JOINT, MOTOR} and s.place.joint >= 0
        and names[s.place.joint] in joints
    }  # fmt: skip
    if several.chances or decision.verdict != 'missing_physics' or not own - {*decision.unknown}:
        return several
    for joint in own:
        why = joints[names[joint]].removesuffix('.')
        why = why[:1].lower() + why[1:]
        decision = refused(several.equations, several.comparison, decision, joint, why)
    return replace(several, decision=decision, model=decision.model)


@dataclass(frozen=True, eq=False)
class _Search:
    """Search for differences between so many recordings."""

    columns: Columns
    scale: Scale
    count: int

    def from_each(self, model: Model, alone: Callable[[int], Equations]) -> Model:
        """Return what models of each recording alone make, extended; without any, this one is."""
        models = models_of_each(map(alone, range(self.count)))
        if not models:
            return self.extended(model)
        first = next(iter(models.values()))
        return self.extended(self.fitted(first, put_together(models)))

    def extended(self, model: Model) -> Model:
        """Return the model with all differences that are worth their price."""
        while True:
            trials = [*self._moved(model), *self._shared(model), *self._simpler(model),
                      *self._fewer(model)]  # fmt: skip
            for r in range(self.count):
                trials += self._added(model, r)
            known = map(self.possible, trials)
            possible = (m for m in known if m.is_possible() and np.isfinite(m.score))
            worth, least = {m: self.worth(m) for m in possible}, self.worth(model) + ALIKE
            better = sorted((m for m in worth if worth[m] > least), key=lambda m: -worth[m])
            if (best := next(filter(self._holds, better), None)) is None:
                return model
            model = best

    def worth(self, model: Model) -> float:
        """Return the worth of a model; between equal ones, more common laws win."""
        own = [s.effect.recording for s in model.effects if isinstance(s.effect, InRecording)]
        return self.scale.worth(model) - 4.0 * ALIKE * len(own) - 2.0 * ALIKE * own.count(0)

    def fitted(self, model: Model, effects: tuple[EffectAt, ...]) -> Model:
        """Return the model with other effects."""
        joints = frozenset(s.place.joint for s in effects if not isinstance(s.effect, InRecording))
        effects = tuple(
            replace(s, effect=InRecording(s.effect.law, s.effect.recording, joints))
            if isinstance(s.effect, InRecording) else s
            for s in effects
        )  # fmt: skip
        return fit(self.columns, effects, model.sigma, is_free=model.is_free, w=model.w, rounds=2,
                   steps=8)  # fmt: skip

    def possible(self, model: Model) -> Model:
        """Return the model with plain laws for common ones that are impossible beside the others.

        They were chosen for what the differences leave, and are fitted with these.
        """
        motion = model.frame.equations.motion
        while True:
            common = [s for s in model.effects if not isinstance(s.effect, InRecording)]
            wrong = [s for s in common if not s.is_possible(motion)]
            if not wrong:
                return model
            kept = {s.key: s for s in model.effects if s not in wrong}
            plain = [EffectAt(EFFECTS[n], Place(s.place.joint)) for s in wrong
                     for n in s.effect.plain[:1]]  # fmt: skip
            effects = {s.key: s for s in plain} | kept
            model = self.fitted(model, tuple(effects.values()))

    def chance(self, model: Model, one: EffectAt) -> float:
        """Return the probability of an effect in one recording, against none and others there."""
        assert isinstance(one.effect, InRecording)
        without = self.fitted(model, tuple(s for s in model.effects if s.key != one.key))
        r = one.effect.recording
        said = Contrasts(self.columns.equations(frozenset()), within(model, r))
        others = (m for m in self._added(without, r) if m.key != model.key and m.is_possible())
        rivals = [without, *(m for m in others if not said.is_same_law(within(m, r)))]
        worth = np.array([self.scale.worth(m) for m in rivals]) - self.scale.worth(model)
        odds = float(np.exp(np.minimum(TEMPER * worth, 50.0)).sum())
        return min(1.0 / (1.0 + odds), MOST_CERTAIN)

    def _added(self, model: Model, recording: int) -> list[Model]:
        """Return the model with one more law in a recording."""
        signed = frozenset(
            s.place.joint for s in model.effects if not isinstance(s.effect, InRecording)
        )
        differing = (*filter(may_differ, EFFECTS.values()), ENCODER_OFFSET)
        laws = [InRecording(e, recording, signed) for e in differing]
        found: dict[object, EffectAt] = {}
        for _, candidate in screen(self.columns, model, laws):
            found.setdefault(candidate.key, candidate)
        return [self.fitted(model, (*model.effects, s)) for s in list(found.values())[:TRIED]]

    def _moved(self, model: Model) -> list[Model]:
        """Return the model with a law moved into one recording, or from it into another."""
        found = []
        for i, s in enumerate(model.effects):
            law = _law(s)
            if not may_differ(law):
                continue
            for r in range(self.count):
                there = replace(s, effect=InRecording(law, r))
                if there.key not in model.key:
                    others = (*model.effects[:i], *model.effects[i + 1 :])
                    found.append(self.fitted(model, (*others, there)))
        return found

    def _shared(self, model: Model) -> list[Model]:
        """Return the model with a law of one recording made common to all."""
        found = []
        for i, s in enumerate(model.effects):
            if isinstance(s.effect, InRecording) and s.effect.law is not ENCODER_OFFSET:
                common = replace(s, effect=s.effect.law)
                if common.key not in model.key:
                    others = (*model.effects[:i], *model.effects[i + 1 :])
                    found.append(self.fitted(model, (common, *others)))
        return found

    def _fewer(self, model: Model) -> list[Model]:
        """Return the model without each of the laws in one recording."""
        return [
            self.fitted(model, tuple(other for other in model.effects if other is not s))
            for s in own_laws(model.effects)
        ]

    def _simpler(self, model: Model) -> list[Model]:
        """Return the model with a law of one number in place of each richer one."""
        motion = model.frame.equations.motion
        simple = [e for e in EFFECTS.values() if may_differ(e) and len(e.quantities) == 1]
        found = []
        for i, s in enumerate(model.effects):
            law = _law(s)
            if not may_differ(law) or len(law.quantities) == 1 or law.is_on_tree:
                continue
            place = Place(s.place.joint)
            for e in simple:
                one = EffectAt(s.effect.of(e) if isinstance(s.effect, InRecording) else e, place)
                if place in e.places(motion) and one.key not in model.key:
                    effects = (*model.effects[:i], one, *model.effects[i + 1 :])
                    found.append(self.fitted(model, effects))
        return found

    def _holds(self, model: Model) -> bool:
        """Return whether the last effect counts as physics and predicts what was left out.

        Only effects that act in one recording are tested, beside what moves the robot.
        """
        equations, last = model.frame.equations, model.effects[-1]
        if not isinstance(last.effect, InRecording):
            return True
        recording = equations.motion.recording
        assert recording is not None
        there = recording[equations.filter.rows] == last.effect.recording
        share = (model.forces[-1][there] ** 2).mean(axis=0) / moving_power(equations)
        if share.max() <= COUNTED_SHARE:
            return False
        limits = self.scale.floor * self.scale.power, self.scale.rows
        return EVIDENCE < float(support(self.columns, model, *limits)[-1]) < math.inf


def _law(s: EffectAt) -> Effect:
    return s.effect.law if isinstance(s.effect, InRecording) else s.effect
