"""Everyday friction of a joint beside something there that has no name.

A joint that no model describes may still have the friction that every joint has. Where the unknown
is a force of one variable whose shape is known, what stands beside that force has its number
there. Elsewhere friction stands where it does not lean on the rest: fitted in each half of each
variable alone, beside bodies of any kind, it is nearly the force that it is in the whole. Where
much of the rest is a friction, of another form, of earlier speeds or one that another variable
changes, what is unknown is the friction itself. The larger the rest is beside it, the nearer the
halves must be: it may be a part of the unknown. The intervals of its numbers hold those of all
halves, for the rest that bends them is not noise.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import COUNTED_SHARE, INTERVAL, NEARLY
from sgp_ros.diagnosis.decide.cancelling import moving_bodies
from sgp_ros.diagnosis.decide.decision import Decision
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.credibility import is_credible
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.joint_search import usual
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.uncertainty import reported_std
from sgp_ros.physics.catalogue import (
    COMMAND_DELAY,
    COULOMB_FRICTION,
    STRIBECK_FRICTION,
    VISCOUS_FRICTION,
)
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.law import remembered
from sgp_ros.physics.place import Place
from sgp_ros.physics.servo import Servo

ROWS_PER_COLUMN = 4
"""Least rows of a half for each column."""
_KNOTS = 8
SHORTEST_LAG, LONGEST_LAG = 3.0, 0.1
"""Lags that are looked for: from so many steps to this part of a recording."""


def with_everyday(equations: Equations, comparison: Comparison, decision: Decision) -> Decision:
    """Return a decision with the everyday friction that stands at joints left unknown.

    If what is named explains more than what is left, physics is missing, with an unknown beside.

    Args:
        equations: of one recording.
        comparison: of models.
        decision: on these.
    """
    if equations.motion.is_static:
        return decision
    if not decision.unknown:
        return _beside_delay(equations, decision)
    model, standing = _beside_shape(decision) or _beside_unknown(equations, decision)
    if not standing or not is_credible(model):
        return decision
    decision = replace(decision, model=model, standing=standing)
    scale, unknown = Scale.of(equations, comparison), list(decision.unknown)
    before, left = comparison.parameters.left[unknown].sum(), model.left[unknown].sum()
    others = np.delete(scale.found(model), unknown).sum()
    if decision.verdict == 'unexplained' and before - left + others > left:
        decision = replace(decision, verdict='missing_physics', tentative=None)
    return decision


def _beside_shape(decision: Decision) -> tuple[Model, Mapping[object, float]] | None:
    """Return what stands beside the force of the only unknown joint, if its shape is known.

    None where that was found beside other laws of the other joints.
    """
    joint, *others = decision.unknown
    model, standing = decision.shaped.get(joint, (decision.model, {}))
    is_same = model.key - standing.keys() == decision.model.key
    return (model, standing) if standing and is_same and not others else None


def _beside_unknown(
    equations: Equations, decision: Decision
) -> tuple[Model, dict[object, float]]:  # fmt: skip
    """Return a model with the friction that stands at unknown joints, and its deviations."""
    open_shape = [j for j in decision.unknown if j not in decision.shaped]
    found = [_standing(equations, decision.model, j) for j in open_shape]
    standing = {s: x for laws in found for s, x in laws.items()}
    if not standing:
        return decision.model, {}
    model, columns = _with(equations, decision.model, standing), Columns(equations)
    known = zip(model.effects, reported_std(model, columns, decision.unknown), strict=True)
    spread = {s.key: x for s, x in standing.items()}
    return model, {s.key: max(spread[s.key], *std.values()) for s, std in known if s.key in spread}


def _beside_delay(equations: Equations, decision: Decision) -> Decision:
    """Return a decision whose delay of targets stands beside the everyday laws of all joints.

    Targets that are late by T act much as viscous friction kp T and as a rotor: the delay takes
    the place of all of these that are not worth their price. They count where it moves beyond its
    error.
    """
    motion, model = equations.motion, decision.model
    has_delay = any(s.effect is COMMAND_DELAY for s in model.effects)
    if not has_delay or not isinstance(motion.drive, Servo):
        return decision
    columns = Columns(equations)
    whole = usual(columns, model, model.effects, least=0.0)
    now = {s.key: s.shape for s in whole.effects}
    if not model.key <= now.keys() or not is_credible(whole):
        return decision
    known = zip(model.effects, reported_std(model, columns), strict=True)
    moved = [
        float(abs(now[s.key] - s.shape)[0]) > INTERVAL * std['delay']
        for s, std in known if s.effect is COMMAND_DELAY
    ]  # fmt: skip
    if not any(moved):
        return decision
    return replace(decision, model=whole, standing=dict.fromkeys(now.keys() - model.key, 0.0))


def widened(
    equations: Equations, model: Model, unknown: Collection[int] = ()
) -> list[dict[str, float]]:
    """Return the standard deviation of each reported number of each effect.

    Friction or a rotor of which a recording shows too little to name it bends what is named. So
    does friction that falls with speed, named as Coulomb friction. How far a number moves
    beside them, beyond what chance would move it, is an error of it. Source: Hausman 1978,
    Econometrica 46, 1251-1271.

    Args:
        equations: of the recording.
        model: that is asserted.
        unknown: joints that it does not describe, where nothing more is taken for known.
    """
    columns, motion = Columns(equations), equations.motion
    found = reported_std(model, columns, unknown)
    if unknown or motion.is_static:
        return found
    more = usual(columns, model, model.effects, least=0.0)
    plain = [dict(std) for std in found]
    for whole in dict.fromkeys([more, _falling(columns, more)]):
        beside = zip(whole.effects, reported_std(whole, columns), strict=True)
        now = {s.key: (s.report(motion), std) for s, std in beside}
        for s, std, own in zip(model.effects, found, plain, strict=True):
            before, (after, wider) = s.report(motion), now.get(s.key, ({}, {}))
            for name in own.keys() & wider.keys() - {'phase'}:
                by_chance = max(wider[name] ** 2 - own[name] ** 2, 0.0)
                moved = (float(after[name]) - float(before[name])) ** 2
                wide = math.sqrt(own[name] ** 2 + max(moved - by_chance, 0.0))
                std[name] = max(std[name], wide)
    return found


def _falling(columns: Columns, model: Model) -> Model:
    """Return a model with friction that falls with speed in place of Coulomb friction."""
    motion, law = model.frame.equations.motion, STRIBECK_FRICTION
    steady = {i for i, s in enumerate(model.effects) if s.effect is not COULOMB_FRICTION}
    while len(steady) < len(model.effects):
        effects = tuple(
            s if i in steady
            else EffectAt(law, s.place, np.median(law.starts(motion, s.place), axis=0))
            for i, s in enumerate(model.effects)
        )  # fmt: skip
        trial = fit(columns, effects, model.sigma, is_free=model.is_free, w=model.w)
        wrong = {i for i, s in enumerate(trial.effects) if not s.is_possible(motion)} - steady
        if not wrong:
            return trial
        steady |= wrong
    return model


def _standing(equations: Equations, model: Model, joint: int) -> dict[EffectAt, float]:
    """Return the friction that stands at a joint, with standard deviations of its numbers.

    The one whose number has another sign in some half is left out.
    """
    place = Place(joint)
    laws = [EffectAt(e, place) for e in (COULOMB_FRICTION, VISCOUS_FRICTION)]
    laws = [s for s in laws if s.key not in model.key]
    while laws:
        trial = _with(equations, model, laws)
        forces = [trial.parts[-len(laws) + i] for i in range(len(laws))]
        numbers = np.array([float(s.coefficients[0]) for s in trial.effects[-len(laws) :]])
        F = np.column_stack(forces)
        y = trial.residual[:, joint] + F.sum(axis=1)
        spread, apart = _in_halves(equations, joint, y, F, numbers)
        is_there = numbers > spread
        if is_there.all():
            size = float((F.sum(axis=1) ** 2).mean())
            part = min(size / trial.mean_square[joint], 1.0)
            is_steady = apart < NEARLY * part and size > COUNTED_SHARE * equations.power[joint]
            return dict(zip(laws, spread / INTERVAL, strict=True)) if is_steady else {}
        laws = [s for s, kept in zip(laws, is_there, strict=True) if kept]
    return {}


def _with(equations: Equations, model: Model, laws: Iterable[EffectAt]) -> Model:
    """Return a model fitted with more laws that have no shape."""
    effects = (*model.effects, *laws)
    return fit(Columns(equations), effects, model.sigma, is_free=model.is_free, w=model.w,
               still=len(effects))  # fmt: skip


def _in_halves(
    equations: Equations, joint: int, y: np.ndarray, forces: np.ndarray, numbers: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return how far the numbers of friction are from those of any half, and its force.

    Args:
        equations: of the recording.
        joint: index.
        y: what friction and the rest are together, (N,) [N m or N].
        forces: of friction, (N, m).
        numbers: that they have, (m,).

    Returns:
        Greatest difference of each number, (m,); of the force, relative. Infinite where the rows
        of a half are too few, or where much of the rest is another friction: one of another form
        over the speed, of earlier speeds, or with other numbers in one half.
    """
    A = np.column_stack([forces / numbers, moving_bodies(equations, joint), np.ones(len(y))])
    halves, force = list(_halves(equations, joint)), forces.sum(axis=1)
    least = (1.0 - NEARLY) * _rest(A, y)
    richer = (_of_speed(equations, joint), *(forces * half[:, None] for half in halves))
    placed = np.column_stack([A, _of_position(equations, joint)])
    past = np.column_stack([placed, _of_earlier_speeds(equations, joint)])
    is_past = _rest(past, y) < (1.0 - NEARLY) * _rest(placed, y)
    if is_past or any(_rest(np.column_stack([A, more]), y) < least for more in richer):
        return np.zeros(len(numbers)), math.inf
    far, apart = np.zeros(len(numbers)), 0.0
    for half in (*halves, *(~x for x in halves)):
        if half.sum() < ROWS_PER_COLUMN * A.shape[1]:
            return far, math.inf
        change = _solved(A[half], y[half])[: len(numbers)] - numbers
        moved = forces[half] @ (change / numbers)
        far = np.maximum(far, np.abs(change))
        apart = max(apart, float(np.linalg.norm(moved) / np.linalg.norm(force[half])))
    return far, apart


