"""Cross-validated R^2 of what a model leaves, and models whose effects all have support.

What the motion of the robot predicts of a residual on stretches left out, or what the residual
predicts of itself, is structure that an adequate model would have. What neither predicts is noise,
however large. Both are measured as R^2 on parts left out. The first is the greater of two: that of
a Gaussian process Z of the motion at the time, and that of a linear response to the motion before
and after, for states that nobody measures, as of an elastic joint, make a residual that no force
at the time of it does. Neither sees the efforts: where friction takes all of an effort, that
effort would explain itself. The second tests whether the residual is white: linear prediction from
rows before; white noise behind the filter is predicted too, by as much as its correlations say
(Makhoul 1975), and that is taken off.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import EVIDENCE, LEAST_SHARE, STRUCTURE_LEAST_SHARE
from sgp_ros.diagnosis.decide.scale import Scale, beyond_noise
from sgp_ros.diagnosis.decide.support import support
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.credibility import is_credible
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.locate.remainder import (
    PARTS,
    explained_share,
    observations,
    parts_of,
    process_inputs,
    spread,
)
from sgp_ros.gp.learning import initial_model, learn, screened
from sgp_ros.gp.model import CoefficientPrior
from sgp_ros.physics.effect_at import EffectAt

LEAST_ROWS = 5 * PARTS
"""Rows below which structure cannot be tested."""
ORDER = 8
"""Rows before that may predict one; of the motion also rows behind."""
PER_COLUMN = 4
"""Rows for each column of a response."""
RIDGE = 1e-3
"""Prior precision of a response, relative to what the rows say of columns of unit variance."""
LEARNED = 200
"""Rows for the hyper-parameters."""


def structure(equations: Equations, residual: np.ndarray) -> np.ndarray:
    """Return the share of each joint's rest that is not noise, (k,), with its uncertainty.

    The greater of the shares that Z and earlier rows explain, at joints with a large residual;
    1 at others.

    Args:
        equations: of the recording.
        residual: of a model, (N, k) [N m or N].
    """
    share = (residual**2).mean(axis=0) / equations.power
    asked = share > max(STRUCTURE_LEAST_SHARE * float(share.max()), 1e-300)
    return repeatable(equations, residual, asked).max(axis=0)


def repeatable(equations: Equations, residual: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Return the shares of each joint's rest that the motion and earlier rows explain, (2, k).

    Shares on parts left out, plus `1/sqrt(N)` for N rows; 1 where none was asked for or can be
    computed. A part that only earlier rows explain is slow and does not repeat with the motion.

    Args:
        equations: of the recording.
        residual: of a model, (N, k) [N m or N].
        asked: (k,) whether a joint is looked at.
    """
    N, k = residual.shape
    found = np.ones((2, k))
    if N < LEAST_ROWS:
        return found
    response = _by_response(equations, residual) if asked.any() else np.zeros(k)
    for j in np.flatnonzero(asked):
        r = residual[:, j]
        motion = max(_by_motion(equations, r, int(j)), response[j])
        explained = np.array([motion, _by_past(equations, r)])
        found[:, j] = np.minimum(1.0, np.maximum(explained, 0.0) + 1.0 / np.sqrt(N))
    return found


def physics_left(equations: Equations, model: Model, unknown: Collection[int]) -> np.ndarray:
    """Return what a model leaves of the mean squared effort that counts as physics, (k,) shares.

    It comes back with the motion; 0 where it does not, where it is less, and at unknown joints.
    """
    counts = beyond_noise(equations, model) > LEAST_SHARE
    counts[list(unknown)] = False
    if not counts.any():
        return np.zeros(len(counts))
    share = repeatable(equations, model.residual, counts)[0] * model.left
    return np.where(counts & (share > LEAST_SHARE), share, 0.0)


