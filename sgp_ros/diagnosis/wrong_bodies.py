"""Masses and centres of mass that a recording contradicts."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import (
    ALIKE,
    EVIDENCE,
    NUMBER_ERROR,
    PER_PARAMETER,
    STRUCTURE_LEAST_SHARE,
)
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.result import ParameterError
from sgp_ros.physics.catalogue import CONSTANT_LOAD
from sgp_ros.physics.effect_at import EffectAt


def parameter_errors(
    equations: Equations, model: Model, unstated: Collection[int] = (),
    other: Model | None = None,
) -> tuple[ParameterError, ...]:  # fmt: skip
    """Return masses and centres that differ by more than two standard deviations.

    Those of one body, with all others as stated, where one alone explains what all of them do. How
    far an offset of the efforts would move them is an error of theirs.

    Args:
        equations: of the recording.
        model: that was asserted.
        unstated: bodies that the robot's file leaves open: nothing that was stated is wrong.
        other: of another machine, from which they differ; None for the nominal robot.
    """
    if not model.is_free:
        return ()
    stated = _stated(equations, other)
    if other is not None:
        change = _apart(model, other)
        return tuple(filter(_differs, _numbers(equations, *change, stated, unstated)[0]))
    alone, beside = (_numbers(equations, *_changed(m), stated, unstated)[0]
                     for m in (model, _with_offsets(equations, model)))  # fmt: skip
    moved = {(e.link, e.parameter): e for e in beside}
    return tuple(e for e in (_widened(e, moved.get((e.link, e.parameter), e)) for e in alone)
                 if _differs(e))  # fmt: skip


def _with_offsets(equations: Equations, model: Model) -> Model:
    """Return a model with a constant force at each motor, as sensors of effort have it."""
    motion = equations.motion
    loads = (EffectAt(CONSTANT_LOAD, place) for place in CONSTANT_LOAD.places(motion)
             if motion.moves[place.joint] and motion.tree.is_actuated[place.joint])  # fmt: skip
    more = (s for s in loads if s.key not in model.key)
    effects = (*model.effects, *more)
    return fit(Columns(equations), effects, model.sigma, is_free=True, w=model.w, rounds=2,
               still=len(effects))  # fmt: skip


def _widened(e: ParameterError, beside: ParameterError) -> ParameterError:
    """Return a number with what offsets move it beyond chance as an error, see `widened`."""
    by_chance = max(beside.std**2 - e.std**2, 0.0)
    moved = max((beside.value - e.value) ** 2 - by_chance, 0.0)
    return replace(e, std=float(np.sqrt(e.std**2 + moved)))


def traded_remarks(
    equations: Equations, model: Model, errors: Sequence[ParameterError],
    unstated: Collection[int] = (), other: Model | None = None,
) -> Iterator[str]:  # fmt: skip
    """Yield sentences on numbers that must differ beside `errors`, if the rest is as stated.

    Or as another machine has them, whose efforts then share the constant forces of this one.

    Numbers of several bodies may do the same, so that none is known by itself. Of changes
    `x ~ N(x_hat, C)`, a set u costs `x_u' C_uu^-1 x_u / 2` nats if it stays as stated, and the
    others are then `x_hat - C_u C_uu^-1 x_u` [source: conditional normal distribution]. What a
    number saves must be worth `EVIDENCE`, and no small part of what all of them cost, beside
    constant forces of the motors too. What is said is without these, as all others are stated.
    """
    if not model.is_free:
        return
    told = {(e.link, e.parameter) for e in errors}
    stated = _stated(equations, other)
    if other is None:
        changes = [(m.w, _of_bodies(m)) for m in (model, _with_offsets(equations, model))]
    else:
        changes = [(model.w, _of_bodies(model) + _of_bodies(other))]
    found = [_numbers(equations, *change, stated, unstated) for change in changes]
    alone, beside = found[0], found[-1]
    numbers, (x, C, _), plain = alone[0], _in_units(*beside), _in_units(*alone)
    held = [i for i, e in enumerate(numbers) if (e.link, e.parameter) not in told]
    asked = max(EVIDENCE, STRUCTURE_LEAST_SHARE * _cost(x, C, [*range(len(x))]))
    while held:
        costs = {i: _cost(x, C, [u for u in held if u != i]) for i in held}
        least = min(costs.values())
        if _cost(x, C, held) < least + asked:
            return
        likely = [i for i in held if costs[i] < least + PER_PARAMETER]
        said = (_alone(numbers[i], *plain, i, [u for u in held if u != i]) for i in likely)
        yield (
            'Bodies differ in one more number, which this motion cannot place. If all others '
            f'are as stated, it is {" or ".join(said)}.'
        )
        held.remove(min(costs, key=lambda i: costs[i]))


def _in_units(
    numbers: Sequence[ParameterError], C: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return changes of numbers and their covariance in units of their deviations, and these."""
    unit = np.sqrt(np.maximum(np.diag(C), 1e-300))
    return np.array([e.value - e.nominal for e in numbers]) / unit, C / np.outer(unit, unit), unit


