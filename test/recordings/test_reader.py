"""Every kind of recording gives the same events; a broken one says in one line what is wrong."""

from __future__ import annotations

import json
import re
import shutil
import sqlite3

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from sgp_ros.engine.samples import CommandSample, JointSample
from sgp_ros.errors import RecordingError, SgpError
from sgp_ros.recordings import mcap_source
from sgp_ros.recordings.messages import TEXT
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.topics import CHANGES_TOPIC
from sgp_ros.recordings.typestore import full_type, new_message
from sgp_ros.recordings.writer import RecordingWriter
from test.recordings import worlds

EVENTS = worlds.swing(30)
EXPECTED = [worlds.exact(event) for event in EVENTS]


def _directory(path, plugin, compression=CompressionMode.NONE):
    store = get_typestore(Stores.ROS2_JAZZY)
    writer = Ros2Writer(path, version=9, storage_plugin=plugin)
    if compression != CompressionMode.NONE:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for event in EVENTS:
            topic, kind, data = worlds.message_of(event)
            if topic not in connections:
                full = kind.replace('/', '/msg/')
                connections[topic] = writer.add_connection(topic, full, typestore=store)
            writer.write(connections[topic], event.stamp_ns, data)
    return path


def _ros1(path):
    return worlds.write_ros1(path, EVENTS)


