"""A robot identified from a whole recording: filter, fits side by side, parameters, excitation.

Every method learns from the same rows and is scored on the same held-out ones: other recordings,
or stretches of time of this one. The parameters come from the physics alone, fitted to all rows
of the recording: a process that sees position and velocity could imitate its columns.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.batch.blocks import holdout
from sgp_ros.batch.bodies import nearest_bodies
from sgp_ros.batch.excitation import Excitation, judge_excitation, require_motion, structural_base
from sgp_ros.batch.fit import OfflineFit, fit_offline
from sgp_ros.batch.inputs import CANDIDATES, InputChoice, choose_inputs
from sgp_ros.batch.passive import require_balance
from sgp_ros.batch.plan import CUTOFFS, PlanChoice, choose_plan
from sgp_ros.batch.regression_data import FilteredData, FilterPlan, filtered_data
from sgp_ros.batch.signals import Signals
from sgp_ros.batch.suggestions import Suggestion, suggest_motions
from sgp_ros.errors import ConfigError, NumericalError, RecordingError
from sgp_ros.rigid.base_parameters import BaseParameters, RegressorFactor
from sgp_ros.rigid.consistent import ConsistentEstimate
from sgp_ros.robots.robot import Robot

METHODS = ('PR', 'GP', 'PRGP', 'SGP')
OWN = CANDIDATES[-1]
"""Inputs of GP and PRGP, unless said otherwise: all candidates."""
HELD_OUT = 'held out'
"""Name of the held-out part of the recording itself."""


@dataclass(frozen=True, slots=True)
class IdentificationOptions:
    """How a recording is identified.

    Attributes:
        methods: that are compared.
        residual_inputs: what Z sees, as for `Robot.residual_columns`; None lets held-out stretches
            of the training rows choose.
        holdout: `tail` or `alternate`, where no other recording is given.
        share: of the rows held out then.
        stretch_s: length of a stretch for `alternate` [s].
        cutoff: of the low-pass [Hz]; None chooses it from the recording.
        seed: of random motions that judge the excitation.
    """

    methods: tuple[str, ...] = METHODS
    residual_inputs: tuple[str, ...] | None = None
    holdout: str = 'tail'
    share: float = 0.4
    stretch_s: float = 6.0
    cutoff: float | None = None
    seed: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """Result of an identification from a whole recording.

    Attributes:
        robot: that was identified.
        choice: of the filter, with all that was tried.
        data: all rows of the recording.
        train: those that the methods learned from.
        held: by name, rows that no method has seen.
        fits: by method, learned from `train`.
        physics: the physics alone, fitted to `data`.
        excitation: what this motion and any motion show of the parameters.
        inputs: what Z of SGP sees, where held-out stretches chose it.
        suggestions: motions that would show more.
        consistent: the coefficients of real bodies nearest to `physics`; None for a robot
            without inertial parameters, and where none could be found.
    """

    robot: Robot
    choice: PlanChoice
    data: FilteredData
    train: FilteredData
    held: Mapping[str, FilteredData]
    fits: Mapping[str, OfflineFit]
    physics: OfflineFit
    excitation: Excitation
    inputs: InputChoice | None
    suggestions: tuple[Suggestion, ...]
    consistent: ConsistentEstimate | None


def identify(
    signals: Signals,
    robot: Robot,
    tests: Mapping[str, Signals],
    options: IdentificationOptions,
    *,
    nominal: np.ndarray | None = None,
    progress: Callable[[float], None] = lambda _share: None,
) -> Identification:
    """Identify a robot.

    Args:
        signals: of the recording that is learned from.
        robot: with its prior.
        tests: other recordings to score on, by name; without any, a part of `signals`.
        options: see `IdentificationOptions`.
        nominal: (p,) coefficients that fill in what no torque tells; None for none.
        progress: called with the share that is done.

    Raises:
        ConfigError: a method, input or hold-out that does not exist.
        RecordingError: too short, or without motion or efforts.
        NumericalError: hyper-parameters cannot be learned.
    """
    if not options.methods or set(options.methods) - set(METHODS):
        raise ConfigError(f'methods {list(options.methods)}', f'some of {list(METHODS)}')
    inputs, of_all = None, robot.residual_columns(options.residual_inputs or OWN)
    require_motion(signals, robot)
    if any(test.velocity is None for test in tests.values()):  # one filter for all of them
        signals = replace(signals, velocity=None)
    cutoffs = CUTOFFS if options.cutoff is None else (options.cutoff,)
    choice = choose_plan(signals, robot, cutoffs)
    progress(0.3)
    data = filtered_data(signals, robot, choice.plan)
    held = {name: _test_data(name, test, robot, choice.plan) for name, test in tests.items()}
    train = data
    if not held:
        train, held[HELD_OUT] = holdout(data, options.holdout, options.share, options.stretch_s)
    progress(0.4)
    if options.residual_inputs is None and 'SGP' in options.methods:
        inputs = choose_inputs(train, robot)
    progress(0.6)
    fits = {}
    for i, method in enumerate(options.methods):
        seen = inputs.inputs if inputs is not None and method == 'SGP' else of_all
        fits[method] = fit_offline(train, robot, method, seen)
        progress(0.6 + 0.2 * (i + 1) / len(options.methods))
    physics = fit_offline(data, robot, 'PR')
    rng = np.random.default_rng(options.seed)
    recorded = RegressorFactor.nothing(data.F.shape[2]).with_rows(data.F)
    excitation = judge_excitation(structural_base(robot, rng), recorded)
    require_balance(physics.coefficients, excitation.excited, data, robot)
    progress(0.9)
    suggestions: tuple[Suggestion, ...] = ()
    if excitation.missing and robot.target == 'effort':
        suggestions = suggest_motions(robot, recorded, rng)
    return Identification(
        robot, choice, data, train, held, fits, physics, excitation, inputs,
        suggestions, _consistent(robot, physics, excitation.excited, nominal),
    )  # fmt: skip


def _test_data(name: str, test: Signals, robot: Robot, plan: FilterPlan) -> FilteredData:
    try:
        return filtered_data(test, robot, plan)
    except (ConfigError, RecordingError) as error:
        raise RecordingError(
            f'test recording {name}: {error.found}', error.expected, 'use a longer or denser one'
        ) from error


def _consistent(
    robot: Robot, physics: OfflineFit, base: BaseParameters, nominal: np.ndarray | None
) -> ConsistentEstimate | None:
    """Return the coefficients of real bodies nearest to a fit; None without, or none found."""
    try:
        R = information_root(physics, base)
        return nearest_bodies(robot, physics.coefficients.mean, R, nominal)
    except NumericalError:  # the fit stands without them, and the findings say so
        return None


def information_root(physics: OfflineFit, base: BaseParameters) -> np.ndarray:
    """Return R (r, p) with `R^T R` the information of a fit on what the recording determines.

    Taken over the r base parameters `C w`, whose covariance `S = L L^T` is regular: `R = L^-1 C`.
    A strongly coloured residual of a short recording can leave it singular; then it is that of
    white noise.

    Raises:
        NumericalError: that is singular too.
    """
    fitted = physics.coefficients
    for covariance in (fitted.covariance, fitted.white_covariance):
        spread = base.combinations @ covariance @ base.combinations.T
        scale = np.sqrt(np.diag(spread))
        try:
            L = np.linalg.cholesky(spread / np.outer(scale, scale))
        except np.linalg.LinAlgError:
            continue
        return np.asarray(np.linalg.solve(L, base.combinations / scale[:, None]))
    raise NumericalError(
        f'the covariance of {base.rank} base parameters is singular',
        'more independent rows than parameters',
        'use a longer recording',
    )
