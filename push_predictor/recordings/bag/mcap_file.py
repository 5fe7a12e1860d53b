# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One MCAP file (https://mcap.dev/spec) as raw messages in file order; damage becomes notes.

It has little-endian records of one byte opcode, eight bytes length, content; a chunk holds compressed records. The mcap
package parses the summary and the descriptions. The records of the data are located here, since its readers end at the
first damage: after it, reading continues at the next chunk.
"""

from __future__ import annotations

import re
import struct
import zlib
from array import array
from collections.abc import Collection, Iterator
from contextlib import suppress
from io import BytesIO
from itertools import zip_longest
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple, TypeAlias

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, McapRecord, Metadata, MetadataIndex, Schema, Statistics
from mcap.stream_reader import StreamReader

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.compression import FRAME, as_cdr
from push_predictor.recordings.bag.message_types import msg_of_idl
from push_predictor.recordings.bag.messages import PORTION, BagFile, Messages, RawMessage, gathered

MAGIC = b"\x89MCAP0\r\n"
LARGEST_CHUNK: Final = 1 << 30  # bytes uncompressed; a foreign file must not exhaust the memory
MOST_NOTES = 50  # a file can have a million damaged records
_UNREADABLE = (struct.error, UnicodeDecodeError, McapError, zstandard.ZstdError, RuntimeError, ValueError)

_Bytes: TypeAlias = bytes | bytearray
_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<BQHIQQ")  # with its head
_MESSAGE_CODE: Final = int(Opcode.MESSAGE)
_MESSAGE_INDEX = struct.Struct("<HI")
_CHUNK = struct.Struct("<BQQQQII")  # up to the length of the compression's name
_CHUNK_HEAD_SIZE = _CHUNK.size + 4 + 8  # up to the compressed records
_CHUNK_BEGIN = re.compile(rb"\x06.{6}\x00{2}.{28}(?:\x04\x00{3}zstd|\x03\x00{3}lz4|\x00{4})", re.DOTALL)
_DATA_END = struct.Struct("<BQI")
_FOOTER = struct.Struct("<BQQQI8s")
_ENDS = {(Opcode.DATA_END, 4), (Opcode.FOOTER, 20)}
_FIELDS: Final = 4
_PLACE = struct.Struct(f"={_FIELDS}Q")  # of a message: its channel, its time, where it begins and ends
_DESCRIPTIONS = {int(Opcode.SCHEMA): Schema, int(Opcode.CHANNEL): Channel, int(Opcode.METADATA): Metadata}
_READ = frozenset({*_DESCRIPTIONS, _MESSAGE_CODE})
_WITH_LENGTHS = (Opcode.CHUNK, Opcode.MESSAGE_INDEX)  # state their length twice, which is compared
_KINDS = frozenset(Opcode)
_COMPRESSIONS = (b"", b"zstd", b"lz4")
_LARGE: Final = 1 << 16  # bytes; read at once, or searched; a longer record with a doubtful length is not read
_PIECE: Final = 1 << 15


class McapFile(BagFile):
    """See BagFile; notes name file and byte offset. Opening reads the summary, messages() the rest.

    A channel without a schema has the type '' unless `topics` is completed. Raises RecordingError for a file that is
    empty or not MCAP.
    """

    storage = "mcap"

    def __init__(self, path: Path, name: str = "") -> None:
        super().__init__(path, name)
        self._channels: dict[int, Channel] = {}  # of two different descriptions the first
        self._types: dict[int, str] = {}
        self._listed: int | None = None  # number of messages in the summary
        self._summary_start = 0  # as the file's end states it, 0 without one
        self._closed = self._end_checked = False
        self._cut = 0  # offset of a chunk that the end of the file cuts off
        self._size = _checked_size(path, self.name)
        with path.open("rb") as stream:
            complete = self._read_end(stream)
        if not complete:
            for _ in self.messages(topics=()):
                pass

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """See BagFile. One chunk at a time is in memory."""
        for places, records, offset in self._found(topics):
            yield from self._messages_at(places, records, offset, topics)
            del records  # before the next chunk is read

    def portions(self, topics: Collection[str]) -> Iterator[Messages]:
        """See BagFile. The messages of a chunk are not made one by one."""
        single: list[RawMessage] = []
        for places, records, offset in self._found(topics):
            if alone := len(places) <= _FIELDS:  # a record of a file without chunks
                single += self._messages_at(places, records, offset, topics)
            if not alone or len(single) >= PORTION:
                yield from gathered(single)
                single = []
            if not alone:
                yield from self._chunk_portions(places, records, offset, topics)
            del records  # before the next chunk is read
        yield from gathered(single)

    def _chunk_portions(
        self, places: array[int], records: _Bytes, offset: int, topics: Collection[str]
    ) -> Iterator[Messages]:
        table, data = np.frombuffer(places, np.int64).reshape(-1, _FIELDS), np.frombuffer(records, np.uint8)
        if np.any(data[np.minimum(table[:, 2], len(data) - 1)] == FRAME[0]):  # messages may be compressed themselves
            yield from gathered(self._messages_at(places, records, offset, topics))
            return
        for number, of in self._wanted(places, topics).items():
            _, times, start, end = table[table[:, 0] == number].T
            if length := int(end[0] - start[0]) if (end - start == end[0] - start[0]).all() else 0:
                joined = np.lib.stride_tricks.sliding_window_view(data, length)[start].tobytes()
            else:
                joined = b"".join(records[a:b] for a, b in zip(start.tolist(), end.tolist(), strict=True))
            yield Messages(*of, times, joined, end - start)

    def _found(self, topics: Collection[str] | None) -> Iterator[tuple[array[int], _Bytes, int]]:
        """Places, as in _PLACE, of the messages in consecutive records, these records, and their offset in the file."""
        seen, chunks = 0, list[int]()
        with self.path.open("rb") as stream:
            for opcode, offset, records in self._records(stream):
                if opcode == Opcode.DATA_END:
                    self._check_end(stream, offset, chunks)
                elif opcode == Opcode.CHUNK:
                    chunks.append(offset)
                places = self._places(records, offset, topics)
                seen += len(places) // _FIELDS
                yield places, records, offset
                del records
        if self._listed not in (None, seen):
            self._lost_at(self._size, f"{seen} messages were found, the summary lists {self._listed}")

    def _messages_at(
        self, places: array[int], records: _Bytes, offset: int, topics: Collection[str] | None
    ) -> Iterator[RawMessage]:
        """The wanted messages at places in consecutive records."""
        undone, wanted = 0, self._wanted(places, topics)
        for number, time, start, end in _PLACE.iter_unpack(places):
            if number not in wanted:
                continue
            try:
                data = as_cdr(records[start:end])
            except zstandard.ZstdError:
                undone += 1
                continue
            yield RawMessage(*wanted[number], time, data)
        if undone:
            self._lost_at(offset, f"{undone} messages cannot be decompressed and were skipped")

    def _places(self, records: _Bytes, offset: int, topics: Collection[str] | None) -> array[int]:
        """The places, as in _PLACE, of the messages in consecutive records from an offset of the file on.

        The channels, schemas and metadata among the records are stored.
        """
        size, at, places = len(records), 0, array("Q")
        head, least, unpack, found = _HEAD.size, _MESSAGE.size, _MESSAGE.unpack_from, places.extend
        try:
            while at + head <= size:
                start = at
                if records[start] != _MESSAGE_CODE:
                    opcode, length = _HEAD.unpack_from(records, start)
                    if (at := start + head + length) <= size and opcode in _DESCRIPTIONS:
                        self._add(_parsed(_DESCRIPTIONS[opcode], records[start + head : at]), offset)
                elif start + least <= size:
                    _, length, number, _, time, _ = unpack(records, start)
                    if length < least - head:
                        raise ValueError(f"a message has {length} bytes, its header alone needs {least - head}")
                    if (at := start + head + length) <= size:
                        found((number, time, start + least, at))
                else:
                    break
            if at != size and offset != self._cut:
                raise ValueError(f"the last record of a chunk ends at byte {at} of {size}")
        except _UNREADABLE as error:
            self._lost_at(offset, f"a record cannot be read ({error or type(error).__name__})")
        for number in sorted(set(places[::_FIELDS])):
            self._check_channel(number, topics, offset)
        return places

    # --- the records of the data ---

    def _records(self, stream: BinaryIO) -> Iterator[tuple[int, int, _Bytes]]:
        """(opcode, offset, content with its head) of each record up to the end of the data; of a chunk its records.

        Damage is noted at its offset, the content is empty then. Reading continues at the next record, or at the next
        chunk if no record begins after the damage.
        """
        offset: int | None = len(MAGIC)
        while offset is not None and offset < self._size:
            opcode, length = _HEAD.unpack(_read_at(stream, offset, _HEAD.size).ljust(_HEAD.size, b"\0"))
            if (opcode, length) in _ENDS:
                yield opcode, offset, b""
                return
            end = offset + _HEAD.size + length
            follows = end <= self._size and _is_head(_read_at(stream, end, _HEAD.size))
            try:
                content = self._content(stream, opcode, offset, length, follows)
                known = follows or opcode in _WITH_LENGTHS
            except _UNREADABLE as error:
                self._lost_at(offset, str(error) or type(error).__name__)
                content, known = b"", follows
            yield opcode, offset, content
            del content
            offset = end if known else _next_chunk(stream, offset + 1)
        if offset is not None:
            self._note(self._size, "the file was not closed; its contents are used")

    def _content(self, stream: BinaryIO, opcode: int, offset: int, length: int, follows: bool) -> _Bytes:
        """See _records; empty for a record that is not read. follows: whether a record begins after it.

        Raises one of _UNREADABLE for damage.
        """
        end = offset + _HEAD.size + length
        if opcode == Opcode.CHUNK:
            return self._chunk(stream, offset)
        if end > self._size:
            raise ValueError(self._lost_from(offset))
        if opcode == Opcode.MESSAGE_INDEX:  # a chunk with a damaged opcode must not be taken for one
            start = _read_at(stream, offset + _HEAD.size, min(_MESSAGE_INDEX.size, length))
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
        return _read_at(stream, offset, _HEAD.size + length) if opcode in _READ else b""

    def _chunk(self, stream: BinaryIO, offset: int) -> _Bytes:
        """The records of a chunk, of one that is cut off those before the cut. Raises ValueError for a damaged one."""
        lost = ""
        try:
            head = _chunk_head(stream, offset)
            lost = f" ({head.seconds:.3g} s of messages)"
            if head.end > self._size:
                # In a file with an end, or with chunks after this one, bytes are missing within it.
                if self._closed or _next_chunk(stream, offset + 1) is not None:
                    raise ValueError(self._lost_from(offset))
                self._lost_at(offset, self._lost_from(offset))
                self._cut = offset
            return _unpacked(head, _read_at(stream, head.begin, min(head.packed, self._size - head.begin)))
        except _UNREADABLE as error:
            raise ValueError(f"a chunk was skipped: {error or type(error).__name__}{lost}") from None

    def _lost_from(self, offset: int) -> str:
        return f"damaged or cut off; some of the {self._size - offset} bytes from there on are lost"

    # --- descriptions ---

    def _wanted(self, places: array[int], topics: Collection[str] | None) -> dict[int, tuple[str, str]]:
        """Topic and type by CDR channel of the messages at these places, of all topics or of the given ones."""
        known = (self._channels.get(number) for number in sorted({*places[::_FIELDS]}))
        return {
            channel.id: (channel.topic, self._types.get(channel.schema_id) or self.topics[channel.topic])
            for channel in known
            if channel and channel.message_encoding == "cdr" and (topics is None or channel.topic in topics)
        }

    def _check_channel(self, channel: int, topics: Collection[str] | None, offset: int) -> None:
        """Note a channel that has no description, or one that is wanted and has another encoding than CDR."""
        if (known := self._channels.get(channel)) is None:
            self._lost_at(offset, f"channel {channel} has no description; its messages were skipped")
        elif topics and known.topic in topics and known.message_encoding != "cdr":
            self._lost_at(offset, f"{known.topic} is encoded as {known.message_encoding!r}, cdr is accepted")

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
        opcode, length, start, _, crc, magic = _FOOTER.unpack(_read_at(stream, end, _FOOTER.size).ljust(_FOOTER.size))
        if (opcode, length, magic) != (Opcode.FOOTER, 20, MAGIC):
            self._note(self._size, "the end of the file is missing or damaged")
            return False
        self._closed, self._summary_start = True, start
        try:
            summary = _read_summary(stream, start or end, end)
            return self._use(stream, summary, verified=crc != 0) if start else False
        except _UNREADABLE as error:
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
            length = place.length - _HEAD.size
            if _read_at(stream, place.offset, _HEAD.size) != _HEAD.pack(Opcode.METADATA, length):
                raise ValueError("the metadata index points to a place without a metadata record")
            record = _parsed(Metadata, stream.read(length))
            if record.name != place.name:
                raise ValueError(f"a metadata record is named {record.name!r}, but {place.name!r} in the index")
        except _UNREADABLE as error:
            self._note(place.offset, f"{error or type(error).__name__}; a metadata record is expected there")
            return False
        self._add(record, place.offset)
        return True

    def _check_end(self, stream: BinaryIO, end: int, chunks: list[int]) -> None:
        """At the end of the data, compare them with their checksum, and the chunks found with the summary."""
        if self._end_checked:
            return
        self._end_checked = True
        _, _, stated = _DATA_END.unpack(_read_at(stream, end, _DATA_END.size).ljust(_DATA_END.size, b"\0"))
        if stated and _checksum(stream, end) != stated:  # 0: none was computed
            self._lost_at(end, "the checksum of the data is wrong; they are damaged somewhere before it")
        if self._summary_start in (0, end + _DATA_END.size):
            return
        try:  # bytes were lost or inserted; the summary still lists the offsets of the chunks
            summary = _read_summary(stream, end + _DATA_END.size, self._size - _FOOTER.size)
        except _UNREADABLE:
            return
        listed = [record.chunk_start_offset for record in summary if isinstance(record, ChunkIndex)]
        if moved := [place for place, found in zip_longest(listed, chunks) if place != found]:
            there = f"{len(chunks)} chunks were found, the summary lists {len(listed)}"
            self._lost_at(moved[0] or self._size, f"a chunk is missing or has moved; {there}")

    def _lost_at(self, offset: int, what: str) -> None:
        self._note(offset, what, lost=True)

    def _note(self, offset: int, what: str, *, lost: bool = False) -> None:
        text = f"{self.name} at byte {offset}: {what}"
        if len(self.notes) >= MOST_NOTES:
            text = f"{self.name}: further damage is not listed"
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


# --- records ---


class _Content(BytesIO):
    """A record's content; a string or number that is longer than its record is an error, not a short read."""

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        if size is not None and len(data) < size:
            raise EndOfFile
        return data


