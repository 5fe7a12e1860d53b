"""One MCAP file, raw and in file order: what can be read is given, what is damaged is noted."""

from __future__ import annotations

from collections.abc import Collection, Generator, Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, MetadataIndex, Schema, Statistics

from push_predictor.errors import RecordingError
from push_predictor.recordings.mcap_records import (
    FOOTER_SIZE,
    HEAD,
    MAGIC,
    MESSAGE,
    UNREADABLE,
    parse,
    split,
    summary_start,
    unpack_chunk,
)

_SKIPPED = frozenset({Opcode.HEADER, Opcode.ATTACHMENT, Opcode.MESSAGE_INDEX})
_ENDS = frozenset({Opcode.DATA_END, Opcode.FOOTER})
_FOREIGN = {
    b"#ROSBAG": "a ROS 1 bag: `push_predictor import rosbag1` makes a recording of it",
    b"SQLite format 3": "a sqlite3 bag: `ros2 bag convert` makes an MCAP bag of it",
}


_Wanted = dict[int, tuple[str, str]]  # channel id: topic and type


class RawMessage(NamedTuple):
    """A message as recorded: topic, type (package/msg/Name), log time in ns, CDR bytes."""

    topic: str
    type: str
    log_time: int
    data: bytes


class McapFile:
    """The topics, metadata records and messages of one file.

    topics: {topic: type}; schemas: {type: definition text}; qos: {topic: offered QoS as YAML text, '' if
    unknown}; metadata: {record name: {key: value}}; notes: damage found so far, with file and byte offset
    (opening reads the summary, messages() the rest). Raises RecordingError for a file that is empty or not MCAP.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[str, str] = {}
        self.schemas: dict[str, str] = {}
        self.qos: dict[str, str] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.notes: list[str] = []
        self._types: dict[int, str] = {}
        self._channels: dict[int, Channel] = {}
        self._listed: int | None = None  # messages, as the summary counts them
        self._size = _checked_size(path)
        if not self._read_summary():
            for _ in self.messages(topics=()):
                pass
        if not (self.notes or self._closed()):
            self._note(self._size, "the end of the file is missing, the messages before it are whole")

    def _closed(self) -> bool:
        with self.path.open("rb") as stream:
            stream.seek(self._size - len(MAGIC))
            return stream.read() == MAGIC

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Messages in file order, of all topics in CDR or of the given ones; damage becomes a note.

        Raises RecordingError for a given topic that is not in CDR.
        """
        wanted: _Wanted = {}
        seen = 0
        for channel in self._channels.values():
            self._want(channel, topics, wanted)
        for opcode, offset, body, whole in self._records():
            content = self._chunk_content(offset, body, whole) if opcode == Opcode.CHUNK else body
            seen += yield from self._decoded(content, offset, topics, wanted)
        if self._listed not in (None, seen):
            self._note(self._size, f"{seen} messages were found, the summary counts {self._listed}")

    def _chunk_content(self, offset: int, body: bytes, whole: bool) -> bytes:
        try:
            return unpack_chunk(body[HEAD.size :], whole)
        except UNREADABLE as error:
            self._note(offset, f"a chunk was skipped: {error or type(error).__name__}")
            return b""

    def _records(self) -> Iterator[tuple[int, int, bytes, bool]]:
        """(opcode, offset, record, is it whole) of the data section; only a chunk may be given in part."""
        with self.path.open("rb") as stream:
            offset = stream.seek(len(MAGIC))
            while head := stream.read(HEAD.size):
                opcode, length = HEAD.unpack(head.ljust(HEAD.size, b"\0"))
                if opcode in _ENDS:
                    return
                end = offset + HEAD.size + length
                if opcode == 0 or end > self._size:
                    self._note(offset, f"damaged or cut off, {self._size - offset} bytes from there are lost in part")
                    if opcode == Opcode.CHUNK:
                        yield opcode, offset, head + stream.read(), False
                    return
                if opcode in _SKIPPED:
                    stream.seek(end)
                else:
                    yield opcode, offset, head + stream.read(length), True
                offset = end
        self._note(offset, "the file was not closed, what it holds is used")

    def _decoded(
        self, content: bytes, offset: int, topics: Collection[str] | None, wanted: _Wanted
    ) -> Generator[RawMessage, None, int]:
        """The wanted messages in a run of records, and how many messages there are in all.

        Channels, schemas and metadata on the way are kept.
        """
        seen = 0
        try:
            for opcode, start, end in split(content):
                if opcode == Opcode.MESSAGE:
                    seen += 1
                    channel, _, log_time, _ = MESSAGE.unpack_from(content, start)
                    if found := wanted.get(channel):
                        yield RawMessage(*found, log_time, content[start + MESSAGE.size : end])
                    elif channel not in self._channels:
                        self._note(offset, f"channel {channel} is not described, its messages were dropped")
                elif described := self._register(opcode, content, start, end):
                    self._want(described, topics, wanted)
        except UNREADABLE as error:
            self._note(offset, f"a record cannot be read ({error or type(error).__name__})")
        return seen

    def _want(self, channel: Channel, topics: Collection[str] | None, wanted: _Wanted) -> None:
        encoding = channel.message_encoding
        if encoding == "cdr" and (topics is None or channel.topic in topics):
            wanted[channel.id] = channel.topic, self._types.get(channel.schema_id, "")
        elif topics and channel.topic in topics:
            raise RecordingError(f"{self.path}: {channel.topic} is encoded as {encoding!r}, cdr is accepted")

    def _register(self, opcode: int, content: bytes, start: int, end: int) -> Channel | None:
        """Keep what a record describes; the channel if it is one."""
        if opcode == Opcode.SCHEMA:
            schema = parse(Schema, content, start, end)
            self._types[schema.id] = schema.name
            self.schemas[schema.name] = schema.data.decode(errors="replace")
        elif opcode == Opcode.CHANNEL:
            channel = parse(Channel, content, start, end)
            self._channels[channel.id] = channel
            self.topics.setdefault(channel.topic, self._types.get(channel.schema_id, ""))
            self.qos.setdefault(channel.topic, channel.metadata.get("offered_qos_profiles", ""))
            return channel
        elif opcode == Opcode.METADATA:
            record = parse(Metadata, content, start, end)
            self.metadata[record.name] = record.metadata
        return None

    def _read_summary(self) -> bool:
        """Topics and metadata by the index at the file's end. False if it is absent, damaged or incomplete."""
        try:
            with self.path.open("rb") as stream:
                stream.seek(max(self._size - FOOTER_SIZE, 0))
                if not (start := summary_start(stream.read())) or start > self._size:
                    return False
                stream.seek(start)
                return self._use_summary(stream.read())
        except UNREADABLE:
            return False

    def _use_summary(self, summary: bytes) -> bool:
        statistics, places = None, []
        for opcode, start, end in split(summary):
            if opcode == Opcode.STATISTICS:
                statistics = parse(Statistics, summary, start, end)
            elif opcode == Opcode.METADATA_INDEX:
                places.append(parse(MetadataIndex, summary, start, end))
            else:
                self._register(opcode, summary, start, end)
        for place in places:
            self._read_metadata(place.offset)
        if statistics is None or statistics.channel_count != len(self._channels):
            return False
        self._listed = statistics.message_count
        return bool(statistics.metadata_count == len(places))

    def _read_metadata(self, offset: int) -> None:
        with self.path.open("rb") as stream:
            stream.seek(offset)
            opcode, length = HEAD.unpack(stream.read(HEAD.size))
            if opcode != Opcode.METADATA or offset + length > self._size:
                raise ValueError("the metadata index points elsewhere")
            body = stream.read(length)
            self._register(opcode, body, 0, length)

    def _note(self, offset: int, what: str) -> None:
        text = f"{self.path} at byte {offset}: {what}"
        if text not in self.notes:
            self.notes.append(text)


def _checked_size(path: Path) -> int:
    try:
        with path.open("rb") as stream:
            start = stream.read(16)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from None
    if not start:
        raise RecordingError(f"{path}: the file is empty, give an MCAP recording")
    if not start.startswith(MAGIC):
        what = next((name for magic, name in _FOREIGN.items() if start.startswith(magic)), "not an MCAP file")
        raise RecordingError(f"{path}: {what} (starts with {start[:8]!r}), MCAP recordings are accepted")
    return path.stat().st_size
