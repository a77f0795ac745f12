"""Read MCAP files in the order of log time.

One segment after the other is read, so that memory holds about one segment however long the
recording is; see `mcap_index` for what a segment is.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Collection, Iterator, Sequence
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

from mcap.records import Message

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.mcap_index import DAMAGE, Segment, index_file, read_records
from sgp_ros.recordings.topics import Topic


class RawMessage(NamedTuple):
    """One message as it was recorded.

    Attributes:
        log_ns: time of logging [ns].
        topic: name of its topic.
        data: serialised message.
    """

    log_ns: int
    topic: str
    data: bytes


class McapSource:
    """The messages of one or several MCAP files, as one recording.

    Args:
        paths: the files, in the order in which they were written.

    Raises:
        RecordingError: a file that is no MCAP file.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = tuple(paths)
        self._files = [index_file(path, number) for number, path in enumerate(self._paths)]

    @property
    def topics(self) -> tuple[Topic, ...]:
        """The topics of all files, by name; a topic with two types keeps the first."""
        found: dict[str, Topic] = {}
        for file in self._files:
            for channel, (name, kind, encoding) in sorted(file.channels.items()):
                known = found.get(name, Topic(name, kind, 0, encoding))
                if (known.type, known.encoding) == (kind, encoding):
                    count = known.count + file.counts[channel]
                    found[name] = Topic(name, kind, count, encoding)
        return tuple(found[name] for name in sorted(found))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What was wrong with the files, one sentence each."""
        return tuple(file.remark for file in self._files if file.remark)

    def messages(self, topics: Collection[Topic]) -> Iterator[RawMessage]:
        """Yield the messages of `topics` by log time; equal times keep the order of the file.

        Raises:
            RecordingError: a damaged segment.
        """
        wanted = {(topic.name, topic.type, topic.encoding) for topic in topics}
        segments = [segment for file in self._files for segment in file.segments]
        order = sorted(range(len(segments)), key=lambda place: segments[place].start_ns)
        following = [segments[place].start_ns for place in order[1:]]
        pending: list[tuple[int, int, RawMessage]] = []
        for number, place in enumerate(order):
            read = self._segment_messages(segments[place], wanted)
            pending += ((message.log_ns, place, message) for message in read)
            pending.sort(key=itemgetter(0, 1))
            if number < len(following):
                ready = bisect_left(pending, following[number], key=itemgetter(0))
                yield from (message for _, _, message in pending[:ready])
                del pending[:ready]
        yield from (message for _, _, message in pending)

    def _segment_messages(
        self, segment: Segment, wanted: Collection[tuple[str, str, str]]
    ) -> Iterator[RawMessage]:
        path = self._paths[segment.file]
        channels = self._files[segment.file].channels
        names = {number: channel[0] for number, channel in channels.items() if channel in wanted}
        with path.open('rb') as stream:
            stream.seek(segment.offset)
            data = stream.read(segment.length)
        try:
            for record in read_records(data):
                if isinstance(record, Message) and record.channel_id in names:
                    yield RawMessage(record.log_time, names[record.channel_id], record.data)
        except DAMAGE as error:
            raise RecordingError(
                f'{path}: damaged data at byte {segment.offset} ({error})',
                'an intact file',
                'copy it again from the recorder',
            ) from error
