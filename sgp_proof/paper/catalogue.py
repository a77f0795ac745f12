"""The experiments by name, with their regions in the order of the paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

from sgp_proof.paper import arm, reaction_wheel, toy
from sgp_proof.paper.choices import CHOICES, FILTERS, Choice, run_choice
from sgp_proof.paper.protocol import METHOD_NAMES, Outcome, World, run_method
from sgp_ros.gp.model import CoefficientPrior


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
