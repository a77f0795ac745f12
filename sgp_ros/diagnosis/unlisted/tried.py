"""Smooth forces that are tried at a joint, if they promise much, and where these leave much."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from sgp_ros.diagnosis.criteria import ALIKE, NEARLY, PER_PARAMETER
from sgp_ros.diagnosis.decide.everyday import SHORTEST_LAG
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.screening import screen
from sgp_ros.diagnosis.unlisted.beside import (
    exceeds,
    is_bent,
    is_creep,
    is_slight,
    law_of,
    own_effects,
)
from sgp_ros.diagnosis.unlisted.formulas import FoundLaw
from sgp_ros.diagnosis.unlisted.shapes import (
    GATES,
    LAW,
    LEAST_PLAY,
    MORE_GATES,
    PIECES,
    LawAsFactor,
    SmoothForce,
    smooth_of,
)
from sgp_ros.diagnosis.unlisted.variables import LEAD, SLIP, STRETCH, Variable
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.robots.observed_motion import ObservedMotion

SPARED = 2.0
"""Times what a force beside all effects explains: the most that one in their place may [1]."""
_WEIGHTS = np.geomspace(0.17, 6.0, 9)
"""Of another joint in a sum, relative to what makes both parts equally large."""


def smooth_forces(motion: ObservedMotion, joint: int) -> Iterator[SmoothForce]:
    """Yield the smooth forces that may act on a joint.

    Of a velocity by itself only odd and even parts with a jump at rest: `f(|v|) sign(v)` is the
    factor `sign`. Where the effort was measured nothing is explained by it. What two joints do
    together, and what was before, has no factor.
    """
    names = motion.tree.moving_names
    for i, kind in itertools.product(motion.moving_joints, ('q', 'dq')):
        variable = Variable(kind, i, names[i])
        knots = variable.knots(motion, PIECES)
        for gate in GATES:
            if gate == 'effort' and not motion.is_commanded[joint]:
                continue
            if kind == 'dq' and i == joint and gate not in {'', 'sign'}:
                continue  # a function of v with a factor of v is a function of v
            yield SmoothForce(joint, variable, gate, knots, names[joint])
    for variable in (*_of_two(motion, joint), *_remembering(motion, joint)):
        yield SmoothForce(joint, variable, '', variable.knots(motion, PIECES), names[joint])


def promises(columns: Columns, listed: Model, joint: int) -> bool:
    """Return whether a smooth force beside the listed effects of a joint leaves much less.

    A force in their place seldom explains more than one beside all of them; where even `SPARED`
    times what the best one explains would not decide, no fit is needed to know that none will.
    Waves of one position with whole ratios are one periodic force, which may have a shorter form.

    Args:
        columns: of the recording.
        listed: best model of listed effects, which is adequate.
        joint: index.
    """
    rows, motion = columns.rows, columns.equations(frozenset()).motion
    if is_series(own_effects(listed, joint), motion):
        return True
    gains = [
        gain + 0.5 * (len(s.effect.coefficient_quantities(s.kind)) + len(s.shape)) * np.log(rows)
        for gain, s in screen(columns, listed, smooth_forces(motion, joint), (joint,))
    ]
    left = np.exp(-2.0 * SPARED * max(gains, default=0.0) / rows)
    apart = float((1.0 - left) * listed.mean_square[joint])
    return bool(left <= NEARLY) or exceeds(listed, own_effects(listed, joint), apart, joint)


def is_wanted(
    columns: Columns, scale: Scale, listed: Model, smooth: Model, joint: int
) -> bool:  # fmt: skip
    """Return whether a formula is looked for in place of listed effects of a joint.

    It is where a smooth force beats them by more than a trifle, or would if its numbers, of which
    a formula has few, cost nothing; and for waves in whole ratios.
    """
    is_trifle = smooth.mean_square[joint] > NEARLY**2 * listed.mean_square[joint]
    is_trifle = is_trifle and is_slight(listed, smooth, joint)
    spared = spared_by(smooth, joint) if leaves_less(smooth, listed, joint) else 0.0
    is_better = is_beaten(scale, listed, smooth, joint, spared) and not is_trifle
    motion = columns.equations(frozenset()).motion
    is_asked = is_better or is_series(own_effects(listed, joint), motion)
    return is_asked and not is_creep(columns, scale, listed, smooth, joint)


def spared_by(smooth: Model, joint: int) -> float:
    """Return the price of the numbers of a smooth force: what a formula may spare of it [nats]."""
    return PER_PARAMETER * len(smooth_of(smooth, joint)[0].coefficients)


def is_beaten(scale: Scale, listed: Model, smooth: Model, joint: int, spared: float = 0.0) -> bool:
    """Return whether a smooth force is worth more than listed effects, and not for a trifle.

    It leaves clearly less, or one of them was distorted to imitate it; `spared` of its price.
    """
    is_worth = scale.worth(smooth) + spared > scale.worth(listed) + ALIKE
    return is_worth and (leaves_less(smooth, listed, joint) or is_bent(listed, smooth, joint))


def leaves_less(model: Model, listed: Model, joint: int) -> bool:
    """Return whether a model leaves clearly less of a joint than another one."""
    return bool(model.mean_square[joint] <= NEARLY * listed.mean_square[joint])


def is_series(effects: Sequence[EffectAt], motion: ObservedMotion) -> bool:
    """Return whether some waves of one joint have as many periods as others times a number."""
    known = ((s.effect.wave(motion, s.place), s) for s in effects)
    waves = [(wave.width, float(s.shape[0])) for wave, s in known if wave is not None]
    pairs = itertools.permutations(waves, 2)
    return any(a > 1.5 * b and abs(a - round(a / b) * b) < width for (width, a), (_, b) in pairs)


def more_forces(motion: ObservedMotion, joint: int) -> Iterator[SmoothForce]:
    """Yield those that are tried where all of these leave something.

    With a factor that acts one way, is the joint's squared speed, its own position, or the speed
    of another joint, as a gyro sees it; of the joint's motion plus a part of another's, as a
    tendon or a hose over both sees it; of a motor's torque, or with another motor's as a factor;
    and of the past in other ways.
    """
    names, own = motion.tree.moving_names, {'q': motion.position, 'dq': motion.velocity}
    for i, kind in itertools.product(motion.moving_joints, own):
        if (i, kind) != (joint, 'dq'):
            variable = Variable(kind, i, names[i])
            knots = variable.knots(motion, PIECES)
            for gate in MORE_GATES if i != joint else MORE_GATES[:-1]:
                yield SmoothForce(joint, variable, gate, knots, names[joint])
        if i != joint:
            size = np.ptp(own[kind][:, joint]) / np.ptp(own[kind][:, i])
            for weight, sign in itertools.product(size * _WEIGHTS, (1.0, -1.0)):
                for gate in ('', 'sign') if kind == 'q' else ('',):
                    yield weighted(motion, joint, i, kind, sign * float(weight), gate)
            if kind == 'q':
                both = (Variable('q', joint, names[joint]), Variable('q', i, names[i]))
                gates = ('speed', 'effort') if motion.is_commanded[i] else ('speed',)
                for variable, gate in itertools.product(both, gates):
                    knots = variable.knots(motion, PIECES)
                    yield SmoothForce(joint, variable, gate, knots, names[joint],
                                      factor_of=(i, names[i]))  # fmt: skip
    for variable in _further(motion, joint):
        yield SmoothForce(joint, variable, '', variable.knots(motion, PIECES), names[joint])


def weighted(
    motion: ObservedMotion, joint: int, other: int, kind: str, weight: float, gate: str
) -> SmoothForce:  # fmt: skip
    """Return the smooth force of a joint's motion plus a part of another's."""
    names = motion.tree.moving_names
    variable = Variable(kind, joint, names[joint], other=(other, names[other], weight))
    return SmoothForce(joint, variable, gate, variable.knots(motion, PIECES), names[joint])


def _of_two(motion: ObservedMotion, joint: int) -> Iterator[Variable]:
    """Yield sums and differences of the joint with others of its kind."""
    names, prismatic = motion.tree.moving_names, motion.tree.is_prismatic
    alike = [i for i in motion.moving_joints if i != joint and prismatic[i] == prismatic[joint]]
    for i, kind, sign in itertools.product(alike, ('q', 'dq'), (1.0, -1.0)):
        yield Variable(kind, joint, names[joint], other=(i, names[i], sign))


def _remembering(motion: ObservedMotion, joint: int) -> Iterator[Variable]:
    """Yield lags of the joint's motion, and its position behind play."""
    name, width = motion.tree.moving_names[joint], float(np.ptp(motion.position[:, joint]))
    for kind in ('q', 'dq'):
        yield Variable(kind, joint, name, memory=('lag', SHORTEST_LAG * motion.step))
    yield Variable('q', joint, name, memory=('play', LEAST_PLAY * width))


