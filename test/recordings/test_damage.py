"""Recordings that lack a part, or hide one: what is there is read, and what is not is said."""

from __future__ import annotations

import re
import sqlite3
import subprocess
import sys

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.typesys import Stores, get_typestore

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.messages import TEXT
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.typestore import full_type, new_message, serialize
from test.recordings import worlds

EVENTS = worlds.swing(600)
EXPECTED = [worlds.exact(event) for event in EVENTS]
TOPICS = {'/command': 1, '/joint_states': 2}
METADATA = """rosbag2_bagfile_information:
  relative_file_paths: [b_0.mcap]
  message_count: {total}
  topics_with_message_count:
  - topic_metadata: {{name: /joint_states}}
    message_count: {states}
"""


def _db3(path, events=EVENTS, extra=()):
    """Write a database as rosbag2 does; `extra` are rows more of topic, stamp and content."""
    base = sqlite3.connect(path)
    base.executescript(
        'CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, '
        'serialization_format TEXT, offered_qos_profiles TEXT);'
        'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, '
        'data BLOB); CREATE INDEX timestamp_idx ON messages(timestamp);'
    )
    types = {topic: kind for topic, kind, _ in map(worlds.message_of, events[:2])}
    rows = [(i, n, types.get(n, TEXT)) for n, i in TOPICS.items()]
    rows.append((3, '/joint_states', TEXT))
    base.executemany("INSERT INTO topics VALUES(?, ?, ?, 'cdr', '')", rows)
    found = [
        (TOPICS[t], e.stamp_ns, data) for e in events for t, _, data in [worlds.message_of(e)]
    ]
    base.executemany('INSERT INTO messages VALUES(NULL, ?, ?, ?)', [*found, *extra])
    base.commit()
    base.close()
    return path


def _folder(path, files=('b_0.mcap',), total=1200, states=600):
    path.mkdir()
    for name in files:
        worlds.write(path / name, EVENTS)
    (path / 'metadata.yaml').write_text(METADATA.format(total=total, states=states))
    return path


def test_a_file_that_the_metadata_does_not_list_is_said_with_its_messages(tmp_path):
    """It may be a part of the recording, or somebody's copy."""
    folder = _folder(tmp_path / 'b', ('b_0.mcap', 'b_1.mcap'))
    (folder / 'b_2.mcap').write_bytes(b'garbage')
    recording = open_recording(folder)
    assert worlds.everything(recording) == EXPECTED
    first, second = recording.remarks
    assert first == (
        'b_1.mcap is not read, because metadata.yaml does not list it (1200 messages)'
    )
    assert second.startswith('b_2.mcap is not read')


def test_damaged_metadata_is_said(tmp_path):
    folder = _folder(tmp_path / 'b')
    for text in ('{', 'rosbag2_bagfile_information: 3', METADATA.format(total='x', states=1)):
        (folder / 'metadata.yaml').write_text(text)
        recording = open_recording(folder)
        assert worlds.everything(recording) == EXPECTED
        assert 'metadata.yaml is damaged' in recording.remarks[0]


def test_the_number_of_all_messages_is_compared_too(tmp_path):
    recording = open_recording(_folder(tmp_path / 'b', total=1300))
    assert recording.remarks == (
        'the files contain 1200 of the 1300 messages that metadata.yaml counts',
    )


def _mcap_of_two_types(path):
    with path.open('wb') as stream:
        writer = McapWriter(stream)
        writer.start()
        for kind, stamp, data in _two_types():
            schema = writer.register_schema(full_type(kind), 'ros2msg', b'')
            channel = writer.register_channel('/joint_states', 'cdr', schema)
            writer.add_message(channel, stamp, data, stamp)
        writer.finish()


def _two_types():
    text = serialize(TEXT, new_message(TEXT, data='x'))
    for i, event in enumerate(EVENTS[1:20:2]):
        _, kind, data = worlds.message_of(event)
        yield kind, event.stamp_ns, data
        if i < 4:
            yield TEXT, event.stamp_ns, text


def _db3_of_two_types(path):
    text = serialize(TEXT, new_message(TEXT, data='x'))
    _db3(path, EVENTS[1:20:2], [(3, e.stamp_ns, text) for e in EVENTS[1:8:2]])


