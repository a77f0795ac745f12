"""Laws of the fold."""

from __future__ import annotations

import dataclasses
import io
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.fitting import FitResult, fit
from sgp_ros.engine.replay import Swap, is_record, replay
from sgp_ros.engine.samples import (
    CommandSample,
    JointSample,
    Reset,
    SettingsChange,
    frozen_array,
)
from sgp_ros.engine.snapshots import restored, take_snapshot
from sgp_ros.errors import ConfigError
from test.engine.worlds import (
    INVERSE_PENDULUM,
    PENDULUM,
    START_NS,
    TRUTH,
    config,
    motion,
    pendulum_events,
)


def _run(events, robot=PENDULUM, **options):
    engine = Engine(robot, config(robot, **options))
    estimates = []
    replay(engine, events, lambda step: estimates.extend(step.estimates))
    return engine, estimates


def _same(one, other):
    for a, b in zip(one, other, strict=True):
        for x, y in zip(dataclasses.astuple(a), dataclasses.astuple(b), strict=True):
            np.testing.assert_array_equal(x, y)


def test_planted_parameters_are_found_within_their_intervals():
    """Truth inside four standard deviations, and within 2 %, for a model that is complete."""
    engine, _ = _run(pendulum_events(1500, noise=5e-4), model__method='PR')
    for parameter in engine.parameters():
        truth = TRUTH[parameter.name]
        assert abs(parameter.value - truth) < 0.02 * abs(truth)
        assert abs(parameter.value - truth) < 4 * parameter.std


def test_one_step_predictions_are_better_than_the_measured_spread():
    """Both sides of the equation of motion are predicted: acceleration, and effort from it."""
    engine, _ = _run(pendulum_events(1000))
    scores = engine.scores()['hinge']
    assert scores['acceleration'].nmse < 1e-3
    assert scores['effort'].nmse < 1e-2


def test_inverse_and_forward_models_tell_the_same_machine():
    """1 / inertia is the gain; the inverse model finds it from the same motion."""
    t, q, _, m = motion(1200, 200.0, 1)
    events = [
        JointSample(START_NS + round(s * 1e9), ('hinge',), frozen_array([x]))
        for s, x in zip(t, q, strict=True)
    ]
    commands = [
        CommandSample(START_NS + round(s * 1e9), frozen_array([x]))
        for s, x in zip(t, m, strict=True)
    ]
    mixed = [event for pair in zip(commands, events, strict=True) for event in pair]
    engine, _ = _run(mixed, INVERSE_PENDULUM, model__method='PR')
    values = {p.name: p.value for p in engine.parameters()}
    assert values['inertia'] == pytest.approx(1 / TRUTH['gain'], rel=0.01)
    assert values['weight'] == pytest.approx(-TRUTH['gravity'] / TRUTH['gain'], rel=0.01)
    assert engine.scores()['hinge']['acceleration'].nmse < 1e-2


@given(st.integers(0, 10_000))
@settings(max_examples=15)
def test_any_arrival_order_inside_the_window_gives_the_same_estimates(seed):
    """Events that arrive up to the reorder window late change nothing, to the bit."""
    events = pendulum_events(150)
    rng = np.random.default_rng(seed)
    arrival = [event.stamp_ns + rng.uniform(0, 0.09e9) for event in events]
    shuffled = [events[i] for i in np.argsort(arrival, kind='stable')]
    one, first = _run(events, refit__enabled=False)
    other, second = _run(shuffled, refit__enabled=False)
    assert other.counts == one.counts
    _same(first, second)


