"""A run without a graph: record, fits in a process, saved models."""

from __future__ import annotations

import dataclasses
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from multiprocessing import connection
from pathlib import Path

import numpy as np
import pytest

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.fitting import FitRequest, FitResult, fit
from sgp_ros.engine.replay import replay
from sgp_ros.engine.samples import CommandSample, Event, JointSample, SettingsChange
from sgp_ros.engine.snapshots import take_snapshot
from sgp_ros.errors import ConfigError
from sgp_ros.recordings.model_files import load_model, load_parameters, save_model
from sgp_ros.recordings.predictions import PredictionTopics, outputs
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.registry import load_robot
from sgp_ros.ros.fit_process import FitProcess, WorkerLost
from sgp_ros.ros.record import Record, Topics
from sgp_ros.ros.session import Session
from sgp_ros.simulation.assembly import make_simulation
from test.ros.graph import DEADLINE_S

ROOT = Path(__file__).parents[2]
START_NS = 1_700_000_000_000_000_000
SETTINGS = {
    'filter.hop': 0.0, 'learning.initial': 20, 'reorder_window': 0.0, 'refit.enabled': False,
    'buffer.budget': 40,
}  # fmt: skip
TOPICS = Topics(
    '/joint_states', '/command', PredictionTopics('/n/prediction', '/n/variance', '/n/predicted')
)


def _engine() -> Engine:
    robot = load_robot('reaction_wheel')
    return Engine(robot, EngineConfig.from_mapping(SETTINGS, robot))


def _events(count: int) -> list[Event]:
    simulation = make_simulation('reaction_wheel', seed=2, start_ns=START_NS)
    events: list[Event] = []
    for _ in range(count):
        sample = simulation.step()
        events.append(CommandSample(sample.stamp_ns, sample.command, ('wheel',)))
        events.append(JointSample(sample.stamp_ns, simulation.joint_names, sample.position))
    return events


def _await(fits: FitProcess) -> FitResult | WorkerLost:
    end = time.monotonic() + DEADLINE_S
    while (left := end - time.monotonic()) > 0.0:
        answer = fits.poll()
        if answer is not None:
            return answer
        assert fits._connection is not None
        connection.wait([fits._connection], left)  # the worker needs the processor
    raise AssertionError('no answer of the worker')


@pytest.fixture
def fits() -> Iterator[FitProcess]:
    process = FitProcess()
    yield process
    process.close()


@pytest.fixture
def session(tmp_path: Path) -> Iterator[Session]:
    record = Record(tmp_path / 'run.mcap', TOPICS, 'sensor_msgs/JointState')
    found = Session(_engine(), record)
    yield found
    found.close()


def test_a_fit_in_a_process_equals_a_fit_in_place(fits: FitProcess) -> None:
    engine = _engine()
    for event in _events(120):
        engine.push(event)
    assert engine.request_refit()
    request = engine.take_fit_request()
    assert request is not None
    fits.submit(request)
    assert not fits.is_free
    answer = _await(fits)
    assert isinstance(answer, FitResult)
    expected = fit(request)
    assert fits.is_free
    assert answer.number == expected.number
    assert answer.model is not None
    assert expected.model is not None
    # The worker runs on one thread of linear algebra only where its environment says so.
    np.testing.assert_allclose(answer.log_evidence, expected.log_evidence, rtol=1e-6)


def test_a_killed_worker_is_reported_and_replaced(fits: FitProcess) -> None:
    process = fits._process
    assert process is not None
    assert process.pid is not None
    os.kill(process.pid, signal.SIGKILL)
    assert _await(fits) == WorkerLost(-signal.SIGKILL, had_request=False)
    test_a_fit_in_a_process_equals_a_fit_in_place(fits)


@pytest.mark.skipif(not hasattr(os, 'SCHED_BATCH'), reason='a policy of Linux')
def test_a_fit_has_a_low_weight_and_comes_beside_busy_processes(fits: FitProcess) -> None:
    """A robot's computer is always busy: a worker for idle time only would never fit there."""
    busy = [
        subprocess.Popen([sys.executable, '-c', 'while True: pass'])
        for _ in range(os.cpu_count() or 1)
    ]
    try:
        test_a_fit_in_a_process_equals_a_fit_in_place(fits)
    finally:
        for process in busy:
            process.kill()
            process.wait()
    worker = fits._process
    assert worker is not None
    assert worker.pid is not None
    assert os.sched_getscheduler(worker.pid) == os.SCHED_BATCH
    own = os.getpriority(os.PRIO_PROCESS, 0)
    assert os.getpriority(os.PRIO_PROCESS, worker.pid) == min(own + 10, 19)


