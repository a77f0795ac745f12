"""The experiments by name, and the choices that are compared on the same worlds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from sgp_proof.paper import arm, reaction_wheel, toy
from sgp_proof.paper.protocol import METHOD_NAMES, Outcome, World, run_method, score, thinned
from sgp_proof.paper.reaction_wheel import ENCODER_SETTINGS
from sgp_ros.gp.kernel import Kernel
from sgp_ros.gp.kernels import AdditiveSquaredExponential, Linear, SquaredExponential
from sgp_ros.gp.learning import initial_model, learn, screened
from sgp_ros.gp.methods import FittedMethod
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.posterior import Posterior
from sgp_ros.gp.selection import select_inputs


@dataclass(frozen=True, slots=True)
class Choice:
    """One way to set up SGP.

    Attributes:
        inputs: `chosen` by evidence, or `all`.
        structure: `chosen` by evidence between smooth and linear, `smooth` in all inputs together,
            or `additive`, a sum of smooth functions of one input each.
        rule: starting values, `standardised` (and screened) or `paper`.
        prior_factor: standard deviation of W in units of sqrt(var y / mean square of its column);
            infinite for the flat prior.
        is_standardised: inputs divided by their standard deviation before the fit.
        is_shared: one kernel and noise for all outputs, as the paper's formula reads.
    """

    inputs: str = 'chosen'
    structure: str = 'chosen'
    rule: str = 'standardised'
    prior_factor: float = np.inf
    is_standardised: bool = False
    is_shared: bool = False


DEFAULT = Choice()
CHOICES: dict[str, Choice] = {
    'default: inputs and structure by evidence, flat prior': DEFAULT,
    'inputs: all, smooth (paper)': replace(DEFAULT, inputs='all', structure='smooth'),
    'inputs: all, additive': replace(DEFAULT, inputs='all', structure='additive'),
    'inputs: by evidence, smooth': replace(DEFAULT, structure='smooth'),
    'inputs: by evidence, additive': replace(DEFAULT, structure='additive'),
    'sigma_w: 1e4 times the scale of y': replace(DEFAULT, prior_factor=1e4),
    'sigma_w: the scale of y': replace(DEFAULT, prior_factor=1.0),
    'sigma_w: a hundredth of it': replace(DEFAULT, prior_factor=0.01),
    'start: length scale = variance (paper)': replace(DEFAULT, rule='paper'),
    'inputs divided by their deviation': replace(DEFAULT, is_standardised=True),
    'one kernel and noise for all outputs': replace(DEFAULT, is_shared=True),
}

FILTERS: dict[str, Mapping[str, float] | None] = {
    'filter: weak form, 0.1 s, every 0.05 s (default)': ENCODER_SETTINGS,
    'filter: the same, every 0.01 s (coloured noise)': {**ENCODER_SETTINGS, 'filter.hop': 0.01},
    'filter: weak form, 0.05 s': {**ENCODER_SETTINGS, 'filter.window': 0.05},
    'filter: weak form, 0.2 s': {**ENCODER_SETTINGS, 'filter.window': 0.2},
    'filter: none, differences paired by index': None,
}
"""Settings of the filter by label; None for no filter at all."""


def run_choice(world: World, choice: Choice) -> Outcome:
    """Fit SGP with one choice and score it on every region."""
    train = thinned(world.train, world.size)
    scale = train.U.std(axis=0) if choice.is_standardised else np.ones(train.U.shape[1])
    scale = np.where(scale > 0.0, scale, 1.0)
    power = np.sqrt(train.y.var(axis=0)) if choice.is_shared else np.ones(train.y.shape[1])
    scaled = _scaled(train, scale, power)
    prior = _prior(scaled, choice.prior_factor)
    start = _start(world, scaled, prior, choice)
    learned = learn(scaled, prior, start)
    model = _shared(learned.model) if choice.is_shared else learned.model
    fitted = FittedMethod(Posterior(model, scaled, prior), None, learned.log_evidence)
    tests = {
        region: replace(
            test, data=_scaled(test.data, scale, power), truth=test.truth / power
        )
        for region, test in world.tests.items()
    }  # fmt: skip
    return score(fitted, replace(world, tests=tests))


def _scaled(data: Observations, scale: np.ndarray, power: np.ndarray) -> Observations:
    return replace(data, U=data.U / scale, F=data.F / power[:, None], y=data.y / power)


def _prior(data: Observations, factor: float) -> CoefficientPrior:
    squares = (data.F**2).mean(axis=(0, 1))
    std = factor * np.sqrt(data.y.var() / np.where(squares > 0.0, squares, 1.0))
    return CoefficientPrior.from_std(np.zeros(len(std)), std)


def _start(world: World, data: Observations, prior: CoefficientPrior, choice: Choice) -> Model:
    """Return inputs, structure and the values from which learning starts."""
    inputs: tuple[tuple[int, ...] | None, ...] = world.paper_inputs or world.candidates
    kernels: tuple[Kernel | None, ...] = (None,) * len(inputs)
    if choice.inputs == 'chosen':
        chosen = [select_inputs(data, prior, j, c) for j, c in enumerate(world.candidates)]
        inputs, kernels = tuple(s.inputs for s in chosen), tuple(s.kernel for s in chosen)
        if choice.structure == 'chosen' and choice.rule != 'paper':
            return Model(kernels, tuple(s.noise for s in chosen))
    start = initial_model(data, inputs, choice.rule)
    if choice.structure == 'additive':
        start = Model(tuple(_additive(k) for k in start.kernels), start.noise)
    if choice.structure == 'chosen':
        pairs = zip(kernels, start.kernels, strict=True)
        start = Model(tuple(k if isinstance(k, Linear) else s for k, s in pairs), start.noise)
    return start if choice.rule == 'paper' else screened(data, prior, start)


def _additive(kernel: object) -> AdditiveSquaredExponential | None:
    if not isinstance(kernel, SquaredExponential):
        return None
    share = kernel.variance / len(kernel.inputs)
    return AdditiveSquaredExponential(
        (share,) * len(kernel.inputs), kernel.lengthscales, kernel.inputs
    )


def _shared(model: Model) -> Model:
    """Return the geometric mean of the outputs' hyper-parameters for all of them."""
    kernels = [k for k in model.kernels if k is not None]
    alike = len({(type(k), k.inputs) for k in kernels}) == 1
    if len(kernels) != len(model.kernels) or not alike:
        return model
    theta = np.mean([k.log_parameters for k in kernels], axis=0)
    noise = float(np.exp(np.mean(np.log(model.noise))))
    return Model(tuple(k.with_log_parameters(theta) for k in kernels), (noise,) * len(model.noise))


