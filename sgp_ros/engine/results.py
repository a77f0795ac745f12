"""Results of the engine: values only, read by nodes, commands and reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.journal import Failure
from sgp_ros.engine.samples import Event
from sgp_ros.gp.regression import Regression
from sgp_ros.gp.scores import RunningScore
from sgp_ros.robots.robot import Robot

REFUSALS = (
    'late', 'duplicate', 'stale', 'nonfinite', 'unpaired', 'unknown_joint', 'gap', 'wrong_length',
    'clock', 'implausible', 'reset', 'error',
)  # fmt: skip
"""Reasons for which a state is refused; each refused state has exactly one."""

COMMAND_REFUSALS = (
    'late', 'nonfinite', 'unknown_joint', 'wrong_kind', 'wrong_length', 'clock', 'reset', 'error',
)  # fmt: skip
"""Reasons for which a command is refused."""

CHANGE_REFUSALS = ('late', 'clock', 'invalid', 'no_factor', 'reset', 'error')
"""Reasons for which a change of settings or a reset in a stream is refused."""

REFIT_REFUSALS = ('diverged', 'no_better', 'no_factor', 'outdated')
"""Reasons for which a fit is refused: no hyper-parameters with a finite evidence were found; none
with a higher evidence than those in force; the covariance of the present buffer has no factor
under them; the samples that they were fitted to are forgotten."""


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """Measured and predicted values of one quantity, each (k,); NaN where there is none.

    Attributes:
        measured: filtered measurement [unit of the channel].
        mean: predicted mean, made before the measurement was revealed.
        variance: of that measurement under the prediction, noise included, calibrated by earlier
            errors [unit squared].
        raw_variance: as the model states it [unit squared].
    """

    measured: np.ndarray
    mean: np.ndarray
    variance: np.ndarray
    raw_variance: np.ndarray

    @classmethod
    def raw(cls, measured: np.ndarray, mean: np.ndarray, variance: np.ndarray) -> Channel:
        """Return a prediction before it is calibrated; unknown where rounding left no variance."""
        if not (variance > 0.0).all():
            mean, variance = (np.where(variance > 0.0, x, np.nan) for x in (mean, variance))
        return cls(measured, mean, variance, variance)

    @classmethod
    def unknown(cls, measured: np.ndarray) -> Channel:
        """Return these measurements without a prediction."""
        nothing = np.full(len(measured), np.nan)
        return cls(measured, nothing, nothing, nothing)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Prediction for one sample.

    Attributes:
        stamp_ns: header stamp of the sample at the centre of the window [ns].
        names: joints, k of them.
        position: (k,) filtered position at that time.
        velocity: (k,) filtered velocity.
        acceleration: measured and predicted accelerations.
        effort: measured and predicted efforts.
        is_scored: whether it entered the scores: a model existed and its variance was finite.
        is_learned: whether the model then learned it.
        physics: (k,) the target as the physics alone predicts it; None without such a model.
    """

    stamp_ns: int
    names: tuple[str, ...]
    position: np.ndarray
    velocity: np.ndarray
    acceleration: Channel
    effort: Channel
    is_scored: bool
    is_learned: bool
    physics: np.ndarray | None = None


@dataclass(frozen=True, slots=True)
class ParameterEstimate:
    """Posterior of one coefficient; `std` is None exactly where it is not identifiable."""

    name: str
    joint: str | None
    value: float
    std: float | None
    unit: str
    is_identifiable: bool


@dataclass(frozen=True, slots=True)
class Score:
    """Prequential scores of one channel of one joint.

    Attributes:
        nmse: mean squared error over the variance of the measured target.
        nlpd: mean negative log predictive density [nat].
        coverage95: share of measurements inside the 95 % interval.
        raw_coverage95: the same for the variance as the model states it.
        n: number of scored samples.
    """

    nmse: float
    nlpd: float
    coverage95: float
    raw_coverage95: float
    n: int


