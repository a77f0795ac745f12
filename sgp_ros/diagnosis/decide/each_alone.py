"""Differences between several recordings, as models of each of them alone show them.

Where much differs, no common model explains the recordings, and differences that are added to the
best of them one at a time stand for one another. Each recording alone is explained then. A law of
most of them is taken as common, with the numbers of the first; where another has so different ones
that it counts as physics, and where few have a law, it acts in that recording alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import COUNTED_SHARE
from sgp_ros.diagnosis.decide.decision import decide
from sgp_ros.diagnosis.explain.comparison import compare_models
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.in_recording import InRecording, may_differ
from sgp_ros.physics.effect_at import EffectAt


def models_of_each(alone: Iterable[Equations]) -> dict[int, Model]:
    """Return the models of the recordings that are explained alone, by their indices.

    Args:
        alone: equations of each.
    """
    found = {}
    for r, equations in enumerate(alone):
        decision = decide(equations, compare_models(equations, lambda _share: None))
        if decision.verdict != 'unexplained':
            found[r] = decision.model
    return found


def put_together(models: dict[int, Model]) -> tuple[EffectAt, ...]:
    """Return the effects that are common, and those in one recording.

    Args:
        models: of recordings alone, by their indices.
    """
    holders: dict[object, list[tuple[int, int]]] = {}
    for r, model in models.items():
        for i, s in enumerate(model.effects):
            holders.setdefault(s.key, []).append((r, i))
    found: list[EffectAt] = []
    for at in holders.values():
        reference = None
        if 2 * len(at) > len(models):
            r, i = at.pop(0)
            reference = models[r].effects[i]
            found.append(reference)
        for r, i in at:
            s = models[r].effects[i]
            if _differs(models[r], i, reference):
                found.append(replace(s, effect=InRecording(s.effect, r)))
    return tuple(found)


def _differs(model: Model, index: int, reference: EffectAt | None) -> bool:
    """Return whether what an effect adds to that of the reference counts as physics."""
    s = model.effects[index]
    if not may_differ(s.effect):
        return False
    power = model.frame.equations.power
    share = float(((model.forces[index] ** 2).mean(axis=0) / power).max())
    if reference is not None:
        change = s.coefficients - reference.coefficients
        share *= float(change @ change / (s.coefficients @ s.coefficients))
    return bool(np.isfinite(share)) and share > COUNTED_SHARE
