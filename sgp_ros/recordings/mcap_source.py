"""MCAP files in the order of log time, also those that a crash cut off.

A file is a sequence of segments: compressed chunks, or stretches of loose messages. Their places
and first times come from the index at the end of the file. A file without one is scanned once,
up to the last complete segment. One segment after the other is read, so that memory holds about
one segment however long the recording is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
from mcap.reader import make_reader
from mcap.records import Channel, Schema
from mcap.summary import Summary

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.mcap_records import (
    DAMAGE,
    DAMAGED,
    MAGIC,
    SOUND,
    Messages,
    Stamps,
    Walk,
    read_records,
    read_stamps,
    require_chunk,
    state_of_summary,
)
from sgp_ros.recordings.topics import RawMessage, Topic, merged_topics
from sgp_ros.recordings.typestore import short_type
from sgp_ros.recordings.unpacking import Unpacking
from sgp_ros.strangers import bound, require_within

_OBJECT = 256
"""Bytes that a message takes beside its content."""
_Stretch = list[tuple[int, str, bytes]]
"""Messages: log time [ns], topic, content."""
_log_ns = itemgetter(0)
_LISTED = 5
"""Damaged places that are listed one by one."""


class McapSource:
    """The messages of one or several MCAP files, as one recording.

    Args:
        paths: the files, in the order in which they were written.
        size: of the files that these were unpacked from [bytes]; None where they were not.

    Raises:
        RecordingError: a file that is not an MCAP file.
        TooMuchError: more messages than `MESSAGES`.
    """

    def __init__(self, paths: Sequence[Path], size: int | None = None) -> None:
        self._paths = tuple(paths)
        self._size = size or sum(path.stat().st_size for path in paths)
        unpacking = Unpacking(self._size)
        self._files = [
            _index_file(path, number, unpacking) for number, path in enumerate(self._paths)
        ]
        count = sum(file.counts.total() for file in self._files)
        require_within(count, 'MESSAGES', 'number of messages')
        self._damage: dict[tuple[int, int], str] = {}
        self.topics, self._not_read = merged_topics(
            (described, file.counts[channel])
            for file in self._files
            for channel, described in sorted(file.channels.items())
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """Damage of the files, one sentence each."""
        damage = [*self._damage.values()]
        if len(damage) > _LISTED:
            damage[_LISTED:] = [f'{len(damage) - _LISTED} more places are damaged']
        return (*(x.remark for x in self._files if x.remark), *self._not_read, *damage)

    def messages(self, topics: Collection[Topic]) -> Iterator[RawMessage]:
        """Yield the messages of `topics` by log time; equal times keep the order of the file.

        What is damaged is left out, and said in `remarks` from then on.
        """
        wanted = {(topic.name, topic.type, topic.encoding) for topic in topics}
        segments = [segment for file in self._files for segment in file.segments]
        order = sorted(range(len(segments)), key=lambda place: segments[place].start_ns)
        following = [segments[place].start_ns for place in order[1:]]
        pending: list[tuple[int, int, _Stretch]] = []
        unpacking, held, most = Unpacking(self._size), 0, bound('HELD_MB') << 20
        for place, until in zip(order, (*following, None), strict=True):
            stretch: _Stretch = []
            for some in self._read(segments[place], wanted, unpacking):
                stretch += some
                held += sum(len(data) + _OBJECT for _, _, data in some)
                if held > most:
                    require_within(held / (1 << 20), 'HELD_MB', 'size of overlapping chunks in MB')
            if stretch:
                stretch.reverse()  # so that messages of one time, too, are in order from the end
                stretch.sort(key=_log_ns, reverse=True)
                heappush(pending, (stretch[-1][0], place, stretch))
            for message in _merged(pending, until):
                held -= len(message.data) + _OBJECT
                yield message

    def _read(
        self, segment: _Segment, wanted: Collection[tuple[str, str, str]], unpacking: Unpacking
    ) -> Iterator[_Stretch]:
        path = self._paths[segment.file]
        channels = self._files[segment.file].channels
        names = {number: channel[0] for number, channel in channels.items() if channel in wanted}
        require_chunk(segment.length)
        with path.open('rb') as stream:
            stream.seek(segment.offset)
            data = stream.read(segment.length)
        try:
            for record in read_records(data, unpacking):
                if isinstance(record, Messages):
                    yield [
                        (t, names[n], data)
                        for n, t, data in zip(*record, strict=True)
                        if n in names
                    ]
        except DAMAGE as error:
            place = path.name, segment.offset
            self._damage[segment.file, segment.offset] = (
                f'{place[0]}: damaged from byte {place[1]} to byte '
                f'{segment.offset + segment.length} ({" ".join(str(error).split())[:80]}); '
                'the intact data before and after it were used'
            )


def _merged(
    pending: list[tuple[int, int, _Stretch]], until_ns: int | None
) -> Iterator[RawMessage]:
    """Take from stretches, each from its end on, what is before a time, by time and place."""
    while pending and (until_ns is None or pending[0][0] < until_ns):
        _, place, stretch = heappop(pending)
        end = pending[0][:2] if pending else None
        while stretch and (until_ns is None or stretch[-1][0] < until_ns):
            if end is not None and (stretch[-1][0], place) > end:
                break
            yield RawMessage(*stretch.pop())
        if stretch:
            heappush(pending, (stretch[-1][0], place, stretch))


class _Segment(NamedTuple):
    """A stretch of a file that holds messages.

    Attributes:
        start_ns: first log time [ns].
        file: number of the file.
        offset: first byte.
        length: number of bytes.
    """

    start_ns: int
    file: int
    offset: int
    length: int


@dataclass(slots=True)
class _FileIndex:
    """Index of one file.

    Attributes:
        channels: channel number to (topic, type, encoding).
        counts: channel number to number of messages.
        segments: where the messages are.
        remark: what the user should know of the state of the file; may be empty.
    """

    channels: dict[int, tuple[str, str, str]] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    segments: list[_Segment] = field(default_factory=list)
    remark: str = ''


def _index_file(path: Path, number: int, unpacking: Unpacking) -> _FileIndex:
    """Return the index of the file at `path`, its segments marked with `number`.

    Raises:
        RecordingError: it is not an MCAP file.
    """
    with path.open('rb') as stream:
        magic = stream.read(len(MAGIC))
        if magic and not MAGIC.startswith(magic):
            raise RecordingError(
                f'{path} starts with {magic!r}', f'an MCAP file ({MAGIC!r})', 'check the file'
            )
        try:
            state = state_of_summary(stream)
            summary = _read_summary(stream) if state == SOUND else None
        except (*DAMAGE, OSError):
            state, summary = DAMAGED, None
        index = _indexed(summary, number) if summary else None
        if index is None:
            stated = summary.statistics if summary else None
            total = stated.message_count if stated else None
            index = _scan(stream, path, number, unpacking, total)
            if stated is not None:
                index.counts.update(_missing(stated.channel_message_counts, index))
        if state == DAMAGED and not index.remark:
            index.remark = f'{path.name}: its index is damaged; the whole file was read without it'
        return index


def _read_summary(stream: IO[bytes]) -> Summary | None:
    stream.seek(0)
    return make_reader(stream).get_summary()


def _missing(stated: Mapping[int, int], index: _FileIndex) -> Counter[int]:
    """Return how many messages of each channel fewer were found than the statistics count."""
    known = {channel: n for channel, n in stated.items() if channel in index.channels}
    return Counter(known) - index.counts


def _indexed(summary: Summary, number: int) -> _FileIndex | None:
    """Return the index at the end of a file, None where it is incomplete."""
    if summary.statistics is None:
        return None
    counts = Counter(summary.statistics.channel_message_counts)
    chunks = summary.chunk_indexes
    if (counts.total() and not chunks) or not set(counts) <= set(summary.channels):
        return None
    places = sorted((c.chunk_start_offset, c.chunk_length) for c in chunks)
    if any(start + length > after for (start, length), (after, _) in pairwise(places)):
        return None  # one chunk, read again and again
    channels = {key: _describe(c, summary.schemas) for key, c in summary.channels.items()}
    segments = [
        _Segment(c.message_start_time, number, c.chunk_start_offset, c.chunk_length)
        for c in chunks
    ]
    return _FileIndex(channels, counts, segments)


def _scan(
    stream: IO[bytes], path: Path, number: int, unpacking: Unpacking, total: int | None
) -> _FileIndex:
    """Walk the records of a file without index, up to the last complete segment."""
    index = _FileIndex()
    schemas: dict[int, Schema] = {}
    latest_ns = 0
    walk = Walk(stream)
    try:
        for offset, data in walk.segments():
            counts, first_ns, last_ns = Counter[int](), 0, 0
            for record in read_stamps(data, unpacking):
                if isinstance(record, Stamps):
                    least, most = int(record.log_ns.min()), int(record.log_ns.max())
                    first_ns = min(first_ns, least) if counts else least
                    last_ns = max(last_ns, most)
                    numbers, found = np.unique(record.channels, return_counts=True)
                    counts.update(dict(zip(numbers.tolist(), found.tolist(), strict=True)))
                elif isinstance(record, Schema):
                    schemas[record.id] = record
                else:
                    index.channels[record.id] = _describe(record, schemas)
            if counts:  # all of it is intact
                index.segments.append(_Segment(first_ns, number, offset, len(data)))
                index.counts.update(counts)
                latest_ns = max(latest_ns, last_ns)
    except DAMAGE:
        walk.is_complete = False
    known = str(index.counts.total()) + ('' if total is None else f' of {total}')
    index.remark = _state_of(walk, path.name, known, latest_ns)
    return index


def _state_of(walk: Walk, name: str, found: str, latest_ns: int) -> str:
    """Return what the user should know of a file that was walked through; may be empty."""
    if walk.is_complete:
        if walk.is_sound:
            return ''
        return f'{name}: the checksum of its data is wrong, so some of its messages may be too'
    remark = f'{name} is incomplete, as after a crash of the recorder: recovered {found} messages'
    if latest_ns:
        remark += f', up to {latest_ns // 10**9}.{latest_ns % 10**9:09d} s'
    return f'{remark}; the rest is damaged, from byte {walk.offset} on'


def _describe(channel: Channel, schemas: dict[int, Schema]) -> tuple[str, str, str]:
    schema = schemas.get(channel.schema_id)
    kind = short_type(schema.name) if schema else ''
    return channel.topic, kind, channel.message_encoding