def _too_large_for_a_pipe(fits: FitProcess) -> FitRequest:
    """Return a request with many inputs that no kernel sees, once the worker listens."""
    engine = _engine()
    for event in _events(120):
        engine.push(event)
    assert engine.request_refit()
    request = engine.take_fit_request()
    assert request is not None
    fits.submit(request)
    _await(fits)
    data = request.data
    wide = np.hstack([data.U, np.zeros((len(data.U), 20_000))])
    return dataclasses.replace(request, data=dataclasses.replace(data, U=wide))


def _stop(fits: FitProcess) -> int:
    """Stop the worker and return its process id."""
    process = fits._process
    assert process is not None
    assert process.pid is not None
    os.kill(process.pid, signal.SIGSTOP)
    os.waitid(os.P_PID, process.pid, os.WSTOPPED)
    return process.pid


def test_handing_out_a_fit_does_not_wait_for_the_worker(fits: FitProcess) -> None:
    request = _too_large_for_a_pipe(fits)
    pid = _stop(fits)
    is_needed = threading.Event()

    def rescue() -> None:
        is_needed.set()
        os.kill(pid, signal.SIGCONT)

    timer = threading.Timer(DEADLINE_S, rescue)
    timer.start()
    fits.submit(request)
    timer.cancel()
    assert not is_needed.is_set()
    os.kill(pid, signal.SIGCONT)
    assert isinstance(_await(fits), FitResult)


def test_a_worker_that_never_reads_is_closed_at_once(fits: FitProcess) -> None:
    request = _too_large_for_a_pipe(fits)
    process = fits._process
    _stop(fits)
    fits.submit(request)
    fits.close()
    assert process is not None
    assert process.exitcode == -signal.SIGKILL


def test_a_fit_stands_still_while_it_is_held(fits: FitProcess) -> None:
    """It goes on afterwards to the end; an idle worker is left alone."""
    request = _too_large_for_a_pipe(fits)
    process = fits._process
    assert process is not None
    assert process.pid is not None
    changed = os.WSTOPPED | os.WCONTINUED
    with fits.held():
        pass
    assert os.waitid(os.P_PID, process.pid, changed | os.WNOHANG) is None
    fits.submit(request)
    with fits.held():
        stopped = os.waitid(os.P_PID, process.pid, os.WSTOPPED)
        assert stopped is not None
        assert stopped.si_status == signal.SIGSTOP
    assert isinstance(_await(fits), FitResult)


