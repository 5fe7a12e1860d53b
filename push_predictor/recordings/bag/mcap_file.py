# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One MCAP file as raw messages in file order; damage becomes notes.

The mcap package parses the summary and the descriptions. The records of the data are located here, since its readers
end at the first damage: after it, reading continues at the next chunk.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from bisect import bisect_right
from collections import Counter
from collections.abc import Collection, Iterator
from io import BytesIO
from itertools import zip_longest
from pathlib import Path
from typing import BinaryIO, Final, TypeAlias

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, McapRecord, Metadata, MetadataIndex, Schema, Statistics
from mcap.stream_reader import StreamReader

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.compression import FRAME, as_cdr
from push_predictor.recordings.bag.idl import msg_of_idl
from push_predictor.recordings.bag.mcap_records import (
    HEAD,
    LARGEST_CHUNK,
    MAGIC,
    UNREADABLE,
    chunk_head,
    is_head,
    next_chunk,
    parse,
    read_at,
    unpack_chunk,
)
from push_predictor.recordings.bag.messages import Messages, RawMessage
from push_predictor.recordings.bag.notes import Notes
from push_predictor.types import BoolArray, IntArray

_Bytes: TypeAlias = bytes | bytearray
_MESSAGE = struct.Struct("<BQHIQQ")  # with its head
_MESSAGE_CODE: Final = int(Opcode.MESSAGE)
_PLACE = struct.Struct("=4Q")  # of _Page.places
_MESSAGE_INDEX = struct.Struct("<HI")
_DATA_END = struct.Struct("<BQI")
_FOOTER = struct.Struct("<BQQQI8s")
_ENDS = {(Opcode.DATA_END, 4), (Opcode.FOOTER, 20)}
_DESCRIPTIONS = {int(Opcode.SCHEMA): Schema, int(Opcode.CHANNEL): Channel, int(Opcode.METADATA): Metadata}
_READ = frozenset({*_DESCRIPTIONS, _MESSAGE_CODE})
_WITH_LENGTHS = (Opcode.CHUNK, Opcode.MESSAGE_INDEX)  # state their length twice, which is compared
_LARGE = 1 << 16  # bytes; a longer record with a doubtful length is not read
MOST_NOTES = 50  # a file can have a million damaged records


class _Page:
    """Consecutive records, and the messages among them.

    places: channel, time, begin and end in `records` of one message after the other. undone: number of messages that
    cannot be decompressed, by the offset of their record or chunk.
    """

    def __init__(self) -> None:
        self.records: _Bytes = b""
        self.places = array("Q")
        self.undone: Counter[int] = Counter()
        self._begins, self._offsets = list[int](), list[int]()

    @property
    def size(self) -> int:
        """Bytes of the records."""
        return len(self.records)

    def add(self, content: _Bytes, offset: int) -> None:
        """Add records from an offset of the file."""
        if content:
            self._begins.append(self.size)
            self._offsets.append(offset)
            self.records = self.records + content if self.records else content

    def offset_of(self, place: int) -> int:
        """Where in the file the records at a place begin."""
        return self._offsets[bisect_right(self._begins, place) - 1]

    def compressed(self, start: IntArray) -> BoolArray:
        """Which messages, by where they begin, are compressed: CDR begins with another byte than a zstd frame."""
        within = np.minimum(start, self.size - 1)  # of an empty message at the end
        return np.asarray(np.frombuffer(self.records, np.uint8)[within] == FRAME[0])

    def joined(self, start: IntArray, length: IntArray) -> bytes:
        """Parts of the records one after the other; most messages of a topic have one length."""
        if (length == length[0]).all():
            bytes_from = np.lib.stride_tricks.sliding_window_view(np.frombuffer(self.records, np.uint8), int(length[0]))
            return bytes_from[start].tobytes()
        spans = zip(start.tolist(), (start + length).tolist(), strict=True)
        return b"".join([self.records[begin:end] for begin, end in spans])


