# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The summary at the end of an MCAP file: its contents and their offsets.

Used only if valid and complete.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, MetadataIndex, Schema, Statistics

from push_predictor.recordings.bag.mcap_records import HEAD, LARGEST_CHUNK, MAGIC, parse, split

DATA_END_SIZE = HEAD.size + 4
_FOOTER = struct.Struct("<QQI")
FOOTER_SIZE = HEAD.size + _FOOTER.size + len(MAGIC)
_DATA_END = HEAD.pack(Opcode.DATA_END, 4)
_CHUNK_INDEX = struct.Struct("<QQQ")


@dataclass(frozen=True)
class Footer:
    """offset: of the footer; start: of the summary, 0 without one; crc: of the summary, 0 if not computed."""

    offset: int
    start: int
    crc: int
    head: bytes

    def check(self, summary: bytes) -> None:
        """Raises ValueError if the checksum is wrong."""
        if self.crc and zlib.crc32(self.head, zlib.crc32(summary)) != self.crc:
            raise ValueError("the summary's checksum is wrong")


@dataclass
class Summary:
    """chunks: their offsets. verified: the summary had a checksum and it was correct."""

    verified: bool
    schemas: list[Schema] = field(default_factory=list)
    channels: list[Channel] = field(default_factory=list)
    statistics: Statistics | None = None
    metadata: list[MetadataIndex] = field(default_factory=list)
    chunks: list[int] = field(default_factory=list)


def read_footer(stream: BinaryIO, size: int) -> Footer | None:
    """The last record of a file of `size` bytes, None if the end of the file is damaged or missing."""
    offset = size - FOOTER_SIZE
    stream.seek(max(offset, 0))
    tail = stream.read()
    if len(tail) != FOOTER_SIZE or not tail.endswith(MAGIC):
        return None
    if HEAD.unpack_from(tail) != (Opcode.FOOTER, _FOOTER.size):
        return None
    start, _, crc = _FOOTER.unpack_from(tail, HEAD.size)
    return Footer(offset, start, crc, tail[: HEAD.size + _FOOTER.size - 4])


def read_summary(stream: BinaryIO, footer: Footer, start: int) -> Summary:
    """The summary that starts at a byte. Raises one of UNREADABLE if it is missing or damaged."""
    if not DATA_END_SIZE < start <= footer.offset or footer.offset - start > LARGEST_CHUNK:
        raise ValueError("the footer places the summary outside the file")
    stream.seek(start - DATA_END_SIZE)
    if stream.read(DATA_END_SIZE)[: HEAD.size] != _DATA_END:
        raise ValueError("the summary is not where the footer places it")
    content = stream.read(footer.offset - start)
    footer.check(content)
    return _summary(content, bool(footer.crc))


def read_metadata(stream: BinaryIO, place: MetadataIndex, size: int) -> Metadata:
    """The record that an index points to. Raises one of UNREADABLE if it points elsewhere."""
    if place.offset + place.length > size:
        raise ValueError("the metadata index points outside the file")
    stream.seek(place.offset)
    opcode, length = HEAD.unpack(stream.read(HEAD.size))
    if opcode != Opcode.METADATA or HEAD.size + length != place.length:
        raise ValueError("the metadata index points to a place without a metadata record")
    record = parse(Metadata, stream.read(length), 0, length)
    if record.name != place.name:
        raise ValueError(f"a metadata record is named {record.name!r}, but {place.name!r} in the index")
    return record


def _summary(content: bytes, verified: bool) -> Summary:
    found = Summary(verified)
    for opcode, start, end in split(content):
        if opcode == Opcode.STATISTICS:
            found.statistics = parse(Statistics, content, start, end)
        elif opcode == Opcode.METADATA_INDEX:
            found.metadata.append(parse(MetadataIndex, content, start, end))
        elif opcode == Opcode.SCHEMA:
            found.schemas.append(parse(Schema, content, start, end))
        elif opcode == Opcode.CHANNEL:
            found.channels.append(parse(Channel, content, start, end))
        elif opcode == Opcode.CHUNK_INDEX:
            found.chunks.append(_CHUNK_INDEX.unpack_from(content, start)[2])
    found.chunks.sort()
    return found