def _bag_of_two_types(path):
    old, new = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_JAZZY)
    connections = {}
    with Ros1Writer(path) as writer:
        for kind, stamp, data in _two_types():
            full = full_type(kind)
            message = new.deserialize_cdr(data, full)
            if kind != TEXT:
                head = old.types['std_msgs/msg/Header'](
                    seq=0, stamp=message.header.stamp, frame_id=''
                )
                values = message.name, message.position, message.velocity, message.effort
                message = old.types[full](head, *values)
            if kind not in connections:
                connections[kind] = writer.add_connection('/joint_states', full, typestore=old)
            writer.write(connections[kind], stamp, old.serialize_ros1(message, full))


@pytest.mark.parametrize(
    ('name', 'make'),
    [
        ('x.mcap', _mcap_of_two_types),
        ('x.db3', _db3_of_two_types),
        ('x.bag', _bag_of_two_types),
    ],
)
def test_of_a_topic_with_two_types_the_rarer_is_said_not_to_be_read(name, make, tmp_path):
    make(tmp_path / name)
    recording = open_recording(tmp_path / name)
    assert worlds.everything(recording) == EXPECTED[1:20:2]
    assert len(recording.remarks) == 1
    assert recording.remarks[0].startswith('/joint_states: 4 messages of type std_msgs/String')


def test_rows_of_no_topic_are_counted(tmp_path):
    recording = open_recording(_db3(tmp_path / 'x.db3', EVENTS, [(9, 5, b'')] * 7))
    assert worlds.everything(recording) == EXPECTED
    assert recording.remarks == ('x.db3: 7 messages belong to no topic and are not read',)


@pytest.mark.parametrize('keep', [0.2, 0.5, 0.77, 0.999])
def test_a_database_that_was_cut_off_gives_its_first_rows(keep, tmp_path):
    path = _db3(tmp_path / 'x.db3')
    whole = path.read_bytes()
    path.write_bytes(whole[: int(keep * len(whole))])
    recording = open_recording(path)
    found = worlds.everything(recording)
    assert found == EXPECTED[: len(found)]
    assert len(found) > 1200 * keep * 0.2  # pages of the index lie between them
    assert re.match(rf'x.db3 is damaged \(.*\): recovered {len(found)} ', recording.remarks[0])


def _require_words(path, places, size, expected):
    """Damage each place in turn: what is missing then is said, or the file is refused."""
    whole, said = path.read_bytes(), 0
    for place in places:
        path.write_bytes(whole[:place] + bytes(size) + whole[place + size :])
        try:
            recording = open_recording(path)
            found = worlds.everything(recording)
        except RecordingError:
            continue
        said += bool(recording.remarks)
        assert found == expected or recording.remarks, place
    return said


def test_no_damaged_page_of_a_database_is_passed_without_a_word(tmp_path):
    path = _db3(tmp_path / 'x.db3')
    pages = range(0, path.stat().st_size, 4096)
    assert _require_words(path, pages, 4096, EXPECTED) > 10


@pytest.mark.parametrize('kind', [None, *Ros1Writer.CompressionFormat])
def test_a_ros_1_bag_that_was_cut_off_gives_its_first_messages(kind, tmp_path):
    path = tmp_path / 'x.bag'
    worlds.write_ros1(path, EVENTS, kind)
    whole = path.read_bytes()
    for size in np.linspace(0.4, 0.99, 6) * len(whole):
        path.write_bytes(whole[: int(size)])
        recording = open_recording(path)
        found = worlds.everything(recording)
        assert found == EXPECTED[: len(found)]
        assert re.match(rf'x.bag is damaged \(.*\): recovered {len(found)} ', recording.remarks[0])


def test_no_damaged_block_of_a_ros_1_bag_is_passed_without_a_word(tmp_path):
    path = tmp_path / 'x.bag'
    worlds.write_ros1(path, EVENTS[:200])
    whole = worlds.everything(open_recording(path))
    places = range(4100, path.stat().st_size, 1500)
    assert _require_words(path, places, 40, whole) > 3


def test_a_database_with_an_unfinished_transaction_says_so(tmp_path):
    """Its recorder was killed: parts of the transaction are in the file, the rest is not."""
    path = _db3(tmp_path / 'x.db3')
    program = (
        'import os, sqlite3, sys\nbase = sqlite3.connect(sys.argv[1])\n'
        "base.execute('PRAGMA cache_size = 1')\n"
        'base.execute("INSERT INTO messages SELECT NULL, topic_id, timestamp, data FROM messages")'
        "\nos.kill(os.getpid(), 9)"
    )  # fmt: skip
    subprocess.run([sys.executable, '-c', program, str(path)], check=False)
    assert (tmp_path / 'x.db3-journal').stat().st_size
    path.chmod(0o444)
    with pytest.raises(RecordingError, match=r'its last transaction is in x\.db3-journal'):
        open_recording(path)
