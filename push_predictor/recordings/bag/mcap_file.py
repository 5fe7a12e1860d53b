"""One MCAP file, raw and in file order: what can be read is given, what is damaged is noted."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterator
from itertools import zip_longest
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.records import MetadataIndex

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.mcap_described import Described, Wanted
from push_predictor.recordings.bag.mcap_places import Place, data_checksum_is_wrong, places
from push_predictor.recordings.bag.mcap_records import (
    CHUNK_HEAD_SIZE,
    HEAD,
    MAGIC,
    MESSAGE,
    UNREADABLE,
    Bytes,
    chunk_head,
    split,
    unpack_chunk,
)
from push_predictor.recordings.bag.mcap_summary import (
    DATA_END_SIZE,
    Footer,
    Summary,
    read_footer,
    read_metadata,
    read_summary,
)

MOST_NOTES = 50  # a file can have a million damaged places
_FOREIGN = {
    b"#ROSBAG": "a ROS 1 bag: `push_predictor import rosbag1` makes a recording of it",
    b"SQLite format 3": "a sqlite3 bag: `ros2 bag convert` makes an MCAP bag of it",
}


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
    (opening reads the summary, messages() the rest). unpack makes CDR of a message that was packed by itself and
    raises one of UNREADABLE where it cannot; name is the file's in notes, if not its path.

    Raises RecordingError for a file that is empty or not MCAP.
    """

    def __init__(self, path: Path, *, unpack: Callable[[bytes], bytes] | None = None, name: str = "") -> None:
        self.path = path
        self._described = described = Described(self._note)
        self.topics, self.schemas = described.topics, described.schemas
        self.qos, self.metadata = described.qos, described.metadata
        self.notes: list[str] = []
        self._name = name or str(path)
        self._unpack = unpack
        self._listed: int | None = None  # messages, as the summary counts them
        self._chunks: list[int] = []  # where they start, if a checksum vouches for it
        self._compared = False
        self._size = _checked_size(path, self._name)
        self._footer: Footer | None = None
        if not self._read_end():
            for _ in self.messages(topics=()):
                pass

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Messages in file order, of all topics in CDR or of the given ones; damage becomes a note.

        One chunk at a time is in memory.
        """
        wanted = self._described.wanted(topics, self._described.channels.values())
        seen = 0
        chunks: list[int] = []
        with self.path.open("rb") as stream:
            for place in places(stream, self._size, self._chunks, self._footer is not None, self._note):
                if place.opcode in (Opcode.DATA_END, Opcode.FOOTER):
                    self._compare(stream, place, chunks)
                    break
                if place.opcode == Opcode.CHUNK:
                    chunks.append(place.offset)
                seen += yield from self._decoded(self._content(stream, place), place, topics, wanted)
        if self._listed not in (None, seen):
            self._note(self._size, f"{seen} messages were found, the summary counts {self._listed}")

    def _content(self, stream: BinaryIO, place: Place) -> Bytes:
        """The records at a place."""
        stream.seek(place.offset)
        if place.opcode != Opcode.CHUNK:
            return stream.read(HEAD.size + place.length)
        try:
            stream.seek(HEAD.size, 1)
            head = chunk_head(stream.read(min(CHUNK_HEAD_SIZE, place.length)), place.length)
            stream.seek(place.offset + HEAD.size + head.begin)
            return unpack_chunk(head, stream)
        except UNREADABLE as error:
            self._note(place.offset, f"a chunk was skipped: {error or type(error).__name__}")
            return b""

    def _decoded(
        self, content: Bytes, place: Place, topics: Collection[str] | None, wanted: Wanted
    ) -> Generator[RawMessage, None, int]:
        """The wanted messages in a run of records, and how many messages there are in all.

        Channels, schemas and metadata on the way are kept.
        """
        seen = unpackable = 0
        view = memoryview(content)
        try:
            for opcode, start, end in split(content, place.whole):
                if opcode == Opcode.MESSAGE:
                    if start + MESSAGE.size > end:
                        raise ValueError(f"a message of {end - start} bytes")
                    seen += 1
                    number, _, log_time, _ = MESSAGE.unpack_from(content, start)
                    if found := wanted.get(number):
                        data = self._unpacked(view[start + MESSAGE.size : end])
                        if data is None:
                            unpackable += 1
                        else:
                            yield RawMessage(*found, log_time, data)
                    else:
                        self._check_unwanted(number, topics, place.offset)
                elif channel := self._described.register(opcode, content, start, end, place.offset):
                    wanted.update(self._described.wanted(topics, [channel]))
        except UNREADABLE as error:
            self._note(place.offset, f"a record cannot be read ({error or type(error).__name__})")
        if unpackable:
            self._note(place.offset, f"{unpackable} messages cannot be unpacked and were dropped")
        return seen

    def _unpacked(self, data: memoryview) -> bytes | None:
        if self._unpack is None:
            return data.tobytes()
        try:
            return self._unpack(data.tobytes())
        except UNREADABLE:
            return None

    def _check_unwanted(self, channel: int, topics: Collection[str] | None, offset: int) -> None:
        """Nobody asked for the message; or it cannot be given, which must not pass in silence."""
        if (known := self._described.channels.get(channel)) is None:
            self._note(offset, f"channel {channel} is not described, its messages were dropped")
        elif topics and known.topic in topics:
            self._note(offset, f"{known.topic} is encoded as {known.message_encoding!r}, cdr is accepted")

    def _read_end(self) -> bool:
        """Topics and metadata by the summary. False if it is absent, damaged or incomplete."""
        with self.path.open("rb") as stream:
            self._footer = footer = read_footer(stream, self._size)
            if footer is None:
                self._note(self._size, "the end of the file is missing or damaged")
                return False
            try:
                if not footer.start:
                    footer.check(b"")
                    return False
                return self._use(stream, read_summary(stream, footer, footer.start))
            except UNREADABLE as error:
                self._note(footer.start or footer.offset, f"{error or type(error).__name__}, the file is read through")
                return False

    def _use(self, stream: BinaryIO, summary: Summary) -> bool:
        """Keep what a summary tells. Is that all that a reader must know?"""
        if (statistics := summary.statistics) is not None:
            self._listed = statistics.message_count
        if statistics is None or not summary.verified:  # the descriptions before the data are as good or better
            return False
        self._chunks = summary.chunks
        for schema in summary.schemas:
            self._described.add_schema(schema)
        for channel in summary.channels:
            self._described.add_channel(channel, self._size)
        read = sum(self._use_metadata(stream, place) for place in summary.metadata)
        complete = statistics.channel_count == len(self._described.channels)
        return bool(complete and statistics.metadata_count == read)

    def _use_metadata(self, stream: BinaryIO, place: MetadataIndex) -> bool:
        try:
            record = read_metadata(stream, place, self._size)
        except UNREADABLE as error:
            self._note(place.offset, f"{error or type(error).__name__}, a metadata record should be there")
            return False
        self.metadata[record.name] = record.metadata
        return True

    def _compare(self, stream: BinaryIO, place: Place, chunks: list[int]) -> None:
        """At the data's end: is all there that the checksum and the summary tell of?"""
        if self._compared or place.opcode != Opcode.DATA_END:
            return
        end = place.offset
        self._compared = True
        if data_checksum_is_wrong(stream, end):
            self._note(end, "the checksum of all that stands before is wrong, it is damaged somewhere")
        if self._footer is None or self._footer.start in (0, end + DATA_END_SIZE):
            return
        try:  # bytes were lost or came in: the summary still tells where the chunks were
            listed = read_summary(stream, self._footer, end + DATA_END_SIZE).chunks
        except UNREADABLE:
            return
        if moved := [place for place, found in zip_longest(listed, chunks) if place != found]:
            there = f"{len(chunks)} chunks are there, the summary lists {len(listed)}"
            self._note(moved[0] or self._size, f"a chunk was there that is missing or has moved; {there}")

    def _note(self, offset: int, what: str) -> None:
        text = f"{self._name} at byte {offset}: {what}"
        if len(self.notes) >= MOST_NOTES:
            text = f"{self._name}: more is damaged than is told here"
        if text not in self.notes:
            self.notes.append(text)


def _checked_size(path: Path, name: str) -> int:
    try:
        with path.open("rb") as stream:
            start = stream.read(16)
    except OSError as error:
        raise RecordingError(f"{name}: cannot be read ({error.strerror})") from None
    if not start:
        raise RecordingError(f"{name}: the file is empty, give an MCAP recording")
    if not start.startswith(MAGIC):
        what = next((text for magic, text in _FOREIGN.items() if start.startswith(magic)), "not an MCAP file")
        raise RecordingError(f"{name}: {what} (starts with {start[:8]!r}), MCAP recordings are accepted")
    return path.stat().st_size
