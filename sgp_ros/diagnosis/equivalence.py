"""Rivals that explain a recording as well as the asserted model, and a motion that would tell.

Two models are told apart by what they leave. Where the likelihoods differ by less than the odds
of one to twenty, the recording prefers none; only their size does. Such rivals are carried over
to other motions, and the one on which their efforts differ most is the excitation to ask for.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sgp_ros.diagnosis.certainty import TEMPER
from sgp_ros.diagnosis.decision import Scale
from sgp_ros.diagnosis.findings import joint_name
from sgp_ros.diagnosis.prediction import imbalance
from sgp_ros.diagnosis.result import Equivalent
from sgp_ros.robots.effects.drive import Drive

if TYPE_CHECKING:
    from sgp_ros.diagnosis.candidates import Model
    from sgp_ros.diagnosis.decision import Decision
    from sgp_ros.diagnosis.equations import Equations
    from sgp_ros.diagnosis.hypotheses import Competition
    from sgp_ros.robots.effects.observed_motion import ObservedMotion

ALIKE = math.log(20.0) / TEMPER
"""Difference of the fits below which a recording prefers neither model [nats]."""
MOST = 3
CLEARER = 2.0
"""A motion separates models if their efforts differ this many times more, as mean squares."""
LONGEST = 4000
"""Rows of the recording that are carried over to other motions."""
MOTIONS = {
    'a motion twice as wide': (2.0, 1.0, 0.0),
    'a motion half as wide': (0.5, 1.0, 0.0),
    'a motion twice as fast': (1.0, 2.0, 0.0),
    'a motion half as fast': (1.0, 0.5, 0.0),
    'the same motion about another position': (1.0, 1.0, 1.5),
}
"""Width and speed relative to the recording, shift of the middle in standard deviations."""


def equivalents(
    equations: Equations, competition: Competition, decision: Decision
) -> tuple[Equivalent, ...]:
    """Return what the recording cannot tell from the asserted model, best first.

    Args:
        equations: of the recording.
        competition: its models.
        decision: `unexplained` has no model to tell anything from.
    """
    if decision.verdict == 'unexplained':
        return ()
    scale, best = Scale.of(equations, competition), decision.model
    bases = competition.nominal, competition.parameters
    found: list[Equivalent] = []
    known: list[Model] = [best]
    rivals = sorted({*decision.rivals, *bases} - {best}, key=scale.worth, reverse=True)
    for rival in rivals:
        is_alike = scale.fit(rival) > scale.fit(best) - ALIKE
        if len(found) < MOST and is_alike and not any(_contains(rival, m) for m in known):
            known.append(rival)
            found.append(_told(equations, best, rival))
    return tuple(found)


def _contains(rival: Model, model: Model) -> bool:
    """Return whether a rival is a model with more freedom: it fits as well of necessity."""
    return model.key <= rival.key and (rival.is_free or not model.is_free)


def _told(equations: Equations, best: Model, rival: Model) -> Equivalent:
    here = _difference(equations, best, rival, moved(equations.motion, 1.0, 1.0, 0.0))
    there = {
        name: _difference(equations, best, rival, moved(equations.motion, *how)) / here
        for name, how in MOTIONS.items()
    }
    name = max(there, key=lambda n: there[n])
    is_clear = there[name] > CLEARER
    effects = tuple(
        (joint_name(equations.motion, s.place.joint), s.effect.name) for s in rival.suspects
    )
    return Equivalent(effects, name if is_clear else '', there[name] if is_clear else 1.0)


def _difference(equations: Equations, one: Model, other: Model, motion: ObservedMotion) -> float:
    """Return the mean square by which the efforts of two models differ, relative, over joints."""
    driven = motion.tree.is_actuated[: motion.tree.size]
    inertial = motion.mass_diagonal * motion.acceleration
    power = np.where(driven, (motion.effort**2).mean(axis=0), (inertial**2).mean(axis=0))
    apart = imbalance(one, equations, motion) - imbalance(other, equations, motion)
    share = (apart**2).mean(axis=0) / np.maximum(power, 1e-300)
    return float(share[motion.moves].sum()) + 1e-300


def moved(motion: ObservedMotion, width: float, speed: float, shift: float) -> ObservedMotion:
    """Return a motion like a given one, under the efforts that the nominal robot takes for it.

    `q' = c + shift sd + width (q - c)` about the middle c, run `speed` times as fast.

    Args:
        motion: given; its first stretch without a pause is used.
        width: factor of the amplitudes.
        speed: factor of the speed.
        shift: of the middle in standard deviations of the position.
    """
    ends = [*motion.starts[1:], len(motion.time)]
    rows = slice(motion.starts[0], min(ends[0], motion.starts[0] + LONGEST))
    q = motion.position[rows]
    middle = q.mean(axis=0)
    time = (motion.time[rows] - motion.time[rows][0]) / speed
    changed = replace(
        motion, time=time, step=motion.step / speed, starts=(0,), drive=None,
        position=middle + shift * q.std(axis=0) + width * (q - middle),
        velocity=width * speed * motion.velocity[rows],
        acceleration=width * speed**2 * motion.acceleration[rows],
        effort=np.zeros_like(q),
    )  # fmt: skip
    driven = motion.tree.is_actuated[: motion.tree.size]
    effort = np.where(driven, changed.nominal_effort, 0.0)
    drive = None
    if motion.drive is not None:
        drive = Drive(time, effort, ((0.0, len(time)),), changed.step)
    return replace(changed, effort=effort, drive=drive)
