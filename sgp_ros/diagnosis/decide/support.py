"""Held-out evidence of effects.

It is how much better the model with an effect predicts parts left out of the fit than the model
without it. Shapes stay as they were found; coefficients and bodies are fitted anew without each
part. An effect whose numbers only follow chance, or one stretch, predicts the others worse.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.locate.remainder import PARTS, parts_of
from sgp_ros.physics.effect_at import EffectAt


def left_out(
    columns: Columns, model: Model, dropped: Sequence[EffectAt | None]
) -> tuple[np.ndarray, np.ndarray]:
    """Return what a model without one of its effects leaves of parts left out in turn.

    Coefficients of all parts but one follow from Gram matrices, which all models share.

    Args:
        columns: of the recording.
        model: whose shapes, freedom of the bodies and scale are used.
        dropped: effects of the model, one after the other; None drops none.

    Returns:
        Mean squares of the residual, (d, PARTS, k) [N^2 m^2 or N^2], and how unlikely the bodies
        are that follow, (d,): minus the log prior of their changes, averaged over parts [nats].
    """
    frame, sigma, p = model.frame, model.sigma, len(model.frame.R)
    N, k = frame.equations.d.shape
    part = parts_of(N)
    order = np.argsort(part, kind='stable')
    A, owner = _columns_of(columns, model, order)
    y = (frame.equations.d[order] / sigma).reshape(-1)
    ends = [0, *(k * np.cumsum(np.bincount(part, minlength=PARTS))).tolist()]
    rows = [slice(*x) for x in pairwise(ends)]
    grams, sides = [A[r].T @ A[r] for r in rows], [A[r].T @ y[r] for r in rows]
    prior = frame.weight * np.diag(np.arange(A.shape[1]) < p)
    pull = np.zeros(len(prior))
    pull[:p] = frame.pull
    is_given = np.array([s is not None and s.effect.is_given for s in owner], dtype=bool)
    kept = [np.array([s is None or s is not out for s in owner], dtype=bool) for out in dropped]
    found, unlikely = np.empty((len(dropped), PARTS, k)), np.zeros(len(dropped))
    for i, out in enumerate(rows):
        G, b = sum(grams[:i] + grams[i + 1 :], prior), sum(sides[:i] + sides[i + 1 :], pull)
        C = np.zeros((len(prior), len(dropped)))
        for d, here in enumerate(kept):
            C[here & is_given, d] = 1.0
            free = np.flatnonzero(here & ~is_given)
            right = b[free] - G[free] @ C[:, d]
            C[free, d] = np.linalg.lstsq(G[np.ix_(free, free)], right, rcond=1e-12)[0]
        r = (y[out, None] - A[out] @ C).reshape(-1, k, len(dropped))
        found[:, i] = (r**2).mean(axis=0).T * sigma**2
        unlikely += 0.5 * (C[:p] ** 2).sum(axis=0) / PARTS
    return found, unlikely


def _columns_of(
    columns: Columns, model: Model, order: np.ndarray
) -> tuple[np.ndarray, list[EffectAt | None]]:
    """Return the columns of bodies and effects, scaled, (N k, m), and the effect of each.

    None for bodies; columns of effects whose coefficients are not given have unit length.

    Args:
        columns: of the recording.
        model: fitted.
        order: of the rows, (N,).
    """
    equations, p = model.frame.equations, len(model.frame.R)
    parts = [columns.of(s, equations, model.w) for s in model.effects]
    both = list(zip(model.effects, parts, strict=True))
    owner = [None] * p + [s for s, x in both for _ in range(x.shape[2])]
    A = np.empty((*equations.d.shape, len(owner)))
    for j, base in enumerate(equations.bases):
        A[:, j, :p] = base[order, :p]
    at = p
    for s, x in both:
        size = np.sqrt(((x / model.sigma[:, None]) ** 2).sum(axis=(0, 1))) + 1e-300
        A[:, :, at : at + len(size)] = x[order] / (1.0 if s.effect.is_given else size)
        at += len(size)
    A /= model.sigma[:, None]
    return A.reshape(-1, len(owner)), owner


def support(columns: Columns, model: Model, floor: np.ndarray, rows: float) -> np.ndarray:
    """Return how much better parts left out are predicted with each effect than without it.

    Bodies that could imitate an effect, such as the inertia of a rotor, predict as much: then it
    counts how unlikely they are.

    Args:
        columns: of the recording.
        model: fitted.
        floor: (k,) mean squares below which residuals do not count [N^2 m^2 or N^2].
        rows: that count as independent.

    Returns:
        By effect: half the sum over joints of the log ratio of mean squares, averaged over the
        parts, times the rows, and by how much likelier the bodies are [nats].
    """
    left, unlikely = left_out(columns, model, (None, *model.effects))
    better = 0.5 * np.log((left[1:] + floor) / (left[0] + floor)).sum(axis=2).mean(axis=1)
    return np.asarray(rows * better + unlikely[1:] - unlikely[0])
