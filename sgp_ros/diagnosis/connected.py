"""Whether a recording is better explained by an error of its connection than by the robot.

The usual comparison of models is made on the recording as it is. Where the search for errors of
the connection proposes some, it is made again on the corrected recording, and the errors are
asserted only where they, with whatever physics is left, are worth more than all physics without.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations, joint_name, make_equations
from sgp_ros.diagnosis.compare.sufficiency import require_rows
from sgp_ros.diagnosis.compare.trajectory import choose_bandwidth
from sgp_ros.diagnosis.compare.volume import noisy_volume
from sgp_ros.diagnosis.criteria import ALIKE, NEARLY, PER_EFFECT, TEMPER
from sgp_ros.diagnosis.decide.differences import Several, decide_several, in_halves
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.gathered import Recordings
from sgp_ros.diagnosis.result import Equivalent, Finding
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.diagnosis.setup.evidence import Probe
from sgp_ros.diagnosis.setup.said import equal_errors, error_finding, price_of, setup_advice
from sgp_ros.diagnosis.setup.search import Connection, search
from sgp_ros.diagnosis.shown import LawSearch, Predictions
from sgp_ros.diagnosis.unlisted.statement import extended
from sgp_ros.physics.catalogue import COMMAND_DELAY, TORQUE_GAIN
from sgp_ros.rigid.tree import Tree

_CORRECTED = 'All other results are for the recording corrected in this way.'


@dataclass(frozen=True, eq=False)
class Connected:
    """Recordings as they were, with the models that were compared on them.

    Attributes:
        recordings: corrected where an error of the connection is asserted.
        equations: of what is learned from.
        several: the comparison of models on these.
        correction: what was undone; None for nothing.
        findings: errors of the connection.
        equivalents: errors that the recording cannot tell from these.
        remarks: what is to be done about them.
        rivals: joints with an error of the connection that would explain as much, not asserted.
        trust: probability of the physics against these.
        common: names and joints of physics that is found whether they are there or not.
        has_rival_gains: whether these are gains of drives.
        delay_std: what errors of the connection add to the uncertainty of a delay [s].
        laws: what a search for laws that no list has said.
        uncorrected: what was compared on the recordings as they are; None where these are.
        price: what the errors must be worth [nats].
    """

    recordings: Recordings
    equations: Equations
    several: Several
    correction: Correction | None = None
    findings: tuple[Finding, ...] = ()
    equivalents: tuple[Equivalent, ...] = ()
    remarks: tuple[str, ...] = ()
    rivals: tuple[str, ...] = ()
    trust: float = 1.0
    common: frozenset[tuple[str, str]] = frozenset()
    has_rival_gains: bool = False
    delay_std: float = 0.0
    laws: tuple[LawSearch, ...] = ()
    uncorrected: Connected | None = None
    price: float = 0.0

    def against_rivals(self, finding: Finding) -> Finding:
        """Return physics with its probability against errors of the connection elsewhere.

        At the same joint the two are one law: a motor of another gain, efforts in another unit;
        of the gains of a drive, this is so of the motor's gain alone. Beside gains that were
        searched with it, a delay is less certain.
        """
        delay = finding.parameters.get('delay')
        if finding.effect == COMMAND_DELAY.name and delay is not None and self.delay_std > 0.0:
            delay = replace(delay, std=math.hypot(delay.std or 0.0, self.delay_std))
            finding = replace(finding, parameters={**finding.parameters, 'delay': delay})
        is_one_law = not self.has_rival_gains or finding.effect == TORQUE_GAIN.name
        is_common = (finding.effect, finding.joint) in self.common
        if not self.rivals or is_common or (self.rivals == (finding.joint,) and is_one_law):
            return finding
        return replace(finding, probability=finding.probability * self.trust)

    @property
    def verdict(self) -> str:
        """Verdict on what is compared."""
        return self.several.decision.verdict

    @property
    def nominal(self) -> np.ndarray:
        """Shares of the discrepancy from the nominal robot, (k,)."""
        return Scale.of(self.equations, self.several.comparison).nominal

    @property
    def left(self) -> tuple[np.ndarray, np.ndarray]:
        """Rest of the nominal robot beyond errors of signals, and how much less bodies leave.

        (k,) shares. The first is at least what bodies gain of the variance of the effort, for a
        weight that is held makes the mean square large and tells nothing of the motion.
        """
        nominal, bodies = self.several.comparison.nominal, self.several.comparison.parameters
        gained, power = nominal.left - bodies.left, self.equations.power
        variance = np.minimum(self.equations.motion.effort.var(axis=0), power)
        moving = gained * power / np.where(variance > 0.0, variance, power)
        return np.maximum(nominal.left, moving), gained

    def worth(
        self, nominal: np.ndarray, recorded: np.ndarray, *, is_of_motion: bool = False
    ) -> float:
        """Return the worth of what is decided, as the density of what was recorded [nats].

        That is of the efforts, given the motion, where all joints have some, as in `Probe`; else
        of the motion. Errors are relative to the recorded efforts, in whatever unit these are, so
        that what a perfect model leaves is the same with a correction and without. Where nothing
        is asserted the best model counts if it explains most of the discrepancy: a correction has
        to explain more than it does.

        Args:
            nominal: (k,) shares whose shape is only nearly right; the same of all compared.
            recorded: (k,) mean squared efforts of the recording [N^2 m^2 or N^2].
            is_of_motion: whether that of the motion is asked for in any case.
        """
        decision, base = self.several.decision, self.several.comparison.base
        model = decision.tentative or decision.model
        if decision.tentative and model.left.sum() > NEARLY * base.left.sum():
            model = base
        scale, done = Scale.of(self.equations, self.several.comparison), self.correction
        has_efforts = self.equations.motion.has_all_efforts and not is_of_motion
        if has_efforts:
            model, scale = replace(model, inertia=model.delivered), replace(scale, carried=0.0)
        if done is not None and has_efforts:
            recorded = recorded[done.effort_order] / done.effort_scale**2
        elif done is not None:
            stated = self.equations.loop.volume(0.0 * recorded, 1.0 / done.kp, 1.0 / done.kd)
            units = model.inertia - stated - np.log(np.abs(done.scale))
            model = replace(model, inertia=noisy_volume(units, self.equations.noise_part))
            recorded = recorded[done.effort_order]
        return replace(scale, nominal=nominal, power=recorded).worth(model)

    def recorded(self, found: Predictions) -> Predictions:
        """Return accelerations as the recording shows them."""
        if self.correction is None:
            return found
        shown = np.empty_like(found.acceleration)
        shown[:, self.correction.order] = found.acceleration * self.correction.scale
        return replace(found, acceleration=shown)


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
        by_gains = search(Probe(recordings.learned, tree, bandwidth, knows_bodies=True))
        known = _connected(plain, by_gains, tree, each)
        is_body = plain.verdict == 'parameters_only'
        if by_gains.is_enough or (known.findings and not is_body):
            return known
    found = search(Probe(recordings.learned, tree, bandwidth))
    if not known.findings:
        return _connected(plain, found, tree, each)
    # what other bodies leave is too small to tell them from other gains
    return _beside(plain, by_gains, 0.0) if found.is_enough else known


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
    plain: Connected, found: Connection, tree: Tree, each: Iterator[Callable[[float], None]]
) -> Connected:
    """Return the recordings with errors of the connection undone where that is worth it."""
    if not found.errors:
        return plain
    recordings, correction = plain.recordings, found.errors[-1].correction
    corrected = replace(
        compared(recordings.corrected(correction), correction.tree(tree), next(each)),
        correction=correction,
    )
    is_free = any(len(e.numbers) for e in found.errors)  # and may imitate a law
    if is_free and corrected.verdict == 'unexplained':
        said = (setup_advice(found),) * (plain.verdict == 'unexplained')
        return replace(plain, remarks=(*said, *plain.remarks))
    price, rare = price_of(found)
    gain = _gain(plain, corrected, price)
    if gain >= PER_EFFECT and plain.verdict != 'unexplained':
        # on the same band: what is slower has less noise
        cutoff = corrected.equations.filter.cutoff
        if plain.equations.filter.cutoff > cutoff:
            on_band = compared(recordings, tree, next(each), cutoff)
            gain = _gain(on_band, corrected, price)
    least = -ALIKE if _stands_for_gains(plain, found) else PER_EFFECT
    if gain < least:
        return plain if gain + rare < -ALIKE else _beside(plain, found, gain, _named(corrected))
    return replace(
        corrected,
        findings=tuple(error_finding(found, i, gain) for i in range(len(found.errors))),
        equivalents=equal_errors(found), delay_std=found.delay_std, uncorrected=plain, price=price,
        remarks=(*(f'{e.remedy} {_CORRECTED}' for e in found.errors), *recordings.remarks),
    )  # fmt: skip


def _stands_for_gains(plain: Connected, found: Connection) -> bool:
    """Return whether the gain of a motor imitates those of its drive, both scaled alike.

    Where commands are position targets, the motor that multiplies them is the drive.
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


