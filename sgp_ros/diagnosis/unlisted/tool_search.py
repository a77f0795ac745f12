"""The search for a law of a force on the tool, where listed effects explain too little.

A rope, a balancer, a floor or a fluid acts on the tool, and by its lever arms on all joints at
once. Texts of few numbers are tried along each path, first with the tool where the robot file has
it, then with the point of attachment free, each jointly with bodies and all other effects.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from sgp_ros.diagnosis.criteria import BENT_BODIES, PER_UNUSUAL
from sgp_ros.diagnosis.decide.decision import Decision
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import Model, adds_to_usual
from sgp_ros.diagnosis.explain.joint_search import by_joint, usual
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.diagnosis.unlisted.formulas import PER_PIECE, pieces
from sgp_ros.physics.carried import link_reach
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.formula import read_formula
from sgp_ros.physics.parts import LawParameter
from sgp_ros.physics.place import JOINT, MOTOR
from sgp_ros.physics.tool_law import (
    ANCHOR,
    ATTACHED,
    AXES,
    DISTANCE,
    MOTION,
    UNITS,
    ToolLaw,
    tool_point,
    tool_reach,
    tool_seen,
)
from sgp_ros.robots.observed_motion import ObservedMotion

_FAR = 20.0
"""Farthest point of the world, in reaches of the tool: beyond it a direction hardly changes."""
_FITTED = {DISTANCE: 4, MOTION: 2} | dict.fromkeys(AXES, 2)
"""Best starts along each path that are fitted."""
_REFINED = 3
"""Best fits with unlike formulas whose point of attachment, and what is beside, is searched."""
_STEPS = 20


@dataclass(frozen=True, slots=True)
class _Text:
    """A formula along some paths, with words for people.

    Attributes:
        paths: along which it is tried.
        text: of the formula.
        words: for people.
        is_first: whether a search starts with it; others start where these have led.
    """

    paths: tuple[str, ...]
    text: str
    words: str
    is_first: bool = True


_IMMERSED = 'min(max((z0 - z)/w0, 0), 1)'
_TEXTS = (
    _Text((DISTANCE,), 'a + b*s', 'a rope or spring from the tool to a point of the world'),
    _Text((DISTANCE,), 'm/s**2', 'a magnet at a point of the world'),
    _Text((DISTANCE,), '-c*ds', 'a damper from the tool to a point of the world'),
    *(
        _Text((DISTANCE,), text, words, is_first=False)
        for text, words in (
            ('a', 'a constant pull on the tool towards a point of the world'),
            ('b*s', 'a spring without a length from the tool to a point of the world'),
            ('b*max(s - x0, 0)', 'a rope with slack to a point of the world'),
            ('a - f*sign(ds)', 'a rope over a drum with friction'),
            ('a + b*s - f*sign(ds)', 'a rope over a drum with friction'),
            ('a + b*s - c*ds', 'a spring and a damper from the tool to a point of the world'),
            ('a*exp(-s/w0)', 'an attraction that fades with the distance'),
            ('a/(1 + (s/w0)**2)**2', 'an attraction that fades with the distance'),
        )
    ),
    _Text(AXES, 'a + b*s', 'a spring on the tool along an axis of the base'),
    _Text(AXES, 'b*max(s - x0, 0)', 'a soft wall, floor or ceiling'),
    _Text(AXES, '-b*max(x0 - s, 0)', 'a soft wall, floor or ceiling'),
    _Text(AXES, '-c*ds', 'a damper on the tool along an axis of the base'),
    _Text((MOTION,), '-f', 'friction of the tool on what it moves along'),
    _Text((MOTION,), '-c*ds', 'viscous drag of the tool'),
    _Text((MOTION,), '-e*ds**2', 'drag of the tool in a fluid'),
    _Text((MOTION,), '-c*ds - e*ds**2', 'drag of the tool in a fluid'),
    _Text((MOTION,), f'-c*ds*{_IMMERSED}', 'drag of the tool that dips into a fluid'),
    _Text((MOTION,), f'-e*ds**2*{_IMMERSED}', 'drag of the tool that dips into a fluid'),
)
_UNITS = {'a': 'N', 'b': 'N/m', 'c': 'N s/m', 'e': 'N s2/m2', 'f': 'N', 'm': 'N m2'}
_PLACES = ('x0', 'w0', 'z0')
"""Numbers that are a place or a width, not a factor [m]."""
_RESISTS = ('c', 'e', 'f')
"""Coefficients that take energy, and are not negative."""


def is_asked(columns: Columns, decision: Decision) -> bool:
    """Return whether a law of the tool is looked for.

    It is where a joint is unexplained, or explained by laws that few joints have, or by unlikely
    bodies: any of them may imitate one.
    """
    motion, model = columns.equations(frozenset()).motion, decision.tentative or decision.model
    if motion.tool is None or len(motion.moving_joints) < 2:
        return False
    is_rare = any(not adds_to_usual(s.effect) for s in model.effects)
    is_bent = model.is_free and model.strain > BENT_BODIES
    return bool(decision.unknown) or is_rare or is_bent


def tool_models(columns: Columns, scale: Scale, decision: Decision) -> list[Model]:
    """Return models with a law of the tool in place of what acts on all joints, best first.

    One is fitted where it promises more than half of what the listed effects gain over everyday
    ones. Listed effects are searched again beside the best: they were chosen without it, and may
    have imitated it.
    """
    motion, listed = columns.equations(frozenset()).motion, decision.tentative or decision.model
    found = list[Model]()
    for base in _bases(columns, listed):
        trials = screen(columns, base, _laws(motion, ATTACHED, is_first=True))
        gained = scale.worth(listed) - scale.worth(base)
        for path, count in _FITTED.items():
            along = [s for gain, s in trials if 2.0 * gain > gained and _is_along(s, path)]
            found += [_fitted(columns, base.effects, s, base) for s in along[:count]]
    found += _from_there(columns, _ranked(found, scale))
    for model in _unlike(_ranked(found, scale))[:_REFINED]:
        found += _attached(columns, scale, model)
    found += _beside(columns, scale, _unlike(_ranked(found, scale)))
    found += _from_there(columns, _ranked(found, scale))
    return _unlike(_ranked(found, scale))


def _beside(columns: Columns, scale: Scale, ranked: list[Model]) -> Iterator[Model]:
    """Yield models with listed effects searched again, as long as one may become the best."""
    gained = np.inf
    for model in ranked[:_REFINED]:
        if scale.worth(ranked[0]) - scale.worth(model) > gained:
            return
        again = by_joint(columns, model)
        more = [x for m in _ranked(again, scale)[:1] for x in _attached(columns, scale, m)]
        yield from (*again, *more)
        if model is ranked[0]:
            gained = max(scale.worth(m) for m in (model, *more)) - scale.worth(model)


def _is_along(s: EffectAt, path: str) -> bool:
    return isinstance(s.effect, ToolLaw) and s.effect.path == path


def _from_there(columns: Columns, ranked: list[Model]) -> Iterator[Model]:
    """Yield models with all formulas along the path of the best one, from its points.

    They start from the mirror image of the point of the world, too: far away, a force towards one
    is a force away from the other, and no search gets there without passing through infinity.
    """
    motion = columns.equations(frozenset()).motion
    middle = dict(zip(ANCHOR, tool_seen(motion).mean(axis=0).tolist(), strict=True))
    for best in ranked[:1]:
        own, numbers = _numbers(best)
        near = {n: x for n, x in numbers.items() if n in {*ATTACHED, *ANCHOR}}
        far = {n: 2.0 * x - near[n] for n, x in middle.items() if n in near}
        for law in (x for x in _laws(motion, [*own.known]) if x.path == own.path):
            starts = {q.name: q.start for q in law.quantities if isinstance(q, LawParameter)}
            if law.key != own.key:
                yield _instead(columns, best, law, starts | near)
            if far:
                yield _instead(columns, best, law, starts | near | far)


def tool_law_of(model: Model) -> EffectAt | None:
    """Return the law of the tool in a model; None where there is none."""
    return next((s for s in model.effects if isinstance(s.effect, ToolLaw)), None)


def _numbers(model: Model) -> tuple[ToolLaw, dict[str, float]]:
    """Return the law of the tool of a model with its numbers by name."""
    placed = tool_law_of(model)
    assert placed is not None
    assert isinstance(placed.effect, ToolLaw)
    return placed.effect, placed.effect.shape_numbers(placed.shape)


def _instead(
    columns: Columns, model: Model, law: ToolLaw, numbers: Mapping[str, float]
) -> Model:  # fmt: skip
    """Return a model with a law of the tool in place of its own, fitted from some numbers."""
    placed = tool_law_of(model)
    assert placed is not None
    others = tuple(s for s in model.effects if s is not placed)
    shape = np.array([numbers[n] for n in law.shape_names()])
    return _fitted(columns, others, EffectAt(law, placed.place, shape), model)


def _ranked(models: Iterable[Model], scale: Scale) -> list[Model]:
    """Return the possible ones that have kept their law of the tool, best first."""
    possible = (m for m in models if m.is_possible() and np.isfinite(m.score) and tool_law_of(m))
    return sorted(possible, key=scale.worth, reverse=True)


def _unlike(ranked: list[Model]) -> list[Model]:
    """Return the best model with each formula."""
    found: dict[object, Model] = {}
    for model in ranked:
        law = tool_law_of(model)
        assert law is not None
        found.setdefault(law.key, model)
    return list(found.values())


def _bases(columns: Columns, listed: Model) -> Iterator[Model]:
    """Yield models without what acts on all joints, with bodies of the file and free."""
    kept = tuple(s for s in listed.effects if s.effect.site in {JOINT, MOTOR})
    plain = tuple(s for s in kept if adds_to_usual(s.effect))
    for is_free in (False, True):
        base = fit(columns, kept, listed.sigma, is_free=is_free, rounds=2, still=len(kept))
        yield base
        everyday = usual(columns, base, plain, least=0.0)
        if everyday.key != base.key:
            yield everyday


def _fitted(
    columns: Columns, others: tuple[EffectAt, ...], law: EffectAt, near: Model
) -> Model:  # fmt: skip
    return fit(columns, (*others, law), near.sigma, is_free=near.is_free, w=near.w, rounds=2,
               steps=_STEPS, still=len(others))  # fmt: skip


def _attached(columns: Columns, scale: Scale, model: Model) -> Iterator[Model]:
    """Yield a model with its point of attachment searched, with all usual laws beside it.

    Coordinates that do not pay, as along the common axis of all joints, stay those of the tool.
    """
    best = max((model, _freed(columns, model, ())), key=scale.worth)
    known: tuple[str, ...] = ()
    for name in ATTACHED if best is not model else ():
        fixed = _freed(columns, best, (*known, name))
        if scale.worth(fixed) > scale.worth(best):
            best, known = fixed, (*known, name)
    law = tool_law_of(best)
    assert law is not None
    rare = tuple(s for s in best.effects if s is not law and not adds_to_usual(s.effect))
    yield best
    yield usual(columns, best, (law, *rare), least=0.0)


def _freed(columns: Columns, model: Model, known: Collection[str]) -> Model:
    """Return a model with the point of attachment free, but for some of its coordinates."""
    own, numbers = _numbers(model)
    laws = _laws(columns.equations(frozenset()).motion, known)
    return _instead(columns, model, next(x for x in laws if x.key == own.key), numbers)


def _laws(
    motion: ObservedMotion, known: Collection[str], *, is_first: bool = False
) -> Iterator[ToolLaw]:
    """Yield the laws that are tried, with some coordinates of attachment those of the tool."""
    at, far = tool_point(motion.tree), _FAR * tool_reach(motion)
    around, size = tool_seen(motion).mean(axis=0), link_reach(motion, motion.tree.tool_body)
    points = [
        LawParameter(n, 'm', x - size, start=x, high=x + size, is_known=n in known)
        for n, x in zip(ATTACHED, at.tolist(), strict=True)
    ]
    anchor = [LawParameter(n, 'm', x - far, start=x + 0.05 * far, high=x + far)
              for n, x in zip(ANCHOR, around.tolist(), strict=True)]  # fmt: skip
    for text in (x for x in _TEXTS if x.is_first or not is_first):
        formula = read_formula(text.text, is_law=True)
        price = PER_UNUSUAL + PER_PIECE * pieces(formula)
        for path in text.paths:
            names = sorted(formula.parameters - UNITS.keys())
            own = [_parameter(n, path, motion) for n in names]
            yield ToolLaw(
                formula, path, [*own, *points, *(anchor if path == DISTANCE else ())], text.words,
                is_open=True, price=price,
            )  # fmt: skip


def _parameter(name: str, path: str, motion: ObservedMotion) -> LawParameter:
    """Return a number of a formula with its unit and range."""
    if name in _RESISTS:
        return LawParameter(name, _UNITS[name], 0.0)
    if name not in _PLACES:
        return LawParameter(name, _UNITS[name])
    low, high = 0.0, 3.0 * tool_reach(motion)
    axis = 'z' if name == 'z0' else path
    if name == 'w0':
        low, high = 1e-2 * tool_reach(motion), tool_reach(motion)
    elif axis in AXES:
        x = tool_seen(motion)[:, AXES.index(axis)]
        low, high = float(x.min()), float(x.max())
    return LawParameter(name, 'm', low, start=0.5 * (low + high), high=high)
