"""The demonstration: two processes over DDS, and a comparison that can fail."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from sgp_ros.apps.demo import compare
from sgp_ros.apps.live_processes import LiveProcesses, graph_environment
from sgp_ros.cli import main
from sgp_ros.engine.results import Channel, Estimate
from sgp_ros.errors import RecordingError
from sgp_ros.recordings.predictions import PredictionTopics, outputs, write_outputs
from sgp_ros.recordings.writer import RecordingWriter


def _children():
    """Command lines of running nodes whose parent is this process."""
    listed = subprocess.run(
        ['ps', '-o', 'args=', '--ppid', str(os.getpid())], capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    return [line for line in listed.stdout.splitlines() if 'sgp_ros.ros' in line]


@pytest.mark.ros
def test_live_and_replay_agree_bit_for_bit(tmp_path):
    """A short demonstration writes all its files, proves equality and leaves no process."""
    assert main(['demo', '--duration', '8', '--seed', '3', '--out', str(tmp_path)]) == 0
    metrics = json.loads((tmp_path / 'metrics.json').read_text())
    equality = metrics['live_equals_replay']
    assert equality['numbers_compared'] > 500
    assert equality['numbers_different'] == 0
    assert equality['live_messages'] == equality['replayed_messages']
    assert metrics['seed'] == 3
    for name in ('demo.mcap', 'report.html', 'parameters.png', 'acceleration_pole.png'):
        assert (tmp_path / name).stat().st_size > 0
    page = (tmp_path / 'report.html').read_text()
    assert 'bit for bit' in page
    assert 'true value' in page
    assert _children() == []


def _estimates():
    rng = np.random.default_rng(0)
    made = []
    for i in range(5):
        values = [rng.normal(size=2) for _ in range(10)]
        made.append(
            Estimate(
                10**18 + i, ('pole', 'wheel'), values[0], values[1],
                Channel(values[2], values[3], values[4] ** 2, values[8] ** 2),
                Channel(values[5], values[6], values[7] ** 2, values[9] ** 2),
                is_scored=True, is_learned=True,
            )
        )  # fmt: skip
    return made


def _record(path, estimates):
    with RecordingWriter(path) as writer:
        for estimate in estimates:
            found = outputs(estimate)
            assert found is not None
            write_outputs(writer, PredictionTopics(), found)


def test_equal_predictions_compare_equal(tmp_path):
    """Every number of mean and variances is compared: 4 x 2 and twice 2 x 2 per estimate."""
    estimates = _estimates()
    _record(tmp_path / 'record.mcap', estimates)
    comparison = compare(tmp_path / 'record.mcap', estimates)
    assert comparison.is_equal
    assert comparison.compared == 5 * 16


def test_one_differing_bit_is_found(tmp_path):
    """The last bit of one variance is a difference, and the sentence says where."""
    estimates = _estimates()
    _record(tmp_path / 'record.mcap', estimates)
    variance = estimates[3].effort.variance.copy()
    variance[1] = np.nextafter(variance[1], np.inf)
    changed = dataclasses.replace(estimates[3].effort, variance=variance)
    estimates[3] = dataclasses.replace(estimates[3], effort=changed)
    comparison = compare(tmp_path / 'record.mcap', estimates)
    assert not comparison.is_equal
    assert comparison.different == 1
    assert 'number 3' in comparison.sentence


def test_a_missing_prediction_is_no_equality(tmp_path):
    """Fewer live messages than replayed ones, or none at all, prove nothing."""
    estimates = _estimates()
    _record(tmp_path / 'record.mcap', estimates[:4])
    assert not compare(tmp_path / 'record.mcap', estimates).is_equal


@pytest.mark.ros
def test_a_child_that_dies_is_reported_with_its_last_words(tmp_path):
    """A wrong parameter ends the node; the error names it and quotes what it said."""
    with graph_environment(tmp_path) as environment:
        processes = LiveProcesses(environment)
        try:
            name = processes.start('sgp_ros.ros.sgp_node', {'robot': 'unicycle'})
            with pytest.raises(RecordingError, match='unicycle'):
                processes.wait_for(name, lambda: False, 20.0, 'to fail')
        finally:
            processes.stop()
    assert _children() == []


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_while_a_process_starts_comes_after_it(monkeypatch, tmp_path, number):
    """In the hooks of a fork it would be lost, and the demonstration would go on."""
    started = []

    def popen(*_arguments, **_options):
        signal.raise_signal(number)
        started.append(number)
        return 'child'

    def interrupt(_number, _frame):
        raise KeyboardInterrupt

    before = signal.signal(number, interrupt)
    monkeypatch.setattr(subprocess, 'Popen', popen)
    processes = LiveProcesses({'ROS_LOG_DIR': str(tmp_path)})
    try:
        with pytest.raises(KeyboardInterrupt):
            processes.start('node', {})
        assert signal.getsignal(number) is interrupt
    finally:
        signal.signal(number, before)
    assert started == [number]
    assert processes._children == {'node': 'child'}  # and is stopped with the others


@pytest.mark.ros
@pytest.mark.long
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_demonstration_leaves_no_process(number, tmp_path):
    """Both nodes run when the signal comes; all three are gone after it."""
    code = 'import signal; signal.signal(signal.SIGINT, signal.default_int_handler); '
    code += 'import sys; from sgp_ros.cli import main; sys.exit(main(sys.argv[1:]))'
    root = Path(__file__).parents[2]
    process = subprocess.Popen(
        [sys.executable, '-c', code, 'demo', '--duration', '60', '--out', str(tmp_path)],
        cwd=root, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip

    def nodes():
        listed = subprocess.run(
            ['ps', '-o', 'pid=,args=', '--ppid', str(process.pid)], capture_output=True,
            text=True, check=False,
        )  # fmt: skip
        lines = [line for line in listed.stdout.splitlines() if 'sgp_ros.ros' in line]
        return [int(line.split()[0]) for line in lines]

    while len(found := nodes()) < 2:
        assert process.poll() is None, process.communicate()
    process.send_signal(number)
    _, error = process.communicate(timeout=30)
    assert process.returncode == 130
    assert error.strip() == 'sgp demo: interrupted'
    deadline = time.monotonic() + 10.0  # they die with their parent, a moment later
    while any(Path(f'/proc/{pid}').exists() for pid in found):
        assert time.monotonic() < deadline, 'a process is left'
        time.sleep(0.02)