def _beside(
    plain: Connected, found: Connection, gain: float,
    common: frozenset[tuple[str, str]] = frozenset(),
) -> Connected:  # fmt: skip
    """Return the recording as it is, with errors of the connection that explain as much."""
    named = tuple((e.hypothesis.joint, e.hypothesis.effect) for e in found.errors)
    return replace(
        plain, equivalents=(Equivalent(named, '', 1.0),),
        rivals=tuple(joint for joint, _ in named),
        has_rival_gains=any(e.hypothesis.is_of_gains for e in found.errors),
        trust=1.0 / (1.0 + math.exp(TEMPER * gain)), common=common,
    )  # fmt: skip


def compared(
    recordings: Recordings, tree: Tree, progress: Callable[[float], None], most_hz: float = np.inf
) -> Connected:
    """Return the models that are compared on recordings as they are, up to a cut-off [Hz]."""
    bandwidth = choose_bandwidth(recordings.learned, tree)
    if bandwidth.cutoff > most_hz:
        state_cutoff = bandwidth.state_cutoff * most_hz / bandwidth.cutoff
        bandwidth = replace(bandwidth, cutoff=most_hz, state_cutoff=state_cutoff)
    require_rows(recordings.learned, bandwidth)
    equations = make_equations(recordings.learned, tree, bandwidth, recordings.unstated)
    several = decide_several(equations, len(recordings.names), progress)
    return Connected(recordings, equations, several, remarks=recordings.remarks)
