"""Where the records of an MCAP file's data section lie: their heads are read and doubted, their contents are not."""

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
_LARGE = 1 << 16  # bytes: a record of doubtful length is not read if it takes more
_WITH_LENGTHS = frozenset({Opcode.CHUNK, Opcode.MESSAGE_INDEX})  # they tell their length twice, _fault compares
_MESSAGE_INDEX = struct.Struct("<HI")
_PIECE = 1 << 16

Note = Callable[[int, str], None]


class Place(NamedTuple):
    """A record: where its head starts, the bytes after the head; whole: False for a chunk that the file's end cuts."""

    opcode: int
    offset: int
    length: int
    whole: bool = True

    @property
    def end(self) -> int:
        """Where the next one starts."""
        return self.offset + HEAD.size + self.length


def places(stream: BinaryIO, size: int, chunks: Sequence[int], closed: bool, note: Note) -> Iterator[Place]:
    """Records to read, in file order, up to and with the one that ends the data; damage is noted at its offset.

    chunks: where chunks are known to start, in order. There reading goes on after a record whose length cannot be
    believed; where nothing is known it ends. closed: does the file end as it should? Then a chunk that goes beyond the
    end was not cut off: bytes are missing in it, and what follows them would be read for something else.
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
            note(offset, f"damaged or cut off, {size - offset} bytes from there are lost in part")
            if place.opcode == Opcode.CHUNK and not closed and not _chunk_fault(stream, place):
                yield place._replace(whole=False)
            return
        is_chunk = passed > 0 and chunks[passed - 1] == offset
        fault = _fault(stream, place, is_chunk, following)
        sure = place.opcode in _WITH_LENGTHS or place.end in chunks[passed : passed + 1]
        believed = not fault and (sure or _begins_record(stream, place.end))
        if not believed:
            note(offset, fault or f"the record there or the one after it, at byte {place.end}, is damaged")
        if place.opcode in _READ and (believed or (not fault and place.length <= _LARGE)):
            yield place
        fits = place.end <= (following or size) and _begins_record(stream, place.end)
        offset = place.end if believed or fits else following
        if not offset:
            return
    note(size, "the file was not closed, what it holds is used")


def data_checksum_is_wrong(stream: BinaryIO, end: int) -> bool:
    """Does what stands before the record that ends the data, at end, have another checksum than it tells?"""
    stream.seek(end + HEAD.size)
    told = int.from_bytes(stream.read(4), "little")
    if told == 0:  # nobody computed one
        return False
    stream.seek(0)
    found = 0
    for begin in range(0, end, _PIECE):
        found = zlib.crc32(stream.read(min(_PIECE, end - begin)), found)
    return found != told


def _place(stream: BinaryIO, offset: int) -> Place:
    stream.seek(offset)
    opcode, length = HEAD.unpack(stream.read(HEAD.size).ljust(HEAD.size, b"\0"))
    return Place(opcode, offset, length)


def _fault(stream: BinaryIO, place: Place, is_chunk: bool, following: int) -> str:
    """Why a record that ends within the file cannot be one; empty if it can."""
    if following and place.end > following:
        return f"a record of {place.length} bytes reaches beyond byte {following}, where a chunk starts: skipped"
    if is_chunk and place.opcode != Opcode.CHUNK:
        return "a chunk should start there, it was skipped"
    if place.opcode == Opcode.CHUNK:
        return _chunk_fault(stream, place)
    if place.opcode == Opcode.MESSAGE_INDEX:
        return _index_fault(stream, place)
    if place.opcode in _READ | _SKIPPED or (place.opcode == Opcode.HEADER and place.offset == len(MAGIC)):
        return ""
    return f"a record of kind {place.opcode:#04x} has no place there, it was skipped"


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
    """A message index is passed over; but a chunk, its opcode damaged, must not pass for one."""
    stream.seek(place.offset + HEAD.size)
    content = stream.read(min(_MESSAGE_INDEX.size, place.length))
    if len(content) < _MESSAGE_INDEX.size or _MESSAGE_INDEX.unpack(content)[1] + len(content) != place.length:
        return "a message index contradicts its own length, the record was skipped"
    return ""


def _begins_record(stream: BinaryIO, offset: int) -> bool:
    stream.seek(offset)
    return is_head(stream.read(HEAD.size))
