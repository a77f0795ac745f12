"""Reasons why a model is not asserted, and what one leaves, in words that its numbers support."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import EVIDENCE, LEAST_SHARE, PER_PARAMETER
from sgp_ros.diagnosis.decide.cross_validation import physics_left
from sgp_ros.diagnosis.decide.decision import Decision
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.decide.support import support
from sgp_ros.diagnosis.explain.credibility import is_sound
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.physics.catalogue import VISCOUS_FRICTION
from sgp_ros.physics.drive import Drive
from sgp_ros.physics.place import joint_name
from sgp_ros.physics.servo import Servo

_MOST_DIGITS = 4
_FIT = 'it predicts the acceleration less well'


def apart(a: float, b: float, digits: int = 2) -> tuple[str, str]:
    """Return two numbers with as few digits as tell them apart; alike where four do not.

    Args:
        a: number.
        b: another.
        digits: fewest of each.
    """
    for n in range(digits, _MOST_DIGITS + 1):
        shown = f'{a:.{n}g}', f'{b:.{n}g}'
        if shown[0] != shown[1]:
            return shown
    return f'{a:.{digits}g}', f'{b:.{digits}g}'


def why_not(model: Model, decision: Decision, scale: Scale) -> str:
    """Return why a model is not asserted: its residual beside that of its reference.

    The reference is the asserted model; where nothing is asserted, the nearest model, and for the
    nearest model itself the bodies alone.

    Args:
        model: that was not asserted.
        decision: in which it was not.
        scale: of the recording.
    """
    if model is decision.tentative or decision.tentative is None:
        against, name = decision.model, 'the asserted model'
        if not against.effects:
            name = 'corrected bodies alone' if against.is_free else 'the nominal robot'
    else:
        against, name = decision.tentative, 'the nearest one'
    refused = decision.refusals.get(model.key, '')
    losses = _losses(model, against, scale)
    reason = max(losses, key=lambda key: losses[key])
    j = _joint(model, against, decision, scale, is_refused=bool(refused))
    rest, other = (float(m.mean_square[j] / scale.power[j]) for m in (model, against))
    shown = apart(100.0 * rest, 100.0 * other, 3)
    joint = model.frame.equations.motion.tree.joint_names[j]
    is_more = against.effects and against.key < model.key
    left = f'leaves {shown[0]} % of the mean squared effort of {joint}'
    is_alike = shown[0] == shown[1]
    without = 'as much as without it' if is_alike else f'without it {shown[1]} %'
    said = f'added to {name} it {left}, {without}'
    if not is_more:
        said = f'{left}, as much as {name}' if is_alike else f'{left}, {name} {shown[1]} %'
    if refused:
        return f'{said}; {refused}'
    is_worse = scale.worth(model) < scale.worth(against)
    if is_worse and reason == _FIT and rest > other and not is_alike:
        return said
    if not scale.is_large(model):
        return f'{said}; one of its effects is too small to count'
    if not is_sound(model):
        return f'{said}; its effects cancel each other or inertial parameters'
    if not is_worse:
        return f'{said}; {_unsupported(model, scale)}'
    return f'{said}; {reason}'


def _losses(model: Model, against: Model, scale: Scale) -> dict[str, float]:
    """Return by how much a model is worth less than another, by cause [nats]."""
    fit = scale.likelihood(against) - scale.likelihood(model)
    more = 'it needs more' if fit < 0.0 else 'it fits no better and needs more'
    justified = ' than the improvement justifies' if fit < 0.0 else ''
    return {
        _FIT: fit,
        'it needs inertial parameters further from the nominal ones': model.strain
        - against.strain,
        f'{more} parameters{justified}': PER_PARAMETER * (model.freedom - against.freedom),
        f'{more}, or rarer, effects{justified}': model.law_price - against.law_price,
        'it needs effects of an unlikely size': model.surprise - against.surprise,
    }


def _joint(
    model: Model, against: Model, decision: Decision, scale: Scale, *, is_refused: bool
) -> int:
    """Return the joint to speak of: the open one, else where the fit lost, or gained, most."""
    if is_refused and decision.unknown:
        return max(decision.unknown, key=lambda j: float(decision.excess[j]))
    rests = [m.mean_square / scale.power + scale.floor for m in (model, against)]
    ratio = np.log(rests[0] / rests[1]) + 2.0 * (against.inertia - model.inertia)
    return int(np.argmax(ratio) if float(ratio.sum()) > 0.0 else np.argmin(ratio))


def _unsupported(model: Model, scale: Scale) -> str:
    """Return what is wrong with a model that is worth no less than the asserted one."""
    columns = Columns(model.frame.equations)
    evidence = support(columns, model, scale.floor * scale.power, scale.rows)
    if evidence.min() > EVIDENCE:
        return 'this recording prefers neither of the two clearly'
    return 'it does not help to predict parts of the recording that were left out'


def held_remarks(model: Model) -> Iterator[str]:
    """Yield what numbers of a model rest on commands that hold until the next one.

    Samples of what a faster controller sends are half a period older on the average than commands
    that hold: where no delay is named, gains make viscous friction of it.
    """
    motion = model.frame.equations.motion
    servo = motion.drive if isinstance(motion.drive, Servo) else None
    drive = servo.targets if servo is not None else motion.drive
    if not isinstance(drive, Drive):
        return
    period, said = 1e3 * float(np.median(np.diff(drive.times))), ''
    if any(s.effect.is_late for s in model.effects):
        said = f'the delay is {0.5 * period:.3g} ms longer'
    elif servo is not None and not servo.is_recorded:
        oiled = (s.place.joint for s in model.effects if s.effect is VISCOUS_FRICTION)
        more = ', '.join(f'{5e-4 * period * servo.kp[j]:.2g} on {joint_name(motion, j)}'
                         for j in oiled)  # fmt: skip
        said = f'the coefficient of viscous friction is larger, by {more}' if more else ''
    if said:
        yield (
            f'Commands are taken to hold until the next one, {period:.3g} ms later. If they are '
            f'samples of a faster controller, {said}.'
        )


def left_remarks(equations: Equations, model: Model, unknown: Collection[int]) -> Iterator[str]:
    """Yield what is left at joints that are described, where it counts as physics by itself.

    It is small against what is named there, and comes back with the motion.
    """
    share = physics_left(equations, model, unknown)
    for j in np.flatnonzero(share):
        yield (
            f'Of the mean squared effort of {equations.motion.tree.moving_names[j]}, '
            f'{100.0 * share[j]:.2g} % is left that comes back with the motion. That is little '
            'beside what is named, but it may be physics that no law here describes.'
        )


def disagreement(shares: Mapping[str, float]) -> str:
    """Return a sentence on what the nominal robot leaves of a simulation; empty if little.

    Args:
        shares: of the mean squared effort, by joint.
    """
    worst = max(shares, key=lambda name: shares[name])
    if shares[worst] < LEAST_SHARE:
        return ''
    return (
        'The robot file does not describe the simulation: it leaves '
        f'{100.0 * shares[worst]:.2g} % of the mean squared effort of {worst} there unexplained. '
        'The machine is compared with the simulation as it was recorded.'
    )
