"""Laws of the choice of a kernel: one class in one place is all that a new one takes."""

from __future__ import annotations

import doctest
import io
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.engine.config import EngineConfig, describe_settings
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import frozen_array
from sgp_ros.engine.snapshots import restored, take_snapshot
from sgp_ros.errors import ConfigError
from sgp_ros.gp import kernel as kernel_module
from sgp_ros.gp.kernel import HyperParameter, Stationary
from sgp_ros.gp.kernels import KERNELS
from test.engine.worlds import PENDULUM, config, pendulum_events


class Bump(Stationary):
    """`signal_variance exp(-r^2)`, under hyper-parameters with names of its own."""

    name = 'bump'
    parameters = (
        HyperParameter('height', 'Height of Z', target=2),
        HyperParameter('lengthscales', 'Reach of Z', is_per_input=True, high=1e9),
    )

    @property
    def height(self):
        """The variance, as the settings name it."""
        return self.signal_variance

    @staticmethod
    def correlation(squares):
        """Fall off as a bell."""
        return np.exp(-squares)

    @staticmethod
    def slope(squares):
        """Fall off as a bell."""
        return -np.exp(-squares)


@pytest.fixture
def registered(monkeypatch):
    """Put the kernel in the one place that a new one takes."""
    monkeypatch.setitem(KERNELS, Bump.name, Bump)


def _estimates(engine, events):
    found = []
    replay(engine, events, lambda step: found.extend(step.estimates))
    return np.array([np.concatenate([e.acceleration.mean, e.effort.variance]) for e in found])


def _kinds(engine):
    return {type(kernel) for kernel in engine.estimator.regression.model.kernels}


def _restored(engine):
    file = io.BytesIO()
    np.savez(file, **take_snapshot(engine))
    file.seek(0)
    with np.load(file, allow_pickle=False) as snapshot:
        return restored(PENDULUM, snapshot)


def _check_a_life(name, mode):
    """Learn, refit, save, restore, continue as if never stopped."""
    events = pendulum_events(400, noise=1e-3)
    options = {'model__kernel': name, 'buffer__mode': mode, 'buffer__budget': 30}
    engine = Engine(PENDULUM, config(refit__period=60, **options))
    _estimates(engine, events[:500])
    assert _kinds(engine) == {KERNELS[name]}
    assert engine.fits > 0
    again = _restored(engine)
    assert again.config == engine.config
    np.testing.assert_array_equal(
        _estimates(again, events[500:]), _estimates(engine, events[500:])
    )
    assert _kinds(again) == {KERNELS[name]}
    assert engine.scores()['hinge']['acceleration'].nmse < 0.1


@pytest.mark.parametrize('mode', ['exact', 'basis'])
@pytest.mark.parametrize('name', sorted(KERNELS))
def test_every_kernel_is_learnt_saved_and_continued(name, mode):
    """Whichever `model.kernel` names, and however the stream is kept."""
    _check_a_life(name, mode)


@pytest.mark.usefixtures('registered')
@pytest.mark.parametrize('mode', ['exact', 'basis'])
def test_a_new_kernel_takes_one_place(mode):
    """It is chosen, learnt, saved and restored by what it says of itself."""
    _check_a_life('bump', mode)


@pytest.mark.usefixtures('registered')
def test_a_kernel_names_its_settings():
    """With unit and range; what was learnt is shown under these names, and taken back."""
    described = {s.name: s for s in describe_settings(PENDULUM, 'bump')}
    assert described['model.kernel'].problem('bump') is None
    assert described['hyper.hinge.height'].unit == '(rad/s^2)^2'
    assert described['hyper.hinge.lengthscales'].high == 1e9
    assert 'hyper.hinge.signal_variance' not in described
    engine = Engine(PENDULUM, config(model__kernel='bump'))
    _estimates(engine, pendulum_events(200))
    values = engine.hyper_settings()
    assert set(values) == {n for n in described if n.startswith('hyper.')}
    given = EngineConfig.from_mapping({'model.kernel': 'bump', **values}, PENDULUM)
    (kernel,) = Engine(PENDULUM, given).estimator.regression.model.kernels
    assert kernel == engine.estimator.regression.model.kernels[0]


@pytest.mark.parametrize('name', sorted(KERNELS))
def test_a_sample_far_outside_all_others_is_survived(name):
    """Its variance may be lost to rounding: no warning, and no score that is not a number."""
    events = pendulum_events(200)
    events[241] = replace(events[241], position=frozen_array(1e20 * events[241].position))
    engine = Engine(PENDULUM, config(model__kernel=name))
    _estimates(engine, events)
    assert engine.counts.scored > 0
    assert np.isfinite(engine.scores()['hinge']['acceleration'].nlpd)


def test_an_unknown_kernel_is_refused_with_the_choices():
    """As any other setting."""
    with pytest.raises(ConfigError, match=r'model\.kernel = .bump.: .*squared_exponential'):
        config(model__kernel='bump')


def test_another_kernel_is_another_model():
    """A setting that changed nothing would be a setting without effect."""
    events = pendulum_events(200, noise=1e-3)
    one, other = (
        _estimates(Engine(PENDULUM, config(model__kernel=name)), events)
        for name in ('squared_exponential', 'matern32')
    )
    assert not np.array_equal(one, other)


def test_the_example_of_a_kernel_runs():
    """The example in the docstring, for those who write a kernel."""
    assert doctest.testmod(kernel_module).failed == 0
