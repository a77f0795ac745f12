"""Laws of putting a fit in force."""

from __future__ import annotations

import dataclasses

import numpy as np

from sgp_proof.columns import acceleration, single_column
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.fitting import FitResult
from sgp_ros.engine.replay import Swap
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.physics.term import Coefficient, Joint
from sgp_ros.robots.robot import Robot
from test.engine.worlds import START_NS, config

NAMES = ('left', 'right')
PAIR = Robot(
    name='pair',
    joints=tuple(Joint(name) for name in NAMES),
    target='effort',
    terms=tuple(
        single_column(Coefficient(f'inertia_{name}', 'kg m^2', name), j, acceleration(j), 'test')
        for j, name in enumerate(NAMES)
    ),
    residual_inputs=(('velocity:left',), ('velocity:right',)),
)


def _engine(count=150, **settings):
    rng = np.random.default_rng(0)
    engine = Engine(PAIR, config(PAIR, refit__enabled=False, **settings))
    for i in range(count):
        t = 0.01 * i
        state = [
            frozen_array(values)
            for values in (
                (np.sin(5.0 * t), np.cos(7.0 * t)),
                (5.0 * np.cos(5.0 * t), -7.0 * np.sin(7.0 * t)),
                rng.normal(size=2),
            )
        ]
        engine.push(JointSample(START_NS + round(1e9 * t), NAMES, *state))
    return engine


def _fit(engine, **changes):
    model = engine.estimator.regression.model
    changed = {
        'kernels': tuple(
            dataclasses.replace(k, signal_variance=2.0 * k.variance) for k in model.kernels
        ),
        'noise': (0.3, 0.7),
    }
    return FitResult(0, dataclasses.replace(model, **(changed | changes)), 2.0, 1.0, 5)


def test_every_step_changes_the_outputs_of_one_factor():
    """The rest keeps what it has; at the end the whole fit is in force and counted once."""
    engine = _engine()
    before = engine.estimator.regression.model
    swap = Swap(engine, _fit(engine))
    change = swap.step()
    assert {name.split('.')[1] for name in change.settings} == {'left'}
    half = engine.estimator.regression.model
    assert half.noise == (0.3, before.noise[1])
    assert half.kernels == (swap.fit.model.kernels[0], before.kernels[1])
    assert (swap.is_done, engine.counts.refits) == (False, 0)
    swap.step()
    assert engine.estimator.regression.model == swap.fit.model
    assert (swap.is_done, engine.counts.refits, engine.counts.refits_refused) == (True, 1, 0)


def test_outputs_that_share_a_factor_change_together():
    """Apart, one factor would become two."""
    engine = _engine(model__residual_inputs=('every:velocity',))
    present = engine.estimator.regression.model
    shared = dataclasses.replace(present, kernels=(present.kernels[0],) * 2, noise=(0.4, 0.4))
    engine.estimator.regression.change(shared)
    fit = FitResult(0, dataclasses.replace(shared, noise=(0.5, 0.5)), 2.0, 1.0, 5)
    swap = Swap(engine, fit)
    swap.step()
    assert swap.is_done


def test_a_part_without_a_factor_leaves_the_others_in_force():
    """It keeps its old hyper-parameters, and the fit counts as refused."""
    engine = _engine()
    before = engine.estimator.regression.model
    swap = Swap(engine, _fit(engine, noise=(1e-300, 0.7)))
    assert len(swap.finish()) == 1
    assert engine.estimator.regression.model.noise == (before.noise[0], 0.7)
    assert swap.refusal == 'no_factor'
    assert (engine.counts.refits, engine.counts.refits_refused_for['no_factor']) == (0, 1)