def _parsed(kind: type[McapRecord], content: _Bytes) -> McapRecord:
    """One record's content as this class of the mcap package. Raises one of _UNREADABLE."""
    return kind.read(ReadDataStream(_Content(content)))


def _read_at(stream: BinaryIO, offset: int, size: int) -> bytes:
    """At most `size` bytes from an offset on."""
    stream.seek(offset)
    return stream.read(size)


def _is_head(head: bytes) -> bool:
    """Whether these bytes can begin a record.

    Random bytes hardly ever do; a head cut by the end of the file does.
    """
    if len(head) < _HEAD.size:
        return True
    opcode, length = _HEAD.unpack(head)
    return bool((opcode in _KINDS or opcode >= 0x80) and length < 4 * LARGEST_CHUNK)


def _read_summary(stream: BinaryIO, start: int, end: int) -> list[McapRecord]:
    """The records of the summary from byte start to the footer at byte end.

    Raises one of _UNREADABLE if they are missing or damaged.
    """
    if not 0 <= end - start <= LARGEST_CHUNK:
        raise ValueError("the footer places the summary outside the file")
    if _read_at(stream, max(start - _DATA_END.size, 0), _HEAD.size) != _HEAD.pack(Opcode.DATA_END, 4):
        raise ValueError("the summary is not where the footer places it")
    content = _read_at(stream, start, end - start + _FOOTER.size)
    crc = _FOOTER.unpack_from(content, end - start)[4]
    if crc and zlib.crc32(memoryview(content)[: -len(MAGIC) - 4]) != crc:
        raise ValueError("the summary's checksum is wrong")
    return list(StreamReader(BytesIO(content), skip_magic=True).records)