def _solved(A: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the least squares solution for columns of any scale."""
    scale = np.sqrt((A**2).mean(axis=0)) + 1e-300
    return np.asarray(np.linalg.lstsq(A / scale, y, rcond=1e-8)[0] / scale)


def _rest(A: np.ndarray, y: np.ndarray) -> float:
    r = y - A @ _solved(A, y)
    return float(r @ r)


def _of_speed(equations: Equations, joint: int) -> np.ndarray:
    """Return the columns of a force of any form of a joint's speed against its motion."""
    v = equations.motion.velocity[:, joint]
    knots = np.quantile(np.abs(v), np.linspace(0.0, 1.0, _KNOTS))
    hats = [np.interp(np.abs(v), knots, height) * np.sign(v) for height in np.eye(_KNOTS)]
    return equations.compact(np.column_stack(hats), joint, is_inertial=False)


def _of_position(equations: Equations, joint: int) -> np.ndarray:
    """Return the columns of a force of any form of a joint's position."""
    q = equations.motion.position[:, joint]
    knots = np.unique(np.quantile(q, np.linspace(0.0, 1.0, _KNOTS)))
    hats = [np.interp(q, knots, height) for height in np.eye(len(knots))]
    return equations.compact(np.column_stack(hats), joint, is_inertial=False)


def _of_earlier_speeds(equations: Equations, joint: int) -> np.ndarray:
    """Return the columns of lags of a joint's speed, such as a fluid that follows it has."""
    motion = equations.motion
    v, whole = motion.velocity[:, joint], motion.step * len(motion.position)
    lags = np.geomspace(SHORTEST_LAG * motion.step, LONGEST_LAG * whole, _KNOTS)
    past = [remembered('lag', motion, v, float(x)) for x in lags]
    return equations.compact(np.column_stack(past), joint, is_inertial=False)


def _halves(equations: Equations, joint: int) -> Iterator[np.ndarray]:
    """Yield the rows of the upper half of each variable: of the motion, the load and time."""
    motion, low = equations.motion, equations.filter
    speed, rows = np.abs(low(motion.velocity)), np.arange(len(equations.d))
    power = low(motion.acceleration[:, joint] * motion.velocity[:, joint])
    load = np.abs(low(motion.nominal_effort[:, joint]))
    own = [load, power, rows.astype(float)]
    for x in (*motion.wrapped[low.rows].T, *speed.T, *own):
        if np.ptp(x) > 0.0:
            yield x > np.median(x)