def test_released_events_reproduce_the_run():
    """Events that took effect, pushed again, give the same estimates: a record holds these."""
    events = pendulum_events(300)
    events.insert(50, dataclasses.replace(events[10]))  # late
    events.insert(61, dataclasses.replace(events[60]))  # a repeated state or command
    engine = Engine(PENDULUM, config(refit__enabled=True))
    record, estimates = [], []

    def keep(step):
        record.extend(step.released)
        estimates.extend(step.estimates)

    for i, event in enumerate(events):
        keep(engine.push(event))
        request = engine.take_fit_request()
        if request is not None:
            record.extend(Swap(engine, fit(request)).finish())
        if i == 300:
            record.append(engine.change({'buffer.budget': 30, 'hyper.hinge.noise_variance': 0.5}))
        if i == 400:
            record.append(engine.change({'filter.hop': 0.02}))
    keep(engine.flush())
    assert is_record(record)
    again = Engine(PENDULUM, config(refit__enabled=True))
    repeated = []
    replay(again, record, lambda step: repeated.extend(step.estimates), obey_record=True)
    _same(estimates, repeated)
    assert again.parameters() == engine.parameters()


def test_a_reset_forgets_and_is_repeatable():
    """After a reset nothing learned is left; the event does the same in a replay."""
    events = pendulum_events(400)
    engine = Engine(PENDULUM, config(refit__enabled=False))
    record, estimates = [], []
    for i, event in enumerate(events):
        step = engine.push(event)
        record.extend(step.released)
        estimates.extend(step.estimates)
        if i == 500:
            waiting = engine.waiting_events
            record.append(engine.reset())
            counts = engine.counts
            assert (counts.refused['reset'], counts.commands_refused['reset']) == waiting
            assert sum(waiting) > 0
            assert not engine.is_ready
            assert engine.parameters() == ()
    again = Engine(PENDULUM, config(refit__enabled=False))
    repeated = []
    for event in record:
        repeated.extend(again.push(event).estimates)
    repeated.extend(again.flush().estimates)
    _same(estimates, repeated[: len(estimates)])
    assert isinstance(record[-1], JointSample | CommandSample)
    assert any(isinstance(event, Reset) for event in record)


def test_stop_save_restore_continue_equals_never_stopped():
    """A snapshot through a file continues to the same bits, at any point of the stream."""
    events = pendulum_events(320)
    for stop in (5, 77, 301, 500):
        whole = Engine(PENDULUM, config(refit__enabled=False))
        first = Engine(PENDULUM, config(refit__enabled=False))
        expected = [e for event in events for e in whole.push(event).estimates]
        found = [e for event in events[:stop] for e in first.push(event).estimates]
        file = io.BytesIO()
        np.savez(file, **take_snapshot(first))
        file.seek(0)
        with np.load(file, allow_pickle=False) as snapshot:
            second = restored(PENDULUM, snapshot)
        found += [e for event in events[stop:] for e in second.push(event).estimates]
        _same(expected, found)
        assert second.scores() == whole.scores()
        assert second.counts == whole.counts


def test_a_snapshot_of_another_robot_is_refused():
    """Coefficients must match, name by name."""
    engine, _ = _run(pendulum_events(100))
    with pytest.raises(ConfigError, match='robot pendulum'):
        restored(INVERSE_PENDULUM, take_snapshot(engine))
    with pytest.raises(ConfigError, match='a file with'):
        restored(PENDULUM, {})


def test_every_state_is_used_or_refused_for_one_reason():
    """read = used + refused, whatever arrives."""
    events = pendulum_events(200)
    good = JointSample(START_NS + 700_000_001, ('hinge',), frozen_array([0.0]))
    bad = [
        dataclasses.replace(good, position=frozen_array([np.nan])),
        dataclasses.replace(good, velocity=frozen_array([np.inf])),
        dataclasses.replace(good, effort=frozen_array([np.inf])),
        dataclasses.replace(good, names=('other',)),
        dataclasses.replace(good, stamp_ns=START_NS),
        dataclasses.replace(good, stamp_ns=START_NS - 10**9),
    ]
    events[160:160] = bad
    events.insert(200, events[199])
    engine, _ = _run(events)
    counts = engine.counts
    refused = {reason: n for reason, n in counts.refused.items() if n}
    assert refused == {'late': 1, 'duplicate': 1, 'nonfinite': 3, 'unknown_joint': 1, 'clock': 1}
    assert counts.read == 200 + 7
    assert counts.used == 200


