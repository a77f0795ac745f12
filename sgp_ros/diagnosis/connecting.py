"""Errors of the connection, undone where that explains a recording better than physics alone.

The usual comparison of models is made on the recording as it is. Where the search for errors of
the connection proposes some, it is made again on the corrected recording, and the errors are
asserted only where they, with whatever physics is left, are worth more than all physics without.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.connected import Connected, compared, foreseen
from sgp_ros.diagnosis.criteria import (
    ALIKE,
    COUNTED_SHARE,
    INTERVAL,
    MOST_CERTAIN,
    NEARLY,
    PER_EFFECT,
    TEMPER,
)
from sgp_ros.diagnosis.gathered import Recordings
from sgp_ros.diagnosis.refining import refined
from sgp_ros.diagnosis.result import Equivalent
from sgp_ros.diagnosis.setup.connection import Connection, Tried
from sgp_ros.diagnosis.setup.errors import EFFORT_SCALE
from sgp_ros.diagnosis.setup.evidence import Probe
from sgp_ros.diagnosis.setup.said import (
    clear,
    equal_errors,
    error_finding,
    price_of,
    setup_advice,
)
from sgp_ros.diagnosis.setup.search import search
from sgp_ros.diagnosis.unlisted.statement import extended
from sgp_ros.physics.catalogue import TORQUE_GAIN
from sgp_ros.physics.place import joint_name
from sgp_ros.rigid.tree import Tree

_CORRECTED = 'All other results are for the recording corrected in this way.'


def in_halves(progress: Callable[[float], None]) -> Iterator[Callable[[float], None]]:
    """Yield the progress of one comparison after the other; how many come is not known ahead.

    Each of them is half of what is left, so that the whole goes on and never back.
    """
    left = 1.0
    while True:
        left *= 0.5
        yield lambda share, left=left: progress(1.0 - left * (2.0 - share))  # type: ignore[misc]


def connect(recordings: Recordings, tree: Tree, progress: Callable[[float], None]) -> Connected:
    """Return the recordings with the best explanation, corrected or not.

    Args:
        recordings: as they are.
        tree: nominal robot.
        progress: called with the share that is done.

    Raises:
        RecordingError: too little is left to decide.
    """
    each = in_halves(progress)
    plain = compared(recordings, tree, next(each))
    # known inertia is what tells units and signs apart
    is_open = recordings.learned.approach is not None or bool(recordings.unstated)
    if is_open or plain.verdict == 'no_mismatch':
        return plain
    bandwidth = choose_bandwidth(recordings.learned, tree)
    known = plain
    if recordings.learned.gains is not None:
        # gains can be separated from bodies only where these are known
        by_gains = clear(search(Probe(recordings.learned, tree, bandwidth, knows_bodies=True)))
        known = _connected(plain, by_gains, tree, each)
        is_body = plain.verdict == 'parameters_only'
        if by_gains.is_enough or (known.findings and not is_body):
            return known
    found = clear(search(Probe(recordings.learned, tree, bandwidth)))
    if not known.findings:
        return _connected(known, found, tree, each)
    # what other bodies leave is too small to tell them from other gains
    return _beside(plain, by_gains.errors, 0.0) if found.is_enough else known


def with_laws(connected: Connected) -> Connected:
    """Return what is decided where laws that no list has are looked for.

    Where some are, the recording as it is may have such a law and no error of its connection.
    """
    found = _extended(connected)
    if not found.laws or connected.uncorrected is None:
        return found
    alone = _extended(connected.uncorrected)
    return found if _gain(alone, found, found.price) >= PER_EFFECT else alone


def _extended(connected: Connected) -> Connected:
    several, laws = extended(connected.several)
    return replace(connected, several=several, laws=laws)


def _connected(
    plain: Connected, found: Connection, tree: Tree, each: Iterator[Callable[[float], None]],
    corrected: Connected | None = None,
) -> Connected:  # fmt: skip
    """Return the recordings with errors of the connection undone where that is worth it.

    An error that is not certain must be worth it beside the others, too, with the physics that is
    found without it.

    Args:
        plain: what was compared on the recordings as they are.
        found: errors.
        tree: nominal robot.
        each: progress of one comparison after the other.
        corrected: what was compared with these errors undone, where that is known.
    """
    found, foreseeable = (found, -math.inf) if corrected else _promising(plain, found, tree)
    if not found.errors:
        return plain
    corrected = corrected or _undone(plain, found, tree, each)
    if _is_taken_back(corrected, found):
        return plain
    is_free = any(len(e.numbers) for e in found.errors)  # and may imitate a law
    if is_free and _may_be_a_law(plain, corrected):
        said = (setup_advice(found),) * (plain.verdict == 'unexplained')
        return replace(plain, remarks=(*said, *plain.remarks))
    price, rare = price_of(found)
    gain = _gain(plain, corrected, price)
    if gain >= PER_EFFECT and plain.verdict != 'unexplained':
        # on the same band: what is slower has less noise
        cutoff = corrected.equations.filter.cutoff
        if plain.equations.filter.cutoff > cutoff:
            on_band = compared(plain.recordings, tree, next(each), cutoff)
            gain = _gain(on_band, corrected, price)
    is_one_law = _stands_for_gains(plain, found)
    if gain < _least_gain(found, price, is_one_law=is_one_law):
        gain = max(gain, min(foreseeable, 0.0))  # a search on corrected recordings found less
        is_alike = gain + rare >= -ALIKE
        return _beside(plain, found.errors, gain, _named(corrected)) if is_alike else plain
    is_alike = is_one_law or gain < PER_EFFECT
    equal = _imitated_by(plain, corrected) if is_alike else ()
    if is_one_law:  # under another name it is there anyway
        gain = max(gain, found.end.evidence - found.start.evidence - price)
    found, corrected = _refined(plain, found, corrected, tree, each)
    errors = tuple(error_finding(found, i, gain) for i in range(len(found.errors)))
    least = min(range(len(errors)), key=lambda i: errors[i].probability)
    if len(errors) > 1 and errors[least].probability < MOST_CERTAIN:
        fewer, dropped = found.without(least), found.errors[least]
        without, (less, common) = _undone(plain, fewer, tree, each), price_of(fewer)
        gain = _gain(without, corrected, price - less)
        if gain < PER_EFFECT:
            kept = _connected(plain, fewer, tree, each, without)
            is_alike = gain + rare - common >= -ALIKE
            return _beside(kept, [dropped], gain, _named(corrected)) if is_alike else kept
    return replace(
        corrected, findings=errors,
        equivalents=(*equal, *equal_errors(found)), delay_std=found.delay_std,
        uncorrected=plain, price=price,
        remarks=(*(f'{e.remedy} {_CORRECTED}' for e in found.errors), *plain.recordings.remarks),
    )  # fmt: skip


def _undone(
    plain: Connected, found: Connection, tree: Tree, each: Iterator[Callable[[float], None]]
) -> Connected:
    """Return the models that are compared where errors of the connection are undone."""
    correction = found.errors[-1].correction
    recordings, whole = plain.recordings.corrected(correction), correction.tree(tree)
    return replace(compared(recordings, whole, next(each)), correction=correction)


def _promising(plain: Connected, found: Connection, tree: Tree) -> tuple[Connection, float]:
    """Return errors, with better numbers, and their gain with the laws found without [nats].

    Where these explain the recordings as they are, a comparison of all models on corrected ones
    finds hardly more than with such laws, or fewer, and takes as long as everything before. None
    are left that are worth much too little so.
    """
    if not found.errors or plain.verdict == 'unexplained':
        return found, -math.inf
    corrected, (price, rare) = foreseen(plain, found.errors[-1].correction, tree), price_of(found)
    gain = _gain(plain, corrected, price)
    if gain + rare < -2.0 * ALIKE:
        return replace(found, errors=(), rivals=()), gain
    return refined(found, plain, corrected, tree)[0], gain


def _refined(
    plain: Connected, found: Connection, corrected: Connected, tree: Tree,
    each: Iterator[Callable[[float], None]],
) -> tuple[Connection, Connected]:  # fmt: skip
    """Return errors with better numbers, and what is compared with these undone."""
    again, has_moved = refined(found, plain, corrected, tree)
    if not has_moved:
        return again, corrected
    better = _undone(plain, again, tree, each)
    return (again, better) if _gain(corrected, better, 0.0) > 0.0 else (found, corrected)


def _is_taken_back(corrected: Connected, found: Connection) -> bool:
    """Return whether the gain of a motor undoes the scale of its effort: neither is there then."""
    scales = {e.hypothesis.joint: e for e in found.errors if e.hypothesis.effect == EFFORT_SCALE}
    if not scales:
        return False
    motion, model = corrected.equations.motion, corrected.several.decision.model
    gains = {joint_name(motion, s.place.joint): 1.0 + float(s.coefficients[0])
             for s in model.effects if s.effect is TORQUE_GAIN}  # fmt: skip
    return any(
        abs(gains[joint] - e.numbers[0]) < INTERVAL * e.std[0]
        for joint, e in scales.items() if joint in gains
    )  # fmt: skip


def _may_be_a_law(plain: Connected, corrected: Connected) -> bool:
    """Return whether numbers of an error may imitate a law that is unknown as it was recorded.

    Much of what is unknown is then left there, though it may look adequate with other laws.
    """
    if corrected.verdict == 'unexplained':
        return True
    before, after = plain.unexplained, corrected.unexplained
    still = corrected.several.decision.unknown
    return any(
        after[j] > NEARLY * before[j] and (j in still or after[j] > COUNTED_SHARE)
        for j in plain.several.decision.unknown
    )


def _least_gain(found: Connection, price: float, *, is_one_law: bool) -> float:
    """Return what errors must gain over physics [nats].

    Other gains of a drive are what is stated least surely where commands are targets: they need
    not be clearly better, and no better where physics only stands for them.
    """
    if is_one_law:
        return -ALIKE - price
    return 0.0 if all(e.hypothesis.is_of_gains for e in found.errors) else PER_EFFECT


def _stands_for_gains(plain: Connected, found: Connection) -> bool:
    """Return whether the gain of a motor imitates those of its drive.

    Where commands are position targets, the motor that multiplies them is the drive. Scaled
    unlike, they are its gain and viscous friction.
    """
    named = {e.hypothesis.joint for e in found.errors if 'kp' in e.hypothesis.names}
    scaled = {joint for effect, joint in _named(plain) if effect == TORQUE_GAIN.name}
    return plain.recordings.learned.gains is not None and bool(named & scaled)


def _gain(plain: Connected, corrected: Connected, price: float) -> float:
    """Return by how much the corrected recording is better explained, less a price [nats].

    Efforts, given the motion, and the motion must both be; 0 where only one of them clearly is.
    Where nothing explains the recording as it is, one of them must be, and the other no worse, for
    the models of it are no explanations.
    """
    nominal, recorded = np.minimum(plain.nominal, corrected.nominal), plain.equations.power
    worth = [[c.worth(nominal, recorded, is_of_motion=m) for m in (False, True)]
             for c in (corrected, plain)]  # fmt: skip
    gains = [a - b - price for a, b in zip(*worth, strict=True)]
    if max(gains) < PER_EFFECT:
        return min(gains)
    is_solved = plain.verdict == 'unexplained' != corrected.verdict
    return max(gains) if is_solved and min(gains) >= -price else max(min(gains), 0.0)


def _named(connected: Connected) -> frozenset[tuple[str, str]]:
    """Return the names and joints of the effects that are asserted."""
    motion, model = connected.equations.motion, connected.several.decision.model
    return frozenset((s.name, joint_name(motion, s.place.joint)) for s in model.effects)


def _imitated_by(plain: Connected, corrected: Connected) -> tuple[Equivalent, ...]:
    """Return the physics that errors of the connection took the place of, where there is any."""
    named = sorted((joint, effect) for effect, joint in _named(plain) - _named(corrected))
    return (Equivalent(tuple(named), '', 1.0),) if named else ()


def _beside(
    plain: Connected, errors: Sequence[Tried], gain: float,
    common: frozenset[tuple[str, str]] = frozenset(),
) -> Connected:  # fmt: skip
    """Return what is decided with further errors of the connection that would explain as much."""
    named = tuple((e.hypothesis.joint, e.hypothesis.effect) for e in errors)
    return replace(
        plain, equivalents=(*plain.equivalents, Equivalent(named, '', 1.0)),
        rivals=tuple(joint for joint, _ in named),
        has_rival_gains=any(e.hypothesis.is_of_gains for e in errors),
        trust=1.0 / (1.0 + math.exp(TEMPER * gain)), common=common,
    )  # fmt: skip
