# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Locate the records in an MCAP file's data section.

Their heads are validated, their contents are not read.
"""

from __future__ import annotations

import struct
import zlib
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode

from push_predictor.recordings.bag.mcap_records import CHUNK_HEAD_SIZE, HEAD, MAGIC, UNREADABLE, chunk_head, is_head

_ENDS = {(Opcode.DATA_END, 4), (Opcode.FOOTER, 20)}
_READ = frozenset({Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.METADATA})
_SKIPPED = frozenset({Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT})
_LARGE = 1 << 16  # bytes; a longer record with a doubtful length is not read
_WITH_LENGTHS = frozenset({Opcode.CHUNK, Opcode.MESSAGE_INDEX})  # contain their length twice, _fault compares them
_MESSAGE_INDEX = struct.Struct("<HI")
_PIECE = 1 << 16

Note = Callable[[int, str], None]


class Place(NamedTuple):
    """A record: offset of its head, length after the head.

    whole: False for a chunk cut by the end of the file.
    """

    opcode: int
    offset: int
    length: int
    whole: bool = True

    @property
    def end(self) -> int:
        """Offset of the next record."""
        return self.offset + HEAD.size + self.length


def places(stream: BinaryIO, size: int, chunks: Sequence[int], closed: bool, note: Note) -> Iterator[Place]:
    """Records to read, in file order, up to and including the end of the data.

    Damage is noted at its offset. chunks: known offsets of chunks, in order. After a record with an invalid length,
    reading continues at the next of them, and ends without one. closed: whether the file has a valid end. Then a chunk
    that extends beyond the end is not cut off; bytes within it are missing, and the data after them would be misread.
    """
    offset = len(MAGIC)
    while offset < size:
        place = _place(stream, offset)
        if (place.opcode, place.length) in _ENDS:
            yield place
            return
        passed = bisect_right(chunks, offset)
        following = next((place for place in chunks[passed : passed + 2] if _is_chunk(stream, place, size)), 0)
        if place.end > size and not following:
            note(offset, f"damaged or cut off; some of the {size - offset} bytes from there on are lost")
            if place.opcode == Opcode.CHUNK and not closed and not _chunk_fault(stream, place):
                yield place._replace(whole=False)
            return
        is_chunk = passed > 0 and chunks[passed - 1] == offset
        fault = _fault(stream, place, is_chunk, following)
        sure = place.opcode in _WITH_LENGTHS or place.end in chunks[passed : passed + 1]
        valid = not fault and (sure or _begins_record(stream, place.end))
        if not valid:
            note(offset, fault or f"the record there or the one after it, at byte {place.end}, is damaged")
        if place.opcode in _READ and (valid or (not fault and place.length <= _LARGE)):
            yield place
        fits = place.end <= (following or size) and _begins_record(stream, place.end)
        offset = place.end if valid or fits else following
        if not offset:
            return
    note(size, "the file was not closed; its contents are used")


def data_checksum_is_wrong(stream: BinaryIO, end: int) -> bool:
    """Whether the data before the data-end record, at offset `end`, have another checksum than it states."""
    stream.seek(end + HEAD.size)
    stated = int.from_bytes(stream.read(4), "little")
    if stated == 0:  # none was computed
        return False
    stream.seek(0)
    found = 0
    for begin in range(0, end, _PIECE):
        found = zlib.crc32(stream.read(min(_PIECE, end - begin)), found)
    return found != stated


def _place(stream: BinaryIO, offset: int) -> Place:
    stream.seek(offset)
    opcode, length = HEAD.unpack(stream.read(HEAD.size).ljust(HEAD.size, b"\0"))
    return Place(opcode, offset, length)


def _fault(stream: BinaryIO, place: Place, is_chunk: bool, following: int) -> str:
    """The fault of a record that ends within the file, empty without one."""
    if following and place.end > following:
        return f"a record of {place.length} bytes reaches beyond byte {following}, where a chunk starts; skipped"
    if is_chunk and place.opcode != Opcode.CHUNK:
        return "a chunk is expected there, the record was skipped"
    if place.opcode == Opcode.CHUNK:
        return _chunk_fault(stream, place)
    if place.opcode == Opcode.MESSAGE_INDEX:
        return _index_fault(stream, place)
    if place.opcode in _READ | _SKIPPED or (place.opcode == Opcode.HEADER and place.offset == len(MAGIC)):
        return ""
    return f"a record of kind {place.opcode:#04x} is not allowed there and was skipped"


def _is_chunk(stream: BinaryIO, offset: int, size: int) -> bool:
    place = _place(stream, offset) if offset < size else Place(0, offset, 0)
    return place.opcode == Opcode.CHUNK and place.end <= size and not _chunk_fault(stream, place)


def _chunk_fault(stream: BinaryIO, place: Place) -> str:
    stream.seek(place.offset + HEAD.size)
    try:
        chunk_head(stream.read(min(CHUNK_HEAD_SIZE, place.length)), place.length)
    except UNREADABLE as error:
        return f"a chunk was skipped: {error or type(error).__name__}"
    return ""


def _index_fault(stream: BinaryIO, place: Place) -> str:
    """Message indexes are skipped, but a chunk with a damaged opcode must not be taken for one."""
    stream.seek(place.offset + HEAD.size)
    content = stream.read(min(_MESSAGE_INDEX.size, place.length))
    if len(content) < _MESSAGE_INDEX.size or _MESSAGE_INDEX.unpack(content)[1] + len(content) != place.length:
        return "a message index contradicts its own length, the record was skipped"
    return ""


def _begins_record(stream: BinaryIO, offset: int) -> bool:
    stream.seek(offset)
    return is_head(stream.read(HEAD.size))