def _alone(
    e: ParameterError, x: np.ndarray, C: np.ndarray, unit: np.ndarray, i: int, held: list[int]
) -> str:
    """Return what a number is if those that are held are as stated."""
    solved = np.linalg.lstsq(C[np.ix_(held, held)], C[held, i], rcond=None)[0]
    now = e.nominal + float(x[i] - solved @ x[held]) * float(unit[i])
    name = 'mass' if e.parameter == 'mass' else f'{e.parameter[-1]} of the centre of mass'
    return f'{name} of {e.link} {now:.3g} instead of {e.nominal:.3g} {e.unit}'


def _cost(x: np.ndarray, C: np.ndarray, held: list[int]) -> float:
    """Return what it costs that some numbers are as stated [nats]."""
    solved = np.linalg.lstsq(C[np.ix_(held, held)], x[held], rcond=None)[0]
    return 0.5 * float(x[held] @ solved)


def _differs(e: ParameterError) -> bool:
    return abs(e.value - e.nominal) > max(2.0 * e.std, 1e-9)


def _numbers(
    equations: Equations, w: np.ndarray, C: np.ndarray, stated: np.ndarray,
    unstated: Collection[int],
) -> tuple[list[ParameterError], np.ndarray]:  # fmt: skip
    """Return masses and centres of all bodies, (n,), and the covariance of what they are, (n, n).

    Args:
        equations: of the recording.
        w: change of the bodies (p,).
        C: its covariance (p, p).
        stated: parameters that are right if nothing differs (b, 10).
        unstated: bodies that are left out.
    """
    tree = equations.motion.tree
    changed = equations.with_bodies(equations.motion, w).tree.parameters
    D = equations.directions.reshape(len(C), -1, 10)
    numbers, functionals = [], []
    for body, link in enumerate(tree.link_names):
        before, after = stated[body], changed[body]
        if after[0] <= 0.0 or before[0] <= 0.0 or body in unstated:
            continue
        slopes = {'mass': D[:, body, 0]}
        for axis, name in enumerate('xyz'):
            slopes[f'com_{name}'] = (
                D[:, body, 1 + axis] - after[1 + axis] / after[0] * D[:, body, 0]
            ) / after[0]
        values = {'mass': (after[0], before[0], 'kg')} | {
            f'com_{n}': (after[1 + i] / after[0], before[1 + i] / before[0], 'm')
            for i, n in enumerate('xyz')
        }
        for name, (now, then, unit) in values.items():
            std = float(np.sqrt(max(float(slopes[name] @ C @ slopes[name]), 0.0)))
            std = float(np.hypot(std, NUMBER_ERROR * abs(now - then)))
            numbers.append(ParameterError(link, name, float(now), std, float(then), unit))
            functionals.append(slopes[name])
    S = np.reshape(functionals, (-1, len(C)))
    return numbers, np.asarray(S @ C @ S.T)