def test_states_without_a_valid_command_are_unpaired():
    """Before the first command, and after one grew stale, no effort is known."""
    events = pendulum_events(300)
    events = [e for e in events if isinstance(e, JointSample) or 50 <= _index(e) < 150]
    engine, _ = _run(events, command__timeout=0.5)
    assert engine.counts.refused['unpaired'] == 50 + 100


def _index(event):
    return round((event.stamp_ns - START_NS) / 1e7)


def test_a_pause_restarts_the_filter():
    """No window spans a gap: estimates on both sides are those of separate recordings."""
    events = pendulum_events(300)
    shifted = [
        dataclasses.replace(e, stamp_ns=e.stamp_ns + (2 * 10**9 if _index(e) >= 150 else 0))
        for e in events
    ]
    engine, estimates = _run(shifted)
    assert engine.counts.refused['gap'] == 1
    _, plain = _run(events)
    assert len(estimates) < len(plain)
    spans = [e.stamp_ns for e in estimates]
    border = START_NS + 1_500_000_000
    assert not any(border - 50_000_000 < stamp < border + 2_050_000_000 for stamp in spans)


@pytest.mark.parametrize(
    ('command', 'reason'),
    [
        (CommandSample(START_NS, frozen_array([1.0, 2.0])), 'wrong_length'),
        (CommandSample(START_NS, frozen_array([np.nan])), 'nonfinite'),
        (CommandSample(START_NS, frozen_array([1.0]), ('elbow',)), 'unknown_joint'),
    ],
)
def test_bad_commands_are_counted_and_change_nothing(command, reason):
    """A refused command does not hold."""
    engine = Engine(PENDULUM, config())
    engine.push(command)
    engine.flush()
    assert engine.counts.commands_refused[reason] == 1
    assert engine.intake.commands.stamps_ns == []


def test_joint_order_may_change_from_message_to_message():
    """Names decide, not places; foreign joints are ignored."""
    events = pendulum_events(200)
    mixed = []
    for i, event in enumerate(events):
        if isinstance(event, JointSample) and i % 3:
            event = dataclasses.replace(  # noqa: PLW2901 - one state in another order
                event, names=('foreign', 'hinge'),
                position=frozen_array([9.0, event.position[0]]),
            )  # fmt: skip
        mixed.append(event)
    _, one = _run(events)
    _, other = _run(mixed)
    _same(one, other)


def test_measured_effort_is_used_where_the_state_carries_it():
    """With `auto`, a state's own effort pairs it; with `command` it does not count."""
    t, q, _, m = motion(300, 100.0, 2)
    events = [
        JointSample(
            START_NS + round(s * 1e9), ('hinge',), frozen_array([x]), None, frozen_array([e])
        )
        for s, x, e in zip(t, q, m, strict=True)
    ]
    engine, _ = _run(events)
    assert engine.counts.refused['unpaired'] == 0
    engine, _ = _run(events, effort__source='command')
    assert engine.counts.refused['unpaired'] == 300


@pytest.mark.parametrize('is_measured', [False, True])
def test_effort_in_another_unit_is_converted_by_its_gain(is_measured):
    """Currents with a torque constant tell the same as torques, measured or commanded."""
    (hinge,) = PENDULUM.joints
    in_amperes = dataclasses.replace(
        PENDULUM, joints=(dataclasses.replace(hinge, effort_gain=0.5),)
    )
    found = []
    for robot, gain in ((PENDULUM, 1.0), (in_amperes, 0.5)):
        events, efforts = [], None
        for event in pendulum_events():
            if isinstance(event, CommandSample):
                efforts = event.effort / gain
                event = dataclasses.replace(event, effort=efforts)  # noqa: PLW2901 - in its unit
            elif is_measured:
                event = dataclasses.replace(event, effort=efforts)  # noqa: PLW2901 - measured
            events.append(event)
        engine, _ = _run(events, robot, model__method='PR')
        found.append([p.value for p in engine.parameters()])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9)


