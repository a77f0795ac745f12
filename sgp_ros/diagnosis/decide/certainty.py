"""Probabilities of the verdict and of each finding.

Scores of models differ by hundreds of nats where the signals are clean, yet the shape of a column
is only approximate; so the odds of rivals are tempered: their difference in log rest counts, not
the number of rows. `sgp_proof/concealed` measures how the probabilities keep what they say.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import CALM_SHARE, LEAST_ODDS, MOST_CERTAIN, TEMPER
from sgp_ros.diagnosis.decide.decision import Decision, Scale
from sgp_ros.diagnosis.decide.equivalence import Contrasts
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.result import Difference, Finding


@dataclass(frozen=True, eq=False)
class Probabilities:
    """Of effects at joints, and of something unknown."""

    by_key: dict[object, float]
    unknown: float
    asserted: Model
    power: np.ndarray

    def of(self, model: Model, index: int) -> float:
        """Return the probability of one effect of a model."""
        return self.by_key.get(model.effects[index].key, 0.0)

    def why(self, model: Model) -> str:
        """Return why a rival was not asserted."""
        rest = float((model.mean_square / self.power).max())
        best = float((self.asserted.mean_square / self.power).max())
        left = f'{100 * rest:.3g} % of the mean squared effort'
        if self.asserted.key and self.asserted.key < model.key:
            return f'leaves {left} beside the asserted model, that alone {100 * best:.3g} %'
        return f'leaves {left}, the asserted model {100 * best:.3g} %'


def probabilities(
    equations: Equations, comparison: Comparison, decision: Decision, contrasts: Contrasts
) -> Probabilities:
    """Return the tempered probabilities of all effects.

    A richer law whose numbers make it the asserted one is no rival to it.
    """
    scale, asserted = Scale.of(equations, comparison), decision.model
    least = scale.worth(asserted) + math.log(LEAST_ODDS) / TEMPER
    models = [
        m
        for m in (*comparison.singles, *comparison.pairs, *comparison.more)
        if scale.counts(m)
        and not (m.key != asserted.key and scale.worth(m) > least and contrasts.is_same_law(m))
    ]
    adequate = 1.0 / (1.0 + decision.excess**2)
    by_key: dict[object, float] = {}
    worth = TEMPER * np.array([scale.worth(m) for m in (comparison.base, *models)])
    odds = np.exp(worth - worth.max())
    for model, p in zip(models, odds[1:] / odds.sum(), strict=True):
        for s in model.effects:
            by_key[s.key] = by_key.get(s.key, 0.0) + float(p) * adequate
    unknown = float(np.clip(decision.excess / (decision.excess + 1.0), 0.05, 0.97))
    return Probabilities(
        {key: min(p, MOST_CERTAIN) for key, p in by_key.items()},
        unknown,
        decision.model,
        equations.power,
    )


def certainty_of(
    findings: Sequence[Finding | Difference],
    equations: Equations,
    comparison: Comparison,
) -> float:
    """Return the probability that the verdict is right."""
    if findings:
        return max(f.probability for f in findings)
    left = float((comparison.parameters.mean_square / equations.power).max())
    return float(np.clip(1.0 / (1.0 + (left / CALM_SHARE) ** 2), 0.5, MOST_CERTAIN))
