"""Laws of settings that say how a long stream is kept."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.snapshots import restored, take_snapshot
from sgp_ros.errors import ConfigError
from test.engine.worlds import PENDULUM, config, pendulum_events

KEEPING = [
    {'buffer__policy': 'least_informative'},
    {'buffer__policy': 'coverage'},
    {'buffer__mode': 'basis', 'basis__features': 10},
    {'forgetting__samples': 30.0},
    {'forgetting__samples': 30.0, 'buffer__mode': 'basis'},
]


def _estimates(engine, events):
    found = []
    replay(engine, events, lambda step: found.extend(step.estimates))
    return np.array([np.concatenate([e.acceleration.mean, e.effort.variance]) for e in found])


def _restored(engine):
    """Return an engine that took the other one's snapshot through a file."""
    file = io.BytesIO()
    np.savez(file, **take_snapshot(engine))
    file.seek(0)
    with np.load(file, allow_pickle=False) as snapshot:
        return restored(PENDULUM, snapshot)


@pytest.mark.parametrize('options', KEEPING)
def test_stop_save_restore_continue_equals_never_stopped(options):
    """A snapshot through a file continues to the same bits, however the stream is kept."""
    events = pendulum_events(400)
    engine = Engine(PENDULUM, config(refit__period=100, buffer__budget=30, **options))
    _estimates(engine, events[:500])
    again = _restored(engine)
    np.testing.assert_array_equal(
        _estimates(again, events[500:]), _estimates(engine, events[500:])
    )
    assert again.drift == engine.drift
    assert again.drift[0].n > 0


@pytest.mark.parametrize('options', KEEPING)
def test_each_way_of_keeping_is_another_model(options):
    """A setting that changed nothing would be a setting without effect."""
    events = pendulum_events(400)
    default = _estimates(Engine(PENDULUM, config(buffer__budget=20)), events)
    other = _estimates(Engine(PENDULUM, config(buffer__budget=20, **options)), events)
    assert not np.array_equal(default[-50:], other[-50:], equal_nan=True)


def test_a_policy_may_change_between_two_samples():
    """A live change takes effect on the next sample that leaves."""
    events = pendulum_events(400)
    engine = Engine(PENDULUM, config(buffer__budget=20))
    _estimates(engine, events[:400])
    before = engine.estimator.regression.buffer.U
    engine.change({'buffer.policy': 'coverage'})
    np.testing.assert_array_equal(engine.estimator.regression.buffer.U, before)
    _estimates(engine, events[400:])
    times_kept = {tuple(u) for u in engine.estimator.regression.buffer.U}
    assert times_kept & {tuple(u) for u in before}


@pytest.mark.parametrize('mode', ['exact', 'basis'])
def test_forgetting_may_begin_between_two_samples(mode):
    """From then on parameters become less certain than those of an engine that hardly forgets."""
    events = pendulum_events(600)
    stds = []
    for forgetting in (1e9, 30.0):
        engine = Engine(PENDULUM, config(refit__enabled=False, buffer__mode=mode))
        _estimates(engine, events[:400])
        engine.change({'forgetting.samples': forgetting})
        _estimates(engine, events[400:])
        stds.append([p.std for p in engine.parameters() + engine.physics_parameters()])
    assert np.all(np.array(stds[1]) > np.array(stds[0]))


@pytest.mark.parametrize('mode', ['basis', pytest.param('exact', marks=pytest.mark.long)])
def test_fits_go_on_however_long_the_stream(mode):
    """Hyper-parameters are fitted long after the first sample has gone."""
    options = {'refit__period': 20, 'buffer__budget': 60, 'filter__hop': 0.01}
    engine = Engine(PENDULUM, config(buffer__mode=mode, **options))
    _estimates(engine, pendulum_events(1000))
    assert engine.counts.learned > 200
    assert engine.fits > 10
    assert engine.counts.refits > 1


def test_a_model_of_another_version_is_refused():
    """Arrays that mean something else must not be read."""
    engine = Engine(PENDULUM, config())
    snapshot = take_snapshot(engine)
    text = json.loads(str(snapshot['json']))
    snapshot['json'] = np.array(json.dumps(text | {'version': 2}))
    with pytest.raises(ConfigError, match='version 2'):
        restored(PENDULUM, snapshot)


def test_a_basis_has_no_factor_to_check():
    """No sample is ever dropped from it, so nothing drifts and nothing is measured."""
    settings = config(buffer__mode='basis', buffer__check_period=20, buffer__budget=20)
    engine = Engine(PENDULUM, settings)
    _estimates(engine, pendulum_events(400))
    assert engine.counts.learned > 40
    assert engine.counts.factor_checks == engine.counts.factor_rebuilt == 0


def test_a_basis_is_fitted_at_least_once():
    """A model that begins with more samples than the budget still takes the first fit whole."""
    options = {'learning__initial': 50, 'buffer__budget': 20, 'filter__hop': 0.01}
    engine = Engine(PENDULUM, config(buffer__mode='basis', **options))
    _estimates(engine, pendulum_events(1000))
    assert engine.counts.refits >= 1
    assert engine.buffer_size <= 100