def _checksum(stream: BinaryIO, end: int) -> int:
    """The checksum of the bytes before an offset."""
    found = 0
    for begin in range(0, end, _LARGE):
        found = zlib.crc32(_read_at(stream, begin, min(_LARGE, end - begin)), found)
    return found


# --- chunks ---


class _ChunkHead(NamedTuple):
    """The fields before a chunk's records. end: offset of the next record; begin, packed: of the compressed records.

    size, crc: of the records; seconds: from the first message to the last.
    """

    end: int
    begin: int
    packed: int
    size: int
    crc: int
    compression: bytes
    seconds: float


def _chunk_head(stream: BinaryIO, offset: int) -> _ChunkHead:
    """The fields of the chunk at an offset.

    Raises one of _UNREADABLE if its lengths contradict each other or are more than is accepted.
    """
    start = _read_at(stream, offset, _CHUNK_HEAD_SIZE)
    _, length, first, last, size, crc, name_length = _CHUNK.unpack_from(start)
    compression = start[_CHUNK.size : _CHUNK.size + min(name_length, _CHUNK_HEAD_SIZE)]
    if compression not in _COMPRESSIONS or len(compression) != name_length:
        raise ValueError(f"chunk compression {compression!r}, zstd, lz4 and none are accepted")
    begin = offset + _CHUNK.size + name_length + 8
    (packed,) = struct.unpack_from("<Q", start, _CHUNK.size + name_length)
    end = offset + _HEAD.size + length
    if begin + packed != end:
        raise ValueError(f"a chunk of {length} bytes claims {packed} bytes of records")
    if size > LARGEST_CHUNK:
        raise ValueError(f"a chunk of {size} bytes, {LARGEST_CHUNK} are accepted")
    if packed > size + size // 64 + 4096:
        raise ValueError(f"a chunk of {size} bytes claims {packed} compressed bytes")
    return _ChunkHead(end, begin, packed, size, crc, compression, 1e-9 * (last - first))


