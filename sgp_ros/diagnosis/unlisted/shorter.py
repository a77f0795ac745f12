"""Formulas without what a recording does not tell from zero."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator

import numpy as np

from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.uncertainty import reported_std
from sgp_ros.diagnosis.unlisted.beside import far_and_near, law_of
from sgp_ros.diagnosis.unlisted.formulas import FoundLaw, Range, law
from sgp_ros.diagnosis.unlisted.sentences import COEFFICIENTS
from sgp_ros.physics.effect_at import EffectAt

_NONE = 2.0
"""Standard deviations below which a coefficient is not distinguished from zero."""


def idle(columns: Columns, model: Model, joint: int) -> frozenset[str]:
    """Return the coefficients of a formula that are hardly zero: a shorter one would do."""
    placed = law_of(model, joint)
    assert placed is not None
    index = [s is placed for s in model.effects].index(True)
    std = reported_std(model, columns)[index]
    numbers = placed.report(columns.equations(frozenset()).motion)
    names = [q.name for q in placed.effect.coefficient_quantities(placed.kind)]
    return frozenset(
        name for name in names
        if name in numbers and name in std and np.isfinite(std[name])
        and abs(float(numbers[name])) < _NONE * std[name]
    )  # fmt: skip


def shorter(columns: Columns, model: Model, joint: int) -> Iterator[Model]:
    """Yield the model with a shorter formula, without idle terms, if there is one; see `idle`.

    Args:
        columns: of the recording.
        model: with a formula at the joint.
        joint: index.
    """
    placed = law_of(model, joint)
    assert placed is not None
    assert isinstance(placed.effect, FoundLaw)
    text = without(placed.effect.text, idle(columns, model, joint))
    if text in {'', placed.effect.text}:
        return
    motion, smooth = columns.equations(frozenset()).motion, placed.effect.smooth
    known = dict(zip(placed.effect.shape_names(), placed.shape.tolist(), strict=True))
    own = {n: x for n, x in known.items() if re.search(rf'\b{n}\b', text)}
    found = law(smooth, motion, Range.of_variable(smooth.variable, motion), text, own)
    shape = np.array([known[n] for n in found.shape_names()])
    far, near = far_and_near(model, joint)
    effects = (*far, *(s for s in near if s is not placed), EffectAt(found, placed.place, shape))
    short = fit(columns, effects, model.sigma, is_free=model.is_free, w=model.w, rounds=2,
                steps=10, still=len(far))  # fmt: skip
    if short.is_possible() and np.isfinite(short.score):
        yield short


def without(text: str, names: Collection[str]) -> str:
    """Return a text without the terms of some coefficients; empty where no variable is left."""
    terms, depth, start = list[str](), 0, 0
    for i, c in enumerate(f'{text} + '):
        depth += (c == '(') - (c == ')')
        if not depth and f'{text} + '[i : i + 3] == ' + ':
            terms.append(text[start:i])
            start = i + 3
    kept = [t for t in terms if not any(re.search(rf'\b{n}\b', t) for n in names)]
    short = ' + '.join(kept)
    if 'X' not in short:
        return ''
    own = [n for n in COEFFICIENTS if re.search(rf'\b{n}\b', short)]
    return re.sub(rf'\b{own[0]}\b', COEFFICIENTS[0], short) if own else short
