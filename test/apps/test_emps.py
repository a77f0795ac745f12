"""A real machine: the EMPS axis, imported and replayed as a user would."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from sgp_ros.cli import main
from sgp_ros.engine.results import REFUSALS

ROOT = Path(__file__).parents[2]
RECORDING = ROOT.parent / 'shared' / 'data' / 'emps' / 'emps_id.csv'
SECONDS = 12.0
PUBLISHED = {'M': 95.1089, 'Fv': 203.5034, 'Fc': 20.3935, 'offset': -3.1648}
"""Janot, Gautier, Brunot 2019, by least squares on the whole record [kg, N s/m, N, N]."""


@pytest.fixture(scope='module')
def replayed(tmp_path_factory):
    """Metrics of the first seconds of the identification record."""
    folder = tmp_path_factory.mktemp('emps')
    beginning = folder / 'emps.csv'
    with RECORDING.open() as source, beginning.open('w') as target:
        rows = csv.reader(source)
        writer = csv.writer(target)
        writer.writerow(next(rows))
        writer.writerows(row for row in rows if float(row[0]) < SECONDS)
    mapping = ROOT / 'config' / 'import' / 'emps.yaml'
    assert main(['import', str(beginning), '--map', str(mapping), '--out', str(folder)]) == 0
    bag = str(folder / 'emps.mcap')
    out = folder / 'out'
    assert main(['replay', bag, '--robot', 'linear_axis', '--out', str(out)]) == 0
    return json.loads((out / 'metrics.json').read_text()), out


def test_published_parameters_lie_inside_the_reported_intervals(replayed):
    """Half of the record gives the published values within its own 95 % intervals, doubled.

    The interval takes the model for complete, the axis is known to be asymmetric: twice the
    width, four standard deviations, bounds what that adds here.
    """
    metrics, _ = replayed
    for parameter in metrics['parameters']:
        error = abs(parameter['value'] - PUBLISHED[parameter['name']])
        assert error < 4 * parameter['std'], parameter
        assert error < 0.06 * abs(PUBLISHED[parameter['name']]), parameter


def test_the_process_explains_what_the_physics_leaves_out(replayed):
    """Asymmetric friction is in no column: with Z the error is clearly less than without."""
    metrics, _ = replayed
    alone = metrics['physics_alone']['axis']['effort']['nmse']
    assert alone < 0.0038
    assert metrics['joints']['axis']['effort']['nmse'] < 0.7 * alone


def test_metrics_follow_the_contract(replayed):
    """Names and types of metrics.json, and the files beside it."""
    metrics, out = replayed
    assert metrics['schema'] == 1
    assert metrics['robot'] == 'linear_axis'
    assert metrics['seed'] is None
    samples = metrics['samples']
    assert samples['read'] == samples['used'] + sum(samples['refused'].values()) == 12000
    assert set(samples['refused']) == set(REFUSALS)
    assert set(metrics['joints']['axis']['effort']) == {
        'nmse', 'nlpd', 'coverage95', 'raw_coverage95', 'n',
    }  # fmt: skip
    for parameter in metrics['parameters']:
        assert set(parameter) == {
            'name', 'meaning', 'joint', 'value', 'std', 'unit', 'identifiable',
        }  # fmt: skip
        assert (parameter['std'] is None) == (not parameter['identifiable'])
    assert set(metrics['timing']['push_ms']) == {'p50', 'p99', 'max'}
    assert metrics['timing']['realtime_factor'] > 0
    for name in ('predictions.mcap', 'report.html', 'robot_identified.yaml', 'model.npz'):
        assert (out / name).is_file()
    assert not list(out.glob('.sgp_growing_*'))


def test_the_report_is_one_self_contained_page(replayed):
    """No link leaves the file; the finding stands in the first paragraph."""
    _, out = replayed
    page = (out / 'report.html').read_text()
    assert 'The model predicts' in page
    assert 'src="http' not in page
    assert '<link' not in page
    assert 'data:image/png;base64,' in page


@pytest.mark.long
def test_what_was_identified_is_the_prior_of_the_next_run(replayed, tmp_path):
    """robot_identified.yaml loads as a robot; a saved model predicts without learning."""
    metrics, out = replayed
    bag = str(out.parent / 'emps.mcap')
    identified = str(out / 'robot_identified.yaml')
    arguments = ['replay', bag, '--robot', identified, '--out', str(tmp_path / 'again')]
    assert main(arguments) == 0
    frozen = [
        'replay', bag, '--robot', 'linear_axis', '--model', str(out / 'model.npz'), '--frozen',
        '--out', str(tmp_path / 'frozen'),
    ]  # fmt: skip
    assert main(frozen) == 0
    again = json.loads((tmp_path / 'frozen' / 'metrics.json').read_text())
    assert again['estimates']['learned'] == 0
    assert again['parameters'] == metrics['parameters']