def _next_chunk(stream: BinaryIO, offset: int) -> int | None:
    """The first offset, from a given one on, at which the fields of a chunk agree; None without one."""
    while piece := _read_at(stream, offset, _LARGE):
        for found in _CHUNK_BEGIN.finditer(piece):
            with suppress(*_UNREADABLE):
                _chunk_head(stream, offset + found.start())
                return offset + found.start()
        offset += _LARGE - _CHUNK_HEAD_SIZE
    return None


def _unpacked(head: _ChunkHead, data: bytes) -> _Bytes:
    """The records of a chunk from its compressed bytes; of one that is cut off by the end of the file the first ones.

    Memory is limited to the compressed bytes and the size that the head states. Raises one of _UNREADABLE for a wrong
    size or a wrong checksum.
    """
    cut = len(data) < head.packed
    if head.compression == b"":
        found: _Bytes = data
    elif head.compression == b"zstd" and not cut and zstandard.frame_content_size(data) == head.size:
        found = zstandard.ZstdDecompressor().decompress(data)  # libzstd's stream takes a window of twice a chunk
    else:
        found = bytearray()
        for piece in _zstd_pieces(data) if head.compression == b"zstd" else _lz4_pieces(data):
            found += piece
            if len(found) > head.size:
                break
    if len(found) != head.size and not cut:
        raise ValueError(f"a chunk does not contain the {head.size} bytes that it claims")
    if head.crc and not cut and zlib.crc32(found) != head.crc:
        raise ValueError("a chunk's checksum is wrong")
    return found


def _zstd_pieces(data: bytes) -> Iterator[bytes]:
    reader = zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True)
    while piece := reader.read(_PIECE):
        yield piece


def _lz4_pieces(data: bytes) -> Iterator[bytes]:
    """All that can be decoded before a cut; in pieces, since incompressible data would take almost twice the memory."""
    reader = lz4.frame.LZ4FrameDecompressor()
    for begin in range(0, len(data), _PIECE):
        if reader.eof:
            return
        yield reader.decompress(data[begin : begin + _PIECE], max_length=_PIECE)
        while not (reader.needs_input or reader.eof):
            yield reader.decompress(b"", max_length=_PIECE)
