# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One MCAP file as raw messages in file order; damage becomes notes."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Collection, Iterator
from itertools import zip_longest
from pathlib import Path
from typing import BinaryIO, TypeAlias

import numpy as np
from mcap.opcode import Opcode
from mcap.records import MetadataIndex

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.mcap_descriptions import Descriptions, Wanted
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
from push_predictor.recordings.bag.messages import Messages, RawMessage, gathered

_Found: TypeAlias = "array[int]"  # of each message: channel, log time, first byte, byte after the last
_NUMBERS = 4
MOST_NOTES = 50  # a file can have a million damaged records


class McapFile:
    """The topics, metadata records and messages of one file.

    topics: {topic: type}; schemas: {type: definition text}; qos: {topic: offered QoS as YAML text, '' if
    unknown}; metadata: {record name: {key: value}}; notes: damage found so far, with file and byte offset
    (opening reads the summary, messages() the rest). unpack decompresses a single message to CDR and raises one of
    UNREADABLE if it cannot; name: of the file in notes, by default its path.

    Raises RecordingError for a file that is empty or not MCAP.
    """

    def __init__(self, path: Path, *, unpack: Callable[[bytes], bytes] | None = None, name: str = "") -> None:
        self.path = path
        self._descriptions = descriptions = Descriptions(self._note)
        self.topics, self.schemas = descriptions.topics, descriptions.schemas
        self.qos, self.metadata = descriptions.qos, descriptions.metadata
        self.notes: list[str] = []
        self._name = name or str(path)
        self._unpack = unpack
        self._listed: int | None = None  # number of messages in the summary
        self._chunks: list[int] = []  # their offsets, if verified by a checksum
        self._end_checked = False
        self._size = _checked_size(path, self._name)
        self._footer: Footer | None = None
        if not self._read_end():
            for _ in self.messages(topics=()):
                pass

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """CDR messages in file order, of all topics or of the given ones; damage becomes a note.

        One chunk at a time is in memory.
        """
        for content, found, wanted, _ in self._contents(topics):
            view = memoryview(content)
            for k in range(0, len(found), _NUMBERS):
                channel, time, start, end = found[k : k + _NUMBERS]
                yield RawMessage(*wanted[channel], time, view[start:end].tobytes())
            del view, content, found  # before the next chunk is read

    def portions(self, topics: Collection[str]) -> Iterator[Messages]:
        """The same of the given topics, a portion for each topic of a chunk."""
        single: list[RawMessage] = []
        for content, found, wanted, is_chunk in self._contents(topics):
            rows = np.array(found).astype(np.int64).reshape(-1, _NUMBERS)
            if not is_chunk:  # a portion of one message would be slow
                single += [RawMessage(*wanted[c], time, bytes(content[a:b])) for c, time, a, b in rows.tolist()]
                continue
            yield from gathered(single)
            single = []
            for of in dict.fromkeys(wanted[channel] for channel in np.unique(rows[:, 0]).tolist()):
                own = [channel for channel, other in wanted.items() if other == of]
                _, time, start, end = rows[np.isin(rows[:, 0], own)].T
                # Copied: a chunk may be mostly of other topics, such as a camera's.
                parts = [bytes(content[a:b]) for a, b in zip(start.tolist(), end.tolist(), strict=True)]
                yield Messages.of(*of, time, parts)
        yield from gathered(single)

    def _contents(self, topics: Collection[str] | None) -> Iterator[tuple[Bytes, _Found, Wanted, bool]]:
        """Consecutive records, the wanted messages among them, of which channels, and whether they are a chunk."""
        wanted = self._descriptions.wanted(topics, self._descriptions.channels.values())
        seen = 0
        chunks: list[int] = []
        with self.path.open("rb") as stream:
            for place in places(stream, self._size, self._chunks, self._footer is not None, self._note):
                if place.opcode in (Opcode.DATA_END, Opcode.FOOTER):
                    self._check_end(stream, place, chunks)
                    break
                if place.opcode == Opcode.CHUNK:
                    chunks.append(place.offset)
                content = self._content(stream, place)
                found, count = self._found(content, place, topics, wanted)
                seen += count
                if self._unpack is not None:
                    content, found = self._unpacked(content, found, place)
                yield content, found, wanted, place.opcode == Opcode.CHUNK
                del content, found
        if self._listed not in (None, seen):
            self._note(self._size, f"{seen} messages were found, the summary lists {self._listed}")

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

    def _found(
        self, content: Bytes, place: Place, topics: Collection[str] | None, wanted: Wanted
    ) -> tuple[_Found, int]:
        """The wanted messages among consecutive records, and the number of all messages.

        The channels, schemas and metadata among the records are stored.
        """
        seen, found, unwanted = 0, array("Q"), set[int]()
        try:
            for opcode, start, end in split(content, place.whole):
                if opcode == Opcode.MESSAGE:
                    if start + MESSAGE.size > end:
                        raise ValueError(f"a message has {end - start} bytes, its header alone needs {MESSAGE.size}")
                    seen += 1
                    number, _, log_time, _ = MESSAGE.unpack_from(content, start)
                    if number in wanted:
                        found.extend((number, log_time, start + MESSAGE.size, end))
                    else:
                        unwanted.add(number)
                elif channel := self._descriptions.register(opcode, content, start, end, place.offset):
                    wanted.update(self._descriptions.wanted(topics, [channel]))
        except UNREADABLE as error:
            self._note(place.offset, f"a record cannot be read ({error or type(error).__name__})")
        for number in sorted(unwanted):
            self._check_unwanted(number, topics, place.offset)
        return found, seen

    def _unpacked(self, content: Bytes, found: _Found, place: Place) -> tuple[Bytes, _Found]:
        """The same with the messages decompressed."""
        assert self._unpack is not None
        unpacked, where, undone = bytearray(), array("Q"), 0
        for k in range(0, len(found), _NUMBERS):
            channel, time, start, end = found[k : k + _NUMBERS]
            try:
                data = self._unpack(bytes(content[start:end]))
            except UNREADABLE:
                undone += 1
            else:
                where.extend((channel, time, len(unpacked), len(unpacked) + len(data)))
                unpacked += data
        if undone:
            self._note(place.offset, f"{undone} messages cannot be decompressed and were skipped")
        return unpacked, where

    def _check_unwanted(self, channel: int, topics: Collection[str] | None, offset: int) -> None:
        """Note a message that is wanted but cannot be decoded; others are ignored."""
        if (known := self._descriptions.channels.get(channel)) is None:
            self._note(offset, f"channel {channel} has no description; its messages were skipped")
        elif topics and known.topic in topics:
            self._note(offset, f"{known.topic} is encoded as {known.message_encoding!r}, cdr is accepted")

    def _read_end(self) -> bool:
        """Read topics and metadata from the summary. False if it is absent, damaged or incomplete."""
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
                self._note(footer.start or footer.offset, f"{error or type(error).__name__}; the whole file is read")
                return False

    def _use(self, stream: BinaryIO, summary: Summary) -> bool:
        """Store a summary's descriptions; returns whether they are complete."""
        if (statistics := summary.statistics) is not None:
            self._listed = statistics.message_count
        if statistics is None or not summary.verified:  # the descriptions before the data are at least as good
            return False
        self._chunks = summary.chunks
        for schema in summary.schemas:
            self._descriptions.add_schema(schema)
        for channel in summary.channels:
            self._descriptions.add_channel(channel, self._size)
        read = sum(self._use_metadata(stream, place) for place in summary.metadata)
        complete = statistics.channel_count == len(self._descriptions.channels)
        return bool(complete and statistics.metadata_count == read)

    def _use_metadata(self, stream: BinaryIO, place: MetadataIndex) -> bool:
        try:
            record = read_metadata(stream, place, self._size)
        except UNREADABLE as error:
            self._note(place.offset, f"{error or type(error).__name__}; a metadata record is expected there")
            return False
        self.metadata[record.name] = record.metadata
        return True

    def _check_end(self, stream: BinaryIO, place: Place, chunks: list[int]) -> None:
        """At the end of the data, compare them with their checksum and with the summary."""
        if self._end_checked or place.opcode != Opcode.DATA_END:
            return
        end = place.offset
        self._end_checked = True
        if data_checksum_is_wrong(stream, end):
            self._note(end, "the checksum of the data is wrong; they are damaged somewhere before it")
        if self._footer is None or self._footer.start in (0, end + DATA_END_SIZE):
            return
        try:  # bytes were lost or inserted; the summary still lists the offsets of the chunks
            listed = read_summary(stream, self._footer, end + DATA_END_SIZE).chunks
        except UNREADABLE:
            return
        if moved := [place for place, found in zip_longest(listed, chunks) if place != found]:
            there = f"{len(chunks)} chunks were found, the summary lists {len(listed)}"
            self._note(moved[0] or self._size, f"a chunk is missing or has moved; {there}")

    def _note(self, offset: int, what: str) -> None:
        text = f"{self._name} at byte {offset}: {what}"
        if len(self.notes) >= MOST_NOTES:
            text = f"{self._name}: further damage is not listed"
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
        accepted = "MCAP, sqlite3 and ROS 1 recordings are accepted"
        raise RecordingError(f"{name}: not an MCAP file (starts with {start[:8]!r}), {accepted}")
    return path.stat().st_size
