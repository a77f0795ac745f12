"""Numbers of errors of the connection, estimated beside the physics that is named.

The search for errors looks at some stretches of a recording, slowly, beside everyday unknowns.
Once the physics is known, every row tells the numbers: those of errors, effects and bodies are
estimated together by least squares, to first order in the errors. The bodies have their usual
prior, and the residual's correlation in time widens the standard deviations, as everywhere.

Factors of efforts and gains are left as they were found: the smaller a recorded effort is taken,
the smaller is what is left of it, and least squares would follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sgp_ros.batch.least_squares import correlation_factor
from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.compare.trajectory import RawTrajectory, observe
from sgp_ros.diagnosis.connected import Connected
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.frame import Frame
from sgp_ros.diagnosis.explain.regression import Columns, dry_joints
from sgp_ros.diagnosis.setup.connection import Connection, Tried, undoing
from sgp_ros.diagnosis.setup.errors import EFFORT_SCALE
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.observed_motion import ObservedMotion

_PART = 0.1
"""Part of the first step of a search by which a number is moved for its slope."""
_DETERMINED = 1e-10
"""Least singular value that counts, relative to the greatest [1]."""


def refined(
    found: Connection, plain: Connected, corrected: Connected, tree: Tree
) -> tuple[Connection, bool]:
    """Return errors with their numbers beside the physics of a corrected recording.

    A number stays as it was found where all rows tell it no better, and all do where none would
    move by more than its standard deviation, which is then new.

    Args:
        found: errors.
        plain: recordings as they are.
        corrected: the same with these errors undone, and the physics found there.
        tree: nominal robot.

    Returns:
        The errors, and whether a number has moved.
    """
    open_ = [e for e in found.errors if _is_open(e)]
    if not open_ or plain.recordings.learned.gains is not None:
        return found, False
    equations, model = corrected.several.equations, corrected.several.decision.model
    slopes = _slopes(found, plain, equations, tree)
    numbers = np.concatenate([e.numbers for e in open_])
    before = np.concatenate([e.std for e in open_])
    is_told = np.ones(len(numbers), dtype=bool)
    while is_told.any():
        change, std = _estimated(equations, model, slopes[:, :, is_told])
        is_better = std < before[is_told]
        if is_better.all():
            break
        is_told[is_told] = is_better
    else:
        return found, False
    has_moved = bool((np.abs(change) > std).any())
    after, spread = numbers.copy(), before.copy()
    after[is_told] += change * has_moved
    spread[is_told] = std
    ends = np.cumsum([len(e.numbers) for e in open_])[:-1]
    parts = zip(open_, np.split(after, ends), np.split(spread, ends), strict=True)
    new = {e.hypothesis.key: replace(e, numbers=e.hypothesis.canonical(x), std=s)
           for e, x, s in parts}  # fmt: skip
    errors = undoing([new.get(e.hypothesis.key, e) for e in found.errors])
    motion = plain.equations.motion
    if not all(e.hypothesis.is_possible(e.numbers) for e in errors) or not (
        errors[-1].correction.keeps_limits(motion)
    ):
        return found, False
    return replace(found, errors=errors), has_moved


def _is_open(e: Tried) -> bool:
    """Return whether least squares of all rows estimate the numbers of an error."""
    is_exact = np.isin(e.numbers, e.hypothesis.exact).any()
    of_efforts = e.hypothesis.effect == EFFORT_SCALE or e.hypothesis.is_of_gains
    return bool(e.numbers.size) and not is_exact and not of_efforts


def _slopes(found: Connection, plain: Connected, equations: Equations, tree: Tree) -> np.ndarray:
    """Return the force that each number lacks per unit while it is too small, (n, k, m).

    None at a joint that does not move, which has no equation.
    """

    def lacking(motion: ObservedMotion) -> np.ndarray:
        return np.asarray(motion.effort + motion.stated_force - motion.nominal_effort)

    def undone(errors: Sequence[Tried]) -> tuple[RawTrajectory, Tree]:
        correction = undoing(errors)[-1].correction
        return plain.recordings.corrected(correction).learned, correction.tree(tree)

    band = choose_bandwidth(*undone(found.errors)).up_to(equations.filter.cutoff)
    now, slopes = lacking(equations.motion), []
    for i, e in enumerate(found.errors):
        steps = _PART * e.hypothesis.steps_at(e.numbers) if _is_open(e) else ()
        for m, step in enumerate(steps):
            moved = replace(e, numbers=e.numbers + step * np.eye(len(e.numbers))[m])
            errors = [*found.errors[:i], moved, *found.errors[i + 1 :]]
            slopes.append((lacking(observe(*undone(errors), band)) - now) / step)
    return np.stack(slopes, axis=2) * equations.motion.moves[:, None]


def _estimated(
    equations: Equations, model: Model, slopes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return by how much numbers are to change, (m,), and their standard deviations.

    Args:
        equations: with the errors undone.
        model: of them; its shapes stay.
        slopes: (n, k, m).
    """
    columns = Columns(equations)
    held = columns.equations(dry_joints(model.effects))
    frame = Frame.of(held, model.sigma, is_free=True, weight=1.0)
    forces = [columns.of(s, held, model.w) for s in model.effects if not s.effect.is_given]
    given = sum((columns.of(s, held, model.w) @ s.coefficients
                 for s in model.effects if s.effect.is_given), np.zeros(held.d.shape))  # fmt: skip
    forces += [held.compact(slopes, 0, is_inertial=False), given[:, :, None]]
    J = frame.projected(np.concatenate(forces, axis=2))
    J, y = J[:, :-1], frame.y - J[:, -1]
    scale = np.sqrt((J * J).sum(axis=0))
    scale[scale == 0.0] = np.inf
    J = J / scale
    inverse = np.linalg.pinv(J.T @ J, rcond=_DETERMINED, hermitian=True)
    best = inverse @ (J.T @ y)
    residual = (y - J @ best)[: held.d.size].reshape(held.d.shape)
    wider = max(correlation_factor(r) for r in residual.T)
    std = np.sqrt(wider * np.diag(inverse)) / scale
    m = slopes.shape[2]
    return (best / scale)[-m:], np.where(np.isfinite(scale), std, np.inf)[-m:]