def _split(path, parts=11):
    path.mkdir()
    size = -(-len(EVENTS) // parts)
    for part in range(parts):
        worlds.write(path / f'bag_{part}.mcap', EVENTS[part * size : (part + 1) * size])
    return path


def _split_sqlite(path):
    whole = _directory(path, StoragePlugin.SQLITE3)
    (whole / 'metadata.yaml').unlink()
    first, second = whole / f'{path.name}.db3', whole / f'{path.name}_1.db3'
    shutil.copy(first, second)
    middle = (EVENTS[20].stamp_ns,)
    for file, query in (
        (first, 'DELETE FROM messages WHERE timestamp >= ?'),
        (second, 'DELETE FROM messages WHERE timestamp < ?'),
    ):
        base = sqlite3.connect(file)
        base.execute(query, middle)
        base.commit()
        base.close()
    return whole


def _without_metadata(path):
    (path / 'metadata.yaml').unlink()
    return path


BAGS = {
    'bare mcap': lambda p: worlds.write(p / 'x.mcap', EVENTS),
    'mcap of another ending': lambda p: worlds.write(p / 'x.record', EVENTS),
    'unchunked mcap': lambda p: worlds.write_chunks(p / 'x.mcap', [EVENTS], unchunked=True),
    'many chunks': lambda p: worlds.write_chunks(p / 'x.mcap', [EVENTS[:7], EVENTS[7:]]),
    'mcap directory': lambda p: _directory(p / 'x', StoragePlugin.MCAP),
    'no metadata': lambda p: _without_metadata(_directory(p / 'x', StoragePlugin.MCAP)),
    'split, no metadata': lambda p: _split(p / 'x'),
    'sqlite directory': lambda p: _directory(p / 'x', StoragePlugin.SQLITE3),
    'sqlite split, no metadata': lambda p: _split_sqlite(p / 'x'),
    'bare sqlite': lambda p: _directory(p / 'x', StoragePlugin.SQLITE3) / 'x.db3',
    'compressed messages': lambda p: _directory(
        p / 'x', StoragePlugin.SQLITE3, CompressionMode.MESSAGE
    ),
    'compressed files': lambda p: _directory(p / 'x', StoragePlugin.SQLITE3, CompressionMode.FILE),
    'ROS 1': lambda p: _ros1(p / 'x.bag'),
}


@pytest.mark.parametrize('kind', BAGS)
def test_every_kind_of_bag_gives_the_same_events(kind, tmp_path):
    recording = open_recording(BAGS[kind](tmp_path))
    assert worlds.everything(recording) == EXPECTED
    assert [(topic.name, topic.count) for topic in recording.topics] == [
        ('/command', 30),
        ('/joint_states', 30),
    ]
    assert recording.remarks == ()


def test_reading_twice_gives_the_same(tmp_path):
    recording = open_recording(worlds.write(tmp_path / 'x.mcap', EVENTS))
    assert worlds.everything(recording) == worlds.everything(recording)


@given(
    chunks=st.lists(st.lists(st.integers(1, 6), min_size=1, max_size=5), min_size=1, max_size=5),
    unchunked=st.booleans(),
)
def test_events_come_by_log_time_and_ties_by_place(tmp_path_factory, chunks, unchunked):
    """Recorders write chunks whose times overlap."""
    numbers = iter(range(100))
    events = [
        [CommandSample(stamp, worlds.array([next(numbers)])) for stamp in chunk]
        for chunk in chunks
    ]
    events[0].append(JointSample(9, ('pole',), worlds.array([0.0])))
    path = tmp_path_factory.mktemp('bag') / 'x.mcap'
    recording = open_recording(worlds.write_chunks(path, events, unchunked=unchunked))
    flat = [event for chunk in events for event in chunk]
    in_order = sorted(flat, key=lambda event: event.stamp_ns)
    assert worlds.everything(recording) == [worlds.exact(event) for event in in_order]


@given(keep=st.floats(0.0, 1.0))
def test_truncated_file_gives_all_complete_chunks(tmp_path_factory, keep):
    path = tmp_path_factory.mktemp('bag') / 'x.mcap'
    chunks = [EVENTS[place : place + 6] for place in range(0, 60, 6)]
    whole = worlds.write_chunks(path, chunks).read_bytes()
    path.write_bytes(whole[: int(keep * len(whole))])
    try:
        recording = open_recording(path)
        found = worlds.everything(recording)
    except RecordingError:
        return
    assert found == EXPECTED[: len(found)]
    assert len(found) % 6 == 0
    if len(found) < 60:
        last = EVENTS[len(found) - 1].stamp_ns
        text = f'recovered {len(found)} messages, up to {last // 10**9}.{last % 10**9:09d} s'
        assert text in recording.remarks[0]
        assert re.search(r'the rest is damaged, from byte \d+ on$', recording.remarks[0])


def test_file_that_lacks_only_its_index_is_whole(tmp_path):
    path = worlds.write_chunks(tmp_path / 'x.mcap', [EVENTS])
    path.write_bytes(path.read_bytes()[:-500])
    recording = open_recording(path)
    assert worlds.everything(recording) == EXPECTED
    assert recording.remarks == ()


@pytest.mark.parametrize('unchunked', [False, True])
@pytest.mark.parametrize('seed', range(3))
def test_messages_of_any_lengths_are_found_without_an_index(seed, unchunked, tmp_path):
    """Runs of messages of one length are read at once, single ones between them as well."""
    rng, path, written = np.random.default_rng(seed), tmp_path / 'x.mcap', []
    with path.open('wb') as stream:
        writer = McapWriter(
            stream, chunk_size=1 << 16, use_chunking=not unchunked, use_statistics=False
        )
        writer.start()
        schema = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'')
        channels = [writer.register_channel(f'/{name}', 'cdr', schema) for name in 'ab']
        for run in 2 ** rng.integers(0, 14, size=12) - 1:
            size, order = int(rng.integers(1, 90)), rng.integers(2, size=run)
            for number in order:
                stamp, content = 10**18 + int(rng.integers(10**9)), rng.bytes(size)
                writer.add_message(channels[number], stamp, content, stamp)
                written.append((stamp, ('/a', '/b')[number], content))
        writer.finish()
    source = mcap_source.McapSource([path])
    assert sum(topic.count for topic in source.topics) == len(written)
    assert sorted(source.messages(source.topics)) == sorted(written)