@dataclass(frozen=True, slots=True)
class Experiment:
    """One experiment.

    Attributes:
        name: key in results.json.
        group: `toy`, `reaction-wheel` or `arm`: what the command is asked for.
        title: one line for the table.
        make: from a seed to a world.
        prior: from a world to the prior of W; None for the flat one.
        seeds: how many seeds it runs by default.
        quick_seeds: how many with `--quick`.
    """

    name: str
    group: str
    title: str
    make: Callable[[int], World]
    prior: Callable[[World], CoefficientPrior] | None = None
    seeds: int = 20
    quick_seeds: int = 1


def _few(seed: int) -> World:
    return toy.make_world(seed, dense=40)


def _concealed(seed: int) -> World:
    return reaction_wheel.make_world(seed, 'reaction_wheel', reaction_wheel.CONCEALED)


def _chosen(name: str, choice: Choice, seed: int) -> Outcome:
    return run_choice(EXPERIMENTS[name].make(seed), choice)


def _filtered(settings: Mapping[str, float] | None, seed: int) -> Outcome:
    return run_method('SGP', reaction_wheel.make_encoder_world(seed, settings))


EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        Experiment('toy', 'toy', 'Toy pendulum, section IV.A', toy.make_world, quick_seeds=5),
        Experiment('toy_40', 'toy', 'Toy pendulum with 40 samples', _few, quick_seeds=5),
        Experiment(
            'reaction_wheel', 'reaction-wheel',
            'Simulated reaction wheel without viscous friction in the model, section IV.B',
            reaction_wheel.make_world,
        ),
        Experiment(
            'reaction_wheel_encoder', 'reaction-wheel',
            'The same from 12-bit encoders through the filter of the package',
            reaction_wheel.make_encoder_world,
        ),
        Experiment(
            'reaction_wheel_concealed', 'reaction-wheel',
            'Ten coefficients and an effect that is none of them, in simulation, for section IV.C',
            _concealed,
        ),
        Experiment(
            'arm', 'arm', 'Three-link arm whose third joint rubs near its limits, section IV.D',
            arm.make_world, arm.make_prior,
        ),
    )
}  # fmt: skip


CHOICE_SEEDS, QUICK_CHOICE_SEEDS = 5, 1
COMPARED: dict[str, dict[str, Callable[[int], Outcome]]] = {
    **{
        name: {label: partial(_chosen, name, choice) for label, choice in CHOICES.items()}
        for name in ('toy', 'reaction_wheel')
    },
    'reaction_wheel_encoder': {
        label: partial(_filtered, settings) for label, settings in FILTERS.items()
    },
}
"""Choices compared per experiment: label to what runs it on a seed."""


def run_seed(name: str, seed: int) -> dict[str, Outcome]:
    """Run every method on one seed; a function that another process can call."""
    experiment = EXPERIMENTS[name]
    world = experiment.make(seed)
    prior = None if experiment.prior is None else experiment.prior(world)
    return {method: run_method(method, world, prior) for method in METHOD_NAMES}


def run_compared(name: str, seed: int, label: str) -> dict[str, Outcome]:
    """Run one choice of `COMPARED` on one seed."""
    return {label: COMPARED[name][label](seed)}
