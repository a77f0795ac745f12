"""Laws of metrics, files and the page."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.report.figures import History
from sgp_ros.report.files import replacing_results, write_bytes, write_text
from sgp_ros.report.html import verdict, write_report
from sgp_ros.report.metrics import Timing, collect_metrics
from sgp_ros.report.page import typeset
from test.engine.worlds import PENDULUM, START_NS, TRUTH, config, pendulum_events
from test.report.pages import content_of


def _run(events, robot=PENDULUM, **options):
    engine = Engine(robot, config(robot, **options))
    history = History()
    replay(engine, events, lambda step: history.take(engine, step))
    return engine, history


def _metrics(engine):
    timing = Timing([0.001, 0.002], 1.0, 10.0)
    return collect_metrics(engine, 'test.mcap', timing=timing)


@pytest.fixture(scope='module')
def finished():
    """An engine and its history after a run."""
    return _run(pendulum_events(600))


def test_metrics_hold_only_json_numbers(finished):
    """No NaN, no infinity; std is null exactly where a parameter is not identifiable."""
    text = json.dumps(_metrics(finished[0]), allow_nan=False)
    for parameter in json.loads(text)['parameters']:
        assert (parameter['std'] is None) == (not parameter['identifiable'])


def test_the_page_says_the_finding_first_and_compares_with_the_truth(finished, tmp_path):
    """Verdict, figures, truth and whether it lies inside; nothing from outside the file."""
    engine, history = finished
    paths = write_report(tmp_path, engine, history, _metrics(engine), truth=TRUTH)
    page = (tmp_path / 'report.html').read_text()
    assert page.index('The model predicts') < page.index('<img')
    assert page.count('<tr>') > 5
    assert 'true value' in page
    assert ('<svg class="robot"' in page) == (engine.robot.bodies is not None)
    content_of(page)
    assert {p.name for p in paths} >= {'report.html', 'parameters.png', 'calibration.png'}
    assert not list(tmp_path.glob('.sgp_growing_*'))


def test_texts_from_outside_are_escaped(finished, tmp_path):
    """A file name or a remark cannot bring its own markup."""
    engine, history = finished
    metrics = _metrics(engine)
    metrics['recording'] = '<script>alert(1)</script>'
    metrics['remarks'] = ['<b>bold</b>']
    write_report(tmp_path, engine, history, metrics)
    page = (tmp_path / 'report.html').read_text()
    assert '&lt;script&gt;alert' in content_of(page)
    assert '<b>' not in page


def test_a_run_too_short_for_a_model_still_has_a_page(tmp_path):
    """No scores, no parameters, and the page says so."""
    engine, history = _run(pendulum_events(30))
    metrics = _metrics(engine)
    assert verdict(metrics) == 'Nothing could be predicted from this recording.'
    write_report(tmp_path, engine, history, metrics)
    assert 'No prediction could be scored' in (tmp_path / 'report.html').read_text()


def test_parameters_that_the_motion_does_not_determine_are_named(tmp_path):
    """A pendulum that never moves and is never driven tells nothing of its parameters."""
    events = []
    rng = np.random.default_rng(0)
    for i in range(400):
        stamp = START_NS + i * 10_000_000
        events.append(CommandSample(stamp, frozen_array([0.0])))
        position = frozen_array([0.3 + 1e-4 * rng.standard_normal()])
        events.append(JointSample(stamp, ('hinge',), position))
    engine, history = _run(events, model__method='PR')
    metrics = _metrics(engine)
    unknown = [p['name'] for p in metrics['parameters'] if not p['identifiable']]
    assert unknown == ['gain']
    write_report(tmp_path, engine, history, metrics)
    assert 'not determined by this motion' in (tmp_path / 'report.html').read_text()


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    """The new content takes the name only when it is complete."""
    path = tmp_path / 'result.json'
    write_text(path, 'old')

    def fail(*_):
        raise OSError('disk full')

    monkeypatch.setattr('sgp_ros.report.files.os.replace', fail)
    with pytest.raises(OSError, match='disk full'):
        write_bytes(path, b'new')
    assert path.read_text() == 'old'
    assert list(tmp_path.iterdir()) == [path]


def test_refused_samples_are_explained(tmp_path):
    """Each reason that occurred stands in the page with its meaning."""
    events = pendulum_events(300)
    events.insert(100, JointSample(START_NS, ('elbow',), frozen_array([0.0])))
    engine, history = _run(events)
    write_report(tmp_path, engine, history, _metrics(engine))
    page = (tmp_path / 'report.html').read_text()
    assert 'unknown_joint' in page
    assert 'a joint of the robot is not in the message' in page


def _write_results(out, *names):
    with replacing_results(out, 'diagnose'):
        for name in names:
            write_text(out / name, name)


def test_results_of_an_earlier_run_do_not_outlive_the_next(tmp_path):
    """A picture of the last verdict beside the report of this one would mislead."""
    _write_results(tmp_path, 'report.html', 'friction.png')
    write_text(tmp_path / 'notes.txt', 'of the user')
    _write_results(tmp_path, 'report.html')
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {'report.html', 'notes.txt', '.sgp_diagnose.json'}


def test_results_of_another_command_stay(tmp_path):
    with replacing_results(tmp_path, 'replay'):
        write_text(tmp_path / 'friction.png', 'of a replay')
    _write_results(tmp_path, 'report.html')
    _write_results(tmp_path, 'report.html')
    assert (tmp_path / 'friction.png').exists()


def test_a_run_that_fails_removes_nothing(tmp_path):
    _write_results(tmp_path, 'report.html', 'friction.png')
    with pytest.raises(OSError, match='full'), replacing_results(tmp_path, 'diagnose'):
        raise OSError('the disk is full')
    assert (tmp_path / 'friction.png').exists()
    _write_results(tmp_path, 'report.html')
    assert not (tmp_path / 'friction.png').exists()


def test_units_are_written_with_their_signs_and_joints_keep_their_names():
    """`m2` behind another unit is a unit, alone it may be a joint."""
    said = typeset('m2: inertia 0.02 +- 0.01 kg m2, drag 1 N m s2/rad2')
    assert said == 'm2: inertia 0.02 ± 0.01 kg m², drag 1\u00a0N\u00a0m s²/rad²'


def test_a_number_is_not_broken_at_its_exponent():
    """A narrow table breaks lines at a hyphen; a name keeps its own."""
    assert typeset('3.8e-06 to 4e+12, link2e-05') == '3.8·10⁻⁶ to 4·10¹², link2e-05'
    assert typeset('4.8e+02 (3.6e+02 to 6e+02)') == '480 (360 to 600)'
