"""Result of a diagnosis, as data for files, reports and nodes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from sgp_ros.diagnosis.shown import (
    Band,
    Dependence,
    LawSearch,
    Overlay,
    Predictions,
    Traces,
)

VERDICTS = ('no_mismatch', 'parameters_only', 'setup_error', 'missing_physics', 'unexplained')


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number, or word, of a finding.

    Attributes:
        value: [unit].
        std: standard deviation; None for words and where it is not known.
        unit: SI; empty for words.
    """

    value: float | str
    std: float | None = None
    unit: str = ''


@dataclass(frozen=True, slots=True)
class Location:
    """The region an effect is confined to; empty where it acts everywhere.

    Attributes:
        variables: of `position`, `velocity`, `effort`, `time`.
        intervals: by variable, `[lo, hi]` each.
        time: `[t0, t1]` in the training recording [s].
    """

    variables: tuple[str, ...] = ()
    intervals: Mapping[str, list[list[float]]] = field(default_factory=dict)
    time: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Finding:
    """An effect that is asserted, or an alternative that is not.

    Attributes:
        joint: name; `base`, `tool` or `all` as in the schema.
        effect: name in the schema; `unknown`.
        parameters: by name.
        location: region.
        log_bayes_factor: of the model it belongs to, against the best one without effects [nats].
        probability: that joint and effect are right, calibrated on simulated worlds.
        share: of the mean squared effort of the joint.
        formula: of the effect.
        why: one sentence; for an alternative why it lost, for `unknown` what it depends on.
        in_simulation: the parameters that the simulation has, where it is the reference.
        difference: of the machine from the simulation.
    """

    joint: str
    effect: str
    parameters: Mapping[str, Parameter]
    location: Location
    log_bayes_factor: float
    probability: float
    share: float
    formula: str = ''
    why: str = ''
    in_simulation: Mapping[str, Parameter] = field(default_factory=dict)
    difference: Mapping[str, Parameter] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Difference:
    """Effect in one of several recordings beyond the model common to all.

    Attributes:
        recording: its stem; joint, effect, probability and share in it as of a finding.
        parameters: by name, in this recording: what is common and what differs together.
        difference: by name, from what is common.
    """

    recording: str
    joint: str
    effect: str
    parameters: Mapping[str, Parameter]
    difference: Mapping[str, Parameter]
    probability: float
    share: float


@dataclass(frozen=True, slots=True)
class Equivalent:
    """Another explanation that fits the recording as well as the asserted one.

    Attributes:
        effects: joint and effect, one or more; empty for wrong parameters of bodies.
        motion: that would tell the two apart; empty where none that was tried does.
        contrast: mean squared difference of their efforts there, relative to the recording.
    """

    effects: tuple[tuple[str, str], ...]
    motion: str
    contrast: float


@dataclass(frozen=True, slots=True)
class ParameterError:
    """An inertial parameter that differs from the nominal one.

    Attributes:
        link: name.
        parameter: `mass`, `com_x` and so on.
        value: found [unit].
        std: of it.
        nominal: [unit].
        unit: SI.
    """

    link: str
    parameter: str
    value: float
    std: float
    nominal: float
    unit: str