def test_measured_velocity_is_used_where_asked_for():
    """From exact velocities the parameters are as good; `position` ignores them."""
    t, q, v, m = motion(1200, 100.0, 3)
    events = []
    for s, x, dx, e in zip(t, q, v, m, strict=True):
        stamp = START_NS + round(s * 1e9)
        events.append(CommandSample(stamp, frozen_array([e])))
        events.append(JointSample(stamp, ('hinge',), frozen_array([x]), frozen_array([dx])))
    measured, _ = _run(events, model__method='PR', filter__velocity='measured')
    for parameter in measured.parameters():
        assert parameter.value == pytest.approx(TRUTH[parameter.name], rel=0.01)
    derived, one = _run(events, filter__velocity='position')
    _, other = _run([_without_velocity(e) for e in events])
    _same(one, other)
    refused, _ = _run([_without_velocity(e) for e in events], filter__velocity='measured')
    assert refused.counts.refused['nonfinite'] == 1200
    assert derived.counts.refused['nonfinite'] == 0


def _without_velocity(event):
    return dataclasses.replace(event, velocity=None) if isinstance(event, JointSample) else event


def test_wrong_settings_change_nothing():
    """A refused change leaves configuration and estimates as they were."""
    engine, _ = _run(pendulum_events(100))
    before, parameters = engine.config, engine.parameters()
    for settings_ in ({'filter.window': -2.0}, {'nonsense': 1}, {'model.method': 'PR'}):
        with pytest.raises(ConfigError):
            engine.change(settings_)
    assert engine.config is before
    assert engine.parameters() == parameters


def test_a_fit_that_is_no_better_is_refused():
    """Worse, failed or factorless hyper-parameters are counted, each by its reason."""
    engine, _ = _run(pendulum_events(200), refit__enabled=False)
    model = engine.estimator.regression.model
    lost = dataclasses.replace(model, noise=(1e-300,))
    for fit_, reason in (
        (FitResult(0, model, 1.0, 2.0, 5), 'no_better'),
        (FitResult(0, model, 2.0, 2.0, 5), 'no_better'),
        (FitResult(0, None, -np.inf, 2.0, 5), 'diverged'),
        (FitResult(0, model, np.nan, 2.0, 5), 'diverged'),
        (FitResult(0, model, np.inf, 2.0, 5), 'diverged'),
        (FitResult(0, lost, 3.0, 2.0, 5), 'no_factor'),
    ):
        before = dict(engine.counts.refits_refused_for)
        assert Swap(engine, fit_).finish() == []
        assert engine.counts.refits_refused_for == before | {reason: before[reason] + 1}
    assert engine.counts.refits_refused == 6
    assert engine.counts.refits == 0
    assert engine.estimator.regression.model == model


def test_a_fit_may_find_what_the_scale_of_the_data_allows():
    """Efforts of a thousand newton metres that are linear in an input ask for 1e14 N^2 m^2."""
    engine, _ = _run(pendulum_events(200), refit__enabled=False)
    model = engine.estimator.regression.model
    large = tuple(dataclasses.replace(kernel, signal_variance=1e14) for kernel in model.kernels)
    found = dataclasses.replace(model, kernels=large, noise=(1e4,))
    assert len(Swap(engine, FitResult(0, found, 3.0, 2.0, 5)).finish()) == 1
    assert engine.estimator.regression.model == found


def test_fits_are_asked_for_at_sample_counts():
    """The first when the first model exists, then every `refit.period` learned samples."""
    engine = Engine(PENDULUM, config(refit__period=50))
    counts = []
    for event in pendulum_events(1000):
        engine.push(event)
        if engine.take_fit_request() is not None:
            counts.append(engine.counts.learned)
    assert counts == [20, 70, 120, 170]


def test_a_fit_that_had_to_wait_sees_the_newest_samples():
    """A worker that was busy gets the buffer of now; copying one at every count would be waste."""
    engine = Engine(PENDULUM, config(refit__period=50))
    for event in pendulum_events(600):
        engine.push(event)
    request = engine.take_fit_request()
    np.testing.assert_array_equal(request.data.y, engine.estimator.regression.buffer.y)
    assert request.number == 0
    assert engine.fits == 1


