"""Recordings with the models that were compared on them, as they are or corrected."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import Equations, make_equations
from sgp_ros.diagnosis.compare.several import alone
from sgp_ros.diagnosis.compare.sufficiency import require_rows
from sgp_ros.diagnosis.compare.trajectory import RawTrajectory
from sgp_ros.diagnosis.compare.volume import noisy_volume
from sgp_ros.diagnosis.criteria import NEARLY
from sgp_ros.diagnosis.decide.decision import calm
from sgp_ros.diagnosis.decide.differences import Several, decide_several, force_of
from sgp_ros.diagnosis.decide.scale import Scale, beyond_noise, moving_power
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.fitted_model import first_scale
from sgp_ros.diagnosis.explain.in_recording import own_laws
from sgp_ros.diagnosis.explain.joint_search import without_vain
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.gathered import Recordings
from sgp_ros.diagnosis.result import Equivalent, Finding
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.diagnosis.setup.evidence import Probe
from sgp_ros.diagnosis.shown import LawSearch, Predictions
from sgp_ros.physics.catalogue import ARMATURE, COMMAND_DELAY, TORQUE_GAIN
from sgp_ros.physics.servo import Servo
from sgp_ros.rigid.tree import Tree


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
    def unexplained(self) -> np.ndarray:
        """Shares of the mean squared effort that the best model leaves, beyond noise, (k,)."""
        decision = self.several.decision
        return beyond_noise(self.equations, decision.tentative or decision.model)

    @property
    def left(self) -> tuple[np.ndarray, np.ndarray]:
        """Rest of the nominal robot beyond errors of signals, and how much less bodies leave.

        (k,) shares. The first is at least what bodies gain of the variance of the effort, for a
        weight that is held makes the mean square large and tells nothing of the motion.
        """
        nominal, bodies = self.several.comparison.nominal, self.several.comparison.parameters
        gained = nominal.left - bodies.left
        moving = gained * self.equations.power / moving_power(self.equations)
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
        if done is not None and not has_efforts:
            kp, kd = (x * done.scale / done.effort_scale for x in (done.kp, done.kd))
            stated = self.equations.loop.volume(0.0 * recorded, 1.0 / kp, 1.0 / kd)
            units = model.inertia - stated - np.log(np.abs(done.scale))
            shown = noisy_volume(units, self.equations.noise_part)
            unit = np.log(np.abs(done.effort_scale))
            model = replace(model, inertia=shown + unit)
            scale = replace(scale, carried=scale.carried + unit)
        if done is not None:
            recorded = recorded[done.effort_order] / done.effort_scale**2
        return replace(scale, nominal=nominal, power=recorded).worth(model)

    def recorded(self, found: Predictions) -> Predictions:
        """Return accelerations as the recording shows them."""
        if self.correction is None:
            return found
        shown = np.empty_like(found.acceleration)
        shown[:, self.correction.order] = found.acceleration * self.correction.scale
        return replace(found, acceleration=shown)


def compared(
    recordings: Recordings, tree: Tree, progress: Callable[[float], None], most_hz: float = np.inf
) -> Connected:
    """Return the models that are compared on recordings as they are, up to a cut-off [Hz].

    Rotors that the robot file does not have change the ripple of held targets: where some are
    found, all is compared again with these, and what leaves less counts.
    """
    found = _compared(recordings, tree, progress, most_hz)
    rotors = _rotors_of_ripple(found)
    if not rotors.any():
        return found
    turned = recordings.changed(
        lambda raw: replace(raw, gains=raw.gains and replace(raw.gains, rotors=rotors))
    )
    again = _compared(turned, tree, lambda _share: None, most_hz)
    return min(found, again, key=lambda c: float(c.unexplained.sum()))


def _compared(
    recordings: Recordings, tree: Tree, progress: Callable[[float], None], most_hz: float
) -> Connected:
    of = equations_of(recordings, tree, most_hz)
    equations, count = of(recordings.learned), len(recordings.names)
    several = decide_several(
        equations, count, progress, lambda r: of(alone(recordings.learned, r))
    )
    return Connected(recordings, equations, several, remarks=recordings.remarks)


def _rotors_of_ripple(found: Connected) -> np.ndarray:
    """Return the rotors that were found where samples show a ripple, else none, (k,)."""
    drive, decision = found.equations.motion.drive, found.several.decision
    rotors = np.zeros(found.equations.d.shape[1])
    if isinstance(drive, Servo) and drive.ripple is not None:
        for s in (decision.tentative or decision.model).effects:
            if s.effect is ARMATURE:
                rotors[s.place.joint] += max(float(s.coefficients[0]), 0.0)
    return rotors


def equations_of(
    recordings: Recordings, tree: Tree, most_hz: float = np.inf
) -> Callable[[RawTrajectory], Equations]:
    """Return what makes equations of a part of recordings, up to a cut-off [Hz]."""
    bandwidth = choose_bandwidth(recordings.learned, tree)
    bandwidth = bandwidth.up_to(most_hz)
    require_rows(recordings.learned, bandwidth)
    accuracy = 1.0
    if not (recordings.unstated or recordings.learned.approach is not None):
        none = Correction.none(tree.size)
        accuracy = Probe(recordings.learned, tree, bandwidth).agreement(none).accuracy
    return lambda raw: make_equations(raw, tree, bandwidth, recordings.unstated, accuracy)


def foreseen(plain: Connected, correction: Correction, tree: Tree) -> Connected:
    """Return what corrected recordings say with the laws of those as they are, or fewer.

    A correction that makes some of these laws needless shows it without a search for others.

    Args:
        plain: recordings as they are, with the models that were compared on them.
        correction: of errors of the connection.
        tree: nominal robot.
    """
    recordings = plain.recordings.corrected(correction)
    equations = equations_of(recordings, correction.tree(tree))(recordings.learned)
    columns, left, of = Columns(equations), equations, plain.several.model
    model = fit(columns, of.effects, first_scale(equations), is_free=of.is_free)
    own = own_laws(model.effects)
    if own:
        left = replace(equations, d=equations.d - force_of(model, own))
        columns = Columns(left)
    start = first_scale(left)
    bases = [fit(columns, (), start, is_free=is_free) for is_free in (False, True)]
    comparison, common = Comparison(bases[0], bases[1], (), ()), plain.several.decision.model
    tried = [fit(columns, common.effects, model.sigma, is_free=m.is_free, w=m.w) for m in bases]
    scale = Scale.of(left, comparison)
    best = max((*bases, *(without_vain(columns, m) for m in tried)), key=scale.worth)
    decision = replace(calm(comparison.base, (), scale), model=best, verdict='missing_physics')
    several = Several(left, comparison, decision, model, {})
    return Connected(recordings, equations, several, correction)
