"""Tasks on a Dask cluster: a lost worker loses nothing, what breaks comes in one line."""

from __future__ import annotations

import subprocess
import sys
import time
from dataclasses import replace

import pyarrow.parquet as pq
import pytest

from sgp_ros.apps import campaign
from sgp_ros.campaign import cluster as cluster_module
from sgp_ros.campaign.cluster import cluster, run_tasks
from sgp_ros.cli import main
from test.campaign.tasks import break_down, die_once

pytest.importorskip('distributed', reason='no Dask: pip install sgp_ros[campaign]')


@pytest.fixture(scope='module')
def client():
    with cluster(None, 1) as started:
        yield started


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """Three short recordings in two folders, and a file that is none."""
    folder = tmp_path_factory.mktemp('bags')
    for i, place in enumerate(('monday', 'monday', 'tuesday')):
        out = folder / 'made' / str(i)
        arguments = ['simulate', 'linear_axis', '--duration', '3', '--seed', str(i), '--quiet']
        assert main([*arguments, '--out', str(out)]) == 0
        (folder / 'bags' / place).mkdir(parents=True, exist_ok=True)
        (out / 'linear_axis.mcap').rename(folder / 'bags' / place / f'{i}.mcap')
    (folder / 'bags' / 'broken.mcap').write_text('no recording')
    return folder / 'bags'


def _arguments(bags, out, client):
    return [
        'campaign', str(bags), '--robot', 'linear_axis', '--task', 'identify', '--out', str(out),
        '--scheduler', client.scheduler.address, '--quiet',
    ]  # fmt: skip


@pytest.fixture(scope='module')
def finished(bags, client, tmp_path_factory):
    out = tmp_path_factory.mktemp('finished') / 'out'
    assert main(_arguments(bags, out, client)) == 0
    return out


def test_a_lost_worker_loses_nothing(client, tmp_path):
    jobs = [{'number': i, 'mark': str(tmp_path / 'mark')} for i in range(4)]
    found = dict(run_tasks(client, die_once, jobs))
    assert found == {i: {'number': i} for i in range(4)}


def test_a_bug_is_one_line_and_stops_no_other(client):
    assert dict(run_tasks(client, break_down, [{}])) == {
        0: 'ZeroDivisionError: of a bug in two lines'
    }


def test_every_recording_has_rows_and_a_failure_its_line(finished):
    rows = pq.read_table(finished / 'results.parquet').to_pylist()
    names = list(dict.fromkeys(row['recording'] for row in rows))
    assert names == ['broken.mcap', 'monday/0.mcap', 'monday/1.mcap', 'tuesday/2.mcap']
    (failed,) = [row['failure'] for row in rows if row['kind'] == 'failure']
    assert 'is not a recording' in failed
    friction = [row for row in rows if row['parameter'] == 'Fv']
    assert [row['joint'] for row in friction] == ['axis'] * 3
    for row in friction:
        assert row['lower'] < row['value'] < row['upper']
        assert row['duration_s'] == pytest.approx(3.0, abs=0.1)
    runs = pq.read_table(finished / 'runs.parquet').to_pylist()
    assert {run['recording'] for run in runs} == set(names)


def test_what_is_finished_is_not_computed_again(bags, client, finished, monkeypatch):
    before = (finished / 'results.parquet').read_bytes()
    monkeypatch.setattr(campaign, 'cluster', None)  # calling it would fail
    assert main(_arguments(bags, finished, client)) == 0
    assert (finished / 'results.parquet').read_bytes() == before


@pytest.mark.long
def test_a_killed_campaign_goes_on_to_the_same_table(bags, client, finished, tmp_path):
    """SIGKILL after the first result; the rest is computed by the next run."""
    out = tmp_path / 'out'
    arguments = _arguments(bags, out, client)
    running = subprocess.Popen([sys.executable, '-m', 'sgp_ros.cli', *arguments])
    try:
        while not list((out / campaign.RESULTS).glob('*.json')):
            assert running.poll() is None
            time.sleep(0.01)
    finally:
        running.kill()
        running.wait()
    assert not (out / 'results.parquet').exists()
    kept = {path: path.stat().st_mtime_ns for path in (out / campaign.RESULTS).glob('[!.]*.json')}
    assert main(arguments) == 0
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    written = (out / 'results.parquet').read_bytes()
    assert written == (finished / 'results.parquet').read_bytes()


def test_an_interrupted_campaign_goes_on_in_its_folder(bags, client, tmp_path, monkeypatch):
    """Finished results there are no files of somebody else."""

    def interrupt(*_):
        raise KeyboardInterrupt

    arguments = _arguments(bags, tmp_path / 'out', client)
    with monkeypatch.context() as patch:
        patch.setattr(campaign, 'run_tasks', interrupt)
        assert main(arguments) == 130
    with monkeypatch.context() as patch:
        patch.setattr(campaign, 'run_tasks', lambda *_: [(i, 'a bug') for i in range(4)])
        assert main(arguments) == 0
    assert pq.read_table(tmp_path / 'out' / 'results.parquet').num_rows == 4


def test_another_option_or_recording_is_computed(bags, finished):
    """Finished results hold for the same file, robot, options and version only."""
    found = campaign.find_recordings([str(bags)])
    chosen = campaign.CampaignOptions(task='identify')
    jobs = campaign._jobs(found, 'linear_axis', chosen)
    assert all(campaign._is_finished(finished, job) for job in jobs)
    for changed in (
        campaign._jobs(found, 'linear_axis', replace(chosen, effort='command')),
        campaign._jobs(dict.fromkeys(found, bags / 'broken.mcap'), 'linear_axis', chosen)[1:],
    ):
        assert not any(campaign._is_finished(finished, job) for job in changed)


@pytest.mark.parametrize(
    ('change', 'said'),
    [
        (['--scheduler', 'tcp://127.0.0.1:1'], 'no Dask scheduler at tcp://127.0.0.1:1'),
        (['--robot', 'no_robot'], "robot 'no_robot' is neither a built-in robot"),
        (['--covariates', 'no.csv'], 'no table at no.csv'),
        (['--sim', 'no.mcap'], 'no file at no.mcap'),
    ],
)
def test_bad_input_is_one_line(bags, client, tmp_path, capsys, monkeypatch, change, said):
    monkeypatch.setattr(cluster_module, '_CONNECT_S', 1)
    assert main([*_arguments(bags, tmp_path, client), *change]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert said in line


def test_a_missing_package_names_the_extra(bags, client, tmp_path, capsys, monkeypatch):
    for name in ('distributed', 'pyarrow.parquet'):
        with monkeypatch.context() as patch:
            patch.setitem(sys.modules, name, None)
            assert main(_arguments(bags, tmp_path, client)) == 2
            assert "pip install 'sgp_ros[campaign]'" in capsys.readouterr().err