def test_a_fit_that_was_asked_for_long_ago_is_not_held(
    fits: FitProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A node that always has a message in hand gets its fit too."""
    request = _too_large_for_a_pipe(fits)
    monkeypatch.setattr('sgp_ros.ros.fit_process.MOST_HELD_S', -1.0)
    fits.submit(request)
    with fits.held():
        assert isinstance(_await(fits), FitResult)


_HOLDS_AND_DIES = """
import os, signal, sys
sys.path.insert(0, {root!r})
from test.ros.test_session import _too_large_for_a_pipe
from sgp_ros.ros.fit_process import FitProcess
if __name__ == '__main__':
    fits = FitProcess()
    fits.submit(_too_large_for_a_pipe(fits))
    with fits.held():
        print(fits._process.pid, flush=True)
        sys.stdin.readline()
        os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(not hasattr(os, 'pidfd_open'), reason='a call of Linux')
def test_a_held_worker_ends_with_its_node(tmp_path: Path) -> None:
    """It could not find the end of the connection by itself."""
    script = tmp_path / 'holds.py'
    script.write_text(_HOLDS_AND_DIES.format(root=str(ROOT)), encoding='utf-8')
    with subprocess.Popen(
        [sys.executable, script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as node:
        assert node.stdout is not None
        assert node.stdin is not None
        worker = os.pidfd_open(int(node.stdout.readline()))
        node.stdin.write('die\n')
        node.stdin.flush()
        assert node.wait(DEADLINE_S) == -signal.SIGKILL
    ended = select.select([worker], [], [], DEADLINE_S)[0] == [worker]
    if not ended:
        signal.pidfd_send_signal(worker, signal.SIGKILL)
    os.close(worker)
    assert ended


def test_closing_kills_the_worker_at_once(fits: FitProcess) -> None:
    process = fits._process
    assert process is not None
    fits.close()
    assert process.exitcode == -signal.SIGKILL


def test_the_record_opens_with_the_settings_in_force(session: Session, tmp_path: Path) -> None:
    session.change({'buffer.budget': 30})
    for event in _events(60):
        session.take(event)
    session.change({'buffer.budget': 25})
    session.close()
    events = list(open_recording(tmp_path / 'run.mcap').events())
    opening = events[0]
    assert isinstance(opening, SettingsChange)
    assert opening.stamp_ns == START_NS - 1
    assert opening.settings['buffer.budget'] == 30
    assert opening.settings['filter.hop'] == 0.0
    changes = [e for e in events if isinstance(e, SettingsChange)]
    assert [dict(c.settings) for c in changes[1:]] == [{'buffer.budget': 25}]


def test_a_fit_that_runs_is_reported_until_it_ends(session: Session) -> None:
    for event in _events(60):
        session.take(event)
    assert session.refit()
    sources = {'joint_states': ('/joint_states', ('/a',)), 'command': ('/command', ())}

    def running() -> str:
        statuses = session.health.statuses(session.engine, 'node', 1.0, sources)
        return next(s for s in statuses if s.name == 'node: model').values['refit_running']

    assert running().startswith('for ')
    end = time.monotonic() + DEADLINE_S
    while running() != 'none' and time.monotonic() < end:
        assert session._fits._connection is not None
        connection.wait([session._fits._connection], 1.0)
        session.poll_fit()
    assert running() == 'none'


def test_a_full_disk_ends_the_record_but_not_the_session() -> None:
    session = Session(_engine(), Record(Path('/dev/full'), TOPICS, 'sensor_msgs/JointState'))
    for event in _events(60):
        session.take(event)
    session.flush_record()
    assert 'No space left' in session.health.record_problem
    assert session.engine.is_ready
    session.take(_events(61)[-1])
    assert session.health.unrecorded >= 1
    session.close()


def test_a_saved_model_loads_to_the_same_arrays(tmp_path: Path) -> None:
    engine = _engine()
    for event in _events(60):
        engine.push(event)
    path = tmp_path / 'a' / 'model.npz'
    own = path.with_suffix('.yaml')
    own.parent.mkdir()
    own.write_text('mine')
    save_model(path, take_snapshot(engine))
    loaded = load_model(path)
    for name, array in take_snapshot(engine).items():
        np.testing.assert_array_equal(loaded[name], array)
    assert load_parameters(path)['buffer.budget'] == 40
    assert sorted(path.parent.iterdir()) == [path, own]
    assert own.read_text() == 'mine'


@pytest.mark.parametrize('content', [None, b'', b'no archive', b'PK\x03\x04 cut off'])
def test_what_is_no_model_is_refused_in_one_line(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / 'model.npz'
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigError, match=r'model\.npz') as caught:
        load_model(path)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('by_ns', 'window_s'),
    [
        (-60 * 10**9, 0.1),
        pytest.param(-(10**18), 0.0, marks=pytest.mark.long),
        pytest.param(60 * 10**9, 0.1, marks=pytest.mark.long),
    ],
)
def test_a_record_of_a_clock_that_jumped_replays_to_the_same_numbers(
    tmp_path: Path, by_ns: int, window_s: float
) -> None:
    """With changes of settings before, at and behind the jump, and messages of the old time."""
    robot = load_robot('reaction_wheel')
    settings = {**SETTINGS, 'reorder_window': window_s}
    engine = Engine(robot, EngineConfig.from_mapping(settings, robot))
    record = Record(tmp_path / 'run.mcap', TOPICS, 'sensor_msgs/JointState')
    session = Session(engine, record, 'sensor_msgs/JointState')
    events = _events(360)
    moved = [dataclasses.replace(e, stamp_ns=e.stamp_ns + by_ns) for e in events[240:480]]
    again = events[480:]
    live: list[bytes] = []
    for i, event in enumerate([*events[:240], *moved, *again]):
        live += [output.prediction.accelerations.tobytes() for output in session.take(event)]
        if i % 20 == 1 or 238 <= i <= 246:
            session.change({'hyper.pole.noise_variance': 1e-3 * (1 + i)})
    session.close()
    final = [p.value for p in session.engine.parameters()]
    assert session.engine.counts.clock_jumps == 2
    assert session.engine.counts.learned > 100

    other = Engine(robot, EngineConfig.from_mapping(settings, robot))
    found: list[bytes] = []
    replay(
        other, open_recording(record.path).events(),
        lambda step: found.extend(
            o.prediction.accelerations.tobytes() for o in map(outputs, step.estimates) if o
        ),
        obey_record=True,
    )  # fmt: skip
    assert found[: len(live)] == live
    assert len(live) > 100
    assert [p.value for p in other.parameters()] == final
    assert sum(other.counts.changes_refused.values()) == 0
