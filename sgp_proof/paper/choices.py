"""Which choices matter: one at a time changed from the defaults, on the same worlds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sgp_proof.paper.protocol import Outcome, World, score, thinned
from sgp_proof.paper.reaction_wheel import ENCODER_SETTINGS
from sgp_ros.gp.kernels import AdditiveSquaredExponential, Kernel, SquaredExponential
from sgp_ros.gp.learning import initial_model, learn, screened
from sgp_ros.gp.linear_kernel import Linear
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