def test_fit_requests_cross_process_borders():
    """A request and its result survive the pickling of `multiprocessing`, to equal numbers."""
    engine = Engine(PENDULUM, config())
    for event in pendulum_events(300):
        engine.push(event)
    assert engine.request_refit()
    request = engine.take_fit_request()
    copied = pickle.loads(pickle.dumps(request))
    assert fit(copied).log_evidence == fit(request).log_evidence
    assert engine.take_fit_request() is None


def test_restarts_never_lower_the_evidence():
    """More starts include the warm one."""
    engine = Engine(PENDULUM, config())
    for event in pendulum_events(300):
        engine.push(event)
    engine.request_refit()
    request = engine.take_fit_request()
    more = fit(dataclasses.replace(request, restarts=3))
    assert more.log_evidence >= fit(dataclasses.replace(request, restarts=0)).log_evidence


def test_learning_off_still_predicts():
    """Prediction and scores go on; the model stays as it is."""
    events = pendulum_events(400)
    engine = Engine(PENDULUM, config())
    for event in events[:400]:
        engine.push(event)
    engine.change({'learning.enabled': False})
    parameters, scored = engine.parameters(), engine.counts.scored
    for event in events[400:]:
        engine.push(event)
    assert engine.parameters() == parameters
    assert engine.counts.scored > scored


def test_given_hyperparameters_need_no_gathering():
    """With all hyper-parameters set, the model exists from the first sample."""
    hyper = {
        'hyper.hinge.signal_variance': 1.0,
        'hyper.hinge.lengthscales': [1.0],
        'hyper.hinge.noise_variance': 0.1,
    }
    engine = Engine(PENDULUM, config(**hyper))
    assert engine.is_ready
    _, estimates = _run(pendulum_events(100), **hyper)
    assert not estimates[0].is_scored  # three coefficients from no sample
    assert estimates[-1].is_scored


def test_the_process_alone_reports_no_parameters():
    """GP has no W and no effort from acceleration."""
    engine, estimates = _run(pendulum_events(300), model__method='GP')
    assert engine.parameters() == ()
    assert set(engine.scores()['hinge']) == {'acceleration'}
    assert np.isnan(estimates[-1].effort.mean).all()


def test_physics_alone_is_scored_beside_the_model():
    """The baseline sees the same samples; its parameters are offered beside the joint ones."""
    engine, _ = _run(pendulum_events(600))
    baseline = engine.baseline_scores()['hinge']['acceleration']
    assert baseline.n == engine.scores()['hinge']['acceleration'].n
    names = [p.name for p in engine.physics_parameters()]
    assert names == [p.name for p in engine.parameters()]
    engine.change({'parameters.source': 'physics'})
    assert engine.parameters() == engine.physics_parameters()


def test_repeated_states_of_a_still_robot_are_survived():
    """Identical samples without noise do not break the factor: they are counted."""
    events = []
    for i in range(400):
        stamp = START_NS + i * 10_000_000
        events.append(CommandSample(stamp, frozen_array([0.0])))
        events.append(JointSample(stamp, ('hinge',), frozen_array([0.0])))
    hyper = {
        'hyper.hinge.signal_variance': 1.0,
        'hyper.hinge.lengthscales': [1.0],
        'hyper.hinge.noise_variance': 1e-30,
    }
    engine, estimates = _run(events, refit__enabled=False, **hyper)
    assert engine.counts.unlearnable > 0
    assert engine.counts.unlearnable + engine.counts.learned == len(estimates)
    _run(events)  # a constant target: variance zero, still no exception