def _further(motion: ObservedMotion, joint: int) -> Iterator[Variable]:
    """Yield motor torques that are commands, and the joint's delay, slip, stretch and lead."""
    names, least = motion.tree.moving_names, SHORTEST_LAG * motion.step
    width = LEAST_PLAY * float(np.ptp(motion.position[:, joint]))
    for i in np.flatnonzero(motion.is_commanded & motion.moves):
        yield Variable('tau', int(i), names[int(i)])
    for kind, memory in itertools.product(('q', 'dq'), ('delay', SLIP)):
        yield Variable(kind, joint, names[joint], memory=(memory, least))
    for memory, number in ((STRETCH, width), (LEAD, least)):
        yield Variable('q', joint, names[joint], memory=(memory, number))


def without_limits(ranked: Sequence[Model], scale: Scale, joint: int) -> list[Model]:
    """Return models with a formula without those of which one is only a limit.

    With a parameter at the end of its range a formula is nearly another, shorter one. It stays
    where it is worth more than every other, by more than a recording shows.
    """

    def is_limit(model: Model) -> bool:
        law = law_of(model, joint)
        return law is not None and bool(law.at_bounds(model.frame.equations.motion))

    inside = [scale.worth(m) for m in ranked if not is_limit(m)]
    most = max(inside, default=-np.inf) + ALIKE
    return [m for m in ranked if scale.worth(m) > most or not is_limit(m)]


