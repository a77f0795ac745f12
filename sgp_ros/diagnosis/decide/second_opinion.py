"""A second opinion: what models leave of stretches of the recording left out of their fit.

Shapes stay as they were found; coefficients and bodies are fitted anew without each part. An
effect whose numbers only follow chance, or one stretch, predicts the others worse than the model
without it does.
"""

from __future__ import annotations

import numpy as np

from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.suspects import Columns
from sgp_ros.diagnosis.parts import PARTS, parts_of
from sgp_ros.physics.effect_at import EffectAt


def left_out(columns: Columns, model: Model, suspects: tuple[EffectAt, ...]) -> np.ndarray:
    """Return what a model with some of its suspects leaves of parts left out in turn.

    Args:
        columns: of the recording.
        model: whose shapes, freedom of the bodies and scale are used.
        suspects: of the model, those that are kept.

    Returns:
        Mean squares of the residual, (PARTS, k) [N^2 m^2 or N^2].
    """
    equations, sigma = model.frame.equations, model.sigma
    N, k = equations.d.shape
    p = equations.base.shape[2] if model.is_free else 0
    y, X = equations.d / sigma, [equations.base[:, :, :p] / sigma[:, None]]
    for suspect in suspects:
        x = columns.of(suspect, equations, model.w) / sigma[:, None]
        if suspect.effect.is_given:
            y = y - x[:, :, 0]
        else:
            X.append(x)
    A = np.concatenate(X, axis=2)
    scale = np.sqrt((A**2).sum(axis=(0, 1))) + 1e-300
    scale[:p] = 1.0
    A = A / scale
    part = parts_of(N)
    grams = [np.tensordot(A[part == i], A[part == i], ((0, 1), (0, 1))) for i in range(PARTS)]
    sides = [np.tensordot(A[part == i], y[part == i], ((0, 1), (0, 1))) for i in range(PARTS)]
    prior = np.diag(np.concatenate([np.ones(p), np.zeros(A.shape[2] - p)]))
    found = np.empty((PARTS, k))
    for i in range(PARTS):
        G = sum(grams[:i] + grams[i + 1 :], prior)
        c = np.linalg.lstsq(G, sum(sides[:i] + sides[i + 1 :], np.zeros(len(G))), rcond=1e-12)[0]
        r = (y[part == i] - A[part == i] @ c) * sigma
        found[i] = (r**2).mean(axis=0)
    return found


def support(columns: Columns, model: Model, floor: np.ndarray) -> list[float]:
    """Return how much better parts left out are predicted with each effect than without it.

    Args:
        columns: of the recording.
        model: fitted.
        floor: (k,) mean squares below which residuals do not count [N^2 m^2 or N^2].

    Returns:
        Half the sum over joints of the log ratio of mean squares, averaged over the parts, by
        effect [nats per independent row].
    """
    whole = left_out(columns, model, model.suspects) + floor
    found = []
    for suspect in model.suspects:
        rest = tuple(s for s in model.suspects if s is not suspect)
        without = left_out(columns, model, rest) + floor
        found.append(float(0.5 * np.log(without / whole).sum(axis=1).mean()))
    return found
