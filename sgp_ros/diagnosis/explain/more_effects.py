"""Models of more than two effects: searches joint by joint from several starts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sgp_ros.diagnosis.criteria import (
    ADEQUATE_REST,
    BENT_BODIES,
    COUNTED_SHARE,
    PER_EFFECT,
    SLIGHT_REST,
)
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.credibility import gain, is_credible, ranked
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.growth import crossed
from sgp_ros.diagnosis.explain.joint_search import (
    built_up,
    by_joint,
    large,
    richer,
    usual,
    without_vain,
)
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.physics.catalogue import COMMAND_DELAY
from sgp_ros.physics.effect_at import EffectAt, one_of_each
from sgp_ros.physics.servo import Servo
from sgp_ros.robots.observed_motion import ObservedMotion

_CARRYING = 3
"""Best models with other bodies for which a load is tried in place of these."""


def more(columns: Columns, nominal: Model, base: Model, compared: Sequence[Model]) -> list[Model]:
    """Return models of a search joint by joint, where the best credible model does not suffice.

    It does not if its residual counts as physics, if it is not adequate, or if its bodies are so
    unlikely that they may imitate missing physics. The search starts from that model and from the
    laws that nearly every joint has, with bodies that may differ, or with a load; and from
    friction that builds up at every joint, where no more is missing. Bodies that change at all may
    imitate a rotor, a load, a spring: it starts from the best model with those of the file, too.

    Args:
        columns: of the recording.
        nominal: model without effects, with the bodies of the file.
        base: the same, or with others where that is better.
        compared: models with one effect or two.
    """
    by_score = ranked([base, *compared])
    sound = [m for m in by_score if not m.effects or is_credible(m)]
    best = next(iter(sound), base)
    limit = np.clip(ADEQUATE_REST * base.left, SLIGHT_REST, COUNTED_SHARE)
    of_file = next((m for m in sound if not m.is_free), nominal)
    is_bent = best.is_free and best.strain > BENT_BODIES
    stated = _as_stated(columns, best, of_file) if is_bent else []
    if (best.left < limit).all() and best.strain < PER_EFFECT:
        models = [*stated, *_everyday(columns, best, nominal.sigma)]
        return ranked([*models, *_richer(columns, [best, *models])])
    everyday = usual(columns, fit(columns, (), nominal.sigma, is_free=True))
    loaded = _loaded(columns, everyday)
    starts = [best] if loaded else [best, everyday]
    built = built_up(columns, everyday)
    if (built.left < limit).all():
        starts.append(built)
    if isinstance(best.frame.equations.motion.drive, Servo):
        starts += _late(columns, best.sigma)
    ends = [stated, loaded, *(by_joint(columns, start) for start in starts)]
    models = _crossed(columns, [end for end in ends if end])
    models += [*_carrying(columns, [best, *models]), *_freed(columns, models)]
    models += _richer(columns, models)
    single = (m for m in models if one_of_each(m.effects) == m.effects)
    return ranked(m for m in single if len(m.effects) > 2)


def _richer(columns: Columns, models: list[Model]) -> list[Model]:
    """Return the best model with richer laws at every joint at once, where it lacks some."""
    best = max(models, key=lambda m: gain(m, models[0]), default=None)
    return [] if best is None else list(richer(columns, best))


def _everyday(columns: Columns, best: Model, sigma: np.ndarray) -> Iterator[Model]:
    """Yield the laws that nearly every joint has, however small, in place of those found.

    Those of one joint may be all that was looked for while others lack some, too.
    """
    for is_free in (False, True) if best.effects else ():
        model = usual(columns, fit(columns, (), sigma, is_free=is_free), least=0.0)
        yield from filter(is_credible, [without_vain(columns, model)])


def _carrying(columns: Columns, models: list[Model]) -> list[Model]:
    """Return the best models with other bodies, with a load or a tilt in place of these."""
    free = sorted((m for m in models if m.is_free), key=lambda m: -gain(m, models[0]))
    motion = columns.equations(frozenset()).motion
    loads = [(x,) for x in (*_loads(motion), *_tilts(motion))]
    return [
        fit(columns, (*model.effects, *load), model.sigma, is_free=False)
        for model in free[:_CARRYING]
        for load in ([()] if any(s.effect.is_body for s in model.effects) else loads)
    ]


def _freed(columns: Columns, models: list[Model]) -> Iterator[Model]:
    """Yield the best model with the bodies of the file, with others in place of some laws.

    A torque constant, a rotor, a spring may have stood for bodies that are a little different.
    """
    stated = [m for m in models if not m.is_free]
    for best in sorted(stated, key=lambda m: -gain(m, stated[0]))[:1]:
        laws = tuple(s for s in best.effects if not s.effect.is_body)
        free = without_vain(columns, fit(columns, laws, best.sigma, is_free=True))
        yield from filter(is_credible, (free, large(columns, free)))


def _tilts(motion: ObservedMotion) -> list[EffectAt]:
    """Return laws of the frame of all bodies, each from one start: they are nearly linear."""
    return [
        EffectAt(law, place, law.starts(motion, place)[0])
        for law in motion.catalogue.values() if law.is_on_tree
        for place in law.places(motion)
    ]  # fmt: skip


def _loads(motion: ObservedMotion) -> list[EffectAt]:
    return [
        EffectAt(law, place, shape)
        for law in motion.catalogue.values() if law.is_body
        for place in law.places(motion)
        for shape in law.starts(motion, place)
    ]  # fmt: skip


def _crossed(columns: Columns, ends: list[list[Model]]) -> list[Model]:
    """Return the models of all searches, and of one from the best with laws from the others."""
    models = [model for end in ends for model in end]
    if len(ends) > 1:
        first = [end[0] for end in ends]
        best = max(first, key=lambda m: gain(m, first[0]))
        better = crossed(columns, best, first)
        models += by_joint(columns, better) if better is not best else []
    return models


def _as_stated(columns: Columns, best: Model, stated: Model) -> list[Model]:
    """Return models of a search beside the bodies of the robot file.

    Args:
        columns: of the recording.
        best: model with other bodies, whose laws a second search starts from if the first one does
            not lead to a better model.
        stated: best model with the bodies of the file.
    """
    found = by_joint(columns, stated)
    if any(gain(m, best) > 0.0 for m in found):
        return found
    laws = fit(columns, best.effects, best.sigma, is_free=False)
    return [*found, *by_joint(columns, laws)]


def _loaded(columns: Columns, everyday: Model) -> list[Model]:
    """Return models of a search from the laws that nearly every joint has beside a load.

    A load is no law to add to bodies that may differ, and beside stated bodies not the first law
    that a robot asks for whose joints all have friction. None where changed bodies are as good, or
    where the load goes as other laws come.
    """
    motion = columns.equations(frozenset()).motion
    base = fit(columns, (), everyday.sigma, is_free=False)
    starts = [usual(columns, base, (load,)) for load in _loads(motion)]
    best = max(starts, key=lambda m: m.score, default=everyday)
    found = by_joint(columns, best) if gain(best, everyday) > PER_EFFECT else []
    return [m for m in found if any(s.effect.is_body for s in m.effects)]


def _late(columns: Columns, sigma: np.ndarray) -> Iterator[Model]:
    """Yield the laws that nearly every joint has beside a delay of targets, in both variants.

    A target that is late by T acts at every joint much as viscous friction kp T and a rotor
    kd T - kp T^2/2; a search that has taken these would not come back to the delay.
    """
    motors = COMMAND_DELAY.places(columns.equations(frozenset()).motion)
    for is_free in (False, True):
        base = fit(columns, (), sigma, is_free=is_free)
        found = [s for _, s in screen(columns, base, [COMMAND_DELAY]) if s.place in motors[-1:]]
        yield from (usual(columns, base, (s,)) for s in found[:1])