@dataclass(frozen=True, slots=True)
class Proof:
    """How well the nominal and the final model explain one recording.

    Attributes:
        nmse_before, nmse_after: mean squared error of the effort over the variance of the
            commanded effort, by joint.
        acceleration_before, acceleration_after: the same of the accelerations.
        nlpd_before, nlpd_after: mean negative log predictive density of the effort [nats].
        rollout_before, rollout_after: mean squared error of the position over 0.3 s roll-outs
            from measured states, over that of holding the position at their start, by joint;
            empty where none were made.
        intervals: 95 % intervals of all these, by their name in diagnosis.json and joint; absent
            where a recording is too short for one.
        nlpd_intervals: of `nlpd_before` and `nlpd_after`; None likewise.
        rollouts: number of roll-outs.
        failed: of them, where one of the models did not end; these are in no mean.
        distance: median distance of the states from those learned from, in standard deviations
            per coordinate.
        yardsticks: root mean square of what `nmse`, `acceleration_nmse` and `rollout_nmse` are
            relative to, by these names and joint [N m or N, rad/s^2 or m/s^2, rad or m].
    """

    nmse_before: Mapping[str, float]
    nmse_after: Mapping[str, float]
    acceleration_before: Mapping[str, float]
    acceleration_after: Mapping[str, float]
    nlpd_before: float
    nlpd_after: float
    rollout_before: Mapping[str, float] = field(default_factory=dict)
    rollout_after: Mapping[str, float] = field(default_factory=dict)
    intervals: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    nlpd_intervals: tuple[tuple[float, float] | None, tuple[float, float] | None] = (None, None)
    rollouts: int = 0
    failed: int = 0
    distance: float = 0.0
    yardsticks: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def errors(self) -> dict[str, Mapping[str, float]]:
        """Return the errors by joint under their names in diagnosis.json, before, then after."""
        return {
            'nmse_before': self.nmse_before,
            'nmse_after': self.nmse_after,
            'acceleration_nmse_before': self.acceleration_before,
            'acceleration_nmse_after': self.acceleration_after,
            'rollout_nmse_before': self.rollout_before,
            'rollout_nmse_after': self.rollout_after,
        }

    def rms(self, name: str) -> dict[str, float]:
        """Return errors in units instead of relative ones, by joint; empty where unknown.

        Args:
            name: of `errors`.
        """
        errors = self.errors()[name]
        scale = self.yardsticks.get(name.rpartition('_')[0], {})
        return {j: math.sqrt(x) * scale[j] for j, x in errors.items() if j in scale}


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """Everything that `sgp diagnose` found.

    Attributes:
        robot: its name.
        joints: (k,) names.
        units: (k,) of the efforts.
        verdict: one of `VERDICTS`.
        certainty: probability that the verdict is right; None where it rests on a joint that the
            model explains no better than a constant.
        findings: asserted, most probable first.
        alternatives: not asserted, best first.
        parameter_errors: of the final model; those beyond two standard deviations.
        proofs: by stem of the recording; `train` first.
        predictions: by stem of the held-out recordings.
        dependences: per joint.
        traces: for pictures.
        cutoff_hz, rate_hz: of the filtered rows.
        rows: number of them.
        refused: states by reason, of the training recording.
        simulation: share of the mean squared effort that is left there, by joint; empty without.
        remarks: for the user.
        equivalents: what this motion cannot tell from the findings, best first.
        bands: Z over each variable of each joint; empty where too few rows were had.
        recordings: stems of several training recordings; empty for one.
        differences: what differs between these, most probable first.
        reference: `simulation` or `robot`, what the machine is compared with.
        shared: effects that machine and simulation have alike.
        setup: errors of how the robot was connected or described, undone before all else.
        visibility: least that would show, infinite if nothing would; by joint, effect, parameter.
        overlays: motions of both models over the measured one, by stem; empty where not asked for.
        law_searches: at joints that listed effects do not describe, or only nearly.
        bodies: (b, 10) inertial parameters of the final model, of bodies that can exist, in the
            order of the tree; None for the nominal ones.
    """

    robot: str
    joints: tuple[str, ...]
    units: tuple[str, ...]
    verdict: str
    certainty: float | None
    findings: tuple[Finding, ...]
    alternatives: tuple[Finding, ...]
    parameter_errors: tuple[ParameterError, ...]
    proofs: Mapping[str, Proof]
    predictions: Mapping[str, Predictions]
    dependences: tuple[Dependence, ...]
    traces: Traces
    cutoff_hz: float
    rate_hz: float
    rows: int
    refused: Mapping[str, int]
    simulation: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    bodies: np.ndarray | None = None
    equivalents: tuple[Equivalent, ...] = ()
    bands: tuple[Band, ...] = ()
    recordings: tuple[str, ...] = ()
    differences: tuple[Difference, ...] = ()
    reference: str = 'robot'
    shared: tuple[Finding, ...] = ()
    setup: tuple[Finding, ...] = ()
    visibility: Mapping[tuple[str, str, str], Parameter] = field(default_factory=dict)
    overlays: Mapping[str, Overlay] = field(default_factory=dict)
    law_searches: tuple[LawSearch, ...] = ()
