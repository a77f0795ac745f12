"""Events, messages and files that the tests of this layer share."""

from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.typesys import Stores, get_typestore

from sgp_ros.engine.samples import CommandSample, Event, JointSample, Reset, SettingsChange
from sgp_ros.recordings.command_types import COMMAND_TYPES
from sgp_ros.recordings.messages import joint_state_message
from sgp_ros.recordings.reader import Recording
from sgp_ros.recordings.typestore import definition, full_type, new_message, serialize
from sgp_ros.recordings.writer import RecordingWriter

DATA = Path(__file__).parents[2] / '..' / 'shared' / 'data'
PRACTICE = DATA.parent / 'practice' / 'cases'
MAPS = Path(__file__).parents[2] / 'config' / 'import'

_STAMPS = st.integers(1, 2**31 * 10**9 - 1)
_FLOATS = st.floats(allow_nan=True, allow_infinity=True)
_NAMES = st.lists(st.text(min_size=1, max_size=8), min_size=1, max_size=4, unique=True)


def array(values) -> np.ndarray:
    """Return a float64 array."""
    return np.array(values, dtype=np.float64)


@st.composite
def joint_samples(draw) -> JointSample:
    """Draw a state of one to four joints, with or without velocity and effort."""
    names = draw(_NAMES)
    values = st.lists(_FLOATS, min_size=len(names), max_size=len(names)).map(array)
    maybe = st.none() | values
    return JointSample(draw(_STAMPS), tuple(names), draw(values), draw(maybe), draw(maybe))


@st.composite
def named_commands(draw) -> CommandSample:
    """Draw a command with joint names."""
    names = draw(_NAMES)
    values = st.lists(_FLOATS, min_size=len(names), max_size=len(names)).map(array)
    return CommandSample(draw(_STAMPS), draw(values), tuple(names))


def plain_commands(longest: int = 4) -> st.SearchStrategy[CommandSample]:
    """Draw a command without names."""
    values = st.lists(_FLOATS, min_size=1, max_size=longest).map(array)
    return st.builds(CommandSample, _STAMPS, values)


_SETTINGS = st.dictionaries(
    st.text(max_size=10),
    st.booleans()
    | st.integers(1 - 2**63, 2**63 - 1)
    | st.floats(allow_nan=False)
    | st.text(max_size=10)
    | st.lists(st.floats(allow_nan=False), max_size=4).map(tuple)
    | st.lists(st.text(max_size=5), max_size=4).map(tuple),
    max_size=4,
)
CHANGES = st.builds(SettingsChange, _STAMPS, _SETTINGS) | st.builds(Reset, _STAMPS)


def exact(event: Event) -> tuple:
    """Return what two events share exactly when they are equal bit for bit, types included."""
    parts = [type(event).__name__]
    for field in fields(event):
        value = getattr(event, field.name)
        parts.append(value.tobytes() if isinstance(value, np.ndarray) else repr(value))
    return tuple(parts)


def swing(n: int, start_ns: int = 1_700_000_000 * 10**9) -> list[Event]:
    """Return `n` states of one joint at 100 Hz, a command 1 ms before each."""
    events: list[Event] = []
    for row in range(n):
        stamp_ns = start_ns + row * 10_000_000
        events.append(CommandSample(stamp_ns - 1_000_000, array([math.cos(row)])))
        events.append(JointSample(stamp_ns, ('pole',), array([math.sin(row)])))
    return events


def write(path: Path, events: list[Event], **options) -> Path:
    """Write `events` to `path`."""
    with RecordingWriter(path, **options) as writer:
        for event in events:
            writer.write_event(event)
    return path


def everything(recording: Recording, **options) -> list[tuple]:
    """Return all events of a recording in the form of `exact`."""
    return [exact(event) for event in recording.events(**options)]


def message_of(event: JointSample | CommandSample) -> tuple[str, str, bytes]:
    """Return topic, short type and CDR bytes of an event of `swing`."""
    if isinstance(event, JointSample):
        kind = 'sensor_msgs/JointState'
        return '/joint_states', kind, serialize(kind, joint_state_message(new_message, event))
    kind = 'std_msgs/Float64MultiArray'
    message = COMMAND_TYPES[kind].message(new_message, event)
    return '/command', kind, serialize(kind, message)


def write_chunks(
    path: Path, chunks: list[list[Event]], *, unchunked: bool = False, crcs: bool = False
) -> Path:
    """Write one MCAP chunk per list of events, or none; `crcs` with a checksum of all data."""
    with path.open('wb') as stream:
        writer = Writer(
            stream,
            compression=CompressionType.LZ4,
            use_chunking=not unchunked,
            enable_data_crcs=crcs,
        )
        writer.start(profile='ros2')
        channels: dict[str, int] = {}
        for chunk in chunks:
            for event in chunk:
                topic, kind, data = message_of(event)
                if topic not in channels:
                    schema = writer.register_schema(
                        full_type(kind), 'ros2msg', definition(kind).encode()
                    )
                    channels[topic] = writer.register_channel(topic, 'cdr', schema)
                writer.add_message(channels[topic], event.stamp_ns, data, event.stamp_ns)
            writer.flush()
        writer.finish()
    return path


def write_ros1(path: Path, events: list[Event], kind: Any = None) -> Path:
    """Write a ROS 1 bag, with chunks compressed as `kind` says."""
    store, new = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_JAZZY)
    writer = Ros1Writer(path)
    if kind is not None:
        writer.set_compression(kind)
        writer.chunk_threshold = 10_000
    with writer:
        connections = {}
        for event in events:
            topic, kind, data = message_of(event)
            full = kind.replace('/', '/msg/')
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, full, typestore=store)
            message = new.deserialize_cdr(data, full)
            if isinstance(event, JointSample):
                header = store.types['std_msgs/msg/Header'](
                    seq=0, stamp=message.header.stamp, frame_id=''
                )
                message = store.types[full](
                    header, message.name, message.position, message.velocity, message.effort
                )
            writer.write(connections[topic], event.stamp_ns, store.serialize_ros1(message, full))
    return path