def _stated(equations: Equations, other: Model | None) -> np.ndarray:
    """Return the parameters of the nominal robot, or of another machine, (b, 10)."""
    if other is None:
        return equations.motion.tree.parameters
    return equations.with_bodies(equations.motion, other.w).tree.parameters


def _changed(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Return the change of the bodies (p,) and its covariance (p, p); of one if that will do."""
    frame = model.frame
    at, root = frame.equations.instants, frame.R / math.sqrt(frame.weight)
    alone = _one_body(frame.equations, root, model.w)
    if alone is None:
        return model.w, _of_bodies(model)
    kept, x = alone
    some = replace(frame, R=np.asarray(np.linalg.qr(frame.R[:, kept], mode='r')))
    w, C = np.zeros_like(model.w), np.zeros_like(frame.R)
    w[kept], C[np.ix_(kept, kept)] = x, some.covariance
    return w, C[at:, at:]


def _apart(model: Model, other: Model) -> tuple[np.ndarray, np.ndarray]:
    """Return the bodies of a model, (p,), and the covariance, (p, p), of their difference.

    They differ in one body from those of another model, if that will do.
    """
    equations, C = model.frame.equations, _of_bodies(model) + _of_bodies(other)
    at, frames = equations.instants, (model.frame, other.frame)
    usual = sum(f.weight * np.linalg.inv(f.R.T @ f.R)[-len(C) :, -len(C) :] for f in frames)
    values, vectors = np.linalg.eigh(usual)
    root = (vectors / np.sqrt(np.maximum(values, 1e-14 * values[-1]))).T
    alone = _one_body(equations, root, (model.w - other.w)[at:], prior=2.0)
    if alone is None:
        return model.w, C
    kept, x = alone
    w, S = other.w.copy(), np.zeros_like(C)
    w[at + kept] += x
    S[np.ix_(kept, kept)] = np.linalg.inv(np.linalg.inv(C)[np.ix_(kept, kept)])
    return w, S


def _one_body(
    equations: Equations, root: np.ndarray, w: np.ndarray, prior: float = 1.0
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return which of the changes (p,) may differ, and how, if those of one body will do.

    The others cost `|R (w - x)|^2 / 2` [nats] if they stay as stated. That must be less than the
    price of the numbers they determine, and of no other body nearly as little.

    Args:
        equations: of the recording.
        root: R, of the information on the changes, which may begin with instants, (p, p).
        w: changes (p,).
        prior: their variance without a recording.
    """
    at = len(root) - len(equations.directions)
    owned = np.asarray(equations.directions.reshape(len(root) - at, -1, 10).any(axis=2))
    found = []
    for body in range(owned.shape[1] if (owned.sum(axis=1) <= 1).all() else 0):
        kept = np.flatnonzero(np.concatenate([np.ones(at, dtype=bool), owned[:, body]]))
        x = np.linalg.lstsq(root[:, kept], root @ w, rcond=None)[0]
        lost = root @ w - root[:, kept] @ x
        found.append((0.5 * float(lost @ lost), body, kept, x))
    found.sort(key=lambda item: item[0])
    if len(found) < 2 or found[1][0] < found[0][0] + ALIKE:
        return None
    cost, _, kept, x = found[0]
    of_all, of_one = (
        int((np.linalg.svd(R, compute_uv=False) > math.sqrt(2.0 / prior)).sum())
        for R in (root, root[:, kept])
    )
    return None if cost > PER_PARAMETER * (of_all - of_one) else (kept, x)


def _of_bodies(model: Model) -> np.ndarray:
    """Return the covariance of the change of the bodies, (p, p)."""
    instants = model.frame.equations.instants
    return np.asarray(model.frame.covariance[instants:, instants:])