def test_file_with_garbage_after_a_crash_gives_its_complete_chunks(tmp_path):
    path = worlds.write_chunks(tmp_path / 'x.mcap', [EVENTS[:40], EVENTS[40:]])
    whole = path.read_bytes()
    for tail in (bytes(5000), b'\x05' * 5000, whole[-300:-40]):
        path.write_bytes(whole[: len(whole) * 3 // 5] + tail)
        found = worlds.everything(open_recording(path))
        assert found == EXPECTED[:40]


@pytest.mark.parametrize('keep', [0.0, 0.01, 0.3])
def test_split_recording_survives_a_truncated_last_file(tmp_path, keep):
    directory = _split(tmp_path / 'x')
    last = directory / 'bag_9.mcap'
    (directory / 'bag_10.mcap').unlink()
    last.write_bytes(last.read_bytes()[: int(keep * last.stat().st_size)])
    recording = open_recording(directory)
    found = worlds.everything(recording)
    assert found == EXPECTED[: len(found)]
    assert len(found) >= 54
    assert 'bag_9.mcap' in recording.remarks[0]


@pytest.mark.parametrize('plugin', [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_counts_of_metadata_are_compared_with_the_files(plugin, tmp_path):
    directory = _directory(tmp_path / 'x', plugin)
    metadata = directory / 'metadata.yaml'
    metadata.write_text(metadata.read_text().replace('message_count: 30', 'message_count: 400'))
    remarks = ' '.join(open_recording(directory).remarks)
    assert 'metadata.yaml counts 400 messages on /joint_states, the files contain 30' in remarks


def test_missing_part_of_a_split_recording_is_remarked(tmp_path):
    directory = _directory(tmp_path / 'x', StoragePlugin.MCAP)
    metadata = directory / 'metadata.yaml'
    metadata.write_text(metadata.read_text().replace('  - x.mcap', '  - x.mcap\n  - y.mcap'))
    recording = open_recording(directory)
    assert 'y.mcap' in recording.remarks[0]
    assert worlds.everything(recording) == EXPECTED


def test_foreign_messages_do_not_matter(tmp_path):
    """Other topics may hold what nothing here can decode."""
    path = tmp_path / 'x.mcap'
    with path.open('wb') as stream:
        writer = McapWriter(stream)
        writer.start(profile='')
        strange = writer.register_schema('acme/msg/Strange', 'jsonschema', b'{')
        other = writer.register_channel('/strange', 'json', strange)
        bare = writer.register_channel('/bare', '', 0)
        topic, _, data = worlds.message_of(EVENTS[1])
        schema = writer.register_schema('sensor_msgs/msg/JointState', '', b'')
        states = writer.register_channel(topic, 'cdr', schema)
        for channel, content in ((other, b'{}'), (bare, b''), (states, data)):
            writer.add_message(channel, EVENTS[1].stamp_ns, content, 0)
        writer.finish()
    assert worlds.everything(open_recording(path)) == EXPECTED[1:2]


def test_unreadable_messages_are_counted_and_skipped(tmp_path):
    path = tmp_path / 'x.mcap'
    long = JointSample(1, ('a', 'b'), worlds.array([1.0]))
    worlds.write(path, [long, long, EVENTS[1]])
    recording = open_recording(path)
    assert worlds.everything(recording) == EXPECTED[1:2]
    assert list(recording.unreadable.items()) == [('/joint_states: position of length 1', 2)]


def test_recorded_changes_can_be_left_out(tmp_path):
    events = [EVENTS[1], worlds.Reset(EVENTS[1].stamp_ns + 1)]
    recording = open_recording(worlds.write(tmp_path / 'x.mcap', events))
    assert len(worlds.everything(recording)) == 2
    assert worlds.everything(recording, changes='') == EXPECTED[1:2]


def test_damaged_chunk_of_an_indexed_file_is_left_out_and_said(tmp_path):
    """Intact parts are used; how much of it there is, and where the damage is, is said."""
    events = worlds.swing(500)
    path = worlds.write_chunks(tmp_path / 'x.mcap', [events[:400], events[400:]])
    content = bytearray(path.read_bytes())
    content[600:700] = bytes(100)
    path.write_bytes(content)
    recording = open_recording(path)
    assert recording.remarks == ()
    states = sum(isinstance(event, JointSample) for event in recording.events())
    assert states == 300
    assert any('damaged from byte' in remark for remark in recording.remarks)
    assert any(f'{states} of 500 messages read' in remark for remark in recording.remarks)


def _mcap(path, *, unchunked):
    """A file with every checksum that the format has."""
    worlds.write_chunks(path, [EVENTS[:20], EVENTS[20:]], unchunked=unchunked, crcs=True)
    return path.read_bytes()


@pytest.mark.parametrize('unchunked', [False, True])
def test_no_flipped_byte_of_an_mcap_is_read_without_a_word(unchunked, tmp_path):
    """Of every seventh byte: what was read is whole, or what is wrong is said."""
    path = tmp_path / 'x.mcap'
    whole = _mcap(path, unchunked=unchunked)
    said = 0
    for place in range(8, len(whole), 7):
        content = bytearray(whole)
        content[place] ^= 1 << place % 8
        path.write_bytes(content)
        try:
            recording = open_recording(path)
            found = worlds.everything(recording)
        except SgpError:
            continue
        said += bool(recording.remarks)
        assert found == EXPECTED or recording.remarks, place
    assert said > 10


def test_a_damaged_index_is_not_believed(tmp_path):
    """Its checksum is wrong, as its statistics are: the file is read without it, and that said."""
    path = tmp_path / 'x.mcap'
    whole = _mcap(path, unchunked=False)
    summary = int.from_bytes(whole[-28:-20], 'little')
    for place in range(summary, len(whole) - 37, 5):
        content = bytearray(whole)
        content[place] ^= 1
        path.write_bytes(content)
        recording = open_recording(path)
        assert worlds.everything(recording) == EXPECTED
        assert recording.remarks == (
            'x.mcap: its index is damaged; the whole file was read without it',
        )


def test_messages_that_the_statistics_count_and_the_file_lacks_are_said(tmp_path):
    """Without chunks the messages are found by walking; what no walk can find is counted."""
    path = worlds.write_chunks(tmp_path / 'x.mcap', [EVENTS], unchunked=True)
    content = bytearray(path.read_bytes())
    place = 8
    while content[place] != Opcode.MESSAGE:
        place += 9 + int.from_bytes(content[place + 1 : place + 9], 'little')
    content[place] = 0x7F  # a record of a kind that nobody knows
    path.write_bytes(content)
    recording = open_recording(path)
    assert len(worlds.everything(recording)) == len(EXPECTED) - 1
    assert re.search('only 29 of 30 messages read', ' '.join(recording.remarks))


def _cut(path, size):
    path.write_bytes(path.read_bytes()[:size])
    return path


def _file(path, content):
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    ('make', 'reason'),
    [
        (lambda p: p / 'nothing.mcap', 'no recording at'),
        (lambda p: p, 'contains no .mcap'),
        (lambda p: _file(p / 'x.mcap', b''), 'is empty'),
        (lambda p: _file(p / 'x.mcap', b'hello, world'), 'is not a recording'),
        (lambda p: worlds.write(p / 'x.mcap', []), 'contains no messages'),
        (
            lambda p: _cut(worlds.write(p / 'x.mcap', EVENTS), 60),
            r'contains no messages \(x.mcap is incomplete.*damaged, from byte \d+ on\)',
        ),
        (lambda p: _file(p / 'x.db3', b'SQLite format 3\0' + bytes(200)), 'cannot be read'),
        (lambda p: _cut(_ros1(p / 'x.bag'), 4500), 'cannot be read'),
        (lambda p: worlds.write(p / 'x.mcap', EVENTS[:1]), 'no sensor_msgs/JointState topic'),
    ],
)
def test_what_is_no_recording_says_so_in_one_line(make, reason, tmp_path):
    with pytest.raises(RecordingError, match=reason) as caught:
        open_recording(make(tmp_path)).events()
    assert '\n' not in str(caught.value)
    assert caught.value.expected


def test_a_recording_of_which_nothing_can_be_read_says_where_it_is_damaged(tmp_path):
    path = worlds.write(tmp_path / 'x.mcap', worlds.swing(500))
    content = bytearray(path.read_bytes())
    content[650] ^= 0xFF  # in its only chunk, whose checksum tells
    path.write_bytes(content)
    recording = open_recording(path)
    with pytest.raises(RecordingError, match=r'only 0 of \d+ messages read.*damaged from byte'):
        list(recording.events())


@pytest.mark.parametrize('case', ['case_01', 'case_15', 'case_69'])
def test_recorded_robot_keeps_every_event_when_written_again(case, tmp_path):
    recording = open_recording(worlds.PRACTICE / case / 'real.mcap')
    events = list(recording.events())
    assert len(events) == sum(topic.count for topic in recording.topics)
    again = open_recording(worlds.write(tmp_path / 'x.mcap', events))
    in_order = sorted(events, key=lambda event: event.stamp_ns)
    assert worlds.everything(again) == [worlds.exact(event) for event in in_order]


def test_recorded_arm_is_read_from_its_directory():
    recording = open_recording(worlds.DATA / 'tiago' / 'mcap_tiago_dynamic')
    events = list(recording.events())
    assert len(events) == 8022
    assert events[0].names[0] == 'torso_lift_joint'


def test_an_index_that_names_a_chunk_twice_is_not_believed(tmp_path, monkeypatch):
    """Small files would else stand for recordings without end."""
    path = worlds.write(tmp_path / 'x.mcap', EVENTS)
    intact = mcap_source._read_summary

    def doubled(stream):
        summary = intact(stream)
        summary.chunk_indexes *= 2
        return summary

    monkeypatch.setattr(mcap_source, '_read_summary', doubled)
    assert worlds.everything(open_recording(path)) == EXPECTED


def _settings(values, stamp_ns=1):
    return json.dumps({'change': 'settings', 'stamp_ns': stamp_ns, 'settings': values})


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        (_settings({}, 10**400), 'a stamp after'),
        (json.dumps({'change': 'reset', 'stamp_ns': -(10**400)}), 'a stamp after'),
        ('[' * 100_000, 'not JSON'),
        (_settings({'a': 10**400}), 'beyond 64 bits'),
        (_settings({'a': [10**40]}), 'beyond 64 bits'),
    ],
)
def test_a_recorded_change_that_no_run_made_is_counted_and_skipped(text, reason, tmp_path):
    with RecordingWriter(tmp_path / 'x.mcap') as writer:
        writer.write_event(EVENTS[1])
        writer._write(CHANGES_TOPIC, TEXT, EVENTS[1].stamp_ns, new_message(TEXT, data=text))
    recording = open_recording(tmp_path / 'x.mcap')
    assert worlds.everything(recording) == EXPECTED[1:2]
    assert recording.unreadable.total() == 1
    assert reason in recording.remarks[-1]


def test_a_log_time_that_no_clock_has_does_not_become_a_stamp(tmp_path):
    """It would stand for the stamp of a message without one; differences of 64 bits overflow."""
    path = tmp_path / 'x.mcap'
    topic, kind, data = worlds.message_of(JointSample(0, ('pole',), worlds.array([1.0])))
    with path.open('wb') as stream:
        writer = McapWriter(stream)
        writer.start()
        channel = writer.register_channel(
            topic, 'cdr', writer.register_schema(full_type(kind), 'ros2msg', b'')
        )
        for stamp in (5, 2**64 - 1):
            writer.add_message(channel, stamp, data, stamp)
        writer.finish()
    recording = open_recording(path)
    assert [event.stamp_ns for event in recording.events()] == [5]
    assert '1 messages of x.mcap could not be read: /joint_states: a stamp' in recording.remarks[0]


def test_an_attachment_of_any_size_costs_no_memory_without_an_index(tmp_path, monkeypatch):
    """It is passed in blocks, and counts in the checksum of the data."""
    monkeypatch.setenv('SGP_MOST_CHUNK_MB', '1')
    path, (topic, kind, data) = tmp_path / 'x.mcap', worlds.message_of(EVENTS[1])
    with path.open('wb') as stream:
        writer = McapWriter(stream, use_chunking=False, enable_data_crcs=True)
        writer.start()
        schema = writer.register_schema(full_type(kind), 'ros2msg', b'')
        channel = writer.register_channel(topic, 'cdr', schema)
        for stamp in (EVENTS[1].stamp_ns, EVENTS[3].stamp_ns):
            writer.add_message(channel, stamp, data, stamp)
            writer.add_attachment(stamp, stamp, 'film', 'video/mp4', bytes(5 << 20))
        writer.finish()
    recording = open_recording(path)
    assert len(list(recording.events())) == 2
    assert recording.remarks == ()
    content = bytearray(path.read_bytes())
    content[3 << 20] ^= 1
    path.write_bytes(content)
    assert 'checksum' in open_recording(path).remarks[0]
