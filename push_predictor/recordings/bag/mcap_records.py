# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Records and chunks of MCAP (https://mcap.dev/spec) that may be damaged: their contents, and where chunks begin.

Little-endian records of one byte opcode, eight bytes length, content; a chunk holds compressed records.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import BinaryIO, Final, NamedTuple, Protocol, TypeVar

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
LARGEST_CHUNK: Final = 1 << 30  # bytes uncompressed; a foreign file must not exhaust the memory
UNREADABLE = (struct.error, UnicodeDecodeError, McapError, zstandard.ZstdError, RuntimeError, ValueError)
_CHUNK = struct.Struct("<BQQQQII")  # up to the length of the compression's name
_KINDS = frozenset(Opcode)
_COMPRESSIONS = (b"", b"zstd", b"lz4")
_CHUNK_HEAD_SIZE = _CHUNK.size + 4 + 8  # up to the compressed records
_BEGIN = re.compile(rb"\x06.{6}\x00{2}.{28}(?:\x04\x00{3}zstd|\x03\x00{3}lz4|\x00{4})", re.DOTALL)
_PIECE: Final = 1 << 15
_SEARCHED: Final = 1 << 16

Record = TypeVar("Record", covariant=True)


class _Readable(Protocol[Record]):
    def read(self, stream: ReadDataStream, /) -> Record: ...


class _Content(BytesIO):
    """A record's content; a string or number that is longer than its record is an error, not a short read."""

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        if size is not None and len(data) < size:
            raise EndOfFile
        return data


class ChunkHead(NamedTuple):
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


def parse(kind: _Readable[Record], content: bytes | bytearray) -> Record:
    """One record's content as the mcap package's class. Raises one of UNREADABLE."""
    return kind.read(ReadDataStream(_Content(content)))


def read_at(stream: BinaryIO, offset: int, size: int) -> bytes:
    """At most `size` bytes from an offset on."""
    stream.seek(offset)
    return stream.read(size)


def is_head(head: bytes) -> bool:
    """Whether these bytes can begin a record.

    Random bytes hardly ever do; a head cut by the end of the file does.
    """
    if len(head) < HEAD.size:
        return True
    opcode, length = HEAD.unpack(head)
    return bool((opcode in _KINDS or opcode >= 0x80) and length < 4 * LARGEST_CHUNK)


def chunk_head(stream: BinaryIO, offset: int) -> ChunkHead:
    """The fields of the chunk at an offset.

    Raises one of UNREADABLE if its lengths contradict each other or are more than is accepted.
    """
    start = read_at(stream, offset, _CHUNK_HEAD_SIZE)
    _, length, first, last, size, crc, name_length = _CHUNK.unpack_from(start)
    compression = start[_CHUNK.size : _CHUNK.size + min(name_length, _CHUNK_HEAD_SIZE)]
    if compression not in _COMPRESSIONS or len(compression) != name_length:
        raise ValueError(f"chunk compression {compression!r}, zstd, lz4 and none are accepted")
    begin = offset + _CHUNK.size + name_length + 8
    (packed,) = struct.unpack_from("<Q", start, _CHUNK.size + name_length)
    end = offset + HEAD.size + length
    if begin + packed != end:
        raise ValueError(f"a chunk of {length} bytes claims {packed} bytes of records")
    if size > LARGEST_CHUNK:
        raise ValueError(f"a chunk of {size} bytes, {LARGEST_CHUNK} are accepted")
    if packed > size + size // 64 + 4096:
        raise ValueError(f"a chunk of {size} bytes claims {packed} compressed bytes")
    return ChunkHead(end, begin, packed, size, crc, compression, 1e-9 * (last - first))


def next_chunk(stream: BinaryIO, offset: int) -> int | None:
    """The first offset, from a given one on, at which the fields of a chunk agree; None without one."""
    size = stream.seek(0, 2)
    while offset < size:
        piece = read_at(stream, offset, _SEARCHED)
        for found in _BEGIN.finditer(piece):
            try:
                chunk_head(stream, offset + found.start())
            except UNREADABLE:
                continue
            return offset + found.start()
        offset += _SEARCHED - _CHUNK_HEAD_SIZE
    return None


def unpack_chunk(stream: BinaryIO, head: ChunkHead) -> bytes | bytearray:
    """The decompressed records of a chunk; of one that is cut off by the end of the file the first ones.

    Memory is limited to the compressed bytes and the size that the head states. Raises one of UNREADABLE for a wrong
    size or a wrong checksum.
    """
    present = min(head.packed, stream.seek(0, 2) - head.begin)
    data, cut = read_at(stream, head.begin, present), present < head.packed
    found = data if head.compression == b"" else _unpacked(head, data, cut)
    if len(found) != head.size and not cut:
        raise ValueError(f"a chunk does not contain the {head.size} bytes that it claims")
    if head.crc and not cut and zlib.crc32(found) != head.crc:
        raise ValueError("a chunk's checksum is wrong")
    return found


def _unpacked(head: ChunkHead, data: bytes, cut: bool) -> bytes | bytearray:
    """The decompressed bytes, at most one piece more than the head states."""
    if head.compression == b"zstd" and not cut and zstandard.frame_content_size(data) == head.size:
        return zstandard.ZstdDecompressor().decompress(data)  # libzstd's stream takes a window of twice a chunk
    found = bytearray()
    for piece in _zstd_pieces(data) if head.compression == b"zstd" else _lz4_pieces(data):
        found += piece
        if len(found) > head.size:
            break
    return found


def _zstd_pieces(data: bytes) -> Iterator[bytes]:
    reader = zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True)
    while piece := reader.read(_PIECE):
        yield piece


def _lz4_pieces(data: bytes) -> Iterator[bytes]:
    """In pieces: incompressible data would take almost twice the memory."""
    reader = lz4.frame.LZ4FrameDecompressor()
    for begin in range(0, len(data), _PIECE):
        if reader.eof:
            return
        yield reader.decompress(data[begin : begin + _PIECE], max_length=_PIECE)
        while not (reader.needs_input or reader.eof):
            yield reader.decompress(b"", max_length=_PIECE)
