"""Prior of robot and settings before any sample: of W, hyper-parameters, empty model."""

from __future__ import annotations

import numpy as np

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.hyperparameters import kernel_named
from sgp_ros.gp.inducing_regression import InducingPointRegression
from sgp_ros.gp.kernel import Kernel
from sgp_ros.gp.learning import initial_model
from sgp_ros.gp.model import CoefficientPrior, Model, Observations
from sgp_ros.gp.online import OnlineRegression
from sgp_ros.gp.regression import Memory, Regression
from sgp_ros.robots.robot import Robot


def model_of_settings(
    config: EngineConfig, inputs: tuple[tuple[int, ...] | None, ...], present: Model | None
) -> Model:
    """Return the hyper-parameters of the settings, with `present` where they are automatic."""
    kernels: list[Kernel | None] = []
    noise = []
    for j, (joint, columns) in enumerate(zip(config.hyper, inputs, strict=True)):
        known = None if present is None else present.kernels[j]
        kernels.append(None if columns is None else joint.kernel_on(columns, known))
        fallback = 1.0 if present is None else present.noise[j]
        noise.append(joint.noise_variance or fallback)
    return Model(tuple(kernels), tuple(noise))


def prior_of_robot(robot: Robot, config: EngineConfig) -> CoefficientPrior:
    """Return the prior of W that robot and settings state."""
    if config.model_method == 'GP':
        return CoefficientPrior.flat(0)
    mean = np.array([c.prior_mean for c in robot.coefficients])
    std = np.array([c.prior_std for c in robot.coefficients]) * config.prior_scale
    return CoefficientPrior.from_std(mean, std)


def memory_of_settings(config: EngineConfig) -> Memory:
    """Return what a model keeps of the stream.

    In a basis the samples are there to be fitted to, so they suffice for a fit.
    """
    budget = config.buffer_budget
    if config.buffer_mode == 'basis':
        budget = max(budget, config.learning_initial)
    return Memory(
        budget,
        config.basis_features,
        config.buffer_remember,
        config.buffer_policy,
        config.forgetting_samples,
    )


def empty_regression(model: Model, prior: CoefficientPrior, config: EngineConfig) -> Regression:
    """Return the kind of model that the settings name, before any sample."""
    kind = InducingPointRegression if config.buffer_mode == 'basis' else OnlineRegression
    return kind(model, prior, memory_of_settings(config))


def empty_baseline(
    model: Model, prior: CoefficientPrior, config: EngineConfig
) -> OnlineRegression:
    """Return the model of the physics alone with the noise of `model`, before any sample."""
    alone = Model((None,) * len(model.kernels), model.noise)
    return OnlineRegression(alone, prior, baseline_memory(config))


def baseline_memory(config: EngineConfig) -> Memory:
    """Return what the model of the physics alone keeps of the stream."""
    return Memory(1, forgetting=config.forgetting_samples)


def first_model(
    config: EngineConfig, inputs: tuple[tuple[int, ...] | None, ...], data: Observations | None
) -> Model:
    """Return the hyper-parameters to begin with, from the first samples where there are any."""
    kernel = kernel_named(config.model_kernel)
    start = None if data is None else initial_model(data, inputs, kernel=kernel)
    return model_of_settings(config, inputs, start)


def complement_columns(robot: Robot) -> set[int]:
    """Return the columns of `Robot.inputs` that hold the complement signals."""
    k = len(robot.joints)
    start = 2 * k if robot.complement == 'acceleration' else 3 * k
    return {
        start + j
        for j, joint in enumerate(robot.joints)
        if robot.complement == 'acceleration' or joint.is_actuated
    }
