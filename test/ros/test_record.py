"""Names, parts and order of the record of a run; no graph is needed."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.samples import JointSample
from sgp_ros.errors import ConfigError
from sgp_ros.recordings.reader import open_recording
from sgp_ros.ros.record import Record, filled_name, free_name, save_file
from test.ros.test_session import TOPICS, _engine, _events

COMMAND = 'sensor_msgs/JointState'


def _write(record: Record, engine: Engine, events: list) -> None:
    for event in events:
        record.write_event(event, engine)


def test_a_second_run_leaves_the_record_of_the_first(tmp_path: Path) -> None:
    """A name that is taken gets a number, and both are complete."""
    counts = []
    for count in (10, 30, 20):
        record = Record(tmp_path / 'run.mcap', TOPICS, COMMAND)
        _write(record, _engine(), _events(count))
        record.close()
        counts.append(len(list(open_recording(record.path).events())))
    assert counts == [21, 61, 41]
    assert {p.name for p in tmp_path.iterdir()} == {'run.mcap', 'run_2.mcap', 'run_3.mcap'}


@pytest.mark.parametrize('limit', [{'most_mb': 1e-4}, {'most_s': 1e-9}])
def test_a_record_in_parts_is_read_as_one(tmp_path: Path, limit: dict[str, float]) -> None:
    """Each part is complete when the next begins; the folder holds what one file would."""
    events, engine = _events(60), _engine()
    record = Record(tmp_path / 'run.mcap', TOPICS, COMMAND, **limit)
    for i in range(0, len(events), 20):
        _write(record, engine, events[i : i + 20])
        record.flush()
    names = sorted(p.name for p in record.path.iterdir())
    assert names[:2] == ['run_0.mcap', 'run_1.mcap']
    assert len(names) > 3
    open_recording(record.path / 'run_1.mcap')
    record.close()
    found = [event.stamp_ns for event in open_recording(tmp_path / 'run').events()]
    assert found[1:] == [event.stamp_ns for event in events]


def test_a_robot_that_is_silent_fills_no_folder(tmp_path: Path) -> None:
    """A file ages from its first message on."""
    record = Record(tmp_path / 'run.mcap', TOPICS, COMMAND, most_s=1e-9)
    for _ in range(5):
        record.flush()
    _write(record, _engine(), _events(20))
    record.flush()
    record.flush()
    record.close()
    assert sorted(p.name for p in record.path.iterdir()) == ['run_0.mcap', 'run_1.mcap']


def test_a_clock_that_is_set_back_keeps_the_order_of_the_record(tmp_path: Path) -> None:
    """As of a bag that is played in a loop: the replay meets the same events in the same order."""
    loop = _events(20)
    later = [dataclasses.replace(event, stamp_ns=event.stamp_ns + 1) for event in loop]
    record = Record(tmp_path / 'run.mcap', TOPICS, COMMAND)
    _write(record, _engine(), [*loop, *later])
    record.close()
    states = [e for e in open_recording(record.path).events() if isinstance(e, JointSample)]
    expected = [e.stamp_ns for e in (*loop, *later) if isinstance(e, JointSample)]
    assert [state.stamp_ns for state in states] == expected


def test_names_of_two_nodes_never_collide() -> None:
    assert filled_name('{node}.mcap', '/left/sgp_node') == 'left.sgp_node.mcap'
    assert save_file('', '/left/sgp_node').name == 'left.sgp_node.npz'
    assert save_file('', '/sgp_node').name == 'sgp_node.npz'
    assert save_file('a/b', '/sgp_node').parts[-2:] == ('a', 'b.npz')


def test_a_time_in_a_name_is_filled_in_and_nothing_else() -> None:
    assert filled_name('{time}.mcap', '/n')[:2] == '20'
    with pytest.raises(ConfigError, match=r'\{day\}'):
        filled_name('{day}.mcap', '/n')


def test_names_are_taken_by_creating_them(tmp_path: Path) -> None:
    """So that two nodes that start together do not take the same one."""
    assert free_name(tmp_path / 'a' / 'x.npz').is_file()
    assert free_name(tmp_path / 'a' / 'x.npz').name == 'x_2.npz'
    assert free_name(tmp_path / 'a' / 'y', is_folder=True).is_dir()


def test_a_clock_that_comes_and_goes_keeps_log_times_near_the_latest_stamp(tmp_path: Path) -> None:
    """As between the times of a simulation and of the wall; else they grow beyond any number."""
    near, events = _events(20), []
    far = [dataclasses.replace(event, stamp_ns=event.stamp_ns + 10**17) for event in near]
    for _ in range(12):
        events += [*near, *far]
    record = Record(tmp_path / 'run.mcap', TOPICS, COMMAND)
    _write(record, _engine(), events)
    record.close()
    times = [log_ns for log_ns, _ in open_recording(record.path).messages(TOPICS.joint_states)]
    assert len(times) == sum(isinstance(e, JointSample) for e in events)
    assert max(times) < max(e.stamp_ns for e in events) + 10**12
