"""Unlisted laws of a joint beside its listed effects: which there are, and what each explains."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import (
    ADEQUATE_REST,
    BLURRED,
    COUNTED_SHARE,
    INDEPENDENT_ROWS,
    NEARLY,
    PER_PARAMETER,
    REGION_ENERGY,
)
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.credibility import is_credible
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import distinct, screen
from sgp_ros.diagnosis.unlisted.searched import leaves_more
from sgp_ros.diagnosis.unlisted.shapes import SmoothForce
from sgp_ros.physics.catalogue import CONSTANT_LOAD, COULOMB_FRICTION, VISCOUS_FRICTION
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.law import FormulaLaw
from sgp_ros.physics.place import JOINT, MOTOR, Place

PLAIN = (COULOMB_FRICTION, VISCOUS_FRICTION, CONSTANT_LOAD)
_FURTHER = 3
"""Listed laws that are tried beside a formula which leaves too much, and that may be added."""


def law_of(model: Model, joint: int) -> EffectAt | None:
    """Return the formula or the smooth force of a model at a joint; None where there is none."""
    found = (
        s for s in model.effects
        if s.place.joint == joint and isinstance(s.effect, (FormulaLaw, SmoothForce))
    )  # fmt: skip
    return next(found, None)


def own_effects(model: Model, joint: int) -> tuple[EffectAt, ...]:
    """Return the effects that a model has at a joint alone."""
    own = {JOINT, MOTOR}
    return tuple(s for s in model.effects if s.place.joint == joint and s.effect.site in own)


def far_and_near(model: Model, joint: int) -> tuple[tuple[EffectAt, ...], tuple[EffectAt, ...]]:
    """Return the effects of a model that act at other joints alone, and all others."""
    far = tuple(
        s for s in model.effects
        if s.effect.site in {JOINT, MOTOR} and s.place.joint >= 0
        and joint not in {s.place.joint, s.place.source}
    )  # fmt: skip
    return far, tuple(s for s in model.effects if s not in far)


def earned(columns: Columns, scale: Scale, model: Model, joint: int) -> Model:
    """Return a model without the listed effects that are not worth their price beside its formula.

    They were chosen without the formula, and may have imitated a part of it. One after the other
    goes, a load for other bodies, and all that is left is fitted again, as long as that is worth
    more. Only shapes at the joint, if it acts there, are searched again: an arm has hundreds.

    Args:
        columns: of the recording.
        scale: of mean squares.
        model: with a formula at the joint.
        joint: index.
    """
    law, trials = law_of(model, joint), []
    elsewhere, here = far_and_near(model, joint)
    for out in (*elsewhere, *here):
        far, near = (tuple(s for s in x if s is not out) for x in (elsewhere, here))
        still = len(far) if out in here else len(far) + len(near)
        if out is not law:
            trials += [
                fit(columns, (*far, *near), model.sigma, is_free=is_free, rounds=2, steps=10,
                    still=still)
                for is_free in dict.fromkeys((False, model.is_free, out.effect.is_body))
            ]  # fmt: skip
    possible = [t for t in trials if t.is_possible() and np.isfinite(t.score)]
    best = max(possible, key=scale.worth, default=model)
    if scale.worth(best) <= scale.worth(model):
        return model
    return earned(columns, scale, best, joint)


def refined(
    columns: Columns, scale: Scale, model: Model, joint: int, most: int = _FURTHER
) -> Model:
    """Return a model with richer or further listed laws beside its formula, if worth more.

    Friction that creeps before it slides, or has another level each way, is that beside a formula
    too; what plain friction leaves of it, or a law that its force hid, would be its error.

    Args:
        columns: of the recording.
        scale: of mean squares.
        model: with a formula at the joint.
        joint: index.
        most: laws that may be added.
    """
    laws = model.frame.equations.motion.catalogue.values()
    far, near = far_and_near(model, joint)

    def tried(kept: tuple[EffectAt, ...], found: Iterable[EffectAt]) -> list[Model]:
        return [
            fit(columns, (*far, *kept, s), model.sigma, is_free=model.is_free, w=model.w, rounds=2,
                steps=10, still=len(far))
            for s in found
        ]  # fmt: skip

    trials = []
    for plain in own_effects(model, joint):
        richer = [e for e in laws if plain.name in e.plain and not e.has_source]
        kept = tuple(s for s in near if s is not plain)
        if richer:
            others = (*far, *kept)
            base = fit(columns, others, model.sigma, is_free=model.is_free, w=model.w,
                       still=len(others))  # fmt: skip
            trials += tried(kept, distinct(screen(columns, base, richer, (joint,))))
    law = law_of(model, joint)
    is_left = bool(scale.excess(model)[joint] > 1.0)
    is_left = is_left or bool(law and leaves_more(model.frame.equations, model, law))
    if is_left:
        for s in distinct(screen(columns, model, laws, (joint,)), _FURTHER):
            friction = (x for j in {joint, s.place.source} - {-1} for x in _friction(j))
            usual = (x for x in friction if x.key not in model.key | {s.key})
            trials += [earned(columns, scale, m, joint) for m in tried((*near, *usual), [s])]
    best = max(filter(is_credible, trials), key=scale.worth, default=model)
    if scale.worth(best) <= scale.worth(model):
        return model
    return refined(columns, scale, best, joint, most - 1) if is_left and most > 1 else best


def is_slight(listed: Model, smooth: Model, joint: int) -> bool:
    """Return whether a smooth force differs from plain laws by less than counts as physics.

    Friction that creeps a little near rest is friction, a spring that hardens a little a spring.
    A law with a shape of its own could be distorted to imitate another one, and so could several,
    if the smooth force takes their place; and friction that is less than the robot file states.
    """
    own = own_effects(listed, joint)
    rare = [s for s in _replaced(listed, smooth, joint) if not (
        (s.effect.is_usual and (s.coefficients >= 0.0).all())
        or s.effect is CONSTANT_LOAD or _is_plain_sum(s))]  # fmt: skip
    if rare and (len(own) > 1 or len(rare[0].shape)):
        return False
    apart = listed.residual[:, joint] - smooth.residual[:, joint]
    return bool((apart**2).mean() < COUNTED_SHARE * smooth.frame.equations.power[joint])


def is_creep(columns: Columns, scale: Scale, listed: Model, smooth: Model, joint: int) -> bool:
    """Return whether a smooth force refines the friction of a joint.

    Friction that creeps before it slides, is larger at rest and differs with direction follows an
    earlier speed a little better than plain laws do, or laws that say one of these; friction that
    grows within a small speed differs from them only there. Where plain laws are adequate, neither
    is a law of its own.
    """
    law, own = law_of(smooth, joint), own_effects(listed, joint)
    variable = law.effect.variable if law and isinstance(law.effect, SmoothForce) else None
    is_own = variable is not None and (variable.kind, variable.index) == ('dq', joint)
    is_past = variable is not None and is_own and bool(variable.memory)
    if not is_past and not _is_slow(listed, smooth, joint):
        return False
    usual = tuple(s for s in listed.effects if s not in own or _is_friction(s.effect))
    if len(usual) < len(listed.effects):
        listed = fit(columns, usual, listed.sigma, is_free=listed.is_free, w=listed.w,
                     still=len(usual))  # fmt: skip
    return bool(scale.excess(listed)[joint] < 1.0)


def acts_as_bodies(equations: Equations, force: np.ndarray, joint: int) -> bool:
    """Return whether other bodies, hardly less likely, would act on a joint as a force does.

    Bodies that could do so and yet were not found contradict other joints, as they do where the
    lengths of the robot file are wrong; that a law acts like a weight would be a coincidence. If
    no other joint moves, bodies were compared with the law.

    Args:
        equations: of the recording.
        force: filtered, (N,) [N m or N].
        joint: index.
    """
    if equations.motion.moves.sum() < 2:
        return False
    base = equations.bases[joint][:, equations.instants :]
    size = float((force**2).mean())
    scale = math.sqrt(len(force) * NEARLY**2 * size / INDEPENDENT_ROWS)
    A = np.concatenate([base / scale, np.eye(base.shape[1])])
    y = np.concatenate([force / scale, np.zeros(base.shape[1])])
    w = np.linalg.lstsq(A, y, rcond=None)[0]
    rest = float(((force - base @ w) ** 2).mean())
    return rest < NEARLY**2 * size and 0.5 * float(w @ w) < PER_PARAMETER


def _is_slow(listed: Model, smooth: Model, joint: int) -> bool:
    """Return whether the forces of two models at a joint differ only while it is slow."""
    motion = listed.frame.equations.motion
    first, second = (
        sum((s.force(motion)[:, joint] for s in own_effects(m, joint)), np.zeros(1))
        for m in (listed, smooth)
    )
    apart, speed = (first - second) ** 2, motion.velocity[:, joint] ** 2
    slow = apart[speed < BLURRED**2 * speed.mean()].sum()
    return bool(slow > REGION_ENERGY * apart.sum())


def _is_friction(law: Effect) -> bool:
    """Return whether every joint may have a law, or it is a richer one of its dry friction."""
    is_dry = COULOMB_FRICTION.name in law.plain and law.drawn_over == 'velocity'
    return law.is_usual or law in PLAIN or (is_dry and not law.has_source)


def is_bent(listed: Model, smooth: Model, joint: int) -> bool:
    """Return whether a listed law was distorted to imitate a smooth force.

    It has a shape of its own, and the smooth force in its place explains more beyond the law than
    an adequate model may leave of the part that this law adds.
    """
    apart = float(listed.mean_square[joint] - smooth.mean_square[joint])
    return exceeds(listed, _replaced(listed, smooth, joint), apart, joint)


def exceeds(listed: Model, own: Sequence[EffectAt], apart: float, joint: int) -> bool:
    """Return whether a mean square is more than may be left of a law with a shape of its own."""
    power = listed.frame.equations.power[joint]
    added = [
        share for s, share in zip(listed.effects, listed.filtered_shares, strict=True)
        if s in own and len(s.shape) and not s.effect.is_usual
    ]  # fmt: skip
    return any(apart > ADEQUATE_REST * share * power for share in added)


def _replaced(listed: Model, smooth: Model, joint: int) -> tuple[EffectAt, ...]:
    """Return the listed effects of a joint that a model with a smooth force does without."""
    return tuple(s for s in own_effects(listed, joint) if s.key not in smooth.key)


def _is_plain_sum(s: EffectAt) -> bool:
    """Return whether a law is a sum of plain ones: it adds to one, and has no shape."""
    return bool(s.effect.plain) and not len(s.shape)


def beside(listed: Model, joint: int, *, is_open: bool) -> Iterable[tuple[EffectAt, ...]]:
    """Return sets of listed effects of a joint that a law may stand beside.

    None, all, all but one, and all but those of one variable; where they leave it unexplained, or
    one is rare, also those of plain friction, beside a rotor if there is one: the list was asked
    without the law, and friction beside it may have been left out, or given another name.

    Args:
        listed: model of listed effects.
        joint: index.
        is_open: whether it leaves the joint unexplained.
    """
    found = _subsets(own := own_effects(listed, joint))
    if is_open or not all(s.effect.is_usual for s in own):
        rotor = tuple(s for s in own if s.effect.is_usual and s.effect.is_inertial)
        found += [(*kept, *rotor) for kept in _subsets(_friction(joint))]
    unique: dict[object, tuple[EffectAt, ...]] = {}
    for kept in found:
        unique.setdefault(frozenset(s.key for s in kept), kept)
    return unique.values()


def _friction(joint: int) -> tuple[EffectAt, ...]:
    return tuple(EffectAt(e, Place(joint)) for e in (COULOMB_FRICTION, VISCOUS_FRICTION))


def _subsets(effects: tuple[EffectAt, ...]) -> list[tuple[EffectAt, ...]]:
    found = [(), effects, *(tuple(s for s in effects if s is not out) for out in effects)]
    found += [
        tuple(s for s in effects if s.effect.drawn_over != over)
        for over in dict.fromkeys(s.effect.drawn_over for s in effects)
    ]
    return found