def _by_past(equations: Equations, r: np.ndarray) -> float:
    """Return the share of r (N,) that earlier rows explain, beyond their share of white noise."""
    order = min(ORDER, len(r) // 10)
    rows = len(r) - order
    past = np.column_stack([r[order - i - 1 : order - i - 1 + rows] for i in range(order)])
    now, part = r[order:], parts_of(rows)
    error = 0.0
    for i in range(PARTS):
        out = part == i
        c = np.linalg.lstsq(past[~out], now[~out], rcond=1e-6)[0]
        error += float(((now[out] - past[out] @ c) ** 2).sum())
    white = equations.filter.correlations(order)
    gram = white[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
    least = 1.0 - float(white[1:] @ np.linalg.lstsq(gram, white[1:], rcond=1e-6)[0])
    return 1.0 - error / float(now @ now) / max(least, 1e-6)


def _by_response(equations: Equations, residual: np.ndarray) -> np.ndarray:
    """Return the shares that a linear response to the motion explains on parts left out, (k,).

    A response of finite length to accelerations and velocities of all joints, `ORDER` rows before
    and after, fewer where rows are few. Settled points respond to nothing before them.

    Args:
        equations: of the recording.
        residual: of a model, (N, k) [N m or N].
    """
    motion, (N, k) = equations.motion, residual.shape
    order = min(ORDER, (N // (PER_COLUMN * 2 * motion.position.shape[1]) - 1) // 2)
    if motion.is_static or order < 1:
        return np.zeros(k)
    moves = equations.filter(np.column_stack([motion.acceleration, motion.velocity]))
    moves /= moves.std(axis=0) + 1e-12
    windows = np.lib.stride_tricks.sliding_window_view(moves, 2 * order + 1, axis=0)
    X = np.column_stack([windows.reshape(len(windows), -1), np.ones(len(windows))])
    y = residual[order : N - order]
    part, error = parts_of(len(y)), np.zeros(k)
    for i in range(PARTS):
        out = part == i
        A = X[~out]
        gram = A.T @ A + RIDGE * len(A) * np.eye(A.shape[1])
        error += ((y[out] - X[out] @ np.linalg.solve(gram, A.T @ y[~out])) ** 2).sum(axis=0)
    return np.asarray(1.0 - error / np.maximum((y**2).sum(axis=0), 1e-300))


def _by_motion(equations: Equations, r: np.ndarray, joint: int) -> float:
    """Return the share of r (N,) that Z of the motion explains on parts left out."""
    motion = equations.motion
    inputs = process_inputs(motion, joint, sees_effort=False)[0]
    U = equations.filter(np.column_stack([inputs, motion.acceleration[:, joint]]))
    U = U / (U.std(axis=0) + 1e-12)
    part = parts_of(len(r))
    rows = spread(np.flatnonzero(part > 0), LEARNED)
    prior, data = CoefficientPrior.flat(0), observations(U, r, rows)
    start = screened(data, prior, initial_model(data, (tuple(range(U.shape[1])),)))
    return explained_share(learn(data, prior, start).model, U, r, part)


def without(equations: Equations, model: Model, is_dropped: Callable[[EffectAt], bool]) -> Model:
    """Return a model fitted again without some of its effects."""
    kept = tuple(s for s in model.effects if not is_dropped(s))
    if len(kept) == len(model.effects):
        return model
    return fit(
        Columns(equations), kept, model.sigma, is_free=model.is_free, w=model.w, still=len(kept)
    )


def supported(equations: Equations, scale: Scale, ranked: Sequence[Model]) -> Model | None:
    """Return the model of most worth whose effects all predict parts of the recording left out.

    From models of more than two effects, those that do not are removed. What is left is compared
    with the models that follow: another law may explain what that effect did, and be supported.

    Args:
        equations: of the recording.
        scale: of mean squares.
        ranked: models, those of most worth first.
    """
    columns, best = Columns(equations), None
    for model in ranked:
        if best is not None and scale.worth(best) >= scale.worth(model):
            break
        found = _pruned(columns, scale, model)
        if found is not None and (best is None or scale.worth(found) > scale.worth(best)):
            best = found
    return best


def _pruned(columns: Columns, scale: Scale, model: Model) -> Model | None:
    """Return a model without the effects that do not predict parts left out; None of no model.

    Where a plain law predicts least beside a richer one that says the same, either may go.
    """
    equations = columns.equations(frozenset())
    while model.effects and is_credible(model):
        evidence = support(columns, model, scale.floor * scale.power, scale.rows)
        if evidence.min() > EVIDENCE:
            return model
        if len(model.effects) <= 2:
            break
        weakest = model.effects[int(np.argmin(evidence))]
        richer = (s for s in model.effects
                  if s.place == weakest.place and weakest.name in s.effect.plain)  # fmt: skip
        trials = [without(equations, model, lambda s, out=out: s is out)  # type: ignore[misc]
                  for out in (weakest, *richer)]  # fmt: skip
        model = max(trials, key=lambda m: (is_credible(m), scale.worth(m)))
    return None