class McapFile:
    """The topics, metadata records and messages of one file.

    topics: {topic: type}; schemas: {type: definition text}; qos: {topic: offered QoS as YAML text, '' if
    unknown}; metadata: {record name: {key: value}}; notes: damage found so far, with file and byte offset
    (opening reads the summary, messages() the rest). A channel without a schema has the type '' unless `topics` is
    completed. name: of the file in notes, by default its path.

    Raises RecordingError for a file that is empty or not MCAP.
    """

    def __init__(self, path: Path, *, name: str = "") -> None:
        self.path = path
        self.topics: dict[str, str] = {}
        self.schemas: dict[str, str] = {}
        self.qos: dict[str, str] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.notes = Notes()
        self._name = name or str(path)
        self._channels: dict[int, Channel] = {}  # of two different descriptions the first
        self._types: dict[int, str] = {}
        self._listed: int | None = None  # number of messages in the summary
        self._summary_start = 0  # as the file's end states it, 0 without one
        self._closed = self._end_checked = False
        self._cut = 0  # offset of a chunk that the end of the file cuts off
        self._size = _checked_size(path, self._name)
        with path.open("rb") as stream:
            complete = self._read_end(stream)
        if not complete:
            for page in self._pages(topics=()):
                self._leave(page)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """CDR messages in file order, of all topics or of the given ones; damage becomes a note.

        One chunk at a time is in memory.
        """
        for page in self._pages(topics):
            wanted = self._wanted(topics)
            for number, time, start, end in _PLACE.iter_unpack(page.places):
                if number in wanted and (data := self._unpacked(page, start, end)) is not None:
                    yield RawMessage(*wanted[number], time, data)
            self._leave(page)

    def portions(self, topics: Collection[str]) -> Iterator[Messages]:
        """The same of the given topics, those of a topic and type at once."""
        for page in self._pages(topics):
            places = np.frombuffer(page.places, np.int64).reshape(-1, 4)  # damaged times have more than 63 bits
            for number, of in self._wanted(topics).items():
                _, time, start, end = places[places[:, 0] == number].T
                if not len(time):
                    continue
                if not page.compressed(start).any():
                    yield Messages(*of, time, page.joined(start, end - start), end - start)
                else:
                    spans = zip(start.tolist(), end.tolist(), strict=True)
                    data = {row: self._unpacked(page, *span) for row, span in enumerate(spans)}
                    known = {row: each for row, each in data.items() if each is not None}
                    yield Messages.of(*of, time[list(known)], list(known.values()))
            self._leave(page)

    def _pages(self, topics: Collection[str] | None) -> Iterator[_Page]:
        """All records: those of a chunk as a page, others as pages of some length."""
        seen, chunks, page = 0, list[int](), _Page()
        with self.path.open("rb") as stream:
            for opcode, offset, content in self._records(stream):
                if opcode == Opcode.DATA_END:
                    self._check_end(stream, offset, chunks)
                elif opcode == Opcode.CHUNK:
                    chunks.append(offset)
                seen += self._find(content, offset, page, topics)
                page.add(content, offset)
                del content  # before the next chunk is read
                if opcode == Opcode.CHUNK or page.size >= _LARGE:
                    yield page
                    page = _Page()
            yield page
        if self._listed not in (None, seen):
            self._lost(self._size, f"{seen} messages were found, the summary lists {self._listed}")

    def _find(self, content: _Bytes, offset: int, page: _Page, topics: Collection[str] | None) -> int:
        """Add the places of the messages among consecutive records to a page; returns their number.

        The channels, schemas and metadata among the records are stored.
        """
        size, at, base, before = len(content), 0, page.size, len(page.places)
        head, least, unpack, found = HEAD.size, _MESSAGE.size, _MESSAGE.unpack_from, page.places.extend
        try:
            while at + head <= size:
                start = at
                if content[start] != _MESSAGE_CODE:
                    opcode, length = HEAD.unpack_from(content, start)
                    if (at := start + head + length) <= size and opcode in _DESCRIPTIONS:
                        self._add(parse(_DESCRIPTIONS[opcode], content[start + head : at]), offset)
                elif start + least <= size:
                    _, length, number, _, time, _ = unpack(content, start)
                    if length < least - head:
                        raise ValueError(f"a message has {length} bytes, its header alone needs {least - head}")
                    if (at := start + head + length) <= size:
                        found((number, time, base + start + least, base + at))
                else:
                    break
            if at != size and offset != self._cut:
                raise ValueError(f"the last record of a chunk ends at byte {at} of {size}")
        except UNREADABLE as error:
            self._lost(offset, f"a record cannot be read ({error or type(error).__name__})")
        for number in sorted(set(page.places[before::4])):
            self._check_channel(number, topics, offset)
        return (len(page.places) - before) // 4

    def _unpacked(self, page: _Page, start: int, end: int) -> bytes | None:
        """A message as CDR, None if it cannot be decompressed."""
        try:
            return as_cdr(page.records[start:end])
        except UNREADABLE:
            page.undone[page.offset_of(start)] += 1
            return None

    def _leave(self, page: _Page) -> None:
        """Note what could not be decompressed; the next chunk is read when this one is no longer in memory."""
        for offset, count in page.undone.items():
            self._lost(offset, f"{count} messages cannot be decompressed and were skipped")
        page.records = b""

    def _check_channel(self, channel: int, topics: Collection[str] | None, offset: int) -> None:
        """Note a channel that has no description, or one that is wanted and has another encoding than CDR."""
        if (known := self._channels.get(channel)) is None:
            self._lost(offset, f"channel {channel} has no description; its messages were skipped")
        elif topics and known.topic in topics and known.message_encoding != "cdr":
            self._lost(offset, f"{known.topic} is encoded as {known.message_encoding!r}, cdr is accepted")

    # --- the records of the data ---

    def _records(self, stream: BinaryIO) -> Iterator[tuple[int, int, _Bytes]]:
        """(opcode, offset, content with its head) of each record up to the end of the data; of a chunk its records.

        Damage is noted at its offset, the content is empty then. Reading continues at the next record, or at the next
        chunk if no record begins after the damage.
        """
        offset: int | None = len(MAGIC)
        while offset is not None and offset < self._size:
            opcode, length = HEAD.unpack(read_at(stream, offset, HEAD.size).ljust(HEAD.size, b"\0"))
            if (opcode, length) in _ENDS:
                yield opcode, offset, b""
                return
            end = offset + HEAD.size + length
            follows = end <= self._size and is_head(read_at(stream, end, HEAD.size))
            try:
                content = self._content(stream, opcode, offset, length, follows)
                known = follows or opcode in _WITH_LENGTHS
            except UNREADABLE as error:
                self._lost(offset, str(error) or type(error).__name__)
                content, known = b"", follows
            yield opcode, offset, content
            del content
            offset = end if known else next_chunk(stream, offset + 1)
        if offset is not None:
            self._note(self._size, "the file was not closed; its contents are used")

    def _content(self, stream: BinaryIO, opcode: int, offset: int, length: int, follows: bool) -> _Bytes:
        """See _records; empty for a record that is not read. follows: whether a record begins after it.

        Raises one of UNREADABLE for damage.
        """
        end = offset + HEAD.size + length
        if opcode == Opcode.CHUNK:
            return self._chunk(stream, offset)
        if end > self._size:
            raise ValueError(self._lost_from(offset))
        if opcode == Opcode.MESSAGE_INDEX:  # a chunk with a damaged opcode must not be taken for one
            start = read_at(stream, offset + HEAD.size, min(_MESSAGE_INDEX.size, length))
            if len(start) < _MESSAGE_INDEX.size or _MESSAGE_INDEX.unpack(start)[1] + len(start) != length:
                raise ValueError("a message index contradicts its own length, the record was skipped")
            return b""
        if opcode not in _READ and opcode != Opcode.ATTACHMENT and (opcode, offset) != (Opcode.HEADER, len(MAGIC)):
            raise ValueError(f"a record of kind {opcode:#04x} is not allowed there and was skipped")
        if not follows:
            doubt = f"the record there or the one after it, at byte {end}, is damaged"
            if length > _LARGE:
                raise ValueError(doubt)
            self._note(offset, doubt)
        return read_at(stream, offset, HEAD.size + length) if opcode in _READ else b""

    def _chunk(self, stream: BinaryIO, offset: int) -> _Bytes:
        """The records of a chunk, of one that is cut off those before the cut. Raises ValueError for a damaged one."""
        lost = ""
        try:
            head = chunk_head(stream, offset)
            lost = f" ({head.seconds:.3g} s of messages)"
            if head.end > self._size:
                # In a file with an end, or with chunks after this one, bytes are missing within it.
                if self._closed or next_chunk(stream, offset + 1) is not None:
                    raise ValueError(self._lost_from(offset))
                self._lost(offset, self._lost_from(offset))
                self._cut = offset
            return unpack_chunk(stream, head)
        except UNREADABLE as error:
            raise ValueError(f"a chunk was skipped: {error or type(error).__name__}{lost}") from None

    def _lost_from(self, offset: int) -> str:
        return f"damaged or cut off; some of the {self._size - offset} bytes from there on are lost"

    # --- descriptions ---

    def _wanted(self, topics: Collection[str] | None) -> dict[int, tuple[str, str]]:
        """Topic and type by CDR channel, of all topics or of the given ones."""
        return {
            channel.id: (channel.topic, self._types.get(channel.schema_id) or self.topics[channel.topic])
            for channel in self._channels.values()
            if channel.message_encoding == "cdr" and (topics is None or channel.topic in topics)
        }

    def _add(self, record: McapRecord, offset: int) -> None:
        """Store a description, of a channel the first."""
        if isinstance(record, Schema):
            self._types.setdefault(record.id, record.name)
            text = record.data.decode(errors="replace")
            self.schemas.setdefault(record.name, msg_of_idl(text) if record.encoding == "ros2idl" else text)
        elif isinstance(record, Metadata):
            self.metadata[record.name] = record.metadata
        elif isinstance(record, Channel):
            known: Channel = self._channels.setdefault(record.id, record)
            if known != record:
                self._note(offset, f"channel {record.id} has a second, different description; the first one is used")
            self.topics.setdefault(known.topic, self._types.get(known.schema_id, ""))
            self.qos.setdefault(known.topic, known.metadata.get("offered_qos_profiles", ""))

    # --- the end of the file ---

    def _read_end(self, stream: BinaryIO) -> bool:
        """Read topics and metadata from the summary. False if it is absent, damaged or incomplete."""
        end = max(self._size - _FOOTER.size, 0)
        opcode, length, start, _, crc, magic = _FOOTER.unpack(read_at(stream, end, _FOOTER.size).ljust(_FOOTER.size))
        if (opcode, length, magic) != (Opcode.FOOTER, 20, MAGIC):
            self._note(self._size, "the end of the file is missing or damaged")
            return False
        self._closed, self._summary_start = True, start
        try:
            summary = _read_summary(stream, start or end, end)
            return self._use(stream, summary, verified=crc != 0) if start else False
        except UNREADABLE as error:
            self._note(start or end, f"{error or type(error).__name__}; the whole file is read")
            return False

    def _use(self, stream: BinaryIO, summary: list[McapRecord], verified: bool) -> bool:
        """Store a summary's descriptions; returns whether they are complete."""
        statistics = next((record for record in summary if isinstance(record, Statistics)), None)
        if statistics is not None:
            self._listed = statistics.message_count
        if statistics is None or not verified:  # the descriptions before the data are at least as good
            return False
        for record in summary:
            self._add(record, self._size)
        read = sum(self._use_metadata(stream, record) for record in summary if isinstance(record, MetadataIndex))
        return bool((statistics.channel_count, statistics.metadata_count) == (len(self._channels), read))

    def _use_metadata(self, stream: BinaryIO, place: MetadataIndex) -> bool:
        """Store the record that an index points to; returns whether it is there."""
        try:
            if place.offset + place.length > self._size:
                raise ValueError("the metadata index points outside the file")
            opcode, length = HEAD.unpack(read_at(stream, place.offset, HEAD.size))
            if opcode != Opcode.METADATA or HEAD.size + length != place.length:
                raise ValueError("the metadata index points to a place without a metadata record")
            record = parse(Metadata, stream.read(length))
            if record.name != place.name:
                raise ValueError(f"a metadata record is named {record.name!r}, but {place.name!r} in the index")
        except UNREADABLE as error:
            self._note(place.offset, f"{error or type(error).__name__}; a metadata record is expected there")
            return False
        self._add(record, place.offset)
        return True

    def _check_end(self, stream: BinaryIO, end: int, chunks: list[int]) -> None:
        """At the end of the data, compare them with their checksum, and the chunks found with the summary."""
        if self._end_checked:
            return
        self._end_checked = True
        _, _, stated = _DATA_END.unpack(read_at(stream, end, _DATA_END.size).ljust(_DATA_END.size, b"\0"))
        if stated and _checksum(stream, end) != stated:  # 0: none was computed
            self._lost(end, "the checksum of the data is wrong; they are damaged somewhere before it")
        if self._summary_start in (0, end + _DATA_END.size):
            return
        try:  # bytes were lost or inserted; the summary still lists the offsets of the chunks
            summary = _read_summary(stream, end + _DATA_END.size, self._size - _FOOTER.size)
        except UNREADABLE:
            return
        listed = [record.chunk_start_offset for record in summary if isinstance(record, ChunkIndex)]
        if moved := [place for place, found in zip_longest(listed, chunks) if place != found]:
            there = f"{len(chunks)} chunks were found, the summary lists {len(listed)}"
            self._lost(moved[0] or self._size, f"a chunk is missing or has moved; {there}")

    def _lost(self, offset: int, what: str) -> None:
        self._note(offset, what, lost=True)

    def _note(self, offset: int, what: str, *, lost: bool = False) -> None:
        text = f"{self._name} at byte {offset}: {what}"
        if len(self.notes) >= MOST_NOTES:
            text = f"{self._name}: further damage is not listed"
        self.notes.add(text, lost=lost)


