"""Statements on errors of the connection: findings, equivalents, price."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.bodies import SPREAD
from sgp_ros.diagnosis.criteria import (
    ALIKE,
    DOUBTED,
    INTERVAL,
    MOST_CERTAIN,
    NEARLY,
    PER_EFFECT,
    PER_PARAMETER,
    PER_UNUSUAL,
    STATED_ERROR,
    TEMPER,
)
from sgp_ros.diagnosis.result import Equivalent, Finding, Location, Parameter
from sgp_ros.diagnosis.setup.connection import Connection, Tried
from sgp_ros.diagnosis.setup.errors import EFFORT_SCALE
from sgp_ros.physics.catalogue import TORQUE_GAIN
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.motion import Structure

_UNDONE = 'a law of the same joint may undo it; together they may be right'
_NEARLY = 'much of what it explains is left at this joint'


def price_of(found: Connection) -> tuple[float, float]:
    """Return the price of errors, and the part of it that is for rare ones [nats]."""
    numbers = sum(len(e.numbers) for e in found.errors)
    rare = PER_UNUSUAL * sum(not e.hypothesis.is_of_gains for e in found.errors)
    return PER_EFFECT * len(found.errors) + PER_PARAMETER * numbers + rare, rare


def setup_advice(found: Connection) -> str:
    """Return what to check where errors are not asserted because too much is left with them."""
    errors = ', '.join(
        f'{e.hypothesis.effect.replace("_", " ")} ({e.hypothesis.joint})' for e in found.errors
    )
    return f'Check the set-up: {errors} would reduce the residual, but not enough to be asserted.'


def clear(found: Connection) -> Connection:
    """Return the errors with a number whose 95 % interval leaves out that of no error."""
    for i in reversed(range(len(found.errors))):
        e = found.errors[i]
        beyond = np.abs(e.numbers - e.hypothesis.neutral) > INTERVAL * _deviations(e)
        if e.numbers.size and not beyond.any():
            found = found.without(i)
    return found


def _deviations(e: Tried) -> np.ndarray:
    """Return the standard deviations of the numbers of an error, (m,).

    Gains of drives are found with the bodies of the robot file, whose errors are theirs too.
    """
    of_bodies = STATED_ERROR * SPREAD if e.hypothesis.is_of_gains else 0.0
    return np.asarray(np.hypot(e.std, of_bodies * e.numbers))


def error_finding(found: Connection, number: int, gain: float) -> Finding:
    """Return an error with its probability against its rivals and against no error."""
    e = found.errors[number]
    rivals = [r.worth - e.worth for r in found.rivals[number]]
    odds = math.exp(-TEMPER * gain) + math.exp(-TEMPER * e.needed)
    odds += sum(math.exp(min(TEMPER * r, 50.0)) for r in rivals)
    stds = [float(s) if 0.0 < own < math.inf else None
            for own, s in zip(e.std, _deviations(e), strict=True)]  # fmt: skip
    named = zip(e.hypothesis.names, e.numbers, stds, e.hypothesis.units, strict=True)
    numbers = {name: Parameter(float(x), std, unit) for name, x, std, unit in named}
    words = {name: Parameter(word) for name, word in e.hypothesis.words.items()}
    return Finding(
        e.hypothesis.joint, e.hypothesis.effect, {**numbers, **words}, Location(), gain,
        min(1.0 / (1.0 + odds), MOST_CERTAIN), 1.0,
    )  # fmt: skip


def equal_errors(found: Connection) -> tuple[Equivalent, ...]:
    """Return the errors that a recording cannot tell from those found."""
    return tuple(
        Equivalent(((r.hypothesis.joint, r.hypothesis.effect),), '', 1.0)
        for e, rivals in zip(found.errors, found.rivals, strict=True)
        for r in rivals
        if e.worth - r.worth < ALIKE and math.isfinite(r.worth)
    )


def doubted_scales(
    findings: tuple[Finding, ...],
    effects: Iterable[EffectAt],
    shares: tuple[np.ndarray, np.ndarray],
    tree: Structure,
) -> tuple[Finding, ...]:
    """Return errors of the connection, with scales of efforts doubted that are not all there is.

    Where physics takes the same effort times a number, a gain is in both, and neither alone need
    be right; a formula that was found, whatever it takes, fills what a wrong scale opens. Where
    much of what a scale explains is left, or of all there is, it says only nearly what there is,
    such as a transmission whose ratio changes with the position.

    Args:
        findings: errors of the connection.
        effects: that are asserted beside them.
        shares: (k,) of the mean squared effort, left by the nominal robot and the recording
            as it is, and with all of them.
        tree: nominal robot.
    """
    scaled = {
        tree.moving_names[s.place.joint] for s in effects
        if s.effect.is_open or s.effect is TORQUE_GAIN
    }  # fmt: skip
    rest = dict(zip(tree.moving_names, zip(*shares, strict=True), strict=True))

    def doubt(f: Finding) -> str:
        if f.effect != EFFORT_SCALE or f.joint not in rest:
            return ''
        explained = (float(f.parameters['scale'].value) - 1.0) ** 2
        before, after = rest[f.joint]
        nearly = _NEARLY if after > NEARLY * min(explained, before) else ''
        return _UNDONE if f.joint in scaled else nearly

    return tuple(
        replace(f, probability=min(f.probability, DOUBTED), why=why) if why else f
        for f, why in zip(findings, map(doubt, findings), strict=True)
    )