@dataclass(slots=True)
class Counts:
    """How many states and commands came, and what became of them.

    Attributes:
        read, used, refused: states that came, those accepted, and those refused by reason; what
            waits for its order is neither yet.
        commands_read, commands_used, commands_refused: the same for commands.
        changes_refused: changes of settings and resets that a stream held, by reason.
        clock_jumps: times at which the clock of the stream jumped, and a new segment began.
        estimated: windows that gave an equation.
        learned: equations that the model learned.
        scored: equations whose prediction entered the scores.
        held: equations that dry friction makes inequalities, as it holds a joint at rest: scored
            for the other joints, and learned from their rows only where no Z is learned.
        unlearnable: equations that repeat others to rounding.
        implausible: equations that neither signals nor model make possible, see `gate`.
        reverted: times at which what was learned before implausible equations took its place
            again.
        refits: fits of hyper-parameters put in force.
        refits_refused_for: those refused by reason.
        factor_checks, factor_drift: factors compared with fresh ones, and the largest relative
            difference found.
        factor_rebuilt: factors that were lost to rounding and computed anew from the buffer.
    """

    read: int = 0
    used: int = 0
    refused: dict[str, int] = field(default_factory=lambda: dict.fromkeys(REFUSALS, 0))
    commands_read: int = 0
    commands_used: int = 0
    commands_refused: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(COMMAND_REFUSALS, 0)
    )
    changes_refused: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(CHANGE_REFUSALS, 0)
    )
    clock_jumps: int = 0
    estimated: int = 0
    learned: int = 0
    scored: int = 0
    held: int = 0
    unlearnable: int = 0
    implausible: int = 0
    reverted: int = 0
    refits: int = 0
    refits_refused_for: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(REFIT_REFUSALS, 0)
    )
    factor_checks: int = 0
    factor_drift: float = 0.0
    factor_rebuilt: int = 0

    @property
    def refits_refused(self) -> int:
        """Fits of hyper-parameters that were not put in force."""
        return sum(self.refits_refused_for.values())


@dataclass(frozen=True, slots=True)
class Step:
    """Result of one `push`.

    Attributes:
        released: events in the order in which they took effect; a record of these reproduces
            the run.
        estimates: predictions that became possible.
        failures: events that only a bug can have kept from taking effect, counted as `error`.
    """

    released: tuple[Event, ...] = ()
    estimates: tuple[Estimate, ...] = ()
    failures: tuple[Failure, ...] = ()

    def then(self, other: Step) -> Step:
        """Return what both set free, one after the other."""
        if self is NOTHING or other is NOTHING:
            return other if self is NOTHING else self
        return Step(self.released + other.released, self.estimates + other.estimates)


NOTHING = Step()
"""Result of an event that waits, or is refused."""


def read_parameters(
    robot: Robot, config: EngineConfig, model: Regression | None
) -> tuple[ParameterEstimate, ...]:
    """Return the posterior of every coefficient under a model; empty without one."""
    if model is None or config.model_method == 'GP':
        return ()
    information = model.information
    std = np.sqrt(np.diag(information.covariance))
    known = information.is_identifiable
    return tuple(
        ParameterEstimate(c.name, c.joint, float(w), float(s) if k else None, c.unit, bool(k))
        for c, w, s, k in zip(
            robot.coefficients, information.coefficients, std, known, strict=True
        )
    )


def read_scores(
    robot: Robot, scores: Mapping[str, Sequence[RunningScore]]
) -> dict[str, dict[str, Score]]:
    """Return scores by joint and channel; what has no samples or a constant target is absent."""
    found: dict[str, dict[str, Score]] = {}
    for j, joint in enumerate(robot.joint_names):
        channels = {channel: _score(running[j]) for channel, running in scores.items()}
        found[joint] = {c: score for c, score in channels.items() if score is not None}
    return found


def _score(running: RunningScore) -> Score | None:
    if running.n == 0 or not np.isfinite(running.nmse):
        return None
    return Score(running.nmse, running.nlpd, running.coverage95, running.raw_coverage95, running.n)