def _checked_size(path: Path, name: str) -> int:
    try:
        with path.open("rb") as stream:
            start = stream.read(16)
    except OSError as error:
        raise RecordingError(f"{name}: cannot be read ({error.strerror})") from None
    if not start:
        raise RecordingError(f"{name}: the file is empty, give an MCAP recording")
    if not start.startswith(MAGIC):
        accepted = "MCAP, sqlite3 and ROS 1 recordings are accepted"
        raise RecordingError(f"{name}: not an MCAP file (starts with {start[:8]!r}), {accepted}")
    return path.stat().st_size


def _read_summary(stream: BinaryIO, start: int, end: int) -> list[McapRecord]:
    """The records of the summary from byte start to the footer at byte end.

    Raises one of UNREADABLE if they are missing or damaged.
    """
    if not 0 <= end - start <= LARGEST_CHUNK:
        raise ValueError("the footer places the summary outside the file")
    if read_at(stream, max(start - _DATA_END.size, 0), HEAD.size) != HEAD.pack(Opcode.DATA_END, 4):
        raise ValueError("the summary is not where the footer places it")
    content = read_at(stream, start, end - start + _FOOTER.size)
    crc = _FOOTER.unpack_from(content, end - start)[4]
    if crc and zlib.crc32(memoryview(content)[: -len(MAGIC) - 4]) != crc:
        raise ValueError("the summary's checksum is wrong")
    return list(StreamReader(BytesIO(content), skip_magic=True).records)


def _checksum(stream: BinaryIO, end: int) -> int:
    """The checksum of the bytes before an offset."""
    found = 0
    for begin in range(0, end, _LARGE):
        found = zlib.crc32(read_at(stream, begin, min(_LARGE, end - begin)), found)
    return found
