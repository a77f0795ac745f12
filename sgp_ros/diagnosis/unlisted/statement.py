"""Statement of an unlisted law: its shape with a band, formulas, one sentence in words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.batch.least_squares import correlation_factor
from sgp_ros.diagnosis.criteria import ALIKE, INTERVAL, LEAST_SHARE
from sgp_ros.diagnosis.decide.differences import Several
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.shown import LawSearch, TriedFormula
from sgp_ros.diagnosis.unlisted.assertion import Explained, with_laws
from sgp_ros.diagnosis.unlisted.at_tool import with_tool_law
from sgp_ros.diagnosis.unlisted.beside import law_of
from sgp_ros.diagnosis.unlisted.formulas import FoundLaw
from sgp_ros.diagnosis.unlisted.searched import Searched
from sgp_ros.diagnosis.unlisted.shapes import SmoothForce, smooth_of
from sgp_ros.diagnosis.unlisted.variables import BEHIND, LEAD
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.formula import Formula
from sgp_ros.physics.grammar import MEMORY

POINTS = 41
_FORMULAS = 3
_MOST_SEEN, _WEAK = 600, 0.2
"""Rows of the recording beside a shape; the least factor of them, relative to the greatest."""
_BEYOND = 0.5
"""Range in which formulas are reported, beyond what was seen, in parts of that."""
_CLEAR = 0.85
"""A curve rises or falls where it leaves this part of its greatest value."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A smooth force over its variable.

    Attributes:
        x: (p,) over the range that was seen.
        mean, std: (p,).
    """

    x: np.ndarray
    mean: np.ndarray
    std: np.ndarray


def extended(several: Several) -> tuple[Several, tuple[LawSearch, ...]]:
    """Return the decision with a search for unlisted laws, in one recording."""
    if several.chances or several.equations.motion.is_static:
        return several, ()
    equations = several.equations
    found = with_laws(equations, *with_tool_law(equations, several.comparison, several.decision))
    several = replace(
        several, comparison=found.comparison, decision=found.decision, model=found.decision.model
    )
    return several, law_searches(found)


def law_searches(found: Explained) -> tuple[LawSearch, ...]:
    """Return the result at each joint where a law was looked for."""
    return tuple(_search(found, s) for s in found.searched)


def shape_of(searched: Searched) -> Shape:
    """Return the smooth force of a joint; its error is that of least squares on coloured rows."""
    model = searched.smooth
    placed, smooth = smooth_of(searched.smooth, searched.joint)
    knots = smooth.knots
    x = np.linspace(knots[0], knots[-1], POINTS)
    B = smooth.basis(x)
    equations = model.frame.equations
    raw = placed.columns(equations.motion)
    A = equations.compact(raw, searched.joint, is_inertial=False)
    r = model.residual[:, searched.joint]
    variance = float(r @ r) / len(r) * max(correlation_factor(r), 1.0)
    C = variance * np.linalg.pinv(A.T @ A, rcond=1e-10)
    std = np.sqrt(np.maximum(np.einsum('pi,ij,pj->p', B, C, B), 0.0))
    return Shape(x, B @ placed.coefficients, std)


@dataclass(frozen=True, eq=False)
class Seen:
    """Some rows of a recording, in the order of the variable.

    Attributes:
        rows: (s,) of the motion.
        x: (s,) the variable.
        y: (s,) what other effects leave for the shape: itself plus the residual over the factor.
    """

    rows: np.ndarray
    x: np.ndarray
    y: np.ndarray


def seen_by(searched: Searched) -> Seen:
    """Return the data beside the shape of a joint, where its factor is not small."""
    placed, smooth = smooth_of(searched.smooth, searched.joint)
    equations = searched.smooth.frame.equations
    rows = equations.filter.rows
    x = smooth.variable.values(equations.motion)[rows]
    g = smooth.factors(equations.motion)[rows]
    kept = np.flatnonzero(np.abs(g) > _WEAK * np.abs(g).max())
    kept = kept[np.argsort(x[kept], kind='stable')]
    kept = kept[np.linspace(0, len(kept) - 1, min(len(kept), _MOST_SEEN)).astype(int)]
    left = searched.smooth.residual[kept, searched.joint]
    y = smooth.basis(x[kept]) @ placed.coefficients + left / g[kept]
    return Seen(rows[kept], x[kept], y)


def _curve(law: EffectAt, searched: Searched, seen: Seen) -> np.ndarray:
    """Return a formula over its factor at the rows that were seen (s,); NaN if of other kind."""
    _, smooth = smooth_of(searched.smooth, searched.joint)
    assert isinstance(law.effect, FoundLaw)
    own = law.effect.smooth
    is_speed = smooth.is_of_own_speed
    if own.variable != smooth.variable or not (is_speed or own.factor == smooth.factor):
        return np.full(len(seen.x), np.nan)
    motion, known = searched.smooth.frame.equations.motion, own.known_factor
    g = smooth.factors(motion) if known is None else known.values(motion, law.report(motion))
    force, g = law.force(motion)[seen.rows, searched.joint], g[seen.rows]
    return np.divide(
        force, g, out=np.full(len(g), np.nan), where=np.abs(g) > _WEAK * np.abs(g).max()
    )


def _beyond(law: EffectAt, searched: Searched, x: np.ndarray) -> np.ndarray:
    """Return a formula over its factor at places of its variable (b,); NaN if of other kind.

    A sign is that of a fast motion ahead, a factor that is a speed or an effort is one; signals
    with memory have settled, and what a joint is ahead of its lag or play is what it is ahead of
    zero. A lead is that of a joint at rest. A formula that is the factor is left out.
    """
    _, smooth = smooth_of(searched.smooth, searched.joint)
    assert isinstance(law.effect, FoundLaw)
    own, numbers = law.effect.smooth, law.report(searched.smooth.frame.equations.motion)
    gate = '' if own.is_of_own_speed else own.gate
    shown = '' if own.is_of_own_speed else own.factor
    if own.variable != smooth.variable or shown != (
        '' if smooth.is_of_own_speed else smooth.factor
    ):
        return np.full(len(x), np.nan)
    variable = own.variable
    past = variable.memory[0] if variable.memory else ''
    factor = np.inf if gate in {'sign', 'soft'} else 0.0 if past == LEAD else 1.0

    def signal(kind: str, joint: str) -> Callable[[object], np.ndarray]:
        if kind == variable.kind and joint == variable.joint:
            return lambda _at: x
        is_other = variable.other is not None and joint == variable.other[1]
        return lambda _at: np.full(len(x), 0.0 if is_other else factor)

    def force(formula: Formula) -> np.ndarray:
        value: Callable[[object], object] = formula.compiled(
            lambda name: lambda _at: float(numbers[name]), signal,
            lambda name, _: (lambda _at, now, _number: 0.0 * now if past in BEHIND else now)
            if name in MEMORY else None,
        )  # fmt: skip
        return np.broadcast_to(np.asarray(value(None), dtype=np.float64), (len(x),))

    with np.errstate(all='ignore'):
        found = force(law.effect.law)
        found = found / (force(own.known_factor.law.law) if own.known_factor else 1.0)
    side = np.sign(x) if smooth.is_of_own_speed and smooth.gate == 'sign' else 1.0
    return np.where(np.isfinite(found), found * side, np.nan)


def _search(found: Explained, searched: Searched) -> LawSearch:
    _, smooth = smooth_of(searched.smooth, searched.joint)
    shape, motion = shape_of(searched), searched.smooth.frame.equations.motion
    seen = seen_by(searched)
    reach = _BEYOND * float(np.ptp(shape.x))
    beyond = np.linspace(shape.x[0] - reach, shape.x[-1] + reach, 2 * POINTS)
    scale = Scale.of(searched.smooth.frame.equations, found.comparison)
    tree = motion.tree
    unit = smooth.variable.unit(tree)
    per = smooth.force_unit(tree)
    power = searched.smooth.frame.equations.power[searched.joint]

    def left(model: Model) -> float:
        return float(model.mean_square[searched.joint] / power)

    tried: list[TriedFormula] = []
    for model in searched.laws:
        law = law_of(model, searched.joint)
        assert law is not None
        if len(tried) == _FORMULAS or law.effect.formula in {t.formula for t in tried}:
            continue
        units = {q.name: q.unit for q in law.effect.quantities}
        numbers = {n: (float(x), units[n]) for n, x in law.report(motion).items()}
        tried.append(TriedFormula(
            law.effect.formula, numbers, left(model), law.effect.words,
            _curve(law, searched, seen), _beyond(law, searched, beyond),
            is_alike=scale.fit(searched.laws[0]) - scale.fit(model) < ALIKE,
        ))  # fmt: skip
    return LawSearch(
        joint=tree.joint_names[searched.joint],
        variable=smooth.variable.text, factor=smooth.factor, unit=unit, force_unit=per,
        x=shape.x, mean=shape.mean, half=INTERVAL * shape.std,
        left=left(searched.smooth), left_listed=left(searched.listed),
        formulas=tuple(tried), why_not=_why_not(
            found, searched.joint, left(searched.listed) - left(searched.smooth)
        ),
        words=sentence(smooth, shape, unit, per), seen_x=seen.x, seen=seen.y,
        beyond_x=beyond,
    )  # fmt: skip


def _why_not(found: Explained, joint: int, more: float) -> str:
    """Return why no formula is asserted; `more` is what the listed effects leave beyond it [1]."""
    if law_of(found.decision.model, joint) is not None:
        return ''
    listed = 'the listed effects explain the same with fewer parameters'
    if more < LEAST_SHARE:
        listed = 'the listed effects leave too little more to count as missing physics'
    return found.why_not.get(joint, listed)


def sentence(smooth: SmoothForce, shape: Shape, unit: str, per: str) -> str:
    """Return a smooth force in words, such as `rises to 0.8 N m at 3 rad/s and then falls`."""
    if not smooth.is_of_own_speed:
        return _course(shape.x, shape.mean, smooth, unit, per)
    ahead = shape.x > 0.0
    x, force = shape.x[ahead], -shape.mean[ahead]
    if len(x) < 2:
        return _course(shape.x, shape.mean, smooth, unit, per)
    does = 'resists the motion' if force.mean() > 0.0 else 'drives the motion'
    size = np.abs(force)
    peak, at = float(size.max()), int(np.argmax(size))
    ends = (
        f'{size[0]:.2g} {per} at {x[0]:.2g} {unit}',
        f'{size[-1]:.2g} {per} at {x[-1]:.2g} {unit}',
    )
    if size[0] < _CLEAR * peak and size[-1] < _CLEAR * peak:
        how = f'rises to {peak:.2g} {per} at {x[at]:.2g} {unit} and then falls to {ends[1]}'
    elif size[0] < _CLEAR * peak:
        how = f'grows from {ends[0]} to {ends[1]}'
    elif size[-1] < _CLEAR * peak:
        how = f'falls from {ends[0]} to {ends[1]}'
    else:
        how = f'stays near {peak:.2g} {per}'
    return f'{does} with a force that {how}'


def _course(x: np.ndarray, f: np.ndarray, smooth: SmoothForce, unit: str, per: str) -> str:
    """Return the ends of a curve and what is greater between them."""
    places = [0, len(x) - 1]
    inner = {int(np.argmax(f)), int(np.argmin(f))} - set(places)
    reach = float(np.ptp(f))
    clear = [i for i in inner if min(abs(f[i] - f[0]), abs(f[i] - f[-1])) > (1.0 - _CLEAR) * reach]
    points = ', '.join(f'{f[i]:.2g} {per} at {x[i]:.2g} {unit}' for i in sorted([*places, *clear]))
    times = f', times {smooth.factor}' if smooth.factor else ''
    return f'depends on the {smooth.variable.words}: {points}{times}'
