"""Written recordings read back bit for bit, in any reader, also after a crash."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from sgp_ros.engine.samples import JointSample
from sgp_ros.errors import MessageError
from sgp_ros.recordings.messages import Point, Status, change_from_text, change_to_text
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.writer import RecordingWriter
from test.recordings import worlds

COMMANDS = {
    'std_msgs/Float64MultiArray': worlds.plain_commands(),
    'std_msgs/Float64': worlds.plain_commands(1),
    'sensor_msgs/JointState': worlds.named_commands(),
    'trajectory_msgs/JointTrajectory': worlds.named_commands(),
}


@given(data=st.data(), kind=st.sampled_from(sorted(COMMANDS)))
def test_write_then_read_is_the_identity_on_events(tmp_path_factory, data, kind):
    events = data.draw(
        st.lists(worlds.joint_samples() | COMMANDS[kind] | worlds.CHANGES, min_size=1)
    )
    events.append(data.draw(worlds.joint_samples()))
    path = worlds.write(tmp_path_factory.mktemp('bag') / 'x.mcap', events, command_type=kind)
    in_order = sorted(events, key=lambda event: event.stamp_ns)
    recording = open_recording(path)
    assert worlds.everything(recording) == [worlds.exact(event) for event in in_order]
    assert not recording.unreadable


@given(change=worlds.CHANGES)
def test_change_of_settings_survives_its_text(change):
    assert worlds.exact(change_from_text(change_to_text(change))) == worlds.exact(change)


@pytest.mark.parametrize(
    'text',
    [
        'hello',
        '[]',
        '{"change": "settings", "settings": {}}',
        '{"change": "other", "stamp_ns": 1}',
        '{"change": "settings", "stamp_ns": 1, "settings": {"a": [1, "b"]}}',
        '{"change": "settings", "stamp_ns": 1, "settings": {"a": null}}',
    ],
)
def test_text_that_is_no_change_is_refused(text):
    with pytest.raises(MessageError):
        change_from_text(text)


def _write_all(path):
    with RecordingWriter(path) as writer:
        for event in worlds.swing(3):
            writer.write_event(event)
        sample = JointSample(10**9, ('pole',), worlds.array([1.0]), None, worlds.array([2.0]))
        writer.write_joint_state('/sgp/predicted_joint_states', sample)
        point = Point(*(worlds.array([x]) for x in (1.0, 2.0, 3.0, 4.0)))
        writer.write_trajectory('/sgp/prediction', 10**9, ('pole',), point)
        status = Status('fit', 1, 'short of data', 'pole', {'value': '1.5', 'unit': 'kg'})
        writer.write_diagnostics('/diagnostics', 10**9, [status])


def test_written_file_opens_in_other_readers(tmp_path):
    path = tmp_path / 'x.mcap'
    _write_all(path)
    with path.open('rb') as stream:
        assert make_reader(stream).get_header().profile == 'ros2'
    with AnyReader([path]) as reader:
        read = [(c.topic, reader.deserialize(data, c.msgtype)) for c, _, data in reader.messages()]
    found = dict(read)
    assert len(read) == 9
    assert found['/sgp/predicted_joint_states'].effort.tolist() == [2.0]
    point = found['/sgp/prediction'].points[0]
    assert (point.accelerations.tolist(), point.effort.tolist()) == ([3.0], [4.0])
    (status,) = found['/diagnostics'].status
    assert (status.level, status.name, status.hardware_id) == (1, 'fit', 'pole')
    assert [(pair.key, pair.value) for pair in status.values] == [('value', '1.5'), ('unit', 'kg')]


def test_results_in_a_record_are_not_read_as_events(tmp_path):
    path = tmp_path / 'x.mcap'
    _write_all(path)
    expected = [worlds.exact(event) for event in worlds.swing(3)]
    assert worlds.everything(open_recording(path)) == expected


def test_file_has_its_name_only_when_complete(tmp_path):
    path = tmp_path / 'x.mcap'
    with RecordingWriter(path) as writer:
        writer.write_event(worlds.swing(1)[1])
        assert not path.exists()
    assert [file.name for file in tmp_path.iterdir()] == ['x.mcap']


def _fail(writer):
    with writer:
        writer.write_event(worlds.swing(1)[1])
        raise RuntimeError


def test_error_while_writing_leaves_the_old_file(tmp_path):
    path = worlds.write(tmp_path / 'x.mcap', worlds.swing(1))
    before = path.read_bytes()
    with pytest.raises(RuntimeError):
        _fail(RecordingWriter(path))
    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


def test_error_while_writing_keeps_a_live_record(tmp_path):
    path = tmp_path / 'x.mcap'
    with pytest.raises(RuntimeError):
        _fail(RecordingWriter(path, is_live=True))
    assert len(worlds.everything(open_recording(path))) == 1


def test_closing_twice_is_closing_once(tmp_path):
    writer = RecordingWriter(tmp_path / 'x.mcap')
    writer.close()
    writer.close()


def test_unknown_command_type_is_a_mistake_of_the_caller(tmp_path):
    with pytest.raises(ValueError, match='command type'):
        RecordingWriter(tmp_path / 'x.mcap', command_type='std_msgs/String')


KILLED = """
import sys
from sgp_ros.recordings.writer import RecordingWriter
from test.recordings.worlds import swing
writer = RecordingWriter(sys.argv[1], is_live=True)
for number, event in enumerate(swing(200)):
    writer.write_event(event)
    if number == 299:
        writer.flush()
print('written', flush=True)
sys.stdin.read()
"""


def test_killed_process_loses_only_what_follows_the_last_flush(tmp_path):
    path = tmp_path / 'x.mcap'
    with subprocess.Popen(
        [sys.executable, '-c', KILLED, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        assert child.stdout.readline() == b'written\n'
        child.send_signal(signal.SIGKILL)
    recording = open_recording(path)
    assert worlds.everything(recording) == [worlds.exact(e) for e in worlds.swing(200)[:300]]
    assert 'recovered 300 messages, up to 1700000001.490000000 s' in recording.remarks[0]