def as_factor(
    model: Model, joint: int
) -> Iterator[tuple[LawAsFactor, tuple[EffectAt, ...]]]:  # fmt: skip
    """Yield the formula of a model at a joint as a factor, if it can be one, and all others.

    Of friction that changes with a position, too, for another form of friction.
    """
    law = law_of(model, joint)
    assert law is not None
    assert isinstance(law.effect, FoundLaw)
    smooth, others = law.effect.smooth, tuple(s for s in model.effects if s is not law)
    gates = ['', f'*{smooth.factor}'] if smooth.gate in {'sign', 'soft'} else ['']
    for gate in gates:
        factor = LawAsFactor.of(law, smooth.variable, gate)
        if factor is not None:
            yield factor, others


def times_law(motion: ObservedMotion, joint: int, factor: LawAsFactor) -> Iterator[SmoothForce]:
    """Yield smooth forces of one variable times a formula of another."""
    names = motion.tree.moving_names
    for i, kind in itertools.product(motion.moving_joints, ('q', 'dq')):
        variable = Variable(kind, i, names[i])
        if (kind, names[i]) not in factor.law.law.signals:  # it would be a function of it alone
            knots = variable.knots(motion, PIECES)
            yield SmoothForce(joint, variable, LAW, knots, names[joint], known=factor)