def test_a_lost_factor_is_rebuilt_and_counted():
    """A factor that holds no numbers any more is computed from the buffer; the stream goes on."""
    events = pendulum_events(400)
    settings = config(PENDULUM, refit__enabled=False, buffer__budget=20)
    whole, broken = Engine(PENDULUM, settings), Engine(PENDULUM, settings)
    found = []
    for engine in (whole, broken):
        for i, event in enumerate(events):
            if i == 600 and engine is broken:
                engine.estimator.regression._held.factors[0]._U[:] = np.nan
            found.append(engine.push(event).estimates)
    half = len(found) // 2
    assert whole.counts.factor_rebuilt == 0
    assert broken.counts.factor_rebuilt == 1
    assert broken.counts.learned == whole.counts.learned
    for one, other in zip(sum(found[:half], ()), sum(found[half:], ()), strict=True):
        np.testing.assert_allclose(one.acceleration.mean, other.acceleration.mean, rtol=1e-6)


def test_the_drift_of_the_factor_is_measured_at_its_period():
    """Every so many learned samples the factor is compared with a fresh one."""
    engine, _ = _run(pendulum_events(400), buffer__check_period=50, buffer__budget=20)
    assert engine.counts.factor_checks == engine.counts.learned // 50 > 0
    assert 0.0 < engine.counts.factor_drift < 1e-6


def test_changes_of_settings_are_events():
    """A change pushed as an event has the effect of one applied at its stamp."""
    events = pendulum_events(200)
    change = SettingsChange(events[200].stamp_ns, {'learning.enabled': False})
    engine, estimates = _run([*events[:201], change, *events[201:]])
    assert [e.is_learned for e in estimates].index(False) > 0
    assert not estimates[-1].is_learned
    assert engine.config.learning_enabled is False


def test_another_recording_continues_what_was_learned():
    """A stream with earlier stamps is not late, scores count anew, parameters stay."""
    engine, _ = _run(pendulum_events(300))
    parameters = engine.parameters()
    engine.begin_stream()
    assert engine.parameters() == parameters
    engine.change({'learning.enabled': False})
    replay(engine, pendulum_events(200, seed=5), lambda step: None)
    assert engine.counts.refused['late'] == 0
    assert engine.counts.read == 200
    assert engine.scores()['hinge']['acceleration'].n == engine.counts.scored
    assert engine.parameters() == parameters


def test_a_command_that_comes_after_the_state_of_its_stamp_left_is_late():
    """Accepting it would pair differently live than in a replay, which sorts it first."""
    events = pendulum_events(100)
    state = events[81]
    assert isinstance(state, JointSample)
    command = events.pop(80)
    later = next(i for i, e in enumerate(events) if e.stamp_ns > state.stamp_ns + 110_000_000)
    events.insert(later + 1, command)
    engine = Engine(PENDULUM, config(refit__enabled=False))
    record, estimates = [], []
    for event in events:
        step = engine.push(event)
        record.extend(step.released)
        estimates.extend(step.estimates)
    assert engine.counts.commands_refused['late'] == 1
    again = Engine(PENDULUM, config(refit__enabled=False))
    repeated = [e for event in record for e in again.push(event).estimates]
    repeated += again.flush().estimates
    _same(estimates, repeated[: len(estimates)])


def test_nothing_of_a_stamp_enters_after_a_change_at_it():
    """A replay applies the change after every event of that stamp."""
    events = pendulum_events(100)
    engine = Engine(PENDULUM, config(reorder_window=0.0))
    for event in events[:100]:
        engine.push(event)
    engine.change({'learning.enabled': False})
    engine.push(CommandSample(events[99].stamp_ns, frozen_array([1.0])))
    assert engine.counts.commands_refused['late'] == 1


def test_first_samples_that_repeat_are_learned_without_those_that_do():
    """A robot that stands still while the first are gathered: no error, and each is counted."""
    settings_ = {'hyper.hinge.noise_variance': 1e-20, 'hyper.hinge.signal_variance': 1.0}
    engine = Engine(PENDULUM, config(refit__enabled=False, filter__hop=0.0, **settings_))
    for i in range(100):
        stamp = START_NS + 10**7 * i
        engine.push(CommandSample(stamp, frozen_array([0.0])))
        engine.push(JointSample(stamp, ('hinge',), frozen_array([0.5])))
    counts = engine.counts
    assert engine.is_ready
    assert counts.unlearnable > 0
    assert counts.learned + counts.unlearnable == counts.estimated
